//! Dispersion formulas, as published by glass makers and refractiveindex.info.

/// A dispersion formula; wavelengths w in um.
#[derive(Clone, Debug, PartialEq)]
pub enum Dispersion {
    /// The same index at every wavelength.
    Constant(f64),
    /// Sellmeier: `n^2 = 1 + sum_i B_i w^2 / (w^2 - C_i)`, C in um^2 (the AGF formula 2).
    Sellmeier {
        /// Oscillator strengths B_i.
        b: Vec<f64>,
        /// Squared resonance wavelengths C_i, um^2.
        c_um2: Vec<f64>,
    },
    /// Schott's power series: `n^2 = a_0 + a_1 w^2 + a_2 w^-2 + a_3 w^-4 + a_4 w^-6 + a_5 w^-8`.
    Schott([f64; 6]),
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
            Self::NdVd { nd, vd } => {
                let inverse_square = |w: f64| 1.0 / (w * w);
                let span = inverse_square(super::LINE_F_UM) - inverse_square(super::LINE_C_UM);
                let b = (nd - 1.0) / vd / span;
                nd + b * (1.0 / w2 - inverse_square(super::LINE_D_UM))
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
