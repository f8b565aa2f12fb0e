//! The exposure of the sensor on the tape.

use std::sync::{Arc, OnceLock};

use burn::prelude::*;
use rayon::prelude::*;

use super::kernel::{Kernel, View, apply};
use super::picture;
use crate::image::CHANNELS;
use crate::sensor::{
    Capture, Noise, SensorError, SensorModel, Slopes, check_capture, check_leak, check_placement,
    expose_checked, expose_tracked,
};

/// Exposes a batch: irradiance `[B,3,H,W]` to digital numbers `[B,1,H,W]`, one capture per picture.
///
/// The [`crate::sensor::NoiseMode`] sets the gradient; see [`crate::sensor::expose_with_tape`]. Irradiance that is not
/// finite makes its pixel NaN and is not an error.
pub fn expose_op(
    irradiance: Tensor<4>,
    sensor: &SensorModel,
    captures: &[Capture],
    noise: &Noise,
) -> Result<Tensor<4>, SensorError> {
    let [_, _, height, width] = irradiance.dims();
    for capture in captures {
        check_capture(sensor, capture, height, width)?;
    }
    let kernel = ExposeKernel::new(irradiance.dims(), sensor, captures, noise, 0.0)?;
    Ok(apply(Arc::new(kernel), [irradiance.into_dispatch()]))
}

/// [`expose_op`] that is differentiable in the exposures as well: `stops[b] = [gain, exposure]` changes the exposure of
/// capture `b` by factors of two (see [`crate::sensor::Exposure::with_stops`]).
///
/// Full wells and converters at their limits pass the share `leak` (0..1; 0 is the true derivative) of a gradient. Gains are
/// continuous here, even if the sensor has steps: round the optimum to [`SensorModel::nearest_gain`]. Stops that give no
/// valid exposure make their picture NaN.
///
/// The built-in experiments hold gain and exposure fixed. One step of gradient descent on both, for the error of the
/// developed picture:
///
/// ```
/// use burn::prelude::*;
/// use petzval_camera::render::Placement;
/// use petzval_camera::sensor::{Capture, Exposure, Noise, NoiseMode, SensorModel};
/// use petzval_camera::tape::{develop_with_stops_op, expose_with_stops_op};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let sensor = petzval_files::parse_sensor(include_str!("../../../../data/sensors/imx249-fitted.toml"))?;
/// let exposure = Exposure { white_e: 500.0, time_s: 0.005, linear_gain: 1.0 };
/// let captures = [Capture { exposure, placement: Placement { row: 0, col: 0 }, frame: 0 }];
/// let noise = Noise { mode: NoiseMode::Dequantised, seed: 1 };
///
/// let device = Device::flex().autodiff();
/// let scene = Tensor::<4>::full([1, 3, 32, 32], 0.2, &device);
/// let stops = Tensor::<2>::zeros([1, 2], &device).require_grad();
/// let raw = expose_with_stops_op(scene.clone(), stops.clone(), &sensor, &captures, &noise, 0.0)?;
/// let picture = develop_with_stops_op(raw, stops.clone(), &sensor, &captures)?;
/// let gradients = (picture - scene).square().mean().backward();
/// let by_stops = stops.grad(&gradients).ok_or("stops have a gradient")?;
///
/// // More light is less noise: the descent lengthens the exposure.
/// let [gain, exposure] = [0, 1].map(|i| by_stops.clone().slice([0..1, i..i + 1]).into_scalar::<f32>());
/// assert!(exposure < 0.0 && exposure.abs() > gain.abs());
/// # Ok(())
/// # }
/// ```
pub fn expose_with_stops_op(
    irradiance: Tensor<4>,
    stops: Tensor<2>,
    sensor: &SensorModel,
    captures: &[Capture],
    noise: &Noise,
    leak: f32,
) -> Result<Tensor<4>, SensorError> {
    let [_, _, height, width] = irradiance.dims();
    check_leak(leak)?;
    check_stops(&stops, captures)?;
    sensor.validate()?;
    for capture in captures {
        capture.exposure.validate()?;
        check_placement(sensor, capture, height, width)?;
    }
    let kernel = ExposeKernel::new(irradiance.dims(), sensor, captures, noise, leak)?;
    Ok(apply(Arc::new(kernel), [irradiance.into_dispatch(), stops.into_dispatch()]))
}

/// Checks that there are two numbers of stops for each capture.
pub(super) fn check_stops(stops: &Tensor<2>, captures: &[Capture]) -> Result<(), SensorError> {
    if stops.dims() == [captures.len(), 2] {
        return Ok(());
    }
    let (expected, got) = (format!("[{}, 2]", captures.len()), format!("{:?}", stops.dims()));
    Err(SensorError::Shape { what: "stops of gain and exposure", expected, got })
}

/// The captures, with their exposures changed if stops are among the inputs.
pub(super) fn changed(captures: &[Capture], inputs: &[View<'_>]) -> Vec<Capture> {
    match inputs {
        [_, stops] => captures
            .iter()
            .zip(stops.values.chunks_exact(2))
            .map(|(c, s)| Capture { exposure: c.exposure.with_stops(s[0], s[1]), ..*c })
            .collect(),
        _ => captures.to_vec(),
    }
}

/// Exposure as a kernel. Inputs: irradiance and, for differentiable exposures, stops.
#[derive(Debug)]
struct ExposeKernel {
    sensor: SensorModel,
    captures: Vec<Capture>,
    noise: Noise,
    leak: f32,
    shape: [usize; 4],
    /// Derivatives per picture. A kernel serves one call, so the backward pass reuses those of the forward pass.
    tape: OnceLock<Vec<Slopes>>,
}

impl ExposeKernel {
    fn new(
        dims: [usize; 4],
        sensor: &SensorModel,
        captures: &[Capture],
        noise: &Noise,
        leak: f32,
    ) -> Result<Self, SensorError> {
        let [batch, channels, height, width] = dims;
        if channels != CHANNELS || batch != captures.len() {
            let expected = format!("[{}, {CHANNELS}, H, W], one capture each", captures.len());
            return Err(SensorError::Shape { what: "irradiance", expected, got: format!("{dims:?}") });
        }
        Ok(Self {
            sensor: sensor.clone(),
            captures: captures.to_vec(),
            noise: *noise,
            leak,
            shape: [batch, 1, height, width],
            tape: OnceLock::new(),
        })
    }

    /// The digital numbers alone.
    fn expose_untracked(&self, inputs: &[View<'_>]) -> Vec<f32> {
        let [_, _, height, width] = self.shape;
        let one = |(i, capture): (usize, &Capture)| {
            if capture.exposure.validate().is_err() {
                return vec![f32::NAN; height * width];
            }
            let light = picture(inputs[0].values, i, CHANNELS, height, width);
            expose_checked(&light, &self.sensor, capture, &self.noise).dn
        };
        let dn: Vec<Vec<f32>> = changed(&self.captures, inputs).par_iter().enumerate().map(one).collect();
        dn.concat()
    }

    /// The digital numbers and their derivatives.
    fn expose(&self, inputs: &[View<'_>]) -> (Vec<f32>, Vec<Slopes>) {
        let [_, _, height, width] = self.shape;
        let one = |(i, capture): (usize, &Capture)| {
            if capture.exposure.validate().is_err() {
                let unknown = || vec![f32::NAN; height * width];
                return (
                    unknown(),
                    Slopes { light: unknown(), log2_gain: unknown(), log2_exposure: unknown() },
                );
            }
            let light = picture(inputs[0].values, i, CHANNELS, height, width);
            let (raw, slopes) = expose_tracked(&light, &self.sensor, capture, &self.noise, self.leak);
            (raw.dn, slopes)
        };
        let (dn, slopes): (Vec<Vec<f32>>, _) =
            changed(&self.captures, inputs).par_iter().enumerate().map(one).unzip();
        (dn.concat(), slopes)
    }
}

impl Kernel for ExposeKernel {
    fn forward(&self, inputs: &[View<'_>], tracked: &[bool]) -> (Vec<f32>, Vec<usize>) {
        if !tracked.contains(&true) {
            return (self.expose_untracked(inputs), self.shape.to_vec());
        }
        let (dn, tape) = self.expose(inputs);
        self.tape.get_or_init(|| tape);
        (dn, self.shape.to_vec())
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], _: &[bool]) -> Vec<Vec<f32>> {
        let [_, _, height, width] = self.shape;
        let tape = self.tape.get_or_init(|| self.expose(inputs).1);
        let plane = height * width;
        let mut d_irradiance = vec![0.0f32; inputs[0].values.len()];
        let mut d_stops = Vec::new();
        for (i, (slopes, capture)) in tape.iter().zip(&self.captures).enumerate() {
            // Distribute each pixel's cotangent to the colours that its filter passes.
            let d_dn = &gradient[i * plane..(i + 1) * plane];
            let placement = capture.placement;
            for (pixel, (slope, d)) in slopes.light.iter().zip(d_dn).enumerate() {
                let (row, col) = (placement.row + pixel / width, placement.col + pixel % width);
                let response = self.sensor.response(self.sensor.cfa.colour(row, col));
                for c in 0..CHANNELS {
                    d_irradiance[(i * CHANNELS + c) * plane + pixel] = slope * d * response[c] as f32;
                }
            }
            // Sum over pixels for the two stops of the picture.
            for slopes in [&slopes.log2_gain, &slopes.log2_exposure] {
                let sum: f64 = slopes.iter().zip(d_dn).map(|(slope, d)| *slope as f64 * *d as f64).sum();
                d_stops.push(sum as f32);
            }
        }
        match inputs.len() {
            1 => vec![d_irradiance],
            _ => vec![d_irradiance, d_stops],
        }
    }
}
