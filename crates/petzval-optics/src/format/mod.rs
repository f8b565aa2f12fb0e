//! File formats: text in, values out, and every error with its line.

pub mod agf;
mod encoding;
mod error;
mod glass_file;
mod glass_toml;
pub mod lens_toml;
pub mod rii;

pub use agf::parse_agf;
pub use encoding::decode;
pub use error::FileError;
pub use glass_file::GlassFile;
pub(crate) use glass_toml::parse_catalog;
pub use glass_toml::write_catalog;
pub use lens_toml::{Expect, Expected, ExpectedSpots, LensFile, parse_lens, write_lens};
pub use rii::parse_rii;
