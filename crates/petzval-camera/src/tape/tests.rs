use burn::prelude::*;
use burn::tensor::{DType, TensorData};

use super::*;
use crate::image::CHANNELS;
use crate::psf::{PsfBank, PsfLayout};
use crate::render::{Placement, RenderGeometry, kernel_radius, render_adjoint};
use crate::sensor::{Capture, Exposure, Noise, NoiseMode, SensorModel};

pub(super) fn uniform(seed: u64, n: usize) -> Vec<f32> {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random::<f32>()).collect()
}

fn device() -> Device {
    Device::flex().autodiff()
}

pub(super) fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D]) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), (&device(), DType::F32))
}

pub(super) fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().convert::<f32>().try_to_vec().unwrap()
}

fn geometry() -> RenderGeometry {
    RenderGeometry { sensor_height: 40, sensor_width: 60, pixel_um: 5.0, patches: (3, 3) }
}

fn bank() -> PsfBank {
    let grid = 8;
    let mut values = uniform(1, 2 * CHANNELS * grid * grid);
    for psf in values.chunks_exact_mut(grid * grid) {
        let sum: f32 = psf.iter().sum();
        psf.iter_mut().for_each(|v| *v /= sum);
    }
    let illumination = vec![1.0, 1.0, 1.0, 0.6, 0.58, 0.55];
    PsfBank { field_radius_mm: vec![0.0, 0.2], grid, pitch_um: 2.0, values, illumination }
}

fn radii() -> Tensor<1> {
    tensor(vec![0.0, 0.2], [2])
}

fn scenes(layout: &PsfLayout, height: usize, width: usize) -> Vec<PlacedScene> {
    let radius = kernel_radius(&geometry(), layout).unwrap();
    let (h, w) = (height + 2 * radius, width + 2 * radius);
    [Placement { row: 0, col: 1 }, Placement { row: 21, col: 30 }]
        .into_iter()
        .enumerate()
        .map(|(i, placement)| {
            let data = uniform(10 + i as u64, CHANNELS * h * w).into_iter().map(|v| 0.1 + 0.6 * v).collect();
            PlacedScene { scene: LinearImage::from_data(CHANNELS, h, w, data).unwrap(), placement }
        })
        .collect()
}

#[test]
fn render_op_has_the_gradient_of_render_adjoint() {
    let (bank, geometry) = (bank(), geometry());
    let layout = bank.layout();
    let scenes = scenes(&layout, 15, 20);
    let weight = uniform(3, 2 * CHANNELS * 15 * 20);
    let psf = tensor(bank.values.clone(), [2, CHANNELS, 8, 8]).require_grad();
    let pictures = render_op(psf.clone(), radii(), &layout, &geometry, None, scenes.clone()).unwrap();
    assert_eq!(pictures.dims(), [2, CHANNELS, 15, 20]);
    let gradients = (pictures * tensor(weight.clone(), [2, CHANNELS, 15, 20])).sum().backward();
    let on_tape = values(psf.grad(&gradients).unwrap());

    let mut expected = vec![0.0f32; on_tape.len()];
    for (i, s) in scenes.iter().enumerate() {
        let gradient = picture(&weight, i, CHANNELS, 15, 20);
        let part = render_adjoint(&geometry, &bank, &s.scene, s.placement, &gradient).unwrap();
        expected.iter_mut().zip(&part.psfs.values).for_each(|(a, b)| *a += b);
    }
    let scale = expected.iter().fold(0.0f32, |a, b| a.max(b.abs()));
    for (a, b) in on_tape.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-5 * scale);
    }
}

/// A scalar of PSF and illumination through the whole camera: the sum of squares of the developed pictures.
fn camera_loss(psf: Tensor<4>, illumination: Tensor<2>, noise: &Noise) -> Tensor<1> {
    let (layout, geometry) = (bank().layout(), geometry());
    let sensor: SensorModel =
        toml::from_str::<SensorModel>(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml"))
            .unwrap();
    let scenes = scenes(&layout, 15, 20);
    let placements: Vec<Placement> = scenes.iter().map(|s| s.placement).collect();
    let captures: Vec<Capture> = placements
        .iter()
        .enumerate()
        .map(|(i, &placement)| {
            let exposure = Exposure { white_e: 9000.0, time_s: 0.01, linear_gain: 1.0 + i as f32 };
            Capture { exposure, placement, frame: i as u64 }
        })
        .collect();
    let light = render_op(psf, radii(), &layout, &geometry, None, scenes).unwrap()
        * illumination_op(illumination, radii(), &layout, &geometry, &placements, 15, 20).unwrap();
    let raw = expose_op(light, &sensor, &captures, noise).unwrap();
    assert_eq!(raw.dims(), [2, 1, 15, 20]);
    develop_op(raw, &sensor, &captures).unwrap().square().sum()
}

#[test]
fn gradients_through_the_whole_camera_match_finite_differences() {
    let bank = bank();
    let noise = Noise { mode: NoiseMode::Off, seed: 0 };
    let psf_shape = [2, CHANNELS, 8, 8];
    let psf = tensor(bank.values.clone(), psf_shape).require_grad();
    let table = tensor(bank.illumination.clone(), [2, CHANNELS]).require_grad();
    let gradients = camera_loss(psf.clone(), table.clone(), &noise).backward();
    let d_psf = values(psf.grad(&gradients).unwrap());
    let d_table = values(table.grad(&gradients).unwrap());

    // The loss is quadratic, so central differences with a large step are exact up to round-off.
    let loss = |psf: Vec<f32>, table: Vec<f32>| {
        values(camera_loss(tensor(psf, psf_shape), tensor(table, [2, CHANNELS]), &noise))[0]
    };
    let check = |analytic: f32, high: f32, low: f32, step: f32| {
        let difference = (high - low) / (2.0 * step);
        assert!((difference - analytic).abs() < 2e-3 * analytic.abs(), "{difference} {analytic}");
    };
    for index in [0, 27, 64 + 36, 3 * 64 + 20, 5 * 64 + 35] {
        let moved = |step: f32| {
            let mut v = bank.values.clone();
            v[index] += step;
            loss(v, bank.illumination.clone())
        };
        check(d_psf[index], moved(0.1), moved(-0.1), 0.1);
    }
    for index in 0..6 {
        let moved = |step: f32| {
            let mut v = bank.illumination.clone();
            v[index] += step;
            loss(bank.values.clone(), v)
        };
        check(d_table[index], moved(0.1), moved(-0.1), 0.1);
    }
}

#[test]
fn noise_repeats_and_exact_noise_stops_the_gradient() {
    let bank = bank();
    let run = |mode: NoiseMode| {
        let psf = tensor(bank.values.clone(), [2, CHANNELS, 8, 8]).require_grad();
        let table = tensor(bank.illumination.clone(), [2, CHANNELS]);
        let loss = camera_loss(psf.clone(), table, &Noise { mode, seed: 7 });
        let gradients = loss.clone().backward();
        (values(loss)[0], values(psf.grad(&gradients).unwrap()))
    };
    assert!(run(NoiseMode::Dequantised) == run(NoiseMode::Dequantised));
    assert!(run(NoiseMode::Dequantised).1.iter().any(|&g| g != 0.0));
    assert!(run(NoiseMode::Exact).1.iter().all(|&g| g == 0.0));
    assert_eq!(run(NoiseMode::Exact).0, run(NoiseMode::StraightThrough).0);
}

#[test]
fn wrong_shapes_are_typed_errors() {
    let (bank, geometry) = (bank(), geometry());
    let layout = bank.layout();
    let psf = tensor(bank.values.clone(), [1, 2 * CHANNELS, 8, 8]);
    assert!(render_op(psf, radii(), &layout, &geometry, None, scenes(&layout, 15, 20)).is_err());
    let psf = tensor(bank.values.clone(), [2, CHANNELS, 8, 8]);
    assert!(render_op(psf.clone(), radii(), &layout, &geometry, None, Vec::new()).is_err());
    let mut mixed = scenes(&layout, 15, 20);
    mixed.extend(scenes(&layout, 14, 20));
    assert!(render_op(psf, radii(), &layout, &geometry, None, mixed).is_err());
    let table = tensor(bank.illumination, [2, CHANNELS]);
    assert!(
        illumination_op(table, radii(), &layout, &geometry, &[Placement { row: 39, col: 0 }], 15, 20)
            .is_err()
    );
}

/// Raw frames of which about half of the pixels saturate, their captures, and an illumination that falls below the floor.
fn overexposed(sensor: &SensorModel) -> (Vec<f32>, Vec<Capture>, Vec<f32>) {
    let exposure = Exposure { white_e: 30_000.0, time_s: 0.005, linear_gain: 1.0 };
    let placements = [Placement { row: 0, col: 1 }, Placement { row: 3, col: 2 }];
    let captures: Vec<Capture> =
        placements.map(|placement| Capture { exposure, placement, frame: 0 }).to_vec();
    let dn = uniform(31, 2 * 12 * 14).into_iter().map(|v| 2.0 * v * sensor.max_dn() as f32).collect();
    let light = uniform(32, 2 * CHANNELS * 12 * 14).into_iter().map(|v| 1.1 * v).collect();
    (dn, captures, light)
}

#[test]
fn the_linear_isp_on_the_tape_is_its_reference_to_the_bit() {
    use crate::develop::{Demosaic, Domain, Interpolation, LinearIsp};
    use crate::sensor::Raw;
    let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
    let sensor: SensorModel = toml::from_str(text).unwrap();
    let (dn, captures, light) = overexposed(&sensor);
    let matrix = [[1.6, -0.5, -0.1], [-0.2, 1.4, -0.2], [0.0, -0.6, 1.6]];
    let menon = Interpolation { demosaic: Demosaic::Menon, domain: Domain::Stabilised };
    for isp in [
        LinearIsp::default(),
        LinearIsp { colour_matrix: Some(matrix), ..LinearIsp::default() },
        LinearIsp { interpolation: menon, ..LinearIsp::default() },
    ] {
        let raw = tensor(dn.clone(), [2, 1, 12, 14]);
        let found = linear_isp_op(raw, tensor(light.clone(), [2, 3, 12, 14]), &isp, &sensor, &captures);
        let found = values(found.unwrap());
        for (i, capture) in captures.iter().enumerate() {
            let n = 12 * 14;
            let raw = Raw { height: 12, width: 14, dn: dn[i * n..(i + 1) * n].to_vec(), capture: *capture };
            let map = picture(&light, i, CHANNELS, 12, 14);
            let expected = isp.develop(&raw, &map, &sensor).unwrap().data;
            for (a, b) in found[i * CHANNELS * n..].iter().zip(&expected) {
                // The matrix is applied in single precision on the tape, in double precision off it.
                let same = if isp.colour_matrix.is_none() { a == b } else { (a - b).abs() < 1e-6 };
                assert!(same, "{a} on the tape, {b} off it");
            }
        }
    }
}

#[test]
fn clipped_highlights_have_no_gradient() {
    use crate::develop::{Demosaic, Interpolation, LinearIsp, clip_levels_dn, develop_adjoint};
    use crate::sensor::Raw;
    let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
    let sensor: SensorModel = toml::from_str(text).unwrap();
    let (dn, captures, _) = overexposed(&sensor);
    let raw = Raw { height: 12, width: 14, dn: dn[..168].to_vec(), capture: captures[0] };
    let ones = LinearImage::filled(CHANNELS, 12, 14, 1.0);
    let isp = LinearIsp::default();
    let (found, _) = linear_isp_pull_back(&raw, &ones, &ones, &isp, &sensor).unwrap();
    let gray = LinearImage::filled(1, 12, 14, 1.0);
    assert!(linear_isp_pull_back(&raw, &ones, &gray, &isp, &sensor).is_err());
    let rcd = Interpolation { demosaic: Demosaic::Rcd, ..Interpolation::default() };
    let error = linear_isp_pull_back(&raw, &ones, &ones, &LinearIsp { interpolation: rcd, ..isp }, &sensor);
    assert!(error.unwrap_err().to_string().contains("rcd"));
    let unclipped = develop_adjoint(&ones, &sensor, &captures[0]).unwrap();
    let levels = clip_levels_dn(&sensor, &captures[0], 12, 14).unwrap();
    let clipped = dn[..168].iter().zip(&levels).filter(|(dn, level)| dn > level).count();
    assert!((60..150).contains(&clipped), "{clipped}");
    for i in 0..168 {
        if dn[i] > levels[i] {
            assert_eq!(found[i], 0.0);
        } else {
            // A developed value is at most the end of the highlights where no pixel beside it is clipped; elsewhere a
            // mean of it with clipped neighbours is, too: the derivative is the whole one.
            assert!((found[i] - unclipped[i]).abs() <= 1e-5 * unclipped[i].abs() + 1e-9, "{i}");
        }
    }
}

#[test]
fn the_map_of_the_field_has_the_distance_of_every_pixel_to_the_bit() {
    let geometry = geometry();
    let placements = [Placement { row: 0, col: 0 }, Placement { row: 21, col: 30 }];
    let map = values(field_map(&geometry, &placements, [15, 20], &device()).unwrap());
    let of = |i: usize| {
        let (at, pixel) = (placements[i / 300], i % 300);
        let radius_mm = geometry.radius_mm(at.row + pixel / 20, at.col + pixel % 20);
        (radius_mm / geometry.radius_mm(0, 0)) as f32
    };
    assert_eq!(map, (0..2 * 300).map(of).collect::<Vec<_>>());
}
