//! The reading: the result of the scores in plain sentences, also if there is no gain. A run has one seed, so they say what differs,
//! and not which camera is better.

use petzval_base::counted;

use super::ranked_answer::RangedFigure;
use super::score_table::{Figure, first_order, picture_scores, spot};
use super::view::{OneSeed, Ranking, Report, SeedStudy, TableRow};
use crate::number;
use crate::words::capitalised;

/// Largest relative difference of first-order data between comparable cameras.
const LIKE_FOR_LIKE: f64 = 0.01;

/// Sentences on the table: the last camera against the baseline, which is the first, and against those between. Empty if there
/// is nothing to compare, or not yet.
pub(super) fn reading(report: &Report) -> Vec<String> {
    if report.progress.is_some() {
        return Vec::new();
    }
    let ranking = report.task.ranking.as_ref();
    let is_read = |s: &Figure| ranking.is_none_or(|r| r.score == s.name || r.further.contains(&s.name));
    let scores: Vec<Figure> = picture_scores(report).into_iter().filter(is_read).collect();
    let (ceiling, rows): (Vec<TableRow>, Vec<TableRow>) =
        report.table.iter().cloned().partition(|r| r.is_ceiling);
    let [baseline, between @ .., design] = &rows[..] else { return Vec::new() };
    let mut sentences: Vec<String> =
        [baseline].into_iter().chain(between).map(|other| compare(report, &scores, design, other)).collect();
    let others: Vec<&TableRow> = between.iter().chain([design]).collect();
    // A camera before it is one from which others start.
    let top = ceiling.last().filter(|top| ranking.is_none_or(|ranking| is_ahead(ranking, top)));
    sentences.extend(top.and_then(|top| gap_sentence(&scores, baseline, &others, top)));
    sentences.extend(report.one_seed.as_ref().map(|known| seed_sentence(&picture_scores(report), known)));
    sentences.extend(spot_sentence(scores.first(), design, baseline, between));
    sentences.extend(rows.iter().filter_map(|r| unlike(r, baseline)));
    sentences
}

/// True if the 95 % range of the gain over the baseline lies wholly above 0.
fn is_ahead(ranking: &Ranking, camera: &TableRow) -> bool {
    let seen = ranking.cameras.iter().find(|seen| seen.camera == camera.camera);
    seen.and_then(|seen| seen.against_baseline).is_some_and(|range| range.low > 0.0)
}

/// Compares a camera with another in the scores of pictures; the score that ranks cameras with the range of the difference.
fn compare(report: &Report, scores: &[Figure], design: &TableRow, other: &TableRow) -> String {
    let range_in = |s: &Figure| {
        let ranking = report.task.ranking.as_ref().filter(|ranking| ranking.score == s.name)?;
        let range = ranking.cameras.iter().find(|c| c.camera == other.camera)?.design_against?;
        Some(RangedFigure::difference(range))
    };
    let known: Vec<&Figure> = scores.iter().filter(|s| s.gain(other, design).is_finite()).collect();
    let against = &other.camera;
    let name = capitalised(&design.camera);
    if known.is_empty() {
        return format!("{name} and {against} have no picture score in common.");
    }
    let differences: Vec<String> = known
        .iter()
        .map(|s| match range_in(s) {
            Some(ranged) => difference(s, &ranged.value) + &ranged.range(),
            None => difference(s, &number::signed(s.of(design) - s.of(other), s.decimals)),
        })
        .collect();
    format!("{name} against {against}: {}.", differences.join(", "))
}

/// Largest share of a gap that is stated.
const MOST_CLOSED: f64 = 2.0;

/// How much of the way from the baseline to a lens without aberrations each camera goes. A score in which one goes more than twice as far is left out:
/// in it that lens is no ceiling.
fn gap_sentence(
    scores: &[Figure],
    baseline: &TableRow,
    cameras: &[&TableRow],
    ceiling: &TableRow,
) -> Option<String> {
    let share = |s: &Figure, camera: &TableRow| s.gain(baseline, camera) / s.gain(baseline, ceiling);
    let is_a_way = |s: &&Figure| {
        s.gain(baseline, ceiling) > 0.0 && !cameras.iter().any(|camera| share(s, camera) > MOST_CLOSED)
    };
    let ways: Vec<&Figure> = scores.iter().filter(is_a_way).collect();
    let shares = |camera: &TableRow| {
        let of_score = |s: &&Figure| {
            let share = share(s, camera);
            share.is_finite().then(|| format!("{} % in {}", number::signed(100.0 * share, 0), s.name))
        };
        let all: Vec<String> = ways.iter().filter_map(of_score).collect();
        (!all.is_empty()).then(|| format!("{}: {}", camera.camera, all.join(", ")))
    };
    let all: Vec<String> = cameras.iter().filter_map(|camera| shares(camera)).collect();
    let from = format!(
        "Share of the gap from {} to {}, a lens without aberrations, that is closed",
        baseline.camera, ceiling.camera
    );
    (!all.is_empty()).then(|| format!("{from}. {}.", capitalised(&all.join("; "))))
}

/// What one seed says, and how far differences scatter with the seed: by a study of this experiment, or by runs that are still to be made.
fn seed_sentence(scores: &[Figure], known: &OneSeed) -> String {
    let further = match known {
        OneSeed::Studied(study) => studied(scores, study),
        OneSeed::Alone(seed) => {
            let others: Vec<String> = (1..)
                .filter(|other| other != seed)
                .take(OTHER_SEEDS)
                .map(|other| other.to_string())
                .collect();
            format!(" Run seeds {}, then compare the runs (petzval compare).", others.join(" and "))
        }
    };
    format!(
        "This run has one seed, and one seed is one sample: another seed gives other differences.{further}"
    )
}

/// Further seeds that are advised: with the run's own they give a standard deviation.
const OTHER_SEEDS: usize = 2;

/// The differences of a study; empty if it has none of these scores.
fn studied(scores: &[Figure], study: &SeedStudy) -> String {
    let differences = study.differences.iter().filter(|d| !d.spreads.is_empty()).map(|d| {
        let spreads = d.spreads.iter().map(|s| {
            let figure = &scores[s.score];
            difference(figure, &number::signed_with_error(s.mean, s.deviation, figure.decimals))
        });
        format!("{} against {}: {}", d.camera, d.against, spreads.collect::<Vec<_>>().join(", "))
    });
    let differences: Vec<String> = differences.collect();
    if differences.is_empty() {
        return String::new();
    }
    format!(
        " For comparison, {} with {} and {} network steps, mean and standard deviation: {}.",
        study.experiment,
        counted(study.seeds, "seed"),
        study.network_steps,
        differences.join("; ")
    )
}

/// A difference with its unit and name: `+0.0187 in 1 − LPIPS`, `+1.30 dB PSNR`.
fn difference(figure: &Figure, value: &str) -> String {
    match figure.unit.as_str() {
        "" => format!("{value} in {}", figure.name),
        unit => format!("{value}\u{a0}{unit} {}", figure.name),
    }
}

/// The change of the spots. Also names another camera that has better spots but worse pictures, because this is the
/// point of end-to-end design.
fn spot_sentence(
    score: Option<&Figure>,
    design: &TableRow,
    baseline: &TableRow,
    between: &[TableRow],
) -> Option<String> {
    let spot = spot();
    let um = |row: &TableRow| number::fixed(row.rms_spot_um, spot.decimals);
    let gain = spot.gain(baseline, design);
    if !gain.is_finite() {
        return None;
    }
    let verb = match gain {
        g if g > 0.0 => "shrink",
        g if g < 0.0 => "grow",
        _ => "stay",
    };
    let mut sentence = format!(
        "The RMS spots {verb} from {} µm ({}) to {} µm ({})",
        um(baseline),
        baseline.camera,
        um(design),
        design.camera
    );
    let worse_in = |r: &TableRow| score.filter(|s| spot.gain(r, design) < 0.0 && s.gain(r, design) > 0.0);
    let sharper_but_worse = |r| worse_in(r).map(|score| (r, score));
    if let Some((other, score)) = between.iter().chain([baseline]).find_map(sharper_but_worse) {
        sentence += &format!(
            "; {} has smaller ones ({} µm), and its pictures score lower in {} in this run",
            other.camera,
            um(other),
            score.name
        );
    }
    Some(sentence + ".")
}

/// Warns of a camera that differs from the baseline in quantities that should be fixed.
fn unlike(row: &TableRow, baseline: &TableRow) -> Option<String> {
    let differences: Vec<String> = first_order()
        .iter()
        .filter_map(|s| {
            let (from, to) = (s.of(baseline), s.of(row));
            let share = to / from - 1.0;
            (share.abs() > LIKE_FOR_LIKE)
                .then(|| format!("{} {} %", s.name, number::signed(100.0 * share, 1)))
        })
        .collect();
    let steps = (row.steps != baseline.steps).then(|| format!("{} steps, not {}", row.steps, baseline.steps));
    let differences: Vec<String> = differences.into_iter().chain(steps).collect();
    (!differences.is_empty()).then(|| {
        format!(
            "Not like for like: {} differs from {} ({}).",
            row.camera,
            baseline.camera,
            differences.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design_report::{Range, RankedCamera, Score, SeedDifference, Spread, TaskPart};
    use crate::sample::{rows, scores};

    /// The reading without its unbreakable spaces.
    fn reading(rows: &[TableRow]) -> Vec<String> {
        let report = Report { scores: scores(), table: rows.to_vec(), ..Report::default() };
        said(&report)
    }

    fn said(report: &Report) -> Vec<String> {
        super::reading(report).iter().map(|s| s.replace('\u{a0}', " ")).collect()
    }

    #[test]
    fn a_gain_is_stated_with_its_numbers() {
        let said = reading(&rows());
        assert_eq!(
            said[0],
            "End-to-end against nominal: +0.0187 in 1 − LPIPS, +1.30 dB PSNR, +0.0210 in SSIM."
        );
        assert!(said[1].starts_with("End-to-end against spot-optimised: +0.0066 in"), "{}", said[1]);
    }

    #[test]
    fn a_score_of_all_windows_is_stated_with_its_range_and_a_gap_only_where_there_is_one() {
        let title = |title: &str| Score { title: title.into(), decimals: 3, ..scores()[0].clone() };
        let row = |camera: &str, values: [f64; 3]| TableRow {
            camera: camera.into(),
            is_ceiling: camera == "perfect",
            scores: values.to_vec(),
            ..rows()[0].clone()
        };
        let seen = |camera: &str, against: Option<[f64; 2]>, design: Option<[f64; 2]>| {
            let range = |[low, high]: [f64; 2]| Range { value: 0.5 * (low + high), low, high };
            RankedCamera {
                camera: camera.into(),
                against_baseline: against.map(range),
                design_against: design.map(range),
                ..RankedCamera::default()
            }
        };
        let mut report = Report {
            scores: ["AP50", "AP", "AP50 small"].map(title).to_vec(),
            table: vec![
                row("nominal", [0.70, 0.4, 0.1]),
                row("perfect", [0.80, 0.5, 0.2]),
                row("end-to-end", [0.75, 0.44, 0.9]),
            ],
            task: TaskPart {
                ranking: Some(Ranking {
                    score: "AP50".into(),
                    further: vec!["AP".into()],
                    baseline: "nominal".into(),
                    design: "end-to-end".into(),
                    cameras: vec![
                        seen("nominal", None, Some([0.02, 0.08])),
                        seen("perfect", Some([0.05, 0.15]), Some([-0.09, -0.01])),
                    ],
                    ..Ranking::default()
                }),
                ..TaskPart::default()
            },
            ..Report::default()
        };
        let all = said(&report);
        assert_eq!(
            all[0],
            "End-to-end against nominal: +0.050 in AP50 (95 % range +0.020 to +0.080), +0.040 in AP."
        );
        assert!(all[1].ends_with("End-to-end: +50 % in AP50, +40 % in AP."), "{}", all[1]);
        // If the windows do not show that perfect optics are ahead, no share of the gap is stated.
        report.task.ranking.as_mut().unwrap().cameras[1] = seen("perfect", Some([-0.01, 0.15]), None);
        assert!(!said(&report).concat().contains("Share of the gap"));
    }

    #[test]
    fn one_seed_names_no_winner_and_quotes_the_scatter_of_several() {
        let spreads = vec![
            Spread { score: 0, mean: 0.0053, deviation: 0.0031 },
            Spread { score: 1, mean: -0.04, deviation: 0.16 },
        ];
        let difference =
            SeedDifference { camera: "end-to-end".into(), against: "spot-optimised".into(), spreads };
        let study = SeedStudy {
            experiment: "the-main-job".into(),
            seeds: 3,
            network_steps: 800,
            differences: vec![difference],
        };
        let one_seed = Some(OneSeed::Studied(study));
        let mut report = Report { scores: scores(), table: rows(), one_seed, ..Report::default() };
        let all = said(&report);
        assert_eq!(
            all[2],
            "This run has one seed, and one seed is one sample: another seed gives other differences. For comparison, the-main-job \
             with 3 seeds and 800 network steps, mean and standard deviation: end-to-end against spot-optimised: +0.005 ± 0.003 \
             in 1 − LPIPS, \u{2212}0.04 ± 0.16 dB PSNR."
        );
        for word in ["beat", "win", "lose", "better", "worse"] {
            assert!(!all.concat().contains(word), "{word}: {all:?}");
        }
        // Figures of another experiment say nothing of this one.
        for (seed, others) in [(1, "2 and 3"), (2, "1 and 3"), (7, "1 and 2")] {
            report.one_seed = Some(OneSeed::Alone(seed));
            let wanted = format!(
                "This run has one seed, and one seed is one sample: another seed gives other differences. Run seeds {others}, then compare the \
                 runs (petzval compare)."
            );
            assert_eq!(said(&report)[2], wanted);
        }
    }

    #[test]
    fn a_loss_and_a_tie_are_stated_too() {
        let mut rows = rows();
        rows[2] = TableRow { camera: "end-to-end".into(), ..rows[0].clone() };
        assert!(reading(&rows)[0].starts_with("End-to-end against nominal: ±0.0000"));
        assert!(reading(&rows)[1].starts_with("End-to-end against spot-optimised: \u{2212}0.0121"));
    }

    #[test]
    fn smaller_spots_with_worse_pictures_are_pointed_out() {
        assert_eq!(
            reading(&rows())[2],
            "The RMS spots shrink from 12.60 µm (nominal) to 8.05 µm (end-to-end); spot-optimised has smaller ones \
             (7.31 µm), and its pictures score lower in 1 − LPIPS in this run."
        );
    }

    #[test]
    fn the_share_of_the_gap_to_perfect_optics_is_stated_and_its_camera_is_no_design() {
        let mut rows = rows();
        let top = TableRow {
            camera: "perfect".into(),
            is_ceiling: true,
            scores: vec![0.9500, 32.44, f64::NAN],
            ..rows[0].clone()
        };
        rows.push(top);
        let said = reading(&rows);
        assert!(said[0].starts_with("End-to-end against nominal"), "{}", said[0]);
        assert_eq!(
            said[2],
            "Share of the gap from nominal to perfect, a lens without aberrations, that is closed. Spot-optimised: +32 % in 1 − LPIPS, \
             +30 % in PSNR; end-to-end: +50 % in 1 − LPIPS, +50 % in PSNR."
        );
        // Where a camera goes more than twice as far, there is no gap to speak of.
        rows[3].scores[1] = rows[0].scores[1] + 0.4 * (rows[2].scores[1] - rows[0].scores[1]);
        // A ceiling before it is a camera from which others start.
        rows.insert(0, TableRow { camera: "trained".into(), ..rows[3].clone() });
        assert_eq!(
            reading(&rows)[2],
            "Share of the gap from nominal to perfect, a lens without aberrations, that is closed. Spot-optimised: +32 % in 1 − LPIPS; \
             end-to-end: +50 % in 1 − LPIPS."
        );
    }

    #[test]
    fn a_longer_focal_length_is_reported_as_not_comparable() {
        let mut rows = rows();
        rows[2].efl_mm *= 1.1;
        assert!(reading(&rows).last().unwrap().contains("EFL +10.0 %"));
        rows[2].steps = 80;
        assert!(reading(&rows).last().unwrap().ends_with("EFL +10.0 %, 80 steps, not 60)."));
        assert!(reading(&rows[..1]).is_empty() && reading(&[]).is_empty());
    }
}
