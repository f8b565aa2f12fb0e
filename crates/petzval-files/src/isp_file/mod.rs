//! Files of image signal processors: presets of the built-in one, the description of an external one, settings of it, and the files by
//! which frames go to it and pictures come back.

mod description;
mod exchange;
mod preset;
mod proxy;
mod settings;

use petzval_base::FileError;
use petzval_camera::isp::IspPreset;
use toml::Table;

pub(crate) use description::Keys as DescriptionKeys;
pub use description::{ExternalIspFile, parse_external_isp};
pub use exchange::{
    FRAME_FILE, PICTURE_FILES, RAW_FILE, decode_picture, frame_toml, picture_png_bytes, raw_bytes,
};
pub use preset::{parse_isp_preset, preset_toml};
pub use proxy::IspProxyFile;
pub(crate) use settings::Keys as SettingsKeys;
pub use settings::{IspSettingsFile, settings_toml};

/// A file that names an ISP and its settings.
#[derive(Clone, Debug, PartialEq)]
pub enum IspFile {
    /// A preset of the built-in ISP.
    Preset(Box<IspPreset>),
    /// The description of an external ISP.
    External(ExternalIspFile),
    /// The description of a network that imitates an ISP.
    Proxy(Box<IspProxyFile>),
    /// Settings of an ISP that is described in another file.
    Settings(IspSettingsFile),
}

/// Reads a file about an ISP. One with the key `command` describes an external ISP, one with the key `isp` holds settings of such an ISP, one
/// with the key `proxy_of` describes a network that imitates an ISP, any other is a preset.
pub fn parse_isp_file(text: &str) -> Result<IspFile, FileError> {
    let table: Table = FileError::read_toml(text)?;
    if table.contains_key("command") {
        return parse_external_isp(text).map(IspFile::External);
    }
    if table.contains_key("proxy_of") {
        return IspProxyFile::parse(text).map(|proxy| IspFile::Proxy(Box::new(proxy)));
    }
    if table.contains_key("isp") {
        IspSettingsFile::parse(text).map(IspFile::Settings)
    } else {
        parse_isp_preset(text).map(|preset| IspFile::Preset(Box::new(preset)))
    }
}
