//! Cameras as they are made: a table of their scores with manufacturing errors.

use maud::{Markup, html};

use super::score_table::{Figure, picture_scores};
use super::view::{MadeCamera, MadeScore, Report, camera_colour};
use crate::number;
use crate::page::caption;
use crate::table::{Column, Row, Table};

/// The table, one row a camera and score; nothing without such cameras.
pub(super) fn made_table(report: &Report) -> Markup {
    let Some(made) = &report.made else { return html! {} };
    let figures = picture_scores(report);
    let columns = [
        Column::new("camera"),
        Column::new("score").text(),
        Column::new("as drawn"),
        Column::new("made: mean"),
        Column::new("90 % reach"),
        Column::new("limit"),
        Column::new("reach it").unit("%"),
        Column::new("no image"),
    ];
    let of_camera = |(i, camera): (usize, &MadeCamera)| {
        let row = |((figure, limit), score): ((&Figure, &f64), &MadeScore)| {
            let fixed = |value: f64| html! { (number::fixed(value, figure.decimals)) };
            let cells = [
                html! { (figure.name) @if !figure.unit.is_empty() { " " (figure.unit) } },
                fixed(score.drawn),
                fixed(score.mean),
                fixed(score.of_90_percent),
                fixed(*limit),
                html! { (number::fixed(100.0 * score.share, 0)) },
                html! { (camera.failed) },
            ];
            Row::new(&camera.camera, cells).of_camera(camera_colour(&report.cameras, &camera.camera, i))
        };
        figures.iter().zip(&made.limits).zip(&camera.scores).map(row).collect::<Vec<_>>()
    };
    let rows: Vec<Row> = made.rows.iter().enumerate().flat_map(of_camera).collect();
    html! {
        (Table::new(columns).class("scores").rows(rows).html())
        (caption(&made.conditions))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design_report::MadeCameras;
    use crate::sample;

    #[test]
    fn every_score_of_a_camera_has_its_figures() {
        let mut report = sample::report();
        assert!(made_table(&report).into_string().is_empty());
        let score =
            |drawn: f64| MadeScore { drawn, mean: drawn - 0.01, of_90_percent: drawn - 0.02, share: 0.75 };
        report.made = Some(MadeCameras {
            conditions: "20 cameras <each>".into(),
            limits: vec![0.9125, 29.84, 0.871],
            rows: vec![MadeCamera {
                camera: "end-to-end".into(),
                failed: 1,
                scores: vec![score(0.9312), score(31.14), score(0.892)],
            }],
        });
        let table = made_table(&report).into_string();
        for text in ["0.9312", "0.9212", "0.9112", "31.12", ">75<", "0.9125", "20 cameras &lt;each&gt;"] {
            assert!(table.contains(text), "{text}: {table}");
        }
    }
}
