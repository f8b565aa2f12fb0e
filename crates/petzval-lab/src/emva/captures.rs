//! A series of captures: its frames, and the setting of each.
//!
//! A folder of captures holds frames and one of two lists of them: `captures.toml` ([`manifest`](super::compat::manifest)), or
//! the `EMVA1288descriptor.txt` of the EMVA 1288 Python library ([`descriptor`](super::compat::descriptor)).

use std::path::{Path, PathBuf};

use petzval_base::{Cancelled, InFile, IoError, counted};
use schemars::JsonSchema;
use serde::Serialize;

use petzval_camera::sensor::CfaPattern;
use petzval_files::raw_file::{RawFileError, RawFrame, load_raw, load_raw_page};

/// Name of our list of captures.
pub const MANIFEST: &str = "captures.toml";
/// Name of the file that identifies the series in a folder; it is written before the first frame.
pub(super) const SERIES: &str = "series.toml";
/// Name of the list of captures of the EMVA 1288 Python library.
pub const DESCRIPTOR: &str = "EMVA1288descriptor.txt";

/// Facts of the sensor that the list of captures states.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct SensorFacts {
    /// Name of the sensor.
    pub name: String,
    /// Bits of the converter.
    pub bits: u32,
    /// Pixel pitch, um, if it is known.
    pub pixel_um: Option<f64>,
    /// Colour filter array; mono if there is none.
    pub cfa: CfaPattern,
    /// Black level BL that the camera is set to, DN.
    pub black_level_dn: Option<f64>,
    /// Full well capacity of the data sheet, electrons.
    pub full_well_e: Option<f64>,
    /// f-number of the lens or of the light source, if one matters.
    pub f_number: Option<f64>,
    /// Wavelength of the light, um.
    pub wavelength_um: Option<f64>,
    /// Temperature of the sensor, degrees Celsius.
    pub temperature_c: Option<f64>,
}

/// Whether light falls on the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Uniform light.
    Flat,
    /// No light.
    Dark,
}

/// A frame of the list: a file, or one page of a file with several pages.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct FrameFile {
    /// The file.
    pub path: PathBuf,
    /// The page, counted from 0, if the file has several.
    pub page: Option<usize>,
}

impl From<PathBuf> for FrameFile {
    fn from(path: PathBuf) -> Self {
        Self { path, page: None }
    }
}

impl FrameFile {
    /// Reads the frame.
    pub fn load(&self) -> Result<RawFrame, RawFileError> {
        match self.page {
            Some(page) => load_raw_page(&self.path, page),
            None => load_raw(&self.path),
        }
    }

    /// Its name below a folder, with the page.
    pub fn name_below(&self, folder: &Path) -> String {
        let name = self.path.strip_prefix(folder).unwrap_or(&self.path).display();
        match self.page {
            Some(page) => format!("{name}, page {}", page + 1),
            None => name.to_string(),
        }
    }
}

/// Frames taken under one setting.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Whether light falls on the sensor.
    pub kind: Kind,
    /// Linear gain g.
    pub linear_gain: f64,
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Mean number of photons per pixel; `None` if it was not measured, 0 for dark points.
    pub photons: Option<f64>,
    /// Black level BL of this gain as the camera is set, DN, if it differs from that of the sensor.
    pub black_level_dn: Option<f64>,
    /// The frames.
    pub frames: Vec<FrameFile>,
    /// Line of the list where the point begins.
    pub line: u32,
}

/// By how much two numbers for one exposure time may differ, as a share.
const SAME_TIME: f64 = 1e-9;

impl Point {
    /// Whether the frames are a stack, for the spatial non-uniformity; two frames are for the photon transfer.
    pub fn is_stack(&self) -> bool {
        self.frames.len() > 2
    }

    /// Whether both have one exposure time, but for the rounding of binary fractions.
    pub fn has_time_of(&self, other: &Self) -> bool {
        (self.exposure_s - other.exposure_s).abs() <= SAME_TIME * other.exposure_s
    }

    /// The setting in words.
    pub fn label(&self) -> String {
        let kind = match self.kind {
            Kind::Flat => "flat",
            Kind::Dark => "dark",
        };
        let photons = match (self.kind, self.photons) {
            (Kind::Flat, Some(p)) => format!(", {p} photons"),
            _ => String::new(),
        };
        let frames = counted(self.frames.len(), "frame");
        let ms = milliseconds(self.exposure_s);
        format!("{kind}, gain {}, {ms} ms{photons}, {frames}", self.linear_gain)
    }
}

/// An exposure time in milliseconds, rounded to a thousandth of a nanosecond to remove the digits of binary fractions.
pub fn milliseconds(exposure_s: f64) -> f64 {
    (1e12 * exposure_s).round() / 1e9
}

/// A series of captures.
#[derive(Debug, Clone, PartialEq)]
pub struct Captures {
    /// The folder.
    pub folder: PathBuf,
    /// The list of captures that was read.
    pub list: PathBuf,
    /// What is known about the sensor.
    pub sensor: SensorFacts,
    /// Rows and columns, if the list states them.
    pub size: Option<(usize, usize)>,
    /// The points in the order of the list.
    pub points: Vec<Point>,
}

/// Why a series of captures cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// There is no list of captures.
    #[error("{}: neither {MANIFEST} nor {DESCRIPTOR} is in this folder", .0.display())]
    NoList(PathBuf),
    /// There is no list of captures yet: the simulation of the series was interrupted.
    #[error("{}: {SERIES} without {MANIFEST}: the captures of this series are not complete", .0.display())]
    Unfinished(PathBuf),
    /// The job was cancelled.
    #[error("stopped before all frames were done")]
    Stopped(#[from] Cancelled),
    /// The path is a file in place of a folder.
    #[error("{}: a file, but no list of captures", .0.display())]
    NoFolder(PathBuf),
    /// A file cannot be read or written.
    #[error(transparent)]
    Io(#[from] IoError),
    /// The list of captures is wrong.
    #[error(transparent)]
    List(#[from] InFile),
    /// A frame cannot be read.
    #[error(transparent)]
    Frame(#[from] RawFileError),
    /// The size of a frame differs from that of the others.
    #[error("{}: {width} x {height} pixels, the other frames have {expected_width} x {expected_height}", path.display())]
    Size {
        /// The frame.
        path: PathBuf,
        /// Its rows.
        height: usize,
        /// Its columns.
        width: usize,
        /// Rows of the others.
        expected_height: usize,
        /// Columns of the others.
        expected_width: usize,
    },
    /// A frame or its sidecar contradicts the list.
    #[error("{}: the frame's sidecar or header says {key} = {frame}, {place} says {list}", path.display())]
    Contradiction {
        /// The frame.
        path: PathBuf,
        /// The setting, as the sidecar calls it.
        key: &'static str,
        /// Its value in the frame or the sidecar.
        frame: String,
        /// Its value in the list.
        list: String,
        /// Where in the list.
        place: String,
    },
    /// A frame has a digital number that its converter cannot give.
    #[error("{}: digital number {value} at row {row}, column {col}; a converter of {bits} bits gives at most {max}", path.display())]
    Value {
        /// The frame.
        path: PathBuf,
        /// The number.
        value: u16,
        /// Its row.
        row: usize,
        /// Its column.
        col: usize,
        /// Bits of the converter.
        bits: u32,
        /// Largest number it gives.
        max: u16,
    },
    /// A bit never changes.
    #[error("{}: bit {} of every sample is {}, while higher bits change: a line of the converter or of the link is stuck", list.display(), bit, u8::from(*is_one))]
    StuckBit {
        /// The list of captures.
        list: PathBuf,
        /// Its place; 0 is the lowest.
        bit: u32,
        /// What it is.
        is_one: bool,
    },
    /// The flat frames are darker than the dark ones.
    #[error("{}: the flat frames are darker than the dark ones at {} of {points} points: are flat and dark swapped? See {}", list.display(), swapped.len(), named(swapped))]
    Swapped {
        /// The list of captures.
        list: PathBuf,
        /// Points at which they are: line of the list, and setting in words.
        swapped: Vec<(u32, String)>,
        /// Flat points with dark ones.
        points: usize,
    },
    /// The flat frames are as dark as the dark ones.
    #[error("{}: at none of {points} points are the flat frames brighter than the dark ones", list.display())]
    NoLight {
        /// The list of captures.
        list: PathBuf,
        /// Flat points with dark ones.
        points: usize,
    },
    /// Every flat point is saturated.
    #[error("{}: {}", list.display(), all_saturated(*points, *moved, *clipped))]
    AllSaturated {
        /// The list of captures.
        list: PathBuf,
        /// Flat points with dark ones.
        points: usize,
        /// Flat points that were left out because something moved.
        moved: usize,
        /// Flat points that were left out because they are clipped at zero.
        clipped: usize,
    },
    /// Another series is in the folder.
    #[error("{}: the folder holds another series of captures ({what})", path.display())]
    OtherSeries {
        /// The file that shows it.
        path: PathBuf,
        /// How it differs.
        what: String,
    },
    /// A frame cannot be simulated.
    #[error(transparent)]
    Sensor(#[from] petzval_camera::sensor::SensorError),
    /// A frame cannot be written.
    #[error(transparent)]
    Image(#[from] petzval_files::ImageError),
    /// The plan of a series is out of range.
    #[error("{what}: {problem}")]
    Plan {
        /// Name of the number in the plan.
        what: &'static str,
        /// What is wrong.
        problem: String,
    },
}

/// Points that an error names.
const MOST_NAMED: usize = 3;

/// The first points of the list, each with its line.
fn named(points: &[(u32, String)]) -> String {
    let first: Vec<String> =
        points.iter().take(MOST_NAMED).map(|(line, label)| format!("line {line} ({label})")).collect();
    let more = points.len().saturating_sub(MOST_NAMED);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{rest}", first.join(", "))
}

fn all_saturated(points: usize, moved: usize, clipped: usize) -> String {
    let of_moved = (moved > 0).then(|| {
        format!(", {moved} because their frames differ in a part of the picture (the light flickers or something moved)")
    });
    let of_clipped = (clipped > 0).then(|| format!(", {clipped} because they are clipped at zero"));
    let reasons: String = of_moved.into_iter().chain(of_clipped).collect();
    let end = "are clipped or above 70 % of saturation";
    match moved + clipped {
        0 => format!("all {points} flat points {end}"),
        left_out => {
            format!("{left_out} of {} flat points are left out{reasons}; all others {end}", points + left_out)
        }
    }
}

impl Captures {
    /// The linear gains, ascending.
    pub fn gains(&self) -> Vec<f64> {
        let mut gains: Vec<f64> = self.points.iter().map(|p| p.linear_gain).collect();
        gains.sort_by(f64::total_cmp);
        gains.dedup();
        gains
    }

    /// Black level of a linear gain, DN: that of its points, or that of the sensor.
    pub fn black_level_dn(&self, linear_gain: f64) -> Option<f64> {
        let of_gain = self.points.iter().filter(|p| p.linear_gain == linear_gain);
        of_gain.filter_map(|p| p.black_level_dn).next().or(self.sensor.black_level_dn)
    }

    /// Black level of a linear gain above that of the lowest gain, DN; 0 where they are not stated.
    pub fn black_shift_dn(&self, linear_gain: f64) -> f64 {
        let lowest = self.gains().first().and_then(|gain| self.black_level_dn(*gain));
        self.black_level_dn(linear_gain).zip(lowest).map_or(0.0, |(own, lowest)| own - lowest)
    }

    /// Frames in all.
    pub fn frames(&self) -> usize {
        self.points.iter().map(|p| p.frames.len()).sum()
    }
}
