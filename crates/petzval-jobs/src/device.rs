//! Where tensors live.

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use std::panic::{AssertUnwindSafe, catch_unwind};

use petzval_learn::Device;

use crate::error::{JobError, Result};

/// Names of all devices, whether this build can use them or another one.
pub const DEVICES: [&str; 3] = ["cpu", "wgpu", "cuda"];

/// Devices that this build can use: name and description.
pub fn compiled_in_devices() -> Vec<(&'static str, &'static str)> {
    vec![
        ("cpu", "Burn flex on the CPU"),
        #[cfg(feature = "wgpu")]
        ("wgpu", "Burn wgpu: Vulkan, Metal or DirectX 12"),
        #[cfg(feature = "cuda")]
        ("cuda", "Burn CUDA, device 0"),
    ]
}

/// The device of a name, with automatic differentiation. A GPU is opened, so that one that is not there is an error now.
pub(crate) fn device(name: &str) -> Result<Device> {
    match name {
        "cpu" => Ok(Device::flex().autodiff()),
        #[cfg(feature = "wgpu")]
        "wgpu" => opened(name, || Device::wgpu(Default::default())),
        #[cfg(feature = "cuda")]
        "cuda" => opened(name, || Device::cuda(0)),
        other => Err(not_in_this_build(other)),
    }
}

/// Keeps in the cache folder of the user, to which nobody else writes, which kernels are the fastest: for all work until a run with a folder of
/// its own begins. Without such a folder the framework chooses the place.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub(crate) fn keep_tuning_for_the_user() {
    if let Some(cache) = dirs::cache_dir() {
        let folder = cache.join("petzval").join("tuning").join(env!("CARGO_PKG_VERSION"));
        petzval_camera::device::keep_tuning_in(&folder);
    }
}

/// Does nothing: this build has no GPU back end.
#[cfg(not(any(feature = "wgpu", feature = "cuda")))]
pub(crate) fn keep_tuning_for_the_user() {}

/// Opens a GPU.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
fn opened(name: &str, device: impl FnOnce() -> Device) -> Result<Device> {
    use std::sync::Once;

    static TUNING: Once = Once::new();
    TUNING.call_once(keep_tuning_for_the_user);
    let tried = catch_unwind(AssertUnwindSafe(|| {
        let device = device();
        petzval_camera::device::facts(&device);
        device
    }));
    let device = tried.map_err(|panic| {
        let (text, _) = crate::panic_place::of(&*panic);
        let text = text.lines().map(str::trim).collect::<Vec<_>>().join(" ");
        JobError::setting("device", name, format!("it cannot be opened: {text}"), where_a_driver_is(name))
    })?;
    Ok(device.autodiff())
}

/// What a device needs beside the build.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
fn where_a_driver_is(name: &str) -> &'static str {
    if name == "wgpu" {
        "a driver for Vulkan, Metal or DirectX 12 is needed; `apt install mesa-vulkan-drivers` brings one that computes on the CPU, for trials"
    } else {
        "NVIDIA's driver is needed, and a card"
    }
}

/// Says how to build a program that has the device.
fn not_in_this_build(name: &str) -> JobError {
    let known: Vec<&str> = compiled_in_devices().iter().map(|(name, _)| *name).collect();
    let known = known.join(", ");
    let hint = match name {
        "wgpu" => format!(
            "this build has {known}; build with `cargo install --locked --path crates/petzval --features wgpu`"
        ),
        "cuda" => format!(
            "this build has {known}; build with `cargo install --locked --path crates/petzval --features cuda`, which downloads a compiler \
             (LLVM) and fails where it cannot; `--features wgpu` needs no download"
        ),
        _ => format!("this build has {known}; build with `--features wgpu` or `cuda` for more"),
    };
    JobError::setting("device", name, "not in this build", hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_of_a_build_are_among_all() {
        assert!(compiled_in_devices().iter().all(|(name, _)| DEVICES.contains(name)));
    }

    #[test]
    fn a_device_that_is_not_compiled_in_is_refused_with_the_command_that_builds_it() {
        assert!(device("cpu").is_ok());
        for (name, needed) in [
            ("wgpu", "--features wgpu`"),
            ("cuda", "downloads a compiler"),
            ("abacus", "build with `--features wgpu` or `cuda`"),
        ] {
            if compiled_in_devices().iter().any(|(there, _)| *there == name) {
                continue;
            }
            let Err(JobError::Setting { key: "device", value, message, hint }) = device(name) else {
                panic!()
            };
            assert_eq!((value.as_str(), message.as_str()), (name, "not in this build"));
            assert!(hint.contains(needed) && hint.contains("this build has cpu"), "{hint}");
        }
    }
}
