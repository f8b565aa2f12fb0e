//! What surfaces are made of: reflectance, gloss and light of their own at each place.

use std::sync::Arc;

use crate::colour::{Rgb, blend, scaled};
use crate::facade::Facade;
use crate::noise::{fractal2, hash, unit, value2, value3};
use crate::shape::Shape;
use crate::surface::{Place, Surface};
use crate::texture::{Texture, smooth};
use crate::vector::{Vec3, vec3};

/// What a part is made of.
#[derive(Clone, Debug)]
pub(crate) enum Material {
    /// One reflectance with slight blotches; `gloss` is the reflectance of its varnish at square incidence, 0..1.
    Plain { albedo: Rgb, gloss: f32 },
    /// A pattern around the upright axis.
    Textured(Texture),
    /// The painted body of a vehicle.
    Paint(Paint),
    /// The upper body of a vehicle: panes between painted pillars.
    Cabin { paint: Paint, pillar_m: f64, middle_pillar_m: Option<f64>, inside: f32 },
    /// A tyre around a rim, seen along the axis of a cylinder.
    Wheel { rim: Rgb, rim_share: f64, spokes: u32 },
    /// A lamp: its luminance when lit (cd/m^2), its reflectance, and which part of its face shines.
    Lamp { lit: Rgb, dark: Rgb, face: LampFace },
    /// Leaves with gaps; `density` 0..1 is the share that is not a gap.
    Leaves { albedo: Rgb, density: f32, size_m: f64, seed: u32 },
    /// Bark.
    Bark { albedo: Rgb, seed: u32 },
    /// The wall of a house.
    Facade(Arc<Facade>),
    /// A board with a coloured disc, ring or bar.
    Sign { ground: Rgb, figure: Rgb, kind: u32 },
}

/// Paint of a vehicle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Paint {
    pub albedo: Rgb,
    /// Reflectance of the lowest part.
    pub skirt: Rgb,
    /// Height to which the lowest part reaches, m.
    pub skirt_m: f64,
    /// Places of door seams along the vehicle, m.
    pub seams_m: [f64; 3],
    /// Height of the dirt, m.
    pub dirt_m: f64,
    pub lamps: Option<CarLamps>,
    pub seed: u32,
}

/// Lamps that lie flush in the body of a car.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CarLamps {
    /// Half the length of the car, m.
    pub half_m: f64,
    /// Head and tail lamps: `[inner, outer]` edge from the middle and `[lower, upper]` edge, m.
    pub head: [f64; 4],
    pub tail: [f64; 4],
    /// How far the outer end of the head lamps is raised, m.
    pub raised_m: f64,
    /// Luminance when lit, cd/m^2.
    pub head_lit: Rgb,
    pub tail_lit: Rgb,
}

impl CarLamps {
    /// The lamp at a place of the body.
    fn surface(&self, place: &Place<'_>, seed: u32) -> Option<Surface> {
        let p = place.object;
        let front = p.z > 0.0;
        if p.z.abs() < self.half_m - 0.42 || place.normal.y > 0.9 {
            return None;
        }
        let [inner, outer, low, high] = if front { self.head } else { self.tail };
        let across = (p.x.abs() - inner) / (outer - inner);
        let raised = if front { self.raised_m * across } else { 0.0 };
        let up = (p.y - raised - low) / (high - low);
        // The inner end of a head lamp is pointed.
        let point = if front { 0.5 * (1.0 - across / 0.6).max(0.0) } else { 0.0 };
        if !(0.0..1.0).contains(&across) || up < point || up > 1.0 - 0.3 * point {
            return None;
        }
        let facets = value2(38.0 * p.x, 50.0 * p.y, seed);
        if !front {
            // One part of a tail lamp is clear, the others red; the red ones shine.
            let clear = up < 0.3 && high - low > 0.12;
            let dark = if clear { [0.4, 0.3, 0.28] } else { scaled([0.25, 0.012, 0.01], 0.6 + 0.8 * facets) };
            let share = if clear { 0.02 } else { 0.7 + 0.6 * facets };
            return Some(Surface { albedo: dark, gloss: 0.06, emission: scaled(self.tail_lit, share) });
        }
        // The beam leaves through one or two small openings.
        let (x, y) = ((across - 0.58) * (outer - inner), (up - 0.5) * (high - low));
        let core = x.hypot(y) < 0.36 * (high - low);
        let along = (-place.ray.z).max(0.0) as f32;
        let beam = (along.powi(24) + 0.004) * if core { 1.0 } else { 0.015 };
        let dark = if core { [0.5; 3] } else { scaled([0.3, 0.31, 0.33], 0.25 + 1.1 * facets) };
        Some(Surface { albedo: dark, gloss: 0.07, emission: scaled(self.head_lit, beam) })
    }
}

/// Which part of a lamp's face shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LampFace {
    /// All of it, a little brighter in the middle.
    Full,
    /// An arrow, turned by an angle in rad from upward to the right.
    Arrow(f64),
    /// A standing or walking figure.
    Figure { walking: bool },
    /// All of it, but only within a beam along the part's own z axis.
    Beam,
}

impl Material {
    /// Whether a ray passes through a gap at a point in the world. `facing` is the cosine between the ray and the surface, 0..1:
    /// towards the rim of a crown its leaves thin out, so that no outline is smooth.
    #[inline]
    pub fn gap(&self, world: Vec3, facing: f64) -> bool {
        match self {
            Self::Leaves { density, size_m, seed, .. } => {
                let p = world * (1.0 / size_m);
                let clump = value3(0.19 * p.x, 0.19 * p.y, 0.19 * p.z, *seed);
                let leaf = value3(p.x, p.y, p.z, seed ^ 9);
                let thin = smooth(0.0, 0.75, facing as f32);
                0.4 * clump + 0.6 * leaf > (0.25 + 0.5 * density) * (0.5 + 0.5 * thin)
            }
            _ => false,
        }
    }

    /// Whether rays can pass through parts of it.
    #[inline]
    pub fn has_gaps(&self) -> bool {
        matches!(self, Self::Leaves { .. })
    }

    /// Radius to which edges are rounded for shading, m.
    pub fn rounding_m(&self) -> f64 {
        match self {
            Self::Paint(_) => 0.12,
            Self::Cabin { .. } => 0.06,
            _ => 0.0,
        }
    }

    /// The surface at a place.
    pub fn surface(&self, place: &Place<'_>) -> Surface {
        let rough = |albedo: Rgb| Surface { albedo, gloss: 0.0, emission: [0.0; 3] };
        let object = place.object;
        match self {
            Self::Plain { albedo, gloss } => {
                let blotch = 0.85 + 0.3 * value3(9.0 * object.x, 9.0 * object.y, 9.0 * object.z, 3);
                Surface { gloss: *gloss, ..rough(scaled(*albedo, blotch)) }
            }
            Self::Textured(texture) => {
                let around = if place.normal.z.abs() > place.normal.x.abs() { object.x } else { object.z };
                let up = if place.normal.y.abs() > 0.8 { object.z } else { object.y };
                rough(texture.at(around, up, place.footprint_m))
            }
            Self::Paint(paint) => paint.surface(place),
            Self::Cabin { paint, pillar_m, middle_pillar_m, inside } => {
                cabin(place, paint, *pillar_m, *middle_pillar_m, *inside)
            }
            Self::Wheel { rim, rim_share, spokes } => wheel(place, *rim, *rim_share, *spokes),
            Self::Lamp { lit, dark, face } => lamp(place, *lit, *dark, *face),
            Self::Leaves { albedo, seed, size_m, .. } => {
                let p = place.world * (0.8 / size_m);
                let tone = 0.45 + 1.1 * value3(p.x, p.y, p.z, seed ^ 21);
                rough(scaled(*albedo, tone))
            }
            Self::Bark { albedo, seed } => {
                let ridges = fractal2(14.0 * (object.x + object.z), 3.0 * object.y, 3, *seed);
                rough(scaled(*albedo, 0.5 + ridges))
            }
            Self::Facade(facade) => facade.surface(place),
            Self::Sign { ground, figure, kind } => rough(sign(place, *ground, *figure, *kind)),
        }
    }
}

impl Paint {
    fn surface(&self, place: &Place<'_>) -> Surface {
        let p = place.object;
        if let Some(lamp) = self.lamps.and_then(|lamps| lamps.surface(place, self.seed)) {
            return lamp;
        }
        let seam = place.normal.x.abs() > 0.7
            && p.y < 1.2
            && self.seams_m.iter().any(|z| (p.z - z).abs() < 0.012 + 0.3 * place.footprint_m);
        let mut albedo = self.albedo;
        if seam {
            albedo = scaled(albedo, 0.45);
        }
        // Dirt gathers low down and behind the wheels.
        let dirt = fractal2(3.0 * p.z, 3.0 * p.y, 2, self.seed) * smooth(self.dirt_m as f32, 0.0, p.y as f32);
        albedo = blend(albedo, [0.16, 0.14, 0.11], 0.8 * dirt);
        if p.y < self.skirt_m {
            return Surface { albedo: self.skirt, gloss: 0.01, emission: [0.0; 3] };
        }
        Surface { albedo, gloss: 0.05 * (1.0 - dirt), emission: [0.0; 3] }
    }
}

/// A pane where the face is steep and its edge is far enough, else paint.
fn cabin(place: &Place<'_>, paint: &Paint, pillar_m: f64, middle: Option<f64>, inside: f32) -> Surface {
    let p = place.object;
    let side = place.normal.x.abs() > 0.7;
    let steep = place.normal.y < 0.86 && place.normal.y > -0.5;
    let pillar = side && middle.is_some_and(|z| (p.z - z).abs() < 0.6 * pillar_m);
    if !steep || pillar || place.edge(pillar_m).0 < pillar_m {
        return paint.surface(place);
    }
    // Seats and people show dimly behind the pane; their place shifts with the direction of sight.
    let deep = p + place.ray * 0.5;
    let across = if side { deep.z } else { deep.x };
    let seat = value2(3.1 * across, 4.0 * deep.y, paint.seed);
    let dim = 0.012 + inside * smooth(0.45, 0.7, seat);
    Surface { albedo: [dim, dim, 1.05 * dim], gloss: 0.07, emission: [0.0; 3] }
}

/// A rim with spokes in a tyre, by the distance from the axis (y) of a cylinder of radius one.
fn wheel(place: &Place<'_>, rim: Rgb, rim_share: f64, spokes: u32) -> Surface {
    let rubber = Surface { albedo: [0.025; 3], gloss: 0.005, emission: [0.0; 3] };
    let radius = place.own.x.hypot(place.own.z);
    if place.face == 0 || radius > rim_share {
        return rubber;
    }
    let turn = place.own.z.atan2(place.own.x) / std::f64::consts::TAU * f64::from(spokes);
    let share = radius / rim_share;
    let open = (turn - turn.floor() - 0.5).abs() < 0.28 && share > 0.3 && share < 0.85;
    let albedo = if open { scaled(rim, 0.12) } else { rim };
    Surface { albedo, gloss: 0.08, emission: [0.0; 3] }
}

/// A lamp's face: the end of a cylinder of radius one, the front of a cube, or a sphere.
fn lamp(place: &Place<'_>, lit: Rgb, dark: Rgb, face: LampFace) -> Surface {
    // Own x and z span the end of a cylinder about y; z points down when the cylinder lies with its top forward.
    let (x, y) = (place.own.x, -place.own.z);
    let share = match face {
        LampFace::Full => {
            let radius = x.hypot(y) as f32;
            1.15 - 0.35 * radius.min(1.0)
        }
        LampFace::Arrow(angle) => {
            let (sin, cos) = angle.sin_cos();
            f32::from(in_arrow(cos * x - sin * y, sin * x + cos * y))
        }
        LampFace::Figure { walking } => f32::from(in_figure(x, y, walking)),
        LampFace::Beam => {
            let along = (-place.ray.z).max(0.0) as f32;
            along.powi(24) + 0.004
        }
    };
    Surface { albedo: dark, gloss: 0.05, emission: scaled(lit, share) }
}

/// Whether a place on a disc of radius one lies in an upward arrow.
fn in_arrow(x: f64, y: f64) -> bool {
    let head = y > 0.0 && y < 0.78 && x.abs() < 0.78 - y;
    let shaft = y <= 0.0 && y > -0.75 && x.abs() < 0.2;
    head || shaft
}

/// Whether a place on a disc of radius one lies in the figure of a person.
fn in_figure(x: f64, y: f64, walking: bool) -> bool {
    let head = x * x + (y - 0.62).powi(2) < 0.17 * 0.17;
    let body = x.abs() < 0.22 && y < 0.42 && y > -0.15;
    let spread = if walking { 0.5 * (-0.15 - y) } else { 0.1 };
    let legs = y <= -0.15 && y > -0.85 && (x.abs() - spread).abs() < 0.12;
    let arms = walking && y < 0.35 && y > 0.0 && (x.abs() - (0.6 - y)).abs() < 0.1;
    head || body || legs || arms
}

/// The face of a board: own x and y for a cube, x and z for the end of a cylinder.
fn sign(place: &Place<'_>, ground: Rgb, figure: Rgb, kind: u32) -> Rgb {
    let (x, y) = match place.shape {
        Shape::Cube => (place.own.x, place.own.y),
        _ => (place.own.x, place.own.z),
    };
    if place.normal.z.abs() < 0.7 {
        return [0.2; 3];
    }
    let radius = x.hypot(y);
    let inside = match kind % 6 {
        0 => radius > 0.72,
        1 => y.abs() < 0.2 && x.abs() < 0.75,
        2 => (radius - 0.35).abs() < 0.15,
        3 => (x + y).abs() < 0.16 || radius > 0.78,
        4 => {
            // Lines of writing.
            let line = ((y + 1.0) * 3.5).floor() as i32;
            let letter = ((x + 1.0) * 7.0).floor() as i32;
            let within = ((y + 1.0) * 3.5).fract();
            within > 0.3 && within < 0.75 && x.abs() < 0.85 && unit(hash(line, letter, 0, kind)) > 0.35
        }
        _ => in_arrow(if kind & 64 == 0 { x } else { -x }, y),
    };
    if inside { figure } else { ground }
}

/// The normal of leaves: that of the crown, disturbed from leaf to leaf.
pub(crate) fn leaf_normal(normal: Vec3, world: Vec3, size_m: f64, seed: u32) -> Vec3 {
    let p = world * (1.0 / size_m);
    let number = |k: u32| f64::from(value3(p.x, p.y, p.z, seed.wrapping_add(k))) - 0.5;
    (normal + vec3(number(31), number(32), number(33)) * 2.0).unit()
}
