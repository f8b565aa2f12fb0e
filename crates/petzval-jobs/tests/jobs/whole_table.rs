//! Every row of the table from its smallest request, through JSON and back, cancelled as soon as it says something.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use cpu_time::ProcessTime;
use petzval_base::Cancel;
use petzval_jobs::{Call, Context, JobError, Silent, Table, built_in_assets, jobs};
use serde_json::{Value, json};

use crate::row_check::{calls, start_and_cancel};
use crate::small_sensor;

/// Calls of rows that need nothing, and those of rows that need what [`prepare`] makes.
const CALLS: [&str; 2] = [include_str!("../calls.json"), include_str!("../ready.json")];

/// CPU time of the whole test, at most.
const CPU: Duration = Duration::from_secs(120);

/// Rows that can take long, and look at the flag before or within the first unit of their work.
const LOOKING: [&str; 7] =
    ["data-check", "data-convert", "detect", "init", "lens-tolerance", "psf", "raw-mtf"];

/// An experiment with a detector that runs in seconds.
const LIGHTS: &str = r#"
name = "tiny lights"
task = "traffic-light"
[psf]
fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
scoring_fields = 3
scoring_blend_error = 2.0
[street]
windows = 3
held_out = 3
samples = 1
[training]
steps = 2
batch = 1
crop = 96
[scoring]
crop = 96
scores = ["ap50"]
[[variant]]
name = "nominal"
[[variant.stage]]
moves = ["network"]
"#;

fn call(job: &str, request: Value) -> Call {
    Call::new(job, request)
}

/// Makes a finished run, captures, raw frames with references, and data sets.
fn prepare(folder: &Path) {
    let at = |name: &str| folder.join(name);
    std::fs::write(at("lights.toml"), LIGHTS).unwrap();
    write_pictures(folder);
    let run = |job: &str, request: Value| {
        let context = Context::new(built_in_assets(), Arc::new(Silent));
        call(job, request).run(&context).unwrap_or_else(|error| panic!("{job}: {error}"))
    };
    run("design", json!({"run": {"new": {"experiment": at("lights.toml"), "out": at("finished")}}}));
    run(
        "psf-capture",
        json!({"lens": "cooke-triplet-nominal", "out": at("ready-pinhole"), "fields": 1, "frames": 2, "exposures_ms": [4, 16]}),
    );
    run(
        "sensor-capture",
        json!({"sensor": "imx249-fitted", "out": at("ready-series"), "gains": [1, 2], "dark_exposures": [20], "size": [40, 60]}),
    );
    run(
        "simulate",
        json!({"images": ["scene:slanted-edge"], "sensor": small_sensor(folder, 160, 200), "spectral": {"qe": "flat:0.6"}, "size": [128, 128],
            "out": at("ready-raws")}),
    );
    // Beside raw frames and their sidecars the search for parameters takes no pictures.
    std::fs::remove_file(at("ready-raws/slanted-edge-developed.png")).unwrap();
    run("isp-develop", json!({"raws": [at("ready-raws/slanted-edge-raw.tiff")], "out": at("references")}));
}

/// Pictures with two lights as a COCO data set, and one of them in the format of YOLO.
fn write_pictures(folder: &Path) {
    for name in ["lights", "yolo/images", "yolo/labels"] {
        std::fs::create_dir_all(folder.join(name)).unwrap();
    }
    let (mut images, mut annotations) = (Vec::new(), Vec::new());
    for i in 1_u8..=10 {
        let picture = image::RgbImage::from_fn(140, 120, |x, y| match (x, y) {
            (20..40, 20..60) => image::Rgb([220, 20, 20]),
            (80..100, 30..70) => image::Rgb([20, 220, 60]),
            _ => image::Rgb([90 + i; 3]),
        });
        let name = format!("{i:02}.png");
        picture.save(folder.join("lights").join(&name)).unwrap();
        images.push(json!({"id": i, "file_name": name, "width": 140, "height": 120}));
        for (k, x, y) in [(1, 20, 20), (2, 80, 30)] {
            annotations.push(json!({
                "id": 2 * i + k, "image_id": i, "category_id": k, "bbox": [x, y, 20, 40], "area": 800, "iscrowd": 0
            }));
        }
    }
    let classes = json!([{"id": 1, "name": "light red"}, {"id": 2, "name": "light green"}]);
    let data = json!({"images": images, "annotations": annotations, "categories": classes});
    std::fs::write(folder.join("lights/annotations.json"), data.to_string()).unwrap();
    std::fs::copy(folder.join("lights/01.png"), folder.join("yolo/images/01.png")).unwrap();
    std::fs::write(folder.join("yolo/labels/01.txt"), "0 0.2 0.3 0.1 0.3\n").unwrap();
    std::fs::write(folder.join("yolo/data.yaml"), "nc: 1\nnames: ['light red']\n").unwrap();
}

/// One call of each row.
fn call_of_each(folder: &str) -> BTreeMap<String, Call> {
    let all = CALLS.iter().flat_map(|text| calls(text, folder));
    let ready = all.filter(|call| !call.request.to_string().contains("missing"));
    ready.map(|call| (call.job.clone(), call)).collect()
}

/// Runs rows that can take long with a flag that is set before their first look. Their results have places of their own.
fn check_that_a_set_flag_is_seen(calls: &BTreeMap<String, Call>) {
    for name in LOOKING {
        let mut call = calls[name].clone();
        if let Some(Value::String(place)) = call.request.get_mut("out") {
            place.push_str("-cancelled");
        }
        let cancel = Cancel::default();
        cancel.set();
        let context = Context::new(built_in_assets(), Arc::new(Silent)).with_cancellation(cancel);
        let outcome = call.run(&context);
        assert!(matches!(outcome, Err(JobError::Stopped(_))), "{name}: {outcome:?}");
    }
}

#[test]
fn every_row_starts_from_its_smallest_request_and_ends_soon_after_it_is_cancelled() {
    let began = ProcessTime::now();
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let mut calls = call_of_each(&folder.path().display().to_string().replace('\\', "/"));
    assert_eq!(calls.len(), jobs().len(), "a row has no call without missing files");
    check_that_a_set_flag_is_seen(&calls);
    let table = Table::built_in();
    for row in table.rows() {
        start_and_cancel(&table, calls.remove(row.name).unwrap());
    }
    assert!(began.elapsed() < CPU, "{:?} of CPU time", began.elapsed());
}
