//! The exposure of the sensor on the tape.

use std::sync::{Arc, OnceLock};

use burn::prelude::*;
use rayon::prelude::*;

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use super::kernel::DeviceForm;
use super::kernel::{Kernel, View, apply};
use super::{joined, picture};
use crate::image::{CHANNELS, LinearImage};
use crate::sensor::{
    Capture, Noise, SensorError, SensorModel, check_capture, expose_checked, expose_tracked,
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
    let [batch, channels, height, width] = irradiance.dims();
    for capture in captures {
        check_capture(sensor, capture, height, width)?;
    }
    if channels != CHANNELS || batch != captures.len() {
        let expected = format!("[{}, {CHANNELS}, H, W], one capture each", captures.len());
        let got = format!("{:?}", irradiance.dims());
        return Err(SensorError::Shape { what: "irradiance", expected, got });
    }
    let kernel = ExposeKernel {
        sensor: sensor.clone(),
        captures: captures.to_vec(),
        noise: *noise,
        shape: [batch, 1, height, width],
        tape: OnceLock::new(),
    };
    Ok(apply(Arc::new(kernel), [irradiance.into_dispatch()]))
}

/// Exposure of irradiance as a kernel.
#[derive(Debug)]
pub(super) struct ExposeKernel {
    pub(super) sensor: SensorModel,
    pub(super) captures: Vec<Capture>,
    pub(super) noise: Noise,
    pub(super) shape: [usize; 4],
    /// Derivative of each digital number by the light in its pixel, per picture. A kernel serves one call, so the backward pass reuses
    /// those of a forward pass on the tape.
    tape: OnceLock<Vec<Vec<f32>>>,
}

impl ExposeKernel {
    /// Exposes every picture of the batch by `expose`.
    fn each<T: Send>(
        &self,
        irradiance: &[f32],
        expose: impl Fn(&LinearImage, &Capture) -> T + Sync,
    ) -> Vec<T> {
        let [_, _, height, width] = self.shape;
        let one = |(i, capture): (usize, &Capture)| {
            expose(&picture(irradiance, i, CHANNELS, height, width), capture)
        };
        self.captures.par_iter().enumerate().map(one).collect()
    }

    /// The digital numbers with their derivatives.
    fn tracked(&self, irradiance: &[f32]) -> (Vec<Vec<f32>>, Vec<Vec<f32>>) {
        let one = |light: &LinearImage, capture: &Capture| {
            let (raw, by_light) = expose_tracked(light, &self.sensor, capture, &self.noise);
            (raw.dn, by_light)
        };
        self.each(irradiance, one).into_iter().unzip()
    }
}

impl Kernel for ExposeKernel {
    fn forward(&self, inputs: &[View<'_>], tracked: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let irradiance = inputs[0].values;
        let dn = if tracked[0] {
            let (dn, tape) = self.tracked(irradiance);
            self.tape.get_or_init(|| tape);
            dn
        } else {
            self.each(irradiance, |light, capture| {
                expose_checked(light, &self.sensor, capture, &self.noise).dn
            })
        };
        (joined(dn), self.shape.to_vec())
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], _: &[bool]) -> Vec<Vec<f32>> {
        let [_, _, height, width] = self.shape;
        let tape = self.tape.get_or_init(|| self.tracked(inputs[0].values).1);
        let plane = height * width;
        let mut d_irradiance = vec![0.0f32; inputs[0].values.len()];
        for (i, (by_light, capture)) in tape.iter().zip(&self.captures).enumerate() {
            // Distribute each pixel's cotangent to the colours that its filter passes.
            let d_dn = &gradient[i * plane..(i + 1) * plane];
            let placement = capture.placement;
            for (pixel, (slope, d)) in by_light.iter().zip(d_dn).enumerate() {
                let (row, col) = (placement.row + pixel / width, placement.col + pixel % width);
                let response = self.sensor.response(self.sensor.cfa.colour(row, col));
                for c in 0..CHANNELS {
                    d_irradiance[(i * CHANNELS + c) * plane + pixel] = slope * d * response[c] as f32;
                }
            }
        }
        vec![d_irradiance]
    }

    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    fn device_form(&self) -> Option<&dyn DeviceForm> {
        Some(self)
    }
}
