//! Reads glass tables and checks every number, so that errors name its place.

use std::ops::Range;
use std::sync::Arc;

use serde::Deserialize;

use super::text::{GlassTables, GlassText, Placed, Thickness};
use crate::spanned::Spanned;
use crate::toml_number::Number;
use petzval_base::FileError;
use petzval_optics::glass::{
    Absorption, Catalog, Dispersion, Expansion, Glass, Misprint, Printed, Status, Thermal,
};

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct CatalogText {
    glass: GlassTables,
}

/// Reads a glass catalogue from its text.
pub fn parse_catalog(text: &str) -> Result<Catalog, FileError> {
    let file: CatalogText = FileError::read_toml(text)?;
    read_glasses(text, &file.glass)
}

/// Whether a text is meant as a catalogue, be it right or wrong: `glass` is its only key, or it is no TOML.
pub fn is_meant_as_catalog(text: &str) -> bool {
    let is_catalog = |table: toml::Table| !table.is_empty() && table.keys().all(|key| key == "glass");
    toml::from_str(text).map_or(true, is_catalog)
}

/// The glasses of some tables. Names and aliases are unique without regard to case.
pub(crate) fn read_glasses(text: &str, tables: &GlassTables) -> Result<Catalog, FileError> {
    let mut catalog = Catalog::default();
    for (name, table) in tables {
        let glass = Arc::new(read_glass(text, name, table)?);
        for called in std::iter::once(name).chain(&table.aliases) {
            if !catalog.all(called.get_ref()).is_empty() {
                let message = format!("the glass `{}` is already defined", called.get_ref());
                return Err(FileError::at(text, called.span(), "glass", message)
                    .hint("upper and lower case are the same; AIR is built in"));
            }
            catalog.insert(called.get_ref(), glass.clone());
        }
    }
    Ok(catalog)
}

fn read_glass(text: &str, name: &Spanned<String>, table: &GlassText) -> Result<Glass, FileError> {
    let mut glass = Glass::new(name.get_ref().as_str(), read_dispersion(text, name, table)?);
    glass.maker.clone_from(&table.maker);
    glass.source.clone_from(&table.source);
    glass.status = table.status.as_ref().map(|word| read_status(text, word)).transpose()?;
    // Beside a formula, nd and vd are printed values. Without one they are the formula.
    if !matches!(glass.dispersion, Dispersion::NdVd { .. }) {
        let printed = |number: &Placed| {
            text.get(number.span()).and_then(|digits| Printed::parse(&digits.replace('_', "")))
        };
        if let Some(nd) = &table.nd {
            check_nd(text, nd)?;
            glass.printed_nd = printed(nd).filter(|printed| printed.value > 1.0);
        }
        if let Some(vd) = &table.vd {
            check_vd(text, vd)?;
            glass.printed_vd = printed(vd).filter(|printed| printed.value > 0.0);
        }
    }
    if let Some(range) = &table.range_um {
        let [min, max] = range.get_ref().map(|n| n.0);
        if !(min > 0.0 && max >= min && max.is_finite()) {
            let error = FileError::at(text, range.span(), "range_um", "this is not a range of wavelengths");
            return Err(error.hint("write the shortest and the longest wavelength in um"));
        }
        glass.range_um = Some([min, max]);
    }
    glass.absorption = read_absorption(text, table)?;
    if let Some(thermal) = &table.thermal {
        let t = thermal.get_ref();
        let (d, e) = (t.d.map(|n| n.0), t.e.map(|n| n.0));
        let (lambda_tk_um, reference_c) = (t.lambda_tk_um.0, t.reference_c.0);
        let numbers = d.into_iter().chain(e).chain([lambda_tk_um, reference_c]);
        At::of(text, thermal, "thermal").check_finite(numbers)?;
        glass.thermal = Some(Thermal { d, e, lambda_tk_um, reference_c });
    }
    for row in &table.expansion {
        let (range_c, per_k) = (row.get_ref().range_c.map(|n| n.0), row.get_ref().per_k.0);
        At::of(text, row, "expansion").check_finite(range_c.into_iter().chain([per_k]))?;
        glass.expansion.push(Expansion { range_c, per_k });
    }
    glass.density_g_cm3 = not_negative(text, "density_g_cm3", &table.density_g_cm3)?;
    glass.relative_cost = not_negative(text, "relative_cost", &table.relative_cost)?;
    match glass.misprint() {
        Some(misprint) => Err(contradiction(text, table, &glass.name, &misprint)),
        None => Ok(glass),
    }
}

/// The error for a formula that contradicts a printed value: a mistyped coefficient changes n_d or V_d.
fn contradiction(text: &str, table: &GlassText, name: &str, misprint: &Misprint) -> FileError {
    let number = if misprint.figure == "nd" { &table.nd } else { &table.vd };
    let span = number.as_ref().map_or(0..0, Spanned::span);
    let key = misprint.figure.to_lowercase();
    FileError::at(text, span, &key, format!("{name}: {misprint}")).hint("one of them is mistyped")
}

/// A value of a glass table: its place in the text, and its key.
struct At<'a> {
    text: &'a str,
    span: Range<usize>,
    key: &'a str,
}

impl<'a> At<'a> {
    fn of<T>(text: &'a str, value: &Spanned<T>, key: &'a str) -> Self {
        Self { text, span: value.span(), key }
    }

    fn error(&self, message: impl Into<String>) -> FileError {
        FileError::at(self.text, self.span.clone(), self.key, message)
    }

    /// Fails with this message unless the condition holds.
    fn check(&self, condition: bool, message: &str) -> Result<(), FileError> {
        if condition { Ok(()) } else { Err(self.error(message)) }
    }

    fn check_finite(&self, mut numbers: impl Iterator<Item = f64>) -> Result<(), FileError> {
        self.check(numbers.all(f64::is_finite), "a number is not finite")
    }

    /// Checks that two lists have the same length, are not empty, and are finite.
    fn check_pair(&self, left: &[f64], right: &[f64]) -> Result<(), FileError> {
        if left.len() != right.len() || left.is_empty() {
            let (left, right) = (left.len(), right.len());
            return Err(self.error(format!("lists of {left} and {right} numbers do not belong together")));
        }
        self.check_finite(left.iter().chain(right).copied())
    }

    fn check_ascending(&self, um: &[f64]) -> Result<(), FileError> {
        let ascends = um.windows(2).all(|w| w[0] < w[1]) && um.iter().all(|w| *w > 0.0);
        self.check(ascends, "the wavelengths do not ascend")
    }
}

/// The one formula of a glass table.
fn read_dispersion(text: &str, name: &Spanned<String>, table: &GlassText) -> Result<Dispersion, FileError> {
    let mut formulas = Vec::new();
    if let Some(n) = &table.n {
        let is_index = n.get_ref().0 >= 1.0 && n.get_ref().0.is_finite();
        At::of(text, n, "n").check(is_index, "an index is a finite number from 1")?;
        formulas.push(("n", n.span(), Dispersion::Constant(n.get_ref().0)));
    }
    if let Some(s) = &table.sellmeier {
        let (b, c_um2) = (plain(&s.get_ref().b), plain(&s.get_ref().c_um2));
        At::of(text, s, "sellmeier").check_pair(&b, &c_um2)?;
        formulas.push(("sellmeier", s.span(), Dispersion::Sellmeier { b, c_um2 }));
    }
    if let Some(s) = &table.square {
        let (powers, resonances) = (rows(&s.get_ref().powers), rows(&s.get_ref().resonances));
        let (at, has_terms) = (At::of(text, s, "square"), !(powers.is_empty() && resonances.is_empty()));
        at.check(has_terms, "there is neither a power nor a resonance")?;
        at.check_finite(powers.iter().flatten().chain(resonances.iter().flatten()).copied())?;
        formulas.push(("square", s.span(), Dispersion::Square { powers, resonances }));
    }
    if let Some(p) = &table.powers {
        let powers = rows(p.get_ref());
        let at = At::of(text, p, "powers");
        at.check(!powers.is_empty(), "there is no power")?;
        at.check_finite(powers.iter().flatten().copied())?;
        formulas.push(("powers", p.span(), Dispersion::Powers(powers)));
    }
    if let Some(g) = &table.gas {
        let (a, terms) = (g.get_ref().a.0, rows(&g.get_ref().terms));
        At::of(text, g, "gas").check_finite(terms.iter().flatten().copied().chain([a]))?;
        formulas.push(("gas", g.span(), Dispersion::Gas { a, terms }));
    }
    formulas.extend(coefficients(text, "schott", &table.schott, Dispersion::Schott)?);
    formulas.extend(coefficients(text, "herzberger", &table.herzberger, Dispersion::Herzberger)?);
    formulas.extend(coefficients(text, "lorentz_lorenz", &table.lorentz_lorenz, Dispersion::LorentzLorenz)?);
    formulas.extend(coefficients(text, "exotic", &table.exotic, Dispersion::Exotic)?);
    if let Some(t) = &table.table {
        let (wavelength_um, index) = (plain(&t.get_ref().wavelength_um), plain(&t.get_ref().index));
        let at = At::of(text, t, "table");
        at.check_pair(&wavelength_um, &index)?;
        at.check_ascending(&wavelength_um)?;
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
            Err(FileError::at(text, name.span(), "glass", message).hint(
                "give `nd` and `vd`, or one of `n`, `sellmeier`, `schott`, `square`, `powers`, `table`, ...",
            ))
        }
    }
}

/// The absorption of the glass, from its transmittance or its extinction coefficients.
fn read_absorption(text: &str, table: &GlassText) -> Result<Option<Absorption>, FileError> {
    if let (Some(_), Some(extinction)) = (&table.transmission, &table.extinction) {
        let message = "the glass has `transmission` already";
        return Err(FileError::at(text, extinction.span(), "extinction", message).hint("keep one of the two"));
    }
    if let Some(placed) = &table.transmission {
        let (t, at) = (placed.get_ref(), At::of(text, placed, "transmission"));
        let (um, transmittance) = (plain(&t.wavelength_um), plain(&t.transmittance));
        let thickness_mm = match &t.thickness_mm {
            Thickness::All(mm) => vec![mm.0; um.len()],
            Thickness::Each(mm) => plain(mm),
        };
        at.check_pair(&um, &transmittance)?;
        at.check_pair(&um, &thickness_mm)?;
        at.check_ascending(&um)?;
        let is_possible = transmittance.iter().all(|t| (0.0..=1.0).contains(t));
        let is_possible = is_possible && thickness_mm.iter().all(|mm| *mm > 0.0);
        at.check(is_possible, "a transmittance is between 0 and 1, a thickness positive")?;
        let rows = (0..um.len()).map(|i| [um[i], transmittance[i], thickness_mm[i]]);
        return Ok(Some(Absorption::Transmittance(rows.collect())));
    }
    let Some(placed) = &table.extinction else { return Ok(None) };
    let (um, k) = (plain(&placed.get_ref().wavelength_um), plain(&placed.get_ref().k));
    let at = At::of(text, placed, "extinction");
    at.check_pair(&um, &k)?;
    at.check_ascending(&um)?;
    at.check(k.iter().all(|k| *k >= 0.0), "an extinction coefficient is at least 0")?;
    Ok(Some(Absorption::Extinction(um.into_iter().zip(k).map(|(um, k)| [um, k]).collect())))
}

fn read_status(text: &str, word: &Spanned<String>) -> Result<Status, FileError> {
    Status::from_word(word.get_ref()).ok_or_else(|| {
        let known: Vec<&str> = Status::ALL.iter().map(|status| status.word()).collect();
        FileError::at(text, word.span(), "status", "no such status")
            .hint(format!("it is one of {}", known.join(", ")))
    })
}

fn plain(numbers: &[Number]) -> Vec<f64> {
    numbers.iter().map(|n| n.0).collect()
}

fn rows<const N: usize>(numbers: &[[Number; N]]) -> Vec<[f64; N]> {
    numbers.iter().map(|row| row.map(|n| n.0)).collect()
}

/// A formula: its key, its place in the file, and what it is.
type Formula<'k> = (&'k str, Range<usize>, Dispersion);

/// A formula with a fixed number of coefficients.
fn coefficients<'k, const N: usize>(
    text: &str,
    key: &'k str,
    numbers: &Option<Spanned<[Number; N]>>,
    formula: fn([f64; N]) -> Dispersion,
) -> Result<Option<Formula<'k>>, FileError> {
    let Some(numbers) = numbers else { return Ok(None) };
    let a = numbers.get_ref().map(|n| n.0);
    At::of(text, numbers, key).check_finite(a.into_iter())?;
    Ok(Some((key, numbers.span(), formula(a))))
}

fn check_nd(text: &str, nd: &Placed) -> Result<f64, FileError> {
    let value = nd.get_ref().0;
    let is_index = value > 1.0 && value.is_finite();
    At::of(text, nd, "nd").check(is_index, "an index is a finite number above 1").map(|()| value)
}

fn check_vd(text: &str, vd: &Placed) -> Result<f64, FileError> {
    let value = vd.get_ref().0;
    let is_abbe = value > 0.0 && value.is_finite();
    At::of(text, vd, "vd").check(is_abbe, "an Abbe number is finite and positive").map(|()| value)
}

fn not_negative(text: &str, key: &str, number: &Option<Placed>) -> Result<Option<f64>, FileError> {
    let Some(number) = number else { return Ok(None) };
    match number.get_ref().0 {
        value if value >= 0.0 && value.is_finite() => Ok(Some(value)),
        _ => Err(FileError::at(text, number.span(), key, "this must be a finite number, at least 0")),
    }
}
