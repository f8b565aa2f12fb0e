//! Windows of the pictures of a folder, with the objects that are to be found in them (in COCO format), or with the classes of their pixels
//! (see `label_images.rs`).
//!
//! Pictures are decoded to linear light, and one of their pixels becomes one of the sensor. Their own noise and blur stay: a scene from a
//! photograph is a scene with that noise.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_base::Cancel;
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_files::coco::{Image, PictureCheck, check_pictures_by, load_coco};
use petzval_files::{CheckedPictures, StoredPicture, load_image_bytes};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::classes::{missing_claims, taken_as, truth};
use super::crop::around;
use super::label_file::{LabelFile, drawn_pixel};
use super::labelled_window::{LARGEST_SHARE, LEAST_INSIDE, crop_around, drawn_by_class, inside, off_middle};
use super::small_pictures::SmallPictures;
use super::{
    Classes, CropPlan, DatasetError, FirstReads, LabelledWindow, List, PictureFile, Purpose, READ_AT_ONCE,
};
use crate::detection::{BBox, Ignored, Object, Truth};

/// Where a data set says nothing of its parts: of every so many sequences, the last is held out and the one before it is for validation.
pub(super) const PART: usize = 5;

/// What to do about a folder whose labels are not enough.
const DATA_CHECK: &str = "`petzval data check` lists what it holds";

/// A picture of the folder.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LabelledPicture {
    pub path: PathBuf,
    /// Its name in the data set.
    pub name: String,
    /// The film that it is of, or its own name.
    pub sequence: String,
    /// Rows and columns.
    pub size: [usize; 2],
    /// Its objects.
    pub truth: Truth,
    /// The classes of its pixels, where they are what is looked for.
    pub labels: Option<LabelFile>,
}

/// The pictures of a folder, in three lists. They share no sequence, unless the data set itself has pictures of one in several parts, or no
/// second one for training; then a note says so.
#[derive(Clone, Debug, Default)]
pub struct LabelledPictures {
    training: Vec<LabelledPicture>,
    validation: Vec<LabelledPicture>,
    held_out: Vec<LabelledPicture>,
    /// Digests of files from their first read; none where all are read at the start.
    reads: Option<Arc<FirstReads>>,
}

/// How windows of pictures are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureWindows {
    /// Seed of the places.
    pub seed: u64,
    /// Share of the windows that lie on an object.
    pub on_objects: f64,
    /// Least longer side of an object that counts, pixels.
    pub least_side_px: f64,
}

impl LabelledPictures {
    /// Reads the annotations of a folder and checks its pictures. Returned with sentences on what of it cannot be used. Fails on boxes as corners
    /// or shares of the picture. Fails where nothing is left to train on or to score with: no picture that holds a window of `crop` pixels, or no
    /// object of a wanted class whose longer side has `least_side_px` pixels.
    ///
    /// The parts of the data set (`split`) decide what is held out: everything outside the parts whose names begin with `train`, or outside the
    /// largest one if none does; a part for tests never trains. A note says which parts are which. Without two parts every fifth sequence is, by name, or the last where there are fewer; a picture that names no sequence is one by
    /// itself. For [`Purpose::ValidatedTraining`] every
    /// fifth sequence is for validation, or the last of those for training where there are fewer; if not, they are for training.
    ///
    /// Pictures whose light takes up to [`READ_AT_ONCE`] bytes together are decoded, and damaged ones left out. Of a larger set the heads of files are
    /// read; what is damaged behind its head is an error when it is needed. Ends with [`DatasetError::Stopped`] once `cancel` is set.
    pub fn load(
        folder: &Path,
        classes: &Classes,
        crop: usize,
        least_side_px: f64,
        purpose: Purpose,
        cancel: &Cancel,
    ) -> Result<(Self, Vec<String>), DatasetError> {
        let class_names = classes.names();
        let validated = purpose == Purpose::ValidatedTraining;
        let trains = purpose != Purpose::Scores;
        let mut loaded = load_coco(folder, cancel)?;
        loaded.check_form()?;
        let checked = CheckedPictures::default();
        let how = PictureCheck { most_light_bytes: READ_AT_ONCE, remembered: &checked };
        let are_decoded = check_pictures_by(&mut loaded, &how, &|_| cancel.check())?;
        loaded.check_form()?;
        let mut notes = checked.take_notes();
        let data = &loaded.data;
        let objects = data.objects_of_images();
        let sequences = sequences(&data.images);
        let training = training_parts(&data.images);
        let wrong = |problem: String, hint: String| DatasetError::Labels {
            path: folder.to_path_buf(),
            problem,
            hint,
        };
        let misfit = |problem: String| wrong(problem, DATA_CHECK.to_owned());
        let is_test = |image: &Image| {
            image.split.as_deref().is_some_and(|part| part.trim().to_lowercase().starts_with("test"))
        };
        if trains && training.is_empty() && !data.images.is_empty() && data.images.iter().all(is_test) {
            return Err(misfit("all pictures are of a part for tests, and none is for training".to_owned()));
        }
        if trains && data.images.iter().all(|image| image.sequence.is_none()) {
            let said = "no picture names its sequence; if pictures for training and for scoring come from one film, scores are better than \
                 they would be on another";
            notes.push(said.to_owned());
        }
        let unnamed = data.images.iter().filter(|image| image.split.is_none()).count();
        if trains && !training.is_empty() {
            notes.push(said_of_parts(&data.images, &training));
            if unnamed > 0 && !training.contains(&None) {
                notes.push(format!(
                    "{unnamed} pictures name no part, and are held out as everything outside the part for training is"
                ));
            }
        }
        notes.extend(taken_as(data, classes));
        notes.extend(missing_claims(data, classes));
        if !are_decoded {
            let said = "pictures are read when they are needed; a damaged one stops the run then, and `petzval data check` finds it before";
            notes.push(said.to_owned());
        }
        let mut found = Self::without_pictures(are_decoded);
        let mut small = SmallPictures::new(crop);
        for (image, objects) in data.images.iter().zip(&objects) {
            let size = [image.height as usize, image.width as usize];
            let Some(path) = loaded.picture(&image.file_name) else { continue };
            let list = match list_of(image, &training, &sequences) {
                _ if !trains => List::HeldOut,
                List::Validation if !validated => List::Training,
                list => list,
            };
            if small.notes(list, size) {
                continue;
            }
            let truth = truth(data, objects, classes);
            let (name, sequence) = (image.file_name.clone(), sequence(image).to_owned());
            found.list_mut(list).push(LabelledPicture { path, name, sequence, size, truth, labels: None });
        }
        notes.extend(small.sentence());
        for (name, list) in [("training", List::Training), ("scoring", List::HeldOut)] {
            if found.list(list).is_empty() && (trains || list == List::HeldOut) {
                // Small pictures of another list are not why this one is empty.
                let remedy = small.remedy(list, purpose);
                let why = match small.sentence().filter(|_| remedy.is_some()) {
                    Some(small) => format!(": {small}"),
                    None if sequences.len() == 1 => {
                        ": all pictures are of one sequence; `split` names parts".to_owned()
                    }
                    None => String::new(),
                };
                let hint = remedy.unwrap_or_else(|| DATA_CHECK.to_owned());
                return Err(wrong(format!("no picture is left for {name}{why}"), hint));
            }
        }
        if trains && training.is_empty() && sequences.len() < PART {
            notes.push(format!(
                "there are fewer than {PART} sequences; the last one is held out, {} pictures, and scores on one sequence say little about others",
                found.held_out.len()
            ));
        }
        if validated && found.validation.is_empty() && !found.take_validation() {
            let said = "all pictures for training are of one sequence, so validation sees pictures that are trained on, and says little";
            notes.push(said.to_owned());
            found.validation = found.training.clone();
        }
        if [&found.training, &found.held_out].into_iter().flatten().all(|p| p.truth.objects.is_empty()) {
            const SHOWN: usize = 8;
            let names: Vec<&str> = data.categories.iter().map(|category| category.name.as_str()).collect();
            let more = match names.len().saturating_sub(SHOWN) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let [classes, names] =
                [&class_names[..], &names[..names.len().min(SHOWN)]].map(|list| list.join(", "));
            return Err(misfit(format!(
                "no box of {classes} counts: it counts if the name of its category says so, if it is no crowd and not to be ignored, and if it is \
                 at least a pixel wide and high; the categories are {names}{more}"
            )));
        }
        let mut per_class = vec![[0_usize; 2]; classes.len()];
        for (k, list) in [&found.training, &found.held_out].into_iter().enumerate() {
            let objects = list.iter().flat_map(|picture| &picture.truth.objects);
            for object in objects.filter(|o| longer_side(&o.bbox) >= least_side_px) {
                per_class[object.class][k] += 1;
            }
        }
        for (k, purpose) in ["training", "scoring"].into_iter().enumerate() {
            if per_class.iter().all(|counts| counts[k] == 0) && (trains || purpose == "scoring") {
                let problem = format!(
                    "no box of {} with a longer side of {least_side_px} pixels or more, `street.least_side_px`, is left for {purpose}",
                    class_names.join(", ")
                );
                return Err(misfit(problem));
            }
        }
        // A picture that names no film has its own name for one. Where two parts list it, a defect says so.
        let films: BTreeSet<&str> =
            data.images.iter().filter_map(|image| image.sequence.as_deref()).collect();
        let [training, held_out] = [List::Training, List::HeldOut].map(|list| found.sequences(list));
        let shared = training.intersection(&held_out).filter(|sequence| films.contains(*sequence)).count();
        if shared > 0 {
            notes.push(format!(
                "pictures of {shared} sequences are in the part for training and in another one; scores on pictures of the same film are \
                 better than on others"
            ));
        }
        for (class, [training, held_out]) in class_names.iter().zip(&per_class) {
            if trains && (*training == 0 || *held_out == 0) {
                notes.push(format!(
                    "the class `{class}` has {training} boxes of {least_side_px} pixels or more for training and {held_out} for scoring"
                ));
            }
        }
        let notes = notes.into_iter().map(|note| format!("{}: {note}", folder.display()));
        Ok((found, loaded.defects.lines(folder).chain(notes).collect()))
    }

    /// No pictures yet, for those of a folder. Where they are not decoded, their digests are those of their first reads.
    pub(super) fn without_pictures(are_decoded: bool) -> Self {
        Self { reads: (!are_decoded).then(Arc::default), ..Self::default() }
    }

    pub(super) fn list_mut(&mut self, list: List) -> &mut Vec<LabelledPicture> {
        match list {
            List::Training => &mut self.training,
            List::Validation => &mut self.validation,
            List::HeldOut => &mut self.held_out,
        }
    }

    pub(super) fn list(&self, list: List) -> &[LabelledPicture] {
        match list {
            List::Training => &self.training,
            List::Validation => &self.validation,
            List::HeldOut => &self.held_out,
        }
    }

    /// Moves the last sequence of the training pictures to those for validation. `false` if there is no other sequence.
    pub(super) fn take_validation(&mut self) -> bool {
        let sequences = self.sequences(List::Training);
        let Some(last) = sequences.last().filter(|_| sequences.len() > 1).map(|last| (*last).to_owned())
        else {
            return false;
        };
        (self.validation, self.training) =
            std::mem::take(&mut self.training).into_iter().partition(|picture| picture.sequence == last);
        true
    }

    /// The names of the sequences of a list.
    fn sequences(&self, list: List) -> BTreeSet<&str> {
        self.list(list).iter().map(|picture| picture.sequence.as_str()).collect()
    }

    /// Digests of files from their first read; none where all are read at the start.
    pub fn first_reads(&self) -> Option<&FirstReads> {
        self.reads.as_deref()
    }

    /// Every picture file, with its digest if they `are_read`. Fails with [`DatasetError::Stopped`] before the next one once `cancel` is set.
    pub fn files(&self, are_read: bool, cancel: &Cancel) -> Result<Vec<PictureFile>, DatasetError> {
        let lists = [List::Training, List::Validation, List::HeldOut].into_iter();
        let all: Vec<(List, &LabelledPicture)> =
            lists.flat_map(|list| self.list(list).iter().map(move |picture| (list, picture))).collect();
        let file = |(list, picture): &(List, &LabelledPicture)| {
            cancel.check()?;
            PictureFile::of(&picture.path, &picture.name, *list, are_read)
        };
        all.par_iter().map(file).collect()
    }

    /// What identifies the pictures: of each its list, its name, the SHA-256 of its file, or its size as long as that is not known, and its boxes. `files`: those of [`Self::files`].
    pub fn fingerprint(&self, files: &[PictureFile]) -> String {
        let mut text = String::new();
        let lists = [List::Training, List::Validation, List::HeldOut].into_iter();
        let pictures = lists.flat_map(|list| self.list(list).iter().map(move |picture| (list, picture)));
        for ((list, picture), PictureFile { sha256, bytes, .. }) in pictures.zip(files) {
            let sha256 = sha256.clone().unwrap_or_else(|| format!("{bytes} bytes"));
            text += &format!("{list:?} {} {sha256}{}\n", picture.name, boxes_of(picture));
        }
        text
    }

    /// Every picture by its name, with its boxes.
    pub fn labels(&self) -> String {
        let all = [&self.training, &self.validation, &self.held_out].into_iter().flatten();
        all.map(|picture| format!("{}{}\n", picture.name, boxes_of(picture))).collect()
    }

    /// SHA-256 of every label image, hexadecimal, by its name in the folder; none where labels are boxes.
    pub fn label_files(&self) -> BTreeMap<String, String> {
        let all = [&self.training, &self.validation, &self.held_out].into_iter().flatten();
        let files = all.filter_map(|picture| picture.labels.as_ref());
        files.map(|file| (file.name(), file.digest.clone())).collect()
    }

    /// Number of pictures of a list.
    pub fn count(&self, list: List) -> usize {
        self.list(list).len()
    }

    /// The picture of window `number` of `of` of a list. Fewer windows than pictures are spread over all of them; more take them in turn.
    fn picture(&self, list: List, [number, of]: [u64; 2]) -> &LabelledPicture {
        let pictures = self.list(list);
        let count = pictures.len() as u64;
        let place = if of < count { number * count / of.max(1) } else { number };
        &pictures[(place % count) as usize]
    }

    /// The sequence of the picture of window `number` of `of` of a list. Windows of one sequence resemble each other.
    pub fn sequence(&self, list: List, window: [u64; 2]) -> &str {
        &self.picture(list, window).sequence
    }

    /// The file name of the picture of window `number` of `of` of a list.
    pub fn name(&self, list: List, window: [u64; 2]) -> &str {
        &self.picture(list, window).name
    }

    /// Window `number` of `of` of a list. Pictures are taken in turn. The window lies on an object that fits into it, or on a labelled pixel, each
    /// class of the picture equally often, or anywhere in the picture. It is placed anywhere on the sensor. Both places depend on the number alone.
    pub fn window(
        &self,
        how: &PictureWindows,
        list: List,
        [number, of]: [u64; 2],
        crops: &CropPlan,
    ) -> Result<LabelledWindow, DatasetError> {
        let picture = self.picture(list, [number, of]);
        let light = self.light(picture)?;
        let mut random = ChaCha8Rng::seed_from_u64(how.seed ^ 0x91c2_77e0_53aa_8b1d);
        random.set_stream(3 * number + list as u64);
        let size = [light.height, light.width];
        let sides = how.least_side_px..LARGEST_SHARE * crops.crop as f64;
        let fits = |o: &&Object| sides.contains(&longer_side(&o.bbox));
        let wanted = picture.truth.objects.iter().filter(fits).map(|o| (o.class, o));
        let classes = picture.labels.as_ref().map(LabelFile::read).transpose()?;
        let is_on_object = random.random_bool(how.on_objects);
        let chosen = match &classes {
            _ if !is_on_object => None,
            Some(classes) => drawn_pixel(classes, &mut random),
            None => drawn_by_class(wanted, &mut random).map(|o| {
                let [x, y] = o.bbox.centre().map(f64::from);
                [y, x]
            }),
        };
        let within: [f64; 2] = random.random();
        let middle = match chosen {
            Some([row, column]) => {
                let off = off_middle(within, crops.crop);
                [row + off[0], column + off[1]]
            }
            None => [within[0] * size[0] as f64, within[1] * size[1] as f64],
        };
        let first = crop_around(middle, size, crops.crop);
        // Anywhere on the sensor, its corners included.
        let at = [crops.sensor_rows, crops.sensor_columns]
            .map(|side| around(random.random_range(0..side), crops.crop, side));
        let exposed = crops.exposed_at(at[0], at[1]);
        // The first pixel of the window, with its border, in the picture; beyond the picture its edge is repeated.
        let corner = [at[0] - exposed.0, at[1] - exposed.1].map(|inset| inset + crops.margin);
        let start: [i64; 2] = std::array::from_fn(|i| first[i] as i64 - corner[i] as i64);
        let scene = repeated(&light, start, crops.window());
        let truth = picture.window_truth(first, crops.crop, how);
        let window = LabelledWindow::new(crops.window(), scene, at, truth);
        Ok(match classes {
            Some(classes) => window.with_classes(classes.part(first, crops.crop)),
            None => window,
        })
    }
}

impl LabelledPictures {
    /// The light of a picture. Fails if its file has another content than at its first read, or another size than when the set was listed.
    fn light(&self, picture: &LabelledPicture) -> Result<LinearImage, DatasetError> {
        let (path, stored) = (&picture.path, StoredPicture::file(picture.path.clone()));
        let bytes = stored.bytes()?;
        let light = load_image_bytes(&bytes, &stored.display())?.light;
        if let Some(reads) = &self.reads {
            reads.note(&picture.name, || path.clone(), &bytes)?;
        }
        if [light.height, light.width] != picture.size {
            return Err(DatasetError::Changed { path: path.clone(), name: picture.name.clone() });
        }
        Ok(light)
    }
}

impl LabelledPicture {
    /// The objects of a crop in its own pixels.
    fn window_truth(&self, first: [usize; 2], crop: usize, how: &PictureWindows) -> Truth {
        let inside = |bbox: &BBox| inside(bbox, first, crop);
        let mut truth = Truth::default();
        for object in &self.truth.objects {
            let Some((bbox, share)) = inside(&object.bbox) else { continue };
            if share >= LEAST_INSIDE && longer_side(&object.bbox) >= how.least_side_px {
                truth.objects.push(Object { bbox, class: object.class })
            } else {
                truth.ignored.push(Ignored::of_all(bbox))
            }
        }
        let part = |region: &Ignored| Some(region.with_box(inside(&region.bbox)?.0));
        truth.ignored.extend(self.truth.ignored.iter().filter_map(part));
        truth
    }
}

/// Width or height of a box, whichever is more, pixels.
fn longer_side(bbox: &BBox) -> f64 {
    f64::from(bbox.width().max(bbox.height()))
}

/// The sequences of pictures, sorted.
fn sequences(images: &[Image]) -> Vec<&str> {
    let all: BTreeSet<&str> = images.iter().map(sequence).collect();
    all.into_iter().collect()
}

/// What groups a picture with others of the same film.
fn sequence(image: &Image) -> &str {
    image.sequence.as_deref().unwrap_or(&image.file_name)
}

/// The parts that are for training, where parts decide what is held out; `None` is that of pictures without a part. Empty where they do not.
///
/// In this order count: parts whose names begin with `train`, in capitals or not; pictures without a part where all parts are for scores; the part
/// of the most pictures. A part for tests never trains.
fn training_parts(images: &[Image]) -> BTreeSet<Option<&str>> {
    let mut counts: BTreeMap<Option<&str>, usize> = BTreeMap::new();
    for image in images {
        *counts.entry(image.split.as_deref()).or_default() += 1;
    }
    let named: Vec<&str> = counts.keys().copied().flatten().collect();
    let begins = |part: &str, words: &[&str]| {
        let part = part.trim().to_lowercase();
        words.iter().any(|word| part.starts_with(word))
    };
    if !named.is_empty() && counts.contains_key(&None) && named.iter().all(|p| begins(p, &["test", "val"])) {
        return BTreeSet::from([None]);
    }
    if named.len() < 2 {
        return BTreeSet::new();
    }
    let is_exact =
        |part: &str| ["train", "training"].iter().any(|word| part.trim().eq_ignore_ascii_case(word));
    let of_names: Vec<&str> = named.iter().copied().filter(|part| begins(part, &["train"])).collect();
    // Something must be left to score with.
    let exact: Vec<&str> = of_names.iter().copied().filter(|part| is_exact(part)).collect();
    let is_some = |chosen: &Vec<&str>| !chosen.is_empty() && chosen.len() < named.len();
    if let Some(chosen) = [of_names, exact].into_iter().find(is_some) {
        return chosen.into_iter().map(Some).collect();
    }
    let others = named.into_iter().filter(|part| !begins(part, &["test"]));
    others.max_by_key(|part| counts[&Some(*part)]).map(Some).into_iter().collect()
}

/// Which parts are trained on and which are held out, in words.
fn said_of_parts(images: &[Image], training: &BTreeSet<Option<&str>>) -> String {
    let list = |is_training: bool| {
        let parts: BTreeSet<Option<&str>> = images.iter().map(|image| image.split.as_deref()).collect();
        let parts = parts.into_iter().filter(|part| training.contains(part) == is_training);
        let name =
            |part: Option<&str>| part.map_or("pictures without a part".to_owned(), |p| format!("`{p}`"));
        parts.map(name).collect::<Vec<_>>().join(", ")
    };
    format!("for training: {}; held out: {}", list(true), list(false))
}

fn list_of(image: &Image, training: &BTreeSet<Option<&str>>, sequences: &[&str]) -> List {
    let number = sequences.binary_search(&sequence(image)).unwrap_or(0);
    if training.is_empty() {
        list_by_place(number, sequences.len())
    } else if !training.contains(&image.split.as_deref()) {
        List::HeldOut
    } else if number % PART + 1 == PART {
        List::Validation
    } else {
        List::Training
    }
}

/// The list of sequence `number` of `count` where nothing says what it is for.
pub(super) fn list_by_place(number: usize, count: usize) -> List {
    let place = number % PART;
    // Of fewer sequences the last is held out, but not the only one.
    let is_last = (2..PART).contains(&count) && number + 1 == count;
    if is_last || place + 1 == PART {
        List::HeldOut
    } else if place + 2 == PART {
        List::Validation
    } else {
        List::Training
    }
}

/// The boxes of a picture as text, a blank before each, and what identifies the classes of its pixels.
fn boxes_of(picture: &LabelledPicture) -> String {
    let mut text = String::new();
    for object in &picture.truth.objects {
        let BBox { x1, y1, x2, y2 } = object.bbox;
        text += &format!(" {} {x1} {y1} {x2} {y2}", object.class);
    }
    for Ignored { bbox: BBox { x1, y1, x2, y2 }, class } in &picture.truth.ignored {
        let class = class.map_or_else(String::new, |class| class.to_string());
        text += &format!(" -{class} {x1} {y1} {x2} {y2}");
    }
    if let Some(labels) = &picture.labels {
        text += &format!(" {}", labels.digest);
    }
    text
}

/// `side` x `side` pixels of a picture from a row and a column on, which may lie outside; there the edge is repeated.
fn repeated(light: &LinearImage, start: [i64; 2], side: usize) -> impl Iterator<Item = f32> {
    let within = |at: i64, size: usize| at.clamp(0, size as i64 - 1) as usize;
    let (height, width) = (light.height, light.width);
    (0..CHANNELS).flat_map(move |channel| {
        (0..side).flat_map(move |row| {
            let row = within(start[0] + row as i64, height);
            (0..side).map(move |column| {
                let column = within(start[1] + column as i64, width);
                light.data[(channel * height + row) * width + column]
            })
        })
    })
}
