//! Internal transmission of a glass, without the reflections at its faces.

use std::f64::consts::PI;

use petzval_base::table::Interval;

/// Absorption data as published.
#[derive(Clone, Debug, PartialEq)]
pub enum Absorption {
    /// Rows `[wavelength um, internal transmittance 0..=1, thickness mm]`, wavelengths ascending.
    Transmittance(Vec<[f64; 3]>),
    /// Rows `[wavelength um, extinction coefficient k]`, wavelengths ascending: `a = 4 pi k / w`.
    Extinction(Vec<[f64; 2]>),
}

impl Absorption {
    /// Absorption coefficient a at a wavelength in um, per mm: linear between the rows, `None` beyond them.
    ///
    /// A printed transmittance of 0 means infinite absorption up to the next row.
    pub fn per_mm(&self, wavelength_um: f64) -> Option<f64> {
        match self {
            Self::Transmittance(rows) => interpolate(rows, wavelength_um, |[_, t, mm]| -t.ln() / mm),
            Self::Extinction(rows) => {
                interpolate(rows, wavelength_um, |[um, k]| 4.0 * PI * k / (um * UM_TO_MM))
            }
        }
    }

    /// Internal transmittance of a path in mm, `exp(-a path)` (Beer and Lambert); `None` beyond the published
    /// wavelengths.
    pub fn transmittance(&self, wavelength_um: f64, path_mm: f64) -> Option<f64> {
        let per_mm = self.per_mm(wavelength_um)?;
        Some(if path_mm == 0.0 { 1.0 } else { (-per_mm * path_mm).exp() })
    }

    /// First and last wavelength, um; `None` for a table without rows.
    pub fn range_um(&self) -> Option<[f64; 2]> {
        match self {
            Self::Transmittance(rows) => Some([rows.first()?[0], rows.last()?[0]]),
            Self::Extinction(rows) => Some([rows.first()?[0], rows.last()?[0]]),
        }
    }
}

const UM_TO_MM: f64 = 1e-3;

/// The value at a wavelength, linear between rows that begin with their wavelength.
fn interpolate<const N: usize>(rows: &[[f64; N]], um: f64, value: impl Fn(&[f64; N]) -> f64) -> Option<f64> {
    let range = rows.first()?[0]..=rows.last()?[0];
    let value = |i: usize| value(&rows[i]);
    let found = || Interval::around(um, rows.len(), |i| rows[i][0]).map_or(value(0), |i| i.mean(value));
    range.contains(&um).then(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transmittance_follows_the_published_rows_and_the_path() {
        // N-BK7 as printed, 25 mm; the 10 mm of the same catalogue is 0.997.
        let table = Absorption::Transmittance(vec![
            [0.29, 0.0, 25.0],
            [0.31, 0.25, 25.0],
            [0.4, 0.992, 25.0],
            [0.5, 0.994, 25.0],
        ]);
        assert_eq!(table.transmittance(0.4, 25.0).map(|t| (t * 1e12).round()), Some(0.992e12));
        assert!((table.transmittance(0.4, 10.0).unwrap() - 0.9968).abs() < 1e-4);
        assert!((table.transmittance(0.31, 50.0).unwrap() - 0.0625).abs() < 1e-12);
        let between = table.transmittance(0.45, 25.0).unwrap();
        assert!((between - (0.992_f64 * 0.994).sqrt()).abs() < 1e-12);
        assert_eq!(table.transmittance(0.3, 1.0), Some(0.0), "opaque up to the next row");
        assert_eq!((table.transmittance(0.29, 0.0), table.transmittance(0.3, 0.0)), (Some(1.0), Some(1.0)));
        assert_eq!((table.transmittance(0.28, 1.0), table.transmittance(0.51, 1.0)), (None, None));
        assert_eq!(Absorption::Extinction(Vec::new()).per_mm(0.5), None);
    }

    #[test]
    fn extinction_and_transmittance_are_the_same_absorption() {
        // The k that refractiveindex.info gives for the row of N-BK7 above.
        let k = Absorption::Extinction(vec![[0.4, 1.0227e-8]]);
        assert!((k.transmittance(0.4, 25.0).unwrap() - 0.992).abs() < 1e-6);
    }
}
