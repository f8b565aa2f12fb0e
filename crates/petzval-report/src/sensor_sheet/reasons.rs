//! Reasons for unresolved numbers of a table: a letter in the cell, and one list of the reasons below the table.

use maud::{Markup, html};
use petzval_lab::emva::{Measured, Unresolved};

use super::style::with_error;
use crate::page::caption;

/// The i-th letter; after z they repeat with a digit.
fn nth_letter(i: usize) -> String {
    let letter = char::from(b'a' + (i % 26) as u8);
    if i < 26 { letter.to_string() } else { format!("{letter}{}", i / 26) }
}

/// The reasons of a table in the order of their first use.
#[derive(Debug, Default)]
pub(super) struct Reasons {
    all: Vec<String>,
}

impl Reasons {
    /// A measured value, or the letter of the reason why there is none.
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
            Unresolved::WithinModelError { value, standard_error } => (
                "its points are not on a line, or too few to show that they are".to_owned(),
                with_error(&Measured::new(value, standard_error)),
            ),
            Unresolved::NegativeVariance(_) => ("the variance is negative".to_owned(), None),
            other => (other.to_string(), None),
        };
        let letter = self.letter(reason);
        html! {
            span.unresolved { "not resolved" sup { (letter) } }
            @if let Some(found) = found { span.why { (found) } }
        }
    }

    /// The letter of a reason; the same one has the same letter.
    fn letter(&mut self, reason: String) -> String {
        let place = self.all.iter().position(|r| *r == reason).unwrap_or_else(|| {
            self.all.push(reason);
            self.all.len() - 1
        });
        nth_letter(place)
    }

    /// The list below the table.
    pub fn list(&self) -> Markup {
        html! {
            @if !self.all.is_empty() {
                (caption(html! {
                    "Not resolved: "
                    @for (i, reason) in self.all.iter().enumerate() {
                        @if i > 0 { "; " }
                        sup { (nth_letter(i)) } " " (reason)
                    }
                    "."
                }))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_listed_once_and_resolved_numbers_stay() {
        let mut reasons = Reasons::default();
        let photons = Measured::none(Unresolved::NoPhotons);
        let noise = |value| Measured::none(Unresolved::WithinNoise { value, standard_error: 135.0 });
        let cells = [&photons, &noise(107.7), &noise(-20.0), &photons, &Measured::new(2.0, 0.1)]
            .map(|m| reasons.cell(m).into_string());
        let letter = |cell: &str| cell.split("<sup>").nth(1).and_then(|t| t.chars().next());
        assert_eq!(cells.each_ref().map(|c| letter(c)), [Some('a'), Some('b'), Some('b'), Some('a'), None]);
        assert_eq!([0, 25, 26, 53].map(nth_letter), ["a", "z", "a1", "b2"]);
        assert!(cells[1].contains("110 ± 140"), "{}", cells[1]);
        assert_eq!(cells[4], "2.00 ± 0.10");
        let list = reasons.list().into_string();
        assert_eq!(list.matches("no point states its photons per pixel").count(), 1, "{list}");
        assert_eq!(list.matches("two standard errors").count(), 1, "{list}");
        assert_eq!(Reasons::default().list().into_string(), "");
    }
}
