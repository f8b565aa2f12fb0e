//! Why numbers of a table are not resolved: a mark in the cell, and one list of the reasons below the table.

use maud::{Markup, html};
use petzval_camera::emva::{Measured, Unresolved};

use super::style::with_error;

/// The reasons of a table in the order in which they came up.
#[derive(Debug, Default)]
pub(super) struct Reasons {
    all: Vec<String>,
}

impl Reasons {
    /// A measured value, or the number of the reason why there is none.
    pub fn cell(&mut self, value: &Measured) -> Markup {
        if let Some(text) = with_error(value) {
            return html! { (text) };
        }
        let Some(why) = value.reason() else { return html! { "–" } };
        let (reason, found) = match why {
            Unresolved::WithinNoise { value, standard_error } => (
                "within two standard errors of zero".to_owned(),
                with_error(&Measured::new(value, standard_error)),
            ),
            Unresolved::NegativeVariance(_) => ("the variance is negative".to_owned(), None),
            other => (other.to_string(), None),
        };
        let number = self.number(reason);
        html! {
            span.unresolved { "not resolved" sup { (number) } }
            @if let Some(found) = found { span.why { (found) } }
        }
    }

    /// Counted from 1; the same reason has the same number.
    fn number(&mut self, reason: String) -> usize {
        let place = self.all.iter().position(|r| *r == reason).unwrap_or_else(|| {
            self.all.push(reason);
            self.all.len() - 1
        });
        place + 1
    }

    /// The list that stands below the table.
    pub fn list(&self) -> Markup {
        html! {
            @if !self.all.is_empty() {
                p.caption.reasons {
                    "Not resolved: "
                    @for (i, reason) in self.all.iter().enumerate() {
                        @if i > 0 { "; " }
                        sup { (i + 1) } " " (reason)
                    }
                    "."
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_told_once_and_found_numbers_stay() {
        let mut reasons = Reasons::default();
        let photons = Measured::none(Unresolved::NoPhotons);
        let noise = |value| Measured::none(Unresolved::WithinNoise { value, standard_error: 135.0 });
        let cells = [&photons, &noise(107.7), &noise(-20.0), &photons, &Measured::new(2.0, 0.1)]
            .map(|m| reasons.cell(m).into_string());
        let number = |cell: &str| cell.split("<sup>").nth(1).and_then(|t| t.chars().next());
        assert_eq!(cells.each_ref().map(|c| number(c)), [Some('1'), Some('2'), Some('2'), Some('1'), None]);
        assert!(cells[1].contains("108 ± 135") || cells[1].contains("110 ± 135"), "{}", cells[1]);
        assert_eq!(cells[4], "2.00 ± 0.10");
        let list = reasons.list().into_string();
        assert_eq!(list.matches("no point states its photons per pixel").count(), 1, "{list}");
        assert_eq!(list.matches("two standard errors").count(), 1, "{list}");
        assert_eq!(Reasons::default().list().into_string(), "");
    }
}
