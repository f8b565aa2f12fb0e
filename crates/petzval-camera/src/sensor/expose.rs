//! One exposure: irradiance in, raw frame out, and the derivative of every pixel.

use rayon::prelude::*;

use super::noise::{RowStreams, shot_noise};
use super::{Capture, Electronics, Noise, NoiseMode, Raw, SensorError, SensorModel};
use crate::image::{CHANNELS, LinearImage};

/// Exposes the sensor window at `capture.placement` to `irradiance` (3 planes, 1.0 = white).
pub fn expose(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
) -> Result<Raw, SensorError> {
    Ok(expose_with_tape(irradiance, sensor, capture, noise)?.0)
}

/// As [`expose`], with the tape: per pixel the derivative of its digital number with respect to the light it sees
/// ([`SensorModel::response`] times irradiance), DN per unit. The shot-noise factor is that of the [`NoiseMode`], rounding passes the gradient
/// through, full well, converter limits and negative irradiance block it.
pub fn expose_with_tape(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
) -> Result<(Raw, Vec<f32>), SensorError> {
    check_irradiance(irradiance)?;
    check_capture(sensor, capture, irradiance.height, irradiance.width)?;
    Ok(expose_checked(irradiance, sensor, capture, noise))
}

/// [`expose_with_tape`] after the checks. Irradiance that is not finite makes its pixel and tape NaN.
pub(crate) fn expose_checked(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
) -> (Raw, Vec<f32>) {
    let (height, width) = (irradiance.height, irradiance.width);
    let mut dn = vec![0.0f32; height * width];
    let mut tape = vec![0.0f32; height * width];
    dn.par_chunks_exact_mut(width.max(1)).zip(tape.par_chunks_exact_mut(width.max(1))).enumerate().for_each(
        |(row, (dn, tape))| {
            expose_row(irradiance, sensor, capture, noise, row, dn, tape);
        },
    );
    (Raw { height, width, dn, capture: *capture }, tape)
}

fn expose_row(
    irradiance: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
    row: usize,
    dn: &mut [f32],
    tape: &mut [f32],
) {
    let (width, plane) = (irradiance.width, irradiance.height * irradiance.width);
    let (sensor_row, first_col) = (capture.placement.row + row, capture.placement.col);
    let mut streams = RowStreams::new(noise.seed, capture.frame, sensor_row, first_col);
    let white_e = capture.exposure.white_e as f64;
    let dark_e = sensor.dark_current_e_per_s * capture.exposure.time_s as f64;
    let gain = sensor.gain_dn_per_e * capture.exposure.linear_gain as f64;
    let (noisy, max_dn) = (noise.mode != NoiseMode::Off, sensor.max_dn());
    let quantise = |v: f64| if noisy { v.round().clamp(0.0, max_dn) } else { v.clamp(0.0, max_dn) };
    let passes = |v: f64| if (0.0..=max_dn).contains(&v) { 1.0 } else { 0.0 };
    for col in 0..width {
        // Photons become electrons in the colour that the filter lets pass; the dark current adds its own.
        let response = sensor.response(sensor.cfa.colour(sensor_row, first_col + col));
        let at = |channel: usize| irradiance.data[channel * plane + row * width + col] as f64;
        let light: f64 = (0..CHANNELS).map(|c| response[c] * at(c)).sum();
        let lambda = light.max(0.0) * white_e + dark_e;
        let mut slope = if light < 0.0 { 0.0 } else { white_e };

        // Electrons arrive one by one, until the well is full.
        let dither = if noise.mode == NoiseMode::Dequantised { streams.next_dither() } else { 0.0 };
        let (mut n, d_lambda) = if noisy {
            shot_noise(noise.mode, lambda, streams.shot(first_col + col), dither)
        } else {
            (lambda, 1.0)
        };
        slope *= d_lambda;
        if n >= sensor.full_well_e {
            (n, slope) = (sensor.full_well_e, 0.0);
        }

        // Reading the charge adds noise; the amplifier turns electrons into digital numbers.
        let (z_read, z_electronics) = if noisy { streams.next_normal_pair() } else { (0.0, 0.0) };
        let e = n + sensor.read_noise_mean_e + sensor.read_noise_e * z_read;
        let signal = gain * e + sensor.black_level_dn;
        let electronics = sensor.electronics_mean_dn + sensor.electronics_noise_dn * z_electronics;
        slope *= gain;

        // The converter rounds and clips.
        let value = match sensor.electronics {
            Electronics::BeforeAdc => {
                slope *= passes(signal + electronics);
                quantise(signal + electronics)
            }
            Electronics::AfterAdc => {
                let digital = quantise(signal);
                slope *= passes(signal) * passes(digital + electronics);
                quantise(digital + electronics)
            }
        };
        let known = light.is_finite();
        dn[col] = if known { value as f32 } else { f32::NAN };
        tape[col] = if known { slope as f32 } else { f32::NAN };
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
    let (row, col) = (capture.placement.row, capture.placement.col);
    let fits = |start: usize, len: usize, size: usize| start.checked_add(len).is_some_and(|end| end <= size);
    if fits(row, height, sensor.height) && fits(col, width, sensor.width) {
        return Ok(());
    }
    let (sensor_height, sensor_width) = (sensor.height, sensor.width);
    Err(SensorError::OffSensor { height, width, row, col, sensor_height, sensor_width })
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
