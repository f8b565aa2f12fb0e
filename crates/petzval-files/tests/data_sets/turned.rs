//! Boxes of pictures that EXIF turns.

use std::path::Path;

use petzval_files::coco::{DefectKind, check_pictures, load_coco, save_coco};

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
    let mut loaded = load_coco(folder.path()).unwrap();
    check_pictures(&mut loaded, &|_| ());
    let size = loaded.data.images.first().map(|image| (image.width, image.height));
    let bounds = loaded.data.annotations.first().map(|a| a.bounds.into());
    let kinds = [DefectKind::TurnedBoxes, DefectKind::UnknownTurn, DefectKind::OtherPictureSize];
    // What is written after the check is read as it is.
    save_coco(&loaded.data, &folder.path().join("annotations.json")).unwrap();
    let mut again = load_coco(folder.path()).unwrap();
    check_pictures(&mut again, &|_| ());
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
    let as_stored = of_turned(&format!("{stored}, \"turned\": false"), 3, "[10, 8, 6, 12]");
    assert_eq!(as_stored, (Some((40, 30)), Some([24.0, 10.0, 6.0, 12.0]), [1, 0, 0]));
    // Without a stated size nothing says it either.
    assert_eq!(of_turned(r#""license": 1"#, 6, "[10, 8, 6, 12]"), (None, None, [0, 1, 0]));
    assert_eq!(of_turned(r#""width": 41, "height": 30"#, 6, "[1, 8, 6, 12]"), (None, None, [0, 0, 1]));
    assert_eq!(
        of_turned(stored, 1, "[10, 8, 6, 12]"),
        (Some((40, 30)), Some([10.0, 8.0, 6.0, 12.0]), [0, 0, 0])
    );
}
