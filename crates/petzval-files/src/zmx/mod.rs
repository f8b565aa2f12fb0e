//! Lens files of Zemax OpticStudio, sequential mode.
//!
//! A file is lines of a keyword and its values: a header, a block `SURF n` for each surface with the object as surface 0 and the
//! image as the last, then merit function, tolerances and configurations. Lengths are in the lens unit, angles in degrees,
//! wavelengths in um. A surface's formula is named by `TYPE`; its numbers are `CURV`, `CONI`, `PARM i` and `XDAT i`.
//!
//! The meaning of records follows the public parts of the program's manual (surface formulas, the order of extended
//! polynomials, the matrix of coordinate breaks) and files that the program wrote. A record whose effect on light is not
//! known from these sources is refused: Forbes surfaces, diffractive structures on mirrors, tilts kept as surface properties.
//!
//! ```
//! # use petzval_base::FileError;
//! use petzval_files::{parse_catalog, parse_zmx};
//! let catalog = parse_catalog("[glass.N-BK7]\nnd = 1.5168\nvd = 64.17\n")?;
//! let text = "\
//! MODE SEQ
//! UNIT MM
//! ENPD 10
//! FTYP 0 0 1 1
//! YFLN 0
//! WAVM 1 0.5876 1
//! PWAV 1
//! SURF 0
//!   TYPE STANDARD
//!   CURV 0.0
//!   DISZ INFINITY
//! SURF 1
//!   STOP
//!   TYPE STANDARD
//!   CURV 0.02
//!   DISZ 4
//!   GLAS N-BK7 0 0 1.5168 64.17
//!   COAT AR
//! SURF 2
//!   TYPE STANDARD
//!   CURV 0.0
//!   DISZ 94
//! SURF 3
//!   TYPE STANDARD
//! ";
//! let read = parse_zmx(text, &catalog)?;
//! assert_eq!(read.file.lens.total_track_mm(), 98.0);
//! assert_eq!(read.losses[0].to_string(), "line 18: `COAT AR`: coatings are not read");
//! # Ok::<(), FileError>(())
//! ```

mod header;
mod out;
mod read;
mod read_shape;
mod read_surface;
mod record;
mod write;
mod write_shape;

pub use read::{parse_zmx, parse_zmx_start};
pub use record::records;
pub use write::write_zmx;
