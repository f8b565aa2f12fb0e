//! The content of a glass file in a foreign format.

use std::sync::Arc;

use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Glass};

/// The glasses of a file, and warnings about lines that were left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GlassFile {
    /// The glasses, in the order of the file.
    pub glasses: Vec<Glass>,
    /// Glasses that were left out.
    pub refused: Vec<Refused>,
    /// Lines that were left out or look wrong, those of [`GlassFile::refused`] first.
    pub warnings: Vec<GlassWarning>,
}

/// A glass that was left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// Its maker; empty if that is unknown.
    pub maker: String,
    /// Whether its file says that it is obsolete.
    pub is_obsolete: bool,
    /// The reason.
    pub error: Box<FileError>,
}

impl Refused {
    /// A glass without a name.
    pub(super) fn unnamed(error: FileError) -> Self {
        Self { name: None, maker: String::new(), is_obsolete: false, error: Box::new(error) }
    }
}

/// A warning about a line of a glass file.
#[derive(Clone, Debug, PartialEq)]
pub struct GlassWarning {
    /// The line, and what is wrong with it.
    pub error: FileError,
    /// What all warnings of its kind have in common.
    pub kind: String,
}

impl GlassWarning {
    /// The warning for a glass that is left out.
    pub(super) fn of_refused(refused: &Refused) -> Self {
        let mut error = FileError::clone(&refused.error);
        error.message += ": the glass is left out";
        Self { error, kind: "the glass is left out".to_owned() }
    }

    /// A warning about a record of known letters. Those of other records with the same message are of another kind.
    pub(super) fn of_record(record: &str, error: FileError) -> Self {
        Self { kind: format!("{record}: {}", error.message), error }
    }

    /// The first warning of each kind, in their order, with the number of further ones.
    pub fn by_kind<'a>(warnings: impl IntoIterator<Item = &'a Self>) -> Vec<(&'a Self, usize)> {
        let mut kinds: Vec<(&Self, usize)> = Vec::new();
        for warning in warnings {
            match kinds.iter_mut().find(|(first, _)| first.kind == warning.kind) {
                Some((_, more)) => *more += 1,
                None => kinds.push((warning, 0)),
            }
        }
        kinds
    }
}

/// Warnings with the same message are of one kind.
impl From<FileError> for GlassWarning {
    fn from(error: FileError) -> Self {
        Self { kind: error.message.clone(), error }
    }
}

impl GlassFile {
    /// The glasses by name.
    pub fn into_catalog(self) -> Catalog {
        let mut catalog = Catalog::default();
        for Refused { name, maker, error, .. } in self.refused {
            if let Some(name) = name {
                let FileError { message, .. } = *error;
                catalog.refuse(&name, &maker, message);
            }
        }
        for glass in self.glasses {
            let name = glass.name.clone();
            catalog.insert(&name, Arc::new(glass));
        }
        catalog
    }
}

/// A number times a power of ten with the same decimal digits: 8.2 in units of 1e-6/K is 8.2e-6 to the last bit.
pub(super) fn shifted(value: f64, exponent: i32) -> f64 {
    let digits = format!("{value:e}");
    let (mantissa, own) = digits.split_once('e').unwrap_or((&digits, "0"));
    let own: i32 = own.parse().unwrap_or(0);
    format!("{mantissa}e{}", own + exponent).parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_keeps_the_digits() {
        assert_eq!([shifted(8.2, -6), shifted(7.1, -6), shifted(2510.0, -3)], [8.2e-6, 7.1e-6, 2.51]);
        assert_eq!([shifted(0.0, -6), shifted(-3.5e-6, 6)], [0.0, -3.5]);
        assert!(shifted(f64::NAN, 3).is_nan() && shifted(f64::INFINITY, 3).is_infinite());
    }
}
