//! Captures with something wrong have warnings, captures without have none.

use std::path::Path;

use super::capture::{WindowLight, take_frame};
use super::folder::{CalibratedPosition, calibrate_position, read_manifest};
use super::landing::{FinePsf, Spot};
use super::manifest::MANIFEST_FILE;
use super::measure::{extract, l1};
use super::{Manifest, PsfCalibrationError};
use petzval_base::InFile;
use petzval_camera::image::CHANNELS;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Noise, NoiseMode, SensorModel};
use petzval_files::raw_file::{RawFormat, RawFrame, save_raw_alone, sidecar_path};

const SIDE: usize = 64;
const PLACEMENT: Placement = Placement { row: 801, col: 1200 };
const SPOT: Spot = Spot { row: 31.3, col: 32.4, azimuth_rad: 0.6 };

/// The calibrated sensor, with more lines.
fn sensor(more: &str) -> SensorModel {
    let text = include_str!("../../../petzval-data/data/sensors/imx249-calibrated.toml");
    petzval_files::parse_sensor(&format!("{text}\n{more}")).unwrap()
}

/// A core of two pixels with a wide surround.
fn fine() -> FinePsf {
    let grid = 96;
    let spot = |i: usize| {
        let (y, x) = ((i / grid) as f64 - 47.5, (i % grid) as f64 - 47.5);
        let gauss = |s: f64| (-0.5 * (x * x + y * y) / (s * s)).exp();
        gauss(5.0) + 0.05 * gauss(13.0)
    };
    let sum: f64 = (0..grid * grid).map(spot).sum();
    let values: Vec<f64> = (0..grid * grid).map(|i| spot(i) / sum).collect();
    let values = [values.clone(), values.clone(), values];
    FinePsf { grid, pitch_um: 1.0, values, light: [5.0e6, 7.0e6, 4.0e6], disc_um: 0.0 }
}

/// How captures are taken; as they should be by default.
struct Bench {
    sensor: SensorModel,
    /// Times at which frames are taken, ms.
    taken_ms: Vec<f64>,
    /// Times that the manifest says.
    said_ms: Vec<f64>,
    frames: usize,
    dark_frames: usize,
    /// 1 fills half of the range at 16 ms.
    brightness: f64,
    /// Where the source is: (exposure, frame) to an offset (row, column), px; `None` for a source that is off.
    offset: fn(usize, usize) -> Option<[f64; 2]>,
    /// A fainter source: offset from the first, px, and share.
    second: Option<([f64; 2], f64)>,
    /// More lines of the position.
    position: &'static str,
    seed: u64,
}

impl Default for Bench {
    fn default() -> Self {
        Self {
            sensor: sensor(""),
            taken_ms: vec![1.0, 4.0, 16.0],
            said_ms: vec![1.0, 4.0, 16.0],
            frames: 10,
            dark_frames: 10,
            brightness: 1.0,
            offset: |_, _| Some([0.0; 2]),
            second: None,
            position: "",
            seed: 1,
        }
    }
}

impl Bench {
    fn light(&self, offset: Option<[f64; 2]>) -> WindowLight {
        let mut rate_e_per_s: [Vec<f64>; CHANNELS] = std::array::from_fn(|_| vec![0.0; SIDE * SIDE]);
        let mut add = |[down, right]: [f64; 2], share: f64| {
            let spot = Spot { row: SPOT.row + down, col: SPOT.col + right, ..SPOT };
            for (to, from) in rate_e_per_s.iter_mut().zip(fine().land(spot, 5.86, (SIDE, SIDE))) {
                to.iter_mut().zip(from).for_each(|(to, from)| *to += self.brightness * share * from);
            }
        };
        if let Some([down, right]) = offset {
            add([down, right], 1.0);
            if let Some(([row, col], share)) = self.second {
                add([down + row, right + col], share);
            }
        }
        WindowLight { height: SIDE, width: SIDE, placement: PLACEMENT, rate_e_per_s }
    }

    /// Writes frames and manifest to a folder.
    fn take(&self, folder: &Path) {
        let mut text = format!(
            "sensor = \"s\"\n[[position]]\nname = \"p\"\norigin = [{}, {}]\n{}\n",
            PLACEMENT.row, PLACEMENT.col, self.position
        );
        let mut number = 0;
        for (k, (taken, said)) in self.taken_ms.iter().zip(&self.said_ms).enumerate() {
            let mut take = |light: &WindowLight, name: &str| {
                let noise = Noise { mode: NoiseMode::Exact, seed: self.seed };
                let raw = take_frame(light, &self.sensor, 1e-3 * taken, 1.0, &noise, number).unwrap();
                number += 1;
                let path = folder.join(name);
                save_raw_alone(&RawFrame::from_raw(&raw, &self.sensor), &path, RawFormat::Png).unwrap();
                format!("\"{name}\"")
            };
            let frames: Vec<String> = (0..self.frames)
                .map(|n| take(&self.light((self.offset)(k, n)), &format!("{k}-{n}.png")))
                .collect();
            let dark: Vec<String> = (0..self.dark_frames)
                .map(|n| take(&self.light(None), &format!("{k}-dark-{n}.png")))
                .collect();
            text += &format!(
                "[[position.exposure]]\nexposure_ms = {said:?}\nframes = [{}]\ndark_frames = [{}]\n",
                frames.join(", "),
                dark.join(", ")
            );
        }
        std::fs::write(folder.join(MANIFEST_FILE), text).unwrap();
    }

    fn calibrate(&self) -> CalibratedPosition {
        let folder = tempfile::tempdir().unwrap();
        self.take(folder.path());
        measured(folder.path(), &self.sensor).unwrap()
    }

    /// Mean squared error of the merged rates over their variance.
    fn chi2(&self, position: &CalibratedPosition) -> f64 {
        let truth = position.frame.mosaic(&self.light(Some([0.0; 2])).rate_e_per_s);
        let merged = &position.merged;
        let z2 = |((a, b), v): ((&f64, &f64), &f64)| (a - b).powi(2) / v;
        merged.rate_e_per_s.iter().zip(&truth).zip(&merged.variance).map(z2).sum::<f64>() / truth.len() as f64
    }

    /// L1 distance of each channel from the PSF without noise, over the predicted floor.
    fn l1_over_floor(&self, position: &CalibratedPosition) -> [f64; CHANNELS] {
        let m = &position.measured;
        let truth = position.frame.mosaic(&self.light(Some([0.0; 2])).rate_e_per_s);
        let start = m.psf.centroid_px[1];
        let psf = extract(&truth, &position.frame, start, Some(m.psf.corner), "truth").unwrap();
        std::array::from_fn(|c| l1(&psf.values[c], &m.psf.values[c]) / m.floor.l1[c])
    }
}

fn measured(folder: &Path, sensor: &SensorModel) -> Result<CalibratedPosition, PsfCalibrationError> {
    let (manifest, text, _): (Manifest, String, _) = read_manifest(folder)?;
    calibrate_position((&manifest, &text), folder, 0, sensor, 1, || Ok(()))
}

/// The one warning that is given.
fn only(position: &CalibratedPosition) -> &str {
    assert_eq!(position.warnings.len(), 1, "{:#?}", position.warnings);
    &position.warnings[0]
}

#[test]
fn good_captures_give_no_warnings() {
    for seed in 0..4 {
        for (frames, brightness) in [(1, 1.0), (3, 0.1), (10, 1.0), (20, 0.3)] {
            let bench = Bench { seed, frames, brightness, ..Bench::default() };
            let position = bench.calibrate();
            assert!(position.warnings.is_empty(), "{:#?}", position.warnings);
        }
    }
    // The longest exposure may clip, and the sensor may have every kind of non-uniformity.
    let sensor = sensor(
        "[nonuniformity]\ndsnu_pixel_e = 8.0\nprnu_pixel_percent = 0.5\nrow_noise_e = 4.0\ncolumn_noise_e = 4.0\n\
         hot_pixel_share = 0.003\nhot_pixel_e_per_s = 100000.0",
    );
    for seed in 0..4 {
        let bench = Bench { seed, brightness: 4.0, sensor: sensor.clone(), ..Bench::default() };
        let position = bench.calibrate();
        assert!(position.exposures[2].saturated_pixels > 0);
        assert!(position.warnings.is_empty(), "{:#?}", position.warnings);
    }
}

#[test]
fn a_source_that_moves_between_clipped_exposures_gives_a_warning() {
    for frames in [1, 10] {
        let offset = |k: usize, _: usize| Some(if k == 0 { [0.0; 2] } else { [0.0, 4.0] });
        let position = Bench { frames, brightness: 12.0, offset, ..Bench::default() }.calibrate();
        assert!(position.exposures[1].saturated_pixels > 0, "every pair has a clipped one");
        let is_meant =
            |w: &String| w.starts_with("the source moved by") && w.contains("between the 1 and the 4 ms");
        assert!(position.warnings.iter().any(is_meant), "{:#?}", position.warnings);
    }
    // A fifth of a pixel, and nothing clips.
    let offset = |k: usize, _: usize| Some(if k < 2 { [0.0; 2] } else { [0.2, 0.0] });
    let position = Bench { offset, ..Bench::default() }.calibrate();
    let is_meant = |w: &String| w.contains("between the 4 and the 16 ms");
    assert!(position.warnings.iter().any(is_meant), "{:#?}", position.warnings);
}

#[test]
fn a_steady_drift_of_two_or_more_frames_gives_a_warning() {
    for frames in [2, 4, 6, 20] {
        let offset = |_: usize, n: usize| Some([0.0, 0.1 * n as f64]);
        let position = Bench { frames, offset, ..Bench::default() }.calibrate();
        let found: Vec<&String> =
            position.warnings.iter().filter(|w| w.contains("during the 16 ms frames")).collect();
        assert_eq!(found.len(), 1, "{frames} frames: {:#?}", position.warnings);
        let said: f64 = found[0].split(' ').nth(4).unwrap().parse().unwrap();
        let is = 0.1 * (frames - 1) as f64;
        assert!((0.6 * is..1.5 * is).contains(&said), "{said} instead of {is}");
    }
}

#[test]
fn a_frame_with_the_source_elsewhere_is_named() {
    let stray = |k: usize, n: usize| Some(if (k, n) == (2, 3) { [3.0, 0.0] } else { [0.0; 2] });
    let position = Bench { frames: 20, offset: stray, ..Bench::default() }.calibrate();
    let is_meant =
        |w: &String| w.starts_with("2-3.png: the source is") && w.contains("from where the other frames");
    assert!(position.warnings.iter().any(is_meant), "{:#?}", position.warnings);
    assert!(!position.warnings.iter().any(|w| w.contains("during")), "{:#?}", position.warnings);

    let off = |k: usize, n: usize| if (k, n) == (1, 5) { None } else { Some([0.0; 2]) };
    let position = Bench { frames: 20, offset: off, ..Bench::default() }.calibrate();
    let is_meant = |w: &String| w.starts_with("1-5.png: the source is not in it");
    assert!(position.warnings.iter().any(is_meant), "{:#?}", position.warnings);
}

#[test]
fn a_wrong_exposure_time_gives_a_warning() {
    let said_ms = vec![1.0, 4.0, 20.0];
    let position = Bench { said_ms, ..Bench::default() }.calibrate();
    let disagreement = position.warnings.iter().find(|w| w.starts_with("the 20 ms frames disagree")).unwrap();
    assert!(
        disagreement.contains("0.80") || disagreement.contains("0.79"),
        "16 ms of light said to be 20: {disagreement}"
    );
    let agreement = position.exposures[2].agreement.unwrap();
    assert!((agreement.ratio - 0.8).abs() < 0.01 && agreement.chi2 > 100.0, "{agreement:?}");
    // Of good captures the mean squared difference is that of noise; 5 standard deviations of a mean of n squares.
    let position = Bench::default().calibrate();
    for e in &position.exposures {
        let a = e.agreement.unwrap();
        assert!((a.chi2 - 1.0).abs() < 5.0 * (2.0 / a.pixels as f64).sqrt(), "{a:?}");
    }
}

#[test]
fn the_noise_floor_includes_non_uniformity() {
    // DSNU without dark frames, PRNU, noise of rows and columns: rates are as far off as their variance says.
    for (more, dark_frames) in [
        ("dsnu_pixel_e = 8.0", 0),
        ("dsnu_pixel_e = 8.0", 10),
        ("prnu_pixel_percent = 0.8", 10),
        ("row_noise_e = 8.0\ncolumn_noise_e = 8.0", 10),
    ] {
        let sensor = sensor(&format!("[nonuniformity]\n{more}"));
        let bench = Bench { sensor, dark_frames, frames: 20, ..Bench::default() };
        let position = bench.calibrate();
        let chi2 = bench.chi2(&position);
        // 4096 squares, but rows and columns share theirs: 64 of each in three exposures.
        let shared = if more.contains("row") { 64.0 } else { 4096.0 };
        assert!(
            (chi2 - 1.0).abs() < 5.0 * (2.0f64 / shared).sqrt(),
            "{more}, {dark_frames} dark frames: {chi2}"
        );
        // Rows keep their neighbours' error, which one frame's L1 shows and independent draws do not: half as much again.
        for ratio in bench.l1_over_floor(&position) {
            assert!((0.5..1.6).contains(&ratio), "{more}, {dark_frames} dark frames: {ratio}");
        }
        for e in &position.exposures {
            let ratio = e.variance_ratio.unwrap();
            assert!((ratio - 1.0).abs() < 0.15, "{more}: {ratio}");
        }
        let is_warned = position.warnings.iter().any(|w| w.contains("offsets that scatter by 8.0 e"));
        assert_eq!(is_warned, dark_frames == 0, "{:#?}", position.warnings);
    }
}

#[test]
fn hot_pixels_are_named_and_harmless_with_and_without_dark_frames() {
    let sensor = sensor("[nonuniformity]\nhot_pixel_share = 0.003\nhot_pixel_e_per_s = 200000.0");
    let pattern = sensor.fixed_pattern(PLACEMENT, SIDE, SIDE);
    assert!(pattern.dark_e_per_s.iter().filter(|v| **v > 0.0).count() > 5);
    for dark_frames in [0, 10] {
        let bench = Bench { sensor: sensor.clone(), dark_frames, frames: 20, ..Bench::default() };
        let position = bench.calibrate();
        let warns = |what: &str| position.warnings.iter().any(|w| w.contains(what));
        assert_eq!(warns("hot pixels, replaced"), dark_frames == 0, "{:#?}", position.warnings);
        assert_eq!(warns("0.30 % hot pixels"), dark_frames == 0, "{:#?}", position.warnings);
        assert!(!warns("moved"), "{:#?}", position.warnings);
        for ratio in bench.l1_over_floor(&position) {
            assert!((0.5..1.6).contains(&ratio), "{dark_frames} dark frames: {ratio}");
        }
    }
}

#[test]
fn a_hot_pixel_is_not_the_source() {
    let folder = tempfile::tempdir().unwrap();
    let bench = Bench {
        taken_ms: vec![16.0],
        said_ms: vec![16.0],
        brightness: 0.02,
        dark_frames: 0,
        ..Bench::default()
    };
    bench.take(folder.path());
    // One pixel near the corner at the end of the converter: brighter than all of the source's 3x3.
    for n in 0..bench.frames {
        let path = folder.path().join(format!("0-{n}.png"));
        let mut frame = petzval_files::raw_file::load_raw(&path).unwrap();
        frame.dn[5 * SIDE + 6] = 4095;
        save_raw_alone(&frame, &path, RawFormat::Png).unwrap();
    }
    let position = measured(folder.path(), &bench.sensor).unwrap();
    let [row, col] = position.measured.psf.centroid_px[1];
    assert!((row - SPOT.row).hypot(col - SPOT.col) < 0.5, "{row} {col}");
    assert!(position.warnings.iter().any(|w| w.contains("1 hot pixels") && w.contains("(806, 1206)")));
}

#[test]
fn subtracting_dark_frames_is_not_taken_for_a_moving_source() {
    // Offsets of 300 electrons beside a faint source; the sensor model does not contain them.
    let odd = sensor("[nonuniformity]\ndsnu_pixel_e = 300.0");
    let stated = sensor("");
    let folder = tempfile::tempdir().unwrap();
    for seed in 0..3 {
        let bench = Bench { sensor: odd.clone(), brightness: 0.1, frames: 20, seed, ..Bench::default() };
        bench.take(folder.path());
        let position = measured(folder.path(), &stated).unwrap();
        assert!(!position.warnings.iter().any(|w| w.contains("moved")), "{:#?}", position.warnings);
    }
}

#[test]
fn the_scatter_reveals_frames_of_another_sensor() {
    let folder = tempfile::tempdir().unwrap();
    Bench::default().take(folder.path());
    let quieter = SensorModel { electronics_noise_dn: 0.3, ..sensor("") };
    let position = measured(folder.path(), &quieter).unwrap();
    assert!(position.warnings.iter().any(|w| w.contains("times the variance of the sensor model")));
}

#[test]
fn an_unexpected_position_and_a_second_source_give_warnings() {
    let bench = Bench { position: "expected_px = [832.3, 1262.4]", ..Bench::default() };
    assert!(only(&bench.calibrate()).starts_with("the source is 30 px from where the manifest expects it"));

    for (offset, share) in [([0.0, 9.0], 0.5), ([7.0, -6.0], 0.3), ([0.0, 25.0], 0.3)] {
        let position = Bench { second: Some((offset, share)), ..Bench::default() }.calibrate();
        assert!(only(&position).starts_with("another source at row"), "{:#?}", position.warnings);
        let (at, found) = position.measured.other_sources[0];
        let off = (at[0] as f64 - SPOT.row - offset[0]).hypot(at[1] as f64 - SPOT.col - offset[1]);
        assert!(off < 1.5 && (found / share - 1.0).abs() < 0.5, "{at:?} {found}");
    }
}

#[test]
fn sidecars_that_contradict_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let bench = Bench { frames: 2, dark_frames: 1, ..Bench::default() };
    bench.take(folder.path());
    let sidecar = |name: &str| sidecar_path(&folder.path().join(name));
    // The sensor is RGGB; a frame from row 801, column 1200 on starts with a line of green and blue.
    for (good, bad, is) in [
        ("cfa = \"GBRG\"", "cfa = \"RGGB\"", "row 801, column 1200"),
        ("bits = 12", "bits = 14", "the sensor has 12"),
        ("exposure_s = 0.01601", "exposure_s = 0.02", "the manifest has 0.016"),
        ("linear_gain = 1.0", "linear_gain = 2.0", "the manifest has 1"),
        ("black_level_dn = 120.0", "black_level_dn = 240.0", "the sensor has 119"),
        ("pixel_um = 5.86", "pixel_um = 3.45", "the sensor has 5.86"),
    ] {
        for name in ["2-1.png", "2-dark-0.png"] {
            std::fs::write(sidecar(name), good).unwrap();
            measured(folder.path(), &bench.sensor).unwrap_or_else(|e| panic!("{good}: {e}"));
            std::fs::write(sidecar(name), bad).unwrap();
            let error = measured(folder.path(), &bench.sensor).unwrap_err().to_string();
            assert!(error.contains(&format!("{name}.toml")) && error.contains(is), "{error}");
            assert!(error.contains(bad.split(' ').next().unwrap()), "{error}");
            std::fs::remove_file(sidecar(name)).unwrap();
        }
    }
}

#[test]
fn dark_electrons_count_for_the_full_well_in_any_frame() {
    // A well of 20 000 electrons, of which dark current fills 8000 in 16 ms; the light alone stays far below.
    let small = SensorModel { full_well_e: 20_000.0, dark_current_e_per_s: 5e5, ..sensor("") };
    let bench = Bench { sensor: small, brightness: 0.95, frames: 20, ..Bench::default() };
    let position = bench.calibrate();
    assert!(position.exposures[2].saturated_pixels > 0);
    let chi2 = bench.chi2(&position);
    assert!((chi2 - 1.0).abs() < 5.0 * (2.0f64 / 4096.0).sqrt(), "{chi2}");
}

#[test]
fn a_manifest_that_is_not_text_is_bad_input() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(MANIFEST_FILE), b"sensor = \"a\"\n# \xff\xfe\n").unwrap();
    match read_manifest(folder.path()) {
        Err(PsfCalibrationError::File(InFile { error, .. })) => {
            assert_eq!((error.line, error.message.as_str()), (Some(2), "this is not UTF-8 text"));
        }
        other => panic!("{other:?}"),
    }
}
