//! Linear development on the tape.

use std::sync::Arc;

use burn::prelude::*;
use rayon::prelude::*;

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use super::kernel::DeviceForm;
use super::kernel::{Kernel, View, apply};
use super::{joined, picture};
use crate::develop::{Interpolation, check_colours, develop_by, develop_by_adjoint};
use crate::image::{CHANNELS, LinearImage};
use crate::sensor::{Capture, Raw, SensorError, SensorModel};

/// Develops a batch: digital numbers `[B,1,H,W]` to linear, white-balanced, demosaiced RGB `[B,3,H,W]`.
///
/// See [`crate::develop::develop`].
pub fn develop_op(
    raw: Tensor<4>,
    sensor: &SensorModel,
    captures: &[Capture],
) -> Result<Tensor<4>, SensorError> {
    develop_by_op(raw, &Interpolation::default(), sensor, captures)
}

/// [`develop_op`] with another interpolation of the colours. See [`crate::develop::develop_by`].
pub fn develop_by_op(
    raw: Tensor<4>,
    interpolation: &Interpolation,
    sensor: &SensorModel,
    captures: &[Capture],
) -> Result<Tensor<4>, SensorError> {
    let kernel = DevelopKernel::new(raw.dims(), interpolation, sensor, captures)?;
    Ok(apply(Arc::new(kernel), [raw.into_dispatch()]))
}

/// Development of digital numbers as a kernel.
#[derive(Debug)]
pub(super) struct DevelopKernel {
    pub(super) interpolation: Interpolation,
    pub(super) sensor: SensorModel,
    pub(super) captures: Vec<Capture>,
    pub(super) shape: [usize; 4],
}

impl DevelopKernel {
    fn new(
        dims: [usize; 4],
        interpolation: &Interpolation,
        sensor: &SensorModel,
        captures: &[Capture],
    ) -> Result<Self, SensorError> {
        let [batch, channels, height, width] = dims;
        if channels != 1 || batch != captures.len() || height < 2 || width < 2 {
            let expected = format!("[{}, 1, H, W], one capture each, at least 2x2 pixels", captures.len());
            return Err(SensorError::Shape { what: "raw frames", expected, got: format!("{dims:?}") });
        }
        sensor.validate()?;
        check_colours(sensor, height, width)?;
        interpolation.demosaic.check_array(sensor.cfa)?;
        for capture in captures {
            capture.exposure.validate()?;
        }
        let shape = [batch, CHANNELS, height, width];
        Ok(Self { interpolation: *interpolation, sensor: sensor.clone(), captures: captures.to_vec(), shape })
    }

    /// Picture `i` of the raw frames.
    fn raw(&self, i: usize, dn: &[f32], capture: Capture) -> Raw {
        let [_, _, height, width] = self.shape;
        let n = height * width;
        Raw { height, width, dn: dn[i * n..(i + 1) * n].to_vec(), capture }
    }
}

const CHECKED: &str = "sizes were checked when the operation was made";

impl Kernel for DevelopKernel {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let one = |(i, capture): (usize, &Capture)| {
            develop_by(&self.raw(i, inputs[0].values, *capture), &self.interpolation, &self.sensor)
                .expect(CHECKED)
                .data
        };
        let pictures: Vec<Vec<f32>> = self.captures.par_iter().enumerate().map(one).collect();
        (joined(pictures), self.shape.to_vec())
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], _: &[bool]) -> Vec<Vec<f32>> {
        let [_, channels, height, width] = self.shape;
        // A method without a gradient gives NaN, which no descent mistakes for a step.
        if !self.interpolation.demosaic.is_differentiable() {
            return vec![vec![f32::NAN; inputs[0].values.len()]];
        }
        let one = |(i, capture): (usize, &Capture)| {
            let gradient: LinearImage = picture(gradient, i, channels, height, width);
            let raw = self.raw(i, inputs[0].values, *capture);
            develop_by_adjoint(&gradient, &raw, &self.interpolation, &self.sensor).expect(CHECKED)
        };
        let d_dn: Vec<Vec<f32>> = self.captures.par_iter().enumerate().map(one).collect();
        vec![d_dn.concat()]
    }

    #[cfg(any(feature = "wgpu", feature = "cuda"))]
    fn device_form(&self) -> Option<&dyn DeviceForm> {
        Some(self)
    }
}
