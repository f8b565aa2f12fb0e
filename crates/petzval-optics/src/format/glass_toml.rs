//! Glasses in TOML: one table `[glass.NAME]` each, the same in a catalogue and in a lens file.
//!
//! ```
//! # use petzval_optics::glass::Catalog;
//! let text = "
//! [glass.N-BK7]
//! nd = 1.5168
//! vd = 64.17
//! sellmeier = { b = [1.03961212, 0.231792344, 1.01046945], c_um2 = [0.00600069867, 0.0200179144, 103.560653] }
//! ";
//! assert!((Catalog::parse(text)?.get("n-bk7").unwrap().index(0.5461) - 1.51872).abs() < 1e-5);
//! # Ok::<(), petzval_optics::format::FileError>(())
//! ```
//!
//! A formula is one of `n`, `sellmeier`, `schott`, `table`; without one, `nd` and `vd` are the glass.
//! Beside a formula they are what its source prints, and a formula that disagrees is a misprint.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::Deserialize;
use toml::Spanned;

use super::FileError;
use super::lens_toml::Number;
use crate::glass::{Catalog, Dispersion, Glass};

/// A table `[glass.NAME]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct GlassText {
    #[serde(default)]
    aliases: Vec<Spanned<String>>,
    maker: Option<String>,
    #[expect(dead_code, reason = "for people who read the file")]
    source: Option<String>,
    n: Option<Spanned<Number>>,
    nd: Option<Spanned<Number>>,
    vd: Option<Spanned<Number>>,
    sellmeier: Option<Spanned<SellmeierText>>,
    schott: Option<Spanned<[Number; 6]>>,
    table: Option<Spanned<TableText>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct SellmeierText {
    b: Vec<Number>,
    c_um2: Vec<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct TableText {
    wavelength_um: Vec<Number>,
    index: Vec<Number>,
}

/// Glass tables by name; the names know their place in the file.
pub(super) type GlassTables = BTreeMap<Spanned<String>, GlassText>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct CatalogText {
    glass: GlassTables,
}

/// A catalogue from its text.
pub(crate) fn parse_catalog(text: &str) -> Result<Catalog, FileError> {
    let file: CatalogText = toml::from_str(text).map_err(|e| FileError::from_toml(text, &e))?;
    read_glasses(text, &file.glass)
}

/// The glasses of some tables. Names and aliases are unique without regard to case.
pub(super) fn read_glasses(text: &str, tables: &GlassTables) -> Result<Catalog, FileError> {
    let mut catalog = Catalog::default();
    for (name, table) in tables {
        let glass =
            Arc::new(Glass { name: name.get_ref().clone(), dispersion: read_dispersion(text, name, table)? });
        check_published(text, &glass, table)?;
        for called in std::iter::once(name).chain(&table.aliases) {
            if catalog.get(called.get_ref()).is_ok() {
                let message = format!("the glass `{}` is already there", called.get_ref());
                return Err(FileError::at(text, called.span(), "glass", message)
                    .hint("upper and lower case are the same; AIR is always there"));
            }
            catalog.insert(called.get_ref(), glass.clone());
            if let Some(maker) = &table.maker {
                catalog.set_maker(called.get_ref(), maker);
            }
        }
    }
    Ok(catalog)
}

/// The one formula of a glass table.
fn read_dispersion(text: &str, name: &Spanned<String>, table: &GlassText) -> Result<Dispersion, FileError> {
    let plain = |numbers: &[Number]| numbers.iter().map(|n| n.0).collect::<Vec<f64>>();
    let mut formulas = Vec::new();
    if let Some(n) = &table.n {
        if !(n.get_ref().0 >= 1.0 && n.get_ref().0.is_finite()) {
            return Err(FileError::at(text, n.span(), "n", "an index is a finite number from 1"));
        }
        formulas.push(("n", n.span(), Dispersion::Constant(n.get_ref().0)));
    }
    if let Some(s) = &table.sellmeier {
        let (b, c_um2) = (plain(&s.get_ref().b), plain(&s.get_ref().c_um2));
        check_pair(text, s.span(), "sellmeier", &b, &c_um2)?;
        formulas.push(("sellmeier", s.span(), Dispersion::Sellmeier { b, c_um2 }));
    }
    if let Some(s) = &table.schott {
        let a = s.get_ref().map(|n| n.0);
        check_pair(text, s.span(), "schott", &a, &a)?;
        formulas.push(("schott", s.span(), Dispersion::Schott(a)));
    }
    if let Some(t) = &table.table {
        let (wavelength_um, index) = (plain(&t.get_ref().wavelength_um), plain(&t.get_ref().index));
        check_pair(text, t.span(), "table", &wavelength_um, &index)?;
        if wavelength_um.windows(2).any(|w| w[0] >= w[1]) {
            return Err(FileError::at(text, t.span(), "table", "the wavelengths do not ascend"));
        }
        formulas.push(("table", t.span(), Dispersion::Table { wavelength_um, index }));
    }
    if let Some((key, span, _)) = formulas.get(1) {
        let message = format!("glass `{}` already has the formula `{}`", name.get_ref(), formulas[0].0);
        return Err(FileError::at(text, span.clone(), key, message).hint("keep one of the two"));
    }
    if let Some((_, _, dispersion)) = formulas.pop() {
        return Ok(dispersion);
    }
    match (&table.nd, &table.vd) {
        (Some(nd), Some(vd)) => {
            let (nd, vd) = (check_nd(text, nd)?, check_vd(text, vd)?);
            Ok(Dispersion::NdVd { nd, vd })
        }
        _ => {
            let message = format!("glass `{}` has no formula", name.get_ref());
            Err(FileError::at(text, name.span(), "glass", message)
                .hint("give `nd` and `vd`, or one of `n`, `sellmeier`, `schott`, `table`"))
        }
    }
}

/// Two lists that belong together: as long as each other, not empty, all finite.
fn check_pair(
    text: &str,
    span: std::ops::Range<usize>,
    key: &str,
    left: &[f64],
    right: &[f64],
) -> Result<(), FileError> {
    if left.len() != right.len() || left.is_empty() {
        let message = format!("lists of {} and {} numbers do not belong together", left.len(), right.len());
        return Err(FileError::at(text, span, key, message));
    }
    if left.iter().chain(right).any(|v| !v.is_finite()) {
        return Err(FileError::at(text, span, key, "a coefficient is not finite"));
    }
    Ok(())
}

fn check_nd(text: &str, nd: &Spanned<Number>) -> Result<f64, FileError> {
    let value = nd.get_ref().0;
    match value > 1.0 && value.is_finite() {
        true => Ok(value),
        false => Err(FileError::at(text, nd.span(), "nd", "an index is a finite number above 1")),
    }
}

fn check_vd(text: &str, vd: &Spanned<Number>) -> Result<f64, FileError> {
    let value = vd.get_ref().0;
    match value > 0.0 && value.is_finite() {
        true => Ok(value),
        false => Err(FileError::at(text, vd.span(), "vd", "an Abbe number is finite and positive")),
    }
}

/// Compare the formula with the printed n_d and V_d: a digit lost in a coefficient shows here.
fn check_published(text: &str, glass: &Glass, table: &GlassText) -> Result<(), FileError> {
    const ND_SLIP: f64 = 1e-3;
    const VD_SLIP: f64 = 0.02;
    if let Some(nd) = &table.nd {
        let (printed, computed) = (check_nd(text, nd)?, glass.nd());
        let off = (computed - printed).abs();
        if off > ND_SLIP || off.is_nan() {
            let message = format!("the formula of `{}` gives nd = {computed:.5}", glass.name);
            return Err(FileError::at(text, nd.span(), "nd", message).hint("one of them is mistyped"));
        }
    }
    if let Some(vd) = &table.vd {
        let (printed, computed) = (check_vd(text, vd)?, glass.abbe_vd());
        let off = (computed / printed - 1.0).abs();
        if off > VD_SLIP || off.is_nan() {
            let message = format!("the formula of `{}` gives vd = {computed:.2}", glass.name);
            return Err(FileError::at(text, vd.span(), "vd", message).hint("one of them is mistyped"));
        }
    }
    Ok(())
}
