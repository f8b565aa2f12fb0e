//! The parts of detectors against torchvision 0.29.2 (torch 2.15.0): `reference.json` holds its inputs and results. What no detector here uses is not
//! compared: ROI pooling by maxima, and the distance and complete IoU.

use std::collections::BTreeMap;

use burn::prelude::*;
use burn::tensor::TensorData;
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use serde_json::Value;

use super::anchors::Anchors;
use super::box_coder::BoxCoder;
use super::box_head::{PROPOSALS_WITH_OBJECTS, box_losses};
use super::levels::LevelOfBox;
use super::loss::{binary_cross_entropy, focal, generalised_iou, smooth_l1};
use super::matcher::{Match, Matcher};
use super::nms::suppress;
use super::parameters::Parameters;
use super::proposals::{POSITIVE_ANCHORS, ProposalConfig, tests::proposals_of};
use super::roi_align::{Region, RoiAlign};
use super::{AnyDetector, BBox, BackboneKind, DetectorKind, FasterRcnnConfig};

use crate::loss::image_loss::read_values;
use crate::weight_file::{NamedTensor, safetensors_of};

fn reference() -> Value {
    serde_json::from_str(include_str!("reference.json")).unwrap()
}

/// All numbers of a value, in their order.
fn numbers(value: &Value) -> Vec<f32> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap() as f32],
    }
}

fn counts(value: &Value) -> Vec<usize> {
    value.as_array().unwrap().iter().map(|v| v.as_u64().unwrap() as usize).collect()
}

fn shape(value: &Value) -> Vec<usize> {
    match value {
        Value::Array(items) => [vec![items.len()], items.first().map_or(vec![], shape)].concat(),
        _ => Vec::new(),
    }
}

fn boxes(value: &Value) -> Vec<BBox> {
    numbers(value).chunks_exact(4).map(|b| BBox::new(b[0], b[1], b[2], b[3])).collect()
}

fn tensor<const D: usize>(value: &Value, device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(numbers(value), shape(value)), device)
}

fn sides(boxes: &[BBox]) -> Vec<f32> {
    boxes.iter().flat_map(|b| [b.x1, b.y1, b.x2, b.y2]).collect()
}

#[track_caller]
fn assert_near(ours: &[f32], theirs: &[f32]) {
    assert_eq!(ours.len(), theirs.len());
    for (i, (a, b)) in ours.iter().zip(theirs).enumerate() {
        assert!((a - b).abs() <= 1e-5 * b.abs().max(1.0), "{i}: {a} {b}");
    }
}

#[test]
fn overlaps_of_boxes() {
    let all = &reference()["iou"];
    let (first, second) = (boxes(&all["boxes1"]), boxes(&all["boxes2"]));
    let ours: Vec<f32> = first.iter().flat_map(|a| second.iter().map(|b| a.iou(b))).collect();
    assert_near(&ours, &numbers(&all["iou"]));
    // The loss adds 1e-7 to both denominators.
    let device = Device::flex();
    let pairs = |of: &dyn Fn(usize) -> BBox| -> Tensor<2> {
        let values: Vec<f32> = (0..first.len() * second.len()).flat_map(|i| sides(&[of(i)])).collect();
        Tensor::from_data(TensorData::new(values, [first.len() * second.len(), 4]), &device)
    };
    let loss = generalised_iou(pairs(&|i| first[i / second.len()]), pairs(&|i| second[i % second.len()]));
    let ours: Vec<f32> = read_values(loss).unwrap().iter().map(|v| 1.0 - v).collect();
    assert_near(&ours, &numbers(&all["giou"]));
    // The loss of torchvision, of the first three pairs on the diagonal.
    let losses: Vec<f32> = (0..3).map(|i| 1.0 - ours[i * second.len() + i]).collect();
    assert_near(&losses, &numbers(&reference()["giou_loss"]["none"]));
}

/// The settings of `fasterrcnn_resnet50_fpn`. A least score of proposals, 0 there, is not among those of ours.
#[test]
fn defaults_of_torchvision() {
    let theirs = &reference()["fasterrcnn_defaults"];
    let config = FasterRcnnConfig::torchvision(BackboneKind::Resnet50, 90);
    let (rpn, boxes) = (&config.proposals, &config.boxes);
    for (name, ours) in [
        ("rpn_pre_nms_top_n_train", rpn.before_suppression[0] as f32),
        ("rpn_pre_nms_top_n_test", rpn.before_suppression[1] as f32),
        ("rpn_post_nms_top_n_train", rpn.after_suppression[0] as f32),
        ("rpn_post_nms_top_n_test", rpn.after_suppression[1] as f32),
        ("rpn_nms_thresh", rpn.most_overlap),
        ("rpn_fg_iou_thresh", rpn.matcher.high),
        ("rpn_bg_iou_thresh", rpn.matcher.low),
        ("rpn_batch_size_per_image", rpn.sampled as f32),
        ("rpn_positive_fraction", POSITIVE_ANCHORS),
        ("box_score_thresh", boxes.least_score),
        ("box_nms_thresh", boxes.most_overlap),
        ("box_detections_per_img", boxes.most_detections as f32),
        ("box_fg_iou_thresh", PROPOSALS_WITH_OBJECTS.high),
        ("box_bg_iou_thresh", PROPOSALS_WITH_OBJECTS.low),
        ("box_batch_size_per_image", boxes.sampled as f32),
        ("box_positive_fraction", boxes.positive),
    ] {
        assert_eq!(Some(ours), theirs[name].as_f64().map(|v| v as f32), "{name}");
    }
}

#[test]
fn boxes_as_offsets_and_back() {
    for case in reference()["box_coder"].as_array().unwrap() {
        let weights: [f32; 4] = numbers(&case["weights"]).try_into().unwrap();
        let coder = BoxCoder { weights };
        assert!([BoxCoder::PROPOSALS, BoxCoder::BOXES].contains(&coder));
        let (proposals, truths) = (boxes(&case["proposals"]), boxes(&case["gt"]));
        let pairs = || truths.iter().zip(&proposals);
        let encoded: Vec<[f32; 4]> = pairs().map(|(t, p)| coder.encode(t, p)).collect();
        assert_near(encoded.as_flattened(), &numbers(&case["encoded"]));
        let decoded: Vec<BBox> = encoded.iter().zip(&proposals).map(|(e, p)| coder.decode(*e, p)).collect();
        assert_near(&sides(&decoded), &numbers(&case["decoded"]));
        let wild: [f32; 4] = numbers(&case["big_deltas"]).try_into().unwrap();
        assert_near(&sides(&[coder.decode(wild, &proposals[0])]), &numbers(&case["big_decoded"]));
    }
}

#[test]
fn anchors_of_two_levels() {
    let all = &reference()["anchors"];
    let sizes: Vec<Vec<f32>> = all["sizes"].as_array().unwrap().iter().map(numbers).collect();
    let anchors = Anchors { sizes, aspect_ratios: numbers(&all["aspect_ratios"]) };
    let picture: [usize; 2] = counts(&all["image_hw"]).try_into().unwrap();
    let mut ours = Vec::new();
    for (level, map) in [[4, 6], [2, 3]].into_iter().enumerate() {
        assert_eq!(anchors.around_origin(level), boxes(&all["cell_anchors"][level]));
        ours.extend(anchors.of_level(level, map, picture));
    }
    assert_eq!(ours, boxes(&all["anchors"]));
}

#[test]
fn matches_of_anchors_and_of_proposals() {
    let as_numbers = |matches: Vec<Match>| -> Vec<i64> {
        let number = |found: &Match| match found {
            Match::Object(i) => *i as i64,
            Match::Background => -1,
            Match::Ignored => -2,
        };
        matches.iter().map(number).collect()
    };
    let reference = reference();
    for (name, keep_best) in [("matcher", true), ("matcher_roi", false)] {
        let case = &reference[name];
        let bound = |key: &str| case[key].as_f64().unwrap() as f32;
        let matcher = Matcher { high: bound("high"), low: bound("low"), keep_best };
        let table: Vec<Vec<f32>> =
            reference["matcher"]["iou_gt_by_anchor"].as_array().unwrap().iter().map(numbers).collect();
        let ours = as_numbers(matcher.by_overlap(&table, table[0].len()));
        let theirs: Vec<i64> =
            case["matches"].as_array().unwrap().iter().map(|v| v.as_i64().unwrap()).collect();
        assert_eq!(ours, theirs, "{name}");
    }
    // A background box inside an ignored region is ignored.
    let matcher = Matcher { high: 0.5, low: 0.3, keep_best: false };
    let region = [BBox::new(0.0, 0.0, 50.0, 50.0)];
    let seen = [BBox::new(10.0, 10.0, 20.0, 20.0), BBox::new(45.0, 45.0, 60.0, 60.0)];
    assert_eq!(matcher.matches(&[], &region, &seen), [Match::Ignored, Match::Background]);
}

#[test]
fn regions_of_features_and_their_gradient() {
    let reference = reference();
    let device = Device::flex().autodiff();
    let rois = numbers(&reference["roi_align_input"]["rois_batch_xyxy"]);
    let regions: Vec<Region> = rois
        .chunks_exact(5)
        .map(|r| Region { picture: r[0] as usize, bbox: BBox::new(r[1], r[2], r[3], r[4]) })
        .collect();
    for case in reference["roi_align"].as_array().unwrap() {
        let samples = usize::try_from(case["sampling_ratio"].as_i64().unwrap()).ok();
        let size: [usize; 2] = counts(&case["output_size"]).try_into().unwrap();
        let align = RoiAlign { size, samples, is_aligned: case["aligned"].as_bool().unwrap() };
        let x: Tensor<4> = tensor(&reference["roi_align_input"]["x"], &device);
        let x = x.require_grad();
        let pooled = align.pool(x.clone(), &regions, case["spatial_scale"].as_f64().unwrap() as f32);
        assert_near(&read_values(pooled.clone()).unwrap(), &numbers(&case["out"]));
        let count = pooled.dims().iter().product::<usize>();
        let upstream = (0..count).map(|i| -1.0 + 2.0 * i as f32 / (count - 1) as f32).collect::<Vec<_>>();
        let upstream = Tensor::<4>::from_data(TensorData::new(upstream, pooled.dims()), &device);
        let gradient = x.grad(&(pooled * upstream).sum().backward()).unwrap();
        let theirs = numbers(&case["grad_input_for_upstream_linspace(-1,1)"]);
        let ours: Vec<f32> = gradient.into_data().try_to_vec().unwrap();
        assert_near(&ours, &theirs);
    }
}

#[test]
fn levels_clipping_and_suppression() {
    let reference = reference();
    let levels = &reference["fpn_level_mapper"];
    let mapper = FasterRcnnConfig::torchvision(BackboneKind::Resnet50, 90).boxes.level;
    assert_eq!(mapper, LevelOfBox { finest: 2, coarsest: 5, canonical_size: 224.0, canonical_level: 4 });
    let ours: Vec<usize> = boxes(&levels["boxes"]).iter().map(|b| mapper.of(b)).collect();
    assert_eq!(ours, counts(&levels["level_index"]));

    let nms = &reference["nms"];
    let (all, scores, classes) = (boxes(&nms["boxes"]), numbers(&nms["scores"]), counts(&nms["class"]));
    for (most, kept) in nms["keep"].as_object().unwrap() {
        let most: f32 = most.parse().unwrap();
        assert_eq!(suppress(&all, &scores, &vec![0; all.len()], most, all.len()), counts(kept));
        let theirs = counts(&nms["keep_batched"][most.to_string()]);
        assert_eq!(suppress(&all, &scores, &classes, most, all.len()), theirs);
        let few = theirs.len() / 2;
        assert_eq!(suppress(&all, &scores, &classes, most, few), theirs[..few]);
    }

    let clip = &reference["clip_and_small"];
    let clipped: Vec<BBox> = all.iter().map(|b| b.clipped([60, 80])).take(6).collect();
    assert_near(&sides(&clipped), &numbers(&clip["clipped_to_60x80"])[..24]);
    let large = |side: f32| (0..all.len()).filter(|i| all[*i].is_at_least(side)).collect::<Vec<_>>();
    assert_eq!(large(20.0), counts(&clip["keep_min_size_20"]));
}

#[test]
fn losses() {
    let reference = reference();
    let device = Device::flex();
    let value = |loss: Tensor<1>| read_values(loss).unwrap();
    let of = |case: &Value, key: &str| vec![case[key].as_f64().unwrap() as f32];

    let case = &reference["smooth_l1"];
    let pair = || [&case["pred"], &case["target"]].map(|v| tensor::<1>(v, &device));
    for (beta, key) in [(1.0 / 9.0, "beta_1/9_sum"), (1.0, "beta_1_sum")] {
        let [predicted, target] = pair();
        assert_near(&value(smooth_l1(predicted, target, beta)), &of(case, key));
    }

    let case = &reference["fastrcnn_loss"];
    let classes = counts(&case["labels"]);
    let targets: Vec<[f32; 4]> =
        numbers(&case["regression_targets"]).chunks_exact(4).map(|t| t.try_into().unwrap()).collect();
    let offsets = tensor(&case["box_regression"], &device);
    let [by_class, by_box] = box_losses(tensor(&case["logits"], &device), offsets, &classes, &targets);
    assert_near(&value(by_class), &of(case, "loss_cls"));
    assert_near(&value(by_box), &of(case, "loss_box"));

    let case = &reference["sigmoid_focal"];
    let pair = || [&case["logits"], &case["targets"]].map(|v| tensor::<2>(v, &device));
    let [logits, targets] = pair();
    assert_near(&read_values(focal(logits, targets, 0.25, 2)).unwrap(), &numbers(&case["none"]));
    let [logits, targets] = pair();
    assert_near(&value(focal(logits, targets, 0.25, 2).sum()), &of(case, "sum"));
    let [logits, targets] = pair();
    let entropy = binary_cross_entropy(logits, targets).mean();
    assert_near(&value(entropy), &of(&reference["bce_with_logits"], "mean"));
}

#[test]
fn proposals_from_features_to_boxes() {
    let reference = reference();
    let case = &reference["rpn_end_to_end"];
    let device = Device::flex();
    // The weights as a file, with torchvision's names.
    let weights: Vec<NamedTensor> = (case["state"].as_object().unwrap().iter())
        .map(|(name, value)| {
            let bytes = numbers(value).iter().flat_map(|v| v.to_le_bytes()).collect();
            (name.clone(), shape(value), bytes)
        })
        .collect();
    let bytes = safetensors_of(&weights, None).unwrap();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let anchors = &reference["anchors"];
    let count = |key: &str| case[key].as_u64().unwrap() as usize;
    let config = ProposalConfig {
        anchors: Anchors {
            sizes: anchors["sizes"].as_array().unwrap().iter().map(numbers).collect(),
            aspect_ratios: numbers(&anchors["aspect_ratios"]),
        },
        before_suppression: [count("pre_nms_top_n"); 2],
        after_suppression: [count("post_nms_top_n"); 2],
        most_overlap: case["nms_thresh"].as_f64().unwrap() as f32,
        ..FasterRcnnConfig::torchvision(BackboneKind::Resnet50, 90).proposals
    };
    let maps: Vec<Tensor<4>> = ["0", "1"].map(|level| tensor(&case["features"][level], &device)).to_vec();
    let ours = proposals_of(&Parameters::read(&file, 1, &device), &maps, config, [64, 96]);
    assert_eq!(ours.len(), 1);
    assert_near(&sides(&ours[0]), &numbers(&case["proposals"]));
}

#[test]
fn weights_of_torchvision_fit_by_name_and_shape() {
    let reference = reference();
    let names = reference["fasterrcnn_resnet50_fpn_state_dict_names"].as_object().unwrap();
    // Zeros of f16 keep the file small; the variances must be positive, but nothing is computed here.
    let longest = names.values().map(|s| counts(s).iter().product::<usize>()).max().unwrap();
    let zeros = vec![0_u8; 2 * longest];
    let file = |but: &str| {
        let kept = names.iter().filter(|(name, _)| *name != but && !name.ends_with("num_batches_tracked"));
        let views: BTreeMap<&str, TensorView> = kept
            .map(|(name, shape)| {
                let shape = counts(shape);
                let bytes = &zeros[..2 * shape.iter().product::<usize>()];
                (name.as_str(), TensorView::new(Dtype::F16, shape, bytes).unwrap())
            })
            .collect();
        safetensors::serialize(views, None).unwrap()
    };
    let read = |bytes: &[u8], classes| {
        AnyDetector::from_torchvision(BackboneKind::Resnet50, classes, bytes, &Device::flex())
    };
    let detector = read(&file(""), 90).unwrap();
    // Statistics and factors of the normalisations are weights as well here.
    let statistics: usize = (names.iter())
        .filter(|(name, _)| name.contains("running_"))
        .map(|(_, shape)| counts(shape).iter().product::<usize>())
        .sum();
    let theirs = reference["fasterrcnn_resnet50_fpn_parameters"].as_u64().unwrap() as usize;
    assert_eq!(detector.num_params(), theirs + statistics);
    // What is missing or of another shape is named.
    let missing = read(&file("backbone.fpn.layer_blocks.2.0.bias"), 90).unwrap_err().to_string();
    assert!(missing.contains("`backbone.fpn.layer_blocks.2.0.bias` is missing"), "{missing}");
    let other = read(&file(""), 2).unwrap_err().to_string();
    assert!(other.contains("cls_score.weight") && other.contains("[91, 1024]"), "{other}");
    assert!(read(b"not a file", 90).is_err());
    for kind in [DetectorKind::FasterRcnn, DetectorKind::Fcos] {
        for backbone in [BackboneKind::Resnet18, BackboneKind::MobilenetV2] {
            kind.init(backbone, 2, 1, &Device::flex()).unwrap();
        }
    }
}
