//! Names of colours for headings and files.

use petzval_camera::sensor::Colour;

/// The letter of the pattern; `mono` for a sensor without filters.
pub fn colour_name(colour: Colour) -> &'static str {
    match colour {
        Colour::Clear => "mono",
        filtered => filtered.name(),
    }
}
