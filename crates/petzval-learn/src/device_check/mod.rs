//! Whether a device computes the convolutions of a training as the CPU does, and whether its memory stays as it is.
//!
//! Known faults of GPU back ends that this is for: results that are wrong for some shapes alone, backward passes that fail for wide pictures,
//! and memory that grows from step to step. So every shape is tried at its real size, forward and back.

mod convolution;
mod memory;
mod networks;

use std::any::Any;
use std::time::Instant;

pub use convolution::{ConvolutionCheck, PassErrors, check_convolution};
pub use memory::{MemoryCheck, check_memory};
pub use networks::{CollectError, DETECTORS, of_detector, of_proxies};

fn milliseconds(since: Instant) -> f64 {
    1e3 * since.elapsed().as_secs_f64()
}

/// What a panic says, on one line.
fn text_of(panic: &(dyn Any + Send)) -> String {
    let text =
        panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    let text = text.unwrap_or("no reason given").lines().map(str::trim).collect::<Vec<_>>().join(" ");
    format!("the device failed: {text}")
}

/// Values in -1..1, by one round of splitmix64 for each: the same on every machine.
fn noise(count: usize, stream: u64) -> Vec<f32> {
    let value = |i: usize| {
        let mut z = (i as u64 + (stream << 48)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    };
    (0..count).map(value).collect()
}
