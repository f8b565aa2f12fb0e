//! `petzval isp`: shows image signal processors, develops raw frames, tunes parameters.

mod develop;
mod show;
mod tune;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Subcommand;
use petzval::jobs::isp::FrameOptions;

use super::failure::Failure;
use super::terminal::Terminal;

/// Verbs about image signal processors.
#[derive(Debug, Subcommand)]
pub enum IspVerb {
    /// Show the parameters of an ISP
    Show(show::Args),
    /// Develop raw frames to pictures
    Develop(develop::Args),
    /// Find the parameters that bring developed frames nearest to references
    Tune(tune::Args),
}

/// Runs a verb.
pub fn run(verb: IspVerb, terminal: &Terminal) -> Result<ExitCode, Failure> {
    match verb {
        IspVerb::Show(args) => show::run(args, terminal),
        IspVerb::Develop(args) => develop::run(args, terminal),
        IspVerb::Tune(args) => tune::run(args, terminal),
    }
}

/// What raw files leave open.
#[derive(Debug, clap::Args)]
struct FrameArgs {
    /// Sensor file, or the name of a built-in one [default: the built-in sensor that the sidecar names]
    #[arg(long)]
    sensor: Option<String>,
    /// Digital number of white light in a green pixel [default: the level of saturation]
    #[arg(long, value_name = "DN")]
    white_dn: Option<f64>,
    /// Estimate the white balance from each frame
    #[arg(long)]
    auto_balance: bool,
    /// Estimate from each frame what is white
    #[arg(long, conflicts_with = "white_dn")]
    auto_exposure: bool,
}

impl FrameArgs {
    fn options(self) -> FrameOptions {
        FrameOptions {
            sensor: self.sensor,
            white_dn: self.white_dn,
            auto_balance: self.auto_balance,
            auto_exposure: self.auto_exposure,
        }
    }
}

/// Whose parameters: a preset, settings or an external ISP.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
struct IspArgs {
    /// Preset of the built-in ISP [default: neutral, every parameter at its default]
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// File of a preset, of settings, or of the description of an external ISP
    #[arg(long, value_name = "FILE")]
    isp: Option<PathBuf>,
}

impl IspArgs {
    fn name(self) -> String {
        let file = self.isp.map(|path| path.display().to_string());
        self.preset.or(file).unwrap_or_else(|| petzval::jobs::isp::NEUTRAL.to_owned())
    }
}
