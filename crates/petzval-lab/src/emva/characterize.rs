//! From captures to a sensor: everything that a series tells, as plain data.

use std::collections::HashMap;

use petzval_base::FileError;
use rayon::prelude::*;
use serde::Serialize;

use super::captures::{CaptureError, Captures, FrameFile, Kind, Point, SensorFacts, milliseconds};
use super::dark::{DarkPoint, DarkSeries, dark_series};
use super::figures::{Basis, Figure, LEAST_DARK_VARIANCE_DN2, figures};
use super::high_pass::HighPass;
use super::histogram_fit::{HistogramFit, fit_histograms};
use super::hot_pixels::{PixelDarkCurrents, dark_ends, of_dark_ends};
use super::joint::{GainInput, GainRow, JointFit, joint_fit};
use super::measured::Unresolved;
use super::point::{Counts, PointStatistics, Stack, reduce};
use super::samples::{Samples, clip_dn};
use super::spatial::{Spatial, spatial};
use super::transfer::{CLIPPED_SHARE, PhotonTransfer, Rules, TransferPoint, photon_transfer};
use super::usable::check_usable;
use super::warning::{Warning, clipped_at_zero, of_point};
use petzval_base::statistics::median;
use petzval_camera::sensor::Colour;

/// How a series is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Options {
    /// The filter before non-uniformity (of the corrected values).
    pub high_pass: HighPass,
    /// Take the variance of the frames' means from the temporal variance (release 4); without it, Eq. 6 of Tseng et al.
    pub mean_difference: bool,
    /// Fit the remaining parameters of the model to the histograms.
    pub fit_histograms: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { high_pass: HighPass::R4, mean_difference: true, fit_histograms: false }
    }
}

/// Everything that a series of captures tells.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Characterization {
    /// What was known before.
    pub sensor: SensorFacts,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// How it was evaluated.
    pub options: Options,
    /// What is odd.
    pub warnings: Vec<Warning>,
    /// Each linear gain, ascending.
    pub gains: Vec<GainResult>,
    /// All gains together.
    pub joint: JointFit,
    /// The fit to the histograms, if it was asked for and possible.
    pub histogram_fit: Option<HistogramFit>,
    /// Captured histograms of the points of two frames; too long for the results file.
    #[serde(skip)]
    pub histograms: Vec<PointHistogram>,
}

/// One linear gain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainResult {
    /// Linear gain g.
    pub linear_gain: f64,
    /// Dark series over all pixels.
    pub dark: DarkSeries,
    /// Dark currents pixel by pixel, if there are two different dark exposure times.
    pub pixel_dark_currents: Option<PixelDarkCurrents>,
    /// Each colour; mono sensors have the one colour `clear`. Empty if the gain has no flat points.
    pub channels: Vec<ChannelResult>,
}

/// One colour at one gain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelResult {
    /// Colour.
    pub colour: Colour,
    /// Points with flat and dark frames, light ascending.
    pub points: Vec<TransferPoint>,
    /// Photon transfer by our rules.
    pub transfer: PhotonTransfer,
    /// Photon transfer by the rules of the EMVA 1288 Python library.
    pub library_transfer: PhotonTransfer,
    /// Non-uniformity, if there are stacks.
    pub spatial: Option<Spatial>,
    /// Figures under the names of the library.
    pub figures: Vec<Figure>,
}

impl ChannelResult {
    /// A figure by its name.
    pub fn figure(&self, name: &str) -> Option<&Figure> {
        self.figures.iter().find(|f| f.name == name)
    }
}

/// The captured histogram of one colour at one point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointHistogram {
    /// Which point of the list; its colours share their light.
    pub point: usize,
    /// Whether light fell on the sensor.
    pub kind: Kind,
    /// Linear gain.
    pub linear_gain: f64,
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Photons per pixel, if they are known.
    pub photons: Option<f64>,
    /// Colour; `None` for dark frames, where all pixels are alike.
    pub colour: Option<Colour>,
    /// Pixels; each contributes one sample per frame.
    pub pixels: usize,
    /// Whether the point lies within the range of photon transfer of its colour; dark ones always do.
    pub in_range: bool,
    /// The counts.
    pub counts: Counts,
}

/// Evaluates a series. `read` is told of every frame that was read; points are read in parallel, gain by gain, and the
/// result does not depend on the number of threads.
pub fn characterize(
    captures: &Captures,
    options: &Options,
    read: &(dyn Fn() + Sync),
) -> Result<Characterization, CaptureError> {
    let size = frame_size(captures)?;
    let (mut warnings, mut gains, mut histograms) = (Vec::new(), Vec::new(), Vec::new());
    let mut known: HashMap<u64, &FrameFile> = HashMap::new();
    let (mut samples, max_dn) = (Samples::default(), (1 << captures.sensor.bits) - 1);
    for linear_gain in captures.gains() {
        let points: Vec<&Point> = captures.points.iter().filter(|p| p.linear_gain == linear_gain).collect();
        let ends = dark_ends(&points);
        let is_end = |point: &Point| ends.iter().flatten().any(|end| std::ptr::eq(*end, point));
        let reduced: Vec<(&Point, PointStatistics)> = points
            .into_par_iter()
            .map(|point| Ok((point, reduce(captures, point, size, is_end(point), read)?)))
            .collect::<Result<_, CaptureError>>()?;
        for (point, found) in &reduced {
            no_copies(captures, point, found, &mut known)?;
            warnings.extend(of_point(captures, point, found));
        }
        let flats = reduced.iter().filter(|(p, _)| p.kind == Kind::Flat);
        let clip_dn = clip_dn(flats.flat_map(|(_, s)| s.colours.iter().map(|(_, m)| m)), max_dn);
        reduced.iter().for_each(|(p, s)| samples.add(p.kind, &s.all));
        samples.clips_at(clip_dn, max_dn);
        let gain = one_gain(captures, options, linear_gain, &reduced, clip_dn, &mut warnings);
        for (point, found) in reduced.iter().filter(|(p, _)| !p.is_stack()) {
            let number = histograms.last().map_or(0, |h: &PointHistogram| h.point + 1);
            histograms.extend(captured(number, point, found, &gain));
        }
        gains.push(gain);
    }
    check_usable(captures, &gains, &warnings)?;
    warnings.extend(samples.warnings(max_dn));
    let joint = {
        let inputs: Vec<GainInput<'_>> = gains.iter().map(input).collect();
        joint_fit(&inputs, captures.sensor.black_level_dn)
    };
    warnings.extend(not_proportional(&joint));
    warnings.extend(dark_current_disagrees(&joint));
    warnings.extend(gains.iter().flat_map(more_electrons_than_photons));
    warnings.extend(joint.gain_dn_per_e.reason().map(|why| Warning::NoSensorFile { why }));
    warnings.extend(joint.rows.iter().filter_map(ruled_by_rounding));
    warnings.extend(joint.rows.iter().filter_map(below_the_converter));
    warnings.extend(gains.iter().flat_map(not_linear));
    warnings.extend(full_well_differs(&captures.sensor, &gains));
    warnings.extend(hot_pixels(&joint));
    let mut histogram_fit = None;
    if options.fit_histograms {
        histogram_fit = fit_histograms(&captures.sensor, &joint, &histograms);
        match &histogram_fit {
            Some(fit) => warnings.extend(fit.warnings(&joint)),
            None => warnings.push(Warning::NoHistogramFit { lacks: lacking(&joint) }),
        }
    }
    Ok(Characterization {
        sensor: captures.sensor.clone(),
        height: size.0,
        width: size.1,
        options: *options,
        warnings,
        gains,
        joint,
        histogram_fit,
        histograms,
    })
}

/// A frame that is the copy of another has no noise of its own: an error that names both.
fn no_copies<'a>(
    captures: &Captures,
    point: &'a Point,
    found: &PointStatistics,
    known: &mut HashMap<u64, &'a FrameFile>,
) -> Result<(), CaptureError> {
    for (frame, print) in point.frames.iter().zip(&found.fingerprints) {
        let Some(print) = print else { continue };
        if let Some(first) = known.insert(*print, frame) {
            let name = |frame: &FrameFile| frame.name_below(&captures.folder);
            let said = format!(
                "the frame {} is a copy of {}: every pixel has the same digital number",
                name(frame),
                name(first)
            );
            let error = FileError::at_line(point.line, "", said)
                .hint("noise is measured from frames that were exposed one after the other");
            return Err(CaptureError::List { path: captures.list.clone(), error: Box::new(error) });
        }
    }
    Ok(())
}

/// The first number that the fit to the histograms needs and the joint fit lacks.
fn lacking(joint: &JointFit) -> &'static str {
    let needed = [
        ("K", joint.gain_dn_per_e),
        ("the read noise", joint.read_noise_e),
        ("its mean", joint.read_noise_mean_e),
        ("the dark offset", joint.dark_offset_dn),
    ];
    let missing = needed.iter().find(|(_, m)| m.value().is_none());
    missing.map_or("a histogram of plausible light and without clipping", |(name, _)| *name)
}

/// Rows and columns: as the list says, or as the first frame has.
fn frame_size(captures: &Captures) -> Result<(usize, usize), CaptureError> {
    match (captures.size, captures.points.first().and_then(|p| p.frames.first())) {
        (Some(size), _) => Ok(size),
        (None, Some(first)) => {
            let frame = first.load()?;
            Ok((frame.height, frame.width))
        }
        (None, None) => Err(CaptureError::NoList(captures.folder.clone())),
    }
}

fn captured(number: usize, point: &Point, found: &PointStatistics, gain: &GainResult) -> Vec<PointHistogram> {
    // Beyond the last point of the transfer range the sensor saturates.
    let in_range = |colour: Option<Colour>, mean_dn: f64| {
        let channel = gain.channels.iter().find(|c| Some(c.colour) == colour);
        let last = channel.and_then(|c| c.points.get(c.transfer.range.1));
        last.is_none_or(|last| mean_dn <= last.mean_dn)
    };
    let of = |colour, moments: &super::point::Moments| PointHistogram {
        point: number,
        kind: point.kind,
        linear_gain: point.linear_gain,
        exposure_s: point.exposure_s,
        photons: point.photons,
        colour,
        pixels: moments.pixels,
        in_range: in_range(colour, moments.mean_dn),
        counts: moments.histogram.clone(),
    };
    match point.kind {
        Kind::Dark => vec![of(None, &found.all)],
        Kind::Flat => found.colours.iter().map(|(colour, m)| of(Some(*colour), m)).collect(),
    }
}

fn input(gain: &GainResult) -> GainInput<'_> {
    GainInput {
        linear_gain: gain.linear_gain,
        gains: gain.channels.iter().map(|c| c.transfer.gain_dn_per_e).collect(),
        dark: &gain.dark,
        pixels: gain.pixel_dark_currents.as_ref().ok_or(Unresolved::TooFewExposures { got: 1, need: 2 }),
        points: gain.channels.iter().map(|c| (c.colour, &c.points[..c.transfer.used])).collect(),
    }
}

/// Points that serve the photon transfer: pairs, and stacks where there is no pair of their setting.
fn temporal<'a>(
    reduced: &'a [(&'a Point, PointStatistics)],
    kind: Kind,
) -> Vec<&'a (&'a Point, PointStatistics)> {
    let setting = |p: &Point| (p.exposure_s, p.photons);
    let of_kind = || reduced.iter().filter(move |(p, _)| p.kind == kind);
    of_kind()
        .filter(|(p, _)| !p.is_stack() || !of_kind().any(|(q, _)| !q.is_stack() && setting(q) == setting(p)))
        .collect()
}

fn one_gain(
    captures: &Captures,
    options: &Options,
    linear_gain: f64,
    reduced: &[(&Point, PointStatistics)],
    clip_dn: u32,
    warnings: &mut Vec<Warning>,
) -> GainResult {
    let (mut flats, mut darks) = (temporal(reduced, Kind::Flat), temporal(reduced, Kind::Dark));
    // By light; where that is not known, by what it does.
    let light = |p: &Point| p.photons.unwrap_or(p.exposure_s);
    flats.sort_by(|(a, x), (b, y)| {
        let by_light = light(a).total_cmp(&light(b)).then(a.exposure_s.total_cmp(&b.exposure_s));
        by_light.then(x.all.mean_dn.total_cmp(&y.all.mean_dn))
    });
    // What is clipped at zero has neither the mean nor the noise of the sensor; `of_point` warns of it.
    // Nor does what moved have the noise of the sensor.
    let has_moved = |p: &Point| {
        let label = p.label();
        warnings.iter().any(|w| matches!(w, Warning::Moved { point, .. } if *point == label))
    };
    flats.retain(|(p, s)| !clipped_at_zero(&s.all) && !has_moved(p));
    darks.retain(|(p, s)| !clipped_at_zero(&s.all) && !has_moved(p));
    let dark = dark_series(
        darks.iter().map(|(p, s)| DarkPoint::new(p.exposure_s, &s.all, options.mean_difference)).collect(),
    );

    warnings.extend(dark_not_linear(linear_gain, &dark));

    // Each flat point needs the dark one of its exposure time.
    let dark_of = |p: &Point| {
        let same =
            |(q, _): &&&(&Point, PointStatistics)| (q.exposure_s - p.exposure_s).abs() <= 1e-9 * p.exposure_s;
        darks.iter().find(same).map(|(_, s)| s)
    };
    let mut pairs = Vec::new();
    for (point, flat) in flats {
        match dark_of(point) {
            None => warnings.push(Warning::NoDark { point: point.label() }),
            Some(dark) if flat.all.mean_dn <= dark.all.mean_dn => {
                warnings.push(Warning::NoSignal {
                    point: point.label(),
                    signal_dn: flat.all.mean_dn - dark.all.mean_dn,
                    standard_error_dn: flat.all.mean_se_dn.hypot(dark.all.mean_se_dn),
                });
            }
            Some(dark) => pairs.push((*point, flat, dark)),
        }
    }
    if !pairs.is_empty() && pairs.len() < 3 {
        warnings.push(Warning::TooFewPoints { linear_gain, points: pairs.len() });
    }
    let stacks = stacks(reduced, warnings);
    let channels: Vec<ChannelResult> = captures
        .sensor
        .cfa
        .colours()
        .into_iter()
        .filter_map(|colour| one_channel(captures, options, colour, &pairs, &darks, stacks.as_ref(), clip_dn))
        .collect();
    let saturated = |i: usize, c: &ChannelResult| {
        let beyond = c.transfer.saturated && i > c.transfer.saturation;
        beyond || c.points[i].share_at_max > CLIPPED_SHARE
    };
    let full = (0..pairs.len()).filter(|i| channels.iter().any(|c| saturated(*i, c))).count();
    if full > 0 {
        warnings.push(Warning::Saturated { linear_gain, points: full, of: pairs.len() });
    }
    for (i, (point, ..)) in pairs.iter().enumerate().skip(1) {
        if channels.iter().any(|c| falls(c, i)) {
            warnings.push(Warning::NotMonotonic { point: point.label() });
        }
    }
    let max_dn = f64::from((1u32 << captures.sensor.bits) - 1);
    GainResult { linear_gain, dark, pixel_dark_currents: of_dark_ends(reduced, max_dn), channels }
}

/// Whether a point is darker than the one of less light: by more than noise below saturation, by a twentieth on the plateau
/// beyond, where the dark signal that is subtracted still grows.
fn falls(channel: &ChannelResult, point: usize) -> bool {
    let (darker, brighter) = (&channel.points[point - 1], &channel.points[point]);
    let (low, high) = (darker.signal_dn(), brighter.signal_dn());
    match channel.transfer.saturated && point > channel.transfer.saturation {
        true => high < 0.95 * low,
        false => high < low - 6.0 * darker.signal_se_dn().hypot(brighter.signal_se_dn()),
    }
}

/// Drift of a dark mean that is not worth a warning, DN per unit of linear gain.
const DARK_DRIFT_DN: f64 = 0.05;

/// The dark mean that is furthest off the straight line over exposure time, if by more than six standard errors and drift.
fn dark_not_linear(linear_gain: f64, dark: &DarkSeries) -> Option<Warning> {
    let (slope, intercept) = (dark.mean.slope.value()?, dark.mean.intercept.value()?);
    let off = |p: &DarkPoint| p.mean_dn - (slope * p.exposure_s + intercept);
    let worst = dark.points.iter().max_by(|a, b| off(a).abs().total_cmp(&off(b).abs()))?;
    let chi2: f64 = dark.points.iter().map(|p| (off(p) / p.mean_se_dn).powi(2)).sum();
    let allowed_dn = 6.0 * worst.mean_se_dn + DARK_DRIFT_DN * linear_gain.max(1.0);
    (off(worst).abs() > allowed_dn).then(|| Warning::DarkNotLinear {
        linear_gain,
        exposure_ms: milliseconds(worst.exposure_s),
        off_dn: off(worst),
        reduced_chi2: chi2 / (dark.points.len() as f64 - 2.0),
    })
}

/// A gain at which the error of the dark variance is rounding's more than chance's.
fn ruled_by_rounding(row: &GainRow) -> Option<Warning> {
    let (variance, se) = (row.dark_variance_dn2.value()?, row.dark_variance_dn2.standard_error()?);
    (2.0 * row.rounding_error_dn2.powi(2) > se * se).then(|| Warning::Rounding {
        linear_gain: row.linear_gain,
        noise_dn: variance.max(0.0).sqrt(),
        error_dn2: row.rounding_error_dn2,
    })
}

/// A gain at which the dark noise is but a limit.
fn below_the_converter(row: &GainRow) -> Option<Warning> {
    let variance = row.dark_variance_dn2.value()?;
    (variance <= LEAST_DARK_VARIANCE_DN2).then_some(Warning::DarkNoiseLimit { linear_gain: row.linear_gain })
}

/// Deviation from a straight line that no sensor has which is worth measuring, percent.
const NOT_LINEAR_PERCENT: f64 = 5.0;

/// Colours whose response is off the straight line by more than 5 % and six standard errors.
fn not_linear(gain: &GainResult) -> Vec<Warning> {
    let of = |c: &ChannelResult| {
        let linearity = c.transfer.linearity.as_ref()?;
        let (first, last) = linearity.range;
        let off = |i: &usize| linearity.deviation_percent[*i].abs();
        let worst = (first..=last).max_by(|a, b| off(a).total_cmp(&off(b)))?;
        let (low, high) = linearity.se_percent;
        (off(&worst) > NOT_LINEAR_PERCENT && off(&worst) > 6.0 * low.max(high)).then(|| Warning::NotLinear {
            linear_gain: gain.linear_gain,
            colour: c.colour,
            percent: linearity.deviation_percent[worst],
            mean_dn: c.points[worst].mean_dn,
        })
    };
    gain.channels.iter().filter_map(of).collect()
}

/// A stated full well beside a measured one that differs by more than five standard errors and 2 %. Where the converter clips
/// first, the well is larger than what is measured.
fn full_well_differs(sensor: &SensorFacts, gains: &[GainResult]) -> Option<Warning> {
    let stated_e = sensor.full_well_e?;
    let channel = gains.first()?.channels.first()?;
    let measured = channel.figure("u_e_sat")?.best();
    let (measured_e, standard_error_e) = (measured.value()?, measured.standard_error()?);
    let is_clipped = channel.points.last().is_some_and(|p| p.share_at_max > 0.5);
    let off_e = measured_e - stated_e;
    let matters = off_e.abs() > (5.0 * standard_error_e).max(0.02 * stated_e);
    (matters && (off_e > 0.0 || !is_clipped)).then_some(Warning::FullWellDiffers {
        stated_e,
        measured_e,
        standard_error_e,
    })
}

/// Dark current from the mean and from the noise that it makes, if they differ by more than five standard errors, 10 %, and what
/// hot pixels add to the mean: the noise of a few pixels is known badly, and that of full ones is missing.
fn dark_current_disagrees(joint: &JointFit) -> Option<Warning> {
    let difference = joint.dark_current_difference_e_per_s;
    let (off, se) = (difference.value()?, difference.standard_error()?);
    let mean = joint.dark_current_e_per_s.value().unwrap_or(0.0);
    let hot = joint.hot_pixel_share.value().and(joint.dark_current_ordinary_e_per_s.value());
    let of_hot = hot.map_or(0.0, |ordinary| (mean - ordinary).max(0.0));
    (off.abs() > 5.0 * se + of_hot && off.abs() > 0.1 * mean.abs()).then_some(Warning::DarkCurrentDisagrees {
        mean_e_per_s: mean,
        difference_e_per_s: off,
        standard_error_e_per_s: se,
    })
}

/// Quantum efficiencies above one by more than five standard errors.
fn more_electrons_than_photons(gain: &GainResult) -> Vec<Warning> {
    let of = |c: &ChannelResult| {
        let efficiency = c.figure("QE")?.best();
        let (percent, standard_error) = (efficiency.value()?, efficiency.standard_error()?);
        (percent - 100.0 > 5.0 * standard_error).then_some(Warning::QuantumEfficiencyAboveOne {
            linear_gain: gain.linear_gain,
            colour: c.colour,
            percent,
            standard_error,
        })
    };
    gain.channels.iter().filter_map(of).collect()
}

/// Hot pixels, with what they do to the mean dark current.
fn hot_pixels(joint: &JointFit) -> Option<Warning> {
    Some(Warning::HotPixels {
        share: joint.hot_pixel_share.value()?,
        excess_e_per_s: joint.hot_pixel_e_per_s.value()?,
        ordinary_e_per_s: joint.dark_current_ordinary_e_per_s.value()?,
        mean_e_per_s: joint.dark_current_e_per_s.value()?,
    })
}

/// A flat and a dark stack of one exposure time.
struct Stacks<'a> {
    flat: &'a Stack,
    dark: &'a Stack,
    exposure_s: f64,
}

fn stacks<'a>(
    reduced: &'a [(&'a Point, PointStatistics)],
    warnings: &mut Vec<Warning>,
) -> Option<Stacks<'a>> {
    let mut chosen: Option<Stacks<'a>> = None;
    let of_kind = |kind| reduced.iter().filter(move |(p, _)| p.kind == kind && p.is_stack());
    for (point, found) in of_kind(Kind::Flat) {
        let Some(flat) = &found.stack else { continue };
        let dark = of_kind(Kind::Dark)
            .filter(|(p, _)| p.exposure_s == point.exposure_s)
            .find_map(|(_, s)| s.stack.as_ref());
        match (dark, &chosen) {
            (None, _) => warnings.push(Warning::LoneStack { point: point.label() }),
            (Some(_), Some(_)) => warnings.push(Warning::MoreStacks { point: point.label() }),
            (Some(dark), None) => chosen = Some(Stacks { flat, dark, exposure_s: point.exposure_s }),
        }
    }
    chosen
}

fn one_channel(
    captures: &Captures,
    options: &Options,
    colour: Colour,
    pairs: &[(&Point, &PointStatistics, &PointStatistics)],
    darks: &[&(&Point, PointStatistics)],
    stacks: Option<&Stacks<'_>>,
    clip_dn: u32,
) -> Option<ChannelResult> {
    let points: Vec<TransferPoint> = pairs
        .iter()
        .filter_map(|(point, flat, dark)| {
            let (flat, dark) = (flat.colour(colour)?, dark.colour(colour)?);
            let corrected = options.mean_difference;
            Some(TransferPoint::new(point.exposure_s, point.photons, flat, dark, corrected, clip_dn))
        })
        .collect();
    let transfer = photon_transfer(&points, Rules::Ours)?;
    let library_transfer = photon_transfer(&points, Rules::Library)?;
    let spatial = stacks
        .and_then(|s| spatial(s.flat, s.dark, s.exposure_s, &captures.sensor.cfa, colour, options.high_pass));
    let of_colour = |(point, found): &&(&Point, PointStatistics)| {
        Some(DarkPoint::new(point.exposure_s, found.colour(colour)?, options.mean_difference))
    };
    let dark = dark_series(darks.iter().filter_map(of_colour).collect());
    let figures = figures(&Basis {
        points: &points,
        library: &library_transfer,
        ours: &transfer,
        dark: &dark,
        spatial: spatial.as_ref(),
        pixel_area_um2: captures.sensor.pixel_um.map(|p| p * p),
    });
    Some(ChannelResult { colour, points, transfer, library_transfer, spatial, figures })
}

/// Gains whose `K_g / g` is off the median of all by more than five standard errors and 2 %. A gain that is off moves the
/// median little, so that the others are not blamed.
fn not_proportional(joint: &JointFit) -> Vec<Warning> {
    let all: Vec<(f64, f64, f64)> = joint
        .rows
        .iter()
        .filter_map(|r| {
            let at_unit = r.gain_at_unit_dn_per_e;
            Some((r.linear_gain, at_unit.value()?, at_unit.standard_error()?))
        })
        .collect();
    let n = all.len();
    if n < 2 {
        return Vec::new();
    }
    let median = median(all.iter().map(|(_, k, _)| *k));
    // Of a normal distribution the median is pi/2 times as uncertain as the mean, in variance.
    let mean_square = all.iter().map(|(.., se)| se * se).sum::<f64>() / n as f64;
    let median_se = (0.5 * std::f64::consts::PI * mean_square / n as f64).sqrt();
    all.iter()
        .filter(|(_, k, se)| {
            (k - median).abs() > 5.0 * se.hypot(median_se) && (k - median).abs() > 0.02 * median
        })
        .map(|(linear_gain, k, _)| Warning::GainNotProportional {
            linear_gain: *linear_gain,
            gain_dn_per_e: *k,
            expected_dn_per_e: median,
        })
        .collect()
}
