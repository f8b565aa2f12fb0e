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
pub(crate) fn section(headline: impl Render, body: Markup) -> Markup {
    html! { section { h2 { (headline) } (body) } }
}

/// A drawing on white paper.
pub(crate) fn figure(svg: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) } }
}

/// The explanation of a table or a figure.
pub(crate) fn caption(text: impl Render) -> Markup {
    html! { p.caption { (text) } }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped_and_nothing_is_fetched() {
        let page = Page {
            title: "</title><script>".into(),
            headline: "a <b> \u{7}".into(),
            main: section("x & y", figure("<svg/>")),
            ..Page::default()
        }
        .html();
        assert!(!page.contains("<script") && page.contains("a &lt;b&gt;") && !page.contains('\u{7}'));
        assert!(page.contains("<h2>x &amp; y</h2><figure><svg/></figure>"));
        assert!(!page.contains("http") && !page.contains("url(") && !page.contains("@import"));
        // Every colour that a rule uses has a value.
        for name in page.split("var(--").skip(1).filter_map(|rest| rest.split([')', ',']).next()) {
            assert!(page.contains(&format!("--{name}:")), "{name}");
        }
    }

    #[test]
    fn unknown_facts_have_no_line() {
        let list = facts([("a", Some("1 <mm>".to_owned())), ("b", None)]).into_string();
        assert!(list.contains("1 &lt;mm&gt;") && !list.contains("<dt>b</dt>"));
    }
}
