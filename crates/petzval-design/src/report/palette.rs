//! Colours: of cameras, of fields, of glass. All sets are told apart by colour-blind readers (Okabe and
//! Ito, "Color Universal Design", 2008) and stand on white.

use petzval_optics::glass::Glass;

use super::CameraView;

/// Lines of cameras: the baseline is grey, the rest stand out from it.
const CAMERAS: [&str; 7] = ["#5f6670", "#0072b2", "#d55e00", "#009e73", "#aa4499", "#b98200", "#3a9bd0"];

/// Ray fans, from the axis outwards.
const FIELDS: [&str; 5] = ["#0072b2", "#009e73", "#d55e00", "#aa4499", "#b98200"];

/// Fill of a crown of high Abbe number, RGB.
const CROWN: [f64; 3] = [206.0, 226.0, 243.0];

/// Fill of a dense flint, RGB.
const FLINT: [f64; 3] = [244.0, 222.0, 190.0];

/// Colour of the i-th camera.
pub(super) fn camera(i: usize) -> &'static str {
    CAMERAS[i % CAMERAS.len()]
}

/// Colour of a camera by its name; a name without a camera takes the colour after theirs.
pub(super) fn camera_named(cameras: &[CameraView], name: &str, i: usize) -> &'static str {
    camera(cameras.iter().position(|c| c.name == name).unwrap_or(cameras.len() + i))
}

/// Colour of the i-th field.
pub(super) fn field(i: usize) -> &'static str {
    FIELDS[i % FIELDS.len()]
}

/// Fill of an element by its dispersion: blue for crowns (V >= 55), sand for flints (V <= 25).
pub(super) fn glass(glass: &Glass) -> String {
    let crown = ((glass.abbe_vd() - 25.0) / 30.0).clamp(0.0, 1.0);
    let mix = |i: usize| (FLINT[i] + crown * (CROWN[i] - FLINT[i])).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// Red, green and blue of a `#rrggbb` colour; grey if it is not one.
pub(super) fn rgb(hex: &str) -> [u8; 3] {
    let part = |i: usize| hex.get(i..i + 2).and_then(|h| u8::from_str_radix(h, 16).ok()).unwrap_or(128);
    [part(1), part(3), part(5)]
}
