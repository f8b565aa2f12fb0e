//! The answer where pictures are scored one by one.

use super::answer_view::Answer;
use super::score_table::{Figure, picture_scores};
use super::standing::{Difference, OF_WHAT, Standing};
use super::view::Report;
use crate::number;
use crate::page::Tile;
use crate::words::capitalised;

/// The answer; none without two cameras to compare.
pub(super) fn answer(report: &Report) -> Option<Answer> {
    let standing = Standing::of(report)?;
    Some(Answer { sentence: sentence(&standing), numbers: tiles(&standing) })
}

/// `End-to-end scores highest in PSNR: +1.1 dB over nominal, +1.1 dB over spot-optimised; against nominal it is ... By SSIM, nominal is best.`
fn sentence(standing: &Standing) -> String {
    let (best, score) = (standing.best, standing.about());
    let others = if best == standing.baseline { Some(standing.subject) } else { Some(standing.baseline) };
    let others = others.into_iter().chain(standing.runner_up);
    let equals = equals(standing);
    let over = others.filter(|other| !equals.contains(other)).map(|other| {
        let amount = signed_amount(standing, standing.difference(best, other));
        format!("{amount} over {}", standing.name(other))
    });
    let over = over.collect::<Vec<_>>().join(", ");
    let over = if over.is_empty() { over } else { format!(": {over}") };
    let highest = if score.higher_is_better { "highest" } else { "best (lowest)" };
    let after = standing.report.short.map(|short| format!(" after {}", short.in_words())).unwrap_or_default();
    let head = format!(
        "{} {highest} in {}{after}{over}",
        capitalised(&leaders_score(standing, &equals)),
        title(&score.title),
    );
    match places_in_words(standing) {
        Some(places) => format!("{head}; {places}.{}", other_leaders(standing)),
        None => format!("{head}.{}", other_leaders(standing)),
    }
}

/// The cameras whose score is that of the best, to the last digit; those with a ceiling lens are left out.
fn equals(standing: &Standing) -> Vec<usize> {
    let table = &standing.report.table;
    (0..table.len())
        .filter(|camera| *camera != standing.best && !table[*camera].is_ceiling)
        .filter(|camera| standing.difference(standing.best, *camera).value == 0.0)
        .collect()
}

/// Subject and verb: `nominal scores`; of several that are equal, `nominal and end-to-end both score`.
fn leaders_score(standing: &Standing, equals: &[usize]) -> String {
    let best = standing.name(standing.best);
    let Some((last, between)) = equals.split_last() else { return format!("{best} scores") };
    let before: Vec<&str> =
        [best].into_iter().chain(between.iter().map(|camera| standing.name(*camera))).collect();
    let all = if between.is_empty() { "both" } else { "all" };
    format!("{} and {} {all} score", before.join(", "), standing.name(*last))
}

/// The scores by which another camera is the best, as the bold figures of the table show: ` By SSIM, nominal is best.`
fn other_leaders(standing: &Standing) -> String {
    let report = standing.report;
    let rows = || (0..report.table.len()).filter(|camera| !report.table[*camera].is_ceiling);
    let leader = |figure: &Figure| {
        let gain = |camera: &usize| figure.gain(&report.table[standing.best], &report.table[*camera]);
        rows().filter(|camera| gain(camera) > 0.0).max_by(|a, b| gain(a).total_cmp(&gain(b)))
    };
    // Scores with the same leader share a sentence.
    let mut led: Vec<(usize, String)> = Vec::new();
    for figure in picture_scores(report) {
        let Some(camera) = leader(&figure) else { continue };
        match led.iter_mut().find(|known| known.0 == camera) {
            Some((_, scores)) => *scores += &format!(" and {}", figure.name),
            None => led.push((camera, figure.name)),
        }
    }
    led.into_iter()
        .map(|(camera, scores)| format!(" By {scores}, {} is best.", standing.name(camera)))
        .collect()
}

/// Where the subject is behind the baseline and where it is ahead; none for less than two places.
fn places_in_words(standing: &Standing) -> Option<String> {
    let (subject, baseline) = (standing.subject, standing.baseline);
    if standing.places.len() < 2 {
        return None;
    }
    let worded = |(place, difference): (usize, Difference), side: &str| {
        format!("{} {side} {}", amount(standing, difference), standing.places[place].in_words())
    };
    let lead = standing.lead(subject, baseline);
    let lag = standing.lag(subject, baseline);
    let of = if subject == standing.best {
        format!("against {} it is", standing.name(baseline))
    } else {
        format!("{} is", standing.name(subject))
    };
    Some(match (lag, lead) {
        (Some(lag), Some(lead)) => {
            // "... at 93 % of the half-diagonal and ... at 41 %".
            let lead = worded(lead, "ahead");
            let is_far = standing.places[lag.0].in_words().ends_with(OF_WHAT);
            let lead = if is_far { lead.trim_end_matches(OF_WHAT) } else { &lead };
            format!("{of} {} and {lead}", worded(lag, "behind"))
        }
        (Some(lag), None) => format!("{of} nowhere ahead, and {}", worded(lag, "behind")),
        (None, None) => format!("{of} at no place further ahead or behind than the error"),
        (None, Some(lead)) => {
            let all = format!("{of} nowhere behind, and {}", worded(lead, "ahead"));
            // Nowhere behind the baseline does not mean nowhere behind.
            let other = standing.runner_up.filter(|_| subject == standing.best);
            let other = other.and_then(|other| Some((other, standing.lag(subject, other)?)));
            match other {
                Some((other, lag)) => {
                    let (place, difference) = lag;
                    format!(
                        "{all}, but {} behind {} {}",
                        amount(standing, difference),
                        standing.name(other),
                        standing.places[place].in_words()
                    )
                }
                None => all,
            }
        }
    })
}

/// Digits of a difference of the leading score: it ends where its error begins.
fn decimals(standing: &Standing, difference: Difference) -> i32 {
    let most = standing.about().decimals as i32;
    number::decimals_of(difference.error).map_or(most, |known| known.min(most))
}

fn with_unit(standing: &Standing, text: String) -> String {
    match standing.about().unit.as_str() {
        "" => text,
        unit => format!("{text}\u{a0}{unit}"),
    }
}

/// A difference without its sign: `1.3 dB`.
fn amount(standing: &Standing, difference: Difference) -> String {
    with_unit(standing, number::rounded(difference.value.abs(), decimals(standing, difference)))
}

/// The same with its sign.
fn signed_amount(standing: &Standing, difference: Difference) -> String {
    let known = decimals(standing, difference).max(0) as usize;
    with_unit(standing, number::signed(difference.value, known))
}

/// The name of a score, whose spaces do not break.
fn title(name: &str) -> String {
    name.replace(' ', "\u{a0}")
}

/// Over the baseline, over the next camera, and where it is furthest behind, or ahead the least.
fn tiles(standing: &Standing) -> Vec<Tile> {
    let (best, subject, baseline) = (standing.best, standing.subject, standing.baseline);
    let score = standing.about();
    let tile = |difference: Difference, label: String| Tile {
        value: with_unit(
            standing,
            number::signed_with_error(difference.value, difference.error, score.decimals),
        ),
        label,
        is_gain: difference.is_resolved(score.decimals).then(|| standing.gain(difference) > 0.0),
    };
    let against = |camera: usize, other: usize| {
        let (camera, other) = (standing.name(camera), standing.name(other));
        format!("{}, {camera} against {other}", score.title)
    };
    let first = if best == baseline { (subject, baseline) } else { (best, baseline) };
    let second = standing.runner_up.map(|other| (if best == baseline { subject } else { best }, other));
    let mut tiles: Vec<Tile> = [Some(first), second]
        .into_iter()
        .flatten()
        .map(|(camera, other)| tile(standing.difference(camera, other), against(camera, other)))
        .collect();
    if standing.places.len() > 1 {
        let places = (0..standing.places.len()).map(|place| (place, standing.at(place, subject, baseline)));
        let weakest = places
            .filter(|(_, difference)| difference.value.is_finite())
            .min_by(|a, b| standing.gain(a.1).total_cmp(&standing.gain(b.1)));
        tiles.extend(weakest.map(|(place, difference)| {
            let label = format!(
                "{}, its weakest place: {}",
                against(subject, baseline),
                standing.places[place].in_words()
            );
            tile(difference, label)
        }));
    }
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn report() -> Report {
        Report { held_out: sample::held_out(), ..sample::report() }
    }

    /// The answer without its unbreakable spaces.
    fn said(report: &Report) -> String {
        answer(report).unwrap().sentence.replace('\u{a0}', " ")
    }

    #[test]
    fn the_sentence_says_by_how_much_and_where_it_is_behind_and_ahead() {
        // Gains of three photographs scatter by 0.1 dB: 0.1 / sqrt(3) = 0.06.
        assert_eq!(
            said(&report()),
            "End-to-end scores highest in PSNR: +1.30 dB over nominal, +0.53 dB over spot-optimised; against nominal it is 1.00 dB behind on the \
             axis and 2.90 dB ahead at 93 % of the half-diagonal."
        );
        let numbers = answer(&report()).unwrap().numbers;
        let of = |i: usize| (numbers[i].value.replace('\u{a0}', " "), numbers[i].is_gain);
        assert_eq!(of(0), ("+1.30 ± 0.06 dB".into(), Some(true)));
        assert_eq!(of(1).0, "+0.53 dB", "all photographs gain the same over the spot-optimised camera");
        assert_eq!(of(2), ("\u{2212}1.00 ± 0.06 dB".into(), Some(false)));
        assert_eq!(numbers[2].label, "PSNR, end-to-end against nominal, its weakest place: on the axis");
        assert_eq!(numbers.len(), 3);
    }

    #[test]
    fn numbers_end_where_their_errors_begin() {
        let mut report = report();
        // Gains in the corner of 1.9, 2.9 and 3.9 dB: 2.9 +- 0.6.
        for (picture, shift) in report.held_out.iter_mut().skip(2).step_by(3).zip([-0.9, 0.0, 0.9]) {
            picture.scores[2][1] += shift;
        }
        assert!(
            said(&report).ends_with("and 2.9 dB ahead at 93 % of the half-diagonal."),
            "{}",
            said(&report)
        );
    }

    #[test]
    fn a_camera_that_is_nowhere_behind_the_baseline_may_be_behind_another() {
        let mut report = report();
        report.held_out.iter_mut().for_each(|picture| picture.scores[0][1] -= 2.0);
        // The gains of both scatter alike, so that their difference has no error.
        let wanted = "; against nominal it is nowhere behind, and 4.90 dB ahead at 93 % of the half-diagonal, but 1.40 dB behind \
                      spot-optimised on the axis.";
        assert!(said(&report).ends_with(wanted), "{}", said(&report));
        let two =
            Report { table: vec![report.table[0].clone(), report.table[2].clone()], ..Report::default() };
        let held_out = report.held_out.iter().map(|picture| {
            let scores = vec![picture.scores[0].clone(), picture.scores[2].clone()];
            crate::design_report::HeldOutScores { scores, ..picture.clone() }
        });
        let two = Report { scores: sample::scores(), held_out: held_out.collect(), ..two };
        assert!(
            said(&two).ends_with("it is nowhere behind, and 4.90 dB ahead at 93 % of the half-diagonal."),
            "{}",
            said(&two)
        );
    }

    #[test]
    fn of_two_places_off_the_axis_the_second_is_named_in_short() {
        let mut report = report();
        for picture in report.held_out.iter_mut().filter(|picture| picture.relative_field == 0.7) {
            picture.scores[2][1] -= 3.0;
        }
        assert!(
            said(&report)
                .ends_with("it is 1.80 dB behind at 70 % of the half-diagonal and 2.90 dB ahead at 93 %."),
            "{}",
            said(&report)
        );
    }

    #[test]
    fn scores_by_which_another_camera_is_best_are_named() {
        let mut report = report();
        report.table[0].scores[0] = 0.95;
        report.table[1].scores[2] = 0.93;
        let wanted =
            "at 93 % of the half-diagonal. By 1 − LPIPS, nominal is best. By SSIM, spot-optimised is best.";
        assert!(said(&report).ends_with(wanted), "{}", said(&report));
        // A lens without aberrations is a ceiling, not a camera to choose.
        report.table[0].is_ceiling = true;
        report.table[1].scores[2] = 0.88;
        assert!(!said(&report).contains(" By "), "{}", said(&report));
    }

    #[test]
    fn cameras_that_are_equal_share_the_first_place() {
        let mut report = sample::report();
        report.table[0].scores[1] = report.table[2].scores[1];
        let others = "over spot-optimised";
        let both = said(&report);
        assert!(both.starts_with("Nominal and end-to-end both score highest in PSNR: +0.53 dB "), "{both}");
        assert!(both.contains(others) && !both.contains("over end-to-end"), "{both}");
        report.table[1].scores[1] = report.table[2].scores[1];
        let all = said(&report);
        assert!(
            all.starts_with("Nominal, spot-optimised and end-to-end all score highest in PSNR."),
            "{all}"
        );
    }

    #[test]
    fn a_short_run_is_called_one() {
        let short = Some(crate::design_report::ShortRun { steps: 12, usual: 400 });
        let said = said(&Report { short, ..sample::report() });
        assert_eq!(
            said,
            "End-to-end scores highest in PSNR after 12 of 400 training steps: +1.30 dB over nominal, +0.53 dB over spot-optimised."
        );
    }

    #[test]
    fn a_loss_is_stated_as_a_loss() {
        let mut report = report();
        report.table[0].scores[1] = 33.0;
        report.held_out.iter_mut().for_each(|picture| picture.scores[0][1] += 4.0);
        assert_eq!(
            said(&report),
            "Nominal scores highest in PSNR: +1.86 dB over end-to-end, +2.39 dB over spot-optimised; end-to-end is nowhere ahead, and 5.00 dB \
             behind on the axis. By 1 − LPIPS and SSIM, end-to-end is best."
        );
        assert_eq!(answer(&report).unwrap().numbers[0].is_gain, Some(false));
    }

    #[test]
    fn without_places_the_sentence_ends_with_the_difference() {
        let report = sample::report();
        assert_eq!(
            said(&report),
            "End-to-end scores highest in PSNR: +1.30 dB over nominal, +0.53 dB over spot-optimised."
        );
        assert!(answer(&Report { table: report.table[..1].to_vec(), ..report }).is_none());
    }
}
