//! Coefficients of powers of r in other programs' files: in lens units, for r divided by a normalisation radius.

use petzval_optics::lens::{Departure, ODD_TERMS, SurfaceShape};

/// Converts a coefficient of r^power from lens units of `mm` mm to mm.
pub(crate) fn in_mm(value: f64, power: usize, mm: f64) -> f64 {
    if mm == 1.0 { value } else { value * mm.powi(1 - power as i32) }
}

/// Sets the terms (power, coefficient) of a polynomial in r over the normalisation radius, both in lens units of `mm` mm.
/// `power` is at least 1. Fails with a message on a nonzero term whose power cannot be traced.
pub(crate) fn set_powers(
    shape: &mut SurfaceShape,
    terms: impl Iterator<Item = (usize, f64)>,
    norm_radius: f64,
    mm: f64,
) -> Result<(), String> {
    let mut odd = [0.0; ODD_TERMS];
    for (power, value) in terms {
        let plain = match norm_radius {
            1.0 => value,
            radius => value / radius.powi(power as i32),
        };
        let value = in_mm(plain, power, mm);
        let place = match power % 2 {
            0 => shape.asphere.get_mut(power / 2 - 1),
            _ => odd.get_mut(power / 2),
        };
        match place {
            Some(place) => *place = value,
            None if value == 0.0 => {}
            None => return Err(format!("the term of r^{power} is not traced: powers up to 16 are")),
        }
    }
    if odd.iter().any(|b| b.to_bits() != 0) {
        shape.departure = Departure::Odd(odd);
    }
    Ok(())
}
