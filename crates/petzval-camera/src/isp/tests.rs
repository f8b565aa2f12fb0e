//! The automotive ISP as a whole: its two versions against each other, its gradient, its limits.

use burn::prelude::*;
use burn::tensor::TensorData;

use super::*;
use crate::develop::{Demosaic, Domain};
use crate::image::{CHANNELS, LinearImage};
use crate::quality::psnr;
use crate::render::Placement;
use crate::sensor::{Capture, CfaPattern, Exposure, Noise, NoiseMode, Raw, SensorModel, expose};

fn sensor() -> SensorModel {
    let sensor: SensorModel =
        toml::from_str(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml")).unwrap();
    SensorModel { cfa: CfaPattern::GRBG, ..sensor }
}

/// A colourful scene: a gradient, stripes, discs, and a dark half.
fn scene(height: usize, width: usize) -> LinearImage {
    let mut image = LinearImage::zeros(CHANNELS, height, width);
    for r in 0..height {
        for c in 0..width {
            let (y, x) = (r as f32 / height as f32, c as f32 / width as f32);
            let stripe = 0.5 + 0.5 * (0.45 * (r as f32 + 0.6 * c as f32)).sin();
            let disc = if (y - 0.5).hypot(x - 0.6) < 0.2 { 0.8 } else { 0.0 };
            let dark = if x < 0.4 { 0.15 } else { 1.0 };
            image.set(0, r, c, dark * (0.1 + 0.5 * x + 0.2 * stripe * y));
            image.set(1, r, c, dark * (0.2 + 0.3 * y + 0.4 * disc));
            image.set(2, r, c, dark * (0.15 + 0.5 * (1.0 - x) + 0.2 * disc * stripe));
        }
    }
    image
}

/// A simulated frame, with shading and a warp.
fn frame(height: usize, width: usize, white_e: f32) -> RawInput {
    let exposure = Exposure { white_e, time_s: 0.005, linear_gain: 1.0 };
    let capture = Capture { exposure, placement: Placement { row: 0, col: 0 }, frame: 0 };
    let noise = Noise { mode: NoiseMode::Exact, seed: 3 };
    let raw: Raw = expose(&scene(height, width), &sensor(), &capture, &noise).unwrap();
    let mut input = RawInput::from_raw(&raw, &sensor()).unwrap();
    // Hot pixels of many levels, and a dead one.
    let (black, white) = (input.about.black_dn, input.about.white_dn);
    for k in 0..12 {
        let (row, col) = (4 + 3 * k % (height - 8), 5 + 17 * k % (width - 10));
        input.dn[row * width + col] = (black + (0.3 + 0.12 * k as f64) * (white - black)) as u32;
    }
    input.dn[26 * width + 27] = 0;
    let bump = |i: usize| 1.0 - 0.06 * ((i / 5) as f32 - 2.0).powi(2) - 0.05 * ((i % 5) as f32 - 2.0).powi(2);
    let plane: Vec<f32> = (0..25).map(bump).collect();
    let planes = vec![plane.clone(), plane.iter().map(|v| v * v).collect(), plane];
    input.about.shading = Some(Mesh { rows: 5, cols: 5, planes });
    let moved = |k: usize| (0..25).map(|i| 1.7 * (((i / 5 + k * (i % 5)) as f32) - 2.3).sin()).collect();
    input.about.warp = Some(Mesh { rows: 5, cols: 5, planes: vec![moved(0), moved(1)] });
    input.about.colour_matrix = Some([[1.6, -0.4, -0.2], [-0.2, 1.5, -0.3], [0.0, -0.6, 1.6]]);
    input
}

/// Every stage at work.
fn busy() -> IspSettings {
    let mut set = IspSettings { bits: 16, ..IspSettings::default() };
    set.black_level.offset_dn = [0.5, -0.3, 0.2, 0.4];
    set.gain.stops = 0.4;
    set.bayer_denoise.radial = 0.5;
    set.defects.threshold = 0.2;
    set.defects.slope = 0.8;
    set.shading.cap = 1.3;
    set.white_balance.red = 1.1;
    set.white_balance.blue = 0.9;
    set.tone_map.strength = 0.6;
    set.tone_map.detail = 1.2;
    set.purple_fringe.strength = 0.5;
    set.colours.mixing = [0.1, -0.05, 0.02, 0.03, -0.04, 0.05];
    set.colours.saturation = 1.1;
    set.output.brightness = 0.02;
    set.output.contrast = 1.1;
    set
}

fn distance(a: &RgbPicture, b: &RgbPicture) -> f64 {
    psnr(&a.encoded(), &b.encoded()).unwrap()
}

#[test]
fn whole_numbers_stay_close_to_the_smooth_version() {
    let frame = frame(64, 80, 8000.0);
    for (name, set) in [("defaults", IspSettings { bits: 16, ..IspSettings::default() }), ("busy", busy())] {
        for demosaic in [Demosaic::Bilinear, Demosaic::Malvar, Demosaic::Rcd, Demosaic::Menon] {
            for domain in [Domain::Stabilised, Domain::Linear] {
                let settings = IspSettings { demosaic, domain, ..set.clone() };
                let fixed = HardwareIsp { settings: settings.clone() }.develop_as_set(&frame).unwrap();
                let smooth =
                    SmoothIsp { settings: settings.clone() }.develop(&frame, &settings.values()).unwrap();
                let db = distance(&fixed, &smooth);
                // A step of the root is 2^-13, of the encoded value 2^-14; decisions at single pixels may differ.
                assert!(db > 52.0, "{name} {demosaic:?} {domain:?}: {db:.1} dB");
            }
        }
    }
}

/// The sum of a picture's values times fixed weights, as a function of the numbers.
fn weighted(isp: &SmoothIsp, frame: &RawInput, weights: &[f32], values: &[f64]) -> f64 {
    let picture = smooth_picture(isp, &frame.linear_dn(), frame, values).unwrap();
    // The products in 32 bits, as on the tape.
    picture.iter().zip(weights).map(|(v, w)| f64::from(v * w)).sum()
}

fn random_weights(height: usize, width: usize) -> Vec<f32> {
    // Smooth weights: differences of the sum are then well above the rounding of f32.
    let of = |i: usize| (0.37 * (i % width) as f32 + 0.23 * (i / width) as f32).sin() + 0.2;
    (0..CHANNELS * height * width).map(of).collect()
}

#[test]
fn every_number_has_the_gradient_of_differences() {
    let (height, width) = (48, 48);
    let frame = frame(height, width, 4000.0);
    let isp = SmoothIsp { settings: busy() };
    let values = isp.settings.values();
    let weights = random_weights(height, width);
    let (by_dn, by_theta) = smooth_pull_back(&isp, &frame.linear_dn(), &frame, &values, &weights).unwrap();
    assert!(by_dn.iter().all(|v| v.is_finite()));
    assert!(smooth_pull_back(&isp, &frame.linear_dn(), &frame, &values, &weights[1..]).is_err());
    assert!(smooth_picture(&isp, &by_dn[1..], &frame, &values).is_err());

    for (i, p) in IspSettings::parameters().iter().enumerate() {
        let step = 2e-3 * (p.about.max - p.about.min).min(values[i].abs().max(0.1));
        let moved = |sign: f64| {
            let mut values = values.clone();
            values[i] += sign * step;
            weighted(&isp, &frame, &weights, &values)
        };
        let wanted = (moved(1.0) - moved(-1.0)) / (2.0 * step);
        let found = by_theta[i];
        // Pixels that cross a bound between the two differences leave a few per cent.
        assert!((found - wanted).abs() < 0.05 * wanted.abs() + 0.01, "{}: {found} {wanted}", p.name);
        assert!(wanted != 0.0, "{} has no effect on this frame", p.name);
    }
}

#[test]
fn the_gradient_by_the_raw_frame_is_that_of_differences() {
    let (height, width) = (32, 32);
    let mut frame = frame(height, width, 4000.0);
    let isp = SmoothIsp { settings: busy() };
    let values = isp.settings.values();
    let weights = random_weights(height, width);
    let (by_dn, _) = smooth_pull_back(&isp, &frame.linear_dn(), &frame, &values, &weights).unwrap();
    let (mut error, mut size) = (0.0, 0.0);
    for i in (0..height * width).step_by(37) {
        let mut moved = |by: i64| {
            frame.dn[i] = (i64::from(frame.dn[i]) + by) as u32;
            weighted(&isp, &frame, &weights, &values)
        };
        let (above, below) = (moved(1), moved(-2));
        moved(1);
        let wanted = (above - below) / 2.0;
        error += (wanted - f64::from(by_dn[i])).powi(2);
        size += wanted.powi(2);
    }
    assert!(error < 0.01 * size, "{error} {size}");
}

#[test]
fn black_white_and_24_bits_give_pictures() {
    let mut frame = frame(32, 48, 8000.0);
    for (bits, dn) in [(12, 0_u32), (12, 4095), (24, 0), (24, (1 << 24) - 1), (24, 70_000), (8, 255)] {
        frame.bits = bits;
        frame.dn.iter_mut().enumerate().for_each(|(i, v)| *v = if i % 7 == 0 { dn / 2 } else { dn });
        frame.about.white_dn = if bits == 24 { 1_000_000.0 } else { 200.0 };
        for set in [IspSettings::default(), busy()] {
            let values = set.values();
            let fixed = HardwareIsp { settings: set.clone() }.develop_as_set(&frame).unwrap();
            let device = Device::flex();
            let dn: Vec<f32> = frame.dn.iter().map(|v| *v as f32).collect();
            let dn = Tensor::from_data(TensorData::new(dn, [1, 1, 32, 48]), &device);
            let theta: Vec<f32> = values.iter().map(|v| *v as f32).collect();
            let theta = Tensor::from_data(TensorData::new(theta, [values.len()]), &device);
            let smooth = SmoothIsp { settings: set }.develop_on_tape(dn, &frame, theta).unwrap();
            assert!(smooth.into_data().try_to_vec::<f32>().unwrap().iter().all(|v| v.is_finite()), "{bits}");
            assert_eq!(fixed.data.len(), 3 * 32 * 48);
        }
    }
}

#[test]
fn whoever_watches_sees_every_stage_and_changes_nothing() {
    let frame = frame(32, 48, 8000.0);
    let mut isp = HardwareIsp { settings: busy() };
    // Unlike the curve by which pictures before it are shown.
    isp.settings.gamma.exponent = 2.2;
    let mut seen = Vec::new();
    let watched = isp.develop_steps(&frame, &mut |stage, picture| seen.push((stage, picture))).unwrap();
    assert_eq!(watched, isp.develop_as_set(&frame).unwrap());
    seen.push(("output", watched));
    let mut stages = IspSettings::STAGES.to_vec();
    // Demosaicing has a method in place of numbers.
    let demosaic = stages.iter().position(|stage| *stage == "false_colour").unwrap();
    stages.insert(demosaic, "demosaic");
    let times = isp.stage_times(&frame, 2).unwrap();
    assert_eq!(times.iter().map(|(stage, _)| *stage).collect::<Vec<_>>(), stages);
    stages.retain(|stage| !HardwareIsp::WITHOUT_PICTURE.iter().any(|(without, _)| without == stage));
    assert_eq!(seen.iter().map(|(stage, _)| *stage).collect::<Vec<_>>(), stages);
    for pair in seen.windows(2) {
        assert!(pair[0].1 != pair[1].1, "{} changes nothing", pair[1].0);
    }
}

#[test]
fn a_companded_frame_develops_as_the_linear_one() {
    let linear = frame(32, 48, 8000.0);
    let companding =
        Companding { companded_dn: vec![0, 1024, 2048, 3072], linear_dn: vec![0, 1024, 4096, 65535] };
    let mut companded = linear.clone();
    companded.dn.iter_mut().for_each(|v| *v = companding.compress(*v));
    companded.about.companding = Some(companding);
    let isp = HardwareIsp::default();
    let db = distance(&isp.develop_as_set(&linear).unwrap(), &isp.develop_as_set(&companded).unwrap());
    // Three linear numbers share a companded one in the second segment.
    assert!(db > 45.0, "{db}");
}

#[test]
fn a_perfect_frame_comes_out_as_the_scene() {
    let (height, width) = (64, 96);
    let smooth_scene = |r: usize, c: usize| 0.1 + 0.6 * (r as f32 / 64.0) * (c as f32 / 96.0);
    let mut scene = LinearImage::zeros(CHANNELS, height, width);
    for plane in 0..CHANNELS {
        for i in 0..height * width {
            scene.set(
                plane,
                i / width,
                i % width,
                smooth_scene(i / width, i % width) * (1.0 - 0.2 * plane as f32),
            );
        }
    }
    let exposure = Exposure { white_e: 16000.0, time_s: 0.005, linear_gain: 1.0 };
    let capture = Capture { exposure, placement: Placement { row: 0, col: 0 }, frame: 0 };
    let raw = expose(&scene, &sensor(), &capture, &Noise { mode: NoiseMode::Off, seed: 0 }).unwrap();
    let input = RawInput::from_raw(&raw, &sensor()).unwrap();
    let mut settings = IspSettings { bits: 16, ..IspSettings::default() };
    settings.sharpen.amount = 0.0;
    let picture = HardwareIsp { settings }.develop_as_set(&input).unwrap();
    let db = psnr(&picture.encoded(), &scene.to_srgb()).unwrap();
    assert!(db > 45.0, "{db}");
}
