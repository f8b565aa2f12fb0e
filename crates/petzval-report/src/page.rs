//! A report as one page: what the sheets of lenses, sensors and measured PSFs share.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A page that needs nothing but itself.
pub(crate) struct Page<'a> {
    /// In the title bar.
    pub title: Markup,
    /// Style sheet.
    pub style: &'a str,
    /// Above everything.
    pub headline: Markup,
    /// Below the headline.
    pub subtitle: Markup,
    /// Sections.
    pub main: Markup,
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
                    title { (self.title) }
                    style { (PreEscaped(self.style)) }
                }
                body {
                    header {
                        p.mark { "Petzval" }
                        h1 { (self.headline) }
                        p.subtitle { (self.subtitle) }
                    }
                    main { (self.main) }
                }
            }
        }
        .into_string()
    }
}
