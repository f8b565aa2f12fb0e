//! One exposure: irradiance in, raw frame out, and the derivatives of every pixel.
//!
//! The physics is that of [`expose_pixel`](super::expose_pixel); here whole rows go through each of its steps, so that
//! they compile to vector code of the widest instruction set of the machine, or of the one that
//! [`PETZVAL_SIMD`](petzval_base::simd) asks for; the bits are the same with all of them.

use petzval_base::simd::dispatch;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::fixed_pattern::{Pattern, PatternRow, PatternScratch, PixelPattern, Shared};
use super::noise::{FrameStreams, ShotScratch};
use super::pixel::{Chain, Charge, light};
use super::{Capture, Noise, Raw, SensorError, SensorModel};
use crate::image::{CHANNELS, LinearImage};
use petzval_base::random::place;

/// Derivatives of a frame, one number per pixel and array, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Slopes {
    /// By the light that the pixel sees ([`SensorModel::response`] times irradiance), DN per unit.
    pub light: Vec<f32>,
    /// By the binary logarithm of the linear gain, DN per stop.
    pub log2_gain: Vec<f32>,
    /// By the binary logarithm of the exposure (`white_e` and `time_s` together), DN per stop.
    pub log2_exposure: Vec<f32>,
}

/// Exposes the sensor window at `capture.placement` to `irradiance` (3 planes, 1.0 = white).
pub fn expose(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
) -> Result<Raw, SensorError> {
    check_irradiance(irradiance)?;
    check_capture(sensor, capture, irradiance.height, irradiance.width)?;
    let (height, width) = (irradiance.height, irradiance.width);
    let frame = Frame::new(irradiance, sensor, capture, noise, 0.0);
    let mut dn = vec![0.0f32; height * width];
    dn.par_chunks_exact_mut(width.max(1)).enumerate().for_each_init(
        Scratch::default,
        |scratch, (row, dn)| {
            let slopes: [&mut [f32]; 3] = Default::default();
            dispatch(ExposeRow::<false> { frame: &frame, row, scratch, dn, slopes });
        },
    );
    Ok(Raw { height, width, dn, capture: *capture })
}

/// As [`expose`], with the derivatives of every digital number.
///
/// The derivative by the electrons' rate is that of the [`NoiseMode`](super::NoiseMode); read and electronics noise are
/// ordinary reparameterised normal noise, so gain and exposure have exact derivatives for the draws at hand. Rounding
/// passes a gradient through. Negative light blocks it; a full well and a converter at its limits let `leak` of it
/// through: 0 is the true derivative, and a small positive number lets an optimiser feel a saturated pixel.
pub fn expose_with_tape(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
    leak: f32,
) -> Result<(Raw, Slopes), SensorError> {
    check_irradiance(irradiance)?;
    check_capture(sensor, capture, irradiance.height, irradiance.width)?;
    check_leak(leak)?;
    Ok(expose_checked(irradiance, sensor, capture, noise, leak))
}

/// [`expose_with_tape`] after the checks. Irradiance that is not finite makes its pixel and slopes NaN.
pub(crate) fn expose_checked(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
    leak: f32,
) -> (Raw, Slopes) {
    let (height, width) = (irradiance.height, irradiance.width);
    let frame = Frame::new(irradiance, sensor, capture, noise, leak);
    let zeros = || vec![0.0f32; height * width];
    let mut dn = zeros();
    let mut slopes = Slopes { light: zeros(), log2_gain: zeros(), log2_exposure: zeros() };
    let step = width.max(1);
    dn.par_chunks_exact_mut(step)
        .zip(slopes.light.par_chunks_exact_mut(step))
        .zip(slopes.log2_gain.par_chunks_exact_mut(step))
        .zip(slopes.log2_exposure.par_chunks_exact_mut(step))
        .enumerate()
        .for_each_init(Scratch::default, |scratch, (row, (((dn, light), gain), exposure))| {
            let slopes = [light, gain, exposure];
            dispatch(ExposeRow::<true> { frame: &frame, row, scratch, dn, slopes });
        });
    (Raw { height, width, dn, capture: *capture }, slopes)
}

/// What all rows of an exposure share.
pub(super) struct Frame<'a> {
    irradiance: &'a LinearImage,
    sensor: &'a SensorModel,
    capture: &'a Capture,
    chain: Chain,
    streams: FrameStreams,
    pattern: Pattern<'a>,
    /// Patterns of the columns.
    columns: Vec<Shared>,
}

impl<'a> Frame<'a> {
    pub fn new(
        irradiance: &'a LinearImage,
        sensor: &'a SensorModel,
        capture: &'a Capture,
        noise: &Noise,
        leak: f32,
    ) -> Self {
        let streams = FrameStreams::new(noise, capture);
        let pattern = Pattern::new(&sensor.nonuniformity, Some(&streams));
        let first = capture.placement.col;
        Self {
            irradiance,
            sensor,
            capture,
            chain: Chain::new(sensor, capture, streams.noisy(), leak),
            streams,
            pattern,
            columns: (first..first + irradiance.width).map(|col| pattern.of_column(col)).collect(),
        }
    }
}

/// Memory of a row, to be used again for the next.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    weights: [Vec<f64>; CHANNELS],
    light: Vec<f64>,
    rate: Vec<f64>,
    electrons: Vec<f64>,
    d_rate: Vec<f64>,
    z_read: Vec<f64>,
    z_electronics: Vec<f64>,
    pattern: PatternRow,
    pattern_scratch: PatternScratch,
    shot: ShotScratch,
}

/// The exposure of one row; `TAPE` says whether the slopes are wanted.
pub(super) struct ExposeRow<'f, 'a, 'm, const TAPE: bool> {
    pub frame: &'f Frame<'a>,
    pub row: usize,
    pub scratch: &'m mut Scratch,
    pub dn: &'m mut [f32],
    /// By light, log2 gain and log2 exposure; empty without a tape.
    pub slopes: [&'m mut [f32]; 3],
}

impl<const TAPE: bool> WithSimd for ExposeRow<'_, '_, '_, TAPE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { frame, row, scratch, dn, slopes } = self;
        expose_row::<TAPE>(frame, row, scratch, dn, slopes);
    }
}

#[inline(always)]
fn expose_row<const TAPE: bool>(
    frame: &Frame,
    row: usize,
    scratch: &mut Scratch,
    dn: &mut [f32],
    slopes: [&mut [f32]; 3],
) {
    let n = frame.irradiance.width;
    let (sensor_row, first_col) = (frame.capture.placement.row + row, frame.capture.placement.col);
    let (first, chain, streams) = (place(sensor_row, first_col), &frame.chain, &frame.streams);
    let Scratch { light: lights, rate, electrons, d_rate, z_read, z_electronics, .. } = scratch;
    for values in [&mut *lights, rate, electrons, d_rate, z_read, z_electronics] {
        values.resize(n, 0.0);
    }

    // What sets each pixel apart, and the light that its filter lets pass.
    let (pattern, pattern_scratch) = (&mut scratch.pattern, &mut scratch.pattern_scratch);
    frame.pattern.pixels_row(sensor_row, first_col, &frame.columns, pattern_scratch, pattern);
    weigh_colours(frame.sensor, sensor_row, first_col, n, &mut scratch.weights);
    let plane = |c: usize| &frame.irradiance.data[(c * frame.irradiance.height + row) * n..][..n];
    let ([red, green, blue], [w0, w1, w2]) = ([plane(0), plane(1), plane(2)], &scratch.weights);
    let (w0, w1, w2, lights) = (&w0[..n], &w1[..n], &w2[..n], &mut lights[..n]);
    for i in 0..n {
        lights[i] = light([w0[i], w1[i], w2[i]], [red[i], green[i], blue[i]]);
    }
    let offset_e = &pattern.offset_e[..n];
    let (response, dark) = (&pattern.response[..n], &pattern.dark_e_per_s[..n]);
    let (rate, electrons, d_rate) = (&mut rate[..n], &mut electrons[..n], &mut d_rate[..n]);
    for i in 0..n {
        let pixel = PixelPattern { offset_e: offset_e[i], response: response[i], dark_e_per_s: dark[i] };
        rate[i] = chain.rate_e(lights[i], &pixel);
    }

    // Electrons arrive one by one; reading them is noisy.
    streams.electrons_row(rate, first, &mut scratch.shot, electrons, d_rate);
    if streams.noisy() {
        streams.read.normals_row(first, z_read, z_electronics);
    } else {
        z_read.fill(0.0);
        z_electronics.fill(0.0);
    }
    let (z_read, z_electronics, dn) = (&z_read[..n], &z_electronics[..n], &mut dn[..n]);
    let [by_light, by_gain, by_exposure] = slopes;
    let tape = if TAPE { n } else { 0 };
    let (by_light, by_gain) = (&mut by_light[..tape], &mut by_gain[..tape]);
    let by_exposure = &mut by_exposure[..tape];
    for i in 0..n {
        let pixel = PixelPattern { offset_e: offset_e[i], response: response[i], dark_e_per_s: dark[i] };
        let charge = Charge { light: lights[i], rate: rate[i], electrons: electrons[i], d_rate: d_rate[i] };
        let reading = chain.read_out(&charge, &pixel, [z_read[i], z_electronics[i]]);
        dn[i] = reading.dn;
        if TAPE {
            by_light[i] = reading.by_light;
            by_gain[i] = reading.by_log2_gain;
            by_exposure[i] = reading.by_log2_exposure;
        }
    }
}

/// Weights of red, green and blue light in each pixel of a row.
fn weigh_colours(
    sensor: &SensorModel,
    sensor_row: usize,
    first_col: usize,
    width: usize,
    weights: &mut [Vec<f64>; CHANNELS],
) {
    for (channel, weights) in weights.iter_mut().enumerate() {
        let period = sensor.cfa.cols();
        let of = |col| sensor.response(sensor.cfa.colour(sensor_row, first_col + col))[channel];
        let tile: Vec<f64> = (0..period).map(of).collect();
        weights.clear();
        weights.extend(tile.iter().cycle().take(width));
    }
}

/// Checks sensor, exposure and placement for a picture of `height` x `width` pixels.
pub(crate) fn check_capture(
    sensor: &SensorModel,
    capture: &Capture,
    height: usize,
    width: usize,
) -> Result<(), SensorError> {
    sensor.validate()?;
    capture.exposure.validate()?;
    sensor.check_gain(capture.exposure.linear_gain)?;
    check_placement(sensor, capture, height, width)
}

/// Checks that a picture of `height` x `width` pixels lies on the sensor.
pub(crate) fn check_placement(
    sensor: &SensorModel,
    capture: &Capture,
    height: usize,
    width: usize,
) -> Result<(), SensorError> {
    let (row, col) = (capture.placement.row, capture.placement.col);
    let fits = |start: usize, len: usize, size: usize| start.checked_add(len).is_some_and(|end| end <= size);
    if fits(row, height, sensor.height) && fits(col, width, sensor.width) {
        return Ok(());
    }
    let (sensor_height, sensor_width) = (sensor.height, sensor.width);
    Err(SensorError::OffSensor { height, width, row, col, sensor_height, sensor_width })
}

/// Checks the share of a gradient that saturated pixels let through.
pub(crate) fn check_leak(leak: f32) -> Result<(), SensorError> {
    if (0.0..=1.0).contains(&leak) { Ok(()) } else { Err(SensorError::Leak { value: leak }) }
}

fn check_irradiance(irradiance: &LinearImage) -> Result<(), SensorError> {
    let (height, width) = (irradiance.height, irradiance.width);
    if irradiance.channels != CHANNELS || irradiance.data.len() != CHANNELS * height * width {
        let got = format!("{} planes, {} values", irradiance.channels, irradiance.data.len());
        let expected = format!("3 planes, {} values", CHANNELS * height * width);
        return Err(SensorError::Shape { what: "irradiance", expected, got });
    }
    if let Some(i) = irradiance.data.iter().position(|v| !v.is_finite()) {
        let pixel = i % (height * width);
        return Err(SensorError::Irradiance {
            row: pixel / width,
            col: pixel % width,
            value: irradiance.data[i],
        });
    }
    Ok(())
}
