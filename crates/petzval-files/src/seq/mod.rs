//! Lens files of CODE V: the commands that define a lens, as the program writes them.
//!
//! A command is a word and its values; upper and lower case are the same. Semicolons separate commands on a line, `&` at the
//! end of a line continues it on the next, `!` begins a comment. `SO`, `S` and `SI` add the object, a surface and the image,
//! with radius (or curvature, if the file has no `RDM`), thickness and glass. Commands after a surface refer to it.
//! Wavelengths are in nm, angles in degrees.
//!
//! The meaning of commands follows files that the program wrote and public descriptions. Rotations `ADE` and `BDE` are
//! left-handed, `CDE` is right-handed. A command whose effect on light is not known from these sources is refused: Forbes
//! surfaces, diffractive structures, mirrors that bend the axis about two axes at once.
//!
//! ```
//! # use petzval_base::FileError;
//! use petzval_files::{parse_catalog, parse_seq};
//! let catalog = parse_catalog("[glass.N-BK7]\nnd = 1.5168\nvd = 64.17\nmaker = \"Schott\"\n")?;
//! let text = "\
//! RDM; LEN
//! TITLE 'plano-convex'
//! EPD 10; DIM M; WL 587.6
//! YAN 0 2
//! SO 0 0.1e14
//! S  51.68 4 NBK7_SCHOTT
//!   STO; CIR 6
//! S  0 97.3
//!   CIR 6
//!   PIM
//! SI 0 0
//! GO
//! ";
//! let read = parse_seq(text, &catalog)?;
//! assert_eq!(read.file.lens.total_track_mm(), 101.3);
//! assert_eq!(read.losses[0].to_string(), "line 10: `PIM`: the solve is not kept, but its value is");
//! # Ok::<(), FileError>(())
//! ```

mod command;
mod glass;
mod out;
mod read;
mod read_surface;
mod system;
mod write;
mod write_surface;

pub use read::{parse_seq, parse_seq_start, records};
pub use write::write_seq;
