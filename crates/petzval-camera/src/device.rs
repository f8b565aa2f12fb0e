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
    Some(DeviceFacts {
        driver: driver(&identity.name).unwrap_or_default(),
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
fn driver(name: &str) -> Option<String> {
    use burn_cubecl::cubecl::future::block_on;
    use burn_cubecl::cubecl::wgpu::wgpu;

    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let backends = descriptor.backends;
    let instance = wgpu::Instance::new(descriptor);
    let adapters = block_on(instance.enumerate_adapters(backends));
    let found = adapters.iter().map(wgpu::Adapter::get_info).find(|info| info.name == name)?;
    Some(format!("{} {}", found.driver, found.driver_info).trim().to_owned())
}

#[cfg(all(feature = "cuda", not(feature = "wgpu")))]
fn driver(_: &str) -> Option<String> {
    None
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
