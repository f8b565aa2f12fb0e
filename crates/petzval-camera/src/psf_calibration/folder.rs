//! A folder of captures, position by position, to measured PSFs.

use std::path::{Path, PathBuf};

use petzval_optics::format::FileError;

use super::PsfCalibrationError;
use super::average::{Average, Dark};
use super::manifest::{MANIFEST_FILE, Manifest};
use super::measure::{Frame, LEAST_SIDE, Measured, green_centroid, measure};
use super::merge::{ExposureMean, Merged, merge, read_variance_e2};
use crate::develop::dark_mean_dn;
use crate::raw_file::{RawFrame, load_raw};
use crate::render::Placement;
use crate::sensor::{Exposure, SensorModel};

/// Frames larger than this are cut to a window of so many pixels a side around the brightest spot.
const WINDOW: usize = 96;

/// A centroid that moves less than this, px, moves too little to matter for a PSF on pixels.
const STILL_PX: f64 = 0.05;

/// What is told of one exposure.
#[derive(Debug, Clone, PartialEq)]
pub struct ExposureReport {
    /// Exposure time, ms.
    pub exposure_ms: f64,
    /// Frames averaged.
    pub frames: usize,
    /// Dark frames averaged; 0 if the dark signal is the sensor model's.
    pub dark_frames: usize,
    /// Pixels that were saturated.
    pub saturated_pixels: usize,
    /// Mean of the frames' variance over the modelled one; `None` for one frame.
    pub variance_ratio: Option<f64>,
    /// Mean centroid of the frames in the window, (row, column), px, and its standard error from their scatter.
    pub centroid_px: Option<([f64; 2], [f64; 2])>,
}

/// One position, measured.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibratedPosition {
    /// Its name.
    pub name: String,
    /// Field radius, mm: the manifest's, or that of the centroid.
    pub field_radius_mm: f64,
    /// Direction away from the axis, rad from the columns towards higher rows.
    pub azimuth_rad: f64,
    /// Where the reference chief ray should be in the window, (row, column), px.
    pub expected_px: Option<[f64; 2]>,
    /// The window on the sensor.
    pub frame: Frame,
    /// Rates and variances of the mosaic.
    pub merged: Merged,
    /// PSF, centroid, noise floor.
    pub measured: Measured,
    /// Exposure by exposure.
    pub exposures: Vec<ExposureReport>,
    /// What a careful reader should know.
    pub warnings: Vec<String>,
}

/// Reads the manifest of a folder; with its text and path.
pub fn read_manifest(folder: &Path) -> Result<(Manifest, String, PathBuf), PsfCalibrationError> {
    let path = folder.join(MANIFEST_FILE);
    let text = std::fs::read_to_string(&path).map_err(PsfCalibrationError::io(&path))?;
    let manifest = Manifest::from_toml(&text).map_err(PsfCalibrationError::file(&path))?;
    Ok((manifest, text, path))
}

/// Measures position number `index` of a manifest whose files are in `folder`. `progress` is called after each frame.
pub fn calibrate_position(
    (manifest, text): (&Manifest, &str),
    folder: &Path,
    index: usize,
    sensor: &SensorModel,
    seed: u64,
    mut progress: impl FnMut(),
) -> Result<CalibratedPosition, PsfCalibrationError> {
    let position = &manifest.position[index];
    let name = position.name.get_ref().clone();
    if !sensor.cfa.is_bayer() {
        return Err(PsfCalibrationError::NotBayer(sensor.cfa.to_string()));
    }
    let mut reader = Reader { folder, position: &name, sensor, size: None };

    // The longest exposure shows best where the source is; around it a window is cut.
    let longest = position.exposure.last().and_then(|e| e.frames.get_ref().first());
    let first = longest.map(|file| reader.load(file)).transpose()?;
    let Some(first) = first else {
        let (height, width, least) = (0, 0, LEAST_SIDE);
        return Err(PsfCalibrationError::TooSmall { position: name, height, width, least });
    };
    let [row, col] = *position.origin.get_ref();
    let fits = |start: usize, len: usize, size: usize| start.checked_add(len).is_some_and(|end| end <= size);
    if !fits(row, first.height, sensor.height) || !fits(col, first.width, sensor.width) {
        let message = format!(
            "frames of {}x{} pixels from here leave the sensor of {}x{}",
            first.height, first.width, sensor.height, sensor.width
        );
        let off = FileError::at(text, position.origin.span(), "origin", message);
        let hint = "[row, column] of the frames' first pixel; the frames' size must be the sensor's or a window of it";
        return Err(PsfCalibrationError::file(&folder.join(MANIFEST_FILE))(off.hint(hint)));
    }
    if first.height.min(first.width) < LEAST_SIDE {
        let (height, width, least) = (first.height, first.width, LEAST_SIDE);
        return Err(PsfCalibrationError::TooSmall { position: name, height, width, least });
    }
    let cut = Cut::around_brightest(&first);
    let frame = Frame {
        height: cut.height,
        width: cut.width,
        placement: Placement { row: row + cut.row, col: col + cut.col },
        cfa: sensor.cfa,
    };

    // Average the frames of each exposure time, and follow the source through them.
    let linear_gain = *manifest.linear_gain.get_ref();
    let gain = sensor.gain_dn_per_e * linear_gain;
    let read_dn2 = gain * gain * read_variance_e2(sensor, linear_gain);
    let (mut exposures, mut tracks, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    let mut modelled_dark = false;
    for files in &position.exposure {
        let time_s = 1e-3 * files.exposure_ms.get_ref();
        let modelled = dark_mean_dn(
            sensor,
            &Exposure { white_e: 1.0, time_s: time_s as f32, linear_gain: linear_gain as f32 },
        );
        let (mut light, mut dark_light) = (Average::default(), Average::default());
        for file in &files.dark_frames {
            dark_light.add(cut.of(&reader.load(file)?), sensor.max_dn());
            progress();
        }
        let mut track: Vec<(String, [f64; 2])> = Vec::new();
        for file in files.frames.get_ref() {
            let dn = reader.load(file)?;
            light.add(cut.of(&dn), sensor.max_dn());
            let mosaic: Vec<f64> = cut.of(&dn).map(|v| v - modelled).collect();
            if let Some(centre) = green_centroid(&mosaic, &frame, cut.brightest) {
                track.push((file.clone(), centre));
            }
            progress();
        }
        let dark = if dark_light.frames > 0 {
            let single = read_dn2 + gain * gain * sensor.dark_current_e_per_s * time_s;
            Dark::measured(&dark_light, single)
        } else {
            modelled_dark = true;
            Dark::modelled(modelled, light.mean_dn.len())
        };
        exposures.push(ExposureMean { time_s, light, dark });
        tracks.push(track);
    }
    if modelled_dark {
        warnings.push("no dark frames: the sensor model's dark signal was taken off".to_owned());
    }

    let merged = merge(&exposures, sensor, linear_gain);
    let measured = measure(&merged, &frame, &name, seed)?;
    let reports: Vec<ExposureReport> = (0..exposures.len())
        .map(|k| {
            let e = &exposures[k];
            let full_dn = super::merge::full_dn(sensor, linear_gain);
            ExposureReport {
                exposure_ms: 1e3 * e.time_s,
                frames: e.light.frames,
                dark_frames: position.exposure[k].dark_frames.len(),
                saturated_pixels: (0..e.light.mean_dn.len()).filter(|i| e.is_saturated(*i, full_dn)).count(),
                variance_ratio: e.variance_ratio(&merged, sensor, linear_gain),
                centroid_px: mean_centroid(&tracks[k]),
            }
        })
        .collect();
    look_for_trouble(&reports, &tracks, &merged, &measured, &mut warnings);

    // Without a place in the manifest, the source is where it was found.
    let on_sensor = [frame.placement.row as f64, frame.placement.col as f64];
    let centroid = [0, 1].map(|axis| on_sensor[axis] + measured.psf.centroid_px[1][axis]);
    let middle = [0.5 * (sensor.height as f64 - 1.0), 0.5 * (sensor.width as f64 - 1.0)];
    let (y, x) = (centroid[0] - middle[0], centroid[1] - middle[1]);
    let found_mm = 1e-3 * sensor.pixel_um * x.hypot(y);
    let expected_px =
        position.expected_px.as_ref().map(|e| [0, 1].map(|axis| e.get_ref()[axis] - on_sensor[axis]));
    if let Some(expected) = expected_px {
        let off = [0, 1].map(|axis| measured.psf.centroid_px[1][axis] - expected[axis]);
        if off[0].hypot(off[1]) > 10.0 {
            let off = off[0].hypot(off[1]);
            warnings.push(format!("the source is {off:.0} px from where the manifest expects it"));
        }
    }
    Ok(CalibratedPosition {
        name,
        field_radius_mm: position.field_radius_mm.as_ref().map_or(found_mm, |r| *r.get_ref()),
        azimuth_rad: position.azimuth_deg.as_ref().map_or(y.atan2(x), |a| a.get_ref().to_radians()),
        expected_px,
        frame,
        merged,
        measured,
        exposures: reports,
        warnings,
    })
}

/// Reads the frames of a position, which all have one size.
struct Reader<'a> {
    folder: &'a Path,
    position: &'a str,
    sensor: &'a SensorModel,
    size: Option<(usize, usize)>,
}

impl Reader<'_> {
    fn load(&mut self, file: &str) -> Result<RawFrame, PsfCalibrationError> {
        let path = self.folder.join(file);
        let raw = load_raw(&path)?;
        let (first_height, first_width) = *self.size.get_or_insert((raw.height, raw.width));
        let (height, width) = (raw.height, raw.width);
        if (height, width) != (first_height, first_width) {
            let position = self.position.to_owned();
            return Err(PsfCalibrationError::Size {
                path,
                position,
                height,
                width,
                first_height,
                first_width,
            });
        }
        let (value, max) = (raw.dn.iter().copied().max().unwrap_or(0), self.sensor.max_dn());
        if f64::from(value) > max {
            return Err(PsfCalibrationError::AboveConverter { path, value, max });
        }
        Ok(raw)
    }
}

/// The part of each frame that is looked at.
struct Cut {
    row: usize,
    col: usize,
    height: usize,
    width: usize,
    /// Brightest place of the first frame, (row, column) in the cut.
    brightest: [f64; 2],
}

impl Cut {
    fn around_brightest(raw: &RawFrame) -> Self {
        // Sums over 3x3 pixels: a hot pixel is not a spot.
        let mut best = (0u64, 1, 1);
        for row in 1..raw.height - 1 {
            for col in 1..raw.width - 1 {
                let line = |r: usize| &raw.dn[r * raw.width + col - 1..=r * raw.width + col + 1];
                let sum: u64 = (row - 1..=row + 1).flat_map(line).map(|v| u64::from(*v)).sum();
                if sum > best.0 {
                    best = (sum, row, col);
                }
            }
        }
        let side = |at: usize, len: usize| {
            let size = len.min(WINDOW);
            (at.saturating_sub(size / 2).min(len - size), size)
        };
        let ((row, height), (col, width)) = (side(best.1, raw.height), side(best.2, raw.width));
        Self { row, col, height, width, brightest: [(best.1 - row) as f64, (best.2 - col) as f64] }
    }

    fn of<'a>(&'a self, raw: &'a RawFrame) -> impl ExactSizeIterator<Item = f64> + 'a {
        (0..self.height * self.width).map(|i| {
            let (row, col) = (self.row + i / self.width, self.col + i % self.width);
            f64::from(raw.dn[row * raw.width + col])
        })
    }
}

/// Mean of the frames' centroids and its standard error.
fn mean_centroid(track: &[(String, [f64; 2])]) -> Option<([f64; 2], [f64; 2])> {
    let count = track.len() as f64;
    if track.len() < 2 {
        return track.first().map(|t| (t.1, [f64::INFINITY; 2]));
    }
    let mean = [0, 1].map(|axis| track.iter().map(|t| t.1[axis]).sum::<f64>() / count);
    let error = [0, 1].map(|axis| {
        let square: f64 = track.iter().map(|t| (t.1[axis] - mean[axis]).powi(2)).sum();
        (square / (count - 1.0) / count).sqrt()
    });
    Some((mean, error))
}

/// Five standard errors: by chance once in 1.7 million.
const MOVED_SIGMAS: f64 = 5.0;

fn look_for_trouble(
    exposures: &[ExposureReport],
    tracks: &[Vec<(String, [f64; 2])>],
    merged: &Merged,
    measured: &Measured,
    warnings: &mut Vec<String>,
) {
    let saturated = merged.saturated.iter().filter(|s| **s).count();
    if saturated > 0 {
        warnings.push(format!(
            "{saturated} pixels are saturated in every exposure, the shortest included: the PSF's peak is cut off; dim the source"
        ));
    }
    for e in exposures {
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
    // Within an exposure: the first half of the frames beside the second.
    for (e, track) in exposures.iter().zip(tracks) {
        let (first, second) = track.split_at(track.len() / 2);
        if let (Some(a), Some(b)) = (mean_centroid(first), mean_centroid(second)) {
            tell_of_move(a, b, &format!("during the {} ms frames", e.exposure_ms), warnings);
        }
        // A single frame far from all others.
        if let Some((mean, error)) = mean_centroid(track) {
            let count = track.len() as f64;
            for (file, at) in track {
                let off = (at[0] - mean[0]).hypot(at[1] - mean[1]);
                let scatter = error[0].hypot(error[1]) * count.sqrt();
                if count > 4.0 && off > 0.5 && off > 0.8 * scatter * count.sqrt() {
                    warnings.push(format!(
                        "{file}: the source is {off:.2} px from where the other frames have it"
                    ));
                }
            }
        }
    }
    // Between exposures; saturation moves centroids, so saturated ones do not take part.
    let clean: Vec<&ExposureReport> = exposures.iter().filter(|e| e.saturated_pixels == 0).collect();
    for pair in clean.windows(2) {
        if let (Some(a), Some(b)) = (pair[0].centroid_px, pair[1].centroid_px) {
            let between =
                format!("between the {} and the {} ms frames", pair[0].exposure_ms, pair[1].exposure_ms);
            tell_of_move(a, b, &between, warnings);
        }
    }
    for ([row, col], share) in &measured.other_sources {
        warnings.push(format!(
            "another source at row {row}, column {col} of the window, {:.0} % as bright",
            100.0 * share
        ));
    }
}

fn tell_of_move(a: ([f64; 2], [f64; 2]), b: ([f64; 2], [f64; 2]), when: &str, warnings: &mut Vec<String>) {
    let moved = [0, 1].map(|axis| b.0[axis] - a.0[axis]);
    let beyond = |axis: usize| moved[axis].abs() > MOVED_SIGMAS * a.1[axis].hypot(b.1[axis]);
    let distance = moved[0].hypot(moved[1]);
    if distance > STILL_PX && (beyond(0) || beyond(1)) {
        warnings.push(format!("the source moved by {distance:.2} px {when}"));
    }
}
