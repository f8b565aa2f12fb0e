//! `raw convert`: a raw frame in another format.

use std::io::ErrorKind;
use std::path::{Path, PathBuf, absolute};

use petzval_camera::sensor::OutOfRange;
use petzval_design::path_text::path_text;
use petzval_files::raw_file::{
    RawFileError, RawFormat, RawFrame, RawInfo, create_raw, load_any_raw, save_raw, sidecar_path,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FrameSummary;
use crate::as_unit::{AsUnit, within};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::range::check_ranges;
use crate::results::{check_file, there_already};

pub use petzval_camera::sensor::CfaPattern;
pub use petzval_files::raw_file::Packing;

petzval_base::parameters! {
    /// A raw frame to write in the format that the name of the output ends with. Its digital numbers do not change.
    ///
    /// Camera and exposure are those of the input and its sidecar, except where the request gives them; they go into the
    /// sidecar of the output.
    pub struct Request {
        /// Bits of the digital numbers.
        bits: Option<u32> = None, "", 1..24, Linear, "give the bits of a digital number, 1 to 24";
        /// Black level, DN.
        black_level_dn: Option<f64> = None, "DN", 0.0..16_777_215.0, Linear, "give the black level in DN";
        /// White level, DN.
        white_level_dn: Option<f64> = None, "DN", 1.0..16_777_215.0, Linear, "give the digital number of saturation";
        /// Exposure time, s.
        time_s: Option<f64> = None, "s", 0.0..1e6, Linear, "give the exposure time in seconds: 5 ms is 0.005";
        /// Linear analogue gain.
        gain: Option<f64> = None, "", 1e-6..1e6, Log, "give the linear gain, 1 for 0 dB";
        /// Pixel pitch, um.
        pixel_um: Option<f64> = None, "um", 0.1..1000.0, Log, "give the pixel pitch in um";
    }
    also {
        /// The frame.
        input: PathBuf = PathBuf::new();
        /// Where to write it: `.tiff`, `.png`, `.npy`, `.raw` or `.exr`.
        output: PathBuf = PathBuf::new();
        /// Packing of a `.raw`; by default the usual one of its bits.
        packing: Option<Packing> = None;
        /// Colour filter array from the first pixel.
        cfa: Option<CfaPattern> = None;
    }
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

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::placed(|request, folder| request.output = within(folder, &request.output, "raw.tiff"));

/// Reads the frame and writes it, with its sidecar.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    let mut frame = load_any_raw(&request.input)?.in_16_bits().ok_or_else(|| {
        JobError::input(
            format!("{}: numbers of more than 16 bits", request.input.display()),
            "`raw convert` writes numbers of up to 16 bits; `petzval isp develop` takes this frame as it is",
        )
    })?;
    frame.info = request.info()?.or(frame.info);
    frame.info.validate_levels().map_err(refused)?;
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
    let save = if context.overwrites() { save_raw } else { create_raw };
    save(&frame, &request.output, request.format(bits)?).map_err(|error| match error {
        RawFileError::Io { ref path, ref source } if source.kind() == ErrorKind::AlreadyExists => {
            there_already(path)
        }
        other => other.into(),
    })?;
    context.wrote(&request.output, "raw frame");
    if let Some(exif) = frame.info.orientation.filter(|exif| *exif > 1) {
        context.note(format!(
            "{} keeps `orientation = {exif}`: the numbers stay as they are stored, and `petzval isp develop` turns the picture",
            sidecar_path(&request.output).display()
        ));
    }
    if let Some(said) = what_is_unknown(&frame.info) {
        context.note(format!("{} {said}", sidecar_path(&request.output).display()));
    }
    Ok(Response { frame: FrameSummary::new(&request.output, &frame), sidecar: sidecar_path(&request.output) })
}

/// What developing a frame needs and its sidecar does not state, with the options that state it; `None` if nothing is missing.
fn what_is_unknown(info: &RawInfo) -> Option<String> {
    let has_black = info.black_level_dn.is_some() || info.sensor.is_some() || info.calibration.is_some();
    let needed = [
        (info.bits.is_some(), "bits", "--bits 12"),
        (info.cfa.is_some(), "cfa", "--cfa RGGB"),
        (has_black, "black_level_dn", "--black-level-dn 64"),
    ];
    let missing: Vec<_> = needed.into_iter().filter(|(is_stated, ..)| !is_stated).collect();
    let [keys, options] = [
        missing.iter().map(|(_, key, _)| *key).collect::<Vec<_>>().join(", "),
        missing.iter().map(|(.., option)| *option).collect::<Vec<_>>().join(" "),
    ];
    (!missing.is_empty())
        .then(|| format!("does not state {keys}, which `petzval isp develop` needs; {options} would"))
}

/// A number of the frame that lies outside its range.
fn refused(wrong: OutOfRange) -> JobError {
    let OutOfRange { key, value, low, high, meaning } = wrong;
    JobError::setting(key, value, format!("outside {low}..{high}"), format!("give {meaning}"))
}

impl Request {
    /// Camera and exposure as the request gives them. Levels are those of 16 bits unless the request states more.
    fn info(&self) -> Result<RawInfo> {
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
        info.validate().map_err(refused)?;
        Ok(info)
    }

    /// The format of the output.
    fn format(&self, bits: u32) -> Result<RawFormat> {
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
fn check_bits(request: &Request, frame: &RawFrame, bits: u32) -> Result<()> {
    let Some((row, col, dn)) = frame.beyond(bits) else { return Ok(()) };
    let input = request.input.display();
    Err(JobError::input(
        format!("{input}: the value {dn} at row {row}, column {col} does not fit in {bits} bits"),
        "give the --bits that the numbers have",
    ))
}
