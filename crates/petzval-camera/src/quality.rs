//! Image quality as numbers: PSNR and SSIM of display-encoded pictures.
//!
//! Inputs are sRGB-encoded values in [0, 1], channel-major (see [`crate::LinearImage::to_srgb`]).

use rayon::prelude::*;

/// Why a score cannot be computed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum QualityError {
    /// The two pictures have different sizes, or do not match the stated shape.
    #[error("the pictures hold {a} and {b} values; {expected} are expected")]
    Length {
        /// Values of the first picture.
        a: usize,
        /// Values of the second picture.
        b: usize,
        /// Values of the stated shape.
        expected: usize,
    },
    /// A picture holds a value that is no finite number.
    #[error("value {index} of a picture is {value}, which is no finite number")]
    NotFinite {
        /// Place in the picture, channel-major.
        index: usize,
        /// The value, as text.
        value: String,
    },
    /// SSIM needs at least one whole window.
    #[error("SSIM needs at least 11x11 pixels, the pictures have {width} x {height}")]
    TooSmall {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
}

/// Peak signal-to-noise ratio in dB over all channels jointly, `10 log10(R^2 / MSE)` with peak `R = 1`.
///
/// Identical pictures give `f64::INFINITY`, which a report must print as "inf". Fails on empty pictures, different lengths, and values that
/// are no finite numbers.
pub fn psnr(a: &[f32], b: &[f32]) -> Result<f64, QualityError> {
    if a.len() != b.len() || a.is_empty() {
        return Err(QualityError::Length { a: a.len(), b: b.len(), expected: a.len().max(1) });
    }
    check_finite(a)?;
    check_finite(b)?;
    let squares: f64 = a.iter().zip(b).map(|(&x, &y)| (x as f64 - y as f64).powi(2)).sum();
    Ok(-10.0 * (squares / a.len() as f64).log10())
}

/// Refuses a picture with a value that is no finite number: no score follows from it.
fn check_finite(picture: &[f32]) -> Result<(), QualityError> {
    match picture.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(QualityError::NotFinite { index, value: picture[index].to_string() }),
        None => Ok(()),
    }
}

const RADIUS: usize = 5;

/// Side of the window of SSIM, pixels.
pub const SSIM_WINDOW: usize = 2 * RADIUS + 1;

/// The constant `0.01^2` that keeps the luminance part of SSIM finite, for values 0..1.
pub const SSIM_C1: f64 = 0.01 * 0.01;

/// The constant `0.03^2` that keeps the contrast part of SSIM finite, for values 0..1.
pub const SSIM_C2: f64 = 0.03 * 0.03;

/// Structural similarity, Gaussian window: mean over the channels of the mean SSIM map.
///
/// `SSIM = (2 mu_a mu_b + C1)(2 s_ab + C2) / ((mu_a^2 + mu_b^2 + C1)(s_a^2 + s_b^2 + C2))`, window 11x11 with
/// sigma 1.5 pixels, population covariance, `C1 = 0.01^2`, `C2 = 0.03^2` for a data range of 1. Pixels closer than 5 to
/// the border are left out. Same variant as scikit-image `structural_similarity(gaussian_weights=True,
/// use_sample_covariance=False)`; torchmetrics keeps the border and differs by up to 0.02.
/// Source: Wang, Bovik, Sheikh, Simoncelli, IEEE TIP 13(4), 2004.
pub fn ssim_gaussian_wang(
    a: &[f32],
    b: &[f32],
    channels: usize,
    height: usize,
    width: usize,
) -> Result<f64, QualityError> {
    let expected = channels * height * width;
    if a.len() != expected || b.len() != expected || channels == 0 {
        return Err(QualityError::Length { a: a.len(), b: b.len(), expected });
    }
    if height < SSIM_WINDOW || width < SSIM_WINDOW {
        return Err(QualityError::TooSmall { height, width });
    }
    check_finite(a)?;
    check_finite(b)?;
    let plane = height * width;
    let per_channel = |c: usize| {
        let part = c * plane..(c + 1) * plane;
        ssim_plane(&a[part.clone()], &b[part], width)
    };
    let scores: Vec<f64> = (0..channels).into_par_iter().map(per_channel).collect();
    Ok(scores.iter().sum::<f64>() / channels as f64)
}

fn ssim_plane(a: &[f32], b: &[f32], width: usize) -> f64 {
    // Blur the two pictures and their products over the window.
    let product = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(x, y)| x * y).collect() };
    let a: Vec<f64> = a.iter().map(|&v| v as f64).collect();
    let b: Vec<f64> = b.iter().map(|&v| v as f64).collect();
    let (mu_a, mu_b) = (blur_valid(&a, width), blur_valid(&b, width));
    let (aa, bb) = (blur_valid(&product(&a, &a), width), blur_valid(&product(&b, &b), width));
    let ab = blur_valid(&product(&a, &b), width);

    // Compare luminance, contrast and structure in every window.
    let total: f64 = (0..mu_a.len())
        .map(|i| {
            let (ma, mb) = (mu_a[i], mu_b[i]);
            let (va, vb, vab) = (aa[i] - ma * ma, bb[i] - mb * mb, ab[i] - ma * mb);
            ((2.0 * ma * mb + SSIM_C1) * (2.0 * vab + SSIM_C2))
                / ((ma * ma + mb * mb + SSIM_C1) * (va + vb + SSIM_C2))
        })
        .sum();
    total / mu_a.len() as f64
}

/// Weights of the window of SSIM along one side, Gaussian with sigma 1.5 pixels; their sum is 1.
pub fn ssim_window() -> [f64; SSIM_WINDOW] {
    let mut w = std::array::from_fn(|i| (-0.5 * ((i as f64 - RADIUS as f64) / 1.5).powi(2)).exp());
    let sum: f64 = w.iter().sum();
    w.iter_mut().for_each(|v| *v /= sum);
    w
}

/// Separable blur of the pixels whose whole window lies inside the picture.
fn blur_valid(plane: &[f64], width: usize) -> Vec<f64> {
    let (w, inner, height) = (ssim_window(), width - 2 * RADIUS, plane.len() / width);
    let add = |target: &mut [f64], source: &[f64], weight: f64| {
        target.iter_mut().zip(source).for_each(|(t, s)| *t += weight * s);
    };
    let mut rows = vec![0.0; height * inner];
    for (target, source) in rows.chunks_exact_mut(inner).zip(plane.chunks_exact(width)) {
        for (k, &weight) in w.iter().enumerate() {
            add(target, &source[k..k + inner], weight);
        }
    }
    let mut out = vec![0.0; (height - 2 * RADIUS) * inner];
    for (r, target) in out.chunks_exact_mut(inner).enumerate() {
        for (k, &weight) in w.iter().enumerate() {
            add(target, &rows[(r + k) * inner..(r + k + 1) * inner], weight);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identical_pictures() {
        let a: Vec<f32> = (0..3 * 144).map(|i| (i % 17) as f32 / 17.0).collect();
        assert_eq!(psnr(&a, &a), Ok(f64::INFINITY));
        assert!((ssim_gaussian_wang(&a, &a, 3, 12, 12).unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn wrong_sizes_are_errors() {
        assert!(psnr(&[0.0], &[]).is_err());
        assert!(matches!(
            ssim_gaussian_wang(&[0.0; 100], &[0.0; 100], 1, 10, 10),
            Err(QualityError::TooSmall { .. })
        ));
        assert!(ssim_gaussian_wang(&[0.0; 121], &[0.0; 122], 1, 11, 11).is_err());
    }

    #[test]
    fn what_is_no_number_has_no_score() {
        let good = vec![0.5; 121];
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut picture = good.clone();
            picture[7] = bad;
            for (a, b) in [(&good, &picture), (&picture, &good)] {
                let expected = QualityError::NotFinite { index: 7, value: bad.to_string() };
                assert_eq!(psnr(a, b), Err(expected.clone()));
                assert_eq!(ssim_gaussian_wang(a, b, 1, 11, 11), Err(expected));
            }
        }
    }

    #[test]
    fn window_weights_match_scipy() {
        // scipy.ndimage gaussian weights, sigma 1.5, radius 5.
        let w = ssim_window();
        assert!((w[0] - 0.00102838008447911).abs() < 1e-15 && (w[2] - 0.03600077212843083).abs() < 1e-15);
    }
}
