//! Repeatable tensors, and comparisons.

use burn::{
    module::{Module, ModuleMapper, Param},
    prelude::*,
    tensor::DType,
};

/// Repeatable values in -1..1.
pub fn noise(shape: &[usize], seed: u64) -> Vec<f32> {
    (0..shape.iter().product::<usize>() as u64)
        .map(|i| {
            let mut z =
                (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xd1b5_4a32_d192_ed03);
            z = (z ^ (z >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            (z >> 40) as f32 / (1_u64 << 23) as f32 - 1.0
        })
        .collect()
}

pub fn random<const D: usize>(shape: [usize; D], seed: u64, device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(noise(&shape, seed), shape), device)
}

pub fn largest_difference<const D: usize>(a: Tensor<D>, b: Tensor<D>) -> f32 {
    let scale: f32 = b.clone().abs().max().into_scalar();
    let difference: f32 = (a - b).abs().max().into_scalar();
    difference / scale
}

/// Asserts that both results and all gradients agree, for a random cotangent.
pub fn assert_same<const D: usize>(
    case: &str,
    ours: Tensor<4>,
    theirs: Tensor<4>,
    inputs: (&Tensor<4>, &Tensor<D>, &Tensor<1>),
) {
    assert_eq!(ours.dims(), theirs.dims(), "{case}: shape");
    let d = largest_difference(ours.clone(), theirs.clone());
    assert!(d < 1e-5, "{case}: values differ by {d}");
    let probe = random(ours.dims(), 4, &ours.device());
    let our_gradients = (ours * probe.clone()).sum().backward();
    let their_gradients = (theirs * probe).sum().backward();
    let (x, weight, bias) = inputs;
    let d = largest_difference(x.grad(&our_gradients).unwrap(), x.grad(&their_gradients).unwrap());
    assert!(d < 1e-5, "{case}: input gradient differs by {d}");
    let d = largest_difference(weight.grad(&our_gradients).unwrap(), weight.grad(&their_gradients).unwrap());
    assert!(d < 3e-5, "{case}: weight gradient differs by {d}");
    let d = largest_difference(bias.grad(&our_gradients).unwrap(), bias.grad(&their_gradients).unwrap());
    assert!(d < 3e-5, "{case}: bias gradient differs by {d}");
}

/// The values of a tensor.
pub fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_to_vec::<f32>().unwrap()
}

/// A network whose tensors are all moved by repeatable values in -`size`..`size`, so that no layer is 0.
pub fn shaken<M: Module>(network: M, size: f32) -> M {
    struct Shake(f32, u64);
    impl ModuleMapper for Shake {
        fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
            self.1 += 1;
            let (size, seed) = (self.0, self.1);
            parameter.map(|t| {
                let moved = (t.clone() + random(t.dims(), seed, &t.device()) * size).detach();
                if t.is_require_grad() { moved.require_grad() } else { moved }
            })
        }
    }
    network.map(&mut Shake(size, 100))
}

/// The same network in double precision, which takes the framework's operations.
pub fn doubled<M: Module>(network: M) -> M {
    struct Double;
    impl ModuleMapper for Double {
        fn map_float<const D: usize>(&mut self, parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
            parameter.map(|t| t.detach().cast(DType::F64).detach())
        }
    }
    network.no_grad().map(&mut Double)
}

/// Asserts that `gradient` is the slope of `loss` at `input`, and that the slope in double precision agrees with central
/// differences: steps along the sign of the gradient for all values, every second and every fifth.
pub fn assert_slope<const D: usize>(
    input: Tensor<D>,
    gradient: Tensor<D>,
    loss: impl Fn(Tensor<D>) -> Tensor<1>,
) {
    let (shape, device) = (gradient.dims(), input.device());
    let input = input.detach().cast(DType::F64).detach().require_grad();
    let exact = input.grad(&loss(input.clone()).backward()).unwrap().cast(DType::F32);
    let d = largest_difference(gradient, exact.clone());
    assert!(d < 2e-3, "gradient differs by {d} from the one in double precision");
    let (input, gradient) = (input.detach(), values(exact));
    for period in [1, 2, 5] {
        let direction: Vec<f32> = gradient
            .iter()
            .enumerate()
            .map(|(i, g)| if i % period == 0 { g.signum() } else { 0.0 })
            .collect();
        let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| f64::from(g * d)).sum();
        let direction = Tensor::<D>::from_data(TensorData::new(direction, shape), &device).cast(DType::F64);
        let moved = |step: f64| loss(input.clone() + direction.clone() * step).into_scalar::<f64>();
        let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
        assert!((along - difference).abs() < 1e-4 * along.abs(), "{along} against {difference}");
    }
}
