//! The score table: one row a camera, best values bold, differences to the baseline.

use maud::{Markup, html};

use super::standing::difference;
use super::view::{Report, Score, TableRow, baseline, camera_colour};
use crate::number;
use crate::page::caption;
use crate::table::{Column, Row, Table};

/// A column of the table.
pub(super) struct Figure {
    /// Name in the header; its spaces do not break.
    pub name: String,
    /// Unit in the header, empty for a plain number.
    pub unit: String,
    /// Direction of improvement; `None` for a property of the camera that is not a score.
    pub better: Option<Better>,
    /// Printed decimals; a difference that rounds to zero does not count.
    pub decimals: usize,
    /// Place of its value in a row.
    place: Place,
}

/// Place of a value in a row.
enum Place {
    /// Among its scores.
    Score(usize),
    /// In a field of its own.
    Field(fn(&TableRow) -> f64),
}

/// Direction in which a figure improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Better {
    Higher,
    Lower,
}

impl Figure {
    fn of_lens(
        name: &str,
        unit: &str,
        better: Option<Better>,
        decimals: usize,
        field: fn(&TableRow) -> f64,
    ) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), better, decimals, place: Place::Field(field) }
    }

    /// The value of a row; NaN if it has none.
    pub fn of(&self, row: &TableRow) -> f64 {
        match self.place {
            Place::Score(i) => row.scores.get(i).copied().unwrap_or(f64::NAN),
            Place::Field(field) => field(row),
        }
    }

    /// The head of the column.
    fn column(&self) -> Column {
        let way = match self.better {
            Some(Better::Higher) => html! { span.muted title="higher is better" { " ↑" } },
            Some(Better::Lower) => html! { span.muted title="lower is better" { " ↓" } },
            None => html! {},
        };
        Column::new(html! { (self.name) (way) }).unit(&self.unit)
    }

    /// How much better `to` is than `from` in printed digits: positive, zero or negative.
    pub fn gain(&self, from: &TableRow, to: &TableRow) -> f64 {
        let difference = self.of(to) - self.of(from);
        if number::is_nothing(difference, self.decimals) {
            return 0.0;
        }
        if self.better == Some(Better::Lower) { -difference } else { difference }
    }

    /// Whether a row has the best printed value; rows that tie are all best.
    fn is_best(&self, row: &TableRow, rows: &[TableRow]) -> bool {
        self.better.is_some()
            && rows.len() > 1
            && self.of(row).is_finite()
            && rows.iter().filter(|r| self.of(r).is_finite()).all(|r| self.gain(row, r) <= 0.0)
    }
}

/// The scores of the pictures. Their numbers end where the smallest error of a difference to the baseline begins.
pub(super) fn picture_scores(report: &Report) -> Vec<Figure> {
    let figure = |(i, score): (usize, &Score)| Figure {
        name: score.title.replace(' ', "\u{a0}"),
        unit: score.unit.clone(),
        better: Some(if score.higher_is_better { Better::Higher } else { Better::Lower }),
        decimals: known_decimals(report, i).unwrap_or(score.decimals).min(score.decimals),
        place: Place::Score(i),
    };
    report.scores.iter().enumerate().map(figure).collect()
}

/// Decimals of a score by the smallest error of a difference to the baseline: that of the score itself is mostly the content of the pictures,
/// which all cameras share.
fn known_decimals(report: &Report, score: usize) -> Option<usize> {
    let baseline = baseline(&report.table);
    let others = (0..report.table.len()).filter(|camera| *camera != baseline);
    let errors = others.map(|camera| difference(report, score, camera, baseline).error);
    let least = errors.filter(|error| *error > 0.0).min_by(f64::total_cmp)?;
    Some(number::decimals_of(least)?.max(0) as usize)
}

/// RMS spot radius.
pub(super) fn spot() -> Figure {
    Figure::of_lens("RMS spot", "µm", Some(Better::Lower), 2, |r| r.rms_spot_um)
}

/// What the best linear restoration of raw frames would leave.
fn restored() -> Figure {
    Figure::of_lens("linear limit", "% of white", Some(Better::Lower), 3, |r| r.restored_error_percent)
}

/// First-order figures, which should be equal for the compared cameras.
pub(super) fn first_order() -> [Figure; 3] {
    [
        Figure::of_lens("EFL", "mm", None, 2, |r| r.efl_mm),
        Figure::of_lens("f-number", "", None, 2, |r| r.f_number),
        Figure::of_lens("field of view", "°", None, 1, |r| r.fov_deg),
    ]
}

/// Difference of the light in the corner between lenses, % of that on the axis, from which on it has a column.
const LIGHT_PERCENT: f64 = 1.0;

/// The light in the corner, where lenses with aberrations differ in it: a spot may be smaller because less light passes.
fn corner_light(rows: &[TableRow]) -> Option<Figure> {
    let figure = Figure::of_lens("corner light", "%", None, 1, |r| r.corner_light_percent);
    let light =
        || rows.iter().filter(|row| !row.is_ceiling).map(|row| figure.of(row)).filter(|v| v.is_finite());
    let least = light().fold(f64::INFINITY, f64::min);
    let most = light().fold(f64::NEG_INFINITY, f64::max);
    (most - least > LIGHT_PERCENT).then_some(figure)
}

/// The table, in the colours of the cameras.
pub(super) fn score_table(report: &Report) -> Markup {
    let rows = &report.table;
    let place = baseline(rows);
    let Some(baseline) = rows.get(place) else { return html! {} };
    let mut figures = picture_scores(report);
    figures.push(restored());
    figures.push(spot());
    figures.extend(first_order());
    figures.extend(corner_light(rows));
    let columns = [Column::new("camera")].into_iter().chain(figures.iter().map(Figure::column));
    let lines = rows.iter().enumerate().map(|(i, row)| {
        let error = |figure: &Figure| match figure.place {
            Place::Score(score) => difference(report, score, i, place).error,
            Place::Field(_) => f64::NAN,
        };
        let cells = figures
            .iter()
            .map(|figure| cell(figure, row, rows, baseline, (i != place).then(|| error(figure))));
        Row::new(&row.camera, cells).of_camera(camera_colour(&report.cameras, &row.camera, i))
    });
    let has_errors = (0..rows.len()).any(|i| {
        i != place && (0..report.scores.len()).any(|score| difference(report, score, i, place).error > 0.0)
    });
    html! {
        (Table::new(columns).class("scores").rows(lines).html())
        (caption(html! {
            "Over all held-out pictures. Bold: the best printed value. Small: the difference to " (baseline.camera)
            @if has_errors { ", ± its standard error over photographs; numbers end where it begins" }
            "."
        }))
    }
}

/// A cell; `error`: that of the difference to the baseline, NaN if it is not known, none for the baseline.
fn cell(
    figure: &Figure,
    row: &TableRow,
    rows: &[TableRow],
    baseline: &TableRow,
    error: Option<f64>,
) -> Markup {
    let value = number::fixed(figure.of(row), figure.decimals);
    let gain = figure.gain(baseline, row);
    let class = match figure.better {
        Some(_) if gain > 0.0 => "delta gain",
        Some(_) if gain < 0.0 => "delta loss",
        _ => "delta",
    };
    html! {
        @if figure.is_best(row, rows) { b { (value) } } @else { (value) }
        @if let Some(error) = error {
            span class=(class) {
                (number::signed_with_error(figure.of(row) - figure.of(baseline), error, figure.decimals))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn table_of(rows: &[TableRow]) -> String {
        score_table(&of(rows)).into_string()
    }

    fn of(rows: &[TableRow]) -> Report {
        Report { scores: sample::scores(), table: rows.to_vec(), ..Report::default() }
    }

    #[test]
    fn numbers_end_where_the_error_of_a_difference_begins() {
        // The errors of PSNR are 0.06 dB and nothing; those of the other scores are nothing.
        let report = Report { held_out: sample::held_out(), ..of(&sample::rows()) };
        let table = score_table(&report).into_string();
        assert!(
            table.contains("+1.30 ± 0.06") && table.contains("+0.0187") && table.contains("over photographs"),
            "{table}"
        );
        let mut report = report;
        report.held_out.iter_mut().enumerate().for_each(|(i, picture)| {
            picture.scores[2][1] += i as f64 - 4.0;
            picture.scores[1][1] += i as f64 - 4.0;
        });
        let table = score_table(&report).into_string();
        assert!(table.contains("+1.3 ± 1.8") && table.contains("<b>31.1</b>"), "{table}");
    }

    #[test]
    fn the_best_is_bold_and_differences_have_signs() {
        let mut rows = sample::rows();
        rows[1].camera = "<i>".into();
        let table = table_of(&rows);
        assert!(table.contains("<b>0.9312</b>") && table.contains("+0.0187"));
        assert!(table.contains("&lt;i&gt;") && !table.contains("<i>"));
        // Lower spots are better.
        assert!(table.contains("<b>7.31</b>") && table.contains("delta gain\">\u{2212}5.29"));
        assert!(!table.contains("NaN"));
        // A ceiling from which others start is no baseline.
        rows.insert(0, TableRow { camera: "trained".into(), is_ceiling: true, ..rows[2].clone() });
        let table = table_of(&rows);
        assert!(table.contains("the difference to nominal") && table.contains("+0.0187"));
    }

    /// A telephoto whose lens for least spots cuts off a third of the corner's light. A lens without aberrations does not count.
    #[test]
    fn the_light_of_the_corner_is_shown_where_lenses_differ_in_it() {
        let mut rows = sample::rows();
        rows[0].corner_light_percent = 87.9;
        rows.push(TableRow { is_ceiling: true, corner_light_percent: 100.0, ..rows[0].clone() });
        assert!(!table_of(&rows).contains("corner light"));
        (rows[0].corner_light_percent, rows[1].corner_light_percent) = (51.0, 34.7);
        let table = table_of(&rows);
        assert!(table.contains("corner light") && table.contains("34.7"), "{table}");
        assert!(table.contains("\u{2212}16.3"), "{table}");
        // Runs of earlier versions have no such figure.
        rows.iter_mut().for_each(|row| row.corner_light_percent = f64::NAN);
        assert!(!table_of(&rows).contains("corner light"));
    }

    #[test]
    fn ties_are_all_best_and_no_gain() {
        let mut rows = sample::rows();
        let [_, psnr, ssim] = &picture_scores(&of(&rows))[..] else { panic!("three scores") };
        rows[1].scores[1] = rows[0].scores[1] + 0.001;
        assert_eq!(psnr.gain(&rows[0], &rows[1]), 0.0);
        rows.truncate(2);
        assert!(psnr.is_best(&rows[0], &rows) && psnr.is_best(&rows[1], &rows));
        rows[0].scores[2] = f64::NAN;
        assert!(!ssim.is_best(&rows[0], &rows));
    }
}
