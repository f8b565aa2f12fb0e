//! A run at work: how far each of its cameras has come.

use maud::{Markup, html};

use super::view::{CameraProgress, CameraState, Report, camera_colour};
use crate::number;
use crate::page::caption;
use crate::table::{Column, Row, Table};

/// Where a camera stands, as the table says it.
fn in_words(state: CameraState) -> &'static str {
    match state {
        CameraState::Finished => "scored",
        CameraState::AtWork => "at work",
        CameraState::Waiting => "not begun",
    }
}

/// The table, one row a camera; nothing for a run that has ended.
pub(super) fn progress(report: &Report) -> Markup {
    let Some(progress) = &report.progress else { return html! {} };
    let columns = [
        Column::new("camera"),
        Column::new("state").text(),
        Column::new("steps taken").text(),
        Column::new("latest loss"),
    ];
    let row = |(i, camera): (usize, &CameraProgress)| {
        let steps: Vec<String> = camera
            .steps
            .iter()
            .map(|(part, taken, planned)| format!("{part} {taken} of {planned}"))
            .collect();
        let cells = [
            html! { (in_words(camera.state)) },
            html! { (steps.join(", ")) },
            html! { (number::fixed(camera.loss, 4)) },
        ];
        Row::new(&camera.camera, cells).of_camera(camera_colour(&report.cameras, &camera.camera, i))
    };
    html! {
        @if let Some(time) = &progress.time_left { p.lead { (time) } }
        (Table::new(columns).class("scores").rows(progress.cameras.iter().enumerate().map(row)).html())
        (caption(
            "A lens that is improved without pictures ends where it converges, mostly before the last of its steps. Scores and pictures below are \
             those of finished cameras; the lens of the camera at work is that of its latest checkpoint."
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design_report::{Progress, html};
    use crate::page::assert_readable;
    use crate::sample;

    #[test]
    fn a_run_at_work_shows_its_progress() {
        let mut report = sample::report();
        assert!(!html(&report).contains("<h2>At work</h2>"));
        let camera = |name: &str, state, taken| CameraProgress {
            camera: name.into(),
            state,
            steps: vec![("network".into(), taken, 400)],
            loss: if taken > 0 { 0.0625 } else { f64::NAN },
        };
        report.progress = Some(Progress {
            cameras: vec![
                camera("nominal", CameraState::Finished, 400),
                camera("spot", CameraState::AtWork, 17),
                camera("end-to-end", CameraState::Waiting, 0),
            ],
            time_left: Some("about 3 min left".into()),
        });
        let page = html(&report);
        assert_readable(&page);
        for text in ["<h2>At work</h2>", "about 3 min left", "network 17 of 400", "0.0625", "not begun"] {
            assert!(page.contains(text), "{text}");
        }
        // Cameras are compared when all are there.
        assert!(!page.contains("End-to-end against"));
    }
}
