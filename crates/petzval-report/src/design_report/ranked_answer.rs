//! The answer by a score of all held-out windows together, with the ranges that it has over draws of them.

use maud::{Markup, html};

use super::answer_view::Answer;
use super::view::{Range, RankedCamera, Ranking, Report};
use crate::number;
use crate::page::Tile;
use crate::words::capitalised;

/// Decimals of figures without a range.
const DECIMALS: usize = 3;

/// A figure as exact as its 95 % range is wide.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RangedFigure {
    /// The figure: `0.71`, `+0.021`.
    pub value: String,
    /// Ends of its range.
    pub ends: Option<[String; 2]>,
}

impl RangedFigure {
    /// A score.
    pub fn figure(value: f64, range: Option<[f64; 2]>) -> Self {
        Self::of(value, range, number::fixed)
    }

    /// A difference of two scores.
    pub fn difference(range: Range) -> Self {
        Self::of(range.value, Some([range.low, range.high]), number::signed)
    }

    fn of(value: f64, range: Option<[f64; 2]>, text: fn(f64, usize) -> String) -> Self {
        // 95 % of a normal distribution lie within 1.96 standard deviations.
        let known = range.and_then(|[low, high]| number::decimals_of((high - low) / (2.0 * 1.96)));
        let decimals = known.map_or(DECIMALS, |known| (known.max(0) as usize).min(DECIMALS));
        Self { value: text(value, decimals), ends: range.map(|ends| ends.map(|end| text(end, decimals))) }
    }

    /// The figure with its range below it.
    pub fn shown(&self) -> Markup {
        html! {
            (self.value)
            @if let Some([low, high]) = &self.ends { span.delta { (low) " … " (high) } }
        }
    }

    /// The range in brackets; nothing where there is none.
    pub fn range(&self) -> String {
        self.ends.as_ref().map_or_else(String::new, |[low, high]| format!(" (95 % range {low} to {high})"))
    }
}

/// The answer; none without a camera that has the score.
pub(super) fn answer(report: &Report, ranking: &Ranking) -> Option<Answer> {
    let is_design = |camera: &&RankedCamera| {
        report.table.iter().any(|row| row.camera == camera.camera && !row.is_ceiling)
    };
    let value = |camera: &RankedCamera| camera.value.filter(|value| value.is_finite());
    let mut ranked: Vec<(&RankedCamera, f64)> = ranking
        .cameras
        .iter()
        .filter(is_design)
        .filter_map(|camera| Some((camera, value(camera)?)))
        .collect();
    ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (best, value) = *ranked.first()?;
    let (score, words) = (&ranking.score, ranking.words);
    let figure = RangedFigure::figure(value, best.range);
    // A difference after few steps says little, however narrow its range over windows is.
    let steps = report.table.iter().find(|row| row.camera == best.camera).map_or(0, |row| row.steps);
    let steps = match report.short {
        Some(short) => short.in_words(),
        None => petzval_base::counted(steps, "network step"),
    };
    // Where all scores are 0, no camera is best, and the windows show no range.
    if value <= 0.0 {
        let which = match ranked.len() {
            1 => format!("The camera {}", words.nothing),
            // Those without aberrations may have more.
            several if several < ranking.cameras.len() => {
                format!("No camera with a real lens {}", words.anything)
            }
            _ => format!("No camera {}", words.anything),
        };
        let label = format!("{score} of {}", best.camera);
        let numbers = vec![Tile { value: figure.value, label, is_gain: None }];
        return Some(Answer { sentence: format!("{which} after {steps}: {score} is 0."), numbers });
    }
    // One camera alone is compared with nothing.
    let best_of_several = if ranked.len() > 1 { format!(" {}", words.most) } else { String::new() };
    let mut sentence = format!(
        "{}{best_of_several} after {steps}: {score} {}{}",
        capitalised(&best.camera),
        figure.value,
        figure.range()
    );
    let label = format!("{score} of {}{}", best.camera, figure.range());
    let mut numbers = vec![Tile { value: figure.value, label, is_gain: None }];
    // The differences that are known: of each camera to the baseline, and of the design to each camera.
    let next = ranked.iter().map(|(camera, _)| *camera);
    let next = next.filter(|other| ![&best.camera, &ranking.baseline].contains(&&other.camera));
    let over_next = next
        .filter(|_| best.camera == ranking.design)
        .find_map(|other| Some((&other.camera, other.design_against?)));
    let over_baseline = best.against_baseline.map(|range| (&ranking.baseline, range));
    for (other, range) in over_baseline.into_iter().chain(over_next) {
        let difference = RangedFigure::difference(range);
        let joint = if numbers.len() == 1 { "; " } else { ", " };
        sentence += &format!("{joint}{}{} over {other}", difference.value, difference.range());
        numbers.push(Tile {
            label: format!("{score}, {} against {other}{}", best.camera, difference.range()),
            value: difference.value,
            is_gain: (range.low > 0.0 || range.high < 0.0).then_some(range.value > 0.0),
        });
    }
    Some(Answer { sentence: sentence + ".", numbers })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design_report::{RankingWords, TaskPart};
    use crate::sample;

    fn report(values: [f64; 3]) -> Report {
        let range = |value: f64| Some(Range { value, low: value - 0.03, high: value + 0.03 });
        let cameras = ["nominal", "spot-optimised", "end-to-end"].into_iter().zip(values).enumerate();
        let cameras = cameras.map(|(i, (camera, value))| RankedCamera {
            camera: camera.into(),
            value: Some(value),
            range: Some([value - 0.06, value + 0.06]),
            against_baseline: if i > 0 { range(value - values[0]) } else { None },
            design_against: if i < 2 { range(values[2] - value) } else { None },
        });
        let ranking = Ranking {
            score: "AP50".into(),
            further: Vec::new(),
            words: RankingWords {
                most: "finds most",
                nothing: "finds no object",
                anything: "finds an object",
            },
            baseline: "nominal".into(),
            design: "end-to-end".into(),
            cameras: cameras.collect(),
        };
        Report { task: TaskPart { ranking: Some(ranking), ..TaskPart::default() }, ..sample::report() }
    }

    fn answer_of(report: &Report) -> Answer {
        answer(report, report.task.ranking.as_ref().unwrap()).unwrap()
    }

    #[test]
    fn the_answer_is_the_score_with_its_range_and_the_differences_with_theirs() {
        let report = report([0.7012, 0.7236, 0.7519]);
        let answer = answer_of(&report);
        assert_eq!(
            answer.sentence,
            "End-to-end finds most after 60 network steps: AP50 0.75 (95 % range 0.69 to 0.81); +0.051 (95 % range +0.021 to +0.081) over nominal, +0.028 (95 % range \
             \u{2212}0.002 to +0.058) over spot-optimised."
        );
        let numbers: Vec<(&str, Option<bool>)> =
            answer.numbers.iter().map(|n| (&*n.value, n.is_gain)).collect();
        assert_eq!(numbers, [("0.75", None), ("+0.051", Some(true)), ("+0.028", None)]);
    }

    #[test]
    fn a_baseline_that_finds_most_has_no_gain_over_itself() {
        let report = report([0.81, 0.7236, 0.7519]);
        let answer = answer_of(&report);
        assert_eq!(
            answer.sentence,
            "Nominal finds most after 60 network steps: AP50 0.81 (95 % range 0.75 to 0.87)."
        );
    }

    #[test]
    fn where_nothing_is_found_no_camera_finds_most() {
        let mut nothing = report([0.0; 3]);
        let of_three = answer_of(&nothing);
        assert_eq!(of_three.sentence, "No camera finds an object after 60 network steps: AP50 is 0.");
        assert_eq!(of_three.numbers.len(), 1);
        nothing.task.ranking.as_mut().unwrap().cameras.truncate(1);
        let of_one = answer_of(&nothing);
        assert_eq!(of_one.sentence, "The camera finds no object after 60 network steps: AP50 is 0.");
    }

    #[test]
    fn a_short_run_is_called_one() {
        let mut report = report([0.7012, 0.7236, 0.7519]);
        report.short = Some(crate::design_report::ShortRun { steps: 12, usual: 400 });
        let answer = answer_of(&report);
        assert!(
            answer.sentence.starts_with("End-to-end finds most after 12 of 400 training steps: AP50 0.75"),
            "{}",
            answer.sentence
        );
    }

    #[test]
    fn a_single_camera_finds_no_more_than_another() {
        let mut report = report([0.81, 0.7236, 0.7519]);
        report.task.ranking.as_mut().unwrap().cameras.truncate(1);
        let answer = answer_of(&report);
        assert_eq!(answer.sentence, "Nominal after 60 network steps: AP50 0.81 (95 % range 0.75 to 0.87).");
    }
}
