//! The answer: which camera is best for the task, by how much, and where it is behind, in one sentence and three numbers.

use super::answer_view::Answer;
use super::view::Report;
use super::{found_answer, scored_answer};

/// The answer; none for a run at work, or where there is nothing to compare.
pub(super) fn answer(report: &Report) -> Option<Answer> {
    match &report.detection {
        _ if report.progress.is_some() => None,
        Some(view) => found_answer::answer(report, view),
        None => scored_answer::answer(report),
    }
}
