//! Lenses that cannot be made: glass thinner than nothing, surfaces that cross or end too soon.
//!
//! Whether rays get through is another question, which only tracing answers.

use super::{Action, Axis, Lens, Surface, SurfaceShape};

/// Radii at which the distance between two surfaces is looked at, from axis to edge.
const HEIGHTS: usize = 32;

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
    #[error("surface {surface}: {quantity} is {value}, not a finite number")]
    NotFinite { surface: usize, quantity: &'static str, value: f64 },
    #[error("surface {surface}: the clear semi-diameter is {semi_diameter_mm} mm, not positive")]
    SemiDiameter { surface: usize, semi_diameter_mm: f64 },
    #[error("surface {surface}: the centre thickness of {medium} is {thickness_mm} mm")]
    CentreThickness { surface: usize, medium: String, thickness_mm: f64 },
    #[error(
        "surface {surface}: the conic ends {reach_mm:.4} mm from the axis, inside its clear \
         semi-diameter of {semi_diameter_mm} mm"
    )]
    SurfaceEnds { surface: usize, reach_mm: f64, semi_diameter_mm: f64 },
    #[error(
        "surface {surface}: the edge thickness of {glass} is {thickness_mm:.4} mm at \
         {height_mm:.4} mm from the axis"
    )]
    EdgeThickness { surface: usize, glass: String, thickness_mm: f64, height_mm: f64 },
    #[error(
        "surfaces {surface} and {} cross: the air gap is {gap_mm:.4} mm at {height_mm:.4} mm from \
         the axis", surface + 1
    )]
    AirGap { surface: usize, gap_mm: f64, height_mm: f64 },
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
            Self::NoSurface | Self::NoStop { .. } | Self::Nothing { .. } | Self::Pupil { .. } => None,
            Self::NotFinite { surface, .. }
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

/// Check that a lens can exist. The first defect from the front is reported.
pub fn validate(lens: &Lens) -> Result<(), LensDefect> {
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
    for (i, surface) in lens.surfaces.iter().enumerate() {
        check_surface(i + 1, surface, lens)?;
    }
    for (i, pair) in lens.surfaces.windows(2).enumerate() {
        let [front, back] = pair else { continue };
        if back.action == Action::Reflect && back.glass != front.glass {
            let glass = back.glass.name.clone();
            return Err(LensDefect::MirrorMedium { surface: i + 2, glass });
        }
        // The distance between surfaces that are turned against each other is no question of their sags.
        if is_straight(front) && is_straight(back) {
            check_gap(i + 1, front, back, lens.light_goes_forwards(i))?;
        }
    }
    Ok(())
}

fn is_straight(surface: &Surface) -> bool {
    surface.placement.is_none_or(|p| p.tilt_rad == [0.0; 3])
}

/// What can be said of a surface without its neighbours.
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
    if let Some(a) = shape.asphere.iter().find(|a| !a.is_finite()) {
        return Err(not_finite("an asphere coefficient", *a));
    }
    check_special(number, surface)?;
    if surface.semi_diameter_mm <= 0.0 {
        let semi_diameter_mm = surface.semi_diameter_mm;
        return Err(LensDefect::SemiDiameter { surface: number, semi_diameter_mm });
    }
    let forwards = lens.light_goes_forwards(number - 1);
    if (forwards && surface.thickness_mm < 0.0) || (!forwards && surface.thickness_mm > 0.0) {
        return Err(LensDefect::CentreThickness {
            surface: number,
            medium: surface.glass.name.clone(),
            thickness_mm: surface.thickness_mm,
        });
    }
    let [r, o] = [surface.semi_diameter_mm, 0.0];
    if shape.sag_mm(r).is_none() || [[o, -r], [r, o], [-r, o]].iter().any(|p| shape.sag_at_mm(*p).is_none()) {
        return Err(LensDefect::SurfaceEnds {
            surface: number,
            reach_mm: 1.0 / (shape.curvature.abs() * (1.0 + shape.conic).sqrt()),
            semi_diameter_mm: surface.semi_diameter_mm,
        });
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

/// What can be said of departures, structures and places.
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

/// Measure the distance between two surfaces from the axis outwards.
///
/// An element needs glass up to the larger of its two clear semi-diameters. Across air the smaller
/// one counts, since beyond it there is a mount and no surface.
fn check_gap(number: usize, front: &Surface, back: &Surface, forwards: bool) -> Result<(), LensDefect> {
    let (a, b) = (front.semi_diameter_mm, back.semi_diameter_mm);
    let edge_mm = if front.glass.is_air() { a.min(b) } else { a.max(b) };
    for i in 1..=HEIGHTS {
        let height_mm = edge_mm * i as f64 / HEIGHTS as f64;
        let along_z = front.thickness_mm + rim_sag_mm(back, height_mm) - rim_sag_mm(front, height_mm);
        let gap_mm = if forwards { along_z } else { -along_z };
        // Surfaces that touch are possible, and rounding must not part them.
        if gap_mm >= -1e-9 {
            continue;
        }
        return Err(match front.glass.is_air() {
            true => LensDefect::AirGap { surface: number, gap_mm, height_mm },
            false => LensDefect::EdgeThickness {
                surface: number,
                glass: front.glass.name.clone(),
                thickness_mm: gap_mm,
                height_mm,
            },
        });
    }
    Ok(())
}

/// Sag of a surface, which goes on as a flat rim where its conic ends beyond its clear edge.
fn rim_sag_mm(surface: &Surface, height_mm: f64) -> f64 {
    let at = |r_mm: f64| surface.shape.sag_mm(r_mm);
    at(height_mm).or_else(|| at(surface.semi_diameter_mm)).unwrap_or(f64::NAN)
}
