//! A dispersion formula through measured indices.

use nalgebra::{DMatrix, DVector};

use super::Dispersion;

/// A term of Schott's formula: its power of the wavelength and its place among the coefficients.
type Term = (i32, usize);

/// The terms in the order in which further points determine them.
const TERMS: &[Term] = &[(0, 0), (-2, 2), (-4, 3), (2, 1), (-6, 4), (-8, 5)];

/// The three terms where absorption at long wavelengths bends the dispersion more than that at short ones.
const LONG_WAVES: &[Term] = &[(0, 0), (-2, 2), (2, 1)];

/// The least number of indices that determine a formula.
const FEWEST: usize = 3;

/// The largest difference between a measured index and that of a formula that stands for it.
const MOST_RESIDUAL: f64 = 1e-4;

/// Schott's formula through measured indices.
#[derive(Clone, Debug, PartialEq)]
pub struct ThroughIndices {
    /// The formula.
    pub dispersion: Dispersion,
    /// The number of its terms, 3 to 6. If there are as many indices, it gives each of them.
    pub terms: usize,
    /// The largest difference between a measured index and that of the formula, at most 1e-4.
    pub residual: f64,
}

impl ThroughIndices {
    /// The formula `n^2 = a_0 + a_2 w^-2 + a_3 w^-4 + a_1 w^2 + a_4 w^-6 + a_5 w^-8` through indices n at wavelengths w, um, ascending. It has as
    /// many of these terms, in this order, as there are indices; of more than six indices it is the least-squares fit in n^2. Terms are left out
    /// from the last until the index is at least 1 and falls with the wavelength over the whole range, as that of a transparent medium does.
    ///
    /// Resonances at short wavelengths make `a_3` positive, those at long ones `a_1` negative. Of three terms the last is therefore `a_1 w^2` where
    /// `a_3` would be negative, as that of most materials in the infrared.
    ///
    /// Through N-BK7 at the lines C, d and F it is right to 1e-5 between them, and to 8e-5 at the g line beyond.
    ///
    /// `None` for fewer than three indices, lists of different lengths, wavelengths that do not ascend from above 0, and where no number of terms
    /// gives such an index within 1e-4 of the measured ones.
    pub fn new(wavelength_um: &[f64], index: &[f64]) -> Option<Self> {
        let ascends =
            wavelength_um.windows(2).all(|w| w[0] < w[1]) && wavelength_um.first().is_some_and(|w| *w > 0.0);
        if index.len() < FEWEST || index.len() != wavelength_um.len() || !ascends {
            return None;
        }
        let most = index.len().min(TERMS.len());
        let mut lists = (FEWEST..=most).rev().map(|terms| &TERMS[..terms]).chain([LONG_WAVES]);
        lists.find_map(|terms| Self::with_terms(wavelength_um, index, terms))
    }

    fn with_terms(wavelength_um: &[f64], index: &[f64], terms: &[Term]) -> Option<Self> {
        let ends_um = [*wavelength_um.first()?, *wavelength_um.last()?];
        // Wavelengths in units of the middle one keep the powers of similar size.
        let middle_um = (ends_um[0] * ends_um[1]).sqrt();
        let matrix = DMatrix::from_fn(index.len(), terms.len(), |row, term| {
            (wavelength_um[row] / middle_um).powi(terms[term].0)
        });
        let qr = matrix.qr();
        let mut turned = DVector::from_iterator(index.len(), index.iter().map(|n| n * n));
        qr.q_tr_mul(&mut turned);
        let found = qr.r().solve_upper_triangular(&turned.rows(0, terms.len()).into_owned())?;
        let mut a = [0.0; 6];
        for ((power, place), value) in terms.iter().zip(found.iter()) {
            a[*place] = value / middle_um.powi(*power);
        }
        let bends_as_resonances_do = terms.len() > FEWEST || a[3] >= 0.0;
        let dispersion = Dispersion::Schott(a);
        let misses = wavelength_um.iter().zip(index).map(|(um, n)| (dispersion.index(*um) - n).abs());
        let residual = misses.fold(0.0, f64::max);
        let is_right = residual <= MOST_RESIDUAL && bends_as_resonances_do && falls(&dispersion, ends_um);
        is_right.then_some(Self { dispersion, terms: terms.len(), residual })
    }
}

/// Whether the index falls with the wavelength between two of them, and stays at least 1.
fn falls(dispersion: &Dispersion, [from_um, to_um]: [f64; 2]) -> bool {
    const STEPS: usize = 256;
    let at = |i: usize| dispersion.index(from_um + (to_um - from_um) * i as f64 / STEPS as f64);
    (0..STEPS).all(|i| at(i) > at(i + 1)) && at(STEPS) >= 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// N-BK7 by Sellmeier's formula.
    fn bk7(um: f64) -> f64 {
        let (b, c_um2) =
            (vec![1.03961212, 0.231792344, 1.01046945], vec![0.00600069867, 0.0200179144, 103.560653]);
        Dispersion::Sellmeier { b, c_um2 }.index(um)
    }

    fn through(um: &[f64]) -> ThroughIndices {
        ThroughIndices::new(um, &um.iter().map(|um| bk7(*um)).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn as_many_terms_as_points_give_each_point() {
        let lines = [0.4046561, 0.4358343, 0.4861327, 0.546074, 0.5875618, 0.6562725];
        for first in 0..=3 {
            let fit = through(&lines[first..]);
            assert_eq!(fit.terms, 6 - first);
            assert!(fit.residual < 1e-12, "{fit:?}");
        }
        let more = through(&[0.4046561, 0.4358343, 0.4861327, 0.52, 0.546074, 0.5875618, 0.62, 0.6562725]);
        assert!(more.terms == 6 && more.residual < 1e-6 && more.residual > 0.0, "{more:?}");
    }

    #[test]
    fn three_lines_give_the_index_between_them() {
        let fit = through(&[0.4861327, 0.5875618, 0.6562725]);
        for um in [0.5, 0.546074, 0.6328] {
            assert!((fit.dispersion.index(um) - bk7(um)).abs() < 1e-5, "{um}");
        }
        assert!((fit.dispersion.index(0.4358343) - bk7(0.4358343)).abs() < 1e-4);
    }

    /// Absorption at 20 um or more bends the dispersion of zinc selenide (Tatian 1984), and that of N-BK7 beyond the visible.
    #[test]
    fn three_indices_of_the_infrared_give_the_index_between_them() {
        let (b, resonances_um) =
            (vec![4.45813734, 0.467216334, 2.8956629], [0.200859853, 0.391371166, 47.1362108_f64]);
        let zinc_selenide = Dispersion::Sellmeier { b, c_um2: resonances_um.map(|um| um * um).to_vec() };
        for at in [[3.0, 4.0, 5.0], [8.0, 10.0, 12.0]] {
            assert_between(at, |um| zinc_selenide.index(um));
        }
        assert_between([1.0, 1.3, 1.6], bk7);
    }

    /// The formula through three indices is right in the middle between them.
    fn assert_between(at: [f64; 3], index: impl Fn(f64) -> f64) {
        let fit = ThroughIndices::new(&at, &at.map(&index)).unwrap();
        for um in [0.5 * (at[0] + at[1]), 0.5 * (at[1] + at[2])] {
            assert!((fit.dispersion.index(um) - index(um)).abs() < 5e-5, "{um}: {fit:?}");
        }
    }

    #[test]
    fn indices_of_no_medium_have_no_formula() {
        assert_eq!(ThroughIndices::new(&[0.4, 0.5, 0.6], &[1.5, 1.51, 1.52]), None);
        assert_eq!(ThroughIndices::new(&[0.4, 0.5], &[1.52, 1.51]), None);
        assert_eq!(ThroughIndices::new(&[0.4, 0.4, 0.6], &[1.52, 1.51, 1.5]), None);
        assert_eq!(ThroughIndices::new(&[], &[]), None);
    }
}
