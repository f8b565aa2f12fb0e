//! Glasses in TOML: one table `[glass.NAME]` each, the same in a catalogue and in a lens file.
//!
//! ```
//! use petzval_files::parse_catalog;
//! let text = "
//! [glass.N-BK7]
//! maker = \"Schott\"
//! nd = 1.5168
//! vd = 64.17
//! sellmeier = { b = [1.03961212, 0.231792344, 1.01046945], c_um2 = [0.00600069867, 0.0200179144, 103.560653] }
//! range_um = [0.3, 2.5]
//! transmission = { thickness_mm = 25, wavelength_um = [0.4, 0.5], transmittance = [0.992, 0.994] }
//! thermal = { d = [1.86e-6, 1.31e-8, -1.37e-11], e = [4.34e-7, 6.27e-10], lambda_tk_um = 0.17, reference_c = 20 }
//! ";
//! let glass = parse_catalog(text)?.get("n-bk7").unwrap();
//! assert!((glass.index(0.5461) - 1.51872).abs() < 1e-5);
//! assert!((glass.internal_transmission(0.4, 10.0).unwrap() - 0.9968).abs() < 1e-4);
//! # Ok::<(), petzval_base::FileError>(())
//! ```
//!
//! A formula is one of `n`, `sellmeier`, `schott`, `square`, `powers`, `herzberger`, `gas`, `lorentz_lorenz`, `exotic`,
//! `table`. Without a formula, `nd` and `vd` define the glass. Beside a formula they are the values that the source prints;
//! a formula that contradicts them is refused as a misprint. All other keys are optional.

mod read;
mod text;
mod write;

pub(super) use read::read_glasses;
pub use read::{is_meant_as_catalog, parse_catalog};
pub(super) use text::{GlassTables, GlassText};
pub use write::write_catalog;
pub(super) use write::write_glass;
