//! How the colours of a mosaic are interpolated: by which method, and in linear light or after variance stabilisation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bilinear::GRADIENT;
use super::{Demosaic, Stabiliser};
use crate::image::LinearImage;
use crate::sensor::{Capture, SensorError, SensorModel};

/// The values between which colours are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Domain {
    /// Light itself.
    #[default]
    Linear,
    /// The square root of light, in which noise is about equal at every level of light. Interpolated values are means of
    /// roots, and their squares are lower than the means of light: at edges, where the neighbours differ, by up to a quarter of the step.
    Stabilised,
}

/// Interpolation of the colours of white-balanced mosaics, 1 = white.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Interpolation {
    /// The method.
    pub demosaic: Demosaic,
    /// The values that it takes.
    pub domain: Domain,
}

impl Default for Interpolation {
    /// Bilinear in linear light: one linear map, the same for every array.
    fn default() -> Self {
        Self { demosaic: Demosaic::Bilinear, domain: Domain::Linear }
    }
}

impl Interpolation {
    fn stabiliser(&self, sensor: &SensorModel, capture: &Capture) -> Option<Stabiliser> {
        (self.domain == Domain::Stabilised).then(|| Stabiliser::of_sensor(sensor, &capture.exposure))
    }

    /// The picture of a mosaic of `height` rows, three planes. Errors as of [`Demosaic::apply`].
    pub fn apply(
        &self,
        mosaic: &[f32],
        height: usize,
        sensor: &SensorModel,
        capture: &Capture,
    ) -> Result<LinearImage, SensorError> {
        let width = mosaic.len() / height.max(1);
        let apply =
            |mosaic: &[f32]| self.demosaic.apply(mosaic, height, width, sensor.cfa, capture.placement);
        let Some(stabiliser) = self.stabiliser(sensor, capture) else { return apply(mosaic) };
        let values: Vec<f32> = mosaic.iter().map(|v| stabiliser.forward(*v)).collect();
        let mut picture = apply(&values)?;
        picture.data.iter_mut().for_each(|v| *v = stabiliser.inverse(*v));
        Ok(picture)
    }

    /// The cotangent of a mosaic from that of its picture. Errors as of [`Demosaic::adjoint`].
    pub fn adjoint(
        &self,
        mosaic: &[f32],
        d_rgb: &LinearImage,
        sensor: &SensorModel,
        capture: &Capture,
    ) -> Result<Vec<f32>, SensorError> {
        let (n, values) = (d_rgb.height * d_rgb.width, mosaic.len());
        if n != values {
            let got = format!("{} x {}", d_rgb.height, d_rgb.width);
            return Err(SensorError::shape(GRADIENT, format!("{values} pixels"), got));
        }
        let adjoint = |mosaic: &[f32], d_rgb: &LinearImage| {
            self.demosaic.adjoint(mosaic, d_rgb, sensor.cfa, capture.placement)
        };
        let Some(stabiliser) = self.stabiliser(sensor, capture) else { return adjoint(mosaic, d_rgb) };
        let values: Vec<f32> = mosaic.iter().map(|v| stabiliser.forward(*v)).collect();
        let mut d_stable =
            self.demosaic.apply(&values, d_rgb.height, d_rgb.width, sensor.cfa, capture.placement)?;
        d_stable.data.iter_mut().zip(&d_rgb.data).for_each(|(v, d)| *v = d * stabiliser.inverse_slope(*v));
        let mut d_mosaic = adjoint(&values, &d_stable)?;
        d_mosaic.iter_mut().zip(mosaic).for_each(|(d, v)| *d *= stabiliser.slope(*v));
        Ok(d_mosaic)
    }
}
