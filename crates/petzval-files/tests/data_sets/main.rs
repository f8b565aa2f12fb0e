//! Data sets in COCO format: every defect is found, and what is read is written again.

mod forms;
mod picture_names;
mod turned;

use petzval_base::Cancel;
use std::collections::BTreeMap;
use std::path::Path;

use petzval_files::coco::{
    Annotation, Attribute, Bounds, Category, CocoError, DataSet, DefectKind, Defects, Detection, Image,
    Loaded, Severity, Statistics, check_pictures, check_values, coco_bytes, load_coco, parse_coco,
    results_bytes, save_coco, save_results,
};

const GOOD: &str = r#"{
"info": {"description": "two lights"},
"licenses": [{"id": 1, "name": "CC BY 4.0"}],
"images": [
{"id": 1, "file_name": "a.png", "width": 40, "height": 30, "video_id": 7, "split": "train"},
{"id": 2, "file_name": "b.png", "width": 40, "height": 30, "sequence": "night"}],
"categories": [{"id": 1, "name": "light", "supercategory": "road"}],
"annotations": [
{"id": 1, "image_id": 1, "category_id": 1, "bbox": [1.5, 2, 10, 20], "area": 200, "iscrowd": 0, "segmentation": [[1, 2, 3]],
 "attributes": {"state": "red", "occluded": true, "distance_m": 31.5}},
{"id": 2, "image_id": 2, "category_id": 1, "bbox": [0, 0, 40, 30], "area": 1100.25, "iscrowd": 1, "ignore": 1, "state": "off"}]}"#;

fn read(text: &str) -> (DataSet, Defects) {
    let mut defects = Defects::default();
    let mut data = parse_coco(text.as_bytes().to_vec(), &mut defects).unwrap();
    check_values(&mut data, &mut defects);
    (data, defects)
}

/// The good file with one piece of its text replaced.
fn with(from: &str, to: &str) -> (DataSet, Defects) {
    assert!(GOOD.contains(from), "{from}");
    read(&GOOD.replacen(from, to, 1))
}

fn write_png(path: &Path, width: u32, height: u32) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::RgbImage::from_pixel(width, height, image::Rgb([90, 120, 60])).save(path).unwrap();
}

/// A file with these boxes in one picture of 40 x 30 pixels.
fn with_boxes(boxes: &[[f64; 4]]) -> Defects {
    read(&text_with_boxes(boxes)).1
}

fn text_with_boxes(boxes: &[[f64; 4]]) -> String {
    let annotation = |(i, b): (usize, &[f64; 4])| {
        format!(r#"{{"id": {}, "image_id": 1, "category_id": 1, "bbox": {b:?}, "area": 1}}"#, i + 1)
    };
    let all: Vec<String> = boxes.iter().enumerate().map(annotation).collect();
    let head = r#"{"images": [{"id": 1, "file_name": "a.png", "width": 40, "height": 30}], "categories": [{"id": 1, "name": "light"}],"#;
    format!("{head} \"annotations\": [{}]}}", all.join(", "))
}

#[test]
fn boxes_in_another_form_are_known_by_all_of_them() {
    let corners = [
        [20.0, 12.0, 38.0, 28.0],
        [4.0, 3.0, 12.0, 14.0],
        [22.0, 16.0, 40.0, 30.0],
        [18.0, 20.0, 30.0, 29.0],
    ];
    let found = with_boxes(&corners);
    assert_eq!((found.count(DefectKind::CornerBoxes), found.errors()), (3, 3));
    // Whose boxes look like this and are none says so.
    assert!(DefectKind::CornerBoxes.hint().contains("\"bbox_mode\": 1"));
    let text = text_with_boxes(&corners);
    let stated = read(&text.replace("\"area\"", "\"bbox_mode\": 1, \"area\"")).1;
    assert_eq!((stated.count(DefectKind::CornerBoxes), stated.errors()), (0, 0), "{stated:?}");
    let some = read(&text.replacen("\"area\"", "\"bbox_mode\": 1, \"area\"", 1)).1;
    assert_eq!(some.count(DefectKind::CornerBoxes), 3);
    // Objects in the upper left do not show it, and one of three that reaches out does.
    let few = [[4.0, 3.0, 12.0, 14.0], [5.0, 2.0, 15.0, 10.0], [22.0, 16.0, 40.0, 30.0]];
    assert_eq!(with_boxes(&few).count(DefectKind::CornerBoxes), 1);
    let shares = with_boxes(&[[0.5, 0.5, 0.2, 0.1], [0.1, 0.2, 0.3, 1.0], [0.0, 0.1, 0.4, 0.2]]);
    assert_eq!(shares.count(DefectKind::ShareBoxes), 3);
    // One box in pixels among them does not hide them. Placeholders in the first pixel among boxes in pixels are no shares.
    let mixed =
        with_boxes(&[[0.5, 0.5, 0.2, 0.1], [0.1, 0.2, 0.3, 1.0], [0.0, 0.1, 0.4, 0.2], [9.0, 8.0, 7.0, 6.0]]);
    assert_eq!(mixed.count(DefectKind::ShareBoxes), 3);
    let empty =
        with_boxes(&[[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0], [9.0, 8.0, 7.0, 6.0]]);
    assert_eq!(empty.count(DefectKind::ShareBoxes), 0);
    // Without a stated size shares show as they are, and corners once the picture is read.
    let folder = tempfile::tempdir().unwrap();
    write_png(&folder.path().join("a.png"), 40, 30);
    let unsized_file = |boxes: &[[f64; 4]], keys: &str| {
        let text = text_with_boxes(boxes).replace("\"width\": 40, \"height\": 30", keys);
        std::fs::write(folder.path().join("annotations.json"), text).unwrap();
        let mut loaded = load_coco(folder.path(), &Cancel::default()).unwrap();
        let before = loaded.check_form().is_ok();
        check_pictures(&mut loaded, &|_| Ok(())).unwrap();
        let kinds = [DefectKind::CornerBoxes, DefectKind::ShareBoxes];
        (before, loaded.check_form().is_ok(), kinds.map(|kind| loaded.defects.count(kind)))
    };
    let fractions = [[0.5, 0.5, 0.2, 0.1], [0.1, 0.2, 0.3, 1.0], [0.0, 0.1, 0.4, 0.2]];
    for keys in ["\"width\": 0, \"height\": 0", "\"turned\": false", "\"license\": 1"] {
        assert_eq!(unsized_file(&corners, keys), (true, false, [3, 0]), "{keys}");
        assert_eq!(unsized_file(&fractions, keys), (false, false, [0, 3]), "{keys}");
        let right = corners.map(|[x1, y1, x2, y2]| [x1, y1, x2 - x1, y2 - y1]);
        assert_eq!(unsized_file(&right, keys), (true, true, [0, 0]), "{keys}");
    }
    // The same boxes as they should be; and objects at the edge, of which most reach out.
    let right = with_boxes(&corners.map(|[x1, y1, x2, y2]| [x1, y1, x2 - x1, y2 - y1]));
    let at_edge = with_boxes(&[[30.0, 20.0, 15.0, 15.0], [28.0, 4.0, 20.0, 9.0], [-5.0, 2.0, 12.0, 9.0]]);
    // Large objects that the left and the upper edge cut: as two corners they would begin outside, too.
    let cut = with_boxes(&[[-6.0, -4.0, 26.0, 20.0], [-3.0, 2.0, 30.0, 25.0], [4.0, 3.0, 12.0, 14.0]]);
    for defects in [right, at_edge, cut] {
        assert_eq!([DefectKind::CornerBoxes, DefectKind::ShareBoxes].map(|kind| defects.count(kind)), [0, 0]);
    }
}

#[test]
fn everything_that_is_read_is_written_again() {
    let (data, defects) = read(GOOD);
    assert_eq!(data.images[0].sequence.as_deref(), Some("7"));
    assert_eq!(
        (data.images[1].sequence.as_deref(), data.images[0].split.as_deref()),
        (Some("night"), Some("train"))
    );
    let first = &data.annotations[0];
    assert_eq!(first.bounds, Bounds { x: 1.5, y: 2.0, width: 10.0, height: 20.0 });
    assert_eq!(first.attributes["state"], Attribute::Text("red".into()));
    assert_eq!(first.attributes["occluded"], Attribute::Flag(true));
    assert_eq!(first.attributes["distance_m"], Attribute::Number(31.5));
    let second = &data.annotations[1];
    assert!(second.crowd && second.ignore && second.attributes["state"].text() == Some("off"));
    let kinds: Vec<_> = defects.iter().map(|d| d.kind).collect();
    assert_eq!(kinds, [DefectKind::UnreadField, DefectKind::CrowdBox]);
    assert_eq!(defects.iter().next().unwrap().first, ["annotations[].segmentation (1)"]);

    let (again, _) = read(&String::from_utf8(coco_bytes(&data)).unwrap());
    assert_eq!(again, data);
    // One record in a line.
    assert_eq!(String::from_utf8(coco_bytes(&data)).unwrap().lines().count(), 13);
    let empty = DataSet::default();
    assert_eq!(read(&String::from_utf8(coco_bytes(&empty)).unwrap()).0, empty);
}

#[test]
fn every_defect_of_a_value_is_found_and_named() {
    let first = r#""bbox": [1.5, 2, 10, 20]"#;
    let boxed = |numbers: &str| with(first, &format!("\"bbox\": [{numbers}]"));
    for ((data, defects), kind, left, example) in [
        (
            boxed("NaN, 2, 10, 20"),
            DefectKind::NotFinite,
            1,
            "annotations[0]: bbox is [NaN or infinity, 2, 10, 20]",
        ),
        (boxed("1, 2, Infinity, 20"), DefectKind::NotFinite, 1, "NaN or infinity, 20]"),
        (boxed("1, 2, 1e999, 20"), DefectKind::NotFinite, 1, "NaN or infinity, 20]"),
        (boxed("1, null, 3, 20"), DefectKind::NotFinite, 1, "[1, null, 3, 20]"),
        (boxed("1, 2, 1e200, 1e200"), DefectKind::NotFinite, 1, "annotation 1 of a.png (40 x 30 px)"),
        (boxed("1, 2, 3"), DefectKind::WrongType, 1, "bbox is [1, 2, 3]"),
        (boxed("1, 2, 3, \"4\""), DefectKind::WrongType, 1, "bbox is [1, 2, 3, \"4\"]"),
        (boxed("1, 2, -3, 4"), DefectKind::NegativeSize, 1, "[1, 2, -3, 4]"),
        (boxed("1, 2, 0, 4"), DefectKind::ZeroSize, 1, "[1, 2, 0, 4]"),
        (boxed("40, 2, 5, 4"), DefectKind::OutsidePicture, 1, "[40, 2, 5, 4]"),
        (boxed("-9, 2, 5, 4"), DefectKind::OutsidePicture, 1, "a.png (40 x 30 px): [-9, 2, 5, 4]"),
        (boxed("38, 2, 5, 4"), DefectKind::ClippedBox, 2, "[38, 2, 5, 4], 3.0 px over"),
        (boxed("1, 2, 3, 4"), DefectKind::AreaBeyondBox, 2, "200 px^2, box 12 px^2"),
        (
            with("\"bbox\": [0, 0, 40, 30], ", ""),
            DefectKind::MissingField,
            1,
            "annotations[1]: bbox is missing",
        ),
        (
            with("\"bbox\": [1.5, 2, 10, 20],", ""),
            DefectKind::WrongType,
            1,
            "annotations[0]: bbox is missing, and segmentation no outline or mask",
        ),
        (with("\"area\": 200", "\"area\": -3"), DefectKind::AreaNotStated, 2, "-3 px^2"),
        (
            with("\"area\": 200", "\"area\": NaN"),
            DefectKind::AreaNotStated,
            2,
            "a.png: no number for its area, box",
        ),
        (with("\"area\": 200,", ""), DefectKind::AreaNotStated, 2, "annotation 1 of a.png"),
        (
            with("{\"id\": 2, \"image_id\": 2", "{\"id\": 1, \"image_id\": 2"),
            DefectKind::RepeatedAnnotationId,
            2,
            "annotation 1 of b.png",
        ),
        (
            with("{\"id\": 2, \"image_id\": 2", "{\"id\": 0, \"image_id\": 2"),
            DefectKind::ZeroId,
            2,
            "annotation 0 of b.png",
        ),
        (
            with("\"categories\": [", "\"categories\": [{\"id\": 0, \"name\": \"x\"}, "),
            DefectKind::ZeroId,
            2,
            "category 0: \"x\"",
        ),
        (boxed("1.5, 2, 10, 1e-300"), DefectKind::ThinBox, 2, "a.png: [1.5, 2, 10, 1e-300]"),
        (boxed("1.5, 2, 0.9, 20"), DefectKind::ThinBox, 2, "annotation 1 of a.png"),
        (with("\"state\": \"red\"", "\"state\": \"rot\""), DefectKind::UnknownState, 2, "state \"rot\""),
        (
            with("\"state\": \"red\"", "\"state\": 3"),
            DefectKind::UnknownState,
            2,
            "a.png: [1.5, 2, 10, 20]: state 3",
        ),
        (
            with("{\"id\": 2, \"image_id\": 2", "{\"id\": -2, \"image_id\": 2"),
            DefectKind::WrongType,
            1,
            "annotations[1]: id is -2",
        ),
        (
            with("\"image_id\": 1", "\"image_id\": 99"),
            DefectKind::UnknownImage,
            1,
            "annotation 1 of image 99",
        ),
        (with("\"category_id\": 1", "\"category_id\": 5"), DefectKind::UnknownCategory, 1, "category 5"),
        (with("\"image_id\": 1", "\"image_id\": \"a\""), DefectKind::WrongType, 1, "image_id is \"a\""),
        (with("\"iscrowd\": 0", "\"iscrowd\": 7"), DefectKind::WrongType, 1, "iscrowd is 7"),
        (
            with("\"id\": 2, \"file_name\"", "\"id\": 1, \"file_name\""),
            DefectKind::RepeatedImageId,
            0,
            "image 1: a.png and b.png",
        ),
        (with("b.png", "a.png"), DefectKind::RepeatedFile, 2, "images 1 and 2: a.png"),
        (
            with("\"file_name\": \"a.png\", ", ""),
            DefectKind::MissingField,
            1,
            "images[0]: file_name is missing",
        ),
        (with("\"a.png\"", "\" \""), DefectKind::WrongType, 1, "images[0]: file_name is \" \""),
        (with("\"width\": 40", "\"width\": \"40\""), DefectKind::WrongType, 1, "images[0]: width is \"40\""),
        (with("\"width\": 40", "\"width\": 1e30"), DefectKind::WrongType, 1, "images[0]: width is 1"),
        (with("\"name\": \"light\"", "\"name\": \"\""), DefectKind::RepeatedClassName, 2, "category 1"),
        (
            with("\"categories\": [", "\"categories\": [{\"id\": 1, \"name\": \"x\"}, "),
            DefectKind::RepeatedCategoryId,
            2,
            "category 1: \"light\"",
        ),
        (
            with("\"categories\": [", "\"categories\": [{\"id\": 3, \"name\": \"x\"}, "),
            DefectKind::ClassWithoutBoxes,
            2,
            "category 3: \"x\"",
        ),
        (
            with("\"categories\": [", "\"categories\": [{\"id\": 3, \"name\": 4}, "),
            DefectKind::WrongType,
            2,
            "categories[0]: name is 4",
        ),
        (
            with(
                "\"annotations\": [",
                "\"annotations\": [{\"id\": 8, \"image_id\": 1, \"category_id\": 1, \"bbox\": [1.5, 2, 10, 20]}, ",
            ),
            DefectKind::RepeatedBox,
            3,
            "annotation 1 of a.png",
        ),
        (
            with("\"occluded\": true", "\"occluded\": [1, 2]"),
            DefectKind::LooseAttribute,
            2,
            "occluded is [1, 2]",
        ),
        (
            with(r#"{"state": "red", "occluded": true, "distance_m": 31.5}"#, "[1]"),
            DefectKind::LooseAttribute,
            2,
            "attributes is [1]",
        ),
        (with("\"image_id\": 2", "\"image_id\": 1"), DefectKind::PictureWithoutBoxes, 2, "b.png"),
        (with("\"iscrowd\": 0", "\"iscrowd\": 0, \"ignore\": 1"), DefectKind::IgnoredBox, 2, "annotation 1"),
    ] {
        let found = defects.iter().find(|defect| defect.kind == kind);
        let found = found.unwrap_or_else(|| panic!("{kind:?} is not found: {defects:?}"));
        assert_eq!(found.count, 1, "{found:?}");
        assert!(found.first[0].contains(example), "{example}: {found:?}");
        assert_eq!(data.annotations.len(), left, "{found:?}");
        assert_eq!(defects.errors() > 0, found.severity == Severity::Error, "{defects:?}");
        assert!(!kind.sentence().is_empty() && !kind.hint().is_empty());
        // What is left is without errors.
        let (again, later) = read(&String::from_utf8(coco_bytes(&data)).unwrap());
        let mut data = data;
        data.annotations.iter_mut().for_each(|annotation| annotation.unclipped = None);
        assert_eq!((again, later.errors()), (data, 0));
    }
    // A clipped box has the area of what is left; ids stay unique.
    let (clipped, _) = boxed("38, 2, 5, 4");
    assert_eq!(clipped.annotations[0].bounds, Bounds::from([38.0, 2.0, 2.0, 4.0]));
    assert_eq!(clipped.annotations[0].area, 8.0);
    let (renumbered, _) = with("{\"id\": 2, \"image_id\": 2", "{\"id\": 1, \"image_id\": 2");
    assert_eq!(renumbered.annotations.iter().map(|a| a.id).collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn text_that_is_not_the_format_has_a_line_and_a_hint() {
    for (text, line, column, needle) in [
        ("{\"images\": [\n{\"id\": 1,}\n]}", 2, 10, "not JSON"),
        ("{\"images\": [", 1, 12, "cut off"),
        ("", 1, 0, "cut off"),
        ("{\"images\": [], \"annotations\": []}", 1, 33, "missing field `categories`"),
        ("{\"images\": 3}", 1, 12, "expected a sequence"),
        ("\u{1}", 1, 1, "not JSON"),
    ] {
        let error = parse_coco(text.as_bytes().to_vec(), &mut Defects::default()).unwrap_err();
        assert_eq!(error.line, Some(line), "{text}: {error}");
        assert!(error.column.unwrap().abs_diff(column) <= 1, "{text}: {error}");
        assert!(error.to_string().contains(needle) && error.hint.is_some(), "{text}: {error}");
    }
    for text in ["[]", "[[], [], []]", "3", "null", "[[{}], [], [], [], []]"] {
        let error = parse_coco(text.into(), &mut Defects::default()).unwrap_err();
        assert!(error.line == Some(1) && error.message.contains("no table"), "{error}");
    }
    // A byte order mark is no error.
    assert!(parse_coco(format!("\u{feff}{GOOD}").into_bytes(), &mut Defects::default()).is_ok());
}

#[test]
fn very_many_boxes_are_read_and_noted() {
    let data = DataSet {
        images: vec![Image {
            id: 1,
            file_name: "a.png".into(),
            width: 4000,
            height: 3000,
            ..Image::default()
        }],
        categories: vec![Category { id: 1, name: "light".into(), ..Category::default() }],
        annotations: (0..200_000)
            .map(|i| Annotation {
                id: i + 1,
                image_id: 1,
                category_id: 1,
                bounds: Bounds::from([(i % 3900) as f64, (i / 3900) as f64, 8.0, 12.5]),
                area: 100.0,
                crowd: false,
                ignore: false,
                attributes: BTreeMap::new(),
                unclipped: None,
            })
            .collect(),
        ..DataSet::default()
    };
    let bytes = coco_bytes(&data);
    let (read, defects) = read(std::str::from_utf8(&bytes).unwrap());
    assert_eq!(read, data);
    let many: Vec<_> = defects.iter().collect();
    assert_eq!((many.len(), many[0].kind), (1, DefectKind::ManyBoxes));
    assert_eq!(many[0].worst.as_deref(), Some("a.png: 200000 boxes"));
    assert_eq!(Statistics::of(&read).most_boxes, 200_000);
}

#[test]
fn the_files_of_pictures_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let names = ["good.png", "missing.png", "broken.png", "other.png", "none.png"];
    let data = DataSet {
        images: (1..)
            .zip(names)
            .map(|(id, name)| Image { id, file_name: name.into(), width: 40, height: 30, ..Image::default() })
            .collect(),
        categories: [(1, "light"), (2, "of missing.png alone")]
            .map(|(id, name)| Category { id, name: name.into(), ..Category::default() })
            .into(),
        annotations: (1..=5)
            .map(|id| Annotation {
                id,
                image_id: id,
                category_id: if id == 2 { 2 } else { 1 },
                bounds: Bounds::from([10.0, 20.0, 10.0, 10.0]),
                area: 100.0,
                crowd: false,
                ignore: false,
                attributes: BTreeMap::new(),
                unclipped: None,
            })
            .collect(),
        ..DataSet::default()
    };
    let mut unsized_image = data.clone();
    (unsized_image.images[4].width, unsized_image.images[4].height) = (0, 0);
    let copy = Image { id: 90, file_name: "copy.png".to_owned(), ..unsized_image.images[0].clone() };
    unsized_image.images.push(copy);
    save_coco(&unsized_image, &root.join("annotations.json")).unwrap();
    write_png(&root.join("good.png"), 40, 30);
    std::fs::copy(root.join("good.png"), root.join("copy.png")).unwrap();
    write_png(&root.join("images/other.png"), 30, 40);
    write_png(&root.join("images/none.png"), 40, 25);
    std::fs::write(root.join("broken.png"), b"no picture").unwrap();

    let cancelled = Cancel::default();
    cancelled.set();
    assert!(matches!(load_coco(root, &cancelled), Err(CocoError::Stopped(_))));
    let mut loaded = load_coco(root, &Cancel::default()).unwrap();
    assert_eq!(loaded.data, unsized_image);
    let loaded_before = loaded.data.images.len();
    let decoded = std::sync::Mutex::new(Vec::new());
    let note = |n| {
        decoded.lock().unwrap().push(n);
        Ok(())
    };
    check_pictures(&mut loaded, &note).unwrap();
    let mut decoded = decoded.into_inner().unwrap();
    decoded.sort_unstable();
    // Before each head nothing is done yet.
    decoded.retain(|done| *done > 0);
    assert_eq!(decoded, (1..=loaded_before).collect::<Vec<_>>());
    let left: Vec<&str> = loaded.data.images.iter().map(|image| image.file_name.as_str()).collect();
    assert_eq!(left, ["good.png", "none.png", "copy.png"]);
    assert_eq!((loaded.data.images[1].width, loaded.data.images[1].height), (40, 25));
    // The box of the picture without a size is clipped now.
    assert_eq!(loaded.data.annotations[1].bounds, Bounds::from([10.0, 20.0, 10.0, 5.0]));
    let example = |kind| {
        let found = loaded.defects.iter().find(|d| d.kind == kind).unwrap_or_else(|| panic!("{kind:?}"));
        assert_eq!(found.count, 1);
        found.first[0].clone()
    };
    assert_eq!(example(DefectKind::MissingPicture), "missing.png");
    assert!(example(DefectKind::UnreadablePicture).contains("broken.png: cannot decode"));
    assert_eq!(example(DefectKind::OtherPictureSize), "other.png: 30 x 40 px, stated 40 x 30");
    assert_eq!(example(DefectKind::SizeNotStated), "none.png");
    assert_eq!(example(DefectKind::SamePicture), "good.png and copy.png");
    assert!(example(DefectKind::ClippedBox).contains("5.0 px over"));
    assert_eq!(example(DefectKind::ClassWithoutBoxes), "category 2: \"of missing.png alone\"");
    assert_eq!(loaded.defects.count(DefectKind::NoPicture), 0);

    // Where no picture is left, that is one more error.
    for name in ["good.png", "copy.png", "images/none.png"] {
        std::fs::remove_file(root.join(name)).unwrap();
    }
    let mut loaded = load_coco(root, &Cancel::default()).unwrap();
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    assert!(loaded.data.images.is_empty() && loaded.defects.count(DefectKind::NoPicture) == 1);
    std::fs::write(root.join("annotations.json"), r#"{"images": [], "annotations": [], "categories": []}"#)
        .unwrap();
    let mut empty = load_coco(root, &Cancel::default()).unwrap();
    check_pictures(&mut empty, &|_| Ok(())).unwrap();
    assert_eq!((empty.defects.errors(), empty.defects.count(DefectKind::NoPicture)), (1, 1));
}

#[cfg(unix)]
#[test]
fn a_link_that_leads_nowhere_is_a_file_that_cannot_be_opened() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    std::fs::write(root.join("annotations.json"), GOOD).unwrap();
    write_png(&root.join("a.png"), 40, 30);
    std::os::unix::fs::symlink(root.join("nowhere.png"), root.join("b.png")).unwrap();
    let mut loaded = load_coco(root, &Cancel::default()).unwrap();
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    assert_eq!((loaded.data.images.len(), loaded.defects.errors()), (1, 1), "{:?}", loaded.defects);
    let unopened = loaded.defects.iter().find(|d| d.kind == DefectKind::UnopenedPicture).unwrap();
    assert!(unopened.first[0].contains("b.png: No such file"), "{unopened:?}");
}

#[test]
fn a_picture_that_is_damaged_in_its_middle_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let image =
        |id, name: &str| Image { id, file_name: name.to_owned(), width: 40, height: 30, ..Image::default() };
    let data = DataSet { images: vec![image(1, "whole.png"), image(2, "damaged.png")], ..DataSet::default() };
    save_coco(&data, &root.join("annotations.json")).unwrap();
    write_png(&root.join("whole.png"), 40, 30);
    let mut bytes = std::fs::read(root.join("whole.png")).unwrap();
    let pixels = bytes.windows(4).position(|chunk| chunk == b"IDAT").unwrap();
    bytes[pixels + 9] ^= 0x10;
    std::fs::write(root.join("damaged.png"), bytes).unwrap();
    let mut loaded = load_coco(root, &Cancel::default()).unwrap();
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    assert_eq!(loaded.data.images.len(), 1);
    assert_eq!(loaded.defects.count(DefectKind::UnreadablePicture), 1);
}

#[test]
fn annotations_are_found_where_programs_put_them() {
    let layouts: [(&str, &str); 6] = [
        ("annotations.json", "a.png"),
        ("labels.json", "data/a.png"),
        ("_annotations.coco.json", "a.png"),
        ("annotations/instances_val2017.json", "val2017/a.png"),
        ("annotations/instances_train.json", "images/train/a.png"),
        ("mine.JSON", "images/a.png"),
    ];
    let load = |root: &Path| -> Result<Loaded, CocoError> { load_coco(root, &Cancel::default()) };
    for (file, picture) in layouts {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(file);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, GOOD).unwrap();
        write_png(&folder.path().join(picture), 40, 30);
        for loaded in [load(folder.path()).unwrap(), load(&file).unwrap()] {
            assert_eq!(loaded.file, file);
            assert_eq!(loaded.picture("a.png").unwrap(), folder.path().join(picture));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let fails = |needles: &[&str]| {
        let error = load(folder.path()).unwrap_err().to_string();
        assert!(needles.iter().all(|needle| error.contains(needle)), "{error}");
    };
    fails(&["no annotations in COCO format", "petzval data convert"]);
    // Cityscapes has labels of pixels, which no conversion makes boxes of.
    let [pictures, labels] = ["leftImg8bit", "gtFine"].map(|name| folder.path().join(name));
    [&pictures, &labels].into_iter().for_each(|name| std::fs::create_dir(name).unwrap());
    fails(&["petzval design EXPERIMENT --check", "pictures/NAME.png, labels/NAME.png"]);
    [pictures, labels].into_iter().for_each(|name| std::fs::remove_dir(name).unwrap());
    // The folder of a segmentation.
    for name in ["pictures", "labels"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    fails(&["no annotations in COCO format", "petzval design EXPERIMENT --check"]);
    for name in ["a.json", "b.json"] {
        std::fs::write(folder.path().join(name), GOOD).unwrap();
    }
    fails(&["2 files could be the annotations", "a.json", "b.json"]);
    std::fs::write(folder.path().join("annotations.json"), "{\"images\": [}").unwrap();
    fails(&["annotations.json: line 1, column 13", "not JSON"]);
    assert!(load(&folder.path().join("nowhere")).is_err());
}

#[test]
fn several_files_of_annotations_are_parts_of_one_data_set() {
    let text = |name: &str| {
        format!(
            r#"{{"images": [{{"id": 5, "file_name": "{name}", "width": 40, "height": 30}}], "categories": [{{"id": 3, "name": "car"}}],
                "annotations": [{{"id": 8, "image_id": 5, "category_id": 3, "bbox": [1, 2, 10, 20], "area": 200}}]}}"#
        )
    };
    let layouts = [
        ("annotations/instances_{}2017.json", "{}2017/a.png", ["train", "val"]),
        ("{}/_annotations.coco.json", "{}/a.png", ["train", "valid"]),
    ];
    for (file, picture, parts) in layouts {
        let folder = tempfile::tempdir().unwrap();
        for (k, part) in parts.iter().enumerate() {
            let file = folder.path().join(file.replace("{}", part));
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(&file, text("a.png")).unwrap();
            write_png(&folder.path().join(picture.replace("{}", part)), 40, 30 - k as u32);
        }
        let mut loaded = load_coco(folder.path(), &Cancel::default()).unwrap();
        let names: Vec<_> = loaded.data.images.iter().map(|image| image.file_name.clone()).collect();
        assert_eq!(names, parts.map(|part| picture.replace("{}", part)));
        let splits: Vec<_> = loaded.data.images.iter().map(|image| image.split.as_deref().unwrap()).collect();
        assert_eq!(splits, parts);
        assert_eq!((loaded.data.categories.len(), loaded.file.as_path()), (1, folder.path()));
        // Each picture is the one of its own part: the second has another size than stated.
        check_pictures(&mut loaded, &|_| Ok(())).unwrap();
        let defects: Vec<_> = loaded.defects.iter().map(|d| (d.kind, d.first[0].clone())).collect();
        let size = format!("{}: 40 x 29 px, stated 40 x 30", names[1]);
        assert_eq!(defects, [(DefectKind::OtherPictureSize, size)]);
        assert_eq!((loaded.data.images.len(), loaded.data.annotations.len()), (1, 1));
    }
    // A picture that two parts list is learned from and judged on. One that a part lists twice is noted once.
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("annotations")).unwrap();
    for part in ["train", "val"] {
        let file = folder.path().join(format!("annotations/instances_{part}.json"));
        let entry = |id: u32| format!(r#"{{"id": {id}, "file_name": "b.png", "width": 40, "height": 30}}, "#);
        let more = if part == "train" { entry(6) + &entry(7) } else { String::new() };
        let images = "\"images\": [";
        std::fs::write(file, text("a.png").replace(images, &format!("{images}{more}"))).unwrap();
    }
    write_png(&folder.path().join("images/a.png"), 40, 30);
    write_png(&folder.path().join("images/b.png"), 40, 31);
    let mut loaded = load_coco(folder.path(), &Cancel::default()).unwrap();
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    let repeated = loaded.defects.iter().find(|d| d.kind == DefectKind::RepeatedFile).unwrap();
    assert_eq!(repeated.first, ["images 6 and 7: b.png", "images/a.png: in `train` and `val`"]);
    // Of two files for one part somebody has to choose.
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("annotations")).unwrap();
    for name in ["instances_train2014.json", "instances_train2017.json", "instances_val2017.json"] {
        std::fs::write(folder.path().join("annotations").join(name), text("a.png")).unwrap();
    }
    let error = load_coco(folder.path(), &Cancel::default()).unwrap_err().to_string();
    assert!(error.contains("3 files could be the annotations") && error.contains("train2014"), "{error}");
}

#[test]
fn annotations_of_programs_for_windows_are_read() {
    let utf16 = |to_bytes: fn(u16) -> [u8; 2], mark: [u8; 2]| -> Vec<u8> {
        mark.into_iter().chain(GOOD.encode_utf16().flat_map(to_bytes)).collect()
    };
    let (good, _) = read(GOOD);
    for bytes in [utf16(u16::to_le_bytes, [0xff, 0xfe]), utf16(u16::to_be_bytes, [0xfe, 0xff])] {
        assert_eq!(parse_coco(bytes, &mut Defects::default()).unwrap(), good);
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("annotations.json"), GOOD.replace("a.png", r"night\\a.png")).unwrap();
    write_png(&folder.path().join("night/a.png"), 40, 30);
    write_png(&folder.path().join("b.png"), 40, 30);
    let mut loaded = load_coco(folder.path(), &Cancel::default()).unwrap();
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    assert_eq!(loaded.data.images.len(), 2);
}

#[test]
fn a_picture_that_is_left_out_is_no_background() {
    let folder = tempfile::tempdir().unwrap();
    let (mut data, _) = read(GOOD);
    data.annotations.clear();
    save_coco(&data, &folder.path().join("annotations.json")).unwrap();
    write_png(&folder.path().join("a.png"), 40, 30);
    let mut loaded = load_coco(folder.path(), &Cancel::default()).unwrap();
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    let count = |kind| loaded.defects.count(kind);
    assert_eq!((count(DefectKind::MissingPicture), count(DefectKind::PictureWithoutBoxes)), (1, 1));
}

/// Without its labels a picture would be learned from as one that shows no object. One that lists none is background.
#[test]
fn a_picture_whose_labels_cannot_be_used_is_left_out() {
    let names = |data: &DataSet| data.images.iter().map(|image| image.file_name.clone()).collect::<Vec<_>>();
    let first = "\"bbox\": [1.5, 2, 10, 20]";
    let cases = [
        with(first, "\"bbox\": [1.5, 2, 0, 20]"),
        with(first, "\"bbox\": [1.5, 2, -10, 20]"),
        with(first, "\"bbox\": [1.5, NaN, 10, 20]"),
        with(first, "\"bbox\": [60, 2, 10, 20]"),
        with(first, "\"bbox\": [6, 12, 10, 20, 30]"),
        with(first, "\"bbox\": [1.5, 2, 10, 20], \"bbox_mode\": 0"),
        with("\"image_id\": 1, \"category_id\": 1", "\"image_id\": 1, \"category_id\": 9"),
        with("\"image_id\": 1, \"category_id\": 1", "\"image_id\": 1, \"category_id\": \"car\""),
        with("\"image_id\": 1, \"category_id\": 1", "\"image_id\": \"1\", \"category_id\": 1"),
    ];
    for (data, defects) in cases {
        assert_eq!(names(&data), ["b.png"], "{defects:?}");
        let found = defects.iter().find(|defect| defect.kind == DefectKind::PictureOfLostLabels).unwrap();
        assert_eq!((found.count, &found.first[..]), (1, &["a.png".to_owned()][..]));
        assert_eq!(defects.count(DefectKind::PictureWithoutBoxes), 0);
    }
    // Another object of it can still be used.
    let two = first.to_owned()
        + r#", "area": 200}, {"id": 9, "image_id": 1, "category_id": 1, "bbox": [1, 2, 0, 4]"#;
    let (data, defects) = with(first, &two);
    assert_eq!((names(&data).len(), defects.count(DefectKind::ZeroSize)), (2, 1));
    assert_eq!(defects.count(DefectKind::PictureOfLostLabels), 0);
    // No object at all.
    let (data, defects) = with("\"image_id\": 1, \"category_id\"", "\"image_id\": 2, \"category_id\"");
    assert_eq!((names(&data).len(), defects.count(DefectKind::PictureWithoutBoxes)), (2, 1));

    // The size of the picture may be known from its file alone, where one label was lost before.
    let folder = tempfile::tempdir().unwrap();
    write_png(&folder.path().join("a.png"), 40, 30);
    write_png(&folder.path().join("b.png"), 41, 30);
    let text = GOOD.replace("\"width\": 40, \"height\": 30, ", "").replacen(first, &two, 1);
    std::fs::write(
        folder.path().join("annotations.json"),
        text.replacen("[1.5, 2, 10, 20]", "[60, 2, 10, 20]", 1),
    )
    .unwrap();
    let mut loaded = load_coco(folder.path(), &Cancel::default()).unwrap();
    assert_eq!(loaded.data.images.len(), 2);
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    assert_eq!(names(&loaded.data), ["b.png"]);
    assert_eq!(loaded.defects.count(DefectKind::PictureOfLostLabels), 1);
}

#[test]
fn detections_are_written() {
    let (data, _) = read(GOOD);
    let detections = [
        Detection { image_id: 1, category_id: 1, bounds: Bounds::from([1.0, 2.5, 3.0, 4.0]), score: 0.75 },
        Detection { image_id: 2, category_id: 1, bounds: Bounds::from([0.0, 0.0, 0.0, 4.0]), score: -1.5 },
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("found.json");
    save_results(&detections, &data, &path).unwrap();
    let written: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    assert_eq!(written.as_array().unwrap().len(), detections.len());
    for (record, found) in written.as_array().unwrap().iter().zip(&detections) {
        assert_eq!(record["image_id"], found.image_id);
        assert_eq!(record["category_id"], found.category_id);
        assert_eq!(record["bbox"], serde_json::json!(<[f64; 4]>::from(found.bounds)));
        assert_eq!(record["score"], found.score);
    }
    let line = String::from_utf8(results_bytes(&detections[..1], &data)).unwrap();
    assert_eq!(line, "[\n{\"image_id\":1,\"category_id\":1,\"bbox\":[1.0,2.5,3.0,4.0],\"score\":0.75}]\n");
}

#[test]
fn figures_count_classes_and_sizes() {
    let (data, _) = read(GOOD);
    let figures = Statistics::of(&data);
    assert_eq!((figures.images, figures.boxes, figures.sequences, figures.most_boxes), (2, 2, 2, 1));
    assert_eq!(figures.sizes, [(40, 30, 2)]);
    assert_eq!(figures.images_by_split, BTreeMap::from([("train".to_owned(), 1)]));
    let class = &figures.classes[0];
    assert_eq!((class.boxes, class.ignored, class.small, class.medium, class.large), (2, 1, 1, 1, 0));
    assert_eq!(class.states, BTreeMap::from([("off".to_owned(), 1), ("red".to_owned(), 1)]));
    assert!((class.side_px[0] - 200f64.sqrt()).abs() < 1e-12);
    assert!(Statistics::of(&DataSet::default()).classes.is_empty());
}

#[test]
fn fields_that_are_not_read_are_counted() {
    let (_, defects) =
        with(r#""area": 200"#, r#""area": 200, "keypoints": [1, 2, 2], "num_keypoints": 1, "track_id": 7"#);
    let found = defects.iter().find(|d| d.kind == DefectKind::UnreadField).unwrap();
    for name in
        ["annotations[].keypoints (1)", "annotations[].track_id (1)", "annotations[].segmentation (1)"]
    {
        assert!(found.first[0].contains(name), "{found:?}");
    }
}
