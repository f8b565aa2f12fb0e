//! `captures.toml`: the positions of the source and the frames of each.
//!
//! ```toml
//! sensor = "imx249-calibrated"      # built in, or a sensor file beside this one: bits, mosaic, black level, gain, noise
//!
//! [source]
//! distance_mm = 1500.0
//! pinhole_um = 75.0
//! camera_turned = true              # the source stood still and the camera was turned towards it
//! image_scale_mm = 25.46            # image height over the tangent of the field: the focal length, for a far source
//!
//! [[position]]
//! name = "diagonal-3.2"
//! field_radius_mm = 3.2             # without it, and without azimuth_deg: from where the source is found
//! azimuth_deg = 32.0                # from the columns towards higher rows
//! origin = [860, 1380]              # sensor row and column of the frames' first pixel
//! expected_px = [890.2, 1411.9]     # sensor row and column of the chief ray, if it is known
//!
//! [[position.exposure]]
//! exposure_ms = 1.0
//! frames = ["diagonal-3.2/1ms-00.png", "diagonal-3.2/1ms-01.png"]
//! dark_frames = []                  # none: the sensor's modelled dark signal is subtracted
//! ```

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use petzval_base::FileError;
use serde::{Deserialize, Serialize};
use toml::Spanned;

/// Name of the manifest in a folder of captures.
pub const MANIFEST_FILE: &str = "captures.toml";

/// A folder of captures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Built-in name of the sensor, or its file, relative to the manifest.
    pub sensor: String,
    /// Linear gain of all frames, 1 = the sensor's system gain.
    #[serde(default = "unit_gain")]
    pub linear_gain: Spanned<f64>,
    /// Properties of the source.
    #[serde(default)]
    pub source: Source,
    /// Places of the source.
    #[serde(default)]
    pub position: Vec<Position>,
}

/// The point source and how it was moved over the field.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Distance from the lens, mm; absent for a collimator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_mm: Option<Spanned<f64>>,
    /// Diameter of the pinhole, um; 0 for a point.
    #[serde(default)]
    pub pinhole_um: f64,
    /// Whether the camera was turned towards a source that stood still. The source's light then falls with the pupil's
    /// foreshortening only; a flat scene's with three more cosines (two of distance, one of its own slant), which are
    /// multiplied in for the bank's relative illumination.
    #[serde(default)]
    pub camera_turned: bool,
    /// Image height over the tangent of the field angle, mm; needed for those cosines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_scale_mm: Option<Spanned<f64>>,
    /// Shift of the image plane from where the lens file has it, mm, when the lens was focused on the source.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refocus_mm: Option<Spanned<f64>>,
}

/// One place of the source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    /// Name in reports.
    pub name: Spanned<String>,
    /// Ideal (undistorted) image radius, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field_radius_mm: Option<Spanned<f64>>,
    /// Direction from the axis to the image, degrees from the columns towards higher rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub azimuth_deg: Option<Spanned<f64>>,
    /// Sensor row and column of the frames' first pixel.
    #[serde(default = "corner")]
    pub origin: Spanned<[usize; 2]>,
    /// Sensor row and column where the reference chief ray should land, if that is known to a part of a pixel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected_px: Option<Spanned<[f64; 2]>>,
    /// Exposures, the shortest first.
    #[serde(default)]
    pub exposure: Vec<ExposureFiles>,
}

/// The frames of one exposure time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExposureFiles {
    /// Exposure time, ms.
    pub exposure_ms: Spanned<f64>,
    /// Frames, relative to the manifest.
    pub frames: Spanned<Vec<String>>,
    /// Frames of the same time and window without light.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub dark_frames: Vec<String>,
}

fn unit_gain() -> Spanned<f64> {
    unspanned(1.0)
}

fn corner() -> Spanned<[usize; 2]> {
    unspanned([0, 0])
}

/// A value without a position in a text.
pub fn unspanned<T>(value: T) -> Spanned<T> {
    Spanned::new(0..0, value)
}

impl Manifest {
    /// Reads and checks a manifest, without checking that its files exist.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let manifest: Self = FileError::read_toml(text)?;
        manifest.check(text)?;
        Ok(manifest)
    }

    /// The manifest as TOML.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    fn check(&self, text: &str) -> Result<(), FileError> {
        let number = |value: &Spanned<f64>, key: &str, low: f64, high: f64, hint: &str| {
            if (low..=high).contains(value.get_ref()) {
                return Ok(());
            }
            Err(FileError::at(text, value.span(), key, format!("not between {low} and {high}")).hint(hint))
        };
        let optional = |value: &Option<Spanned<f64>>, key: &str, low: f64, high: f64, hint: &str| {
            value.as_ref().map_or(Ok(()), |v| number(v, key, low, high, hint))
        };
        number(&self.linear_gain, "linear_gain", 1e-3, 1e3, "1 is the sensor's system gain")?;
        optional(&self.source.distance_mm, "distance_mm", 1.0, 1e9, "millimetres from the lens")?;
        optional(&self.source.image_scale_mm, "image_scale_mm", 1e-2, 1e5, "the focal length in mm")?;
        let meaning = "millimetres; positive moves the sensor away";
        optional(&self.source.refocus_mm, "refocus_mm", -1e3, 1e3, meaning)?;
        if !(0.0..=1e5).contains(&self.source.pinhole_um) {
            let at = FileError::at_key(text, &["source", "pinhole_um"], "not between 0 and 100000");
            return Err(at.hint("the diameter in um; 0 for a point"));
        }
        if self.position.is_empty() {
            let none = FileError::at_key(text, &["position"], "no position");
            return Err(none.hint("add a [[position]] with a name and its [[position.exposure]]s"));
        }
        let mut names = BTreeSet::new();
        for position in &self.position {
            let name = position.name.get_ref();
            let at = |message: &str| FileError::at(text, position.name.span(), "name", message);
            if name.trim().is_empty() {
                return Err(at("an empty name").hint("any text that distinguishes positions"));
            }
            if !names.insert(name) {
                return Err(at("another position has this name").hint("names distinguish positions"));
            }
            optional(&position.field_radius_mm, "field_radius_mm", 0.0, 1e3, "millimetres from the axis")?;
            optional(&position.azimuth_deg, "azimuth_deg", -360.0, 360.0, "degrees from the columns")?;
            if let Some(expected) = &position.expected_px
                && !expected.get_ref().iter().all(|v| (-0.5..=65535.5).contains(v))
            {
                let off = FileError::at(text, expected.span(), "expected_px", "not on any sensor");
                return Err(off.hint("[row, column] on the sensor"));
            }
            if position.exposure.is_empty() {
                return Err(at("this position has no exposure").hint("add a [[position.exposure]] below it"));
            }
            let mut before = 0.0;
            let mut files = BTreeSet::new();
            for exposure in &position.exposure {
                let ms = &exposure.exposure_ms;
                number(ms, "exposure_ms", 1e-6, 1e7, "milliseconds")?;
                if *ms.get_ref() <= before {
                    let order = format!("not longer than the {before} ms before it");
                    let order = FileError::at(text, ms.span(), "exposure_ms", order);
                    return Err(order.hint("list each exposure time once, the shortest first"));
                }
                before = *ms.get_ref();
                if exposure.frames.get_ref().is_empty() {
                    let none = FileError::at(text, exposure.frames.span(), "frames", "no frame");
                    return Err(none.hint("files relative to this one"));
                }
                let light = exposure.frames.get_ref().iter().map(|file| ("frames", file));
                let dark = exposure.dark_frames.iter().map(|file| ("dark_frames", file));
                for (key, file) in light.chain(dark) {
                    // `./a.png` is `a.png`.
                    let named = Path::new(file).components().filter(|c| *c != Component::CurDir);
                    let path: PathBuf = named.collect();
                    if !files.insert(path) {
                        let span = last_place(text, &exposure.frames.span(), file);
                        let message = format!("{file} is listed twice for this position");
                        let hint = "a repeated frame would count as independent noise, and a file is of one exposure only";
                        return Err(FileError::at(text, span, key, message).hint(hint));
                    }
                }
            }
        }
        Ok(())
    }
}

/// Position of the last mention of a file in the table of its list of frames; position of that list if the file is spelled
/// differently.
fn last_place(text: &str, frames: &Range<usize>, file: &str) -> Range<usize> {
    let end = text.get(frames.end..).and_then(|rest| rest.find("\n[")).map_or(text.len(), |n| frames.end + n);
    let start = text.get(..frames.start).and_then(|head| head.rfind("\n[")).unwrap_or(0);
    let quoted = [format!("\"{file}\""), format!("'{file}'")];
    let found = |quoted: &String| Some((start + text.get(start..end)?.rfind(quoted.as_str())?, quoted.len()));
    let last = quoted.iter().filter_map(found).max();
    last.map_or(frames.clone(), |(at, length)| at..at + length)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"
sensor = "imx249-calibrated"
[[position]]
name = "axis"
[[position.exposure]]
exposure_ms = 1.0
frames = ["a.png", "b.png"]
[[position.exposure]]
exposure_ms = 4.0
frames = ["c.png"]
"#;

    #[test]
    fn writing_and_reading_keeps_a_manifest() {
        let manifest = Manifest::from_toml(GOOD).unwrap();
        assert_eq!(manifest.position[0].exposure.len(), 2);
        assert_eq!(Manifest::from_toml(&manifest.to_toml().unwrap()).unwrap(), manifest);
    }

    #[test]
    fn every_error_has_its_line() {
        for (from, to, line, key) in [
            ("exposure_ms = 4.0", "exposure_ms = 0.5", 9, "exposure_ms"),
            ("exposure_ms = 4.0", "exposure_ms = nan", 9, "exposure_ms"),
            ("frames = [\"c.png\"]", "frames = []", 10, "frames"),
            ("frames = [\"c.png\"]", "frames = [\"c.png\", \"c.png\"]", 10, "frames"),
            ("frames = [\"c.png\"]", "frames = [\"b.png\"]", 10, "frames"),
            ("frames = [\"c.png\"]", "frames = [\"./a.png\"]", 10, "frames"),
            (
                "frames = [\"c.png\"]",
                "frames = [\"c.png\"]\ndark_frames = [\"d.png\", \"d.png\"]",
                11,
                "dark_frames",
            ),
            ("frames = [\"c.png\"]", "frames = [\"c.png\"]\ndark_frames = ['a.png']", 11, "dark_frames"),
            ("frames = [\"c.png\"]", "frame = [\"c.png\"]", 10, "frame"),
            ("name = \"axis\"", "name = \" \"", 4, "name"),
            ("name = \"axis\"", "name = \"axis\"\nfield_radius_mm = -1.0", 5, "field_radius_mm"),
            ("name = \"axis\"", "name = \"axis\"\norigin = [-1, 2]", 5, "origin"),
        ] {
            let error = Manifest::from_toml(&GOOD.replace(from, to)).unwrap_err();
            assert_eq!((error.line, error.key.as_str()), (Some(line), key), "{to}: {error}");
        }
        assert!(Manifest::from_toml("sensor = \"x\"").unwrap_err().to_string().contains("no position"));
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(line in 0usize..11, text in "\\PC{0,40}") {
            let mut lines: Vec<&str> = GOOD.lines().collect();
            let at = line.min(lines.len() - 1);
            lines[at] = &text;
            let _ = Manifest::from_toml(&lines.join("\n"));
            let _ = Manifest::from_toml(&text);
        }
    }
}
