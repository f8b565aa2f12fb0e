//! Lines of a file, and the records that do not affect rays.

use crate::ForeignRecords;
use crate::draft::{Record, line_end};
use crate::loss::{Effect, Losses};
use petzval_base::FileError;

/// A line: a keyword and its values.
#[derive(Clone, Debug, Default)]
pub(super) struct Line<'a> {
    /// Line number, from 1.
    pub number: u32,
    /// Whether it is indented, as records of a surface are.
    pub indented: bool,
    /// The text without surrounding spaces.
    pub text: &'a str,
    /// Its first word.
    pub keyword: &'a str,
}

impl<'a> Line<'a> {
    /// The lines that are not empty.
    pub fn all(text: &'a str) -> impl Iterator<Item = Self> {
        text.split(line_end(text)).zip(1..).filter_map(|(whole, number)| {
            let text = whole.trim();
            let keyword = text.split_whitespace().next()?;
            Some(Self { number, indented: whole.starts_with([' ', '\t']), text, keyword })
        })
    }

    /// The text after the keyword.
    pub fn rest(&self) -> &'a str {
        self.text[self.keyword.len()..].trim()
    }

    /// The text of value `index`, from 0.
    pub fn word(&self, index: usize) -> Option<&'a str> {
        self.text.split_whitespace().nth(index + 1)
    }

    /// Value `index` as a finite number; `None` if the line ends before it.
    pub fn number(&self, index: usize) -> Result<Option<f64>, FileError> {
        self.word(index).map(|word| self.parse(word)).transpose()
    }

    /// Value `index` as a finite number. Fails if it is missing.
    pub fn needed(&self, index: usize) -> Result<f64, FileError> {
        match self.number(index)? {
            Some(value) => Ok(value),
            None => Err(self.error(format!("value {} is missing", index + 1))),
        }
    }

    /// Value `index` as a count from 0 to 1e6. Fails if it is missing.
    pub fn count(&self, index: usize) -> Result<usize, FileError> {
        let value = self.needed(index)?;
        if (0.0..=1e6).contains(&value) && value.fract() == 0.0 {
            Ok(value as usize)
        } else {
            Err(self.error(format!("value {} must be a whole number from 0", index + 1)))
        }
    }

    /// The first `most` values as finite numbers. Further values are ignored.
    pub fn numbers(&self, most: usize) -> Result<Vec<f64>, FileError> {
        self.text.split_whitespace().skip(1).take(most).map(|word| self.parse(word)).collect()
    }

    /// Whether values other than 0 follow the first `skip` ones.
    pub fn has_values(&self, skip: usize) -> bool {
        let values = self.text.split_whitespace().skip(1 + skip);
        values.filter_map(|word| word.parse::<f64>().ok()).any(|v| v != 0.0)
    }

    fn parse(&self, word: &str) -> Result<f64, FileError> {
        match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.error(format!("`{word}` is not a finite number"))),
        }
    }

    pub fn record(&self) -> Record {
        Record::new(self.number, self.text)
    }

    pub fn error(&self, message: impl Into<String>) -> FileError {
        FileError::at_line(self.number, self.text, message)
    }

    /// Adds a loss of the line.
    pub fn lose(&self, losses: &mut Losses, effect: Effect, message: impl Into<String>) {
        losses.add(self.number, self.text, effect, message);
    }
}

/// Records of the header about the program's display and computation, without effect on the lens.
pub(super) const HEADER_BOOKKEEPING: &[&str] = &[
    "VERS", "AUTH", "IWDP", "STUD", "PFIL", "LANG", "GFAC", "RAIM", "PUSH", "SDMA", "OMMA", "ROPD", "HYPR",
    "PICB", "FCOM", "POLS", "GLRS", "GSTD", "NSCD", "COFN", "LUID", "EERA",
];

/// Records of a surface about its drawing, mount, numbering or sampling, without effect on rays.
///
/// `MEMA` is the semi-diameter of the mount, `VDSZ` and `VPAR` mark variables.
pub(super) const SURFACE_BOOKKEEPING: &[&str] =
    &["FIMP", "HIDE", "MIRR", "SLAB", "SSID", "POPS", "MEMA", "SCOL", "VDSZ", "VPAR"];

/// Records of a surface that do not affect rays, with the message of their loss.
pub(super) const SURFACE_LOST: &[(&str, &str)] = &[
    ("COAT", "coatings are not read"),
    ("SCAT", "scattering is not read"),
    ("RSCE", "scattering is not read"),
    ("TCEX", "thermal expansion is not read"),
];

/// Solves. The file also contains their values.
pub(super) const SOLVES: &[&str] = &[
    "MAZH", "CHZH", "PZUP", "EDGE", "OPDZ", "POSZ", "COMP", "CCUR", "CNUP", "PICK", "COPK", "TOLE", "GPIK",
    "PPUP", "PRPK", "XPUP", "MAZA",
];

/// The records that are not read into the lens.
pub fn records() -> ForeignRecords {
    ForeignRecords {
        ignored: [HEADER_BOOKKEEPING, SURFACE_BOOKKEEPING].concat(),
        lost: SURFACE_LOST.to_vec(),
        solves: SOLVES.to_vec(),
        refused: Vec::new(),
    }
}
