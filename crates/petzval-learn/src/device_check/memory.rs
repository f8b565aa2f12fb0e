//! Whether a device keeps more and more memory from step to step.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use burn::optim::{AdamConfig, GradientsParams};
use burn::prelude::*;
use petzval_base::{Cancel, Cancelled};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{milliseconds, noise, text_of};
use crate::network::NafConfig;

/// Memory of a device over steps of a training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MemoryCheck {
    /// Shape of the batch: pictures, channels, height, width.
    pub input: [usize; 4],
    /// Steps taken.
    pub steps: usize,
    /// Bytes that the device keeps, after a third of the steps.
    pub bytes_at_a_third: u64,
    /// Most bytes that it keeps from then on.
    pub most_bytes: u64,
    /// Milliseconds of a step: the median of the second half.
    pub step_ms: f64,
    /// Why the device does not pass; none if it passes.
    pub problem: Option<String>,
}

/// By how much memory may grow from the first third of the steps on.
const GROWTH: f64 = 0.02;

/// Trains a small restoration network for some steps, at least three, on pictures of this shape, and looks at the memory of the device. None if the
/// device says nothing of its memory, as the CPU. `taken` is called after every step.
pub fn check_memory(
    device: &Device,
    input: [usize; 4],
    steps: usize,
    cancel: &Cancel,
    taken: &mut dyn FnMut(usize),
) -> Result<Option<MemoryCheck>, Cancelled> {
    if device.memory_pool_usage().is_none() {
        return Ok(None);
    }
    let mut check =
        MemoryCheck { input, steps: 0, bytes_at_a_third: 0, most_bytes: 0, step_ms: 0.0, problem: None };
    let mut times = Vec::with_capacity(steps);
    let tried = catch_unwind(AssertUnwindSafe(|| -> Result<Result<(), Cancelled>, String> {
        let config = NafConfig { in_channels: input[1], ..NafConfig::default() };
        let mut network = config.init(1, device).map_err(|e| e.to_string())?;
        let mut optimizer = AdamConfig::new().init();
        let pictures = noise(input.iter().product(), 5);
        let pictures: Tensor<4> = Tensor::from_data(TensorData::new(pictures, input), device);
        for step in 1..=steps {
            if let Err(cancelled) = cancel.check() {
                return Ok(Err(cancelled));
            }
            let started = Instant::now();
            let loss = (network.forward(pictures.clone()) - 0.5).square().mean();
            let gradients = GradientsParams::from_grads(loss.backward(), &network);
            network = optimizer.step(1e-3, network, gradients);
            device.sync().map_err(|e| format!("{e:?}"))?;
            times.push(milliseconds(started));
            let bytes = device.memory_pool_usage().map_or(0, |usage| usage.bytes_reserved);
            check.steps = step;
            if step == (steps / 3).max(1) {
                check.bytes_at_a_third = bytes;
            }
            if step >= steps / 3 {
                check.most_bytes = check.most_bytes.max(bytes);
            }
            taken(step);
        }
        let last = network.forward(pictures).into_data().try_to_vec::<f32>().map_err(|e| format!("{e:?}"))?;
        if last.iter().any(|v| !v.is_finite()) {
            return Err("the network gives values that are no numbers".to_owned());
        }
        Ok(Ok(()))
    }));
    match tried.unwrap_or_else(|panic| Err(text_of(&*panic))) {
        Ok(ended) => ended?,
        Err(problem) => check.problem = Some(problem),
    }
    let mut late = times.split_off(times.len() / 2);
    late.sort_by(f64::total_cmp);
    check.step_ms = late.get(late.len() / 2).copied().unwrap_or(0.0);
    if check.problem.is_none() {
        check.problem = grew(check.bytes_at_a_third, check.most_bytes, steps);
    }
    Ok(Some(check))
}

/// What is wrong with memory of `before` bytes after a third of the steps and of `most` bytes at most since; none if it stays.
fn grew(before: u64, most: u64, steps: usize) -> Option<String> {
    // A device that reserves nothing is not measured.
    if before == 0 {
        return Some("the device says that it reserves no memory, so that growth cannot be seen".to_owned());
    }
    let is_flat = most as f64 <= before as f64 * (1.0 + GROWTH);
    let [before, most] = [before, most].map(|bytes| bytes as f64 / 1e6);
    (!is_flat).then(|| {
        format!(
            "memory grew from {before:.1} to {most:.1} MB over the last two thirds of {steps} steps; {} % is allowed",
            100.0 * GROWTH
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_may_grow_by_two_percent_and_no_more() {
        for most in [0, 900_000_000, 1_000_000_000, 1_020_000_000] {
            assert_eq!(grew(1_000_000_000, most, 300), None, "{most}");
        }
        assert_eq!(
            grew(1_000_000_000, 1_020_000_001, 300).unwrap(),
            "memory grew from 1000.0 to 1020.0 MB over the last two thirds of 300 steps; 2 % is allowed"
        );
        assert!(grew(10_000_000, 300_000_000, 300).unwrap().contains("from 10.0 to 300.0 MB"));
        // What is not measured does not pass.
        assert!(grew(0, 0, 300).is_some() && grew(0, 7, 300).is_some());
    }

    #[test]
    fn the_cpu_says_nothing_of_its_memory() {
        let device = Device::flex().autodiff();
        let found = check_memory(&device, [1, 8, 8, 8], 3, &Cancel::default(), &mut |_| ()).unwrap();
        assert_eq!(found, None);
    }
}
