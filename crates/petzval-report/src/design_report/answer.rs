//! The answer: which camera is best for the task, by how much, and where it is behind, in one sentence and three numbers.

use super::answer_view::Answer;
use super::view::Report;
use super::{ranked_answer, scored_answer};

/// The answer; none for a run at work, or where there is nothing to compare.
pub(super) fn answer(report: &Report) -> Option<Answer> {
    match &report.task.ranking {
        _ if report.progress.is_some() => None,
        Some(ranking) => ranked_answer::answer(report, ranking),
        None => scored_answer::answer(report),
    }
}
