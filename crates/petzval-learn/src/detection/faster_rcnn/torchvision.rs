//! Whole detectors against torchvision's, with weights by a formula: `whole_detectors.py` beside the fixture made it, in 64 bits.

use std::collections::BTreeMap;

use burn::tensor::TensorData;
use safetensors::SafeTensors;
use serde::Deserialize;

use super::*;
use crate::detection::{AnyDetector, DetectorKind, WeightsOf};
use crate::weight_file::{NamedTensor, safetensors_of};

#[derive(Deserialize)]
struct Fixture {
    picture: [usize; 2],
    of_classes: usize,
    detectors: BTreeMap<String, Expected>,
}

/// A detector of torchvision, and what it makes of the picture.
#[derive(Deserialize)]
struct Expected {
    /// Shapes of its weights by name.
    state: BTreeMap<String, Vec<usize>>,
    body: Vec<Map>,
    pyramid: Vec<Map>,
    /// Number of all detections.
    count: usize,
    /// The best detections.
    boxes: Vec<[f32; 4]>,
    classes: Vec<usize>,
    scores: Vec<f32>,
}

/// What is known of a map of features.
#[derive(Deserialize)]
struct Map {
    shape: Vec<usize>,
    rms: f64,
    /// Values at equal distances, from the first.
    values: Vec<f64>,
}

/// Numbers 0..1 that follow from a name.
fn uniform(name: &str, count: usize) -> impl Iterator<Item = f64> {
    let seed = name.bytes().fold(0x811c_9dc5_u32, |h, b| (h ^ u32::from(b)).wrapping_mul(0x0100_0193));
    (0..count as u32).map(move |i| {
        let mut x = seed ^ i.wrapping_mul(0x9e37_79b9);
        x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
        x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
        f64::from((x ^ x >> 16) >> 8) / f64::from(1 << 24)
    })
}

/// The bytes of a weight.
fn weight(name: &str, shape: &[usize]) -> Vec<u8> {
    let from_body = name.starts_with("backbone.body");
    let inputs: usize = shape[1..].iter().product();
    let spread = if from_body { 1.0 } else { 0.6 } * (6.0 / inputs as f64).sqrt();
    let value = |u: f64| match name.rsplit('.').next().unwrap() {
        "running_var" => 0.5 + u,
        "running_mean" | "bias" => 0.2 * (u - 0.5),
        _ if shape.len() == 1 => 0.5 + 0.5 * u,
        _ => (2.0 * u - 1.0) * spread,
    };
    uniform(name, shape.iter().product()).flat_map(|u| (value(u) as f32).to_le_bytes()).collect()
}

/// The weight of a detector with the 91 outputs of COCO whose outputs of these numbers are those of `weight`, and the others zero.
fn among_coco((name, mut shape, bytes): NamedTensor, numbers: [usize; 4]) -> NamedTensor {
    if !name.contains("box_predictor") {
        return (name, shape, bytes);
    }
    let size = bytes.len() / numbers.len();
    let mut all = vec![0; 91 * size];
    for (own, number) in bytes.chunks_exact(size).zip(numbers) {
        all[number * size..][..size].copy_from_slice(own);
    }
    shape[0] = shape[0] / numbers.len() * 91;
    (name, shape, all)
}

/// The file of a classifier that has these weights of a detector in its layers before the last one.
fn as_classifier(kind: BackboneKind, weights: &[NamedTensor]) -> Vec<u8> {
    let prefix = if kind == BackboneKind::MobilenetV2 { "features." } else { "" };
    let of_backbone = weights.iter().filter_map(|(name, shape, bytes)| {
        let name = name.strip_prefix("backbone.body.")?;
        Some((format!("{prefix}{name}"), shape.clone(), bytes.clone()))
    });
    safetensors_of(&of_backbone.collect::<Vec<_>>(), None).unwrap()
}

fn assert_maps(ours: &[Tensor<4>], theirs: &[Map], what: &str) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    for (level, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
        assert_eq!(ours.dims().as_slice(), theirs.shape, "{what} {level}");
        let values: Vec<f32> = ours.clone().into_data().try_to_vec().unwrap();
        let squares: f64 = values.iter().map(|v| f64::from(*v).powi(2)).sum();
        let rms = (squares / values.len() as f64).sqrt();
        assert!((rms / theirs.rms - 1.0).abs() < 1e-5, "{what} {level}: {rms} {}", theirs.rms);
        for (i, expected) in theirs.values.iter().enumerate() {
            let value = f64::from(values[i * values.len() / theirs.values.len()]);
            assert!((value - expected).abs() < 1e-5 * theirs.rms, "{what} {level} {i}: {value} {expected}");
        }
    }
}

#[test]
fn whole_detectors_see_and_find_what_those_of_torchvision_do() {
    let text = include_str!("../../../tests/fixtures/whole_detectors.json");
    let Fixture { picture: [height, width], of_classes, mut detectors } = serde_json::from_str(text).unwrap();
    let device = Device::flex();
    let values: Vec<f32> = uniform("picture", 3 * height * width).map(|u| u as f32).collect();
    let picture = Tensor::<4>::from_data(TensorData::new(values, [1, 3, height, width]), &device);
    for kind in [BackboneKind::Resnet18, BackboneKind::Resnet50, BackboneKind::MobilenetV2] {
        let name = serde_json::to_value(kind).unwrap().as_str().unwrap().to_owned();
        let expected = detectors.remove(&name).unwrap();
        let weights = expected.state.iter().map(|(n, shape)| (n.clone(), shape.clone(), weight(n, shape)));
        let weights: Vec<NamedTensor> = weights.collect();
        let bytes = safetensors_of(&weights, None).unwrap();
        let file = SafeTensors::deserialize(&bytes).unwrap();
        let config = FasterRcnnConfig::torchvision(kind, of_classes);
        let detector = FasterRcnn::with(config, &Parameters::read(&file, 1, &device)).unwrap();

        assert_maps(
            &detector.body.features(normalized(picture.clone())).collect::<Vec<_>>(),
            &expected.body,
            "body",
        );
        assert_maps(&detector.maps(picture.clone()), &expected.pyramid, "pyramid");
        let found = detector.detect(picture.clone()).unwrap().remove(0);
        assert_eq!(found.len(), expected.count, "{name}");
        assert_eq!(WeightsOf::file(&bytes), WeightsOf::Detector);
        // The backbone alone, from the file of a classifier.
        let bytes = as_classifier(kind, &weights);
        assert_eq!(WeightsOf::file(&bytes), WeightsOf::Classifier);
        let from_classifier = |of: DetectorKind, kind| of.from_classifier(kind, 2, 1, &bytes, &device);
        let Ok(AnyDetector::FasterRcnn(begun)) = from_classifier(DetectorKind::FasterRcnn, kind) else {
            panic!("{name}");
        };
        assert_maps(
            &begun.body.features(normalized(picture.clone())).collect::<Vec<_>>(),
            &expected.body,
            "body of a classifier",
        );
        from_classifier(DetectorKind::Fcos, kind).unwrap();
        if kind == BackboneKind::Resnet18 {
            let other = from_classifier(DetectorKind::Fcos, BackboneKind::Resnet50).unwrap_err().to_string();
            assert!(other.contains("`layer1.0.conv1.weight` is of shape [64, 64, 3, 3]"), "{other}");
            // The same from a file for COCO, in which these classes have other numbers.
            let coco: Vec<NamedTensor> =
                weights.into_iter().map(|weight| among_coco(weight, [0, 1, 3, 10])).collect();
            let detector =
                AnyDetector::from_coco(kind, &[1, 3, 10], &safetensors_of(&coco, None).unwrap(), &device)
                    .unwrap();
            let same = detector.detect(picture.clone()).unwrap().remove(0);
            assert_eq!(found, same);
        }
        assert!(expected.scores.len() == 30 && expected.boxes.len() == 30 && expected.classes.len() == 30);
        // Rounding moves proposals, and with them what the second stage sees. Torchvision itself in 32 bits is up to 2.4e-5 (scores) and
        // 6e-4 pixels (boxes) away from its figures in 64 bits, and 3e-6 of the root mean square in the maps.
        for (i, found) in found.iter().take(30).enumerate() {
            let (score, bbox) = (expected.scores[i], expected.boxes[i]);
            assert_eq!(found.class, expected.classes[i], "{name} {i}");
            assert!((found.score - score).abs() < 1e-4, "{name} {i}: {} {score}", found.score);
            let BBox { x1, y1, x2, y2 } = found.bbox;
            let largest = [x1, y1, x2, y2].iter().zip(bbox).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(largest < 2e-3, "{name} {i}: {:?} {bbox:?}", found.bbox);
        }
    }
    assert!(detectors.is_empty());
}
