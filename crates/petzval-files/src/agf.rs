//! AGF, the glass catalogue format of lens design programs, in which makers publish their glasses.
//!
//! A file is a text of records, one per line. The first two letters name the record:
//!
//! | record | numbers |
//! |---|---|
//! | `NM` | name, formula 1 to 13, code, n_d, V_d, two flags, status (0 standard, 1 preferred, 2 obsolete, 3 special, 4 melt), melt frequency: begins a glass |
//! | `GC` | a remark |
//! | `ED` | expansion from -30 to 70 C and from 100 to 300 C, 1e-6/K, density, g/cm^3, dP_gF, a flag |
//! | `CD` | coefficients of the formula |
//! | `TD` | D0, D1, D2, E0, E1, w_tk and reference temperature of [`Thermal`] |
//! | `OD` | relative cost, resistance to climate, stain, acid, alkali, phosphate; -1 where unknown |
//! | `LD` | shortest and longest wavelength, um |
//! | `IT` | wavelength, um, internal transmittance, thickness, mm |
//! | `CC`, `!` | comments on the catalogue |
//!
//! The formulas, with the coefficients in the order of `CD` and w in um:
//!
//! | number | formula |
//! |---|---|
//! | 1 Schott | `n^2 = a0 + a1 w^2 + a2 w^-2 + a3 w^-4 + a4 w^-6 + a5 w^-8` |
//! | 2 Sellmeier 1, 6 Sellmeier 3, 11 Sellmeier 5 | `n^2 = 1 + sum_i K_i w^2 / (w^2 - L_i)`, 3, 4, 5 terms K1, L1, K2, ... |
//! | 3 Herzberger | `n = A + B L + C L^2 + D w^2 + E w^4 + F w^6`, `L = 1 / (w^2 - 0.028)` |
//! | 4 Sellmeier 2 | `n^2 = 1 + A + B1 w^2 / (w^2 - w1^2) + B2 / (w^2 - w2^2)` |
//! | 5 Conrady | `n = n0 + A / w + B / w^3.5` |
//! | 7 Handbook of Optics 1 | `n^2 = A + B / (w^2 - C) - D w^2` |
//! | 8 Handbook of Optics 2 | `n^2 = A + B w^2 / (w^2 - C) - D w^2` |
//! | 9 Sellmeier 4 | `n^2 = A + B w^2 / (w^2 - C) + D w^2 / (w^2 - E)` |
//! | 10 Extended | 1 Schott with `+ a6 w^-10 + a7 w^-12` |
//! | 12 Extended 2 | 1 Schott with `+ a6 w^4 + a7 w^6` |
//! | 13 Extended 3 | `n^2 = a0 + a1 w^2 + a2 w^4 + a3 w^-2 + a4 w^-4 + a5 w^-6 + a6 w^-8 + a7 w^-10 + a8 w^-12` |
//!
//! A glass without a usable formula is left out with a warning. If the file has no other glass, it is an error. A malformed
//! line that does not affect an index, such as a row of transmittance with a blank in it, is left out with a warning.
//! Resistances are always left out.

use std::collections::HashMap;

use super::glass_file::{GlassFile, shifted};
use petzval_base::{FileError, quote};
use petzval_optics::glass::{Absorption, Dispersion, Expansion, Glass, Printed, Status, Thermal};

/// The glasses of an AGF file, all of one maker. Warnings about glasses that are left out come first. Fails if no glass
/// remains.
///
/// ```
/// # use petzval_files::parse_agf;
/// let text = "NM N-BK7 2 517642.251 1.5168 64.17 0 1\n\
///     CD 1.03961212 0.00600069867 0.231792344 0.0200179144 1.01046945 103.560653\n\
///     LD 0.3 2.5\n";
/// let file = parse_agf(text, "Schott")?;
/// assert!(file.warnings.is_empty());
/// assert!(file.glasses[0].printed_vd.unwrap().agrees(file.glasses[0].abbe_vd()));
/// # Ok::<(), petzval_base::FileError>(())
/// ```
pub fn parse_agf(text: &str, maker: &str) -> Result<GlassFile, FileError> {
    let mut file = GlassFile::default();
    let mut places: HashMap<String, usize> = HashMap::new();
    let mut entry: Option<Entry> = None;
    // Errors of the glasses that are left out, and whether the current records belong to such a glass.
    let (mut lost, mut in_lost) = (Vec::new(), false);
    for (i, line) in text.lines().enumerate() {
        let line = Line { number: i + 1, text: line.trim() };
        let (record, _) = line.text.split_once(char::is_whitespace).unwrap_or((line.text, ""));
        match (record, &mut entry) {
            ("" | "CC", _) => {}
            (comment, _) if comment.starts_with('!') => {}
            ("NM", _) => {
                if let Some(done) = entry.take() {
                    lost.extend(close(done, &mut file, &mut places).err());
                }
                let begun = Entry::begin(&line, maker, &mut file.warnings);
                in_lost = begun.is_err();
                entry = begun.map_err(|error| lost.push(error)).ok();
            }
            ("GC" | "ED" | "CD" | "TD" | "OD" | "LD" | "IT", Some(open)) => {
                if let Err(error) = open.record(record, &line, &mut file.warnings) {
                    lost.push(error);
                    (entry, in_lost) = (None, true);
                }
            }
            ("GC" | "ED" | "CD" | "TD" | "OD" | "LD" | "IT", None) if in_lost => {}
            ("CD", None) => {
                let error = line.error("these coefficients belong to no glass");
                lost.push(error.hint("a glass begins with `NM`"));
            }
            ("GC" | "ED" | "TD" | "OD" | "LD" | "IT", None) => {
                file.warnings.push(line.error("this belongs to no glass: left out"));
            }
            _ => file.warnings.push(line.error("no such record in AGF files: left out")),
        }
    }
    // Complete the last glass, then decide between an error and warnings.
    if let Some(done) = entry {
        lost.extend(close(done, &mut file, &mut places).err());
    }
    if file.glasses.is_empty() && !lost.is_empty() {
        return Err(lost.swap_remove(0));
    }
    if file.glasses.is_empty() {
        let hint = "an AGF file has a line `NM name formula ...` for each glass";
        return Err(Line { number: 1, text: "" }.error("there is no glass in this file").hint(hint));
    }
    for error in &mut lost {
        error.message += ": the glass is left out";
    }
    file.warnings.splice(0..0, lost);
    Ok(file)
}

/// Completes a glass and adds it to the file. A later glass of the same name replaces an earlier one, unless only the later
/// one is obsolete.
fn close(entry: Entry, file: &mut GlassFile, places: &mut HashMap<String, usize>) -> Result<(), FileError> {
    let (number, glass) = (entry.line, entry.finish(&mut file.warnings)?);
    let line = Line { number, text: &glass.name };
    if glass.name.to_uppercase() == "AIR" {
        file.warnings.push(line.error("air is built in: left out"));
        return Ok(());
    }
    match places.get(&glass.name.to_uppercase()) {
        Some(place) => {
            let is_obsolete = |glass: &Glass| glass.status == Some(Status::Obsolete);
            if is_obsolete(&glass) && !is_obsolete(&file.glasses[*place]) {
                file.warnings.push(line.error("an obsolete glass has the name of this one: left out"));
                return Ok(());
            }
            if file.glasses[*place] != glass {
                file.warnings.push(
                    line.error("the file has this glass twice, with different figures: the later is used"),
                );
            }
            file.glasses[*place] = glass;
        }
        None => {
            places.insert(glass.name.to_uppercase(), file.glasses.len());
            file.glasses.push(glass);
        }
    }
    Ok(())
}

/// A line of the file.
struct Line<'a> {
    number: usize,
    text: &'a str,
}

impl Line<'_> {
    fn error(&self, message: impl Into<String>) -> FileError {
        FileError {
            line: u32::try_from(self.number).ok(),
            column: None,
            key: String::new(),
            value: quote(self.text),
            message: message.into(),
            hint: None,
        }
    }

    /// The words after the record's name.
    fn words(&self) -> impl Iterator<Item = &str> {
        self.text.split_whitespace().skip(1)
    }

    /// The numbers after the record's name; `None` if a word is not a finite number.
    fn numbers(&self) -> Option<Vec<f64>> {
        self.words().map(finite).collect()
    }
}

fn finite(word: &str) -> Option<f64> {
    word.parse().ok().filter(|value: &f64| value.is_finite())
}

/// A glass whose records are being read.
struct Entry {
    /// Line of its `NM`.
    line: usize,
    formula: usize,
    glass: Glass,
    /// Whether `CD` has been read.
    has_coefficients: bool,
    /// Rows of `IT`.
    transmittance: Vec<[f64; 3]>,
}

/// Number of coefficients of each formula.
const COUNTS: [usize; 13] = [6, 6, 6, 5, 3, 8, 4, 4, 5, 8, 10, 8, 9];

/// Temperature ranges of the two expansions of `ED`, degrees Celsius.
const EXPANSION_C: [[f64; 2]; 2] = [[-30.0, 70.0], [100.0, 300.0]];

impl Entry {
    fn begin(line: &Line<'_>, maker: &str, warnings: &mut Vec<FileError>) -> Result<Self, FileError> {
        let words: Vec<&str> = line.words().collect();
        let formula = words.get(1).and_then(|word| finite(word));
        let (Some(name), Some(formula)) = (words.first(), formula) else {
            return Err(line.error("a glass needs a name and the number of a formula"));
        };
        if formula.fract() != 0.0 || !(1.0..=COUNTS.len() as f64).contains(&formula) {
            let message = format!("there is no formula {formula}");
            return Err(line
                .error(message)
                .hint(format!("formulas are numbered from 1 to {}", COUNTS.len())));
        }
        // The formula is set when `CD` is read.
        let mut glass = Glass::new(*name, Dispersion::Constant(1.0));
        glass.maker = maker.to_owned();
        let mut printed = |place: usize, what: &str| {
            let number = words.get(place).and_then(|word| Printed::parse(word));
            if number.is_none() {
                warnings.push(line.error(format!("there is no {what}")));
            }
            // Media without n_d or V_d, such as infrared materials, have 0.
            number.filter(|number| number.value > 0.0)
        };
        glass.printed_nd = printed(3, "n_d").filter(|nd| nd.value > 1.0);
        glass.printed_vd = printed(4, "V_d");
        glass.status = match words.get(6).copied() {
            None => None,
            Some("0") => Some(Status::Standard),
            Some("1") => Some(Status::Preferred),
            Some("2") => Some(Status::Obsolete),
            Some("3") => Some(Status::Special),
            Some("4") => Some(Status::Melt),
            Some(_) => {
                warnings.push(line.error("the status is not one of 0 to 4"));
                None
            }
        };
        let formula = formula as usize;
        Ok(Self { line: line.number, formula, glass, has_coefficients: false, transmittance: Vec::new() })
    }

    fn record(
        &mut self,
        record: &str,
        line: &Line<'_>,
        warnings: &mut Vec<FileError>,
    ) -> Result<(), FileError> {
        let numbers = line.numbers();
        match (record, numbers.as_deref()) {
            ("GC", _) => {
                let remark: Vec<&str> = line.words().collect();
                self.glass.source = remark.join(" ");
            }
            ("CD", Some(numbers)) if !numbers.is_empty() => {
                let count = COUNTS[self.formula - 1];
                if numbers.iter().skip(count).any(|extra| *extra != 0.0) {
                    let message =
                        format!("formula {} has {count} coefficients: the others are left out", self.formula);
                    warnings.push(line.error(message));
                }
                let mut padded = numbers[..numbers.len().min(count)].to_vec();
                padded.resize(count, 0.0);
                self.glass.dispersion = dispersion(self.formula, &padded)
                    .ok_or_else(|| line.error(format!("the formula of `{}` has no term", self.glass.name)))?;
                if std::mem::replace(&mut self.has_coefficients, true) {
                    return Err(line.error(format!("`{}` has coefficients already", self.glass.name)));
                }
            }
            ("CD", _) => {
                let message = format!("these are not coefficients of `{}`", self.glass.name);
                return Err(line.error(message).hint("write numbers such as 1.03961212E+00"));
            }
            // A blank record means unknown values.
            ("ED" | "TD" | "OD" | "LD" | "IT", Some([])) => {}
            ("ED", Some(rest)) => {
                self.glass.expansion = (EXPANSION_C.iter().zip(rest))
                    .filter(|(_, ppm)| **ppm != 0.0 && **ppm != -1.0)
                    .map(|(range_c, ppm)| Expansion { range_c: *range_c, per_k: shifted(*ppm, -6) })
                    .collect();
                self.glass.density_g_cm3 = rest.get(2).copied().filter(|density| *density > 0.0);
            }
            ("TD", Some([d0, d1, d2, e0, e1, lambda_tk_um, reference_c, ..])) => {
                let (d, e) = ([*d0, *d1, *d2], [*e0, *e1]);
                // Zeros mean unknown values: the index of every glass changes with temperature.
                if d != [0.0; 3] || e != [0.0; 2] {
                    let (lambda_tk_um, reference_c) = (*lambda_tk_um, *reference_c);
                    self.glass.thermal = Some(Thermal { d, e, lambda_tk_um, reference_c });
                }
            }
            ("OD", Some([cost, ..])) => self.glass.relative_cost = Some(*cost).filter(|cost| *cost > 0.0),
            ("LD", Some([min, max, ..])) if *min > 0.0 && max >= min => {
                self.glass.range_um = Some([*min, *max])
            }
            ("IT", Some([um, t, mm, ..])) if *um > 0.0 && (0.0..=1.0).contains(t) && *mm > 0.0 => {
                self.transmittance.push([*um, *t, *mm]);
            }
            ("OD", None) => {
                // Resistances may be words; only the first value, the cost, is read.
                self.glass.relative_cost = line.words().next().and_then(finite).filter(|cost| *cost > 0.0);
            }
            _ => warnings.push(line.error("the numbers do not fit the record: left out")),
        }
        Ok(())
    }

    /// The complete glass, after its last record.
    fn finish(mut self, warnings: &mut Vec<FileError>) -> Result<Glass, FileError> {
        let name = self.glass.name.clone();
        let at = |number: usize| Line { number, text: &name };
        if !self.has_coefficients {
            return Err(at(self.line)
                .error(format!("`{name}` has no coefficients"))
                .hint("add a line `CD ...`"));
        }
        self.transmittance.sort_by(|a, b| a[0].total_cmp(&b[0]));
        self.transmittance.dedup();
        let rows = self.transmittance.len();
        self.transmittance.dedup_by(|later, earlier| later[0] == earlier[0]);
        if self.transmittance.len() < rows {
            warnings.push(
                at(self.line).error("two rows of transmittance have the same wavelength: the first is used"),
            );
        }
        if !self.transmittance.is_empty() {
            self.glass.absorption = Some(Absorption::Transmittance(self.transmittance));
        }
        let misprints = self.glass.drop_misprints();
        warnings.extend(misprints.into_iter().map(|message| at(self.line).error(message)));
        Ok(self.glass)
    }
}

/// A formula by its number; `a` has as many coefficients as that formula. `None` if the formula would have no term.
fn dispersion(formula: usize, a: &[f64]) -> Option<Dispersion> {
    let schott_powers = [0.0, 2.0, -2.0, -4.0, -6.0, -8.0];
    let series = |powers: &[f64]| {
        let rows = a.iter().zip(powers).map(|(a, p)| [*a, *p]);
        Dispersion::Square { powers: rows.filter(|[a, _]| *a != 0.0).collect(), resonances: Vec::new() }
    };
    let square = |powers: &[[f64; 2]], resonances: &[[f64; 4]]| Dispersion::Square {
        powers: powers.iter().copied().filter(|[a, _]| *a != 0.0).collect(),
        resonances: resonances.iter().copied().filter(|[b, ..]| *b != 0.0).collect(),
    };
    let found = match (formula, a) {
        (1, &[a0, a1, a2, a3, a4, a5]) => Dispersion::Schott([a0, a1, a2, a3, a4, a5]),
        (3, &[a0, a1, a2, a3, a4, a5]) => Dispersion::Herzberger([a0, a1, a2, a3, a4, a5]),
        (4, &[a, b1, w1, b2, w2]) => {
            square(&[[1.0, 0.0], [a, 0.0]], &[[b1, 2.0, w1, 2.0], [b2, 0.0, w2, 2.0]])
        }
        (5, &[n0, a, b]) => Dispersion::Powers(vec![[n0, 0.0], [a, -1.0], [b, -3.5]]),
        (7, &[a, b, c, d]) => square(&[[a, 0.0], [-d, 2.0]], &[[b, 0.0, c, 1.0]]),
        (8, &[a, b, c, d]) => square(&[[a, 0.0], [-d, 2.0]], &[[b, 2.0, c, 1.0]]),
        (9, &[a, b, c, d, e]) => square(&[[a, 0.0]], &[[b, 2.0, c, 1.0], [d, 2.0, e, 1.0]]),
        (10, _) => series(&[&schott_powers[..], &[-10.0, -12.0]].concat()),
        (12, _) => series(&[&schott_powers[..], &[4.0, 6.0]].concat()),
        (13, _) => series(&[0.0, 2.0, 4.0, -2.0, -4.0, -6.0, -8.0, -10.0, -12.0]),
        _ => {
            let pairs = a.chunks_exact(2).filter(|pair| pair[0] != 0.0);
            let (b, c_um2) = pairs.map(|pair| (pair[0], pair[1])).unzip();
            Dispersion::Sellmeier { b, c_um2 }
        }
    };
    let has_terms = match &found {
        Dispersion::Sellmeier { b, .. } => !b.is_empty(),
        Dispersion::Square { powers, resonances } => !(powers.is_empty() && resonances.is_empty()),
        _ => a.iter().any(|a| *a != 0.0),
    };
    has_terms.then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(formula: usize, cd: &str, um: f64) -> f64 {
        let text = format!("NM X {formula} 0 1.5 60\nCD {cd}\nLD 5 9\n");
        parse_agf(&text, "").unwrap().glasses[0].index(um)
    }

    #[test]
    fn every_formula_matches_the_published_one() {
        // By hand at 0.5 um: w^2 = 1/4, w^-2 = 4.
        let cases: [(usize, &str, f64); 13] = [
            (1, "2 -0.01 0.02 1e-3 -1e-4 1e-5", (2.0 - 0.0025 + 0.08 + 0.016 - 0.0064 + 0.00256_f64).sqrt()),
            (2, "1 0.01 0.2 0.02 1 100", (1.0 + 0.25 / 0.24 + 0.05 / 0.23 + 0.25 / -99.75_f64).sqrt()),
            (
                3,
                "1.5 0.01 0.001 -1e-3 2e-3 3e-3",
                1.5 + 0.01 / 0.222 + 0.001 / 0.222 / 0.222 - 2.5e-4 + 1.25e-4 + 3e-3 / 64.0,
            ),
            (4, "0.5 0.7 0.1 0.02 0.2", (1.5 + 0.7 * 0.25 / 0.24 + 0.02 / 0.21_f64).sqrt()),
            (5, "1.5 0.01 0.001", 1.5 + 0.02 + 0.001 * 2_f64.powf(3.5)),
            (
                6,
                "1 0.01 0.2 0.02 1 100 0.3 0.05",
                (1.0 + 0.25 / 0.24 + 0.05 / 0.23 - 0.25 / 99.75 + 0.075 / 0.2_f64).sqrt(),
            ),
            (7, "2.2 0.02 0.01 0.03", (2.2 + 0.02 / 0.24 - 0.0075_f64).sqrt()),
            (8, "1.2 1.1 0.01 0.03", (1.2 + 1.1 * 0.25 / 0.24 - 0.0075_f64).sqrt()),
            (9, "1.2 1.1 0.01 0.3 0.05", (1.2 + 1.1 * 0.25 / 0.24 + 0.075 / 0.2_f64).sqrt()),
            (10, "2 -0.01 0.02 0 0 0 1e-5 1e-6", (2.0 - 0.0025 + 0.08 + 0.01024 + 0.004096_f64).sqrt()),
            (11, "1 0.01 0 0 0 0 0 0 0.3 0.05", (1.0 + 0.25 / 0.24 + 0.075 / 0.2_f64).sqrt()),
            (
                12,
                "2 -0.01 0.02 0 0 0 -0.01 -0.02",
                (2.0 - 0.0025 + 0.08 - 0.01 / 16.0 - 0.02 / 64.0_f64).sqrt(),
            ),
            (
                13,
                "2 -0.01 -0.02 0.02 1e-3 1e-4 1e-5 1e-6 1e-7",
                (2.0 - 0.0025 - 0.00125 + 0.08 + 0.016 + 0.0064 + 0.00256 + 0.001024 + 0.0004096_f64).sqrt(),
            ),
        ];
        for (formula, cd, by_hand) in cases {
            let found = index(formula, cd, 0.5);
            assert!((found - by_hand).abs() < 1e-14, "formula {formula}: {found}, not {by_hand}");
        }
    }

    const GLASS: &str = "CC a catalogue\n! a comment\nNM F2 2 620364.360 1.62004 36.37 0 1\nGC lead glass\n\
        ED 8.2 9.2 3.599 0.0002 0\n\
        CD 1.34533359 0.00997743871 0.209073176 0.0470450767 0.937357162 111.886764\n\
        TD 1.51E-06 1.56E-08 -2.78E-11 9.34E-07 1.04E-09 0.25 20\nOD 1.2419 1 0 1 2.3 1.3\nLD 0.32 2.5\n\
        IT 0.334 0.211 25\nIT 0.32 0.0 25\nIT 0.35 0.78 25\n";

    #[test]
    fn every_record_is_read() {
        let file = parse_agf(GLASS, "Schott").unwrap();
        assert_eq!(file.warnings, []);
        let glass = &file.glasses[0];
        assert_eq!(
            (glass.name.as_str(), glass.maker.as_str(), glass.source.as_str()),
            ("F2", "Schott", "lead glass")
        );
        assert_eq!(glass.status, Some(Status::Preferred));
        assert!(
            glass.printed_nd.unwrap().agrees(glass.nd()) && glass.printed_vd.unwrap().agrees(glass.abbe_vd())
        );
        assert_eq!(glass.expansion[0], Expansion { range_c: [-30.0, 70.0], per_k: 8.2e-6 });
        assert_eq!((glass.density_g_cm3, glass.relative_cost), (Some(3.599), Some(1.2419)));
        assert_eq!(glass.range_um, Some([0.32, 2.5]));
        assert_eq!(glass.thermal.unwrap().lambda_tk_um, 0.25);
        assert!((glass.internal_transmission(0.35, 25.0).unwrap() - 0.78).abs() < 1e-12);
    }

    #[test]
    fn lines_that_do_not_affect_an_index_give_warnings_with_their_line() {
        let text = format!("Reproduced by permission\n{GLASS}XY 1 2\nIT 0.36  25\nLD 2.5 0.3\n")
            .replace("OD 1.2419", "OD _");
        let file = parse_agf(&text, "").unwrap();
        let lines: Vec<_> = file.warnings.iter().map(|w| w.line.unwrap()).collect();
        assert_eq!(lines, [1, 14, 15, 16]);
        assert_eq!(file.glasses[0].range_um, Some([0.32, 2.5]));
        // An equal glass gives no warning; a different glass of that name does.
        let twice = GLASS.to_owned() + GLASS;
        assert_eq!(parse_agf(&twice, "").map(|f| (f.glasses.len(), f.warnings.len())), Ok((1, 0)));
        // An obsolete glass does not replace a current one.
        let obsolete = GLASS.to_owned() + &GLASS.replace("36.37 0 1", "36.37 0 2");
        let file = parse_agf(&obsolete, "").unwrap();
        assert_eq!((file.glasses[0].status, file.warnings.len()), (Some(Status::Preferred), 1));
        let other = GLASS.to_owned() + &GLASS.replace("9.37357162", "9.4").replace("36.37", "36.38");
        assert_eq!(parse_agf(&other, "").map(|f| (f.glasses.len(), f.warnings.len())), Ok((1, 1)));
        // Printed values that contradict the formula are left out, because our own reader would refuse them.
        let misprinted = parse_agf(&GLASS.replace("1.62004 36.37", "1.63004 63.37"), "").unwrap();
        let says: Vec<_> = misprinted.warnings.iter().map(|w| (w.line, w.message.as_str())).collect();
        assert!(
            says[0].1.contains("gives nd = 1.62004") && says[1].1.contains("gives vd = 36.366"),
            "{says:?}"
        );
        assert_eq!((says.len(), says[0].0), (2, Some(3)));
        let glass = &misprinted.glasses[0];
        assert_eq!((glass.printed_nd, glass.printed_vd), (None, None));
        let again = crate::parse_catalog(&crate::write_catalog([glass])).unwrap();
        assert_eq!(*again.get("F2").unwrap(), *glass);
    }

    #[test]
    fn an_unusable_glass_is_a_warning_among_others_and_an_error_alone() {
        for (from, to, line, says) in [
            ("F2 2 620364.360", "F2 14", Some(3), "there is no formula 14"),
            ("F2 2 620364.360 1.62004 36.37 0 1", "F2", Some(3), "needs a name and the number"),
            ("CD 1.34533359", "CD 1.345e3x", Some(6), "not coefficients of `F2`"),
            ("CD", "CC", Some(3), "`F2` has no coefficients"),
            ("NM F2", "CC F2", Some(6), "belong to no glass"),
            ("CD 1.34533359", "CD 1e999", Some(6), "not coefficients of `F2`"),
            (
                "CD 1.34533359 0.00997743871 0.209073176 0.0470450767 0.937357162",
                "CD 0 1 0 1 0",
                Some(6),
                "formula of `F2` has no term",
            ),
        ] {
            let bad = GLASS.replace(from, to);
            let error = parse_agf(&bad, "").unwrap_err();
            assert_eq!(error.line, line, "{error}");
            assert!(error.to_string().contains(says), "{error}");
            let file = parse_agf(&(bad + &GLASS.replace("NM F2", "NM F3")), "").unwrap();
            let names: Vec<_> = file.glasses.iter().map(|glass| glass.name.as_str()).collect();
            assert_eq!(names, ["F3"]);
            let warning = &file.warnings[0];
            assert_eq!(warning.line, line, "{warning}");
            assert!(warning.message.contains(says) && warning.message.ends_with("is left out"), "{warning}");
        }
        assert!(parse_agf("", "").is_err() && parse_agf("CC nothing", "").is_err());
    }
}
