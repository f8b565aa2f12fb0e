//! A bank of PSFs in a file takes the place of a lens: in a simulation, in an experiment, and in the cameras of a finished run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_base::Cancel;
use petzval_camera::image::LinearImage;
use petzval_design::experiment::PsfConfig;
use petzval_files::psf_file::{PsfAxes, PsfFile, read_psfs, write_psfs};
use petzval_files::raw_file::load_raw;
use petzval_files::{FloatType, parse_sensor, save_png16};
use petzval_jobs::{Call, Context, Event, JobError, Silent, Watcher, built_in_assets, psf, simulate};
use serde_json::{Value, json};

const LENS: &str = "cooke-triplet-nominal";

fn context() -> Context {
    Context::new(built_in_assets(), Arc::new(Silent))
}

/// A sensor of few large pixels, 4.5 mm from its centre to its corner.
fn sensor(folder: &Path) -> PathBuf {
    let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
    let small = [
        ("height = 1200", "height = 240"),
        ("width = 1920", "width = 384"),
        ("pixel_um = 5.86", "pixel_um = 20.0"),
    ];
    let text = small.iter().fold(text.to_owned(), |text, (from, to)| {
        assert!(text.contains(from));
        text.replace(from, to)
    });
    let path = folder.join("sensor.toml");
    std::fs::write(&path, text).unwrap();
    path
}

/// A picture with edges everywhere.
fn photo(folder: &Path) -> PathBuf {
    let mut light = LinearImage::filled(3, 240, 384, 0.1);
    for (row, col) in (0..240).flat_map(|row| (0..384).map(move |col| (row, col))) {
        if (row / 16 + col / 16) % 2 == 0 {
            (0..3).for_each(|colour| light.set(colour, row, col, 0.3 + 0.2 * colour as f32));
        }
    }
    let path = folder.join("photo.png");
    save_png16(&light, &path).unwrap();
    path
}

/// The fields, grid and pupil of the PSFs that a simulation traces.
fn as_simulated(sensor: &Path) -> psf::Request {
    let (config, text) = (PsfConfig::default(), std::fs::read_to_string(sensor).unwrap());
    let plan = config.plan(&parse_sensor(&text).unwrap(), config.scoring_pupil_cells).unwrap();
    psf::Request {
        lens: LENS.into(),
        fields: config.scoring_fields,
        corner_mm: *plan.field_radius_mm.last().unwrap(),
        wavelengths: config.wavelengths_um.to_vec(),
        grid: config.grid,
        pitch_um: config.pitch_um,
        pupil_cells: config.scoring_pupil_cells,
        pupil_error: config.scoring_pupil_error,
        ..psf::Request::default()
    }
}

#[test]
fn a_bank_of_a_lens_gives_the_frames_of_the_lens() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let sensor = sensor(at);
    let out = at.join("psfs");
    psf::run(&psf::Request { out: out.clone(), ..as_simulated(&sensor) }, &context()).unwrap();
    let request = simulate::Request {
        images: vec![photo(at)],
        lens: LENS.into(),
        sensor: sensor.to_str().unwrap().into(),
        ..simulate::Request::default()
    };
    let mut number = 0;
    let mut frame = |psfs: Option<&Path>, no_distortion: bool| -> Vec<u16> {
        number += 1;
        let out = at.join(format!("frame-{number}"));
        let psfs = psfs.map(Path::to_path_buf);
        let request = simulate::Request { psfs, no_distortion, out: out.clone(), ..request.clone() };
        simulate::run(&request, &context()).unwrap();
        load_raw(&out.join("photo-raw.tiff")).unwrap().dn
    };
    // With the fields and the grid of the simulation, every number is the same; so it is in single precision, in which the renderer works.
    let of_lens = frame(None, true);
    assert!(frame(Some(&out), true) == of_lens);
    let single = at.join("single");
    write_psfs(&read_psfs(&out).unwrap(), &single, FloatType::Float32).unwrap();
    assert!(frame(Some(&single), true) == of_lens);
    // Half precision has 11 bits, and the frame noise of ten DN and more: the mean difference is a fraction of one.
    let half = at.join("half");
    write_psfs(&read_psfs(&out).unwrap(), &half, FloatType::Float16).unwrap();
    let off = |a: &[u16], b: &[u16]| {
        let all = a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)));
        (all.clone().sum::<f64>() / a.len() as f64, all.fold(0.0, f64::max))
    };
    let (mean, _) = off(&frame(Some(&half), true), &of_lens);
    assert!(mean < 0.5, "{mean}");
    // Distortion follows from the angles in degrees, which round: one number in a thousand may fall on the other side of a half.
    let distorted = frame(None, false);
    assert!(off(&distorted, &of_lens).0 > 1.0, "the lens distorts");
    let (mean, most) = off(&frame(Some(&out), false), &distorted);
    assert!(mean < 1e-3 && most <= 1.0, "{mean}, {most}");
    // A coarser bank is near.
    let coarse = at.join("coarse");
    let few = psf::Request { fields: 13, out: coarse.clone(), ..as_simulated(&sensor) };
    psf::run(&few, &context()).unwrap();
    let (mean, _) = off(&frame(Some(&coarse), true), &of_lens);
    assert!(mean > 0.0 && mean < 2.0, "{mean}");
}

/// An experiment that runs in seconds, with the PSFs of a file.
fn experiment(folder: &Path) -> String {
    sensor(folder);
    let request = psf::Request {
        lens: LENS.into(),
        out: folder.join("bank"),
        fields: 5,
        corner_mm: 4.6,
        grid: 33,
        pitch_um: 6.0,
        pupil_cells: 32,
        pupil_error: 2.0,
        ..psf::Request::default()
    };
    // A grid of an odd number of cells, as measured banks have.
    psf::run(&request, &context()).unwrap();
    r#"
name = "with a file"
lens = "cooke-triplet-nominal"
sensor = "sensor.toml"
[psf]
kind = "file"
file = "bank"
fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
scoring_fields = 3
scoring_blend_error = 2.0
[network]
base_channels = 4
levels = 1
weights = "none"
[training]
steps = 6
batch = 1
crop = 64
[scoring]
crop = 64
scores = ["psnr_db"]
[checkpoint]
every = 2
[[variant]]
name = "measured"
[[variant.stage]]
moves = ["network"]
"#
    .to_owned()
}

fn run(job: &str, request: Value, context: &Context) -> Result<Value, JobError> {
    Call::new(job, request).run(context)
}

/// Cancels a job after some steps.
struct After(u64, Cancel);

impl Watcher for After {
    fn event(&self, event: &Event) {
        if let Event::Step { step, .. } = event
            && *step >= self.0
        {
            self.1.set();
        }
    }
}

#[test]
fn an_experiment_holds_the_psfs_of_a_file_and_its_run_stands_on_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = experiment(at);
    let file = at.join("mine.toml");
    std::fs::write(&file, &text).unwrap();
    let new = |out: &str| json!({"run": {"new": {"experiment": file, "out": at.join(out)}}});
    let whole = run("design", new("whole"), &context()).unwrap();
    let score = |response: &Value| response["metrics"]["rows"][0]["psnr_db"].as_f64().unwrap();
    assert!(score(&whole) > 5.0, "{whole}");

    // The PSFs are inputs of the run, and kept in it.
    let inputs = std::fs::read_to_string(at.join("whole/inputs/inputs.json")).unwrap();
    assert!(inputs.contains("\"PSFs\""), "{inputs}");
    let [own, kept] = ["bank", "whole/inputs/psfs"].map(|name| read_psfs(&at.join(name)).unwrap());
    assert_eq!(own, kept);
    let config = std::fs::read_to_string(at.join("whole/config.toml")).unwrap();
    assert!(config.contains("file = \"inputs/psfs/psf.json\""), "{config}");

    // Stopped, and resumed where the file is no longer: the same bits.
    let cancel = Cancel::default();
    let stopping =
        Context::new(built_in_assets(), Arc::new(After(3, cancel.clone()))).with_cancellation(cancel);
    let stopped = run("design", new("stopped"), &stopping).unwrap_err();
    assert!(matches!(stopped, JobError::Stopped(_)), "{stopped}");
    std::fs::rename(at.join("bank"), at.join("elsewhere")).unwrap();
    let resumed = run("design", json!({"run": {"resume": {"run": at.join("stopped")}}}), &context()).unwrap();
    assert_eq!(resumed["metrics"], whole["metrics"]);
    // Other PSFs in the run are not those that it began with.
    let mut other = kept.clone();
    other.illumination[3] *= 0.5;
    let inside = at.join("stopped/inputs/psfs");
    write_psfs(&other, &inside, FloatType::Float64).unwrap();
    let request = json!({"run": at.join("stopped")});
    let error = run("evaluate", request.clone(), &context()).unwrap_err().to_string();
    assert!(error.contains("the PSFs"), "{error}");
    write_psfs(&kept, &inside, FloatType::Float64).unwrap();
    let again = run("evaluate", request, &context()).unwrap();
    assert_eq!(again["largest_difference_from_run"], 0.0, "{again}");

    // Cameras of a finished run with other PSFs: a wide blur costs, the PSFs of the run cost nothing.
    let mut wide = kept.clone();
    let cells = wide.shape[2] * wide.shape[3];
    wide.values = vec![1.0 / cells as f64; wide.values.len()];
    write_psfs(&wide, &at.join("wide"), FloatType::Float32).unwrap();
    let scored = |psfs: &str| {
        run("evaluate", json!({"run": at.join("whole"), "psfs": at.join(psfs)}), &context()).unwrap()
    };
    assert_eq!(score(&scored("elsewhere")), score(&whole));
    assert!(score(&scored("wide")) < score(&whole) - 0.5, "{} {}", score(&scored("wide")), score(&whole));
    let traced = run("evaluate", json!({"run": at.join("whole"), "psf": "geometric"}), &context()).unwrap();
    assert!((score(&traced) - score(&whole)).abs() > 0.0);

    let image = photo(at);
    let applied = |psfs: Option<&str>, out: &str| {
        let psfs = psfs.map(|name| at.join(name));
        let request = json!({"run": at.join("whole"), "images": [image], "psfs": psfs, "out": at.join(out)});
        run("apply", request, &context()).unwrap();
        std::fs::read(at.join(out).join("photo-measured.png")).unwrap()
    };
    let own = applied(None, "own");
    assert!(applied(Some("elsewhere"), "same") == own);
    assert!(applied(Some("wide"), "blurred") != own);

    // What does not go together.
    for (request, says) in [
        (json!({"run": at.join("whole"), "psfs": at.join("wide"), "psf": "geometric"}), "rays or waves"),
        (json!({"run": at.join("whole"), "psfs": at.join("wide"), "made": {"trials": 1}}), "made cameras"),
        (json!({"run": at.join("whole"), "made": {"trials": 1}}), "PSFs of a file"),
        (json!({"run": at.join("whole"), "psfs": at.join("none")}), "results of `petzval psf`"),
    ] {
        let error = run("evaluate", request, &context()).unwrap_err();
        let report = error.report();
        assert!(format!("{} {}", report.message, report.hint).contains(says), "{report:?}");
    }
}

#[test]
fn what_does_not_fit_held_psfs_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = experiment(at);
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from));
        let file = at.join("wrong.toml");
        std::fs::write(&file, text.replacen(from, to, 1)).unwrap();
        let request = json!({"run": {"new": {"experiment": file, "out": at.join("never")}}});
        let report = run("design", request, &context()).unwrap_err().report();
        assert!(!at.join("never").exists());
        (format!("{} ({})", report.message, report.hint), report.place.unwrap_or_default())
    };
    for (from, to, key, says) in [
        (
            "moves = [\"network\"]",
            "moves = [\"optics\", \"network\"]",
            "moves",
            "are held, so that its lens cannot move",
        ),
        ("[[variant.stage]]", "lens = \"perfect\"\n[[variant.stage]]", "lens", "whatever its lens"),
        ("file = \"bank\"\n", "", "kind", "psf.file does not name the file"),
        ("kind = \"file\"", "kind = \"geometric\"", "file", "psf.kind is another"),
        ("file = \"bank\"", "file = \"no-such\"", "file", "`petzval psf-calibrate` wrote"),
        ("kind = \"file\"", "kind = \"files\"", "kind", "did you mean \"file\"?"),
    ] {
        let (message, place) = refused(from, to);
        assert!(message.contains(says) && place.key == key && place.line.is_some(), "{message} {place:?}");
    }
    // A bank that no camera can take is named with its key.
    let bank = read_psfs(&at.join("bank")).unwrap();
    let off_axis: Vec<f64> = bank.axes.field_radius_mm.iter().map(|mm| mm + 0.5).collect();
    let bank = PsfFile { axes: PsfAxes { field_radius_mm: off_axis, ..bank.axes.clone() }, ..bank };
    write_psfs(&bank, &at.join("beside"), FloatType::Float64).unwrap();
    let (message, place) = refused("file = \"bank\"", "file = \"beside\"");
    assert!(
        message.contains("no field lies on the axis") && place.key == "field_radius_mm",
        "{message} {place:?}"
    );
    assert!(place.path.unwrap().ends_with("beside/psf.json"));
}
