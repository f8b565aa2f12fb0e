//! Runs that name the class of every pixel: of streets, and of pictures with label images of one's own.

use std::collections::BTreeSet;
use std::path::Path;

use image::{ImageBuffer, Luma, Rgb, RgbImage};

use crate::common::{data, read, read_json, run_fails, run_ok};

const TINY: &str = r#"
name = "tiny streets"
task = "street-segmentation"
[psf]
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
levels = 2
[street]
windows = 4
held_out = 4
samples = 1
[training]
steps = 6
batch = 1
crop = 96
[optics]
steps = 2
[scoring]
crop = 96
scores = ["miou", "pixel_accuracy", "iou_road", "iou_sky"]
[checkpoint]
every = 2
[[variant]]
name = "nominal"
[[variant.stage]]
moves = ["network"]
[[variant]]
name = "end-to-end"
from = "nominal"
[[variant.stage]]
moves = ["optics", "network"]
"#;

#[test]
fn a_run_on_streets_is_scored_again_reported_and_applied() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    std::fs::write(root.join("tiny.toml"), TINY).unwrap();
    let said = run_ok(root, &["design", "tiny.toml", "--out", "run"]);
    assert!(said.stdout.contains("mIoU") && said.stdout.contains("network steps"), "{}", said.stdout);
    assert!(said.stdout.contains("over 4 windows of held-out scenes"), "{}", said.stdout);
    let rows = read_json(&root.join("run/metrics.json"))["rows"].clone();
    for row in rows.as_array().unwrap() {
        for score in ["miou", "pixel_accuracy"] {
            let [low, high] = [0, 1].map(|end| row["intervals"][score][end].as_f64().unwrap_or(0.0));
            let value = row[score].as_f64().unwrap();
            assert!((0.0..=1.0).contains(&value) && low <= value && value <= high.max(value), "{row}");
        }
    }
    // Its lens moved by the loss of the network.
    assert_ne!(rows[0]["rms_spot_um"], rows[1]["rms_spot_um"]);
    let report = read(&root.join("run/report.html"));
    for words in ["Segmentation", "what is taken for what", "wrong pixels", "vegetation", "class-legend"] {
        assert!(report.contains(words), "{words}");
    }
    let again = run_ok(root, &["evaluate", "run"]);
    assert!(again.stdout.contains("own figures: 0.000e0"), "{}", again.stdout);
    run_ok(root, &["report", "run"]);
    run_ok(root, &["compare", "run", "--out", "side-by-side.html"]);
    // It has no detector.
    let photo = data("photos/coffee.png").display().to_string();
    run_fails(root, &["detect", &photo, "--run", "run"], 2, &["have no detector"]);

    // A picture of one's own: the classes of its pixels as numbers, and over the picture.
    let args = ["apply", "run", &photo, "--camera", "nominal", "--out", "applied"];
    let done = run_ok(root, &args);
    for file in ["coffee-scene.png", "coffee-nominal-classes.png"] {
        assert!(done.stdout.contains(&format!("applied/{file}")), "{}", done.stdout);
    }
    let classes = image::open(root.join("applied/coffee-nominal-classes.png")).unwrap();
    assert_eq!((classes.width(), classes.height()), (1920, 1200));
    assert_eq!(classes.color(), image::ColorType::L8);
    let found: BTreeSet<u8> = classes.to_luma8().iter().copied().collect();
    assert!(found.iter().all(|class| *class < 9), "{found:?}");
    assert!(root.join("applied/coffee-nominal.png").is_file());
    // Nothing is written over.
    run_fails(root, &args, 2, &["--force"]);
}

#[cfg(unix)]
#[test]
fn a_run_on_streets_that_is_killed_resumes_to_the_same_figures() {
    let [whole, folder] = [(), ()].map(|()| tempfile::tempdir().unwrap());
    for folder in [&whole, &folder] {
        std::fs::write(folder.path().join("tiny.toml"), TINY).unwrap();
    }
    run_ok(whole.path(), &["design", "tiny.toml", "--out", "run"]);
    let (mut child, run) = crate::resume::started_from(folder.path(), 3);
    child.kill().unwrap();
    child.wait().unwrap();
    run_ok(folder.path(), &["design", "--resume", "run"]);
    let [whole, resumed] = [&whole.path().join("run"), &run].map(|run| read(&run.join("metrics.json")));
    assert_eq!(resumed, whole);
    let frames = |run: &Path| read(&run.join("cameras/end-to-end/segments.json"));
    assert!(frames(&run).contains("\"confusion\""), "{}", frames(&run));
}

/// The experiment for pictures of one's own, with indices of 16 bits.
const OWN: &str = r#"
[[class]]
name = "wall"
values = [24001, 24002]
[[class]]
name = "thing"
values = [7]
[[class]]
name = "border"
values = [0]
ignored = true
"#;

/// Four gray pictures with a red square, and labels of 16 bits.
fn write_pictures(folder: &Path) {
    for name in ["pictures", "labels"] {
        std::fs::create_dir_all(folder.join(name)).unwrap();
    }
    for number in 0..4_u32 {
        let is_thing =
            |x: u32, y: u32| (20 + 9 * number..70 + 9 * number).contains(&x) && (30..80).contains(&y);
        let picture = RgbImage::from_fn(150, 130, |x, y| {
            if is_thing(x, y) { Rgb([220, 30, 30]) } else { Rgb([90 + 20 * number as u8; 3]) }
        });
        picture.save(folder.join(format!("pictures/{number}.jpg"))).unwrap();
        let labels = ImageBuffer::<Luma<u16>, Vec<u16>>::from_fn(150, 130, |x, y| {
            Luma([match (x, y) {
                (0, _) => 0,
                (1, _) => 65_535,
                (2, _) => 255,
                _ if is_thing(x, y) => 7,
                _ => 24_001 + (x % 2) as u16,
            }])
        });
        labels.save(folder.join(format!("labels/{number}.png"))).unwrap();
    }
}

#[test]
fn pictures_with_label_images_take_the_place_of_streets() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let text =
        TINY.replace("street-segmentation", "segments").replace("\"iou_road\", \"iou_sky\"", "\"iou_thing\"");
    std::fs::write(root.join("own.toml"), format!("data = \"own\"\n{text}{OWN}")).unwrap();
    run_fails(root, &["design", "own.toml", "--out", "run"], 2, &["a folder of labelled pictures"]);
    write_pictures(&root.join("own"));
    let args = ["design", "own.toml", "--variant", "nominal", "--steps", "30", "--out", "run"];
    let said = run_ok(root, &args);
    assert!(said.says("4 windows of 3 pictures in training, 4 windows of 1 in scores"), "{}", said.stderr);
    assert!(said.says("there are fewer than 5 pictures"), "{}", said.stderr);
    assert!(said.says("street.samples = 1 (`data` names pictures"), "{}", said.stderr);
    assert!(said.stdout.contains("IoU thing"), "{}", said.stdout);
    // Red on gray is soon told apart from the wall.
    let row = read_json(&root.join("run/metrics.json"))["rows"][0].clone();
    assert!(row["pixel_accuracy"].as_f64().unwrap() > 0.6, "{row}");
    assert!(read(&root.join("run/report.html")).contains("wall"));
    run_ok(root, &["evaluate", "run"]);
    // A run goes on with the labels that it began with, or not at all.
    let labels = root.join("own/labels/3.png");
    let before = std::fs::read(&labels).unwrap();
    let mut changed = image::open(&labels).unwrap().into_luma16();
    // A pixel of the square becomes one of the wall.
    changed.put_pixel(60, 40, Luma([24_001]));
    changed.save(&labels).unwrap();
    let needles = ["not those that this run began with: the label image labels/3.png"];
    run_fails(root, &["evaluate", "run"], 2, &needles);
    // A value that no class names has its file, its place and a hint.
    changed.put_pixel(40, 50, Luma([33]));
    changed.save(&labels).unwrap();
    let needles = ["3.png", "the value 33 in row 50, column 40 is of no class", "ignored = true"];
    run_fails(root, &["design", "own.toml", "--out", "b"], 2, &needles);
    std::fs::write(&labels, before).unwrap();
    std::fs::remove_file(root.join("own/labels/0.png")).unwrap();
    run_fails(root, &["design", "own.toml", "--out", "b"], 2, &["0.jpg", "this picture has no labels"]);
}
