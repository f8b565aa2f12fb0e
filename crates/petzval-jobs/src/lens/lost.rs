//! Where a lens loses the light of a field.

use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::{aim_one, paraxial_launch};
use petzval_optics::trace::{Fate, launch, trace_ray};

/// Where the ray of a field, rad, through the middle of the stop is lost, at the reference wavelength: the paraxial ray if none can be
/// aimed there. `None` if the ray reaches the image.
pub(crate) fn where_lost(lens: &Lens, field_rad: f64) -> Option<String> {
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    let aimed = aim_one(&sequence, field_rad, order.stop_radius_mm, [0.0; 2]);
    let ray = if aimed.is_some() {
        "the ray through the middle of the stop"
    } else {
        "no ray through the middle of the stop is found, and the paraxial one"
    };
    let at = aimed.unwrap_or_else(|| paraxial_launch(&order, &sequence, field_rad, [0.0; 2]));
    match trace_ray(&sequence, launch(&sequence, field_rad, at).ray).fate {
        Fate::Missed(i) => Some(format!("{ray} misses surface {}", i + 1)),
        Fate::TotalReflection(i) => {
            Some(format!("{ray} does not pass surface {}, by total reflection or an evanescent order", i + 1))
        }
        Fate::Clipped(i) => Some(format!("{ray} is clipped at surface {}", i + 1)),
        Fate::Ok | Fate::NotAimed => None,
    }
}
