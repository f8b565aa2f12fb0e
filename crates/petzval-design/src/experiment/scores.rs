//! The scores that an experiment names.

use petzval_base::{FileError, nearest};

use super::{Experiment, TaskFacts, variants};

impl Experiment {
    /// The experiment with the scores of its task if its text names none.
    pub(crate) fn with_default_scores(mut self, text: &str, facts: &TaskFacts) -> Self {
        if let Some(scores) = facts.default_scores.filter(|_| !names_scores(text)) {
            self.scoring.scores = scores.iter().map(|score| (*score).to_owned()).collect();
        }
        self
    }

    /// Checks that the scores are among those that are known. One who scores by others, with scorers of their own, leaves this out.
    pub(crate) fn check_scores(
        &self,
        text: &str,
        known: &[String],
        facts: &TaskFacts,
    ) -> Result<(), FileError> {
        let unknown = self.scoring.scores.iter().enumerate().find(|(_, name)| !known.contains(name));
        let Some((i, unknown)) = unknown else { return Ok(()) };
        let of = format!("of {}", facts.scored);
        let message = format!("`{unknown}` is no score {of}");
        let error = variants::at(text, &["scoring", "scores", &i.to_string()], message);
        let words: Vec<&str> = known.iter().map(String::as_str).collect();
        let near = nearest(unknown, &words).map(|near| format!("did you mean \"{near}\"? "));
        let hint = format!("{}scores {of} are {}", near.unwrap_or_default(), known.join(", "));
        Err(FileError { key: "scores".to_owned(), ..error }.hint(hint))
    }
}

/// Whether the text of an experiment names scores.
fn names_scores(text: &str) -> bool {
    let table: Option<toml::Table> = text.parse().ok();
    table.is_some_and(|all| all.get("scoring").is_some_and(|scoring| scoring.get("scores").is_some()))
}
