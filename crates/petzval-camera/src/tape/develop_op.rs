//! Linear development on the tape.

use std::sync::Arc;

use burn::prelude::*;
use rayon::prelude::*;

use super::host_kernel::{HostKernel, apply};
use super::picture;
use crate::develop::{develop, develop_adjoint};
use crate::image::CHANNELS;
use crate::sensor::{Capture, Raw, SensorError, SensorModel};

/// Develops a batch: digital numbers `[B,1,H,W]` to linear, white-balanced, demosaiced RGB `[B,3,H,W]`.
///
/// See [`crate::develop::develop`].
pub fn develop_op(
    raw: Tensor<4>,
    sensor: &SensorModel,
    captures: &[Capture],
) -> Result<Tensor<4>, SensorError> {
    let [batch, channels, height, width] = raw.dims();
    if channels != 1 || batch != captures.len() || height < 2 || width < 2 {
        let expected = format!("[{}, 1, H, W], one capture each, at least 2x2 pixels", captures.len());
        return Err(SensorError::Shape { what: "raw frames", expected, got: format!("{:?}", raw.dims()) });
    }
    sensor.validate()?;
    for capture in captures {
        capture.exposure.validate()?;
    }
    let kernel = DevelopKernel {
        sensor: sensor.clone(),
        captures: captures.to_vec(),
        shape: [batch, CHANNELS, height, width],
    };
    Ok(apply(Arc::new(kernel), raw))
}

#[derive(Debug)]
struct DevelopKernel {
    sensor: SensorModel,
    captures: Vec<Capture>,
    shape: [usize; 4],
}

const CHECKED: &str = "sizes were checked when the operation was made";

impl HostKernel for DevelopKernel {
    fn output_shape(&self) -> Vec<usize> {
        self.shape.to_vec()
    }

    fn forward(&self, inputs: &[&[f32]]) -> Vec<f32> {
        let [_, _, height, width] = self.shape;
        let one = |(dn, capture): (&[f32], &Capture)| {
            let raw = Raw { height, width, dn: dn.to_vec(), capture: *capture };
            develop(&raw, &self.sensor).expect(CHECKED).data
        };
        let pictures: Vec<Vec<f32>> =
            inputs[0].par_chunks_exact(height * width).zip(&self.captures).map(one).collect();
        pictures.concat()
    }

    fn adjoint(&self, _: &[&[f32]], d_output: &[f32]) -> Vec<Vec<f32>> {
        let [batch, channels, height, width] = self.shape;
        let one = |i: usize| {
            let gradient = picture(d_output, i, channels, height, width);
            develop_adjoint(&gradient, &self.sensor, &self.captures[i]).expect(CHECKED)
        };
        let parts: Vec<Vec<f32>> = (0..batch).into_par_iter().map(one).collect();
        vec![parts.concat()]
    }
}
