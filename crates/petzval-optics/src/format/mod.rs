//! File formats: text in, values out, and every error with its line.

mod encoding;
mod error;
mod glass_toml;
pub mod lens_toml;

pub use encoding::decode;
pub use error::FileError;
pub(crate) use glass_toml::parse_catalog;
pub use lens_toml::{Expect, Expected, ExpectedSpots, LensFile, parse_lens, write_lens};
