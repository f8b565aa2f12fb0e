//! The frame of every page: head, style sheet, headline and sections, in one self-contained file.
//!
//! The style sheet has a light and a dark colour scheme, and one for paper.

use maud::{DOCTYPE, Markup, PreEscaped, Render, html};

use crate::palette;
use crate::plot::plain;

/// The rules of all pages.
const STYLE: &str = include_str!("page.css");

/// A page.
#[derive(Clone, Debug, Default)]
pub(crate) struct Page<'a> {
    /// In the title bar.
    pub title: String,
    /// Rules that only this page needs.
    pub style: &'a str,
    /// Above everything.
    pub headline: String,
    /// One line below the headline.
    pub subtitle: Markup,
    /// Further content above the sections.
    pub lead: Markup,
    /// Sections.
    pub main: Markup,
    /// A script with its elements; empty if there is none.
    pub script: Option<(Markup, &'a str)>,
}

impl Page<'_> {
    /// The page as HTML.
    pub fn html(self) -> String {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (plain(&self.title)) }
                    style { (PreEscaped(palette::page_colours())) (PreEscaped(STYLE)) (PreEscaped(self.style)) }
                }
                body {
                    header {
                        p.mark { "Petzval" }
                        h1 { (plain(&self.headline)) }
                        @if !self.subtitle.0.is_empty() { p.subtitle { (self.subtitle) } }
                        (self.lead)
                    }
                    main { (self.main) }
                    @if let Some((parts, script)) = self.script { (parts) script { (PreEscaped(script)) } }
                }
            }
        }
        .into_string()
    }
}

/// A section under a headline.
#[derive(Clone, Debug)]
pub(crate) struct Section {
    headline: String,
    body: Markup,
}

/// A section under a headline.
pub(crate) fn section(headline: impl Into<String>, body: Markup) -> Section {
    Section { headline: headline.into(), body }
}

impl Section {
    /// The headline in the form of a name that addresses can have.
    fn slug(&self) -> String {
        let words = self.headline.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("-").to_ascii_lowercase()
    }

    fn html(&self, id: &str) -> Markup {
        html! { section id=(id) { h2 { (plain(&self.headline)) } (self.body) } }
    }
}

impl Render for Section {
    fn render(&self) -> Markup {
        self.html(&self.slug())
    }
}

/// Sections below a list of their headlines, which lead to them.
pub(crate) fn with_contents(sections: &[Section]) -> Markup {
    let mut ids: Vec<String> = Vec::new();
    for section in sections {
        let slug = section.slug();
        let id = if ids.contains(&slug) || slug.is_empty() {
            format!("{slug}-section-{}", ids.len() + 1)
        } else {
            slug
        };
        ids.push(id);
    }
    html! {
        @if sections.len() > 1 {
            nav.contents aria-label="Contents" {
                @for (section, id) in sections.iter().zip(&ids) {
                    a href=(format!("#{id}")) { (plain(&section.headline)) }
                }
            }
        }
        @for (section, id) in sections.iter().zip(&ids) { (section.html(id)) }
    }
}

/// A drawing in the colours of the page. On a phone it stays so wide that its smallest text can be read, and scrolls in its frame.
pub(crate) fn figure(svg: &str) -> Markup {
    let width = least_width_px(svg).map(|px| format!("--least:{px:.0}px"));
    html! { figure style=[width] { (PreEscaped(palette::for_page(svg))) } }
}

/// Size below which a text cannot be read, px.
const SMALLEST_TEXT_PX: f64 = 10.0;

/// Width of a drawing at which its smallest text has [`SMALLEST_TEXT_PX`], px; none for one without a view box or text.
fn least_width_px(svg: &str) -> Option<f64> {
    let value = |start: &str| svg.split(start).nth(1)?.split('"').next();
    let width: f64 = value("viewBox=\"")?.split_whitespace().nth(2)?.parse().ok()?;
    let sizes =
        svg.split("font-size=\"").skip(1).filter_map(|rest| rest.split('"').next()?.parse::<f64>().ok());
    let smallest = sizes.filter(|size| *size > 0.0).min_by(f64::total_cmp)?;
    Some((width * SMALLEST_TEXT_PX / smallest).ceil())
}

/// The explanation of a table or a figure.
pub(crate) fn caption(text: impl Render) -> Markup {
    html! { p.caption { (text) } }
}

/// A number that a page begins with.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tile {
    /// The number with its error and unit.
    pub value: String,
    /// What it is.
    pub label: String,
    /// Whether it is an improvement; none for a plain figure, or a difference within its error.
    pub is_gain: Option<bool>,
}

/// Numbers in large type, three in a row.
pub(crate) fn numbers(tiles: &[Tile]) -> Markup {
    html! {
        dl.numbers {
            @for tile in tiles {
                div {
                    dd class=[tile.is_gain.map(|is_gain| if is_gain { "gain" } else { "loss" })] { (tile.value) }
                    dt { (tile.label) }
                }
            }
        }
    }
}

/// Names and values in two columns; unknown values are left out.
pub(crate) fn facts<'a>(rows: impl IntoIterator<Item = (&'a str, Option<String>)>) -> Markup {
    html! {
        dl.facts {
            @for (name, value) in rows {
                @if let Some(value) = value { div { dt { (plain(name)) } dd { (plain(&value)) } } }
            }
        }
    }
}

/// Checks every page. Each link has one target, and drawings have the colours of the page. Headings and drawings have words instead of
/// names of keys, and a phone shows no text below [`SMALLEST_TEXT_PX`].
#[cfg(test)]
pub(crate) fn assert_readable(page: &str) {
    assert_legible_on_a_phone(page);
    let values = |page: &str, start: &str| -> Vec<String> {
        page.split(start).skip(1).filter_map(|rest| Some(rest.split_once('"')?.0.to_owned())).collect()
    };
    let ids = values(page, " id=\"");
    for (i, id) in ids.iter().enumerate() {
        assert!(!id.is_empty() && !ids[..i].contains(id), "{id} is no name, or that of two elements");
    }
    for target in values(page, "href=\"#") {
        assert!(ids.contains(&target), "#{target} leads nowhere");
    }
    for name in page.split("var(--").skip(1).filter_map(|rest| rest.split([')', ',']).next()) {
        assert!(page.contains(&format!("--{name}:")), "--{name} has no value");
    }
    // What a test chart measures keeps its colour, in a figure with a class; glass is tinted by its dispersion.
    let figures = page.split("<figure").skip(1).filter_map(|rest| rest.split("</figure>").next());
    for figure in figures.filter(|figure| !figure.starts_with(" class")) {
        for element in figure.split('<').filter(|e| !e.starts_with("path class=\"element\"")) {
            assert!(!element.contains("=\"#"), "a fixed colour: {element}");
        }
    }
    for tag in ["h1", "h2", "h3", "th", "text", "summary"] {
        for text in
            page.split(&format!("<{tag}")).skip(1).filter_map(|rest| rest.split(&format!("</{tag}>")).next())
        {
            let text = text.split_once('>').map_or("", |(_, inside)| inside);
            // Keys of settings stand in code.
            if text.starts_with("<code>") {
                continue;
            }
            let is_key = |word: &str| {
                let letter = |c: Option<char>| c.is_some_and(|c| c.is_ascii_lowercase());
                let mut parts = word.split('_');
                letter(word.chars().next())
                    && parts.clone().count() > 1
                    && parts.all(|p| letter(p.chars().next()))
            };
            let words = text.split(|c: char| !(c.is_alphanumeric() || c == '_'));
            words.for_each(|word| assert!(!is_key(word), "the name of a key in <{tag}>: {text}"));
        }
    }
}

/// Checks that no text of a page is smaller than [`SMALLEST_TEXT_PX`] on a screen of 390 px: that of drawings by the width at which they
/// stay, that of elements by the style sheet.
#[cfg(test)]
fn assert_legible_on_a_phone(page: &str) {
    for drawing in page.split("<figure").skip(1).filter_map(|rest| rest.split("</figure>").next()) {
        let number = |start: &str, end: char| -> Option<f64> {
            drawing.split(start).nth(1)?.split([end, ' ']).next()?.trim_end_matches("px").parse().ok()
        };
        let Some(view_box) =
            drawing.split("viewBox=\"").nth(1).and_then(|v| v.split(['"', ' ']).nth(2)?.parse::<f64>().ok())
        else {
            continue;
        };
        // The width that is left between the margins of the page, or that at which the drawing stays.
        let shown = number("--least:", '"').unwrap_or(0.0).max(342.0);
        for size in drawing
            .split("font-size=\"")
            .skip(1)
            .filter_map(|rest| rest.split('"').next()?.parse::<f64>().ok())
        {
            let px = size * shown / view_box;
            assert!(
                px >= SMALLEST_TEXT_PX - 0.01,
                "{px} px in a drawing of {view_box} px: {}",
                &drawing[..200.min(drawing.len())]
            );
        }
    }
    let style = page.split("<style>").nth(1).and_then(|rest| rest.split("</style>").next()).unwrap_or("");
    for size in style.split("font-size:").skip(1).filter_map(|rest| rest.split([';', '}']).next()) {
        let size = size.trim();
        let px =
            size.strip_suffix("rem").map_or(f64::NAN, |rem| 16.0 * rem.parse::<f64>().unwrap_or(f64::NAN));
        // A size by the text around it has a floor of its own.
        assert!(px.is_nan() || px >= SMALLEST_TEXT_PX, "font-size: {size}");
        assert!(
            !size.ends_with("em") || size.ends_with("rem") || size.starts_with("max("),
            "font-size: {size}"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_stays_as_wide_as_its_smallest_text_needs() {
        let svg = "<svg viewBox=\"0 0 900 300\"><text font-size=\"12\">a</text><text font-size=\"11.5\">b</text></svg>";
        assert_eq!(least_width_px(svg), Some(783.0));
        let page = figure(svg).into_string();
        assert!(page.starts_with("<figure style=\"--least:783px\">"), "{page}");
        assert_legible_on_a_phone(&page);
        assert_eq!(least_width_px("<svg/>"), None);
    }

    #[test]
    #[should_panic(expected = "px in a drawing")]
    fn the_check_finds_small_text_in_drawings() {
        assert_legible_on_a_phone(
            "<figure><svg viewBox=\"0 0 900 300\"><text font-size=\"12\">a</text></svg></figure>",
        );
    }

    #[test]
    #[should_panic(expected = "font-size: .5rem")]
    fn the_check_finds_small_text_in_style_sheets() {
        assert_legible_on_a_phone("<style>p { font-size: .5rem; }</style>");
    }

    #[test]
    fn names_are_escaped_and_nothing_is_fetched() {
        let page = Page {
            title: "</title><script>".into(),
            headline: "a <b> \u{7}".into(),
            main: section("x & y", figure("<svg/>")).render(),
            ..Page::default()
        }
        .html();
        assert!(!page.contains("<script") && page.contains("a &lt;b&gt;") && !page.contains('\u{7}'));
        assert!(page.contains("<section id=\"x-y\"><h2>x &amp; y</h2><figure><svg/></figure>"));
        assert!(!page.contains("http") && !page.contains("url(") && !page.contains("@import"));
        assert_readable(&page);
    }

    #[test]
    fn contents_lead_to_every_section_even_if_headlines_are_equal() {
        let sections = ["Lenses", "Lenses", "Größe", "µ"].map(|headline| section(headline, html! {}));
        let page = with_contents(&sections).into_string();
        assert_eq!(page.matches("href=\"#").count(), 4);
        assert_readable(&page);
        // A list of one headline is none.
        assert!(!with_contents(&sections[..1]).into_string().contains("<nav"));
    }

    #[test]
    #[should_panic(expected = "the name of a key")]
    fn the_check_finds_keys_in_headings() {
        assert_readable("<table><th scope=\"col\">rms_spot</th></table>");
    }

    #[test]
    #[should_panic(expected = "leads nowhere")]
    fn the_check_finds_links_that_lead_nowhere() {
        assert_readable("<a href=\"#here\">here</a>");
    }

    #[test]
    #[should_panic(expected = "a fixed colour")]
    fn the_check_finds_fixed_colours() {
        assert_readable("<figure><path stroke=\"#123456\"/></figure>");
    }

    #[test]
    fn unknown_facts_have_no_line() {
        let list = facts([("a", Some("1 <mm>".to_owned())), ("b", None)]).into_string();
        assert!(list.contains("1 &lt;mm&gt;") && !list.contains("<dt>b</dt>"));
    }
}
