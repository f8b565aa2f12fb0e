//! Reading any bytes as a data set ends soon and without a panic, with a data set or with an error.
//!
//! COCO files are read 5000 times and other labels 1000 times; `PETZVAL_MUTATIONS=1000000` makes it a million and fifty thousand.

use petzval_base::Cancel;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use petzval_files::coco::convert::{SourceFormat, convert};
use petzval_files::coco::{Defects, check_values, coco_bytes, parse_coco};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const COCO: &[u8] = br#"{"info": {"a": 1}, "images": [{"id": 1, "file_name": "a.png", "width": 40, "height": 30}],
"categories": [{"id": 1, "name": "light"}, {"id": 2, "name": "car"}], "annotations": [
{"id": 1, "image_id": 1, "category_id": 1, "bbox": [1.5, 2, 10, 20], "area": 200, "iscrowd": 0, "attributes": {"state": "red"}},
{"id": 2, "image_id": 1, "category_id": 2, "bbox": [0, 0, 40, 30], "area": 1100.25, "iscrowd": 1, "ignore": 1}]}"#;
const KITTI: &[u8] = b"Car 0.25 1 -1.57 10.5 20.0 40.5 32.0 1.5 1.6 3.9 1 2 30 -1.5\nDontCare -1 -1 -10 7 1 9 8 -1 -1 -1 -1000 -1000 -1000 -10\n";
const TRACKS: &[u8] = b"0 3 Car 0 1 -1.57 10.5 20.0 30.5 25.0 1.5 1.6 3.9 1 2 30 -1.5\n0 -1 DontCare -1 -1 -10 7 1 9 8 -1 -1 -1 -1000 -1000 -1000 -10\n";
const BDD: &[u8] = br#"[{"name": "a.png", "labels": [{"category": "traffic light", "attributes": {"trafficLightColor": "red"},
"box2d": {"x1": 10, "y1": 5, "x2": 14.5, "y2": 15}}]}, {"name": "b.png", "labels": null}]"#;
const YOLO: &[u8] = b"0 0.5 0.5 0.1 0.2\n1 0.1 0.1 0.2 0.1 0.2 0.2\n";
const YAML: &[u8] = b"train: ../train/images\nnc: 2\nnames:\n  0: green\n  1: 'red'\n";
const VOC: &[u8] = b"<annotation><size><width>40</width><height>30</height></size><object><name>car</name><difficult>1</difficult>
<bndbox><xmin>1</xmin><ymin>2</ymin><xmax>30</xmax><ymax>20</ymax></bndbox></object></annotation>";

/// Pieces that mutations insert, so that many mutated files are still readable.
const PIECES: &[&str] = &[
    "0",
    "-1",
    "NaN",
    "-Infinity",
    "1e999",
    "1e308",
    "-0.0",
    "18446744073709551615",
    "null",
    "true",
    "\"",
    "\\",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "\"id\": 1,",
    "\"bbox\": [1, 2, 3, 4],",
    "<",
    ">",
    "&",
    "</object>",
    "<object>",
    "\n",
    "\t",
    " ",
    "\u{feff}",
    "\u{0}",
    "&a",
    "*a",
    "- ",
    "9999999999",
    "0.5",
    "1.7976931348623157e308",
    "é",
];

fn mutated(text: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = text.to_vec();
    for _ in 0..random.random_range(1..4) {
        let at = random.random_range(0..=bytes.len());
        let end = (at + random.random_range(0..12)).min(bytes.len());
        match random.random_range(0..6) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..end)),
            2 if at < bytes.len() => bytes[at] = random.random_range(0..=255),
            3 => {
                let copy = bytes[at..end].to_vec();
                let to = random.random_range(0..=bytes.len());
                bytes.splice(to..to, copy);
            }
            4 => {
                let piece = PIECES[random.random_range(0..PIECES.len())];
                bytes.splice(at..end, piece.bytes());
            }
            _ => {
                let piece = PIECES[random.random_range(0..PIECES.len())];
                bytes.splice(at..at, piece.bytes());
            }
        }
    }
    bytes
}

fn mutations() -> usize {
    std::env::var("PETZVAL_MUTATIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(5000)
}

/// Reads mutations of a text; the share that is read without an error.
fn read_mutations(name: &str, text: &[u8], mutations: usize, read: impl Fn(&[u8]) -> bool) {
    assert!(read(text), "{name} itself is read");
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut good = 0;
    for _ in 0..mutations {
        let bytes = mutated(text, &mut random);
        match catch_unwind(AssertUnwindSafe(|| read(&bytes))) {
            Ok(is_good) => good += usize::from(is_good),
            Err(_) => panic!("{name}: a panic at\n{}", String::from_utf8_lossy(&bytes)),
        }
    }
    println!("{name}: {good} of {mutations} mutations are read");
    assert!(good > 0 && good < mutations);
}

#[test]
fn mutated_annotations_are_read_or_refused() {
    read_mutations("COCO", COCO, mutations(), |bytes| {
        let mut defects = Defects::default();
        let Ok(mut data) = parse_coco(bytes.to_vec(), &mut defects) else { return false };
        check_values(&mut data, &mut defects);
        // What is left can be used: it is read again as it is, without errors. Boxes are written as they were clipped.
        data.annotations.iter_mut().for_each(|annotation| annotation.unclipped = None);
        let mut later = Defects::default();
        let mut again = parse_coco(coco_bytes(&data), &mut later).unwrap();
        check_values(&mut again, &mut later);
        assert_eq!((later.errors(), &again.annotations), (0, &data.annotations), "{later:?}");
        true
    });
}

#[test]
fn mutated_labels_are_read_or_refused() {
    for (name, format, labels, text, more) in [
        ("KITTI", SourceFormat::Kitti, "label_2/a.txt", KITTI, None),
        ("tracks of KITTI", SourceFormat::Kitti, "label_02/0.txt", TRACKS, None),
        ("BDD100K", SourceFormat::Bdd100k, "labels/a.json", BDD, None),
        ("YOLO", SourceFormat::Yolo, "labels/a.txt", YOLO, Some(("data.yaml", YAML))),
        ("names of YOLO", SourceFormat::Yolo, "data.yaml", YAML, Some(("labels/a.txt", YOLO))),
        ("Pascal VOC", SourceFormat::Voc, "Annotations/a.xml", VOC, None),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let write = |name: &str, bytes: &[u8]| {
            let path = root.join(name);
            std::fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).unwrap();
            std::fs::write(path, bytes).unwrap();
        };
        for picture in ["image_2/a.png", "image_02/0/0.png", "images/a.png"] {
            let path = root.join(picture);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            image::RgbImage::new(40, 30).save(path).unwrap();
        }
        if let Some((name, bytes)) = more {
            write(name, bytes);
        }
        read_mutations(name, text, (mutations() / 5).min(50_000), |bytes| {
            write(labels, bytes);
            convert(format, root, None, &Cancel::default()).is_ok()
        });
    }
}
