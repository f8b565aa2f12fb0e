//! The training loss of a camera for pictures: differences of pixels, structure and features, each with a weight.

use burn::prelude::*;

use super::{LossError, Lpips, LpipsTarget, l1, l2, same_shape, ssim};

petzval_base::parameters! {
    /// `total = l1_weight mean |d| + l2_weight mean d^2 + ssim_weight (1 - SSIM) + lpips_weight LPIPS`, with d = image - target.
    pub struct ImageLoss {
        /// Weight of the mean absolute difference; a part of weight 0 is neither computed nor reported.
        l1_weight: f32 = 1.0, "", 0..1e6, Log, "a weight of 0 leaves the part out";
        /// Weight of the mean squared difference, the error that PSNR measures; a part of weight 0 is neither computed nor reported.
        l2_weight: f32 = 0.0, "", 0..1e6, Log, "a weight of 0 leaves the part out";
        /// Weight of `1 - SSIM`; a part of weight 0 is neither computed nor reported.
        ssim_weight: f32 = 0.0, "", 0..1e6, Log, "a weight of 0 leaves the part out";
        /// Weight of the LPIPS distance; a part of weight 0 is neither computed nor reported.
        lpips_weight: f32 = 0.5, "", 0..1e6, Log, "a weight of 0 leaves the part out";
    }
}

/// A reference picture and, if the loss uses LPIPS, its features.
pub struct ImageTarget {
    picture: Tensor<4>,
    features: Option<LpipsTarget>,
}

/// The loss and its parts.
pub struct ImageLossParts {
    /// The weighted sum, one value, with its graph.
    pub total: Tensor<1>,
    /// Name, weight and unweighted value of every part whose weight is not 0.
    pub parts: Vec<LossPart>,
}

/// A part of the loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossPart {
    /// `l1`, `l2`, `ssim` or `lpips`.
    pub name: &'static str,
    /// Its weight.
    pub weight: f32,
    /// Its value; `1 - SSIM` for `ssim`.
    pub value: f32,
}

impl ImageLoss {
    /// The weights by the names of their keys.
    fn weights(&self) -> [(&'static str, f32); 4] {
        [
            ("l1_weight", self.l1_weight),
            ("l2_weight", self.l2_weight),
            ("ssim_weight", self.ssim_weight),
            ("lpips_weight", self.lpips_weight),
        ]
    }

    /// Whether no part has a weight.
    pub fn is_empty(&self) -> bool {
        self.weights().iter().all(|(_, weight)| *weight == 0.0)
    }

    /// Checks that the weights are finite and not negative.
    pub fn check(&self) -> Result<(), LossError> {
        for (name, value) in self.weights() {
            if !value.is_finite() || value < 0.0 {
                return Err(LossError::BadLossWeight { name, value });
            }
        }
        Ok(())
    }

    /// Prepares a reference picture `[batch, 3, height, width]`, sRGB-encoded, 0..1; no gradient flows to it.
    ///
    /// The same target serves any number of [`evaluate`](Self::evaluate) calls with this loss.
    pub fn target(&self, lpips: &Lpips, reference: Tensor<4>) -> Result<ImageTarget, LossError> {
        self.check()?;
        let picture = reference.detach();
        let features = if self.lpips_weight > 0.0 { Some(lpips.target(picture.clone())?) } else { None };
        Ok(ImageTarget { picture, features })
    }

    /// The loss of `image` against `target`, with its parts by name.
    pub fn evaluate(
        &self,
        lpips: &Lpips,
        image: Tensor<4>,
        target: &ImageTarget,
    ) -> Result<ImageLossParts, LossError> {
        self.check()?;
        same_shape(image.dims(), target.picture.dims())?;
        let picture = || target.picture.clone();
        let mut total = Tensor::<1>::zeros([1], &image.device());
        let mut parts = Vec::new();
        let mut add = |name: &'static str, weight: f32, part: Tensor<1>| -> Result<(), LossError> {
            parts.push(LossPart { name, weight, value: read_back(&part)? });
            total = total.clone() + part * weight;
            Ok(())
        };

        if self.l1_weight > 0.0 {
            add("l1", self.l1_weight, l1(image.clone(), picture())?)?;
        }
        if self.l2_weight > 0.0 {
            add("l2", self.l2_weight, l2(image.clone(), picture())?)?;
        }
        if self.ssim_weight > 0.0 {
            add("ssim", self.ssim_weight, ssim(image.clone(), picture())?.neg() + 1.0)?;
        }
        if self.lpips_weight > 0.0 {
            // Compute the features if the target was prepared by a loss without LPIPS.
            let distance = match &target.features {
                Some(features) => lpips.distance_to(image, features)?,
                None => lpips.distance_to(image, &lpips.target(picture())?)?,
            };
            add("lpips", self.lpips_weight, distance.mean())?;
        }
        Ok(ImageLossParts { total, parts })
    }
}

/// Reads one value back from the device.
pub(crate) fn read_back(value: &Tensor<1>) -> Result<f32, LossError> {
    let values = read_values(value.clone())?;
    values.first().copied().ok_or_else(|| LossError::ReadBack("no value".to_string()))
}

/// Reads the values of a tensor back from the device.
pub(crate) fn read_values<const D: usize>(values: Tensor<D>) -> Result<Vec<f32>, LossError> {
    values.detach().into_data().try_to_vec::<f32>().map_err(|error| LossError::ReadBack(format!("{error:?}")))
}

/// The same of what is compared with limits and with each other: NaN would drop out there in silence. Fails on the first one.
pub(crate) fn read_numbers<const D: usize>(
    values: Tensor<D>,
    what: &'static str,
) -> Result<Vec<f32>, LossError> {
    let values = read_values(values)?;
    if values.iter().any(|v| v.is_nan()) { Err(LossError::NotANumber(what)) } else { Ok(values) }
}
