//! Writing glass tables, such that reading them gives the same bits.

use std::fmt::Write;

use toml_writer::ToTomlKey;

use crate::format::lens_toml::{number, numbers, quoted};
use crate::glass::{Absorption, Dispersion, Glass};

/// A catalogue file of these glasses, in their order, under their own names.
pub fn write_catalog<'a>(glasses: impl IntoIterator<Item = &'a Glass>) -> String {
    let mut out = String::new();
    for glass in glasses {
        write_glass(&glass.name, glass, &mut out).expect("a string takes whatever is written to it");
    }
    out
}

/// A table `[glass.NAME]`, with an empty line before it.
pub(in crate::format) fn write_glass(name: &str, glass: &Glass, out: &mut String) -> std::fmt::Result {
    writeln!(out, "\n[glass.{}]", name.to_toml_key())?;
    for (key, text) in [("maker", &glass.maker), ("source", &glass.source)] {
        if !text.is_empty() {
            writeln!(out, "{key} = {}", quoted(text))?;
        }
    }
    if let Some(status) = glass.status {
        writeln!(out, "status = \"{status}\"")?;
    }
    if !matches!(glass.dispersion, Dispersion::NdVd { .. }) {
        for (key, printed) in [("nd", glass.printed_nd), ("vd", glass.printed_vd)] {
            if let Some(printed) = printed {
                writeln!(out, "{key} = {printed}")?;
            }
        }
    }
    write_dispersion(&glass.dispersion, out)?;
    if let Some(range) = glass.range_um {
        writeln!(out, "range_um = {}", numbers(&range))?;
    }
    match &glass.absorption {
        None => {}
        Some(Absorption::Transmittance(rows)) => {
            let column = |i: usize| numbers(&rows.iter().map(|row| row[i]).collect::<Vec<_>>());
            // Nearly always all rows have one thickness.
            let thickness_mm = match rows.first() {
                Some(first) if rows.iter().all(|row| row[2].to_bits() == first[2].to_bits()) => {
                    number(first[2])
                }
                _ => column(2),
            };
            let (um, transmittance) = (column(0), column(1));
            let columns = format!("wavelength_um = {um}, transmittance = {transmittance}");
            writeln!(out, "transmission = {{ thickness_mm = {thickness_mm}, {columns} }}")?;
        }
        Some(Absorption::Extinction(rows)) => {
            let column = |i: usize| numbers(&rows.iter().map(|row| row[i]).collect::<Vec<_>>());
            writeln!(out, "extinction = {{ wavelength_um = {}, k = {} }}", column(0), column(1))?;
        }
    }
    if let Some(t) = &glass.thermal {
        let (d, e, lambda_tk_um) = (numbers(&t.d), numbers(&t.e), number(t.lambda_tk_um));
        let reference_c = number(t.reference_c);
        writeln!(
            out,
            "thermal = {{ d = {d}, e = {e}, lambda_tk_um = {lambda_tk_um}, reference_c = {reference_c} }}"
        )?;
    }
    if !glass.expansion.is_empty() {
        let row = |e: &crate::glass::Expansion| {
            format!("{{ range_c = {}, per_k = {} }}", numbers(&e.range_c), number(e.per_k))
        };
        let rows: Vec<String> = glass.expansion.iter().map(row).collect();
        writeln!(out, "expansion = [{}]", rows.join(", "))?;
    }
    for (key, value) in [("density_g_cm3", glass.density_g_cm3), ("relative_cost", glass.relative_cost)] {
        if let Some(value) = value {
            writeln!(out, "{key} = {}", number(value))?;
        }
    }
    Ok(())
}

fn write_dispersion(dispersion: &Dispersion, out: &mut String) -> std::fmt::Result {
    match dispersion {
        Dispersion::Constant(n) => writeln!(out, "n = {}", number(*n)),
        Dispersion::NdVd { nd, vd } => writeln!(out, "nd = {}\nvd = {}", number(*nd), number(*vd)),
        Dispersion::Schott(a) => writeln!(out, "schott = {}", numbers(a)),
        Dispersion::Sellmeier { b, c_um2 } => {
            writeln!(out, "sellmeier = {{ b = {}, c_um2 = {} }}", numbers(b), numbers(c_um2))
        }
        Dispersion::Square { powers, resonances } => {
            let mut parts = Vec::new();
            if !powers.is_empty() {
                parts.push(format!("powers = {}", rows(powers)));
            }
            if !resonances.is_empty() {
                parts.push(format!("resonances = {}", rows(resonances)));
            }
            writeln!(out, "square = {{ {} }}", parts.join(", "))
        }
        Dispersion::Powers(powers) => writeln!(out, "powers = {}", rows(powers)),
        Dispersion::Herzberger(a) => writeln!(out, "herzberger = {}", numbers(a)),
        Dispersion::Gas { a, terms } => {
            writeln!(out, "gas = {{ a = {}, terms = {} }}", number(*a), rows(terms))
        }
        Dispersion::LorentzLorenz(a) => writeln!(out, "lorentz_lorenz = {}", numbers(a)),
        Dispersion::Exotic(a) => writeln!(out, "exotic = {}", numbers(a)),
        Dispersion::Table { wavelength_um, index } => {
            let (wavelength_um, index) = (numbers(wavelength_um), numbers(index));
            writeln!(out, "table = {{ wavelength_um = {wavelength_um}, index = {index} }}")
        }
    }
}

fn rows<const N: usize>(rows: &[[f64; N]]) -> String {
    let rows: Vec<String> = rows.iter().map(|row| numbers(row)).collect();
    format!("[{}]", rows.join(", "))
}
