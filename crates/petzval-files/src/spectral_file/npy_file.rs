//! Spectral images as NumPy arrays: `[bands, rows, columns]` or `[rows, columns, bands]`.

use npyz::NpyFile;

use super::sidecar::{Axes, Sidecar};
use crate::limits::MAX_VALUES;
use petzval_camera::spectral::SpectralImage;

const HINT: &str = "a spectral image is an array of three axes of float32, float64, uint8 or uint16";

/// Reads an array of three axes, of any byte order and memory layout.
pub fn read(bytes: &[u8], sidecar: &Sidecar) -> Result<SpectralImage, (String, &'static str)> {
    let wrong = |reason: String| (reason, HINT);
    let array = NpyFile::new(bytes).map_err(|e| wrong(format!("not a .npy file: {e}")))?;
    let shape: [u64; 3] =
        array.shape().try_into().map_err(|_| wrong(format!("an array of {} axes", array.shape().len())))?;
    let count = shape.iter().try_fold(1u64, |n, side| n.checked_mul(*side)).unwrap_or(u64::MAX);
    if count == 0 || count > MAX_VALUES as u64 || count > bytes.len() as u64 {
        return Err(wrong(format!("an array of {shape:?} in a file of {} bytes", bytes.len())));
    }
    let strides: Vec<usize> = array.strides().iter().map(|s| *s as usize).collect();
    let values = values(array)?;
    let side = shape.map(|s| s as usize);
    let (bands, rows, columns) = match sidecar.axes {
        Axes::BandsFirst => (0, 1, 2),
        Axes::BandsLast => (2, 0, 1),
    };
    if side[bands] != sidecar.wavelength_um.len() {
        let known = sidecar.wavelength_um.len();
        let reason = format!("{} bands, but {known} wavelengths in the sidecar", side[bands]);
        return Err((reason, "check `wavelength_um` and `axes` of the sidecar"));
    }
    let scale = sidecar.scale;
    let mut data = Vec::with_capacity(values.len());
    for band in 0..side[bands] {
        for row in 0..side[rows] {
            let start = band * strides[bands] + row * strides[rows];
            data.extend((0..side[columns]).map(|c| (values[start + c * strides[columns]] * scale) as f32));
        }
    }
    let (height, width) = (side[rows], side[columns]);
    Ok(SpectralImage { wavelength_um: sidecar.wavelength_um.clone(), height, width, data })
}

/// The values in the order of the file.
fn values(array: NpyFile<&[u8]>) -> Result<Vec<f64>, (String, &'static str)> {
    let kind = array.dtype().descr();
    let cut = |e: std::io::Error| (format!("the values cannot be read: {e}"), HINT);
    let array = match array.try_data::<f32>() {
        Ok(data) => return data.map(|v| v.map(f64::from)).collect::<Result<_, _>>().map_err(cut),
        Err(array) => array,
    };
    let array = match array.try_data::<f64>() {
        Ok(data) => return data.collect::<Result<_, _>>().map_err(cut),
        Err(array) => array,
    };
    let array = match array.try_data::<u16>() {
        Ok(data) => return data.map(|v| v.map(f64::from)).collect::<Result<_, _>>().map_err(cut),
        Err(array) => array,
    };
    match array.try_data::<u8>() {
        Ok(data) => data.map(|v| v.map(f64::from)).collect::<Result<_, _>>().map_err(cut),
        Err(_) => Err((format!("values of type {kind}"), HINT)),
    }
}
