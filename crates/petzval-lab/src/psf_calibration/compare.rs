//! Compares a measured PSF with a simulated one, twice: on ideal pixels, and through the same mosaic.
//!
//! Bilinear demosaicing of a spot a few pixels wide makes a large error. Measured and simulated PSF share it if the
//! simulated one is processed in the same way: placed at the best-fitting sub-pixel position, sampled by the same
//! mosaic, demosaiced and cropped. The distance to that PSF is to be compared with noise. The distance between the two
//! simulated PSFs is the error of demosaicing.

use super::PsfCalibrationError;
use super::landing::{FinePsf, Spot};
use super::measure::{Frame, Measured, PixelPsf, centroid, extract, extract_ideal, l1};
use petzval_camera::image::CHANNELS;

/// The comparison of a measured position with its simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The simulated PSF through the same mosaic, demosaiced.
    pub fair: PixelPsf,
    /// The simulated PSF in every colour of every pixel, unit sum.
    pub ideal: [Vec<f64>; CHANNELS],
    /// L1 distance of the measured PSF from the simulated one through the same mosaic.
    pub l1: [f64; CHANNELS],
    /// L1 distance of the measured PSF from the simulated one on ideal pixels.
    pub l1_ideal: [f64; CHANNELS],
    /// L1 distance between the two simulated PSFs: demosaicing alone, without noise.
    pub demosaic_l1: [f64; CHANNELS],
    /// Measured minus simulated centroid of each channel through the same mosaic, (row, column), px: demosaicing shifts
    /// both, so this is the effect of noise. If the position of the image is not known, the simulated PSF stays where
    /// it fits best, and only differences between channels are meaningful.
    pub centroid_error_px: [[f64; 2]; CHANNELS],
    /// Measured minus ideal-pixel centroid: the total error of the measured centroid, demosaicing included.
    pub centroid_error_ideal_px: [[f64; 2]; CHANNELS],
    /// Centroid of the simulated PSF on ideal pixels in the same round window, (row, column) in the frame, px.
    pub ideal_centroid_px: [[f64; 2]; CHANNELS],
    /// Whether the place of the image was known, and within the frame.
    pub is_placed: bool,
}

/// Number of moves of the simulated PSF.
const MOVES: usize = 4;

/// Step of the differences behind a move, px.
const STEP_PX: f64 = 0.02;

/// Compares the PSFs where the simulated one fits best, and returns how far the measured centroid is from that at `expected`,
/// the window place (row, column) of the reference chief ray, if it is known. A place from which the PSF leaves the frame
/// counts as not known.
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
    // Crop the PSF at the expected chief ray separately, with its own centroid window: it may be far from the measured PSF.
    let placed = expected_px.and_then(|at| {
        let light = simulated.land(Spot { row: at[0], col: at[1], azimuth_rad }, pixel_um, size);
        let fair = extract(&frame.mosaic(&light), frame, at, None, position).ok()?;
        Some((light, fair))
    });

    // Align the centroids, which is exact to a hundredth of a pixel because of noise in the faint surround.
    let (_, near) = land(goal)?;
    let mut at = [0, 1].map(|axis| 2.0 * goal[axis] - near.centroid_px[1][axis]);
    let (mut light, mut fair) = land(at)?;
    // Refine by least squares over all pixels and colours: Gauss-Newton with derivatives by differences.
    for _ in 0..MOVES {
        let along = [land([at[0] + STEP_PX, at[1]])?.1, land([at[0], at[1] + STEP_PX])?.1];
        let (mut normal, mut right) = ([0.0; 3], [0.0; 2]);
        for c in 0..CHANNELS {
            for i in 0..fair.values[c].len() {
                let residual = measured.psf.values[c][i] - fair.values[c][i];
                let by = [0, 1].map(|axis| (along[axis].values[c][i] - fair.values[c][i]) / STEP_PX);
                normal = [normal[0] + by[0] * by[0], normal[1] + by[0] * by[1], normal[2] + by[1] * by[1]];
                right = [right[0] + by[0] * residual, right[1] + by[1] * residual];
            }
        }
        let determinant = normal[0] * normal[2] - normal[1] * normal[1];
        let moved = [
            (normal[2] * right[0] - normal[1] * right[1]) / determinant,
            (normal[0] * right[1] - normal[1] * right[0]) / determinant,
        ];
        // Stop if the PSFs are too different for a sensible step.
        if !moved.iter().all(|m| m.abs() < 0.5) {
            break;
        }
        at = [at[0] + moved[0], at[1] + moved[1]];
        (light, fair) = land(at)?;
    }
    let ideal = extract_ideal(&light, frame.width, measured.psf.corner);
    let (beside_light, beside) = placed.as_ref().map_or((&light, &fair), |(light, fair)| (light, fair));
    let ideal_centroid_px: [[f64; 2]; CHANNELS] = std::array::from_fn(|c| {
        let plane: Vec<f32> = beside_light[c].iter().map(|v| *v as f32).collect();
        let start = beside.centroid_px[c];
        centroid(&plane, frame, start).map_or(start, |(centre, _)| centre)
    });
    let less = |from: &[[f64; 2]; CHANNELS]| {
        std::array::from_fn(|c| [0, 1].map(|axis| measured.psf.centroid_px[c][axis] - from[c][axis]))
    };
    let each = |a: &[Vec<f64>; CHANNELS], b: &[Vec<f64>; CHANNELS]| std::array::from_fn(|c| l1(&a[c], &b[c]));
    Ok(Comparison {
        l1: each(&measured.psf.values, &fair.values),
        l1_ideal: each(&measured.psf.values, &ideal),
        demosaic_l1: each(&fair.values, &ideal),
        centroid_error_px: less(&beside.centroid_px),
        centroid_error_ideal_px: less(&ideal_centroid_px),
        ideal_centroid_px,
        is_placed: placed.is_some(),
        fair,
        ideal,
    })
}
