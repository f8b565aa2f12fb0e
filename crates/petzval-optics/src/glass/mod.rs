//! Glass: the refractive index of a medium as a function of wavelength, and further data of its maker.

mod catalog;
mod dispersion;
mod lines;
mod nearest;
mod printed;
mod thermal;
mod through;
mod transmission;

pub use catalog::{Catalog, UnknownGlass};
pub use dispersion::Dispersion;
pub use lines::{LINE_C_UM, LINE_D_UM, LINE_F_UM, LINE_G_UM};
pub use nearest::{Near, map_distance, nearest};
pub use printed::Printed;
pub use thermal::{Expansion, Thermal, air_index};
pub use through::ThroughIndices;
pub use transmission::Absorption;

use std::fmt;
use std::sync::{Arc, LazyLock};

/// A named optical medium.
#[derive(Clone, Debug, PartialEq)]
pub struct Glass {
    /// Catalogue name, e.g. `N-BK7`; `AIR` for the gap between elements.
    pub name: String,
    /// Its dispersion formula with published coefficients.
    pub dispersion: Dispersion,
    /// Maker; empty if unknown.
    pub maker: String,
    /// Source of the figures; empty if unknown.
    pub source: String,
    /// Availability.
    pub status: Option<Status>,
    /// Index at the d line as its source prints it.
    pub printed_nd: Option<Printed>,
    /// Abbe number V_d as its source prints it.
    pub printed_vd: Option<Printed>,
    /// Shortest and longest wavelength at which the formula holds, um.
    pub range_um: Option<[f64; 2]>,
    /// Absorption.
    pub absorption: Option<Absorption>,
    /// Change of its index with temperature.
    pub thermal: Option<Thermal>,
    /// Thermal expansion; no rows if unknown.
    pub expansion: Vec<Expansion>,
    /// Density, g/cm^3.
    pub density_g_cm3: Option<f64>,
    /// Price relative to the maker's reference glass.
    pub relative_cost: Option<f64>,
}

/// Availability of a glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Preferred, from stock.
    Preferred,
    /// Made regularly.
    Standard,
    /// Made to order, or soon obsolete.
    Special,
    /// No longer made.
    Obsolete,
    /// A measured melt.
    Melt,
}

impl Status {
    /// All values.
    pub const ALL: [Self; 5] = [Self::Preferred, Self::Standard, Self::Special, Self::Obsolete, Self::Melt];

    /// The word for it in files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Preferred => "preferred",
            Self::Standard => "standard",
            Self::Special => "special",
            Self::Obsolete => "obsolete",
            Self::Melt => "melt",
        }
    }

    /// The status of a word, in upper or lower case.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|status| status.word().eq_ignore_ascii_case(word))
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl Glass {
    /// A medium with a formula and no other data.
    pub fn new(name: impl Into<String>, dispersion: Dispersion) -> Self {
        Self {
            name: name.into(),
            dispersion,
            maker: String::new(),
            source: String::new(),
            status: None,
            printed_nd: None,
            printed_vd: None,
            range_um: None,
            absorption: None,
            thermal: None,
            expansion: Vec::new(),
            density_g_cm3: None,
            relative_cost: None,
        }
    }

    /// Air, whose index is the unit in which catalogues print all others.
    pub fn air() -> Arc<Self> {
        static AIR: LazyLock<Arc<Glass>> =
            LazyLock::new(|| Arc::new(Glass::new("AIR", Dispersion::Constant(1.0))));
        AIR.clone()
    }

    /// Whether this is the gap between elements rather than a material.
    pub fn is_air(&self) -> bool {
        self.dispersion == Dispersion::Constant(1.0)
    }

    /// Refractive index at a wavelength in um, relative to air and at the temperature of the catalogue.
    pub fn index(&self, wavelength_um: f64) -> f64 {
        self.dispersion.index(wavelength_um)
    }

    /// Refractive index relative to the air around it, of glass and air at `temperature_c` (degrees Celsius) and
    /// `pressure_atm`; `None` if the change of the glass with temperature is not known.
    ///
    /// `wavelength_um` is the wavelength in air of catalogue conditions, by which lines are named: light keeps its
    /// frequency, not its wavelength, when the air changes.
    pub fn index_at(&self, wavelength_um: f64, temperature_c: f64, pressure_atm: f64) -> Option<f64> {
        if self.is_air() {
            return Some(1.0);
        }
        let thermal = self.thermal.as_ref()?;
        let n = self.index(wavelength_um);
        let absolute = n * air_index(wavelength_um, thermal.reference_c, 1.0)
            + thermal.absolute_change(n, wavelength_um, temperature_c);
        Some(absolute / air_index(wavelength_um, temperature_c, pressure_atm))
    }

    /// Internal transmittance of a path in mm, without reflections at faces; `None` if it is not known. Air has 1.
    pub fn internal_transmission(&self, wavelength_um: f64, path_mm: f64) -> Option<f64> {
        if self.is_air() {
            Some(1.0)
        } else {
            self.absorption.as_ref()?.transmittance(wavelength_um, path_mm)
        }
    }

    /// Shortest and longest wavelength at which the index is known, um: the stated range, or the ends of a table.
    pub fn known_range_um(&self) -> Option<[f64; 2]> {
        self.range_um.or_else(|| match &self.dispersion {
            Dispersion::Table { wavelength_um, .. } => {
                Some([*wavelength_um.first()?, *wavelength_um.last()?])
            }
            _ => None,
        })
    }

    /// Whether the formula is known not to hold at a wavelength in um, or a table does not reach it. Spectral lines are printed to 1e-4 um or finer,
    /// so a wavelength may lie half of that beyond an end.
    pub fn is_outside_range(&self, wavelength_um: f64) -> bool {
        const PRINTED_UM: f64 = 5e-5;
        let is_inside = |[min, max]: [f64; 2]| (min - PRINTED_UM..=max + PRINTED_UM).contains(&wavelength_um);
        self.known_range_um().is_some_and(|range| !is_inside(range))
    }

    /// Index at the d line.
    pub fn nd(&self) -> f64 {
        self.index(LINE_D_UM)
    }

    /// Abbe number `(n_d - 1) / (n_F - n_C)`; infinite for a medium without dispersion.
    pub fn abbe_vd(&self) -> f64 {
        let spread = self.index(LINE_F_UM) - self.index(LINE_C_UM);
        // Avoid 0 / 0 for air.
        if spread == 0.0 { f64::INFINITY } else { (self.nd() - 1.0) / spread }
    }

    /// [`nd`](Self::nd) and [`abbe_vd`](Self::abbe_vd); `None` where the formula is known not to hold at their lines, or the value is not finite.
    pub fn known_nd_and_vd(&self) -> [Option<f64>; 2] {
        let holds = |lines_um: &[f64]| !lines_um.iter().any(|um| self.is_outside_range(*um));
        let known = |value: f64, lines_um: &[f64]| Some(value).filter(|v| v.is_finite() && holds(lines_um));
        [known(self.nd(), &[LINE_D_UM]), known(self.abbe_vd(), &[LINE_F_UM, LINE_D_UM, LINE_C_UM])]
    }

    /// Relative partial dispersion `P_gF = (n_g - n_F) / (n_F - n_C)`; NaN for a medium without dispersion.
    pub fn partial_dispersion_gf(&self) -> f64 {
        let n_f = self.index(LINE_F_UM);
        (self.index(LINE_G_UM) - n_f) / (n_f - self.index(LINE_C_UM))
    }

    /// A printed n_d or V_d that contradicts the formula: one of the two must be mistyped, or a coefficient is missing.
    ///
    /// n_d contradicts it where the indices differ by more than [`MISPRINT`], V_d where the dispersions `n_F - n_C` do, each beyond the rounding
    /// of the printed digits. Rounded indices and fits of makers differ by up to 6e-5. Lines outside the range of the formula are ignored.
    pub fn misprint(&self) -> Option<Misprint> {
        let holds = |lines: &[f64]| lines.iter().all(|line| !self.is_outside_range(*line));
        let (nd, vd) = (self.nd(), self.abbe_vd());
        // A formula without a real value contradicts every print.
        let agrees = |off: f64, rounding: f64| off.abs() <= MISPRINT + rounding;
        if let Some(printed) = self.printed_nd.filter(|_| holds(&[LINE_D_UM]))
            && !agrees(nd - printed.value, printed.rounding())
        {
            return Some(Misprint { figure: "nd", formula: nd, printed });
        }
        let printed = self.printed_vd.filter(|_| holds(&[LINE_F_UM, LINE_D_UM, LINE_C_UM]))?;
        let dispersion = (nd - 1.0) / printed.value;
        let rounding = dispersion * printed.rounding() / printed.value;
        let is_contradicted = !agrees((nd - 1.0) / vd - dispersion, rounding.abs());
        is_contradicted.then_some(Misprint { figure: "Vd", formula: vd, printed })
    }
}

/// Difference of indices from which a printed value contradicts a formula, see [`Glass::misprint`].
pub const MISPRINT: f64 = 1e-4;

/// A printed value that contradicts the formula.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the formula gives {figure} = {formula:.5}, and {printed} is printed")]
pub struct Misprint {
    /// `nd` or `Vd`.
    pub figure: &'static str,
    /// Its value by the formula.
    pub formula: f64,
    /// Its printed value.
    pub printed: Printed,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_holds_between_its_ends_unless_a_range_is_stated() {
        let table = Dispersion::Table { wavelength_um: vec![0.48613, 0.65627], index: vec![1.52, 1.51] };
        let mut glass = Glass::new("MEASURED", table);
        assert_eq!(glass.known_range_um(), Some([0.48613, 0.65627]));
        let outside =
            [0.4358343, 0.4861, LINE_F_UM, 0.55, LINE_C_UM, 0.7].map(|um| glass.is_outside_range(um));
        assert_eq!(outside, [true, false, false, false, false, true]);
        glass.range_um = Some([0.4, 0.7]);
        assert!(!glass.is_outside_range(0.4358343));
        assert_eq!(Glass::new("FLAT", Dispersion::Constant(1.5)).known_range_um(), None);
    }
}
