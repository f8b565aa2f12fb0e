use super::*;
use crate::sensor::{CfaPattern, Noise, NoiseMode, expose};

fn sensor() -> SensorModel {
    toml::from_str::<SensorModel>(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml"))
        .unwrap()
}

fn capture(row: usize, col: usize) -> Capture {
    let exposure = Exposure { white_e: 15000.0, time_s: 0.01, linear_gain: 1.5 };
    Capture { exposure, placement: Placement { row, col }, frame: 0 }
}

fn uniform(seed: u64, n: usize) -> Vec<f32> {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random::<f32>()).collect()
}

#[test]
fn bilinear_demosaic_matches_colour_demosaicing() {
    // colour_demosaicing 0.2.7, demosaicing_CFA_Bayer_bilinear; its borders follow another rule, so one pixel is left out.
    let text = include_str!("../../tests/fixtures/demosaic_bilinear.json");
    let fixture: serde_json::Value = serde_json::from_str(text).unwrap();
    for (name, cfa) in [("RGGB", CfaPattern::RGGB), ("GBRG", CfaPattern::GBRG)] {
        let (mosaic, expected) = (&fixture[name]["mosaic"], &fixture[name]["bilinear"]);
        let number = |v: &serde_json::Value| v.as_f64().unwrap() as f32;
        let (height, width) = (12, 14);
        let values: Vec<f32> = (0..height * width).map(|i| number(&mosaic[i / width][i % width])).collect();
        let rgb = demosaic_bilinear(&values, height, width, cfa, Placement::default()).unwrap();
        for r in 1..height - 1 {
            for c in 1..width - 1 {
                for channel in 0..CHANNELS {
                    let difference = rgb.get(channel, r, c) - number(&expected[r][c][channel]);
                    assert!(difference.abs() < 1e-6, "{name} ({channel}, {r}, {c}): {difference}");
                }
            }
        }
    }
}

#[test]
fn development_recovers_a_gray_scene_at_any_phase_of_the_mosaic() {
    let light = LinearImage::filled(CHANNELS, 7, 9, 0.37);
    for (row, col) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let noise = Noise { mode: NoiseMode::Off, seed: 0 };
        let raw = expose(&light, &sensor(), &capture(row, col), &noise).unwrap();
        let rgb = develop(&raw, &sensor()).unwrap();
        assert!(rgb.data.iter().all(|v| (v - 0.37).abs() < 1e-6));
    }
}

const TILES: [&str; 8] = [
    "mono",
    "RRGG/RRGG/GGBB/GGBB",
    "GBGGRG/RGRBGB/GBGGRG/GRGGBG/BGBRGR/GRGGBG",
    "WR/GB",
    "RGB",
    "WWRG/WWGB",
    "RW/WB",
    "WR/GW",
];

fn with_tile(tile: &str) -> SensorModel {
    SensorModel { cfa: tile.parse().unwrap(), clear_response: [0.4, 0.9, 0.5], ..sensor() }
}

#[test]
fn development_recovers_a_gray_scene_from_any_array() {
    let light = LinearImage::filled(CHANNELS, 9, 11, 0.37);
    for tile in TILES {
        let sensor = with_tile(tile);
        for place in 0..36 {
            let noise = Noise { mode: NoiseMode::Off, seed: 0 };
            let raw = expose(&light, &sensor, &capture(place / 6, place % 6), &noise).unwrap();
            let rgb = develop(&raw, &sensor).unwrap();
            assert!(rgb.data.iter().all(|v| (v - 0.37).abs() < 1e-6), "{tile}, {place}");
        }
    }
}

#[test]
fn pixels_keep_the_colour_they_measured_and_mono_gives_three_equal_planes() {
    let mosaic = uniform(4, 9 * 11);
    for tile in TILES {
        let (cfa, origin): (CfaPattern, _) = (tile.parse().unwrap(), Placement { row: 2, col: 5 });
        let rgb = demosaic_bilinear(&mosaic, 9, 11, cfa, origin).unwrap();
        for (i, value) in mosaic.iter().enumerate() {
            if let Some(plane) = cfa.colour(2 + i / 11, 5 + i % 11).plane() {
                assert_eq!(rgb.plane(plane)[i], *value, "{tile}");
            }
        }
    }
    let rgb = demosaic_bilinear(&mosaic, 9, 11, CfaPattern::MONO, Placement::default()).unwrap();
    assert!((0..CHANNELS).all(|c| rgb.plane(c) == mosaic));
}

#[test]
fn interpolation_of_a_bayer_tile_equals_bilinear_demosaicing() {
    let (height, width, mosaic) = (10, 12, uniform(6, 120));
    for (cfa, origin) in
        [(CfaPattern::RGGB, Placement { row: 0, col: 0 }), (CfaPattern::GBRG, Placement { row: 1, col: 4 })]
    {
        let interpolation =
            linear_interpolation::LinearInterpolation::new(cfa, origin, height, width).unwrap();
        let filled = interpolation.fill(&mosaic, height, width);
        let bilinear = demosaic_bilinear(&mosaic, height, width, cfa, origin).unwrap();
        for r in 1..height - 1 {
            for c in 1..width - 1 {
                for channel in 0..CHANNELS {
                    assert!((filled.get(channel, r, c) - bilinear.get(channel, r, c)).abs() < 1e-6);
                }
            }
        }
    }
}

#[test]
fn demosaicing_reproduces_a_linear_ramp_from_any_array() {
    let (height, width) = (24, 26);
    for tile in TILES {
        let cfa: CfaPattern = tile.parse().unwrap();
        let slopes = [(0.02, 0.03), (-0.01, 0.02), (0.03, -0.01)];
        // Clear pixels see the ramp of the first plane; so do the planes whose colour comes from clear pixels.
        let of = |c: usize| {
            if cfa.colours().contains(&[Colour::Red, Colour::Green, Colour::Blue][c]) { c } else { 0 }
        };
        let value = |c: usize, r: usize, col: usize| slopes[c].0 * r as f32 + slopes[c].1 * col as f32;
        for (row, col) in [(0, 0), (1, 3), (5, 2)] {
            let origin = Placement { row, col };
            let seen = |i: usize| {
                let (r, c) = (i / width, i % width);
                value(cfa.colour(row + r, col + c).plane().map_or(0, of), r, c)
            };
            let mosaic: Vec<f32> = (0..height * width).map(seen).collect();
            let rgb = demosaic_bilinear(&mosaic, height, width, cfa, origin).unwrap();
            // Away from the border, where there are pixels on both sides.
            for (r, c) in (6..height - 6).flat_map(|r| (6..width - 6).map(move |c| (r, c))) {
                for channel in 0..CHANNELS {
                    let error = rgb.get(channel, r, c) - value(of(channel), r, c);
                    assert!(error.abs() < 1e-5, "{tile} ({channel}, {r}, {c}): {error}");
                }
            }
        }
    }
}

#[test]
fn an_edge_through_a_binned_array_is_no_wider_than_the_gap_between_its_pixels() {
    const GAP: usize = 3;
    let (height, width) = (24, 24);
    let cfa: CfaPattern = "RRGG/RRGG/GGBB/GGBB".parse().unwrap();
    for edge in 10..14 {
        let mosaic: Vec<f32> =
            (0..height * width).map(|i| if i % width < edge { 0.0 } else { 1.0 }).collect();
        let rgb = demosaic_bilinear(&mosaic, height, width, cfa, Placement::default()).unwrap();
        for (channel, r, c) in (0..CHANNELS * 16 * 16).map(|i| (i / 256, 4 + i / 16 % 16, 4 + i % 16)) {
            let value = rgb.get(channel, r, c);
            let known = if c + GAP <= edge { Some(0.0) } else { (c + 1 >= edge + GAP).then_some(1.0) };
            assert!(
                known.is_none_or(|known| (value - known).abs() < 1e-6),
                "{edge}: {channel} {r} {c} {value}"
            );
            // Red and blue lie on a grid of rows and columns, so all rows of a vertical edge are equal.
            assert!(
                channel == 1 || (value - rgb.get(channel, 4, c)).abs() < 1e-6,
                "{edge}: {channel} {r} {c}"
            );
        }
    }
}

#[test]
fn an_array_that_lacks_a_colour_is_an_error() {
    let develop_with = |tile: &str, height, width| {
        let sensor = with_tile(tile);
        let raw = Raw { height, width, dn: vec![200.0; height * width], capture: capture(0, 0) };
        develop(&raw, &sensor)
    };
    assert!(matches!(develop_with("RG/GR", 6, 6), Err(SensorError::UnseenColour { colour: "blue", .. })));
    assert!(matches!(develop_with("RRGG/RRGG/GGBB/GGBB", 3, 9), Err(SensorError::Shape { .. })));
    assert!(develop_with("RRGG/RRGG/GGBB/GGBB", 4, 9).is_ok());
}

#[test]
fn noisy_development_is_unbiased() {
    let light = LinearImage::filled(CHANNELS, 400, 400, 0.02);
    let raw = expose(&light, &sensor(), &capture(3, 5), &Noise { mode: NoiseMode::Exact, seed: 4 }).unwrap();
    let rgb = develop(&raw, &sensor()).unwrap();
    for c in 0..CHANNELS {
        let n = rgb.plane(c).len() as f64;
        let mean = rgb.plane(c).iter().map(|&v| v as f64).sum::<f64>() / n;
        // At least 40000 independent pixels of standard deviation below 0.0015.
        assert!((mean - 0.02).abs() < 4.0 * 0.0015 / 200.0, "{mean}");
    }
}

#[test]
fn development_adjoint_passes_the_dot_product_test() {
    let (height, width) = (9, 12);
    let places = [(0, 0), (0, 1), (1, 0), (1, 1), (3, 5)];
    for (tile, (row, col)) in TILES.into_iter().chain(["RGGB"]).flat_map(|t| places.map(|p| (t, p))) {
        let (sensor, capture) = (&with_tile(tile), capture(row, col));
        let linear = |dn: Vec<f32>| develop(&Raw { height, width, dn, capture }, sensor).unwrap();
        let (a, b) = (uniform(1, height * width), uniform(2, height * width));
        // The offset cancels in a difference.
        let sum: Vec<f32> = a.iter().zip(&b).map(|(x, y)| 1000.0 + 100.0 * (x - y)).collect();
        let (high, low) = (linear(sum.clone()), linear(vec![1000.0; height * width]));
        let y =
            LinearImage::from_data(CHANNELS, height, width, uniform(3, CHANNELS * height * width)).unwrap();
        let forward: f64 =
            (0..y.data.len()).map(|i| y.data[i] as f64 * (high.data[i] as f64 - low.data[i] as f64)).sum();
        let back = develop_adjoint(&y, sensor, &capture).unwrap();
        let backward: f64 = back.iter().zip(&sum).map(|(g, s)| *g as f64 * (*s as f64 - 1000.0)).sum();
        let size: f64 = back.iter().zip(&sum).map(|(g, s)| (*g as f64 * (*s as f64 - 1000.0)).abs()).sum();
        assert!((forward - backward).abs() < 1e-5 * size, "{forward} {backward}");
    }
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    for tile in ["RGGB", "RRGG/RRGG/GGBB/GGBB"] {
        let (sensor, capture) = (with_tile(tile), capture(1, 0));
        let raw =
            Raw { height: 40, width: 50, dn: uniform(5, 2000).iter().map(|v| v * 4000.0).collect(), capture };
        let run = |threads: usize| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let rgb = develop(&raw, &sensor).unwrap();
                (develop_adjoint(&rgb, &sensor, &capture).unwrap(), rgb)
            })
        };
        assert!(run(1) == run(2));
    }
}

#[test]
fn shading_correction_divides_down_to_the_floor() {
    let image = LinearImage::from_data(1, 1, 3, vec![0.5, 0.5, 0.5]).unwrap();
    let map = LinearImage::from_data(1, 1, 3, vec![1.0, 0.5, 0.01]).unwrap();
    assert_eq!(correct_shading(&image, &map, 0.25).unwrap().data, vec![0.5, 1.0, 2.0]);
    assert!(correct_shading(&image, &LinearImage::zeros(1, 3, 1), 0.25).is_err());
    assert!(matches!(correct_shading(&image, &map, 0.0), Err(SensorError::ShadingFloor { .. })));
}

#[test]
fn too_small_a_frame_is_an_error() {
    let raw = Raw { height: 1, width: 5, dn: vec![0.0; 5], capture: capture(0, 0) };
    assert!(matches!(develop(&raw, &sensor()), Err(SensorError::Shape { what: "mosaic", .. })));
}

/// Development by every method with a gradient, in both domains: the adjoint is the derivative of a loss by the digital numbers.
#[test]
fn developments_by_other_interpolations_have_the_gradient_of_differences() {
    use crate::develop::{Demosaic, Domain, Interpolation};
    let (sensor, capture) = (sensor(), capture(1, 2));
    let (height, width) = (24, 30);
    // Mid-tones with strong structure: directions are decided, and nothing is near the bend of the stabiliser.
    let dn: Vec<f32> = uniform(7, height * width).into_iter().map(|v| 300.0 + 2000.0 * v).collect();
    let weights = uniform(8, CHANNELS * height * width);
    let d_rgb = LinearImage::from_data(CHANNELS, height, width, weights.clone()).unwrap();
    for demosaic in Demosaic::ALL.into_iter().filter(|method| method.is_differentiable()) {
        for domain in [Domain::Linear, Domain::Stabilised] {
            let interpolation = Interpolation { demosaic, domain };
            let raw = |dn: Vec<f32>| Raw { height, width, dn, capture };
            let loss = |dn: Vec<f32>| -> f64 {
                let picture = develop_by(&raw(dn), &interpolation, &sensor).unwrap();
                picture.data.iter().zip(&weights).map(|(v, w)| f64::from(*v) * f64::from(*w)).sum()
            };
            let bar = develop_by_adjoint(&d_rgb, &raw(dn.clone()), &interpolation, &sensor).unwrap();
            let mut wrong = 0;
            for pixel in (0..height * width).step_by(7) {
                let moved = |step: f32| {
                    let mut dn = dn.clone();
                    dn[pixel] += step;
                    loss(dn)
                };
                let difference = (moved(4.0) - moved(-4.0)) / 8.0;
                // A step that turns a direction makes a jump; few do.
                wrong += usize::from(
                    (difference - f64::from(bar[pixel])).abs() > 0.01 * f64::from(bar[pixel].abs()).max(1e-4),
                );
            }
            assert!(wrong <= 3, "{demosaic:?} {domain:?}: {wrong} of 103");
        }
    }
}

/// A field of one colour on arrays that lack a filter: the planes are those of the light, not of the clear pixels.
#[test]
fn colours_without_a_filter_come_from_the_clear_pixels() {
    let light = [0.2, 0.5, 0.3];
    for (tile, wanted) in [
        ("RW/WB", light),
        ("RW/GW", light),
        // Green and blue are not told apart: `(c - w_R R) / (w_G + w_B)`.
        ("RW/WW", [0.2, (0.6 * 0.5 + 0.3 * 0.3) / 0.9, (0.6 * 0.5 + 0.3 * 0.3) / 0.9]),
    ] {
        let clear_response = if tile == "RW/WW" { [0.2, 1.2, 0.6] } else { [0.5, 1.0, 0.4] };
        let sensor = SensorModel { cfa: tile.parse().unwrap(), clear_response, ..sensor() };
        let planes = light.iter().flat_map(|v| vec![*v as f32; 24 * 24]).collect();
        let scene = LinearImage::from_data(CHANNELS, 24, 24, planes).unwrap();
        let raw = expose(&scene, &sensor, &capture(0, 0), &Noise { mode: NoiseMode::Off, seed: 0 }).unwrap();
        let picture = develop(&raw, &sensor).unwrap();
        for c in 0..CHANNELS {
            let found = f64::from(picture.get(c, 12, 12));
            assert!((found - wanted[c]).abs() < 2e-3, "{tile} {c}: {found} {}", wanted[c]);
        }
    }
    // Clear pixels that do not see green cannot give it.
    let blind = SensorModel { cfa: "RW/WB".parse().unwrap(), clear_response: [0.5, 0.0, 0.5], ..sensor() };
    let raw = Raw { height: 8, width: 8, dn: vec![200.0; 64], capture: capture(0, 0) };
    assert!(matches!(develop(&raw, &blind), Err(SensorError::UnseenColour { colour: "green", .. })));
}
