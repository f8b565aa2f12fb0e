//! Dispersion formulas, as published by glass makers and refractiveindex.info.
//!
//! Every coefficient stays as printed. Formulas of the same form differ only in their powers, which are data. The
//! variants of the published formulas:
//!
//! | variant | formulas of AGF files | of refractiveindex.info |
//! |---|---|---|
//! | [`Sellmeier`](Dispersion::Sellmeier) | 2 Sellmeier 1, 6 Sellmeier 3, 11 Sellmeier 5 | 2 without an offset |
//! | [`Schott`](Dispersion::Schott) | 1 Schott | 3 with the powers 2, -2, -4, -6, -8 |
//! | [`Square`](Dispersion::Square) | 4 Sellmeier 2, 7 and 8 Handbook of Optics, 9 Sellmeier 4, 10, 12, 13 Extended | 1, 2, 3, 4 |
//! | [`Powers`](Dispersion::Powers) | 5 Conrady | 5 Cauchy |
//! | [`Herzberger`](Dispersion::Herzberger) | 3 Herzberger | 7 |
//! | [`Gas`](Dispersion::Gas) | | 6 |
//! | [`LorentzLorenz`](Dispersion::LorentzLorenz) | | 8 Retro |
//! | [`Exotic`](Dispersion::Exotic) | | 9 Exotic |
//! | [`Table`](Dispersion::Table) | | tabulated n, tabulated nk |

use super::lines::{LINE_C_UM, LINE_D_UM, LINE_F_UM};

/// A dispersion formula; wavelengths w in um.
#[derive(Clone, Debug, PartialEq)]
pub enum Dispersion {
    /// The same index at every wavelength.
    Constant(f64),
    /// Sellmeier: `n^2 = 1 + sum_i B_i w^2 / (w^2 - C_i)`, C in um^2.
    Sellmeier {
        /// Oscillator strengths B_i.
        b: Vec<f64>,
        /// Squared resonance wavelengths C_i, um^2.
        c_um2: Vec<f64>,
    },
    /// Schott's power series: `n^2 = a_0 + a_1 w^2 + a_2 w^-2 + a_3 w^-4 + a_4 w^-6 + a_5 w^-8`.
    Schott([f64; 6]),
    /// Powers and resonances of any kind: `n^2 = sum_i a_i w^(p_i) + sum_j b_j w^(q_j) / (w^2 - c_j^(r_j))`.
    Square {
        /// Rows `[a, p]`; a constant has p = 0.
        powers: Vec<[f64; 2]>,
        /// Rows `[b, q, c, r]`: r is 1 where the square of the resonance is printed, 2 where its wavelength is.
        resonances: Vec<[f64; 4]>,
    },
    /// A series for the index itself: `n = sum_i a_i w^(p_i)`, rows `[a, p]`.
    Powers(Vec<[f64; 2]>),
    /// Herzberger: `n = a_0 + a_1 L + a_2 L^2 + a_3 w^2 + a_4 w^4 + a_5 w^6`, `L = 1 / (w^2 - 0.028)`.
    Herzberger([f64; 6]),
    /// A gas, against vacuum: `n = 1 + a + sum_i b_i / (c_i - w^-2)`.
    Gas {
        /// The constant a.
        a: f64,
        /// Rows `[b, c]`.
        terms: Vec<[f64; 2]>,
    },
    /// `(n^2 - 1) / (n^2 + 2) = a_0 + a_1 w^2 / (w^2 - a_2) + a_3 w^2`.
    LorentzLorenz([f64; 4]),
    /// `n^2 = a_0 + a_1 / (w^2 - a_2) + a_3 (w - a_4) / ((w - a_4)^2 + a_5)`.
    Exotic([f64; 6]),
    /// Two-term Cauchy `n = A + B / w^2` through a given n_d and V_d.
    NdVd {
        /// Index at the d line.
        nd: f64,
        /// Abbe number.
        vd: f64,
    },
    /// Measured indices, linear between the wavelengths and constant beyond them.
    Table {
        /// Wavelengths, um, ascending.
        wavelength_um: Vec<f64>,
        /// Index at each of them.
        index: Vec<f64>,
    },
}

impl Dispersion {
    /// Refractive index at a wavelength in um; NaN where the formula has no real value.
    pub fn index(&self, wavelength_um: f64) -> f64 {
        let w2 = wavelength_um * wavelength_um;
        match self {
            Self::Constant(n) => *n,
            Self::Sellmeier { b, c_um2 } => {
                let sum: f64 = b.iter().zip(c_um2).map(|(b, c)| b * w2 / (w2 - c)).sum();
                (1.0 + sum).sqrt()
            }
            Self::Schott(a) => {
                let v = 1.0 / w2;
                (a[0] + a[1] * w2 + v * (a[2] + v * (a[3] + v * (a[4] + v * a[5])))).sqrt()
            }
            Self::Square { powers, resonances } => {
                let resonant = |[b, q, c, r]: &[f64; 4]| b * power(wavelength_um, *q) / (w2 - power(*c, *r));
                (series(powers, wavelength_um) + resonances.iter().map(resonant).sum::<f64>()).sqrt()
            }
            Self::Powers(powers) => series(powers, wavelength_um),
            Self::Herzberger(a) => {
                const RESONANCE_UM2: f64 = 0.028;
                let l = 1.0 / (w2 - RESONANCE_UM2);
                a[0] + l * (a[1] + l * a[2]) + w2 * (a[3] + w2 * (a[4] + w2 * a[5]))
            }
            Self::Gas { a, terms } => 1.0 + a + terms.iter().map(|[b, c]| b / (c - 1.0 / w2)).sum::<f64>(),
            Self::LorentzLorenz(a) => {
                let x = a[0] + a[1] * w2 / (w2 - a[2]) + a[3] * w2;
                ((1.0 + 2.0 * x) / (1.0 - x)).sqrt()
            }
            Self::Exotic(a) => {
                let d = wavelength_um - a[4];
                (a[0] + a[1] / (w2 - a[2]) + a[3] * d / (d * d + a[5])).sqrt()
            }
            Self::NdVd { nd, vd } => {
                let inverse_square = |w: f64| 1.0 / (w * w);
                let span = inverse_square(LINE_F_UM) - inverse_square(LINE_C_UM);
                let b = (nd - 1.0) / vd / span;
                nd + b * (1.0 / w2 - inverse_square(LINE_D_UM))
            }
            Self::Table { wavelength_um: at, index } => {
                let hi = at.partition_point(|w| *w < wavelength_um).clamp(1, at.len().max(2) - 1);
                if at.len() < 2 {
                    return index.first().copied().unwrap_or(f64::NAN);
                }
                let t = (wavelength_um - at[hi - 1]) / (at[hi] - at[hi - 1]);
                index[hi - 1] + t.clamp(0.0, 1.0) * (index[hi] - index[hi - 1])
            }
        }
    }
}

fn series(powers: &[[f64; 2]], wavelength_um: f64) -> f64 {
    powers.iter().map(|[a, p]| a * power(wavelength_um, *p)).sum()
}

/// `base^exponent`; whole exponents, which nearly all are, also of negative bases.
fn power(base: f64, exponent: f64) -> f64 {
    const LARGEST_WHOLE: f64 = 64.0;
    if exponent.fract() == 0.0 && exponent.abs() <= LARGEST_WHOLE {
        base.powi(exponent as i32)
    } else {
        base.powf(exponent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_of_the_same_mathematics_agree() {
        let (b, c_um2) =
            (vec![1.03961212, 0.231792344, 1.01046945], vec![0.00600069867, 0.0200179144, 103.560653]);
        let rows =
            |r: f64, of: fn(f64) -> f64| b.iter().zip(&c_um2).map(|(b, c)| [*b, 2.0, of(*c), r]).collect();
        let squares = Dispersion::Square { powers: vec![[1.0, 0.0]], resonances: rows(1.0, |c| c) };
        let wavelengths = Dispersion::Square { powers: vec![[1.0, 0.0]], resonances: rows(2.0, f64::sqrt) };
        let schott = [2.2702566, -0.0091988101, 0.011609706, -7.6123911e-05, 2.8558727e-05, -1.2566486e-06];
        let powers = schott.iter().zip([0.0, 2.0, -2.0, -4.0, -6.0, -8.0]).map(|(a, p)| [*a, p]).collect();
        let series = Dispersion::Square { powers, resonances: Vec::new() };
        let (sellmeier, schott) = (Dispersion::Sellmeier { b, c_um2 }, Dispersion::Schott(schott));
        for um in [0.4, 0.5875618, 1.0, 2.2] {
            assert!((squares.index(um) - sellmeier.index(um)).abs() < 1e-14);
            assert!((wavelengths.index(um) - sellmeier.index(um)).abs() < 1e-14);
            assert!((series.index(um) - schott.index(um)).abs() < 1e-14);
        }
    }

    #[test]
    fn formulas_for_the_index_itself_are_what_they_say() {
        // By hand at 0.5 um, where w^2 = 1/4, w^-2 = 4 and L = 1 / 0.222.
        let near = |found: f64, by_hand: f64| assert!((found - by_hand).abs() < 1e-14, "{found} {by_hand}");
        near(
            Dispersion::Powers(vec![[1.5, 0.0], [0.01, -1.0], [0.001, -3.5]]).index(0.5),
            1.5 + 0.02 + 0.001 * 2_f64.powf(3.5),
        );
        near(
            Dispersion::Gas { a: 0.0, terms: vec![[0.05792105, 238.0185]] }.index(0.5),
            1.0 + 0.05792105 / 234.0185,
        );
        let l = 1.0 / 0.222;
        near(
            Dispersion::Herzberger([3.4, 0.16, -0.12, 1e-3, -2e-3, 3e-3]).index(0.5),
            3.4 + 0.16 * l - 0.12 * l * l + 1e-3 / 4.0 - 2e-3 / 16.0 + 3e-3 / 64.0,
        );
        let x: f64 = 0.2 + 0.1 * 0.25 / (0.25 - 0.01) + 0.02 * 0.25;
        near(
            Dispersion::LorentzLorenz([0.2, 0.1, 0.01, 0.02]).index(0.5),
            ((1.0 + 2.0 * x) / (1.0 - x)).sqrt(),
        );
        let exotic: f64 = 2.0 + 0.01 / (0.25 - 0.02) + 0.3 * 0.1 / (0.01 + 0.5);
        near(Dispersion::Exotic([2.0, 0.01, 0.02, 0.3, 0.4, 0.5]).index(0.5), exotic.sqrt());
    }

    #[test]
    fn there_is_no_index_beyond_a_formula() {
        let beyond = Dispersion::Square { powers: vec![[1.0, 0.0]], resonances: vec![[1.0, 2.0, 0.5, 2.0]] };
        assert!(beyond.index(0.499).is_nan() && beyond.index(0.6).is_finite());
        assert!(Dispersion::LorentzLorenz([2.0, 0.0, 0.0, 0.0]).index(0.5).is_nan());
    }
}
