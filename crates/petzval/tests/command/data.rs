//! `petzval data`: data sets for object detection.

use std::path::Path;

use crate::common::{self, read, read_json, run, run_fails, run_ok};

fn write(root: &Path, name: &str, text: &str) {
    let path = root.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

fn write_jpeg(root: &Path, name: &str, blue: u8) {
    let path = root.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::RgbImage::from_fn(100, 40, |x, y| image::Rgb([x as u8, y as u8, blue])).save(path).unwrap();
}

/// A data set as Roboflow exports it.
fn write_yolo(root: &Path) {
    for (part, blue) in [("train", 80), ("valid", 160)] {
        write_jpeg(root, &format!("in/{part}/images/a.jpg"), blue);
        write(root, &format!("in/{part}/labels/a.txt"), "1 0.5 0.25 0.2 0.1\n0 0.5 0.5 0.4 0.5\n");
    }
    write(root, "in/data.yaml", "train: ../train/images\nnc: 2\nnames: ['green', 'red']\n");
}

#[test]
fn a_converted_data_set_is_checked_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_yolo(root);
    let text = run_ok(root, &["data", "convert", "yolo", "in", "out"]).stdout;
    for words in [
        "2 pictures, 4 boxes",
        "parts  train 1, valid 1",
        "out/annotations.json (2 pictures linked, 0 copied)",
    ] {
        assert!(text.contains(words), "{words}\n{text}");
    }
    let annotations = read_json(&root.join("out/annotations.json"));
    assert_eq!(annotations["images"][1]["file_name"], "images/valid/a.jpg");
    assert_eq!(annotations["annotations"][0]["bbox"], serde_json::json!([40.0, 8.0, 20.0, 4.0]));

    let copied = run_ok(root, &["data", "convert", "yolo", "in", "copy", "--copy", "--json"]).json();
    assert_eq!((&copied["linked"], &copied["copied"]), (&0.into(), &2.into()));
    assert_eq!(read(&root.join("copy/annotations.json")), read(&root.join("out/annotations.json")));

    let checked = run_ok(root, &["data", "check", "out", "--out", "page", "--json"]).json();
    assert_eq!((&checked["errors"], &checked["statistics"]["images"]), (&0.into(), &2.into()));
    assert_eq!(checked["statistics"]["classes"][1]["name"], "red");
    assert_eq!(read_json(&root.join("page/data.json")), checked);
    let page = read(&root.join("page/data.html"));
    assert!(page.matches("<rect").count() == 4 && page.matches("data:image/png").count() == 2);
    assert!(page.contains("#ff3b30") && page.contains("No defects."));

    // What the classes of an experiment take.
    let args = ["data", "check", "out", "--classes-of", "traffic-light"];
    let taken = run_ok(root, &args).stdout;
    for words in ["red  ", "green  ", "no category"] {
        assert!(taken.contains(words), "{words}\n{taken}");
    }
    let json = run_ok(root, &[&args[..], &["--json"]].concat()).json();
    let boxes: Vec<u64> =
        json["taken"]["classes"].as_array().unwrap().iter().map(|c| c["boxes"].as_u64().unwrap()).collect();
    assert_eq!(boxes.iter().sum::<u64>(), 4);
    let people = run_ok(root, &["data", "check", "out", "--classes-of", "pedestrian-vehicle"]).stdout;
    assert!(people.contains("background") && people.contains("green, red"), "{people}");
    let lens = ["data", "check", "out", "--classes-of", "cooke-triplet-image-quality"];
    run_fails(root, &lens, 2, &["has no classes"]);

    // A file that cannot be decoded is an error of the data, with everything else still shown.
    std::fs::remove_file(root.join("out/images/train/a.jpg")).unwrap();
    write(root, "out/images/train/a.jpg", "no picture");
    let broken = run(root, &["data", "check", "out"]);
    assert_eq!(broken.code, Some(2));
    for words in ["1 picture, 2 boxes", "error, once: The file of a picture cannot be decoded", "a.jpg"] {
        assert!(broken.stdout.contains(words), "{words}\n{}", broken.stdout);
    }
}

#[cfg(unix)]
#[test]
fn small_photographs_and_broken_links_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    std::fs::create_dir(root.join("photos")).unwrap();
    for (name, side) in [("a.png", 126), ("b.png", 125), ("c.png", 24)] {
        image::RgbImage::from_pixel(140, side, image::Rgb([9; 3]))
            .save(root.join("photos").join(name))
            .unwrap();
    }
    std::os::unix::fs::symlink(root.join("gone.png"), root.join("photos/d.png")).unwrap();
    write(root, "photos/boxes.csv", "ImageID,LabelName,XMin,XMax,YMin,YMax\n");
    write(root, "photos/labels/a.xml", "<annotation/>\n");
    let checked = run(root, &["data", "check", "photos"]);
    assert_eq!(checked.code, Some(2));
    for words in [
        "note, 2 times: A photograph is smaller than 126 pixels",
        "worst: c.png: 140 x 24 px",
        "b.png: 140 x 125 px",
        "error, once: The file of a picture cannot be opened",
        "photos/d.png",
    ] {
        assert!(checked.stdout.contains(words), "{words}\n{}", checked.stdout);
    }
    let said = "photos: taken as pictures without labels: photos/boxes.csv and another file may hold some and are not read";
    assert!(checked.says(said), "{}", checked.stderr);
}

#[test]
fn what_cannot_be_converted_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_yolo(root);
    write(root, "full/note.txt", "mine");
    write(root, "bad/annotations.json", "{\"images\": [\n{\"id\": 1,}\n]}");
    for (args, needles) in [
        (&["convert", "kitti", "in", "out"][..], ["no folder `label_2`", "image_2"]),
        (&["convert", "voc", "in", "out"], ["no XML file", "JPEGImages"]),
        (&["convert", "bdd100k", "in", "out"], ["no JSON file", "labels"]),
        (&["convert", "yolo", "nowhere", "out"], ["nowhere", "No such file"]),
        (&["convert", "yolo", "in", "full"], ["full: the folder is not empty", "new folder"]),
        (&["convert", "coco", "in", "out"], ["COCO needs no conversion", "petzval data check"]),
        (&["convert", "kity", "in", "out"], ["invalid value 'kity'", "kitti, bdd100k, yolo, voc"]),
        (&["check", "in"], ["no annotations in COCO format", "petzval data convert"]),
        (&["check", "bad"], ["bad/annotations.json:2:", "not JSON"]),
        (&["check", "bad", "--samples", "1000"], ["--samples 1000", "must lie between 0 and 200"]),
    ] {
        run_fails(root, &[&["data"], args].concat(), 2, &needles);
    }
    write(root, "in/valid/labels/a.txt", "1 0.5 0.25 0.2 0.1\n1 200 0.25 0.2 0.1\n5 0.5 0.5 0.1 0.1\n");
    let needles = ["in/valid/labels/a.txt:2: `200`", "1 more places are wrong", "divide pixels"];
    run_fails(root, &["data", "convert", "yolo", "in", "out"], 2, &needles);
}

/// What was left out is exit code 2, and everything else is written.
#[test]
fn a_conversion_that_leaves_something_out_says_so_by_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_yolo(root);
    write(root, "in/train/labels/a.txt", "1 0.5 0.25 0.2 0.1\n0 0.5 0.5 0.0 0.5\n");
    let left_out = run(root, &["data", "convert", "yolo", "in", "out", "--json"]);
    assert_eq!(left_out.code, Some(2));
    assert_eq!((&left_out.json()["errors"], &left_out.json()["statistics"]["boxes"]), (&1.into(), &3.into()));
    assert!(root.join("out/annotations.json").is_file());
    assert!(
        run(root, &["data", "convert", "yolo", "in", "again"])
            .stdout
            .contains("error, once: A box has no width")
    );
}

#[cfg(unix)]
#[test]
fn names_that_are_no_text_are_read_and_shown() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_yolo(root);
    let (input, out) = (OsStr::from_bytes(b"in\xff"), OsStr::from_bytes(b"out\xfe\x1b[31m"));
    std::fs::rename(root.join("in"), root.join(input)).unwrap();
    let run = |args: &[&OsStr]| common::outcome(common::petzval(root).args(args).output().unwrap());
    let [data, convert, check, yolo, json] = ["data", "convert", "check", "yolo", "--json"].map(OsStr::new);
    let converted = run(&[data, convert, yolo, input, out, json]);
    assert_eq!(converted.code, Some(0), "{}", converted.stderr);
    assert_eq!(converted.json()["annotations"], "out\u{fffd}\u{1b}[31m/annotations.json");
    let checked = run(&[data, check, out]);
    assert_eq!(checked.code, Some(0), "{}", checked.stderr);
    // Neither stdout nor stderr moves the cursor or changes colours.
    std::fs::write(root.join(out).join("annotations.json"), "{\"images\": [\n{\"id\": 1,}\n]}").unwrap();
    let bad = run(&[data, check, out]);
    assert_eq!(bad.code, Some(2));
    assert!(bad.stderr.contains(r"out�\u{1b}[31m/annotations.json"), "{}", bad.stderr);
    let unknown = run(&[OsStr::from_bytes(b"a\xff\x1b[31m")]);
    assert_eq!(unknown.code, Some(2));
    for outcome in [&converted, &checked, &bad, &unknown] {
        assert!(!outcome.stdout.contains('\u{1b}') && !outcome.stderr.contains('\u{1b}'), "{outcome:?}");
    }
}
