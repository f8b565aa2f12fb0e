//! The score-function estimator: a baseline for comparison, too noisy for images.

/// One-draw estimate of `d/dlambda E f(N)` for a Poisson count of rate `rate` (e-, > 0): `(f(N) - baseline) (N / rate - 1)`.
///
/// `N / rate - 1` is the derivative of the log probability of the count, so the estimate needs no derivative of `f`. It is unbiased for
/// every `f`, and for every `baseline` that does not depend on the count. Williams calls it REINFORCE ("Simple statistical
/// gradient-following algorithms", 1992). A baseline of `E f(N)` removes most of the spread. For a single pixel the remaining spread is
/// still several times the gradient. In a picture `f` is the loss of all pixels, so each pixel's estimate carries the noise of all the
/// others. The spread then grows with the number of pixels, and so does the number of frames to average. The function serves for
/// comparison.
///
/// The paper's noise layer may be this estimator. The layer makes a Poisson distribution of TensorFlow Probability from the
/// rate. That distribution is not reparameterised: its samples have no gradient with respect to the rate (TensorFlow 2.21
/// with TensorFlow Probability 0.25 returns none). Only its mean (gradient 1) and the log probability of a given count
/// (gradient `N / rate - 1`) have one. With the mean, the layer is
/// [`StraightThrough`](crate::sensor::NoiseMode::StraightThrough) or has no noise; with the log probability it is this
/// function; a normal approximation would be [`Gaussian`](crate::sensor::NoiseMode::Gaussian). The paper does not say which
/// it used.
pub fn score_function_gradient(value: f64, baseline: f64, count: f64, rate: f64) -> f64 {
    (value - baseline) * (count / rate - 1.0)
}
