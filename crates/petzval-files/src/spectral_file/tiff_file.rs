//! Spectral images as TIFF files: a page per band, or one page with a sample per band.

use std::io::Cursor;

use tiff::decoder::{Decoder, DecodingResult};

use super::sidecar::Sidecar;
use crate::limits::MAX_VALUES;
use petzval_camera::spectral::SpectralImage;

type Wrong = (String, &'static str);

const HINT: &str =
    "a spectral TIFF has one gray page per band, or one page with one sample per band, all of one size";

/// Reads all pages. Each sample of a page is a band.
pub fn read(bytes: &[u8], sidecar: &Sidecar) -> Result<SpectralImage, Wrong> {
    let damaged = |e: tiff::TiffError| (format!("not a readable TIFF file: {e}"), HINT);
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(damaged)?;
    let (width, height) = decoder.dimensions().map_err(damaged)?;
    let (width, height) = (width as usize, height as usize);
    let expected = sidecar.wavelength_um.len();
    let pixels = width.checked_mul(height).filter(|n| *n > 0 && n.saturating_mul(expected) <= MAX_VALUES);
    let pixels = pixels.ok_or_else(|| (format!("pages of {width} x {height} pixels"), HINT))?;
    let mut data: Vec<f32> = Vec::new();
    loop {
        let size = decoder.dimensions().map_err(damaged)?;
        if size != (width as u32, height as u32) {
            return Err((format!("pages of {width} x {height} and of {} x {} pixels", size.0, size.1), HINT));
        }
        let samples = usize::from(decoder.colortype().map_err(damaged)?.num_samples());
        let page = as_f32(decoder.read_image().map_err(damaged)?)?;
        if page.len() != pixels * samples || data.len() + page.len() > pixels * expected {
            let bands = (data.len() + page.len()) / pixels;
            return Err((format!("{bands} bands or more, but {expected} wavelengths in the sidecar"), HINT));
        }
        for sample in 0..samples {
            data.extend(
                page.iter().skip(sample).step_by(samples).map(|v| (f64::from(*v) * sidecar.scale) as f32),
            );
        }
        if !decoder.more_images() {
            break;
        }
        decoder.next_image().map_err(damaged)?;
    }
    if data.len() != pixels * expected {
        let reason = format!("{} bands, but {expected} wavelengths in the sidecar", data.len() / pixels);
        return Err((reason, HINT));
    }
    Ok(SpectralImage { wavelength_um: sidecar.wavelength_um.clone(), height, width, data })
}

fn as_f32(page: DecodingResult) -> Result<Vec<f32>, Wrong> {
    Ok(match page {
        DecodingResult::F32(v) => v,
        DecodingResult::F64(v) => v.into_iter().map(|v| v as f32).collect(),
        DecodingResult::F16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U8(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U16(v) => v.into_iter().map(f32::from).collect(),
        DecodingResult::U32(v) => v.into_iter().map(|v| v as f32).collect(),
        _ => return Err(("samples of a type that is not read".to_owned(), "use float or unsigned samples")),
    })
}
