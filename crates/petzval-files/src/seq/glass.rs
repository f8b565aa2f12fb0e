//! Glasses of a CODE V file: private catalogues, names without hyphens and with their maker, codes, fictitious glasses.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::command::{Command, Word};
use crate::decimal::{shifted, shown};
use crate::draft::{MOST_VALUES, Record};
use crate::old_glass::unknown_glass;
use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Dispersion, Glass, ThroughIndices};

/// Largest number of private glasses in a file.
const MOST_GLASSES: usize = 1000;

/// The program's maker name for materials without a maker.
pub(super) const NO_MAKER: &str = "SPECIAL";

/// A private catalogue, `PRV` to `END`.
#[derive(Debug, Default)]
pub(super) struct PrivateGlasses {
    /// Wavelengths of the indices that follow, um.
    wavelengths_um: Vec<f64>,
    /// Glasses by upper-case name. An unknown formula is an error only if its glass is used.
    glasses: BTreeMap<String, Result<Private, FileError>>,
}

/// A private glass.
#[derive(Clone, Debug)]
struct Private {
    glass: Arc<Glass>,
    /// How the index between the stated ones is read.
    remark: Option<String>,
}

impl PrivateGlasses {
    /// Reads one line of the catalogue.
    pub fn read(&mut self, command: &Command) -> Result<(), FileError> {
        if command.full == "PWL" && !command.quoted {
            let nm = command.words.iter().take(MOST_VALUES).map(|word| shifted(&word.text, -3));
            let um: Option<Vec<f64>> = nm.collect();
            self.wavelengths_um = um
                .filter(|list| list.iter().all(|um| *um > 0.0))
                .ok_or_else(|| command.error("the wavelengths must be positive numbers, in nm"))?;
            return Ok(());
        }
        if self.glasses.len() >= MOST_GLASSES {
            return Err(command.error(format!("more than {MOST_GLASSES} private glasses are not read")));
        }
        self.glasses.insert(command.full.clone(), self.glass(command));
        Ok(())
    }

    /// A private glass: Laurent's series (Schott's formula), or an index at each wavelength of the catalogue.
    fn glass(&self, command: &Command) -> Result<Private, FileError> {
        let kind = command.word(0).unwrap_or("").to_uppercase();
        if kind == "LAU" {
            let mut a = [0.0; 6];
            for (i, a) in a.iter_mut().enumerate() {
                if i + 1 < command.words.len() {
                    *a = command.number(i + 1)?;
                }
            }
            return match command.words.len() {
                2..=7 => {
                    let glass = Arc::new(Glass::new(&command.full, Dispersion::Schott(a)));
                    Ok(Private { glass, remark: None })
                }
                _ => Err(command.error("Laurent's series has one to six coefficients")),
            };
        }
        if kind.parse::<f64>().is_err() {
            return Err(command
                .error(format!("private glasses by the formula {kind} are not read"))
                .hint("LAU and indices at the wavelengths of PWL are; or name a catalogue glass"));
        }
        let index = command.numbers(MOST_VALUES)?;
        if index.len() != self.wavelengths_um.len() {
            let message = format!("{} indices for {} wavelengths", index.len(), self.wavelengths_um.len());
            return Err(command.error(message).hint("PWL lists the wavelengths before the glasses"));
        }
        if index.iter().any(|n| *n < 1.0) {
            return Err(command.error("an index is a number from 1"));
        }
        let mut pairs: Vec<(f64, f64)> = self.wavelengths_um.iter().copied().zip(index).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        if pairs.windows(2).any(|w| w[0].0 >= w[1].0) {
            return Err(command.error("PWL names a wavelength twice"));
        }
        let (wavelength_um, index) = pairs.into_iter().unzip();
        Ok(by_indices(&command.full, wavelength_um, index))
    }

    /// The glass that a word names.
    pub fn medium(&self, word: &Word, catalog: &Catalog, record: &Record) -> Result<Arc<Glass>, FileError> {
        let upper = word.text.to_uppercase();
        if let Some(private) = self.glasses.get(&upper) {
            return private.clone().map(|private| private.glass);
        }
        if upper == "AIR" {
            return Ok(Glass::air());
        }
        if let Some((nd, vd)) = fictitious(&word.text) {
            return if nd > 1.0 && nd < 10.0 && vd > 0.0 && vd.is_finite() {
                Ok(Arc::new(Glass::new(&word.text, Dispersion::NdVd { nd, vd })))
            } else {
                Err(record.error(format!(
                    "nd = {} and Vd = {} are not those of a glass",
                    shown(nd),
                    shown(vd)
                )))
            };
        }
        if word.text.starts_with(|c: char| c.is_ascii_digit()) && word.text.parse::<f64>().is_ok() {
            let message = format!("`{}` is neither a glass code nor a name", word.text);
            return Err(record.error(message).hint("codes are 517642, 516800.6417 or 1.5168:64.17"));
        }
        by_name(&word.text, catalog, record)
    }

    /// The note to print with the glass that a word names.
    pub fn remark(&self, word: &Word) -> Option<String> {
        self.glasses.get(&word.text.to_uppercase())?.as_ref().ok()?.remark.clone()
    }
}

/// A glass by its indices at wavelengths in um, ascending. Three or more of them give a formula, see [`ThroughIndices`].
/// CODE V has a formula of its own.
fn by_indices(name: &str, wavelength_um: Vec<f64>, index: Vec<f64>) -> Private {
    let count = index.len();
    let range_um = match wavelength_um[..] {
        [first, .., last] => Some([first, last]),
        _ => None,
    };
    let (dispersion, remark) = if index.windows(2).all(|n| n[0] == n[1]) {
        let n = index.first().copied().unwrap_or(1.0);
        (
            Dispersion::Constant(n),
            format!("the private glass {name} has the index {} at every wavelength", shown(n)),
        )
    } else if let Some(fit) = ThroughIndices::new(&wavelength_um, &index) {
        let ThroughIndices { dispersion, terms, residual } = fit;
        let misses = if terms < count {
            format!(", which is off by up to {residual:.1e} at its {count} wavelengths")
        } else {
            format!(" through its {count} indices")
        };
        let formula = format!("a formula of Schott's with {terms} terms{misses}");
        (
            dispersion,
            format!("the private glass {name} is read as {formula}; CODE V has a formula of its own"),
        )
    } else {
        let why = if count < 3 { "three determine a formula" } else { "their indices do not fall smoothly" };
        let remark = format!(
            "the index of the private glass {name} is linear between its {count} wavelengths and constant beyond them: {why}"
        );
        (Dispersion::Table { wavelength_um, index }, remark)
    };
    let glass = Arc::new(Glass { range_um, ..Glass::new(name, dispersion) });
    Private { glass, remark: Some(remark) }
}

/// Index and Abbe number of a fictitious glass: `1.5168:64.17`; the code `517642`, which means 1.517 and 64.2; or
/// `516800.6417`, which means 1.5168 and 64.17.
pub(super) fn fictitious(text: &str) -> Option<(f64, f64)> {
    if let Some((nd, vd)) = text.split_once(':') {
        return Some((nd.parse().ok()?, vd.parse().ok()?));
    }
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    if text.len() == 6 && digits(text) {
        return Some((format!("1.{}", &text[..3]).parse().ok()?, shifted(&text[3..], -1)?));
    }
    let (index, abbe) = text.split_once('.')?;
    let is_code = index.len() >= 3 && digits(index) && digits(abbe);
    if !is_code {
        None
    } else {
        Some((format!("1.{index}").parse().ok()?, shifted(&format!("0.{abbe}"), 2)?))
    }
}

/// The letters and digits of a name in upper case: the program's spelling of glass names.
pub(super) fn bare(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_uppercase()).collect()
}

/// The program's name of a maker.
pub(super) fn maker_suffix(maker: &str) -> String {
    let maker = bare(maker);
    if maker == "GENERIC" { NO_MAKER.to_owned() } else { maker }
}

/// A catalogue glass by its exact name, or by its name without punctuation, followed by `_` and its maker.
fn by_name(name: &str, catalog: &Catalog, record: &Record) -> Result<Arc<Glass>, FileError> {
    if let Ok(glass) = catalog.get(name) {
        return Ok(glass);
    }
    let (wanted, suffix) = match name.rsplit_once('_') {
        Some((glass, maker)) => (bare(glass), Some(bare(maker))),
        None => (bare(name), None),
    };
    let is_wanted = |known: &str| bare(known) == wanted;
    let mut found: Vec<&Arc<Glass>> = match &suffix {
        None => catalog.iter().filter(|(known, _)| is_wanted(known)).map(|(_, glass)| glass).collect(),
        Some(suffix) => (catalog.iter_all().filter(|(known, _)| is_wanted(known)))
            .flat_map(|(_, all)| all)
            .filter(|glass| !glass.maker.is_empty() && maker_suffix(&glass.maker) == *suffix)
            .collect(),
    };
    found.dedup();
    match found[..] {
        [glass] => Ok(glass.clone()),
        [] => {
            let (bare_name, maker) = name.rsplit_once('_').unwrap_or((name, ""));
            let message = match maker {
                "" => format!("no glass is called `{name}`"),
                maker => format!("no glass of {maker} is called `{bare_name}`"),
            };
            // If another maker has the name, look for names near the whole text.
            let nearest = catalog.get(bare_name).err().or_else(|| catalog.get(&name.replace('_', "-")).err());
            Err(match nearest {
                Some(unknown) if unknown.refused.is_some() => unknown_glass(record, &unknown),
                Some(unknown) => FileError { message, ..unknown_glass(record, &unknown) },
                None => record.error(message),
            })
        }
        _ => {
            let message = format!("several glasses are called `{name}` without punctuation");
            Err(record.error(message).hint("add the maker, as in NBK7_SCHOTT"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_fictitious_glasses() {
        assert_eq!(fictitious("1.5168:64.17"), Some((1.5168, 64.17)));
        assert_eq!(fictitious("517642"), Some((1.517, 64.2)));
        assert_eq!(fictitious("516800.6417"), Some((1.5168, 64.17)));
        assert_eq!(fictitious("517.642"), Some((1.517, 64.2)));
        for none in ["NBK7", "1.5", "12", "5176420", "1.5:x", "e"] {
            assert_eq!(fictitious(none), None, "{none}");
        }
    }

    #[test]
    fn indices_become_a_formula_where_they_determine_one() {
        let private = |um: &[f64], index: &[f64]| by_indices("MELT", um.to_vec(), index.to_vec());
        let lines = [0.4861327, 0.5875618, 0.6562725];
        let three = private(&lines, &[1.522376, 1.516800, 1.514322]);
        for (um, n) in lines.iter().zip([1.522376, 1.516800, 1.514322]) {
            assert!((three.glass.index(*um) - n).abs() < 1e-12, "{um}");
        }
        // Sellmeier's formula of N-BK7 gives the index at e, and that at g beyond the last line.
        assert!((three.glass.index(0.546074) - 1.518721).abs() < 3e-5);
        assert!((three.glass.index(0.4358343) - 1.526685).abs() < 3e-4);
        assert!(three.glass.is_outside_range(0.4358343) && !three.glass.is_outside_range(0.546074));
        assert!(three.remark.unwrap().contains("MELT is read as a formula of Schott's with 3 terms"));
        let said = |um: &[f64], index: &[f64]| private(um, index).remark.unwrap();
        assert!(said(&lines[..2], &[1.52, 1.51]).contains("three determine a formula"));
        assert!(said(&lines, &[1.52, 1.53, 1.51]).contains("do not fall smoothly"));
        assert!(said(&lines[..1], &[1.52]).contains("has the index 1.52 at every wavelength"));
        let many: Vec<f64> = (0..9).map(|i| 0.45 + 0.03 * f64::from(i)).collect();
        let off: Vec<f64> = many.iter().map(|um| 1.5 + 0.005 / (um * um - 0.01)).collect();
        assert!(said(&many, &off).contains("with 6 terms, which is off by up to"));
    }

    #[test]
    fn names_are_matched_without_punctuation_but_never_guessed() {
        let text =
            "[glass.N-BK7]\nnd=1.5168\nvd=64.17\nmaker=\"Schott\"\n[glass.SK16]\nn=1.6\nmaker=\"Hikari\"\n";
        let catalog = crate::parse_catalog(text).unwrap();
        let record = Record::new(7, "S 1 2 x");
        let get = |name: &str| by_name(name, &catalog, &record).map(|g| g.name.clone());
        for name in ["NBK7_SCHOTT", "nbk7_schott", "N-BK7", "nbk7", "N-BK7_SCHOTT"] {
            assert_eq!(get(name).unwrap(), "N-BK7", "{name}");
        }
        for name in ["BK7_SCHOTT", "SK16_SCHOTT", "NBK7_OHARA", "NBK", "_", "", "NBK7_"] {
            let error = get(name).unwrap_err().to_string();
            assert!(error.starts_with("line 7: ") && error.contains("nearest names are"), "{error}");
        }
    }
}
