//! The wavelengths that a lens may have.

use std::fmt::Display;
use std::ops::RangeInclusive;

use crate::decimal::{shifted, shown};

/// Permitted wavelengths of a lens, um.
pub const OPTICAL_UM: RangeInclusive<f64> = 0.2..=20.0;

/// What a number is divided by where it was meant in another unit, or its point was forgotten: nm, mm, m, angstrom, two digits, one digit.
const SLIPS: [f64; 6] = [1e3, 1e-3, 1e-6, 1e4, 1e2, 1e-1];

/// A unit in which files state wavelengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WavelengthUnit {
    /// Its name.
    pub name: &'static str,
    /// The power of ten of its length in um: -3 for nm.
    pub power: i32,
}

impl WavelengthUnit {
    pub const UM: Self = Self { name: "um", power: 0 };
    pub const NM: Self = Self { name: "nm", power: -3 };

    /// The number of a wavelength, um, in this unit.
    fn number(self, um: f64) -> String {
        shown(shifted(&format!("{um:e}"), -self.power).unwrap_or(um))
    }

    fn message_about(self, number: impl Display) -> String {
        let [least, most] = [OPTICAL_UM.start(), OPTICAL_UM.end()].map(|um| self.number(*um));
        let unit = self.name;
        format!("a wavelength of {number} {unit} is not optical ({least} to {most} {unit})")
    }

    /// The message about a wavelength, um, outside of [`OPTICAL_UM`].
    pub fn message(self, um: f64) -> String {
        self.message_about(self.number(um))
    }

    /// The hint about a wavelength, um, outside of [`OPTICAL_UM`]. A number that it offers lies inside.
    pub fn hint(self, um: f64) -> String {
        // Rounded, so that 0.00055 mm are 0.55 um and not 0.5499999999.
        let meant = |slip: &f64| format!("{:.9}", um / slip).parse().unwrap_or(f64::NAN);
        let unit = self.name;
        match SLIPS.iter().map(meant).find(|um| OPTICAL_UM.contains(um)) {
            Some(meant) => format!("wavelengths are in {unit}; did you mean {}?", self.number(meant)),
            None => format!("wavelengths are in {unit}, such as {}", self.number(0.55)),
        }
    }
}

/// The message about a wavelength outside of [`OPTICAL_UM`].
pub fn wavelength_message(um: impl Display) -> String {
    WavelengthUnit::UM.message_about(um)
}

/// The hint about a wavelength outside of [`OPTICAL_UM`]. A number that it offers lies inside.
pub fn wavelength_hint(um: f64) -> String {
    WavelengthUnit::UM.hint(um)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_offered_is_optical() {
        for (um, meant) in [
            (550.0, "0.55"),
            (587.5618, "0.5875618"),
            (55.0, "0.55"),
            (0.055, "0.55"),
            (0.000_55, "0.55"),
            (5.5e-7, "0.55"),
        ] {
            assert_eq!(wavelength_hint(um), format!("wavelengths are in um; did you mean {meant}?"));
        }
        for um in [0.0, -0.55, f64::NAN, f64::INFINITY] {
            assert_eq!(wavelength_hint(um), "wavelengths are in um, such as 0.55");
        }
    }

    #[test]
    fn messages_and_hints_are_in_the_unit_of_the_file() {
        let nm = WavelengthUnit::NM;
        assert_eq!(nm.message(0.000_656_3), "a wavelength of 0.6563 nm is not optical (200 to 20000 nm)");
        assert_eq!(nm.hint(0.000_656_3), "wavelengths are in nm; did you mean 656.3?");
        assert_eq!(nm.hint(-0.55), "wavelengths are in nm, such as 550");
        assert_eq!(WavelengthUnit::UM.message(550.0), wavelength_message(550.0));
    }
}
