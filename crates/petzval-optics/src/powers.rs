//! Powers of a number, all at once.

/// Bound above the highest power of a coordinate.
pub(crate) const MAX_POWER: usize = 24;

/// The powers of a number from 0 on.
pub(crate) type Powers = [f64; MAX_POWER];

/// Powers up to a degree below [`MAX_POWER`], with the bits of [`f64::powi`]; zeros above.
///
/// Each is the product of the repeated squares that its binary digits name, the lowest first. The power without the highest digit is there
/// already, so that each takes one product.
pub(crate) fn powers_of(v: f64, degree: usize) -> Powers {
    let mut all = [0.0; MAX_POWER];
    all[0] = 1.0;
    let (mut highest, mut square) = (1, v);
    for n in 1..=degree {
        if n == 2 * highest {
            (highest, square) = (n, square * square);
        }
        all[n] = if n == highest { square } else { all[n - highest] * square };
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_have_the_bits_of_powi() {
        for k in 0..2000 {
            let v = (f64::from(k) * 0.618_034).sin() * 1.3;
            let all = powers_of(v, MAX_POWER - 1);
            for (n, power) in all.into_iter().enumerate() {
                assert_eq!(power.to_bits(), std::hint::black_box(v).powi(n as i32).to_bits(), "{v}^{n}");
            }
            assert_eq!(powers_of(v, 4)[..6], [all[0], all[1], all[2], all[3], all[4], 0.0]);
        }
    }
}
