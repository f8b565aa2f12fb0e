//! `sensor`: look at a sensor, measure one from captures, or simulate such captures.

pub mod capture;
pub mod characterize;
pub mod list;
pub mod show;

use petzval_base::{InFile, IoError};
use petzval_lab::emva::CaptureError;

use crate::error::JobError;

impl From<CaptureError> for JobError {
    /// Captures that cannot be used are wrong input. Each kind of mistake has its own hint.
    fn from(error: CaptureError) -> Self {
        let message = error.to_string();
        let hint = match error {
            CaptureError::List(InFile { path, error }) => return Self::File { path, error },
            CaptureError::Stopped(cancelled) => return cancelled.into(),
            CaptureError::Image(_) => return Self::failed(message),
            CaptureError::Plan { what: "series", .. } => return Self::failed(message),
            CaptureError::Plan { what, problem } => {
                let key = if what == "quantum efficiency" { "quantum_efficiency" } else { what };
                return Self::setting(
                    key,
                    "",
                    problem,
                    "`petzval sensor capture --help` describes every option",
                );
            }
            CaptureError::NoList(_) => {
                "the manual's page on characterisation shows how to write captures.toml"
            }
            CaptureError::Unfinished(_) => {
                "run the same `petzval sensor capture` again: it goes on where it stopped"
            }
            CaptureError::NoFolder(_) => "give the folder of the captures, or its captures.toml",
            CaptureError::Io(IoError { source, .. }) => {
                return Self::system(
                    message,
                    &source,
                    "give a folder that exists and may be read and written",
                );
            }
            CaptureError::Frame(_) => "replace the frame, or remove its point from the list",
            CaptureError::Size { .. } => "all frames of a series have one size",
            CaptureError::Contradiction { .. } => {
                "correct the list or the sidecar, or remove a sidecar that belongs to another frame"
            }
            CaptureError::Value { .. } => {
                "check `bits`, and that the frames hold digital numbers as the camera gave them"
            }
            CaptureError::StuckBit { .. } => {
                "such frames say nothing about the noise; check the packing of the frames, and the camera with a uniform gray"
            }
            CaptureError::Swapped { .. } => {
                "`kind` of each point says whether light fell on the sensor: \"flat\" or \"dark\""
            }
            CaptureError::NoLight { .. } => {
                "check that light reached the sensor, and that the frames are those of the list"
            }
            CaptureError::AllSaturated { moved: 1.., .. } => {
                "use a light that does not flicker and leave camera and target alone, so that the darker points count"
            }
            CaptureError::AllSaturated { .. } => {
                "add flat points of less light or shorter exposure: K is measured below 70 % of saturation"
            }
            CaptureError::OtherSeries { .. } => "choose another folder, or empty this one",
            CaptureError::Sensor(_) => "check the sensor file and the exposures",
        };
        Self::input(message, hint)
    }
}
