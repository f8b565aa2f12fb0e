//! Colours of drawings and of pages. Colour-blind readers can distinguish the colours of each set (Okabe and Ito,
//! "Color Universal Design", 2008).
//!
//! Drawings have the colours of the light scheme as they are, so that a file with one alone shows in any program. On a
//! page [`for_page`] turns them into variables, which follow the colour scheme.

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

/// Hues of curves and bars.
const BLUE: &str = "#0072b2";
const VERMILION: &str = "#d55e00";
const GREEN: &str = "#009e73";
const PURPLE: &str = "#aa4499";
const AMBER: &str = "#b98200";
const SKY: &str = "#3a9bd0";
const VIOLET: &str = "#8a3ea6";
const BROWN: &str = "#8c2d04";

/// Colours of classes of pixels: the set "muted" of Tol, then orange, brown and a dark gray (Tol, "Colour Schemes", SRON/EPS/TN/09-002, 2021).
const CLASSES: [[u8; 3]; 13] = [
    [0x88, 0xcc, 0xee],
    [0xcc, 0x66, 0x77],
    [0xdd, 0xcc, 0x77],
    [0x11, 0x77, 0x33],
    [0x33, 0x22, 0x88],
    [0xaa, 0x44, 0x99],
    [0x44, 0xaa, 0x99],
    [0x99, 0x99, 0x33],
    [0x88, 0x22, 0x55],
    [0xdd, 0xdd, 0xdd],
    [0xee, 0x77, 0x33],
    [0x66, 0x33, 0x33],
    [0x66, 0x66, 0x66],
];

/// The colour of a class of pixels by its number: red, green and blue. Of more than 13 classes colours are used again.
pub fn class_colour(class: usize) -> [u8; 3] {
    CLASSES[class % CLASSES.len()]
}

/// Colours of the mosaic of a sensor.
const FILTER_RED: &str = "#c0392b";
const FILTER_GREEN: &str = "#238b45";
const FILTER_BLUE: &str = "#2b62b8";

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
const PAGE: [PageColour; 8] = [
    PageColour { name: "paper", light: "#fbfbf9", dark: "#14171b", print: "#fff" },
    PageColour { name: "ink", light: "#1d2229", dark: "#e6e8eb", print: "#000" },
    PageColour { name: "muted", light: "#626a75", dark: "#98a1ad", print: "#444" },
    PageColour { name: "line", light: "#dcdfe3", dark: "#323840", print: "#ccc" },
    PageColour { name: "soft", light: "#f1f2f0", dark: "#1d2126", print: "#f4f4f4" },
    PageColour { name: "gain", light: "#14703f", dark: "#5cc98d", print: "#14703f" },
    PageColour { name: "loss", light: "#b0341d", dark: "#f08a6f", print: "#b0341d" },
    PageColour { name: "accent", light: "#0b5fa5", dark: "#6cb2f0", print: "#0b5fa5" },
];

/// A colour of drawings; on printed paper it is that of the light scheme.
const fn drawn(name: &'static str, light: &'static str, dark: &'static str) -> PageColour {
    PageColour { name, light, dark, print: light }
}

/// The colours of drawings on pages.
const DRAWN: [PageColour; 18] = [
    drawn("plot-paper", PAPER, "#1a1e23"),
    drawn("plot-ink", INK, "#e6e8eb"),
    drawn("plot-muted", MUTED, "#a3abb5"),
    drawn("plot-axis", AXIS, "#757d88"),
    drawn("plot-grid", GRID, "#2c3239"),
    drawn("plot-limit", LIMIT, "#59616b"),
    drawn("plot-ideal", IDEAL, "#d9a82e"),
    drawn("plot-blue", BLUE, "#4aa8e0"),
    drawn("plot-vermilion", VERMILION, "#f08a3c"),
    drawn("plot-green", GREEN, "#2cc79a"),
    drawn("plot-purple", PURPLE, "#d983c9"),
    drawn("plot-amber", AMBER, "#e0b03c"),
    drawn("plot-sky", SKY, "#8fd0f5"),
    drawn("plot-violet", VIOLET, "#bd84d6"),
    drawn("plot-brown", BROWN, "#c9713f"),
    drawn("plot-filter-red", FILTER_RED, "#f0776a"),
    drawn("plot-filter-green", FILTER_GREEN, "#55bf77"),
    drawn("plot-filter-blue", FILTER_BLUE, "#6f9ff0"),
];

/// The colours of pages and of their drawings as rules of a style sheet.
pub(crate) fn page_colours() -> String {
    let rule = |of: fn(&PageColour) -> &'static str| -> String {
        let all = PAGE.iter().chain(&DRAWN);
        let colours: String = all.map(|c| format!("--{}:{};", c.name, of(c))).collect();
        format!(":root{{{colours}}}")
    };
    format!(
        ":root{{color-scheme:light dark;}}{}@media screen and (prefers-color-scheme: dark){{{}}}@media print{{{}}}\n",
        rule(|c| c.light),
        rule(|c| c.dark),
        rule(|c| c.print)
    )
}

/// A drawing whose colours follow the colour scheme of the page.
///
/// Colours are whole values of attributes; the quotation marks of a text are escaped, so that no text is touched.
pub(crate) fn for_page(svg: &str) -> String {
    DRAWN.iter().fold(svg.to_owned(), |svg, colour| {
        svg.replace(&format!("\"{}\"", colour.light), &format!("\"{}\"", variable(colour.light)))
    })
}

/// A colour of drawings as the page has it.
fn variable(colour: &str) -> String {
    let known = DRAWN.iter().find(|c| c.light == colour);
    known.map_or_else(|| colour.to_owned(), |c| format!("var(--{})", c.name))
}

/// The colour of a camera for the elements of a page that show it.
pub(crate) fn camera_style(colour: &str) -> String {
    format!("--camera:{}", variable(colour))
}

/// Lines of cameras: the baseline is grey, the others are coloured.
const CAMERAS: [&str; 7] = [MUTED, BLUE, VERMILION, GREEN, PURPLE, AMBER, SKY];

/// Ray fans, from the axis outwards.
const FIELDS: [&str; 5] = [BLUE, GREEN, VERMILION, PURPLE, AMBER];

/// Wavelengths from short to long, near their hues; a lens with few wavelengths uses colours that are far apart.
const WAVELENGTHS: [&str; 7] = [VIOLET, BLUE, SKY, GREEN, AMBER, VERMILION, BROWN];

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
        Some(Colour::Red) => FILTER_RED,
        Some(Colour::Green) => FILTER_GREEN,
        Some(Colour::Blue) => FILTER_BLUE,
        Some(Colour::Clear) | None => INK,
    }
}

/// Fill of an element by its Abbe number: blue for crowns (V >= 55), sand for flints (V <= 25).
pub(crate) fn glass(vd: f64) -> String {
    let crown = if vd.is_finite() { ((vd - 25.0) / 30.0).clamp(0.0, 1.0) } else { 1.0 };
    let mix = |i: usize| (FLINT[i] + crown * (CROWN[i] - FLINT[i])).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_colour_of_a_drawing_is_a_variable_and_texts_stay() {
        let all: Vec<&str> = (0..7).flat_map(|i| [camera(i), field(i), wavelength(i, 7)]).collect();
        for colour in all.into_iter().chain([PAPER, INK, MUTED, AXIS, GRID, LIMIT, IDEAL]) {
            let page = for_page(&format!("<path stroke=\"{colour}\"/><text>{colour}</text>"));
            assert!(
                page.starts_with("<path stroke=\"var(--plot-") && page.contains(&format!("<text>{colour}<"))
            );
        }
        // No two colours of the light scheme are equal: each has one name.
        for (i, a) in DRAWN.iter().enumerate() {
            assert!(DRAWN[..i].iter().all(|b| b.light != a.light && b.dark != a.dark), "{}", a.name);
        }
    }
}
