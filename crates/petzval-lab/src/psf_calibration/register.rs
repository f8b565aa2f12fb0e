//! Finds the centre of a fitted PSF on the pixels of a position, and scores how well the PSF explains them.

use super::ascent::{Datum, landing, pixels};
use super::landing::Landing;
use super::place::Place;
use petzval_camera::image::CHANNELS;

/// Step of the differences behind a registration, px.
const STEP_PX: f64 = 0.02;

/// Largest move of a position in one registration, px.
const MOST_PX: f64 = 0.3;

/// Number of registrations of a held-out position.
const MOVES: usize = 8;

/// Residuals of pixels, given the cells.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Score {
    /// Sum of squared residuals over variances.
    square: f64,
    /// Pixels.
    pixels: f64,
    /// Sum of absolute residuals, electrons/s.
    off: f64,
    /// The same for noise alone, electrons/s.
    noise: f64,
    /// Light on the pixels, electrons/s.
    light: f64,
}

impl Score {
    /// Mean squared residual over the variance.
    pub fn chi2(&self) -> f64 {
        self.square / self.pixels
    }

    /// Sum of absolute residuals over the light on the same pixels.
    pub fn l1(&self) -> f64 {
        self.off / self.light
    }

    /// [`Score::l1`] for noise alone: `sqrt(2/pi)` of the standard deviations.
    pub fn noise_l1(&self) -> f64 {
        self.noise / self.light
    }

    /// The sum of two scores.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            square: self.square + other.square,
            pixels: self.pixels + other.pixels,
            off: self.off + other.off,
            noise: self.noise + other.noise,
            light: self.light + other.light,
        }
    }

    /// Of pixels on which `landed` electrons/s are expected, up to their common light if that is free.
    pub(super) fn of(data: &[Datum], landed: &[f64], is_light_free: bool) -> Self {
        let light = if is_light_free { light_factor(data, landed) } else { 1.0 };
        let mut score = Self::default();
        for d in data {
            let residual = d.value - light * d.time_s * landed[d.pixel];
            score = score.and(Self {
                square: residual * residual / d.variance,
                pixels: 1.0,
                off: residual.abs() / d.time_s,
                noise: (std::f64::consts::FRAC_2_PI * d.variance).sqrt() / d.time_s,
                light: d.value / d.time_s,
            });
        }
        score
    }
}

/// The factor on `landed` that explains the pixels best.
fn light_factor(data: &[Datum], landed: &[f64]) -> f64 {
    let (mut top, mut bottom) = (0.0, 0.0);
    for d in data {
        let expected = d.time_s * landed[d.pixel];
        top += expected * d.value / d.variance;
        bottom += expected * expected / d.variance;
    }
    if bottom > 0.0 { top / bottom } else { 1.0 }
}

/// Distance of a position's centre from the best fit of the cells to its pixels, (row, column), px: one Gauss-Newton
/// step over all colours, the light of each free.
pub(super) fn misplaced(
    place: &Place,
    middle: [f64; 2],
    cells: [&[f64]; CHANNELS],
    pixel_um: f64,
) -> [f64; 2] {
    let at = |row: f64, col: f64| landing(place, [middle[0] + row, middle[1] + col], pixel_um);
    let landings: [Landing; 3] = [at(0.0, 0.0), at(STEP_PX, 0.0), at(0.0, STEP_PX)];
    let (mut normal, mut right) = ([0.0; 3], [0.0; 2]);
    for (channel, cells) in cells.into_iter().enumerate() {
        let landed = [0, 1, 2].map(|k| landings[k].land(cells));
        let data = pixels(place, channel);
        let light = light_factor(&data, &landed[0]);
        for d in data {
            let expected = light * d.time_s * landed[0][d.pixel];
            let by = [1, 2].map(|k| light * d.time_s * (landed[k][d.pixel] - landed[0][d.pixel]) / STEP_PX);
            // Before the fit has converged, use the variance of the expected light.
            let weight = 1.0 / (d.variance + 1e-4 * expected * expected);
            let residual = d.value - expected;
            normal = [
                normal[0] + weight * by[0] * by[0],
                normal[1] + weight * by[0] * by[1],
                normal[2] + weight * by[1] * by[1],
            ];
            right = [right[0] + weight * by[0] * residual, right[1] + weight * by[1] * residual];
        }
    }
    let determinant = normal[0] * normal[2] - normal[1] * normal[1];
    let step = [
        (normal[2] * right[0] - normal[1] * right[1]) / determinant,
        (normal[0] * right[1] - normal[1] * right[0]) / determinant,
    ];
    step.map(|s| if s.is_finite() { s.clamp(-MOST_PX, MOST_PX) } else { 0.0 })
}

/// Scores the fitted cells on a held-out position. The brightness of each colour is fitted, so the cells may have any unit of light. The
/// centre (row, column) is fitted from `start` and returned.
pub fn explain(
    place: &Place,
    start: [f64; 2],
    cells: [&[f64]; CHANNELS],
    pixel_um: f64,
) -> ([f64; 2], [Score; CHANNELS]) {
    let mut middle = start;
    for _ in 0..MOVES {
        let by = misplaced(place, middle, cells, pixel_um);
        middle = [middle[0] + by[0], middle[1] + by[1]];
    }
    let landing = landing(place, middle, pixel_um);
    (middle, std::array::from_fn(|c| Score::of(&pixels(place, c), &landing.land(cells[c]), true)))
}
