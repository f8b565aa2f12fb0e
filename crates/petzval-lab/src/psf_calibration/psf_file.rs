//! A bank of PSFs as two files: `psfs.toml` with the axes, and the values beside it as `.npy`.

use std::path::{Path, PathBuf};

use petzval_base::FileError;
use serde::{Deserialize, Serialize};

use super::PsfCalibrationError;
use petzval_base::write_whole;
use petzval_camera::image::CHANNELS;
use petzval_camera::psf::{PsfBank, PsfError, PsfLayout};
use petzval_files::npy_bytes;

/// Name of the file with the axes.
pub const AXES_FILE: &str = "psfs.toml";

/// Largest number of values of a bank: 1 GiB in single precision.
const MOST_VALUES: usize = 1 << 28;

/// Permitted cell sizes, um.
const PITCH_UM: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

/// How NumPy writes a file that is read.
const NUMPY_HINT: &str = "hint: numpy.save(file, numpy.ascontiguousarray(psfs, dtype=\"<f4\"))";

/// The axes of a bank of PSFs, as in `psfs.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PsfAxes {
    /// Source of the PSFs.
    pub source: String,
    /// File of the values beside this one: float32 of either byte order, `[field][channel][row][col]` in C order, unit sum each.
    pub values: String,
    /// Cells along a side.
    pub grid: usize,
    /// Cell size, um.
    pub pitch_um: f64,
    /// Image radius of each field, mm, ascending from 0.
    pub field_radius_mm: Vec<f64>,
    /// Relative illumination of each field in red, green and blue.
    pub illumination: Vec<[f32; CHANNELS]>,
}

/// Writes a bank to a folder: the values first, then the axes that name them, each under a temporary name.
pub fn save_psfs(bank: &PsfBank, source: &str, folder: &Path) -> Result<PathBuf, PsfCalibrationError> {
    bank.validate()?;
    let values = folder.join("psfs.npy");
    let shape = [bank.field_radius_mm.len() as u64, CHANNELS as u64, bank.grid as u64, bank.grid as u64];
    npy_bytes(&shape, &bank.values)
        .and_then(|npy| write_whole(&values, &npy))
        .map_err(PsfCalibrationError::io(&values))?;
    let axes = PsfAxes {
        source: source.to_owned(),
        values: "psfs.npy".to_owned(),
        grid: bank.grid,
        pitch_um: bank.pitch_um,
        field_radius_mm: bank.field_radius_mm.clone(),
        illumination: bank.illumination.chunks_exact(CHANNELS).map(|v| [v[0], v[1], v[2]]).collect(),
    };
    let path = folder.join(AXES_FILE);
    let text = toml::to_string(&axes)
        .map_err(|e| PsfCalibrationError::Values { path: path.clone(), reason: e.to_string() })?;
    let head = "# Point-spread functions, measured or traced, for `petzval simulate --psfs`.\n\
                # Rows of each PSF run away from the axis; the image point is in the middle of the grid.\n";
    write_whole(&path, format!("{head}{text}").as_bytes()).map_err(PsfCalibrationError::io(&path))?;
    Ok(path)
}

/// Reads a bank from its `psfs.toml`, or from the folder that holds one.
pub fn load_psfs(path: &Path) -> Result<PsfBank, PsfCalibrationError> {
    let path = if path.is_dir() { path.join(AXES_FILE) } else { path.to_owned() };
    let bytes = petzval_base::read_whole(&path).map_err(PsfCalibrationError::io(&path))?;
    let text = String::from_utf8(bytes).map_err(|_| PsfCalibrationError::Values {
        path: path.clone(),
        reason: "the file is not UTF-8 text; hint: `petzval psf-calibrate` writes such files".to_owned(),
    })?;
    let axes: PsfAxes = toml::from_str(&text)
        .map_err(|e| PsfCalibrationError::file(&path)(FileError::from_toml(&text, &e)))?;
    let wrong = |key: &str, message: String, hint: &str| {
        PsfCalibrationError::file(&path)(FileError::at_key(&text, &[key], message).hint(hint))
    };
    if !PITCH_UM.contains(&axes.pitch_um) {
        let message = format!("not between {} and {}", PITCH_UM.start(), PITCH_UM.end());
        return Err(wrong("pitch_um", message, "the size of a cell in um"));
    }
    let layout =
        PsfLayout { field_radius_mm: axes.field_radius_mm.clone(), grid: axes.grid, pitch_um: axes.pitch_um };
    layout.validate().map_err(|e| match e {
        PsfError::Grid { .. } => wrong("grid", e.to_string(), "the number of cells a side"),
        _ => wrong("field_radius_mm", e.to_string(), "radii in mm from 0 upwards"),
    })?;
    let fields = axes.field_radius_mm.len();
    let cells = axes.grid.checked_mul(axes.grid).and_then(|n| n.checked_mul(CHANNELS * fields));
    if cells.is_none_or(|n| n > MOST_VALUES) {
        return Err(wrong(
            "grid",
            format!("{fields} fields of this grid are too many values"),
            "a smaller grid",
        ));
    }
    if axes.illumination.len() != fields {
        let message = format!("{} fields, but {fields} radii", axes.illumination.len());
        return Err(wrong("illumination", message, "three numbers for each field"));
    }
    // Read the values from the folder of the axes.
    let values_path = path.parent().unwrap_or(Path::new("")).join(&axes.values);
    let values_wrong = |reason: String| PsfCalibrationError::Values { path: values_path.clone(), reason };
    let bytes = petzval_base::read_whole(&values_path).map_err(PsfCalibrationError::io(&values_path))?;
    let npy = npyz::NpyFile::new(&bytes[..]).map_err(|e| values_wrong(e.to_string()))?;
    let shape = [fields as u64, CHANNELS as u64, axes.grid as u64, axes.grid as u64];
    if npy.shape() != shape || npy.order() != npyz::Order::C {
        let (found, order) = (npy.shape().to_vec(), npy.order());
        return Err(values_wrong(format!(
            "holds {found:?} ({order:?} order); {shape:?} (C order) are needed; {NUMPY_HINT}"
        )));
    }
    let kind = npy.dtype().descr();
    let values: Vec<f32> =
        npy.into_vec().map_err(|_| values_wrong(format!("holds {kind}, not float32; {NUMPY_HINT}")))?;
    let bank = PsfBank {
        field_radius_mm: axes.field_radius_mm,
        grid: axes.grid,
        pitch_um: axes.pitch_um,
        values,
        illumination: axes.illumination.into_iter().flatten().collect(),
    };
    bank.validate().map_err(|e| match e {
        PsfError::Value { what: "the illumination", .. } => {
            wrong("illumination", e.to_string(), "numbers from 0, 1 on the axis")
        }
        e => values_wrong(e.to_string()),
    })?;
    Ok(bank)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bank() -> PsfBank {
        let mut values = vec![0.0; CHANNELS * 16];
        values.chunks_exact_mut(16).for_each(|psf| psf[5] = 1.0);
        PsfBank {
            field_radius_mm: vec![0.0],
            grid: 4,
            pitch_um: 1.5,
            values,
            illumination: vec![1.0; CHANNELS],
        }
    }

    #[test]
    fn writing_and_reading_keeps_a_bank_and_a_failure_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let path = save_psfs(&bank(), "test", at).unwrap();
        assert_eq!(load_psfs(&path).unwrap(), bank());
        assert_eq!(load_psfs(at).unwrap(), bank());
        assert_eq!(std::fs::read_dir(at).unwrap().count(), 2);

        // A folder stands where the values should go.
        let other = tempfile::tempdir().unwrap();
        std::fs::create_dir(other.path().join("psfs.npy")).unwrap();
        assert!(matches!(save_psfs(&bank(), "test", other.path()), Err(PsfCalibrationError::Io { .. })));
        assert_eq!(std::fs::read_dir(other.path()).unwrap().count(), 1);
    }

    /// Files as NumPy writes them: what holds the same numbers is read, everything else is refused with a hint.
    #[test]
    fn values_in_other_forms_are_read_as_they_are_or_refused() {
        let folder = tempfile::tempdir().unwrap();
        save_psfs(&bank(), "test", folder.path()).unwrap();
        let mut wanted = bank();
        // Unequal values show a wrong order of bytes or axes.
        (wanted.values[5], wanted.values[6]) = (0.75, 0.25);
        let write = |kind: &str, is_fortran: &str, bytes: Vec<u8>| {
            let text =
                format!("{{'descr': '{kind}', 'fortran_order': {is_fortran}, 'shape': (1, 3, 4, 4), }}");
            let head = format!("{text:<117}\n");
            let file = [&b"\x93NUMPY\x01\x00\x76\x00"[..], head.as_bytes(), &bytes].concat();
            std::fs::write(folder.path().join("psfs.npy"), file).unwrap();
            load_psfs(folder.path()).map_err(|e| e.to_string())
        };
        let values = &wanted.values;
        let little: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(write("<f4", "False", little.clone()).unwrap(), wanted);
        assert_eq!(
            write(">f4", "False", values.iter().flat_map(|v| v.to_be_bytes()).collect()).unwrap(),
            wanted
        );
        let double = values.iter().flat_map(|v| f64::from(*v).to_le_bytes()).collect();
        let half: Vec<u8> = values.iter().flat_map(|v| (0.5 * v).to_le_bytes()).collect();
        for (read, needles) in [
            (write("<f8", "False", double), ["not float32", "ascontiguousarray"]),
            (write("<f4", "True", little), ["Fortran order", "ascontiguousarray"]),
            (write("<f4", "False", half), ["0.5", "sum"]),
        ] {
            let error = read.unwrap_err();
            assert!(needles.iter().all(|needle| error.contains(needle)), "{error}");
        }
    }

    #[test]
    fn every_error_names_its_key() {
        let folder = tempfile::tempdir().unwrap();
        let path = save_psfs(&bank(), "test", folder.path()).unwrap();
        let good = std::fs::read_to_string(&path).unwrap();
        for pitch in ["1e300", "1e-300", "nan", "-1.0", "inf"] {
            std::fs::write(&path, good.replace("pitch_um = 1.5", &format!("pitch_um = {pitch}"))).unwrap();
            match load_psfs(&path).unwrap_err() {
                PsfCalibrationError::File { path: at, error } => {
                    assert_eq!((&at, error.key.as_str(), error.value.as_str()), (&path, "pitch_um", pitch));
                    assert!(error.line.is_some() && error.to_string().len() < 200, "{error}");
                }
                other => panic!("{pitch}: {other}"),
            }
        }
        std::fs::write(&path, b"source = \"\xff\"").unwrap();
        let error = load_psfs(&path).unwrap_err().to_string();
        assert!(error.contains("psfs.toml") && error.contains("not UTF-8"), "{error}");
    }
}
