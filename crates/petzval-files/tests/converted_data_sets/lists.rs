//! Parts of a data set that lists of pictures name.

use petzval_base::Cancel;
use petzval_files::coco::DefectKind;
use petzval_files::coco::convert::{SourceFormat, convert};
use std::path::Path;

use super::{KITTI, VOC, write, write_png};

/// The part of each picture, `-` for none, and how many lines name a picture that is not there, or that is in two parts.
fn parts(format: SourceFormat, root: &Path) -> (String, [usize; 2]) {
    let converted = convert(format, root, None, &Cancel::default()).unwrap();
    let parts = converted.data.images.iter().map(|image| image.split.as_deref().unwrap_or("-"));
    let kinds = [DefectKind::ListedWithoutPicture, DefectKind::PictureInTwoParts];
    (parts.collect::<Vec<_>>().join(" "), kinds.map(|kind| converted.defects.count(kind)))
}

#[test]
fn parts_of_kitti_are_those_of_its_lists() {
    for base in ["training/", ""] {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for number in 0..4 {
            write(root, &format!("{base}label_2/00000{number}.txt"), KITTI);
            write_png(root, &format!("{base}image_2/00000{number}.png"), 100, 40);
        }
        let of = |lists: &[(&str, &str)]| {
            let _ = std::fs::remove_dir_all(root.join("ImageSets"));
            lists.iter().for_each(|(list, lines)| write(root, &format!("ImageSets/{list}.txt"), lines));
            let found = parts(SourceFormat::Kitti, root);
            assert_eq!(found, parts(SourceFormat::Kitti, &root.join(base)));
            found
        };
        let (train, val) = ("000000\n000001.png\n", "\"000002\"\n000009\n");
        assert_eq!(of(&[("train", train), ("val", val)]), ("train train valid -".into(), [1, 0]));
        assert_eq!(
            of(&[("trainval", "000000\n000001\n000002\n"), ("test", "000003\n000002\n")]),
            ("train train test test".into(), [0, 1])
        );
        // The pictures of `testing` have the same numbers.
        let testing = "000000\n000001\n000002\n000007\n";
        assert_eq!(
            of(&[("train", train), ("val", val), ("test", testing)]),
            ("train train valid -".into(), [1, 0])
        );
        // What a list for validation leaves out has the part of its folder.
        let rest = if base.is_empty() { "- - valid -" } else { "train train valid train" };
        assert_eq!(of(&[("val", "000002\n")]), (rest.into(), [0, 0]));
    }
}

#[test]
fn lists_of_voc_name_pictures_with_their_folders_and_in_quotes() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for name in ["cam1/f", "cam2/f", "cam2/my pic"] {
        write(root, &format!("Annotations/{name}.xml"), VOC);
        write_png(root, &format!("JPEGImages/{name}.png"), 100, 40);
    }
    write(root, "ImageSets/Main/train.txt", "cam1/f\ncam3/f\n");
    write(root, "ImageSets/Main/val.txt", "\"cam2/f\"\n\"cam2/my pic\" 1\n");
    assert_eq!(parts(SourceFormat::Voc, root), ("train valid valid".into(), [1, 0]));
    write(root, "ImageSets/Main/val.txt", "cam2\\f\ncam2/my pic\n");
    assert_eq!(parts(SourceFormat::Voc, root), ("train valid valid".into(), [1, 0]));
}

#[test]
fn parts_of_darknet_are_those_of_its_lists() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for name in ["obj_Train_data/cam/f0", "obj_Train_data/cam/f1", "obj_Validation_data/cam/f2"] {
        write(root, &format!("{name}.txt"), "0 0.5 0.5 0.2 0.1\n");
        write_png(root, &format!("{name}.png"), 100, 40);
    }
    write(root, "obj.names", "car\n");
    write(root, "Train.txt", "data/obj_Train_data/cam/f0.png\ndata\\obj_Train_data\\cam\\f1.png\n");
    write(
        root,
        "Validation.txt",
        "/home/x/obj_Validation_data/cam/f2.png\ndata/obj_Validation_data/cam/f9.png\n",
    );
    let of = |valid: &str| {
        let text = format!(
            "classes = 1\ntrain = data/Train.txt\nvalid = {valid}\nnames = data/obj.names\nbackup = backup/\n"
        );
        write(root, "obj.data", &text);
        parts(SourceFormat::Yolo, root)
    };
    assert_eq!(of("data/Validation.txt"), ("train train valid".into(), [1, 0]));
    // One list of both parts is for training. One that is not there is noted.
    assert_eq!(of("data/Train.txt"), ("train train -".into(), [0, 0]));
    assert_eq!(of("data/none.txt"), ("train train -".into(), [0, 0]));
    let converted = convert(SourceFormat::Yolo, root, None, &Cancel::default()).unwrap();
    assert_eq!(converted.defects.count(DefectKind::PartWithoutPictures), 1);
    // The names of lists say their parts where no file does; labels of a picture of such a name are no list.
    std::fs::remove_file(root.join("obj.data")).unwrap();
    assert_eq!(parts(SourceFormat::Yolo, root), ("train train valid".into(), [1, 0]));
    std::fs::remove_file(root.join("Train.txt")).unwrap();
    std::fs::remove_file(root.join("Validation.txt")).unwrap();
    write(root, "train.txt", "0 0.5 0.5 0.2 0.1\n");
    write_png(root, "train.png", 100, 40);
    assert_eq!(parts(SourceFormat::Yolo, root), ("- - - -".into(), [0, 0]));
}
