//! Cross-entropy of the classes of pixels, for a segmentation.

use burn::prelude::*;
use burn::tensor::activation::log_softmax;

use super::LossError;

/// The label of a pixel that is ignored: it has neither a loss nor a score.
pub const IGNORED: u8 = 255;

/// The mean of `-log p(class of the pixel)` over the labelled pixels of a batch, where `p = softmax(logits)` over the classes. A pixel counts as much
/// as the weight of its class says.
///
/// `logits`: `[batch, classes, height, width]`. `labels`: the class of each pixel, picture by picture and row by row, or [`IGNORED`]. `weights`: one
/// for each class, positive. An ignored pixel has no share in the loss, and no gradient. Without a labelled pixel the loss is 0. Fails if there is not
/// a label for each pixel and a weight for each class, or if a label is no class.
pub fn cross_entropy(logits: Tensor<4>, labels: &[u8], weights: &[f64]) -> Result<Tensor<1>, LossError> {
    let [batch, classes, height, width] = logits.dims();
    let pixels = batch * height * width;
    if labels.len() != pixels {
        return Err(LossError::LabelCount { labels: labels.len(), pixels });
    }
    if weights.len() != classes {
        return Err(LossError::WeightCount { weights: weights.len(), classes });
    }
    if let Some(label) = labels.iter().find(|label| usize::from(**label) >= classes && **label != IGNORED) {
        return Err(LossError::NoClass { label: *label, classes });
    }
    // The weight at the class of each labelled pixel; the row of an ignored one is zero, and so is its gradient.
    let mut wanted = vec![0.0_f32; pixels * classes];
    let plane = height * width;
    for (pixel, label) in labels.iter().enumerate().filter(|(_, label)| **label != IGNORED) {
        let (picture, place) = (pixel / plane, pixel % plane);
        wanted[(picture * classes + usize::from(*label)) * plane + place] =
            weights[usize::from(*label)] as f32;
    }
    let wanted =
        Tensor::<4>::from_data(TensorData::new(wanted, [batch, classes, height, width]), &logits.device());
    let picked = log_softmax(logits, 1) * wanted;
    let counted = label_weight(labels, weights);
    Ok(picked.sum() / -(if counted > 0.0 { counted } else { 1.0 }))
}

/// The sum of the weights of the labelled pixels: what [`cross_entropy`] divides by.
pub fn label_weight(labels: &[u8], weights: &[f64]) -> f64 {
    let mut pixels = vec![0_usize; weights.len()];
    for label in labels.iter().filter(|label| **label != IGNORED) {
        pixels[usize::from(*label)] += 1;
    }
    pixels.into_iter().zip(weights).map(|(count, weight)| count as f64 * weight).sum()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const SHAPE: [usize; 4] = [2, 3, 4, 5];

    fn drawn(seed: u64) -> (Vec<f32>, Vec<u8>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let logits = (0..SHAPE.iter().product()).map(|_| 8.0 * random.random::<f32>() - 4.0).collect();
        let labels = (0..2 * 4 * 5).map(|_| [0, 1, 2, IGNORED][random.random_range(0..4)]).collect();
        (logits, labels)
    }

    /// The loss pixel by pixel, and its gradient `w (p - 1 at the class) / sum of w`, in double precision.
    fn reference(logits: &[f32], labels: &[u8], weights: [f64; 3]) -> (f64, Vec<f64>) {
        let [_, classes, height, width] = SHAPE;
        let plane = height * width;
        let labelled = labels.iter().filter(|label| **label != IGNORED);
        let all: f64 = labelled.map(|label| weights[usize::from(*label)]).sum();
        let (mut loss, mut gradient) = (0.0, vec![0.0; logits.len()]);
        for (pixel, label) in labels.iter().enumerate().filter(|(_, label)| **label != IGNORED) {
            let at = |class: usize| (pixel / plane * classes + class) * plane + pixel % plane;
            let powers: Vec<f64> = (0..classes).map(|class| f64::from(logits[at(class)]).exp()).collect();
            let sum: f64 = powers.iter().sum();
            let share = weights[usize::from(*label)] / all;
            loss -= share * (powers[usize::from(*label)] / sum).ln();
            for class in 0..classes {
                let is_it = f64::from(u8::from(class == usize::from(*label)));
                gradient[at(class)] = share * (powers[class] / sum - is_it);
            }
        }
        (loss, gradient)
    }

    #[test]
    fn loss_and_gradient_are_those_of_the_plain_formula_and_ignored_pixels_have_none() {
        let device = Device::flex().autodiff();
        for seed in 0..20 {
            let weights = if seed < 10 { [1.0; 3] } else { [0.5, 1.0, 7.0] };
            let (values, labels) = drawn(seed);
            let logits =
                Tensor::<4>::from_data(TensorData::new(values.clone(), SHAPE), &device).require_grad();
            let loss = cross_entropy(logits.clone(), &labels, &weights).unwrap();
            let gradient = logits.grad(&loss.backward()).unwrap().into_data().try_to_vec::<f32>().unwrap();
            let (expected, slopes) = reference(&values, &labels, weights);
            let loss = f64::from(loss.into_data().try_to_vec::<f32>().unwrap()[0]);
            assert!((loss - expected).abs() < 1e-5 * expected, "{loss} {expected}");
            for (i, (found, slope)) in gradient.iter().zip(&slopes).enumerate() {
                assert!((f64::from(*found) - slope).abs() < 1e-6, "{i}: {found} {slope}");
            }
            let plane = SHAPE[2] * SHAPE[3];
            for (pixel, _) in labels.iter().enumerate().filter(|(_, label)| **label == IGNORED) {
                let at = |class: usize| gradient[(pixel / plane * SHAPE[1] + class) * plane + pixel % plane];
                assert_eq!([at(0), at(1), at(2)], [0.0; 3], "an ignored pixel has no gradient");
            }
        }
    }

    #[test]
    fn pictures_without_labels_have_no_loss_and_wrong_labels_are_refused() {
        let logits = Tensor::<4>::ones(SHAPE, &Device::flex());
        let loss = |labels: &[u8], weights: &[f64]| cross_entropy(logits.clone(), labels, weights);
        let none = loss(&[IGNORED; 40], &[1.0; 3]).unwrap();
        assert_eq!(none.into_data().try_to_vec::<f32>().unwrap(), [0.0]);
        let refused = |labels: &[u8], weights: &[f64]| loss(labels, weights).unwrap_err().to_string();
        assert!(refused(&[0; 39], &[1.0; 3]).contains("39 labels for 40 pixels"));
        assert!(refused(&[3; 40], &[1.0; 3]).contains("label 3"));
        assert!(refused(&[0; 40], &[1.0; 2]).contains("2 weights for 3 classes"));
    }
}
