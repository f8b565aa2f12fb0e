//! Lenses that cannot be made: glass thinner than nothing, surfaces that cross or end too soon.
//!
//! Whether rays get through is another question, which only tracing answers.

use super::{Action, Axis, Lens, Surface, SurfaceShape};

/// Number of radii, from axis to edge, at which the distance between two surfaces is checked.
const HEIGHTS: usize = 32;

/// Directions across the axis in which surfaces without symmetry are looked at.
const AZIMUTHS: usize = 16;

/// Longest length of a lens: over a thousand kilometres a ray is still right to 0.1 um. Far beyond it, squares of lengths overflow and spots are lost
/// without a word.
const FARTHEST_MM: f64 = 1e9;

/// Why a lens is impossible. Surfaces are counted from 1; lengths in mm.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum LensDefect {
    #[error("the lens has no surface")]
    NoSurface,
    #[error("the stop is surface {stop}, but the lens has {surfaces}")]
    NoStop { stop: usize, surfaces: usize },
    #[error("the lens has no {what}")]
    Nothing { what: &'static str },
    #[error("the entrance pupil diameter is {diameter_mm} mm, not a positive number")]
    Pupil { diameter_mm: f64 },
    #[error("the field of {field_deg} degrees is not within {limit_deg} degrees of the axis")]
    Field { field_deg: f64, limit_deg: f64 },
    #[error("surface {surface}: {quantity} is {value}, not a finite number")]
    NotFinite { surface: usize, quantity: &'static str, value: f64 },
    #[error("surface {surface}: {quantity} is {value_mm:e} mm, beyond {FARTHEST_MM:e} mm")]
    TooFar { surface: usize, quantity: &'static str, value_mm: f64 },
    #[error("surface {surface}: the clear semi-diameter is {semi_diameter_mm} mm, not positive")]
    SemiDiameter { surface: usize, semi_diameter_mm: f64 },
    #[error("surface {surface}: the thickness of {thickness_mm} mm of {medium} goes against the light")]
    CentreThickness { surface: usize, medium: String, thickness_mm: f64 },
    #[error(
        "surface {surface}: the shape ends {reach_mm:.4} mm from its vertex, inside its clear \
         semi-diameter of {semi_diameter_mm} mm"
    )]
    SurfaceEnds { surface: usize, reach_mm: f64, semi_diameter_mm: f64 },
    #[error(
        "surface {surface}: the edge thickness of {glass} is {thickness_mm:.4} mm at \
         {height_mm:.4} mm from the axis"
    )]
    EdgeThickness { surface: usize, glass: String, thickness_mm: f64, height_mm: f64 },
    #[error(
        "surfaces {surface} and {next} cross: the air gap is {gap_mm:.4} mm at {height_mm:.4} mm from \
         the axis"
    )]
    AirGap { surface: usize, next: usize, gap_mm: f64, height_mm: f64 },
    #[error("surface {surface}: the axis bends at a surface that is no mirror")]
    BendsWithoutMirror { surface: usize },
    #[error("surface {surface}: a thin lens is a plane, without a diffractive structure")]
    ThinLens { surface: usize },
    #[error("surface {surface}: a mirror has the medium of its front behind it, not {glass}")]
    MirrorMedium { surface: usize, glass: String },
    #[error("surface {surface}: {glass} has the index {index} at {wavelength_um} um")]
    Index { surface: usize, glass: String, wavelength_um: f64, index: f64 },
}

impl LensDefect {
    /// The surface at fault, from 1; `None` where it is the lens as a whole.
    pub fn surface(&self) -> Option<usize> {
        match self {
            Self::NoSurface
            | Self::NoStop { .. }
            | Self::Nothing { .. }
            | Self::Pupil { .. }
            | Self::Field { .. } => None,
            Self::NotFinite { surface, .. }
            | Self::TooFar { surface, .. }
            | Self::SemiDiameter { surface, .. }
            | Self::CentreThickness { surface, .. }
            | Self::SurfaceEnds { surface, .. }
            | Self::EdgeThickness { surface, .. }
            | Self::AirGap { surface, .. }
            | Self::BendsWithoutMirror { surface }
            | Self::ThinLens { surface }
            | Self::MirrorMedium { surface, .. }
            | Self::Index { surface, .. } => Some(*surface),
        }
    }
}

/// Checks that a lens can exist. Defects that no ray passes are reported before those that only prevent its manufacture, each kind from the front.
pub fn validate(lens: &Lens) -> Result<(), LensDefect> {
    traceable(lens)?;
    let solid = solid(lens);
    for Solid { index, surface, .. } in &solid {
        if lens.goes_against_the_light(*index) {
            let (medium, thickness_mm) = (surface.glass.name.clone(), surface.thickness_mm);
            return Err(LensDefect::CentreThickness { surface: index + 1, medium, thickness_mm });
        }
    }
    for pair in solid.windows(2) {
        let [front, back] = pair else { continue };
        // The distance between surfaces that are turned against each other is no question of their sags.
        if is_straight(&front.surface) && is_straight(&back.surface) {
            check_gap(front, back, lens.light_goes_forwards(front.index))?;
        }
    }
    Ok(())
}

/// A surface that glass or a mirror could run into. Two neighbours that are not turned have their points across the axis in the same coordinates.
struct Solid {
    /// From 0.
    index: usize,
    /// With the whole distance to the next one.
    surface: Surface,
    /// Where the axis in front of it lies, mm.
    axis_mm: [f64; 2],
    /// Where its vertex lies, mm.
    vertex_mm: [f64; 2],
}

/// The surfaces without planes that do nothing to light: these are no things, and the distances on both sides are joined.
fn solid(lens: &Lens) -> Vec<Solid> {
    let mut solid = Vec::with_capacity(lens.surfaces.len());
    let mut axis_mm = [0.0; 2];
    for (index, surface) in lens.surfaces.iter().enumerate() {
        let placement = surface.placement.unwrap_or_default();
        let [dx, dy] = placement.decenter_mm;
        let vertex_mm = [axis_mm[0] + dx, axis_mm[1] + dy];
        if !lens.is_idle_plane(index) {
            let surface = Surface { thickness_mm: lens.gap_behind_mm(index), ..surface.clone() };
            solid.push(Solid { index, surface, axis_mm, vertex_mm });
        }
        // Behind the surface the axis goes on where it was, or from the vertex.
        if placement.axis != Axis::Returns {
            axis_mm = vertex_mm;
        }
    }
    solid
}

/// Checks that every number of a lens has a meaning. Its surfaces may still cross and its glass be thinner than nothing, which is enough to begin an
/// optimisation.
pub fn traceable(lens: &Lens) -> Result<(), LensDefect> {
    if lens.surfaces.is_empty() {
        return Err(LensDefect::NoSurface);
    }
    if lens.stop >= lens.surfaces.len() {
        return Err(LensDefect::NoStop { stop: lens.stop + 1, surfaces: lens.surfaces.len() });
    }
    for (what, list) in [("wavelength", &lens.wavelengths_um), ("field", &lens.fields_deg)] {
        if list.is_empty() {
            return Err(LensDefect::Nothing { what });
        }
    }
    if !(lens.entrance_pupil_mm > 0.0 && lens.entrance_pupil_mm.is_finite()) {
        return Err(LensDefect::Pupil { diameter_mm: lens.entrance_pupil_mm });
    }
    let limit_deg = lens.object.field_limit_deg();
    let is_outside = |field: &f64| field.is_nan() || field.abs() >= limit_deg;
    if let Some(field_deg) = lens.fields_deg.iter().copied().find(is_outside) {
        return Err(LensDefect::Field { field_deg, limit_deg });
    }
    for (i, surface) in lens.surfaces.iter().enumerate() {
        check_surface(i + 1, surface, lens)?;
    }
    for (i, pair) in lens.surfaces.windows(2).enumerate() {
        let [front, back] = pair else { continue };
        if back.action == Action::Reflect && back.glass != front.glass {
            let glass = back.glass.name.clone();
            return Err(LensDefect::MirrorMedium { surface: i + 2, glass });
        }
    }
    Ok(())
}

/// Directions across the axis in which surfaces are looked at: one is enough where all are alike.
pub(crate) fn azimuths(surfaces: &[&Surface]) -> Vec<[f64; 2]> {
    let round = |s: &&Surface| {
        s.shape.is_rotationally_symmetric() && s.placement.is_none_or(|p| p.decenter_mm == [0.0; 2])
    };
    if surfaces.iter().all(round) { vec![[0.0, 1.0]] } else { all_azimuths() }
}

/// Directions across the axis, evenly around it.
fn all_azimuths() -> Vec<[f64; 2]> {
    let turn = |k: usize| (k as f64 / AZIMUTHS as f64 * std::f64::consts::TAU).sin_cos();
    (0..AZIMUTHS).map(turn).map(|(sin, cos)| [sin, cos]).collect()
}

fn is_straight(surface: &Surface) -> bool {
    surface.placement.is_none_or(|p| p.tilt_rad == [0.0; 3])
}

/// Checks a surface without its neighbours.
fn check_surface(number: usize, surface: &Surface, lens: &Lens) -> Result<(), LensDefect> {
    let shape = &surface.shape;
    let not_finite = |quantity, value: f64| LensDefect::NotFinite { surface: number, quantity, value };
    for (quantity, value) in [
        ("the curvature", shape.curvature),
        ("the conic constant", shape.conic),
        ("the thickness", surface.thickness_mm),
        ("the clear semi-diameter", surface.semi_diameter_mm),
    ] {
        if !value.is_finite() {
            return Err(not_finite(quantity, value));
        }
    }
    for (quantity, value_mm) in
        [("the thickness", surface.thickness_mm), ("the clear semi-diameter", surface.semi_diameter_mm)]
    {
        if value_mm.abs() > FARTHEST_MM {
            return Err(LensDefect::TooFar { surface: number, quantity, value_mm });
        }
    }
    if let Some(a) = shape.asphere.iter().find(|a| !a.is_finite()) {
        return Err(not_finite("an asphere coefficient", *a));
    }
    check_special(number, surface)?;
    if surface.semi_diameter_mm <= 0.0 {
        let semi_diameter_mm = surface.semi_diameter_mm;
        return Err(LensDefect::SemiDiameter { surface: number, semi_diameter_mm });
    }
    let semi_diameter_mm = surface.semi_diameter_mm;
    let reach_mm = azimuths(&[surface]).into_iter().map(|d| reach_mm(shape, d, semi_diameter_mm));
    let reach_mm = reach_mm.fold(f64::INFINITY, f64::min);
    if reach_mm < semi_diameter_mm {
        return Err(LensDefect::SurfaceEnds { surface: number, reach_mm, semi_diameter_mm });
    }
    for wavelength_um in lens.wavelengths_um.iter().copied().chain([lens.reference_um]) {
        let index = surface.glass.index(wavelength_um);
        if !(index > 0.0 && index.is_finite()) {
            let glass = surface.glass.name.clone();
            return Err(LensDefect::Index { surface: number, glass, wavelength_um, index });
        }
    }
    Ok(())
}

/// How far a shape reaches in a direction across the axis, `far_mm` at most.
pub(crate) fn reach_mm(shape: &SurfaceShape, direction: [f64; 2], far_mm: f64) -> f64 {
    let reaches = |r: f64| shape.sag_at_mm(direction.map(|v| v * r)).is_some();
    if reaches(far_mm) {
        return far_mm;
    }
    // Halve the range in which it ends.
    let (mut inside, mut outside) = (0.0, far_mm);
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        if reaches(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}

/// Checks the departure, the diffractive structure and the placement of a surface.
fn check_special(number: usize, surface: &Surface) -> Result<(), LensDefect> {
    let mut named: Vec<(&'static str, f64)> = Vec::new();
    named.extend(surface.shape.departure.numbers().into_iter().map(|v| ("a number of the departure", v)));
    named.extend(surface.shape.departure.norm_radius_mm().map(|v| ("the normalisation radius", v)));
    if let Some(phase) = &surface.phase {
        named.extend(phase.numbers().into_iter().map(|v| ("a number of the diffractive structure", v)));
    }
    if let Action::ThinLens { power_per_mm } = surface.action {
        named.push(("the power", power_per_mm));
        if surface.shape != SurfaceShape::PLANE || surface.phase.is_some() {
            return Err(LensDefect::ThinLens { surface: number });
        }
    }
    if let Some(placement) = &surface.placement {
        named.extend(placement.decenter_mm.map(|v| ("the decentre", v)));
        named.extend(placement.tilt_rad.map(|v| ("the tilt", v)));
        if placement.axis == Axis::Bends && surface.action != Action::Reflect {
            return Err(LensDefect::BendsWithoutMirror { surface: number });
        }
    }
    match named.into_iter().find(|(_, value)| !value.is_finite()) {
        Some((quantity, value)) => Err(LensDefect::NotFinite { surface: number, quantity, value }),
        None => Ok(()),
    }
}

/// Measures the distance between two surfaces over the clear apertures.
///
/// An element needs glass up to the larger of its two clear semi-diameters. Across air the smaller
/// one counts, since beyond it there is a mount and no surface.
fn check_gap(front: &Solid, back: &Solid, forwards: bool) -> Result<(), LensDefect> {
    let is_air = front.surface.glass.is_air();
    let [a, b] = [front, back].map(|s| s.surface.semi_diameter_mm);
    let by_back = if is_air { b < a } else { b > a };
    let (measured, other) = if by_back { (back, front) } else { (front, back) };
    let is_concentric = front.vertex_mm == back.vertex_mm;
    let directions = if is_concentric { azimuths(&[&front.surface, &back.surface]) } else { all_azimuths() };
    for (direction, i) in directions.iter().flat_map(|d| (1..=HEIGHTS).map(move |i| (d, i))) {
        let from_vertex_mm = measured.surface.semi_diameter_mm * i as f64 / HEIGHTS as f64;
        let at_mm = [0, 1].map(|k| measured.vertex_mm[k] + direction[k] * from_vertex_mm);
        let from = |origin: [f64; 2]| [at_mm[0] - origin[0], at_mm[1] - origin[1]];
        let distance_mm = |origin: [f64; 2]| from(origin)[0].hypot(from(origin)[1]);
        // Of two surfaces across air, a point counts that lies on both.
        if is_air && !is_concentric && distance_mm(other.vertex_mm) > other.surface.semi_diameter_mm {
            continue;
        }
        let sag_mm = |s: &Solid| rim_sag_mm(&s.surface, from(s.vertex_mm));
        let along_z = front.surface.thickness_mm + sag_mm(back) - sag_mm(front);
        let gap_mm = if forwards { along_z } else { -along_z };
        // Surfaces that touch are possible, and rounding must not part them.
        if gap_mm >= -1e-9 {
            continue;
        }
        let (surface, height_mm) = (front.index + 1, distance_mm(front.axis_mm));
        return Err(if is_air {
            LensDefect::AirGap { surface, next: back.index + 1, gap_mm, height_mm }
        } else {
            let glass = front.surface.glass.name.clone();
            LensDefect::EdgeThickness { surface, glass, thickness_mm: gap_mm, height_mm }
        });
    }
    Ok(())
}

/// Sag of a surface at a point from its vertex; it goes on as a flat rim where its shape ends beyond its clear edge.
fn rim_sag_mm(surface: &Surface, at_mm: [f64; 2]) -> f64 {
    let sag = |share: f64| surface.shape.sag_at_mm(at_mm.map(|v| v * share));
    let radius_mm = at_mm[0].hypot(at_mm[1]);
    sag(1.0).or_else(|| sag(surface.semi_diameter_mm / radius_mm)).unwrap_or(f64::NAN)
}
