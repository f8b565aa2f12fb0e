//! What holds in every format: parts of one name, turned pictures, letters, lost labels.

use petzval_base::Cancel;
use petzval_files::coco::DefectKind;
use petzval_files::coco::convert::{SourceFormat, convert};

use super::{KITTI, VOC, fails, objects, write, write_grey, write_png, write_turned_png};

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

/// Archives of macOS have a letter and its marks apart, where other systems have one sign.
#[test]
fn names_are_the_same_in_every_form_of_their_letters() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let (one, apart) = ("\u{e4}", "a\u{308}");
    for (picture, labels) in [(one, apart), (apart, one)] {
        let root = root.join(if picture == one { "one" } else { "apart" });
        write_png(&root, &format!("yolo/images/{picture}.png"), 100, 40);
        write(&root, &format!("yolo/labels/{labels}.txt"), "0 0.5 0.5 0.2 0.1\n");
        write(&root, "yolo/classes.txt", "car\n");
        write(&root, "yolo/val.txt", &format!("images/{labels}.png\n"));
        write_png(&root, &format!("voc/JPEGImages/{picture}.png"), 100, 40);
        write(&root, &format!("voc/Annotations/{labels}.xml"), VOC);
        write(&root, "voc/ImageSets/Main/val.txt", &format!("{labels}\n"));
        for (format, name, objects) in [(SourceFormat::Yolo, "yolo", 1), (SourceFormat::Voc, "voc", 2)] {
            let converted = convert(format, &root.join(name), None, &Cancel::default()).unwrap();
            assert_eq!(
                (converted.data.annotations.len(), converted.defects.errors()),
                (objects, 0),
                "{name}"
            );
            assert_eq!(converted.data.images[0].split.as_deref(), Some("valid"), "{name}");
        }
    }
}
