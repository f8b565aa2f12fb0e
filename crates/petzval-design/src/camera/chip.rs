//! A hardware ISP in a camera: on the tape while something is learnt, in whole numbers where pictures are judged.

use std::sync::Arc;

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::image::LinearImage;
use petzval_camera::isp::{
    DifferentiableIsp, HardwareIsp, Isp, IspParameter, IspSettings, Mesh, RawInput, Shading, SmoothIsp,
};
use petzval_camera::sensor::{Capture, Noise, NoiseMode, Raw, SensorModel, expose};
use petzval_learn::proxy_isp::{LEAST_SHADE, ProxyIsp};
use rayon::prelude::*;

use super::host::to_host;
use crate::assets::OutsideIsp;
use crate::error::{DesignError, Result};

/// Nodes along a side of the mesh by which the shading of a window is corrected.
const MESH: usize = 5;

/// The hardware ISP of a camera: a black box with parameters, ours or anybody's.
#[derive(Clone)]
pub struct Chip {
    isp: Arc<dyn Isp>,
    values: Vec<f64>,
    /// The same in floating point, which only ours has.
    smooth: Option<Box<SmoothIsp>>,
    /// What describes one that is not ours.
    description: String,
}

impl Chip {
    /// The built-in ISP with these methods and values.
    pub fn built_in(settings: IspSettings) -> Self {
        let values = settings.values();
        let smooth = Some(Box::new(SmoothIsp { settings: settings.clone() }));
        Self { isp: Arc::new(HardwareIsp { settings }), values, smooth, description: String::new() }
    }

    /// An ISP outside this program.
    pub fn external(OutsideIsp { isp, values, description }: OutsideIsp) -> Self {
        Self { isp, values, smooth: None, description }
    }

    /// The text that describes one that is not ours.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// The ISP as a black box.
    pub fn isp(&self) -> &Arc<dyn Isp> {
        &self.isp
    }

    /// Its parameters.
    pub fn parameters(&self) -> Vec<IspParameter> {
        self.isp.parameters()
    }

    /// The values with which truths are developed, and that it has unless others are set: one for each parameter.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The methods of the built-in ISP.
    pub fn settings(&self) -> Option<&IspSettings> {
        self.smooth.as_ref().map(|smooth| &smooth.settings)
    }
}

/// The values of the parameters of a camera's hardware ISP.
#[derive(Clone)]
pub enum ChipValues {
    /// On the tape, each in its own unit, for the built-in ISP in floating point, whose gradient goes to raw frames and values.
    OnTape(Box<Tensor<1>>),
    /// On the tape, each in its own unit, for a network that imitates the ISP; its gradient goes to raw frames and values.
    Imitated {
        /// The values.
        values: Box<Tensor<1>>,
        /// The network.
        proxy: Box<ProxyIsp>,
    },
    /// For the ISP itself, as the chip runs it; the built-in one in whole numbers. No gradient.
    Exact(Vec<f64>),
}

/// Raw frames of a batch with what a calibrated camera knows about them. The illumination of the lens serves as calibration of the
/// shading.
pub fn raw_inputs(
    raw: &Tensor<4>,
    illumination: &Tensor<4>,
    captures: &[Capture],
    sensor: &SensorModel,
) -> Result<Vec<RawInput>> {
    let [_, _, height, width] = raw.dims();
    let pixels = height * width;
    let (dn, shades) = (to_host(raw.clone())?, to_host(illumination.clone())?);
    let one = |(i, capture): (usize, &Capture)| {
        let dn = dn[i * pixels..][..pixels].to_vec();
        let mut input = RawInput::from_raw(&Raw { height, width, dn, capture: *capture }, sensor)?;
        let data = shades[3 * i * pixels..][..3 * pixels].to_vec();
        let shades = LinearImage { channels: 3, height, width, data };
        input.about.shading = Some(Mesh::of_picture(&shades, MESH, MESH));
        Ok(input)
    };
    captures.iter().enumerate().map(one).collect()
}

/// The frame of a scene through perfect optics, without noise.
pub fn ideal_input(scene: &LinearImage, capture: &Capture, sensor: &SensorModel) -> Result<RawInput> {
    let noise = Noise { mode: NoiseMode::Off, seed: 0 };
    Ok(RawInput::from_raw(&expose(scene, sensor, capture, &noise)?, sensor)?)
}

/// Develops a batch of raw frames to sRGB-encoded pictures `[batch, 3, height, width]`.
pub fn develop(
    chip: &Chip,
    values: &ChipValues,
    raw: Tensor<4>,
    illumination: &Tensor<4>,
    inputs: &[RawInput],
) -> Result<Tensor<4>> {
    let [_, _, height, width] = raw.dims();
    match values {
        ChipValues::Exact(values) => exact(chip, values, inputs, [height, width], &raw.device()),
        ChipValues::OnTape(values) => {
            let isp = chip.smooth.as_ref().ok_or(DesignError::NoGradient("an ISP outside this program"))?;
            let now = isp.settings.with_values(&in_range(&to_host(values.as_ref().clone())?))?;
            let one = |(i, input): (usize, &RawInput)| {
                let dn = raw.clone().slice([i..i + 1, 0..1, 0..height, 0..width]);
                let shades = illumination.clone().slice([i..i + 1, 0..3, 0..height, 0..width]);
                let dn = recalibrated(dn, shades, input, &now.shading);
                Ok(isp.develop_on_tape(dn, input, values.as_ref().clone())?)
            };
            Ok(Tensor::cat(inputs.iter().enumerate().map(one).collect::<Result<_>>()?, 0))
        }
        ChipValues::Imitated { values, proxy } => {
            // The network receives light whose shading is corrected whole.
            let whole = Shading { strength: 1.0, cap: 1.0 / f64::from(LEAST_SHADE) };
            let mut frames = Vec::with_capacity(inputs.len());
            for (i, input) in inputs.iter().enumerate() {
                let dn = raw.clone().slice([i..i + 1, 0..1, 0..height, 0..width]);
                let shades = illumination.clone().slice([i..i + 1, 0..3, 0..height, 0..width]);
                frames.push((recalibrated(dn, shades, input, &whole), input));
            }
            let places = proxy.places_on_tape(values).expand([inputs.len() as i64, -1]);
            Ok(proxy.develop_batch(frames, places)?)
        }
    }
}

/// Values of all parameters within their ranges, which single precision may leave by rounding.
fn in_range(values: &[f32]) -> Vec<f64> {
    let parameters = IspSettings::parameters();
    values.iter().zip(&parameters).map(|(v, p)| f64::from(*v).clamp(p.about.min, p.about.max)).collect()
}

/// Digital numbers `[1, 1, height, width]` whose gradient knows that the shading is calibrated for the lens as it is.
///
/// The ISP sees its calibration as numbers. For a lens that moves, the shading correction moves with the illumination. The digital numbers
/// are multiplied by the illumination of the calibration over that on the tape. The ratio is 1; its gradient is that of the correction, and
/// 0 where the gain is capped.
fn recalibrated(dn: Tensor<4>, shades: Tensor<4>, input: &RawInput, shading: &Shading) -> Tensor<4> {
    let RawInput { height, width, cfa, .. } = *input;
    let of_plane = |plane: usize| (0..height * width).map(move |i| (plane, i));
    let is_plane = |(plane, i): (usize, usize)| {
        f32::from(u8::from(cfa.colour(i / width, i % width).plane() == Some(plane)))
    };
    let masks: Vec<f32> = (0..3).flat_map(of_plane).map(is_plane).collect();
    let masks: Tensor<4> = Tensor::from_data(TensorData::new(masks, [1, 3, height, width]), &dn.device());
    let shades = shades.clamp_min(1.0 / shading.cap);
    let ratio = ((shades.clone().detach() / shades) * masks).sum_dim(1).powf_scalar(shading.strength);
    let black = input.about.black_dn;
    (dn - black) * ratio + black
}

/// What the ISP itself makes of frames of one size.
pub fn exact(
    chip: &Chip,
    values: &[f64],
    inputs: &[RawInput],
    [height, width]: [usize; 2],
    device: &Device,
) -> Result<Tensor<4>> {
    let pictures: Vec<Vec<f32>> = inputs
        .par_iter()
        .map(|input| Ok(chip.isp.develop(input, values)?.encoded()))
        .collect::<Result<_>>()?;
    let data = TensorData::new(pictures.concat(), [inputs.len(), 3, height, width]);
    Ok(Tensor::from_data(data, device))
}
