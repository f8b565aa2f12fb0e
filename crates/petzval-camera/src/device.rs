//! What a device says of itself, and where its tuning is kept.

use std::path::Path;

use burn::prelude::Device;

/// A device as it names itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceFacts {
    /// Its name, such as that of a card.
    pub name: String,
    /// Its driver with the driver's version; empty where it is not known.
    pub driver: String,
    /// True if it is a program on the CPU in place of a card.
    pub is_software: bool,
}

/// What a device of a GPU back end says of itself. None for the CPU. Opens the device.
///
/// # Panics
/// Panics, as the framework does, if there is no such device on this machine.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub fn facts(device: &Device) -> Option<DeviceFacts> {
    let identity = device.identity()?;
    #[cfg(feature = "wgpu")]
    let adapter = driver_of_adapter(&identity.name);
    #[cfg(not(feature = "wgpu"))]
    let adapter: Option<String> = None;
    // CUDA names its kernels by the card's generation.
    let module = || identity.fingerprint.starts_with("ptx").then(driver_of_module).flatten();
    Some(DeviceFacts {
        driver: adapter.or_else(module).unwrap_or_default(),
        is_software: identity.physical.is_none(),
        name: identity.name,
    })
}

/// What a device says of itself. None for the CPU, which is the only one of this build.
#[cfg(not(any(feature = "wgpu", feature = "cuda")))]
pub fn facts(_: &Device) -> Option<DeviceFacts> {
    None
}

/// The driver of the adapter with this name.
#[cfg(feature = "wgpu")]
fn driver_of_adapter(name: &str) -> Option<String> {
    use burn_cubecl::cubecl::future::block_on;
    use burn_cubecl::cubecl::wgpu::wgpu;

    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let backends = descriptor.backends;
    let instance = wgpu::Instance::new(descriptor);
    let adapters = block_on(instance.enumerate_adapters(backends));
    let found = adapters.iter().map(wgpu::Adapter::get_info).find(|info| info.name == name)?;
    Some(format!("{} {}", found.driver, found.driver_info).trim().to_owned())
}

/// What NVIDIA's module of the Linux kernel says of its version; none on other systems.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
fn driver_of_module() -> Option<String> {
    version_of_module(&petzval_base::read_text("/proc/driver/nvidia/version").ok()?)
}

/// The first line of the module's description: `NVRM version: NVIDIA UNIX x86_64 Kernel Module  550.54.15  Tue Mar  5`.
#[cfg(any(test, feature = "wgpu", feature = "cuda"))]
fn version_of_module(text: &str) -> Option<String> {
    let line = text.lines().next()?.strip_prefix("NVRM version:")?;
    Some(line.split_whitespace().collect::<Vec<_>>().join(" ")).filter(|version| !version.is_empty())
}

/// Keeps in a folder which kernels were found the fastest on the GPU, and takes those that are kept there already. Holds for the process until
/// the next call; what was tuned before is tuned anew.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub fn keep_tuning_in(folder: &Path) {
    use burn_cubecl::cubecl::config::{CubeClRuntimeConfig, RuntimeConfig};

    // The framework chooses a folder of its own when it first looks at its settings: let it do so now.
    let _settings = CubeClRuntimeConfig::get();
    burn_cubecl::cubecl::environment::set_root(folder);
}

/// Does nothing: this build has no GPU back end.
#[cfg(not(any(feature = "wgpu", feature = "cuda")))]
pub fn keep_tuning_in(_: &Path) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_of_the_module_is_that_of_its_first_line() {
        let text = "NVRM version: NVIDIA UNIX x86_64 Kernel Module  550.54.15  Tue Mar  5 22:23:56 UTC 2024\nGCC version: 12\n";
        let version = version_of_module(text).unwrap();
        assert_eq!(version, "NVIDIA UNIX x86_64 Kernel Module 550.54.15 Tue Mar 5 22:23:56 UTC 2024");
        for other in ["", "NVRM version:\n", "GCC version: 12"] {
            assert_eq!(version_of_module(other), None, "{other}");
        }
    }
}
