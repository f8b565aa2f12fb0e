//! A measured PSF beside a simulated one, twice: as ideal pixels would show it, and through the same mosaic.
//!
//! Bilinear demosaicing of a spot a few pixels wide is no small error, and one that measured and simulated PSF share if
//! the simulated one goes the same way: landed at the same sub-pixel place, kept by the same colours, demosaiced and cropped.
//! The distance to that one is judged against noise; the distance between the two simulated ones is what demosaicing does.

use super::PsfCalibrationError;
use super::landing::{FinePsf, Spot};
use super::measure::{Frame, Measured, PixelPsf, extract, extract_ideal, l1};
use crate::image::CHANNELS;

/// What simulation says of a measured place.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The simulated PSF through the same mosaic, demosaiced.
    pub fair: PixelPsf,
    /// The simulated PSF in every colour of every pixel, unit sum.
    pub ideal: [Vec<f64>; CHANNELS],
    /// L1 distance of the measured PSF from the fair one.
    pub l1: [f64; CHANNELS],
    /// L1 distance of the measured PSF from the ideal one.
    pub l1_ideal: [f64; CHANNELS],
    /// L1 distance of the fair PSF from the ideal one: demosaicing alone, without noise.
    pub demosaic_l1: [f64; CHANNELS],
    /// Measured less simulated centroid of each channel, (row, column), px. Where the place of the image is not known, the
    /// simulated PSF is put where the green centroids agree, and green says nothing.
    pub centroid_error_px: [[f64; 2]; CHANNELS],
    /// Whether the place of the image was known.
    pub is_placed: bool,
}

/// How often the simulated PSF is moved onto the measured centroid.
const MOVES: usize = 4;

/// Compares at the measured centroid, and says how far that is from `expected`, the window place (row, column) of the reference
/// chief ray, if it is known.
pub fn compare(
    measured: &Measured,
    frame: &Frame,
    simulated: &FinePsf,
    pixel_um: f64,
    azimuth_rad: f64,
    expected_px: Option<[f64; 2]>,
    position: &str,
) -> Result<Comparison, PsfCalibrationError> {
    let goal = measured.psf.centroid_px[1];
    let size = (frame.height, frame.width);
    let corner = Some(measured.psf.corner);
    let land = |at: [f64; 2]| {
        let light = simulated.land(Spot { row: at[0], col: at[1], azimuth_rad }, pixel_um, size);
        let fair = extract(&frame.mosaic(&light), frame, goal, corner, position)?;
        Ok::<_, PsfCalibrationError>((light, fair))
    };
    // The demosaiced centroid is not quite that of the light: walk there.
    let mut at = expected_px.unwrap_or(goal);
    let (mut light, mut fair) = land(at)?;
    let placed = fair.clone();
    for _ in 0..MOVES {
        at = [0, 1].map(|axis| at[axis] + goal[axis] - fair.centroid_px[1][axis]);
        (light, fair) = land(at)?;
    }
    let ideal = extract_ideal(&light, frame.width, measured.psf.corner);
    let beside = if expected_px.is_some() { &placed } else { &fair };
    let each = |a: &[Vec<f64>; CHANNELS], b: &[Vec<f64>; CHANNELS]| std::array::from_fn(|c| l1(&a[c], &b[c]));
    Ok(Comparison {
        l1: each(&measured.psf.values, &fair.values),
        l1_ideal: each(&measured.psf.values, &ideal),
        demosaic_l1: each(&fair.values, &ideal),
        centroid_error_px: std::array::from_fn(|c| {
            [0, 1].map(|axis| measured.psf.centroid_px[c][axis] - beside.centroid_px[c][axis])
        }),
        is_placed: expected_px.is_some(),
        fair,
        ideal,
    })
}
