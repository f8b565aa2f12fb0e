//! One exposure: from irradiance to a raw frame, with the derivative of every pixel where it is needed.
//!
//! The physics is that of [`expose_pixel`](super::expose_pixel). Here each step processes a whole row, so that it compiles
//! to vector code. The instruction set is the widest of the machine, or the one that [`PETZVAL_SIMD`](petzval_base::simd)
//! names. All instruction sets give the same bits.

use petzval_base::simd::dispatch;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::fixed_pattern::{Pattern, PatternRow, PatternScratch, PixelPattern, Shared};
use super::noise::{FrameStreams, ShotScratch};
use super::pixel::{Chain, Charge, light};
use super::{Capture, Noise, Raw, SensorError, SensorModel};
use crate::image::{CHANNELS, LinearImage};
use crate::render::Window;
use petzval_base::random::place;

/// Exposes the sensor window at `capture.placement` to `irradiance` (3 planes, 1.0 = white).
///
/// Fails if irradiance is not finite, the sensor or a setting is out of range, or the window extends beyond the sensor.
pub fn expose(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
) -> Result<Raw, SensorError> {
    check_irradiance(irradiance)?;
    check_capture(sensor, capture, irradiance.height, irradiance.width)?;
    Ok(expose_checked(irradiance, sensor, capture, noise))
}

/// [`expose`] after the checks. Irradiance that is not finite makes its pixel NaN.
pub(crate) fn expose_checked(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
) -> Raw {
    let (height, width) = (irradiance.height, irradiance.width);
    let frame = Frame::new(irradiance, sensor, capture, noise);
    let mut dn = vec![0.0f32; height * width];
    dn.par_chunks_exact_mut(width.max(1)).enumerate().for_each_init(
        Scratch::default,
        |scratch, (row, dn)| {
            dispatch(ExposeRow::<false> { frame: &frame, row, scratch, dn, by_light: &mut [] });
        },
    );
    Raw { height, width, dn, capture: *capture }
}

/// As [`expose`], with the derivative of every digital number with respect to the light in its pixel
/// ([`SensorModel::response`] times irradiance), DN per unit, row by row.
///
/// The [`NoiseMode`](super::NoiseMode) sets the derivative of electrons with respect to their rate. Read and electronics noise do not
/// depend on light. Rounding passes the gradient unchanged. Negative light, a full well and a converter at its limits block it.
pub fn expose_with_tape(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
) -> Result<(Raw, Vec<f32>), SensorError> {
    check_irradiance(irradiance)?;
    check_capture(sensor, capture, irradiance.height, irradiance.width)?;
    Ok(expose_tracked(irradiance, sensor, capture, noise))
}

/// [`expose_with_tape`] after the checks. Irradiance that is not finite makes its pixel and derivative NaN.
pub(crate) fn expose_tracked(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
) -> (Raw, Vec<f32>) {
    let (height, width) = (irradiance.height, irradiance.width);
    let frame = Frame::new(irradiance, sensor, capture, noise);
    let (mut dn, mut by_light) = (vec![0.0f32; height * width], vec![0.0f32; height * width]);
    let step = width.max(1);
    dn.par_chunks_exact_mut(step).zip(by_light.par_chunks_exact_mut(step)).enumerate().for_each_init(
        Scratch::default,
        |scratch, (row, (dn, by_light))| {
            dispatch(ExposeRow::<true> { frame: &frame, row, scratch, dn, by_light });
        },
    );
    (Raw { height, width, dn, capture: *capture }, by_light)
}

/// The data that all rows of an exposure share.
pub(super) struct Frame<'a> {
    irradiance: &'a LinearImage,
    capture: &'a Capture,
    chain: Chain,
    streams: FrameStreams,
    pattern: Pattern<'a>,
    /// Patterns of the columns.
    columns: Vec<Shared>,
    /// Weights of red, green and blue light along each row of the array of colours, which repeats down the frame.
    weights: Vec<[Vec<f64>; CHANNELS]>,
}

impl<'a> Frame<'a> {
    pub fn new(
        irradiance: &'a LinearImage,
        sensor: &'a SensorModel,
        capture: &'a Capture,
        noise: &Noise,
    ) -> Self {
        let streams = FrameStreams::new(noise, capture);
        let pattern = Pattern::new(&sensor.nonuniformity, Some(&streams));
        let first = capture.placement.col;
        Self {
            irradiance,
            capture,
            chain: Chain::new(sensor, capture, streams.noisy()),
            streams,
            pattern,
            columns: (first..first + irradiance.width).map(|col| pattern.of_column(col)).collect(),
            weights: (0..sensor.cfa.rows())
                .map(|row| colour_weights(sensor, row, first, irradiance.width))
                .collect(),
        }
    }
}

/// Working memory of a row, reused for the next row.
#[derive(Debug, Default)]
pub(super) struct Scratch {
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

/// The exposure of one row. With `TAPE` it also computes the derivatives.
pub(super) struct ExposeRow<'f, 'a, 'm, const TAPE: bool> {
    pub frame: &'f Frame<'a>,
    pub row: usize,
    pub scratch: &'m mut Scratch,
    pub dn: &'m mut [f32],
    /// Derivatives with respect to light; empty without a tape.
    pub by_light: &'m mut [f32],
}

impl<const TAPE: bool> WithSimd for ExposeRow<'_, '_, '_, TAPE> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { frame, row, scratch, dn, by_light } = self;
        expose_row::<TAPE>(frame, row, scratch, dn, by_light);
    }
}

#[inline(always)]
fn expose_row<const TAPE: bool>(
    frame: &Frame,
    row: usize,
    scratch: &mut Scratch,
    dn: &mut [f32],
    by_light: &mut [f32],
) {
    let n = frame.irradiance.width;
    let (sensor_row, first_col) = (frame.capture.placement.row + row, frame.capture.placement.col);
    let (first, chain, streams) = (place(sensor_row, first_col), &frame.chain, &frame.streams);
    let Scratch { light: lights, rate, electrons, d_rate, z_read, z_electronics, .. } = scratch;
    for values in [&mut *lights, rate, electrons, d_rate, z_read, z_electronics] {
        values.resize(n, 0.0);
    }

    // Draw the non-uniformity of each pixel, and collect the light that its filter passes.
    let (pattern, pattern_scratch) = (&mut scratch.pattern, &mut scratch.pattern_scratch);
    frame.pattern.pixels_row(sensor_row, first_col, &frame.columns, pattern_scratch, pattern);
    let weights = &frame.weights[sensor_row % frame.weights.len()];
    let plane = |c: usize| &frame.irradiance.data[(c * frame.irradiance.height + row) * n..][..n];
    let ([red, green, blue], [w0, w1, w2]) = ([plane(0), plane(1), plane(2)], weights);
    let (w0, w1, w2, lights) = (&w0[..n], &w1[..n], &w2[..n], &mut lights[..n]);
    for i in 0..n {
        lights[i] = light([w0[i], w1[i], w2[i]], [red[i], green[i], blue[i]]);
    }
    // Turn light into a mean rate of electrons, with each pixel's response and dark current.
    let offset_e = &pattern.offset_e[..n];
    let (response, dark) = (&pattern.response[..n], &pattern.dark_e_per_s[..n]);
    let (rate, electrons, d_rate) = (&mut rate[..n], &mut electrons[..n], &mut d_rate[..n]);
    for i in 0..n {
        let pixel = PixelPattern { offset_e: offset_e[i], response: response[i], dark_e_per_s: dark[i] };
        rate[i] = chain.rate_e(lights[i], &pixel);
    }

    // Count the electrons with shot noise, and draw the noise of reading them out.
    streams.electrons_row(rate, first, &mut scratch.shot, electrons, d_rate);
    if streams.noisy() {
        streams.read.normals_row(first, z_read, z_electronics);
    } else {
        z_read.fill(0.0);
        z_electronics.fill(0.0);
    }
    // Amplify and convert the charge of each pixel to a digital number, with its derivative.
    let (z_read, z_electronics, dn) = (&z_read[..n], &z_electronics[..n], &mut dn[..n]);
    let by_light = &mut by_light[..if TAPE { n } else { 0 }];
    for i in 0..n {
        let pixel = PixelPattern { offset_e: offset_e[i], response: response[i], dark_e_per_s: dark[i] };
        let charge = Charge { light: lights[i], electrons: electrons[i], d_rate: d_rate[i] };
        let reading = chain.read_out(&charge, &pixel, [z_read[i], z_electronics[i]]);
        dn[i] = reading.dn;
        if TAPE {
            by_light[i] = reading.by_light;
        }
    }
}

/// Weights of red, green and blue light in each pixel of a row.
fn colour_weights(
    sensor: &SensorModel,
    sensor_row: usize,
    first_col: usize,
    width: usize,
) -> [Vec<f64>; CHANNELS] {
    std::array::from_fn(|channel| {
        let of = |col| sensor.response(sensor.cfa.colour(sensor_row, first_col + col))[channel];
        let tile: Vec<f64> = (0..sensor.cfa.cols()).map(of).collect();
        tile.iter().copied().cycle().take(width).collect()
    })
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
    let window = Window { placement: capture.placement, height, width };
    window.checked((sensor.height, sensor.width), "picture")?;
    Ok(())
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
        let (row, col) = (pixel / width, pixel % width);
        return Err(SensorError::Irradiance { row, col, value: irradiance.data[i] });
    }
    Ok(())
}
