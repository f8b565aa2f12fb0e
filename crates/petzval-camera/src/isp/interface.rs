//! The interface of every image signal processor: raw frame and parameters in, picture out.
//!
//! The built-in ISPs and external programs implement it. Tuning calls an ISP through it alone.

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_base::parameter::Parameter;

use super::RawInput;
use super::error::IspError;

/// One number of an ISP.
#[derive(Clone, Debug, PartialEq)]
pub struct IspParameter {
    /// Name, `stage.key`, or `stage.key[i]` for a number of an array.
    pub name: String,
    /// Unit, range, scale and sentence. The default is that of this number alone.
    pub about: Parameter,
}

impl IspParameter {
    /// The value that it has unless it is set.
    pub fn default_value(&self) -> f64 {
        self.about.default.first().copied().unwrap_or(self.about.min)
    }
}

/// A developed picture as a display takes it: sRGB-encoded, three planes.
#[derive(Clone, Debug, PartialEq)]
pub struct RgbPicture {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Bits of a value: 8, 10 or 16.
    pub bits: u32,
    /// Red, then green, then blue, each row by row; white is `2^bits - 1`.
    pub data: Vec<u16>,
}

impl RgbPicture {
    /// Its values over that of white, 0..1.
    pub fn encoded(&self) -> Vec<f32> {
        let white = ((1_u32 << self.bits) - 1) as f32;
        self.data.iter().map(|v| f32::from(*v) / white).collect()
    }

    /// The picture turned by an orientation as EXIF numbers it: 3 is half a turn, 6 a quarter clockwise, 8 a quarter anticlockwise, and 2, 4, 5 and 7 are
    /// mirrored. 1 and every other number keep the picture as it is.
    pub fn turned(self, orientation: u8) -> Self {
        if !(2..=8).contains(&orientation) || self.data.is_empty() {
            return self;
        }
        let Self { height, width, bits, data } = self;
        let (bottom, right) = (height - 1, width - 1);
        // Row and column of the stored picture that come to a row and column of the turned one.
        let stored = |row: usize, col: usize| match orientation {
            2 => (row, right - col),
            3 => (bottom - row, right - col),
            4 => (bottom - row, col),
            5 => (col, row),
            6 => (bottom - col, row),
            7 => (bottom - col, right - row),
            _ => (col, right - row),
        };
        let (rows, cols) = if orientation < 5 { (height, width) } else { (width, height) };
        let mut turned = Vec::with_capacity(data.len());
        for plane in data.chunks_exact(height * width) {
            for row in 0..rows {
                turned.extend((0..cols).map(|col| {
                    let (row, col) = stored(row, col);
                    plane[row * width + col]
                }));
            }
        }
        Self { height: rows, width: cols, bits, data: turned }
    }
}

/// An image signal processor.
pub trait Isp: Send + Sync {
    /// Its name, for messages and reports.
    fn name(&self) -> &str;

    /// Its parameters, in the order in which [`Isp::develop`] takes their values.
    fn parameters(&self) -> Vec<IspParameter>;

    /// Develops a raw frame. `values` holds one number for each parameter, in its own unit.
    fn develop(&self, frame: &RawInput, values: &[f64]) -> Result<RgbPicture, IspError>;

    /// Its parameters' defaults.
    fn defaults(&self) -> Vec<f64> {
        self.parameters().iter().map(IspParameter::default_value).collect()
    }
}

/// An image signal processor with a gradient by raw frame and parameters.
pub trait DifferentiableIsp: Isp {
    /// Develops one frame on the tape: [linear digital numbers](RawInput::linear_dn) `[1, 1, height, width]` and parameters `[count]`, each in its own unit, to an
    /// sRGB-encoded picture `[1, 3, height, width]`, about 0..1. `frame` gives everything but the digital numbers.
    fn develop_on_tape(
        &self,
        dn: Tensor<4>,
        frame: &RawInput,
        values: Tensor<1>,
    ) -> Result<Tensor<4>, IspError>;
}

/// What a differentiable ISP makes of a frame where no gradient is needed, rounded to so many bits.
pub fn developed_without_gradient(
    isp: &dyn DifferentiableIsp,
    frame: &RawInput,
    values: &[f64],
    bits: u32,
) -> Result<RgbPicture, IspError> {
    let encoded = smooth_picture(isp, &frame.linear_dn(), frame, values)?;
    let white = ((1_u32 << bits) - 1) as f32;
    let data = encoded.iter().map(|v| (v.clamp(0.0, 1.0) * white).round() as u16).collect();
    Ok(RgbPicture { height: frame.height, width: frame.width, bits, data })
}

/// What a differentiable ISP makes of linear digital numbers, sRGB-encoded, about 0..1: three planes. `frame` gives everything but the
/// numbers.
pub fn smooth_picture(
    isp: &dyn DifferentiableIsp,
    dn: &[f32],
    frame: &RawInput,
    values: &[f64],
) -> Result<Vec<f32>, IspError> {
    let (dn, values) = tensors(dn, frame, values, &Device::flex())?;
    on_host(isp.develop_on_tape(dn, frame, values)?)
}

/// Derivatives by digital numbers and by parameters of a loss that has the derivatives `d_picture` by [`smooth_picture`].
pub fn smooth_pull_back(
    isp: &dyn DifferentiableIsp,
    dn: &[f32],
    frame: &RawInput,
    values: &[f64],
    d_picture: &[f32],
) -> Result<(Vec<f32>, Vec<f64>), IspError> {
    let device = Device::flex().autodiff();
    let (dn, values) = tensors(dn, frame, values, &device)?;
    let (dn, values) = (dn.require_grad(), values.require_grad());
    let picture = isp.develop_on_tape(dn.clone(), frame, values.clone())?;
    check_count("number of derivatives", d_picture.len(), picture.shape().num_elements())?;
    let weights: Tensor<4> = Tensor::from_data(TensorData::new(d_picture.to_vec(), picture.dims()), &device);
    let gradients = (picture * weights).sum().backward();
    // What the picture does not depend on has no derivative on the tape.
    let by_dn = dn.grad(&gradients).unwrap_or_else(|| dn.detach().zeros_like());
    let by_values = values.grad(&gradients).unwrap_or_else(|| values.detach().zeros_like());
    Ok((on_host(by_dn)?, on_host(by_values)?.into_iter().map(f64::from).collect()))
}

/// Digital numbers and parameters of a frame on a device.
fn tensors(
    dn: &[f32],
    frame: &RawInput,
    values: &[f64],
    device: &Device,
) -> Result<(Tensor<4>, Tensor<1>), IspError> {
    frame.validate()?;
    let (height, width) = (frame.height, frame.width);
    check_count("number of pixels", dn.len(), height * width)?;
    let dn = TensorData::new(dn.to_vec(), [1, 1, height, width]);
    let values = TensorData::new(values.iter().map(|v| *v as f32).collect::<Vec<f32>>(), [values.len()]);
    Ok((Tensor::from_data(dn, device), Tensor::from_data(values, device)))
}

fn check_count(what: &'static str, count: usize, wanted: usize) -> Result<(), IspError> {
    if count == wanted {
        return Ok(());
    }
    Err(IspError::Input { what, got: count.to_string(), need: "that of the frame" })
}

fn on_host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, IspError> {
    tensor.into_data().try_to_vec::<f32>().map_err(|e| IspError::External(format!("{e:?}")))
}

/// Checks the values of parameters.
pub fn check_values(parameters: &[IspParameter], values: &[f64]) -> Result<(), IspError> {
    if parameters.len() != values.len() {
        return Err(IspError::Count { expected: parameters.len(), got: values.len() });
    }
    for (p, value) in parameters.iter().zip(values) {
        let (min, max) = (p.about.min, p.about.max);
        if !(*value >= min && *value <= max) {
            return Err(IspError::Parameter { name: p.name.clone(), value: *value, min, max });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use image::metadata::Orientation;
    use image::{DynamicImage, RgbImage};

    use super::*;

    #[test]
    fn pictures_are_turned_as_exif_says() {
        let stored =
            RgbImage::from_fn(4, 3, |x, y| image::Rgb([(4 * y + x) as u8, 100 + x as u8, 200 + y as u8]));
        let planes = |picture: &RgbImage| -> Vec<u16> {
            (0..3).flat_map(|c| picture.pixels().map(move |p| u16::from(p[c]))).collect()
        };
        for exif in 0..=9 {
            let mut wanted = DynamicImage::ImageRgb8(stored.clone());
            if let Some(orientation) = Orientation::from_exif(exif) {
                wanted.apply_orientation(orientation);
            }
            let wanted = wanted.into_rgb8();
            let found = RgbPicture { height: 3, width: 4, bits: 8, data: planes(&stored) }.turned(exif);
            assert_eq!((found.width as u32, found.height as u32), wanted.dimensions(), "{exif}");
            assert_eq!(found.data, planes(&wanted), "{exif}");
        }
    }
}
