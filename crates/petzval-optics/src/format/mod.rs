//! File formats: text in, values out, and every error with its line.

mod decimal;
mod draft;
mod encoding;
mod error;
mod export;
mod glass_toml;
pub mod lens_toml;
mod loss;
pub mod seq;
pub mod zmx;

pub use draft::Import;
pub use encoding::decode;
pub use error::FileError;
pub use export::Export;
pub(crate) use glass_toml::parse_catalog;
pub use lens_toml::{Expect, Expected, ExpectedSpots, LensFile, parse_lens, write_lens};
pub use loss::{Effect, Loss};
pub use seq::{parse_seq, write_seq};
pub use zmx::{parse_zmx, write_zmx};
