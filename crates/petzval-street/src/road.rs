//! The ground: carriageway, marks, kerbs and pavements, along a street that may bend.

use crate::colour::{Rgb, blend, scaled};
use crate::noise::{cell, cells2, fractal2, value2};
use crate::surface::Surface;
use crate::texture::smooth;
use crate::vector::{Vec3, vec3};

/// A street that crosses this one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    /// Its middle along the street, m.
    pub z: f64,
    /// Half the width of its carriageway, m.
    pub half_m: f64,
}

/// A line of paint along the street.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneLine {
    /// Its middle, m from the street's axis.
    pub x: f64,
    pub width_m: f64,
    /// Length of a dash and of the gap behind it, m; a gap of zero for a solid line.
    pub dash_m: [f64; 2],
}

/// The ground of a street. Its axis bends as `x = bend z^2 / 2`.
#[derive(Clone, Debug)]
pub(crate) struct Road {
    pub bend_per_m: f64,
    /// Half the width of the carriageway, m.
    pub half_m: f64,
    pub kerb_m: f64,
    pub crossings: Vec<Crossing>,
    pub lines: Vec<LaneLine>,
    /// Zebra crossings: first and last place along the street, m.
    pub zebras: Vec<[f64; 2]>,
    /// Stop lines: place along the street, and from where to where across it, m.
    pub stops: Vec<[f64; 3]>,
    /// Reflectance of the asphalt, of the pavement, and of paint.
    pub asphalt: Rgb,
    pub slabs: Rgb,
    pub paint: Rgb,
    /// Length of a slab of the pavement, m.
    pub slab_m: f64,
    /// How wet the road is, 0..1.
    pub wet: f32,
    pub seed: u32,
}

/// What the ground is at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum GroundFace {
    Carriageway,
    Pavement,
    Kerb,
}

impl Road {
    /// The street's axis at `z`, m.
    pub fn axis(&self, z: f64) -> f64 {
        0.5 * self.bend_per_m * z * z
    }

    /// The direction of the street at `z`, rad to the right.
    pub fn heading(&self, z: f64) -> f64 {
        (self.bend_per_m * z).atan()
    }

    /// The place in the world of a place along the street.
    pub fn place(&self, across: f64, up: f64, z: f64) -> Vec3 {
        vec3(self.axis(z) + across, up, z)
    }

    #[inline]
    fn on_carriageway(&self, x: f64, z: f64) -> bool {
        let across = x - self.axis(z);
        across.abs() < self.half_m || self.crossings.iter().any(|c| (z - c.z).abs() < c.half_m)
    }

    /// Where a ray from above meets the ground.
    #[inline]
    pub fn enter(&self, o: Vec3, d: Vec3) -> Option<(f64, GroundFace)> {
        if d.y >= -1e-9 || o.y <= self.kerb_m {
            return None;
        }
        // First meet the plane of the pavement; where that is carriageway, go on to the road below.
        let mut above = (self.kerb_m - o.y) / d.y;
        let p = o + d * above;
        if !self.on_carriageway(p.x, p.z) {
            return Some((above, GroundFace::Pavement));
        }
        let mut below = -o.y / d.y;
        let p = o + d * below;
        if self.on_carriageway(p.x, p.z) {
            return Some((below, GroundFace::Carriageway));
        }
        // The ray passes the kerb between the two planes.
        for _ in 0..8 {
            let middle = 0.5 * (above + below);
            let p = o + d * middle;
            if self.on_carriageway(p.x, p.z) { above = middle } else { below = middle }
        }
        Some((below, GroundFace::Kerb))
    }

    /// The ground's surface and normal at a place; `footprint_m` is the width of a pixel across the ray.
    pub fn surface(&self, p: Vec3, face: GroundFace, footprint_m: f64) -> (Surface, Vec3) {
        let across = p.x - self.axis(p.z);
        let matte = |albedo: Rgb| Surface { albedo, gloss: 0.0, emission: [0.0; 3] };
        let up = vec3(0.0, 1.0, 0.0);
        match face {
            GroundFace::Kerb => {
                let stone = (p.z / 0.9).floor() as i32;
                let tone = 0.8 + 0.4 * cell(stone, 1, self.seed);
                (matte(scaled(self.slabs, tone)), vec3(-across.signum(), 0.3, 0.0).unit())
            }
            GroundFace::Pavement => (matte(self.pavement(across, p.z, footprint_m)), up),
            GroundFace::Carriageway => (self.carriageway(across, p, footprint_m), up),
        }
    }

    fn pavement(&self, across: f64, z: f64, footprint_m: f64) -> Rgb {
        // The kerbstone is a band of its own.
        let kerb = across.abs() - self.half_m < 0.18;
        let size = if kerb { 0.9 } else { self.slab_m };
        let (row, column) = ((z / size).floor(), (across / size).floor());
        let joint = (z - row * size).min(if kerb { 1.0 } else { across - column * size }) < 0.014;
        let seen = (0.5 * size / footprint_m.max(1e-6)).min(1.0) as f32;
        let tone = 0.85 + 0.3 * cell(row as i32, if kerb { 9999 } else { column as i32 }, self.seed);
        let tone = 1.0 + (tone * if joint { 0.6 } else { 1.0 } - 1.0) * seen;
        let stain = 0.65 + 0.7 * fractal2(0.5 * across, 0.5 * z, 4, self.seed ^ 4);
        let grain = 0.85 + 0.3 * fractal2(23.0 * across, 23.0 * z, 2, self.seed ^ 6);
        scaled(self.slabs, tone * stain * grain)
    }

    fn carriageway(&self, across: f64, p: Vec3, footprint_m: f64) -> Surface {
        let z = p.z;
        let coarse = fractal2(0.23 * p.x, 0.11 * z, 4, self.seed);
        let grain_seen = (0.05 / footprint_m.max(1e-6)).min(1.0) as f32;
        let grain = 1.0
            + (value2(34.0 * p.x, 34.0 * z, self.seed ^ 1) + value2(71.0 * p.x, 71.0 * z, self.seed ^ 2)
                - 1.0)
                * 0.5
                * grain_seen;
        let mut tone = (0.62 + 0.76 * coarse) * grain;
        // Repaired patches have straight edges and another tone.
        let patch = ((0.21 * across + 0.13 * (0.1 * z).sin()).floor() as i32, (z / 11.0).floor() as i32);
        if cell(patch.0, patch.1, self.seed ^ 8) < 0.16 {
            tone *= 0.72 + 0.5 * cell(patch.0, patch.1, self.seed ^ 9);
        }
        // Wheels polish and darken two tracks of each lane.
        let track = (f64::from(value2(0.05 * z, 1.0, self.seed)) + 0.62 * across).rem_euclid(1.0) - 0.5;
        tone *= 1.0 - 0.14 * (1.0 - (4.0 * track.abs()).min(1.0)) as f32;
        // Cracks, sealed with tar.
        let cracked = smooth(0.5, 0.7, value2(0.12 * p.x, 0.07 * z, self.seed ^ 12));
        if footprint_m < 0.05 && cracked > 0.0 {
            let wander = 0.35 * f64::from(fractal2(1.1 * p.x, 1.1 * z, 3, self.seed ^ 10));
            let (_, edge) = cells2(0.42 * p.x + wander, 0.3 * z + wander, self.seed ^ 11);
            let width = 0.02 * value2(3.0 * p.x, 3.0 * z, self.seed ^ 17);
            if edge < width * cracked {
                tone *= 0.6;
            }
        }
        let mut albedo = scaled(self.asphalt, tone);
        // A manhole here and there.
        let (mx, mz) = ((across / 3.1).floor(), (z / 17.0).floor());
        if cell(mx as i32, mz as i32, self.seed ^ 13) < 0.2 {
            let shift = f64::from(cell(mx as i32, mz as i32, self.seed ^ 14));
            let (dx, dz) = (across - (mx + 0.5) * 3.1, z - (mz + 0.2 + 0.6 * shift) * 17.0);
            let radius = dx.hypot(dz);
            if radius < 0.34 {
                albedo = if radius > 0.29 { [0.03; 3] } else { scaled([0.09, 0.08, 0.075], tone) };
            }
        }
        let share = if self.painted(across, z) {
            0.25 + 0.75 * smooth(0.25, 0.5, fractal2(1.9 * p.x, 1.3 * z, 3, self.seed ^ 15))
        } else {
            0.0
        };
        let albedo = blend(albedo, scaled(self.paint, 0.8 + 0.2 * grain), share);
        // Water fills the hollows first.
        let wet = match self.wet {
            0.0 => 0.0,
            wet => {
                let height = fractal2(0.4 * p.x, 0.3 * z, 3, self.seed ^ 16);
                wet * smooth(0.75 - 0.6 * wet, 0.95 - 0.6 * wet, height)
            }
        };
        Surface { albedo: scaled(albedo, 1.0 - 0.45 * wet), gloss: 0.004 + 0.03 * wet, emission: [0.0; 3] }
    }

    /// Whether a place of the carriageway bears paint.
    fn painted(&self, across: f64, z: f64) -> bool {
        let in_crossing = self.crossings.iter().any(|c| (z - c.z).abs() < c.half_m + 4.5);
        if across.abs() > self.half_m {
            return false;
        }
        let stops =
            self.stops.iter().any(|&[at, from, to]| (z - at).abs() < 0.22 && across > from && across < to);
        let zebra = self.zebras.iter().any(|&[from, to]| {
            z > from && z < to && across.abs() < self.half_m - 0.3 && across.rem_euclid(1.0) < 0.5
        });
        let lines = self.lines.iter().any(|line| {
            let [dash, gap] = line.dash_m;
            (across - line.x).abs() < 0.5 * line.width_m && z.rem_euclid(dash + gap) < dash
        });
        let near_zebra = self.zebras.iter().any(|&[from, to]| z > from - 1.5 && z < to + 1.5);
        stops || zebra || (lines && !in_crossing && !near_zebra)
    }
}
