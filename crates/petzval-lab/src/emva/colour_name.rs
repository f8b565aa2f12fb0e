//! Names of colours for headings and files.

use petzval_camera::sensor::Colour;

/// Letter of the colour in the pattern; `mono` for a sensor without filters.
pub fn colour_name(colour: Colour) -> &'static str {
    match colour {
        Colour::Clear => "mono",
        filtered => filtered.name(),
    }
}
