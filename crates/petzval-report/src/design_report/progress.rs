//! A run at work: how far each of its cameras has come.

use maud::{Markup, html};

use super::view::{Report, camera_colour};
use crate::number;
use crate::page::caption;
use crate::table::{Column, Row, Table};

/// A run that has not ended.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Progress {
    /// Every camera of the run, in the order in which they are made.
    pub cameras: Vec<CameraProgress>,
    /// Time that the steps that are left will take at the pace of the latest ones, in words; none before the first step.
    pub time_left: Option<String>,
    /// Seconds after which a browser asks for the page again.
    pub again_s: u32,
}

/// How far a camera has come.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraProgress {
    /// Its name.
    pub camera: String,
    /// Where it stands.
    pub state: CameraState,
    /// What moves in its steps, the steps that were taken, and those that are planned at most.
    pub steps: Vec<(String, usize, usize)>,
    /// The latest sum of all losses; NaN without one.
    pub loss: f64,
}

/// Where a camera of a run stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraState {
    /// Scored.
    Finished,
    /// Being made.
    AtWork,
    /// Not begun.
    Waiting,
}

impl CameraState {
    fn in_words(self) -> &'static str {
        match self {
            Self::Finished => "scored",
            Self::AtWork => "at work",
            Self::Waiting => "not begun",
        }
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
            html! { (camera.state.in_words()) },
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
    use crate::design_report::html;
    use crate::page::assert_readable;
    use crate::sample;

    #[test]
    fn a_run_at_work_says_how_far_it_is_and_is_asked_for_again() {
        let mut report = sample::report();
        assert!(!html(&report).contains("http-equiv"));
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
            again_s: 10,
        });
        let page = html(&report);
        assert_readable(&page);
        assert!(page.contains("<meta http-equiv=\"refresh\" content=\"10\">"));
        for text in ["<h2>At work</h2>", "about 3 min left", "network 17 of 400", "0.0625", "not begun"] {
            assert!(page.contains(text), "{text}");
        }
        // Cameras are compared when all are there.
        assert!(!page.contains("End-to-end against"));
    }
}
