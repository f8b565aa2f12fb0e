//! The scores that an experiment names.

use petzval_base::{FileError, nearest};

use super::{Experiment, PicturesKey, TaskFacts, variants};

/// An experiment with more classes has no score for each of them by default: tables would be too wide.
const MOST_CLASSES: usize = 8;

impl Experiment {
    /// The experiment with the scores of its task if its text names none, and with one for each of its own classes if they are few.
    pub(crate) fn with_default_scores(mut self, text: &str, facts: &TaskFacts) -> Self {
        let table: toml::Table = text.parse().unwrap_or_default();
        let names_scores = table.get("scoring").is_some_and(|scoring| scoring.get("scores").is_some());
        if let Some(scores) = facts.default_scores.filter(|_| !names_scores) {
            self.scoring.scores = scores.iter().map(|score| (*score).to_owned()).collect();
            let classes = self.classes().counted();
            let few =
                facts.class_score.filter(|_| table.contains_key("class") && classes.len() <= MOST_CLASSES);
            if let Some(score) = few {
                let of_classes = classes.names().into_iter().map(|class| format!("{score}_{class}"));
                self.scoring.scores.extend(of_classes);
            }
        }
        self
    }

    /// Checks that the scores are among those that are known, and that what is counted is there. One who scores by others, with scorers of their own,
    /// leaves this out, and so do runs of earlier versions.
    pub(crate) fn check_scores(
        &self,
        text: &str,
        known: &[String],
        facts: &TaskFacts,
    ) -> Result<(), FileError> {
        // Windows of scenes have a number of their own.
        if self.scoring.pictures != 0 && facts.pictures != PicturesKey::Photos {
            let message =
                format!("the task `{}` scores windows of scenes, and this key counts photographs", self.task);
            let hint = "leave it out, and give the number of windows to `street.held_out`, for streets and for a folder";
            return Err(FileError::at_key(text, &["scoring", "pictures"], message).hint(hint));
        }
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
