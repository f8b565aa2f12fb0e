//! KITTI object detection: a text file of labels for each picture.
//!
//! A line is `type truncated occluded alpha left top right bottom height width length x y z rotation_y`, with edges in pixels from 0. `alpha` and
//! everything from `height` on belong to the object in space: they must be numbers, and are not used. A line with a 16th value, a score, is what a
//! detector found; such lines are counted. <https://www.cvlibs.net/datasets/kitti/eval_object.php>
//!
//! Pictures are numbered in a random order. The folder `mapping` of the devkit says which drive each is of: line `n` of `train_mapping.txt` is
//! `date drive frame`, and the value of `train_rand.txt` for a picture is its `n`, from 1.
//!
//! Lists `ImageSets/train.txt`, `val.txt`, `trainval.txt` and `test.txt` beside `training` or `label_2` say the part of each picture.
//!
//! `DontCare` is a region whose objects have no labels. COCO knows such regions class by class: it becomes a crowd of every class.

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, FileError};

use super::builder::{Builder, Converted, Label};
use super::image_sets::{IMAGE_SETS, Named, PartList, parts_of, read_lists};
use super::kitti_tracking;
use super::tree::{Pictures, ends_with, files_below, labels_text, pictures_among, split_of};
use crate::coco::bounds::Bounds;
use crate::coco::data_set::Attribute;
use crate::coco::defect::DefectKind;
use crate::coco::error::CocoError;

/// Values of a line; detections have one more, the score.
const VALUES: [usize; 2] = [15, 16];

/// The values of a line behind the class.
const NAMES: [&str; 15] = [
    "truncated",
    "occluded",
    "alpha",
    "left",
    "top",
    "right",
    "bottom",
    "height",
    "width",
    "length",
    "x",
    "y",
    "z",
    "rotation_y",
    "score",
];

/// The class of regions without labels.
const REGION: &str = "DontCare";

/// Where the folder `mapping` may lie, beside `label_2` or beside the folder around it.
const MAPPINGS: [&str; 3] = ["mapping", "devkit_object/mapping", "devkit/mapping"];

/// A line of a file of labels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Line {
    class: String,
    truncated: f64,
    occluded: f64,
    pub bounds: Bounds,
    /// How sure a detector was; labels have none.
    score: Option<f64>,
    /// The number of the object in its film, where the labels are of tracks.
    pub track: Option<i32>,
}

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

/// The files of a folder of KITTI.
pub(super) struct Files {
    /// Files of labels.
    pub labels: Vec<PathBuf>,
    /// Files in the folder of pictures.
    pub pictures: Vec<PathBuf>,
    /// The part that the name of the folder says.
    pub split: Option<String>,
}

impl Files {
    /// Those in these folders of labels and of pictures. Fails where there are none for pictures.
    pub fn of(base: &Path, [labels, pictures]: [&str; 2], cancel: &Cancel) -> Result<Self, CocoError> {
        let labels = files_below(&base.join(labels), cancel)?.into_iter().filter(|p| ends_with(p, "txt"));
        let folder = base.join(pictures);
        if !folder.is_dir() {
            return Err(CocoError::content(&folder, "there is no such folder", "put the pictures there"));
        }
        let pictures = files_below(&folder, cancel)?;
        let split = base.file_name().and_then(|name| split_of(Path::new(name)));
        Ok(Self { labels: labels.collect(), pictures, split })
    }
}

/// Regions whose objects have no labels, with the number of their picture.
#[derive(Default)]
pub(super) struct Regions(Vec<(u64, Bounds)>);

impl Regions {
    /// Adds the object of a line, or keeps the region. `place` names the line.
    pub fn add_line(&mut self, builder: &mut Builder, image_id: u64, line: Line, place: &dyn Fn() -> String) {
        if line.class == REGION {
            self.0.push((image_id, line.bounds));
            return;
        }
        if line.score.is_some() {
            builder.defects.add(DefectKind::ScoredLabel, place);
        }
        let attributes = [
            ("truncated", Some(line.truncated)),
            ("occluded", Some(line.occluded)),
            ("score", line.score),
            ("track", line.track.map(f64::from)),
        ];
        let known = attributes.into_iter().filter_map(|(name, value)| Some((name, value?)));
        let attributes = known.map(|(name, value)| (name.to_owned(), Attribute::Number(value))).collect();
        builder.object(image_id, Label { attributes, ..Label::new(&line.class, line.bounds) });
    }

    /// Makes each region a crowd of every class.
    pub fn become_crowds(&self, builder: &mut Builder) {
        let attributes = BTreeMap::from([("region".to_owned(), Attribute::Text(REGION.to_owned()))]);
        for class in builder.class_names() {
            for (id, bounds) in &self.0 {
                let attributes = attributes.clone();
                let crowd = Label { crowd: true, ignore: true, attributes, ..Label::new(&class, *bounds) };
                builder.object(*id, crowd);
            }
        }
    }
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

fn parse_line(number: u32, line: &str) -> Result<Line, FileError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    line_of(number, line, &words)
}

/// A line whose values for detection are `words`.
pub(super) fn line_of(number: u32, line: &str, words: &[&str]) -> Result<Line, FileError> {
    if !VALUES.contains(&words.len()) {
        return Err(FileError::at_line(number, line, format!("the line has {} values", words.len()))
            .hint("give 15: type truncated occluded alpha left top right bottom height width length x y z rotation_y"));
    }
    let value = |i: usize, name: &str| -> Result<f64, FileError> {
        words[i].parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| {
            let message = format!("`{name}` is no number");
            FileError::at_line(number, words[i], message).hint("write a finite number, with a point")
        })
    };
    let mut numbers = Vec::with_capacity(NAMES.len());
    for (i, name) in (1..words.len()).zip(NAMES) {
        numbers.push(value(i, name)?);
    }
    let bounds = Bounds::between(numbers[3], numbers[4], numbers[5], numbers[6]);
    let [truncated, occluded] = [numbers[0], numbers[1]];
    let (class, score) = (words[0].to_owned(), numbers.get(14).copied());
    Ok(Line { class, truncated, occluded, bounds, score, track: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_gives_class_and_corners() {
        let line = "Car 0.25 1 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 1 2 30 -1.5";
        let found = parse_line(3, line).unwrap();
        assert_eq!(found.bounds, Bounds::from([10.5, 20.0, 100.0, 50.0]));
        assert_eq!((found.class.as_str(), found.truncated, found.occluded), ("Car", 0.25, 1.0));
        assert_eq!(found.score, None);
        assert_eq!(parse_line(3, &format!("{line} 0.875")).unwrap().score, Some(0.875));
        for (line, value, needle) in [
            ("Car 0.25 1 -1.57 10.5 20", "Car 0.25 1 -1.57 10.5 20", "has 6 values"),
            ("Car 0.25 1 -1.57 10,5 20 110.5 70 1.5 1.6 3.9 1 2 30 -1.5", "10,5", "`left` is no number"),
            ("Car 0.25 1 -1.57 10.5 20 nan 70 1.5 1.6 3.9 1 2 30 -1.5", "nan", "`right` is no number"),
            ("Car 0.25 1 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 car 2 30 -1.5", "car", "`x` is no number"),
        ] {
            let error = parse_line(3, line).unwrap_err();
            assert_eq!((error.line, error.value.as_str()), (Some(3), value));
            assert!(error.message.contains(needle) && error.hint.is_some(), "{error}");
        }
    }
}
