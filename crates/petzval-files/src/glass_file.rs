//! The content of a glass file in a foreign format.

use std::sync::Arc;

use petzval_base::FileError;
use petzval_optics::glass::{Catalog, Glass};

/// The glasses of a file, and warnings about lines that were left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GlassFile {
    /// The glasses, in the order of the file.
    pub glasses: Vec<Glass>,
    /// Lines that were left out or look wrong.
    pub warnings: Vec<FileError>,
}

impl GlassFile {
    /// The glasses by name.
    pub fn into_catalog(self) -> Catalog {
        let mut catalog = Catalog::default();
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
