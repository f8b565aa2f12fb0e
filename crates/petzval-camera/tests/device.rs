//! Operations of the camera on a device against those on the CPU, forward and back.
//!
//! `cargo xtask devices` runs these on a Vulkan device on the CPU. Without a device nothing is tested, and each test says so.
#![cfg(any(feature = "wgpu", feature = "cuda"))]

use std::panic::catch_unwind;
use std::sync::OnceLock;

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_base::random::{Stage, Stream};
use petzval_camera::develop::{Demosaic, Domain, Interpolation, LinearIsp};
use petzval_camera::sensor::{Electronics, NonUniformity};
use petzval_camera::tape::{expose_op, linear_isp_op};
use petzval_camera::{
    CHANNELS, Capture, CfaPattern, Exposure, Noise, NoiseMode, Placement, SensorModel, expose_pixel,
};

/// The device under test; none on a machine without one.
fn device() -> Option<Device> {
    static FOUND: OnceLock<Option<Device>> = OnceLock::new();
    let open = || {
        #[cfg(feature = "wgpu")]
        let device = Device::wgpu(Default::default());
        #[cfg(not(feature = "wgpu"))]
        let device = Device::cuda(0);
        petzval_camera::device::facts(&device);
        device
    };
    let found = FOUND.get_or_init(|| catch_unwind(open).ok().map(Device::autodiff)).clone();
    if found.is_none() {
        eprintln!("NOT TESTED: this machine has no device (apt install mesa-vulkan-drivers)");
    }
    found
}

fn host() -> Device {
    Device::flex().autodiff()
}

/// Numbers in 0..1, the same for a seed.
fn uniform(seed: u64, n: usize) -> Vec<f32> {
    let stream = Stream::new(seed, 0, Stage::Search);
    (0..n as u32).map(|i| stream.uniforms(i, 0)[0] as f32).collect()
}

fn tensor<const D: usize>(values: &[f32], shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), device)
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().convert::<f32>().try_to_vec().unwrap()
}

/// Largest difference over the largest value.
fn error(found: &[f32], expected: &[f32]) -> f32 {
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(0.0f32, |a, b| a.max(b.abs()));
    let differences = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    let worst = differences.fold(0.0f32, |a, b| if a.is_nan() || b.is_nan() { f32::NAN } else { a.max(b) });
    if worst == 0.0 { 0.0 } else { worst / largest }
}

fn sensor() -> SensorModel {
    toml::from_str(include_str!("../../petzval-data/data/sensors/imx249-fitted.toml")).unwrap()
}

fn captures(white_e: f32) -> Vec<Capture> {
    let of = |gain, row, col, frame| Capture {
        exposure: Exposure { white_e, time_s: 0.05, linear_gain: gain },
        placement: Placement { row, col },
        frame,
    };
    // Both phases of the array along each axis, and a frame number above 32 bits.
    vec![of(1.0, 3, 4, 0), of(1.6, 90, 201, (7 << 32) + 5), of(1.0, 1100, 1001, 2)]
}

/// Digital numbers and the cotangent of the light.
fn exposed(
    light: &[f32],
    shape: [usize; 4],
    sensor: &SensorModel,
    captures: &[Capture],
    noise: &Noise,
    device: &Device,
) -> [Vec<f32>; 2] {
    let light = tensor(light, shape, device).require_grad();
    let dn = expose_op(light.clone(), sensor, captures, noise).unwrap();
    let [batch, _, height, width] = shape;
    let weight = tensor(&uniform(9, batch * height * width), [batch, 1, height, width], device);
    let gradients = (dn.clone() * weight).sum().backward();
    [values(dn), values(light.grad(&gradients).unwrap())]
}

#[test]
fn exposures_are_those_of_the_cpu_but_for_ties() {
    let Some(device) = device() else { return };
    let nonuniformity = NonUniformity {
        specimen: (3 << 32) + 2,
        dsnu_pixel_e: 2.0,
        dsnu_row_e: 1.0,
        prnu_pixel_percent: 1.0,
        prnu_column_percent: 0.5,
        hot_pixel_share: 0.02,
        hot_pixel_e_per_s: 2000.0,
        row_noise_e: 0.7,
        column_noise_e: 0.4,
        ..Default::default()
    };
    let plain = sensor();
    let uneven = SensorModel { nonuniformity, dark_current_e_per_s: 400.0, ..sensor() };
    let second =
        SensorModel { electronics: Electronics::AfterAdc, cfa: "WR/GB".parse().unwrap(), ..sensor() };
    let [height, width] = [61, 83];
    let (shape, plane) = ([3, CHANNELS, height, width], height * width);
    let mut light = uniform(1, 3 * CHANNELS * plane);
    // Dark, negative and overexposed parts.
    light.iter_mut().enumerate().for_each(|(i, v)| match i % width {
        0..10 => *v *= 1e-3,
        10..12 => *v = -*v,
        12..16 => *v *= 6.0,
        _ => {}
    });
    for (name, sensor) in [("plain", &plain), ("uneven", &uneven), ("second converter", &second)] {
        for (mode, white_e) in [
            (NoiseMode::Exact, 16_000.0),
            (NoiseMode::Dequantised, 16_000.0),
            (NoiseMode::Dequantised, 60.0),
            (NoiseMode::HalfStep, 300.0),
            (NoiseMode::StraightThrough, 9000.0),
            (NoiseMode::Gaussian, 16_000.0),
            (NoiseMode::Off, 16_000.0),
        ] {
            let (captures, noise) = (captures(white_e), Noise { mode, seed: (11 << 32) + 3 });
            let [dn, by_light] = exposed(&light, shape, sensor, &captures, &noise, &device);
            let [host_dn, host_by_light] = exposed(&light, shape, sensor, &captures, &noise, &host());
            let what = format!("{name}, {mode:?}, {white_e} e-");
            if mode == NoiseMode::Off {
                let most = dn.iter().zip(&host_dn).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(most < 2e-3, "{what}: {most} DN");
                assert!(error(&by_light, &host_by_light) < 1e-5, "{what}");
                continue;
            }
            // Where the numbers differ, light that differs by up to two parts in a million has the device's number on the CPU.
            let different: Vec<usize> = (0..dn.len()).filter(|i| dn[*i] != host_dn[*i]).collect();
            assert!(different.len() * 1000 < dn.len(), "{what}: {} of {}", different.len(), dn.len());
            for &i in &different {
                let (frame, pixel) = (i / plane, i % plane);
                let capture = &captures[frame];
                let at = (capture.placement.row + pixel / width, capture.placement.col + pixel % width);
                let of = |k: i32| {
                    let scaled = |c: usize| {
                        let v = f64::from(light[(frame * CHANNELS + c) * plane + pixel]);
                        (v * (1.0 + f64::from(k) * 1e-7)) as f32
                    };
                    expose_pixel([0, 1, 2].map(scaled), sensor, capture, &noise, at).dn
                };
                let is_of_the_cpu = (-20..=20).any(|k| of(k) == dn[i]);
                // A reading at the middle between two numbers needs no other light.
                assert!(
                    is_of_the_cpu || (dn[i] - host_dn[i]).abs() == 1.0,
                    "{what}: {} {}",
                    dn[i],
                    host_dn[i]
                );
            }
            let apart = different.iter().filter(|i| (dn[**i] - host_dn[**i]).abs() > 1.0).count();
            // A count that differs by an electron may leave the number as it is, but not its slope.
            let largest = host_by_light.iter().fold(0.0f32, |a, b| a.max(b.abs()));
            let is_other = |(a, b): &(&f32, &f32)| (**a - **b).abs() > 1e-5 * largest;
            let others = by_light.iter().zip(&host_by_light).filter(is_other).count();
            assert!(others * 1000 < by_light.len(), "{what}: {others} of {} slopes", by_light.len());
            println!(
                "{what}: {} of {} differ, {apart} by more than 1 DN; {others} slopes",
                different.len(),
                dn.len()
            );
        }
    }
}

#[test]
fn light_that_is_no_number_makes_its_pixel_none() {
    let Some(device) = device() else { return };
    let sensor = SensorModel { cfa: CfaPattern::RGGB, ..sensor() };
    let mut light = vec![0.5; CHANNELS * 6];
    light[1] = f32::NAN;
    light[6 + 3] = f32::INFINITY;
    let (capture, noise) = (captures(9000.0)[0], Noise { mode: NoiseMode::Dequantised, seed: 1 });
    for device in [device, host()] {
        let [dn, _] = exposed(&light, [1, CHANNELS, 2, 3], &sensor, &[capture], &noise, &device);
        let unknown: Vec<usize> = (0..6).filter(|i| dn[*i].is_nan()).collect();
        assert_eq!(unknown, [1, 3]);
    }
}

/// Developed pictures, and the cotangents of digital numbers and of the illumination.
fn developed(
    dn: &[f32],
    [height, width]: [usize; 2],
    isp: &LinearIsp,
    sensor: &SensorModel,
    captures: &[Capture],
    device: &Device,
) -> [Vec<f32>; 3] {
    let (batch, pixels) = (captures.len(), height * width);
    let raw = tensor(dn, [batch, 1, height, width], device).require_grad();
    let light: Vec<f32> = uniform(5, batch * CHANNELS * pixels).iter().map(|v| 0.4 + 0.6 * v).collect();
    let light = tensor(&light, [batch, CHANNELS, height, width], device).require_grad();
    let picture = linear_isp_op(raw.clone(), light.clone(), isp, sensor, captures).unwrap();
    let weight = tensor(&uniform(6, batch * CHANNELS * pixels), [batch, CHANNELS, height, width], device);
    let gradients = (picture.clone() * weight).sum().backward();
    [picture, raw.grad(&gradients).unwrap(), light.grad(&gradients).unwrap()].map(values)
}

#[test]
fn developments_are_those_of_the_cpu_forward_and_back() {
    let Some(device) = device() else { return };
    let matrix = [[1.6, -0.4, -0.2], [-0.2, 1.4, -0.2], [0.0, -0.5, 1.5]];
    for cfa in [CfaPattern::RGGB, CfaPattern::GRBG, CfaPattern::GBRG, CfaPattern::BGGR, CfaPattern::MONO] {
        let sensor = SensorModel { cfa, ..sensor() };
        // Odd sizes, and one that the border mirrors several times.
        for size in [[37, 53], [5, 4]] {
            let n = 3 * size[0] * size[1];
            // Up to the clipping level and beyond, and a flat part whose directions are ties.
            let dn: Vec<f32> = uniform(4, n)
                .iter()
                .enumerate()
                .map(|(i, v)| if i % size[1] < 3 { 700.0 } else { (100.0 + 4100.0 * v).round().min(4095.0) })
                .collect();
            for demosaic in Demosaic::ALL {
                for domain in [Domain::Linear, Domain::Stabilised] {
                    if !demosaic.is_differentiable() || !(cfa.is_bayer() || demosaic == Demosaic::Bilinear) {
                        continue;
                    }
                    let interpolation = Interpolation { demosaic, domain };
                    let colour_matrix = (demosaic == Demosaic::Menon).then_some(matrix);
                    let isp = LinearIsp { interpolation, colour_matrix, ..LinearIsp::default() };
                    let captures = captures(9000.0);
                    let [found, expected] =
                        [&device, &host()].map(|d| developed(&dn, size, &isp, &sensor, &captures, d));
                    for ((found, expected), what) in
                        found.iter().zip(&expected).zip(["pictures", "by digital numbers", "by illumination"])
                    {
                        let error = error(found, expected);
                        println!("{cfa} {size:?} {demosaic:?} {domain:?} {what}: {error:.1e}");
                        assert!(error < 2e-5, "{cfa} {size:?} {demosaic:?} {domain:?} {what}: {error}");
                    }
                }
            }
        }
    }
}
