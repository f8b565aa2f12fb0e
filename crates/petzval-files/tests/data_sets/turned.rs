//! Boxes of pictures that EXIF turns.

use petzval_base::Cancel;
use std::path::Path;

use petzval_files::coco::convert::{SourceFormat, convert};
use petzval_files::coco::{Bounds, DefectKind, check_pictures, load_coco, save_coco};
use petzval_files::load_image;

/// A PNG of a gradient whose EXIF says that it is to be turned.
fn write_turned_png(path: &Path, width: u32, height: u32, exif: u8) {
    use image::ImageEncoder;
    let picture = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, 9]));
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let about = [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0", &[exif][..], b"\0\0\0\0\0\0"].concat();
    encoder.set_exif_metadata(about).unwrap();
    encoder.write_image(&picture, width, height, image::ExtendedColorType::Rgb8).unwrap();
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

/// Size and box of the picture, if they are left, and how often the kinds of turns were noted.
type OfTurned = (Option<(u32, u32)>, Option<[f64; 4]>, [usize; 3]);

/// What a check leaves of a data set of one picture.
fn of_turned(picture: &str, exif: u8, bbox: &str) -> OfTurned {
    let folder = tempfile::tempdir().unwrap();
    write_turned_png(&folder.path().join("a.png"), 40, 30, exif);
    let annotation = format!(r#"{{"id": 1, "image_id": 1, "category_id": 1, "bbox": {bbox}, "area": 72}}"#);
    let annotation = if bbox.is_empty() { "" } else { &annotation };
    let text = format!(
        r#"{{"images": [{{"id": 1, "file_name": "a.png", {picture}}}], "categories": [{{"id": 1, "name": "car"}}],
            "annotations": [{annotation}]}}"#
    );
    std::fs::write(folder.path().join("annotations.json"), text).unwrap();
    let mut loaded = load_coco(folder.path(), &Cancel::default()).unwrap();
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    let size = loaded.data.images.first().map(|image| (image.width, image.height));
    let bounds = loaded.data.annotations.first().map(|a| a.bounds.into());
    let kinds = [DefectKind::TurnedBoxes, DefectKind::UnknownTurn, DefectKind::OtherPictureSize];
    // What is written after the check is read as it is.
    save_coco(&loaded.data, &folder.path().join("annotations.json")).unwrap();
    let mut again = load_coco(folder.path(), &Cancel::default()).unwrap();
    check_pictures(&mut again, &|_| Ok(())).unwrap();
    let noted = kinds.map(|kind| loaded.defects.count(kind));
    loaded.data.annotations.iter_mut().for_each(|a| a.unclipped = None);
    assert_eq!((again.data, again.defects.count(DefectKind::TurnedBoxes)), (loaded.data, 0));
    (size, bounds, noted)
}

#[test]
fn boxes_turn_with_pictures_that_exif_turns_or_are_not_guessed() {
    let stored = r#""width": 40, "height": 30"#;
    // Orientation 6 is a quarter turn clockwise: what is 10 px above the lower edge is 10 px right of the left one.
    let quarter = of_turned(stored, 6, "[10, 8, 6, 12]");
    assert_eq!(quarter, (Some((30, 40)), Some([10.0, 10.0, 12.0, 6.0]), [1, 0, 0]));
    // A box that reaches out of the stored picture is clipped there.
    let clipped = of_turned(stored, 6, "[-4, 8, 10, 12]");
    assert_eq!(clipped, (Some((30, 40)), Some([10.0, 0.0, 12.0, 6.0]), [1, 0, 0]));
    let upright = of_turned(r#""width": 30, "height": 40"#, 6, "[10, 8, 6, 12]");
    assert_eq!(upright, (Some((30, 40)), Some([10.0, 8.0, 6.0, 12.0]), [0, 0, 0]));
    // Upside down the sizes say nothing: a picture with boxes is left out unless its entry says of what they are.
    assert_eq!(of_turned(stored, 3, "[10, 8, 6, 12]"), (None, None, [0, 1, 0]));
    assert_eq!(of_turned(stored, 3, ""), (Some((40, 30)), None, [0, 0, 0]));
    let turned = of_turned(&format!("{stored}, \"turned\": true"), 3, "[10, 8, 6, 12]");
    assert_eq!(turned, (Some((40, 30)), Some([10.0, 8.0, 6.0, 12.0]), [0, 0, 0]));
    let unturned = of_turned(&format!("{stored}, \"turned\": false"), 3, "[10, 8, 6, 12]");
    assert_eq!(unturned, (Some((40, 30)), Some([24.0, 10.0, 6.0, 12.0]), [1, 0, 0]));
    // Without a stated size nothing says it either.
    assert_eq!(of_turned(r#""license": 1"#, 6, "[10, 8, 6, 12]"), (None, None, [0, 1, 0]));
    assert_eq!(of_turned(r#""width": 41, "height": 30"#, 6, "[1, 8, 6, 12]"), (None, None, [0, 0, 1]));
    assert_eq!(
        of_turned(stored, 1, "[10, 8, 6, 12]"),
        (Some((40, 30)), Some([10.0, 8.0, 6.0, 12.0]), [0, 0, 0])
    );
}

fn write(root: &Path, name: &str, text: &str) {
    std::fs::write(root.join(name), text).unwrap();
}

/// The bright object of a picture lies in its box, whichever way EXIF turns the picture, or the picture is left out.
#[test]
fn boxes_lie_on_their_objects_for_every_orientation() {
    for exif in 1..=8 {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        // The object is at 8..20 x 3..9 of 40 x 30 stored pixels.
        write_turned_object(&root.join("a.jpg"), exif);
        let light = load_image(&root.join("a.jpg")).unwrap().light;
        let (width, height) = (light.width, light.height);
        assert_eq!((width, height), if exif < 5 { (40, 30) } else { (30, 40) });
        let bright: Vec<[f64; 2]> = (0..height)
            .flat_map(|row| (0..width).map(move |column| (row, column)))
            .filter(|(row, column)| light.get(1, *row, *column) > 0.3)
            .map(|(row, column)| [column as f64, row as f64])
            .collect();
        let around = Bounds::around(bright).unwrap();
        let truth = [around.x, around.y, around.width + 1.0, around.height + 1.0];
        assert_eq!(truth[2] * truth[3], 12.0 * 6.0, "orientation {exif}");

        // YOLO labels are of the turned picture.
        let [x, y, w, h] = truth;
        let shares = [
            (x + 0.5 * w) / width as f64,
            (y + 0.5 * h) / height as f64,
            w / width as f64,
            h / height as f64,
        ];
        write(root, "classes.txt", "car\n");
        write(root, "a.txt", &format!("0 {} {} {} {}\n", shares[0], shares[1], shares[2], shares[3]));
        let found = |format| {
            let converted = convert(format, root, None, &Cancel::default()).unwrap();
            let bounds = converted.data.annotations.first().map(|a| <[f64; 4]>::from(a.bounds));
            (bounds, converted.data.images.len(), converted.defects)
        };
        let is_truth = |bounds: Option<[f64; 4]>| {
            bounds.is_some_and(|b| b.iter().zip(truth).all(|(found, wanted)| (found - wanted).abs() < 1e-9))
        };
        assert!(is_truth(found(SourceFormat::Yolo).0), "orientation {exif}");

        // Pascal VOC states a size: that of the stored pixels, or of the turned picture. Of half a turn and of mirrors it says nothing.
        let voc = |[x, y, w, h]: [f64; 4], size: [usize; 2]| {
            format!(
                "<annotation><size><width>{}</width><height>{}</height></size><object><name>car</name><bndbox><xmin>{}</xmin>\
                 <ymin>{}</ymin><xmax>{}</xmax><ymax>{}</ymax></bndbox></object></annotation>",
                size[0],
                size[1],
                x + 1.0,
                y + 1.0,
                x + w,
                y + h
            )
        };
        let stored = [8.0, 3.0, 12.0, 6.0];
        for (bounds, size) in [(stored, [40, 30]), (truth, [width, height])] {
            write(root, "a.xml", &voc(bounds, size));
            let (found, pictures, defects) = found(SourceFormat::Voc);
            if (2..=4).contains(&exif) {
                assert_eq!((found, pictures, defects.count(DefectKind::UnknownTurn)), (None, 0, 1));
            } else {
                assert!(is_truth(found), "orientation {exif}, stated {size:?}: {found:?}");
            }
        }
        std::fs::remove_file(root.join("a.xml")).unwrap();

        // BDD100K states none. Its corners are the first and the last pixel.
        let corners = format!(r#"{{"x1": {x}, "y1": {y}, "x2": {}, "y2": {}}}"#, x + w - 1.0, y + h - 1.0);
        let label =
            format!(r#"[{{"name": "a.jpg", "labels": [{{"category": "car", "box2d": {corners}}}]}}]"#);
        write(root, "labels.json", &label);
        let (bounds, pictures, defects) = found(SourceFormat::Bdd100k);
        if exif == 1 {
            assert!(is_truth(bounds));
        } else {
            assert_eq!((bounds, pictures, defects.count(DefectKind::UnknownTurn)), (None, 0, 1));
        }
        std::fs::remove_file(root.join("labels.json")).unwrap();

        // An entry of a file in COCO format may say it.
        for (is_turned, bounds) in [(true, truth), (false, stored)] {
            let annotation =
                format!(r#"{{"id": 1, "image_id": 1, "category_id": 1, "area": 72, "bbox": {bounds:?}}}"#);
            let text = format!(
                r#"{{"images": [{{"id": 1, "file_name": "a.jpg", "turned": {is_turned}}}],
                    "categories": [{{"id": 1, "name": "car"}}], "annotations": [{annotation}]}}"#
            );
            write(root, "annotations.json", &text);
            let mut loaded = load_coco(root, &Cancel::default()).unwrap();
            check_pictures(&mut loaded, &|_| Ok(())).unwrap();
            let bounds = loaded.data.annotations.first().map(|a| a.bounds.into());
            assert!(is_truth(bounds), "orientation {exif}, turned {is_turned}: {bounds:?}");
        }
    }
}

/// A JPEG of 40 x 30 stored pixels with a bright object, whose EXIF says how it is to be turned.
fn write_turned_object(path: &Path, exif: u8) {
    use image::ImageEncoder;
    let inside = |x: u32, y: u32| (8..20).contains(&x) && (3..9).contains(&y);
    let picture =
        image::RgbImage::from_fn(40, 30, |x, y| image::Rgb([if inside(x, y) { 240 } else { 20 }; 3]));
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 100);
    let about = [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0", &[exif][..], b"\0\0\0\0\0\0"].concat();
    encoder.set_exif_metadata(about).unwrap();
    encoder.write_image(&picture, 40, 30, image::ExtendedColorType::Rgb8).unwrap();
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn the_size_that_does_not_fit_is_that_of_the_stored_pixels_where_boxes_are_of_these() {
    let folder = tempfile::tempdir().unwrap();
    write_turned_png(&folder.path().join("a.png"), 40, 30, 6);
    for (turned, size) in [
        (true, "30 x 40 px, stated 41 x 30"),
        (false, "40 x 30 px as stored (`turned` is false), stated 41 x 30"),
    ] {
        let text = format!(
            r#"{{"images": [{{"id": 1, "file_name": "a.png", "width": 41, "height": 30, "turned": {turned}}}], "categories": [],
                "annotations": []}}"#
        );
        write(folder.path(), "annotations.json", &text);
        let mut loaded = load_coco(folder.path(), &Cancel::default()).unwrap();
        check_pictures(&mut loaded, &|_| Ok(())).unwrap();
        let other = loaded.defects.iter().find(|d| d.kind == DefectKind::OtherPictureSize).unwrap();
        assert_eq!(other.first, [format!("a.png: {size}")]);
    }
}
