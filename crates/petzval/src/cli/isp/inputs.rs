//! Arguments that verbs about ISPs share.

use crate::jobs::isp::{FrameOptions, NEUTRAL};

/// What raw files leave open.
#[derive(Debug, clap::Args)]
pub struct FrameArgs {
    /// Sensor file, or the name of a built-in one [default: the built-in sensor that the sidecar names]
    #[arg(long)]
    sensor: Option<String>,
    /// Digital number of white light in a green pixel [default: that of the calibration, else the level of saturation]
    ///
    /// With --merge the number counts as those of the longest exposure, and the level of saturation is that of the merged frame, where the
    /// shortest exposure ends.
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
    /// As jobs take it.
    pub fn options(self) -> FrameOptions {
        FrameOptions {
            sensor: self.sensor.map(Into::into),
            white_dn: self.white_dn,
            auto_balance: self.auto_balance,
            auto_exposure: self.auto_exposure,
        }
    }
}

/// Whose parameters: a preset, settings or an external ISP.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
pub struct IspArgs {
    /// Preset of the built-in ISP [default: neutral, every parameter at its default]
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// File of a preset, of settings, or of the description of an external ISP
    #[arg(long, value_name = "FILE")]
    isp: Option<String>,
}

impl IspArgs {
    /// As jobs take it.
    pub fn name(self) -> String {
        self.preset.or(self.isp).unwrap_or_else(|| NEUTRAL.to_owned())
    }
}
