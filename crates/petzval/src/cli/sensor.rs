//! `petzval sensor`: look at a sensor, measure one, simulate its captures.

mod capture;
mod characterize;
mod list;
mod show;

use std::process::ExitCode;

use clap::Subcommand;

use super::Failure;

/// Verbs about a sensor.
#[derive(Debug, Subcommand)]
pub enum SensorVerb {
    /// The built-in sensors, a line each
    List(list::Args),
    /// The numbers of a sensor file, and the EMVA 1288 figures that follow
    Show(show::Args),
    /// Simulate the calibration series of a sensor: flat and dark frames over gains and exposure times
    Capture(capture::Args),
    /// Measure a sensor from captures: EMVA 1288, and the paper's calibration over all gains
    Characterize(characterize::Args),
}

/// Runs a verb.
pub fn run(verb: SensorVerb) -> Result<ExitCode, Failure> {
    match verb {
        SensorVerb::List(args) => list::run(args),
        SensorVerb::Show(args) => show::run(args),
        SensorVerb::Capture(args) => capture::run(args),
        SensorVerb::Characterize(args) => characterize::run(args),
    }
}

/// A number with six significant digits, without zeros at the end.
fn six_digits(value: f64) -> String {
    // Rounding by way of text gives the nearest number, whose shortest form has no more digits.
    format!("{value:.5e}").parse::<f64>().unwrap_or(value).to_string()
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
