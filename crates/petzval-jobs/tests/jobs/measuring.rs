//! A sensor and a lens are captured and measured without the command: requests and responses as JSON, progress and notes to a
//! watcher.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use petzval_camera::sensor::CfaPattern;
use petzval_files::raw_file::Packing;
use petzval_jobs::{
    Context, Event, JobError, Watcher, built_in_assets, psf_calibrate, psf_capture, raw, sensor,
};
use petzval_lab::emva::{HighPass, Values};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Keeps everything that a job reports.
#[derive(Default)]
struct Kept {
    lines: Mutex<Vec<String>>,
    progress: Mutex<Vec<[u64; 2]>>,
    files: Mutex<Vec<PathBuf>>,
}

impl Watcher for Kept {
    fn event(&self, event: &Event) {
        match event {
            Event::Progress { done, total, .. } => self.progress.lock().unwrap().push([*done, *total]),
            Event::File { path, .. } => self.files.lock().unwrap().push(path.clone()),
            other => self.lines.lock().unwrap().push(other.to_string()),
        }
    }
}

impl Kept {
    /// Whether some line contains the text.
    fn says(&self, text: &str) -> bool {
        self.lines.lock().unwrap().iter().any(|line| line.contains(text))
    }

    /// Checks that the work came in phases with these totals, and that in each the count never falls and ends at the total;
    /// forgets it.
    fn counted(&self, totals: &[u64]) {
        let all = std::mem::take(&mut *self.progress.lock().unwrap());
        let phases: Vec<&[[u64; 2]]> = all.chunk_by(|a, b| a[1] == b[1]).collect();
        assert_eq!(phases.iter().map(|p| p[0][1]).collect::<Vec<_>>(), totals, "{all:?}");
        for phase in phases {
            assert!(phase.windows(2).all(|p| p[0][0] <= p[1][0]), "{all:?}");
            assert_eq!(phase.last().unwrap()[0], phase[0][1], "{all:?}");
        }
    }
}

fn context() -> (Context, Arc<Kept>) {
    let kept = Arc::new(Kept::default());
    (Context::new(built_in_assets(), kept.clone()), kept)
}

/// The value after a journey through JSON, which must not change it.
fn sent<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(value: T) -> T {
    let again: T = serde_json::from_str(&serde_json::to_string(&value).unwrap()).unwrap();
    assert_eq!(again, value);
    again
}

fn series(out: &Path) -> sensor::capture::Request {
    sensor::capture::Request {
        sensor: "imx249-fitted".into(),
        out: out.to_owned(),
        emva: false,
        gains: vec![1.0, 2.0, 4.0],
        exposures: None,
        dark_exposures: Some(vec![20.0]),
        stack: None,
        size: Some([40, 60]),
        level: None,
        quantum_efficiency: None,
        wavelength: None,
        format: sensor::capture::Format::Png,
        seed: 1,
    }
}

#[test]
fn a_sensor_is_listed_shown_captured_and_measured() {
    let folder = tempfile::tempdir().unwrap();
    let (context, kept) = context();
    let listed = sent(sensor::list::run(&sensor::list::Request {}, &context).unwrap()).sensors;
    assert!(listed.iter().any(|s| s.name == "imx249-fitted" && s.bits == 12));
    let request = sensor::show::Request { sensor: "imx249-fitted".into(), gains: vec![1.0, 10.0] };
    let shown = sent(sensor::show::run(&sent(request), &context).unwrap());
    assert_eq!(shown.derived.iter().map(|d| d.linear_gain).collect::<Vec<_>>(), [1.0, 10.0]);

    // Three gains of 4 flat and 5 dark pairs.
    let request = sent(series(&folder.path().join("series")));
    let written = sent(sensor::capture::run(&request, &context).unwrap());
    assert_eq!((written.frames, written.kept), (54, 0));
    kept.counted(&[54]);
    assert!(kept.says("54 frames, at most 1 MB") && kept.says("the list states no photons"));
    assert_eq!(sensor::capture::run(&request, &context).unwrap().kept, 54);
    kept.counted(&[54]);

    let request = sent(sensor::characterize::Request {
        dir: request.out,
        out: Some(folder.path().join("found")),
        highpass: HighPass::R4,
        values: Values::Corrected,
        mean_difference: true,
        fit_histograms: false,
        pixel_um: None,
    });
    let found = sensor::characterize::run(&request, &context).unwrap();
    kept.counted(&[54]);
    let k = found.characterization.joint.gain_dn_per_e;
    let (value, error) = (k.value().unwrap(), k.standard_error().unwrap());
    // Six standard errors: K of a small series is known to some percent.
    assert!((value - 0.14).abs() < 6.0 * error && error < 0.02, "{value} +- {error}");
    assert!(found.files.len() > 5 && found.files.iter().all(|file| file.is_file()), "{:?}", found.files);
    // What a job writes it says.
    let said = kept.files.lock().unwrap().clone();
    assert!(found.files.iter().all(|file| said.contains(file)), "{said:?}");
}

#[test]
fn a_setting_that_cannot_be_used_is_named_as_the_request_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let (context, _) = context();
    let out = folder.path().join("never");
    for (request, name) in [
        (sensor::capture::Request { size: Some([5000, 80]), ..series(&out) }, "size"),
        (sensor::capture::Request { gains: vec![1.0, 1.0], ..series(&out) }, "gains"),
        (sensor::capture::Request { dark_exposures: Some(vec![-1.0]), ..series(&out) }, "dark_exposures"),
        (sensor::capture::Request { stack: Some(2), ..series(&out) }, "stack"),
        (sensor::capture::Request { level: Some(f64::NAN), ..series(&out) }, "level"),
        (sensor::capture::Request { quantum_efficiency: Some(60.0), ..series(&out) }, "quantum_efficiency"),
        (sensor::capture::Request { wavelength: Some(550.0), ..series(&out) }, "wavelength"),
    ] {
        let error = sensor::capture::run(&request, &context).unwrap_err();
        assert!(matches!(error, JobError::Setting { key, .. } if key == name), "{name}: {error:?}");
    }
    assert!(!out.exists());
}

#[test]
fn a_raw_frame_is_converted_and_summarised() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (context, _) = context();
    let dn: Vec<u16> = (0..24).map(|i| 119 + 100 * i).collect();
    image::ImageBuffer::<image::Luma<u16>, _>::from_raw(6, 4, dn).unwrap().save(at("a.tiff")).unwrap();
    let request = sent(raw::convert::Request {
        input: at("a.tiff"),
        output: at("b.raw"),
        packing: Some(Packing::Lsb),
        bits: Some(12),
        cfa: Some(CfaPattern::GRBG),
        black_level_dn: Some(119.0),
        white_level_dn: None,
        time_s: Some(0.0025),
        gain: None,
        pixel_um: None,
    });
    let written = sent(raw::convert::run(&request, &context).unwrap());
    assert!(written.sidecar.ends_with("b.raw.toml") && written.sidecar.is_file());
    let shown = raw::show::run(&sent(raw::show::Request { file: at("b.raw") }), &context).unwrap();
    assert_eq!(shown, written.frame);
    assert_eq!((shown.height, shown.width, shown.colours.len()), (4, 6, 3));

    let wrong = raw::convert::Request { time_s: Some(-1.0), ..request };
    let error = raw::convert::run(&wrong, &context).unwrap_err();
    assert!(matches!(error, JobError::Setting { key: "time_s", .. }), "{error:?}");
}

#[test]
fn a_pinhole_is_captured_and_its_psf_measured() {
    let folder = tempfile::tempdir().unwrap();
    let (context, kept) = context();
    let request = sent(psf_capture::Request {
        lens: "cooke-triplet-nominal".into(),
        out: folder.path().join("captures"),
        sensor: "imx249-calibrated".into(),
        distance_mm: 1500.0,
        pinhole_um: 75.0,
        focus: psf_capture::Focus::Source,
        fields: 1,
        radius_mm: 3.0,
        axes: vec![psf_capture::Axis::Vertical, psf_capture::Axis::Diagonal],
        exposures_ms: vec![4.0, 16.0],
        frames: 6,
        dark_frames: 2,
        peak: 0.8,
        window: 64,
        seed: 1,
    });
    let written = sent(psf_capture::run(&request, &context).unwrap());
    kept.counted(&[16]);
    // All directions share the field on the axis.
    let [axis] = &written.captures.positions[..] else { panic!("{written:?}") };
    assert_eq!((axis.name.as_str(), written.frames), ("axis", 16));

    let request =
        sent(psf_calibrate::Request { captures: request.out, lens: Some(request.lens), out: None, seed: 1 });
    let found = sent(psf_calibrate::run(&request, &context).unwrap());
    // The fit of the bank is a phase of its own.
    kept.counted(&[16, 1]);
    let [position] = &found.figures.positions[..] else { panic!("{found:?}") };
    // The green centroid lies where the chief ray was sent, up to what demosaicing does to a spot of a few pixels.
    let off = [0, 1].map(|i| (position.centroid_px[1][i] - axis.chief_ray_px[i]).abs());
    assert!(off.iter().all(|o| *o < 0.3), "{off:?}");
    assert_eq!(found.figures.bank.fit[0].held_out.by, psf_calibrate::HeldOutBy::Pixels);
    // The file holds the same figures.
    let text = std::fs::read_to_string(found.out.join("calibration.json")).unwrap();
    assert_eq!(serde_json::from_str::<psf_calibrate::Figures>(&text).unwrap(), found.figures);
}
