//! What a simulation writes: the raw frame with its sidecar, and the developed picture.

use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

use petzval_base::PartFolder;
use petzval_camera::image::LinearImage;
use petzval_camera::sensor::{Raw, SensorModel};
use petzval_design::error::DesignError;
use petzval_files::raw_file::{
    FrameCalibration, Packing, RawFileError, RawFormat, RawFrame, save_raw, sidecar_path,
};
use petzval_files::{ImageError, save_exr, save_npy, save_png, save_png16};
use serde_json::{Value, json};

use super::request::{PictureAs, RawAs};
use crate::context::Context;
use crate::error::{JobError, Result};

/// Facts about what was written of one image, by name; see the command's manual.
pub type Facts = serde_json::Map<String, Value>;

/// The file format of a raw frame of so many bits.
fn file_format(raw: RawAs, bits: u32) -> RawFormat {
    match raw {
        RawAs::Tiff => RawFormat::Tiff,
        RawAs::Png => RawFormat::Png,
        RawAs::Packed => RawFormat::Packed(Packing::for_bits(bits)),
        RawAs::Npy => RawFormat::Npy,
    }
}

fn raw_name(raw: RawAs, name: &str) -> String {
    // The ending is the same for any number of bits.
    format!("{name}-raw.{}", file_format(raw, 12).extension())
}

fn developed_name(picture: PictureAs, name: &str) -> String {
    format!("{name}-developed.{}", picture.extension())
}

fn calibration_name(name: &str) -> String {
    format!("{name}-calibration.toml")
}

fn chip_name(name: &str) -> String {
    format!("{name}-isp.png")
}

/// Names of the files of an image: the raw frame, its calibration, the picture and, with an ISP, that by the ISP.
pub fn names((raw, picture): (RawAs, PictureAs), name: &str, has_isp: bool) -> Vec<String> {
    let mut names = vec![developed_name(picture, name), raw_name(raw, name), calibration_name(name)];
    names.extend(has_isp.then(|| chip_name(name)));
    names
}

/// How a picture becomes a file.
type SavePicture = fn(&LinearImage, &Path) -> Result<(), ImageError>;

/// What is written of an image if there is such.
pub struct More {
    /// What an ISP may know of the frame.
    pub calibration: Option<FrameCalibration>,
    /// The PNG of an ISP.
    pub by_chip: Option<Vec<u8>>,
}

/// Writes the results of one image as NAME-raw.*, NAME-calibration.toml, NAME-developed.* and, if an ISP made a PNG, NAME-isp.png, and returns their paths. Where one of them cannot be
/// written, none is. Formats for a display show the light `display_white` as white.
pub fn write(
    (raw_format, picture_format): (RawAs, PictureAs),
    folder: &Path,
    name: &str,
    raw: &Raw,
    sensor: &SensorModel,
    (developed, display_white): (&LinearImage, f32),
    more: &More,
) -> Result<Facts> {
    let format = file_format(raw_format, sensor.bits);
    let (save, white): (SavePicture, _) = match picture_format {
        PictureAs::Png => (save_png, display_white),
        PictureAs::Png16 => (save_png16, display_white),
        PictureAs::Exr => (save_exr, 1.0),
        PictureAs::Npy => (save_npy, 1.0),
    };
    let raw_path = folder.join(raw_name(raw_format, name));
    let developed_path = folder.join(developed_name(picture_format, name));
    let chip_path = folder.join(chip_name(name));
    let mut files = vec![raw_path.clone(), sidecar_path(&raw_path), developed_path.clone()];
    let calibration_path = folder.join(calibration_name(name));
    files.extend(more.calibration.as_ref().map(|_| calibration_path.clone()));
    files.extend(more.by_chip.as_ref().map(|_| chip_path.clone()));
    for path in &files {
        if path.is_dir() {
            return Err(not_written(path, &Error::new(ErrorKind::IsADirectory, "this is a folder")));
        }
    }

    // All files come to be in a folder of their own, and move where they belong when the last is whole.
    let unfinished = Unfinished::new(folder, name)?;
    let [raw_part, developed_part] = [&raw_path, &developed_path].map(|path| unfinished.part(path));
    let mut frame = RawFrame::from_raw(raw, sensor);
    frame.info.calibration = more.calibration.as_ref().map(|_| calibration_name(name));
    save_raw(&frame, &raw_part, format).map_err(|error| match error {
        RawFileError::Io { source, .. } => not_written(&raw_path, &source),
        other => other.into(),
    })?;
    let shown = developed.data.iter().map(|value| value / white).collect();
    save(&LinearImage { data: shown, ..*developed }, &developed_part).map_err(|error| match error {
        ImageError::Io { source, .. } => not_written(&developed_path, &source),
        other => DesignError::from(other).into(),
    })?;
    let calibration = more.calibration.as_ref().map(|calibration| calibration.to_toml().into_bytes());
    for (path, bytes) in [(&calibration_path, &calibration), (&chip_path, &more.by_chip)] {
        if let Some(bytes) = bytes {
            std::fs::write(unfinished.part(path), bytes).map_err(|error| not_written(path, &error))?;
        }
    }
    for path in &files {
        std::fs::rename(unfinished.part(path), path).map_err(|error| not_written(path, &error))?;
    }
    let facts = [
        ("image", json!(name)),
        ("raw", json!(raw_path.display().to_string())),
        ("sidecar", json!(sidecar_path(&raw_path).display().to_string())),
        ("developed", json!(developed_path.display().to_string())),
        ("black_level_dn", json!(sensor.black_level_dn)),
        ("cfa", json!(sensor.cfa)),
    ];
    let path = |path: &Path| json!(path.display().to_string());
    let calibration = calibration.map(|_| ("calibration", path(&calibration_path)));
    let by_chip = more.by_chip.as_ref().map(|_| ("isp", path(&chip_path)));
    let facts = facts.into_iter().chain(calibration).chain(by_chip);
    Ok(facts.map(|(key, value)| (key.to_owned(), value)).collect())
}

/// Reports the files that are named among facts.
pub fn report_files(facts: &Facts, context: &Context) {
    let files = [
        ("raw", "raw frame"),
        ("sidecar", "sidecar"),
        ("calibration", "calibration"),
        ("developed", "picture"),
        ("isp", "picture"),
    ];
    for (key, what) in files {
        if let Some(path) = facts.get(key).and_then(Value::as_str) {
            context.wrote(path, what);
        }
    }
}

fn not_written(path: &Path, error: &std::io::Error) -> JobError {
    JobError::system(
        format!("{}: cannot be written: {error}", path.display()),
        error,
        "choose a folder with --out that can be written, has room, and holds nothing else of that name",
    )
}

/// A hidden folder for files that are not whole yet.
struct Unfinished(PartFolder);

impl Unfinished {
    fn new(folder: &Path, name: &str) -> Result<Self> {
        PartFolder::beside(&folder.join(name)).map(Self).map_err(|error| not_written(folder, &error))
    }

    /// Where the file of that name is made.
    fn part(&self, path: &Path) -> PathBuf {
        self.0.path().join(path.file_name().unwrap_or_default())
    }
}
