//! Petzval's values, each computed by the convention of the program with which it is compared.

use std::f64::consts::TAU;

use petzval_optics::analysis::{AnalysisOptions, field_mtf};
use petzval_optics::lens::{ASPHERE_TERMS, Lens};
use petzval_optics::paraxial::{FirstOrder, first_order};
use petzval_optics::pupil::paraxial_launch;
use petzval_optics::seidel::{seidel, seidel_total};
use petzval_optics::trace::{Path, Sequence, aim_at_stop, launch, trace_ray};
use petzval_optics::wave::{PupilPlane, opd};

use super::listed::{AtField, ListedLens, Modulation, NearAxis, Paraxial};

/// The surface on which points of the pupil are defined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// The paraxial entrance pupil of the reference wavelength.
    Paraxial,
    /// The same, shifted so that the ray through its middle passes the middle of the stop at the reference wavelength.
    Shifted,
    /// The stop with the radius of first-order optics: Petzval's own convention.
    Stop,
    /// The stop with the radius at which the traced axial marginal ray passes it.
    TracedStop,
}

/// A lens, and the quantities from which its rays are launched.
pub struct Studied {
    pub lens: Lens,
    reference: Sequence,
    order: FirstOrder,
    /// Height at which the traced marginal ray of the axis passes the stop, mm.
    traced_stop_radius_mm: f64,
    /// Height difference of two close rays, in pupil radii.
    close: f64,
}

/// Points for spots and wavefronts. Each stands for the same area of the pupil.
pub fn points() -> Vec<[f64; 2]> {
    let ring = |i: usize| {
        (0..18).map(move |j| {
            let radius = ((i as f64 + 0.5) / 6.0).sqrt();
            let (sin, cos) = (TAU * j as f64 / 18.0).sin_cos();
            [radius * cos, radius * sin]
        })
    };
    (0..6).flat_map(ring).collect()
}

impl Studied {
    pub fn new(listed: &ListedLens, close: f64) -> Self {
        Self::of(listed.lens(), close)
    }

    fn of(lens: Lens, close: f64) -> Self {
        let reference = lens.at_wavelength(lens.reference_um);
        let order = first_order(&reference);
        let rim = [0.0, 0.5 * lens.entrance_pupil_mm];
        let marginal = trace_ray(&reference, launch(&reference, 0.0, rim).ray);
        let traced_stop_radius_mm = marginal.passages[lens.stop].point[1].abs();
        Self { lens, reference, order, traced_stop_radius_mm, close }
    }

    /// The same lens without the first `count` terms of its aspheres.
    pub fn without_terms(&self, count: usize) -> Self {
        let mut lens = self.lens.clone();
        for s in &mut lens.surfaces {
            s.shape.asphere[..count.min(ASPHERE_TERMS)].fill(0.0);
        }
        Self::of(lens, self.close)
    }

    /// Distance of the paraxial image behind the image plane, mm.
    pub fn focus_beyond_mm(&self) -> f64 {
        self.order.bfl_mm - self.lens.image_distance_mm()
    }

    pub fn paraxial(&self) -> Paraxial {
        Paraxial {
            efl_mm: self.order.efl_mm,
            bfl_mm: self.order.bfl_mm,
            entrance_pupil_at_mm: self.order.entrance_pupil_at_mm,
            exit_pupil_at_mm: self.order.exit_pupil_at_mm,
            exit_pupil_mm: self.order.exit_pupil_mm,
        }
    }

    pub fn seidel_mm(&self) -> [f64; 5] {
        seidel_total(&self.reference, self.full_field_rad()).expect("refracting surfaces").s
    }

    pub fn seidel_by_surface_mm(&self) -> Vec<[f64; 5]> {
        let sums = seidel(&self.reference, self.full_field_rad()).expect("refracting surfaces");
        sums.iter().map(|s| s.s).collect()
    }

    fn full_field_rad(&self) -> f64 {
        self.lens.fields_deg.iter().fold(0.0_f64, |a, b| a.max(*b)).to_radians()
    }

    /// Traces one ray; also returns the optical path from the plane wave through the first vertex to its start, mm.
    fn ray(&self, sequence: &Sequence, field_rad: f64, aim: Aim, p: [f64; 2]) -> (f64, Path) {
        let paraxial = |p| paraxial_launch(&self.order, &self.reference, field_rad, p);
        let at = match aim {
            Aim::Paraxial => paraxial(p),
            Aim::Shifted => {
                let middle = paraxial([0.0; 2]);
                let chief = aim_at_stop(&self.reference, field_rad, [0.0; 2], middle).expect("a chief ray");
                let [x, y] = paraxial(p);
                [x + chief.launch_mm[0] - middle[0], y + chief.launch_mm[1] - middle[1]]
            }
            Aim::Stop | Aim::TracedStop => {
                let target = p.map(|p| p * self.stop_radius_mm(aim));
                aim_at_stop(sequence, field_rad, target, paraxial(p)).expect("an aimed ray").launch_mm
            }
        };
        let start = launch(sequence, field_rad, at).ray;
        // Path from the plane wave through the first vertex to the start of the ray.
        let behind = start.position[1] * start.direction[1];
        (behind, trace_ray(sequence, start))
    }

    fn stop_radius_mm(&self, aim: Aim) -> f64 {
        match aim {
            Aim::TracedStop => self.traced_stop_radius_mm,
            _ => self.order.stop_radius_mm,
        }
    }

    fn landing(&self, sequence: &Sequence, field_rad: f64, aim: Aim, p: [f64; 2]) -> [f64; 2] {
        let [x, y, _] = self.ray(sequence, field_rad, aim, p).1.image.expect("a ray").position;
        [x, y]
    }

    pub fn near_axis(&self) -> NearAxis {
        let height = self.close * 0.5 * self.lens.entrance_pupil_mm;
        let of = |um: f64| {
            let image = self.ray(&self.lens.at_wavelength(um), 0.0, Aim::Paraxial, [0.0, self.close]).1.image;
            image.expect("a ray")
        };
        let focus = |um: f64| {
            let ray = of(um);
            -ray.position[1] * ray.direction[2] / ray.direction[1]
        };
        let reference = self.lens.reference_um;
        NearAxis {
            efl_mm: -height / of(reference).direction[1],
            bfl_mm: self.lens.image_distance_mm() + focus(reference),
            focus_mm: self.lens.wavelengths_um.iter().map(|um| focus(*um)).collect(),
        }
    }

    /// Values of a field with one way of aiming. The reference sphere goes through the paraxial exit pupil, or has the radius
    /// `sphere_mm`.
    pub fn at_field(&self, field_deg: f64, aim: Aim, sphere_mm: Option<f64>) -> AtField {
        let field_rad = field_deg.to_radians();
        let colours: Vec<Sequence> =
            self.lens.wavelengths_um.iter().map(|um| self.lens.at_wavelength(*um)).collect();
        let points = points();
        let landings = |colour: &Sequence| -> Vec<[f64; 2]> {
            points.iter().map(|p| self.landing(colour, field_rad, aim, *p)).collect()
        };
        let focus = |axis: usize| {
            let end = |side: f64| {
                let p = if axis == 0 { [side, 0.0] } else { [0.0, side] };
                let image = self.ray(&self.reference, field_rad, aim, p).1.image.expect("a ray");
                (image.position[axis], image.direction[axis] / image.direction[2])
            };
            let ((a, u), (b, v)) = (end(-self.close), end(self.close));
            -(b - a) / (v - u)
        };
        // Collect heights, foci, wavefront and spots.
        let all: Vec<[f64; 2]> = colours.iter().flat_map(&landings).collect();
        let chief = |colour: &Sequence| self.landing(colour, field_rad, aim, [0.0; 2])[1];
        AtField {
            chief_mm: colours.iter().map(&chief).collect(),
            reference_chief_mm: chief(&self.reference),
            sagittal_focus_mm: focus(0),
            tangential_focus_mm: focus(1),
            opd_rms_waves: match sphere_mm {
                Some(radius) => self.opd_rms_about(field_rad, aim, &points, radius),
                None => self.opd_rms(field_rad, aim, &points),
            },
            opd_rms_by_the_sphere_waves: None,
            rms_um: rms_about_centroid_um(&landings(&self.reference)),
            rms_poly_um: rms_about_centroid_um(&all),
            coddington_mm: None,
            reference_sphere_mm: sphere_mm,
        }
    }

    fn opd_rms(&self, field_rad: f64, aim: Aim, points: &[[f64; 2]]) -> f64 {
        let plane = match aim {
            Aim::Paraxial | Aim::Shifted => PupilPlane::Paraxial,
            Aim::Stop | Aim::TracedStop => PupilPlane::Stop,
        };
        let found =
            opd(&self.reference, field_rad, self.stop_radius_mm(aim), points, plane).expect("a chief ray");
        deviation(&found.waves.iter().map(|w| w.expect("a ray")).collect::<Vec<_>>())
    }

    /// RMS wavefront directly from the path lengths: from the plane wave to the first vertex plane, through the lens to the image
    /// plane, and back to the sphere about the image point of the chief ray.
    fn opd_rms_about(&self, field_rad: f64, aim: Aim, points: &[[f64; 2]], radius_mm: f64) -> f64 {
        let centre = self.landing(&self.reference, field_rad, aim, [0.0; 2]);
        let path = |p: &[f64; 2]| {
            let (behind, path) = self.ray(&self.reference, field_rad, aim, *p);
            let image = path.image.expect("a ray");
            let e = [image.position[0] - centre[0], image.position[1] - centre[1]];
            let b = e[0] * image.direction[0] + e[1] * image.direction[1];
            let run = -b - (b * b + radius_mm * radius_mm - e[0] * e[0] - e[1] * e[1]).sqrt();
            (behind + path.optical_path_mm + run) / (1e-3 * self.lens.reference_um)
        };
        deviation(&points.iter().map(path).collect::<Vec<_>>())
    }

    /// Modulation by Optiland's conventions. Geometric: rays through a square grid of the paraxial entrance pupil. Diffraction:
    /// the autocorrelation of the wave in the pupil. Its shift relative to the pupil is the frequency relative to the cutoff,
    /// which follows from the directions of the rays at the rim.
    pub fn modulation_paraxial(&self, field_deg: f64, frequencies: &[f64]) -> Modulation {
        const SIDE: usize = 128;
        let field = field_deg.to_radians();
        let along = |i: usize| -1.0 + 2.0 * i as f64 / (SIDE - 1) as f64;
        let grid = (0..SIDE * SIDE).map(|k| [along(k % SIDE), along(k / SIDE)]);
        let places: Vec<[f64; 2]> = grid
            .filter(|p| p[0] * p[0] + p[1] * p[1] <= 1.0)
            .map(|p| self.landing(&self.reference, field, Aim::Paraxial, p))
            .collect();
        let geometric = |axis: usize| {
            let at = |f: &f64| {
                let phases = places.iter().map(|p| (TAU * f * p[axis]).sin_cos());
                let (sin, cos) = phases.fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
                f64::hypot(sin, cos) / places.len() as f64
            };
            frequencies.iter().map(at).collect()
        };
        let waves = |axis: usize| frequencies.iter().map(|f| self.overlap(field, axis, *f)).collect();
        Modulation {
            geometric_tangential: geometric(1),
            geometric_sagittal: geometric(0),
            fft_tangential: waves(1),
            fft_sagittal: waves(0),
        }
    }

    /// Autocorrelation of the wave in the pupil for a frequency along an axis.
    fn overlap(&self, field_rad: f64, axis: usize, frequency_per_mm: f64) -> f64 {
        const STRIPS: usize = 240;
        let rim = |side: f64| {
            let p = if axis == 0 { [side, 0.0] } else { [0.0, side] };
            self.ray(&self.reference, field_rad, Aim::Paraxial, p).1.image.expect("a ray").direction[axis]
        };
        let half = frequency_per_mm * 1e-3 * self.lens.reference_um / (rim(-1.0) - rim(1.0)).abs();
        // Integrate in strips across the overlap of the two disks. Spacing them by the sine of an angle makes the integrand
        // smooth at the ends.
        let widest = (1.0 - half * half).sqrt();
        let (mut pairs, mut areas) = (Vec::new(), Vec::new());
        for i in 0..STRIPS {
            let angle = std::f64::consts::PI * ((i as f64 + 0.5) / STRIPS as f64 - 0.5);
            let across = widest * angle.sin();
            let width = widest * angle.cos() * std::f64::consts::PI / STRIPS as f64;
            let reach = (1.0 - across * across).sqrt() - half;
            for k in 0..STRIPS {
                let along = reach * ((2 * k + 1) as f64 / STRIPS as f64 - 1.0);
                for at in [along - half, along + half] {
                    pairs.push(if axis == 0 { [at, across] } else { [across, at] });
                }
                areas.push(width * 2.0 * reach / STRIPS as f64);
            }
        }
        // Sum the phase differences of the two shifted waves over the overlap.
        let stop = self.order.stop_radius_mm;
        let found = opd(&self.reference, field_rad, stop, &pairs, PupilPlane::Paraxial).expect("a chief ray");
        let phases = found.waves.chunks(2).map(|w| TAU * (w[1].expect("a ray") - w[0].expect("a ray")));
        let (sin, cos) = phases
            .zip(&areas)
            .map(|(phase, area)| (area * phase.sin(), area * phase.cos()))
            .fold((0.0, 0.0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
        f64::hypot(sin, cos) / std::f64::consts::PI
    }

    /// Modulation by Petzval's own convention: of the beam that passes the stop.
    pub fn modulation(&self, field_deg: f64) -> Modulation {
        let mut lens = self.lens.clone();
        lens.wavelengths_um = vec![lens.reference_um];
        let options = AnalysisOptions {
            max_frequency_per_mm: Some(50.0),
            frequency_points: 6,
            pupil_cells: 128,
            ..AnalysisOptions::default()
        };
        let mtf = field_mtf(&lens, field_deg, &options).expect("an MTF");
        // Select 10, 20, 30 and 50 cycles/mm among 0, 10, ... 50.
        let pick = |curve: &[f64]| [1, 2, 3, 5].map(|k| curve[k]).to_vec();
        let waves = mtf.diffraction.expect("a wave");
        Modulation {
            geometric_tangential: pick(&mtf.geometric.tangential),
            geometric_sagittal: pick(&mtf.geometric.sagittal),
            fft_tangential: pick(&waves.tangential),
            fft_sagittal: pick(&waves.sagittal),
        }
    }

    /// S_I from traced axial rays, mm. For a height h in pupil radii, longitudinal aberration begins as `S_I h^2 / (2 u'^2)`,
    /// where u' is the slope of the marginal ray behind the lens. Extrapolation from three heights removes the next two powers.
    pub fn spherical_by_rays_mm(&self) -> f64 {
        let crossing = |h: f64| {
            let image = self.ray(&self.reference, 0.0, Aim::Paraxial, [0.0, h]).1.image.expect("a ray");
            -image.position[1] * image.direction[2] / image.direction[1]
        };
        let share = |h: f64| (crossing(h) - self.focus_beyond_mm()) / (h * h);
        let [a, b, c] = [0.05, 0.1, 0.2].map(share);
        let (once, twice) = ((4.0 * a - b) / 3.0, (4.0 * b - c) / 3.0);
        let coefficient = (16.0 * once - twice) / 15.0;
        let slope = 0.5 * self.lens.entrance_pupil_mm / self.order.efl_mm;
        -2.0 * slope * slope * coefficient
    }
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64).sqrt()
}

fn rms_about_centroid_um(places: &[[f64; 2]]) -> f64 {
    let of = |axis: usize| deviation(&places.iter().map(|p| p[axis]).collect::<Vec<_>>());
    1e3 * of(0).hypot(of(1))
}
