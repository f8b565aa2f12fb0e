//! The linear ISP on the tape.

use burn::prelude::*;
use burn::tensor::TensorData;

use super::develop_op::develop_by_op;
use super::on_device;
use crate::develop::LinearIsp;
use crate::develop::clip_levels_dn;
use crate::image::LinearImage;
use crate::sensor::{Capture, Raw, SensorError, SensorModel};

/// Develops a batch: digital numbers `[B,1,H,W]` and relative illumination `[B,3,H,W]` to linear light `[B,3,H,W]`,
/// differentiable in both. See [`LinearIsp::develop`].
///
/// The gradient with respect to the illumination includes the gain that compensates lost light. Together with the illumination in the
/// irradiance, a lens that loses light pays for it in noise, not in brightness.
pub fn linear_isp_op(
    raw: Tensor<4>,
    illumination: Tensor<4>,
    isp: &LinearIsp,
    sensor: &SensorModel,
    captures: &[Capture],
) -> Result<Tensor<4>, SensorError> {
    let [batch, _, height, width] = raw.dims();
    let device = raw.device();
    if captures.len() != batch {
        let got = format!("{} captures", captures.len());
        return Err(SensorError::shape("raw frames", format!("one capture each, {batch}"), got));
    }
    // Clip each pixel where white light would saturate the first colour: the levels of a tile of the array, repeated.
    let (rows, cols) = (sensor.cfa.rows(), sensor.cfa.cols());
    let mut levels = Vec::with_capacity(batch * rows * cols);
    let mut highest = Vec::with_capacity(batch);
    for capture in captures {
        levels.extend(clip_levels_dn(sensor, capture, rows, cols)?);
        highest.push(crate::develop::highest_light(sensor, &capture.exposure)?);
    }
    let levels = Tensor::<4>::from_data(TensorData::new(levels, [batch, 1, rows, cols]), &device)
        .repeat(&[1, 1, height.div_ceil(rows), width.div_ceil(cols)])
        .slice([0..batch, 0..1, 0..height, 0..width]);
    let clipped = raw.min_pair(levels);
    // Dark level, white balance, demosaicing.
    let balanced = develop_by_op(clipped, &isp.interpolation, sensor, captures)?;
    // Lift the dim corners, but nothing above the light at which highlights end.
    let highest = Tensor::<4>::from_data(TensorData::new(highest, [batch, 1, 1, 1]), &device);
    let picture = (balanced / illumination.clamp_min(isp.shading_floor))
        .min_pair(highest.expand([batch, 3, height, width]));
    let Some(matrix) = &isp.colour_matrix else { return Ok(picture) };
    // Mix the planes: row r of the matrix gives plane r.
    let rows: Vec<f32> = matrix.iter().flatten().map(|v| *v as f32).collect();
    let matrix = Tensor::<3>::from_data(TensorData::new(rows, [1, 3, 3]), &device);
    let flat = picture.reshape([batch, 3, height * width]);
    Ok(matrix.expand([batch, 3, 3]).matmul(flat).reshape([batch, 3, height, width]))
}

/// Derivatives by digital numbers and by relative illumination of a loss that has the derivatives `d_picture` by
/// [`LinearIsp::develop`].
///
/// Fails on another shape, and for a method of demosaicing without a gradient.
pub fn linear_isp_pull_back(
    raw: &Raw,
    illumination: &LinearImage,
    d_picture: &LinearImage,
    isp: &LinearIsp,
    sensor: &SensorModel,
) -> Result<(Vec<f32>, LinearImage), SensorError> {
    let shape =
        |i: &LinearImage| format!("{} x {} x {}, {} values", i.channels, i.height, i.width, i.data.len());
    let (height, width, pixels) = (raw.height, raw.width, raw.height * raw.width);
    let wanted = format!("3 x {height} x {width}, {} values", 3 * pixels);
    for (what, image) in
        [("illumination map", illumination), ("gradient of the developed picture", d_picture)]
    {
        if shape(image) != wanted {
            return Err(SensorError::Shape { what, expected: wanted, got: shape(image) });
        }
    }
    if raw.dn.len() != pixels {
        let got = format!("{} values", raw.dn.len());
        return Err(SensorError::shape("raw frame", format!("{pixels} values"), got));
    }
    let demosaic = isp.interpolation.demosaic;
    if !demosaic.is_differentiable() {
        return Err(demosaic.without_gradient());
    }
    let device = Device::flex().autodiff();
    let dn = TensorData::new(raw.dn.clone(), [1, 1, height, width]);
    let dn = Tensor::<4>::from_data(dn, &device).require_grad();
    let light = on_device(illumination, &device).require_grad();
    let picture = linear_isp_op(dn.clone(), light.clone(), isp, sensor, &[raw.capture])?;
    let gradients = (picture * on_device(d_picture, &device)).sum().backward();
    let by = |tensor: Tensor<4>| {
        let found = tensor.grad(&gradients).expect("the picture depends on both");
        found.into_data().try_to_vec::<f32>().expect("f32 on the host")
    };
    let by_dn = by(dn);
    Ok((by_dn, LinearImage { data: by(light), ..*d_picture }))
}
