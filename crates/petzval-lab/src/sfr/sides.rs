//! The light of the two sides: their levels, and how the light changes across the region.
//!
//! Light that falls across a chart multiplies both sides alike, and a haze that grows along the edge or across it adds to both. The tail of a blur is
//! the same on both sides but for its sign. It is fitted beside the light, so that no blur is taken for light. A haze across the edge that is
//! straight to the ends of both sides is no tail, which falls off. A haze that bends across the edge cannot be told from blur, and counts as blur.

use super::light::{Light, Pulls};
use super::path::Path;
use super::place::{Place, Sample, TERMS, WAYS};
use super::region::Region;

/// Standard deviations of a normal blur beyond which a side is even, and the least distance, pixels.
const FAR_BLURS: f64 = 6.4;
const LEAST_FAR_PX: f64 = 3.0;

/// Least depth of the even part of a side, pixels, and its least number of pixels.
const LEAST_DEPTH_PX: f64 = 3.0;
const LEAST_PIXELS: usize = 40;

/// Share of the profile, at either end, whose mean is the level of that side.
const LEVEL_SHARE: f64 = 0.2;

/// The least change of the light over the region that is divided out, of the step.
const LEAST_CHANGE: f64 = 0.02;

/// The same of light with a haze across the edge, half of whose change would count as blur.
const LEAST_VEIL: f64 = 0.002;

/// The light at a pixel, of that at the middle of the edge, that is divided out: a side that changes further is not even.
const LIGHT: std::ops::RangeInclusive<f64> = 0.4..=2.5;

/// The light of both sides.
#[derive(Clone, Debug)]
pub struct Sides {
    /// Levels of the dark and the bright side at the middle of the edge.
    pub levels: [f64; 2],
    /// Largest change of the bright side over the region, of its level; none if the light is even.
    pub fall: Option<f64>,
    /// How the light changes.
    light: Light,
    /// How each band of rows pulls the light: the sum of squares is the variance.
    pulls: Pulls,
    place: Place,
}

/// Distance beyond which a side is even, pixels.
pub fn far_px(blur_px: f64) -> f64 {
    (FAR_BLURS * blur_px).max(LEAST_FAR_PX)
}

impl Sides {
    /// The sides of an edge of a given blur, seen up to `half` pixels from it.
    pub fn of(
        region: &Region,
        samples: &[Sample],
        path: &Path,
        blur_px: f64,
        half: usize,
        bands: usize,
    ) -> Self {
        let place = Place::of(region, path);
        let even = Self { levels: [0.0; 2], fall: None, light: Light::default(), pulls: Vec::new(), place };
        let far = far_px(blur_px);
        let beyond: Vec<Sample> = samples.iter().filter(|s| s.distance.abs() > far).copied().collect();
        let count = |sign: f64| beyond.iter().filter(|s| sign * s.distance > 0.0).count();
        let is_known = half as f64 >= far + LEAST_DEPTH_PX && count(1.0).min(count(-1.0)) >= LEAST_PIXELS;
        let found = if is_known { Light::found(&place, &beyond, far, half as f64, bands) } else { None };
        let with_levels = |sides: Self| Self { levels: sides.mean_levels(samples, half as f64), ..sides };
        if let Some((light, pulls)) = found {
            let sides = with_levels(Self { light, pulls, ..even.clone() });
            let change = sides.largest_change(region);
            let is_lit = samples.iter().all(|s| LIGHT.contains(&sides.light_at(s.at)[0]));
            let least = if sides.light.has_veil() { LEAST_VEIL } else { LEAST_CHANGE };
            if is_lit && change >= least * (sides.levels[1] - sides.levels[0]).abs() {
                let fall = Some(change / sides.levels[1].abs().max(1e-300));
                return Self { fall, ..sides };
            }
        }
        with_levels(even)
    }

    /// The light at a place and the haze there.
    fn light_at(&self, at: [f64; 2]) -> [f64; 2] {
        self.light.at(&self.place.terms(at))
    }

    /// Values of the dark and the bright side, continued to a place.
    fn at(&self, at: [f64; 2]) -> [f64; 2] {
        let [light, haze] = self.light_at(at);
        self.levels.map(|level| light * level + haze)
    }

    /// The share of the step at a place, 0 on the dark side, 1 on the bright one; none where the light is far from that at the edge.
    pub fn share(&self, at: [f64; 2], value: f64) -> Option<f64> {
        let [light, haze] = self.light_at(at);
        let step = self.levels[1] - self.levels[0];
        LIGHT.contains(&light).then(|| ((value - haze) / light - self.levels[0]) / step)
    }

    /// By band of rows, how the band pulls the share of the step at a place on the edge's profile.
    pub fn pulls_at(&self, at: [f64; 2], share: f64) -> Vec<f64> {
        let terms = self.place.terms(at);
        let step = self.levels[1] - self.levels[0];
        let value = self.levels[0] + step * share;
        let pull = |by: &[f64; WAYS]| {
            let light: f64 = (0..TERMS).map(|k| by[k] * terms[k]).sum();
            let haze: f64 = (TERMS..WAYS).map(|k| by[k] * terms[k]).sum();
            -(light * value + haze) / step
        };
        self.pulls.iter().map(pull).collect()
    }

    /// Means of the outer fifths of the profile, less the change of the light.
    fn mean_levels(&self, samples: &[Sample], half: f64) -> [f64; 2] {
        let outer = (1.0 - 2.0 * LEVEL_SHARE) * half;
        [-1.0, 1.0].map(|sign| {
            let is_outer = |s: &&Sample| sign * s.distance > outer && sign * s.distance <= half;
            let (sum, count) = samples.iter().filter(is_outer).fold((0.0, 0.0), |(sum, count), s| {
                let [light, haze] = self.light_at(s.at);
                (sum + (s.value - haze) / light, count + 1.0)
            });
            sum / f64::max(count, 1.0)
        })
    }

    /// By band, how the band pulls the mean levels.
    pub fn level_pulls(&self, samples: &[Sample], half: f64, bands: usize) -> [Vec<f64>; 2] {
        let outer = (1.0 - 2.0 * LEVEL_SHARE) * half;
        [-1.0, 1.0].map(|sign| {
            let side = usize::from(sign > 0.0);
            let (mut sums, mut count) = (vec![0.0; bands], 0.0);
            for s in samples.iter().filter(|s| sign * s.distance > outer && sign * s.distance <= half) {
                let [light, haze] = self.light_at(s.at);
                sums[s.band] += (s.value - haze) / light - self.levels[side];
                count += 1.0;
            }
            sums.iter().map(|sum| sum / f64::max(count, 1.0)).collect()
        })
    }

    /// Largest change of a side between the corners and the middle of the region.
    fn largest_change(&self, region: &Region) -> f64 {
        let (w, h) = (region.width as f64, region.height as f64);
        let places = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h], [0.5 * w, 0.5 * h]].map(|at| self.at(at));
        let range = |side: usize| {
            let (low, high) = places
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c[side]), h.max(c[side])));
            high - low
        };
        range(0).max(range(1))
    }
}
