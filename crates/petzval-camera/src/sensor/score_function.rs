//! The score-function estimator: the baseline that every sampler of counts has, and that no image should use.

/// One-draw estimate of `d/dlambda E f(N)` for a Poisson count of rate `rate` (e-, > 0): `(f(N) - baseline) (N / rate - 1)`.
///
/// `N / rate - 1` is the derivative of the log probability of the count, so the estimate needs no derivative of `f` and is
/// unbiased for every `f` and every `baseline` that does not depend on the count (Williams, "Simple statistical
/// gradient-following algorithms", 1992, where it is called REINFORCE). A baseline of `E f(N)` takes off most of the
/// spread, and what remains is still several times the gradient for a single pixel. In a picture `f` is the loss of all
/// pixels, so each pixel's estimate carries the noise of all the others: the spread grows with the number of pixels,
/// and averages over frames are needed in proportion. It is here as the yardstick.
///
/// It is also one of the few things that the paper's noise layer can mean. The layer makes a Poisson distribution of
/// TensorFlow Probability from the rate. That distribution declares itself not reparameterised: its samples have no
/// gradient by the rate (TensorFlow 2.21 with TensorFlow Probability 0.25 returns none), only its mean (gradient 1) and
/// the log probability of a given count (gradient `N / rate - 1`) have. With the mean the layer is
/// [`StraightThrough`](crate::sensor::NoiseMode::StraightThrough) or no noise at all; with the log probability it is this
/// function; a normal approximation would be [`Gaussian`](crate::sensor::NoiseMode::Gaussian). Which one it was, the
/// paper does not say.
pub fn score_function_gradient(value: f64, baseline: f64, count: f64, rate: f64) -> f64 {
    (value - baseline) * (count / rate - 1.0)
}
