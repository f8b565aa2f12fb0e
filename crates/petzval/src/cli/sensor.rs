//! `petzval sensor`: look at a sensor, measure one, simulate its captures.

mod capture;
mod characterize;
mod list;
mod show;

use std::process::ExitCode;

use clap::Subcommand;
use indicatif::{ProgressBar, ProgressStyle};
use petzval::design::error::DesignError;
use petzval::lab::emva::CaptureError;

use super::Failure;

/// Verbs about a sensor.
#[derive(Debug, Subcommand)]
pub enum SensorVerb {
    /// The built-in sensors, a line each
    List(list::Args),
    /// What a sensor file says, and the EMVA 1288 figures that follow
    Show(show::Args),
    /// Simulate the calibration series of a sensor: flat and dark frames over gains and exposure times
    Capture(capture::Args),
    /// Measure a sensor from captures: EMVA 1288, and the paper's calibration over all gains
    Characterize(characterize::Args),
}

/// Runs a verb.
pub fn run(verb: SensorVerb) -> Result<ExitCode, Failure> {
    match verb {
        SensorVerb::List(args) => list::run(&args),
        SensorVerb::Show(args) => show::run(&args),
        SensorVerb::Capture(args) => capture::run(&args),
        SensorVerb::Characterize(args) => characterize::run(&args),
    }
}

/// A number for a reader: six significant digits, without zeros at the end.
fn six_digits(value: f64) -> String {
    // Rounding by way of text gives the nearest number, whose shortest form has no more digits.
    format!("{value:.5e}").parse::<f64>().unwrap_or(value).to_string()
}

/// A bar over frames, on stderr.
fn frames_bar(frames: usize, doing: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(frames as u64).with_message(doing);
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {pos}/{len} frames, {eta} left") {
        bar.set_style(style);
    }
    bar
}

/// What is wrong with captures is wrong input, with a hint.
fn failure(error: CaptureError) -> Failure {
    let said = error.to_string();
    let hint = match error {
        CaptureError::List { path, error } => return DesignError::Input { path, error }.into(),
        CaptureError::NoList(_) => "the manual's page on characterisation shows how to write captures.toml",
        CaptureError::Unfinished(_) => {
            "run the same `petzval sensor capture` again: it goes on where it stopped"
        }
        CaptureError::NoFolder(_) => "give the folder of the captures, or its captures.toml",
        CaptureError::Io { .. } => "give a folder that exists and may be read and written",
        CaptureError::Frame(_) => "replace the frame, or take its point off the list",
        CaptureError::Size { .. } => "all frames of a series have one size",
        CaptureError::Contradiction { .. } => {
            "correct the list or the sidecar, or take away a sidecar of another frame"
        }
        CaptureError::Value { .. } => {
            "check `bits`, and that the frames hold digital numbers as the camera gave them"
        }
        CaptureError::Swapped { .. } => {
            "`kind` of each point says whether light fell on the sensor: \"flat\" or \"dark\""
        }
        CaptureError::NoLight { .. } => {
            "look that light reached the sensor, and that the frames are those of the list"
        }
        CaptureError::AllSaturated { .. } => {
            "add flat points of less light or shorter exposure: K is measured below 70 % of saturation"
        }
        CaptureError::OtherSeries { .. } => "choose another folder, or empty this one",
        CaptureError::Plan { .. } => "`petzval sensor capture --help` tells what a series can be",
        CaptureError::Sensor(_) => "check the sensor file and the exposures",
        CaptureError::Image(_) => return Failure::job(said),
    };
    Failure::input(said, hint)
}

#[cfg(test)]
mod tests {
    use super::six_digits;

    #[test]
    fn numbers_have_six_digits_at_most() {
        let all = [0.1399653591279929, 33723.0, 10_471.285_48, 0.0, -1.15, 4.0, 1_234_567.0].map(six_digits);
        assert_eq!(all, ["0.139965", "33723", "10471.3", "0", "-1.15", "4", "1234570"]);
    }
}
