//! Image area around a field: how distortion concentrates or dilutes the light of a uniform scene.

use super::beam::{ChiefRay, chief_ray, pull_back_chief};
use super::launch::LEAST_COSINE;
use crate::gradient::LensGradient;
use crate::trace::Sequence;

/// Step of the field between chief rays whose difference is a slope, rad. The relative error of a central difference is
/// `step^2 / 6` times the ratio of the third derivative to the first: 1e-8 where that is 1; rounding adds 1e-12.
const STEP_RAD: f64 = 2e-4;

/// Distortion-free image area divided by the image area on which the lens really puts the light, around a field, relative to the
/// axis.
///
/// The cone of directions between the fields a and a + da has the solid angle `2 pi sin a da`. It has the area `2 pi (s tan a)
/// (s da / cos^2 a)` in an image without distortion and `2 pi y dy` in that of the lens, where y is the height of the chief ray and
/// `s = dy/da` on the axis. Hence `ratio = s^2 (sin a / y) / (cos^3 a  dy/da)`. It multiplies the light per distortion-free image
/// area (entrance pupil, cos^4) to give the irradiance of the image of a uniform scene. From 89 degrees on, where that light is counted
/// with the cosine of 89 degrees, so is the ratio: their product stays right.
///
/// `sin a / y` is the sagittal part. It is that of a lens with rotational symmetry, also where a lens has none. The image may lie in any direction
/// from the axis, as behind a prism or in turned axes: slopes and heights are lengths of vectors in the image.
#[derive(Clone, Debug)]
pub struct ImageArea {
    /// The ratio; 1 on the axis, above 1 for barrel distortion.
    pub ratio: f64,
    /// Chief rays, and the derivatives of the logarithm of the ratio by the place `[x, y]` of each, 1/mm.
    parts: Vec<(ChiefRay, [f64; 2])>,
}

/// A vector in the image by its length and its direction.
struct Arrow {
    length: f64,
    direction: [f64; 2],
}

impl Arrow {
    /// The vector between two points, divided by a positive number.
    fn between(from: [f64; 2], to: [f64; 2], divisor: f64) -> Self {
        let [x, y] = [(to[0] - from[0]) / divisor, (to[1] - from[1]) / divisor];
        let length = x.hypot(y);
        Self { length, direction: [x / length, y / length] }
    }

    /// The derivatives of the logarithm of its length by its end, times a factor.
    fn by_end(&self, factor: f64) -> [f64; 2] {
        self.direction.map(|along| along * factor)
    }
}

impl ImageArea {
    /// The ratio around a field at the wavelength of `sequence`; `chief` is the chief ray of that field. `None` if a chief ray near
    /// the field or near the axis does not reach the image.
    pub fn new(sequence: &Sequence, field_rad: f64, chief: &ChiefRay) -> Option<Self> {
        let at = |field: f64| chief_ray(sequence, field);
        let place = |chief: &ChiefRay| [chief.x_mm, chief.y_mm];
        // A lens without symmetry need not image the axis to the middle.
        let [below, above] = [at(-STEP_RAD)?, at(STEP_RAD)?];
        let scale = Arrow::between(place(&below), place(&above), 2.0 * STEP_RAD);
        let middle = [0.5 * (above.x_mm + below.x_mm), 0.5 * (above.y_mm + below.y_mm)];
        let [low, high] = [at(field_rad - STEP_RAD)?, at(field_rad + STEP_RAD)?];
        let slope = Arrow::between(place(&low), place(&high), 2.0 * STEP_RAD);
        // ln ratio = 2 ln s + ln(sin a) - ln(y - middle) - 3 ln(cos a) - ln(dy/da). On the axis y / sin a is dy/da.
        let is_axis = field_rad.abs() < STEP_RAD;
        let (sagittal, by_height) = if is_axis {
            (slope.length, [0.0; 2])
        } else {
            let height = Arrow::between(middle, place(chief), 1.0);
            (height.length / field_rad.sin(), height.by_end(1.0 / height.length))
        };
        let cosine = field_rad.cos().max(LEAST_COSINE);
        // Areas are positive, also where the image folds back.
        let ratio = scale.length * scale.length / (cosine.powi(3) * slope.length * sagittal).abs();
        let by_slope = slope.by_end(if is_axis { 2.0 } else { 1.0 } / (2.0 * STEP_RAD * slope.length));
        let by_scale = scale.by_end(1.0 / (STEP_RAD * scale.length));
        let both = |sign: f64| [0, 1].map(|axis| sign * by_scale[axis] + 0.5 * by_height[axis]);
        let parts = vec![
            (low, by_slope),
            (high, by_slope.map(|by| -by)),
            (below, both(-1.0)),
            (above, both(1.0)),
            (chief.clone(), by_height.map(|by| -by)),
        ];
        (ratio.is_finite() && ratio > 0.0).then_some(Self { ratio, parts })
    }

    /// Adds the gradient of a loss whose derivative by the ratio is `bar`.
    pub fn pull_back(&self, sequence: &Sequence, bar: f64, gradient: &mut LensGradient) {
        for (chief, by_place) in self.parts.iter().filter(|(_, by)| *by != [0.0; 2]) {
            pull_back_chief(sequence, chief, by_place.map(|by| bar * self.ratio * by), gradient);
        }
    }
}
