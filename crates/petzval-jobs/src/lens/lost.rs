//! What to say of a field whose light is lost.

use petzval_optics::lens::Lens;
use petzval_optics::pupil::where_lost;

/// That no ray of a field, degrees, reaches the image, and at which surface its light is lost.
pub(super) fn no_ray_at(lens: &Lens, field_deg: f64) -> String {
    let lost = where_lost(lens, field_deg.to_radians(), &lens.wavelengths_um);
    let cause = lost.map_or_else(String::new, |lost| format!(": {lost}"));
    format!("at {field_deg} degrees no ray reaches the image{cause}")
}
