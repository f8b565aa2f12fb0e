//! Writes glass tables; reading them gives the same bits.

use std::fmt::Write;

use toml_writer::ToTomlKey;

use crate::toml_number::{number, numbers, quoted};
use petzval_optics::glass::{Absorption, Dispersion, Glass};

/// The text of a catalogue of these glasses, in their order, under their own names.
pub fn write_catalog<'a>(glasses: impl IntoIterator<Item = &'a Glass>) -> String {
    let mut out = String::new();
    for glass in glasses {
        write_glass(&glass.name, glass, &mut out).expect("a string takes whatever is written to it");
    }
    out
}

/// Writes a table `[glass.NAME]`, after an empty line.
pub(crate) fn write_glass(name: &str, glass: &Glass, out: &mut String) -> std::fmt::Result {
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
            // Write a common thickness once.
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
        let row = |e: &petzval_optics::glass::Expansion| {
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

#[cfg(test)]
mod tests {
    use super::*;
    use petzval_optics::glass::{Expansion, Printed, Status, Thermal};

    #[test]
    fn writing_and_reading_keeps_every_formula_and_key_to_the_last_bit() {
        // Numbers without a short decimal.
        let odd = |i: i32| (f64::from(i) + 1.0 / 3.0) * 10_f64.powi(-3 * i);
        let six = [1, 2, 3, 4, 5, 6].map(odd);
        let formulas = [
            Dispersion::Constant(1.0 + odd(0)),
            Dispersion::Sellmeier { b: vec![odd(0), odd(1)], c_um2: vec![odd(2), odd(3)] },
            Dispersion::Schott(six),
            Dispersion::Square {
                powers: vec![[odd(0), 0.0], [-0.0, -2.5]],
                resonances: vec![[odd(1), 2.0, odd(2), 2.0]],
            },
            Dispersion::Square { powers: Vec::new(), resonances: vec![[odd(1), 0.0, -odd(2), 1.0]] },
            Dispersion::Powers(vec![[1.5, 0.0], [odd(1), -3.5]]),
            Dispersion::Herzberger(six),
            Dispersion::Gas { a: odd(4), terms: vec![[odd(1), 238.0185]] },
            Dispersion::LorentzLorenz([odd(1), odd(2), odd(3), odd(4)]),
            Dispersion::Exotic(six),
            Dispersion::NdVd { nd: 1.0 + odd(0), vd: 60.0 + odd(0) },
            Dispersion::Table { wavelength_um: vec![0.4, 0.5 + odd(1)], index: vec![1.5, odd(0)] },
        ];
        let glasses: Vec<Glass> = (0_i32..)
            .zip(formulas)
            .map(|(i, dispersion)| {
                let mut glass = Glass::new(format!("g {i:02}"), dispersion);
                glass.maker = "A \"maker\"".to_owned();
                glass.source = "line\nline".to_owned();
                glass.status = Some(Status::ALL[i as usize % Status::ALL.len()]);
                // Outside the visible range n_d is not compared with the formula.
                glass.range_um = Some([1.0 + odd(1), 2.0]);
                if !matches!(glass.dispersion, Dispersion::NdVd { .. }) {
                    (glass.printed_nd, glass.printed_vd) =
                        (Printed::parse("1.51680"), Printed::parse("64.0"));
                }
                glass.absorption = match i % 3 {
                    0 => Some(Absorption::Transmittance(vec![[0.4, odd(0), 10.0], [0.5, 1.0, 10.0]])),
                    1 => Some(Absorption::Transmittance(vec![[0.4, odd(0), 10.0], [0.5, 0.0, odd(0)]])),
                    _ => Some(Absorption::Extinction(vec![[odd(1), odd(3)], [0.5, 0.0]])),
                };
                let (d, e) = ([odd(3), -odd(4), 0.0], [odd(3), odd(5)]);
                glass.thermal = Some(Thermal { d, e, lambda_tk_um: odd(1), reference_c: 20.0 });
                glass.expansion = vec![Expansion { range_c: [-30.0, 70.0], per_k: odd(3) }; (i % 3) as usize];
                (glass.density_g_cm3, glass.relative_cost) = (Some(odd(0)), Some(0.0));
                glass
            })
            .collect();
        let text = write_catalog(&glasses);
        let again = crate::parse_catalog(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let again: Vec<Glass> = again.glasses().map(|glass| glass.as_ref().clone()).collect();
        assert_eq!(again, glasses);
        // Compare texts too: 0 and -0 are equal numbers with different bits.
        assert_eq!(write_catalog(&again), text);
    }
}
