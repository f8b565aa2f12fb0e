//! Sheets: whole pictures, with a headline, a key, and a foot that names the lens.

use maud::{Markup, html};

use super::key::{self, Key};
use super::text::{plain, px};
use crate::palette::{INK, MUTED, PAPER};

/// Width of the sheets of a page, px.
pub(crate) const WIDTH_PX: f64 = 908.0;

/// Space at the left and right edge, px.
const MARGIN_PX: f64 = 18.0;

/// A picture.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sheet {
    /// Kind of the picture: the class of the SVG.
    pub class: &'static str,
    /// Headline; empty if the page has one.
    pub title: String,
    /// A line below it.
    pub remark: String,
    /// Key below that.
    pub keys: Vec<Key>,
    /// Description of the picture for readers who cannot see it.
    pub alt: String,
    /// Size of the body, px.
    pub width: f64,
    pub height: f64,
    /// The picture itself, from its own upper left corner.
    pub body: Markup,
    /// The lens and its colours, at the foot.
    pub foot: Vec<Key>,
}

impl Sheet {
    /// The picture as a stand-alone SVG on white.
    pub fn svg(&self) -> String {
        let inside = self.width - 2.0 * MARGIN_PX;
        // A sheet without a headline begins with its key.
        let title_px = if self.title.is_empty() { 10.0 } else { 38.0 };
        let key_top = title_px + if self.remark.is_empty() { 0.0 } else { 17.0 };
        let body_top = key_top + key::height(&self.keys, inside);
        let foot_top = body_top + self.height;
        let foot_px = if self.foot.is_empty() { 0.0 } else { key::height(&self.foot, inside) + 12.0 };
        let height = foot_top + foot_px;
        html! {
            svg xmlns="http://www.w3.org/2000/svg" class=(self.class) role="img" aria-label=(plain(&self.alt))
                viewBox=(format!("0 0 {} {}", px(self.width), px(height))) width=(px(self.width)) height=(px(height))
                font-family="system-ui, sans-serif" fill="none" stroke-linejoin="round" {
                rect width="100%" height="100%" fill=(PAPER) {}
                @if !self.title.is_empty() {
                    text x=(px(MARGIN_PX)) y="27" fill=(INK) font-size="17" font-weight="600" { (plain(&self.title)) }
                }
                @if !self.remark.is_empty() {
                    text x=(px(MARGIN_PX)) y=(px(title_px + 8.0)) fill=(MUTED) font-size="12.5" { (plain(&self.remark)) }
                }
                (key::draw(&self.keys, [MARGIN_PX, key_top], inside))
                g class="body" transform=(format!("translate(0 {})", px(body_top))) { (self.body) }
                (key::draw(&self.foot, [MARGIN_PX, foot_top], inside))
            }
        }
        .into_string()
    }
}

/// A picture of a width that says that there are no data.
pub(super) fn without_data(alt: &str, width: f64) -> Sheet {
    Sheet {
        class: "chart",
        keys: vec![Key::remark("no data")],
        alt: alt.into(),
        width,
        height: 20.0,
        ..Sheet::default()
    }
}
