//! What an answer is: one sentence and its numbers, as they are shown.

use maud::{Markup, html};

use crate::page::{Tile, numbers};

/// The answer: a sentence, and at most three numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Answer {
    /// Made from the figures of the run.
    pub sentence: String,
    /// Its numbers.
    pub numbers: Vec<Tile>,
}

impl Answer {
    /// The sentence and its numbers, as the page begins.
    pub fn shown(&self) -> Markup {
        html! { p.lead.answer { (self.sentence) } (numbers(&self.numbers)) }
    }
}
