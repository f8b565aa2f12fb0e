//! File formats: text in, values out, and every error with its line.

pub mod agf;
mod decimal;
mod draft;
mod encoding;
mod error;
mod export;
mod glass_file;
mod glass_toml;
pub mod lens_toml;
mod loss;
pub mod rii;
pub mod seq;
pub mod zmx;

pub use agf::parse_agf;
pub use draft::Import;
pub use encoding::decode;
pub use error::FileError;
pub use export::Export;
pub use glass_file::GlassFile;
pub(crate) use glass_toml::parse_catalog;
pub use glass_toml::write_catalog;
pub use lens_toml::{Expect, Expected, ExpectedSpots, LensFile, parse_lens, write_lens};
pub use loss::{Effect, Loss};
pub use rii::parse_rii;
pub use seq::{parse_seq, write_seq};
pub use zmx::{parse_zmx, write_zmx};
