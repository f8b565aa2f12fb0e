//! One convolution on a device beside the CPU: result, gradient of the input, gradient of the weights.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use burn::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{milliseconds, noise, text_of};
use crate::convolution::{Convolution, ConvolutionKind, of_loss};
use crate::network::{
    Prologue, conv_by_framework, conv_leaky, depthwise, depthwise_by_framework, gated_pointwise,
    mix_by_framework, normalized_pointwise, pointwise,
};

/// A convolution on a device beside the CPU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConvolutionCheck {
    /// The convolution.
    pub convolution: Convolution,
    /// Largest difference of each pass from the CPU, by the largest value of that pass, in the worst repetition. None if the device failed, or
    /// gave what is no number.
    pub errors: Option<PassErrors>,
    /// Why the convolution does not pass; none if it passes.
    pub problem: Option<String>,
    /// Milliseconds of all passes on the device: the shortest of the repetitions.
    pub device_ms: f64,
    /// Milliseconds of all passes on the CPU, once.
    pub cpu_ms: f64,
}

/// Largest difference of each pass from the CPU, by the largest value of that pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PassErrors {
    /// Of the result.
    pub forward: f64,
    /// Of the gradient of the input.
    pub by_input: f64,
    /// Of the gradient of the weights; 0 for a loss, whose weights are held.
    pub by_weights: f64,
}

impl PassErrors {
    /// The largest of them; infinite if one is no number.
    pub fn largest(&self) -> f64 {
        let all = [self.forward, self.by_input, self.by_weights];
        if all.iter().any(|e| e.is_nan()) { f64::INFINITY } else { all.into_iter().fold(0.0, f64::max) }
    }
}

/// Result, gradient of the input, gradient of the weights.
type Passes = [Vec<f32>; 3];

/// Computes a convolution forward and back on the CPU, and once and so many `repetitions` more on a device, and compares every time.
/// `tolerance` is the largest permitted difference by the largest value of a pass. On the CPU itself the framework's operations are compared
/// with ours.
///
/// A panic of the device is a problem of the convolution. The device must have automatic differentiation.
pub fn check_convolution(
    convolution: &Convolution,
    device: &Device,
    tolerance: f64,
    repetitions: usize,
) -> ConvolutionCheck {
    let operands = Operands::new(convolution);
    let cpu = Device::flex().autodiff();
    let expected = operands.passes(&cpu, false);

    let by_framework = device.clone().without_autodiff() == Device::flex();
    let cpu_ms = expected.as_ref().map_or(0.0, |(_, ms)| *ms);
    let tried = expected.and_then(|(expected, _)| {
        let tried = catch_unwind(AssertUnwindSafe(|| {
            // A kernel that races is right at times, and the first pass may be one of the tuning.
            let tries = (0..=repetitions).map(|_| operands.passes(device, by_framework));
            worst_and_shortest(tries, &expected)
        }));
        tried.unwrap_or_else(|panic| Err(text_of(&*panic)))
    });
    let (errors, device_ms, problem) = match tried {
        Ok((errors, ms)) => {
            let largest = errors.largest();
            let problem = if !largest.is_finite() {
                Some("gives values that are no numbers".to_owned())
            } else if largest > tolerance {
                Some(format!(
                    "differs from the CPU by {largest:.1e} of the largest value; {tolerance:.0e} is allowed"
                ))
            } else {
                None
            };
            (Some(errors).filter(|_| largest.is_finite()), ms, problem)
        }
        Err(problem) => (None, 0.0, Some(problem)),
    };
    ConvolutionCheck { convolution: *convolution, errors, problem, device_ms, cpu_ms }
}

/// The largest differences of all tries from what is expected, and the shortest time.
fn worst_and_shortest(
    tries: impl Iterator<Item = Result<(Passes, f64), String>>,
    expected: &Passes,
) -> Result<(PassErrors, f64), String> {
    let (mut worst, mut shortest) = ([0.0f64; 3], f64::INFINITY);
    for tried in tries {
        let (found, ms) = tried?;
        for (worst, (found, expected)) in worst.iter_mut().zip(found.iter().zip(expected)) {
            let own = difference(found, expected);
            // What is no number is the worst, and stays so.
            *worst = if own.is_nan() || worst.is_nan() { f64::NAN } else { worst.max(own) };
        }
        shortest = shortest.min(ms);
    }
    let [forward, by_input, by_weights] = worst;
    Ok((PassErrors { forward, by_input, by_weights }, shortest))
}

/// The largest difference by the largest expected value. Not a number where a value is none.
fn difference(found: &[f32], expected: &[f32]) -> f64 {
    if found.len() != expected.len() {
        return f64::INFINITY;
    }
    let largest = expected.iter().fold(0.0f64, |most, v| most.max(f64::from(v.abs())));
    let mut most = 0.0f64;
    for (a, b) in found.iter().zip(expected) {
        let difference = f64::from((a - b).abs());
        if difference.is_nan() {
            return f64::NAN;
        }
        most = most.max(difference);
    }
    if most == 0.0 { 0.0 } else { most / largest }
}

/// Inputs of a convolution, and the cotangent of its result, drawn by a fixed rule.
struct Operands {
    convolution: Convolution,
    x: Vec<f32>,
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl Operands {
    fn new(convolution: &Convolution) -> Self {
        let [_, channels, _, _] = convolution.input;
        let inputs = match convolution.kind {
            ConvolutionKind::Depthwise => 1,
            ConvolutionKind::Gated => channels / 2,
            _ => channels,
        };
        let seen = inputs * convolution.kernel.iter().product::<usize>();
        let scale = (seen as f32).sqrt().recip();
        let mut weight = noise(convolution.outputs * seen, 2);
        weight.iter_mut().for_each(|w| *w *= scale);
        Self {
            convolution: *convolution,
            x: noise(convolution.input.iter().product(), 1),
            weight,
            bias: noise(convolution.outputs, 3),
        }
    }

    /// All passes, by the framework's operations in place of ours or not, and the milliseconds that they took.
    fn passes(&self, device: &Device, by_framework: bool) -> Result<(Passes, f64), String> {
        let Convolution { kind, input, outputs, kernel: [rows, columns], step, border } = self.convolution;
        let x = leaf(&self.x, input, device);
        let bias = leaf(&self.bias, [outputs], device);
        let shape = self.convolution.output();
        let cotangent = noise(shape.iter().product(), 4);
        let cotangent = Tensor::from_data(TensorData::new(cotangent, shape), device);
        let pull = PullBack { x: x.clone(), cotangent, device };
        match kind {
            ConvolutionKind::Loss => {
                let shape = [outputs, input[1], rows, columns];
                let held = Tensor::from_data(TensorData::new(self.weight.clone(), shape), device);
                pull.run::<4>(None, || of_loss(x, held, None, step, border))
            }
            ConvolutionKind::Full => {
                let weight = leaf(&self.weight, [outputs, input[1], rows, columns], device);
                let of = weight.clone();
                pull.run(Some(&weight), || {
                    if by_framework {
                        conv_by_framework(x, of, bias, step)
                    } else {
                        conv_leaky(x, of, bias, step, 1.0)
                    }
                })
            }
            ConvolutionKind::Depthwise => {
                let weight = leaf(&self.weight, [outputs, rows, columns], device);
                let way = if by_framework { depthwise_by_framework } else { depthwise };
                let of = weight.clone();
                pull.run(Some(&weight), || way(x, of, bias))
            }
            ConvolutionKind::Pointwise | ConvolutionKind::Normalized | ConvolutionKind::Gated => {
                let (prologue, way) = match kind {
                    ConvolutionKind::Normalized => (Prologue::Normalize, normalized_pointwise as Mix),
                    ConvolutionKind::Gated => (Prologue::Gate, gated_pointwise as Mix),
                    _ => (Prologue::Plain, pointwise as Mix),
                };
                let weight = leaf(&self.weight, [outputs, self.weight.len() / outputs], device);
                let of = weight.clone();
                pull.run(Some(&weight), || {
                    if by_framework { mix_by_framework(prologue, x, of, bias) } else { way(x, of, bias) }
                })
            }
        }
    }
}

/// A 1x1 convolution.
type Mix = fn(Tensor<4>, Tensor<2>, Tensor<1>) -> Tensor<4>;

fn leaf<const D: usize>(values: &[f32], shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), device).require_grad()
}

/// Takes a cotangent back to the input of a convolution and to its weights.
struct PullBack<'a> {
    x: Tensor<4>,
    cotangent: Tensor<4>,
    device: &'a Device,
}

impl PullBack<'_> {
    /// The result and the gradients on the host, and the milliseconds between the tensors on the device and the gradients there. Without weights there
    /// is no gradient by them.
    fn run<const D: usize>(
        self,
        weight: Option<&Tensor<D>>,
        convolved: impl FnOnce() -> Tensor<4>,
    ) -> Result<(Passes, f64), String> {
        let Self { x, cotangent, device } = self;
        let wait = || device.sync().map_err(|e| format!("the device failed: {e:?}"));
        wait()?;
        let started = Instant::now();
        let y = convolved();
        let gradients = (y.clone() * cotangent).sum().backward();
        wait()?;
        let ms = milliseconds(started);

        let for_x = x.grad(&gradients).ok_or("the device gave no gradient of the input")?;
        let for_weight = match weight {
            Some(weight) => {
                host(weight.grad(&gradients).ok_or("the device gave no gradient of the weights")?)?
            }
            None => Vec::new(),
        };
        Ok(([host(y)?, host(for_x)?, for_weight], ms))
    }
}

fn host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, String> {
    let values = tensor.into_data().try_to_vec::<f32>();
    values.map_err(|e| format!("the values of the device cannot be read: {e:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convolution::collect;
    use crate::network::{Naf, NafConfig, UNetConfig};

    fn cpu() -> Device {
        Device::flex().autodiff()
    }

    fn convolutions() -> std::collections::BTreeSet<Convolution> {
        let naf: Naf = NafConfig { in_channels: 3, levels: 1, base_channels: 8, ..Default::default() }
            .init(1, &cpu())
            .unwrap();
        let unet = UNetConfig { levels: 1, base_channels: 8, ..Default::default() }.init(1, &cpu()).unwrap();
        let picture: Tensor<4> = Tensor::zeros([1, 3, 12, 10], &cpu());
        let (_, seen) = collect(|| (naf.forward(picture.clone()), unet.forward(picture.clone())));
        seen
    }

    #[test]
    fn every_kind_of_convolution_of_the_networks_is_collected_and_agrees_with_the_framework() {
        let mut seen = convolutions();
        let kinds: Vec<ConvolutionKind> = seen.iter().map(|c| c.kind).collect();
        for kind in [
            ConvolutionKind::Full,
            ConvolutionKind::Depthwise,
            ConvolutionKind::Pointwise,
            ConvolutionKind::Normalized,
            ConvolutionKind::Gated,
        ] {
            assert!(kinds.contains(&kind), "{kind:?} is missing");
        }
        seen.insert(Convolution {
            kind: ConvolutionKind::Loss,
            input: [1, 3, 31, 33],
            outputs: 4,
            kernel: [11, 11],
            step: 4,
            border: 2,
        });
        for convolution in &seen {
            let check = check_convolution(convolution, &cpu(), 1e-5, 1);
            assert_eq!(check.problem, None, "{convolution}");
            assert!(check.errors.unwrap().largest() < 1e-5 && check.device_ms > 0.0, "{convolution}");
        }
        // What nobody collects is not kept.
        assert!(collect(|| ()).1.is_empty());
    }

    #[test]
    fn a_difference_beyond_the_tolerance_is_a_problem() {
        let differs = convolutions().into_iter().find_map(|convolution| {
            let check = check_convolution(&convolution, &cpu(), 0.0, 1);
            let is_equal = check.errors.unwrap().largest() == 0.0;
            assert_eq!(check.problem.is_none(), is_equal);
            check.problem
        });
        // Two ways of summing up differ in the last digits.
        assert!(differs.unwrap().contains("of the largest value; 0e0 is allowed"));
    }

    #[test]
    fn one_wrong_try_of_several_counts() {
        let right: Passes = [vec![1.0, 2.0], vec![4.0], vec![]];
        let [mut wrong, mut none] = [right.clone(), right.clone()];
        (wrong[1][0], none[0][1]) = (3.0, f32::NAN);
        let of = |tries: &[(&Passes, f64)]| {
            worst_and_shortest(tries.iter().map(|(passes, ms)| Ok(((*passes).clone(), *ms))), &right)
        };
        let (errors, ms) = of(&[(&right, 3.0), (&wrong, 2.0), (&right, 5.0)]).unwrap();
        assert_eq!((errors.forward, errors.by_input, errors.by_weights, ms), (0.0, 0.25, 0.0, 2.0));
        for order in [[&none, &right, &wrong], [&right, &wrong, &none]] {
            let (errors, _) = of(&order.map(|passes| (passes, 1.0))).unwrap();
            assert!(errors.forward.is_nan() && errors.largest() == f64::INFINITY);
            assert_eq!(errors.by_input, 0.25);
        }
        let failing = [Ok((right.clone(), 1.0)), Err("the device failed: lost".to_owned())];
        assert_eq!(worst_and_shortest(failing.into_iter(), &right).unwrap_err(), "the device failed: lost");
    }

    #[test]
    fn values_that_are_no_numbers_and_arrays_of_another_length_are_never_equal() {
        assert_eq!(difference(&[1.0, 2.0], &[1.0, 2.0]), 0.0);
        assert_eq!(difference(&[1.0, 3.0], &[1.0, 2.0]), 0.5);
        assert_eq!(difference(&[1.0], &[1.0, 2.0]), f64::INFINITY);
        assert!(difference(&[1.0, f32::NAN, 2.0], &[1.0, 1.0, 2.0]).is_nan());
        let errors = PassErrors { forward: 0.0, by_input: f64::NAN, by_weights: 0.0 };
        assert_eq!(errors.largest(), f64::INFINITY);
    }

    #[test]
    fn what_a_panic_of_a_device_says_is_one_line() {
        assert_eq!(text_of(&"a\n  b".to_owned()), "the device failed: a b");
        assert_eq!(text_of(&"static"), "the device failed: static");
        assert_eq!(text_of(&7), "the device failed: no reason given");
    }
}
