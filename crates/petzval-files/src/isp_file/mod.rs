//! Files of image signal processors: the description of an external one, the files by which frames go to it and pictures come back,
//! and settings, which are values of parameters by name.

mod description;
mod exchange;
mod settings;

pub use description::{ExternalIspFile, parse_external_isp};
pub use exchange::{
    FRAME_FILE, PICTURE_FILES, RAW_FILE, decode_picture, frame_toml, picture_png_bytes, raw_bytes,
};
pub use settings::{IspFile, IspSettingsFile, parse_isp_file, settings_toml};
