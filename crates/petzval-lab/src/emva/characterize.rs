//! Measures a sensor from captures: reduces the frames gain by gain, then evaluates all gains together.

use std::collections::HashMap;

use petzval_base::{Cancelled, FileError, InFile};
use rayon::prelude::*;

use super::captures::{CaptureError, Captures, FrameFile, Kind, Point};
use super::counts::PointHistogram;
use super::dark_defects::{dark_defects, flat_and_dark};
use super::fits::fits;
use super::flags::{FlaggedPoint, FrameFlags, GainFlags};
use super::gain::evaluate_gain;
use super::gain_lines::{block_lines_dn2, line_models, models_of};
use super::histogram_fit::fit_histograms;
use super::hot_pixels::dark_ends;
use super::joint::{GainInput, joint_fit};
use super::measured::{Measured, Unresolved};
use super::point::{Moments, PointStatistics, reduce};
use super::result::{Characterization, GainResult, Options};
use super::samples::{Samples, StuckBit, clip_dn};
use super::usable::check_usable;
use super::warnings::{departures, fit_warnings, gain_warnings, series_warnings};
use petzval_camera::sensor::Colour;

/// A unit of the work of [`characterize`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Done {
    /// A frame was read; each is read once.
    Frame,
    /// A histogram is compared with the model, once in every step of their fit.
    Histogram,
}

/// Evaluates a series. Calls `done` with each unit of its work; an error of it ends the evaluation. Points are read in parallel, gain by
/// gain; the result does not depend on the number of threads.
pub fn characterize(
    captures: &Captures,
    options: &Options,
    done: &(dyn Fn(Done) -> Result<(), Cancelled> + Sync),
) -> Result<Characterization, CaptureError> {
    let read = &|| done(Done::Frame);
    let size = frame_size(captures)?;
    let max_dn = (1 << captures.sensor.bits) - 1;
    let (mut gains, mut flags, mut histograms) = (Vec::new(), Vec::new(), Vec::new());
    let mut known: HashMap<u64, &FrameFile> = HashMap::new();
    let mut samples = Samples::default();

    // For each gain: reduce the frames, flag the points, fit the lines.
    for linear_gain in captures.gains() {
        let points: Vec<&Point> = captures.points.iter().filter(|p| p.linear_gain == linear_gain).collect();
        let ends = dark_ends(&points);
        let found = reduced_points(captures, &points, ends, size, read)?;
        let reduced = flagged(captures, &points, found);
        for p in &reduced {
            no_copies(captures, p.point, &p.found, &mut known)?;
        }

        // Find the digital number at which the converter clips at this gain.
        let flats = reduced.iter().filter(|p| p.point.kind == Kind::Flat);
        let clip_dn = clip_dn(flats.flat_map(|p| p.found.colours.iter().map(|(_, m)| m)), max_dn);
        reduced.iter().for_each(|p| samples.add(p.point.kind, &p.found.all));
        samples.clips_at(clip_dn, max_dn);

        let reduced_end = |end: &Point| reduced.iter().find(|p| std::ptr::eq(p.point, end));
        let ends = ends.map(|end| end.and_then(reduced_end));
        let (gain, gain_flags) = evaluate_gain(captures, options, linear_gain, &reduced, ends, clip_dn);
        for p in reduced.iter().filter(|p| !p.point.is_stack()) {
            let number = histograms.last().map_or(0, |h: &PointHistogram| h.point + 1);
            histograms.extend(captured(captures, number, p.point, &p.found, &gain));
        }
        gains.push(gain);
        flags.push(gain_flags);
    }
    if let Some(StuckBit { bit, is_one }) = samples.stuck_bit(max_dn) {
        return Err(CaptureError::StuckBit { list: captures.list.clone(), bit, is_one });
    }
    check_usable(captures, &gains, &flags)?;

    // Fit all gains together, then the histograms.
    // A filter over time is a setting of the camera: gains without a stack cannot show it.
    let is_filtered = |gain: &GainResult| {
        let mut shared = gain.channels.iter().filter_map(|channel| channel.transfer.shared_noise);
        shared.any(|shared| shared.between_frames != 0.0 && shared.is_far())
    };
    let is_filtered = gains.iter().any(is_filtered);
    let inputs: Vec<GainInput<'_>> = gains.iter().map(|gain| input(captures, gain, is_filtered)).collect();
    let lowest = captures.gains().first().and_then(|gain| captures.black_level_dn(*gain));
    let joint = joint_fit(&inputs, lowest);
    let compared = &|| done(Done::Histogram);
    let fitted =
        options.fit_histograms.then(|| fit_histograms(&captures.sensor, &joint, &histograms, compared));
    let histogram_fit = fitted.transpose()?;

    // Make the warnings from flags and results; no code reads them.
    let of_gain = |(gain, flags): (&GainResult, &GainFlags)| gain_warnings(gain, flags);
    let mut warnings: Vec<_> = gains.iter().zip(&flags).flat_map(of_gain).collect();
    warnings.extend(series_warnings(&captures.sensor, &samples.flags(max_dn), &gains, &joint, &histograms));
    warnings.extend(histogram_fit.iter().flat_map(|fit| fit_warnings(fit.as_ref(), &joint)));
    let mut found = Characterization {
        sensor: captures.sensor.clone(),
        height: size.0,
        width: size.1,
        options: *options,
        warnings,
        gains,
        joint,
        histogram_fit: histogram_fit.flatten(),
        histograms,
    };
    found.warnings.extend(departures(&fits(&found)));
    Ok(found)
}

/// Reduces the points of one gain. Those that show its defect pixels come first, so that the others are reduced without these.
fn reduced_points(
    captures: &Captures,
    points: &[&Point],
    ends: [Option<&Point>; 2],
    size: (usize, usize),
    read: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<Vec<(Kind, PointStatistics)>, CaptureError> {
    let shown = flat_and_dark(points);
    let kept: Vec<&Point> = ends.into_iter().flatten().chain(shown.into_iter().flatten()).collect();
    let is_kept = |point: &Point| kept.iter().any(|kept| std::ptr::eq(*kept, point));
    let reduce_if = |is_now: &(dyn Fn(&Point) -> bool + Sync), defects: &[usize]| {
        let of = |(i, point): (usize, &&Point)| {
            is_now(point).then(|| Ok((i, reduce(captures, point, size, is_kept(point), defects, read)?)))
        };
        points.par_iter().enumerate().filter_map(of).collect::<Result<Vec<_>, CaptureError>>()
    };
    let mut found = reduce_if(&is_kept, &[])?;
    let at = |wanted: &Point| {
        let here = found.iter().find(|(i, _)| std::ptr::eq(points[*i], wanted));
        here.map(|(_, statistics)| statistics)
    };
    let of_shown = shown.and_then(|[flat, dark]| Some([at(flat)?, at(dark)?]));
    let ends = ends.map(|end| end.and_then(at));
    let defects = of_shown.map(|shown| dark_defects(shown, ends, &captures.sensor.cfa)).unwrap_or_default();
    found.iter_mut().for_each(|(_, statistics)| statistics.leave_out(&defects));
    found.extend(reduce_if(&|point| !is_kept(point), &defects)?);
    found.sort_by_key(|(i, _)| *i);
    Ok(found.into_iter().map(|(i, statistics)| (points[i].kind, statistics)).collect())
}

/// The points of one gain with their flags, and with the standard errors that the noise of rows and columns of all of them leaves.
fn flagged<'a>(
    captures: &Captures,
    points: &[&'a Point],
    mut found: Vec<(Kind, PointStatistics)>,
) -> Vec<FlaggedPoint<'a>> {
    // Look for flicker and movement beyond the noise of the lines of all points, ...
    let block_lines = block_lines_dn2(&found);
    let darks: Vec<&Moments> =
        found.iter().filter(|(kind, _)| *kind == Kind::Dark).map(|(_, f)| &f.all).collect();
    let models = models_of(&darks);
    found.iter_mut().for_each(|(_, found)| found.set_lines(&models));
    let points = points.iter().copied().zip(found).map(|(point, (_, found))| {
        let flags = FrameFlags::of(captures, point, &found, block_lines);
        FlaggedPoint { point, found, flags }
    });
    let mut points: Vec<FlaggedPoint<'_>> = points.collect();
    // ... and take this noise from the usable points alone.
    let models = line_models(&points);
    points.iter_mut().for_each(|p| p.found.set_lines(&models));
    points
}

/// Returns an error that names both frames if a frame is a copy of another: it has no noise of its own.
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
            let message = format!(
                "the frame {} is a copy of {}: every pixel has the same digital number",
                name(frame),
                name(first)
            );
            let error = FileError::at_line(point.line, "", message)
                .hint("noise is measured from frames that were exposed one after the other");
            return Err(CaptureError::List(InFile::at(&captures.list)(error)));
        }
    }
    Ok(())
}

/// Rows and columns of the list, or else of the first frame.
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

/// The histograms of a point: one of all pixels for dark frames, one of each colour for flat frames.
fn captured(
    captures: &Captures,
    number: usize,
    point: &Point,
    found: &PointStatistics,
    gain: &GainResult,
) -> Vec<PointHistogram> {
    // Beyond the last point of the transfer range the sensor saturates.
    let in_range = |colour: Option<Colour>, mean_dn: f64| {
        let channel = gain.channels.iter().find(|c| Some(c.colour) == colour);
        let last = channel.and_then(|c| c.points.get(c.transfer.range.1));
        last.is_none_or(|last| mean_dn <= last.mean_dn)
    };
    let of = |colour, moments: &Moments| PointHistogram {
        point: number,
        kind: point.kind,
        linear_gain: point.linear_gain,
        exposure_s: point.exposure_s,
        photons: point.photons,
        black_shift_dn: captures.black_shift_dn(point.linear_gain),
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

/// The input of one gain to the joint fit; without K if the frames are filtered over time.
fn input<'a>(captures: &Captures, gain: &'a GainResult, is_filtered: bool) -> GainInput<'a> {
    let of_filtered = is_filtered.then_some(Measured::none(Unresolved::SharedNoise));
    GainInput {
        linear_gain: gain.linear_gain,
        black_shift_dn: captures.black_shift_dn(gain.linear_gain),
        gains: gain
            .channels
            .iter()
            .map(|c| (of_filtered.unwrap_or(c.transfer.gain_dn_per_e), c.transfer.gain_test.model_error))
            .collect(),
        dark: &gain.dark,
        line_noise: gain.line_noise,
        pixels: gain.pixel_dark_currents.as_ref().ok_or(Unresolved::TooFewExposures { got: 1, need: 2 }),
        points: gain.channels.iter().map(|c| (c.colour, &c.points[..c.transfer.used])).collect(),
    }
}
