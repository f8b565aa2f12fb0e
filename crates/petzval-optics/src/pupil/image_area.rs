//! Image area around a field: how distortion concentrates or dilutes the light of a uniform scene.

use super::beam::{ChiefRay, chief_ray, pull_back_chief};
use crate::gradient::LensGradient;
use crate::trace::Sequence;

/// Step of the tangent of the field between chief rays whose difference is a slope. Its square is the relative error of the slope
/// where the third-order distortion is 100 % per unit of the tangent; rounding adds 1e-12.
const STEP: f64 = 2e-4;

/// Distortion-free image area divided by the image area on which the lens really puts the light, around a field, relative to the
/// axis.
///
/// With y the height of the chief ray and t the tangent of the field, a ring of the scene has the image area `2 pi y dy` instead of
/// `2 pi (s t) (s dt)`, where `s = dy/dt` on the axis. Hence `ratio = s^2 / ((y / t) (dy / dt))`: the first factor of the
/// denominator is the sagittal, the second the tangential magnification. It multiplies the light per ideal image area
/// (entrance pupil, cos^4) to give the irradiance of the image of a uniform scene.
///
/// The sagittal magnification is that of a lens with rotational symmetry, also where a lens has none.
#[derive(Clone, Debug)]
pub struct ImageArea {
    /// The ratio; 1 on the axis, above 1 for barrel distortion.
    pub ratio: f64,
    /// Chief rays, and the derivative of the logarithm of the ratio by the height of each, 1/mm.
    parts: Vec<(ChiefRay, f64)>,
}

impl ImageArea {
    /// The ratio around a field at the wavelength of `sequence`; `chief` is the chief ray of that field. `None` if a chief ray near
    /// the field or near the axis does not reach the image.
    pub fn new(sequence: &Sequence, field_rad: f64, chief: &ChiefRay) -> Option<Self> {
        let at = |tangent: f64| chief_ray(sequence, tangent.atan());
        let tangent = field_rad.tan();
        // A lens without symmetry need not image the axis to the middle.
        let on_axis = [at(-STEP)?, at(STEP)?];
        let scale = (on_axis[1].y_mm - on_axis[0].y_mm) / (2.0 * STEP);
        let middle = 0.5 * (on_axis[0].y_mm + on_axis[1].y_mm);
        let around = [at(tangent - STEP)?, at(tangent + STEP)?];
        let slope = (around[1].y_mm - around[0].y_mm) / (2.0 * STEP);
        // ln ratio = 2 ln s - ln(dy/dt) - ln((y - middle) / t). On the axis the two magnifications are one.
        let is_axis = tangent.abs() < STEP;
        let (sagittal, by_sagittal) = match is_axis {
            true => (slope, 0.0),
            false => ((chief.y_mm - middle) / tangent, 1.0 / (chief.y_mm - middle)),
        };
        let ratio = scale * scale / (slope * sagittal);
        let weight = if is_axis { 2.0 } else { 1.0 };
        let by_slope = weight / (2.0 * STEP * slope);
        let by_scale = 1.0 / (STEP * scale);
        let [low, high] = around;
        let [below, above] = on_axis;
        let parts = vec![
            (low, by_slope),
            (high, -by_slope),
            (below, -by_scale + 0.5 * by_sagittal),
            (above, by_scale + 0.5 * by_sagittal),
            (chief.clone(), -by_sagittal),
        ];
        (ratio.is_finite() && ratio > 0.0).then_some(Self { ratio, parts })
    }

    /// Adds the gradient of a loss whose derivative by the ratio is `bar`.
    pub fn pull_back(&self, sequence: &Sequence, bar: f64, gradient: &mut LensGradient) {
        for (chief, by_height) in self.parts.iter().filter(|(_, by)| *by != 0.0) {
            pull_back_chief(sequence, chief, [0.0, bar * self.ratio * by_height], gradient);
        }
    }
}
