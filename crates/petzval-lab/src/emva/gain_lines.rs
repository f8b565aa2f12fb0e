//! The noise of rows and columns at one gain, from all of its points together: one point has too few rows to show how they are
//! correlated.
//!
//! Readout noise does not depend on light. So dark points determine it for all, if there are enough of them.

use super::block_means::BLOCKS;
use super::captures::Kind;
use super::flags::{Deviations, FlaggedPoint};
use super::line_covariance::{LineCovariance, LineModel};
use super::line_noise::LineNoise;
use super::measured::{Measured, Unresolved};
use super::point::{Moments, PointStatistics};
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

/// Least number of dark points whose median one moved frame does not shift.
const ENOUGH_DARKS: usize = 3;

/// Variances of rows of blocks and of columns of blocks about the mean of their frame, beyond the noise of their pixels, DN^2. They are
/// medians over the dark points, or over all points if fewer than three are dark. Something that moves is in one point and not in all.
pub fn block_lines_dn2(points: &[(Kind, PointStatistics)]) -> [f64; 2] {
    let darks = points.iter().filter(|(kind, _)| *kind == Kind::Dark).count();
    let counts = |kind: Kind| kind == Kind::Dark || darks < ENOUGH_DARKS;
    let of_points: Vec<[f64; 2]> =
        points.iter().filter(|(kind, _)| counts(*kind)).map(|(_, found)| of_point(found)).collect();
    if of_points.len() < ENOUGH_DARKS {
        [0.0; 2]
    } else {
        [0, 1].map(|axis| median(of_points.iter().map(|p| p[axis])).max(0.0))
    }
}

/// The same of one point, by the median size of its deviations.
fn of_point(found: &PointStatistics) -> [f64; 2] {
    let frames = found.frames as f64;
    let all: Vec<Deviations> =
        found.block_deviations_dn.iter().map(|d| Deviations::of(d, &found.block_pixels)).collect();
    let of_pixels = found.all.pixel_dn2() * BLOCKS as f64 / found.all.pixels as f64;
    let of = |values: &dyn Fn(&Deviations) -> Vec<f64>| {
        let sizes = all.iter().flat_map(values).map(f64::abs);
        let sigma = SIGMA_OVER_MEDIAN * median(sizes);
        // A frame is compared with the mean of the others.
        sigma * sigma * (frames - 1.0) / frames - std::f64::consts::FRAC_PI_2 * of_pixels
    };
    [of(&|d| d.rows_dn.clone()), of(&|d| d.columns_dn.clone())]
}

/// The noise of rows and of columns of these points, whose frames are neither clipped at zero nor moved: that of the dark ones, or of the
/// flat ones where none is dark.
pub fn line_models(points: &[FlaggedPoint<'_>]) -> [LineModel; 2] {
    let of_kind = |kind: Kind| -> Vec<&Moments> {
        let of_kind = points.iter().filter(|p| p.point.kind == kind && p.flags.is_usable());
        of_kind.map(|p| &p.found.all).collect()
    };
    let darks = of_kind(Kind::Dark);
    let known = if darks.is_empty() { of_kind(Kind::Flat) } else { darks };
    models_of(&known)
}

/// The noise of rows and of columns of these frames.
pub fn models_of(points: &[&Moments]) -> [LineModel; 2] {
    let pixels = pixels_of(points);
    [0, 1].map(|axis| match LineCovariance::pooled(points.iter().map(|p| &p.line_covariances[axis])) {
        Some(pooled) => LineModel::of(&pooled, pixels),
        None => LineModel::none(Unresolved::NoDark),
    })
}

/// Temporal variance of single pixels over these frames, each point with the weight of its frames but one, DN^2.
pub fn pixels_of(points: &[&Moments]) -> Measured {
    let weight = |p: &Moments| p.frame_means_dn.len() as f64 - 1.0;
    let total: f64 = points.iter().map(|p| weight(p)).sum();
    let parts = points.iter().map(|p| p.line_noise.pixel_dn2.scale(weight(p) / total));
    parts.reduce(Measured::plus).unwrap_or(Measured::none(Unresolved::NoDark))
}

/// The noise of rows, columns and pixels of these dark frames.
pub fn dark_line_noise(darks: &[&Moments]) -> LineNoise {
    let [rows, columns] = models_of(darks);
    LineNoise { row_dn2: rows.variance_dn2, column_dn2: columns.variance_dn2, pixel_dn2: pixels_of(darks) }
}
