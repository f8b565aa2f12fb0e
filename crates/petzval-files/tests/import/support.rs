//! The catalogue, and one singlet in both formats.

use petzval_files::{Import, parse_seq, parse_zmx};
use petzval_optics::glass::Catalog;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;

pub fn catalog() -> Catalog {
    let mut catalog = Catalog::default();
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/glasses");
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            catalog.merge(petzval_files::parse_catalog(&std::fs::read_to_string(path).unwrap()).unwrap());
        }
    }
    catalog
}

pub fn zmx(text: &str) -> Import {
    parse_zmx(text, &catalog()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

pub fn seq(text: &str) -> Import {
    parse_seq(text, &catalog()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

pub fn losses(import: &Import) -> Vec<String> {
    import.losses.iter().map(ToString::to_string).collect()
}

pub fn efl_mm(lens: &Lens) -> f64 {
    first_order(&lens.at_wavelength(lens.reference_um)).efl_mm
}

/// A singlet of N-BK7; the records of its first surface begin on line 13.
pub const ZMX: &str = "\
VERS 140124 258 36214
MODE SEQ
NAME singlet
UNIT MM X W X CM MR CPMM
ENPD 10
FTYP 0 0 2 1 0 0 0
YFLN 0 2
WAVM 1 0.5876 1
PWAV 1
SURF 0
  DISZ INFINITY
SURF 1
  STOP
  TYPE STANDARD
  CURV 0.02 0 0 0 0 \"\"
  DISZ 4
  GLAS N-BK7 0 0 1.5168 64.17
  DIAM 6 1 0 0 1 \"\"
  CLAP 0 6 0
SURF 2
  TYPE STANDARD
  CURV 0.0
  DISZ 94
SURF 3
  TYPE STANDARD
";

/// A singlet of N-BK7; the commands of its first surface begin on line 8.
pub const SEQ: &str = "\
RDM;LEN
TITLE 'singlet'
EPD 10
DIM M
WL 587.6
YAN 0 2
SO 0.0 0.1e14
S 50 4 NBK7_SCHOTT
  STO
  CIR 6
S 0 94
SI 0 0
GO
";

pub fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "{from:?} is not there");
    text.replacen(from, to, 1)
}
