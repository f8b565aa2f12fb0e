//! Repeatable tensors, and comparisons.

use burn::prelude::*;

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
pub fn shaken<M: burn::module::Module>(network: M, size: f32) -> M {
    struct Shake(f32, u64);
    impl burn::module::ModuleMapper for Shake {
        fn map_float<const D: usize>(
            &mut self,
            parameter: burn::module::Param<Tensor<D>>,
        ) -> burn::module::Param<Tensor<D>> {
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

/// Asserts that `gradient` is the slope of `loss` at `values`: steps along the sign of the gradient, for all values, every
/// second and every fifth.
pub fn assert_slope(values: &[f32], gradient: &[f32], step: f32, loss: impl Fn(Vec<f32>) -> f64) {
    for period in [1, 2, 5] {
        let direction: Vec<f32> = gradient
            .iter()
            .enumerate()
            .map(|(i, g)| if i % period == 0 { g.signum() } else { 0.0 })
            .collect();
        let along: f64 = gradient.iter().zip(&direction).map(|(g, d)| f64::from(g * d)).sum();
        let moved =
            |sign: f32| loss(values.iter().zip(&direction).map(|(v, d)| v + sign * step * d).collect());
        let difference = (moved(1.0) - moved(-1.0)) / f64::from(2.0 * step);
        assert!((along - difference).abs() < 0.01 * along.abs(), "{along} against {difference}");
    }
}
