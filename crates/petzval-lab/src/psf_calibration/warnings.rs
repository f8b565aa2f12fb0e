//! Warnings about a measured position.

use super::exposure_report::ExposureReport;
use super::measure::Measured;
use super::merge::Merged;
use super::track::{Centroid, Track, drift, scatter_px, strays};
use petzval_camera::sensor::NonUniformity;

/// Largest movement of a centroid that does not matter for a PSF on pixels, px.
const STILL_PX: f64 = 0.05;

/// Five standard errors: by chance once in 1.7 million.
const MOVED_SIGMAS: f64 = 5.0;

/// Light of the other frames, in standard deviations, from which a frame without the source is reported.
const SEEN_SIGMAS: f64 = 20.0;

/// Least mean squared difference over variance of exposures that disagree, in addition to five of its standard
/// deviations; models of noise are not more accurate.
const DISAGREEMENT: f64 = 1.4;

/// A measured position with the inputs of its warnings.
pub(super) struct Seen<'a> {
    /// Exposure by exposure.
    pub exposures: &'a [ExposureReport],
    /// The source in the frames of each exposure.
    pub tracks: &'a [Track],
    /// The source in each exposure and the next, the same pixels of both.
    pub between: &'a [Option<[Centroid; 2]>],
    /// The merged mosaic.
    pub merged: &'a Merged,
    /// What was measured.
    pub measured: &'a Measured,
    /// Hot pixels, (row, column) on the sensor.
    pub hot: &'a [[usize; 2]],
    /// Non-uniformity of the sensor's pixels.
    pub nonuniformity: &'a NonUniformity,
}

/// The warnings about a position.
pub(super) fn position_warnings(seen: &Seen) -> Vec<String> {
    let mut warnings = Vec::new();
    of_pixels(seen, &mut warnings);
    of_exposures(seen, &mut warnings);
    of_movement(seen, &mut warnings);
    for ([row, col], share) in &seen.measured.other_sources {
        warnings.push(format!(
            "another source at row {row}, column {col} of the window, {:.0} % as bright",
            100.0 * share
        ));
    }
    warnings
}

/// The sensor: dark signal, hot and saturated pixels.
fn of_pixels(seen: &Seen, warnings: &mut Vec<String>) {
    let n = seen.nonuniformity;
    if seen.exposures.iter().any(|e| e.dark_frames == 0) {
        warnings.push("no dark frames: the sensor model's dark signal was subtracted".to_owned());
        let dsnu_e = n.dsnu_pixel_e.hypot(n.dsnu_row_e).hypot(n.dsnu_column_e);
        let mut fixed = Vec::new();
        if dsnu_e > 0.0 {
            fixed.push(format!("offsets that scatter by {dsnu_e:.1} e"));
        }
        if n.hot_pixel_share * n.hot_pixel_e_per_s > 0.0 {
            fixed.push(format!("{:.2} % hot pixels", 100.0 * n.hot_pixel_share));
        }
        if !fixed.is_empty() {
            warnings.push(format!(
                "the sensor model has {}, which only dark frames correct: take some of each exposure time",
                fixed.join(" and ")
            ));
        }
    }
    if !seen.hot.is_empty() {
        const NAMED: usize = 5;
        let names: Vec<String> =
            seen.hot.iter().take(NAMED).map(|[row, col]| format!("({row}, {col})")).collect();
        let more = if seen.hot.len() > NAMED { ", ..." } else { "" };
        warnings.push(format!(
            "{} hot pixels, replaced by their neighbours, at (row, column) of the sensor: {}{more}",
            seen.hot.len(),
            names.join(", ")
        ));
    }
    let saturated = seen.merged.saturated.iter().filter(|s| **s).count();
    if saturated > 0 {
        warnings.push(format!(
            "{saturated} pixels are saturated in every exposure, the shortest included: the PSF's peak is cut off; dim the source"
        ));
    }
}

/// Noise and light of the exposures.
fn of_exposures(seen: &Seen, warnings: &mut Vec<String>) {
    for e in seen.exposures {
        if let Some(ratio) = e.variance_ratio
            && !(0.7..=1.4).contains(&ratio)
        {
            warnings.push(format!(
                "at {} ms the frames scatter with {ratio:.2} times the variance of the sensor model: is this the sensor and its gain, \
                 and was the source steady?",
                e.exposure_ms
            ));
        }
    }
    // Report only the exposure that differs most from all others.
    let known = seen.exposures.iter().filter_map(|e| Some((e, e.agreement?)));
    let worst = known
        .filter(|(_, a)| a.chi2 > DISAGREEMENT + 5.0 * (2.0 / a.pixels as f64).sqrt())
        .max_by(|(_, a), (_, b)| a.chi2.total_cmp(&b.chi2));
    if let Some((e, a)) = worst {
        warnings.push(format!(
            "the {} ms frames disagree with the other exposures: {:.3} times their light, chi2 {:.1} over {} bright pixels where 1 \
             is noise alone; are `exposure_ms` and the files right, and was the source steady?",
            e.exposure_ms, a.ratio, a.chi2, a.pixels
        ));
    }
}

/// The source, from frame to frame and from exposure to exposure.
fn of_movement(seen: &Seen, warnings: &mut Vec<String>) {
    let moved = |px: [f64; 2], error_px: [f64; 2]| {
        let beyond = |axis: usize| px[axis].abs() > MOVED_SIGMAS * error_px[axis];
        let distance = px[0].hypot(px[1]);
        (distance > STILL_PX && (beyond(0) || beyond(1))).then_some(distance)
    };
    for (e, track) in seen.exposures.iter().zip(seen.tracks) {
        let stray = strays(track, MOVED_SIGMAS);
        for (frame, distance) in &stray {
            warnings.push(format!(
                "{}: the source is {distance:.2} px from where the other frames have it",
                track[*frame].0
            ));
        }
        let strayed: Vec<usize> = stray.iter().map(|s| s.0).collect();
        if let Some(distance) = drift(track, &strayed).and_then(|d| moved(d.px, d.error_px)) {
            warnings
                .push(format!("the source moved by {distance:.2} px during the {} ms frames", e.exposure_ms));
        }
        let bright = track.iter().filter_map(|(_, c)| c.map(|c| c.light_sigmas));
        if petzval_base::statistics::median(bright) > SEEN_SIGMAS {
            for (file, _) in track.iter().filter(|(_, c)| c.is_none()) {
                warnings.push(format!("{file}: the source is not in it, but in the other frames"));
            }
        }
    }
    for (k, pair) in seen.between.iter().enumerate() {
        let Some([a, b]) = pair else { continue };
        let px = [0, 1].map(|axis| b.px[axis] - a.px[axis]);
        // Use at least the scatter of the frames as the error of a mean.
        let scatter = |k: usize, axis: usize| {
            scatter_px(&seen.tracks[k], axis) / (seen.exposures[k].frames as f64).sqrt()
        };
        let error = [0, 1].map(|axis| {
            let of = |k: usize, c: &Centroid| c.error_px[axis].max(scatter(k, axis));
            of(k, a).hypot(of(k + 1, b))
        });
        if let Some(distance) = moved(px, error) {
            let (before, after) = (seen.exposures[k].exposure_ms, seen.exposures[k + 1].exposure_ms);
            warnings.push(format!(
                "the source moved by {distance:.2} px between the {before} and the {after} ms frames"
            ));
        }
    }
}
