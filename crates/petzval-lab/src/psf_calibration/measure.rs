//! Computes the PSF from the merged mosaic: background, demosaic, centroid, crop, and their errors.
//!
//! The centroid is that of the demosaiced green plane in a round window that moves with it,
//!
//! ```text
//! c <- sum w(|x - c|) (I(x) - b) x / sum w(|x - c|) (I(x) - b),   w = 1 inside 11 px, falling to 0 at 12 px
//! ```
//!
//! until it moves less than 1e-4 px. `I` is linear in the mosaic `m`, so `dc/dm` is the transposed demosaicing of
//! `w (x - c) / sum w (I - b)`, and the standard error follows from the pixels' variances, demosaicing's correlations
//! included (the window held still). `b` is the mean of the pixels of each colour beyond 16 px from the source.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::PsfCalibrationError;
pub use super::frame::{Frame, LEAST_SIDE};
use super::merge::Merged;
use super::spots::{find_source, other_sources};
use petzval_camera::develop::demosaic_bilinear_adjoint;
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::sensor::CfaPattern;

/// Pixels along a side of a measured PSF, as in the paper.
pub const CROP: usize = 23;

/// Window of the centroid: full weight to here, px.
const WINDOW_PX: f64 = 0.5 * CROP as f64 - 0.5;

/// Draws of noise behind the noise floor.
const DRAWS: usize = 48;

/// Colours in the order of the planes.
pub const COLOURS: [&str; CHANNELS] = ["red", "green", "blue"];

/// Checks that PSFs are measured through this mosaic.
pub fn check_mosaic(cfa: CfaPattern) -> Result<(), PsfCalibrationError> {
    if cfa.is_bayer() || cfa == CfaPattern::MONO { Ok(()) } else { Err(PsfCalibrationError::Mosaic(cfa)) }
}

/// A PSF as the pixels of a window show it.
#[derive(Debug, Clone, PartialEq)]
pub struct PixelPsf {
    /// Window row and column of the crop's first pixel.
    pub corner: (usize, usize),
    /// Values of each channel, `CROP` x `CROP`, rows in sensor order, unit sum; noise may take values below 0.
    pub values: [Vec<f64>; CHANNELS],
    /// Sum of each channel over the crop before it was normalised, electrons/s of its pixels. For spots no wider than a
    /// few pixels it depends on their position on the mosaic; the light that [`super::estimate`] fits does not.
    pub light_e_per_s: [f64; CHANNELS],
    /// Centroid of each channel in the window, (row, column), px.
    pub centroid_px: [[f64; 2]; CHANNELS],
}

/// Effect of noise alone on a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseFloor {
    /// Expected L1 distance of each channel's PSF from the noiseless one, background and normalisation included: the mean over
    /// draws of noise with the merged variance.
    pub l1: [f64; CHANNELS],
    /// Standard deviation over the draws of each channel's centroid, (row, column), px.
    pub centroid_px: [[f64; 2]; CHANNELS],
    /// Relative standard deviation over the draws of each channel's light.
    pub light: [f64; CHANNELS],
}

/// One place of the source, measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// The PSF; places are counted in the window.
    pub psf: PixelPsf,
    /// Standard error of the green centroid by propagation, (row, column), px.
    pub centroid_se_px: [f64; 2],
    /// Background of each colour, electrons/s.
    pub background_e_per_s: [f64; CHANNELS],
    /// Noise floor.
    pub floor: NoiseFloor,
    /// The mosaic minus its background, electrons/s.
    pub mosaic_e_per_s: Vec<f64>,
    /// Other bright spots of the window, 4 px and more from the source: (row, column) and share of the main peak.
    pub other_sources: Vec<([usize; 2], f64)>,
}

/// Weight of the centroid's window at a distance from its middle, px.
pub(super) fn window(distance_px: f64) -> f64 {
    (WINDOW_PX + 1.0 - distance_px).clamp(0.0, 1.0)
}

/// Windowed centroid of a plane, (row, column), and the light in the window; `None` if there is none.
pub(super) fn centroid(plane: &[f32], frame: &Frame, start: [f64; 2]) -> Option<([f64; 2], f64)> {
    const MOVES: usize = 50;
    let mut centre = start;
    let mut light = 0.0;
    for _ in 0..MOVES {
        let mut sum = [0.0; 3];
        for (i, value) in plane.iter().enumerate() {
            let weight = window(frame.distance(i, centre)) * f64::from(*value);
            sum[0] += weight;
            sum[1] += weight * (i / frame.width) as f64;
            sum[2] += weight * (i % frame.width) as f64;
        }
        let next = [sum[1] / sum[0], sum[2] / sum[0]];
        let inside =
            next[0] >= 0.0 && next[1] >= 0.0 && next[0] < frame.height as f64 && next[1] < frame.width as f64;
        if !(sum[0] > 0.0 && inside) {
            return None;
        }
        light = sum[0];
        let moved = (next[0] - centre[0]).hypot(next[1] - centre[1]);
        centre = next;
        if moved < 1e-4 {
            break;
        }
    }
    Some((centre, light))
}

/// First row and column of the crop around a centroid; `None` if it leaves the frame.
pub fn crop_corner(centroid_px: [f64; 2], height: usize, width: usize) -> Option<(usize, usize)> {
    let half = (CROP / 2) as f64;
    let (row, col) = (centroid_px[0].round() - half, centroid_px[1].round() - half);
    let fits = row >= 0.0 && col >= 0.0 && row as usize + CROP <= height && col as usize + CROP <= width;
    fits.then_some((row as usize, col as usize))
}

/// Demosaics a mosaic without background and cuts its PSF; around the green centroid, or at a given corner.
pub fn extract(
    mosaic: &[f64],
    frame: &Frame,
    start: [f64; 2],
    corner: Option<(usize, usize)>,
    position: &str,
) -> Result<PixelPsf, PsfCalibrationError> {
    let sensor = |error| PsfCalibrationError::Sensor { position: position.to_owned(), error };
    let planes = frame.demosaic(mosaic).map_err(sensor)?;
    let no_light =
        |c: usize| PsfCalibrationError::NoLight { position: position.to_owned(), colour: COLOURS[c] };
    let (green, _) = centroid(planes.plane(1), frame, start).ok_or_else(|| no_light(1))?;
    let corner = corner.or_else(|| crop_corner(green, frame.height, frame.width)).ok_or_else(|| {
        PsfCalibrationError::NearBorder {
            position: position.to_owned(),
            row: green[0],
            col: green[1],
            size: CROP,
            height: frame.height,
            width: frame.width,
        }
    })?;
    let mut out = PixelPsf {
        corner,
        values: Default::default(),
        light_e_per_s: [0.0; CHANNELS],
        centroid_px: [green; CHANNELS],
    };
    for c in 0..CHANNELS {
        let plane = planes.plane(c);
        let cut = |i: usize| (corner.0 + i / CROP) * frame.width + corner.1 + i % CROP;
        let values: Vec<f64> = (0..CROP * CROP).map(|i| f64::from(plane[cut(i)])).collect();
        let light: f64 = values.iter().sum();
        if !light.is_finite() || light <= 0.0 {
            return Err(no_light(c));
        }
        out.values[c] = values.into_iter().map(|v| v / light).collect();
        out.light_e_per_s[c] = light;
        out.centroid_px[c] = centroid(plane, frame, green).ok_or_else(|| no_light(c))?.0;
    }
    Ok(out)
}

/// Crops light that is known in every colour of every pixel, without a mosaic.
pub fn extract_ideal(
    light: &[Vec<f64>; CHANNELS],
    width: usize,
    corner: (usize, usize),
) -> [Vec<f64>; CHANNELS] {
    std::array::from_fn(|c| {
        let cut = |i: usize| light[c][(corner.0 + i / CROP) * width + corner.1 + i % CROP];
        let values: Vec<f64> = (0..CROP * CROP).map(cut).collect();
        let sum: f64 = values.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        values.into_iter().map(|v| v / sum).collect()
    })
}

/// L1 distance of two PSFs of unit sum, `sum |a - b|`: 0 for equal ones, 2 for ones that share no pixel.
pub fn l1(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum()
}

/// Measures the PSF of one place of the source; `seed` is that of the noise floor's draws.
pub fn measure(
    merged: &Merged,
    frame: &Frame,
    position: &str,
    seed: u64,
) -> Result<Measured, PsfCalibrationError> {
    check_mosaic(frame.cfa)?;
    if frame.height.min(frame.width) < LEAST_SIDE {
        let (height, width) = (frame.height, frame.width);
        let position = position.to_owned();
        return Err(PsfCalibrationError::TooSmall { position, height, width, least: LEAST_SIDE });
    }
    let (rate, variance) = (&merged.rate_e_per_s, &merged.variance);
    let source = find_source(rate, variance, frame, position)?;
    let found = source.map(|v| v as f64);
    let background = frame.background(rate, variance, found);
    let mosaic = frame.without(rate, background);
    let psf = extract(&mosaic, frame, found, None, position)?;
    let centre = psf.centroid_px[1];
    // Start at the brightest spot, because a second source shifts the centroid of the whole frame.
    let other_sources = other_sources(&mosaic, variance, frame, source);
    Ok(Measured {
        centroid_se_px: centroid_error(&mosaic, variance, frame, centre, position)?,
        floor: noise_floor(rate, variance, frame, &psf, position, seed)?,
        psf,
        background_e_per_s: background,
        mosaic_e_per_s: mosaic,
        other_sources,
    })
}

/// Standard error of the green centroid: variances of the mosaic through the transposed demosaicing.
fn centroid_error(
    mosaic: &[f64],
    variance: &[f64],
    frame: &Frame,
    centre: [f64; 2],
    position: &str,
) -> Result<[f64; 2], PsfCalibrationError> {
    let sensor = |error| PsfCalibrationError::Sensor { position: position.to_owned(), error };
    let planes = frame.demosaic(mosaic).map_err(sensor)?;
    let pixels = planes.plane(1).iter().enumerate();
    let light: f64 = pixels.map(|(i, v)| window(frame.distance(i, centre)) * f64::from(*v)).sum();
    let mut error = [0.0; 2];
    for (axis, error) in error.iter_mut().enumerate() {
        let mut by_plane = LinearImage::zeros(CHANNELS, frame.height, frame.width);
        for (i, by) in by_plane.plane_mut(1).iter_mut().enumerate() {
            let at = [(i / frame.width) as f64, (i % frame.width) as f64][axis];
            *by = (window(frame.distance(i, centre)) * (at - centre[axis]) / light) as f32;
        }
        let by_pixel = demosaic_bilinear_adjoint(&by_plane, frame.cfa, frame.placement).map_err(sensor)?;
        let variance: f64 = by_pixel.iter().zip(variance).map(|(g, v)| f64::from(*g).powi(2) * v).sum();
        *error = variance.sqrt();
    }
    Ok(error)
}

/// Repeats the measurement with draws of noise added to the mosaic, and computes the scatter of the results.
fn noise_floor(
    rate: &[f64],
    variance: &[f64],
    frame: &Frame,
    psf: &PixelPsf,
    position: &str,
    seed: u64,
) -> Result<NoiseFloor, PsfCalibrationError> {
    let centre = psf.centroid_px[1];
    let draws: Vec<PixelPsf> = (0..DRAWS)
        .into_par_iter()
        .map(|draw| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(draw as u64);
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let noisy: Vec<f64> = rate.iter().zip(variance).map(|(r, v)| r + v.sqrt() * normal()).collect();
            let background = frame.background(&noisy, variance, centre);
            extract(&frame.without(&noisy, background), frame, centre, Some(psf.corner), position)
        })
        .collect::<Result<_, _>>()?;
    let mean = |f: &dyn Fn(&PixelPsf) -> f64| draws.iter().map(f).sum::<f64>() / DRAWS as f64;
    let spread = |f: &dyn Fn(&PixelPsf) -> f64, middle: f64| mean(&|p| (f(p) - middle).powi(2)).sqrt();
    Ok(NoiseFloor {
        l1: std::array::from_fn(|c| mean(&|p| l1(&p.values[c], &psf.values[c]))),
        centroid_px: std::array::from_fn(|c| {
            std::array::from_fn(|axis| spread(&|p| p.centroid_px[c][axis], psf.centroid_px[c][axis]))
        }),
        light: std::array::from_fn(|c| {
            spread(&|p| p.light_e_per_s[c], psf.light_e_per_s[c]) / psf.light_e_per_s[c]
        }),
    })
}
