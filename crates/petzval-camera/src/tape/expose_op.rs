//! The sensor on the tape.

use std::sync::{Arc, OnceLock};

use burn::prelude::*;

use super::host_kernel::{HostKernel, apply};
use super::picture;
use crate::image::CHANNELS;
use crate::sensor::{Capture, Noise, SensorError, SensorModel, check_capture, expose_checked};

/// Exposes a batch: irradiance `[B,3,H,W]` to digital numbers `[B,1,H,W]`, one capture per picture.
///
/// The gradient is that of the [`crate::sensor::NoiseMode`]; see [`crate::sensor::expose_with_tape`]. A value that is not
/// finite makes its pixel NaN instead of an error.
pub fn expose_op(
    irradiance: Tensor<4>,
    sensor: &SensorModel,
    captures: &[Capture],
    noise: &Noise,
) -> Result<Tensor<4>, SensorError> {
    let [batch, channels, height, width] = irradiance.dims();
    if channels != CHANNELS || batch != captures.len() {
        let expected = format!("[{}, {CHANNELS}, H, W], one capture each", captures.len());
        return Err(SensorError::Shape {
            what: "irradiance",
            expected,
            got: format!("{:?}", irradiance.dims()),
        });
    }
    for capture in captures {
        check_capture(sensor, capture, height, width)?;
    }
    let kernel = ExposeKernel {
        sensor: sensor.clone(),
        captures: captures.to_vec(),
        noise: *noise,
        shape: [batch, 1, height, width],
        tape: OnceLock::new(),
    };
    Ok(apply(Arc::new(kernel), irradiance))
}

#[derive(Debug)]
struct ExposeKernel {
    sensor: SensorModel,
    captures: Vec<Capture>,
    noise: Noise,
    shape: [usize; 4],
    /// Derivative per pixel. A kernel serves one call, so what the forward pass found holds for the backward pass.
    tape: OnceLock<Vec<f32>>,
}

impl ExposeKernel {
    fn expose(&self, irradiance: &[f32]) -> (Vec<f32>, Vec<f32>) {
        let [batch, _, height, width] = self.shape;
        let (mut dn, mut tape) = (Vec::new(), Vec::new());
        for i in 0..batch {
            let light = picture(irradiance, i, CHANNELS, height, width);
            let (raw, slope) = expose_checked(&light, &self.sensor, &self.captures[i], &self.noise);
            dn.extend(raw.dn);
            tape.extend(slope);
        }
        (dn, tape)
    }
}

impl HostKernel for ExposeKernel {
    fn output_shape(&self) -> Vec<usize> {
        self.shape.to_vec()
    }

    fn forward(&self, inputs: &[&[f32]]) -> Vec<f32> {
        let (dn, tape) = self.expose(inputs[0]);
        self.tape.get_or_init(|| tape);
        dn
    }

    fn adjoint(&self, inputs: &[&[f32]], d_output: &[f32]) -> Vec<Vec<f32>> {
        let [batch, _, height, width] = self.shape;
        let tape = self.tape.get_or_init(|| self.expose(inputs[0]).1);
        let mut d_irradiance = vec![0.0f32; inputs[0].len()];
        let plane = height * width;
        for i in 0..batch {
            let placement = self.captures[i].placement;
            for pixel in 0..plane {
                let (row, col) = (placement.row + pixel / width, placement.col + pixel % width);
                let response = self.sensor.response(self.sensor.cfa.colour(row, col));
                let k = i * plane + pixel;
                for c in 0..CHANNELS {
                    d_irradiance[(i * CHANNELS + c) * plane + pixel] =
                        tape[k] * d_output[k] * response[c] as f32;
                }
            }
        }
        vec![d_irradiance]
    }
}
