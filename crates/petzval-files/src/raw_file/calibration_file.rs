//! Reads the files of calibrations, and says what is wrong with their numbers.

use std::path::Path;

use petzval_base::{FileError, InFile};
use petzval_camera::isp::Mesh;

use super::RawFileError;
use super::calibration::{BlackAtGain, FrameCalibration};

/// Largest calibration that is read, bytes: meshes of a node for every few pixels.
const MOST_BYTES: u64 = 64 << 20;

/// Range of a response, relative to green.
const RESPONSE: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// Furthest that the response of green may lie from 1, to which the others are relative: more than rounding.
const GREEN_MARGIN: f64 = 0.01;

/// Largest relative illumination. Shares of the light stay below it, also of a lens that is brighter beside the middle, and percentages do not.
const MOST_SHADE: f32 = 10.0;

/// Range of what a row of a colour matrix makes of white; 1 keeps it.
const MATRIX_WHITE: std::ops::RangeInclusive<f64> = 0.1..=10.0;

/// Least light at saturation, 1 for white.
const LEAST_SATURATION: f64 = 1e-6;

/// Least distance of white from black, DN.
const LEAST_RANGE_DN: f64 = 1.0;

/// A key with a wrong value.
struct Fault {
    /// The key.
    key: &'static str,
    /// What its value must be, and what is wrong if the value itself does not show it.
    message: String,
    /// What to write.
    hint: &'static str,
    /// Whether the value is short enough to be quoted.
    is_short: bool,
}

impl FrameCalibration {
    /// Reads and checks a file.
    pub fn load(path: &Path) -> Result<Self, RawFileError> {
        let bytes = petzval_base::read_at_most(path, MOST_BYTES).map_err(RawFileError::io(path))?;
        let Ok(text) = String::from_utf8(bytes) else {
            let reason = "the calibration is not UTF-8 text".to_owned();
            return Err(RawFileError::content(path, reason, "give a TOML file with keys such as black_dn"));
        };
        Ok(Self::from_toml(&text).map_err(InFile::at(path))?)
    }

    /// Reads and checks the text of a file.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let calibration: Self = FileError::read_toml(text)?;
        if let Some(Fault { key, message, hint, is_short }) = calibration.fault() {
            let error = FileError::at_key(text, &[key], message).hint(hint);
            return Err(if is_short { error } else { error.without_value() });
        }
        Ok(calibration)
    }

    /// The first fault; `None` if every number is in its range.
    fn fault(&self) -> Option<Fault> {
        self.fault_of_number().or_else(|| self.fault_of_list())
    }

    /// The first fault of the keys with one number or three.
    fn fault_of_number(&self) -> Option<Fault> {
        let is_below = |value: Option<f64>, low: f64| value.is_some_and(|v| !(v.is_finite() && v >= low));
        let least_white_dn = self.black_dn.unwrap_or(0.0) + LEAST_RANGE_DN;
        let white = match self.black_dn {
            Some(black_dn) => {
                format!("must be a number above the black level, `black_dn = {black_dn}`, by 1 DN or more")
            }
            None => "must be a number of 1 DN or more".to_owned(),
        };
        let strange = self
            .response
            .iter()
            .flatten()
            .zip(["red", "green", "blue"])
            .find(|(v, _)| !RESPONSE.contains(*v));
        let response = strange.map_or(String::new(), |(value, colour)| {
            format!("{colour} is {value}, and must lie between 0.01 and 100")
        });
        let absolute = self.response.filter(|[_, green, _]| (green - 1.0).abs() > GREEN_MARGIN);
        let relative = absolute.map_or(String::new(), |[red, green, blue]| {
            let doubt = if green > 1.0 { "; are they in percent?" } else { "" };
            format!(
                "green is {green}, and must be 1: relative to green they are [{:.4}, 1.0, {:.4}]{doubt}",
                red / green,
                blue / green
            )
        });
        let checks = [
            (
                is_below(self.black_dn, 0.0),
                "black_dn",
                "must be a number of 0 or more".to_owned(),
                "give the digital number without light",
            ),
            (
                is_below(self.white_dn, least_white_dn),
                "white_dn",
                white,
                "give the digital number of white, above that of black",
            ),
            (strange.is_some(), "response", response, "give red, green and blue, relative to green"),
            (absolute.is_some(), "response", relative, "divide all three by green"),
            (
                is_below(self.saturation, LEAST_SATURATION),
                "saturation",
                format!("must be a number of {LEAST_SATURATION} or more"),
                "give the light at saturation, 1 for white",
            ),
            (
                is_below(self.gain_ev, f64::MIN),
                "gain_ev",
                "must be a finite number".to_owned(),
                "give the gain in stops, 0 for the lowest",
            ),
        ];
        let (_, key, message, hint) = checks.into_iter().find(|(is_wrong, ..)| *is_wrong)?;
        Some(Fault { key, message, hint, is_short: true })
    }

    /// The first fault of the keys with tables and lists.
    fn fault_of_list(&self) -> Option<Fault> {
        let long = |key, message: Option<String>, hint| {
            message.map(|message| Fault { key, message, hint, is_short: false })
        };
        let ladder = || {
            long(
                "black_at_gain",
                fault_of_ladder(&self.black_at_gain, self.black_dn),
                "give linear_gain, ascending, and black_dn, a number or the same count of numbers at every gain; and no black_dn beside them",
            )
        };
        let noise = || long("noise", self.fault_of_noise(), "give variances, 0 or more");
        let matrix = || {
            long(
                "colour_matrix",
                self.fault_of_matrix(),
                "give three rows of three numbers, each with a sum of about 1, so that white stays white",
            )
        };
        let shading = || {
            long(
                "shading",
                self.shading.as_ref().and_then(|mesh| {
                    fault_of_mesh(mesh, 3, f32::MIN_POSITIVE, "above 0").or_else(|| too_bright(mesh))
                }),
                "give rows and cols, at least 2, and three planes of rows x cols relative illuminations above 0, 1 where all light arrives: red, green, blue",
            )
        };
        let warp = || {
            long(
                "warp",
                self.warp.as_ref().and_then(|mesh| fault_of_mesh(mesh, 2, f32::MIN, "finite")),
                "give rows and cols, at least 2, and two planes of rows x cols displacements in pixels: by rows, by columns",
            )
        };
        ladder().or_else(noise).or_else(matrix).or_else(shading).or_else(warp)
    }

    fn fault_of_noise(&self) -> Option<String> {
        let noise = self.noise?;
        let wrong = [("shot", noise.shot), ("read", noise.read)];
        let (name, value) = wrong.into_iter().find(|(_, v)| !(v.is_finite() && *v >= 0.0))?;
        Some(format!("`{name} = {value}` is no variance: it must be a number of 0 or more"))
    }

    fn fault_of_matrix(&self) -> Option<String> {
        let matrix = self.colour_matrix?;
        if let Some(at) = matrix.iter().flatten().position(|v| !v.is_finite()) {
            return Some(format!(
                "the number at row {}, column {} is {}, and must be finite",
                at / 3 + 1,
                at % 3 + 1,
                matrix[at / 3][at % 3]
            ));
        }
        let sums = matrix.map(|row| row.iter().sum::<f64>());
        let row = sums.iter().position(|sum| !MATRIX_WHITE.contains(sum))?;
        let colour = ["red", "green", "blue"][row];
        let percent = if sums[row] > *MATRIX_WHITE.end() { "; is it in percent?" } else { "" };
        Some(format!(
            "row {} has the sum {}: the {colour} of white becomes so many times as bright{percent}",
            row + 1,
            sums[row]
        ))
    }
}

/// What is wrong with black levels by gain.
fn fault_of_ladder(table: &[BlackAtGain], black_dn: Option<f64>) -> Option<String> {
    let first = table.first()?.black_dn.each_dn().len();
    if let Some(black_dn) = black_dn {
        return Some(format!("stands beside `black_dn = {black_dn}`, and only one of the two can count"));
    }
    let mut before = 0.0;
    for (i, BlackAtGain { linear_gain, black_dn }) in table.iter().enumerate() {
        let (entry, levels) = (i + 1, black_dn.each_dn());
        if !(linear_gain.is_finite() && *linear_gain > before) {
            return Some(format!(
                "entry {entry} has `linear_gain = {linear_gain}`, and must have more than {before}"
            ));
        }
        if levels.is_empty() || levels.len() != first {
            return Some(format!(
                "entry {entry} has {} black levels, and the first has {first}",
                levels.len()
            ));
        }
        if let Some(level) = levels.iter().find(|dn| !(dn.is_finite() && **dn >= 0.0)) {
            return Some(format!("entry {entry} has a black level of {level} DN, and must have 0 or more"));
        }
        before = *linear_gain;
    }
    None
}

/// What is wrong with a mesh of relative illuminations that are no shares of light.
fn too_bright(mesh: &Mesh) -> Option<String> {
    let (plane, values) =
        (1..).zip(&mesh.planes).find(|(_, values)| values.iter().any(|v| *v > MOST_SHADE))?;
    let at = values.iter().position(|v| *v > MOST_SHADE)?;
    Some(format!(
        "plane {plane} has {} at row {}, column {}, and 1 is all light; is it in percent?",
        values[at],
        at / mesh.cols + 1,
        at % mesh.cols + 1
    ))
}

/// What is wrong with a mesh of so many planes, whose values must be finite and at least `low`: `need`, in words.
fn fault_of_mesh(mesh: &Mesh, planes: usize, low: f32, need: &str) -> Option<String> {
    let (rows, cols, found) = (mesh.rows, mesh.cols, &mesh.planes);
    if rows.min(cols) < 2 {
        return Some(format!("a mesh of {rows} x {cols} nodes, and the least is 2 x 2"));
    }
    if found.len() != planes {
        return Some(format!("a mesh of {} planes, and it must have {planes}", found.len()));
    }
    let nodes = rows.saturating_mul(cols);
    for (plane, values) in (1..).zip(found) {
        if values.len() != nodes {
            return Some(format!("plane {plane} has {} numbers for {rows} x {cols} nodes", values.len()));
        }
        if let Some(i) = values.iter().position(|v| !(v.is_finite() && *v >= low)) {
            let (row, col) = (i / cols + 1, i % cols + 1);
            return Some(format!(
                "plane {plane} has {} at row {row}, column {col}, and must be {need}",
                values[i]
            ));
        }
    }
    None
}
