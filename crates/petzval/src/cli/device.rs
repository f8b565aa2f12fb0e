//! `--device`: where tensors live.

use petzval::learn::Device;

use super::Failure;

/// Devices that this build can use, by name, with a word about each.
pub fn compiled_in() -> Vec<(&'static str, &'static str)> {
    vec![
        ("cpu", "Burn flex on the CPU"),
        #[cfg(feature = "wgpu")]
        ("wgpu", "Burn wgpu: Vulkan, Metal or DirectX 12"),
        #[cfg(feature = "cuda")]
        ("cuda", "Burn CUDA, device 0"),
    ]
}

/// The device of a name, with automatic differentiation.
pub fn device(name: &str) -> Result<Device, Failure> {
    let device = match name {
        "cpu" => Device::flex(),
        #[cfg(feature = "wgpu")]
        "wgpu" => Device::wgpu(Default::default()),
        #[cfg(feature = "cuda")]
        "cuda" => Device::cuda(0),
        other => {
            let known: Vec<&str> = compiled_in().iter().map(|(name, _)| *name).collect();
            return Err(Failure::input(
                format!("--device {other}: not in this build"),
                format!(
                    "this build has {}; build with `--features wgpu` or `cuda` for more",
                    known.join(", ")
                ),
            ));
        }
    };
    Ok(device.autodiff())
}
