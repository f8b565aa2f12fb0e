//! One linear gain: selects its points by their flags and evaluates them colour by colour.

use super::captures::{Captures, Kind, Point};
use super::compressed::{growing_steps, level_step_dn, step_variance_dn2};
use super::counts::Counts;
use super::dark::{DarkPoint, dark_series};
use super::figures::{Basis, figures};
use super::flags::{FlaggedPoint, FlatFlags, GainFlags, LeftOutFlats, Signal, StackFlags, StackUse};
use super::gain_lines::dark_line_noise;
use super::hot_pixels::of_dark_ends;
use super::line_noise::LineNoise;
use super::measured::{Measured, Unresolved};
use super::point::{Moments, PointStatistics};
use super::result::{ChannelResult, GainResult, Options};
use super::rounding::Steps;
use super::shared_noise::{NeighbourNoise, SharedNoise};
use super::spatial::{Stacks, spatial};
use super::tile_levels::tile_levels_dn;
use super::transfer::photon_transfer;
use super::transfer_point::{Rules, TransferPoint};
use petzval_camera::sensor::Colour;

/// Evaluates the points of one gain. `dark_ends` are the points of the shortest and the longest dark exposure; the
/// converter clips at `clip_dn`.
pub fn evaluate_gain(
    captures: &Captures,
    options: &Options,
    linear_gain: f64,
    points: &[FlaggedPoint<'_>],
    dark_ends: [Option<&FlaggedPoint<'_>>; 2],
    clip_dn: u32,
) -> (GainResult, GainFlags) {
    // Select the points with unbiased mean and noise; sort the flat ones by ascending light.
    let mut flats = temporal(points, Kind::Flat);
    flats.sort_by(by_light);
    let left_out = LeftOutFlats::of(flats.iter().map(|p| &p.flags));
    flats.retain(|p| p.flags.is_usable());
    let mut darks = temporal(points, Kind::Dark);
    darks.retain(|p| p.flags.is_usable());

    // Fit mean and variance of the dark frames over exposure time, without pixels that answer neither light nor time.
    let mean_difference = options.mean_difference;
    let step_dn = dark_step_dn(&darks);
    let dark_point = |p: &&FlaggedPoint<'_>| {
        DarkPoint::new(p.point.exposure_s, &p.found.all, mean_difference, step_dn).without(p.found.left_out)
    };
    let dark = dark_series(darks.iter().map(dark_point).collect());
    let shortest = darks.iter().min_by(|a, b| a.point.exposure_s.total_cmp(&b.point.exposure_s));
    let dark_defects = shortest.map(|p| p.found.left_out).unwrap_or_default();
    let line_noise = mean_line_noise(&darks, step_dn);
    let cfa = captures.sensor.cfa.to_string();
    let of_shortest = dark_ends[0].and_then(|end| end.found.stack.as_ref());
    let tile_levels_dn = of_shortest.and_then(|stack| tile_levels_dn(stack, &captures.sensor.cfa));

    // Pair each flat point with the dark point of its exposure time, and leave out points without signal.
    let dark_of = |flat: &FlaggedPoint<'_>| darks.iter().find(|d| d.point.has_time_of(flat.point)).copied();
    let (mut pairs, mut flat_flags) = (Vec::new(), Vec::new());
    for flat in flats {
        let dark = dark_of(flat);
        let signal = signal(flat, dark);
        if let (Signal::Above, Some(dark)) = (signal, dark) {
            pairs.push(Pair { point: flat.point, flat: &flat.found, dark: &dark.found });
        }
        let (label, line) = (flat.flags.label.clone(), flat.point.line);
        flat_flags.push(FlatFlags { label, line, signal, is_saturated: false, is_darker: false });
    }

    // Find the hot pixels. Evaluate each colour: photon transfer, non-uniformity, figures.
    let max_dn = f64::from((1u32 << captures.sensor.bits) - 1);
    let bulk_point = |p: &&FlaggedPoint<'_>| dark_point(p).of_bulk(&p.found.all);
    let bulk = dark_series(darks.iter().map(bulk_point).collect());
    let pixel_dark_currents = of_dark_ends(dark_ends, max_dn, &bulk);
    let of_pixels = pixel_dark_currents.as_ref();
    let hot = of_pixels.map_or(&[][..], |of| &of.outlier_pixels);
    let bright = of_pixels.map_or(&[][..], |of| &of.bright_pixels);
    let (stacks, stack_flags) = stacks(points, hot, bright);
    let is_usable_stack =
        |p: &&FlaggedPoint<'_>| p.point.kind == Kind::Flat && p.point.is_stack() && p.flags.is_usable();
    let flat_stack = points
        .iter()
        .filter(is_usable_stack)
        .find_map(|flat| Some(Pair { point: flat.point, flat: &flat.found, dark: &dark_of(flat)?.found }));
    let selected = Selected { pairs, darks, step_dn, stacks, flat_stack };
    let channels: Vec<ChannelResult> = captures
        .sensor
        .cfa
        .colours()
        .into_iter()
        .filter_map(|colour| channel(captures, options, colour, &selected, clip_dn))
        .collect();
    // What a filter takes from the noise of pixels passes for noise of rows and columns.
    let is_filtered = |c: &ChannelResult| c.transfer.shared_noise.is_some_and(|shared| shared.is_spatial());
    let line_noise = if channels.iter().any(is_filtered) {
        let none = Measured::none(Unresolved::SharedNoise);
        LineNoise { row_dn2: none, column_dn2: none, pixel_dn2: none }
    } else {
        line_noise
    };

    // Flag the points that the photon transfer found saturated, or darker than a point with less light.
    let lit = flat_flags.iter_mut().filter(|flat| flat.signal == Signal::Above);
    for (i, flat) in lit.enumerate() {
        flat.is_saturated = channels.iter().any(|c| is_saturated(c, i));
        flat.is_darker = i > 0 && channels.iter().any(|c| is_darker(c, i));
    }
    let frames = points.iter().map(|p| p.flags.clone()).collect();
    (
        GainResult { linear_gain, dark, line_noise, pixel_dark_currents, channels },
        GainFlags {
            frames,
            flats: flat_flags,
            stacks: stack_flags,
            left_out,
            dark_defects,
            cfa,
            tile_levels_dn,
        },
    )
}

/// Distance of the digital numbers in the dark frames of a gain, DN.
fn dark_step_dn(darks: &[&FlaggedPoint<'_>]) -> f64 {
    let all = darks.iter().fold(Counts::default(), |all, p| all.merge(&p.found.all.histogram));
    level_step_dn(&all)
}

/// Temporal noise of rows, columns and pixels over all dark frames of a gain. The errors of rows and columns contain that of rounding, which
/// all points have in common.
fn mean_line_noise(darks: &[&FlaggedPoint<'_>], step_dn: f64) -> LineNoise {
    let moments: Vec<&Moments> = darks.iter().map(|p| &p.found.all).collect();
    let found = dark_line_noise(&moments);
    let steps = Steps::behind(found.pixel_dn2.value().unwrap_or(0.0), step_dn);
    let with_rounding = |lines: Measured| match (lines.value(), lines.standard_error()) {
        (Some(found), Some(error)) => lines.with_error(steps.error_of_variance(found, error)),
        _ => lines,
    };
    LineNoise { row_dn2: with_rounding(found.row_dn2), column_dn2: with_rounding(found.column_dn2), ..found }
}

/// Points for the photon transfer: pairs, and stacks if there is no pair of their setting.
fn temporal<'p, 'a>(points: &'p [FlaggedPoint<'a>], kind: Kind) -> Vec<&'p FlaggedPoint<'a>> {
    let setting = |p: &Point| (p.exposure_s, p.photons);
    let of_kind = || points.iter().filter(move |p| p.point.kind == kind);
    let has_pair = |p: &Point| of_kind().any(|q| !q.point.is_stack() && setting(q.point) == setting(p));
    of_kind().filter(|p| !p.point.is_stack() || !has_pair(p.point)).collect()
}

/// Orders points by light: photons, else exposure time, else the mean of the frames.
fn by_light(a: &&FlaggedPoint<'_>, b: &&FlaggedPoint<'_>) -> std::cmp::Ordering {
    let light = |p: &Point| p.photons.unwrap_or(p.exposure_s);
    let by_time = a.point.exposure_s.total_cmp(&b.point.exposure_s);
    let by_light = light(a.point).total_cmp(&light(b.point)).then(by_time);
    by_light.then(a.found.all.mean_dn.total_cmp(&b.found.all.mean_dn))
}

/// Signal of a flat point above the dark frames of its exposure time.
fn signal(flat: &FlaggedPoint<'_>, dark: Option<&FlaggedPoint<'_>>) -> Signal {
    let Some(dark) = dark else { return Signal::NoDark };
    let (flat, dark) = (&flat.found.all, &dark.found.all);
    if flat.mean_dn <= dark.mean_dn {
        Signal::None {
            signal_dn: flat.mean_dn - dark.mean_dn,
            standard_error_dn: flat.mean_se_dn.hypot(dark.mean_se_dn),
        }
    } else {
        Signal::Above
    }
}

/// Whether a point is clipped in a colour, or beyond the peak of its noise.
fn is_saturated(channel: &ChannelResult, point: usize) -> bool {
    channel.transfer.is_beyond_saturation(point) || channel.points[point].is_clipped()
}

/// Whether a point is darker than the one before it, which has less light. Below saturation the difference must exceed
/// noise. On the plateau beyond it must exceed a twentieth, because the subtracted dark signal still grows there.
fn is_darker(channel: &ChannelResult, point: usize) -> bool {
    let (before, own) = (&channel.points[point - 1], &channel.points[point]);
    let (low, high) = (before.signal_dn(), own.signal_dn());
    if channel.transfer.is_beyond_saturation(point) {
        high < 0.95 * low
    } else {
        high < low - 6.0 * before.signal_se_dn().hypot(own.signal_se_dn())
    }
}

/// Flat frames with the dark frames of the same exposure time.
struct Pair<'a> {
    point: &'a Point,
    flat: &'a PointStatistics,
    dark: &'a PointStatistics,
}

/// The first flat stack with a dark stack of its exposure time, and the use of each flat stack.
fn stacks<'p>(
    points: &'p [FlaggedPoint<'_>],
    hot_pixels: &'p [usize],
    bright_pixels: &'p [usize],
) -> (Option<Stacks<'p>>, Vec<StackFlags>) {
    let (mut chosen, mut flags) = (None, Vec::new());
    let of_kind = |kind| points.iter().filter(move |p| p.point.kind == kind && p.point.is_stack());
    for flat_point in of_kind(Kind::Flat) {
        let flat = &flat_point.found;
        let exposure_s = flat_point.point.exposure_s;
        let dark = of_kind(Kind::Dark).find(|p| p.point.exposure_s == exposure_s).map(|p| &p.found);
        let stack_use = match (dark, &chosen) {
            (None, _) => StackUse::NoDarkStack,
            (Some(_), Some(_)) => StackUse::Surplus,
            (Some(dark), None) => {
                chosen = Some(Stacks { flat, dark, exposure_s, hot_pixels, bright_pixels });
                StackUse::Evaluated
            }
        };
        flags.push(StackFlags { label: flat_point.flags.label.clone(), stack_use });
    }
    (chosen, flags)
}

/// The points of a gain that are evaluated.
struct Selected<'a> {
    /// Light ascending.
    pairs: Vec<Pair<'a>>,
    /// Usable dark points of any exposure time.
    darks: Vec<&'a FlaggedPoint<'a>>,
    /// Distance of the digital numbers in them, DN.
    step_dn: f64,
    /// The stacks of the non-uniformity.
    stacks: Option<Stacks<'a>>,
    /// A flat stack in which nothing moves, with the dark frames of its exposure time.
    flat_stack: Option<Pair<'a>>,
}

/// The digital numbers of all pairs of points.
fn all_counts(colour: Colour, selected: &Selected<'_>) -> Counts {
    let points = selected.pairs.iter().flat_map(|pair| [pair.flat, pair.dark]);
    let of_colour = points.filter_map(|point| point.colour(colour));
    of_colour.fold(Counts::default(), |all, moments| all.merge(&moments.histogram))
}

/// Noise that pixels or frames of one colour share. Of the points within the photon transfer, and of the stack, those count whose noise is mostly
/// that of light: the readout of one pixel may leave noise in the next exposure.
fn shared_noise(
    colour: Colour,
    selected: &Selected<'_>,
    points: &[TransferPoint],
    used: usize,
) -> Option<SharedNoise> {
    let is_light = |variance_dn2: f64, dark_dn2: f64| variance_dn2 > 2.0 * dark_dn2;
    let of_point = |(pair, point): (&Pair<'_>, &TransferPoint)| {
        let is_lit = is_light(point.variance_dn2, point.dark_variance_dn2);
        pair.flat.colour(colour).filter(|_| is_lit).map(|moments| moments.neighbours)
    };
    let neighbours = selected.pairs.iter().zip(&points[..used]).filter_map(of_point);
    let between_frames = selected.flat_stack.as_ref().and_then(|stack| {
        let (flat, dark) = (stack.flat.colour(colour)?, stack.dark.colour(colour)?);
        flat.between_frames.filter(|_| is_light(flat.variance_dn2, dark.variance_dn2))
    });
    SharedNoise::of(NeighbourNoise::pooled(neighbours), between_frames)
}

/// Evaluates one colour; `None` if it has no points.
fn channel(
    captures: &Captures,
    options: &Options,
    colour: Colour,
    selected: &Selected<'_>,
    clip_dn: u32,
) -> Option<ChannelResult> {
    let mean_difference = options.mean_difference;

    // Photon transfer, by our rules and by those of the library.
    let transfer_point = |pair: &Pair<'_>| {
        let (flat, dark) = (pair.flat.colour(colour)?, pair.dark.colour(colour)?);
        let (exposure_s, photons) = (pair.point.exposure_s, pair.point.photons);
        let step_dn = selected.step_dn;
        Some(TransferPoint::new(exposure_s, photons, flat, dark, mean_difference, clip_dn, step_dn))
    };
    let points: Vec<TransferPoint> = selected.pairs.iter().filter_map(transfer_point).collect();
    let mut transfer = photon_transfer(&points, Rules::Ours)?;
    if let Some(steps) = growing_steps(&all_counts(colour, selected)) {
        let variance =
            |of: &PointStatistics| of.colour(colour).map_or(0.0, |m| step_variance_dn2(&m.histogram));
        let added = selected.pairs.iter().map(|pair| variance(pair.flat) - variance(pair.dark));
        let used = transfer.used;
        transfer = transfer.with_steps(steps, &points[..used], &added.take(used).collect::<Vec<f64>>());
    }
    if let Some(shared) = shared_noise(colour, selected, &points, transfer.used) {
        transfer = transfer.with_shared_noise(shared);
    }
    let as_they_are = points.iter().map(|point| TransferPoint { row_flicker_dn2: 0.0, ..point.clone() });
    let library_transfer = photon_transfer(&as_they_are.collect::<Vec<_>>(), Rules::Library)?;

    // Non-uniformity from the stacks.
    let stacks = selected.stacks.as_ref();
    let spatial = stacks.and_then(|s| spatial(s, &captures.sensor.cfa, colour, options.high_pass));

    // Figures, with the dark series of this colour's pixels.
    let dark_point = |p: &&FlaggedPoint<'_>| {
        Some(DarkPoint::new(p.point.exposure_s, p.found.colour(colour)?, mean_difference, selected.step_dn))
    };
    let dark = dark_series(selected.darks.iter().filter_map(dark_point).collect());
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
