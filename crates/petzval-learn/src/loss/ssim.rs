//! Structural similarity on the tape.

use burn::prelude::*;
use petzval_camera::quality::{SSIM_C1, SSIM_C2, SSIM_WINDOW, ssim_window};

use super::{LossError, same_shape};
use crate::convolution;

/// The mean structural similarity of two pictures `[batch, 3, height, width]` of values 0..1, with a gradient to both; 1 for equal
/// pictures. Returns one value. Sides below 11 pixels are refused.
///
/// It is the score `ssim` of `score` in single precision: per channel and window of 11 x 11 pixels with Gaussian weights w,
/// sigma 1.5, that lies inside the picture,
///
/// ```text
/// ssim = (2 ma mb + C1) (2 vab + C2) / ((ma^2 + mb^2 + C1) (va + vb + C2))
/// ma = w * a,   va = w * a^2 - ma^2,   vab = w * (a b) - ma mb,   C1 = 0.01^2,   C2 = 0.03^2
/// ```
///
/// Source: Z. Wang, A. Bovik, H. Sheikh, E. Simoncelli, "Image quality assessment: from error visibility to structural similarity", IEEE TIP
/// 13, 2004.
pub fn ssim(image: Tensor<4>, target: Tensor<4>) -> Result<Tensor<1>, LossError> {
    same_shape(image.dims(), target.dims())?;
    let [batch, channels, height, width] = image.dims();
    if height.min(width) < SSIM_WINDOW {
        return Err(LossError::SmallerThanWindow { height, width, least: SSIM_WINDOW });
    }
    // Every channel of every picture is a picture of one channel.
    let planes = |x: Tensor<4>| x.reshape([batch * channels, 1, height, width]);
    let (a, b) = (planes(image), planes(target));

    // Blur the two pictures and their products over the window.
    let (ma, mb) = (blurred(a.clone()), blurred(b.clone()));
    let (aa, bb) = (blurred(a.clone().square()), blurred(b.clone().square()));
    let ab = blurred(a * b);

    // Compare luminance, contrast and structure in every window.
    let (c1, c2) = (SSIM_C1 as f32, SSIM_C2 as f32);
    let squares = ma.clone().square() + mb.clone().square();
    let product = ma * mb;
    let variances = aa + bb - squares.clone();
    let covariance = ab - product.clone();
    let similar = (product * 2.0 + c1) * (covariance * 2.0 + c2);
    let largest = (squares + c1) * (variances + c2);
    Ok((similar / largest).mean_dim(3).mean())
}

/// Means over the windows that lie inside the picture, along columns and then along rows.
fn blurred(x: Tensor<4>) -> Tensor<4> {
    let device = x.device();
    let weights: Vec<f32> = ssim_window().iter().map(|w| *w as f32).collect();
    let along = |shape: [usize; 4]| Tensor::from_data(TensorData::new(weights.clone(), shape), &device);
    let down = convolution::of_loss(x, along([1, 1, SSIM_WINDOW, 1]), None, 1, 0);
    convolution::of_loss(down, along([1, 1, 1, SSIM_WINDOW]), None, 1, 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use petzval_camera::quality::ssim_gaussian_wang;

    const SHAPE: [usize; 4] = [2, 3, 14, 17];

    /// Two pictures with edges, ramps and differences that are not small.
    fn pictures() -> [Vec<f32>; 2] {
        let count = SHAPE.iter().product::<usize>();
        let value = |i: usize, phase: f32| (0.5 + 0.3 * (0.37 * i as f32 + phase).sin()).clamp(0.0, 1.0);
        let edge = |i: usize| if i % 17 > 8 { 0.15 } else { 0.0 };
        [(0..count).map(|i| value(i, 0.0) + edge(i)).collect(), (0..count).map(|i| value(i, 0.4)).collect()]
    }

    fn tensor(values: &[f32], device: &Device) -> Tensor<4> {
        Tensor::from_data(TensorData::new(values.to_vec(), SHAPE), device)
    }

    fn value(a: &[f32], b: &[f32]) -> f32 {
        let device = Device::flex();
        ssim(tensor(a, &device), tensor(b, &device)).unwrap().into_scalar()
    }

    #[test]
    fn it_is_the_score_in_single_precision() {
        let [a, b] = pictures();
        let [batch, channels, height, width] = SHAPE;
        let half = a.len() / batch;
        let of = |i: usize| {
            let part = i * half..(i + 1) * half;
            ssim_gaussian_wang(&b[part.clone()], &a[part], channels, height, width).unwrap()
        };
        let expected = (0..batch).map(of).sum::<f64>() / batch as f64;
        let found = f64::from(value(&a, &b));
        assert!((found - expected).abs() < 2e-6, "{found} {expected}");
        assert!(expected < 0.95, "{expected}");
        assert!((value(&a, &a) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn its_gradient_is_that_of_finite_differences() {
        let [a, b] = pictures();
        let device = Device::flex().autodiff();
        let image = tensor(&a, &device).require_grad();
        let gradients = ssim(image.clone(), tensor(&b, &device)).unwrap().backward();
        let slopes: Vec<f32> = image.grad(&gradients).unwrap().into_data().try_to_vec().unwrap();
        // Along the gradient, and along a direction that has nothing to do with it.
        let norm = slopes.iter().map(|s| s * s).sum::<f32>().sqrt();
        let along: Vec<f32> = slopes.iter().map(|s| s / norm).collect();
        let across: Vec<f32> = (0..a.len()).map(|i| 0.03 * (1.7 * i as f32).cos()).collect();
        for direction in [along, across] {
            let expected: f32 = slopes.iter().zip(&direction).map(|(s, d)| s * d).sum();
            let at = |step: f32| {
                let moved: Vec<f32> = a.iter().zip(&direction).map(|(v, d)| v + step * d).collect();
                value(&moved, &b)
            };
            let found = (at(0.1) - at(-0.1)) / 0.2;
            assert!((found - expected).abs() < 0.02 * norm, "{found} {expected} {norm}");
        }
    }

    #[test]
    fn a_picture_smaller_than_the_window_is_refused() {
        let device = Device::flex();
        let small = Tensor::<4>::zeros([1, 3, 10, 40], &device);
        assert!(matches!(ssim(small.clone(), small), Err(LossError::SmallerThanWindow { .. })));
    }
}
