//! What kernels are given and what becomes of their results: on the host, on the tape, and in a form for a device.

use std::sync::{Arc, Mutex};

use burn::backend::DispatchTensor;
use burn::prelude::*;
use burn::tensor::{DType, TensorData};

use super::tests::{tensor, values};
use super::{BackwardPass, DeviceForm, Kernel, View, apply, computes_in_place, is_on_host};

/// What a kernel was called with.
#[derive(Clone, Debug, Default, PartialEq)]
struct Seen {
    tracked: Vec<bool>,
    wanted: Vec<bool>,
    output: Vec<f32>,
    on_device: bool,
}

/// The product of all inputs, element by element.
#[derive(Clone, Debug, Default)]
struct Product {
    reads_output: bool,
    has_device_form: bool,
    seen: Arc<Mutex<Seen>>,
}

impl Product {
    fn of<const R: usize>(&self, inputs: impl IntoIterator<Item = DispatchTensor>) -> Tensor<R> {
        apply(Arc::new(self.clone()), inputs)
    }

    fn seen(&self) -> Seen {
        self.seen.lock().unwrap().clone()
    }
}

/// `scale` times the product of all inputs but one.
fn others(inputs: &[View<'_>], but: usize, scale: &[f32]) -> Vec<f32> {
    let rest =
        |at: usize| inputs.iter().enumerate().filter(move |(i, _)| *i != but).map(move |(_, v)| v.values[at]);
    scale.iter().enumerate().map(|(at, scale)| scale * rest(at).product::<f32>()).collect()
}

impl Kernel for Product {
    fn forward(&self, inputs: &[View<'_>], tracked: &[bool]) -> (Vec<f32>, Vec<usize>) {
        self.seen.lock().unwrap().tracked = tracked.to_vec();
        let count = inputs[0].values.len();
        (others(inputs, inputs.len(), &vec![1.0; count]), vec![count])
    }

    fn backward(
        &self,
        inputs: &[View<'_>],
        output: &[f32],
        gradient: &[f32],
        wanted: &[bool],
    ) -> Vec<Vec<f32>> {
        let mut seen = self.seen.lock().unwrap();
        (seen.wanted, seen.output) = (wanted.to_vec(), output.to_vec());
        let by = |(i, wanted): (usize, &bool)| if *wanted { others(inputs, i, gradient) } else { Vec::new() };
        wanted.iter().enumerate().map(by).collect()
    }

    fn reads_output(&self) -> bool {
        self.reads_output
    }

    fn device_form(&self) -> Option<&dyn DeviceForm> {
        self.has_device_form.then_some(self)
    }
}

/// The same by operations of the framework, for two inputs in a row.
impl DeviceForm for Product {
    fn serves(&self, input: &DispatchTensor) -> bool {
        Tensor::<1>::from_dispatch(input.clone()).dtype() == DType::F32
    }

    fn forward(&self, inputs: &[DispatchTensor], tracked: &[bool]) -> DispatchTensor {
        *self.seen.lock().unwrap() = Seen { tracked: tracked.to_vec(), on_device: true, ..Seen::default() };
        let [a, b] = [0, 1].map(|i: usize| Tensor::<1>::from_dispatch(inputs[i].clone()));
        (a * b).into_dispatch()
    }

    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        let BackwardPass { output, gradient, wanted } = at;
        let mut seen = self.seen.lock().unwrap();
        seen.wanted = wanted.to_vec();
        seen.output = output.map_or(Vec::new(), |y| values(Tensor::<1>::from_dispatch(y.clone())));
        let [a, b, g] = [&inputs[0], &inputs[1], gradient].map(|t| Tensor::<1>::from_dispatch(t.clone()));
        let by = [b * g.clone(), a * g];
        by.into_iter().zip(wanted).map(|(by, wanted)| wanted.then(|| by.into_dispatch())).collect()
    }
}

#[test]
fn every_tracked_input_of_any_number_has_its_gradient() {
    for count in 1..=8 {
        let leaves: Vec<Tensor<1>> =
            (0..count).map(|i| tensor(vec![2.0 + i as f32, 3.0], [2]).require_grad()).collect();
        let product = Product::default();
        // The leaves are doubled before and the value is tripled after the kernel.
        let y: Tensor<1> = product.of(leaves.iter().map(|leaf| (leaf.clone() * 2.0).into_dispatch()));
        let gradients = (y.clone() * 3.0).sum().backward();
        let y = values(y);
        for (i, leaf) in leaves.iter().enumerate() {
            let expected = [3.0 * y[0] / (2.0 + i as f32), 3.0 * y[1] / 3.0];
            for (found, expected) in values(leaf.grad(&gradients).unwrap()).iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 1e-6, "{count} inputs, {i}: {found} {expected}");
            }
        }
        assert_eq!(product.seen().wanted, vec![true; count]);
    }
}

#[test]
fn a_kernel_knows_which_inputs_are_tracked_and_gets_its_value_back_only_if_it_reads_it() {
    for reads_output in [false, true] {
        let product = Product { reads_output, ..Product::default() };
        // The shapes of the inputs may differ, and the gradient has that of its input.
        let constant = tensor(vec![2.0, 3.0], [2]);
        let leaf = tensor(vec![5.0, 7.0], [1, 2]).require_grad();
        let y: Tensor<1> = product.of([constant.into_dispatch(), leaf.clone().into_dispatch()]);
        let gradients = y.sum().backward();
        assert_eq!(leaf.grad(&gradients).unwrap().dims(), [1, 2]);
        assert_eq!(values(leaf.grad(&gradients).unwrap()), vec![2.0, 3.0]);
        let seen = product.seen();
        assert_eq!((seen.tracked, seen.wanted), (vec![false, true], vec![false, true]));
        assert_eq!(seen.output, if reads_output { vec![10.0, 21.0] } else { Vec::new() });
    }
}

#[test]
fn without_a_tape_nothing_is_tracked() {
    let product = Product::default();
    let x = Tensor::<1>::from_data(TensorData::new(vec![3.0f32], [1]), (&Device::flex(), DType::F32));
    assert_eq!(values(product.of::<1>([x.clone().into_dispatch(), x.into_dispatch()])), vec![9.0]);
    assert_eq!(product.seen().tracked, vec![false, false]);
    // On a device with a tape, constants are not tracked either.
    let x = tensor(vec![3.0], [1]);
    assert_eq!(values(product.of::<1>([x.clone().into_dispatch(), x.into_dispatch()])), vec![9.0]);
    assert_eq!(product.seen().tracked, vec![false, false]);
}

#[test]
fn views_are_contiguous_and_other_number_types_come_back_as_they_were() {
    let product = Product::default();
    let x = tensor(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [2, 3]).require_grad();
    let turned = x.clone().swap_dims(0, 1);
    let y: Tensor<1> = product.of([turned.into_dispatch()]);
    assert_eq!(values(y.clone()), vec![1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
    let weights = tensor(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [6]);
    let gradients = (y * weights).sum().backward();
    assert_eq!(values(x.grad(&gradients).unwrap()), vec![1.0, 3.0, 5.0, 2.0, 4.0, 6.0]);

    assert!(is_on_host(&x));
    let double =
        Tensor::<1>::from_data(TensorData::new(vec![2.0f64, 3.0], [2]), (&Device::flex(), DType::F64));
    assert!(!is_on_host(&double));
    let y: Tensor<1> = product.of([double.into_dispatch()]);
    assert_eq!((y.dtype(), values(y)), (DType::F64, vec![2.0, 3.0]));
}

#[test]
fn a_device_form_takes_the_place_of_the_host_where_it_serves() {
    let [a, b] = [vec![2.0, 3.0], vec![5.0, 7.0]].map(|v| tensor(v, [2]).require_grad());
    let product = Product { has_device_form: true, reads_output: true, ..Product::default() };
    let y: Tensor<1> = product.of([a.clone().into_dispatch(), b.clone().into_dispatch()]);
    let gradients = (y * 2.0).sum().backward();
    let seen =
        Seen { tracked: vec![true; 2], wanted: vec![true; 2], output: vec![10.0, 21.0], on_device: true };
    assert_eq!(product.seen(), seen);
    assert_eq!(values(a.grad(&gradients).unwrap()), vec![10.0, 14.0]);
    assert_eq!(values(b.grad(&gradients).unwrap()), vec![4.0, 6.0]);
    assert!(computes_in_place(&product, &a));

    // It does not serve 64 bits: those go to the host.
    let double = Tensor::<1>::from_data(TensorData::new(vec![2.0f64], [1]), (&Device::flex(), DType::F64));
    let product = Product { has_device_form: true, ..Product::default() };
    assert!(!computes_in_place(&product, &double));
    assert!(computes_in_place(&Product::default(), &a) && !computes_in_place(&Product::default(), &double));
    assert_eq!(values(product.of::<1>([double.clone().into_dispatch(), double.into_dispatch()])), vec![4.0]);
    assert!(!product.seen().on_device);
}

#[test]
#[should_panic(expected = "rank of the value")]
fn a_value_of_another_rank_is_a_panic() {
    let x = tensor(vec![1.0], [1]);
    let _: Tensor<2> = Product::default().of([x.into_dispatch()]);
}
