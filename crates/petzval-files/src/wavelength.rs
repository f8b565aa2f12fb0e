//! The wavelengths that a lens may have.

use std::ops::RangeInclusive;

/// Permitted wavelengths of a lens, um.
pub const OPTICAL_UM: RangeInclusive<f64> = 0.2..=20.0;

/// What a number is divided by where it was meant in another unit, or its point was forgotten: nm, mm, m, angstrom, two digits, one digit.
const SLIPS: [f64; 6] = [1e3, 1e-3, 1e-6, 1e4, 1e2, 1e-1];

/// The message about a wavelength outside of [`OPTICAL_UM`].
pub fn wavelength_message(um: impl std::fmt::Display) -> String {
    format!("a wavelength of {um} um is not optical ({} to {} um)", OPTICAL_UM.start(), OPTICAL_UM.end())
}

/// The hint about a wavelength outside of [`OPTICAL_UM`]. A number that it offers lies inside.
pub fn wavelength_hint(um: f64) -> String {
    // Rounded, so that 0.00055 mm are 0.55 um and not 0.5499999999.
    let meant = |slip: &f64| format!("{:.9}", um / slip).parse().unwrap_or(f64::NAN);
    match SLIPS.iter().map(meant).find(|um| OPTICAL_UM.contains(um)) {
        Some(meant) => format!("wavelengths are in um; did you mean {meant}?"),
        None => "wavelengths are in um, such as 0.55".to_owned(),
    }
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
}
