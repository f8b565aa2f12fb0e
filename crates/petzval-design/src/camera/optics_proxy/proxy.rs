//! A trained network as a source of PSFs.

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::psf::PsfBank;
use petzval_learn::network::{OpticsProxy, OpticsProxyConfig, PROXY_GRID, PredictedPsfs};
use petzval_learn::weight_file::Weights;
use petzval_optics::design_space::DesignSpace;
use petzval_optics::lens::Lens;
use petzval_optics::psf::PsfKind;
use serde::{Deserialize, Serialize};

use crate::camera::to_host;
use crate::error::{DesignError, Result};
use crate::lens::psf_plan::PsfPlan;

/// Mean and standard deviation of the inputs of a network over random lenses of its design space: the coordinates of the design space, and
/// last the image radius of the field, mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations.
    pub deviation: Vec<f64>,
}

impl Scale {
    /// Of these inputs, each of the same length.
    pub fn of(rows: &[Vec<f64>]) -> Self {
        let count = rows.len().max(1) as f64;
        let inputs = rows.first().map_or(0, Vec::len);
        let mean: Vec<f64> = (0..inputs).map(|i| rows.iter().map(|r| r[i]).sum::<f64>() / count).collect();
        let variance = |i: usize| rows.iter().map(|r| (r[i] - mean[i]).powi(2)).sum::<f64>() / count;
        let deviation = (0..inputs).map(|i| variance(i).sqrt().max(f64::MIN_POSITIVE)).collect();
        Self { deviation, mean }
    }
}

/// What a network predicts: PSFs of these colours, on this grid, for fields up to this radius.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProxyDomain {
    /// Wavelengths of the red, green and blue channel, um.
    pub wavelengths_um: [f64; 3],
    /// Cells a side.
    pub grid: usize,
    /// Size of a cell, um.
    pub pitch_um: f64,
    /// Image radius of the outermost field, mm.
    pub corner_mm: f64,
}

impl ProxyDomain {
    /// What a network has to predict for a plan. The error is the key of an experiment whose value no network has, and a hint.
    pub fn of(plan: &PsfPlan) -> Result<Self, (&'static str, String)> {
        let options = &plan.options;
        if options.grid != PROXY_GRID {
            return Err(("psf.grid", format!("the network predicts PSFs of {PROXY_GRID} cells a side")));
        }
        if options.kind != PsfKind::Geometric {
            return Err(("psf.kind", "the network learns the PSFs of rays: write \"geometric\"".to_owned()));
        }
        Ok(Self {
            wavelengths_um: plan.wavelengths_um,
            grid: options.grid,
            pitch_um: options.pitch_um,
            corner_mm: plan.field_radius_mm.last().copied().unwrap_or(0.0),
        })
    }
}

/// A network that gives the PSFs of the lenses of one design space.
pub struct ProxyOptics {
    space: DesignSpace,
    domain: ProxyDomain,
    scale: Scale,
    pub(super) network: OpticsProxy,
    device: Device,
}

/// PSFs that a network gave, with what their gradient needs.
pub struct ProxyPsfs {
    /// The renderer's input.
    pub bank: PsfBank,
    inputs: Tensor<2>,
    predicted: PredictedPsfs,
    deviation: Vec<f64>,
}

impl ProxyOptics {
    /// A network of these sizes with weights from a seed, for the lenses of a space. Its inputs are the coordinates of the space and the
    /// field: `config.inputs` is ignored. `device` has automatic differentiation.
    pub fn new(
        space: DesignSpace,
        domain: ProxyDomain,
        scale: Scale,
        config: OpticsProxyConfig,
        seed: u64,
        device: &Device,
    ) -> Result<Self> {
        let inputs = space.dimension() + 1;
        let network = OpticsProxyConfig { inputs, ..config }.init(seed, device)?;
        Ok(Self { space, domain, scale, network, device: device.clone() })
    }

    /// The same with the weights of a file, of this program or safetensors.
    pub fn with_weights(mut self, weights: Vec<u8>) -> Result<Self> {
        self.network = self.network.load_any(weights)?;
        Ok(self)
    }

    /// What it predicts.
    pub fn domain(&self) -> &ProxyDomain {
        &self.domain
    }

    /// Means and deviations of its inputs.
    pub fn scale(&self) -> &Scale {
        &self.scale
    }

    /// The inputs of lenses and fields, at mean 0 and variance 1: `[batch, coordinates + 1]`.
    pub(super) fn inputs(&self, lenses_and_radii: &[(&Lens, f64)]) -> Tensor<2> {
        let Scale { mean, deviation } = &self.scale;
        let normalised = |(lens, radius_mm): &(&Lens, f64)| {
            let numbers = self.space.coordinates(lens).into_iter().chain([*radius_mm]);
            let scaled = numbers.zip(mean.iter().zip(deviation)).map(|(x, (m, d))| ((x - m) / d) as f32);
            scaled.collect::<Vec<_>>()
        };
        let values: Vec<f32> = lenses_and_radii.iter().flat_map(normalised).collect();
        Tensor::from_data(TensorData::new(values, [lenses_and_radii.len(), mean.len()]), &self.device)
    }

    /// The PSFs of a lens at image radii, mm, the first 0.
    pub fn psfs(&self, lens: &Lens, field_radius_mm: &[f64]) -> Result<ProxyPsfs> {
        let fields: Vec<(&Lens, f64)> = field_radius_mm.iter().map(|radius| (lens, *radius)).collect();
        let inputs = self.inputs(&fields).require_grad();
        let predicted = self.network.forward(inputs.clone());
        let bank = PsfBank {
            field_radius_mm: field_radius_mm.to_vec(),
            grid: self.domain.grid,
            pitch_um: self.domain.pitch_um,
            values: to_host(predicted.values.clone())?,
            illumination: to_host(predicted.illumination.clone())?,
        };
        Ok(ProxyPsfs { bank, inputs, predicted, deviation: self.scale.deviation.clone() })
    }
}

impl ProxyPsfs {
    /// The derivatives of a loss by the coordinates of the design space, from those by the bank's values and illumination, laid out as in
    /// [`PsfBank`].
    pub fn by_coordinates(&self, by_values: &[f32], by_illumination: &[f32]) -> Result<Vec<f64>> {
        let PredictedPsfs { values, illumination } = &self.predicted;
        let device = values.device();
        let of_values = Tensor::from_data(TensorData::new(by_values.to_vec(), values.dims()), &device);
        let of_light =
            Tensor::from_data(TensorData::new(by_illumination.to_vec(), illumination.dims()), &device);
        let loss = (values.clone() * of_values).sum() + (illumination.clone() * of_light).sum();
        let slopes = self.inputs.grad(&loss.backward()).ok_or(DesignError::NoGradient("the lens"))?;
        let slopes = to_host(slopes)?;
        let inputs = self.deviation.len();
        // The last input is the field, which stays.
        let by = |i: usize| slopes.iter().skip(i).step_by(inputs).map(|s| f64::from(*s)).sum::<f64>();
        Ok((0..inputs - 1).map(|i| by(i) / self.deviation[i]).collect())
    }
}
