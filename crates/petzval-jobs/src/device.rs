//! Where tensors live.

use petzval_learn::Device;

use crate::error::JobError;

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

/// The device of a name, with automatic differentiation.
pub(crate) fn device(name: &str) -> Result<Device, JobError> {
    let device = match name {
        "cpu" => Device::flex(),
        #[cfg(feature = "wgpu")]
        "wgpu" => Device::wgpu(Default::default()),
        #[cfg(feature = "cuda")]
        "cuda" => Device::cuda(0),
        other => {
            let known: Vec<&str> = compiled_in_devices().iter().map(|(name, _)| *name).collect();
            return Err(JobError::setting(
                "device",
                other,
                "not in this build",
                format!(
                    "this build has {}; build with `--features wgpu` or `cuda` for more",
                    known.join(", ")
                ),
            ));
        }
    };
    Ok(device.autodiff())
}
