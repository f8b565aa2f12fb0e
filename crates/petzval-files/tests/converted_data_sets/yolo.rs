//! Labels of YOLO: layouts, parts, poses, classes.

use petzval_base::Cancel;
use petzval_files::coco::DefectKind;
use petzval_files::coco::convert::{Converted, SourceFormat, convert};

use super::{fails, objects, write, write_grey, write_png};

/// Boxes that a converter made are in pixels from the left and the upper edge, whatever they look like.
#[test]
fn the_form_of_converted_boxes_is_not_guessed() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "data.yaml", "names: [car]\n");
    write_png(root, "images/a.png", 100, 100);
    // Three objects that the right and the lower edge cut, [37.5, 37.5, 75, 75] px.
    write(root, "labels/a.txt", &"0 0.75 0.75 0.75 0.75\n".repeat(3));
    let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
    assert_eq!(converted.defects.errors(), 0, "{:?}", converted.defects);
    assert_eq!(objects(&converted)[0].2, [37.5, 37.5, 62.5, 62.5]);
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

    // The same numbers are an outline where the file says so, and that is counted.
    write(root, "data.yaml", "names: [car]\ntask: segment\n");
    write(root, "labels/a.txt", pose);
    let outline = read();
    near(&outline, [80.0, 105.0, 140.0, 90.0]);
    assert_eq!(outline.defects.count(DefectKind::OutlineBox), 1);
    write(root, "data.yaml", "names: [car]\n");
    // Corners of a square on its tip, and of an upright box.
    write(root, "labels/a.txt", "0 0.5 0.2 0.65 0.4 0.5 0.6 0.35 0.4\n0 0.1 0.1 0.2 0.1 0.2 0.3 0.1 0.3\n");
    let rotated = read();
    near(&rotated, [140.0, 60.0, 120.0, 120.0]);
    let count = |kind| rotated.defects.count(kind);
    assert_eq!((count(DefectKind::RotatedBox), count(DefectKind::OutlineBox)), (1, 1));
}

/// Outlines and poses are not guessed where every line may be both.
#[test]
fn long_lines_of_yolo_that_may_be_poses_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(root, "images/a.png", 400, 300);
    // Names as Darknet has them, without a page that could say what the lines are.
    write(root, "classes.txt", "car\n");
    let of_box = "0 0.5 0.5 0.2 0.4";
    for (keypoints, shape) in [
        ("0.45 0.35", "[1, 2]"),
        ("0.45 0.35 0.5 0.5", "[2, 2]"),
        ("0.45 0.35 0.55 0.35 0.45 0.65 0.55 0.65", "[4, 2]"),
        ("0.45 0.35 1 0.55 0.35 1", "[2, 3]"),
        ("0.45 0.35 0 0.55 0.35 1", "[2, 3]"),
    ] {
        write(root, "labels/a.txt", &format!("{of_box}\n{of_box} {keypoints}\n"));
        let kpt_shape = format!("`kpt_shape: {shape}`");
        let needles = ["a.txt: line 2", "may be an outline or a box", &kpt_shape, "`task: segment`"];
        fails(SourceFormat::Yolo, root, &needles);
        write(root, "data.yaml", &format!("names: [car]\nkpt_shape: {shape}\n"));
        let poses = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
        assert_eq!(poses.data.annotations[0].bounds, poses.data.annotations[1].bounds);
        std::fs::remove_file(root.join("data.yaml")).unwrap();
    }
    // Outlines of different numbers of points, corners of rectangles, and an outline that is no pose.
    for outlines in [
        "0 0.3 0.3 0.32 0.3 0.33 0.32\n0 0.3 0.3 0.32 0.3 0.33 0.32 0.31 0.34\n",
        "0 0.3 0.3 0.35 0.3 0.35 0.36 0.3 0.36\n",
        "0 0.4 0.3 0.6 0.3 0.6 0.7 0.4 0.7 0.3 0.5\n",
    ] {
        write(root, "labels/a.txt", outlines);
        let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
        let count = converted.defects.count(DefectKind::OutlineBox);
        assert_eq!(count, outlines.lines().count(), "{outlines}");
    }
}

#[cfg(unix)]
#[test]
fn a_link_that_leads_nowhere_is_a_file_that_cannot_be_opened() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "data.yaml", "names: [light]\n");
    write_png(root, "images/a.png", 100, 40);
    std::os::unix::fs::symlink(root.join("nowhere.png"), root.join("images/b.png")).unwrap();
    for name in ["a", "b"] {
        write(root, &format!("labels/{name}.txt"), "0 0.5 0.5 0.2 0.1\n");
    }
    let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
    assert_eq!(objects(&converted).len(), 1);
    assert_eq!(converted.defects.count(DefectKind::UnreadablePicture), 0);
    let unopened = converted.defects.iter().find(|d| d.kind == DefectKind::UnopenedPicture).unwrap();
    assert!(unopened.count == 1 && unopened.first[0].contains("b.png: No such file"), "{unopened:?}");
    assert!(unopened.kind.hint().contains("link"));
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
    write(root, "b.txt", "/home/x/set/images/two/a.png\n./images/one/../train/a.png\n");
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
