//! The numbers of a lens as a report names them.

use petzval_files::lens_toml::parameter_name;
use petzval_optics::lens::Lens;
use petzval_optics::number::Number;

/// A number with its surface: `V1 front: radius`.
pub fn full_name(lens: &Lens, surface: usize, number: Number) -> String {
    format!("{}: {}", surface_name(lens, surface), name(lens, surface, number))
}

/// The label of a surface, or its place.
pub fn surface_name(lens: &Lens, surface: usize) -> String {
    let label = &lens.surfaces[surface].label;
    if label.is_empty() { format!("surface {}", surface + 1) } else { label.clone() }
}

/// A number without its surface.
pub fn name(lens: &Lens, surface: usize, number: Number) -> String {
    match number {
        Number::Curvature => "radius".to_owned(),
        Number::Conic => "conic constant".to_owned(),
        Number::Asphere(j) => format!("a{}", 2 * j + 2),
        Number::Thickness if surface + 1 == lens.surfaces.len() => "distance to the image".to_owned(),
        Number::Thickness => "distance to the next surface".to_owned(),
        _ => parameter_name(&lens.surfaces[surface], number),
    }
}

/// The unit in which a number is stated.
pub fn unit_of(number: Number) -> String {
    match number {
        Number::Curvature | Number::Thickness | Number::SemiDiameter | Number::Decenter(_) => "mm".to_owned(),
        Number::Conic | Number::Index | Number::Departure(_) | Number::Phase(_) => String::new(),
        Number::Power => "1/mm".to_owned(),
        Number::Tilt(_) => "deg".to_owned(),
        Number::Asphere(j) => format!("mm^{}", -1 - 2 * j as i64),
    }
}
