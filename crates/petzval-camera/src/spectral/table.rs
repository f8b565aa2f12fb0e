//! Tables of spectra: the first column holds wavelengths in nm or um, each other column a named curve.

use petzval_base::FileError;

use crate::spectrum::{Spectrum, SpectrumError};

/// Named curves.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectrumTable {
    /// Name and curve of each column.
    pub curves: Vec<(String, Spectrum)>,
}

impl SpectrumTable {
    /// Reads comma-separated values: a head line of names, then one line per wavelength. The first column holds wavelengths in nm, or in um
    /// if its name ends so, as `wavelength_um` does. An empty cell means that the curve has no sample there. Lines that begin with `#` are
    /// comments.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let numbered = text.lines().enumerate().map(|(i, line)| (i as u32 + 1, line.trim()));
        let mut lines = numbered.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let hint = "give a head line `wavelength_nm,NAME,...`, or `wavelength_um`, and then lines of numbers, wavelengths ascending";
        let (head_line, head) =
            lines.next().ok_or_else(|| FileError::at_line(0, "", "the table is empty").hint(hint))?;
        let names: Vec<&str> = head.split(',').map(str::trim).collect();
        if names.len() < 2 || names[0].parse::<f64>().is_ok() {
            return Err(FileError::at_line(head_line, head, "this is not a head line of a table").hint(hint));
        }
        let per_um = if is_in_um(names[0]) { 1.0 } else { 1000.0 };
        // Read one wavelength per line, and remember the line of every sample for errors.
        let mut samples: Vec<(Vec<f64>, Vec<f64>)> = vec![Default::default(); names.len() - 1];
        let mut places: Vec<Vec<(u32, &str)>> = vec![Vec::new(); names.len() - 1];
        for (number, line) in lines {
            let wrong = |message: String| FileError::at_line(number, line, message).hint(hint);
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            if cells.len() != names.len() {
                return Err(wrong(format!("{} cells where the head line has {}", cells.len(), names.len())));
            }
            let read = |cell: &str| -> Result<f64, FileError> {
                let number = cell.parse::<f64>().ok().filter(|v| v.is_finite());
                number.ok_or_else(|| wrong(format!("`{cell}` is not a finite number")))
            };
            let um = read(cells[0])? / per_um;
            for ((cell, (at, value)), places) in cells[1..].iter().zip(&mut samples).zip(&mut places) {
                if !cell.is_empty() {
                    places.push((number, line));
                    at.push(um);
                    value.push(read(cell)?);
                }
            }
        }
        // Make a curve of every column.
        let curves = names[1..].iter().zip(samples).zip(places).map(|((name, (at, value)), places)| {
            let curve = Spectrum::new(at, value).map_err(|e| {
                let (number, line) = match &e {
                    SpectrumError::Wavelength { index, .. } => places[*index],
                    _ => (head_line, head),
                };
                FileError::at_line(number, line, format!("column `{name}`: {e}")).hint(hint)
            })?;
            Ok(((*name).to_owned(), curve))
        });
        let curves = curves.collect::<Result<_, FileError>>()?;
        Ok(Self { curves })
    }

    /// A table that is built into the program; tests parse every one.
    pub(super) fn built_in(text: &str) -> Self {
        match Self::parse(text) {
            Ok(table) => table,
            Err(error) => unreachable!("a built-in table of spectra is malformed: {error}"),
        }
    }

    /// The curve with this name, in any letter case.
    pub fn get(&self, name: &str) -> Option<&Spectrum> {
        self.curves.iter().find(|(n, _)| n.eq_ignore_ascii_case(name)).map(|(_, curve)| curve)
    }

    /// The `N` curves of a table that is built into the program.
    pub(super) fn built_in_curves<const N: usize>(text: &str) -> [Spectrum; N] {
        let curves: Vec<Spectrum> = Self::built_in(text).curves.into_iter().map(|(_, curve)| curve).collect();
        let count = curves.len();
        curves
            .try_into()
            .unwrap_or_else(|_| unreachable!("a built-in table has {count} spectra in place of {N}"))
    }
}

/// Whether the name of a column ends in the word `um`, in brackets or not.
fn is_in_um(name: &str) -> bool {
    let mut words = name.rsplit(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.next().is_some_and(|word| matches!(word.to_lowercase().as_str(), "um" | "\u{b5}m" | "\u{3bc}m"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_reads_with_empty_cells_and_comments() {
        let table = SpectrumTable::parse("# lamps\nnm, a ,b\n400,1,\n500,2,3\n600,4,5\n").unwrap();
        assert_eq!(table.get("A").unwrap().at(0.45), 1.5);
        assert_eq!(table.get("b").unwrap().range_um(), (0.5, 0.6));
        assert!(table.get("c").is_none());
    }

    #[test]
    fn the_head_line_states_the_unit_of_wavelengths() {
        let in_nm = SpectrumTable::parse("nm,a\n400,1\n500,2\n").unwrap();
        for head in ["um", "wavelength_um", "Wavelength (um)", "wavelength [\u{b5}m]", "\u{3bc}m"] {
            assert_eq!(SpectrumTable::parse(&format!("{head},a\n0.4,1\n0.5,2\n")).unwrap(), in_nm, "{head}");
        }
        for head in ["spectrum", "wavelength", "wavelength_nm"] {
            assert_eq!(SpectrumTable::parse(&format!("{head},a\n400,1\n500,2\n")).unwrap(), in_nm, "{head}");
            let error = SpectrumTable::parse(&format!("{head},a\n0.4,1\n0.5,2\n")).unwrap_err();
            assert!(error.hint.as_deref().unwrap().contains("or `wavelength_um`"), "{error}");
        }
    }

    #[test]
    fn errors_name_the_line() {
        for (text, line, needle) in [
            ("", None, "empty"),
            ("400,1\n500,2", Some(1), "head line"),
            ("nm,a\n400,1\n500,x", Some(3), "`x`"),
            ("nm,a\n400,1\n500", Some(3), "1 cells"),
            ("nm,a\n500,1\n400,2", Some(3), "ascend"),
            ("nm,a\n400,1\n500,inf", Some(3), "inf"),
        ] {
            let error = SpectrumTable::parse(text).unwrap_err();
            assert_eq!(error.line, line, "{error}");
            assert!(error.to_string().contains(needle), "{error}");
        }
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(text in "[nma0-9.,\\-e#\n ]{0,200}") {
            let _ = SpectrumTable::parse(&text);
        }
    }
}
