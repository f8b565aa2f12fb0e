//! Raw files as an ISP takes them: the frame, with the calibration that its file, its sidecar and the sensor give, the first of them first.

use std::path::Path;

use petzval_camera::develop::dark_mean_dn;
use petzval_camera::isp::{
    BalanceGains, BalanceOptions, ExposureOptions, FrameData, MergeOptions, Merged, Motion, NoiseProfile,
    RawInput, RgbPicture, Statistics, auto_balance, finished_exposure_ev, merge_exposures,
};
use petzval_camera::sensor::{CfaPattern, Colour, Exposure, SensorModel};
use petzval_design::library::Library;
use petzval_files::raw_file::{
    FrameCalibration, RawFileError, RawFrame, RawInfo, load_any_raw, sidecar_path, stated_info,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::input::SensorInput;
use crate::named_isp::{NamedIsp, about_frame};
use crate::noted::Noted;
use crate::pile::{doubtful_pile, pile_below};
use crate::pixels::check_numbers;

/// Largest digital number of white.
const MOST_WHITE_DN: f64 = 1e8;

/// Least digital numbers from black to white to which automatic exposure amplifies.
const LEAST_RANGE_DN: f64 = 2.0;

/// Exposure that automatic exposure may miss without a warning, stops.
const MISSED_EV: f64 = 0.1;

/// What raw files leave open.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FrameOptions {
    /// Sensor: a built-in name, the path of a file, or the sensor itself; none means the built-in sensor that the sidecar names, if any. What
    /// the calibration of a frame states counts before it.
    pub sensor: Option<SensorInput>,
    /// Digital number of white light in a green pixel; none means that of the calibration, else the level of saturation. Of merged frames it counts
    /// in numbers of the longest exposure, and the level of saturation is that of the merged frame, where the shortest exposure ends.
    pub white_dn: Option<f64>,
    /// Whether to estimate the white balance from the frame.
    pub auto_balance: bool,
    /// Whether to estimate from the frame what is white.
    pub auto_exposure: bool,
}

/// Noise of a frame whose sensor is unknown: 10,000 electrons of white, 4 electrons of read noise.
const UNKNOWN_NOISE: NoiseProfile = NoiseProfile { shot: 1e-4, read: 1.6e-7 };

/// Exposure time of a frame that states none, s.
const USUAL_TIME_S: f64 = 0.005;

/// How far below the black level a pixel is no noise: standard deviations in the dark, and at least this share of the range to white.
const BLACK_SIGMAS: f64 = 6.0;
const BLACK_MARGIN: f64 = 0.01;

/// Share of such pixels, beyond which they are no defects.
const BLACK_SHARE: f64 = 0.01;

/// Distance from a whole number below which a difference of black levels is whole, DN: levels are decimals.
const WHOLE_DN: f64 = 1e-6;

/// Difference of two black levels that is reported, as a share of the range to saturation.
const BLACK_DIFFERENCE: f64 = 0.0025;

/// Ratio of the answers of two colours to white from which a highlight is coloured that ends at one number in both.
const COLOURED: f64 = 1.05;

/// Nodes along a side from which a mesh of shading is fine enough for straight lines between them.
const FINE_NODES: usize = 33;

/// Difference of a smooth curve from straight lines between nodes that is reported.
const COARSE: f64 = 0.01;

/// Ratio of two exposures, given and stated, over one another, from which they contradict each other. Light that flickers and shutters change
/// exposures by less.
const LARGEST_CONTRADICTION: f64 = 1.2;

/// Several raw files as one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Merge {
    /// Relative exposures, products of time and gain, one for each file; none takes them from the sidecars.
    pub exposures: Option<Vec<f64>>,
    /// Leave out the check for motion.
    pub no_motion_check: bool,
}

/// A raw frame in memory.
#[derive(Clone, Copy, Debug)]
pub struct RawInMemory<'a> {
    /// What its picture and errors call it.
    pub name: &'a str,
    /// Digital numbers, row by row, with what is known of camera and exposure: bits and colour filters at least.
    pub frame: &'a RawFrame<u32>,
    /// What an ISP may know of it; no file is read for it, also if the frame names one.
    pub calibration: Option<&'a FrameCalibration>,
}

/// Where a raw frame is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Source<'a> {
    File(&'a Path),
    Memory(RawInMemory<'a>),
}

impl<'a> Source<'a> {
    /// Its file, or its name as one.
    pub(super) fn path(&self) -> &'a Path {
        match self {
            Self::File(path) => path,
            Self::Memory(raw) => Path::new(raw.name),
        }
    }

    fn frame(&self) -> Result<RawFrame<u32>> {
        match self {
            Self::File(path) => Ok(load_any_raw(path)?),
            Self::Memory(raw) => Ok(raw.frame.clone()),
        }
    }

    /// Its calibration: that in memory, or the file that its sidecar names.
    fn calibration(&self, info: &RawInfo) -> Result<FrameCalibration> {
        match (self, &info.calibration) {
            (Self::File(path), Some(name)) => calibration(path, name),
            (Self::File(_), None) => Ok(FrameCalibration::default()),
            (Self::Memory(raw), _) => Ok(raw.calibration.cloned().unwrap_or_default()),
        }
    }

    /// What is stated of a file whose numbers are not read yet, where that can be known.
    fn stated(&self) -> Result<Option<RawInfo>> {
        match self {
            Self::File(path) => Ok(stated_info(path)?),
            Self::Memory(_) => Ok(None),
        }
    }

    /// Bits and mosaic of a frame. Fails with all keys that are missing; a sensor or a calibration may give the black level.
    fn needed(&self, info: &RawInfo, options: &FrameOptions) -> Result<(u32, CfaPattern)> {
        let has_sensor = info.sensor.is_some() || options.sensor.is_some();
        let is_black_known = info.black_level_dn.is_some() || has_sensor || self.has_calibration(info);
        if let (Some(bits), Some(cfa), true) = (info.bits, info.cfa, is_black_known) {
            return Ok((bits, cfa));
        }
        let keys =
            [("bits", info.bits.is_none()), ("cfa", info.cfa.is_none()), ("black_level_dn", !is_black_known)];
        Err(self.missing(&keys.iter().filter(|(_, is)| *is).map(|(key, _)| *key).collect::<Vec<_>>()))
    }

    /// The error where neither the frame nor its sidecar states these keys.
    fn missing(&self, keys: &[&str]) -> JobError {
        let path = self.path().display();
        let named: Vec<String> = keys.iter().map(|key| format!("`{key}`")).collect();
        let named = named.join(", ");
        let example = |key: &&str| match *key {
            "bits" => "bits = 12",
            "cfa" => "cfa = \"RGGB\"",
            _ => "black_level_dn = 64",
        };
        match self {
            Self::File(_) => JobError::input(
                format!("{path}: neither the file nor its sidecar gives {named}"),
                format!(
                    "add lines such as these to {path}.toml: {}",
                    keys.iter().map(example).collect::<Vec<_>>().join(", ")
                ),
            ),
            Self::Memory(_) => {
                JobError::input(format!("{path}: its `info` does not give {named}"), format!("give {named}"))
            }
        }
    }

    /// Whether it has a calibration, in memory or by name.
    fn has_calibration(&self, info: &RawInfo) -> bool {
        match self {
            Self::File(_) => info.calibration.is_some(),
            Self::Memory(raw) => raw.calibration.is_some(),
        }
    }
}

/// Reads a raw file as an ISP takes it.
pub fn read_frame(path: &Path, options: &FrameOptions, context: &Context) -> Result<RawInput> {
    let noted = noted_frames(context);
    Ok(read_one(Source::File(path), options, &noted)?.unturned(path, &noted))
}

/// A raw frame in memory as an ISP takes it.
pub fn frame_in_memory(raw: RawInMemory<'_>, options: &FrameOptions, context: &Context) -> Result<RawInput> {
    check_numbers(raw.frame, raw.name)?;
    let noted = noted_frames(context);
    Ok(read_one(Source::Memory(raw), options, &noted)?.unturned(Path::new(raw.name), &noted))
}

/// What an ISP knows of frames like one in memory, without their numbers: no level is estimated from these.
pub fn frames_like(raw: RawInMemory<'_>, options: &FrameOptions, context: &Context) -> Result<RawInput> {
    let frame = RawFrame { height: 0, width: 0, dn: Vec::new(), info: raw.frame.info.clone() };
    let source = Source::Memory(RawInMemory { frame: &frame, ..raw });
    Ok(read_exposure(source, options, &noted_frames(context))?.frame)
}

/// Collects what is said of raw frames.
pub(super) fn noted_frames(context: &Context) -> Noted<'_> {
    Noted::new(context, "frame")
}

/// A raw frame as an ISP takes it, and how the picture that the ISP makes is turned.
#[derive(Debug)]
pub(super) struct Frame {
    pub input: RawInput,
    /// Orientation as EXIF numbers it, 1 to 8, if the file or its sidecar states it.
    pub orientation: Option<u8>,
}

impl Frame {
    /// The picture of the ISP, turned.
    pub fn turned(&self, picture: RgbPicture) -> RgbPicture {
        picture.turned(self.orientation.unwrap_or(1))
    }

    /// Rows and columns of the turned picture.
    pub fn turned_size(&self) -> (usize, usize) {
        let RawInput { height, width, .. } = self.input;
        if self.orientation.is_some_and(|exif| exif > 4) { (width, height) } else { (height, width) }
    }

    /// Notes that the picture is turned.
    pub fn note_turn(&self, path: &Path, noted: &Noted<'_>) {
        if let Some((exif, turn)) = self.turn() {
            noted.note(
                path.display(),
                format!("its orientation is {exif}: the picture is {turn}; `orientation = 1` in the sidecar keeps it as stored"),
            );
        }
    }

    /// The frame alone, for those who make pictures of it themselves. Warns if these should be turned.
    fn unturned(self, path: &Path, noted: &Noted<'_>) -> RawInput {
        if let Some((exif, turn)) = self.turn() {
            noted.warning(
                path.display(),
                WarningKind::RawFrame,
                format!("its orientation is {exif}, and the frame is as it is stored: its picture should be {turn}"),
            );
        }
        self.input
    }

    /// The orientation, if it turns the picture, and what it does.
    fn turn(&self) -> Option<(u8, &'static str)> {
        let exif = self.orientation?;
        let turn = match exif {
            2 => "mirrored from left to right",
            3 => "turned by half a turn",
            4 => "mirrored from top to bottom",
            5 => "mirrored along its diagonal",
            6 => "turned by a quarter clockwise",
            7 => "mirrored across its diagonal",
            8 => "turned by a quarter anticlockwise",
            _ => return None,
        };
        Some((exif, turn))
    }
}

/// Reads a raw frame.
pub(super) fn read_one(source: Source<'_>, options: &FrameOptions, noted: &Noted<'_>) -> Result<Frame> {
    let Exposed { mut frame, orientation, .. } = read_exposure(source, options, noted)?;
    estimate(&mut frame, options, source.path(), noted).map_err(about_frame(source.path()))?;
    Ok(Frame { input: frame, orientation })
}

/// Reads raw frames of one scene at several exposures, and merges them. The picture is turned as that of the first.
pub(super) fn read_merged(
    sources: &[Source<'_>],
    merge: &Merge,
    options: &FrameOptions,
    noted: &Noted<'_>,
) -> Result<Frame> {
    let (mut frames, mut known, mut have_white) = (Vec::new(), Vec::new(), Vec::new());
    let mut orientations = Vec::new();
    for source in sources {
        let Exposed { frame, exposure, has_white, orientation } = read_exposure(*source, options, noted)?;
        orientations.push(orientation);
        frames.push(frame);
        known.push(exposure);
        have_white.push(has_white);
    }
    let stated: Option<Vec<f64>> = known.iter().copied().collect();
    let exposures = merge.exposures.clone().or(stated).ok_or_else(|| {
        let message = "a raw file without `exposure_s`: its exposure is unknown";
        let hint = "give the relative exposures of all files, such as --exposures 16,4,1";
        JobError::setting("exposures", "", message, hint)
    })?;
    let merged =
        if merge.no_motion_check { MergeOptions { motion_sigmas: None } } else { MergeOptions::default() };
    let first = sources.first().map_or(Path::new(""), Source::path);
    let Merged { mut frame, motion } =
        merge_exposures(&frames, &exposures, &merged).map_err(about_frame(first))?;
    warn_of_exposures(sources, &exposures, &known, noted);
    warn_of_motion(motion, first, noted);
    // Black and white of a merged frame are those of its longest exposure, the first of several.
    let longest = (0..exposures.len()).rev().max_by(|a, b| exposures[*a].total_cmp(&exposures[*b]));
    if longest.is_none_or(|i| !have_white[i]) && !options.auto_exposure {
        white_at_saturation(&mut frame.about);
    }
    estimate(&mut frame, options, first, noted).map_err(about_frame(first))?;
    Ok(Frame { input: frame, orientation: orientations.first().copied().flatten() })
}

/// Makes the light white at which the strongest colour saturates, as in a single frame without a stated white.
fn white_at_saturation(about: &mut FrameData) {
    set_white(about, about.saturation * strongest(about.response));
}

/// Warns of exposures that are given and contradict those that two of the frames state.
fn warn_of_exposures(sources: &[Source<'_>], given: &[f64], known: &[Option<f64>], noted: &Noted<'_>) {
    let both = given.iter().zip(known).enumerate();
    let scales: Vec<(usize, f64)> = both
        .filter_map(|(i, (given, known))| Some((i, given / known.filter(|known| *known > 0.0)?)))
        .collect();
    let by_scale = |a: &&(usize, f64), b: &&(usize, f64)| a.1.total_cmp(&b.1);
    let (Some(least), Some(most)) = (scales.iter().min_by(by_scale), scales.iter().max_by(by_scale)) else {
        return;
    };
    if most.1 <= LARGEST_CONTRADICTION * least.1 {
        return;
    }
    let of_given = given[most.0] / given[least.0];
    noted.warning(sources[most.0].path().display(), WarningKind::RawFrame, format!(
        "--exposures gives it {} times the exposure of {}, and by `exposure_s` and `linear_gain` of the two frames it has {} times; \
         --exposures counts, and if it is wrong, so is the merged frame",
        rounded(of_given),
        sources[least.0].path().display(),
        rounded(of_given * least.1 / most.1)
    ));
}

/// A number to three digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Warns if so much of a merged frame was taken as motion that the exposures may be wrong.
fn warn_of_motion(motion: Motion, path: &Path, noted: &Noted<'_>) {
    if !motion.is_doubtful() {
        return;
    }
    let percent = |of: usize| 100.0 * motion.moved as f64 / of as f64;
    noted.warning(path.display(), WarningKind::RawFrame, format!(
        "{:.0} % of the merged frame was taken as motion, {:.0} % of what is brighter than the noise: the exposures of the files may be \
         wrong, or the camera moved; --exposures gives them",
        percent(motion.blocks),
        percent(motion.lit)
    ));
}

/// A raw frame, and what merging needs to know of it.
struct Exposed {
    frame: RawInput,
    /// Product of time in s and gain, if the time is known.
    exposure: Option<f64>,
    /// Whether the options or the calibration state its white; otherwise it is the level of saturation.
    has_white: bool,
    /// Orientation as EXIF numbers it, 1 to 8, if it is stated.
    orientation: Option<u8>,
}

/// Reads a raw frame.
fn read_exposure(source: Source<'_>, options: &FrameOptions, noted: &Noted<'_>) -> Result<Exposed> {
    // A large file is not decoded in vain.
    if let Some(stated) = source.stated()? {
        source.needed(&stated, options)?;
    }
    let (path, raw) = (source.path(), source.frame()?);
    let info = &raw.info;
    let (bits, cfa) = source.needed(info, options)?;
    let calibration = source.calibration(info)?;
    let sensor = sensor_of(info, options, &noted.context().assets)?;
    if sensor.is_none() {
        warn_of_assumed(&calibration, path, noted);
    } else if options.sensor.is_some() {
        note_what_counts(&calibration, path, noted);
    }
    let highest = (1_u32 << bits) - 1;
    let highest =
        f64::from(info.companding.as_ref().map_or(highest, |companding| companding.expand(highest)));
    let gain = info.linear_gain.unwrap_or(1.0);
    let (black_dn, black_tile) = match calibration.black_at(gain) {
        Some(levels) if info.companding.is_some() && levels.iter().any(|level| *level != levels[0]) => {
            let message = format!(
                "{}: its calibration has levels of the tile, and the frame is companded",
                path.display()
            );
            return Err(JobError::input(message, "give one level: that after the expansion"));
        }
        Some(levels) => tile_of(path, levels, cfa)?,
        None if calibration.black_dn.is_some() => (calibration.black_dn, None),
        None => (info.black_level_dn, info.black_tile_dn.clone()),
    };
    let black_dn = black_tile.as_deref().and_then(common_level).or(black_dn);
    // The dark of a sensor depends on gain and exposure time.
    let of_sensor = |sensor: &SensorModel| {
        let time_s = info.exposure_s.unwrap_or(USUAL_TIME_S) as f32;
        dark_mean_dn(sensor, &Exposure { white_e: 1.0, time_s, linear_gain: gain as f32 })
    };
    let dark_dn = sensor.as_ref().map(of_sensor);
    let black_dn = black_dn.or(dark_dn).ok_or_else(|| source.missing(&["black_level_dn"]))?;
    let stated_dn = info.white_level_dn.unwrap_or(highest);
    // A calibration that says where the frame saturates counts.
    let is_saturation_known = calibration.saturation.is_some();
    let full_dn = if is_saturation_known {
        stated_dn
    } else {
        saturated_dn(&raw.dn, raw.width, cfa, stated_dn, info, path, noted)
    };
    let has_white = options.white_dn.is_some() || calibration.white_dn.is_some();
    let white_dn = calibration.white_dn.unwrap_or(full_dn);
    if let Some(message) = wrong_white(white_dn, black_dn) {
        let (key, hint) = match calibration.white_dn {
            Some(_) => ("white_dn", "correct it in the calibration of the frame, or the black level"),
            None => ("white_level_dn", "correct it in the sidecar of the frame, or the black level"),
        };
        return Err(JobError::input(format!("{}: `{key} = {white_dn}`: {message}", path.display()), hint));
    }
    let range = white_dn - black_dn;
    if calibration.black_dn.is_some() || !calibration.black_at_gain.is_empty() {
        note_black(black_dn, dark_dn, full_dn, info, path, noted);
    }
    let saturation = |response: [f64; 3]| (full_dn - black_dn) / range / strongest(response);
    let about = match &sensor {
        Some(sensor) => {
            let green: f64 = sensor.response(Colour::Green).iter().sum();
            let exposure = Exposure {
                white_e: (range / (sensor.gain_dn_per_e * gain * green)) as f32,
                time_s: info.exposure_s.unwrap_or(USUAL_TIME_S) as f32,
                linear_gain: gain as f32,
            };
            let about = FrameData::of_sensor(sensor, &exposure)
                .map_err(|e| JobError::input(format!("{}: {e}", path.display()), ""))?;
            // The model of a sensor knows nothing of numbers that its converter does not make, or of pixels that pile up.
            let is_by_levels = info.companding.is_some() || bits > sensor.bits || full_dn < stated_dn;
            let saturation = match calibration.response {
                Some(response) => saturation(response),
                None if is_by_levels => saturation(about.response),
                // A frame may end below its sensor: by a stated level, or by fewer bits.
                None => about.saturation.min(saturation(about.response)),
            };
            FrameData { black_dn, white_dn, saturation, ..about }
        }
        None => FrameData {
            black_dn,
            white_dn,
            response: [1.0; 3],
            saturation: saturation(calibration.response.unwrap_or([1.0; 3])),
            noise: UNKNOWN_NOISE,
            gain_ev: info.linear_gain.map_or(0.0, f64::log2),
            colour_matrix: None,
            companding: None,
            shading: None,
            warp: None,
        },
    };
    let is_noise_known = sensor.is_some() || calibration.noise.is_some();
    let mut about = FrameData { companding: info.companding.clone(), ..calibration.over(about) };
    if let Some(white_dn) = options.white_dn {
        if let Some(message) = wrong_white(white_dn, black_dn) {
            let message = format!("{message} in {}", path.display());
            let hint = "give the digital number of a white surface in a green pixel";
            return Err(JobError::setting("white_dn", white_dn, message, hint));
        }
        let noise = about.noise;
        set_white(&mut about, (white_dn - black_dn) / range);
        about.white_dn = white_dn;
        if !is_noise_known {
            about.noise = noise;
        }
    }
    let exposure = info.exposure_s.map(|time_s| time_s * info.linear_gain.unwrap_or(1.0));
    smooth_shading(&mut about, path, noted);
    let is_linear = info.companding.is_none();
    let mut dn = raw.dn;
    if let Some(tile) = black_tile {
        level_black(&mut dn, raw.width, cfa, &tile, black_dn, full_dn);
    }
    if is_linear {
        warn_of_black(&dn, &about, path, noted);
    }
    let orientation = raw.info.orientation;
    let frame = RawInput { height: raw.height, width: raw.width, dn, bits: bits.max(8), cfa, about };
    if is_linear && !is_saturation_known {
        warn_of_doubtful_pile(&frame, path, noted);
    }
    Ok(Exposed { frame, exposure, has_white, orientation })
}

/// What is wrong with a white level, DN, beside a black level; `None` if it can be one.
fn wrong_white(white_dn: f64, black_dn: f64) -> Option<String> {
    if white_dn > MOST_WHITE_DN {
        Some(format!("above {MOST_WHITE_DN:e} DN"))
    } else if white_dn > black_dn + 1.0 {
        None
    } else {
        Some(format!("not above the black level of {black_dn} DN"))
    }
}

/// Warns of what is assumed of a frame whose sensor is unknown: what its calibration does not state.
fn warn_of_assumed(calibration: &FrameCalibration, path: &Path, noted: &Noted<'_>) {
    let open = [
        ("its noise", calibration.noise.is_none()),
        ("its answer to white light", calibration.response.is_none()),
    ];
    let open: Vec<&str> = open.iter().filter(|(_, is)| *is).map(|(what, _)| *what).collect();
    if !open.is_empty() {
        let verb = if open.len() == 1 { "is" } else { "are" };
        noted.warning(
            path.display(),
            WarningKind::RawFrame,
            format!("the sensor is unknown: {} {verb} assumed; --sensor names it", open.join(" and ")),
        );
    }
}

/// Says what the calibration of a frame states that a sensor by name has, too. The calibration was measured on this camera, and counts.
fn note_what_counts(calibration: &FrameCalibration, path: &Path, noted: &Noted<'_>) {
    let stated = [
        ("response", calibration.response.is_some()),
        ("saturation", calibration.saturation.is_some()),
        ("noise", calibration.noise.is_some()),
    ];
    let stated: Vec<&str> = stated.iter().filter(|(_, is)| *is).map(|(key, _)| *key).collect();
    if !stated.is_empty() {
        let text = format!(
            "its calibration counts before --sensor, in {}; remove what the sensor should give",
            stated.join(", ")
        );
        noted.note(path.display(), text);
    }
}

/// Says that the black level of a calibration counts where the sidecar states another. It may hold the dark current, which the sidecar leaves out: a
/// level near the dark of a known sensor is right.
fn note_black(
    black_dn: f64,
    dark_dn: Option<f64>,
    full_dn: f64,
    info: &RawInfo,
    path: &Path,
    noted: &Noted<'_>,
) {
    let Some(stated_dn) = info.black_level_dn else { return };
    let is_other = |level_dn: f64| (black_dn - level_dn).abs() > BLACK_DIFFERENCE * (full_dn - stated_dn);
    if is_other(stated_dn) && dark_dn.is_none_or(is_other) {
        noted.note(
            path.display(),
            format!(
                "its calibration has a black level of {} DN and counts before `black_level_dn = {stated_dn}` of the sidecar; correct the wrong one, \
                 unless dark current makes the difference",
                (100.0 * black_dn).round() / 100.0
            ),
        );
    }
}

/// The only black level, or those of the pixels of the mosaic's tile.
fn tile_of(path: &Path, levels: Vec<f64>, cfa: CfaPattern) -> Result<(Option<f64>, Option<Vec<f64>>)> {
    let pixels = cfa.rows() * cfa.cols();
    match levels.len() {
        1 => Ok((levels.first().copied(), None)),
        count if count == pixels => Ok((None, Some(levels))),
        count => Err(JobError::input(
            format!(
                "{}: its calibration has {count} black levels at a gain, and {cfa} has {pixels} pixels",
                path.display()
            ),
            "give one black level, or one for each pixel of the tile, row by row",
        )),
    }
}

/// The black level, DN, to which all pixels of a tile are moved; none of no level. Levels that differ by whole numbers have one near their mean
/// that differs from each by a whole number, so that no move is rounded. Otherwise it is their mean.
fn common_level(tile: &[f64]) -> Option<f64> {
    let first = tile.first()?;
    let mean = tile.iter().sum::<f64>() / tile.len() as f64;
    let is_whole = |dn: f64| (dn - dn.round()).abs() < WHOLE_DN;
    let is_exact = tile.iter().all(|level| is_whole(level - first));
    Some(if is_exact { first + (mean - first).round() } else { mean })
}

/// Moves the digital numbers of each pixel of the tile so that all of them have the same black level: exactly where the levels differ by whole
/// numbers, else to half a digital number. Saturated pixels stay as they are, and none becomes saturated or less than zero.
fn level_black(dn: &mut [u32], width: usize, cfa: CfaPattern, tile: &[f64], black_dn: f64, full_dn: f64) {
    let moves: Vec<i64> = tile.iter().map(|level| (black_dn - level).round() as i64).collect();
    for (row, line) in dn.chunks_exact_mut(width).enumerate() {
        for (col, dn) in line.iter_mut().enumerate() {
            let by = moves[row % cfa.rows() * cfa.cols() + col % cfa.cols()];
            if f64::from(*dn) < full_dn {
                *dn = (i64::from(*dn) + by).clamp(0, full_dn as i64) as u32;
            }
        }
    }
}

/// Warns of a black level above the light of many pixels: they would become black, and the shadows coloured.
fn warn_of_black(dn: &[u32], about: &FrameData, path: &Path, noted: &Noted<'_>) {
    let range_dn = about.white_dn - about.black_dn;
    let margin_dn = range_dn * (BLACK_SIGMAS * about.noise.read.max(0.0).sqrt()).max(BLACK_MARGIN);
    let below = dn.iter().filter(|dn| f64::from(**dn) < about.black_dn - margin_dn).count();
    if below as f64 > BLACK_SHARE * dn.len() as f64 {
        noted.warning(path.display(), WarningKind::RawFrame, format!(
            "{below} of {} pixels lie more than {margin_dn:.0} DN below the black level of {} DN: it is too high, and they become black; correct `black_level_dn`",
            dn.len(),
            about.black_dn
        ));
    }
}

/// Warns of pixels of all colours that end near one number below the level of saturation, if that would colour them.
fn warn_of_doubtful_pile(frame: &RawInput, path: &Path, noted: &Noted<'_>) {
    let about = &frame.about;
    let weakest = about.response.into_iter().fold(f64::INFINITY, f64::min);
    if strongest(about.response) < COLOURED * weakest {
        return;
    }
    let range_dn = about.white_dn - about.black_dn;
    let end_dn = about.black_dn + about.saturation * strongest(about.response) * range_dn;
    let Some(pile) = doubtful_pile(&frame.dn, frame.width, frame.cfa, end_dn) else { return };
    noted.warning(path.display(), WarningKind::Saturation, format!(
        "{} pixels of all colours end near one number, from {} DN, below the level of saturation of {end_dn:.0} DN: if they are saturated, \
         highlights are coloured; then state `white_level_dn = {}`",
        pile.pixels,
        pile.dn,
        pile.dn
    ));
}

/// Warns of coefficients and light of a frame that the registers of an ISP cut off at these values of its parameters.
pub(super) fn warn_of_clipped(
    (isp, values): (&NamedIsp, &[f64]),
    frame: &RawInput,
    path: &Path,
    noted: &Noted<'_>,
) -> Result<()> {
    let coefficients = isp.clipped(&frame.about, values).map_err(about_frame(path))?;
    for clipped in coefficients.into_iter().chain(isp.clipped_light(frame)) {
        noted.warning(path.display(), WarningKind::RawFrame, format!("its {clipped}"));
    }
    Ok(())
}

/// Replaces a coarse mesh of shading by a smooth one through its nodes, and says how much that changes.
fn smooth_shading(about: &mut FrameData, path: &Path, noted: &Noted<'_>) {
    let Some(mesh) = about.shading.as_mut().filter(|mesh| mesh.rows.min(mesh.cols) < FINE_NODES) else {
        return;
    };
    let (fine, difference) = mesh.refined(FINE_NODES);
    let nodes = format!("its shading mesh has {} x {} nodes", mesh.rows, mesh.cols);
    if mesh.rows.min(mesh.cols) < 3 {
        noted.warning(path.display(), WarningKind::RawFrame, format!(
            "{nodes}: how the light falls between two nodes is unknown, and a ramp is corrected; give 5 or more nodes a side"
        ));
    } else if difference > COARSE {
        noted.warning(path.display(), WarningKind::RawFrame, format!(
            "{nodes}: between them a smooth curve is corrected, which differs from straight lines by up to {:.1} %; more nodes say more",
            100.0 * difference
        ));
    }
    *mesh = fine;
}

/// The digital number at which the pixels of a frame saturate: that which is stated, or a lower one at which those of a colour pile up,
/// exactly or within a few numbers.
fn saturated_dn(
    dn: &[u32],
    width: usize,
    cfa: CfaPattern,
    stated_dn: f64,
    info: &RawInfo,
    path: &Path,
    noted: &Noted<'_>,
) -> f64 {
    if info.companding.is_some() {
        return stated_dn;
    }
    let Some(pile) = pile_below(dn, width, cfa, stated_dn) else { return stated_dn };
    let have =
        if pile.is_one_number { "have the largest number," } else { "pile up at the largest numbers, from" };
    noted.warning(path.display(), WarningKind::Saturation, format!(
        "{} pixels {have} {} DN, below the white level of {stated_dn} DN: they are taken as saturated, or highlights would be coloured; state it with `white_level_dn`",
        pile.pixels,
        pile.dn
    ));
    f64::from(pile.dn)
}

/// The calibration that the sidecar of a frame names.
fn calibration(frame: &Path, name: &str) -> Result<FrameCalibration> {
    let file = frame.parent().unwrap_or(Path::new("")).join(name);
    FrameCalibration::load(&file).map_err(|error| match error {
        RawFileError::Io { source, .. } => JobError::input(
            format!(
                "{}: `calibration = \"{name}\"`: {}: {source}",
                sidecar_path(frame).display(),
                file.display()
            ),
            "copy the calibration beside the frame, or remove the line",
        ),
        other => other.into(),
    })
}

/// Changes the calibration of a frame to the light that its statistics suggest: the balance first, since the exposure is that of balanced colours.
fn estimate(
    frame: &mut RawInput,
    options: &FrameOptions,
    path: &Path,
    noted: &Noted<'_>,
) -> Result<(), petzval_camera::isp::IspError> {
    frame.validate()?;
    if !options.auto_balance && !options.auto_exposure {
        return Ok(());
    }
    let statistics = Statistics::of_frame(frame)?;
    let about = &mut frame.about;
    if options.auto_balance {
        balance(about, auto_balance(&statistics, about.response, &BalanceOptions::default()));
    }
    if options.auto_exposure {
        let ev = finished_exposure_ev(&statistics, about.response, &ExposureOptions::default());
        amplify(about, ev, path, noted);
    }
    Ok(())
}

/// Balances by gains of red and blue. The digital numbers at which pixels saturate stay.
fn balance(about: &mut FrameData, gains: BalanceGains) {
    let before = strongest(about.response);
    about.response[0] /= gains.red;
    about.response[2] /= gains.blue;
    about.saturation *= before / strongest(about.response);
}

/// The largest answer of a colour to white light.
fn strongest(response: [f64; 3]) -> f64 {
    response.into_iter().fold(f64::MIN_POSITIVE, f64::max)
}

/// Amplifies a frame by stops, as far as digital gain goes. The light is given, so the white level moves instead.
fn amplify(about: &mut FrameData, wanted_ev: f64, path: &Path, noted: &Noted<'_>) {
    let range_dn = about.white_dn - about.black_dn;
    let most_ev = (range_dn / LEAST_RANGE_DN).log2().max(0.0);
    let least_ev = (range_dn / MOST_WHITE_DN).log2().min(0.0);
    let ev = wanted_ev.clamp(least_ev, most_ev);
    let missed_ev = wanted_ev - ev;
    if missed_ev.abs() > MISSED_EV {
        let is = if missed_ev > 0.0 { "dark" } else { "bright" };
        noted.warning(path.display(), WarningKind::RawFrame, format!(
            "automatic exposure changes it by {ev:.1} EV, the most that its {range_dn:.0} DN from black to white allow, and \
             misses the middle by {:.1} EV: the picture is too {is}",
            missed_ev.abs()
        ));
    }
    set_white(about, (-ev).exp2());
}

/// Makes light white that is so many times as bright as the present one.
fn set_white(about: &mut FrameData, factor: f64) {
    about.white_dn = about.black_dn + (about.white_dn - about.black_dn) * factor;
    about.saturation /= factor;
    about.noise.shot /= factor;
    about.noise.read /= factor * factor;
}

/// The sensor that the options name, or the built-in one with the name that the file gives.
fn sensor_of(info: &RawInfo, options: &FrameOptions, assets: &Library) -> Result<Option<SensorModel>> {
    if let Some(sensor) = &options.sensor {
        return Ok(Some(sensor.read(assets)?));
    }
    let Some(named) = &info.sensor else { return Ok(None) };
    for name in assets.names("sensors") {
        let sensor = assets.sensor(name)?;
        if sensor.name == *named || name == named {
            return Ok(Some(sensor));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests;
