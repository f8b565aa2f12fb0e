//! `petzval design` for a task of detection, and `petzval detect` with the detector that it trained.

use std::path::Path;
use std::sync::Arc;

use petzval::camera::image::LinearImage;
use petzval::files::load_image;
use petzval::jobs::detect::{Found, ObjectFinder, Source};
use petzval::jobs::{Context, Silent, built_in_assets};

use crate::common::{self, copy_folder, read, read_json, run_fails, run_ok};

/// An experiment that runs in seconds.
const TINY: &str = r#"
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
scores = ["ap50", "ap50_large", "state_accuracy"]
[[variant]]
name = "nominal"
[[variant.stage]]
moves = ["network"]
[[variant]]
name = "perfect"
from = "nominal"
lens = "perfect"
[[variant.stage]]
moves = ["network"]
"#;

/// A data set of gray pictures with a red and a green light in each.
fn write_lights(folder: &Path) {
    let (mut images, mut annotations) = (Vec::new(), Vec::new());
    for i in 1..=10 {
        let picture = image::RgbImage::from_fn(140, 120, |x, y| match (x, y) {
            (20..40, 20..60) => image::Rgb([220, 20, 20]),
            (80..100, 30..70) => image::Rgb([20, 220, 60]),
            _ => image::Rgb([90 + i; 3]),
        });
        picture.save(folder.join(format!("{i:02}.png"))).unwrap();
        images.push(format!(r#"{{"id": {i}, "file_name": "{i:02}.png", "width": 140, "height": 120}}"#));
        for (k, x, y) in [(1, 20, 20), (2, 80, 30)] {
            annotations.push(format!(
                r#"{{"id": {}, "image_id": {i}, "category_id": {k}, "bbox": [{x}, {y}, 20, 40], "area": 800, "iscrowd": 0}}"#,
                2 * u32::from(i) + k
            ));
        }
    }
    let text = format!(
        r#"{{"images": [{}], "annotations": [{}], "categories": [{{"id": 1, "name": "light red"}}, {{"id": 2, "name": "light green"}}]}}"#,
        images.join(","),
        annotations.join(",")
    );
    std::fs::write(folder.join("annotations.json"), text).unwrap();
}

/// A copy of a picture whose EXIF says that it is upside down.
fn write_upside_down(from: &Path, to: &Path) {
    use image::ImageEncoder;
    let picture = image::open(from).unwrap().into_rgb8();
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    // One tag, the orientation: 3 is half a turn.
    let about = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0";
    encoder.set_exif_metadata(about.to_vec()).unwrap();
    encoder.write_image(&picture, picture.width(), picture.height(), image::ExtendedColorType::Rgb8).unwrap();
    std::fs::write(to, bytes).unwrap();
}

/// A folder with the experiment, `tiny.toml`, and the data set of lights, `in`.
fn experiment_and_lights() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("tiny.toml"), TINY).unwrap();
    std::fs::create_dir(folder.path().join("in")).unwrap();
    write_lights(&folder.path().join("in"));
    folder
}

#[test]
fn a_run_that_looks_for_objects_is_scored_again_reported_and_lends_its_detector() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    std::fs::write(root.join("tiny.toml"), TINY).unwrap();
    let said = run_ok(root, &["design", "tiny.toml", "--out", "run"]);
    assert!(said.stdout.contains("over 3 windows of held-out scenes"), "{}", said.stdout);
    assert!(said.says("streets (day): 3 windows in training, 3 in scores"), "{}", said.stderr);
    assert!(!said.stdout.contains("NaN") && !said.stdout.contains("AP50 large"), "{}", said.stdout);
    let why = "ap50_large (no object above 96 x 96 pixels in the pictures)";
    assert!(said.says("no value of") && said.says(why), "{}", said.stderr);
    let reasons = read_json(&root.join("run/metrics.json"))["without_value"].clone();
    assert_eq!(reasons["ap50_large"], "no object above 96 x 96 pixels in the pictures");
    assert!(reasons["ap50"].is_null(), "{reasons}");
    assert!(read(&root.join("run/report.html")).contains(why));
    let rows = read_json(&root.join("run/metrics.json"))["rows"].clone();
    assert_eq!([&rows[0]["network_steps"], &rows[1]["network_steps"]], [2, 4]);
    assert_eq!(rows[1]["is_ceiling"], true);
    assert!(rows[0]["ap50"].as_f64().is_some_and(|v| (0.0..=1.0).contains(&v)));
    assert!(read(&root.join("run/report.html")).contains("windows of held-out scenes"));
    let again = run_ok(root, &["evaluate", "run"]);
    assert!(again.stdout.contains("own figures: 0.000e0"), "{}", again.stdout);

    // Cameras as they are made: no light of these windows is large, so there is nothing to say of this score.
    let args = ["evaluate", "run", "--tolerances", "commercial", "--trials", "2", "--pictures", "2"];
    let made = run_ok(root, &args);
    assert!(made.says("hold no object for ap50_large"), "{}", made.stderr);
    let made = read_json(&root.join("run/tolerance.json"));
    assert_eq!(made["rows"].as_array().unwrap().len(), 1);
    assert!(made["rows"][0]["scores"]["ap50"]["drawn"].is_f64(), "{made}");
    assert!(made["rows"][0]["scores"]["ap50_large"].is_null(), "{made}");
    assert!(read(&root.join("run/report.html")).contains("commercial"));

    // Another run starts with its detector, and keeps a copy.
    let file = "run/cameras/nominal/blocks/network/weights.bin";
    let next = |weights: &str| {
        let text =
            TINY.replacen("[[variant]]", &format!("[detector]\nweights = \"{weights}\"\n[[variant]]"), 1);
        std::fs::write(root.join("next.toml"), text).unwrap();
    };
    next(file);
    run_ok(root, &["design", "next.toml", "--variant", "nominal", "--out", "next"]);
    let bytes = |name: &str| std::fs::read(root.join(name)).unwrap();
    assert!(bytes("next/inputs/detector-weights.bin") == bytes(file));
    assert!(read(&root.join("next/config.toml")).contains("inputs/detector-weights.bin"));
    run_ok(root, &["evaluate", "next"]);
    for (weights, says) in [("nowhere.bin", "blocks/network/weights.bin"), ("tiny.toml", "the same kind")] {
        next(weights);
        run_fails(root, &["design", "next.toml", "--out", "b"], 2, &[says]);
    }

    // Its detector looks at pictures of any size.
    std::fs::create_dir(root.join("in")).unwrap();
    write_lights(&root.join("in"));
    let args = ["detect", "in", "--run", "run", "--camera", "nominal", "--least-score", "0"];
    let lines = run_ok(root, &args).stdout;
    assert!(lines.starts_with("file,class,score,x,y,width,height\n"), "{lines}");
    // Where nothing is sure enough to be shown, how sure the surest is is said.
    let unsure = run_ok(root, &[&args[..args.len() - 1], &["1"]].concat());
    assert_eq!(unsure.stdout, "file,class,score,x,y,width,height\n");
    assert!(
        unsure.says("nothing has a score of 1 or more; the surest detection has 0."),
        "{}",
        unsure.stderr
    );
    let found = run_ok(root, &[&args[..], &["--json", "--out", "out"]].concat());
    assert!(found.says("and of no other file of annotations"), "{}", found.stderr);
    let found = found.json();
    let pictures = found["pictures"].as_array().unwrap();
    assert_eq!(pictures.len(), 10);
    let count: usize = pictures.iter().map(|p| p["found"].as_array().unwrap().len()).sum();
    assert_eq!(lines.lines().count(), count + 1);
    let results = read_json(&root.join("out/detections.json"));
    assert_eq!(results.as_array().unwrap().len(), count);
    // In memory, the same detector finds the same.
    let context = Context::new(built_in_assets(), Arc::new(Silent));
    let source = Source::Run { run: root.join("run"), camera: Some("nominal".to_owned()) };
    let finder = ObjectFinder::open(&source, "cpu", &[], &context).unwrap();
    assert_eq!(finder.classes()[2], "green");
    let picture = load_image(&root.join("in/01.png")).unwrap().light;
    let of_file: Vec<Found> = serde_json::from_value(pictures[0]["found"].clone()).unwrap();
    assert_eq!(finder.find(&picture, 0.0).unwrap(), of_file);
    assert!(finder.find(&LinearImage::zeros(1, 8, 8), 0.0).is_err());
    let data = read_json(&root.join("out/annotations.json"));
    assert_eq!(data["images"].as_array().unwrap().len(), 10);
    assert_eq!(data["categories"][2]["name"], "green");
    assert!(root.join("out/0010-10.png").is_file());

    // Against its own detections it is perfect: everything is found once, where it is.
    let mut known = data.clone();
    let objects = results.as_array().unwrap().iter().enumerate().map(|(i, found)| {
        let mut object = found.clone();
        object["id"] = (i + 1).into();
        object
    });
    known["annotations"] = objects.collect();
    std::fs::write(root.join("known.json"), known.to_string()).unwrap();
    let args = ["detect", "--data", "known.json", "--run", "run", "--camera", "nominal"];
    let said = run_ok(root, &args).stdout;
    assert!(said.starts_with("AP    1.000, 95 % range 1.000 to 1.000\n"), "{said}");
    assert!(said.ends_with("over 10 pictures\n"), "{said}");
    let scores = run_ok(root, &[&args[..], &["--json", "--out", "scored"]].concat()).json()["scores"].clone();
    let per_class = scores["classes"].as_array().unwrap();
    assert_eq!(per_class.iter().map(|c| c["objects"].as_u64().unwrap() as usize).sum::<usize>(), count);
    assert!((scores["coco"]["ar100"].as_f64().unwrap() - 1.0).abs() < 1e-9, "{scores}");
    // All detections are written, whatever the least score of printed ones.
    assert_eq!(read_json(&root.join("scored/detections.json")), results);
    // What another call drew there is warned of.
    std::fs::write(root.join("scored/0042-earlier.png"), b"").unwrap();
    std::fs::write(root.join("scored/own.png"), b"").unwrap();
    let again = run_ok(root, &[&args[..], &["--out", "scored", "--force"]].concat());
    assert!(
        again.says("1 drawn pictures in this folder") && again.says("0042-earlier.png"),
        "{}",
        again.stderr
    );
    // With an object more, which nobody finds, it is not.
    known["annotations"]
        .as_array_mut()
        .unwrap()
        .push(serde_json::json!({"id": count + 1, "image_id": 1, "category_id": 1, "bbox": [1, 1, 3, 3]}));
    std::fs::write(root.join("known.json"), known.to_string()).unwrap();
    let missed = run_ok(root, &[&args[..], &["--json"]].concat()).json()["scores"]["coco"].clone();
    assert!(missed["ar100"].as_f64().unwrap() < 0.999 && missed["ap"].as_f64().unwrap() < 1.0, "{missed}");
    // An object to be ignored is not judged, but pycocotools looks at `iscrowd` alone.
    known["annotations"][0]["ignore"] = 1.into();
    std::fs::write(root.join("known.json"), known.to_string()).unwrap();
    let said = run_ok(root, &args).stdout;
    assert!(
        said.contains("AP of pycocotools")
            && said.contains("objects with `ignore` or thinner than a pixel: 1;"),
        "{said}"
    );

    // A raw frame of its sensor is developed by the camera, as `apply` does it, and looked at.
    let photo = common::data("photos/coffee.png").display().to_string();
    let simulate = ["simulate", &photo, "--sensor", "mt9m034-mono", "--out", "other"];
    run_ok(root, &[&["simulate", &photo, "--sensor", "imx249-fitted", "--out", "taken"][..]].concat());
    let raw = "taken/coffee-raw.tiff";
    let args = ["detect", raw, "--run", "run", "--least-score", "0", "--out", "of-raw"];
    let of_raw = run_ok(root, &args).stdout;
    run_ok(root, &["apply", "run", raw, "--out", "applied"]);
    let pixels = |path: &str| image::open(root.join(path)).unwrap().into_rgb8();
    let [seen, applied] = ["of-raw/0001-coffee-raw.png", "applied/coffee-raw-perfect.png"].map(pixels);
    assert_eq!(seen.dimensions(), applied.dimensions());
    // But for the boxes, which have another least score there.
    let same = seen.pixels().zip(applied.pixels()).filter(|(a, b)| a == b).count();
    assert!(same as f64 > 0.5 * f64::from(seen.width() * seen.height()), "{same} pixels are the same");
    assert!(of_raw.lines().count() > 1, "nothing was found: {of_raw}");
    assert!(of_raw.lines().skip(1).all(|line| line.starts_with(&format!("{raw},"))), "{of_raw}");

    // What does not fit is refused, and nothing is written.
    run_ok(root, &simulate);
    run_fails(root, &["detect", "other/coffee-raw.tiff", "--run", "run"], 2, &["coffee-raw.tiff"]);
    run_fails(
        root,
        &["detect", raw, "--weights", "tiny.toml"],
        2,
        &["which only a camera develops", "--run"],
    );
    let fails = |args: &[&str], says: &str| run_fails(root, args, 2, &[says]);
    fails(&["detect", "in", "--run", "run", "--camera", "other"], "finished are nominal, perfect");
    fails(&["detect", "in", "--run", "run", "--least-score", "2"], "between 0 and 1");
    fails(&["detect", "run", "--run", "run"], "no picture in this folder");
    fails(&["detect", "in", "--weights", "tiny.toml"], "not a safetensors file");
    fails(
        &["detect", "in", "--weights", "tiny.toml", "--longer-side", "0"],
        "--longer-side 0: must lie between 1 and",
    );
    fails(&["detect", "in", "--weights", "none.safetensors"], "none.safetensors");
    fails(&["detect", "in"], "--run");
    fails(&["detect", "--run", "run"], "--data");
    fails(&["detect", "in", "--data", "in", "--run", "run"], "cannot be used with");
    fails(&["detect", "in", "--run", "run", "--backbone", "resnet18"], "cannot be used with");
    std::fs::write(root.join("none.json"), r#"{"images": [], "annotations": [], "categories": []}"#).unwrap();
    fails(&["detect", "--data", "none.json", "--run", "run"], "no picture of this data set can be used");
    let without_boxes = r#"{"images": [{"id": 1, "file_name": "in/01.png", "width": 140, "height": 120}], "annotations": [], "categories": []}"#;
    std::fs::write(root.join("none.json"), without_boxes).unwrap();
    fails(&["detect", "--data", "none.json", "--run", "run"], "no box of red, yellow, green, off");
    // Corners in place of sizes are no truth: 20 + 20, 20 + 40 and 80 + 20, 30 + 40.
    let corners = read(&root.join("in/annotations.json"))
        .replace("[20, 20, 20, 40]", "[20, 20, 40, 60]")
        .replace("[80, 30, 20, 40]", "[80, 30, 100, 70]")
        .replace("\"file_name\": \"", "\"file_name\": \"in/");
    std::fs::write(root.join("corners.json"), corners).unwrap();
    let says = "none would as two corners (the first: annotation 4 of in/01.png: [80, 30, 100, 70])";
    fails(&["detect", "--data", "corners.json", "--run", "run"], says);
    fails(
        &["design", "tiny.toml", "--data", "corners.json", "--out", "corners"],
        "subtract the first number",
    );
    // Nothing overwrites the data set that is read.
    let args = ["detect", "--data", "in", "--run", "run", "--out", "in", "--force"];
    fails(&args, "the data set is in this folder");
    for part in ["train", "valid"] {
        std::fs::create_dir_all(root.join("parts").join(part)).unwrap();
        std::fs::copy(root.join("none.json"), root.join("parts").join(part).join("_annotations.coco.json"))
            .unwrap();
    }
    fails(&["detect", "--data", "parts", "--run", "run", "--out", "parts"], "the data set is in this folder");

    // A picture that was cut off is left out of a data set with its boxes; among named pictures it is left out and is an error at the end.
    let whole = std::fs::read(root.join("in/04.png")).unwrap();
    std::fs::write(root.join("in/04.png"), &whole[..whole.len() - 20]).unwrap();
    let said = run_ok(root, &["detect", "--data", "in", "--run", "run"]);
    assert!(said.stdout.ends_with("over 9 pictures\n"), "{}", said.stdout);
    assert!(said.says("it is cut off"), "{}", said.stderr);
    let cut = common::run(root, &["detect", "in", "--run", "run", "--out", "nine"]);
    assert!(cut.code == Some(2) && cut.says("1 of 10 pictures cannot be read"), "{}", cut.stderr);
    assert!(cut.says("in/04.png") && cut.says("it is cut off"), "{}", cut.stderr);
    // The detections of the others are printed all the same.
    assert!(cut.stdout.starts_with("file,class,score,x,y,width,height\n"), "{}", cut.stdout);
    assert_eq!(read_json(&root.join("nine/annotations.json"))["images"].as_array().unwrap().len(), 9);
    assert!(root.join("nine/detections.json").is_file() && root.join("nine/0010-10.png").is_file());

    // Boxes are of pictures as EXIF turns them, and annotations say so.
    std::fs::create_dir(root.join("turned")).unwrap();
    write_upside_down(&root.join("in/01.png"), &root.join("turned/a.png"));
    std::fs::copy(root.join("in/02.png"), root.join("turned/b.png")).unwrap();
    run_ok(root, &["detect", "turned", "--run", "run", "--out", "of-turned"]);
    let images = read_json(&root.join("of-turned/annotations.json"))["images"].clone();
    assert_eq!((&images[0]["turned"], images[1].get("turned")), (&true.into(), None), "{images}");
}

#[test]
fn a_folder_with_boxes_takes_the_place_of_the_streets() {
    let folder = experiment_and_lights();
    let root = folder.path();
    let said = run_ok(root, &["design", "tiny.toml", "--data", "in", "--variant", "nominal", "--out", "run"]);
    assert!(said.says("checking every picture of"), "{}", said.stderr);
    assert!(said.stdout.contains("network steps"), "{}", said.stdout);
    assert!(said.says("the class `yellow` has 0 boxes"), "{}", said.stderr);
    assert!(said.says("3 windows of 8 pictures in training, 3 windows of 2 in scores"), "{}", said.stderr);
    assert!(read(&root.join("run/config.toml")).contains("data = "));
    run_ok(root, &["evaluate", "run"]);
    // Two of the ten are held out.
    let seen = run_ok(root, &["detect", "--data", "in", "--run", "run"]);
    assert!(seen.says("has been trained on 8 of these 10 pictures"), "{}", seen.stderr);
    // Its camera on pictures with other labels: scores have ranges.
    std::fs::create_dir(root.join("other")).unwrap();
    write_lights(&root.join("other"));
    let other = read(&root.join("other/annotations.json"));
    std::fs::write(
        root.join("other/annotations.json"),
        other.replace("[20, 20, 20, 40]", "[21, 20, 20, 40]"),
    )
    .unwrap();
    let said = run_ok(root, &["evaluate", "run", "--data", "other/annotations.json", "--json"]);
    assert!(said.says("3 windows of 10 pictures in scores"), "{}", said.stderr);
    let found = said.json();
    assert_eq!(found["other_pictures"], "other/annotations.json");
    // The files are those on which it was trained.
    assert!(said.says("has been trained on 8 of the 10 pictures of other"), "{}", said.stderr);
    assert_eq!(found["trained_on"], 8);
    let seen = run_ok(root, &["detect", "--data", "other", "--run", "run"]);
    assert!(seen.says("has been trained on 8 of these 10 pictures"), "{}", seen.stderr);
    let row = &found["metrics"]["rows"][0];
    assert!(row["ap50"].is_f64() && row["intervals"]["ap50"][0].is_f64(), "{row}");
    // What it finds has the ids of the data set, whose annotations other programs compare it with.
    let text = read(&root.join("other/annotations.json"));
    let text = text.replace(r#""category_id": 1"#, r#""category_id": 7"#).replace(
        r#"[{"id": 1, "name": "light red"}, {"id": 2, "#,
        r#"[{"id": 7, "name": "light red"}, {"id": 3, "#,
    );
    let text = text.replace(r#""category_id": 2"#, r#""category_id": 3"#);
    std::fs::write(root.join("other/annotations.json"), text).unwrap();
    let args = ["detect", "--data", "other", "--run", "run", "--out", "ids"];
    assert!(!run_ok(root, &args).says("and of no other file of annotations"));
    let written = read_json(&root.join("ids/annotations.json"));
    let categories = written["categories"].as_array().unwrap();
    let named: Vec<_> =
        categories.iter().map(|c| (c["name"].as_str().unwrap(), c["id"].as_u64().unwrap())).collect();
    assert_eq!(named, [("red", 7), ("yellow", 1), ("green", 3), ("off", 2)]);
    let ids = |records: &serde_json::Value| -> std::collections::BTreeSet<u64> {
        records.as_array().unwrap().iter().map(|record| record["category_id"].as_u64().unwrap()).collect()
    };
    assert_eq!(ids(&written["annotations"]), [3, 7].into());
    assert!(ids(&read_json(&root.join("ids/detections.json"))).is_subset(&[1, 2, 3, 7].into()));
    // The same pictures elsewhere are those of the run.
    copy_folder(&root.join("in"), &root.join("moved"));
    let moved = run_ok(root, &["evaluate", "run", "--data", "moved"]);
    assert!(moved.stdout.contains("own figures: 0.000e0"), "{}", moved.stdout);
    run_fails(
        root,
        &["evaluate", "run", "--photos", "in"],
        2,
        &["--photos", "the run looks at labelled scenes"],
    );
    // A run goes on with the pictures that it began with, or not at all.
    let text = read(&root.join("in/annotations.json"));
    std::fs::write(root.join("in/annotations.json"), text.replace("[20, 20, 20, 40]", "[21, 20, 20, 40]"))
        .unwrap();
    let needles = ["not those that this run began with: the labels of the pictures"];
    run_fails(root, &["evaluate", "run"], 2, &needles);
    // Mistakes of the data are named.
    std::fs::write(root.join("in/annotations.json"), "{\"images\": [}").unwrap();
    run_fails(root, &["design", "tiny.toml", "--data", "in", "--out", "b"], 2, &["annotations.json"]);
    run_fails(root, &["design", "--data", "in", "--out", "b"], 2, &["the experiment makes pictures"]);
    let nowhere = format!("data = \"nowhere\"\n{TINY}");
    std::fs::write(root.join("nowhere.toml"), nowhere).unwrap();
    run_fails(root, &["design", "nowhere.toml", "--out", "b"], 2, &["a folder of labelled pictures"]);
}

#[test]
fn a_folder_with_bad_boxes_trains_on_the_others_and_says_so() {
    let folder = experiment_and_lights();
    let root = folder.path();
    let file = root.join("in/annotations.json");
    let good = read(&file);
    let many = (0..10_000).map(|k| {
        let (id, x, y) = (1000 + k, k % 100, k / 100);
        format!(r#"{{"id": {id}, "image_id": 1, "category_id": 1, "bbox": [{x}, {y}, 12, 16], "area": 192}}"#)
    });
    let bad = [
        r#"{"id": 100, "image_id": 2, "category_id": 1, "bbox": [NaN, 20, 20, 40]}"#,
        r#"{"id": 101, "image_id": 2, "category_id": 1, "bbox": [1, 20, 0, 40], "area": 0}"#,
        r#"{"id": 102, "image_id": 2, "category_id": 1, "bbox": [1, 20, 1e-6, 40], "area": 4e-5}"#,
        r#"{"id": 103, "image_id": 2, "category_id": 1, "bbox": [1, 70, 20, 40], "area": 800, "state": "rot"}"#,
        r#"{"id": 104, "image_id": 99, "category_id": 1, "bbox": [1, 20, 20, 40], "area": 800}"#,
    ];
    let more: Vec<String> = bad.iter().map(|text| (*text).to_owned()).chain(many).collect();
    let start = "\"annotations\": [";
    std::fs::write(&file, good.replacen(start, &format!("{start}{},", more.join(",")), 1)).unwrap();
    let said = run_ok(root, &["design", "tiny.toml", "--data", "in", "--variant", "nominal", "--out", "run"]);
    for part in [
        "A box holds NaN, infinity or no number; it is left out (once",
        "A box has no width or no height; it is left out (once",
        "A box is narrower or lower than a pixel; whether it is detected does not count (once",
        "A `state` is none of red, yellow, green and off",
        "An annotation names a picture that is not listed; it is left out (once",
        "01.png: 10002 boxes",
    ] {
        assert!(said.says(part), "{part}: {}", said.stderr);
    }
    assert!(read_json(&root.join("run/metrics.json"))["rows"][0]["ap50"].is_f64());

    // Boxes that no window can hold are as good as none.
    let thin = good.replace(", 20, 40]", ", 0.001, 40]");
    assert_ne!(thin, good);
    std::fs::write(&file, thin).unwrap();
    let args = ["design", "tiny.toml", "--data", "in", "--out", "thin"];
    run_fails(
        root,
        &args,
        2,
        &["no box of red, yellow, green, off counts", "at least a pixel wide and high"],
    );
    assert!(!root.join("thin").exists());
}

/// Weights of a Faster R-CNN of torchvision on ResNet-18 for COCO, all zero but the variances of the normalisations, which are one, and the
/// biases of the outputs, each of which is its number. Those of the layers under `prefix`, which their names then lack.
fn write_torchvision_weights(file: &Path, prefix: &str) {
    let fixture = include_str!("../../../petzval-learn/tests/fixtures/whole_detectors.json");
    let fixture: serde_json::Value = serde_json::from_str(fixture).unwrap();
    let (mut header, mut bytes) = (serde_json::Map::new(), Vec::new());
    for (name, shape) in fixture["detectors"]["resnet18"]["state"].as_object().unwrap() {
        let Some(name) = name.strip_prefix(prefix) else { continue };
        let mut shape: Vec<u64> = serde_json::from_value(shape.clone()).unwrap();
        if name.contains("box_predictor") {
            // From those of three classes and the background.
            shape[0] = shape[0] / 4 * 91;
        }
        let start = bytes.len();
        let count = shape.iter().product::<u64>() as usize;
        let kind = match name {
            "roi_heads.box_predictor.cls_score.bias" => {
                bytes.extend((0..count).flat_map(|output| (output as f32).to_le_bytes()));
                "F32"
            }
            // 0 or 1 in 16 bits.
            _ => {
                let value: [u8; 2] = if name.ends_with("running_var") { [0x00, 0x3c] } else { [0, 0] };
                bytes.extend(value.repeat(count));
                "F16"
            }
        };
        let about = serde_json::json!({"dtype": kind, "shape": shape, "data_offsets": [start, bytes.len()]});
        header.insert(name.to_owned(), about);
    }
    let header = serde_json::Value::from(header).to_string();
    let length = (header.len() as u64).to_le_bytes();
    std::fs::write(file, [&length[..], header.as_bytes(), &bytes].concat()).unwrap();
}

#[test]
#[ignore = "trains detectors with whole backbones; `cargo xtask full` runs it"]
fn a_detector_starts_from_weights_of_torchvision() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_torchvision_weights(&root.join("coco.safetensors"), "");
    let experiment = |name: &str, backbone: &str, kind: &str| {
        let detector = format!(
            "[detector]\nkind = \"{kind}\"\nbackbone = \"{backbone}\"\nweights = \"coco.safetensors\"\n[[variant]]"
        );
        std::fs::write(root.join(name), TINY.replacen("[[variant]]", &detector, 1)).unwrap();
    };
    experiment("a.toml", "resnet18", "faster-rcnn");
    run_ok(root, &["design", "a.toml", "--variant", "nominal", "--out", "run"]);
    assert!(read(&root.join("run/config.toml")).contains("inputs/detector-weights.safetensors"));
    let bytes = |name: &str| std::fs::read(root.join(name)).unwrap();
    assert!(bytes("run/inputs/detector-weights.safetensors") == bytes("coco.safetensors"));
    run_ok(root, &["evaluate", "run"]);
    // After two steps, the background and four times the traffic light of COCO, which is its class 10.
    let file = bytes("run/cameras/nominal/network.safetensors");
    let length = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&file[8..8 + length]).unwrap();
    let places =
        &header.as_object().unwrap().iter().find(|(name, _)| name.ends_with("boxes.logits.bias")).unwrap().1;
    let start = 8 + length + places["data_offsets"][0].as_u64().unwrap() as usize;
    let bias = |k: usize| f32::from_le_bytes(file[start + 4 * k..][..4].try_into().unwrap());
    for (k, expected) in [0.0, 10.0, 10.0, 10.0, 10.0].into_iter().enumerate() {
        assert!((bias(k) - expected).abs() < 0.05, "{k}: {}", bias(k));
    }
    // The network that a run writes is a start as well.
    std::fs::copy(root.join("run/cameras/nominal/network.safetensors"), root.join("own.safetensors"))
        .unwrap();
    let text = read(&root.join("a.toml")).replace("coco.safetensors", "own.safetensors");
    std::fs::write(root.join("own.toml"), text).unwrap();
    run_ok(root, &["design", "own.toml", "--variant", "nominal", "--out", "own"]);

    // A gigabyte that need not be compared.
    ["run", "own"].iter().for_each(|name| std::fs::remove_dir_all(root.join(name)).unwrap());
    let fails = |name: &str, says: &[&str]| run_fails(root, &["design", name, "--out", "b"], 2, says);
    experiment("b.toml", "resnet50", "faster-rcnn");
    fails("b.toml", &["coco.safetensors", "layer1.0.conv1.weight` is of shape", "detector.backbone"]);
    for (backbone, kind) in [("small", "faster-rcnn"), ("resnet18", "fcos")] {
        experiment("c.toml", backbone, kind);
        fails("c.toml", &["which has no detector of this kind", "resnet50"]);
    }
    // A classifier has weights for the backbone of every kind of detector.
    write_torchvision_weights(&root.join("coco.safetensors"), "backbone.body.");
    experiment("d.toml", "small", "faster-rcnn");
    fails("d.toml", &["weights of a classifier", "resnet50"]);
    experiment("e.toml", "resnet18", "fcos");
    run_ok(root, &["design", "e.toml", "--variant", "nominal", "--out", "run"]);
}

/// Muon's momentum and Adam's moments of a detector are in a checkpoint, each with its weight.
#[test]
fn a_detector_that_is_trained_in_two_sittings_has_the_same_weights() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let text = TINY.replace("steps = 2", "steps = 4").replacen(
        "[[variant]]",
        "[checkpoint]\nevery = 1\nkeep = 10\n[[variant]]",
        1,
    );
    std::fs::write(root.join("tiny.toml"), text).unwrap();
    run_ok(root, &["design", "tiny.toml", "--variant", "nominal", "--out", "run"]);
    let weights = root.join("run/cameras/nominal/blocks/network/weights.bin");
    let results = || (read(&root.join("run/metrics.json")), std::fs::read(&weights).unwrap());
    let whole = results();
    // As it was after its second step.
    std::fs::remove_file(root.join("run/metrics.json")).unwrap();
    std::fs::remove_dir_all(root.join("run/cameras")).unwrap();
    for later in 3..=5 {
        std::fs::remove_dir_all(root.join(format!("run/checkpoints/step-{later:06}"))).unwrap();
    }
    assert!(root.join("run/checkpoints/step-000002").is_dir());
    run_ok(root, &["design", "--resume", "run"]);
    assert!(results() == whole);
}

/// A user's classes, by a name of their own, by the number of a category, and beside others of the data set.
#[test]
fn classes_of_ones_own_are_trained_scored_reported_and_found() {
    let folder = experiment_and_lights();
    let root = folder.path();
    let classes =
        "[[class]]\nname = \"stop\"\nfrom = [\"light red\"]\n[[class]]\nname = \"go\"\ncategories = [2]\n";
    let scores = r#"scores = ["ap50", "ap50_stop", "class_accuracy"]"#;
    let text = TINY
        .replace("task = \"traffic-light\"", "task = \"objects\"\ndata = \"in\"")
        .replace(r#"scores = ["ap50", "ap50_large", "state_accuracy"]"#, scores)
        .replacen("[[variant]]", &format!("{classes}[[variant]]"), 1);
    std::fs::write(root.join("own.toml"), &text).unwrap();
    let said = run_ok(root, &["design", "own.toml", "--variant", "nominal", "--out", "run"]);
    assert!(said.says("pictures in training"), "{}", said.stderr);
    let metrics = read_json(&root.join("run/metrics.json"));
    let names: Vec<&str> =
        metrics["scores"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["ap50", "ap50_stop", "class_accuracy"]);
    assert!(metrics["rows"][0]["ap50_stop"].is_f64(), "{metrics}");
    let report = read(&root.join("run/report.html"));
    assert!(report.contains("stop") && report.contains("go"));
    // The run holds its classes, and is scored again from them alone.
    let config = read(&root.join("run/config.toml"));
    assert!(config.contains("name = \"stop\"") && config.contains("categories = [2]"), "{config}");
    std::fs::remove_file(root.join("own.toml")).unwrap();
    let again = run_ok(root, &["evaluate", "run"]);
    assert!(again.stdout.contains("own figures: 0.000e0"), "{}", again.stdout);

    // Its detector finds them by their names, and is scored on a data set by them.
    let args = ["detect", "--data", "in", "--run", "run", "--least-score", "0", "--json", "--out", "out"];
    let found = run_ok(root, &args).json();
    let found: std::collections::BTreeSet<&str> = found["pictures"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|picture| picture["found"].as_array().unwrap())
        .map(|object| object["class"].as_str().unwrap())
        .collect();
    assert!(!found.is_empty() && found.iter().all(|class| ["stop", "go"].contains(class)), "{found:?}");
    let scored = run_ok(root, &["detect", "--data", "in", "--run", "run"]).stdout;
    let has_accuracy =
        ["of the objects that are found", "(no object is found"].map(|text| scored.contains(text));
    assert!(has_accuracy.contains(&true), "{scored}");

    // A class that takes nothing of the data set is said, and scores of other classes are refused where they stand.
    let wrong = text.replace("categories = [2]", "categories = [9]");
    std::fs::write(root.join("wrong.toml"), &wrong).unwrap();
    let said = run_ok(root, &["design", "wrong.toml", "--variant", "nominal", "--out", "other"]);
    assert!(
        said.says("the class `go` has 0 boxes") && said.says("are background: light green"),
        "{}",
        said.stderr
    );
    std::fs::write(root.join("wrong.toml"), text.replace("ap50_stop", "ap50_halt")).unwrap();
    run_fails(
        root,
        &["design", "wrong.toml", "--out", "b"],
        2,
        &["`ap50_halt` is no score of objects", "ap50_stop"],
    );
}
