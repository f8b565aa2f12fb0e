//! The reading: the result of the scores in plain sentences, also if there is no gain.

use super::score_table::{Figure, first_order, picture_scores, spot};
use super::view::{Score, TableRow};
use crate::number;

/// Largest relative difference of first-order data between comparable cameras.
const LIKE_FOR_LIKE: f64 = 0.01;

/// Sentences on the table: the last camera against the baseline, which is the first, and against those between. Empty if there
/// is nothing to compare.
pub(super) fn reading(scores: &[Score], rows: &[TableRow]) -> Vec<String> {
    let scores = picture_scores(scores);
    let [baseline, between @ .., design] = rows else { return Vec::new() };
    let mut sentences: Vec<String> =
        [baseline].into_iter().chain(between).map(|other| compare(&scores, design, other)).collect();
    sentences.extend(spot_sentence(scores.first(), design, baseline, between));
    sentences.extend(rows.iter().filter_map(|r| unlike(r, baseline)));
    sentences
}

/// Compares a camera with another in the scores of pictures.
fn compare(scores: &[Figure], design: &TableRow, other: &TableRow) -> String {
    let known: Vec<&Figure> = scores.iter().filter(|s| s.gain(other, design).is_finite()).collect();
    let against = &other.camera;
    let name = capitalised(&design.camera);
    if known.is_empty() {
        return format!("{name} and {against} have no picture score in common.");
    }
    let gains: Vec<f64> = known.iter().map(|s| s.gain(other, design)).collect();
    let (wins, losses) =
        (gains.iter().filter(|g| **g > 0.0).count(), gains.iter().filter(|g| **g < 0.0).count());
    let verdict = match (wins, losses) {
        (0, 0) => "equals",
        (_, 0) if wins == known.len() => "beats",
        (_, 0) => "is as good as or better than",
        (0, _) if losses == known.len() => "loses to",
        (0, _) => "is as good as or worse than",
        _ => "wins in some scores and loses in others against",
    };
    let differences: Vec<String> = known.iter().map(|s| difference(s, design, other)).collect();
    format!("{name} {verdict} {against}: {}.", differences.join(", "))
}

/// A difference with its sign, unit and name: `+0.0187 in 1 − LPIPS`, `+1.30 dB PSNR`.
fn difference(figure: &Figure, design: &TableRow, other: &TableRow) -> String {
    let value = number::signed(figure.of(design) - figure.of(other), figure.decimals);
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
            "; {} has smaller ones ({} µm), and yet its pictures score lower in {}",
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
    (!differences.is_empty()).then(|| {
        format!(
            "Not like for like: {} differs from {} ({}).",
            row.camera,
            baseline.camera,
            differences.join(", ")
        )
    })
}

fn capitalised(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::{rows, scores};

    /// The reading without its unbreakable spaces.
    fn reading(rows: &[TableRow]) -> Vec<String> {
        super::reading(&scores(), rows).iter().map(|s| s.replace('\u{a0}', " ")).collect()
    }

    #[test]
    fn a_gain_is_stated_with_its_numbers() {
        let said = reading(&rows());
        assert_eq!(
            said[0],
            "End-to-end beats nominal: +0.0187 in 1 − LPIPS, +1.30 dB PSNR, +0.0210 in SSIM."
        );
        assert!(said[1].starts_with("End-to-end beats spot-optimised: +0.0066 in"), "{}", said[1]);
    }

    #[test]
    fn a_loss_and_a_tie_are_stated_too() {
        let mut rows = rows();
        rows[2] = TableRow { camera: "end-to-end".into(), ..rows[0].clone() };
        assert!(reading(&rows)[0].starts_with("End-to-end equals nominal: ±0.0000"));
        assert!(reading(&rows)[1].starts_with("End-to-end loses to spot-optimised"));
        rows[2].scores[1] += 0.5;
        rows[2].scores[0] -= 0.01;
        assert!(reading(&rows)[0].contains("wins in some scores and loses in others"));
    }

    #[test]
    fn smaller_spots_with_worse_pictures_are_pointed_out() {
        assert_eq!(
            reading(&rows())[2],
            "The RMS spots shrink from 12.60 µm (nominal) to 8.05 µm (end-to-end); spot-optimised has smaller ones \
             (7.31 µm), and yet its pictures score lower in 1 − LPIPS."
        );
    }

    #[test]
    fn a_longer_focal_length_is_reported_as_not_comparable() {
        let mut rows = rows();
        rows[2].efl_mm *= 1.1;
        assert!(reading(&rows).last().unwrap().contains("EFL +10.0 %"));
        assert!(reading(&rows[..1]).is_empty() && reading(&[]).is_empty());
    }
}
