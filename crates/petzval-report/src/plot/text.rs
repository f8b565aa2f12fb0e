//! Coordinates and names as text for SVG.

/// Mean width of a character, relative to the size of its font.
const CHARACTER: f64 = 0.56;

/// Largest coordinate in a file, px: drawing programs cannot handle much larger numbers.
const FARTHEST_PX: f64 = 1e5;

/// A coordinate for SVG, to a hundredth; a value that is not finite becomes 0.
pub(crate) fn px(value: f64) -> String {
    if !value.is_finite() {
        return "0".into();
    }
    let text = format!("{:.2}", value.clamp(-FARTHEST_PX, FARTHEST_PX));
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}

/// Width of a text in a font of a size, px, estimated without the font.
pub(crate) fn width_of(text: &str, size: f64) -> f64 {
    CHARACTER * size * text.chars().count() as f64
}

/// A text without the characters that XML does not allow.
pub(crate) fn plain(text: &str) -> String {
    let fits = |c: char| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}');
    text.chars().map(|c| if fits(c) { c } else { ' ' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_finite() {
        assert_eq!(px(1.0), "1");
        assert_eq!(px(-0.001), "0");
        assert_eq!(px(-2.5), "-2.5");
        assert_eq!(px(100.0), "100");
        assert_eq!(px(f64::NAN), "0");
        assert_eq!(px(1e300), "100000");
    }

    #[test]
    fn a_name_loses_what_xml_cannot_hold() {
        assert_eq!(plain("a\u{7}b\u{ffff}µ"), "a b µ");
    }
}
