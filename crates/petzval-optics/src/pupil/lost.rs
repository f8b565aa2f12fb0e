//! Where a lens loses the light of a field.

use std::fmt;

use super::aim::aim_one;
use super::launch::paraxial_launch;
use crate::lens::Lens;
use crate::paraxial::first_order;
use crate::trace::{Fate, launch, trace_ray};

/// How a ray is lost at a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayLoss {
    /// It never meets the surface.
    Missed,
    /// It meets the surface outside its clear aperture.
    Clipped,
    /// It is totally reflected, or its order of diffraction is evanescent.
    NotPassed,
}

/// A ray of a field through the middle of the stop that is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LostRay {
    /// Its wavelength, um; `None` for the reference wavelength of the lens.
    pub wavelength_um: Option<f64>,
    /// Whether it was aimed through the real stop; otherwise no such ray was found, and this is the paraxial one.
    pub is_aimed: bool,
    /// The surface at which it is lost, 0-based.
    pub surface: usize,
    /// How it is lost there.
    pub loss: RayLoss,
}

impl fmt::Display for LostRay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(um) = self.wavelength_um {
            write!(f, "at {um} um ")?;
        }
        f.write_str(if self.is_aimed {
            "the ray through the middle of the stop"
        } else {
            "no ray through the middle of the stop is found, and the paraxial one"
        })?;
        let number = self.surface + 1;
        match self.loss {
            RayLoss::Missed => write!(f, " misses surface {number}"),
            RayLoss::Clipped => write!(f, " is clipped at surface {number}"),
            RayLoss::NotPassed => {
                write!(f, " does not pass surface {number}, by total reflection or an evanescent order")
            }
        }
    }
}

/// Where the ray of a field, rad, through the middle of the stop is lost: at the reference wavelength or, if it passes there, at the first of
/// `wavelengths_um`, um, at which it is lost. The paraxial ray is taken if none can be aimed there. `None` if all rays reach the image.
pub fn where_lost(lens: &Lens, field_rad: f64, wavelengths_um: &[f64]) -> Option<LostRay> {
    let others = wavelengths_um.iter().filter(|um| **um != lens.reference_um).map(|um| Some(*um));
    std::iter::once(None).chain(others).find_map(|wavelength_um| lost_at(lens, field_rad, wavelength_um))
}

/// [`where_lost`] at one wavelength, um; `None` for the reference wavelength.
fn lost_at(lens: &Lens, field_rad: f64, wavelength_um: Option<f64>) -> Option<LostRay> {
    let sequence = lens.at_wavelength(wavelength_um.unwrap_or(lens.reference_um));
    let order = first_order(&sequence);
    let aimed = aim_one(&sequence, field_rad, order.stop_radius_mm, [0.0; 2]);
    let at = aimed.unwrap_or_else(|| paraxial_launch(&order, &sequence, field_rad, [0.0; 2]));
    let (surface, loss) = match trace_ray(&sequence, launch(&sequence, field_rad, at).ray).fate {
        Fate::Missed(surface) => (surface, RayLoss::Missed),
        Fate::Clipped(surface) => (surface, RayLoss::Clipped),
        Fate::TotalReflection(surface) => (surface, RayLoss::NotPassed),
        Fate::Ok | Fate::NotAimed => return None,
    };
    Some(LostRay { wavelength_um, is_aimed: aimed.is_some(), surface, loss })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::glass::{Dispersion, Glass};
    use crate::lens::{ObjectDistance, Surface};

    /// A stop, and 1 mm behind it a plate of 10 mm with an index of 1.5 at 0.55 um and 1.2 at 0.45 um. At 30 degrees the ray through the middle of
    /// the stop leaves the plate 4.11 mm from the axis at 0.55 um, and 5.16 mm at 0.45 um.
    fn plate(semi_diameter_mm: f64) -> Lens {
        let index = Dispersion::Table { wavelength_um: vec![0.45, 0.55], index: vec![1.2, 1.5] };
        let surface = |thickness_mm: f64, glass: Arc<Glass>, semi_diameter_mm: f64| Surface {
            thickness_mm,
            glass,
            semi_diameter_mm,
            ..Surface::default()
        };
        Lens {
            name: "plate".into(),
            source: String::new(),
            surfaces: vec![
                surface(1.0, Glass::air(), 0.5),
                surface(10.0, Arc::new(Glass::new("step", index)), 10.0),
                surface(20.0, Glass::air(), semi_diameter_mm),
            ],
            stop: 0,
            entrance_pupil_mm: 1.0,
            object: ObjectDistance::Infinity,
            wavelengths_um: vec![0.45, 0.55],
            reference_um: 0.55,
            fields_deg: vec![0.0, 30.0],
        }
    }

    #[test]
    fn a_ray_that_is_lost_at_one_colour_alone_names_it() {
        let lost = |semi_diameter_mm: f64, field_deg: f64, wavelengths_um: &[f64]| {
            where_lost(&plate(semi_diameter_mm), field_deg.to_radians(), wavelengths_um)
        };
        let both = [0.45, 0.55];
        assert_eq!(lost(6.0, 30.0, &both), None);
        assert_eq!(lost(4.6, 0.0, &both), None);
        assert_eq!(lost(4.6, 30.0, &[]), None);
        let blue = lost(4.6, 30.0, &both).unwrap();
        let clipped =
            LostRay { wavelength_um: Some(0.45), is_aimed: true, surface: 2, loss: RayLoss::Clipped };
        assert_eq!(blue, clipped);
        let said = "the ray through the middle of the stop is clipped at surface 3";
        assert_eq!(blue.to_string(), format!("at 0.45 um {said}"));
        // Where the reference wavelength is lost, too, it is the one that is named.
        assert_eq!(lost(3.0, 30.0, &both).unwrap().to_string(), said);
    }
}
