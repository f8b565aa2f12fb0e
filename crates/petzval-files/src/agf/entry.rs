//! A glass whose records are being read.

use petzval_base::FileError;
use petzval_optics::glass::{Absorption, Dispersion, Expansion, Glass, Printed, Status, Thermal};

use super::formula::{COUNTS, dispersion};
use super::lines::{Line, error_at, finite};
use crate::glass_file::{GlassWarning, Refused, shifted};

/// A glass whose records are being read.
pub(super) struct Entry {
    /// Line of its `NM`.
    pub line: usize,
    formula: usize,
    glass: Glass,
    /// Whether `CD` has been read.
    has_coefficients: bool,
    /// Rows of `IT`.
    transmittance: Vec<[f64; 3]>,
}

/// Temperature ranges of the two expansions of `ED`, degrees Celsius.
const EXPANSION_C: [[f64; 2]; 2] = [[-30.0, 70.0], [100.0, 300.0]];

impl Entry {
    /// Begins a glass with its record `NM`.
    pub fn begin(line: &Line, maker: &str, warnings: &mut Vec<GlassWarning>) -> Result<Self, Refused> {
        let words: Vec<&str> = line.words().collect();
        let formula = words.get(1).and_then(|word| finite(word));
        let is_obsolete = words.get(6) == Some(&"2");
        let (Some(name), Some(formula)) = (words.first(), formula) else {
            let error = line.error("a glass needs a name and the number of a formula");
            return Err(Refused {
                name: words.first().map(|name| (*name).to_owned()),
                maker: maker.to_owned(),
                is_obsolete,
                error: Box::new(error),
            });
        };
        if formula.fract() != 0.0 || !(1.0..=COUNTS.len() as f64).contains(&formula) {
            let message = format!("there is no formula {formula}");
            let hint = format!("formulas are numbered from 1 to {}", COUNTS.len());
            let error = Box::new(line.error(message).hint(hint));
            let (name, maker) = (Some((*name).to_owned()), maker.to_owned());
            return Err(Refused { name, maker, is_obsolete, error });
        }
        // The formula is set when `CD` is read.
        let mut glass = Glass::new(*name, Dispersion::Constant(1.0));
        glass.maker = maker.to_owned();
        let mut printed = |place: usize, what: &str| {
            let number = words.get(place).and_then(|word| Printed::parse(word));
            if number.is_none() {
                warnings.push(line.error(format!("there is no {what}")).into());
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
                warnings.push(line.error("the status is not one of 0 to 4").into());
                None
            }
        };
        let formula = formula as usize;
        Ok(Self { line: line.number, formula, glass, has_coefficients: false, transmittance: Vec::new() })
    }

    /// The glass is left out, for an error.
    pub fn refused(&self, error: FileError) -> Refused {
        let Glass { name, maker, status, .. } = &self.glass;
        let is_obsolete = *status == Some(Status::Obsolete);
        Refused { name: Some(name.clone()), maker: maker.clone(), is_obsolete, error: Box::new(error) }
    }

    /// Reads a record other than `NM`. Fails if the glass has no usable formula by it.
    pub fn record(
        &mut self,
        record: &str,
        line: &Line,
        warnings: &mut Vec<GlassWarning>,
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
                    warnings.push(line.error(message).into());
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
            _ => {
                let error = line.error("the numbers do not fit the record: left out");
                warnings.push(GlassWarning::of_record(record, error));
            }
        }
        Ok(())
    }

    /// The complete glass, after its last record. Fails if it has no formula, or one that contradicts its printed n_d or V_d.
    pub fn finish(mut self, warnings: &mut Vec<GlassWarning>) -> Result<Glass, Refused> {
        let (number, name) = (self.line, self.glass.name.clone());
        if !self.has_coefficients {
            let error = error_at(number, &name, format!("`{name}` has no coefficients"));
            return Err(self.refused(error.hint("add a line `CD ...`")));
        }
        self.transmittance.sort_by(|a, b| a[0].total_cmp(&b[0]));
        self.transmittance.dedup();
        let rows = self.transmittance.len();
        self.transmittance.dedup_by(|later, earlier| later[0] == earlier[0]);
        if self.transmittance.len() < rows {
            let message = "two rows of transmittance have the same wavelength: the first is used";
            warnings.push(error_at(number, &name, message).into());
        }
        if !self.transmittance.is_empty() {
            self.glass.absorption = Some(Absorption::Transmittance(std::mem::take(&mut self.transmittance)));
        }
        match self.glass.misprint() {
            Some(misprint) => {
                let hint = "correct the coefficients or the printed value, by the data sheet of the maker";
                Err(self.refused(error_at(number, &name, misprint.to_string()).hint(hint)))
            }
            None => Ok(self.glass),
        }
    }
}
