//! Compares LPIPS with the reference implementation, and its gradient with finite differences.

use burn::prelude::*;
use petzval_learn::loss::{ImageLoss, LEAST_SIDE, LossError, Lpips, l1, l2, ssim};

const WEIGHTS: &[u8] = include_bytes!("../../petzval-data/data/weights/lpips_alex_f16.safetensors");

fn lpips(device: &Device) -> Lpips {
    Lpips::from_safetensors(WEIGHTS, device).unwrap()
}

/// An 8-bit picture as `[1, 3, height, width]`, exactly value / 255.
fn picture(name: &str, device: &Device) -> Tensor<4> {
    let path = format!("{}/tests/fixtures/{name}.png", env!("CARGO_MANIFEST_DIR"));
    let picture = image::open(path).unwrap().into_rgb8();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let values: Vec<f32> = (0..3)
        .flat_map(|channel| picture.as_raw().iter().skip(channel).step_by(3).map(|&v| f32::from(v) / 255.0))
        .collect();
    Tensor::from_data(TensorData::new(values, [1, 3, height, width]), device)
}

fn distance(lpips: &Lpips, a: Tensor<4>, b: Tensor<4>) -> f32 {
    lpips.distance(a, b).unwrap().into_scalar()
}

#[test]
fn agrees_with_the_reference_implementation() {
    // Values of the package lpips 0.1.4 (torch 2.15.0), AlexNet; the first two are the authors' example (0.722, 0.138).
    let cases = [
        ("lpips_ex_ref", "lpips_ex_p0", 0.721_880_7),
        ("lpips_ex_ref", "lpips_ex_p1", 0.137_565_6),
        ("slanted_edge", "slanted_edge__blur_s1.5", 0.088_906_88),
        ("slanted_edge", "slanted_edge__shift1px", 0.078_590_3),
        ("synthetic", "synthetic__blur_s1.5", 0.236_644_34),
        ("astronaut", "astronaut__blur_s1.5", 0.236_583_9),
    ];
    let device = Device::flex();
    let lpips = lpips(&device);
    for (a, b, expected) in cases {
        let found = distance(&lpips, picture(a, &device), picture(b, &device));
        println!("{a} {b}: {found:.5}, reference {expected:.5}");
        assert!((found - expected).abs() < 1e-3, "{a} against {b}: {found}, reference {expected}");
    }
}

#[test]
fn equal_pictures_have_distance_zero() {
    let device = Device::flex();
    let lpips = lpips(&device);
    let image = picture("lpips_ex_ref", &device);
    assert_eq!(distance(&lpips, image.clone(), image), 0.0);
}

#[test]
fn pictures_of_a_batch_have_separate_distances() {
    let device = Device::flex();
    let lpips = lpips(&device);
    let [reference, p0, p1] = ["lpips_ex_ref", "lpips_ex_p0", "lpips_ex_p1"].map(|n| picture(n, &device));
    let alone =
        [distance(&lpips, p0.clone(), reference.clone()), distance(&lpips, p1.clone(), reference.clone())];
    let target = lpips.target(Tensor::cat(vec![reference.clone(), reference], 0)).unwrap();
    let together = lpips.distance_to(Tensor::cat(vec![p0, p1], 0), &target).unwrap();
    let together = together.into_data().try_to_vec::<f32>().unwrap();
    for (a, b) in alone.iter().zip(together) {
        assert!((a - b).abs() < 1e-5, "{a} alone, {b} in a batch");
    }
}

#[test]
fn gradient_agrees_with_central_differences() {
    let device = Device::flex().autodiff();
    let lpips = lpips(&device);
    let target = lpips.target(picture("lpips_ex_ref", &device)).unwrap();
    let values = picture("lpips_ex_p1", &device).into_data().try_to_vec::<f32>().unwrap();
    let shape = [1, 3, 64, 64];

    let image = Tensor::<4>::from_data(TensorData::new(values.clone(), shape), &device).require_grad();
    let gradients = lpips.distance_to(image.clone(), &target).unwrap().sum().backward();
    let gradient = image.grad(&gradients).unwrap().into_data().try_to_vec::<f32>().unwrap();
    assert!(gradient.iter().all(|g| g.is_finite()));

    // Move the whole picture: the change of a single pixel would be lost in f32 rounding. The distance has kinks
    // (rectifiers, pooling), so a small difference remains.
    for seed in 0..4_u32 {
        let direction: Vec<f32> = gradient
            .iter()
            .enumerate()
            .map(|(i, g)| {
                let bits = (i as u32)
                    .wrapping_mul(2_654_435_761)
                    .wrapping_add(seed * 97)
                    .wrapping_mul(2_246_822_519);
                g.signum() * 0.5 + (bits >> 8) as f32 / (1 << 24) as f32 - 0.5
            })
            .collect();
        let step = 1e-3_f32;
        let moved = |sign: f32| {
            let moved: Vec<f32> = values.iter().zip(&direction).map(|(v, d)| v + sign * step * d).collect();
            let image = Tensor::<4>::from_data(TensorData::new(moved, shape), &device);
            let distance: f32 = lpips.distance_to(image, &target).unwrap().into_scalar();
            f64::from(distance)
        };
        let difference = (moved(1.0) - moved(-1.0)) / (2.0 * f64::from(step));
        let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| f64::from(g * d)).sum();
        println!("direction {seed}: gradient {along:.6}, differences {difference:.6}");
        assert!((along - difference).abs() < 0.02 * difference.abs(), "{along} against {difference}");
    }
}

#[test]
fn gradient_is_finite_on_a_black_picture() {
    let device = Device::flex().autodiff();
    let lpips = lpips(&device);
    let image = Tensor::<4>::zeros([1, 3, 40, 40], &device).require_grad();
    let target = lpips.target(Tensor::zeros([1, 3, 40, 40], &device)).unwrap();
    let gradients = lpips.distance_to(image.clone(), &target).unwrap().sum().backward();
    let gradient = image.grad(&gradients).unwrap().into_data().try_to_vec::<f32>().unwrap();
    assert!(gradient.iter().all(|g| g.is_finite()));
}

#[test]
fn the_least_picture_works_and_a_smaller_one_is_refused() {
    let device = Device::flex();
    let lpips = lpips(&device);
    let least = Tensor::<4>::ones([1, 3, LEAST_SIDE, LEAST_SIDE], &device);
    assert!(distance(&lpips, least.clone(), least * 0.5).is_finite());
    let small = Tensor::<4>::ones([1, 3, LEAST_SIDE - 1, 80], &device);
    let error = lpips.distance(small.clone(), small).err().unwrap();
    assert!(matches!(error, LossError::TooSmall { height: 30, width: 80, .. }), "{error}");
}

#[test]
fn bad_weights_are_refused_by_name() {
    let device = Device::flex();
    assert!(matches!(Lpips::from_safetensors(b"nonsense", &device).err(), Some(LossError::BadFile(_))));
    let data = [0_u8; 8];
    let view = safetensors::tensor::TensorView::new(safetensors::Dtype::F32, vec![2], &data).unwrap();
    let bytes = safetensors::serialize([("features.0.bias", view)], None).unwrap();
    let error = Lpips::from_safetensors(&bytes, &device).err().unwrap().to_string();
    assert!(error.contains("features.0.weight") && error.contains("missing"), "{error}");
}

#[test]
fn parts_of_the_loss_add_up() {
    let device = Device::flex().autodiff();
    let lpips = lpips(&device);
    let (reference, image) = (picture("lpips_ex_ref", &device), picture("lpips_ex_p1", &device));
    let loss = ImageLoss { l1_weight: 0.8, l2_weight: 2.0, ssim_weight: 0.4, lpips_weight: 0.3 };
    let target = loss.target(&lpips, reference.clone()).unwrap();
    let found = loss.evaluate(&lpips, image.clone(), &target).unwrap();
    let names: Vec<&str> = found.parts.iter().map(|part| part.name).collect();
    assert_eq!(names, ["l1", "l2", "ssim", "lpips"]);
    // Each part is what it is alone.
    let alone = [
        l1(image.clone(), reference.clone()).unwrap(),
        l2(image.clone(), reference.clone()).unwrap(),
        ssim(image.clone(), reference.clone()).unwrap().neg() + 1.0,
        lpips.distance(image.clone(), reference.clone()).unwrap(),
    ];
    for (part, alone) in found.parts.iter().zip(alone) {
        let alone: f32 = alone.into_scalar();
        assert!((part.value - alone).abs() < 1e-6 && alone > 1e-4, "{part:?} {alone}");
    }
    let total: f32 = found.total.into_scalar();
    let sum: f32 = found.parts.iter().map(|part| part.weight * part.value).sum();
    assert!((total - sum).abs() < 1e-6, "{total} against {sum}");

    let only_l1 = ImageLoss { lpips_weight: 0.0, ..ImageLoss::default() };
    let target = only_l1.target(&lpips, reference).unwrap();
    let found = only_l1.evaluate(&lpips, image.clone(), &target).unwrap();
    assert!(found.parts.len() == 1 && found.parts[0].name == "l1");
    let negative = ImageLoss { ssim_weight: -1.0, ..ImageLoss::default() };
    assert!(negative.evaluate(&lpips, image, &target).is_err());
}

#[test]
fn gradient_has_the_same_bits_for_any_thread_count() {
    let compute = || {
        let device = Device::flex().autodiff();
        let lpips = lpips(&device);
        let [reference, image] = ["astronaut", "astronaut__blur_s1.5"].map(|n| picture(n, &device));
        let target = lpips.target(reference).unwrap();
        let image = image.require_grad();
        let distance = lpips.distance_to(image.clone(), &target).unwrap();
        let value: f32 = distance.clone().into_scalar();
        let gradient = image.grad(&distance.sum().backward()).unwrap();
        let mut bits: Vec<u32> =
            gradient.into_data().try_to_vec::<f32>().unwrap().iter().map(|v| v.to_bits()).collect();
        bits.push(value.to_bits());
        bits
    };
    let first = compute();
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for _ in 0..3 {
            let other = pool.install(compute).iter().zip(&first).filter(|(a, b)| a != b).count();
            assert_eq!(other, 0, "{threads} threads: {other} of {} values differ", first.len());
        }
    }
}

#[test]
fn l1_has_the_same_bits_in_every_run() {
    let device = Device::flex();
    let values: Vec<f32> = (0..3 * 1200 * 1920).map(|i| (i as f32 * 0.37).sin()).collect();
    let image = Tensor::<4>::from_data(TensorData::new(values, [1, 3, 1200, 1920]), &device);
    let compute = || l1(image.clone(), image.clone() * 0.3).unwrap().into_scalar::<f32>().to_bits();
    let first = compute();
    for threads in [1, 2, 3, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for _ in 0..20 {
            assert_eq!(pool.install(compute), first, "{threads} threads");
        }
    }
}
