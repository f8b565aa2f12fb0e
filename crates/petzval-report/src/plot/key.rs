//! Keys: the meaning of the colours, dashes and markers of a picture.

use maud::{Markup, html};

use super::{Marker, Pen, plain, px, width_of};
use crate::palette::INK;

/// Size of the text, length of a piece of line, height of a row, and space between entries, px.
const TEXT_PX: f64 = 12.5;
const LINE_PX: f64 = 26.0;
const ROW_PX: f64 = 20.0;
const GAP_PX: f64 = 20.0;

/// A name longer than this is cut.
const LONGEST_NAME: usize = 90;

/// An entry of a key.
#[derive(Clone, Debug)]
pub(crate) struct Key {
    /// Symbol before the name.
    pub line: KeyLine,
    /// The name.
    pub name: String,
}

/// The symbol of an entry.
#[derive(Clone, Debug)]
pub(crate) enum KeyLine {
    /// Nothing: the name is a remark.
    None,
    /// A piece of a curve.
    Pen(Pen),
    /// A marker by itself.
    Marker(String, Marker),
    /// A filled box.
    Fill(String),
}

impl Key {
    /// An entry for curves.
    pub fn pen(pen: Pen, name: impl Into<String>) -> Self {
        Self { line: KeyLine::Pen(pen), name: name.into() }
    }

    /// A remark without a line.
    pub fn remark(text: impl Into<String>) -> Self {
        Self { line: KeyLine::None, name: text.into() }
    }

    /// A name without a symbol; a long one is cut.
    pub fn name(text: &str) -> Self {
        let mut name: String = text.chars().take(LONGEST_NAME).collect();
        if name.len() < text.len() {
            name.push('…');
        }
        Self::remark(name)
    }

    fn sample_px(&self) -> f64 {
        match self.line {
            KeyLine::None => 0.0,
            KeyLine::Pen(_) => LINE_PX + 6.0,
            KeyLine::Marker(..) | KeyLine::Fill(_) => 16.0,
        }
    }

    fn width_px(&self) -> f64 {
        self.sample_px() + width_of(&self.name, TEXT_PX) + GAP_PX
    }

    fn draw(&self, x: f64, y: f64) -> Markup {
        let marker = |marker: Marker, colour: &str, at: f64| {
            let path = marker.path([[at, y]], 3.6);
            html! {
                @if marker.is_open() { path d=(path) stroke=(colour) stroke-width="1.7" {} }
                @else { path d=(path) fill=(colour) {} }
            }
        };
        html! {
            @match &self.line {
                KeyLine::None => {}
                KeyLine::Pen(pen) => {
                    path d=(format!("M{} {}h{LINE_PX}", px(x), px(y))) stroke=(pen.colour) stroke-width=(px(pen.width))
                        stroke-dasharray=[pen.dashes()] {}
                    @if let Some(shape) = pen.marker { (marker(shape, &pen.colour, x + 0.5 * LINE_PX)) }
                }
                KeyLine::Marker(colour, shape) => (marker(*shape, colour, x + 5.0)),
                KeyLine::Fill(colour) => {
                    rect x=(px(x)) y=(px(y - 5.0)) width="10" height="10" fill=(colour) {}
                }
            }
            text x=(px(x + self.sample_px())) y=(px(y + 0.35 * TEXT_PX)) fill=(INK) font-size=(TEXT_PX) { (plain(&self.name)) }
        }
    }
}

/// Positions of the entries in rows of a width: (entry, x, row), and the number of rows.
fn places(keys: &[Key], width: f64) -> (Vec<(&Key, f64, usize)>, usize) {
    let (mut x, mut row, mut placed) = (0.0, 0, Vec::new());
    for key in keys {
        if x > 0.0 && x + key.width_px() - GAP_PX > width {
            (x, row) = (0.0, row + 1);
        }
        placed.push((key, x, row));
        x += key.width_px();
    }
    (placed, if keys.is_empty() { 0 } else { row + 1 })
}

/// Height of a key in rows of a width, px.
pub(super) fn height(keys: &[Key], width: f64) -> f64 {
    ROW_PX * places(keys, width).1 as f64
}

/// The key in rows of a width from a place on.
pub(super) fn draw(keys: &[Key], [left, top]: [f64; 2], width: f64) -> Markup {
    html! {
        g class="key" {
            @for (key, x, row) in places(keys, width).0 {
                (key.draw(left + x, top + ROW_PX * (row as f64 + 0.5)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_name_is_cut() {
        assert_eq!(Key::name("short").name, "short");
        let long = Key::name(&"µ".repeat(200)).name;
        assert!(long.chars().count() == LONGEST_NAME + 1 && long.ends_with('…'));
    }

    #[test]
    fn a_long_key_goes_on_in_the_next_row() {
        let keys: Vec<Key> =
            (0..10).map(|i| Key { line: KeyLine::None, name: format!("entry number {i}") }).collect();
        let (placed, rows) = places(&keys, 400.0);
        assert!((2..=4).contains(&rows));
        assert!(placed.iter().all(|(key, x, _)| x + key.width_px() - GAP_PX <= 400.0));
        assert_eq!(height(&keys, 1e6), ROW_PX);
        assert_eq!(height(&[], 400.0), 0.0);
        // An entry wider than the row stands in a row of its own.
        assert_eq!(places(&keys[..2], 10.0).1, 2);
    }
}
