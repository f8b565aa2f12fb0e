//! Variance stabilisation: the square root of light plus an offset, after which noise is about equal at every level of light.
//!
//! Noise of variance `shot * light + read` has after `r = sqrt(light + c)`, `c = read / shot + 3/8 shot`, the standard deviation
//! `sqrt(shot) / 2` (the generalised transform of Anscombe). Where the root is too steep, below `c / 4`, it goes on as a straight line.
//! On the way back the mean of a root is squared, which is less than the mean of the light by the variance that was averaged away:
//! `light = r^2 - c + averaged * shot / 4` (M. Makitalo, A. Foi, IEEE TIP 2013, give the exact series for the full average).

use burn::prelude::*;

use crate::isp::NoiseProfile;
use crate::isp::fixed::{Grid, LINEAR, OctaveTable, ROOT, by_blocks, scaled, shift_round};
use crate::isp::tape_grid::Theta;

petzval_base::parameters! {
    /// Variance stabilisation: how much noise the stages after it expect.
    pub struct Stabilise {
        /// Standard deviation of the noise over that of the sensor's calibration.
        noise_scale: f64 = 1.0, "", 0.5..2.0, Log, "1 trusts the calibration";
    }
}

/// Least offset, so that the root has a slope that fixed-point numbers can hold.
const LEAST_OFFSET: f64 = 1.0 / 8192.0;

/// Greatest offset, the brightest light: of frames with so much noise nothing can be seen.
const MOST_OFFSET: f64 = LINEAR.max as f64 / LINEAR.one() as f64;

/// The transform of light with a digital gain.
pub struct Stable {
    /// Offset c, units of light.
    pub offset: f64,
    /// Standard deviation of the noise after the transform.
    pub sigma: f64,
    /// Light that the average of noise adds on the way back, if all of it is averaged away.
    bias: f64,
    table: OctaveTable,
    whole_offset: i32,
    least: i32,
    least_root: i32,
    /// Slope of the root at its least value, steps of [`ROOT`] per step of [`LINEAR`], [`TANGENT_BITS`] behind the point.
    tangent: i32,
}

/// Bits behind the point of the slope of the root; it is at most 0.71, at the [least offset](LEAST_OFFSET).
const TANGENT_BITS: u32 = 16;

impl Stabilise {
    /// The transform of light of a noise profile after a gain.
    pub fn stable(&self, noise: &NoiseProfile, gain: f64) -> Stable {
        let shot = (noise.shot * gain).max(1e-9);
        let offset = (noise.read * gain * gain / shot + 0.375 * shot).clamp(LEAST_OFFSET, MOST_OFFSET);
        let one = f64::from(LINEAR.one());
        let whole_offset = LINEAR.of(offset);
        // The root of c / 4 has the slope 1 / sqrt(c).
        let steps = f64::from(ROOT.one()) / one;
        let tangent = (steps / offset.sqrt() * f64::from(1 << TANGENT_BITS)).round() as i32;
        Stable {
            offset,
            sigma: 0.5 * shot.sqrt() * self.noise_scale,
            bias: 0.25 * shot,
            table: OctaveTable::new(LINEAR.max, ROOT, |v| (v / one).sqrt()),
            whole_offset,
            least: whole_offset >> 2,
            least_root: ROOT.of((0.25 * offset).sqrt()),
            tangent,
        }
    }
}

impl Stable {
    /// Root, [`ROOT`], of light, [`LINEAR`].
    #[inline(always)]
    pub fn root(&self, light: i32) -> i32 {
        let sum = (light + self.whole_offset).min(LINEAR.max);
        let above = self.table.at(sum);
        // The tangent below.
        let steps = shift_round(scaled((sum - self.least).min(0), self.tangent), TANGENT_BITS - 12);
        let below = ROOT.clamp(self.least_root + steps);
        if sum >= self.least { above } else { below }
    }

    /// Light, [`LINEAR`], of a root, [`ROOT`], of whose noise a share was averaged away; `bias` is [`Stable::bias`] of that share.
    #[inline(always)]
    pub fn light(&self, root: i32, bias: i32) -> i32 {
        let low = self.least_root;
        // Steps of the square have 2^6 in a step of light.
        const SHIFT: u32 = 2 * ROOT.fraction - LINEAR.fraction;
        // Below the least root along the tangent.
        let above = root.max(low);
        let square = above * above + 2 * low * (root - above);
        LINEAR.clamp(((square + (1 << (SHIFT - 1))) >> SHIFT) - self.whole_offset + bias)
    }

    /// What the way back adds where a share of the noise's variance was averaged away, [`LINEAR`].
    pub fn bias(&self, averaged: f64) -> i32 {
        LINEAR.of(self.bias * averaged)
    }
}

/// The roots of the light of a mosaic, each by `root`.
pub fn rooted(light: &Grid<i32>, root: impl Fn(i32) -> i32 + Sync) -> Grid<i16> {
    Grid::from_rows(
        light.size(),
        #[inline(always)]
        |row, out| {
            let light = light.row(row);
            by_blocks(
                [out],
                #[inline(always)]
                |pixels, [block]| {
                    block.iter_mut().zip(&light[pixels]).for_each(|(out, v)| *out = root(*v));
                },
            );
        },
    )
}

/// The transform on the tape: offset and standard deviation depend on the gain.
pub struct SmoothStable {
    pub offset: Tensor<4>,
    pub sigma: Tensor<4>,
    shot: Tensor<4>,
}

impl SmoothStable {
    pub fn new(noise: &NoiseProfile, gain: Tensor<4>, theta: &Theta) -> Self {
        let shot = (gain.clone() * noise.shot).clamp_min(1e-9);
        let offset = gain.clone() * gain * noise.read / shot.clone() + shot.clone() * 0.375;
        let sigma = shot.clone().sqrt() * theta.number("stabilise.noise_scale") * 0.5;
        Self { offset: offset.clamp(LEAST_OFFSET, MOST_OFFSET), sigma, shot }
    }

    pub fn root(&self, light: Tensor<4>) -> Tensor<4> {
        let least = self.offset.clone() * 0.25;
        let sum = (light + self.offset.clone()).clamp_max(LINEAR.value(LINEAR.max));
        let above = sum.clone().max_pair(least.clone().expand(sum.dims()));
        // Below the least sum the root goes on along its tangent.
        let below = (sum - above.clone()) / (least.sqrt() * 2.0);
        (above.sqrt() + below).clamp(ROOT.value(ROOT.min), ROOT.value(ROOT.max))
    }

    pub fn light(&self, root: Tensor<4>, averaged: Tensor<4>) -> Tensor<4> {
        let low = (self.offset.clone() * 0.25).sqrt();
        let above = root.clone().max_pair(low.clone().expand(root.dims()));
        let below = (root - above.clone()) * low * 2.0;
        let light = above.clone() * above + below - self.offset.clone() + averaged * self.shot.clone() * 0.25;
        light.clamp(LINEAR.value(LINEAR.min), LINEAR.value(LINEAR.max))
    }
}
