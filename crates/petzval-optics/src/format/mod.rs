//! File formats: text in, values out, and every error with its line.

mod encoding;
mod error;
mod glass_toml;
pub mod lens_toml;
mod tolerance_toml;

pub use encoding::decode;
pub use error::FileError;
pub(crate) use glass_toml::parse_catalog;
pub use lens_toml::{Expect, Expected, ExpectedSpots, LensFile, parse_lens, write_lens};
pub use tolerance_toml::{ToleranceFile, parse_tolerances, write_tolerances};
