//! `raw convert`: a raw frame in another format.

use std::path::{Path, PathBuf, absolute};

use petzval_camera::sensor::OutOfRange;
use petzval_design::path_text::path_text;
use petzval_files::raw_file::{RawFormat, RawFrame, RawInfo, load_any_raw, save_raw, sidecar_path};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FrameSummary;
use crate::context::Context;
use crate::error::JobError;
use crate::results::check_file;

pub use petzval_camera::sensor::CfaPattern;
pub use petzval_files::raw_file::Packing;

/// A raw frame to write in the format that the name of the output ends with. Its digital numbers do not change.
///
/// Camera and exposure are those of the input and its sidecar, except where the request gives them; they go into the
/// sidecar of the output.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// The frame.
    pub input: PathBuf,
    /// Where to write it: `.tiff`, `.png`, `.npy`, `.raw` or `.exr`.
    pub output: PathBuf,
    /// Packing of a `.raw`; by default the usual one of its bits.
    pub packing: Option<Packing>,
    /// Bits of the digital numbers.
    pub bits: Option<u32>,
    /// Colour filter array from the first pixel.
    pub cfa: Option<CfaPattern>,
    /// Black level, DN.
    pub black_level_dn: Option<f64>,
    /// White level, DN.
    pub white_level_dn: Option<f64>,
    /// Exposure time, s.
    pub time_s: Option<f64>,
    /// Linear analogue gain.
    pub gain: Option<f64>,
    /// Pixel pitch, um.
    pub pixel_um: Option<f64>,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The frame as it was written.
    pub frame: FrameSummary,
    /// The sidecar that was written beside it.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub sidecar: PathBuf,
}

/// Reads the frame and writes it, with its sidecar.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let mut frame = load_any_raw(&request.input)?.in_16_bits().ok_or_else(|| {
        JobError::input(
            format!("{}: numbers of more than 16 bits", request.input.display()),
            "frames of up to 16 bits are written in other formats; `petzval isp develop` takes this one as it is",
        )
    })?;
    frame.info = request.info()?.or(frame.info);
    if let Some(file) = &mut frame.info.calibration {
        // The file stays where it is.
        let (from, to) = (request.input.parent(), request.output.parent());
        if from != to {
            let path = from.unwrap_or(Path::new("")).join(&*file);
            let path = absolute(&path).map_err(|e| JobError::failed(format!("{}: {e}", path.display())))?;
            *file = path_text(&path)?;
        }
    }
    let bits = frame.info.bits.unwrap_or(16);
    check_bits(request, &frame, bits)?;
    check_file(&request.output, context)?;
    save_raw(&frame, &request.output, request.format(bits)?)?;
    context.wrote(&request.output, "raw frame");
    Ok(Response { frame: FrameSummary::new(&request.output, &frame), sidecar: sidecar_path(&request.output) })
}

impl Request {
    /// Camera and exposure as the request gives them, once every number is in its range.
    fn info(&self) -> Result<RawInfo, JobError> {
        let info = RawInfo {
            bits: self.bits,
            cfa: self.cfa,
            black_level_dn: self.black_level_dn,
            white_level_dn: self.white_level_dn,
            exposure_s: self.time_s,
            linear_gain: self.gain,
            pixel_um: self.pixel_um,
            ..RawInfo::default()
        };
        info.validate().map_err(|wrong| {
            let OutOfRange { key, value, low, high, meaning } = wrong;
            let key = match key {
                "exposure_s" => "time_s",
                "linear_gain" => "gain",
                same => same,
            };
            JobError::setting(key, value, format!("outside {low}..{high}"), format!("give {meaning}"))
        })?;
        Ok(info)
    }

    /// The format of the output.
    fn format(&self, bits: u32) -> Result<RawFormat, JobError> {
        let packing = self.packing.unwrap_or(Packing::for_bits(bits));
        let output = self.output.display();
        let format = RawFormat::of_name(&self.output, packing).filter(|format| *format != RawFormat::Dng);
        let format = format.ok_or_else(|| {
            JobError::input(
                format!("{output}: the name does not end with a format that can be written"),
                "end it with .tiff, .png, .npy, .raw or .exr",
            )
        })?;
        match self.packing {
            Some(packing) if !matches!(format, RawFormat::Packed(_)) => Err(JobError::setting(
                "packing",
                packing.name(),
                format!("only .raw files are packed, and {output} is not one"),
                "leave --packing out, or name the file .raw",
            )),
            _ => Ok(format),
        }
    }
}

/// Checks that every digital number fits in the bits of the converter.
fn check_bits(request: &Request, frame: &RawFrame, bits: u32) -> Result<(), JobError> {
    let Some((row, col, dn)) = frame.beyond(bits) else { return Ok(()) };
    let input = request.input.display();
    Err(JobError::input(
        format!("{input}: the value {dn} at row {row}, column {col} does not fit in {bits} bits"),
        "give the --bits that the numbers have",
    ))
}
