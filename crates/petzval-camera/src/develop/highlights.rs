//! Highlight clipping: finds the level at which white light first saturates a colour, and clips every colour there.
//!
//! White balance scales each colour and, with it, the level at which the colour saturates. Above the lowest of these levels
//! one colour of a white surface is clipped and the others are not, so the surface is tinted. Raw developers therefore clip
//! every colour at the level of the colour that saturates first: highlights end in neutral white.

use super::dark_mean_dn;
use super::linear_interpolation::sources;
use crate::render::Placement;
use crate::sensor::{Capture, Colour, Raw, SensorError, SensorModel};

/// Exposure (`white_e`, electrons) at which white light saturates the first colour of a picture:
/// `capacity / max_c s_c`, with the photoelectrons that a pixel holds ([`SensorModel::light_capacity_e`]) and the response
/// s_c of each colour to white.
///
/// The result is zero or negative if dark current alone fills the pixels. Fails if the array lacks a colour and has no clear
/// pixels.
pub fn white_capacity_e(sensor: &SensorModel, time_s: f64, linear_gain: f64) -> Result<f64, SensorError> {
    Ok(sensor.light_capacity_e(time_s, linear_gain) / strongest_answer(sensor)?)
}

/// Clips the digital numbers of each colour at the level where white light saturates the first colour. The picture that
/// [`develop`](super::develop) makes of them is then at most `white_capacity_e / white_e`, and neutral at that level:
///
/// ```text
/// dn <- min(dn, dark + (W - dark) s_c / max s)
/// ```
///
/// with the dark mean, the white level W and the response s_c to white. Smaller numbers stay as they are. Clear pixels of an
/// array with all three colours do not enter the picture; they are clipped at W.
pub fn clip_highlights(raw: &Raw, sensor: &SensorModel) -> Result<Raw, SensorError> {
    let levels = clip_levels_dn(sensor, &raw.capture, raw.height, raw.width)?;
    let dn = raw.dn.iter().zip(levels).map(|(dn, level)| dn.min(level)).collect();
    Ok(Raw { height: raw.height, width: raw.width, dn, capture: raw.capture })
}

/// The level at which [`clip_highlights`] cuts each pixel of a frame, DN.
pub(crate) fn clip_levels_dn(
    sensor: &SensorModel,
    capture: &Capture,
    height: usize,
    width: usize,
) -> Result<Vec<f32>, SensorError> {
    sensor.validate()?;
    let exposure = &capture.exposure;
    exposure.validate()?;
    let (white, dark) = (sensor.white_level_dn(exposure.linear_gain.into()), dark_mean_dn(sensor, exposure));
    let strongest = strongest_answer(sensor)?;
    let level = |colour| {
        let answer: f64 = sensor.response(colour).iter().sum();
        (dark + (white - dark) * (answer / strongest).min(1.0)) as f32
    };
    let levels = Colour::ALL.map(level);
    let Placement { row, col } = capture.placement;
    let of = |i: usize| levels[sensor.cfa.colour(row + i / width, col + i % width) as usize];
    // Rows repeat with the array.
    let period = sensor.cfa.rows().min(height);
    let mut all: Vec<f32> = Vec::with_capacity(height * width);
    all.extend((0..period * width).map(of));
    for row in period..height {
        let same = (row - period) * width;
        all.extend_from_within(same..same + width);
    }
    Ok(all)
}

/// Share (0..1) of the pixels that are saturated.
///
/// A pixel is saturated at or above the white level, rounded down. If the full well limits the white level, the read-out
/// noise scatters full pixels about it; the limit is then four standard deviations of that noise lower.
pub fn saturated_share(raw: &Raw, sensor: &SensorModel) -> f64 {
    let gain = f64::from(raw.capture.exposure.linear_gain);
    let level = sensor.white_level_dn(gain);
    let read_out_dn = (sensor.gain_dn_per_e * gain * sensor.read_noise_e).hypot(sensor.electronics_noise_dn);
    let scatter_dn = if level < sensor.max_dn() { 4.0 * read_out_dn } else { 0.0 };
    let white = (level - scatter_dn).floor() as f32;
    let saturated = raw.dn.iter().filter(|dn| **dn >= white).count();
    saturated as f64 / raw.dn.len().max(1) as f64
}

/// The largest response to white among the colours of a picture.
fn strongest_answer(sensor: &SensorModel) -> Result<f64, SensorError> {
    let answers = sources(sensor.cfa)?.map(|colour| sensor.response(colour).iter().sum::<f64>());
    Ok(answers.into_iter().fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::super::develop;
    use super::*;
    use crate::image::{CHANNELS, LinearImage};
    use crate::sensor::{Exposure, Noise, NoiseMode, expose};

    const TILES: [&str; 4] = ["RGGB", "RRGG/RRGG/GGBB/GGBB", "WR/GB", "mono"];

    fn sensor(tile: &str, full_well_e: f64) -> SensorModel {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        let clear_response = [0.6, 0.9, 0.7];
        SensorModel {
            cfa: tile.parse().unwrap(),
            full_well_e,
            clear_response,
            ..toml::from_str::<SensorModel>(text).unwrap()
        }
    }

    fn take(sensor: &SensorModel, light: &LinearImage, white_e: f32, mode: NoiseMode) -> Raw {
        let exposure = Exposure { white_e, time_s: 0.005, linear_gain: 2.0 };
        let capture = Capture { exposure, placement: Placement { row: 1, col: 2 }, frame: 0 };
        expose(light, sensor, &capture, &Noise { mode, seed: 3 }).unwrap()
    }

    /// The greatest difference between the colours of a pixel.
    fn tint(picture: &LinearImage) -> f32 {
        let n = picture.height * picture.width;
        let of = |i: usize| {
            let values = [0, 1, 2].map(|c| picture.data[c * n + i]);
            values.into_iter().fold(f32::MIN, f32::max) - values.into_iter().fold(f32::MAX, f32::min)
        };
        (0..n).map(of).fold(0.0, f32::max)
    }

    #[test]
    fn gray_of_any_brightness_stays_neutral_and_clips_at_the_capacity_for_white() {
        // With the larger well the converter saturates first, with the smaller one the well.
        for (tile, well_e) in TILES.into_iter().flat_map(|t| [(t, 33_723.0), (t, 9000.0)]) {
            let sensor = sensor(tile, well_e);
            let level = white_capacity_e(&sensor, 0.005, 2.0).unwrap() / 16_000.0;
            for brightness in [0.1, 0.3, 0.45, 0.6, 0.8, 1.0, 3.0] {
                let light = LinearImage::filled(CHANNELS, 12, 12, brightness);
                let raw = take(&sensor, &light, 16_000.0, NoiseMode::Off);
                let picture = develop(&clip_highlights(&raw, &sensor).unwrap(), &sensor).unwrap();
                assert!(tint(&picture) < 1e-5, "{tile} {well_e} {brightness}: {}", tint(&picture));
                let expected = f64::from(brightness).min(level);
                assert!((f64::from(picture.data[0]) - expected).abs() < 1e-5, "{tile} {well_e} {brightness}");
            }
        }
    }

    #[test]
    fn overexposed_white_is_tinted_without_clipping_and_neutral_with_it() {
        let sensor = sensor("RGGB", 33_723.0);
        let light: Vec<f32> = (0..CHANNELS * 16 * 16).map(|i| if i % 16 < 8 { 0.05 } else { 2.0 }).collect();
        let light = LinearImage::from_data(CHANNELS, 16, 16, light).unwrap();
        let raw = take(&sensor, &light, 16_000.0, NoiseMode::Off);
        let [tinted, neutral] =
            [raw.clone(), clip_highlights(&raw, &sensor).unwrap()].map(|raw| develop(&raw, &sensor).unwrap());
        let at = |picture: &LinearImage| [0, 1, 2].map(|c| picture.get(c, 8, 14));
        let [red, green, blue] = at(&tinted);
        assert!(red > 1.15 * green && green > 1.2 * blue, "{red} {green} {blue}");
        let [red, green, blue] = at(&neutral);
        assert!((red - green).abs() < 1e-5 && (green - blue).abs() < 1e-5);
    }

    #[test]
    fn numbers_below_the_clipping_level_are_unchanged_and_full_pixels_count_as_saturated() {
        for tile in TILES {
            let sensor = sensor(tile, 33_723.0);
            let light = LinearImage::filled(CHANNELS, 40, 40, 0.5);
            let white_e = white_capacity_e(&sensor, 0.005, 2.0).unwrap() as f32;
            let raw = take(&sensor, &light, white_e, NoiseMode::Exact);
            assert_eq!(clip_highlights(&raw, &sensor).unwrap(), raw, "{tile}");
            assert_eq!(saturated_share(&raw, &sensor), 0.0);
            // Noise scatters full pixels to either side of the white level; the converter's maximum is sharp.
            for full_well_e in [33_723.0, 9000.0] {
                let sensor = SensorModel { full_well_e, ..sensor.clone() };
                let bright = take(&sensor, &light, 8.0 * white_e, NoiseMode::Exact);
                assert!(saturated_share(&bright, &sensor) > 0.999, "{tile} {full_well_e}");
            }
        }
    }
}
