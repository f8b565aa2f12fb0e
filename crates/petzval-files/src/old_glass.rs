//! Glasses that lens files name and no catalogue holds any more.
//!
//! Around 1998 Schott made its glasses anew without lead and arsenic. Most old glasses have a successor of the same index and nearly the same
//! dispersion, whose name has an `N-` in front: BK7 became N-BK7. The others are known by their index and Abbe number alone.

use std::sync::Arc;

use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Dispersion, Glass, UnknownGlass};

use crate::draft::Record;

/// Old glasses of Schott without a successor: name, n_d and V_d as the maker's catalogues of the 1980s print them.
const WITHOUT_SUCCESSOR: &[(&str, f64, f64)] = &[
    ("BAF3", 1.58267, 46.47),
    ("BAF8", 1.62374, 47.00),
    ("BAF9", 1.64328, 47.96),
    ("BAF13", 1.66892, 44.96),
    ("BAK5", 1.55671, 58.65),
    ("BK1", 1.51009, 63.46),
    ("BK3", 1.49831, 65.06),
    ("BK6", 1.53113, 62.15),
    ("F8", 1.59551, 39.18),
    ("F16", 1.59270, 35.34),
    ("FN11", 1.62096, 36.18),
    ("K3", 1.51823, 58.98),
    ("K4", 1.51895, 57.40),
    ("K11", 1.50013, 61.44),
    ("K50", 1.52257, 60.18),
    ("KF1", 1.54041, 51.05),
    ("KF3", 1.51454, 54.70),
    ("KF6", 1.51742, 52.20),
    ("LAF3", 1.71700, 48.00),
    ("LAF20", 1.68248, 48.20),
    ("LAK23", 1.66882, 57.38),
    ("LAK31", 1.69673, 56.42),
    ("LF3", 1.58215, 42.09),
    ("LF4", 1.57830, 41.65),
    ("LF6", 1.56732, 42.81),
    ("LLF2", 1.54072, 47.23),
    ("LLF3", 1.56013, 47.08),
    ("PK1", 1.50378, 66.92),
    ("PK2", 1.51821, 65.05),
    ("PK3", 1.52542, 64.70),
    ("PSK2", 1.56873, 63.10),
    ("SF3", 1.74000, 28.20),
    ("SF9", 1.65446, 33.65),
    ("SF12", 1.64831, 33.84),
    ("SF19", 1.66680, 33.01),
    ("SF53", 1.72830, 28.69),
    ("SF55", 1.76180, 26.95),
    ("SF58", 1.91761, 21.51),
    ("SF59", 1.95250, 20.36),
    ("SK6", 1.61375, 56.40),
    ("SK10", 1.62278, 56.90),
    ("SK12", 1.58313, 59.45),
    ("SSK2", 1.62230, 53.13),
    ("SSK3", 1.61484, 51.16),
    ("SSK4", 1.61765, 55.14),
    ("UBK7", 1.51680, 64.29),
];

/// Index and Abbe number that a file states beside a name, and from which a successor may differ by so much.
const SAME_ND: f64 = 5e-4;
const SAME_VD: f64 = 0.5;

/// The error for an unknown name.
pub(super) fn unknown_glass(record: &Record, unknown: &UnknownGlass) -> FileError {
    let hint = format!(
        "the nearest names are {}; --glasses FILE reads a catalogue that has it (.agf, .toml)",
        unknown.nearest.join(", ")
    );
    record.error(unknown.reason()).hint(hint)
}

/// A substitute for a glass that no catalogue holds, and the note about it.
pub(super) type Substitute = (Arc<Glass>, String);

/// The glass for an old name of Schott's, or for index and Abbe number that the file states. A successor that contradicts the file is not
/// taken. `None` for an unknown glass, and for one that was left out of a catalogue.
pub(super) fn substitute(name: &str, stated: Option<[f64; 2]>, catalog: &Catalog) -> Option<Substitute> {
    if catalog.get(name).is_err_and(|unknown| unknown.refused.is_some()) {
        return None;
    }
    let upper = name.to_uppercase();
    let fits = |nd: f64, vd: f64| {
        stated.is_none_or(|[own_nd, own_vd]| (nd - own_nd).abs() < SAME_ND && (vd - own_vd).abs() < SAME_VD)
    };
    let of_schott = |glass: &&Arc<Glass>| glass.maker.eq_ignore_ascii_case("schott");
    let successor = catalog.all(&format!("N-{upper}")).iter().find(of_schott);
    if let Some(glass) = successor.filter(|glass| fits(glass.nd(), glass.abbe_vd())) {
        let said = format!("no catalogue has {upper} any more; its successor {} takes its place", glass.name);
        return Some((glass.clone(), said));
    }
    let by_model = |nd: f64, vd: f64, source: &str| {
        let dispersion = if vd > 0.0 { Dispersion::NdVd { nd, vd } } else { Dispersion::Constant(nd) };
        let said = format!(
            "no catalogue has {upper}; it has the index {nd:.5} and the Abbe number {vd:.2} {source}, by Cauchy's formula"
        );
        Some((Arc::new(Glass::new(name, dispersion)), said))
    };
    let old = WITHOUT_SUCCESSOR.iter().find(|(known, nd, vd)| *known == upper && fits(*nd, *vd));
    match (old, stated) {
        (Some((_, nd, vd)), _) => by_model(*nd, *vd, "of the maker's old catalogue"),
        (None, Some([nd, vd])) => by_model(nd, vd, "that the file states"),
        (None, None) => None,
    }
}
