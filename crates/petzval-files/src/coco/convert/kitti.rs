//! KITTI object detection: a text file of labels for each picture.
//!
//! A line is `type truncated occluded alpha left top right bottom height width length x y z rotation_y`, with edges in pixels from 0. `alpha` and
//! everything from `height` on belong to the object in space: they must be numbers, and are not used. `truncated` is a share, `occluded` 0, 1, 2 or 3,
//! and both are -1 where they are not known. A line with a 16th value, a score, is what a
//! detector found; such lines are counted. <https://www.cvlibs.net/datasets/kitti/eval_object.php>
//!
//! Pictures are numbered in a random order. The folder `mapping` of the devkit says which drive each is of: line `n` of `train_mapping.txt` is
//! `date drive frame`, and the value of `train_rand.txt` for a picture is its `n`, from 1.
//!
//! Lists `ImageSets/train.txt`, `val.txt`, `trainval.txt` and `test.txt` beside `training` or `label_2` say the part of each picture.
//!
//! `DontCare` is a region whose objects have no labels. COCO knows such regions class by class: it becomes a crowd of every class.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::Cancel;

use super::builder::{Builder, Converted};
use super::image_sets::{IMAGE_SETS, Named, PartList, parts_of, read_lists};
use super::kitti_lines::{Files, Regions, parse_line};
use super::kitti_tracking;
use super::tree::{Pictures, files_below, labels_text, pictures_among};
use crate::coco::error::CocoError;

/// Where the folder `mapping` may lie, beside `label_2` or beside the folder around it.
const MAPPINGS: [&str; 3] = ["mapping", "devkit_object/mapping", "devkit/mapping"];

/// Reads a folder with `label_2/*.txt` and `image_2/`, or the folder `training` around it; where there is `label_02`, as the [tracking](kitti_tracking)
/// benchmark.
pub(super) fn convert(root: &Path, turned: Option<bool>, cancel: &Cancel) -> Result<Converted, CocoError> {
    let with = |labels: &str| {
        [root.to_owned(), root.join("training")].into_iter().find(|base| base.join(labels).is_dir())
    };
    let Some(base) = with("label_2") else {
        if let Some(base) = with(kitti_tracking::LABELS) {
            return kitti_tracking::convert(&base, turned, cancel);
        }
        let hint = "name the folder that holds `label_2` and `image_2` (tracking: `label_02` and `image_02`), or the one that holds `training`";
        return Err(CocoError::content(root, "there is no folder `label_2`", hint));
    };
    let Files { labels, pictures: files, split } = Files::of(&base, ["label_2", "image_2"], cancel)?;
    let pictures = Pictures::among(&base, &files);

    let drives = drives(&base)?;
    let mut builder = Builder::new(turned);
    let named = Named::among(pictures_among(&files).chain(labels.iter().map(PathBuf::as_path)));
    let lists = lists(&base, split.is_some(), &named, cancel)?;
    // Pictures that a list for training leaves out are not trained on, though their folder is called so.
    let split = split.filter(|_| lists.iter().all(|list| list.part != "train"));
    let parts = parts_of(lists, &mut builder.defects);
    let mut regions = Regions::default();
    for path in &labels {
        cancel.check()?;
        let text = labels_text(path)?;
        let stem = path.file_stem().unwrap_or(OsStr::new(""));
        let found = pictures.by_stem(stem, path, Path::new(""));
        let place = || format!("no picture for {}", path.display());
        let Some(picture) = found.noted(&place, &mut builder.defects) else { continue };
        let listed =
            [path.as_path(), picture].into_iter().find_map(|file| parts.get(file)).map(str::to_owned);
        let part = listed.or_else(|| split.clone());
        let Some(image) = builder.picture(&base, picture, part) else { continue };
        let id = image.id;
        let number = path.file_stem().and_then(|stem| stem.to_str()?.parse::<usize>().ok());
        image.sequence = number.and_then(|number| drives.get(number).cloned());
        for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
            if let Some(line) = builder.understood(path, parse_line(number, line)) {
                regions.add_line(&mut builder, id, line, &|| format!("{}: line {number}", path.display()));
            }
        }
    }
    builder.note_unlabelled(pictures_among(&files));
    regions.become_crowds(&mut builder);
    builder.finish("KITTI")
}

/// The lists of parts beside the labels, or beside the folder of the part around them.
fn lists<'f>(
    base: &Path,
    is_of_part: bool,
    named: &Named<'f>,
    cancel: &Cancel,
) -> Result<Vec<PartList<'f>>, CocoError> {
    let around = base.parent().filter(|_| is_of_part);
    let mut folders = [Some(base), around].into_iter().flatten().map(|place| place.join(IMAGE_SETS));
    let Some(folder) = folders.find(|folder| folder.is_dir()) else { return Ok(Vec::new()) };
    let files = files_below(&folder, cancel)?;
    let paths = files.iter().map(PathBuf::as_path).filter(|path| path.parent() == Some(&*folder));
    let mut lists = read_lists(paths, named)?;
    // KITTI numbers the pictures of `testing`, which have no labels, from 0 as well. So is a list for tests whose pictures are all in other lists.
    let has_testing = around.is_some_and(|around| around.join("testing").is_dir());
    let is_for_tests = |list: &PartList| list.part == "test";
    let others: HashSet<&Path> =
        lists.iter().filter(|list| !is_for_tests(list)).flat_map(PartList::files).collect();
    let is_in_others =
        |list: &PartList| list.files().next().is_some() && list.files().all(|file| others.contains(file));
    let is_of_testing = |list: &PartList| has_testing || is_in_others(list);
    lists.retain(|list| !is_for_tests(list) || !is_of_testing(list));
    Ok(lists)
}

/// The drive of each picture, by its number; empty where the devkit does not lie beside the labels.
fn drives(base: &Path) -> Result<Vec<String>, CocoError> {
    let places = [Some(base), base.parent()].into_iter().flatten();
    let mut folders = places.flat_map(|place| MAPPINGS.map(|name| place.join(name)));
    let Some(folder) = folders.find(|folder| folder.join("train_mapping.txt").is_file()) else {
        return Ok(Vec::new());
    };
    let lines = labels_text(&folder.join("train_mapping.txt"))?;
    let lines: Vec<&str> = lines.lines().collect();
    let path = folder.join("train_rand.txt");
    let order = labels_text(&path)?;
    let values = order.split([',', ' ', '\t', '\r', '\n']).filter(|value| !value.is_empty());
    let drive = |value: &str| {
        let line = value.parse::<usize>().ok().and_then(|n| lines.get(n.checked_sub(1)?));
        let drive = line.and_then(|line| line.split_whitespace().nth(1));
        drive.map(str::to_owned).ok_or_else(|| {
            let reason = format!("`{value}` is not the number of a line of train_mapping.txt with a drive");
            CocoError::content(&path, reason, "put the folder `mapping` of the devkit there as it was loaded")
        })
    };
    values.map(drive).collect()
}
