//! Values so coarse that all pixels of a side have one of them: rounding then bends the profile in place of scattering the pixels.

use super::profile::Profile;

/// Share of the pixels of a side at one value from which its noise is less than a step of the values. Noise of a third of a step leaves 0.87 there.
const LEAST_SHARE: f64 = 0.95;

/// Least step of the values, of the step of the edge, that counts.
const LEAST_STEP: f64 = 0.002;

/// The larger step of the values at the sides that have less noise than it, of the step of the edge; none where it does not count.
pub fn coarse_step(profile: &Profile) -> Option<f64> {
    let steps = [-1.0, 1.0].into_iter().filter_map(|sign| step_without_noise(profile, sign));
    steps.filter(|step| *step >= LEAST_STEP).max_by(f64::total_cmp)
}

/// Difference of the value of a side to the next one, of the step of the edge; none of a side with noise.
fn step_without_noise(profile: &Profile, sign: f64) -> Option<f64> {
    let mut even: Vec<f64> = profile.even_pixels(sign).collect();
    even.sort_by(f64::total_cmp);
    let most = even.chunk_by(|a, b| a == b).max_by_key(|equal| equal.len())?;
    if (most.len() as f64) < LEAST_SHARE * even.len() as f64 {
        return None;
    }
    let differences = profile.values().map(|(_, value)| (value - most[0]).abs()).filter(|d| *d > 0.0);
    differences.min_by(f64::total_cmp).map(|least| least / profile.step())
}
