//! How far a proxy is from the ISP that it imitates, on frames and parameters that training has not seen.

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_base::Cancel;
use petzval_camera::image::LinearImage;
use petzval_camera::isp::Isp;
use petzval_camera::tape::on_device;
use petzval_learn::proxy_isp::ProxyIsp;
use petzval_learn::score::{Score, ScoreDescription, ScoredPair};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Frame;
use super::sampling::{beside, far, near};
use super::trainer::dn_on;
use crate::camera::to_host;
use crate::error::{DesignError, Result};

/// Half the step of the ISP's difference quotients, as a share of a parameter's range.
const HALF_STEP: f64 = 0.02;

/// Seed of the parameters on which proxies are judged; training draws others.
const SEED: u64 = 0x6170_6172_7421;

/// What an imitation costs. Means over frames of scenes that training has not seen. The truth of a frame is what the ISP makes, with the
/// parameters about which the proxy was trained, of the same scene through perfect optics and without noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Gap {
    /// Frames.
    pub frames: usize,
    /// PSNR of the proxy's picture against the ISP's with the parameters about which it was trained, dB.
    pub psnr_at_centre_db: f64,
    /// The same with parameters near them, drawn for every frame.
    pub psnr_near_db: f64,
    /// The same with a tenth of the parameters anywhere in their ranges.
    pub psnr_far_db: f64,
    /// What either makes of the scores, with the parameters about which the proxy was trained.
    pub scores: Vec<ScoreGap>,
    /// Cosine between the two gradients of the mean squared error of the picture by the place of each parameter in its range: the ISP's
    /// by central differences, and the proxy's. Every parameter is a tenth of its range beside the one about which the proxy was trained: there the
    /// error is least, and what is left of its slopes is noise.
    pub gradient_cosine: f64,
    /// The two gradients, at the same place.
    pub slopes: Vec<ParameterSlope>,
}

/// A score of the ISP's pictures beside that of the proxy's; the gap is their difference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScoreGap {
    /// The score.
    pub score: ScoreDescription,
    /// Of the ISP.
    pub isp: f64,
    /// Of the proxy.
    pub proxy: f64,
}

/// The slope of the mean squared error by the place of a parameter in its range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ParameterSlope {
    /// Name of the parameter.
    pub name: String,
    /// Through the ISP, by differences.
    pub isp: f64,
    /// Through the proxy.
    pub proxy: f64,
}

/// Judges proxies of an ISP.
pub struct Judge<'a> {
    /// The ISP.
    pub isp: &'a dyn Isp,
    /// Frames of scenes that training has not seen.
    pub frames: &'a [Frame],
    /// Scores of pictures against their truths.
    pub scores: &'a [Box<dyn Score>],
    /// Stops it before the next frame.
    pub cancel: &'a Cancel,
}

impl Judge<'_> {
    /// Judges a proxy about `values`, one for each parameter of the ISP. `device` has automatic differentiation. Fails with
    /// [`DesignError::Stopped`] once the flag is set.
    pub fn gap(&self, proxy: &ProxyIsp, values: &[f64], device: &Device) -> Result<Gap> {
        let centre = proxy.places(values);
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        let count = self.frames.len();
        let (mut near_by, mut far_off) = (Vec::new(), Vec::new());
        for _ in 0..count {
            near_by.push(near(&centre, &mut random));
            far_off.push(far(&centre, &mut random));
        }
        let same = vec![centre.clone(); count];
        let truth = |frame: &Frame| -> Result<LinearImage> {
            self.cancel.check()?;
            let picture = self.isp.develop(&frame.ideal, values)?;
            let (height, width, data) = (picture.height, picture.width, picture.encoded());
            Ok(LinearImage { channels: 3, height, width, data })
        };
        let truths: Vec<LinearImage> = self.frames.iter().map(truth).collect::<Result<_, _>>()?;
        let at_centre = self.pictures(proxy, &same, device)?;
        let scores = self.scores.iter().map(|score| {
            let score = score.as_ref();
            score_gap(score, &at_centre, &truths, device, self.cancel)
        });
        let slopes = self.slopes(proxy, &truths, &beside(&centre, &mut random), device)?;
        Ok(Gap {
            frames: count,
            psnr_at_centre_db: psnr_db(&at_centre),
            psnr_near_db: psnr_db(&self.pictures(proxy, &near_by, device)?),
            psnr_far_db: psnr_db(&self.pictures(proxy, &far_off, device)?),
            scores: scores.collect::<Result<_, _>>()?,
            gradient_cosine: cosine(&slopes),
            slopes,
        })
    }

    /// What ISP and proxy make of each frame, with parameters of its own.
    fn pictures(&self, proxy: &ProxyIsp, places: &[Vec<f64>], device: &Device) -> Result<Vec<Pictures>> {
        let both = |(frame, places): (&Frame, &Vec<f64>)| {
            self.cancel.check()?;
            let isp = self.isp.develop(&frame.raw, &proxy.values(places))?.encoded();
            let proxy = to_host(develop(proxy, frame, at(places, device), device)?)?;
            Ok(Pictures { isp, proxy })
        };
        self.frames.iter().zip(places).map(both).collect()
    }

    /// Both gradients of the mean squared error of the pictures against their truths, at a point.
    fn slopes(
        &self,
        proxy: &ProxyIsp,
        truths: &[LinearImage],
        point: &[f64],
        device: &Device,
    ) -> Result<Vec<ParameterSlope>> {
        let count = self.frames.len() as f64;
        let mut by_proxy = vec![0.0; point.len()];
        for (frame, truth) in self.frames.iter().zip(truths) {
            self.cancel.check()?;
            let places = at(point, device).require_grad();
            let error = develop(proxy, frame, places.clone(), device)? - on_device(truth, device);
            let gradients = error.square().mean().backward();
            let by = places.grad(&gradients).ok_or(DesignError::NoGradient("the parameters of the ISP"))?;
            by_proxy.iter_mut().zip(to_host(by)?).for_each(|(sum, slope)| *sum += f64::from(slope) / count);
        }
        let (isp, frames, cancel) = (self.isp, self.frames, self.cancel);
        let mean_square_of = |places: &[f64]| -> Result<f64> {
            let values = proxy.values(places);
            let of = |(frame, truth): (&Frame, &LinearImage)| {
                cancel.check()?;
                let picture = isp.develop(&frame.raw, &values)?;
                Ok(mean_square(&picture.encoded(), &truth.data))
            };
            let errors: Vec<f64> = frames.par_iter().zip(truths).map(of).collect::<Result<_>>()?;
            Ok(errors.iter().sum::<f64>() / count)
        };
        let mut slopes = Vec::new();
        for (i, (parameter, by_proxy)) in proxy.varied().zip(by_proxy).enumerate() {
            let (mut low, mut high) = (point.to_vec(), point.to_vec());
            low[i] = (point[i] - HALF_STEP).max(0.0);
            high[i] = (point[i] + HALF_STEP).min(1.0);
            let isp = (mean_square_of(&high)? - mean_square_of(&low)?) / (high[i] - low[i]);
            slopes.push(ParameterSlope { name: parameter.name.clone(), isp, proxy: by_proxy });
        }
        Ok(slopes)
    }
}

/// A frame as ISP and proxy develop it, three planes, encoded.
struct Pictures {
    isp: Vec<f32>,
    proxy: Vec<f32>,
}

/// Mean PSNR of the proxy's pictures against the ISP's, dB.
fn psnr_db(pictures: &[Pictures]) -> f64 {
    let psnr = |p: &Pictures| -10.0 * mean_square(&p.proxy, &p.isp).log10();
    pictures.iter().map(psnr).sum::<f64>() / pictures.len() as f64
}

/// The mean score of the pictures of either against their truths.
fn score_gap(
    score: &dyn Score,
    pictures: &[Pictures],
    truths: &[LinearImage],
    device: &Device,
    cancel: &Cancel,
) -> Result<ScoreGap> {
    let mean = |of: fn(&Pictures) -> &Vec<f32>| -> Result<f64> {
        let mut sum = 0.0;
        for (picture, truth) in pictures.iter().map(of).zip(truths) {
            cancel.check()?;
            let data = picture.iter().map(|v| v.clamp(0.0, 1.0)).collect();
            let finished = LinearImage { data, ..truth.clone() };
            sum += score.of(&ScoredPair::new(finished, truth.clone(), device))?;
        }
        Ok(sum / pictures.len() as f64)
    };
    Ok(ScoreGap { score: ScoreDescription::of(score), isp: mean(|p| &p.isp)?, proxy: mean(|p| &p.proxy)? })
}

fn at(places: &[f64], device: &Device) -> Tensor<2> {
    let places: Vec<f32> = places.iter().map(|v| *v as f32).collect();
    let shape = [1, places.len()];
    Tensor::from_data(TensorData::new(places, shape), device)
}

/// What a proxy makes of a frame.
fn develop(proxy: &ProxyIsp, frame: &Frame, places: Tensor<2>, device: &Device) -> Result<Tensor<4>> {
    Ok(proxy.develop_batch(vec![(dn_on(&frame.raw, device), &frame.raw)], places)?)
}

fn mean_square(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / a.len() as f64
}

/// The cosine between the two gradients; 0 where one of them is 0, as that of an untrained proxy.
fn cosine(slopes: &[ParameterSlope]) -> f64 {
    let sum = |of: &dyn Fn(&ParameterSlope) -> f64| slopes.iter().map(of).sum::<f64>();
    let norms = (sum(&|s| s.isp * s.isp) * sum(&|s| s.proxy * s.proxy)).sqrt();
    if norms > 0.0 { sum(&|s| s.isp * s.proxy) / norms } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cosine_is_one_along_minus_one_against_and_zero_across() {
        let slope = |isp, proxy| ParameterSlope { name: String::new(), isp, proxy };
        let close = |slopes: &[ParameterSlope], expected: f64| (cosine(slopes) - expected).abs() < 1e-12;
        assert!(close(&[slope(3.0, 6.0), slope(-1.0, -2.0)], 1.0));
        assert!(close(&[slope(3.0, -3.0), slope(-1.0, 1.0)], -1.0));
        assert!(close(&[slope(1.0, 2.0), slope(2.0, -1.0)], 0.0));
        assert!(close(&[slope(1.0, 0.0)], 0.0));
    }
}
