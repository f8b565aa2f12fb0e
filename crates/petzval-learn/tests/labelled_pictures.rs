//! Windows of a folder of pictures with boxes.

use std::path::Path;

use petzval_base::Cancel;
use petzval_learn::dataset::{Classes, CropPlan, LabelledPictures, List, PictureWindows, Purpose};

const CROP: usize = 64;

/// A folder of `count` pictures of 120 x 100 pixels with a white person and a black car in each, and a crowd.
fn folder(path: &Path, count: usize, category: &str) {
    let mut pictures = Vec::new();
    let mut annotations = Vec::new();
    for i in 1..=count {
        let name = format!("{i:02}.png");
        let [x, y] = [5 * (i % 10) as u32, 3 * (i % 10) as u32];
        let picture = image::RgbImage::from_fn(120, 100, |column, row| {
            let is_in = |left: u32, top: u32, width: u32, height: u32| {
                (left..left + width).contains(&column) && (top..top + height).contains(&row)
            };
            image::Rgb(if is_in(x, y, 16, 40) {
                [255; 3]
            } else if is_in(x + 40, y + 20, 30, 20) {
                [0; 3]
            } else {
                [128; 3]
            })
        });
        picture.save(path.join(&name)).unwrap();
        pictures.push(format!(r#"{{"id": {i}, "file_name": "{name}", "width": 120, "height": 100}}"#));
        let boxes = [(x, y, 16, 40, 1, 0), (x + 40, y + 20, 30, 20, 2, 0), (0, 80, 20, 20, 1, 1)];
        for (k, (x, y, width, height, class, crowd)) in boxes.into_iter().enumerate() {
            let (id, area) = (10 * i + k, width * height);
            annotations.push(format!(
                r#"{{"id": {id}, "image_id": {i}, "category_id": {class}, "bbox": [{x}, {y}, {width}, {height}], "area": {area}, "iscrowd": {crowd}}}"#
            ));
        }
    }
    let text = format!(
        r#"{{"images": [{}], "annotations": [{}], "categories": [{{"id": 1, "name": "{category}"}}, {{"id": 2, "name": "car"}}]}}"#,
        pictures.join(","),
        annotations.join(",")
    );
    std::fs::write(path.join("annotations.json"), text).unwrap();
}

fn people_and_vehicles() -> Classes {
    Classes::parse(include_str!("../../petzval-data/data/tasks/pedestrian-vehicle.toml")).unwrap()
}

fn load(path: &Path, crop: usize) -> Result<(LabelledPictures, Vec<String>), String> {
    LabelledPictures::load(
        path,
        &people_and_vehicles(),
        crop,
        8.0,
        Purpose::ValidatedTraining,
        &Cancel::default(),
    )
    .map_err(|e| e.to_string())
}

#[test]
fn windows_hold_the_light_and_the_boxes_of_their_pictures() {
    let folder_path = tempfile::tempdir().unwrap();
    folder(folder_path.path(), 15, "person");
    let (pictures, notes) = load(folder_path.path(), CROP).unwrap();
    // Pictures 1 and 11 are the same, and so are four other pairs.
    assert!(
        notes.len() == 3
            && notes[0].contains("Two picture files have the same content (5 times; the first: 0"),
        "{notes:?}"
    );
    assert!(notes[1].contains("crowd"), "{notes:?}");
    assert!(notes[2].contains("no picture names its sequence"), "{notes:?}");
    assert_eq!([List::Training, List::Validation, List::HeldOut].map(|list| pictures.count(list)), [9, 3, 3]);
    // Without validations all others train.
    let all = LabelledPictures::load(
        folder_path.path(),
        &people_and_vehicles(),
        CROP,
        8.0,
        Purpose::Training,
        &Cancel::default(),
    );
    let all = all.unwrap().0;
    assert_eq!([List::Training, List::Validation, List::HeldOut].map(|list| all.count(list)), [12, 0, 3]);
    let crops = CropPlan { surround: 4, ..CropPlan::on_1920x1200(CROP, 10) };
    let how = PictureWindows { seed: 1, on_objects: 1.0, least_side_px: 8.0 };
    let mut found = [0, 0];
    for number in 0..30 {
        let window = pictures.window(&how, List::Training, [number, 30], &crops).unwrap();
        assert_eq!(window, pictures.window(&how, List::Training, [number, 30], &crops).unwrap());
        let scene = window.scene();
        assert_eq!([scene.height, scene.width], [crops.window(); 2]);
        let exposed = crops.exposed_at(window.at[0], window.at[1]);
        let inset = [window.at[0] - exposed.0 + crops.margin, window.at[1] - exposed.1 + crops.margin];
        for object in &window.truth.objects {
            // The middle of a person is white, that of a car black.
            let [x, y] = object.bbox.centre().map(|v| v as usize);
            let light = scene.data[(y + inset[0]) * scene.width + x + inset[1]];
            assert_eq!(light > 0.9, object.class == 0, "{number}: {light}");
            found[object.class] += 1;
        }
    }
    assert!(found.iter().all(|count| *count > 10), "{found:?}");
}

#[test]
fn folders_that_cannot_train_or_score_a_detector_are_refused() {
    let few = tempfile::tempdir().unwrap();
    folder(few.path(), 3, "person");
    mark(few.path(), |_| r#""sequence": "drive""#.to_owned());
    let error = load(few.path(), CROP).unwrap_err();
    assert!(error.contains("of one sequence") && error.contains("left for scoring"), "{error}");
    // A small picture among those for training is not why none is left for scoring.
    let annotations = few.path().join("annotations.json");
    let text = std::fs::read_to_string(&annotations).unwrap();
    std::fs::write(&annotations, text.replacen("\"height\": 100", "\"height\": 50", 1)).unwrap();
    image::RgbImage::new(120, 50).save(few.path().join("01.png")).unwrap();
    let error = load(few.path(), CROP).unwrap_err();
    assert!(error.contains("of one sequence") && !error.contains("smaller than a window"), "{error}");
    let other = tempfile::tempdir().unwrap();
    folder(other.path(), 15, "cow");
    let (_, notes) = load(other.path(), CROP).unwrap();
    assert!(notes.iter().any(|note| note.contains("`pedestrian` has 0 boxes")), "{notes:?}");
    let large = load(other.path(), 110).unwrap_err();
    assert!(large.contains("no picture is left"), "{large}");
    let remedy = "; hint: write 100 or less for `training.crop` and for `scoring.crop`, or ";
    assert!(large.contains(remedy), "{large}");
    let text = std::fs::read_to_string(other.path().join("annotations.json")).unwrap();
    // Boxes of another form are refused, not trained on.
    let boxes = "\"bbox\": [";
    let (head, rest) = text.split_once(boxes).unwrap();
    let shares = rest.split(boxes).map(|rest| {
        let (_, after) = rest.split_once(']').unwrap();
        format!("{boxes}0.1, 0.2, 0.3, 0.4]{after}")
    });
    let shares: String = std::iter::once(head.to_owned()).chain(shares).collect();
    std::fs::write(other.path().join("annotations.json"), shares).unwrap();
    let error = load(other.path(), CROP).unwrap_err();
    assert!(
        error.contains("shares of the picture") && error.contains("hint: COCO boxes are in pixels"),
        "{error}"
    );
    std::fs::write(other.path().join("annotations.json"), &text).unwrap();
    // What is too small to count is as good as not there.
    let small = LabelledPictures::load(
        other.path(),
        &people_and_vehicles(),
        CROP,
        500.0,
        Purpose::ValidatedTraining,
        &Cancel::default(),
    );
    assert!(small.unwrap_err().to_string().contains("500 pixels or more"));
    std::fs::write(other.path().join("annotations.json"), text.replace("\"car\"", "\"goat\"")).unwrap();
    let nothing = load(other.path(), CROP).unwrap_err();
    let why = "no box of pedestrian, vehicle counts";
    assert!(nothing.contains(why) && nothing.contains("the categories are cow, goat;"), "{nothing}");
    std::fs::write(other.path().join("annotations.json"), "{\"images\": [").unwrap();
    assert!(load(other.path(), CROP).unwrap_err().contains("annotations.json"));
    assert!(load(&other.path().join("nowhere"), CROP).is_err());
}

#[test]
fn a_few_sequences_are_enough_and_the_last_is_held_out() {
    let few = tempfile::tempdir().unwrap();
    folder(few.path(), 6, "person");
    mark(few.path(), |i| format!(r#""sequence": "drive-{}""#, i.div_ceil(2)));
    let (pictures, notes) = load(few.path(), CROP).unwrap();
    assert_eq!([List::Training, List::Validation, List::HeldOut].map(|list| pictures.count(list)), [2, 2, 2]);
    assert!(notes.iter().any(|note| note.contains("fewer than 5 sequences")), "{notes:?}");
    // The same one is held out with validations and without.
    let four = tempfile::tempdir().unwrap();
    folder(four.path(), 7, "person");
    mark(four.path(), |i| format!(r#""sequence": "drive-{}""#, i.div_ceil(2)));
    for (purpose, counts) in [
        (Purpose::ValidatedTraining, [4, 2, 1]),
        (Purpose::Training, [6, 0, 1]),
        (Purpose::Scores, [0, 0, 7]),
    ] {
        let classes = people_and_vehicles();
        let pictures =
            LabelledPictures::load(four.path(), &classes, CROP, 8.0, purpose, &Cancel::default()).unwrap().0;
        assert_eq!(
            [List::Training, List::Validation, List::HeldOut].map(|list| pictures.count(list)),
            counts
        );
    }
}

#[test]
fn what_names_no_part_is_not_trained_on() {
    let parts = tempfile::tempdir().unwrap();
    folder(parts.path(), 9, "person");
    mark(parts.path(), |i| format!(r#""split": "{}""#, ["train", "val", ""][i % 3]));
    let (pictures, notes) = load(parts.path(), CROP).unwrap();
    assert_eq!(pictures.count(List::Training) + pictures.count(List::Validation), 3);
    assert_eq!(pictures.count(List::HeldOut), 6);
    assert!(notes.iter().any(|note| note.contains("3 pictures name no part")), "{notes:?}");
}

#[test]
fn parts_for_training_are_known_by_how_their_names_begin_and_tests_never_train() {
    // Of fifteen pictures ten are of the larger part.
    let said = |small: &str, large: &str| {
        let parts = tempfile::tempdir().unwrap();
        folder(parts.path(), 15, "person");
        mark(parts.path(), |i| format!(r#""split": "{}""#, if i % 3 == 0 { small } else { large }));
        load(parts.path(), CROP).map(|(pictures, notes)| {
            let note = notes.into_iter().find(|note| note.contains("for training: ")).unwrap_or_default();
            (
                pictures.count(List::HeldOut),
                note.split_once(": ").map(|(_, note)| note.to_owned()).unwrap_or_default(),
            )
        })
    };
    for (small, large, held_out, note) in [
        ("TRAIN", "val", 10, "for training: `TRAIN`; held out: `val`"),
        ("train2017", "val2017", 10, "for training: `train2017`; held out: `val2017`"),
        ("Training", "test", 10, "for training: `Training`; held out: `test`"),
        ("train_b", "train", 5, "for training: `train`; held out: `train_b`"),
        ("day", "night", 5, "for training: `night`; held out: `day`"),
        ("val", "test", 10, "for training: `val`; held out: `test`"),
        ("test", "", 5, "for training: pictures without a part; held out: `test`"),
    ] {
        assert_eq!(said(small, large), Ok((held_out, note.to_owned())), "{small}, {large}");
    }
    let error = said("test", "Test-dev").unwrap_err();
    assert!(error.contains("all pictures are of a part for tests"), "{error}");
}

/// Writes keys into the records of the pictures of a folder: `more` says which, by the picture's number, from 1.
fn mark(path: &Path, more: impl Fn(usize) -> String) {
    let file = path.join("annotations.json");
    let mut text = std::fs::read_to_string(&file).unwrap();
    for i in 1.. {
        let (from, next) = (format!("{{\"id\": {i}, \"file_name\""), text.clone());
        text = text.replacen(&from, &format!("{{{}, \"id\": {i}, \"file_name\"", more(i)), 1);
        if text == next {
            break;
        }
    }
    std::fs::write(file, text).unwrap();
}

/// Folders of KITTI name the part for training alone: nothing would be held out.
#[test]
fn where_all_pictures_are_of_one_part_every_fifth_is_held_out() {
    let one = tempfile::tempdir().unwrap();
    folder(one.path(), 15, "person");
    mark(one.path(), |_| "\"split\": \"train\"".to_owned());
    let (pictures, _) = load(one.path(), CROP).unwrap();
    assert_eq!([List::Training, List::Validation, List::HeldOut].map(|list| pictures.count(list)), [9, 3, 3]);
}

#[test]
fn categories_are_taken_by_the_words_of_their_names_and_background_is_named() {
    let people = |category: &str| {
        let folder_path = tempfile::tempdir().unwrap();
        folder(folder_path.path(), 15, category);
        match load(folder_path.path(), CROP) {
            Ok((_, notes)) => {
                notes.iter().find(|note| note.contains("background")).cloned().unwrap_or_default()
            }
            Err(error) => error,
        }
    };
    for category in ["persons", "Cyclist", "human--person", "people", "Pedestrians"] {
        assert_eq!(people(category), "", "{category}");
    }
    for category in ["pedestrian traffic light", "bus stop", "object--vehicle--bicycle", "dog"] {
        let note = people(category);
        assert!(note.contains(&format!("background: {category}; as `vehicle`: car")), "{note}");
    }
}

#[test]
fn validation_sees_no_film_that_is_trained_on_if_there_is_a_second_one() {
    let counts = |pictures: &LabelledPictures| {
        [List::Training, List::Validation, List::HeldOut].map(|list| pictures.count(list))
    };
    let part = |i: usize| if i <= 9 { "train" } else { "test" };
    // Three films of three pictures each to train on: the last one is for validation, though none of them is a fifth one.
    let three = tempfile::tempdir().unwrap();
    folder(three.path(), 12, "person");
    mark(three.path(), |i| format!("\"split\": \"{}\", \"sequence\": \"film {}\"", part(i), (i - 1) / 3));
    let (pictures, notes) = load(three.path(), CROP).unwrap();
    assert_eq!(counts(&pictures), [6, 3, 3]);
    assert!(notes.iter().all(|note| !note.contains("sequence")), "{notes:?}");
    assert_eq!(
        (0..3).map(|k| pictures.sequence(List::Validation, [k, 3])).collect::<Vec<_>>(),
        ["film 2"; 3]
    );
    // What validates does not train: a class that training has in the film for validation alone is missed.
    let file = three.path().join("annotations.json");
    let mut data: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&file).unwrap()).unwrap();
    let objects = data["annotations"].as_array_mut().unwrap();
    objects.retain(|object| object["category_id"] != 1 || object["image_id"].as_u64() > Some(6));
    std::fs::write(&file, data.to_string()).unwrap();
    let (_, notes) = load(three.path(), CROP).unwrap();
    assert!(notes.iter().any(|note| note.contains("`pedestrian` has 0 boxes")), "{notes:?}");
    // One film alone: a note says that validation is worth little, and that scores see it as well.
    let one = tempfile::tempdir().unwrap();
    folder(one.path(), 12, "person");
    mark(one.path(), |i| format!("\"split\": \"{}\", \"sequence\": \"film\"", part(i)));
    let (pictures, notes) = load(one.path(), CROP).unwrap();
    assert_eq!(counts(&pictures), [9, 9, 3]);
    let said = |words: &str| notes.iter().any(|note| note.contains(words));
    assert!(
        said("of one sequence") && said("pictures of 1 sequences are in the part for training"),
        "{notes:?}"
    );
}

#[test]
fn a_picture_of_two_parts_is_noted_and_is_no_film() {
    let path = tempfile::tempdir().unwrap();
    folder(path.path(), 12, "person");
    mark(path.path(), |i| format!("\"split\": \"{}\"", if i <= 9 { "train" } else { "test" }));
    let file = path.path().join("annotations.json");
    let again = r#"{"id": 99, "file_name": "01.png", "split": "test", "width": 120, "height": 100}, "#;
    let images = "\"images\": [";
    let text = std::fs::read_to_string(&file).unwrap().replacen(images, &format!("{images}{again}"), 1);
    std::fs::write(&file, text).unwrap();
    let (_, notes) = load(path.path(), CROP).unwrap();
    let said = |words: &str| notes.iter().any(|note| note.contains(words));
    assert!(said("Two entries are of one picture file") && said("01.png"), "{notes:?}");
    assert!(said("no picture names its sequence") && !said("pictures of the same film"), "{notes:?}");
}

#[test]
fn the_fingerprint_is_that_of_the_files_content() {
    let path = tempfile::tempdir().unwrap();
    folder(path.path(), 15, "person");
    let print = || {
        let pictures = load(path.path(), CROP).unwrap().0;
        pictures.files(true, &Cancel::default()).map(|files| pictures.fingerprint(&files))
    };
    let before = print().unwrap();
    assert_eq!(before, print().unwrap());
    // One byte of the same file.
    let picture = path.path().join("03.png");
    let mut bytes = std::fs::read(&picture).unwrap();
    bytes[60] ^= 1;
    let loaded = load(path.path(), CROP).unwrap().0;
    std::fs::write(&picture, &bytes).unwrap();
    assert_ne!(loaded.fingerprint(&loaded.files(true, &Cancel::default()).unwrap()), before);
    std::fs::remove_file(&picture).unwrap();
    assert!(loaded.files(true, &Cancel::default()).unwrap_err().to_string().contains("03.png"));
}
