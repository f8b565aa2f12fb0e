//! `captures.toml`: our list of captures.
//!
//! ```toml
//! [sensor]
//! name = "my camera"
//! bits = 12
//! pixel_um = 5.86            # optional, as all below
//! cfa = "RGGB"               # mono if it is left out
//! black_level_dn = 119.0     # as the camera is set
//! full_well_e = 33723.0
//!
//! [[point]]
//! kind = "flat"              # or "dark"
//! linear_gain = 1.0          # 1 if it is left out
//! exposure_ms = 2.5
//! photons = 4062.4           # mean per pixel; without it there is no quantum efficiency
//! black_level_dn = 119.0     # of this gain, where the gains have different ones
//! frames = ["flat-2.5ms-a.tiff", "flat-2.5ms-b.tiff"]
//! ```
//!
//! Names of frames may have the wildcards `*`, `?`, `[...]` and `**`; each page of a TIFF file of several is a frame.
//!
//! Two frames of a setting are for the photon transfer, a point of more than two for the spatial non-uniformity.

use std::path::Path;

use petzval_base::FileError;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use crate::emva::captures::{Captures, Kind, MANIFEST, Point, SensorFacts};
use petzval_camera::sensor::CfaPattern;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    sensor: Sensor,
    #[serde(default)]
    point: Vec<Spanned<Entry>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sensor {
    name: String,
    bits: Spanned<u32>,
    pixel_um: Option<Spanned<f64>>,
    #[serde(default = "mono")]
    cfa: CfaPattern,
    black_level_dn: Option<Spanned<f64>>,
    full_well_e: Option<Spanned<f64>>,
    f_number: Option<Spanned<f64>>,
    wavelength_um: Option<Spanned<f64>>,
    temperature_c: Option<Spanned<f64>>,
}

fn mono() -> CfaPattern {
    CfaPattern::MONO
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum EntryKind {
    Flat,
    Dark,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    kind: EntryKind,
    linear_gain: Option<Spanned<f64>>,
    exposure_ms: Spanned<f64>,
    photons: Option<Spanned<f64>>,
    black_level_dn: Option<Spanned<f64>>,
    frames: Vec<String>,
}

/// Reads the text of `captures.toml` in `folder`.
pub fn parse(text: &str, folder: &Path) -> Result<Captures, FileError> {
    let file: File = FileError::read_toml(text).map_err(names_dark)?;
    let within = |key: &str, value: &Spanned<f64>, low: f64, high: f64, meaning: &str| {
        let v = *value.get_ref();
        if (low..=high).contains(&v) {
            return Ok(v);
        }
        let message = format!("{v} is outside {low}..{high}");
        Err(FileError::at(text, value.span(), key, message).hint(format!("give {meaning}")))
    };
    let maybe = |key: &str, value: &Option<Spanned<f64>>, low: f64, high: f64, meaning: &str| {
        value.as_ref().map(|v| within(key, v, low, high, meaning)).transpose()
    };
    let s = &file.sensor;
    let bits = *s.bits.get_ref();
    if !(1..=16).contains(&bits) {
        let error = FileError::at(text, s.bits.span(), "bits", format!("{bits} is outside 1..16"));
        return Err(error.hint("give the bits of the converter"));
    }
    let max_dn = (2.0_f64).powi(bits as i32) - 1.0;
    let sensor = SensorFacts {
        name: s.name.clone(),
        bits,
        pixel_um: maybe("pixel_um", &s.pixel_um, 0.1, 1000.0, "the pixel pitch in um")?,
        cfa: s.cfa,
        black_level_dn: maybe("black_level_dn", &s.black_level_dn, 0.0, max_dn, "the black level in DN")?,
        full_well_e: maybe("full_well_e", &s.full_well_e, 1.0, 1e9, "the full well capacity in electrons")?,
        f_number: maybe("f_number", &s.f_number, 0.1, 1000.0, "the f-number")?,
        wavelength_um: maybe("wavelength_um", &s.wavelength_um, 0.01, 100.0, "the wavelength in um")?,
        temperature_c: maybe("temperature_c", &s.temperature_c, -273.0, 1000.0, "degrees Celsius")?,
    };
    let mut points = Vec::new();
    for spanned in &file.point {
        let entry = spanned.get_ref();
        let kind = match entry.kind {
            EntryKind::Flat => Kind::Flat,
            EntryKind::Dark => Kind::Dark,
        };
        let photons = maybe("photons", &entry.photons, 0.0, 1e12, "the mean number of photons per pixel")?;
        if let (Kind::Dark, Some(p), Some(value)) = (kind, photons, &entry.photons)
            && p != 0.0
        {
            let error = FileError::at(text, value.span(), "photons", "a dark point has no photons");
            return Err(error.hint("leave the key out, or make it a flat point"));
        }
        if let (Kind::Flat, Some(0.0), Some(value)) = (kind, photons, &entry.photons) {
            let error = FileError::at(text, value.span(), "photons", "a flat point without photons is dark");
            return Err(error.hint("leave the key out if the photons are not known"));
        }
        let (line, _) = line_of(text, spanned.span().start);
        let gain = maybe("linear_gain", &entry.linear_gain, 1e-6, 1e6, "the linear gain")?;
        let (exposure, black) = ("the exposure time in milliseconds", "the black level of this gain in DN");
        let exposure_ms = within("exposure_ms", &entry.exposure_ms, 0.0, 1e9, exposure)?;
        points.push(Point {
            kind,
            linear_gain: gain.unwrap_or(1.0),
            exposure_s: exposure_ms / 1e3,
            photons: if kind == Kind::Dark { Some(0.0) } else { photons },
            black_level_dn: maybe("black_level_dn", &entry.black_level_dn, 0.0, max_dn, black)?,
            frames: entry.frames.iter().map(|name| folder.join(name.replace('\\', "/")).into()).collect(),
            line,
        });
    }
    let found =
        Captures { folder: folder.to_owned(), list: folder.join(MANIFEST), sensor, size: None, points };
    check_black_levels(text, &file.point, &found)?;
    Ok(found)
}

/// What dark frames are called elsewhere.
const OTHER_DARK: [&str; 3] = ["black", "bias", "offset"];

/// The error about a kind that is another word for dark, with this as its hint.
fn names_dark(error: FileError) -> FileError {
    let is_dark = error.key == "kind" && OTHER_DARK.contains(&error.value.trim_matches('"'));
    if is_dark { error.hint("frames without light are of the kind \"dark\"") } else { error }
}

/// Refuses two black levels of one gain, and gains without one beside others that have one.
fn check_black_levels(text: &str, entries: &[Spanned<Entry>], found: &Captures) -> Result<(), FileError> {
    let key = "black_level_dn";
    let is_stated = found.points.iter().any(|point| point.black_level_dn.is_some());
    for (entry, point) in entries.iter().zip(&found.points).filter(|_| is_stated) {
        let gain = point.linear_gain;
        let own = entry.get_ref().black_level_dn.as_ref();
        match (own, point.black_level_dn, found.black_level_dn(gain)) {
            (Some(value), Some(own), Some(first)) if own != first => {
                let message = format!("{own} at gain {gain}, where a point above states {first}");
                let error = FileError::at(text, value.span(), key, message);
                return Err(error.hint("give all points of a gain the same black level"));
            }
            (.., None) => {
                let message = format!("gain {gain} states none, and other gains do");
                let error = FileError::at(text, entry.span(), key, message);
                return Err(
                    error.hint("state it in a [[point]] of every gain, or in [sensor] for the others")
                );
            }
            _ => {}
        }
    }
    Ok(())
}

/// Line from 1, and its first byte.
fn line_of(text: &str, offset: usize) -> (u32, usize) {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let start = before.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    (before.iter().filter(|b| **b == b'\n').count() as u32 + 1, start)
}

/// The list as it is written: facts that are not known are left out.
#[derive(Serialize)]
struct OutFile<'a> {
    sensor: &'a SensorFacts,
    point: &'a [Listed],
}

/// One entry of a list to be written: a point with the names of its frames in the folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Listed {
    /// Whether light falls on the sensor.
    pub kind: Kind,
    /// Linear gain g.
    pub linear_gain: f64,
    /// Exposure time, ms.
    pub exposure_ms: f64,
    /// Photons per pixel, if they are known.
    pub photons: Option<f64>,
    /// Names of the frames.
    pub frames: Vec<String>,
}

/// The text of `captures.toml` for these points.
pub fn write(sensor: &SensorFacts, points: &[Listed]) -> Result<String, toml::ser::Error> {
    toml::to_string(&OutFile { sensor, point: points })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"[sensor]
name = "test"
bits = 12

[[point]]
kind = "flat"
exposure_ms = 2.5
frames = ["a.png", "sub\\b.png"]

[[point]]
kind = "dark"
linear_gain = 2.0
exposure_ms = 5.0
frames = ["c.png", "d.png"]
"#;

    #[test]
    fn a_list_is_read_with_its_defaults() {
        let captures = parse(TEXT, Path::new("folder")).unwrap();
        assert_eq!(captures.sensor.cfa, CfaPattern::MONO);
        let [flat, dark] = &captures.points[..] else { panic!("two points") };
        assert_eq!(
            (flat.kind, flat.linear_gain, flat.exposure_s, flat.photons),
            (Kind::Flat, 1.0, 0.0025, None)
        );
        assert_eq!(flat.frames[1].path, Path::new("folder/sub/b.png"));
        assert_eq!((dark.kind, dark.linear_gain, dark.photons, dark.line), (Kind::Dark, 2.0, Some(0.0), 10));
    }

    #[test]
    fn every_error_has_its_line() {
        for (from, to, line, key, says) in [
            ("bits = 12", "bits = 20", 3, "bits", "outside"),
            ("bits = 12", "bitts = 12", 3, "bitts", "did you mean `bits`"),
            ("exposure_ms = 2.5", "exposure_ms = -1.0", 7, "exposure_ms", "milliseconds"),
            ("exposure_ms = 2.5", "exposure_s = 0.0025", 7, "exposure_s", "exposure_ms"),
            ("linear_gain = 2.0", "linear_gain = nan", 12, "linear_gain", "outside"),
            ("linear_gain = 2.0", "photons = 3.0", 12, "photons", "dark point"),
            ("kind = \"dark\"", "kind = \"drak\"", 11, "kind", "dark"),
            (
                "linear_gain = 2.0",
                "linear_gain = 2.0\nblack_level_dn = 5000.0",
                13,
                "black_level_dn",
                "outside",
            ),
            (
                "exposure_ms = 2.5",
                "exposure_ms = 2.5\nblack_level_dn = 64.0",
                11,
                "black_level_dn",
                "gain 2 states",
            ),
            (
                "linear_gain = 2.0",
                "linear_gain = 1.0\nblack_level_dn = 64.0\nexposure_ms = 1.0\nframes = []\n[[point]]\nkind = \"dark\"\nblack_level_dn = 70.0",
                18,
                "black_level_dn",
                "64",
            ),
        ] {
            let error = parse(&TEXT.replace(from, to), Path::new("")).unwrap_err();
            assert_eq!((error.line, error.key.as_str()), (Some(line), key), "{error}");
            assert!(error.to_string().contains(says), "{error}");
        }
    }

    #[test]
    fn a_wrong_kind_is_given_the_word_for_it() {
        for (kind, hint) in [
            ("black", "frames without light are of the kind \"dark\""),
            ("bias", "frames without light are of the kind \"dark\""),
            ("darks", "did you mean \"dark\"?"),
            ("lamp", "write one of these values"),
        ] {
            let text = TEXT.replace("kind = \"dark\"", &format!("kind = \"{kind}\""));
            let error = parse(&text, Path::new("")).unwrap_err();
            assert_eq!((error.line, error.hint.as_deref()), (Some(11), Some(hint)), "{error}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(line in 0usize..14, text in "\\PC{0,40}", newline in proptest::bool::ANY) {
            let mut lines: Vec<&str> = TEXT.lines().collect();
            if newline { lines.insert(line, &text) } else { lines[line] = &text }
            let _ = parse(&lines.join("\n"), Path::new(""));
            let _ = parse(&text, Path::new(""));
            let _ = super::super::descriptor::parse(&text, Path::new(""));
        }
    }
}
