//! The bands of a spectral image: their wavelengths, and the value of a curve in each band.

use crate::spectrum::{Spectrum, integral};

/// Centres, um, of `count` bands evenly spaced over `low_um..high_um`, both ends included, rounded to 1 pm.
pub fn even_bands(low_um: f64, high_um: f64, count: usize) -> Vec<f64> {
    let last = count.saturating_sub(1).max(1) as f64;
    let to_picometre = |um: f64| (um * 1e6).round() / 1e6;
    (0..count).map(|i| to_picometre(low_um + (high_um - low_um) * i as f64 / last)).collect()
}

/// Number of evenly spaced bands, both ends included, that lie at most `step_um` apart over a range, um.
pub fn bands_within((low_um, high_um): (f64, f64), step_um: f64) -> usize {
    // A step that divides the range up to rounding needs no extra band.
    ((high_um - low_um) / step_um - 1e-6).ceil().max(1.0) as usize + 1
}

/// Mean of a product of up to four curves over the hat function of each band. The hat is 1 at the band and falls to zero at
/// its neighbours, so the light of a narrow line is shared between the bands around it and never lost between them.
pub fn band_mean(factors: &[&Spectrum], band_um: &[f64]) -> Vec<f64> {
    (0..band_um.len())
        .map(|band| {
            let Some(hat) = hat(band_um, band) else { return 0.0 };
            let mut weighted = factors.to_vec();
            weighted.push(&hat);
            integral(&weighted) / integral(&[&hat])
        })
        .collect()
}

/// First and last band, um.
pub(crate) fn ends(band_um: &[f64]) -> (f64, f64) {
    (band_um.first().copied().unwrap_or(0.0), band_um.last().copied().unwrap_or(0.0))
}

/// Hat function of a band; `None` if there are fewer than two bands or they do not ascend.
pub(super) fn hat(band_um: &[f64], band: usize) -> Option<Spectrum> {
    let near = band.saturating_sub(1)..(band + 2).min(band_um.len());
    let value = near.clone().map(|i| if i == band { 1.0 } else { 0.0 }).collect();
    Spectrum::new(band_um[near].to_vec(), value).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_keep_a_constant() {
        let bands = even_bands(0.4, 0.7, 7);
        assert_eq!(bands.len(), 7);
        assert_eq!(
            [(0.4, 0.7), (0.3, 1.1), (0.5, 0.501)].map(|range| bands_within(range, 0.02)),
            [16, 41, 2]
        );
        assert!((bands[1] - 0.45).abs() < 1e-12);
        let flat = Spectrum::new(vec![0.3, 0.8], vec![2.0, 2.0]).unwrap();
        assert!(band_mean(&[&flat, &flat], &bands).iter().all(|v| (v - 4.0).abs() < 1e-12));
    }

    #[test]
    fn a_line_between_bands_keeps_its_energy() {
        let line = Spectrum::new(vec![0.4799, 0.48, 0.4801], vec![0.0, 1e4, 0.0]).unwrap();
        let bands = even_bands(0.4, 0.7, 7);
        let energy: f64 = band_mean(&[&line], &bands)
            .iter()
            .zip(0..)
            .map(|(v, i)| v * if i == 0 || i == 6 { 0.025 } else { 0.05 })
            .sum();
        assert!((energy - 1.0).abs() < 1e-9, "{energy}");
    }
}
