//! `detect`: what a detector finds in pictures.

mod finder;
mod scores;

use std::collections::{BTreeSet, HashSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_camera::image::LinearImage;
use petzval_design::camera::Camera;
use petzval_design::error::DesignError;
use petzval_design::task::objects::boxes::with_boxes;
use petzval_files::coco::{
    self, ANNOTATIONS, Annotation, Bounds, Category, DataSet, Image, load_coco, save_coco, save_results,
};
use petzval_files::{CheckedPictures, PICTURE_ENDINGS, encoded_png_bytes, is_picture_turned};
use petzval_learn::dataset::{Judged, List, PictureFile, in_classes, own_categories, taken_as};
use petzval_learn::detection::{Detection, detect_in};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use finder::{Found, ObjectFinder, Source, Weights};
pub use petzval_learn::detection::BackboneKind;
pub use petzval_learn::score::detection::CocoSummary;
pub use scores::{ClassScore, Pycocotools, Scores};

use finder::{Finder, finder};

use crate::apply::{developed, is_raw, raw_frame};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::data::check_pictures_in;
use crate::error::{JobError, Result, Stopped, make_folder, write_file};
use crate::event::WarningKind;
use crate::noted_pictures::NotedPictures;
use crate::range::check_ranges;
use crate::results::check_folder;

petzval_base::parameters! {
    /// Pictures to look at, and the detector.
    pub struct Request {
        /// Least score of a detection, 0..1.
        least_score: f32 = 0.5, "", 0..1, Linear, "0 shows everything that the detector keeps, 0.5 what is more likely there than not";
    }
    also {
        /// Pictures, and folders of pictures; for the camera of a run also raw frames, which it develops: DNG files, and files with a sidecar.
        images: Vec<PathBuf> = Vec::new();
        /// In place of `images`: a data set in COCO format, in all of whose pictures is looked, and with whose objects is compared.
        data: Option<PathBuf> = None;
        /// The part of the data set that is looked at, such as `valid`; all of it if none is named.
        part: Option<String> = None;
        /// Where the detector comes from.
        detector: Source = Source::default();
        /// Folder for results and drawn pictures.
        out: Option<PathBuf> = None;
        /// Device of the tensors.
        device: String = crate::usual::device();
        /// Files or folders of the run, by their path below it, that may differ from their digests.
        accept_changed: Vec<String> = Vec::new();
    }
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The pictures in the order of the request, without those that cannot be read.
    pub pictures: Vec<Seen>,
    /// Pictures that cannot be read; a warning gave the reason for each.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub unread: Vec<PathBuf>,
    /// Folder with `detections.json` (COCO results), `annotations.json` (pictures, classes, and the objects of a data set) and the drawn
    /// pictures. Both files have the category ids of the data set where every class takes one category of it. Else they have numbers of their
    /// own, which fit no other file of annotations, as a note says.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub out: Option<PathBuf>,
    /// How well the objects of the data set are found; none without one.
    pub scores: Option<Scores>,
}

/// A picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Seen {
    /// Its file.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub file: PathBuf,
    /// What was found in it, best first.
    pub found: Vec<Found>,
}

/// The ending of raw frames, which only the camera of a run develops.
const RAW_ENDING: &str = "dng";

/// A picture in which objects are detected.
struct Looked {
    file: PathBuf,
    /// Its record in the data set.
    image: Image,
}

/// The pictures of a request.
struct PictureSet {
    looked: Vec<Looked>,
    /// The data set that they are from; none for pictures without labels.
    data: Option<DataSet>,
    /// Whether the data set was joined from several files, which numbers its pictures anew.
    is_joined: bool,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::placed(|request, folder| request.out = request.out.take().map(|_| folder.to_owned()));

/// Detects objects in pictures, for a camera of a run at their own size.
///
/// Drawn pictures are written one by one, the results at the end. If the job is stopped, the results are of the pictures before. A picture
/// that cannot be read gives a warning and is left out. With a data set, scores and results use all detections, not only those above the
/// least score.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    let device = context.device(&request.device)?;
    let PictureSet { looked, data: labelled, is_joined } = pictures_of(request, context)?;
    if let Some(out) = &request.out {
        check_folder(out, ["detections.json", ANNOTATIONS], context)?;
    }
    let raw = looked.iter().map(|l| &l.file).find(|file| is_raw(file));
    let mut finder = finder(&request.detector, raw, &device, &request.accept_changed, context)?;
    let detector = finder.detector.as_ref();
    if let (Some(place), Some(data)) = (&request.data, &labelled) {
        warn_of_training_pictures(&finder, place, data, &looked, context);
    }
    // Those of all its parts: a part has the same ids.
    let own =
        labelled.as_ref().zip(finder.taken.as_ref()).and_then(|(data, taken)| own_categories(data, taken));
    let labelled = labelled.map(|data| only(data, &looked));
    // A copy of a large data set is made only where it may differ.
    let filed = labelled.as_ref().filter(|data| may_differ_for_pycocotools(data)).map(DataSet::unclipped);
    let labelled = labelled.map(|data| in_classes_of(&finder, data, Judged::Clear, context)).transpose()?;
    // What is wrong with the classes was said by now.
    let filed =
        filed.and_then(|data| in_classes_of(&finder, data, Judged::AllButCrowds, &context.silent()).ok());
    // Weights know their classes by number alone.
    if let (None, Some(data)) = (&finder.taken, &labelled) {
        take_names(&mut finder.classes, &data.categories);
    }
    let (mut pictures, mut results, mut images, mut unread) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut earlier = request.out.as_deref().map(drawn_pictures).unwrap_or_default();
    let (count, mut surest) = (looked.len(), None::<f32>);
    // What files of a data set say was said when they were checked.
    let silent = context.silent();
    let reader = NotedPictures::new(if request.data.is_some() { &silent } else { context });
    let outcome = looked.into_iter().enumerate().try_for_each(|(i, Looked { file, mut image })| {
        let check = || context.check(|| format!("stopped after {i} of {count} pictures"));
        check()?;
        let encoded = match encoded(&file, finder.camera.as_ref(), &reader) {
            Ok((encoded, is_turned)) => {
                // Boxes are of the picture as it is shown. Other pictures need no such word.
                image.turned = is_turned.then_some(true);
                encoded
            }
            Err(error) => {
                context.warning(WarningKind::UnreadablePicture, format!("{error}"));
                unread.push(file);
                context.progress(i as u64 + 1, count as u64, "pictures");
                return Ok(());
            }
        };
        (image.height, image.width) = (encoded.height as u32, encoded.width as u32);
        let found = detect_in(detector, &encoded, &device, context.cancel());
        // A look that was cancelled has no results, and ends as that between two pictures.
        check()?;
        let found = found.map_err(DesignError::from)?;
        surest = surest.into_iter().chain(found.first().map(|best| best.score)).reduce(f32::max);
        let is_sure = |d: &&Detection| d.score >= request.least_score;
        results
            .extend(found.iter().filter(|d| labelled.is_some() || is_sure(d)).map(|d| result(image.id, d)));
        let sure: Vec<Detection> = found.iter().filter(is_sure).copied().collect();
        images.push(image);
        pictures.push(Seen { file: file.clone(), found: sure.iter().map(|d| finder.in_words(d)).collect() });
        if let Some(out) = &request.out {
            let boxes: Vec<_> = sure.iter().map(|d| (d.bbox, d.class)).collect();
            let png = encoded_png_bytes(&with_boxes(&encoded, &boxes, &finder.classes))
                .map_err(DesignError::from)?;
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            make_folder(out)?;
            let drawn = out.join(format!("{:04}-{stem}.png", i + 1));
            write_file(&drawn, &png)?;
            context.wrote(&drawn, "picture");
            earlier.remove(&drawn);
        }
        context.progress(i as u64 + 1, count as u64, "pictures");
        Ok(())
    });
    let scores = labelled.as_ref().filter(|_| outcome.is_ok()).map(|data| Scores {
        pycocotools: filed.as_ref().and_then(|filed| Pycocotools::of(data, filed, &results)),
        ..Scores::of(data, &results)
    });
    if let Some(out) = request.out.as_ref().filter(|_| !pictures.is_empty()) {
        // Weights know classes by their numbers, which are those of a data set in which they look.
        let has_own_ids = !is_joined && (own.is_some() || labelled.is_some() && finder.taken.is_none());
        let mut data = labelled.unwrap_or_else(|| DataSet {
            categories: (finder.classes.into_iter().enumerate())
                .map(|(i, name)| Category { id: i as u64 + 1, name, ..Category::default() })
                .collect(),
            ..DataSet::default()
        });
        data.images = images;
        let seen: HashSet<u64> = data.images.iter().map(|image| image.id).collect();
        data.annotations.retain(|object| seen.contains(&object.image_id));
        if let Some(own) = own {
            take_ids(own, &mut data, &mut results);
        }
        let files = ["detections.json", ANNOTATIONS].map(|name| out.join(name));
        if !has_own_ids {
            context.note(format!(
                "ids in {} are those of {ANNOTATIONS} beside it, and of no other file of annotations",
                files[0].display()
            ));
        }
        save_results(&results, &data, &files[0])?;
        save_coco(&data, &files[1])?;
        context.wrote(&files[0], "detections");
        context.wrote(&files[1], "annotations");
    }
    outcome.map_err(|error| match error {
        // The files of the pictures before are written by now.
        JobError::Stopped(stopped) => Stopped { kept: context.written(), ..*stopped }.into(),
        other => other,
    })?;
    if let (Some(out), Some(left)) = (&request.out, earlier.first()) {
        let (count, name) = (earlier.len(), left.file_name().unwrap_or_default());
        context.warning(
            WarningKind::OldFile,
            format!(
                "{}: {count} drawn pictures in this folder are of an earlier call, such as {}",
                out.display(),
                name.display()
            ),
        );
    }
    if let Some(surest) = surest.filter(|surest| *surest < request.least_score) {
        context.note(format!(
            "nothing has a score of {} or more; the surest detection has {surest:.3}, and a lower least score shows it",
            request.least_score
        ));
    }
    Ok(Response { pictures, unread, out: request.out.clone(), scores })
}

/// Gives classes that have numbers, from 1 on, the names that categories have for these.
fn take_names(classes: &mut [String], categories: &[Category]) {
    for category in categories {
        let place = usize::try_from(category.id).ok().and_then(|id| id.checked_sub(1));
        if let Some(class) = place.and_then(|place| classes.get_mut(place)) {
            class.clone_from(&category.name);
        }
    }
}

/// Gives objects and detections the ids of other categories: class `c`, which has the number `c + 1`, is of `categories[c]`.
fn take_ids(categories: Vec<Category>, data: &mut DataSet, results: &mut [coco::Detection]) {
    let id = |class: u64| categories.get(class as usize - 1).map_or(class, |category| category.id);
    data.annotations.iter_mut().for_each(|object| object.category_id = id(object.category_id));
    results.iter_mut().for_each(|found| found.category_id = id(found.category_id));
    data.categories = categories;
}

/// The pictures of a folder that are named as drawn ones are: `0001-street.png`.
fn drawn_pictures(folder: &Path) -> BTreeSet<PathBuf> {
    let is_drawn = |path: &Path| {
        let name = path.file_name().and_then(OsStr::to_str).and_then(|name| name.strip_suffix(".png"));
        let number = name.and_then(|name| Some(name.split_once('-')?.0));
        number.is_some_and(|number| number.len() >= 4 && number.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| is_drawn(path)).collect()
}

/// A picture as a detector sees it, sRGB-encoded, and whether EXIF has turned it; a raw frame developed by the camera.
fn encoded(
    file: &Path,
    camera: Option<&Camera>,
    pictures: &NotedPictures<'_>,
) -> Result<(LinearImage, bool)> {
    Ok(match camera.filter(|_| is_raw(file)) {
        Some(camera) => (developed(camera, &raw_frame(file, &camera.body().sensor, pictures)?)?, false),
        None => {
            let light = pictures.light(file).map_err(DesignError::from)?;
            let is_turned = is_picture_turned(file).map_err(DesignError::from)?;
            (LinearImage { data: light.to_srgb(), ..light }, is_turned)
        }
    })
}

/// A detection as COCO writes it.
fn result(image_id: u64, found: &Detection) -> coco::Detection {
    let [x, y, width, height] =
        [found.bbox.x1, found.bbox.y1, found.bbox.width(), found.bbox.height()].map(f64::from);
    coco::Detection {
        image_id,
        category_id: found.class as u64 + 1,
        bounds: Bounds { x, y, width, height },
        score: f64::from(found.score),
    }
}

/// The pictures that a request names, or those of the part of its data set.
fn pictures_of(request: &Request, context: &Context) -> Result<PictureSet> {
    let Some(place) = &request.data else {
        let looked = unlabelled(files(&request.images, &request.detector)?)?;
        return Ok(PictureSet { looked, data: None, is_joined: false });
    };
    let all = labelled(place, request.out.as_deref(), context)?;
    Ok(PictureSet { looked: of_part(all.looked, request.part.as_deref(), place)?, ..all })
}

/// Pictures without labels, numbered from 1.
fn unlabelled(files: Vec<PathBuf>) -> Result<Vec<Looked>> {
    let looked = |(i, file): (usize, PathBuf)| {
        let image = Image { id: i as u64 + 1, file_name: whole_path(&file)?, ..Image::default() };
        Ok(Looked { file, image })
    };
    files.into_iter().enumerate().map(looked).collect()
}

/// The path of a file from the root on, so that annotations in another folder find it.
fn whole_path(file: &Path) -> Result<String> {
    Ok(std::path::absolute(file).map_err(DesignError::io(file))?.display().to_string())
}

/// The pictures of a data set. What of it cannot be used is a warning. Refuses to write into `out` if that would replace the annotations.
fn labelled(place: &Path, out: Option<&Path>, context: &Context) -> Result<PictureSet> {
    let mut loaded = load_coco(place, context.cancel())?;
    loaded.check_form()?;
    let whole = |path: &Path| path.canonicalize().ok();
    // Annotations written beside those of several parts would be read in place of them.
    let is_of_data = |path: &Path| whole(path).is_some_and(|p| Some(p) == whole(&loaded.file));
    if let Some(out) = out.filter(|out| is_of_data(out) || is_of_data(&out.join(ANNOTATIONS))) {
        let message = format!("{}: the data set is in this folder", out.display());
        return Err(JobError::input(message, "name another folder for --out"));
    }
    check_pictures_in(&mut loaded, &CheckedPictures::default(), context)?;
    loaded.check_form()?;
    for line in loaded.defects.lines(place) {
        context.warning(WarningKind::DataSet, line);
    }
    let mut looked = Vec::new();
    for image in &loaded.data.images {
        if let Some(file) = loaded.picture(&image.file_name) {
            let image = Image { file_name: whole_path(&file)?, ..image.clone() };
            looked.push(Looked { file, image });
        }
    }
    if looked.is_empty() {
        let message = format!("{}: no picture of this data set can be used", place.display());
        return Err(JobError::input(message, "`data check` says what is wrong with it"));
    }
    Ok(PictureSet { looked, is_joined: loaded.file.is_dir(), data: Some(loaded.data) })
}

/// The pictures of a part of the data set.
fn of_part(looked: Vec<Looked>, part: Option<&str>, place: &Path) -> Result<Vec<Looked>> {
    let Some(part) = part else { return Ok(looked) };
    let known: BTreeSet<String> = looked.iter().filter_map(|l| l.image.split.clone()).collect();
    let mut looked = looked;
    looked.retain(|l| l.image.split.as_deref() == Some(part));
    if looked.is_empty() {
        let known: Vec<String> = known.into_iter().collect();
        let hint = if known.is_empty() {
            format!("the pictures of {} name no part; leave it out", place.display())
        } else {
            format!("its parts are {}", listed(&known))
        };
        return Err(JobError::setting("part", part, "no picture of the data set is in this part", hint));
    }
    Ok(looked)
}

/// Says how many of the pictures are those that the network has been trained on: scores on them say little about others. Pictures at the place
/// of the run's own are known by their names, and all by their content.
fn warn_of_training_pictures(
    finder: &Finder,
    place: &Path,
    data: &DataSet,
    looked: &[Looked],
    context: &Context,
) {
    // A data set is named by its folder or by its file of annotations.
    let folder = |path: &Path| {
        let path = path.canonicalize().ok()?;
        if path.is_dir() { Some(path) } else { Some(path.parent()?.to_owned()) }
    };
    let Some(own) = &finder.own_pictures else { return };
    let is_here = |own: &Path| folder(own).is_some_and(|own| Some(own) == folder(place));
    let named = if is_here(&own.place) || is_here(&own.listed.place) {
        listed_for_training(&own.listed.files, data)
    } else {
        HashSet::new()
    };
    let is_trained = |l: &&Looked| named.contains(&l.image.id) || own.trained.holds(&l.file);
    let trained = looked.iter().filter(is_trained).count();
    if trained > 0 {
        let message = format!(
            "the network of this run has been trained on {trained} of these {} pictures: scores on them say little about others; `part` takes one \
             part of a data set, and `evaluate` scores the cameras of the run on what it held out",
            looked.len()
        );
        context.warning(WarningKind::DataSet, message);
    }
}

/// Ids of the pictures that a run has listed for training or validation, by their names in the data set.
fn listed_for_training(listed: &[PictureFile], data: &DataSet) -> HashSet<u64> {
    let of_list = listed.iter().filter(|file| file.list != List::HeldOut).map(|file| file.name.as_str());
    let trained: HashSet<&str> = of_list.collect();
    let is_trained = |image: &&Image| trained.contains(image.file_name.as_str());
    data.images.iter().filter(is_trained).map(|image| image.id).collect()
}

/// The data set with these pictures alone.
fn only(mut data: DataSet, looked: &[Looked]) -> DataSet {
    let ids: HashSet<u64> = looked.iter().map(|l| l.image.id).collect();
    data.images.retain(|image| ids.contains(&image.id));
    data.annotations.retain(|object| ids.contains(&object.image_id));
    data
}

/// The data set with the classes of a detector for categories: for a run by the words of their names, for weights of torchvision by their
/// numbers. Fails where nothing is left to find.
fn in_classes_of(finder: &Finder, data: DataSet, judged: Judged, context: &Context) -> Result<DataSet> {
    let nothing = |hint: &str| {
        Err(JobError::input(format!("no box of {} is in this data set", listed(&finder.classes)), hint))
    };
    let Some(classes) = &finder.taken else {
        // An id that is a word has no number of the weights.
        let is_number = |c: &Category| c.text_id.as_deref().is_none_or(|text| text.parse() == Ok(c.id));
        let is_known = |c: &Category| (1..=finder.classes.len() as u64).contains(&c.id) && is_number(c);
        let (known, unknown): (Vec<Category>, Vec<Category>) =
            data.categories.into_iter().partition(is_known);
        if !unknown.is_empty() {
            let names: Vec<String> = unknown.iter().map(|c| format!("{} ({})", c.name, c.id)).collect();
            let most = finder.classes.len();
            context.warning(
                WarningKind::DataSet,
                format!("the weights know the numbers 1 to {most}: left out are {}", listed(&names)),
            );
        }
        let numbers: HashSet<u64> = known.iter().map(|category| category.id).collect();
        let mut data = DataSet { categories: known, ..data };
        data.annotations.retain(|object| numbers.contains(&object.category_id));
        // Other programs obey crowds alone.
        for object in &mut data.annotations {
            match judged {
                Judged::Clear => object.crowd |= object.ignore,
                Judged::AllButCrowds => object.ignore = false,
            }
        }
        return if data.annotations.iter().any(|object| !object.crowd) {
            Ok(data)
        } else {
            nothing("its categories need the numbers that the weights have for them, such as those of COCO")
        };
    };
    taken_as(&data, classes).iter().for_each(|note| context.warning(WarningKind::DataSet, note));
    let data = in_classes(&data, classes, judged);
    if data.annotations.iter().any(|object| !object.crowd) {
        Ok(data)
    } else {
        nothing("its categories are recognised by the words of their names; `data check` lists them")
    }
}

/// Whether a data set has objects that pycocotools may take in another way: boxes that reach out of their pictures, and objects that are not judged
/// though they are no crowds.
fn may_differ_for_pycocotools(data: &DataSet) -> bool {
    let may_differ = |a: &Annotation| a.unclipped.is_some() || !a.crowd && (a.ignore || a.bounds.is_thin());
    data.annotations.iter().any(may_differ)
}

/// A list for people: its first eight words, and how many more there are.
fn listed(words: &[String]) -> String {
    const SHOWN: usize = 8;
    let more = words.len().saturating_sub(SHOWN);
    let first = words.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{first} and {more} more") } else { first }
}

/// The pictures that are named, and those of the folders that are named, sorted by name. Raw frames of folders are for the camera of a run.
fn files(images: &[PathBuf], detector: &Source) -> Result<Vec<PathBuf>> {
    let is_taken = |ending: &str| {
        let is_raw = matches!(detector, Source::Run { .. }) && ending == RAW_ENDING;
        is_raw || PICTURE_ENDINGS.contains(&ending)
    };
    let mut files = Vec::new();
    for path in images {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let entries = std::fs::read_dir(path).map_err(DesignError::io(path))?;
        let mut found = Vec::new();
        for entry in entries {
            let file = entry.map_err(DesignError::io(path))?.path();
            let ending = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            if is_taken(&ending) && file.is_file() {
                found.push(file);
            }
        }
        found.sort();
        if found.is_empty() {
            let message = format!("{}: no picture in this folder", path.display());
            return Err(JobError::input(
                message,
                "PNG, JPEG, TIFF, WebP and BMP files in the folder itself are looked at, and DNG files with --run, not those in folders below it",
            ));
        }
        files.extend(found);
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_without_names_take_those_of_the_data_set() {
        let mut classes: Vec<String> = (1..=4).map(|class| class.to_string()).collect();
        let category = |id: u64, name: &str| Category { id, name: name.to_owned(), ..Category::default() };
        let categories = [category(2, "v"), category(4, "p"), category(0, "none"), category(9, "far")];
        take_names(&mut classes, &categories);
        assert_eq!(classes, ["1", "v", "3", "p"]);
    }

    #[test]
    fn pictures_for_training_are_known_by_the_list_of_the_run() {
        let image = |id: u64, name: &str| Image { id, file_name: name.to_owned(), ..Image::default() };
        let data = DataSet {
            images: vec![image(7, "img/a.png"), image(8, "img/b.png"), image(9, "img/c.png")],
            ..DataSet::default()
        };
        let listed =
            [("img/a.png", List::Training), ("img/b.png", List::HeldOut), ("img/c.png", List::Validation)];
        let listed = listed.map(|(name, list)| PictureFile {
            name: name.to_owned(),
            list,
            bytes: 1,
            modified_s: None,
            sha256: None,
        });
        assert_eq!(listed_for_training(&listed, &data), HashSet::from([7, 9]));
    }
}
