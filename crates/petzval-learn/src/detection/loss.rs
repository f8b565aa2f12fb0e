//! The parts of a detector's loss.

use burn::prelude::*;
use burn::tensor::activation::{log_sigmoid, log_softmax};

/// `sum over elements of d^2 / (2 beta)` where `|d| < beta`, else `|d| - beta / 2`; `d` is the difference of the two.
pub fn smooth_l1<const D: usize>(predicted: Tensor<D>, target: Tensor<D>, beta: f32) -> Tensor<1> {
    let distance = (predicted - target).abs();
    // The part of the distance below beta is squared, the rest is linear.
    let near = distance.clone().clamp_max(beta);
    let far = distance - near.clone();
    (near.square() / (2.0 * beta) + far).sum()
}

/// Cross entropy of logits with targets of 0 and 1, element by element: `-t ln s(x) - (1 - t) ln(1 - s(x))` with the sigmoid `s`.
pub fn binary_cross_entropy<const D: usize>(logits: Tensor<D>, targets: Tensor<D>) -> Tensor<D> {
    let without = (targets.clone() * -1.0 + 1.0) * log_sigmoid(logits.clone().neg());
    (targets * log_sigmoid(logits) + without).neg()
}

/// The focal loss (Lin 2017), element by element: `alpha_t (1 - p_t)^gamma CE`, where `p_t` is the probability of the truth.
pub fn focal<const D: usize>(logits: Tensor<D>, targets: Tensor<D>, alpha: f32, gamma: i32) -> Tensor<D> {
    let entropy = binary_cross_entropy(logits, targets.clone());
    let missing = entropy.clone().neg().exp() * -1.0 + 1.0;
    let weight = targets * (2.0 * alpha - 1.0) + (1.0 - alpha);
    weight * missing.powi_scalar(gamma) * entropy
}

/// Cross entropy of logits `[items, classes]` with a class each, the mean over items.
pub fn cross_entropy(logits: Tensor<2>, classes: &[usize]) -> Tensor<1> {
    let [items, _] = logits.dims();
    let index = classes.iter().map(|class| *class as i64).collect::<Vec<_>>();
    let index = Tensor::<2, Int>::from_data(TensorData::new(index, [items, 1]), &logits.device());
    log_softmax(logits, 1).gather(1, index).mean().neg()
}

/// `1 - GIoU` (Rezatofighi 2019) of boxes `[items, 4]` given by their corners `x1, y1, x2, y2`, `[items]`.
pub fn generalised_iou(predicted: Tensor<2>, target: Tensor<2>) -> Tensor<1> {
    const EPSILON: f32 = 1e-7;
    let [items, _] = predicted.dims();
    let side = |of: &Tensor<2>, i: usize| of.clone().slice([0..items, i..i + 1]).reshape([items]);
    let [p, t] = [&predicted, &target].map(|of| [0, 1, 2, 3].map(|i| side(of, i)));
    let area = |b: &[Tensor<1>; 4]| (b[2].clone() - b[0].clone()) * (b[3].clone() - b[1].clone());
    let lower = |i: usize| p[i].clone().min_pair(t[i].clone());
    let upper = |i: usize| p[i].clone().max_pair(t[i].clone());
    let shared = (lower(2) - upper(0)).clamp_min(0.0) * (lower(3) - upper(1)).clamp_min(0.0);
    let union = area(&p) + area(&t) - shared.clone();
    let around = (upper(2) - lower(0)) * (upper(3) - lower(1));
    let iou = shared / (union.clone() + EPSILON);
    let empty = (around.clone() - union) / (around + EPSILON);
    iou.neg() + empty + 1.0
}
