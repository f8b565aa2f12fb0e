//! Pictures with a label for each pixel, and the maps of classes of streets.

use std::path::Path;

use petzval_base::Cancel;
use petzval_camera::image::LinearImage;
use petzval_files::{index_png_bytes, png_bytes};
use petzval_learn::dataset::{
    ClassMap, Classes, CropPlan, DatasetError, IGNORED, LabelledPictures, List, PictureWindows, Purpose,
    StreetPlan, StreetView,
};
use petzval_street::{Families, Light};

const HEIGHT: usize = 40;
const WIDTH: usize = 60;

const CLASSES: &str = r#"
[[class]]
name = "left"
values = [7, 8]
[[class]]
name = "void"
values = [0]
ignored = true
[[class]]
name = "right"
values = [9]
"#;

/// The index of a pixel: 7 or 8 at the left, 9 at the right, 0 in the first row and 255 in the second.
fn index(row: usize, column: usize) -> u8 {
    match (row, column) {
        (0, _) => 0,
        (1, _) => 255,
        (_, 0..30) => 7 + (row % 2) as u8,
        _ => 9,
    }
}

/// The class of that pixel.
fn class(row: usize, column: usize) -> u8 {
    match index(row, column) {
        7 | 8 => 0,
        9 => 1,
        _ => IGNORED,
    }
}

fn labels(height: usize, width: usize) -> Vec<u8> {
    (0..height * width).map(|i| index(i / width, i % width)).collect()
}

/// A folder of so many pictures, whose red says the column and whose green the row.
fn folder(pictures: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["pictures", "labels"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    let place = |i: usize| {
        let (channel, pixel) = (i / (HEIGHT * WIDTH), i % (HEIGHT * WIDTH));
        [pixel % WIDTH, pixel / WIDTH, 0][channel] as f32 / 100.0
    };
    let data: Vec<f32> = (0..3 * HEIGHT * WIDTH).map(place).collect();
    let picture = LinearImage { channels: 3, height: HEIGHT, width: WIDTH, data };
    for number in 0..pictures {
        let path = |of: &str| folder.path().join(of).join(format!("{number}.png"));
        std::fs::write(path("pictures"), png_bytes(&picture).unwrap()).unwrap();
        let indices = index_png_bytes(&labels(HEIGHT, WIDTH), HEIGHT, WIDTH).unwrap();
        std::fs::write(path("labels"), indices).unwrap();
    }
    folder
}

fn load(folder: &Path, purpose: Purpose) -> Result<(LabelledPictures, Vec<String>), String> {
    let classes = Classes::parse(CLASSES).unwrap();
    LabelledPictures::load_with_label_images(folder, &classes, 16, purpose, &Cancel::default())
        .map_err(|e| e.to_string())
}

#[test]
fn what_files_of_pictures_say_that_is_not_obeyed_is_noted_once() {
    let folder = folder(7);
    for number in [1, 3] {
        let path = folder.path().join(format!("pictures/{number}.png"));
        let picture = image::open(&path).unwrap().into_rgb8();
        let mut encoder = image::codecs::png::PngEncoder::new(std::fs::File::create(&path).unwrap());
        image::ImageEncoder::set_icc_profile(&mut encoder, vec![7; 300]).unwrap();
        picture.write_with_encoder(encoder).unwrap();
    }
    let (_, notes) = load(folder.path(), Purpose::Training).unwrap();
    let wanted = "1.png and another picture: its ICC profile (that cannot be read) is ignored";
    assert!(notes.len() == 1 && notes[0].contains(wanted), "{notes:?}");
}

#[test]
fn a_window_has_the_classes_of_the_pixels_that_it_shows() {
    let folder = folder(7);
    let (pictures, notes) = load(folder.path(), Purpose::ValidatedTraining).unwrap();
    let counts = [List::Training, List::Validation, List::HeldOut].map(|list| pictures.count(list));
    assert_eq!((counts, &notes[..]), ([5, 1, 1], &[][..]));
    // Pictures in folders are not read, and a note says so.
    std::fs::create_dir(folder.path().join("pictures/aachen")).unwrap();
    let (_, notes) = load(folder.path(), Purpose::ValidatedTraining).unwrap();
    assert!(notes.len() == 1 && notes[0].contains("a folder is inside `pictures` and not read"), "{notes:?}");
    let how = PictureWindows { seed: 1, on_objects: 0.5, least_side_px: 1.0 };
    let crops = CropPlan { crop: 16, margin: 3, surround: 2, sensor_rows: 50, sensor_columns: 70 };
    let mut seen = [0_usize; 2];
    for number in 0..40 {
        let window = pictures.window(&how, List::Training, [number, 40], &crops).unwrap();
        assert_eq!(window, pictures.window(&how, List::Training, [number, 40], &crops).unwrap());
        let ClassMap { height, width, classes } = window.classes.clone().unwrap();
        assert_eq!([height, width], [16; 2]);
        // The light says which pixel of the picture it is of.
        let (scene, side) = (window.scene(), crops.window());
        let exposed = crops.exposed_at(window.at[0], window.at[1]);
        let inset = [window.at[0] - exposed.0 + crops.margin, window.at[1] - exposed.1 + crops.margin];
        let value = |channel: usize, row: usize, column: usize| {
            (100.0 * scene.data[(channel * side + row + inset[0]) * side + column + inset[1]]).round()
                as usize
        };
        for row in 0..16 {
            for column in 0..16 {
                let found = classes[row * 16 + column];
                assert_eq!(
                    found,
                    class(value(1, row, column), value(0, row, column)),
                    "{number}: {row} {column}"
                );
                if found != IGNORED {
                    seen[usize::from(found)] += 1;
                }
            }
        }
    }
    assert!(seen.iter().all(|pixels| *pixels > 1000), "{seen:?}");
}

#[test]
fn labels_that_cannot_be_used_are_refused_with_file_value_and_hint() {
    let refused = |folder: &tempfile::TempDir| load(folder.path(), Purpose::Training).unwrap_err();
    let broken = |change: &dyn Fn(&Path)| {
        let folder = folder(5);
        change(folder.path());
        refused(&folder)
    };
    let write = |path: &Path, values: &[u8], height| {
        std::fs::write(path, index_png_bytes(values, height, WIDTH).unwrap()).unwrap();
    };
    let unknown = broken(&|folder| {
        let mut values = labels(HEIGHT, WIDTH);
        values[3 * WIDTH + 5] = 13;
        write(&folder.join("labels/2.png"), &values, HEIGHT);
    });
    assert!(unknown.contains("2.png: the value 13 in row 3, column 5 is of no class"), "{unknown}");
    assert!(unknown.contains("hint: name it in `values` of a [[class]]"), "{unknown}");
    let size = broken(&|folder| write(&folder.join("labels/1.png"), &labels(HEIGHT - 1, WIDTH), HEIGHT - 1));
    assert!(size.contains("60 x 39 labels for a picture of 60 x 40 pixels"), "{size}");
    let missing = broken(&|folder| std::fs::remove_file(folder.join("labels/4.png")).unwrap());
    assert!(missing.contains("pictures/4.png: this picture has no labels"), "{missing}");
    let twice = broken(&|folder| {
        std::fs::copy(folder.join("labels/4.png"), folder.join("labels/4.tif")).unwrap();
    });
    assert!(twice.contains("has the same name but for its ending"), "{twice}");
    let other = broken(&|folder| std::fs::rename(folder.join("labels"), folder.join("masks")).unwrap());
    assert!(other.contains("there is no folder `labels` in it"), "{other}");
    let ignored = broken(&|folder| {
        for number in 0..4 {
            write(&folder.join(format!("labels/{number}.png")), &[0; HEIGHT * WIDTH], HEIGHT);
        }
    });
    assert!(ignored.contains("all pixels for training are ignored"), "{ignored}");
    // A single picture cannot both be trained on and scored with, but scored with alone.
    let one = folder(1);
    assert!(refused(&one).contains("no picture is left for scoring"), "{}", refused(&one));
    assert_eq!(load(one.path(), Purpose::Scores).unwrap().0.count(List::HeldOut), 1);
}

#[test]
fn four_pictures_are_enough_and_what_is_odd_is_said() {
    let folder = folder(4);
    std::fs::copy(folder.path().join("labels/0.png"), folder.path().join("labels/more.png")).unwrap();
    let (pictures, notes) = load(folder.path(), Purpose::ValidatedTraining).unwrap();
    let counts = [List::Training, List::Validation, List::HeldOut].map(|list| pictures.count(list));
    assert_eq!(counts, [2, 1, 1]);
    assert!(notes.iter().any(|note| note.contains("labels without a picture")), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("fewer than 5 pictures")), "{notes:?}");
    // What identifies the pictures changes with their labels.
    let before = pictures.labels();
    let mut other = labels(HEIGHT, WIDTH);
    other[5 * WIDTH] = 9;
    std::fs::write(folder.path().join("labels/1.png"), index_png_bytes(&other, HEIGHT, WIDTH).unwrap())
        .unwrap();
    assert_ne!(load(folder.path(), Purpose::ValidatedTraining).unwrap().0.labels(), before);
}

#[test]
fn labels_of_a_picture_that_exif_turns_are_said_to_be_those_of_the_turned_one() {
    use image::ImageEncoder;
    let folder = folder(5);
    // Upside down: labels of the stored pixels would have the same size.
    let upside_down = 3_u8;
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let about =
        [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0", &[upside_down][..], b"\0\0\0\0\0\0"].concat();
    encoder.set_exif_metadata(about).unwrap();
    let (pixels, width, height) = (vec![90; 3 * HEIGHT * WIDTH], WIDTH as u32, HEIGHT as u32);
    encoder.write_image(&pixels, width, height, image::ExtendedColorType::Rgb8).unwrap();
    std::fs::write(folder.path().join("pictures/2.png"), bytes).unwrap();
    let (_, notes) = load(folder.path(), Purpose::Training).unwrap();
    let [note] = &notes[..] else { panic!("{notes:?}") };
    assert!(note.contains("EXIF turns pictures/2.png; labels are taken as those of the turned"), "{note}");
}

#[test]
fn damaged_pictures_are_left_out_and_named() {
    let folder = folder(7);
    let cut = |number: usize| {
        let path = folder.path().join(format!("pictures/{number}.png"));
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    };
    cut(4);
    let (pictures, notes) = load(folder.path(), Purpose::Training).unwrap();
    // The fifth of those that are left is held out.
    assert_eq!([List::Training, List::HeldOut].map(|list| pictures.count(list)), [5, 1]);
    let [note] = &notes[..] else { panic!("{notes:?}") };
    assert!(note.contains("1 picture is left out with its labels") && note.contains("4.png"), "{note}");
    assert!(note.contains("cut off") && note.contains("take it out of the folder"), "{note}");
    cut(6);
    let (_, notes) = load(folder.path(), Purpose::Training).unwrap();
    assert!(notes[0].contains("2 pictures are left out with their labels, the first of them"), "{notes:?}");
    [0, 1, 2, 3, 5].into_iter().for_each(cut);
    let error = load(folder.path(), Purpose::Training).unwrap_err();
    assert!(error.contains("no picture is left for training: 7 pictures are left out"), "{error}");
    // Decoding can be stopped.
    let cancel = Cancel::default();
    cancel.set();
    let classes = Classes::parse(CLASSES).unwrap();
    let purpose = Purpose::Training;
    let stopped = LabelledPictures::load_with_label_images(folder.path(), &classes, 16, purpose, &cancel);
    assert!(matches!(stopped, Err(DatasetError::Stopped(_))));
}

#[test]
fn labels_are_turned_before_they_are_laid_over_their_pictures() {
    use image::ImageEncoder;
    let folder = folder(5);
    // The stored rows are columns of the labels: only turned ones have the size of the picture.
    let on_its_side = 6_u8;
    let mut bytes = Vec::new();
    let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let about =
        [b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0", &[on_its_side][..], b"\0\0\0\0\0\0"].concat();
    encoder.set_exif_metadata(about).unwrap();
    let (height, width) = (HEIGHT as u32, WIDTH as u32);
    encoder.write_image(&vec![9; HEIGHT * WIDTH], height, width, image::ExtendedColorType::L8).unwrap();
    std::fs::write(folder.path().join("labels/2.png"), bytes).unwrap();
    let (pictures, notes) = load(folder.path(), Purpose::Training).unwrap();
    let [note] = &notes[..] else { panic!("{notes:?}") };
    assert!(note.contains("EXIF turns labels/2.png; these labels are turned by it"), "{note}");
    assert_eq!(pictures.label_files().len(), 5);
}

#[test]
fn windows_of_streets_have_the_classes_of_their_surfaces() {
    let classes = Classes::parse(
        "[[class]]\nname = \"ground\"\nstreet = [\"road\", \"pavement\"]\n[[class]]\nname = \"sky\"\nstreet = [\"sky\"]\n\
         [[class]]\nname = \"car\"\nstreet = [\"vehicle\"]\n",
    )
    .unwrap();
    let plan = StreetPlan {
        seed: 1,
        light: Light::Day,
        busy: 0.4,
        surfaces: Some(classes.of_surfaces()),
        classes,
        white_cd_m2: 3.0,
        samples: 1,
        on_objects: 0.5,
        least_side_px: 24.0,
        least_visible: 0.6,
    };
    let radius_px: Vec<f64> = (0..160).map(|i| 8.0 * f64::from(i)).collect();
    let angle_rad: Vec<f64> = radius_px.iter().map(|r| (r * 5.86e-3 / 25.0).atan()).collect();
    let view = StreetView::new(&radius_px, &angle_rad, [1200, 1920]).unwrap();
    let crops = CropPlan { crop: 192, margin: 5, surround: 7, sensor_rows: 1200, sensor_columns: 1920 };
    let (mut pixels, mut in_boxes) = ([0_usize; 3], [0_usize; 2]);
    for number in 0..12 {
        let window = plan.window(List::Training, Families::All, number, [&view, &view], &crops).unwrap();
        let map = window.classes.as_ref().unwrap();
        assert_eq!([map.height, map.width], [192; 2]);
        let at = |row: usize, column: usize| map.classes[row * 192 + column];
        for class in map.classes.iter().filter(|class| **class != IGNORED) {
            pixels[usize::from(*class)] += 1;
        }
        // The box of a vehicle that counts, 0.6 of which can be seen, shows the vehicle.
        for object in window.truth.objects.iter().filter(|object| object.class == 2) {
            let b = object.bbox;
            for row in b.y1 as usize..b.y2 as usize {
                for column in b.x1 as usize..b.x2 as usize {
                    in_boxes[0] += usize::from(at(row, column) == 2);
                    in_boxes[1] += 1;
                }
            }
        }
    }
    assert!(pixels.iter().all(|pixels| *pixels > 1000), "{pixels:?}");
    assert!(2 * in_boxes[0] > in_boxes[1] && in_boxes[1] > 1000, "{in_boxes:?}");
}
