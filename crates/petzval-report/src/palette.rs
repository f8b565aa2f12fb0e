//! Colours of drawings and of pages. Colour-blind readers can distinguish the colours of each set (Okabe and Ito,
//! "Color Universal Design", 2008). Drawings are on white paper in the dark colour scheme too, so that their colours
//! keep their meaning.

use petzval_camera::sensor::Colour;

/// Paper of drawings.
pub(crate) const PAPER: &str = "#ffffff";
/// Text and outlines in drawings.
pub(crate) const INK: &str = "#22272e";
/// Explanations in drawings, and curves that belong to no colour.
pub(crate) const MUTED: &str = "#5f6670";
/// Axes.
pub(crate) const AXIS: &str = "#969da6";
/// Grids.
pub(crate) const GRID: &str = "#e4e7eb";
/// Limits and marks behind the curves, and the range around a curve.
pub(crate) const LIMIT: &str = "#b3b9c1";
/// Values that an ideal instrument would have.
pub(crate) const IDEAL: &str = "#b8860b";

/// A colour of pages.
struct PageColour {
    /// Its name in the style sheet.
    name: &'static str,
    /// In the light colour scheme.
    light: &'static str,
    /// In the dark one.
    dark: &'static str,
    /// On printed paper.
    print: &'static str,
}

/// The colours of pages.
const PAGE: [PageColour; 9] = [
    PageColour { name: "paper", light: "#fbfbf9", dark: "#14171b", print: "#fff" },
    PageColour { name: "ink", light: "#1d2229", dark: "#e6e8eb", print: "#000" },
    PageColour { name: "muted", light: "#626a75", dark: "#98a1ad", print: "#444" },
    PageColour { name: "line", light: "#dcdfe3", dark: "#323840", print: "#ccc" },
    PageColour { name: "soft", light: "#f1f2f0", dark: "#1d2126", print: "#f4f4f4" },
    PageColour { name: "gain", light: "#14703f", dark: "#5cc98d", print: "#14703f" },
    PageColour { name: "loss", light: "#b0341d", dark: "#f08a6f", print: "#b0341d" },
    PageColour { name: "accent", light: "#0b5fa5", dark: "#6cb2f0", print: "#0b5fa5" },
    PageColour { name: "drawing", light: PAPER, dark: PAPER, print: PAPER },
];

/// The colours of pages as rules of a style sheet.
pub(crate) fn page_colours() -> String {
    let rule = |of: fn(&PageColour) -> &'static str| -> String {
        let colours: String = PAGE.iter().map(|c| format!("--{}:{};", c.name, of(c))).collect();
        format!(":root{{{colours}}}")
    };
    format!(
        ":root{{color-scheme:light dark;}}{}@media screen and (prefers-color-scheme: dark){{{}}}@media print{{{}}}\n",
        rule(|c| c.light),
        rule(|c| c.dark),
        rule(|c| c.print)
    )
}

/// Lines of cameras: the baseline is grey, the others are coloured.
const CAMERAS: [&str; 7] = ["#5f6670", "#0072b2", "#d55e00", "#009e73", "#aa4499", "#b98200", "#3a9bd0"];

/// Ray fans, from the axis outwards.
const FIELDS: [&str; 5] = ["#0072b2", "#009e73", "#d55e00", "#aa4499", "#b98200"];

/// Wavelengths from short to long, near their hues; a lens with few wavelengths uses colours that are far apart.
const WAVELENGTHS: [&str; 7] = ["#8a3ea6", "#0072b2", "#3a9bd0", "#009e73", "#b98200", "#d55e00", "#8c2d04"];

/// Indices of these colours, by the number of wavelengths.
const CHOICES: [&[usize]; 7] =
    [&[3], &[1, 5], &[1, 3, 5], &[1, 3, 4, 5], &[0, 1, 3, 4, 5], &[0, 1, 2, 3, 4, 5], &[0, 1, 2, 3, 4, 5, 6]];

/// Fill of a crown of high Abbe number, RGB.
const CROWN: [f64; 3] = [206.0, 226.0, 243.0];

/// Fill of a dense flint, RGB.
const FLINT: [f64; 3] = [244.0, 222.0, 190.0];

/// Colour of the i-th camera.
pub(crate) fn camera(i: usize) -> &'static str {
    CAMERAS[i % CAMERAS.len()]
}

/// Colour of the i-th field.
pub(crate) fn field(i: usize) -> &'static str {
    FIELDS[i % FIELDS.len()]
}

/// Colour of the i-th of a number of wavelengths, from the shortest.
pub(crate) fn wavelength(i: usize, count: usize) -> &'static str {
    let choice = CHOICES[count.clamp(1, CHOICES.len()) - 1];
    // More wavelengths than colours: neighbours share one and keep their markers.
    let place = if count > choice.len() { i * choice.len() / count } else { i };
    WAVELENGTHS[choice[place.min(choice.len() - 1)]]
}

/// A colour of the mosaic of a sensor; dark grey for pixels without a filter and for all pixels together.
pub(crate) fn mosaic(colour: Option<Colour>) -> &'static str {
    match colour {
        Some(Colour::Red) => "#c0392b",
        Some(Colour::Green) => "#238b45",
        Some(Colour::Blue) => "#2b62b8",
        Some(Colour::Clear) | None => INK,
    }
}

/// Fill of an element by its Abbe number: blue for crowns (V >= 55), sand for flints (V <= 25).
pub(crate) fn glass(vd: f64) -> String {
    let crown = if vd.is_finite() { ((vd - 25.0) / 30.0).clamp(0.0, 1.0) } else { 1.0 };
    let mix = |i: usize| (FLINT[i] + crown * (CROWN[i] - FLINT[i])).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}
