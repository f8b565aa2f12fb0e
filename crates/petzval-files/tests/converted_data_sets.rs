//! Data sets in other formats: what is read, and what is wrong with damaged ones.

use petzval_base::Cancel;
use std::path::Path;

use petzval_files::coco::convert::{Converted, SourceFormat, convert};
use petzval_files::coco::{Bounds, CocoError, DefectKind};

fn write(root: &Path, name: &str, text: &str) {
    let path = root.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, text).unwrap();
}

fn write_png(root: &Path, name: &str, width: u32, height: u32) {
    let path = root.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::RgbImage::from_pixel(width, height, image::Rgb([90, 120, 60])).save(path).unwrap();
}

/// Name of the picture, class and bounds of each object that counts.
fn objects(converted: &Converted) -> Vec<(&str, &str, [f64; 4])> {
    let data = &converted.data;
    let named = data.annotations.iter().filter(|a| !a.crowd).map(|a| {
        let image = data.images.iter().find(|image| image.id == a.image_id).unwrap();
        (image.file_name.as_str(), data.category(a.category_id).unwrap().name.as_str(), a.bounds.into())
    });
    named.collect()
}

/// The error of a folder that cannot be read: its message.
fn fails(format: SourceFormat, root: &Path, needles: &[&str]) {
    let error = convert(format, root, None, &Cancel::default()).unwrap_err();
    let text = error.to_string();
    assert!(
        needles.iter().all(|needle| text.contains(needle)) && text.contains("hint"),
        "{needles:?}: {text}"
    );
    if let CocoError::File { error, .. } = error {
        assert!(error.hint.is_some(), "{error}");
    }
}

const KITTI: &str = "Car 0.25 1 -1.57 10.5 20.0 40.5 32.0 1.5 1.6 3.9 1 2 30 -1.5\n\
                     Pedestrian 0 0 0.2 50 5 60 35 1.7 0.5 0.8 4 2 20 0.1\n\
                     DontCare -1 -1 -10 70 1 90 8 -1 -1 -1 -1000 -1000 -1000 -10\n";

#[test]
fn kitti_regions_are_crowds_of_every_class() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "training/label_2/000001.txt", KITTI);
    write(root, "training/label_2/000002.txt", "\n");
    write(root, "training/label_2/000003.txt", KITTI);
    write_png(root, "training/image_2/000001.png", 100, 40);
    write_png(root, "training/image_2/000002.png", 100, 40);
    let converted = convert(SourceFormat::Kitti, root, None, &Cancel::default()).unwrap();
    assert_eq!(
        converted,
        convert(SourceFormat::Kitti, &root.join("training"), None, &Cancel::default()).unwrap()
    );
    let cancelled = Cancel::default();
    cancelled.set();
    for format in [SourceFormat::Kitti, SourceFormat::Bdd100k, SourceFormat::Yolo, SourceFormat::Voc] {
        assert!(matches!(convert(format, root, None, &cancelled), Err(CocoError::Stopped(_))), "{format:?}");
    }
    let (car, pedestrian) = ([10.5, 20.0, 30.0, 12.0], [50.0, 5.0, 10.0, 30.0]);
    let name = "images/000001.png";
    assert_eq!(objects(&converted), [(name, "Car", car), (name, "Pedestrian", pedestrian)]);
    let crowds: Vec<_> = converted.data.annotations.iter().filter(|a| a.crowd).collect();
    assert_eq!(crowds.len(), 2);
    assert!(crowds.iter().all(|a| a.ignore && a.bounds == Bounds::from([70.0, 1.0, 20.0, 7.0])));
    assert_eq!(converted.sources[0], root.join("training/image_2/000001.png"));
    assert_eq!(converted.data.images.len(), 2);
    assert_eq!(converted.data.images[0].split.as_deref(), Some("train"));
    let count = |kind| converted.defects.count(kind);
    assert_eq!((count(DefectKind::MissingPicture), count(DefectKind::PictureWithoutBoxes)), (1, 1));
    assert_eq!(count(DefectKind::PictureWithoutLabels), 0);

    // A picture without labels is left out with a note.
    write_png(root, "training/image_2/000009.png", 100, 40);
    let more = convert(SourceFormat::Kitti, root, None, &Cancel::default()).unwrap();
    let found = more.defects.iter().find(|d| d.kind == DefectKind::PictureWithoutLabels).unwrap();
    assert!(found.count == 1 && found.first[0].ends_with("000009.png"), "{found:?}");
    assert_eq!(more.data, converted.data);
    std::fs::remove_file(root.join("training/image_2/000009.png")).unwrap();

    // The devkit knows of which drive a picture is.
    assert!(converted.data.images.iter().all(|image| image.sequence.is_none()));
    let lines =
        "2011_09_26 drive_a 0000000001\n2011_09_26 drive_b 0000000007\n2011_09_28 drive_c 0000000002\n";
    write(root, "devkit_object/mapping/train_mapping.txt", lines);
    write(root, "devkit_object/mapping/train_rand.txt", "3,1,\n2");
    for from in [root.to_owned(), root.join("training")] {
        let images = convert(SourceFormat::Kitti, &from, None, &Cancel::default()).unwrap().data.images;
        let drives: Vec<_> = images.iter().map(|image| image.sequence.as_deref()).collect();
        assert_eq!(drives, [Some("drive_a"), Some("drive_b")]);
    }
    write(root, "devkit_object/mapping/train_rand.txt", "3,1,4");
    fails(SourceFormat::Kitti, root, &["train_rand.txt", "`4` is not the number of a line"]);
    std::fs::remove_dir_all(root.join("devkit_object")).unwrap();

    write(root, "training/label_2/000002.txt", &format!("{KITTI}Car 0.25 one -1.57\n{KITTI}Car x"));
    let needles = ["000002.txt: line 4: `Car 0.25 one -1.57`", "has 4 values", "1 more places are wrong"];
    fails(SourceFormat::Kitti, root, &needles);
    fails(SourceFormat::Kitti, &root.join("training/label_2"), &["no folder `label_2`"]);
    assert!(convert(SourceFormat::Kitti, &root.join("nowhere"), None, &Cancel::default()).is_err());
}

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
                (name, "traffic light", [10.0, 5.0, 4.5, 10.0]),
                (name, "traffic light", [20.0, 5.0, 4.0, 10.0]),
                (name, "car", [30.0, 5.0, 40.0, 30.0])
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
    assert_eq!(objects(&converted), [("images/100k/val/b.png", "car", [1.0, 2.0, 2.0, 3.0])]);

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
fn yolo_is_read_in_every_layout() {
    let label = "1 0.5 0.25 0.2 0.1\n0 0.5 0.5 1.0 1.002\n";
    let layouts = [
        ("train/images/a.png", "train/labels/a.txt", "images/train/a.png"),
        ("images/train/a.png", "labels/train/a.txt", "images/train/a.png"),
        ("obj/a.png", "obj/a.txt", "images/obj/a.png"),
        ("images/a.png", "labels/a.txt", "images/a.png"),
    ];
    for (picture, labels, name) in layouts {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        write_png(root, picture, 100, 40);
        write(root, labels, label);
        write(
            root,
            "data.yaml",
            "train: ../train/images\nval: ../valid/images\nnc: 2\nnames: ['green', 'red']\n",
        );
        let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
        assert_eq!(
            objects(&converted),
            [(name, "red", [40.0, 8.0, 20.0, 4.0]), (name, "green", [0.0, 0.0, 100.0, 40.0])]
        );
        // The second box is higher than its picture by rounding.
        assert_eq!(converted.defects.count(DefectKind::ClippedBox), 1);
        assert_eq!(converted.data.categories[0].name, "green");
        assert_eq!(converted.data.images[0].split.is_some(), name.contains("train"));
    }
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for part in ["train", "valid", "test"] {
        write_png(root, &format!("{part}/images/a.png"), 100, 40);
        write(root, &format!("{part}/labels/a.txt"), label);
    }
    write(root, "test/labels/lost.txt", label);
    fails(SourceFormat::Yolo, root, &["no file names the classes"]);
    write(root, "classes.txt", "green\nred\n");
    write(root, "README.txt", "a text that is no label");
    let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
    let names: Vec<&str> = converted.data.images.iter().map(|image| image.file_name.as_str()).collect();
    assert_eq!(names, ["images/test/a.png", "images/train/a.png", "images/valid/a.png"]);
    assert_eq!(converted.defects.count(DefectKind::MissingPicture), 1);

    write(root, "valid/labels/a.txt", "0 0.5 0.5 0.1 0.1\n\n1 0.5 120 0.1 0.1\n7 0.5 0.5 0.1 0.1\n");
    fails(SourceFormat::Yolo, root, &["valid/labels/a.txt: line 3: `120`", "no share", "1 more places"]);
    write(root, "data.yaml", "names: [a, b\n");
    fails(SourceFormat::Yolo, root, &["data.yaml", "not YAML"]);
    write(root, "data.yaml", "nc: 2\nnames: [a]\n");
    fails(SourceFormat::Yolo, root, &["data.yaml: line 1: `nc = 2`", "`names` lists 1"]);

    // Pictures alone, as they lie beside a file in COCO format.
    let bare = tempfile::tempdir().unwrap();
    write_png(bare.path(), "test_0001.png", 10, 10);
    write(bare.path(), "data.yaml", "names: [a]\n");
    fails(SourceFormat::Yolo, bare.path(), &["no picture here has a file of labels", "petzval data check"]);
}

const VOC: &str = "<annotation>
<filename>a.png</filename>
<size><width>100</width><height>40</height><depth>3</depth></size>
<object><name>person</name><pose>Left</pose><truncated>1</truncated><difficult>0</difficult>
<bndbox><xmin>11</xmin><ymin>6</ymin><xmax>30</xmax><ymax>40</ymax></bndbox>
<part><name>head</name><bndbox><xmin>1</xmin><ymin>1</ymin><xmax>2</xmax><ymax>2</ymax></bndbox></part></object>
<object><name>car</name><difficult>1</difficult>
<bndbox><xmin>1</xmin><ymin>1</ymin><xmax>100</xmax><ymax>40</ymax></bndbox></object>
</annotation>
";

#[test]
fn voc_boxes_count_from_one_and_difficult_objects_are_ignored() {
    for (labels, picture) in [("Annotations/a.xml", "JPEGImages/a.png"), ("train/a.xml", "train/a.png")] {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        write(root, labels, VOC);
        write_png(root, picture, 100, 40);
        let converted = convert(SourceFormat::Voc, root, None, &Cancel::default()).unwrap();
        let name = if labels.starts_with("train") { "images/train/a.png" } else { "images/a.png" };
        let (person, car) = ([10.0, 5.0, 20.0, 35.0], [0.0, 0.0, 100.0, 40.0]);
        assert_eq!(objects(&converted), [(name, "person", person), (name, "car", car)]);
        let ignored: Vec<bool> = converted.data.annotations.iter().map(|a| a.ignore).collect();
        assert_eq!(ignored, [false, true]);
        assert_eq!(converted.data.annotations[0].attributes["pose"].text(), Some("Left"));
        assert_eq!(converted.defects.errors(), 0);
        assert_eq!(converted.defects.count(DefectKind::CountedFromZero), 0);
        // A box that begins at 0 is counted: the set may count from there. One further out reaches out.
        for (left, count) in [("0", 1), ("0.5", 1), ("-3", 0)] {
            write(root, labels, &VOC.replace("<xmin>11", &format!("<xmin>{left}")));
            let from_zero = convert(SourceFormat::Voc, root, None, &Cancel::default()).unwrap();
            assert_eq!(from_zero.defects.count(DefectKind::CountedFromZero), count, "{left}");
            assert_eq!(from_zero.defects.count(DefectKind::ClippedBox), 1);
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(root, "JPEGImages/a.png", 100, 40);
    write(root, "ImageSets/Main/val.txt", "a\n");
    write(root, "ImageSets/Main/car_train.txt", "a -1\n");
    write(root, "Annotations/a.xml", VOC);
    write_png(root, "JPEGImages/b.png", 100, 40);
    write_png(root, "SegmentationClass/a.png", 100, 40);
    let converted = convert(SourceFormat::Voc, root, None, &Cancel::default()).unwrap();
    assert_eq!(converted.data.images[0].split.as_deref(), Some("valid"));
    // `trainval` is of two parts: what no other list names is trained on. A picture of two lists is held out, and one that is not there is listed.
    for name in ["c", "d", "e"] {
        write_grey(root, &format!("JPEGImages/{name}.png"), 30);
        write(root, &format!("Annotations/{name}.xml"), VOC);
    }
    let parts = |lists: &[(&str, &str)]| {
        let _ = std::fs::remove_dir_all(root.join("ImageSets"));
        lists.iter().for_each(|(list, lines)| write(root, &format!("ImageSets/Main/{list}.txt"), lines));
        let converted = convert(SourceFormat::Voc, root, None, &Cancel::default()).unwrap();
        let parts = converted.data.images.iter().map(|image| image.split.clone().unwrap_or_default());
        let kinds = [DefectKind::PictureInTwoParts, DefectKind::ListedWithoutPicture];
        (parts.collect::<Vec<_>>().join(" "), kinds.map(|kind| converted.defects.count(kind)))
    };
    assert_eq!(
        parts(&[("trainval", "a\nc\nd\n"), ("test", "e\n")]),
        ("train train train test".into(), [0, 0])
    );
    assert_eq!(
        parts(&[("trainval", "a\nc\nd\ne"), ("val", "e\n")]),
        ("train train train valid".into(), [0, 0])
    );
    assert_eq!(
        parts(&[("trainval", "a\nc\nd\n"), ("train", "a\nc\n")]),
        ("train train valid ".into(), [0, 0])
    );
    assert_eq!(parts(&[("trainval", "a\nc\ne\n"), ("test", "e\n")]), ("train train  test".into(), [1, 0]));
    let lists = [("train", "a\nc\nd\nzz\n"), ("val", "d.png\nc\n")];
    assert_eq!(parts(&lists), ("train valid valid ".into(), [2, 1]));
    for name in ["c", "d", "e"] {
        std::fs::remove_file(root.join(format!("JPEGImages/{name}.png"))).unwrap();
        std::fs::remove_file(root.join(format!("Annotations/{name}.xml"))).unwrap();
    }
    // A mask has the name of its picture.
    let unlabelled = converted.defects.iter().find(|d| d.kind == DefectKind::PictureWithoutLabels).unwrap();
    assert!(unlabelled.count == 1 && unlabelled.first[0].ends_with("b.png"), "{unlabelled:?}");
    for (from, to, needles) in [
        ("<xmin>11</xmin>", "<xmin>left</xmin>", ["a.xml: line 5, column 9: `xmin = left`", "no number"]),
        ("<xmin>11</xmin>", "", ["line 5, column 1", "`xmin` is missing"]),
        ("<name>person</name>", "", ["line 4", "no `name`"]),
        ("</annotation>", "", ["a.xml: line 8", "the file is cut off"]),
        ("<annotation>", "<!DOCTYPE a [<!ENTITY b \"c\">]><annotation>", ["a.xml: line 1", "not XML"]),
    ] {
        write(root, "Annotations/a.xml", &VOC.replacen(from, to, 1));
        fails(SourceFormat::Voc, root, &needles);
    }
    write(root, "Annotations/a.xml", "<svg/>");
    fails(SourceFormat::Voc, root, &["line 1", "not `annotation`"]);
    write(root, "Annotations/a.xml", &VOC.replacen("<width>100<", "<width>99<", 1));
    let converted = convert(SourceFormat::Voc, root, None, &Cancel::default()).unwrap();
    assert_eq!((converted.data.images.len(), converted.defects.count(DefectKind::OtherPictureSize)), (0, 1));
    // Deep nesting ends in an error, not in an overflow of the stack.
    write(root, "Annotations/a.xml", &"<annotation>".repeat(200_000));
    assert!(convert(SourceFormat::Voc, root, None, &Cancel::default()).is_err());
}

/// Writes a picture of one colour, 100 x 40 px.
fn write_grey(root: &Path, name: &str, grey: u8) {
    let path = root.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::GrayImage::from_pixel(100, 40, image::Luma([grey])).save(path).unwrap();
}

#[test]
fn parts_that_repeat_the_names_of_pictures_keep_their_own_labels() {
    // The class of each part is the name of the part.
    let layouts = [
        ("Annotations/PART/a.xml", "JPEGImages/PART/a.png"),
        ("PART/Annotations/a.xml", "PART/JPEGImages/a.png"),
        ("PART/a.xml", "PART/a.PNG"),
    ];
    for (labels, picture) in layouts {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for (part, grey) in [("train", 40), ("val", 200)] {
            write(root, &labels.replace("PART", part), &VOC.replace("person", part));
            let picture = picture.replace("PART", part);
            write_grey(root, &picture.replace(".PNG", ".png"), grey);
            if picture.ends_with(".PNG") {
                std::fs::rename(root.join(picture.replace(".PNG", ".png")), root.join(&picture)).unwrap();
            }
        }
        let converted = convert(SourceFormat::Voc, root, None, &Cancel::default()).unwrap();
        let found = objects(&converted);
        assert_eq!(found.len(), 4, "{labels}");
        assert!(found.iter().all(|(file, class, _)| *class == "car" || file.contains(class)), "{found:?}");
        assert_eq!(converted.defects.errors(), 0);
    }

    // A file whose own picture is gone takes that of another part, which is counted.
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "train/Annotations/a.xml", VOC);
    write(root, "val/Annotations/a.xml", VOC);
    write_grey(root, "val/JPEGImages/a.png", 90);
    let converted = convert(SourceFormat::Voc, root, None, &Cancel::default()).unwrap();
    assert_eq!(converted.defects.count(DefectKind::RepeatedFile), 1);

    // A list of BDD100K that states folders means them.
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let entry = |name: &str, class: &str| {
        format!(
            r#"{{"name": "{name}", "labels": [{{"category": "{class}", "box2d": {{"x1": 1, "y1": 2, "x2": 9, "y2": 8}}}}]}}"#
        )
    };
    write_grey(root, "images/one/a.png", 40);
    write_grey(root, "images/two/a.png", 200);
    write(root, "labels/l.json", &format!("[{}, {}]", entry("one/a.png", "one"), entry("two/a.png", "two")));
    let converted = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    let found = objects(&converted);
    assert!(found.len() == 2 && found.iter().all(|(file, class, _)| file.contains(class)), "{found:?}");
    // A bare name may be either, unless both are one picture.
    write_grey(root, "images/one/b.png", 90);
    write(root, "labels/l.json", &format!("[{}, {}]", entry("a.png", "car"), entry("b.png", "car")));
    let converted = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    assert_eq!(objects(&converted).len(), 1);
    let several = converted.defects.iter().find(|d| d.kind == DefectKind::SeveralPictures).unwrap();
    assert!(several.count == 1 && several.first[0].contains("one/a.png or "), "{several:?}");
    write_grey(root, "images/two/a.png", 40);
    let converted = convert(SourceFormat::Bdd100k, root, None, &Cancel::default()).unwrap();
    assert_eq!((objects(&converted).len(), converted.defects.errors()), (2, 0));
}

/// A picture whose EXIF says that it is to be turned, 100 x 40 stored pixels.
fn write_turned_png(root: &Path, name: &str, exif: u8) {
    use image::ImageEncoder;
    let picture = image::RgbImage::from_pixel(100, 40, image::Rgb([90, 120, 60]));
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let about = [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0", &[exif][..], b"\0\0\0\0\0\0"].concat();
    encoder.set_exif_metadata(about).unwrap();
    encoder.write_image(&picture, 100, 40, image::ExtendedColorType::Rgb8).unwrap();
    let path = root.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn yolo_poses_are_boxes_and_outlines_and_rotated_boxes_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(root, "images/a.png", 400, 300);
    // A box of [160, 90, 80, 120], and four points in it.
    let pose = "0 0.5 0.5 0.2 0.4 0.45 0.35 0.55 0.35 0.45 0.65 0.55 0.65\n";
    write(root, "labels/a.txt", pose);
    write(root, "data.yaml", "kpt_shape: [4, 2]\nnames:\n  0: car\n");
    let read = || convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
    let near = |found: &Converted, wanted: [f64; 4]| {
        let bounds = <[f64; 4]>::from(found.data.annotations[0].bounds);
        let is_near = bounds.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(is_near, "{bounds:?}, wanted {wanted:?}");
    };
    let poses = read();
    near(&poses, [160.0, 90.0, 80.0, 120.0]);
    let unread = poses.defects.iter().find(|d| d.kind == DefectKind::UnreadField).unwrap();
    assert_eq!(unread.first, ["keypoints (1)"]);
    write(root, "labels/a.txt", "0 0.5 0.5 0.2 0.4 0.45 0.35 0.55\n");
    fails(SourceFormat::Yolo, root, &["a.txt: line 1", "has 8 values", "the 13 of a box with the keypoints"]);

    // The same numbers are an outline where nothing says that they are a pose, and that is counted.
    write(root, "data.yaml", "names: [car]\n");
    write(root, "labels/a.txt", pose);
    let outline = read();
    near(&outline, [80.0, 105.0, 140.0, 90.0]);
    assert_eq!(outline.defects.count(DefectKind::OutlineBox), 1);
    // Corners of a square on its tip, and of an upright box.
    write(root, "labels/a.txt", "0 0.5 0.2 0.65 0.4 0.5 0.6 0.35 0.4\n0 0.1 0.1 0.2 0.1 0.2 0.3 0.1 0.3\n");
    let rotated = read();
    near(&rotated, [140.0, 60.0, 120.0, 120.0]);
    let count = |kind| rotated.defects.count(kind);
    assert_eq!((count(DefectKind::RotatedBox), count(DefectKind::OutlineBox)), (1, 1));
}

#[test]
fn labels_of_turned_pictures_are_turned_as_their_format_says() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    // YOLO means the turned picture, 40 x 100 px.
    for (name, exif) in [("a", 6), ("b", 3)] {
        write_turned_png(root, &format!("yolo/images/{name}.png"), exif);
        write(root, &format!("yolo/labels/{name}.txt"), "0 0.5 0.5 0.5 0.1\n");
    }
    write(root, "yolo/data.yaml", "names: [car]\n");
    let converted = convert(SourceFormat::Yolo, &root.join("yolo"), None, &Cancel::default()).unwrap();
    let bounds: Vec<[f64; 4]> = objects(&converted).into_iter().map(|(_, _, bounds)| bounds).collect();
    assert_eq!(bounds, [[10.0, 45.0, 20.0, 10.0], [25.0, 18.0, 50.0, 4.0]]);
    assert_eq!(converted.defects.count(DefectKind::TurnedPicture), 2);
    // What was converted says so itself.
    assert!(converted.data.images.iter().all(|image| image.turned == Some(true)));

    // VOC states the size: here that of the stored pixels.
    write_turned_png(root, "voc/a.png", 6);
    write(root, "voc/a.xml", VOC);
    let converted = convert(SourceFormat::Voc, &root.join("voc"), None, &Cancel::default()).unwrap();
    let (person, car) = ([0.0, 10.0, 35.0, 20.0], [0.0, 0.0, 40.0, 100.0]);
    let name = "images/a.png";
    assert_eq!(objects(&converted), [(name, "person", person), (name, "car", car)]);
    assert_eq!((converted.data.images[0].width, converted.defects.count(DefectKind::TurnedBoxes)), (40, 1));
    let unread = converted.defects.iter().find(|d| d.kind == DefectKind::UnreadField).unwrap();
    assert_eq!(unread.first, ["object/part (1)"]);

    // KITTI states none.
    write_turned_png(root, "kitti/image_2/000001.png", 6);
    write(root, "kitti/label_2/000001.txt", KITTI);
    let converted = convert(SourceFormat::Kitti, &root.join("kitti"), None, &Cancel::default()).unwrap();
    assert_eq!((converted.data.images.len(), converted.data.annotations.len()), (0, 0));
    assert_eq!((converted.defects.count(DefectKind::UnknownTurn), converted.defects.errors()), (1, 1));
}

#[test]
fn the_caller_says_what_boxes_of_turned_pictures_are_of() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let read = |format, name: &str, turned| {
        let converted = convert(format, &root.join(name), turned, &Cancel::default()).unwrap();
        let bounds: Vec<[f64; 4]> = objects(&converted).into_iter().map(|(_, _, bounds)| bounds).collect();
        (bounds, converted.defects.errors(), converted.defects.count(DefectKind::UnknownTurn))
    };
    // Half a turn leaves the size that VOC states; a quarter turn does not, and the size decides.
    write_turned_png(root, "voc/a.png", 3);
    write(root, "voc/a.xml", VOC);
    let (person, car) = ([10.0, 5.0, 20.0, 35.0], [0.0, 0.0, 100.0, 40.0]);
    assert_eq!(read(SourceFormat::Voc, "voc", None), (vec![], 1, 1));
    assert_eq!(read(SourceFormat::Voc, "voc", Some(true)), (vec![person, car], 0, 0));
    let other_way_up = [70.0, 0.0, 20.0, 35.0];
    assert_eq!(read(SourceFormat::Voc, "voc", Some(false)), (vec![other_way_up, car], 0, 0));
    write_turned_png(root, "voc/a.png", 6);
    let by_size = read(SourceFormat::Voc, "voc", None);
    assert_eq!(by_size.0, [[0.0, 10.0, 35.0, 20.0], [0.0, 0.0, 40.0, 100.0]]);
    assert_eq!(read(SourceFormat::Voc, "voc", Some(true)), by_size);

    // Shares are of the stored pixels then: 100 x 40 px, of which a quarter turn makes 40 x 100.
    write_turned_png(root, "yolo/images/a.png", 6);
    write(root, "yolo/labels/a.txt", "0 0.3 0.5 0.2 0.5\n");
    write(root, "yolo/data.yaml", "names: [car]\n");
    // Of the stored pixels the box has columns 20 to 40 and rows 10 to 30.
    for (turned, wanted) in [(true, [8.0, 25.0, 8.0, 50.0]), (false, [10.0, 20.0, 20.0, 20.0])] {
        let found = read(SourceFormat::Yolo, "yolo", Some(turned)).0;
        let near = found[0].iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(found.len() == 1 && near, "{turned}: {found:?}");
    }
}

#[test]
fn yolo_pictures_that_cannot_be_decoded_have_labels_and_classes_of_one_name_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "images/a.bmp", "BM: no picture that is read");
    write(root, "labels/a.txt", "1 0.5 0.5 0.2 0.1\n");
    write(root, "data.yaml", "names: [light, car, light]\n");
    let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
    let count = |kind| converted.defects.count(kind);
    assert_eq!((count(DefectKind::UnreadablePicture), count(DefectKind::MissingPicture)), (1, 0));
    let repeated = converted.defects.iter().find(|d| d.kind == DefectKind::RepeatedClassName).unwrap();
    assert_eq!((repeated.count, repeated.first[0].as_str()), (1, "class 2: \"light\""));
}

#[test]
fn parts_of_yolo_are_those_that_its_file_names() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for name in ["one", "two", "train"] {
        write_png(root, &format!("images/{name}/a.png"), 100, 40);
        write(root, &format!("labels/{name}/a.txt"), "0 0.5 0.5 0.2 0.1\n");
    }
    let parts = |yaml: &str| {
        write(root, "data.yaml", &format!("names: [car]\n{yaml}"));
        let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
        let split = |of: &str| {
            let image = converted.data.images.iter().find(|image| image.file_name.contains(of)).unwrap();
            image.split.clone()
        };
        let lost = converted.defects.count(DefectKind::PartWithoutPictures);
        (["images/one", "images/two", "images/train"].map(split), lost)
    };
    let named = |names: [&str; 3]| names.map(|name| Some(name.to_owned()).filter(|name| !name.is_empty()));
    assert_eq!(parts(""), (named(["", "", "train"]), 0));
    let yaml = "path: ../elsewhere\ntrain: [images/one, ./images/train]\nval: ../images/two\ntest:\n";
    assert_eq!(parts(yaml), (named(["train", "valid", "train"]), 0));
    // A folder that is called otherwise, and a list that is not there, which is counted.
    assert_eq!(parts("val: images/train\ntest: lists/test.txt\n"), (named(["", "", "valid"]), 1));
    // Folders that are not there, of which `images` alone is no place on another machine.
    let yaml = "train: imges/one\nval: /home/x/set/images/two\ntest: /home/x/images\n";
    assert_eq!(parts(yaml), (named(["", "valid", "train"]), 2));
    // `path` counts where its folder is here: the parts lie in it, though folders of their names lie beside it.
    write_png(root, "images/sub/two/a.png", 100, 40);
    write(root, "labels/sub/two/a.txt", "0 0.5 0.5 0.2 0.1\n");
    assert_eq!(parts("path: images/sub\nval: two\n"), (named(["", "", "train"]), 0));
    assert_eq!(parts("path: ../images\nval: two\n"), (named(["", "valid", "train"]), 0));
    std::fs::remove_dir_all(root.join("images/sub")).unwrap();
    std::fs::remove_dir_all(root.join("labels/sub")).unwrap();

    // Lists name pictures from their own folder or from that of the data set. One that two lists name is held out.
    write(root, "lists/a.txt", "images/one/a.png\n\n../images/two/a.png\nimages/none.png\n");
    write(root, "b.txt", "/home/x/set/images/two/a.png\n./images/train/a.png\n");
    assert_eq!(parts("train: lists/a.txt\nval: b.txt\n"), (named(["train", "valid", "valid"]), 0));
    let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
    let first = |kind| &converted.defects.iter().find(|d| d.kind == kind).unwrap().first;
    let listed = first(DefectKind::ListedWithoutPicture);
    assert!(listed.len() == 1 && listed[0].ends_with("lists/a.txt: line 4: images/none.png"), "{listed:?}");
    let both = first(DefectKind::PictureInTwoParts);
    assert!(both.len() == 1 && both[0].ends_with("line 3: ../images/two/a.png, and in valid"), "{both:?}");
}

#[test]
fn yolo_files_that_give_a_number_to_two_classes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for part in ["train", "val"] {
        write_png(root, &format!("{part}/images/{part}.png"), 100, 40);
        write(root, &format!("{part}/labels/{part}.txt"), "0 0.5 0.5 0.2 0.1\n");
    }
    let classes = || convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap().data.categories;
    let names = || classes().into_iter().map(|class| class.name).collect::<Vec<_>>();
    write(root, "train/labels/classes.txt", "person\ncar\n");
    write(root, "val/labels/classes.txt", "car\nperson\n");
    let files = ["val/labels/classes.txt", "train/labels/classes.txt", "class 0 is `car`, and `person` in"];
    fails(SourceFormat::Yolo, root, &files);
    // A file may know fewer classes, or write them in capitals.
    write(root, "val/labels/classes.txt", "Person\ncar\nbus\n");
    assert_eq!(names(), ["Person", "car", "bus"]);
    write(root, "data.yaml", "names: [person, car]\n");
    assert_eq!(names(), ["person", "car"]);
    write(root, "val/labels/classes.txt", "person\nbus\n");
    fails(
        SourceFormat::Yolo,
        root,
        &["val/labels/classes.txt", "data.yaml", "class 1 is `bus`, and `car` in"],
    );
    write(root, "val/labels/classes.txt", "person\n");
    write(root, "more.yaml", "names: {0: car, 1: person}\n");
    fails(SourceFormat::Yolo, root, &["more.yaml", "data.yaml", "class 0 is `car`, and `person` in"]);
    // Other pages of a folder have no classes, or are none of this form.
    write(root, "more.yaml", "names: [[1, 2]]\n");
    write(root, "train/data.yaml", "lr0: 0.01\n");
    assert_eq!(names(), ["person", "car"]);
    write(root, "train/data.yaml", "names: [dog]\n");
    fails(SourceFormat::Yolo, root, &["train/data.yaml", "class 0 is `dog`"]);
}

#[test]
fn yolo_labels_are_found_in_capitals_and_are_of_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "classes.txt", "car\n");
    let label = "0 0.5 0.5 0.2 0.1\n";
    for (name, grey) in [("train/images/a", 40), ("val/Images/b", 50), ("val/Images/c", 60)] {
        write_grey(root, &format!("{name}.png"), grey);
    }
    write(root, "train/labels/a.TXT", label);
    write(root, "val/Labels/b.txt", label);
    write(root, "val/Labels/c.txt", "");
    let read = || convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
    let names = |converted: &Converted| -> Vec<String> {
        converted.data.images.iter().map(|image| image.file_name.clone()).collect()
    };
    let found = read();
    assert_eq!((names(&found).len(), found.data.annotations.len(), found.defects.errors()), (3, 2, 0));
    // Of two pictures with one file of labels neither is used, unless they are copies.
    std::fs::copy(root.join("train/images/a.png"), root.join("train/images/a.PNG")).unwrap();
    let copies = read();
    assert_eq!((names(&copies).len(), copies.data.annotations.len(), copies.defects.errors()), (3, 2, 0));
    write_grey(root, "other.png", 90);
    std::fs::rename(root.join("other.png"), root.join("train/images/a.PNG")).unwrap();
    let two = read();
    let several = two.defects.iter().find(|d| d.kind == DefectKind::SeveralPictures).unwrap();
    assert!(several.count == 1 && several.first[0].contains("a.PNG or "), "{several:?}");
    assert_eq!((names(&two).len(), two.data.annotations.len()), (2, 1));
    // Labels that lie where no picture looks for them make no background of the pictures of their name.
    std::fs::remove_file(root.join("train/images/a.PNG")).unwrap();
    write_grey(root, "train/images/inner/d.png", 70);
    write(root, "train/labels/d.txt", label);
    let lost = read();
    assert_eq!(names(&lost).len(), 3);
    assert_eq!(
        [DefectKind::MissingPicture, DefectKind::PictureOfLostLabels].map(|kind| lost.defects.count(kind)),
        [1, 1]
    );
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
fn letters_of_labels_are_never_guessed() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(root, "kitti/image_2/000001.png", 100, 40);
    let labels = [KITTI.as_bytes(), b"Fu\xdfg\xe4nger 0 0 0 1 2 30 20 1 1 1 1 1 1 1\n"].concat();
    std::fs::create_dir_all(root.join("kitti/label_2")).unwrap();
    std::fs::write(root.join("kitti/label_2/000001.txt"), labels).unwrap();
    fails(SourceFormat::Kitti, &root.join("kitti"), &["000001.txt: line 4", "not text in UTF-8"]);

    // 行人, pedestrian, in the encoding that the file declares, and in one that it does not.
    write_png(root, "voc/a.png", 100, 40);
    let file = |head: &str| {
        let (before, after) = VOC.split_once("person").unwrap();
        [head.as_bytes(), before.as_bytes(), b"\xd0\xd0\xc8\xcb", after.as_bytes()].concat()
    };
    std::fs::write(root.join("voc/a.xml"), file("<?xml version=\"1.0\" encoding=\"GBK\"?>")).unwrap();
    let converted = convert(SourceFormat::Voc, &root.join("voc"), None, &Cancel::default()).unwrap();
    assert_eq!(converted.data.categories[0].name, "\u{884c}\u{4eba}");
    for (head, needle) in
        [("", "not text in UTF-8"), ("<?xml version='1.0' encoding='x-none'?>", "not known")]
    {
        std::fs::write(root.join("voc/a.xml"), file(head)).unwrap();
        fails(SourceFormat::Voc, &root.join("voc"), &["a.xml: line", needle]);
    }
}

/// In every format a picture whose only label cannot be used is no background.
#[test]
fn pictures_of_lost_labels_are_not_converted() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for name in ["b/a.png", "b/b.png", "b/c.png", "y/a.png", "y/b.png", "v/a.png", "v/b.png"] {
        write_png(root, name, 100, 40);
    }
    for name in ["k/image_2/a.png", "k/image_2/b.png"] {
        write_png(root, name, 100, 40);
    }
    let car = r#"{"category": "car", "box2d": {"x1": 1, "y1": 2, "x2": 30, "y2": 20}}"#;
    let labels = format!(
        r#"[{{"name": "a.png", "labels": [{{"category": "person", "poly2d": []}}]}}, {{"name": "b.png", "labels": [{car}]}},
            {{"name": "c.png", "labels": [{{"category": "lane", "poly2d": []}}]}}]"#
    );
    write(root, "b/labels.json", &labels);
    write(root, "y/classes.txt", "car\n");
    write(root, "y/a.txt", "0 0.5 0.5 0 0.5\n");
    write(root, "y/b.txt", "0 0.5 0.5 0.25 0.5\n");
    let line = |left: i32| format!("Car 0 0 0 {left} 5 60 35 1.7 0.5 0.8 4 2 20 0.1\n");
    write(root, "k/label_2/a.txt", &line(60));
    write(root, "k/label_2/b.txt", &line(20));
    let object = |left: i32| {
        format!(
            "<annotation><object><name>car</name><bndbox><xmin>{left}</xmin><ymin>2</ymin><xmax>{}</xmax><ymax>9</ymax>\
             </bndbox></object></annotation>",
            left + 9
        )
    };
    write(root, "v/a.xml", &object(400));
    write(root, "v/b.xml", &object(4));
    for (format, name, left) in [
        (SourceFormat::Bdd100k, "b", &["images/b.png", "images/c.png"][..]),
        (SourceFormat::Yolo, "y", &["images/b.png"]),
        (SourceFormat::Kitti, "k", &["images/b.png"]),
        (SourceFormat::Voc, "v", &["images/b.png"]),
    ] {
        let converted = convert(format, &root.join(name), None, &Cancel::default()).unwrap();
        let names: Vec<&str> = converted.data.images.iter().map(|image| image.file_name.as_str()).collect();
        assert_eq!(names, left, "{:?}", converted.defects);
        assert_eq!(converted.sources.len(), left.len());
        assert_eq!(converted.data.annotations.len(), 1);
        let lost = converted.defects.iter().find(|d| d.kind == DefectKind::PictureOfLostLabels).unwrap();
        assert_eq!((lost.count, &lost.first[..]), (1, &["images/a.png".to_owned()][..]));
    }
}
