//! Names of pictures that are not those of their files: of other systems, of other machines, addresses.

use petzval_base::Cancel;
use petzval_files::coco::{DefectKind, Loaded, check_pictures, load_coco};
use serde_json::json;
use std::path::Path;

use super::write_png;

/// Writes annotations of pictures with these names, one object in each.
fn write_annotations(file: &Path, names: &[&str]) {
    let images =
        (1..).zip(names).map(|(id, name)| json!({"id": id, "file_name": name, "width": 40, "height": 30}));
    let objects = (1..=names.len())
        .map(|id| json!({"id": id, "image_id": id, "category_id": 1, "bbox": [1, 2, 10, 20], "area": 200}));
    let text = json!({
        "images": images.collect::<Vec<_>>(),
        "categories": [{"id": 1, "name": "car"}],
        "annotations": objects.collect::<Vec<_>>(),
    });
    std::fs::create_dir_all(file.parent().unwrap()).unwrap();
    std::fs::write(file, text.to_string()).unwrap();
}

/// The data set of a folder and the names of its pictures, which are all there.
fn checked(root: &Path) -> (Loaded, Vec<String>) {
    let mut loaded = load_coco(root, &Cancel::default()).unwrap();
    check_pictures(&mut loaded, &|_| Ok(())).unwrap();
    let names = loaded.data.images.iter().map(|image| image.file_name.clone()).collect();
    (loaded, names)
}

#[test]
fn the_only_picture_that_a_name_can_mean_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for name in ["my pic.png", "\u{e4}.png", "w.png", "abc.png", "url.png", "film/a.png"] {
        write_png(&root.join("images").join(name), 40, 30);
    }
    // A file system that does not distinguish capitals finds it by either name.
    write_png(&root.join("images/UP.png"), 40, 30);
    let names = [
        "my%20pic.png",
        "a\u{308}.png",
        r"C:\data\images\w.png",
        "/data/upload/1/abc.png",
        "https://x.y/z/url.png?size=3",
        "/home/x/film/a.PNG",
        "UP.PNG",
    ];
    write_annotations(&root.join("annotations.json"), &names);
    let (loaded, found) = checked(root);
    assert_eq!((found.len(), loaded.defects.errors()), (names.len(), 0), "{:?}", loaded.defects);
    let noted = loaded.defects.iter().find(|d| d.kind == DefectKind::OtherFileName).unwrap();
    assert_eq!(
        (found[0].as_str(), noted.first[0].as_str()),
        ("images/my pic.png", "my%20pic.png: images/my pic.png")
    );
    assert!(noted.count >= 5, "{noted:?}");
    if cfg!(target_os = "linux") {
        assert_eq!(noted.count, names.len());
    }
}

#[test]
fn a_name_is_never_guessed_between_two_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for name in ["images/both.png", "both.png", "images/one.png", "images/film/two.png", "images/three.png"] {
        write_png(&root.join(name), 40, 30);
    }
    // One name of two files, two names of one file, and relative paths into folders that are not there.
    let names = ["/x/both.png", "/x/one.png", "/y/one.png", "other/two.png", "other/three.png"];
    write_annotations(&root.join("annotations.json"), &names);
    let (loaded, found) = checked(root);
    assert!(found.is_empty(), "{found:?}");
    assert_eq!(loaded.defects.count(DefectKind::MissingPicture), names.len());
    // More of a path decides.
    write_annotations(&root.join("annotations.json"), &["/x/images/both.png"]);
    assert_eq!(checked(root).1, ["images/both.png"]);
}

#[test]
fn other_spellings_are_taken_in_each_part() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for part in ["train", "valid"] {
        write_annotations(&root.join(part).join("_annotations.coco.json"), &["/x/a.png"]);
        write_png(&root.join(part).join("a.png"), 40, 30);
    }
    let (loaded, found) = checked(root);
    assert_eq!(found, ["train/a.png", "valid/a.png"]);
    assert_eq!(loaded.defects.count(DefectKind::OtherFileName), 2);
}

#[test]
fn one_file_in_several_spellings_is_one_picture() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_png(&root.join("images/x.png"), 40, 30);
    write_png(&root.join("images/film/y.png"), 41, 30);
    let names = ["images/x.png", "./images/x.png", "images/film/../x.png", "x.png"];
    write_annotations(&root.join("annotations.json"), &names);
    let (loaded, found) = checked(root);
    assert_eq!(found, ["images/x.png"; 4]);
    let noted = loaded.defects.iter().find(|d| d.kind == DefectKind::RepeatedFile).unwrap();
    assert_eq!((noted.count, loaded.defects.count(DefectKind::SamePicture)), (3, 0));
    assert_eq!(noted.first[1], "images/x.png and images/film/../x.png");
}

#[test]
fn one_file_of_two_parts_is_found_in_any_spelling() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_annotations(&root.join("train/_annotations.coco.json"), &["x.png"]);
    write_annotations(&root.join("valid/_annotations.coco.json"), &["../train/x.png"]);
    write_png(&root.join("train/x.png"), 40, 30);
    let (loaded, found) = checked(root);
    assert_eq!(found, ["train/x.png"; 2]);
    let noted = loaded.defects.iter().find(|d| d.kind == DefectKind::RepeatedFile).unwrap();
    assert_eq!(noted.first, ["train/x.png and valid/../train/x.png"]);
}
