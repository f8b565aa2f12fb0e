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
use petzval_camera::render::{KNOTS, Wiener, patch_kernels};
use petzval_camera::sensor::{Electronics, NonUniformity};
use petzval_camera::tape::{
    PlacedScene, Restoration, expose_op, field_map, illumination_op, linear_isp_op, render_op, restore_op,
};
use petzval_camera::{
    CHANNELS, Capture, CfaPattern, Exposure, LinearImage, Noise, NoiseMode, Placement, PsfBank,
    RenderGeometry, SensorModel, expose_pixel, kernel_radius,
};

/// Set by those who need the tests to run: then a machine without a device fails.
const REQUIRED: &str = "PETZVAL_DEVICE_REQUIRED";

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
        assert!(std::env::var_os(REQUIRED).is_none(), "{REQUIRED} is set, and there is no device");
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

/// Numbers in -0.5..0.5: PSFs of one light differ by nothing in the sum, so that equal weights would leave only rounding of a derivative.
fn centred(seed: u64, n: usize) -> Vec<f32> {
    uniform(seed, n).iter().map(|v| v - 0.5).collect()
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
    for cfa in [CfaPattern::RGGB, CfaPattern::GBRG, CfaPattern::MONO] {
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

fn geometry(patches: (usize, usize)) -> RenderGeometry {
    RenderGeometry { sensor_height: 96, sensor_width: 128, pixel_um: 5.0, patches }
}

/// Uneven Gauss curves, wider at the corner.
fn bank(grid: usize, sigma: f32) -> PsfBank {
    let mut values = Vec::new();
    for (field, sigma) in [sigma, 1.5 * sigma, 1.2 * sigma].into_iter().enumerate() {
        for c in 0..CHANNELS {
            let random = uniform((10 * field + c) as u64, grid * grid);
            let at = |i: usize| (i as f32 - 0.5 * (grid as f32 - 1.0)) * 1.5 / sigma;
            let cell = |i: usize| (-0.5 * (at(i / grid).powi(2) + at(i % grid).powi(2))).exp();
            let psf: Vec<f32> = (0..grid * grid).map(|i| cell(i) * (0.5 + random[i])).collect();
            let sum: f32 = psf.iter().sum();
            values.extend(psf.iter().map(|v| v / sum));
        }
    }
    let illumination = vec![1.0, 0.99, 0.98, 0.8, 0.82, 0.79, 0.5, 0.52, 0.47];
    PsfBank { field_radius_mm: vec![0.0, 0.2, 0.33], grid, pitch_um: 1.5, values, illumination }
}

/// Windows in the middle, at a corner and across the centres of patches.
const PLACES: [Placement; 3] =
    [Placement { row: 0, col: 3 }, Placement { row: 61, col: 90 }, Placement { row: 29, col: 40 }];

/// Leaves of PSF values and radii.
fn psf_leaves(bank: &PsfBank, device: &Device) -> (Tensor<4>, Tensor<1>) {
    let values = tensor(&bank.values, [3, CHANNELS, bank.grid, bank.grid], device);
    let radii: Vec<f32> = bank.field_radius_mm.iter().map(|v| *v as f32).collect();
    (values.require_grad(), tensor(&radii, [3], device).require_grad())
}

fn compare(what: &str, names: &[&str], most: f32, [found, expected]: [Vec<Vec<f32>>; 2]) {
    assert_eq!([found.len(), expected.len()], [names.len(); 2]);
    for ((found, expected), name) in found.iter().zip(&expected).zip(names) {
        let error = error(found, expected);
        println!("{what}, {name}: {error:.1e}");
        assert!(error < most, "{what}, {name}: {error}");
    }
}

#[test]
fn renderings_are_those_of_the_cpu_forward_and_back() {
    let Some(device) = device() else { return };
    let [height, width] = [35, 37];
    for (patches, grid, sigma) in [((3, 4), 16, 3.0), ((1, 1), 16, 3.0), ((1, 3), 61, 18.0), ((5, 2), 8, 2.0)]
    {
        let (geometry, bank) = (geometry(patches), bank(grid, sigma));
        let layout = bank.layout();
        let radius = kernel_radius(&geometry, &layout).unwrap();
        let (h, w) = (height + 2 * radius, width + 2 * radius);
        let scenes: Vec<PlacedScene> = PLACES
            .iter()
            .enumerate()
            .map(|(i, placement)| {
                let data = uniform(40 + i as u64, CHANNELS * h * w);
                let scene = LinearImage::from_data(CHANNELS, h, w, data).unwrap();
                PlacedScene { scene, placement: *placement }
            })
            .collect();
        let shape = [3, CHANNELS, height, width];
        let weight = centred(8, shape.iter().product());
        let active = vec![true; geometry.patch_count()];
        let ready = patch_kernels(&geometry, &layout, &bank.values, &active).unwrap();
        for ready in [None, Some(std::sync::Arc::new(ready))] {
            let rendered = |device: &Device| {
                let (psf, radii) = psf_leaves(&bank, device);
                let scenes = scenes.clone();
                let pictures =
                    render_op(psf.clone(), radii.clone(), &layout, &geometry, ready.clone(), scenes).unwrap();
                let gradients = (pictures.clone() * tensor(&weight, shape, device)).sum().backward();
                let by = [values(psf.grad(&gradients).unwrap()), values(radii.grad(&gradients).unwrap())];
                vec![values(pictures), by[0].clone(), by[1].clone()]
            };
            let names = ["light", "by PSF values", "by field radii"];
            compare(&format!("{patches:?}, grid {grid}"), &names, 1e-5, [&device, &host()].map(rendered));
        }
        let illuminated = |device: &Device| {
            let (_, radii) = psf_leaves(&bank, device);
            let table = tensor(&bank.illumination, [3, CHANNELS], device).require_grad();
            let map =
                illumination_op(table.clone(), radii.clone(), &layout, &geometry, &PLACES, height, width)
                    .unwrap();
            let gradients = (map.clone() * tensor(&weight, shape, device)).sum().backward();
            let by = [values(table.grad(&gradients).unwrap()), values(radii.grad(&gradients).unwrap())];
            vec![values(map), by[0].clone(), by[1].clone()]
        };
        let field =
            |device: &Device| vec![values(field_map(&geometry, &PLACES, [height, width], device).unwrap())];
        compare(&format!("{patches:?}"), &["field"], 1e-6, [&device, &host()].map(field));
        let names = ["illumination", "by the table", "by field radii"];
        compare(&format!("{patches:?}"), &names, 1e-5, [&device, &host()].map(illuminated));
    }
}

#[test]
fn restorations_are_those_of_the_cpu_forward_and_back() {
    let Some(device) = device() else { return };
    let [height, width] = [35, 37];
    let shape = [3, CHANNELS, height, width];
    let (pictures, weight) = (uniform(3, shape.iter().product()), centred(8, shape.iter().product()));
    let curves: Vec<f32> = uniform(6, CHANNELS * KNOTS).iter().map(|v| 2.0 * v - 1.0).collect();
    // The second has kernels of more than 16 pixels, whose filters reach farther than the least.
    for (patches, grid) in [((3, 4), 16), ((1, 2), 81)] {
        let (geometry, bank) = (geometry(patches), bank(grid, 4.0));
        let restored = |device: &Device| {
            let (psf, radii) = psf_leaves(&bank, device);
            let pictures = tensor(&pictures, shape, device).require_grad();
            let curves = tensor(&curves, [CHANNELS, KNOTS], device).require_grad();
            let restoration = Restoration {
                wiener: Wiener { noise: 0.02, ..Wiener::default() },
                layout: bank.layout(),
                geometry: geometry.clone(),
                ready: None,
                placements: PLACES.to_vec(),
            };
            let (values_of, curves_of) = (psf.clone(), curves.clone());
            let out = restore_op(pictures.clone(), values_of, radii.clone(), curves_of, restoration).unwrap();
            let gradients = (out.clone() * tensor(&weight, shape, device)).sum().backward();
            vec![
                values(out),
                values(pictures.grad(&gradients).unwrap()),
                values(psf.grad(&gradients).unwrap()),
                values(radii.grad(&gradients).unwrap()),
                values(curves.grad(&gradients).unwrap()),
            ]
        };
        let names = ["pictures", "by pictures", "by PSF values", "by field radii", "by curves"];
        compare(&format!("{patches:?}, grid {grid}"), &names, 1e-5, [&device, &host()].map(restored));
    }
}
