//! Automatic exposure: by how many stops a finished frame is amplified.

use super::statistics::{Statistics, Zone};

/// What the exposure aims at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureOptions {
    /// Geometric mean of the zones' luminance, 1 = white; 0.18 is a gray card.
    pub middle: f64,
    /// Share of the pixels of a colour that may saturate, 0..1.
    pub highlights: f64,
}

impl Default for ExposureOptions {
    fn default() -> Self {
        Self { middle: 0.18, highlights: 0.005 }
    }
}

/// Luminance that the logarithm of black counts as.
const LEAST_LUMINANCE: f64 = 1e-5;

/// Share of the range that highlights may reach.
const HIGHLIGHT_LEVEL: f64 = 0.95;

/// Stops by which a finished frame is amplified, in one step.
///
/// `ev = log2(middle / exp(mean ln Y))` over the zones, with the luminance `Y = 0.2126 R + 0.7152 G + 0.0722 B` of colours over the
/// `response` to white, but at most what leaves all but the given share of highlights below the end of the range.
/// `response` is that of the balance by which the frame is developed. Highlights are those of balanced colours, which end where the first
/// colour saturates.
pub fn finished_exposure_ev(statistics: &Statistics, response: [f64; 3], options: &ExposureOptions) -> f64 {
    let strongest = response.into_iter().fold(f64::MIN_POSITIVE, f64::max);
    let balanced = |c: usize| statistics.quantile(c, options.highlights) / response[c];
    let brightest = (0..3).map(balanced).fold(0.0, f64::max).min(statistics.full / strongest);
    middle_ev(statistics, response, options.middle).min(highlight_ev(statistics, brightest))
}

/// Stops that bring the geometric mean of the zones' luminance to `middle`.
fn middle_ev(statistics: &Statistics, response: [f64; 3], middle: f64) -> f64 {
    let luminance = |zone: &Zone| {
        let weights = [0.2126, 0.7152, 0.0722];
        (0..3).map(|c| weights[c] * zone.mean[c] / response[c]).sum::<f64>().max(LEAST_LUMINANCE)
    };
    let logs: f64 = statistics.zones.iter().map(|zone| luminance(zone).ln()).sum();
    let mean = (logs / statistics.zones.len().max(1) as f64).exp();
    (middle / mean).log2()
}

/// Stops that bring light to the level of highlights below the end of the range.
fn highlight_ev(statistics: &Statistics, light: f64) -> f64 {
    (HIGHLIGHT_LEVEL * statistics.full / light.max(f64::MIN_POSITIVE)).log2()
}

#[cfg(test)]
mod tests {
    use super::super::statistics::tests::frame;
    use super::*;

    fn finished_ev(response: [f64; 3], light: impl Fn(usize, usize, usize) -> f64) -> f64 {
        let statistics = Statistics::of_frame(&frame(light)).unwrap();
        finished_exposure_ev(&statistics, response, &ExposureOptions::default())
    }

    #[test]
    fn a_finished_frame_comes_to_the_middle_in_one_step() {
        for stops in [-4.0_f64, -3.5, -1.0, 0.0, 2.0] {
            let change = finished_ev([0.5, 1.0, 0.7], |_, _, _| 0.18 * stops.exp2());
            assert!((change + stops).abs() < 0.02, "{stops}: {change}");
        }
    }

    #[test]
    fn half_the_zones_above_and_half_below_meet_at_the_middle_of_their_logarithms() {
        // The seventh of fifteen columns of zones is dark.
        let change = finished_ev([0.5, 1.0, 0.7], |_, col, _| if col < 80 { 0.045 } else { 0.72 });
        assert!((change - 4.0 * (8.0 / 15.0 - 0.5)).abs() < 0.02, "{change}");
    }

    #[test]
    fn a_lamp_of_a_few_pixels_does_not_hold_the_exposure_back() {
        let change = finished_ev([0.5, 1.0, 0.7], |row, col, _| if row < 4 && col < 6 { 50.0 } else { 0.09 });
        assert!(change > 0.9, "{change}");
    }

    #[test]
    fn highlights_of_a_finished_frame_are_those_of_balanced_colours() {
        // A red window. The stronger red pixels answer to white, the less red light there is.
        let red = |row: usize, col: usize, c: usize| match (row < 24 && col < 20, c) {
            (true, 0) => 2.0,
            (true, _) => 0.5,
            _ => 0.01,
        };
        for (response, brightest) in [([0.5, 1.0, 0.7], 2.0), ([1.0, 1.0, 0.7], 1.0)] {
            let change = finished_ev(response, red);
            let wanted = (0.95_f64 * 3.995 / brightest).log2();
            assert!((change - wanted).abs() < 0.01, "{response:?}: {change} {wanted}");
        }
        // Pixels that are saturated end at one level, which goes to the end of the range: no step back hides it.
        let window = |row: usize, col: usize, _: usize| if row < 24 && col < 20 { 50.0 } else { 0.01 };
        assert!((finished_ev([0.5, 1.0, 0.7], window) - 0.95_f64.log2()).abs() < 1e-9);
        assert!((finished_ev([2.0, 1.0, 0.7], window) - 1.9_f64.log2()).abs() < 1e-9);
    }
}
