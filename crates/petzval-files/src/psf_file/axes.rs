//! The axes of a bank of PSFs, as in `psf.json`.

use petzval_base::FileError;
use petzval_optics::psf::{PsfKind, PsfMethod as Method};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::names::{ILLUMINATION_FILE, VALUES_FILE};

/// What `format` of the file says.
pub const FORMAT: &str = "petzval-psfs";

/// The version that is written. Files without a version are of earlier programs.
pub const VERSION: u32 = 1;

/// Names of the axes of the array of PSFs.
const AXES: [&str; 4] = ["field", "wavelength", "row", "column"];

/// Direction of the rows of a rotationally symmetric lens, and of any other.
const ROW_AXES: [&str; 2] = ["y, away from the axis", "y"];

/// The axes of a bank of PSFs. What is not known is left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PsfAxes {
    /// `petzval-psfs`.
    #[serde(default)]
    pub format: String,
    /// Version of the format.
    #[serde(default)]
    pub version: u32,
    /// Name of the lens.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub lens: String,
    /// Where the PSFs come from, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// How they were made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<PsfOrigin>,
    /// File of the PSFs, beside this one.
    #[serde(default = "values_file")]
    pub values_file: String,
    /// File of the relative illumination, beside this one; without it the illumination is 1 everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub illumination_file: Option<String>,
    /// Names of the axes of the PSFs: field, wavelength, row, column.
    #[serde(default = "axes")]
    pub axes: [String; 4],
    /// Direction of the rows: `y, away from the axis` in a rotationally symmetric lens, else `y`.
    #[serde(default = "row_axis")]
    pub row_axis: String,
    /// Cell size, um.
    pub pitch_um: f64,
    /// Image radii of the fields, mm: where their chief rays land.
    pub field_radius_mm: Vec<f64>,
    /// Whether the PSFs of other azimuths are these, turned. Then the fields lie on the +y axis.
    #[serde(default = "yes")]
    pub rotationally_symmetric: bool,
    /// Where the reference chief ray lands across the plane of the fields, mm.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub chief_ray_x_mm: Vec<f64>,
    /// Where the reference chief ray lands in the plane of the fields, mm.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub chief_ray_y_mm: Vec<f64>,
    /// Field angles, degrees.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub field_deg: Vec<f64>,
    /// Image height per tangent of the field near the axis, mm. With the field angles it gives the distortion of a picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_scale_mm: Option<f64>,
    /// The colour for which each wavelength stands. Without it a camera takes the longest of three wavelengths for red.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<Channel>,
    /// Wavelengths, um.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub wavelengths_um: Vec<f64>,
    /// Share of the light that falls inside the grid, per field and wavelength.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub captured: Vec<Vec<f64>>,
    /// Pupil cells a side; diffraction chooses its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pupil_cells: Option<usize>,
    /// Error by the pupil cells: the sum of absolute differences of PSFs of unit sum; 0 of diffraction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pupil_error: Option<f64>,
    /// How each PSF was computed, per field and wavelength.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub method: Vec<Vec<Method>>,
}

fn values_file() -> String {
    VALUES_FILE.to_owned()
}

fn axes() -> [String; 4] {
    AXES.map(str::to_owned)
}

fn row_axis() -> String {
    ROW_AXES[0].to_owned()
}

fn yes() -> bool {
    true
}

/// How PSFs were made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PsfOrigin {
    /// By rays.
    Geometric,
    /// By waves.
    Diffraction,
    /// From captures.
    Measured,
    /// By another program, or otherwise.
    Other,
}

impl From<PsfKind> for PsfOrigin {
    fn from(kind: PsfKind) -> Self {
        match kind {
            PsfKind::Geometric => Self::Geometric,
            PsfKind::Diffraction => Self::Diffraction,
        }
    }
}

/// A colour of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Channel {
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
}

impl Channel {
    /// The colours of a camera in their order.
    pub const RGB: [Self; 3] = [Self::Red, Self::Green, Self::Blue];
}

impl PsfAxes {
    /// The axes of a rotationally symmetric lens with these fields, in the version that is written; what else is known can be added.
    pub fn new(pitch_um: f64, field_radius_mm: Vec<f64>) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            lens: String::new(),
            source: String::new(),
            kind: None,
            values_file: values_file(),
            illumination_file: Some(ILLUMINATION_FILE.to_owned()),
            axes: axes(),
            row_axis: row_axis(),
            pitch_um,
            field_radius_mm,
            rotationally_symmetric: true,
            chief_ray_x_mm: Vec::new(),
            chief_ray_y_mm: Vec::new(),
            field_deg: Vec::new(),
            image_scale_mm: None,
            channels: Vec::new(),
            wavelengths_um: Vec::new(),
            captured: Vec::new(),
            pupil_cells: None,
            pupil_error: None,
            method: Vec::new(),
        }
    }

    /// The same axes of a lens that is rotationally symmetric or not.
    pub fn symmetric(self, is_symmetric: bool) -> Self {
        let row_axis = ROW_AXES[usize::from(!is_symmetric)].to_owned();
        Self { rotationally_symmetric: is_symmetric, row_axis, ..self }
    }

    /// Reads the text of `psf.json`. Errors name key, line and a hint; numbers are checked with the arrays.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let mut json = serde_json::Deserializer::from_str(text);
        let axes: Self = serde_path_to_error::deserialize(&mut json).map_err(|error| {
            let path = error.path().to_string();
            json_error(text, &path, error.inner())
        })?;
        json.end().map_err(|error| json_error(text, "", &error))?;
        let wrong = |key: &str, message: String, hint: &str| Err(at_key(text, key, message).hint(hint));
        if !axes.format.is_empty() && axes.format != FORMAT {
            let message = format!("\"{}\" is another format", axes.format);
            return wrong("format", message, "write \"petzval-psfs\"");
        }
        if axes.version > VERSION {
            let message = format!("version {} is younger than this program", axes.version);
            return wrong("version", message, "this program reads version 1; take a newer one");
        }
        if axes.axes != AXES {
            let hint = "transpose the array, and write [\"field\", \"wavelength\", \"row\", \"column\"]";
            return wrong("axes", format!("axes {}", axes.axes.join(", ")), hint);
        }
        if !ROW_AXES.contains(&axes.row_axis.as_str()) {
            let hint = "turn the rows so that y grows with them, and write \"y, away from the axis\"";
            return wrong("row_axis", format!("rows along \"{}\"", axes.row_axis), hint);
        }
        let names = [Some(&axes.values_file), axes.illumination_file.as_ref()];
        for (key, name) in ["values_file", "illumination_file"].iter().zip(names) {
            if name.is_some_and(|name| name.is_empty() || name.contains(['/', '\\'])) {
                let hint = "name a file in the folder of this one";
                return wrong(key, "not the name of a file".to_owned(), hint);
            }
        }
        Ok(axes)
    }
}

/// An error of the JSON reader at a path of keys.
fn json_error(text: &str, path: &str, error: &serde_json::Error) -> FileError {
    let message = error.to_string();
    // The message ends with the place, which the error has of its own.
    let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(message, _)| message);
    let (line, column) = (error.line() as u32, error.column() as u32);
    let is_there = line > 0 && !text.trim().is_empty();
    let found = FileError::of_value(path, message);
    FileError { line: is_there.then_some(line), column: is_there.then_some(column), ..found }
}

/// An error about the value of a key, at its place in the text of a JSON file.
pub(super) fn at_key(text: &str, key: &str, message: String) -> FileError {
    let quoted = format!("\"{key}\"");
    match text.find(&quoted) {
        Some(start) => FileError::at(text, start..start + quoted.len(), key, message).without_value(),
        None => FileError { key: key.into(), ..FileError::at_line(0, "", message) },
    }
}
