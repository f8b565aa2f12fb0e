//! Constraints as people state them: the figure itself and its bound, in one unit.

use super::{Constraint, direction_of_light, reach};
use crate::lens::Lens;
use crate::paraxial::{first_order, image_height_per_tangent};
use crate::pupil::chief_ray;

/// The figure of a lens that a constraint bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    /// What the lens reaches, in the unit.
    pub value: f64,
    /// The unit in which the bound is given: mm, degrees or percent.
    pub unit: &'static str,
    /// The bound in words, in that unit: `at most 11`.
    pub bound: String,
}

impl Constraint {
    /// The bounded figure of a lens that is `excess_mm` beyond the bound, at its clear semi-diameters. `None` if a ray that it needs is lost.
    pub fn stated(&self, lens: &Lens, excess_mm: f64) -> Option<Stated> {
        let sequence = || lens.at_wavelength(lens.reference_um);
        let mm = |value: f64, bound: String| Some(Stated { value, unit: "mm", bound });
        let degrees = |tangent: f64, greatest_rad: f64| {
            let bound = format!("at most {}", short(greatest_rad.to_degrees()));
            Some(Stated { value: tangent.atan().to_degrees(), unit: "degrees", bound })
        };
        let stated = match *self {
            Self::Edge { least_mm, .. }
            | Self::Centre { least_mm, .. }
            | Self::Air { least_mm, .. }
            | Self::AirEdge { least_mm, .. }
            | Self::ImageDistance { least_mm } => {
                mm(least_mm - excess_mm, format!("at least {}", short(least_mm)))
            }
            Self::Reach { surface } => {
                let reach_mm = reach(&lens.surfaces[surface].shape)?;
                mm(reach_mm, format!("at least {}", short(reach_mm + excess_mm)))
            }
            Self::SolvedRadius { surface, radius_mm } => {
                mm(1.0 / lens.surfaces[surface].shape.curvature, between(radius_mm))
            }
            Self::FocalLength { between_mm } => mm(first_order(&sequence()).efl_mm, between(between_mm)),
            Self::BackFocal { between_mm } => {
                let direction = direction_of_light(lens, lens.surfaces.len() - 1);
                mm(direction * first_order(&sequence()).bfl_mm, between(between_mm))
            }
            Self::Track { most_mm } => mm(most_mm + excess_mm, format!("at most {}", short(most_mm))),
            Self::ClearDiameter { most_mm, .. } => {
                mm(most_mm + 2.0 * excess_mm, format!("at most {}", short(most_mm)))
            }
            Self::Distortion { field_rad, share } => {
                let ideal_mm = (image_height_per_tangent(&sequence()) * field_rad.tan()).abs();
                let value = 100.0 * (share + excess_mm / ideal_mm);
                Some(Stated { value, unit: "%", bound: format!("at most {}", short(100.0 * share)) })
            }
            Self::Slope { surface, steepest_rad } => {
                let radius_mm = lens.surfaces[surface].semi_diameter_mm;
                degrees(steepest_rad.tan() + excess_mm / radius_mm, steepest_rad)
            }
            Self::ChiefRayAngle { greatest_rad, .. } => {
                let bfl_mm = first_order(&sequence()).bfl_mm.abs();
                degrees(greatest_rad.tan() + excess_mm / bfl_mm, greatest_rad)
            }
            Self::ChiefHeight { field_rad, wanted_mm, tolerance_mm } => {
                let height_mm = chief_ray(&sequence(), field_rad)?.y_mm;
                mm(height_mm, between([wanted_mm - tolerance_mm, wanted_mm + tolerance_mm]))
            }
            Self::Light { least, scale_mm, .. } => {
                let value = 100.0 * (least - excess_mm / scale_mm);
                Some(Stated { value, unit: "%", bound: format!("at least {}", short(100.0 * least)) })
            }
        };
        // Field 0 has no distortion.
        stated.filter(|stated| stated.value.is_finite())
    }
}

/// A length beyond which a bound is none, mm.
const FAR_MM: f64 = 9e5;

/// Bounds on either side, mm.
fn between([least, most]: [f64; 2]) -> String {
    match (least > -FAR_MM, most < FAR_MM) {
        (true, false) => format!("at least {}", short(least)),
        (false, true) => format!("at most {}", short(most)),
        _ => format!("from {} to {}", short(least), short(most)),
    }
}

/// A bound to a thousandth, and a small one to three digits, without zeros at its end.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let text = if value.abs() < 0.1 {
        let decimals = (2.0 - value.abs().log10().floor()) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.3}")
    };
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::{between, short};

    #[test]
    fn bounds_are_as_they_were_given() {
        assert_eq!([short(11.0), short(0.5), short(49.9999), short(-3.25)], ["11", "0.5", "50", "-3.25"]);
        assert_eq!([short(0.0), short(-0.0), short(0.01), short(-0.000_12)], ["0", "0", "0.01", "-0.00012"]);
        assert_eq!(between([24.0, 25.0]), "from 24 to 25");
        assert_eq!(between([50.0001, 999_999.999_9]), "at least 50");
        assert_eq!(between([-999_999.999_9, 8.0]), "at most 8");
    }
}
