//! Forms of records beside the usual one: outlines, masks, rotated boxes, ids that are texts.

use petzval_files::coco::{Bounds, DefectKind, Defects, Detection, coco_bytes, parse_coco, results_bytes};

use super::{GOOD, read, with};

#[test]
fn outlines_and_rotated_boxes_become_the_boxes_around_them() {
    let outline = r#""segmentation": [[10, 8, 16, 8, 16, 20.5, 10, 20]]"#;
    let (data, defects) = read(&GOOD.replacen(r#""bbox": [1.5, 2, 10, 20], "#, "", 1).replacen(
        r#""segmentation": [[1, 2, 3]]"#,
        outline,
        1,
    ));
    assert_eq!(data.annotations[0].bounds, Bounds::from([10.0, 8.0, 6.0, 12.5]));
    assert_eq!((defects.count(DefectKind::OutlineBox), defects.count(DefectKind::UnreadField)), (1, 0));
    // An empty list is no box, and a mask whose runs end within a number has none.
    let masked = GOOD.replacen("[1.5, 2, 10, 20]", "[]", 1).replacen(
        "[[1, 2, 3]]",
        r#"{"counts": "abc", "size": [30, 40]}"#,
        1,
    );
    let (data, defects) = read(&masked);
    assert_eq!((data.annotations.len(), defects.errors()), (1, 2));
    let of = [DefectKind::WrongType, DefectKind::PictureOfLostLabels].map(|kind| defects.count(kind));
    assert_eq!(of, [1, 1]);

    // A quarter turn about the middle of the box, (6.5, 12).
    let (data, defects) = with(r#""distance_m": 31.5"#, r#""rotation": 90"#);
    let found = <[f64; 4]>::from(data.annotations[0].bounds);
    for (found, wanted) in found.into_iter().zip([0.0, 7.0, 16.5, 10.0]) {
        assert!((found - wanted).abs() < 1e-9, "{:?}", data.annotations[0].bounds);
    }
    assert_eq!((defects.count(DefectKind::RotatedBox), defects.count(DefectKind::ClippedBox)), (1, 1));
    assert!(!data.annotations[0].attributes.contains_key("rotation"));
    let (data, defects) = with(r#""distance_m": 31.5"#, r#""rotation": 0.0"#);
    assert_eq!((data.annotations.len(), defects.count(DefectKind::RotatedBox)), (2, 0));
    // An angle that is no number gives no box.
    for angle in ["\"90\"", "true"] {
        let (data, defects) = with(r#""distance_m": 31.5"#, &format!(r#""rotation": {angle}"#));
        assert_eq!((data.annotations.len(), defects.count(DefectKind::WrongType)), (1, 1), "{angle}");
    }
    // Capitals mean the same, and other names of angles say no unit: they are counted.
    let (data, defects) = with(r#""distance_m": 31.5"#, r#""Rotation": 90"#);
    let height = data.annotations[0].bounds.height;
    assert!((height - 10.0).abs() < 1e-9 && defects.count(DefectKind::RotatedBox) == 1, "{height}");
    assert_eq!(with(r#""distance_m": 31.5"#, r#""rotation": [90]"#).1.count(DefectKind::WrongType), 1);
    let fields = |attribute: &str| {
        let (data, defects) = with(r#""distance_m": 31.5"#, attribute);
        assert_eq!(data.annotations[0].bounds, Bounds::from([1.5, 2.0, 10.0, 20.0]));
        defects.iter().find(|defect| defect.kind == DefectKind::UnreadField).unwrap().first[0].clone()
    };
    assert!(fields(r#""angle": 30"#).contains("annotations[].attributes.angle (1)"));
    assert!(!fields(r#""angle": 0"#).contains("angle"));
    // Detectron2's number for two corners is no box of COCO.
    let (_, defects) = with(r#""area": 200"#, r#""area": 200, "bbox_mode": 0"#);
    assert_eq!(defects.count(DefectKind::WrongType), 1);
    assert_eq!(with(r#""area": 200"#, r#""area": 200, "bbox_mode": 1"#).1.errors(), 0);
    // Five values are a rotated box of which nothing says how it is written.
    assert_eq!(with("[1.5, 2, 10, 20]", "[6, 12, 10, 20, 30]").1.count(DefectKind::WrongType), 1);
}

/// The good file, whose first object has this in place of its outline, and no box.
fn with_mask(mask: &str) -> (Option<[f64; 4]>, Defects) {
    let text = GOOD.replacen(r#""bbox": [1.5, 2, 10, 20], "#, "", 1).replacen("[[1, 2, 3]]", mask, 1);
    let (data, defects) = read(&text);
    (data.annotations.iter().find(|a| a.id == 1).map(|a| a.bounds.into()), defects)
}

#[test]
fn masks_without_a_box_have_the_one_around_their_pixels() {
    // Pieces in column 3, in columns 20 and 21, and the last pixel: `mask.toBbox` of pycocotools 2.0.11 gives [3, 2, 37, 28].
    let wanted = Some([3.0, 2.0, 37.0, 28.0]);
    let (list, text) = ("[95, 4, 503, 26, 4, 26, 541, 1]", r#""o24g?f0]@0i`0WO""#);
    for mask in [list, text] {
        for order in [
            format!(r#"{{"size": [30, 40], "counts": {mask}}}"#),
            format!(r#"{{"counts": {mask}, "size": [30, 40]}}"#),
        ] {
            let (found, defects) = with_mask(&order);
            assert_eq!((found, defects.count(DefectKind::OutlineBox)), (wanted, 1), "{order}");
            assert_eq!((defects.errors(), defects.count(DefectKind::UnreadField)), (0, 0));
        }
    }
    // A mask of other pixels, and one that does not end with its picture, say nothing of this one.
    for wrong in [
        r#"{"size": [40, 30], "counts": [95, 4, 503, 26, 4, 26, 541, 1]}"#,
        r#"{"size": [30, 40], "counts": [95, 4, 503, 26, 4, 26, 541, 2]}"#,
        r#"{"size": [30, 40], "counts": [1200]}"#,
    ] {
        let (found, defects) = with_mask(wrong);
        assert_eq!((found, defects.count(DefectKind::WrongType)), (None, 1), "{wrong}");
    }
    // Beside a box a mask is counted and not read.
    let (data, defects) = with("[[1, 2, 3]]", r#"{"size": [30, 40], "counts": "o24g?f0]@0i`0WO"}"#);
    assert_eq!(data.annotations[0].bounds, Bounds::from([1.5, 2.0, 10.0, 20.0]));
    assert_eq!((defects.count(DefectKind::OutlineBox), defects.count(DefectKind::UnreadField)), (0, 1));
}

const NAMED: &str = r#"{
"images": [{"id": "000000001", "file_name": "a.png", "width": 40, "height": 30},
           {"id": "img_b", "file_name": "b.png", "width": 40, "height": 30}],
"categories": [{"id": 1, "name": "car"}],
"annotations": [{"id": "x", "image_id": "img_b", "category_id": 1, "bbox": [1, 2, 3, 4], "area": 12},
                {"id": "y", "image_id": "000000001", "category_id": 1, "bbox": [5, 6, 7, 8], "area": 56}]}"#;

#[test]
fn ids_that_are_texts_are_names_that_must_agree() {
    let (data, defects) = read(NAMED);
    assert_eq!(defects.iter().count(), 0, "{defects:?}");
    let of = |k: usize| {
        let object = &data.annotations[k];
        let image = data.images.iter().find(|image| image.id == object.image_id).unwrap();
        (image.file_name.as_str(), object.bounds.x)
    };
    assert_eq!((of(0), of(1)), (("b.png", 1.0), ("a.png", 5.0)));
    // Written again, the pictures have the names of their file, so that other programs find them there.
    let bytes = coco_bytes(&data);
    let written: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    assert_eq!(
        (&written["images"][0]["id"], &written["annotations"][0]["image_id"]),
        (&"000000001".into(), &"img_b".into())
    );
    assert_eq!(parse_coco(bytes, &mut Defects::default()).unwrap(), data);
    let found = [Detection {
        image_id: data.images[1].id,
        category_id: 1,
        bounds: Bounds::from([1.0, 2.0, 3.0, 4.0]),
        score: 0.5,
    }];
    let line = String::from_utf8(results_bytes(&found, &data)).unwrap();
    assert!(line.contains(r#""image_id":"img_b""#), "{line}");
    let written: serde_json::Value = serde_json::from_str(&line).unwrap();
    assert_eq!(written.as_array().unwrap().len(), 1);
    assert_eq!((&written[0]["category_id"], &written[0]["score"]), (&1.into(), &0.5.into()));
    assert_eq!(written[0]["bbox"], serde_json::json!([1.0, 2.0, 3.0, 4.0]));

    // Ids of classes are read and written alike.
    let classes = NAMED.replace(
        r#""categories": [{"id": 1,"#,
        r#""categories": [{"id": "k7", "name": "bus"}, {"id": "k1","#,
    );
    let classes = classes.replace(r#""category_id": 1"#, r#""category_id": "k1""#);
    let (data, defects) = read(&classes);
    assert_eq!((defects.errors(), data.annotations.len()), (0, 2), "{defects:?}");
    assert_eq!(data.category(data.annotations[0].category_id).unwrap().name, "car");
    assert_eq!(parse_coco(coco_bytes(&data), &mut Defects::default()).unwrap(), data);
    let found = [Detection { category_id: data.annotations[0].category_id, ..found[0] }];
    let line = String::from_utf8(results_bytes(&found, &data)).unwrap();
    assert!(line.contains(r#""category_id":"k1""#), "{line}");
    let (data, defects) = read(&classes.replacen(r#""category_id": "k1""#, r#""category_id": "k2""#, 1));
    assert_eq!((data.annotations.len(), defects.count(DefectKind::UnknownCategory)), (1, 1));

    for (from, to, kind, images, objects) in [
        // A name that no picture has, a number among names, a name among numbers, and a name that two have.
        (r#""image_id": "img_b""#, r#""image_id": "img_c""#, DefectKind::UnknownImage, 2, 1),
        (r#""image_id": "img_b""#, r#""image_id": 2"#, DefectKind::WrongType, 2, 1),
        (r#""id": "img_b""#, r#""id": 2"#, DefectKind::WrongType, 1, 0),
        (r#""id": "img_b""#, r#""id": "000000001""#, DefectKind::RepeatedImageId, 0, 0),
        (
            r#""id": "img_b", "file_name": "b.png""#,
            r#""id": "000000001", "file_name": "a.png""#,
            DefectKind::RepeatedFile,
            1,
            1,
        ),
        (r#""id": "img_b""#, r#""id": """#, DefectKind::WrongType, 1, 1),
        (r#""id": "y""#, r#""id": 7"#, DefectKind::WrongType, 1, 1),
        (r#""id": "y""#, r#""id": "x""#, DefectKind::RepeatedAnnotationId, 2, 2),
    ] {
        let (data, defects) = read(&NAMED.replacen(from, to, 1));
        assert!(defects.count(kind) >= 1, "{to}: {defects:?}");
        assert_eq!((data.images.len(), data.annotations.len()), (images, objects), "{to}");
    }
}
