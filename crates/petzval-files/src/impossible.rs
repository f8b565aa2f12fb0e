//! Which number of a file makes a lens impossible, and what to do about it.

use petzval_optics::lens::LensDefect;

/// What of a surface a defect is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Culprit {
    Thickness,
    SemiDiameter,
    Placement,
    ThinLens,
    Glass,
    /// Another number, or the lens as a whole.
    Other,
}

impl Culprit {
    pub fn of(defect: &LensDefect) -> Self {
        match defect {
            LensDefect::TooFar { quantity, .. } | LensDefect::NotFinite { quantity, .. } => {
                Self::of_quantity(quantity)
            }
            LensDefect::CentreThickness { .. }
            | LensDefect::EdgeThickness { .. }
            | LensDefect::AirGap { .. } => Self::Thickness,
            LensDefect::SemiDiameter { .. } | LensDefect::SurfaceEnds { .. } => Self::SemiDiameter,
            LensDefect::BendsWithoutMirror { .. } => Self::Placement,
            LensDefect::ThinLens { .. } => Self::ThinLens,
            LensDefect::MirrorMedium { .. } | LensDefect::Index { .. } => Self::Glass,
            LensDefect::NoSurface
            | LensDefect::NoStop { .. }
            | LensDefect::Nothing { .. }
            | LensDefect::Pupil { .. }
            | LensDefect::Field { .. } => Self::Other,
        }
    }

    fn of_quantity(quantity: &str) -> Self {
        if quantity.contains("thickness") {
            Self::Thickness
        } else if quantity.contains("semi-diameter") {
            Self::SemiDiameter
        } else {
            Self::Other
        }
    }
}

/// The surfaces, from 0, whose clear semi-diameters matter for a defect.
pub(crate) fn measured_surfaces(defect: &LensDefect) -> Vec<usize> {
    match defect {
        LensDefect::EdgeThickness { surface, .. } => vec![surface - 1, *surface],
        LensDefect::AirGap { surface, next, .. } => vec![surface - 1, next - 1],
        LensDefect::SurfaceEnds { surface, .. } => vec![surface - 1],
        _ => Vec::new(),
    }
}

/// What to do about a defect. `follows_beam` says whether a semi-diameter of its [`measured_surfaces`] follows from the beam.
pub(crate) fn hint(defect: &LensDefect, follows_beam: bool) -> &'static str {
    match defect {
        LensDefect::CentreThickness { .. } => {
            "it is at least 0; behind an odd number of mirrors it is at most 0, because light travels back"
        }
        LensDefect::TooFar { .. } => "lengths are in mm",
        LensDefect::NotFinite { .. } => "every number of a surface is finite",
        LensDefect::SemiDiameter { .. } => "a clear semi-diameter is above 0",
        LensDefect::BendsWithoutMirror { .. } => "only a mirror bends the axis; let it follow or return",
        LensDefect::ThinLens { .. } => "give it an infinite radius, and no other number of a shape",
        LensDefect::EdgeThickness { .. } | LensDefect::AirGap { .. } if follows_beam => {
            "raise the thickness, or narrow the beam: semi-diameters that are not fixed follow from it"
        }
        LensDefect::EdgeThickness { .. } | LensDefect::AirGap { .. } => {
            "raise the thickness, or lower the semi-diameters"
        }
        LensDefect::SurfaceEnds { .. } if follows_beam => "narrow the beam, or flatten the surface",
        LensDefect::SurfaceEnds { .. } => "lower the semi-diameter, or flatten the surface",
        LensDefect::MirrorMedium { .. } => "leave the glass of the mirror out",
        LensDefect::Index { .. } => "the formula does not hold at this wavelength",
        LensDefect::Pupil { .. } => "the diameter of the entrance pupil is above 0",
        LensDefect::Field { .. } => "leave wider fields out",
        LensDefect::NoSurface | LensDefect::NoStop { .. } | LensDefect::Nothing { .. } => {
            "a lens has surfaces, a stop among them, wavelengths and fields"
        }
    }
}
