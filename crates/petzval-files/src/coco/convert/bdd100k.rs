//! BDD100K: JSON files with a list of pictures, each with `labels[].box2d`; also the older files of one picture each.
//!
//! <https://doc.bdd100k.com/format.html>. `x1`, `y1`, `x2` and `y2` are the first and the last pixels of a box, from 0: it is `x2 - x1 + 1` wide, as in
//! Scalabel, the data set's own converter. Lanes and drivable areas without `box2d` are left out and counted, and so are lists that have no
//! other labels: their pictures are no background. Another label without a box is an error of its own. A file of one picture has all labels
//! of it. A folder of the name of a film has its pictures. Frames of several times or films by the name of
//! one picture are an error; other entries of a picture in a list are noted, and their labels come together. The colour of a traffic light becomes the attribute `state`: `red`, `yellow` and `green`, or `R`, `Y` and `G`. Objects with `crowd` or `ignored` are crowds. A stated `size` is that of the picture. Labels of whole
//! pictures, such as the weather, are not read. The attribute `rotation` is that of CVAT: degrees about the middle of the box. An angle within `box2d`
//! has no known unit and is an error.

use std::collections::{BTreeMap, HashMap};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::{Cancel, FileError};
use serde::Deserialize;

use super::builder::{Builder, Converted, Label};
use super::tree::{Pictures, ends_with, files_below, pictures_among, split_of};
use crate::coco::bounded::read_bounded;
use crate::coco::bounds::Bounds;
use crate::coco::data_set::Attribute;
use crate::coco::defect::DefectKind;
use crate::coco::error::CocoError;
use crate::coco::folder::LARGEST_ANNOTATIONS;
use crate::coco::loose::{Fields, Loose, Record, Wrong};
use crate::coco::read::{json_error, plain_json};
use crate::coco::rotation::{
    NO_UNIT, UNIT_HINT, is_angle, is_rotation, is_zero, take_rotation_deg, unread_angles,
};

/// A file: a list of pictures, or a table with one (`frames`).
enum Contents {
    List(Vec<Record<Picture>>),
    Table(Table),
}

#[derive(Deserialize)]
struct Table {
    /// In older files, the picture to which the frames belong.
    name: Option<String>,
    frames: Vec<Record<Picture>>,
}

#[derive(Deserialize)]
struct Picture {
    #[serde(default)]
    name: Loose,
    #[serde(default, alias = "videoName", alias = "video_name")]
    video: Loose,
    #[serde(default)]
    attributes: Loose,
    /// When it was taken: the number of the frame, or a time.
    #[serde(default, alias = "frame_index")]
    #[serde(rename = "frameIndex")]
    frame: Loose,
    #[serde(default)]
    timestamp: Loose,
    /// Scalabel states the size of the picture here.
    size: Option<Record<Size>>,
    /// `objects` in older files.
    #[serde(default, alias = "objects")]
    labels: Option<Vec<Record<Object>>>,
}

#[derive(Deserialize)]
struct Object {
    #[serde(default)]
    category: Loose,
    box2d: Option<Record<Corners>>,
    #[serde(default)]
    attributes: Option<BTreeMap<String, Loose>>,
    #[serde(default)]
    score: Loose,
    #[serde(default)]
    crowd: Loose,
    #[serde(default)]
    ignored: Loose,
    #[serde(skip)]
    unread: Vec<String>,
}

impl Object {
    /// Whether it is a lane or a drivable area, as newer and older files name them, without a box.
    fn is_lane_or_area(&self) -> bool {
        let name = self.category.text().unwrap_or("").to_lowercase();
        let is_named = ["lane", "area", "drivable"].iter().any(|word| name.starts_with(word));
        is_named && self.box2d.is_none()
    }
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Corners {
    x1: Loose,
    y1: Loose,
    x2: Loose,
    y2: Loose,
    #[serde(flatten)]
    others: BTreeMap<String, Loose>,
}

#[derive(Deserialize)]
struct Size {
    #[serde(default)]
    width: Loose,
    #[serde(default)]
    height: Loose,
}

impl Fields for Picture {}
impl Fields for Size {}

impl Fields for Object {
    const KNOWN: Option<&'static [&'static str]> = Some(&[
        "category",
        "box2d",
        "attributes",
        "score",
        "crowd",
        "ignored",
        "id",
        "index",
        "manualShape",
        "manualAttributes",
        "box3d",
        "poly2d",
        "rle",
        "graph",
    ]);

    fn set_unread(&mut self, fields: Vec<String>) {
        self.unread = fields;
    }
}

impl Fields for Corners {}

/// Reads a JSON file, or all of those below a folder. Pictures are looked for by name below the folder.
pub(super) fn convert(root: &Path, turned: Option<bool>, cancel: &Cancel) -> Result<Converted, CocoError> {
    // A single file has its pictures beside it or in the folders around.
    let (labels, base) = if root.is_dir() {
        (files_below(root, cancel)?.into_iter().filter(|p| ends_with(p, "json")).collect(), root.to_owned())
    } else {
        (vec![root.to_owned()], folder_around(root))
    };
    if labels.is_empty() {
        let hint = "name the folder that holds `labels` and `images`";
        return Err(CocoError::content(root, "there is no JSON file", hint));
    }
    let files = files_below(&base, cancel)?;
    let by_names = Pictures::among(&base, &files);
    let mut builder = Builder::new(turned);
    for path in &labels {
        cancel.check()?;
        let (pictures, is_list) = pictures_of(path)?;
        if is_list && is_of_lanes(&pictures) {
            builder.defects.add(DefectKind::FileWithoutBoxes, || path.display().to_string());
            continue;
        }
        // The time of the first entry of each picture of this file.
        let mut times: HashMap<u64, [Loose; 2]> = HashMap::new();
        for (place, picture) in (0..).zip(pictures) {
            cancel.check()?;
            let Some(picture) = builder.understood(path, table("frames", &picture)) else { continue };
            let wanted = "the name of the file of the picture";
            let name = picture.name.text().map_err(|wrong| wrong_value("name", &wrong, wanted));
            let Some(name) = builder.understood(path, name).map(str::to_owned) else { continue };
            // Frames of two films may have one name. Each film then has a folder.
            let video = picture.video.name().unwrap_or(None);
            let in_video = video.as_ref().map(|video| Path::new(video).join(&name));
            let in_video = in_video.filter(|stated| by_names.has(stated));
            let stated = in_video.unwrap_or_else(|| PathBuf::from(&name));
            // Older files leave the ending out.
            let short = stated.file_name().unwrap_or(OsStr::new(""));
            let found = by_names.by_name(path, &stated).or(|| by_names.by_stem(short, path, &stated));
            let Some(file) = found.noted(&|| name.clone(), &mut builder.defects) else { continue };
            let split = split_of(file.strip_prefix(&base).unwrap_or(file));
            let Some(image) = builder.picture(&base, file, split) else { continue };
            let is_of_other_film = match (&image.sequence, &video) {
                (Some(first), Some(video)) => first != video,
                _ => false,
            };
            if let Some(video) = video {
                image.sequence = Some(video);
            }
            let id = image.id;
            // The frames of a table are of different times, the entries of a list where they say so.
            let time = if is_list {
                [picture.frame.clone(), picture.timestamp.clone()]
            } else {
                [Loose::Whole(place), Loose::Absent]
            };
            let first = times.insert(id, time.clone());
            let are_other = |(a, b): (&Loose, &Loose)| ![a, b].contains(&&Loose::Absent) && a != b;
            let is_of_other_time = first.as_ref().is_some_and(|first| first.iter().zip(&time).any(are_other));
            let said = || format!("{}: {name}: {}", path.display(), file.display());
            if first.is_some() && (is_of_other_film || is_of_other_time) {
                builder.defects.add(DefectKind::SeveralTimes, said);
                builder.leave_out(id);
            } else if first.is_some() {
                builder.defects.add(DefectKind::RepeatedFile, said);
            }
            let of_picture = |error: FileError| FileError { key: format!("{name}: {}", error.key), ..error };
            let size = picture.size.as_ref().map(pixels).transpose().map_err(of_picture);
            if let Some(size) = builder.understood(path, size).flatten() {
                builder.stated(id, size);
            }
            if picture.attributes != Loose::Absent {
                builder.unread("attributes of a picture");
            }
            for (i, object) in picture.labels.iter().flatten().enumerate() {
                let place = || format!("{name}: labels[{i}]");
                match label(object, &place, &mut builder) {
                    Ok(Some(label)) => builder.object(id, label),
                    Ok(None) => {
                        if !object.table().is_some_and(Object::is_lane_or_area) {
                            builder.lose_label(id);
                        }
                    }
                    Err(error) => {
                        let key = format!("{name}: labels[{i}].{}", error.key);
                        builder.wrong(path, FileError { key, ..error });
                    }
                }
            }
        }
    }
    builder.note_unlabelled(pictures_among(&files));
    builder.finish("BDD100K")
}

/// The folder in which the pictures of a file of labels are: the one above `labels`, or the file's own.
fn folder_around(file: &Path) -> PathBuf {
    let is_labels = |folder: &&Path| folder.file_name() == Some(OsStr::new("labels"));
    let own = file.parent().unwrap_or(Path::new(""));
    let above = file.ancestors().skip(1).find(is_labels).and_then(Path::parent);
    let folder = above.unwrap_or(own);
    if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() }
}

/// The pictures of a file, and whether it is a list of them.
fn pictures_of(path: &Path) -> Result<(Vec<Record<Picture>>, bool), CocoError> {
    let hint = "lanes and areas (`poly2d`) are not used and may be left out; or split the file";
    let bytes = plain_json(read_bounded(path, LARGEST_ANNOTATIONS, hint)?);
    let start = bytes.iter().find(|b| !b.is_ascii_whitespace());
    // Choose by the first character: an error then has its place.
    let contents = match start {
        Some(b'{') => serde_json::from_slice(&bytes).map(Contents::Table),
        _ => serde_json::from_slice(&bytes).map(Contents::List),
    };
    let contents = contents.map_err(|e| {
        let hint = "a BDD100K file is a list of {name, labels: [{category, box2d: {x1, y1, x2, y2}}]}";
        let error = json_error(&bytes, &e);
        CocoError::file(path, if e.is_data() { error.hint(hint) } else { error })
    })?;
    Ok(match contents {
        Contents::List(pictures) => (pictures, true),
        Contents::Table(Table { name, mut frames }) => {
            for frame in &mut frames {
                if let Record::Table(Picture { name: missing @ Loose::Absent, .. }) = frame {
                    *missing = name.clone().map_or(Loose::Absent, Loose::Text);
                }
            }
            (frames, false)
        }
    })
}

/// True if a file labels only lanes and areas, and so no objects.
fn is_of_lanes(pictures: &[Record<Picture>]) -> bool {
    let labels = pictures.iter().filter_map(|picture| picture.table()?.labels.as_ref());
    let mut labels = labels.flatten().peekable();
    labels.peek().is_some() && labels.all(|label| label.table().is_some_and(Object::is_lane_or_area))
}

/// The stated size of a picture, columns and rows, px.
fn pixels(size: &Record<Size>) -> Result<(u32, u32), FileError> {
    let size = table("size", size)?;
    let side = |value: &Loose, name: &str| {
        let whole = value.whole().and_then(|n| u32::try_from(n).map_err(|_| Wrong::Type(n.to_string())));
        whole.map_err(|wrong| wrong_value(&format!("size.{name}"), &wrong, "a whole number of pixels"))
    };
    Ok((side(&size.width, "width")?, side(&size.height, "height")?))
}

/// The label of an object; `None`, which is noted, if it has no box.
fn label<'a>(
    object: &'a Record<Object>,
    place: &dyn Fn() -> String,
    builder: &mut Builder,
) -> Result<Option<Label<'a>>, FileError> {
    let object = table("", object)?;
    let Some(corners) = &object.box2d else {
        let kind =
            if object.is_lane_or_area() { DefectKind::LaneOrArea } else { DefectKind::LabelWithoutBox };
        builder.defects.add(kind, || format!("{}, category {}: no `box2d`", place(), object.category));
        return Ok(None);
    };
    let corners = table("box2d", corners)?;
    note_unread(object, corners, builder)?;
    let class =
        object.category.text().map_err(|wrong| wrong_value("category", &wrong, "the name of the class"))?;
    let value = |value: &Loose, name: &str| {
        value.number().map_err(|wrong| wrong_value(&format!("box2d.{name}"), &wrong, "a number of pixels"))
    };
    let [left, top] = [value(&corners.x1, "x1")?, value(&corners.y1, "y1")?];
    let [right, bottom] = [value(&corners.x2, "x2")?, value(&corners.y2, "y2")?];
    // The last pixel belongs to the box. Scalabel adds it to labels of every release, also to fractions of pixels.
    let mut label = Label::new(class, Bounds::between(left, top, right + 1.0, bottom + 1.0));
    for name in unread_angles(object.attributes.iter().flatten()) {
        builder.unread(&format!("labels[].attributes.{name}"));
    }
    for (name, value) in object.attributes.iter().flatten() {
        let value = match value {
            Loose::Absent => continue,
            Loose::Text(colour) if name == "trafficLightColor" => {
                if let Some(state) = state(colour) {
                    label.attributes.insert("state".to_owned(), Attribute::Text(state));
                }
                continue;
            }
            // No text is no state; the check of values counts it.
            value if name == "trafficLightColor" => {
                label.attributes.insert("state".to_owned(), Attribute::Text(value.to_string()));
                continue;
            }
            Loose::Flag(flag) => Attribute::Flag(*flag),
            Loose::Text(text) => Attribute::Text(text.clone()),
            value => match value.number() {
                Ok(number) => Attribute::Number(number),
                Err(wrong) if is_rotation(name) => return Err(wrong_rotation(&wrong)),
                Err(_) => {
                    builder
                        .defects
                        .add(DefectKind::LooseAttribute, || format!("{}: {name} is {value}", place()));
                    continue;
                }
            },
        };
        // Scalabel judges neither crowds nor what is ignored: both are crowds in its files in COCO format.
        let is_said = matches!(value, Attribute::Flag(true) | Attribute::Number(1.0));
        let is_ignored = is_said && name.eq_ignore_ascii_case("ignored");
        label.crowd |= is_ignored || is_said && name.eq_ignore_ascii_case("crowd");
        label.ignore |= is_ignored;
        label.attributes.insert(name.clone(), value);
    }
    let rotation_deg = take_rotation_deg(&mut label.attributes);
    if let Some(degrees) = rotation_deg.map_err(|value| wrong_rotation(&Wrong::Type(value)))? {
        let (bounds, around) = (label.bounds, label.bounds.around_rotated(degrees.to_radians()));
        builder.defects.add(DefectKind::RotatedBox, || {
            format!("{}: {bounds} by {degrees} degrees becomes {around}", place())
        });
        label.bounds = around;
    }
    let flag =
        |value: &Loose, name: &str| value.flag().map_err(|wrong| wrong_value(name, &wrong, "true or false"));
    let is_ignored = flag(&object.ignored, "ignored")?;
    label.crowd |= is_ignored || flag(&object.crowd, "crowd")?;
    label.ignore |= is_ignored;
    if object.score != Loose::Absent {
        builder.defects.add(DefectKind::ScoredLabel, || format!("{}: score {}", place(), object.score));
    }
    Ok(Some(label))
}

/// Counts the fields of an object and its box that are not read. Fails where the box has an angle, in a unit that nothing states.
fn note_unread(object: &Object, corners: &Corners, builder: &mut Builder) -> Result<(), FileError> {
    for (name, value) in &corners.others {
        if is_angle(name) && !is_zero(value) {
            let error = FileError::at_line(0, &value.to_string(), NO_UNIT).hint(UNIT_HINT);
            return Err(FileError { key: format!("box2d.{name}"), ..error });
        }
        builder.unread(&format!("labels[].box2d.{name}"));
    }
    object.unread.iter().for_each(|name| builder.unread(&format!("labels[].{name}")));
    Ok(())
}

fn wrong_rotation(wrong: &Wrong) -> FileError {
    wrong_value("attributes.rotation", wrong, "one number of degrees")
}

/// The state that the colour of a traffic light stands for. `none` and `NA` are given to lights whose state is not seen, and to everything that
/// is no traffic light. A word that is not known stays as it is, so that the check of values counts it.
fn state(colour: &str) -> Option<String> {
    let state = match colour.to_lowercase().as_str() {
        "none" | "na" | "" => return None,
        "r" => "red",
        "y" => "yellow",
        "g" => "green",
        word => return Some(word.to_owned()),
    };
    Some(state.to_owned())
}

fn table<'a, T>(key: &str, record: &'a Record<T>) -> Result<&'a T, FileError> {
    match record {
        Record::Table(record) => Ok(record),
        Record::Other(found) => Err(wrong_value(key, &Wrong::Type(found.to_string()), "a table")),
    }
}

fn wrong_value(key: &str, wrong: &Wrong, wanted: &str) -> FileError {
    let (value, message) = match wrong {
        Wrong::Absent => ("", "the value is missing"),
        Wrong::Type(value) => (value.as_str(), "this is of the wrong type"),
        Wrong::NotFinite(value) => (value.as_str(), "this is no finite number"),
        Wrong::Unlisted(value) => (value.as_str(), "this is not listed"),
    };
    let error = FileError::at_line(0, "", message).hint(format!("write {wanted}"));
    FileError { key: key.to_owned(), value: value.to_owned(), ..error }
}
