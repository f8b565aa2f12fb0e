//! The merit of a lens, and its linearisation.

use nalgebra::{DMatrix, DVector};

use super::chart::{Chart, Mapped};
use super::problem::Problem;
use crate::constraint::{direction_of_light, edge_clearance, sag_gradient, thinnest_edge};
use crate::gradient::LensGradient;
use crate::lens::{Lens, azimuths};
use crate::number::Number;
use crate::paraxial::{
    FirstOrderCotangent, first_order, image_height_per_tangent, pull_back_first_order, pull_back_image_height,
};
use crate::pupil::{PupilBasis, Sides, chief_ray, paraxial_launch, pull_back_chief};
use crate::trace::{
    AimedRays, LandingJacobian, RayBundle, Reaim, Seeds, Sequence, SquaredHeights, landing_jacobian,
    pull_back, trace_with_heights,
};

const UM_PER_MM: f64 = 1e3;

/// A mount needs this much more than the beam, mm.
const MOUNT_MM: f64 = 0.1;

/// A lens with its figures.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// The lens.
    pub lens: Lens,
    /// What is made small: the square of the p-mean of the fields' RMS spots, um^2, plus squared violations.
    pub merit: f64,
    /// RMS spot of each field about its centroid, all wavelengths together, um.
    pub rms_um: Vec<f64>,
    /// What is violated, and by how much, mm (distortion: on the image; slopes and angles: as tangents, the former times the
    /// radius of the clear aperture, the latter times the back focal length).
    pub violations: Vec<(Violation, f64)>,
    /// Launch points of the rays, by field and wavelength: where the next aiming starts.
    pub(super) launches: Vec<Vec<[f64; 2]>>,
    /// How far the beams reach: by rays on the rim of the stop if a limit asks, else by those that are traced anyway.
    apertures: Apertures,
}

/// How far beams reach on the surfaces.
#[derive(Clone, Debug)]
struct Apertures {
    /// Radius at which a surface must be clear, mm.
    clear_mm: Vec<f64>,
    /// The field, wavelength and point of the pupil whose ray needs that radius.
    widest: Vec<(usize, usize, [f64; 2])>,
}

impl Apertures {
    fn none(lens: &Lens) -> Self {
        let surfaces = lens.surfaces.len();
        Self { clear_mm: vec![0.0; surfaces], widest: vec![(0, 0, [0.0; 2]); surfaces] }
    }

    fn widen(&mut self, heights: &[SquaredHeights], points: &[[f64; 2]], [field, colour]: [usize; 2]) {
        for h in heights {
            for (u, p) in h.values.iter().zip(points) {
                if u.sqrt() > self.clear_mm[h.surface] {
                    self.clear_mm[h.surface] = u.sqrt();
                    self.widest[h.surface] = (field, colour, *p);
                }
            }
        }
    }
}

/// Points on half of the rim of the stop.
const RIM: [[f64; 2]; 7] = [
    [0.0, -1.0],
    [0.5, -0.866_025_403_784_438_6],
    [0.866_025_403_784_438_6, -0.5],
    [1.0, 0.0],
    [0.866_025_403_784_438_6, 0.5],
    [0.5, 0.866_025_403_784_438_6],
    [0.0, 1.0],
];

/// How far rays on the rim of the stop reach; `None` if one of them is lost.
fn rim(problem: &Problem, lens: &Lens, stop_radius_mm: f64) -> Option<Apertures> {
    let mut apertures = Apertures::none(lens);
    let points = problem.sides().points(&RIM);
    for field in 0..problem.fields_rad.len() {
        for colour in 0..problem.wavelengths_um.len() {
            let beam = beam(lens, problem, &points, [field, colour], stop_radius_mm, None)?;
            let mut rays = beam.aimed.bundle(&beam.sequence);
            let mut heights: Vec<SquaredHeights> =
                (0..lens.surfaces.len()).map(|s| SquaredHeights::zero(s, points.len())).collect();
            trace_with_heights(&beam.sequence, &mut rays, &mut heights);
            if !(0..points.len()).all(|i| rays.fate(i).reaches_image()) {
                return None;
            }
            apertures.widen(&heights, &points, [field, colour]);
        }
    }
    Some(apertures)
}

impl Analysis {
    /// Mean RMS spot over the fields, um.
    pub fn mean_rms_um(&self) -> f64 {
        self.rms_um.iter().sum::<f64>() / self.rms_um.len() as f64
    }

    /// The lens with clear semi-diameters as its beams need them, and a margin for the mount; the stop has none.
    pub fn fitted_lens(&self, problem: &Problem) -> Lens {
        let mut lens = self.lens.clone();
        let stop_radius_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
        // For every beam that the file asks for, not only for those that were looked at.
        let mut whole = problem.clone();
        whole.fields_rad.extend(lens.fields_deg.iter().map(|f| f.to_radians()));
        whole.wavelengths_um.extend(&lens.wavelengths_um);
        let apertures = rim(&whole, &lens, stop_radius_mm)
            .or_else(|| rim(problem, &lens, stop_radius_mm))
            .unwrap_or_else(|| Apertures::none(&lens));
        for (i, s) in lens.surfaces.iter_mut().enumerate() {
            let needed = apertures.clear_mm[i].max(self.apertures.clear_mm[i]) + MOUNT_MM;
            s.semi_diameter_mm = if i == lens.stop { stop_radius_mm } else { needed };
        }
        lens
    }
}

/// A limit that may be violated; surfaces from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Violation {
    /// Edge thickness of the element behind a surface.
    Edge(usize),
    /// Centre thickness of the element behind a surface.
    Centre(usize),
    /// Air behind a surface, on the axis.
    Air(usize),
    /// Air behind a surface, at the edge.
    AirEdge(usize),
    /// The curvature that holds the focal length.
    SolvedRadius,
    /// The back focal length.
    BackFocal,
    /// The track.
    Track,
    /// The clear diameter of a surface.
    ClearDiameter(usize),
    /// The distortion.
    Distortion,
    /// The slope of a surface at the edge of its clear aperture.
    Slope(usize),
    /// The angle of the outermost field's chief ray at the image.
    ChiefRayAngle,
}

impl std::fmt::Display for Violation {
    /// As a person names it; surfaces from 1.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Edge(i) => write!(f, "edge thickness behind surface {}", i + 1),
            Self::Centre(i) => write!(f, "centre thickness behind surface {}", i + 1),
            Self::Air(i) => write!(f, "air behind surface {}", i + 1),
            Self::AirEdge(i) => write!(f, "air at the edge behind surface {}", i + 1),
            Self::SolvedRadius => write!(f, "bounds of the radius that holds the focal length, as a sag"),
            Self::BackFocal => write!(f, "back focal length"),
            Self::Track => write!(f, "track"),
            Self::ClearDiameter(i) => write!(f, "clear radius of surface {}", i + 1),
            Self::Distortion => write!(f, "distortion, on the image"),
            Self::Slope(i) => write!(f, "slope of surface {}, times its clear radius", i + 1),
            Self::ChiefRayAngle => write!(f, "chief-ray angle, times the back focal length"),
        }
    }
}

/// The merit's quadratic model: `merit + 2 gradient . step + step . hessian step`.
#[derive(Clone, Debug)]
pub(super) struct Linearised {
    /// Half the gradient by the coordinates.
    pub gradient: DVector<f64>,
    /// Half the Hessian of Gauss and Newton.
    pub hessian: DMatrix<f64>,
}

/// A beam of one field at one wavelength.
struct Beam {
    sequence: Sequence,
    aimed: AimedRays,
}

fn beam(
    lens: &Lens,
    problem: &Problem,
    points: &[[f64; 2]],
    [field, colour]: [usize; 2],
    stop_radius_mm: f64,
    guesses: Option<&[[f64; 2]]>,
) -> Option<Beam> {
    let sequence = lens.at_wavelength(problem.wavelengths_um[colour]);
    let field_rad = problem.fields_rad[field];
    let targets: Vec<[f64; 2]> = points.iter().map(|p| p.map(|p| stop_radius_mm * p)).collect();
    let aim = |guesses: &[[f64; 2]]| {
        let aimed = AimedRays::new(&sequence, field_rad, &targets, guesses);
        (0..targets.len()).all(|i| aimed.is_aimed(i)).then_some(aimed)
    };
    let aimed = guesses.and_then(aim).or_else(|| {
        let order = first_order(&sequence);
        let guesses: Vec<[f64; 2]> =
            points.iter().map(|p| paraxial_launch(&order, &sequence, field_rad, *p)).collect();
        aim(&guesses)
    })?;
    Some(Beam { sequence, aimed })
}

/// Points of the pupil that are looked at, and their shares of its area.
fn samples(problem: &Problem) -> (Vec<[f64; 2]>, Vec<f64>) {
    let (basis, sides) = (PupilBasis::of(problem.sampling), problem.sides());
    (sides.points(&basis.samples), sides.weights(&basis.weights))
}

/// A point in the middle of a beam from its first ray; half a beam is symmetric about x = 0.
fn origin_of([x, y]: [f64; 2], is_half: bool) -> [f64; 2] {
    [if is_half { 0.0 } else { x }, y]
}

/// The merit of a lens; `None` if a ray of the stop is lost. `near`, a lens like it, makes aiming quicker.
pub(super) fn analyse(problem: &Problem, lens: Lens, near: Option<&Analysis>) -> Option<Analysis> {
    let (points, weights) = samples(problem);
    let is_half = problem.sides() == Sides::Mirrored;
    let stop_radius_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
    let surfaces = lens.surfaces.len();
    // Light cannot go backwards.
    if (0..surfaces).any(|i| direction_of_light(&lens, i) * lens.surfaces[i].thickness_mm < 0.0) {
        return None;
    }
    let colours = problem.wavelengths_um.len();
    let mut launches = Vec::with_capacity(problem.fields_rad.len() * colours);
    let mut rms_um = Vec::with_capacity(problem.fields_rad.len());
    let limits = &problem.limits;
    let by_rim = limits.element_edge_mm.is_some()
        || limits.air_gap_mm.is_some()
        || limits.clear_diameter_mm.is_some()
        || limits.slope_rad.is_some();
    let mut apertures = if by_rim { rim(problem, &lens, stop_radius_mm)? } else { Apertures::none(&lens) };
    for field in 0..problem.fields_rad.len() {
        // Heights are taken about the first ray, so that their squares can be subtracted.
        let (mut origin, mut sums) = (None, [0.0; 4]);
        for colour in 0..colours {
            let guesses = near.and_then(|n| n.launches.get(field * colours + colour)).or(if colour > 0 {
                launches.last()
            } else {
                None
            });
            let beam =
                beam(&lens, problem, &points, [field, colour], stop_radius_mm, guesses.map(Vec::as_slice))?;
            let mut rays = beam.aimed.bundle(&beam.sequence);
            // Rays on the rim have told already, if a limit asks.
            let mut heights: Vec<SquaredHeights> = if by_rim {
                Vec::new()
            } else {
                (0..surfaces).map(|s| SquaredHeights::zero(s, points.len())).collect()
            };
            trace_with_heights(&beam.sequence, &mut rays, &mut heights);
            let [x, y] = rays.image_xy();
            for (i, weight) in weights.iter().enumerate() {
                if !rays.fate(i).reaches_image() {
                    return None;
                }
                let [at_x, at_y] = *origin.get_or_insert(origin_of([x[i], y[i]], is_half));
                let (x, y) = (x[i] - at_x, y[i] - at_y);
                sums[0] += weight;
                sums[1] += weight * y;
                sums[2] += weight * (x * x + y * y);
                sums[3] += weight * x;
            }
            apertures.widen(&heights, &points, [field, colour]);
            launches.push((0..points.len()).map(|i| beam.aimed.launch_of(i)).collect());
        }
        // Half a beam and its mirror image have their mean at x = 0.
        let mean_x = if is_half { 0.0 } else { sums[3] };
        let square = (sums[2] - sums[1] * sums[1] / sums[0] - mean_x * mean_x / sums[0]) / sums[0];
        rms_um.push(UM_PER_MM * square.max(0.0).sqrt());
    }
    let mut analysis = Analysis { lens, merit: 0.0, rms_um, violations: Vec::new(), launches, apertures };
    analysis.violations = violations(problem, &analysis)?;
    let total: f64 = problem.field_weights.iter().sum();
    let mean: f64 = analysis
        .rms_um
        .iter()
        .zip(&problem.field_weights)
        .map(|(rms, w)| w / total * rms.powf(problem.power))
        .sum();
    let stiff = |v: f64| (problem.stiffness_um_per_mm * v).powi(2);
    analysis.merit =
        mean.powf(2.0 / problem.power) + analysis.violations.iter().map(|(_, v)| stiff(*v)).sum::<f64>();
    analysis.merit.is_finite().then_some(analysis)
}

/// What is violated; positive amounts.
fn violations(problem: &Problem, analysis: &Analysis) -> Option<Vec<(Violation, f64)>> {
    let (lens, limits) = (&analysis.lens, &problem.limits);
    let mut found = Vec::new();
    let mut ask = |what: Violation, short: f64| {
        if short > 0.0 {
            found.push((what, short));
        }
    };
    let last = lens.surfaces.len() - 1;
    for i in 0..last {
        let surface = &lens.surfaces[i];
        let [a, b] =
            [analysis.apertures.clear_mm[i], analysis.apertures.clear_mm[i + 1]].map(|r| r + MOUNT_MM);
        if surface.glass.is_air() {
            if let Some(least) = limits.air_gap_mm.filter(|_| !problem.has_open_gap(i)) {
                ask(Violation::Air(i), least - direction_of_light(lens, i) * surface.thickness_mm);
                ask(Violation::AirEdge(i), least - edge_clearance(lens, i, a.min(b))?);
            }
        } else {
            if let Some(least) = limits.element_centre_mm {
                ask(Violation::Centre(i), least - direction_of_light(lens, i) * surface.thickness_mm);
            }
            if let Some(least) = limits.element_edge_mm {
                ask(Violation::Edge(i), least - edge_clearance(lens, i, a.max(b))?);
            }
        }
    }
    if let Some(solve) = &problem.solves.efl
        && let Some([min, max]) = solve.radius_mm
    {
        let [low, high] = curvature_bounds(min, max);
        let c = lens.surfaces[solve.surface].shape.curvature;
        // As a sag at the edge of the clear aperture, so that it is a length.
        let scale = 0.5 * analysis.apertures.clear_mm[solve.surface].powi(2);
        ask(Violation::SolvedRadius, scale * (c - high).max(low - c));
    }
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    if let Some([min, max]) = limits.back_focal_mm {
        let found = direction_of_light(lens, last) * order.bfl_mm;
        ask(Violation::BackFocal, (found - max).max(min - found));
    }
    if let Some(track) = limits.track_mm {
        let (from, to) = extent(lens);
        ask(
            Violation::Track,
            lens.surfaces[from..to].iter().map(|s| s.thickness_mm).sum::<f64>().abs() - track,
        );
    }
    if let Some(diameter) = limits.clear_diameter_mm {
        for i in 0..=last {
            ask(Violation::ClearDiameter(i), analysis.apertures.clear_mm[i] - 0.5 * diameter);
        }
    }
    if let Some(share) = limits.distortion {
        let (ideal, real) = distorted(problem, lens)?;
        ask(Violation::Distortion, (real - ideal).abs() - share * ideal.abs());
    }
    if let Some(steepest) = limits.slope_rad {
        for i in 0..=last {
            let radius = analysis.apertures.clear_mm[i];
            let slope = steepest_section(lens, i, radius)?.slope;
            ask(Violation::Slope(i), (slope.abs() - steepest.tan()) * radius);
        }
    }
    if let Some(greatest) = limits.chief_ray_angle_rad {
        ask(
            Violation::ChiefRayAngle,
            (chief_slope(problem, lens)?.abs() - greatest.tan()) * order.bfl_mm.abs(),
        );
    }
    Some(found)
}

/// The vertices, or the image plane as one more, that are furthest apart along the axis: the former first.
fn extent(lens: &Lens) -> (usize, usize) {
    let mut at = vec![0.0];
    for s in &lens.surfaces {
        at.push(at[at.len() - 1] + s.thickness_mm);
    }
    let furthest =
        |sign: f64| (0..at.len()).max_by(|a, b| (sign * at[*a]).total_cmp(&(sign * at[*b]))).unwrap_or(0);
    let (low, high) = (furthest(-1.0), furthest(1.0));
    (low.min(high), low.max(high))
}

/// Bounds of a curvature from those of its radius, a ten-thousandth of their distance inside: a penalty ends a little beyond
/// what it asks, and that must not be beyond the bounds.
fn curvature_bounds(min_mm: f64, max_mm: f64) -> [f64; 2] {
    let (a, b) = (1.0 / min_mm, 1.0 / max_mm);
    let inside = 1e-4 * (a - b).abs();
    [a.min(b) + inside, a.max(b) - inside]
}

/// Ideal and real image height of the outermost field, mm.
fn distorted(problem: &Problem, lens: &Lens) -> Option<(f64, f64)> {
    let field = problem.outermost_field_rad();
    let sequence = lens.at_wavelength(lens.reference_um);
    let chief = chief_ray(&sequence, field)?;
    Some((image_height_per_tangent(&sequence) * field.tan(), chief.y_mm))
}

/// Tangent of the outermost field's chief ray to the axis at the image: what its height gains over a millimetre.
fn chief_slope(problem: &Problem, lens: &Lens) -> Option<f64> {
    let height = |lens: &Lens| {
        Some(chief_ray(&lens.at_wavelength(lens.reference_um), problem.outermost_field_rad())?.y_mm)
    };
    Some(height(&a_millimetre_behind(lens))? - height(lens)?)
}

fn a_millimetre_behind(lens: &Lens) -> Lens {
    lens.with_image_distance(lens.image_distance_mm() + 1.0)
}

/// Adds the gradient of a loss that depends on the radius at which a surface must be clear, `bar` per mm: that of the ray
/// which needs it.
fn add_clear(
    problem: &Problem,
    analysis: &Analysis,
    surface: usize,
    bar: f64,
    gradient: &mut LensGradient,
) -> Option<()> {
    let lens = &analysis.lens;
    let (field, colour, point) = analysis.apertures.widest[surface];
    let reference = lens.at_wavelength(lens.reference_um);
    let stop_radius_mm = first_order(&reference).stop_radius_mm;
    let beam = beam(lens, problem, &[point], [field, colour], stop_radius_mm, None)?;
    let mut seeds = Seeds::zero(1);
    let mut height = SquaredHeights::zero(surface, 1);
    height.values[0] = 0.5 * bar / analysis.apertures.clear_mm[surface];
    seeds.heights.push(height);
    let nothing = vec![0.0; RayBundle::padded(1)];
    let reaim = Reaim { aimed: &beam.aimed, launch_bar: [&nothing, &nothing] };
    let launched = beam.aimed.bundle(&beam.sequence);
    let by_stop = pull_back(&beam.sequence, &launched, &seeds, Some(&reaim), gradient);
    let wish = FirstOrderCotangent { stop_radius: by_stop / stop_radius_mm, ..Default::default() };
    pull_back_first_order(&reference, wish, gradient);
    Some(())
}

/// The gradient of how much the edge behind a surface is too thin, by its larger or its smaller clear aperture.
fn edge_gradient(
    problem: &Problem,
    analysis: &Analysis,
    i: usize,
    larger: bool,
    g: &mut LensGradient,
) -> Option<()> {
    let lens = &analysis.lens;
    let [a, b] = [analysis.apertures.clear_mm[i], analysis.apertures.clear_mm[i + 1]];
    let decisive = if (a > b) == larger { i } else { i + 1 };
    let height = analysis.apertures.clear_mm[decisive] + MOUNT_MM;
    let sign = direction_of_light(lens, i);
    let (_, direction) = thinnest_edge(lens, i, height)?;
    let at = direction.map(|v| v * height);
    g[(i, Number::Thickness)] -= sign;
    sag_gradient(lens, i, at, sign, g);
    sag_gradient(lens, i + 1, at, -sign, g);
    // The edge moves outwards with the beam.
    let slope = |s: usize| {
        let [x, y] = lens.surfaces[s].shape.sag_jet(at).slope;
        x * direction[0] + y * direction[1]
    };
    add_clear(problem, analysis, decisive, sign * (slope(i) - slope(i + 1)), g)
}

/// Where a surface is steepest at a height, of some directions across the axis.
struct Section {
    direction: [f64; 2],
    /// Length of the gradient of the sag.
    slope: f64,
}

fn steepest_section(lens: &Lens, surface: usize, height_mm: f64) -> Option<Section> {
    let shape = &lens.surfaces[surface].shape;
    let of = |direction: [f64; 2]| {
        let [x, y] = shape.sag_jet(direction.map(|v| v * height_mm)).slope;
        Section { direction, slope: x.hypot(y) }
    };
    let all = azimuths(&[&lens.surfaces[surface]]).into_iter().map(of);
    all.max_by(|a, b| a.slope.total_cmp(&b.slope)).filter(|s| s.slope.is_finite())
}

/// The gradient of a violation by the numbers of the lens.
fn violation_gradient(problem: &Problem, analysis: &Analysis, what: Violation) -> Option<LensGradient> {
    let lens = &analysis.lens;
    let mut g = LensGradient::zero(lens.surfaces.len());
    let sequence = || lens.at_wavelength(lens.reference_um);
    let last = lens.surfaces.len() - 1;
    match what {
        Violation::Edge(i) => edge_gradient(problem, analysis, i, true, &mut g)?,
        Violation::AirEdge(i) => edge_gradient(problem, analysis, i, false, &mut g)?,
        Violation::Centre(i) | Violation::Air(i) => g[(i, Number::Thickness)] = -direction_of_light(lens, i),
        Violation::SolvedRadius => {
            let solve = problem.solves.efl.as_ref()?;
            let [min, max] = solve.radius_mm?;
            let c = lens.surfaces[solve.surface].shape.curvature;
            let scale = 0.5 * analysis.apertures.clear_mm[solve.surface].powi(2);
            let [low, high] = curvature_bounds(min, max);
            let sign = if c > high { 1.0 } else { -1.0 };
            g[(solve.surface, Number::Curvature)] = sign * scale;
            let beyond = (c - high).max(low - c) * analysis.apertures.clear_mm[solve.surface];
            add_clear(problem, analysis, solve.surface, beyond, &mut g)?;
        }
        Violation::BackFocal => {
            let [_, max] = problem.limits.back_focal_mm?;
            let sequence = sequence();
            let direction = direction_of_light(lens, last);
            let found = direction * first_order(&sequence).bfl_mm;
            let sign = if found > max { direction } else { -direction };
            let wish = FirstOrderCotangent { bfl: sign, ..Default::default() };
            pull_back_first_order(&sequence, wish, &mut g);
        }
        Violation::Track => {
            let (from, to) = extent(lens);
            let between = &lens.surfaces[from..to];
            let sign = between.iter().map(|s| s.thickness_mm).sum::<f64>().signum();
            (from..to).for_each(|i| g[(i, Number::Thickness)] = sign);
        }
        Violation::ClearDiameter(i) => add_clear(problem, analysis, i, 1.0, &mut g)?,
        Violation::Distortion => {
            let sequence = sequence();
            let (ideal, real) = distorted(problem, lens)?;
            let share = problem.limits.distortion?;
            let sign = (real - ideal).signum();
            let field = problem.outermost_field_rad();
            pull_back_chief(&sequence, &chief_ray(&sequence, field)?, [0.0, sign], &mut g);
            let by_ideal = -sign - share * ideal.signum();
            pull_back_image_height(&sequence, by_ideal * field.tan(), &mut g);
        }
        Violation::Slope(i) => {
            let radius = analysis.apertures.clear_mm[i];
            let section = steepest_section(lens, i, radius)?;
            let (direction, slope) = (section.direction, section.slope);
            let at = direction.map(|v| v * radius);
            let shape = &lens.surfaces[i].shape;
            let jet = shape.sag_jet(at);
            // Unit vector of the gradient, and how its length grows outwards.
            let [x, y] = jet.slope.map(|v| v / slope);
            let [xx, xy, yy] = jet.second;
            let [dx, dy] = direction;
            let outwards = x * (xx * dx + xy * dy) + y * (xy * dx + yy * dy);
            // The amount is (|grad z| - tan) r.
            let by_radius = slope + radius * outwards - problem.limits.slope_rad?.tan();
            add_clear(problem, analysis, i, by_radius, &mut g)?;
            for (number, by) in shape.sensitivities(at) {
                let by_slope = x * by.slope[0] + y * by.slope[1];
                g[(i, number)] += radius * by_slope;
            }
        }
        Violation::ChiefRayAngle => {
            let field = problem.outermost_field_rad();
            let slope = chief_slope(problem, lens)?;
            let bfl_mm = first_order(&sequence()).bfl_mm;
            let bar = slope.signum() * bfl_mm.abs();
            for (lens, sign) in [(a_millimetre_behind(lens), 1.0), (lens.clone(), -1.0)] {
                let sequence = lens.at_wavelength(lens.reference_um);
                pull_back_chief(&sequence, &chief_ray(&sequence, field)?, [0.0, sign * bar], &mut g);
            }
            let over = slope.abs() - problem.limits.chief_ray_angle_rad?.tan();
            let wish = FirstOrderCotangent { bfl: over * bfl_mm.signum(), ..Default::default() };
            pull_back_first_order(&sequence(), wish, &mut g);
        }
    }
    Some(g)
}

/// The linearised problem at a lens of the chart.
pub(super) fn linearise(
    problem: &Problem,
    chart: &Chart,
    mapped: &Mapped,
    analysis: &Analysis,
) -> Option<Linearised> {
    let (points, weights) = samples(problem);
    let is_half = problem.sides() == Sides::Mirrored;
    let stop_radius_mm = first_order(&mapped.lens.at_wavelength(mapped.lens.reference_um)).stop_radius_mm;
    let colours = problem.wavelengths_um.len();
    // One column per number, the stop's growth, and the residual itself.
    let columns = chart.numbers.len() + 2;
    let mut gram = DMatrix::<f64>::zeros(columns, columns);
    let total: f64 = problem.field_weights.iter().sum();
    let p = problem.power;
    let mean: f64 =
        analysis.rms_um.iter().zip(&problem.field_weights).map(|(rms, w)| w / total * rms.powf(p)).sum();
    for field in 0..problem.fields_rad.len() {
        let mut of_field = DMatrix::<f64>::zeros(columns, columns);
        let mut means = [0, 1].map(|_| DVector::<f64>::zeros(columns));
        let mut origin = None;
        for colour in 0..colours {
            let guesses = analysis.launches.get(field * colours + colour).map(Vec::as_slice);
            let beam = beam(&mapped.lens, problem, &points, [field, colour], stop_radius_mm, guesses)?;
            let landing = landing_jacobian(&beam.sequence, &beam.aimed, &chart.numbers);
            if !landing.complete {
                return None;
            }
            let first = [landing.landing[0][0], landing.landing[1][0]];
            let origin = *origin.get_or_insert(origin_of(first, is_half));
            add_gram(&landing, &weights, origin, is_half, colours as f64, &mut of_field, &mut means);
        }
        let [mean_x, mean_y] = &means;
        of_field -= mean_y * mean_y.transpose();
        if !is_half {
            of_field -= mean_x * mean_x.transpose();
        }
        // d(mean^(2/p)) / d(S_f), S_f in um^2.
        let rms = analysis.rms_um[field].max(1e-6);
        let weight = mean.powf(2.0 / p - 1.0) * problem.field_weights[field] / total * rms.powf(p - 2.0);
        gram += of_field * (weight * UM_PER_MM * UM_PER_MM);
    }
    let residual = columns - 1;
    let slopes = &mapped.slopes;
    let inner = gram.view((0, 0), (residual, residual));
    let mut hessian = slopes.transpose() * inner * slopes;
    let mut gradient = slopes.transpose() * gram.view((0, residual), (residual, 1)).column(0);
    for (what, amount) in &analysis.violations {
        let g = violation_gradient(problem, analysis, *what)?;
        let row = DVector::from_fn(chart.numbers.len() + 1, |n, _| {
            chart.numbers.get(n).map_or(0.0, |number| g[*number])
        });
        let row = slopes.transpose() * row;
        let stiffness = problem.stiffness_um_per_mm * problem.stiffness_um_per_mm;
        gradient += &row * (stiffness * amount);
        hessian += &row * row.transpose() * stiffness;
    }
    Some(Linearised { gradient, hessian })
}

/// Adds the products of the columns of a beam, weighted, and the means of x and of y; about an origin. Half a beam and its
/// mirror image have no mean of x.
fn add_gram(
    landing: &LandingJacobian,
    weights: &[f64],
    origin: [f64; 2],
    is_half: bool,
    colours: f64,
    gram: &mut DMatrix<f64>,
    means: &mut [DVector<f64>; 2],
) {
    let count = weights.len();
    // Columns scaled by the roots of the weights: x and then y of every ray.
    let roots: Vec<f64> = weights.iter().map(|w| (w / colours).sqrt()).collect();
    let columns = landing.by.len() + 1;
    let block = DMatrix::from_fn(2 * count, columns, |r, c| {
        let (axis, ray) = (r / count, r % count);
        let value = match landing.by.get(c) {
            Some(by) => by[axis][ray],
            None => landing.landing[axis][ray] - origin[axis],
        };
        roots[ray] * value
    });
    gram.gemm_tr(1.0, &block, &block, 1.0);
    for c in 0..columns {
        for (axis, means) in means.iter_mut().enumerate().skip(usize::from(is_half)) {
            means[c] += (0..count).map(|ray| roots[ray] * block[(axis * count + ray, c)]).sum::<f64>();
        }
    }
}
