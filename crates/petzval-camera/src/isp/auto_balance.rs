//! Automatic white balance: the gains of red and blue that make gray things gray.

use super::statistics::{Statistics, Zone};

/// How the colour of the light is estimated from the zones of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BalanceMethod {
    /// The mean of all zones is gray (Buchsbaum 1980).
    GrayWorld,
    /// The Minkowski mean `(sum v^p / n)^(1/p)` of the zones is gray (Finlayson and Trezzi, "Shades of gray and colour constancy", CIC
    /// 2004; they recommend p = 6). Then the mean of those zones is gray that the estimate made nearly gray, twice.
    ShadesOfGray {
        /// The power, 1 to 20; 1 is the mean, and a large one the brightest zone.
        p: f64,
    },
}

/// What the balance may do, and which zones count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BalanceOptions {
    /// The method.
    pub method: BalanceMethod,
    /// Least and greatest gain of red and blue.
    pub gains: [f64; 2],
    /// Zones count up to this share of saturated pixels.
    pub most_saturated: f64,
    /// Zones count from this share of the brightest counted zone's green light on.
    pub least_light: f64,
}

impl Default for BalanceOptions {
    fn default() -> Self {
        let method = BalanceMethod::ShadesOfGray { p: 6.0 };
        Self { method, gains: [0.25, 4.0], most_saturated: 0.01, least_light: 0.02 }
    }
}

/// Factors of red and blue beyond those that balance white light: 1 and 1 under the light of the calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BalanceGains {
    /// Of red.
    pub red: f64,
    /// Of blue.
    pub blue: f64,
}

/// Distance of a nearly gray zone: natural logarithms of red and blue over green.
const GRAY_DISTANCE: f64 = 0.2;

/// Estimates the balance of a frame. `response` is that of [`FrameData`](super::FrameData). Without a zone that counts the gains are 1.
pub fn auto_balance(statistics: &Statistics, response: [f64; 3], options: &BalanceOptions) -> BalanceGains {
    // Colours as white light would give them; zones that are saturated, dark or empty say nothing about the light.
    let colour = |zone: &Zone| -> [f64; 3] { std::array::from_fn(|c| zone.mean[c] / response[c]) };
    let kept = statistics.zones.iter().filter(|zone| zone.saturated <= options.most_saturated);
    let exposed: Vec<[f64; 3]> = kept.map(colour).filter(|colour| colour.iter().all(|v| *v > 0.0)).collect();
    let brightest = exposed.iter().map(|c| c[1]).fold(0.0, f64::max);
    let zones: Vec<[f64; 3]> =
        exposed.into_iter().filter(|c| c[1] >= options.least_light * brightest).collect();
    if zones.is_empty() {
        return BalanceGains { red: 1.0, blue: 1.0 };
    }

    let light = match options.method {
        BalanceMethod::GrayWorld => minkowski_mean(&zones, 1.0),
        BalanceMethod::ShadesOfGray { p } => {
            let mut light = minkowski_mean(&zones, p.clamp(1.0, 20.0));
            for _ in 0..2 {
                let log = |zone: &[f64; 3], c: usize| (zone[c] / light[c] * light[1] / zone[1]).ln();
                let is_gray = |zone: &&[f64; 3]| log(zone, 0).hypot(log(zone, 2)) < GRAY_DISTANCE;
                let gray: Vec<[f64; 3]> = zones.iter().filter(is_gray).copied().collect();
                if gray.is_empty() {
                    break;
                }
                light = minkowski_mean(&gray, 1.0);
            }
            light
        }
    };
    let [low, high] = options.gains;
    let gain = |c: usize| (light[1] / light[c]).clamp(low, high);
    BalanceGains { red: gain(0), blue: gain(2) }
}

/// `(sum v^p / n)^(1/p)` of each colour, computed relative to the greatest value.
fn minkowski_mean(zones: &[[f64; 3]], p: f64) -> [f64; 3] {
    std::array::from_fn(|c| {
        let greatest = zones.iter().map(|zone| zone[c]).fold(f64::MIN_POSITIVE, f64::max);
        let sum: f64 = zones.iter().map(|zone| (zone[c] / greatest).powf(p)).sum();
        greatest * (sum / zones.len() as f64).powf(1.0 / p)
    })
}

#[cfg(test)]
mod tests {
    use petzval_base::random::{Stage, Stream, place};

    use super::super::statistics::tests::frame;
    use super::*;

    /// Colour of the light: the gains that undo it are 1 / 1.6 and 1 / 0.6.
    const LIGHT: [f64; 3] = [1.6, 1.0, 0.6];

    fn gains(reflectance: impl Fn(usize, usize, usize) -> f64, options: &BalanceOptions) -> BalanceGains {
        let frame = frame(|row, col, colour| LIGHT[colour] * reflectance(row, col, colour));
        auto_balance(&Statistics::of_frame(&frame).unwrap(), frame.about.response, options)
    }

    fn error(gains: BalanceGains) -> f64 {
        (gains.red * LIGHT[0]).ln().abs().max((gains.blue * LIGHT[2]).ln().abs())
    }

    fn gray_world() -> BalanceOptions {
        BalanceOptions { method: BalanceMethod::GrayWorld, ..BalanceOptions::default() }
    }

    /// Weak colours of each zone, gray on average.
    fn patches(row: usize, col: usize, colour: usize) -> f64 {
        let random =
            |frame: u64| Stream::new(5, frame, Stage::Search).uniforms(place(row / 8, col / 10), 0)[0];
        (0.1 + 0.5 * random(9)) * (0.8 + 0.4 * random(colour as u64))
    }

    #[test]
    fn a_gray_scene_gives_the_colour_of_the_light() {
        for options in [gray_world(), BalanceOptions::default()] {
            let flat = gains(|_, _, _| 0.4, &options);
            assert!(error(flat) < 0.01, "{flat:?}");
            let many = gains(patches, &options);
            assert!(error(many) < 0.04, "{options:?}: {many:?}");
        }
    }

    #[test]
    fn a_meadow_misleads_gray_world_more_than_shades_of_gray() {
        // Two thirds are green; a road and a wall are gray, and brighter.
        let meadow = |row: usize, _: usize, colour: usize| match row / 40 {
            0 => [0.5, 0.5, 0.5][colour],
            _ => [0.12, 0.25, 0.06][colour],
        };
        let [world, shades] =
            [gray_world(), BalanceOptions::default()].map(|options| error(gains(meadow, &options)));
        assert!(world > 0.2, "{world}");
        assert!(shades < 0.02, "{shades}");
    }

    #[test]
    fn saturated_and_dark_zones_do_not_count() {
        // A lamp that saturates, and shadows with a cast.
        let scene = |row: usize, _: usize, colour: usize| match row / 40 {
            0 => 50.0,
            1 => 0.5,
            _ => [0.0004, 0.004, 0.004][colour],
        };
        for options in [gray_world(), BalanceOptions::default()] {
            let found = gains(scene, &options);
            assert!(error(found) < 0.02, "{options:?}: {found:?}");
        }
    }

    #[test]
    fn gains_are_bounded_and_1_without_light() {
        assert_eq!(gains(|_, _, _| 0.0, &BalanceOptions::default()), BalanceGains { red: 1.0, blue: 1.0 });
        assert_eq!(gains(|_, _, _| 90.0, &BalanceOptions::default()), BalanceGains { red: 1.0, blue: 1.0 });
        let red = |_: usize, _: usize, colour: usize| [2.0, 0.1, 0.1][colour];
        let bounded = gains(red, &BalanceOptions { gains: [0.5, 1.2], ..gray_world() });
        assert_eq!(bounded, BalanceGains { red: 0.5, blue: 1.2 });
    }
}
