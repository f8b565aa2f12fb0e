//! The light path on the tape: PSFs and scenes in, developed pictures out.

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::image::LinearImage;
use petzval_camera::psf::{PsfBank, PsfLayout};
use petzval_camera::render::{Placement, RenderGeometry};
use petzval_camera::sensor::{Capture, Exposure, Noise, SensorModel};
use petzval_camera::tape::{PlacedScene, develop_op, expose_op, illumination_op, render_op};

use crate::error::DesignError;

/// Illumination below which shading is no longer corrected: there is nothing but noise to amplify.
pub const SHADING_FLOOR: f32 = 0.05;

/// One window of a photograph at a place of the sensor, taken as one frame.
#[derive(Clone, Debug)]
pub struct Shot {
    /// The scene: the window and the border that the PSF reaches into, linear light.
    pub scene: LinearImage,
    /// Sensor position of the window's top-left pixel.
    pub placement: Placement,
    /// Number of the frame: it keys the noise.
    pub frame: u64,
}

/// Camera stages that do not change during a run.
#[derive(Clone, Debug)]
pub struct LightPath {
    /// Sensor grid and PSF patches.
    pub geometry: RenderGeometry,
    /// Fields and grid of the PSFs.
    pub layout: PsfLayout,
    /// The sensor.
    pub sensor: SensorModel,
    /// Its exposure.
    pub exposure: Exposure,
    /// Border of a scene around its window, pixels.
    pub border: usize,
}

/// A PSF bank as leaf tensors.
pub struct PsfLeaves {
    /// `[field, channel, row, column]`.
    pub values: Tensor<4>,
    /// `[field, channel]`.
    pub illumination: Tensor<2>,
}

impl PsfLeaves {
    /// Leaves on a device; with `tracked` they collect gradients.
    pub fn new(bank: &PsfBank, device: &Device, tracked: bool) -> Self {
        let (fields, grid) = (bank.field_radius_mm.len(), bank.grid);
        let values = TensorData::new(bank.values.clone(), [fields, 3, grid, grid]);
        let illumination = TensorData::new(bank.illumination.clone(), [fields, 3]);
        let leaves = Self {
            values: Tensor::from_data(values, device),
            illumination: Tensor::from_data(illumination, device),
        };
        if tracked {
            Self { values: leaves.values.require_grad(), illumination: leaves.illumination.require_grad() }
        } else {
            leaves
        }
    }
}

impl LightPath {
    /// Takes the shots: render through the lens, expose, develop, correct the shading, encode as sRGB.
    ///
    /// Returns `[shot, 3, height, width]`, about 0..1. Shading is corrected with the lens's own relative
    /// illumination, as a calibrated camera does; the gradient knows both where light is lost and where the
    /// loss is made good.
    pub fn take(&self, psf: &PsfLeaves, shots: &[Shot], noise: &Noise) -> Result<Tensor<4>, DesignError> {
        let Some(first) = shots.first() else {
            return Ok(Tensor::zeros([1, 3, 1, 1], &psf.values.device()));
        };
        let (height, width) = (first.scene.height - 2 * self.border, first.scene.width - 2 * self.border);
        let scenes =
            shots.iter().map(|s| PlacedScene { scene: s.scene.clone(), placement: s.placement }).collect();
        let placements: Vec<Placement> = shots.iter().map(|s| s.placement).collect();
        let captures: Vec<Capture> = shots
            .iter()
            .map(|s| Capture { exposure: self.exposure, placement: s.placement, frame: s.frame })
            .collect();

        let blurred = render_op(psf.values.clone(), &self.layout, &self.geometry, scenes)?;
        let light = illumination_op(
            psf.illumination.clone(),
            &self.layout,
            &self.geometry,
            &placements,
            height,
            width,
        )?;
        let raw = expose_op(blurred * light.clone(), &self.sensor, &captures, noise)?;
        let linear = develop_op(raw, &self.sensor, &captures)?;
        Ok(srgb_encode(linear / light.clamp_min(SHADING_FLOOR)))
    }

    /// The windows themselves, sRGB-encoded: what a perfect camera would show.
    pub fn truth(&self, shots: &[Shot], device: &Device) -> Result<Tensor<4>, DesignError> {
        let mut data = Vec::new();
        let (mut height, mut width) = (0, 0);
        for shot in shots {
            height = shot.scene.height - 2 * self.border;
            width = shot.scene.width - 2 * self.border;
            let window = shot
                .scene
                .crop(self.border, self.border, height, width)
                .map_err(|e| DesignError::Device(e.to_string()))?;
            data.extend(window.to_srgb());
        }
        Ok(Tensor::from_data(TensorData::new(data, [shots.len(), 3, height, width]), device))
    }
}

/// The sRGB transfer function (IEC 61966-2-1), linear below its toe so that noise around black keeps its sign.
fn srgb_encode(linear: Tensor<4>) -> Tensor<4> {
    const TOE: f32 = 0.003_130_8;
    let toe = linear.clone() * 12.92;
    let curve = linear.clone().clamp_min(TOE).powf_scalar(1.0 / 2.4) * 1.055 - 0.055;
    let in_toe = linear.lower_equal_elem(TOE);
    curve.mask_where(in_toe, toe)
}
