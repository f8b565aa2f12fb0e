//! Data sets in other formats: what is read, and what is wrong with damaged ones.

mod bdd100k;
mod every_format;
mod lists;
mod yolo;

use petzval_base::Cancel;
use petzval_files::coco::convert::{Converted, SourceFormat, convert};
use petzval_files::coco::{Attribute, Bounds, CocoError, DefectKind};
use std::path::Path;

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

/// Two films with one number of a frame, as the tracking benchmark has them.
#[test]
fn kitti_tracks_are_objects_of_the_frames_of_their_films() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let line = |start: &str| format!("{start} 0 1 -1.57 10.5 20.0 40.5 32.0 1.5 1.6 3.9 1 2 30 -1.5\n");
    let region = "0 -1 DontCare -1 -1 -10 70 1 90 8 -1 -1 -1 -1000 -1000 -1000 -10\n";
    let cars = ["0 7 Car", "2 7 Car", "9 7 Car"].map(line).concat();
    write(root, "training/label_02/0000.txt", &format!("{cars}{region}"));
    write(root, "training/label_02/0001.txt", &line("0 7 Van"));
    for picture in ["0000/000000", "0000/000001", "0000/000002", "0001/000000", "0002/000000"] {
        write_png(root, &format!("training/image_02/{picture}.png"), 100, 40);
    }
    let converted = convert(SourceFormat::Kitti, root, None, &Cancel::default()).unwrap();
    let bounds = [10.5, 20.0, 30.0, 12.0];
    let names = ["images/0000/000000.png", "images/0000/000002.png", "images/0001/000000.png"];
    let found = [(names[0], "Car", bounds), (names[1], "Car", bounds), (names[2], "Van", bounds)];
    assert_eq!(objects(&converted), found);
    // The frame without a line shows no object, and is in its film.
    let films: Vec<_> =
        converted.data.images.iter().map(|image| image.sequence.as_deref().unwrap()).collect();
    assert_eq!(films, ["0000", "0000", "0000", "0001"]);
    assert!(converted.data.images.iter().all(|image| image.split.as_deref() == Some("train")));
    // The region is a crowd of both classes.
    assert_eq!(converted.data.annotations.iter().filter(|a| a.crowd && a.image_id == 1).count(), 2);
    assert_eq!(converted.data.annotations[0].attributes["track"], Attribute::Number(7.0));
    let first = |kind| converted.defects.iter().find(|d| d.kind == kind).unwrap();
    let missing = first(DefectKind::MissingPicture);
    assert!(missing.count == 1 && missing.first[0].starts_with("no picture for frame 9"), "{missing:?}");
    let unlabelled = first(DefectKind::PictureWithoutLabels);
    assert!(unlabelled.count == 1 && unlabelled.first[0].ends_with("000000.png"), "{unlabelled:?}");

    // Of two pictures of one frame the first is used, and the second is noted.
    write_png(root, "training/image_02/0001/000000.webp", 100, 40);
    let converted = convert(SourceFormat::Kitti, root, None, &Cancel::default()).unwrap();
    assert_eq!(objects(&converted), found);
    let unlabelled = converted.defects.iter().find(|d| d.kind == DefectKind::PictureWithoutLabels).unwrap();
    assert!(unlabelled.count == 2 && unlabelled.first[0].ends_with("000000.webp"), "{unlabelled:?}");

    write(root, "training/label_02/0001.txt", "0 7 Van 0 1\n");
    fails(SourceFormat::Kitti, root, &["0001.txt: line 1: `0 7 Van 0 1`", "has 5 values"]);
    std::fs::remove_dir_all(root.join("training/image_02")).unwrap();
    fails(SourceFormat::Kitti, root, &["image_02: there is no such folder"]);
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
