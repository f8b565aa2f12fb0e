//! Several exposures of one scene merged into one linear frame of up to 24 bits.
//!
//! A pixel of the frame i, whose exposure is `1 / r_i` of the longest, measures the light `s_i = r_i (dn_i - black_i)` in digital numbers of
//! the longest one, with the variance `v_i(s) = r_i K_i s + (r_i sigma_i)^2` of its noise profile. The merged light is
//!
//! ```text
//! s = sum_i w_i s_i / sum_i w_i,    w_i = fade_i / v_i(s0),
//! ```
//!
//! with s0 from the longest exposure that is not near saturation. `fade` goes to 0 from 75 % to 95 % of saturation, so that the change from
//! one exposure to the next leaves no seam, and no weight depends strongly on the noise that it weighs. Where the exposures contradict each
//! other by more than their noise, something moved: all four pixels of the block come from one exposure then.
//!
//! The driver writes the registers of each exposure; every pixel is computed in whole numbers.

#[cfg(test)]
mod tests;

use rayon::prelude::*;

use super::{FrameData, IspError, NoiseProfile, RawInput};

/// Exposures that can be merged.
const FEWEST: usize = 2;
const MOST: usize = 8;

/// Largest ratio of two exposures.
const LARGEST_RATIO: f64 = 65536.0;

/// Shares of saturation at which an exposure begins to fade, and has no weight any more.
const FADE: [f64; 2] = [0.75, 0.95];
/// Weight before fading.
const WHOLE: i64 = 256;

/// Bits of the merged frame at most, and bits that it has below a digital number of the longest exposure where there is room.
const MOST_BITS: u32 = 24;
const BITS_BELOW: u32 = 2;

/// Bits behind the point: of light below a merged digital number, of ratios, of slopes of variances, and of weights.
const LIGHT_BITS: u32 = 4;
const RATIO_BITS: u32 = 16;
const SLOPE_BITS: u32 = 12;
const WEIGHT_BITS: u32 = 12;

/// Two exposures may differ by one part in so many beside their noise: errors of the known ratio and of linearity.
const TOLERATED_PART: i64 = 50;

/// How exposures are merged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergeOptions {
    /// Standard deviations by which two exposures of a resting scene may differ; none leaves moving objects to be mixed.
    pub motion_sigmas: Option<f64>,
}

impl Default for MergeOptions {
    fn default() -> Self {
        Self { motion_sigmas: Some(5.0) }
    }
}

/// Shares of the blocks beyond which contradictions are no moving objects: of the blocks that are brighter than the noise, and of the frame. A wrong
/// exposure contradicts nearly all blocks with light, and objects cover a part of them. A few lamps in the dark may well move together.
const DOUBTFUL_OF_LIT: f64 = 0.5;
const DOUBTFUL_OF_FRAME: f64 = 0.05;

/// A merged frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// The frame.
    pub frame: RawInput,
    /// What was taken as motion; no blocks without the check.
    pub motion: Motion,
}

/// Blocks of 2 x 2 pixels in which the exposures contradict each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Motion {
    /// All blocks of the frame.
    pub blocks: usize,
    /// Those that are brighter than the noise of at least one exposure.
    pub lit: usize,
    /// Those in which the exposures contradict each other.
    pub moved: usize,
}

impl Motion {
    /// Whether so much of the frame is contradicted that the exposures may be wrong.
    pub fn is_doubtful(&self) -> bool {
        let moved = self.moved as f64;
        moved > DOUBTFUL_OF_LIT * self.lit as f64 && moved > DOUBTFUL_OF_FRAME * self.blocks as f64
    }

    fn and(self, other: Self) -> Self {
        Self {
            blocks: self.blocks + other.blocks,
            lit: self.lit + other.lit,
            moved: self.moved + other.moved,
        }
    }
}

/// Merges frames of one scene. `exposures` are the products of time and gain, in any unit.
///
/// The frame keeps black and white of the longest exposure. Its noise profile is that of light which saturates none of the exposures,
/// `1 / shot = sum 1 / shot_i` and `1 / read = sum 1 / read_i`; brighter light is measured by the shorter exposures alone, and is noisier
/// than the profile says.
pub fn merge_exposures(
    frames: &[RawInput],
    exposures: &[f64],
    options: &MergeOptions,
) -> Result<Merged, IspError> {
    check(frames, exposures, options)?;
    // The longest exposure first.
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by(|a, b| exposures[*b].total_cmp(&exposures[*a]));
    let longest = &frames[order[0]];
    let ratio = |i: usize| exposures[order[0]] / exposures[i];

    // As many bits as the light needs that saturates the shortest exposure.
    let highest = order.iter().map(|i| ratio(*i) * full_dn(&frames[*i])).fold(0.0, f64::max);
    let needed = |below: u32| ((highest + longest.about.black_dn) * f64::from(1_u32 << below)).log2().ceil();
    let below = (0..=BITS_BELOW).rev().find(|below| needed(*below) <= f64::from(MOST_BITS));
    let below = below.ok_or_else(|| IspError::Input {
        what: "range of the merged light",
        got: format!("{} bits", needed(0)),
        need: "at most 24 bits",
    })?;
    let bits = (needed(below) as u32).max(longest.bits);
    let unit = f64::from(1_u32 << below);

    let sources =
        order.iter().map(|i| Source::new(&frames[*i], ratio(*i), unit, *i == order[order.len() - 1]));
    let sources: Vec<Source> = sources.collect();
    let motion = options.motion_sigmas.map(|sigmas| (sigmas * sigmas * f64::from(1 << 8)).round() as i64);
    let black = (longest.about.black_dn * unit * f64::from(1 << LIGHT_BITS)).round() as i64;
    let highest_dn = (1_i64 << bits) - 1;
    let width = longest.width;
    let mut dn = vec![0_u32; longest.dn.len()];
    let of_rows = dn.par_chunks_exact_mut(2 * width).enumerate().map(|(pair, out)| {
        let mut found = Motion::default();
        for col in (0..width).step_by(2) {
            let places = [0, 1, width, width + 1].map(|k| k + col);
            let (light, of_block) = merged_block(&sources, places.map(|k| k + 2 * pair * width), motion);
            found = found.and(of_block);
            for (place, light) in places.into_iter().zip(light) {
                let value = (light + black + (1 << (LIGHT_BITS - 1))) >> LIGHT_BITS;
                out[place] = value.clamp(0, highest_dn) as u32;
            }
        }
        found
    });
    let motion = of_rows.reduce(Motion::default, Motion::and);
    let about = merged_data(&order.iter().map(|i| (&frames[*i], ratio(*i))).collect::<Vec<_>>(), unit);
    let frame = RawInput { height: longest.height, width, dn, bits, cfa: longest.cfa, about };
    Ok(Merged { frame, motion })
}

/// The registers of an exposure, and its pixels.
struct Source<'a> {
    frame: &'a RawInput,
    /// Light, in units of `2^-LIGHT_BITS` merged digital numbers, of a digital number; and of the dark; both with [`RATIO_BITS`] more.
    ratio: i64,
    black: i64,
    /// Variance of light s: `(slope s >> SLOPE_BITS) + read`.
    slope: i64,
    read: i64,
    /// Digital numbers between which the weight fades; none for the shortest exposure.
    fade: Option<[i64; 2]>,
    /// Light at which the fading begins.
    fading_light: i64,
}

impl<'a> Source<'a> {
    fn new(frame: &'a RawInput, ratio: f64, unit: f64, is_shortest: bool) -> Self {
        let about = &frame.about;
        let range = about.white_dn - about.black_dn;
        let light_of_dn = ratio * unit * f64::from(1 << LIGHT_BITS);
        let point = |bits: u32| f64::from(1 << bits);
        // Variance of digital numbers: K dn + sigma^2, with K = shot * range and sigma^2 = read * range^2.
        let slope = about.noise.shot * range * light_of_dn;
        let read = about.noise.read * (range * light_of_dn).powi(2);
        let fade = FADE.map(|share| about.black_dn + share * (full_dn(frame) - about.black_dn));
        Self {
            frame,
            ratio: (light_of_dn * point(RATIO_BITS)).round() as i64,
            black: (about.black_dn * light_of_dn * point(RATIO_BITS)).round() as i64,
            slope: (slope * point(SLOPE_BITS)).round() as i64,
            // Rounding to digital numbers is the least noise there is.
            read: read.max(light_of_dn.powi(2) / 12.0).round().max(1.0) as i64,
            fade: (!is_shortest).then(|| fade.map(|dn| dn.round() as i64)),
            fading_light: ((fade[0] - about.black_dn) * light_of_dn) as i64,
        }
    }

    fn dn(&self, place: usize) -> i64 {
        let dn = self.frame.dn[place];
        i64::from(self.frame.about.companding.as_ref().map_or(dn, |c| c.expand(dn)))
    }

    fn light(&self, dn: i64) -> i64 {
        (dn * self.ratio - self.black + (1 << (RATIO_BITS - 1))) >> RATIO_BITS
    }

    /// Weight of a digital number before noise counts, 0 to [`WHOLE`].
    fn fading(&self, dn: i64) -> i64 {
        self.fade.map_or(WHOLE, |[start, end]| ((end - dn) * WHOLE / (end - start).max(1)).clamp(0, WHOLE))
    }

    fn variance(&self, light: i64) -> i64 {
        (self.slope.saturating_mul(light.max(0)) >> SLOPE_BITS) + self.read
    }
}

/// What one exposure says about a pixel.
#[derive(Clone, Copy, Default)]
struct Reading {
    light: i64,
    fading: i64,
    variance: i64,
}

impl Reading {
    /// Whether the light is brighter than its noise by a number of standard deviations. `sigmas` is as that of [`disagree`].
    fn is_lit(&self, sigmas: i64) -> bool {
        self.light > 0 && self.light.saturating_mul(self.light) > self.variance.saturating_mul(sigmas) >> 8
    }
}

/// The light of the four pixels of a block, and its share in the motion of the frame.
fn merged_block(sources: &[Source], places: [usize; 4], motion: Option<i64>) -> ([i64; 4], Motion) {
    let mut readings = [[Reading::default(); MOST]; 4];
    let (mut is_lit, mut has_moved) = (false, false);
    for (place, readings) in places.into_iter().zip(&mut readings) {
        for (source, reading) in sources.iter().zip(readings.iter_mut()) {
            let dn = source.dn(place);
            (reading.light, reading.fading) = (source.light(dn), source.fading(dn));
        }
        // Take the noise of all exposures at the light of the longest that does not fade.
        let readings = &mut readings[..sources.len()];
        let best = readings.iter().position(|r| r.fading == WHOLE).unwrap_or(sources.len() - 1);
        let light = readings[best].light;
        for (source, reading) in sources.iter().zip(readings.iter_mut()) {
            reading.variance = source.variance(light);
        }
        has_moved |= motion.is_some_and(|sigmas| disagree(readings, best, sigmas));
        is_lit |= motion.is_some_and(|sigmas| readings.iter().any(|reading| reading.is_lit(sigmas)));
    }
    let found = Motion {
        blocks: usize::from(motion.is_some()),
        lit: usize::from(is_lit || has_moved),
        moved: usize::from(has_moved),
    };
    if has_moved {
        let single = single_exposure(sources, &readings);
        return (readings.map(|readings| readings[single].light), found);
    }
    (readings.map(|readings| weighted(&readings[..sources.len()])), found)
}

/// The mean of the exposures by their weights.
fn weighted(readings: &[Reading]) -> i64 {
    let least = readings.iter().filter(|r| r.fading > 0).map(|r| r.variance).min().unwrap_or(1);
    let (mut sum, mut weights) = (0, 0);
    for reading in readings {
        let weight = (least << WEIGHT_BITS) / reading.variance * reading.fading;
        sum += weight * reading.light;
        weights += weight;
    }
    (sum + weights / 2).div_euclid(weights.max(1))
}

/// True if an exposure differs from the one numbered `best` by more than a number of standard deviations. `sigmas` is the square of that
/// number, with 8 fractional bits. An exposure without weight is saturated: its light is a lower bound.
fn disagree(readings: &[Reading], best: usize, sigmas: i64) -> bool {
    let of = readings[best];
    readings.iter().enumerate().filter(|(i, _)| *i != best).any(|(_, other)| {
        let apart = other.light - of.light;
        let apart = if other.fading == 0 { apart } else { apart.abs() };
        let beyond = apart - of.light.max(0) / TOLERATED_PART;
        let limit = (other.variance + of.variance).saturating_mul(sigmas) >> 8;
        beyond > 0 && beyond.saturating_mul(beyond) > limit
    })
}

/// Chooses the longest exposure that is not saturated anywhere in the block. It counts as saturated if the light of any reading exceeds its
/// `fading_light` by more than three standard deviations. If an object moved, the place it left and the place it reached get the same
/// exposure.
fn single_exposure(sources: &[Source], readings: &[[Reading; MOST]; 4]) -> usize {
    let says_saturated = |source: &Source| {
        readings.iter().flat_map(|of_pixel| &of_pixel[..sources.len()]).any(|reading| {
            let above = reading.light - source.fading_light;
            above > 0 && above.saturating_mul(above) > reading.variance.saturating_mul(9)
        })
    };
    sources.iter().position(|source| !says_saturated(source)).unwrap_or(sources.len() - 1)
}

/// The digital number, linear in light, at which a pixel saturates.
fn full_dn(frame: &RawInput) -> f64 {
    let about = &frame.about;
    let response = about.response.iter().copied().fold(0.0, f64::max);
    let by_light = about.black_dn + about.saturation * response * (about.white_dn - about.black_dn);
    let last = (1_u32 << frame.bits) - 1;
    let last = about.companding.as_ref().map_or(last, |c| c.expand(last));
    by_light.min(f64::from(last))
}

/// What is known of the merged frame, from the frames, the longest exposure first, with their ratios.
fn merged_data(frames: &[(&RawInput, f64)], unit: f64) -> FrameData {
    let longest = &frames[0].0.about;
    let range = longest.white_dn - longest.black_dn;
    let (mut shot, mut read) = (0.0, 0.0);
    for (frame, ratio) in frames {
        // Variances of light, in whites of the longest exposure.
        let of = &frame.about;
        let scale = ratio * (of.white_dn - of.black_dn) / range;
        shot += 1.0 / (of.noise.shot * scale).max(f64::MIN_POSITIVE);
        read += 1.0 / (of.noise.read * scale * scale).max(f64::MIN_POSITIVE);
    }
    let shortest = frames[frames.len() - 1];
    let saturated = shortest.1 * (full_dn(shortest.0) - shortest.0.about.black_dn) / range;
    let response = longest.response.iter().copied().fold(0.0, f64::max);
    let black_dn = longest.black_dn * unit;
    FrameData {
        black_dn,
        white_dn: black_dn + range * unit,
        saturation: saturated / response,
        noise: NoiseProfile { shot: 1.0 / shot, read: 1.0 / read },
        companding: None,
        ..longest.clone()
    }
}

fn check(frames: &[RawInput], exposures: &[f64], options: &MergeOptions) -> Result<(), IspError> {
    let bad = |what: &'static str, got: String, need: &'static str| Err(IspError::Input { what, got, need });
    if !(FEWEST..=MOST).contains(&frames.len()) {
        return bad("number of exposures", frames.len().to_string(), "2 to 8");
    }
    if exposures.len() != frames.len() {
        return bad("number of exposures", exposures.len().to_string(), "one for each frame");
    }
    let (least, most) =
        exposures.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), e| (least.min(*e), most.max(*e)));
    if !exposures.iter().all(|e| e.is_finite() && *e > 0.0) || most / least > LARGEST_RATIO {
        let need = "positive, the longest at most 65536 times the shortest";
        return bad("exposures", format!("{exposures:?}"), need);
    }
    if let Some(sigmas) = options.motion_sigmas.filter(|sigmas| !(1.0..=100.0).contains(sigmas)) {
        return bad("limit of the motion check", sigmas.to_string(), "1 to 100 standard deviations");
    }
    for frame in frames {
        frame.validate()?;
        let first = &frames[0];
        if (frame.height, frame.width, frame.cfa) != (first.height, first.width, first.cfa) {
            let got = format!("{} x {} {}", frame.width, frame.height, frame.cfa);
            return bad("an exposure", got, "of the same size and array as the others");
        }
    }
    Ok(())
}
