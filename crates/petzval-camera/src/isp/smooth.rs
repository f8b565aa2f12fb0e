//! The automotive ISP in floating point on the tape: the stages of [`HardwareIsp`](super::HardwareIsp) without rounding, with a gradient
//! by the raw frame and by every number.

use burn::prelude::*;

use super::fixed::{LINEAR, ROOT};
use super::settings::IspSettings;
use super::stage::bayer_denoise::BayerDenoise;
use super::stage::black_level::BlackLevel;
use super::stage::colour::Colours;
use super::stage::colour_denoise;
use super::stage::defects::Defects;
use super::stage::demosaic::{self, FalseColour};
use super::stage::dewarp::Dewarp;
use super::stage::gain::{Gain, smooth_amplified};
use super::stage::green_balance::GreenBalance;
use super::stage::output::Output;
use super::stage::purple_fringe::PurpleFringe;
use super::stage::shading::Shading;
use super::stage::sharpen::Sharpen;
use super::stage::stabilise::SmoothStable;
use super::stage::tone_map::ToneMap;
use super::stage::white_balance::WhiteBalance;
use super::tape_grid::{Theta, least};
use super::{
    DifferentiableIsp, Isp, IspError, IspParameter, RawInput, RgbPicture, developed_without_gradient,
};
use crate::develop::Domain;

/// The automotive ISP in floating point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SmoothIsp {
    /// Methods, and the bits of pictures that are rounded.
    pub settings: IspSettings,
}

impl Isp for SmoothIsp {
    fn name(&self) -> &str {
        "petzval automotive ISP, floating point"
    }

    fn parameters(&self) -> Vec<IspParameter> {
        IspSettings::parameters()
    }

    fn develop(&self, frame: &RawInput, values: &[f64]) -> Result<RgbPicture, IspError> {
        developed_without_gradient(self, frame, values, self.settings.bits)
    }
}

impl DifferentiableIsp for SmoothIsp {
    fn develop_on_tape(
        &self,
        dn: Tensor<4>,
        frame: &RawInput,
        values: Tensor<1>,
    ) -> Result<Tensor<4>, IspError> {
        let parameters = IspSettings::parameters();
        let host = values.clone().detach().into_data().try_to_vec::<f32>();
        let host = host.map_err(|e| IspError::External(format!("{e:?}")))?;
        let host: Vec<f64> = host.into_iter().map(f64::from).collect();
        // Values in f32 may leave their range by rounding.
        let inside: Vec<f64> = if parameters.len() == host.len() {
            host.iter().zip(&parameters).map(|(v, p)| v.clamp(p.about.min, p.about.max)).collect()
        } else {
            host
        };
        let set = self.settings.with_values(&inside)?;
        let theta = Theta::new(values, parameters.into_iter().map(|p| p.name).collect());
        let (about, cfa) = (&frame.about, frame.cfa);

        let gain = Gain::smooth_factor(&theta);
        let stable = SmoothStable::new(&about.noise, gain.clone(), &theta);
        let light = smooth_amplified(BlackLevel::smooth(frame, dn, &theta), gain.clone());
        let mut mosaic = stable.root(light);
        mosaic = GreenBalance::smooth(mosaic, cfa, stable.sigma.clone(), &theta);
        mosaic = Defects::smooth(mosaic, &theta);
        mosaic = BayerDenoise::smooth(mosaic, stable.sigma.clone(), &theta);

        let mut light = stable.light(mosaic, BayerDenoise::smooth_averaged(&theta));
        light = smooth_amplified(light.clone(), Shading::smooth(about.shading.as_ref(), cfa, &light, &theta));
        light = smooth_amplified(light.clone(), WhiteBalance::smooth(about, cfa, &light, &theta));
        let highest = (gain * about.saturation).clamp_max(LINEAR.value(LINEAR.max)).expand(light.dims());
        light = least(light, highest);
        light = smooth_amplified(light.clone(), ToneMap::smooth(&light, &theta));

        let roots = match set.domain {
            Domain::Stabilised => stable.root(light),
            Domain::Linear => light.clamp(ROOT.value(ROOT.min), ROOT.value(ROOT.max)),
        };
        let mut rgb = demosaic::smooth(set.demosaic, roots, cfa);
        rgb = FalseColour::smooth(rgb, &theta);
        rgb = PurpleFringe::smooth(rgb, &theta);
        rgb = colour_denoise::smooth(rgb, stable.sigma.clone(), &theta);

        let zero: Tensor<4> = Tensor::zeros([1, 1, 1, 1], &rgb[0].device());
        let lights = rgb.map(|roots| match set.domain {
            Domain::Stabilised => stable.light(roots, zero.clone()),
            Domain::Linear => roots,
        });
        rgb =
            Colours::smooth(lights, about.colour_matrix, &theta).map(|light| set.gamma.smooth(light, &theta));
        rgb = Sharpen::smooth(rgb, &theta);
        rgb = Dewarp::smooth(rgb, about.warp.as_ref(), &theta);
        Ok(Output::smooth(rgb, &theta))
    }
}
