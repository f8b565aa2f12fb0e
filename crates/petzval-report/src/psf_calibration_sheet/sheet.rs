//! PSFs as pictures: linear and logarithmic, measured and simulated.

use image::{Rgb, RgbImage};
use petzval_camera::image::{CHANNELS, srgb_encode};
use petzval_lab::psf_calibration::CROP;

use super::{Calibration, by_direction};
use crate::png;

/// Picture pixels along one sensor pixel of the sheet.
const ZOOM: usize = 4;

/// Picture pixels between two PSFs.
const GAP: usize = 6;

/// Decades of the logarithmic pictures.
pub(super) const DECADES: f64 = 3.0;

/// Scale of the brightness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Tone {
    /// Proportional to light, as a screen shows it.
    Linear,
    /// By its logarithm, [`DECADES`] below the peak.
    Log,
}

/// One PSF, `CROP` x `CROP` picture pixels, the peak of all colours white.
pub(super) fn picture(values: &[Vec<f64>; CHANNELS], tone: Tone) -> RgbImage {
    let peak = values.iter().flatten().fold(f64::MIN_POSITIVE, |a, b| a.max(*b));
    let level = |value: f64| {
        let share = (value / peak).clamp(0.0, 1.0);
        let shown = match tone {
            Tone::Linear => f64::from(srgb_encode(share as f32)),
            Tone::Log => (1.0 + share.max(1e-9).log10() / DECADES).clamp(0.0, 1.0),
        };
        (255.0 * shown).round() as u8
    };
    RgbImage::from_fn(CROP as u32, CROP as u32, |x, y| {
        let i = y as usize * CROP + x as usize;
        Rgb([0, 1, 2].map(|c| level(values[c].get(i).copied().unwrap_or(0.0))))
    })
}

/// The sheet of all positions as a PNG file.
pub fn sheet_png(calibration: &Calibration) -> Vec<u8> {
    png::encode(&sheet(calibration))
}

/// The PSFs of a position, with their names.
pub(super) fn kinds(calibration: &Calibration, index: usize) -> Vec<(&'static str, &[Vec<f64>; CHANNELS])> {
    let (position, comparison) = &calibration.positions[index];
    let mut kinds = vec![("measured", &position.measured.psf.values)];
    if let Some(comparison) = comparison {
        kinds.push(("simulated, same mosaic", &comparison.fair.values));
        kinds.push(("simulated, ideal pixels", &comparison.ideal));
    }
    kinds
}

/// All PSFs on one sheet. For each direction a block of lines: measured, simulated through the same mosaic, simulated for
/// ideal pixels, in linear and then in logarithmic brightness; the field radius ascends to the right.
pub(super) fn sheet(calibration: &Calibration) -> RgbImage {
    let blocks = by_direction(calibration);
    let kinds_shown = if calibration.lens.is_some() { 3 } else { 1 };
    let (lines, step) = (2 * kinds_shown, CROP * ZOOM + GAP);
    let columns = blocks.iter().map(|(_, members)| members.len()).max().unwrap_or(0);
    let block = lines * step + 3 * GAP;
    let size = ((columns * step + GAP) as u32, (blocks.len() * block + GAP) as u32);
    let mut sheet = RgbImage::from_pixel(size.0.max(1), size.1.max(1), Rgb([48, 48, 48]));
    for (b, (_, members)) in blocks.iter().enumerate() {
        for (column, index) in members.iter().enumerate() {
            for (k, (_, values)) in kinds(calibration, *index).into_iter().enumerate() {
                for (t, tone) in [Tone::Linear, Tone::Log].into_iter().enumerate() {
                    let small = picture(values, tone);
                    let (left, top) = (GAP + column * step, GAP + b * block + (t * kinds_shown + k) * step);
                    for y in 0..CROP * ZOOM {
                        for x in 0..CROP * ZOOM {
                            let colour = *small.get_pixel((x / ZOOM) as u32, (y / ZOOM) as u32);
                            sheet.put_pixel((left + x) as u32, (top + y) as u32, colour);
                        }
                    }
                }
            }
        }
    }
    sheet
}
