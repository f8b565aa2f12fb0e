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
    let file: CatalogText = toml::from_str(text).map_err(|e| FileError::from_toml(text, &e))?;
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
        check_finite(
            text,
            thermal.span(),
            "thermal",
            d.into_iter().chain(e).chain([lambda_tk_um, reference_c]),
        )?;
        glass.thermal = Some(Thermal { d, e, lambda_tk_um, reference_c });
    }
    for row in &table.expansion {
        let (range_c, per_k) = (row.get_ref().range_c.map(|n| n.0), row.get_ref().per_k.0);
        check_finite(text, row.span(), "expansion", range_c.into_iter().chain([per_k]))?;
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

/// The one formula of a glass table.
fn read_dispersion(text: &str, name: &Spanned<String>, table: &GlassText) -> Result<Dispersion, FileError> {
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
    if let Some(s) = &table.square {
        let (powers, resonances) = (rows(&s.get_ref().powers), rows(&s.get_ref().resonances));
        if powers.is_empty() && resonances.is_empty() {
            return Err(FileError::at(text, s.span(), "square", "there is neither a power nor a resonance"));
        }
        check_finite(
            text,
            s.span(),
            "square",
            powers.iter().flatten().chain(resonances.iter().flatten()).copied(),
        )?;
        formulas.push(("square", s.span(), Dispersion::Square { powers, resonances }));
    }
    if let Some(p) = &table.powers {
        let powers = rows(p.get_ref());
        if powers.is_empty() {
            return Err(FileError::at(text, p.span(), "powers", "there is no power"));
        }
        check_finite(text, p.span(), "powers", powers.iter().flatten().copied())?;
        formulas.push(("powers", p.span(), Dispersion::Powers(powers)));
    }
    if let Some(g) = &table.gas {
        let (a, terms) = (g.get_ref().a.0, rows(&g.get_ref().terms));
        check_finite(text, g.span(), "gas", terms.iter().flatten().copied().chain([a]))?;
        formulas.push(("gas", g.span(), Dispersion::Gas { a, terms }));
    }
    if let Some(a) = coefficients(text, "schott", &table.schott)? {
        formulas.push(("schott", a.0, Dispersion::Schott(a.1)));
    }
    if let Some(a) = coefficients(text, "herzberger", &table.herzberger)? {
        formulas.push(("herzberger", a.0, Dispersion::Herzberger(a.1)));
    }
    if let Some(a) = coefficients(text, "lorentz_lorenz", &table.lorentz_lorenz)? {
        formulas.push(("lorentz_lorenz", a.0, Dispersion::LorentzLorenz(a.1)));
    }
    if let Some(a) = coefficients(text, "exotic", &table.exotic)? {
        formulas.push(("exotic", a.0, Dispersion::Exotic(a.1)));
    }
    if let Some(t) = &table.table {
        let (wavelength_um, index) = (plain(&t.get_ref().wavelength_um), plain(&t.get_ref().index));
        check_pair(text, t.span(), "table", &wavelength_um, &index)?;
        check_ascending(text, t.span(), "table", &wavelength_um)?;
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
        let (t, span) = (placed.get_ref(), placed.span());
        let (um, transmittance) = (plain(&t.wavelength_um), plain(&t.transmittance));
        let thickness_mm = match &t.thickness_mm {
            Thickness::All(mm) => vec![mm.0; um.len()],
            Thickness::Each(mm) => plain(mm),
        };
        check_pair(text, span.clone(), "transmission", &um, &transmittance)?;
        check_pair(text, span.clone(), "transmission", &um, &thickness_mm)?;
        check_ascending(text, span.clone(), "transmission", &um)?;
        if transmittance.iter().any(|t| !(0.0..=1.0).contains(t)) || thickness_mm.iter().any(|mm| *mm <= 0.0)
        {
            let message = "a transmittance is between 0 and 1, a thickness positive";
            return Err(FileError::at(text, span, "transmission", message));
        }
        let rows = (0..um.len()).map(|i| [um[i], transmittance[i], thickness_mm[i]]);
        return Ok(Some(Absorption::Transmittance(rows.collect())));
    }
    let Some(placed) = &table.extinction else { return Ok(None) };
    let (um, k) = (plain(&placed.get_ref().wavelength_um), plain(&placed.get_ref().k));
    check_pair(text, placed.span(), "extinction", &um, &k)?;
    check_ascending(text, placed.span(), "extinction", &um)?;
    if k.iter().any(|k| *k < 0.0) {
        return Err(FileError::at(
            text,
            placed.span(),
            "extinction",
            "an extinction coefficient is at least 0",
        ));
    }
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

/// Numbers, and their place in the file.
type PlacedNumbers<const N: usize> = (Range<usize>, [f64; N]);

/// The coefficients of a formula with a fixed number of them.
fn coefficients<const N: usize>(
    text: &str,
    key: &str,
    numbers: &Option<Spanned<[Number; N]>>,
) -> Result<Option<PlacedNumbers<N>>, FileError> {
    let Some(numbers) = numbers else { return Ok(None) };
    let a = numbers.get_ref().map(|n| n.0);
    check_finite(text, numbers.span(), key, a.into_iter())?;
    Ok(Some((numbers.span(), a)))
}

/// Checks that two lists have the same length, are not empty, and are finite.
fn check_pair(
    text: &str,
    span: Range<usize>,
    key: &str,
    left: &[f64],
    right: &[f64],
) -> Result<(), FileError> {
    if left.len() != right.len() || left.is_empty() {
        let message = format!("lists of {} and {} numbers do not belong together", left.len(), right.len());
        return Err(FileError::at(text, span, key, message));
    }
    check_finite(text, span, key, left.iter().chain(right).copied())
}

fn check_finite(
    text: &str,
    span: Range<usize>,
    key: &str,
    mut numbers: impl Iterator<Item = f64>,
) -> Result<(), FileError> {
    if numbers.all(f64::is_finite) {
        Ok(())
    } else {
        Err(FileError::at(text, span, key, "a number is not finite"))
    }
}

fn check_ascending(text: &str, span: Range<usize>, key: &str, um: &[f64]) -> Result<(), FileError> {
    if um.windows(2).any(|w| w[0] >= w[1]) || um.iter().any(|w| *w <= 0.0) {
        return Err(FileError::at(text, span, key, "the wavelengths do not ascend"));
    }
    Ok(())
}

fn check_nd(text: &str, nd: &Placed) -> Result<f64, FileError> {
    let value = nd.get_ref().0;
    if value > 1.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(FileError::at(text, nd.span(), "nd", "an index is a finite number above 1"))
    }
}

fn check_vd(text: &str, vd: &Placed) -> Result<f64, FileError> {
    let value = vd.get_ref().0;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(FileError::at(text, vd.span(), "vd", "an Abbe number is finite and positive"))
    }
}

fn not_negative(text: &str, key: &str, number: &Option<Placed>) -> Result<Option<f64>, FileError> {
    let Some(number) = number else { return Ok(None) };
    match number.get_ref().0 {
        value if value >= 0.0 && value.is_finite() => Ok(Some(value)),
        _ => Err(FileError::at(text, number.span(), key, "this must be a finite number, at least 0")),
    }
}
