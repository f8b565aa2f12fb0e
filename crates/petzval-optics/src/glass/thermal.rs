//! The index of a glass at another temperature than that of its catalogue, in air of any temperature and pressure.
//!
//! Catalogues print indices relative to air at the temperature of the measurement and 1 atm. The absolute index, that
//! against vacuum, changes by `dn = (n^2 - 1) / (2 n) (D0 t + D1 t^2 + D2 t^3 + (E0 t + E1 t^2) / (w^2 - w_tk^2))`,
//! t = T - T0 in K (Schott, technical information TIE-19; the record `TD` of AGF files, formula A of
//! refractiveindex.info). For a lens in air this index is divided by that of the air.

/// Coefficients of the change of the absolute index with temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermal {
    /// D0, D1, D2: 1/K, 1/K^2, 1/K^3.
    pub d: [f64; 3],
    /// E0, E1: um^2/K, um^2/K^2.
    pub e: [f64; 2],
    /// Resonance w_tk, um.
    pub lambda_tk_um: f64,
    /// Temperature T0 at which the glass has the index of its formula, degrees Celsius.
    pub reference_c: f64,
}

impl Thermal {
    /// Change of the absolute index from the reference temperature to `temperature_c`, for a glass of index `n` at
    /// the reference.
    pub fn absolute_change(&self, n: f64, wavelength_um: f64, temperature_c: f64) -> f64 {
        let t = temperature_c - self.reference_c;
        let [d0, d1, d2] = self.d;
        let [e0, e1] = self.e;
        // Without resonant terms the resonance is arbitrary, and may be at this wavelength.
        let resonant = if [e0, e1] == [0.0; 2] {
            0.0
        } else {
            t * (e0 + t * e1) / (wavelength_um * wavelength_um - self.lambda_tk_um * self.lambda_tk_um)
        };
        (n * n - 1.0) / (2.0 * n) * (t * (d0 + t * (d1 + t * d2)) + resonant)
    }
}

/// Thermal expansion of a glass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion {
    /// Range of temperatures of this mean, degrees Celsius.
    pub range_c: [f64; 2],
    /// Linear expansion, 1/K.
    pub per_k: f64,
}

/// Index of air against vacuum at a temperature in degrees Celsius and a pressure in atm.
///
/// `n - 1 = (n15 - 1) P / (1 + 3.4785e-3 (T - 15))`, with `(n15 - 1) 1e8 = 6432.8 + 2949810 w^2 / (146 w^2 - 1) +
/// 25540 w^2 / (41 w^2 - 1)`: Edlén's dispersion of 1953 and Kohlrausch's law (Praktische Physik, 1968) as lens design
/// programs use them, good to about 1e-7 for dry air between -40 and 100 C.
pub fn air_index(wavelength_um: f64, temperature_c: f64, pressure_atm: f64) -> f64 {
    let w2 = wavelength_um * wavelength_um;
    let n15 = 6432.8 + 2_949_810.0 * w2 / (146.0 * w2 - 1.0) + 25_540.0 * w2 / (41.0 * w2 - 1.0);
    1.0 + n15 * 1e-8 * pressure_atm / (1.0 + 3.4785e-3 * (temperature_c - 15.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::glass::{Dispersion, Glass};

    #[test]
    fn air_is_as_tabulated() {
        // Ciddor, Appl. Opt. 35, 1566 (1996), a later formula for dry air of 15 C and 1 atm.
        let ciddor = |w: f64| {
            1.0 + 0.057_921_05 / (238.0185 - 1.0 / (w * w)) + 0.001_679_17 / (57.362 - 1.0 / (w * w))
        };
        for um in [0.4, 0.5461, 0.5893, 1.06] {
            assert!((air_index(um, 15.0, 1.0) - ciddor(um)).abs() < 3e-8, "{um}");
        }
        // One kelvin takes 1/293 of a gas, half an atmosphere half of it.
        let refractivity = |c: f64, atm: f64| air_index(0.55, c, atm) - 1.0;
        assert!((refractivity(20.0, 1.0) / refractivity(21.0, 1.0) - 294.15 / 293.15).abs() < 5e-4);
        assert!((refractivity(20.0, 0.5) / refractivity(20.0, 1.0) - 0.5).abs() < 1e-9);
        assert_eq!(air_index(0.5, 20.0, 0.0), 1.0);
    }

    /// N-BK7 of Schott.
    fn bk7() -> Glass {
        let (b, c_um2) =
            (vec![1.03961212, 0.231792344, 1.01046945], vec![0.00600069867, 0.0200179144, 103.560653]);
        let (d, e) = ([1.86e-6, 1.31e-8, -1.37e-11], [4.34e-7, 6.27e-10]);
        let mut glass = Glass::new("N-BK7", Dispersion::Sellmeier { b, c_um2 });
        glass.thermal = Some(Thermal { d, e, lambda_tk_um: 0.17, reference_c: 20.0 });
        glass
    }

    #[test]
    fn dn_dt_is_that_of_the_data_sheet() {
        // Schott's data sheet of N-BK7, 1e-6/K: range of temperature, relative and absolute at 1060 nm, e, g.
        let sheet = [
            ([-40.0, -20.0], [2.4, 2.9, 3.3], [0.3, 0.8, 1.2]),
            ([20.0, 40.0], [2.4, 3.0, 3.5], [1.1, 1.6, 2.1]),
            ([60.0, 80.0], [2.5, 3.1, 3.7], [1.5, 2.1, 2.7]),
        ];
        let glass = bk7();
        let thermal = glass.thermal.unwrap();
        for ([from, to], relative, absolute) in sheet {
            for (i, um) in [1.06, 0.546_074, 0.435_835].into_iter().enumerate() {
                let at = |c| glass.index_at(um, c, 1.0).unwrap();
                let found = (at(to) - at(from)) / (to - from) * 1e6;
                assert!(
                    (found - relative[i]).abs() < 0.051,
                    "relative, {from} C, {um} um: {found}, not {}",
                    relative[i]
                );
                let change = |c| thermal.absolute_change(glass.index(um), um, c);
                let found = (change(to) - change(from)) / (to - from) * 1e6;
                assert!(
                    (found - absolute[i]).abs() < 0.051,
                    "absolute, {from} C, {um} um: {found}, not {}",
                    absolute[i]
                );
            }
        }
    }

    #[test]
    fn at_catalogue_conditions_nothing_changes_and_in_vacuum_the_air_is_gone() {
        let glass = bk7();
        assert!((glass.index_at(0.55, 20.0, 1.0).unwrap() - glass.index(0.55)).abs() < 1e-15);
        let vacuum = glass.index_at(0.55, 20.0, 0.0).unwrap();
        assert!((vacuum - glass.index(0.55) * air_index(0.55, 20.0, 1.0)).abs() < 1e-15);
        assert_eq!(Glass::new("X", Dispersion::Constant(1.5)).index_at(0.55, 30.0, 1.0), None);
        assert_eq!(Glass::air().index_at(0.55, 30.0, 0.9), Some(1.0));
    }
}
