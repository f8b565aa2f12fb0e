//! The score table: one row a camera, best values bold, differences to the baseline.

use maud::{Markup, html};

use super::{CameraView, TableRow};
use crate::number;
use crate::page::caption;
use crate::table::{Column, Row, Table};

/// A column of scores.
pub(super) struct Score {
    /// Name in the header.
    pub name: &'static str,
    /// Unit in the header, empty for a plain number.
    pub unit: &'static str,
    /// Which way is better; `None` for what only describes the camera.
    pub better: Option<Better>,
    /// Decimals that are printed; what rounds to zero with them is no difference.
    pub decimals: usize,
    /// The column's value in a row.
    pub value: fn(&TableRow) -> f64,
}

/// Which way a score improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Better {
    Higher,
    Lower,
}

impl Score {
    /// The head of the column.
    fn column(&self) -> Column {
        let way = match self.better {
            Some(Better::Higher) => html! { span.muted title="higher is better" { " ↑" } },
            Some(Better::Lower) => html! { span.muted title="lower is better" { " ↓" } },
            None => html! {},
        };
        Column::new(html! { (self.name) (way) }).unit(self.unit)
    }

    /// How much better `to` is than `from` in printed digits: positive, zero or negative.
    pub fn gain(&self, from: &TableRow, to: &TableRow) -> f64 {
        let difference = (self.value)(to) - (self.value)(from);
        if number::is_nothing(difference, self.decimals) {
            return 0.0;
        }
        if self.better == Some(Better::Lower) { -difference } else { difference }
    }

    /// Whether a row has the best printed value; rows that tie are all best.
    fn is_best(&self, row: &TableRow, rows: &[TableRow]) -> bool {
        self.better.is_some()
            && rows.len() > 1
            && (self.value)(row).is_finite()
            && rows.iter().filter(|r| (self.value)(r).is_finite()).all(|r| self.gain(row, r) <= 0.0)
    }
}

pub(super) const LPIPS: Score = Score {
    // Unbreakable.
    name: "1\u{a0}−\u{a0}LPIPS",
    unit: "",
    better: Some(Better::Higher),
    decimals: 4,
    value: |r| r.one_minus_lpips,
};
pub(super) const PSNR: Score =
    Score { name: "PSNR", unit: "dB", better: Some(Better::Higher), decimals: 2, value: |r| r.psnr_db };
pub(super) const SSIM: Score =
    Score { name: "SSIM", unit: "", better: Some(Better::Higher), decimals: 4, value: |r| r.ssim };
pub(super) const SPOT: Score = Score {
    name: "RMS spot",
    unit: "µm",
    better: Some(Better::Lower),
    decimals: 2,
    value: |r| r.rms_spot_um,
};
pub(super) const EFL: Score =
    Score { name: "EFL", unit: "mm", better: None, decimals: 2, value: |r| r.efl_mm };
pub(super) const F_NUMBER: Score =
    Score { name: "f-number", unit: "", better: None, decimals: 2, value: |r| r.f_number };
pub(super) const FOV: Score =
    Score { name: "field of view", unit: "°", better: None, decimals: 1, value: |r| r.fov_deg };

/// All columns, from what is wanted to what is given.
const SCORES: [Score; 7] = [LPIPS, PSNR, SSIM, SPOT, EFL, F_NUMBER, FOV];

/// The table, in the colours of the cameras. The first row is the baseline.
pub(super) fn score_table(rows: &[TableRow], cameras: &[CameraView]) -> Markup {
    let Some(baseline) = rows.first() else { return html! {} };
    let columns = [Column::new("camera")].into_iter().chain(SCORES.iter().map(Score::column));
    let lines = rows.iter().enumerate().map(|(i, row)| {
        let cells = SCORES.iter().map(|score| cell(score, row, rows, baseline, i > 0));
        Row::new(&row.camera, cells).of_camera(super::camera_colour(cameras, &row.camera, i))
    });
    html! {
        (Table::new(columns).class("scores").rows(lines).html())
        (caption(format!(
            "Means over held-out pictures. Bold: the best printed value. Small: the difference to {}.",
            baseline.camera
        )))
    }
}

fn cell(score: &Score, row: &TableRow, rows: &[TableRow], baseline: &TableRow, differs: bool) -> Markup {
    let value = number::fixed((score.value)(row), score.decimals);
    let gain = score.gain(baseline, row);
    let class = match score.better {
        Some(_) if gain > 0.0 => "delta gain",
        Some(_) if gain < 0.0 => "delta loss",
        _ => "delta",
    };
    html! {
        @if score.is_best(row, rows) { b { (value) } } @else { (value) }
        @if differs {
            span class=(class) {
                (number::signed((score.value)(row) - (score.value)(baseline), score.decimals))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn the_best_is_bold_and_differences_have_signs() {
        let mut rows = sample::rows();
        rows[1].camera = "<i>".into();
        let table = score_table(&rows, &[]).into_string();
        assert!(table.contains("<b>0.9312</b>") && table.contains("+0.0187"));
        assert!(table.contains("&lt;i&gt;") && !table.contains("<i>"));
        // Lower spots are better.
        assert!(table.contains("<b>7.31</b>") && table.contains("delta gain\">\u{2212}5.29"));
        assert!(!table.contains("NaN"));
    }

    #[test]
    fn ties_are_all_best_and_no_gain() {
        let mut rows = sample::rows();
        rows[1].psnr_db = rows[0].psnr_db + 0.001;
        assert_eq!(PSNR.gain(&rows[0], &rows[1]), 0.0);
        rows.truncate(2);
        assert!(PSNR.is_best(&rows[0], &rows) && PSNR.is_best(&rows[1], &rows));
        rows[0].ssim = f64::NAN;
        assert!(!SSIM.is_best(&rows[0], &rows));
    }
}
