//! AGF, the glass catalogue format of lens design programs, in which makers publish their glasses.
//!
//! A file is a text of records, one per line; a line that begins with a number continues the record before it. The first two
//! letters name the record:
//!
//! | record | numbers |
//! |---|---|
//! | `NM` | name, formula 1 to 13, code, n_d, V_d, two flags, status (0 standard, 1 preferred, 2 obsolete, 3 special, 4 melt), melt frequency: begins a glass |
//! | `GC` | a remark |
//! | `ED` | expansion from -30 to 70 C and from 100 to 300 C, 1e-6/K, density, g/cm^3, dP_gF, a flag |
//! | `CD` | coefficients of the formula |
//! | `TD` | D0, D1, D2, E0, E1, w_tk and reference temperature of its change with temperature |
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
//! A glass without a usable formula is left out with a warning, and so is one whose formula contradicts its printed n_d or V_d
//! (see [`Glass::misprint`]). If the file has no other glass, it is an error. A malformed
//! line that does not affect an index, such as a row of transmittance with a blank in it, is left out with a warning.
//! Resistances are always left out.

mod entry;
mod formula;
mod lines;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use super::glass_file::{GlassFile, GlassWarning, Refused};
use entry::Entry;
use lines::{Line, error_at};
use petzval_base::FileError;
use petzval_optics::glass::{Glass, Status};

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
    let mut places: HashMap<String, Place> = HashMap::new();
    let mut entry: Option<Entry> = None;
    // Glasses that are left out, and whether the current records belong to such a glass.
    let (mut lost, mut in_lost) = (Vec::new(), false);
    for line in Line::all(text) {
        match (line.record(), &mut entry) {
            ("CC", _) => {}
            (comment, _) if comment.starts_with('!') => {}
            ("NM", _) => {
                if let Some(done) = entry.take() {
                    lost.extend(close(done, &mut file, &mut places).err());
                }
                let begun = Entry::begin(&line, maker, &mut file.warnings);
                in_lost = begun.is_err();
                entry = begun.map_err(|refused| lost.push(refused)).ok();
            }
            (record @ ("GC" | "ED" | "CD" | "TD" | "OD" | "LD" | "IT"), Some(open)) => {
                if let Err(error) = open.record(record, &line, &mut file.warnings) {
                    lost.push(open.refused(error));
                    (entry, in_lost) = (None, true);
                }
            }
            ("GC" | "ED" | "CD" | "TD" | "OD" | "LD" | "IT", None) if in_lost => {}
            ("CD", None) => {
                let error = line.error("these coefficients belong to no glass");
                lost.push(Refused::unnamed(error.hint("a glass begins with `NM`")));
            }
            ("GC" | "ED" | "TD" | "OD" | "LD" | "IT", None) => {
                file.warnings.push(line.error("this belongs to no glass: left out").into());
            }
            _ => file.warnings.push(line.error("no such record in AGF files: left out").into()),
        }
    }
    // Complete the last glass, then decide between an error and warnings.
    if let Some(done) = entry {
        lost.extend(close(done, &mut file, &mut places).err());
    }
    drop_replaced(&mut file, &lost, &places);
    if file.glasses.is_empty() && !lost.is_empty() {
        return Err(*lost.swap_remove(0).error);
    }
    if file.glasses.is_empty() {
        let hint = "an AGF file has a line `NM name formula ...` for each glass";
        return Err(error_at(1, "", "there is no glass in this file").hint(hint));
    }
    file.warnings.splice(0..0, lost.iter().map(GlassWarning::of_refused));
    file.refused = lost;
    Ok(file)
}

/// Where the glass of a name is.
struct Place {
    /// Among those of the file.
    index: usize,
    /// The line with which it begins.
    line: usize,
}

/// Drops glasses whose name a later glass has that is left out and would have replaced them.
fn drop_replaced(file: &mut GlassFile, lost: &[Refused], places: &HashMap<String, Place>) {
    let mut refused: HashMap<String, Vec<(usize, bool)>> = HashMap::new();
    for lost in lost {
        if let (Some(name), Some(line)) = (&lost.name, lost.error.line) {
            refused.entry(name.to_uppercase()).or_default().push((line as usize, lost.is_obsolete));
        }
    }
    file.glasses.retain(|glass| {
        let name = glass.name.to_uppercase();
        let (Some(refused), Some(place)) = (refused.get(&name), places.get(&name)) else { return true };
        !refused.iter().any(|(line, is_old)| *line > place.line && (!is_old || is_obsolete(glass)))
    });
}

fn is_obsolete(glass: &Glass) -> bool {
    glass.status == Some(Status::Obsolete)
}

/// Completes a glass and adds it to the file. A later glass of the same name replaces an earlier one, unless only the later
/// one is obsolete.
fn close(entry: Entry, file: &mut GlassFile, places: &mut HashMap<String, Place>) -> Result<(), Refused> {
    let (number, glass) = (entry.line, entry.finish(&mut file.warnings)?);
    let warning = |message: &str| error_at(number, &glass.name, message).into();
    if glass.name.to_uppercase() == "AIR" {
        file.warnings.push(warning("air is built in: left out"));
        return Ok(());
    }
    match places.get_mut(&glass.name.to_uppercase()) {
        Some(place) => {
            if is_obsolete(&glass) && !is_obsolete(&file.glasses[place.index]) {
                file.warnings.push(warning("an obsolete glass has the name of this one: left out"));
                return Ok(());
            }
            if file.glasses[place.index] != glass {
                let message = "the file has this glass twice, with different figures: the later is used";
                file.warnings.push(warning(message));
            }
            file.glasses[place.index] = glass;
            place.line = number;
        }
        None => {
            let place = Place { index: file.glasses.len(), line: number };
            places.insert(glass.name.to_uppercase(), place);
            file.glasses.push(glass);
        }
    }
    Ok(())
}
