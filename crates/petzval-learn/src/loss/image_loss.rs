//! The training loss of a camera for pictures: L1 plus LPIPS.

use burn::prelude::*;

use super::{LossError, Lpips, LpipsTarget, l1, same_shape};

petzval_base::parameters! {
    /// `total = l1_weight * mean |image - target| + lpips_weight * mean over the batch of LPIPS(image, target)`.
    pub struct ImageLoss {
        /// Weight of the mean absolute difference; a part of weight 0 is neither computed nor reported.
        l1_weight: f32 = 1.0, "", 0..1e6, Log, "a weight of 0 leaves the part out";
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
    /// The mean absolute difference, unweighted; none when its weight is 0.
    pub l1: Option<f32>,
    /// The mean LPIPS distance, unweighted; none when its weight is 0.
    pub lpips: Option<f32>,
}

impl ImageLoss {
    /// Checks that the weights are finite and not negative.
    pub fn check(&self) -> Result<(), LossError> {
        for (name, value) in [("l1_weight", self.l1_weight), ("lpips_weight", self.lpips_weight)] {
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
        let mut total = Tensor::<1>::zeros([1], &image.device());
        let mut parts = [None, None];

        if self.l1_weight > 0.0 {
            let part = l1(image.clone(), target.picture.clone())?;
            parts[0] = Some(read_back(&part)?);
            total = total + part * self.l1_weight;
        }
        if self.lpips_weight > 0.0 {
            // Compute the features if the target was prepared by a loss without LPIPS.
            let distance = match &target.features {
                Some(features) => lpips.distance_to(image, features)?,
                None => lpips.distance_to(image, &lpips.target(target.picture.clone())?)?,
            };
            let part = distance.mean();
            parts[1] = Some(read_back(&part)?);
            total = total + part * self.lpips_weight;
        }
        Ok(ImageLossParts { total, l1: parts[0], lpips: parts[1] })
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
