//! A detector of one stage without anchors, after FCOS (Tian 2019): every place of the pyramid says which object its centre lies in, and how
//! far the sides of its box are.

use burn::module::Module;
use burn::prelude::*;
use burn::tensor::activation::sigmoid;
use petzval_base::Cancel;
use serde::Serialize;

use super::backbone::{Backbone, BackboneKind};
use super::box_head::best;
use super::layers::{Conv, ConvShape};
use super::loss::{binary_cross_entropy, focal, generalised_iou};
use super::parameters::{Parameters, Start, tensor};
use super::pyramid::Pyramid;
use super::{BBox, Detection, Detector, Truth, features_unless, named, normalized, seen_sides};
use crate::loss::image_loss::read_numbers;
use crate::loss::{LossError, NamedLoss};
use crate::network::NetworkError;
use crate::weight_file::NamedArray;

/// The parts of the detector and their settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FcosConfig {
    /// The backbone.
    pub backbone: BackboneKind,
    /// Channels of the pyramid and of the two towers.
    pub channels: usize,
    /// Convolutions of each tower.
    pub depth: usize,
    /// Classes.
    pub classes: usize,
    /// Distance from the centre of a box within which a place is to find it, strides of the level.
    pub radius: f32,
    /// Largest distance from a place to a side of its box on each level but the last, strides.
    pub reach: f32,
    /// Least score of a detection.
    pub least_score: f32,
    /// Overlap above which the better of two detections of a class suppresses the other.
    pub most_overlap: f32,
    /// Most detections of a picture.
    pub most_detections: usize,
}

impl FcosConfig {
    /// A detector that trains on two processor cores.
    pub fn small(classes: usize) -> Self {
        Self {
            backbone: BackboneKind::Small,
            channels: 48,
            depth: 2,
            classes,
            radius: 1.5,
            reach: 8.0,
            least_score: 0.05,
            most_overlap: 0.5,
            most_detections: 100,
        }
    }
}

/// Weight of the objects against the background, and how much sure places count less, in the focal loss.
const ALPHA: f32 = 0.25;
const GAMMA: i32 = 2;

/// Slope of the rectifiers for negative values.
const SLOPE: f32 = 0.1;

/// Probability of an object at which the logits start.
const FIRST_PROBABILITY: f32 = 0.01;

/// Largest logarithm of a distance, strides.
const LARGEST_LOG: f32 = 5.0;

/// A detector of one stage.
#[derive(Module, Debug)]
pub struct Fcos {
    body: Backbone,
    pyramid: Pyramid,
    class_tower: Vec<Conv>,
    box_tower: Vec<Conv>,
    logits: Conv,
    distances: Conv,
    centredness: Conv,
    #[module(skip)]
    config: FcosConfig,
}

/// A place of the pyramid.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    /// Its centre, pixels of the picture, `[x, y]`.
    at: [f32; 2],
    /// Pixels of the picture between neighbours.
    stride: f32,
    level: usize,
}

/// What the detector says at every place of every picture.
struct Seen {
    /// `[batch, places, classes]`.
    logits: Tensor<3>,
    /// Logarithms of the distances to the left, upper, right and lower side over the stride, `[batch, places, 4]`.
    distances: Tensor<3>,
    /// Logits of how central the place is in its box, `[batch, places, 1]`.
    centredness: Tensor<3>,
    places: Vec<Place>,
}

impl Fcos {
    /// A detector with weights drawn from `seed` alone.
    pub fn new(config: FcosConfig, seed: u64, device: &Device) -> Result<Self, NetworkError> {
        Self::with(config, &Parameters::drawn(seed, device))
    }

    /// A detector with the given weights.
    pub(crate) fn with(config: FcosConfig, from: &Parameters) -> Result<Self, NetworkError> {
        let same = ConvShape::new(config.channels, config.channels, 3);
        let tower = |name: &str| {
            let conv = |i| Conv::new(from, &format!("head.{name}.{i}"), same, same.rectified(), 0.0);
            (0..config.depth).map(conv).collect::<Result<Vec<_>, _>>()
        };
        let last = |name: &str, outputs: usize, bias: f32| {
            let shape = ConvShape { outputs, ..same };
            Conv::new(from, &format!("head.{name}"), shape, Start::Normal(0.01), bias)
        };
        let odds = FIRST_PROBABILITY / (1.0 - FIRST_PROBABILITY);
        let inputs = Backbone::channels(config.backbone);
        Ok(Self {
            body: Backbone::new(config.backbone, from, "backbone.body")?,
            pyramid: Pyramid::new(from, "backbone.fpn", &inputs, config.channels)?,
            class_tower: tower("class_tower")?,
            box_tower: tower("box_tower")?,
            logits: last("logits", config.classes, odds.ln())?,
            distances: last("distances", 4, 1.0)?,
            centredness: last("centredness", 1, 0.0)?,
            config,
        })
    }

    /// Logits, distances and centredness of each level, as planes.
    fn outputs(&self, pictures: Tensor<4>) -> Vec<Tensor<4>> {
        self.outputs_of(self.body.features(normalized(pictures)).collect())
    }

    /// [`outputs`](Self::outputs) of pictures of which the backbone sees these features.
    fn outputs_of(&self, features: Vec<Tensor<4>>) -> Vec<Tensor<4>> {
        let maps = self.pyramid.forward(features);
        let of_level = |map: Tensor<4>| {
            let through = |tower: &[Conv]| tower.iter().fold(map.clone(), |x, conv| conv.leaky(x, SLOPE));
            let (classes, boxes) = (through(&self.class_tower), through(&self.box_tower));
            [
                self.logits.forward(classes),
                self.distances.forward(boxes.clone()),
                self.centredness.forward(boxes),
            ]
        };
        maps.into_iter().flat_map(of_level).collect()
    }

    fn seen(&self, pictures: Tensor<4>) -> Seen {
        let [_, _, height, width] = pictures.dims();
        by_place(&self.outputs(pictures), [height, width])
    }

    /// See [`AnyDetector::heads`](super::AnyDetector::heads).
    pub(super) fn heads(&self, pictures: Tensor<4>) -> Result<Vec<NamedArray>, LossError> {
        let seen = self.seen(pictures);
        let [batch, places, _] = seen.logits.dims();
        Ok(vec![
            named("logits", seen.logits, "scores of objects")?,
            named("distances", seen.distances, "boxes of objects")?,
            named("centredness", seen.centredness.reshape([batch, places]), "scores of objects")?,
        ])
    }

    /// The object that each place is to find; none for background. Of several objects the smallest.
    fn assigned(&self, places: &[Place], truth: &Truth) -> Vec<Assigned> {
        let levels = places.last().map_or(0, |p| p.level);
        places
            .iter()
            .map(|place| {
                let fits = |bbox: &BBox| {
                    let (sides, [x, y]) = (sides(place, bbox), bbox.centre());
                    let near = self.config.radius * place.stride;
                    let is_near = (place.at[0] - x).abs() < near && (place.at[1] - y).abs() < near;
                    let is_inside = sides.iter().all(|side| *side > 0.0);
                    let farthest = sides.iter().copied().fold(0.0, f32::max) / place.stride;
                    let least = if place.level == 0 { 0.0 } else { 0.5 * self.config.reach };
                    let most = if place.level == levels { f32::INFINITY } else { self.config.reach };
                    is_near && is_inside && farthest >= least && farthest < most
                };
                let objects = truth.objects.iter().enumerate().filter(|(_, o)| fits(&o.bbox));
                let smallest = objects.min_by(|a, b| a.1.bbox.area().total_cmp(&b.1.bbox.area()));
                match smallest {
                    Some((number, _)) => Assigned::Object(number),
                    None if truth
                        .ignored
                        .iter()
                        .any(|r| sides(place, &r.bbox).iter().all(|side| *side > 0.0)) =>
                    {
                        Assigned::Ignored
                    }
                    None => Assigned::Background,
                }
            })
            .collect()
    }
}

/// Logits, distances and centredness of all levels, three planes after three, by place. The pictures have this height and width.
fn by_place(outputs: &[Tensor<4>], picture: [usize; 2]) -> Seen {
    let [height, width] = seen_sides(picture);
    let by_place = |x: &Tensor<4>| {
        let [batch, values, rows, columns] = x.dims();
        x.clone().permute([0, 2, 3, 1]).reshape([batch, rows * columns, values])
    };
    let (mut logits, mut distances, mut centredness) = (Vec::new(), Vec::new(), Vec::new());
    let mut places = Vec::new();
    for (level, outputs) in outputs.chunks_exact(3).enumerate() {
        let [_, _, rows, columns] = outputs[0].dims();
        logits.push(by_place(&outputs[0]));
        distances.push(by_place(&outputs[1]));
        centredness.push(by_place(&outputs[2]));
        let stride = (height as f32 / rows as f32).max(width as f32 / columns as f32).log2().round().exp2();
        let centre = |i: usize| (i as f32 + 0.5) * stride;
        let of_row = |row: usize| {
            (0..columns).map(move |column| Place { at: [centre(column), centre(row)], stride, level })
        };
        places.extend((0..rows).flat_map(of_row));
    }
    let [logits, distances, centredness] =
        [logits, distances, centredness].map(|levels| Tensor::cat(levels, 1));
    Seen { logits, distances: distances.clamp_max(LARGEST_LOG), centredness, places }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Assigned {
    Object(usize),
    Background,
    Ignored,
}

/// Distances from a place to the left, upper, right and lower side of a box, pixels; negative outside.
fn sides(place: &Place, bbox: &BBox) -> [f32; 4] {
    let [x, y] = place.at;
    [x - bbox.x1, y - bbox.y1, bbox.x2 - x, bbox.y2 - y]
}

/// `sqrt(min(l, r) / max(l, r) min(t, b) / max(t, b))`: 1 in the middle of a box, 0 at its border.
fn centredness([left, upper, right, lower]: [f32; 4]) -> f32 {
    (left.min(right) / left.max(right) * upper.min(lower) / upper.max(lower)).sqrt()
}

impl Detector for Fcos {
    fn look(&self, pictures: Tensor<4>) -> Vec<Tensor<4>> {
        self.outputs(pictures)
    }

    fn loss_of_look(
        &self,
        look: Vec<Tensor<4>>,
        picture: [usize; 2],
        truths: &[Truth],
        _seed: u64,
    ) -> Result<NamedLoss, LossError> {
        let seen = by_place(&look, picture);
        let ([batch, count, classes], device) = (seen.logits.dims(), seen.logits.device());
        let mut targets = vec![0.0; batch * count * classes];
        let mut weights = vec![1.0; batch * count];
        let (mut rows, mut distances, mut central) = (Vec::new(), Vec::new(), Vec::new());
        for (item, truth) in truths.iter().enumerate() {
            for (i, (place, assigned)) in
                seen.places.iter().zip(self.assigned(&seen.places, truth)).enumerate()
            {
                let row = item * count + i;
                match assigned {
                    Assigned::Object(number) => {
                        let object = &truth.objects[number];
                        let sides = sides(place, &object.bbox);
                        targets[row * classes + object.class] = 1.0;
                        rows.push(row as i64);
                        distances.extend(sides.map(|side| side / place.stride));
                        central.push(centredness(sides));
                    }
                    Assigned::Ignored => weights[row] = 0.0,
                    Assigned::Background => {}
                }
            }
        }
        let positive = rows.len();
        let targets = tensor(targets, [batch, count, classes], &device);
        let weights = tensor(weights, [batch, count, 1], &device);
        let by_class = (focal(seen.logits, targets, ALPHA, GAMMA) * weights).sum() / positive.max(1) as f32;
        if positive == 0 {
            let nothing = || Tensor::zeros([1], &device);
            return NamedLoss::sum(vec![("class", by_class), ("box", nothing()), ("centredness", nothing())]);
        }
        let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [positive]), &device);
        let of = |x: Tensor<3>| {
            let [_, _, values] = x.dims();
            x.reshape([batch * count, values]).select(0, rows.clone())
        };
        // Boxes relative to their places: the overlap does not change by a shift or a factor.
        let sign = tensor(vec![-1.0, -1.0, 1.0, 1.0], [1, 4], &device);
        let predicted = of(seen.distances).exp() * sign.clone();
        let overlap = generalised_iou(predicted, tensor(distances, [positive, 4], &device) * sign);
        let central = tensor(central, [positive, 1], &device);
        let by_centre = binary_cross_entropy(of(seen.centredness), central);
        NamedLoss::sum(vec![("class", by_class), ("box", overlap.mean()), ("centredness", by_centre.mean())])
    }

    fn detect_unless(&self, cancel: &Cancel, pictures: Tensor<4>) -> Result<Vec<Vec<Detection>>, LossError> {
        let [batch, _, height, width] = pictures.dims();
        let features = features_unless(cancel, &self.body, pictures)?;
        let seen = by_place(&self.outputs_of(features), [height, width]);
        cancel.check()?;
        let [_, count, classes] = seen.logits.dims();
        let scores = (sigmoid(seen.logits) * sigmoid(seen.centredness)).sqrt();
        let scores = read_numbers(scores, "scores of objects")?;
        let distances = read_numbers(seen.distances.exp(), "boxes of objects")?;
        let of_picture = |item: usize| {
            let mut found = Vec::new();
            for (i, place) in seen.places.iter().enumerate() {
                let row = item * count + i;
                let [left, upper, right, lower] =
                    std::array::from_fn(|k| distances[4 * row + k] * place.stride);
                let [x, y] = place.at;
                let bbox = BBox::new(x - left, y - upper, x + right, y + lower).clipped([height, width]);
                for class in 0..classes {
                    let score = scores[row * classes + class];
                    if score > self.config.least_score && bbox.is_at_least(1.0) {
                        found.push(Detection { bbox, class, score });
                    }
                }
            }
            best(found, self.config.most_overlap, self.config.most_detections)
        };
        Ok((0..batch).map(of_picture).collect())
    }
}
