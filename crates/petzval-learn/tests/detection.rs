//! Detectors learn, and their loss has a gradient by the picture.

use burn::optim::{AdamConfig, GradientsParams};
use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_learn::detection::{
    AnyDetector, BBox, BackboneKind, Detector, DetectorKind, Ignored, Object, Truth,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIDE: usize = 64;

/// Pictures of noise with a bright upright bar (class 0) or a dark square (class 1) in each.
fn pictures(count: usize, seed: u64, device: &Device) -> (Tensor<4>, Vec<Truth>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut values = Vec::new();
    let mut truths = Vec::new();
    for _ in 0..count {
        let class = random.random_range(0..2);
        let side = random.random_range(12..24);
        let [height, width] = if class == 0 { [side, side / 2] } else { [side, side] };
        let [top, left] = [height, width].map(|size| random.random_range(0..SIDE - size));
        let light = if class == 0 { 0.9 } else { 0.1 };
        let noise: Vec<f32> = (0..SIDE * SIDE).map(|_| 0.5 + random.random_range(-0.1..0.1)).collect();
        for _ in 0..3 {
            values.extend((0..SIDE * SIDE).map(|i| {
                let (row, column) = (i / SIDE, i % SIDE);
                let is_inside = (top..top + height).contains(&row) && (left..left + width).contains(&column);
                if is_inside { light } else { noise[i] }
            }));
        }
        let [x1, y1, x2, y2] = [left, top, left + width, top + height].map(|v| v as f32);
        truths.push(Truth {
            objects: vec![Object { bbox: BBox::new(x1, y1, x2, y2), class }],
            ..Truth::default()
        });
    }
    (Tensor::from_data(TensorData::new(values, [count, 3, SIDE, SIDE]), device), truths)
}

fn found_share(detector: &AnyDetector, seed: u64, device: &Device) -> f64 {
    let (seen, truths) = pictures(40, seed, device);
    let found = detector.detect(seen).unwrap();
    let is_right = |(truth, found): &(&Truth, &Vec<petzval_learn::detection::Detection>)| {
        let object = truth.objects[0];
        found.first().is_some_and(|d| d.class == object.class && d.bbox.iou(&object.bbox) > 0.5)
    };
    truths.iter().zip(&found).filter(is_right).count() as f64 / truths.len() as f64
}

#[test]
fn both_kinds_learn_to_find_bars_and_squares() {
    let device = Device::flex().autodiff();
    for kind in [DetectorKind::FasterRcnn, DetectorKind::Fcos] {
        let mut detector = kind.init(BackboneKind::Small, 2, 3, &device).unwrap();
        let mut optimizer = AdamConfig::new().init();
        assert!(found_share(&detector, 1, &device) < 0.4, "untrained");
        let mut losses = Vec::new();
        for step in 0..200 {
            let (seen, truths) = pictures(8, 1000 + step, &device);
            let loss = detector.loss(seen, &truths, step).unwrap();
            let parts: f64 = loss.parts.iter().filter(|(n, _)| *n != "total").map(|(_, v)| v).sum();
            let total = loss.parts.iter().find(|(name, _)| *name == "total").unwrap().1;
            assert!((parts - total).abs() < 1e-6 * parts, "{kind:?} {:?}", loss.parts);
            losses.push(total);
            let gradients = GradientsParams::from_grads(loss.total.backward(), &detector);
            detector = optimizer.step(2e-3, detector, gradients);
        }
        let share = found_share(&detector, 1, &device);
        assert!(share >= 0.9, "{kind:?} {share}: {} to {}", losses[0], losses[199]);
    }
}

#[test]
fn the_loss_of_one_stage_has_its_gradient_by_the_picture() {
    let device = Device::flex().autodiff();
    let detector = DetectorKind::Fcos.init(BackboneKind::Small, 2, 3, &device).unwrap();
    let (seen, truths) = pictures(2, 5, &device);
    let values: Vec<f32> = seen.into_data().try_to_vec().unwrap();
    let loss = |values: &[f32]| {
        let data = TensorData::new(values.to_vec(), [2, 3, SIDE, SIDE]);
        let leaf = Tensor::<4>::from_data(data, &device).require_grad();
        let loss = detector.loss(leaf.clone(), &truths, 9).unwrap();
        let total = loss.parts.iter().find(|(name, _)| *name == "total").unwrap().1;
        (total, leaf.grad(&loss.total.backward()).unwrap())
    };
    let gradient: Vec<f32> = loss(&values).1.into_data().try_to_vec().unwrap();
    // Along the gradient, where the difference stands out from the rounding of f32.
    let square: f64 = gradient.iter().map(|g| f64::from(*g).powi(2)).sum();
    assert!(square > 0.0, "no gradient");
    let step = 1e-2 / square.sqrt();
    let moved = |sign: f64| -> Vec<f32> {
        values.iter().zip(&gradient).map(|(v, g)| v + (sign * step * f64::from(*g)) as f32).collect()
    };
    let difference = (loss(&moved(1.0)).0 - loss(&moved(-1.0)).0) / (2.0 * step);
    assert!((difference / square - 1.0).abs() < 0.03, "{difference} {square}");
}

#[test]
fn pictures_without_objects_and_regions_that_are_ignored_give_finite_losses() {
    let device = Device::flex().autodiff();
    let (seen, _) = pictures(2, 5, &device);
    let everything = vec![Ignored::of_all(BBox::new(0.0, 0.0, SIDE as f32, SIDE as f32))];
    let truths = [Truth::default(), Truth { ignored: everything, ..Truth::default() }];
    for kind in [DetectorKind::FasterRcnn, DetectorKind::Fcos] {
        let detector = kind.init(BackboneKind::Small, 2, 3, &device).unwrap();
        let loss = detector.loss(seen.clone(), &truths, 9).unwrap();
        assert!(loss.parts.iter().all(|(_, value)| value.is_finite()), "{:?}", loss.parts);
        loss.total.backward();
        // Pictures whose sides are no multiple of the coarsest step; where their boxes lie is tested with the anchors.
        let odd = Tensor::<4>::zeros([1, 3, 37, 50], &device) + 0.5;
        detector.loss(odd.clone(), &truths[..1], 9).unwrap();
        assert_eq!(detector.detect(odd).unwrap().len(), 1);
    }
}
