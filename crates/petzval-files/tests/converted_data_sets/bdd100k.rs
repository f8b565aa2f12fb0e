//! Labels of BDD100K and of Scalabel: colours and states, sizes, crowds, times.

use petzval_base::Cancel;
use petzval_files::coco::DefectKind;
use petzval_files::coco::convert::{Converted, SourceFormat, convert};

use super::{fails, objects, write, write_grey, write_png};

const BDD: &str = r#"[
{"name": "a.jpg", "videoName": "v1", "attributes": {"timeofday": "night"}, "labels": [
  {"id": "0", "category": "traffic light", "attributes": {"occluded": false, "trafficLightColor": "Red"},
   "box2d": {"x1": 10, "y1": 5, "x2": 14.5, "y2": 15}},
  {"id": "1", "category": "traffic light", "attributes": {"trafficLightColor": "none"}, "box2d": {"x1": 20, "y1": 5, "x2": 24, "y2": 15}},
  {"id": "2", "category": "car", "attributes": {"trafficLightColor": "none"}, "box2d": {"x1": 30, "y1": 5, "x2": 70, "y2": 35}},
  {"id": "3", "category": "drivable area", "poly2d": [{"vertices": [[1, 2]], "closed": true}]}]},
{"name": "b.jpg", "labels": null},
{"name": "gone.jpg"}]"#;

#[test]
fn bdd100k_colours_become_states() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "labels/det_val.json", BDD);
    write_png(root, "images/100k/val/a.png", 100, 40);
    std::fs::rename(root.join("images/100k/val/a.png"), root.join("images/100k/val/a.jpg")).unwrap();
    write_png(root, "images/100k/val/b.png", 100, 40);
    for place in [root.to_owned(), root.join("labels/det_val.json")] {
        let converted = convert(SourceFormat::Bdd100k, &place, None, &Cancel::default()).unwrap();
        let name = "images/100k/val/a.jpg";
        assert_eq!(
            objects(&converted),
            [
                // The last pixel belongs to a box: scalabel.label.transforms gives `x2 - x1 + 1`, also for fractions.
                (name, "traffic light", [10.0, 5.0, 5.5, 11.0]),
                (name, "traffic light", [20.0, 5.0, 5.0, 11.0]),
                (name, "car", [30.0, 5.0, 41.0, 31.0])
            ]
        );
        let states =
            converted.data.annotations.iter().map(|a| a.attributes.get("state").and_then(|s| s.text()));
        assert_eq!(states.collect::<Vec<_>>(), [Some("red"), None, None]);
        let image = &converted.data.images[0];
        assert_eq!((image.sequence.as_deref(), image.split.as_deref()), (Some("v1"), Some("valid")));
        // `b.jpg` is there as b.png only, and gone.jpg not at all.
        assert_eq!(converted.defects.count(DefectKind::MissingPicture), 2);
    }

    // A byte order mark is not JSON, and one of UTF-16 says how to read the file.
    let plain = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    let utf_16: Vec<u8> =
        std::iter::once(0xfeff).chain(BDD.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    for bytes in [[b"\xef\xbb\xbf".as_slice(), BDD.as_bytes()].concat(), utf_16] {
        std::fs::write(root.join("labels/det_val.json"), bytes).unwrap();
        assert_eq!(convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap(), plain);
    }

    // A second file about the same pictures adds its boxes to them.
    let more = r#"[{"name": "a.jpg", "labels": [{"category": "bus", "box2d": {"x1": 1, "y1": 2, "x2": 9, "y2": 8}}, {"category": "lane"}]}]"#;
    write(root, "labels/lane_val.json", more);
    let both = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    assert_eq!((both.data.images.len(), both.data.annotations.len()), (1, 4));
    assert_eq!(both.data.images[0].sequence.as_deref(), Some("v1"));
    // A file of lanes alone makes no background of a picture.
    write_png(root, "images/100k/val/c.png", 100, 40);
    write(
        root,
        "labels/lane_val.json",
        r#"[{"name": "c.png", "labels": [{"category": "lane/curb", "poly2d": []}]}]"#,
    );
    let lanes = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    assert_eq!((lanes.data.images.len(), lanes.defects.count(DefectKind::FileWithoutBoxes)), (1, 1));
    // Neither it nor `b.png` has labels.
    assert_eq!(lanes.defects.count(DefectKind::PictureWithoutLabels), 2);
    // A picture of which a file says that it has no labels is background.
    write(root, "labels/lane_val.json", r#"[{"name": "c.png", "labels": []}]"#);
    assert_eq!(convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap().data.images.len(), 2);
    // So is that of a file of its own, which has all labels of it.
    write(
        root,
        "labels/lane_val.json",
        r#"{"name": "c", "frames": [{"objects": [{"category": "lane/curb", "poly2d": []}]}]}"#,
    );
    assert_eq!(convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap().data.images.len(), 2);
    std::fs::remove_file(root.join("labels/lane_val.json")).unwrap();

    // Files of one picture each, with its name outside and without ending.
    let old = r#"{"name": "b", "frames": [{"timestamp": 1, "objects": [{"category": "car", "id": 3, "attributes": {},
                 "box2d": {"x1": 1, "y1": 2, "x2": 3, "y2": 5}}]}]}"#;
    write(root, "labels/det_val.json", old);
    let converted = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    assert_eq!(objects(&converted), [("images/100k/val/b.png", "car", [1.0, 2.0, 3.0, 4.0])]);

    for (from, to, needles) in [
        ("\"x1\": 10,", "\"x1\": NaN,", ["a.jpg: labels[0].box2d.x1", "no finite number"]),
        ("\"x1\": 10,", "", ["labels[0].box2d.x1", "missing"]),
        ("\"category\": \"car\"", "\"category\": 3", ["labels[2].category = 3", "wrong type"]),
        ("{\"name\": \"b.jpg\",", "{", ["`name`", "missing"]),
        ("{\"name\": \"b.jpg\",", "{\"name\" \"b.jpg\",", ["line 8, column", "not JSON"]),
    ] {
        write(root, "labels/det_val.json", &BDD.replacen(from, to, 1));
        fails(SourceFormat::Bdd100k, root, &needles);
    }
    write(root, "labels/det_val.json", "{\"images\": []}");
    fails(SourceFormat::Bdd100k, root, &["missing field `frames`", "a BDD100K file is a list"]);
}

#[test]
fn bdd100k_sizes_are_those_of_the_pictures_and_colours_that_are_no_text_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(root, "a.png", 100, 40);
    let entry = |size: &str, colour: &str| {
        format!(
            r#"[{{"name": "a.png", "size": {size}, "labels": [{{"category": "traffic light",
                "attributes": {{"trafficLightColor": {colour}}}, "box2d": {{"x1": 1, "y1": 5, "x2": 9, "y2": 15}}}}]}}]"#
        )
    };
    let read = |text: &str| {
        write(root, "labels.json", text);
        convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap()
    };
    let of = |found: &Converted, kind| (found.data.images.len(), found.defects.count(kind));
    for size in [r#"{"width": 100, "height": 40}"#, "null"] {
        assert_eq!(of(&read(&entry(size, "\"R\"")), DefectKind::UnknownState), (1, 0));
    }
    for colour in ["1", "true", "[\"R\"]"] {
        assert_eq!(of(&read(&entry("null", colour)), DefectKind::UnknownState), (1, 1), "{colour}");
    }
    // Boxes of 1280 x 720 px are of other pixels.
    let other = read(&entry(r#"{"width": 1280, "height": 720}"#, "\"R\""));
    assert_eq!(of(&other, DefectKind::OtherPictureSize), (0, 1));
    write(root, "labels.json", &entry(r#"{"width": 100}"#, "\"R\""));
    fails(SourceFormat::Bdd100k, root, &["labels.json", "a.png: size.height", "missing"]);
}

#[test]
fn states_of_every_version_of_bdd100k_are_read_and_labels_without_boxes_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(root, "a.png", 100, 40);
    let light = |colour: &str| {
        format!(
            r#"{{"category": "traffic light", "attributes": {{"trafficLightColor": "{colour}"}},
                "box2d": {{"x1": 1, "y1": 5, "x2": 9, "y2": 15}}}}"#
        )
    };
    let colours = ["G", "R", "Y", "green", "Red", "NA", "none", "blue"];
    let mut labels: Vec<String> = colours.iter().map(|colour| light(colour)).collect();
    labels.push(r#"{"category": "lane/road curb", "poly2d": []}"#.to_owned());
    labels.push(r#"{"category": "person", "poly2d": []}"#.to_owned());
    labels.push(
        r#"{"category": "car", "score": 0.5, "attributes": {"list": [1]}, "box2d": {"x1": 1, "y1": 5, "x2": 9, "y2": 15}}"#
            .to_owned(),
    );
    let text = format!(
        r#"[{{"name": "a.png", "attributes": {{"weather": "clear"}}, "labels": [{}]}}]"#,
        labels.join(", ")
    );
    write(root, "labels.json", &text);
    let converted = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    let states =
        converted.data.annotations.iter().map(|a| a.attributes.get("state").and_then(|state| state.text()));
    let wanted = [
        Some("green"),
        Some("red"),
        Some("yellow"),
        Some("green"),
        Some("red"),
        None,
        None,
        Some("blue"),
        None,
    ];
    assert_eq!(states.collect::<Vec<_>>(), wanted);
    for kind in [
        DefectKind::UnknownState,
        DefectKind::LaneOrArea,
        DefectKind::LabelWithoutBox,
        DefectKind::ScoredLabel,
        DefectKind::LooseAttribute,
        DefectKind::UnreadField,
    ] {
        assert_eq!(converted.defects.count(kind), 1, "{kind:?}: {:?}", converted.defects);
    }
    // A file of outlines of objects is no file of lanes.
    write(root, "labels.json", r#"[{"name": "a.png", "labels": [{"category": "person", "poly2d": []}]}]"#);
    let outlines = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    assert_eq!(outlines.defects.count(DefectKind::FileWithoutBoxes), 0);
    assert_eq!(outlines.defects.count(DefectKind::LabelWithoutBox), 1);
}

#[test]
fn crowds_and_what_is_ignored_in_bdd100k_are_not_judged() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(root, "a.png", 100, 40);
    let object = |keys: &str| {
        format!(r#"{{"category": "car", {keys}, "box2d": {{"x1": 1, "y1": 5, "x2": 9, "y2": 15}}}}"#)
    };
    for (keys, wanted) in [
        (r#""attributes": {"ignored": true}"#, (true, true)),
        (r#""attributes": {"Ignored": true, "Crowd": false}"#, (true, true)),
        (r#""ignored": true"#, (true, true)),
        (r#""attributes": {"crowd": true}"#, (true, false)),
        (r#""attributes": {"ignored": false}, "ignored": null"#, (false, false)),
        (r#""attributes": {"occluded": true}"#, (false, false)),
    ] {
        write(root, "labels.json", &format!(r#"[{{"name": "a.png", "labels": [{}]}}]"#, object(keys)));
        let converted = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
        let object = &converted.data.annotations[0];
        assert_eq!((object.crowd, object.ignore), wanted, "{keys}");
    }
    write(
        root,
        "labels.json",
        &format!(r#"[{{"name": "a.png", "labels": [{}]}}]"#, object(r#""ignored": "no""#)),
    );
    fails(SourceFormat::Bdd100k, root, &["labels.json", "labels[0].ignored", "wrong type", "true or false"]);
}

#[test]
fn rotations_in_bdd100k_are_of_cvat_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(root, "a.png", 400, 300);
    // 41 x 101 px about (120.5, 130.5).
    let write_object = |keys: &str, in_box: &str| {
        let corners = format!(r#"{{"x1": 100, "y1": 80, "x2": 140, "y2": 180{in_box}}}"#);
        let text =
            format!(r#"[{{"name": "a.png", "labels": [{{"category": "car", {keys}"box2d": {corners}}}]}}]"#);
        write(root, "labels.json", &text);
    };
    let read = |keys: &str, in_box: &str| {
        write_object(keys, in_box);
        convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap()
    };
    let unread = |found: &Converted| -> Vec<String> {
        let unread = found.defects.iter().find(|defect| defect.kind == DefectKind::UnreadField);
        unread.map_or(Vec::new(), |defect| defect.first.clone())
    };
    let upright = [100.0, 80.0, 41.0, 101.0];
    let rotated = read(r#""attributes": {"Rotation": 90}, "#, "");
    let (_, _, bounds) = objects(&rotated)[0];
    let near = bounds.iter().zip([70.0, 110.0, 101.0, 41.0]).all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(near, "{bounds:?}");
    assert_eq!(rotated.defects.count(DefectKind::RotatedBox), 1);
    // The box around it is not rotated again where the data set is read.
    assert!(rotated.data.annotations[0].attributes.is_empty());

    for (keys, in_box, wanted) in [
        (r#""attributes": {"angle": 30}, "#, "", "labels[].attributes.angle (1)"),
        (r#""theta": 0.5, "id": "7", "#, "", "labels[].theta (1)"),
        ("", r#", "angle": 0"#, "labels[].box2d.angle (1)"),
        ("", r#", "depth": 3"#, "labels[].box2d.depth (1)"),
    ] {
        let found = read(keys, in_box);
        assert_eq!((objects(&found)[0].2, unread(&found)), (upright, vec![wanted.to_owned()]));
        assert_eq!(found.defects.count(DefectKind::RotatedBox), 0);
    }
    assert!(unread(&read(r#""id": 7, "poly2d": null, "attributes": {"angle": 0}, "#, "")).is_empty());
    write_object("", r#", "angle": 0.5"#);
    fails(SourceFormat::Bdd100k, root, &["labels[0].box2d.angle = 0.5", "in which unit", "`rotation`"]);
    for value in ["\"30,5\"", "[30]", "true"] {
        write_object(&format!(r#""attributes": {{"rotation": {value}}}, "#), "");
        fails(SourceFormat::Bdd100k, root, &["labels[0].attributes.rotation", "wrong type", "degrees"]);
    }
}

#[test]
fn bdd100k_labels_of_two_times_are_not_laid_on_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for name in ["a.png", "b.png"] {
        write_png(root, name, 100, 40);
    }
    let labels = |key: &str, left: u32| {
        format!(r#""{key}": [{{"category": "car", "box2d": {{"x1": {left}, "y1": 5, "x2": 90, "y2": 15}}}}]"#)
    };
    let frame = |keys: &str, left: u32| format!("{{{keys}{}}}", labels("objects", left));
    let entry = |name: &str, keys: &str, left: u32| {
        format!(r#"{{"name": "{name}.png", {keys}{}}}"#, labels("labels", left))
    };
    let table = |frames: &[String]| format!(r#"{{"name": "a", "frames": [{}]}}"#, frames.join(", "));
    let list = |entries: &[String]| format!("[{}]", entries.join(", "));
    for (text, pictures, objects, times, repeated) in [
        (table(&[frame("", 1)]), 1, 1, 0, 0),
        (table(&[frame("\"timestamp\": 1000, ", 1), frame("\"timestamp\": 2000, ", 2)]), 0, 0, 1, 0),
        (table(&[frame("", 1), frame("\"name\": \"b.png\", ", 2)]), 2, 2, 0, 0),
        (list(&[entry("a", "", 1), entry("a", "", 2)]), 1, 2, 0, 1),
        (list(&[entry("a", "\"frameIndex\": 3, ", 1), entry("a", "\"frameIndex\": 3, ", 2)]), 1, 2, 0, 1),
        (list(&[entry("a", "\"frameIndex\": 3, ", 1), entry("a", "\"frameIndex\": 4, ", 2)]), 0, 0, 1, 0),
        (list(&[entry("a", "\"timestamp\": 3, ", 1), entry("b", "\"timestamp\": 4, ", 2)]), 2, 2, 0, 0),
    ] {
        write(root, "labels.json", &text);
        let found = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
        let counts =
            [DefectKind::SeveralTimes, DefectKind::RepeatedFile].map(|kind| found.defects.count(kind));
        assert_eq!((found.data.images.len(), found.data.annotations.len()), (pictures, objects), "{text}");
        assert_eq!(counts, [times, repeated], "{text}");
    }
}

#[test]
fn frames_of_one_name_are_in_the_folders_of_their_films() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_grey(root, "images/v1/0001.png", 40);
    write_grey(root, "images/v2/0001.png", 200);
    let labels = |ending: &str| {
        let frame = |(film, class): (&str, &str)| {
            let corners = r#"{"x1": 1, "y1": 5, "x2": 9, "y2": 15}"#;
            format!(
                r#"{{"name": "0001{ending}", "videoName": "{film}", "labels": [{{"category": "{class}", "box2d": {corners}}}]}}"#
            )
        };
        write(root, "labels.json", &format!("[{}]", [("v1", "car"), ("v2", "bus")].map(frame).join(", ")));
        convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap()
    };
    for ending in [".png", ""] {
        let found = labels(ending);
        let bounds = [1.0, 5.0, 9.0, 11.0];
        assert_eq!(
            objects(&found),
            [("images/v1/0001.png", "car", bounds), ("images/v2/0001.png", "bus", bounds)]
        );
        assert_eq!(found.defects.errors(), 0);
    }
    // Labels of a film whose pictures are not there are not laid on those of another one.
    std::fs::remove_dir_all(root.join("images/v2")).unwrap();
    let lost = labels(".png");
    assert_eq!((lost.data.images.len(), lost.defects.count(DefectKind::SeveralTimes)), (0, 1));
}
