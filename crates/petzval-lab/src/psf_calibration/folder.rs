//! Measures the PSFs of a folder of captures, position by position.

use std::path::{Path, PathBuf};

use petzval_base::{Cancelled, FileError, InFile, IoError};

use super::PsfCalibrationError;
use super::average::{Average, Dark};
use super::exposure_report::ExposureReport;
use super::manifest::{MANIFEST_FILE, Manifest};
use super::measure::{Frame, LEAST_SIDE, Measured, check_mosaic, measure};
use super::merge::{ExposureMean, Merged, SensorNoise, agreement, mask_hot_pixels, merge, saturation_dn};
use super::spots::{DETECTION_SIGMAS, SECOND_SOURCE};
use super::track::{Centroid, Mosaics, Track, mean_centroid};
use super::warnings::{Seen, position_warnings};
use petzval_base::statistics::median;
use petzval_camera::develop::dark_mean_dn;
use petzval_camera::render::{Placement, Window};
use petzval_camera::sensor::{Exposure, SensorModel};
use petzval_files::raw_file::{RawFrame, RawInfo, Sidecar, load_raw, sidecar_path};

/// Largest side of a frame, px; larger frames are cropped to a window of this size around the brightest spot.
const WINDOW: usize = 96;

/// Number of the darkest of 5x5 pixels that give the brightness of a place, so that single bright pixels do not count.
const KEPT: usize = 20;

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
    /// Warnings about the position.
    pub warnings: Vec<String>,
}

/// Reads the manifest of a folder; with its text and path.
pub fn read_manifest(folder: &Path) -> Result<(Manifest, String, PathBuf), PsfCalibrationError> {
    let path = folder.join(MANIFEST_FILE);
    let bytes = petzval_base::read_whole(&path).map_err(IoError::at(&path))?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let text = String::from_utf8_lossy(error.as_bytes());
        let at = error.utf8_error().valid_up_to();
        let error = FileError::at(&text, at..at, "", "this is not UTF-8 text");
        InFile::at(&path)(error.hint("save the manifest as UTF-8"))
    })?;
    let manifest = Manifest::from_toml(&text).map_err(InFile::at(&path))?;
    Ok((manifest, text, path))
}

/// Measures position number `index` of a manifest whose files are in `folder`. `progress` is called after each frame; its error
/// ends the work.
pub fn calibrate_position(
    (manifest, text): (&Manifest, &str),
    folder: &Path,
    index: usize,
    sensor: &SensorModel,
    seed: u64,
    mut progress: impl FnMut() -> Result<(), Cancelled>,
) -> Result<CalibratedPosition, PsfCalibrationError> {
    let position = &manifest.position[index];
    let name = position.name.get_ref().clone();
    check_mosaic(sensor.cfa)?;
    let mut reader =
        Reader { folder, position: &name, manifest, origin: *position.origin.get_ref(), sensor, size: None };

    // Crop a window around the source in the longest exposure.
    let longest = position.exposure.last();
    let first = longest.and_then(|e| Some((e.frames.get_ref().first()?, *e.exposure_ms.get_ref())));
    let first = first.map(|(file, exposure_ms)| reader.load(file, exposure_ms)).transpose()?;
    let Some(first) = first else {
        let (height, width, least) = (0, 0, LEAST_SIDE);
        return Err(PsfCalibrationError::TooSmall { position: name, height, width, least });
    };
    let [row, col] = *position.origin.get_ref();
    let window = Window { placement: Placement { row, col }, height: first.height, width: first.width };
    if !window.lies_on((sensor.height, sensor.width)) {
        let message = format!(
            "frames of {} x {} pixels from here leave the sensor of {} x {}",
            first.width, first.height, sensor.width, sensor.height
        );
        let off = FileError::at(text, position.origin.span(), "origin", message);
        let hint = "[row, column] of the frames' first pixel; the frames' size must be the sensor's or a window of it";
        return Err(InFile::at(&folder.join(MANIFEST_FILE))(off.hint(hint)).into());
    }
    if first.height.min(first.width) < LEAST_SIDE {
        let (height, width, least) = (first.height, first.width, LEAST_SIDE);
        return Err(PsfCalibrationError::TooSmall { position: name, height, width, least });
    }
    let cut = Cut::around_brightest(&first);
    let placement = Placement { row: row + cut.row, col: col + cut.col };
    let frame = Frame { height: cut.height, width: cut.width, placement, cfa: sensor.cfa };

    // Average the frames of each exposure time.
    let linear_gain = *manifest.linear_gain.get_ref();
    let noise = SensorNoise::new(sensor, linear_gain);
    let gain = noise.gain_dn_per_e;
    let saturation_dn = saturation_dn(sensor, linear_gain);
    let (mut exposures, mut windows) = (Vec::new(), Vec::new());
    for files in &position.exposure {
        let exposure_ms = *files.exposure_ms.get_ref();
        let time_s = 1e-3 * exposure_ms;
        let (mut light, mut dark_light) = (Average::default(), Average::default());
        for file in &files.dark_frames {
            let dn = cut.of(&reader.load(file, exposure_ms)?);
            dark_light.add(dn.iter().map(|v| f64::from(*v)), saturation_dn);
            progress()?;
        }
        let mut of_exposure: Vec<Vec<u16>> = Vec::new();
        for file in files.frames.get_ref() {
            let dn = cut.of(&reader.load(file, exposure_ms)?);
            light.add(dn.iter().map(|v| f64::from(*v)), saturation_dn);
            of_exposure.push(dn);
            progress()?;
        }
        let dark = if dark_light.frames > 0 {
            let single_e2 = noise.read_e2 + noise.dark_e_per_s * time_s;
            Dark::measured(&dark_light, gain * gain * single_e2)
        } else {
            let (time_s, linear_gain) = (time_s as f32, linear_gain as f32);
            let modelled = dark_mean_dn(sensor, &Exposure { white_e: 1.0, time_s, linear_gain });
            Dark::modelled(modelled, light.mean_dn.len())
        };
        exposures.push(ExposureMean { time_s, light, dark });
        windows.push(of_exposure);
    }

    // Merge the exposures, and replace hot pixels: single bright pixels away from the source.
    let mut merged = merge(&exposures, sensor, linear_gain);
    let source = brightest(frame.height, frame.width, |i| merged.rate_e_per_s[i]).0;
    let hot = mask_hot_pixels(&mut merged, &frame, source);
    let measured = measure(&merged, &frame, &name, seed)?;

    // Follow the source through the frames, and from each exposure to the next.
    let follow = Follow { frame: &frame, exposures: &exposures, merged: &merged, noise: &noise, hot: &hot };
    let tracks: Vec<Track> = (0..exposures.len())
        .map(|k| follow.frames(k, position.exposure[k].frames.get_ref(), &windows[k]))
        .collect();
    let between: Vec<_> = (1..exposures.len()).map(|k| follow.exposures(k - 1, k)).collect();
    let reports: Vec<ExposureReport> = (0..exposures.len())
        .map(|k| {
            let e = &exposures[k];
            ExposureReport {
                exposure_ms: 1e3 * e.time_s,
                frames: e.light.frames,
                dark_frames: position.exposure[k].dark_frames.len(),
                saturated_pixels: (0..e.light.mean_dn.len()).filter(|i| e.is_saturated(*i)).count(),
                variance_ratio: e.variance_ratio(&merged, sensor, linear_gain),
                agreement: agreement(&exposures, k, &merged, &noise),
                centroid_px: mean_centroid(&tracks[k]),
            }
        })
        .collect();
    let on_frame = |i: usize| [frame.placement.row + i / frame.width, frame.placement.col + i % frame.width];
    let mut warnings = position_warnings(&Seen {
        exposures: &reports,
        tracks: &tracks,
        between: &between,
        merged: &merged,
        measured: &measured,
        hot: &hot.iter().map(|i| on_frame(*i)).collect::<Vec<_>>(),
        nonuniformity: &sensor.nonuniformity,
    });
    if let Some(([r, c], share)) = cut.elsewhere {
        warnings.push(format!(
            "another source at row {}, column {} of the sensor, {:.0} % as bright, outside the {} x {} pixels that are measured",
            row + r,
            col + c,
            100.0 * share,
            cut.width,
            cut.height
        ));
    }

    // Without a position in the manifest, use the measured position.
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
    manifest: &'a Manifest,
    origin: [usize; 2],
    sensor: &'a SensorModel,
    size: Option<(usize, usize)>,
}

impl Reader<'_> {
    fn load(&mut self, file: &str, exposure_ms: f64) -> Result<RawFrame, PsfCalibrationError> {
        let path = self.folder.join(file);
        let raw = load_raw(&path)?;
        let (first_height, first_width) = *self.size.get_or_insert((raw.height, raw.width));
        let (height, width) = (raw.height, raw.width);
        if (height, width) != (first_height, first_width) {
            let position = self.position.to_owned();
            let error =
                PsfCalibrationError::Size { path, position, height, width, first_height, first_width };
            return Err(error);
        }
        // The bits of the converter are those of the sidecar; a file's own bits are those of its container.
        let bits = Sidecar::beside(&path)?.and_then(|sidecar| sidecar.info.bits);
        if let Some((what, said, is)) = self.contradiction(&raw.info, bits, exposure_ms) {
            let sidecar = sidecar_path(&path);
            let path = if sidecar.is_file() { sidecar } else { path };
            return Err(PsfCalibrationError::Contradiction { path, what, said, is });
        }
        let (value, max) = (raw.dn.iter().copied().max().unwrap_or(0), self.sensor.max_dn());
        if f64::from(value) > max {
            return Err(PsfCalibrationError::AboveConverter { path, value, max });
        }
        Ok(raw)
    }

    /// A setting of a frame that contradicts the sensor or the manifest: the key, the frame's value, and theirs.
    fn contradiction(
        &self,
        info: &RawInfo,
        bits: Option<u32>,
        exposure_ms: f64,
    ) -> Option<(&'static str, String, String)> {
        let sensor = self.sensor;
        if let Some(bits) = bits.filter(|bits| *bits != sensor.bits) {
            return Some(("bits", bits.to_string(), format!("the sensor has {}", sensor.bits)));
        }
        // Mosaics repeat within 8 pixels: those of sensor and frame are the same if 16 x 16 pixels are.
        if let Some(cfa) = info.cfa {
            let [row, col] = self.origin.map(|v| v % 1_000_000);
            let differs =
                |i: usize| cfa.colour(i / 16, i % 16) != sensor.cfa.colour(row + i / 16, col + i % 16);
            if (0..256).any(differs) {
                let is = format!(
                    "the sensor has {} from its first pixel, and the frame starts at row {}, column {}",
                    sensor.cfa, self.origin[0], self.origin[1]
                );
                return Some(("cfa", cfa.to_string(), is));
            }
        }
        // Cameras round the values that they report: allow one percent, and one digital number.
        let linear_gain = *self.manifest.linear_gain.get_ref();
        let numbers = [
            ("exposure_s", info.exposure_s, 1e-3 * exposure_ms, 0.01, 0.0, "the manifest"),
            ("linear_gain", info.linear_gain, linear_gain, 0.01, 0.0, "the manifest"),
            ("pixel_um", info.pixel_um, sensor.pixel_um, 0.01, 0.0, "the sensor"),
            ("black_level_dn", info.black_level_dn, sensor.black_level_dn, 0.1, 1.0, "the sensor"),
        ];
        numbers.into_iter().find_map(
            |(key, said, is, share, least, whose): (_, Option<f64>, f64, f64, f64, &str)| {
                let said = said.filter(|said| (said - is).abs() > least.max(share * is))?;
                Some((key, said.to_string(), format!("{whose} has {is}")))
            },
        )
    }
}

/// The part of each frame that is evaluated.
struct Cut {
    row: usize,
    col: usize,
    height: usize,
    width: usize,
    /// A second source outside the cut: (row, column) in the frame, and its share of the first one's light.
    elsewhere: Option<([usize; 2], f64)>,
}

/// The brightest place, (row, column), of at least 5x5 pixels, and the light there: 5x5 pixels without the five brightest, so
/// that a few hot pixels do not count as a spot.
fn brightest(height: usize, width: usize, value: impl Fn(usize) -> f64) -> ([f64; 2], f64) {
    let mut best = ([2.0; 2], f64::NEG_INFINITY);
    let mut values = [0.0; 25];
    for row in 2..height.saturating_sub(2) {
        for col in 2..width.saturating_sub(2) {
            for (n, v) in values.iter_mut().enumerate() {
                *v = value((row + n / 5 - 2) * width + col + n % 5 - 2);
            }
            // Most places are too dark even with all of their pixels.
            if values.iter().map(|v| v.max(0.0)).sum::<f64>() > best.1 {
                values.select_nth_unstable_by(KEPT, f64::total_cmp);
                let light: f64 = values[..KEPT].iter().sum();
                if light > best.1 {
                    best = ([row as f64, col as f64], light);
                }
            }
        }
    }
    best
}

impl Cut {
    fn around_brightest(raw: &RawFrame) -> Self {
        let (at, light) = brightest(raw.height, raw.width, |i| f64::from(raw.dn[i]));
        let side = |at: f64, len: usize| {
            let size = len.min(WINDOW);
            ((at as usize).saturating_sub(size / 2).min(len - size), size)
        };
        let ((row, height), (col, width)) = (side(at[0], raw.height), side(at[1], raw.width));
        let mut cut = Self { row, col, height, width, elsewhere: None };
        if (height, width) == (raw.height, raw.width) {
            return cut;
        }
        // A second source outside the cut: as bright, above the level and the noise of the whole frame.
        let level = median(raw.dn.iter().map(|v| f64::from(*v)));
        let spread = 1.4826 * median(raw.dn.iter().map(|v| (f64::from(*v) - level).abs()));
        let inside = |r: usize, c: usize| (row..row + height).contains(&r) && (col..col + width).contains(&c);
        let (there, second) = brightest(raw.height, raw.width, |i| {
            if inside(i / raw.width, i % raw.width) { level } else { f64::from(raw.dn[i]) }
        });
        let share = (second - KEPT as f64 * level) / (light - KEPT as f64 * level);
        if share > SECOND_SOURCE
            && second - KEPT as f64 * level > DETECTION_SIGMAS * (KEPT as f64).sqrt() * spread.max(1.0)
        {
            cut.elsewhere = Some((there.map(|v| v as usize), share));
        }
        cut
    }

    fn of(&self, raw: &RawFrame) -> Vec<u16> {
        let line = |r: usize| {
            let first = (self.row + r) * raw.width + self.col;
            raw.dn[first..first + self.width].iter().copied()
        };
        (0..self.height).flat_map(line).collect()
    }
}

/// The inputs of finding the source in frames and exposures.
struct Follow<'a> {
    frame: &'a Frame,
    exposures: &'a [ExposureMean],
    merged: &'a Merged,
    noise: &'a SensorNoise,
    hot: &'a [usize],
}

impl Follow<'_> {
    /// Hot pixels and those that are saturated in any of the exposures.
    fn left_out(&self, exposures: &[usize]) -> Vec<bool> {
        let saturated = |i: usize| exposures.iter().any(|k| self.exposures[*k].is_saturated(i));
        let mut out: Vec<bool> = (0..self.merged.rate_e_per_s.len()).map(saturated).collect();
        self.hot.iter().for_each(|i| out[*i] = true);
        out
    }

    /// The brightest place of a mosaic without the pixels left out.
    fn start(&self, mosaic: &[f64], left_out: &[bool]) -> [f64; 2] {
        brightest(self.frame.height, self.frame.width, |i| if left_out[i] { 0.0 } else { mosaic[i] }).0
    }

    /// The source in every frame of an exposure.
    fn frames(&self, k: usize, files: &[String], windows: &[Vec<u16>]) -> Track {
        let e = &self.exposures[k];
        let left_out = self.left_out(&[k]);
        let variance: Vec<f64> = (0..left_out.len())
            .map(|i| e.frame_variance_e2(i, self.merged.rate_e_per_s[i], self.noise))
            .collect();
        let shared = self.noise.shared_e2;
        let mosaics = Mosaics { frame: self.frame, variance: &variance, shared, left_out: &left_out };
        let electrons = |dn: &[u16]| -> Vec<f64> {
            let of = |(v, dark): (&u16, &f64)| (f64::from(*v) - dark) / self.noise.gain_dn_per_e;
            dn.iter().zip(&e.dark.mean_dn).map(of).collect()
        };
        let follow = |(file, dn): (&String, &Vec<u16>)| {
            let mosaic = electrons(dn);
            (file.clone(), mosaics.centroid(&mosaic, self.start(&mosaic, &left_out)))
        };
        files.iter().zip(windows).map(follow).collect()
    }

    /// The source in the means of two exposures, without the pixels that are saturated in either.
    fn exposures(&self, a: usize, b: usize) -> Option<[Centroid; 2]> {
        let left_out = self.left_out(&[a, b]);
        let of = |k: usize| {
            let e = &self.exposures[k];
            let all = 0..left_out.len();
            let rate: Vec<f64> = all.clone().map(|i| e.rate(i, self.noise.gain_dn_per_e)).collect();
            let offset = e.offset_e_per_s(self.noise);
            let variance: Vec<f64> = all
                .map(|i| e.variance(i, self.merged.rate_e_per_s[i], self.noise) + offset * offset)
                .collect();
            let per_mean = 1.0 / (e.light.frames as f64 * e.time_s * e.time_s);
            let shared = self.noise.shared_e2.map(|v| v * per_mean);
            let mosaics = Mosaics { frame: self.frame, variance: &variance, shared, left_out: &left_out };
            mosaics.centroid(&rate, self.start(&rate, &left_out))
        };
        Some([of(a)?, of(b)?])
    }
}
