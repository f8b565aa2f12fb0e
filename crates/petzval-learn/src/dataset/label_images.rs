//! Pictures with labels for each of their pixels: `FOLDER/pictures/NAME.*` with `FOLDER/labels/NAME.png` or `.tif`.
//!
//! Labels are pictures of indices (see `petzval_files::load_label_image`), which the classes name in `values`. A window takes the labels of its own
//! pixels as they are: pictures are never scaled, so that no label is ever interpolated.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_base::{Cancel, reason_and_hint};
use petzval_files::coco::content_digest;
use petzval_files::{
    CheckedPicture, CheckedPictures, PictureNotes, StoredPicture, check_stored_up_to, load_label_image,
    picture_statements,
};
use rayon::prelude::*;

use super::label_file::{LABELS, LabelFile, name_in, pixels_of_classes};
use super::labelled_pictures::{LabelledPicture, PART, list_by_place};
use super::photo_set::picture_paths;
use super::small_pictures::SmallPictures;
use super::{Classes, DatasetError, IGNORED, LabelledPictures, List, Purpose, READ_AT_ONCE};
use crate::detection::Truth;

/// The folders of pictures and of labels.
const FOLDERS: [&str; 2] = ["pictures", LABELS];

/// A picture with the pixels of each of its classes.
struct Checked {
    picture: LabelledPicture,
    /// What is not obeyed of what its file says.
    statements: Vec<String>,
    /// Whether EXIF or TIFF turns the picture, and whether it turns the labels.
    are_turned: [bool; 2],
    /// What of the labels' file is not read.
    notes_of_labels: Vec<String>,
    pixels: [usize; IGNORED as usize],
}

/// The pictures of a folder that can be read, with their labels.
#[derive(Default)]
struct Pairs {
    readable: Vec<Pair>,
    /// What their files say that is not obeyed, a clause for each kind.
    notes: Vec<String>,
    /// Whether all were decoded. Else the heads of their files were read.
    are_decoded: bool,
    /// Why each other picture cannot be read.
    damaged: Vec<String>,
    /// Labels without a picture.
    alone: Vec<PathBuf>,
}

/// A picture and its labels, if there are any.
struct Pair {
    picture: PathBuf,
    found: CheckedPicture,
    labels: Option<PathBuf>,
}

impl Pairs {
    /// Decodes the pictures of a folder, on all threads, or reads their heads where their light takes more than [`READ_AT_ONCE`].
    fn of(folder: &Path, cancel: &Cancel) -> Result<Self, DatasetError> {
        let [pictures, mut labels] = [by_stem(&folder.join(FOLDERS[0]))?, by_stem(&folder.join(FOLDERS[1]))?];
        let stored = |path: &PathBuf| StoredPicture::file(path.clone()).named(picture_name(path));
        let stored: Vec<StoredPicture> = pictures.values().map(stored).collect();
        let checked = CheckedPictures::default();
        let watch = |_: usize| cancel.check();
        let (found, are_decoded) = check_stored_up_to(READ_AT_ONCE, &stored, &checked, &watch)?;
        let mut pairs = Self { notes: checked.take_notes(), are_decoded, ..Self::default() };
        for ((stem, picture), found) in pictures.into_iter().zip(found) {
            let labels = labels.remove(&stem);
            match found {
                Ok(found) => pairs.readable.push(Pair { picture, found, labels }),
                Err(unread) => pairs.damaged.push(unread.message),
            }
        }
        pairs.alone = labels.into_values().collect();
        Ok(pairs)
    }

    /// How many pictures cannot be read, in words, with the first of them and what to do; none where all can.
    fn damaged_in_words(&self) -> Option<String> {
        let (reason, hint) = reason_and_hint(self.damaged.first()?);
        let are = match self.damaged.len() {
            1 => "1 picture is left out with its labels".to_owned(),
            count => format!("{count} pictures are left out with their labels, the first of them"),
        };
        let hint = if hint.is_empty() { "check that it may be read" } else { hint };
        Some(format!("{are}: {reason}; {hint}, or take it out of the folder"))
    }
}

impl LabelledPictures {
    /// Reads the pictures of a folder that have labels for each pixel, and checks all labels. Returned with sentences on what cannot be used. Every
    /// fifth picture by name is held out, or the last where there are fewer; for [`Purpose::ValidatedTraining`] the one before each of
    /// these is for validation.
    ///
    /// Pictures whose light takes up to [`READ_AT_ONCE`] bytes together are decoded, and damaged ones left out. Of a larger set the heads of files are
    /// read; what is damaged behind its head is an error when it is needed. Ends with [`DatasetError::Stopped`] once `cancel` is set.
    ///
    /// Fails on a picture without labels or with those of another size, on an index that is of no class, and where no picture that holds a window
    /// of `crop` pixels, or no labelled pixel, is left for training or scores.
    pub fn load_with_label_images(
        folder: &Path,
        classes: &Classes,
        crop: usize,
        purpose: Purpose,
        cancel: &Cancel,
    ) -> Result<(Self, Vec<String>), DatasetError> {
        let at = |problem: String, hint: String| DatasetError::LabelImage {
            path: folder.to_owned(),
            problem,
            hint,
        };
        let missing = FOLDERS.into_iter().find(|name| !folder.join(name).is_dir());
        if let Some(name) = missing {
            let hint = "pictures lie in its folder `pictures`, and the labels of pictures/NAME.jpg are labels/NAME.png";
            return Err(at(format!("there is no folder `{name}` in it"), hint.to_owned()));
        }
        let pairs = Pairs::of(folder, cancel)?;
        let of_values = Arc::new(classes.of_values());
        let read = |pair: &Pair| {
            cancel.check()?;
            let statements = if pairs.are_decoded { Vec::new() } else { picture_statements(&pair.picture)? };
            checked(pair, statements, &of_values)
        };
        let checked: Vec<Result<Checked, DatasetError>> = pairs.readable.par_iter().map(read).collect();

        let mut notes = Vec::new();
        if let Some(alone) = pairs.alone.first() {
            let others = and_others(pairs.alone.len());
            notes.push(format!("{}{others}: labels without a picture, which are not used", alone.display()));
        }
        let mut note = |text: String| notes.push(format!("{}: {text}", folder.display()));
        let inner = folders_in(&folder.join(FOLDERS[0]))?;
        if inner > 0 {
            note(format!(
                "{} inside `pictures` and not read; pictures lie in `pictures` itself, and their labels in `labels`",
                if inner == 1 { "a folder is".to_owned() } else { format!("{inner} folders are") }
            ));
        }
        let damaged = pairs.damaged_in_words();
        damaged.iter().cloned().for_each(&mut note);
        let mut found = Self::without_pictures(pairs.are_decoded);
        if !pairs.are_decoded {
            note("pictures are read when they are needed; a damaged one stops the run then".to_owned());
        }
        let (mut small, mut pixels) = (SmallPictures::new(crop), [[0; IGNORED as usize]; 2]);
        let mut turned: [Vec<String>; 2] = Default::default();
        let [mut noted, mut noted_of_labels] = <[PictureNotes; 2]>::default();
        let count = checked.len();
        for (number, checked) in checked.into_iter().enumerate() {
            let Checked { picture, statements, are_turned, notes_of_labels, pixels: own } = checked?;
            noted.add(&picture.name, &statements);
            let labels = picture.labels.as_ref().map_or_else(String::new, LabelFile::name);
            noted_of_labels.add(&labels, &notes_of_labels);
            match are_turned {
                [_, true] => turned[1].push(labels),
                [true, false] => turned[0].push(picture.name.clone()),
                [false, false] => {}
            }
            let list = match list_by_place(number, count) {
                _ if purpose == Purpose::Scores => List::HeldOut,
                List::Validation if purpose != Purpose::ValidatedTraining => List::Training,
                list => list,
            };
            if small.notes(list, picture.size) {
                continue;
            }
            let of_list = &mut pixels[usize::from(list == List::HeldOut)];
            of_list.iter_mut().zip(own).for_each(|(all, own)| *all += own);
            found.list_mut(list).push(picture);
        }
        // Labels of the stored pixels often have the same size.
        let said = [
            "labels are taken as those of the turned picture, which the report shows",
            "these labels are turned by it, as pictures are, before they are laid over their pictures",
        ];
        for (turned, said) in turned.iter().zip(said) {
            if let Some(first) = turned.first() {
                let others = and_others(turned.len());
                note(format!("EXIF turns {first}{others}; {said}"));
            }
        }
        pairs.notes.iter().cloned().chain(noted.clauses()).for_each(&mut note);
        noted_of_labels.clauses_of("label image").into_iter().for_each(&mut note);
        small.sentence().into_iter().for_each(&mut note);
        let trains = purpose != Purpose::Scores;
        let validated = purpose == Purpose::ValidatedTraining;
        if validated && found.list(List::Validation).is_empty() && !found.take_validation() {
            let training = found.list(List::Training).to_vec();
            *found.list_mut(List::Validation) = training;
            note("there is one picture for training, which validation sees, too, and says little".to_owned());
        }
        for (list, name, pixels) in
            [(List::Training, "training", &pixels[0]), (List::HeldOut, "scoring", &pixels[1])]
        {
            if list == List::Training && !trains {
                continue;
            }
            if found.list(list).is_empty() {
                let needed = "at least two pictures that hold a window are needed, one of them to score with";
                let hint = small.remedy(list, purpose).unwrap_or_else(|| needed.to_owned());
                let why = damaged.map_or_else(String::new, |damaged| format!(": {damaged}"));
                return Err(at(format!("no picture is left for {name}{why}"), hint));
            }
            if pixels.iter().all(|count| *count == 0) {
                let hint = "`values` of [[class]] names the indices that are not ignored";
                return Err(at(format!("all pixels for {name} are ignored"), hint.to_owned()));
            }
            let counted = classes.counted();
            let names = counted.names().into_iter();
            let absent: Vec<&str> =
                names.zip(pixels).filter(|(_, count)| **count == 0).map(|(c, _)| c).collect();
            if !absent.is_empty() {
                note(format!("no pixel for {name} is of {}", absent.join(", ")));
            }
        }
        if trains && count < PART {
            note(format!(
                "there are fewer than {PART} pictures; the last one is held out, and scores on one picture say little about others"
            ));
        }
        Ok((found, notes))
    }
}

/// A picture whose labels are there, have its size, and are of known classes.
fn checked(
    pair: &Pair,
    statements: Vec<String>,
    of_values: &Arc<BTreeMap<u16, u8>>,
) -> Result<Checked, DatasetError> {
    let Pair { picture, found, labels } = pair;
    let Some(path) = labels.clone() else {
        let hint = "add FOLDER/labels/NAME.png with its name, or take the picture out".to_owned();
        let problem = "this picture has no labels".to_owned();
        return Err(DatasetError::LabelImage { path: picture.to_owned(), problem, hint });
    };
    let (width, height) = found.size;
    let digest = content_digest(&path).map_err(|source| DatasetError::Io { path: path.clone(), source })?;
    let labels = LabelFile { path, of_values: of_values.clone(), digest };
    let mut image = load_label_image(&labels.path)?;
    let (are_turned, notes_of_labels) =
        ([found.is_turned, image.is_turned], std::mem::take(&mut image.notes));
    let classes = labels.classes_of(image)?;
    let size = [height as usize, width as usize];
    if [classes.height, classes.width] != size {
        let problem = format!(
            "{} x {} labels for a picture of {width} x {height} pixels",
            classes.width, classes.height
        );
        return Err(labels.wrong(problem, "every pixel of the picture, the right way up, needs one label"));
    }
    let name = picture_name(picture);
    let (path, truth) = (picture.to_owned(), Truth::default());
    let picture = LabelledPicture { path, sequence: name.clone(), name, size, truth, labels: Some(labels) };
    let pixels = pixels_of_classes(&classes);
    Ok(Checked { picture, statements, are_turned, notes_of_labels, pixels })
}

/// The name of a picture in its data set.
fn picture_name(path: &Path) -> String {
    name_in(FOLDERS[0], path)
}

/// How many there are beside the first of them, in words.
fn and_others(count: usize) -> String {
    if count > 1 { format!(" and {} others", count - 1) } else { String::new() }
}

/// The folders in this one, without hidden ones. Pictures in them are not read.
fn folders_in(folder: &Path) -> Result<usize, DatasetError> {
    let cannot_read = |source| DatasetError::Io { path: folder.to_owned(), source };
    let mut count = 0;
    for entry in std::fs::read_dir(folder).map_err(cannot_read)? {
        let entry = entry.map_err(cannot_read)?;
        let is_hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
        count += usize::from(!is_hidden && entry.path().is_dir());
    }
    Ok(count)
}

/// The pictures of a folder by their name without its ending. Fails where two have the same.
fn by_stem(folder: &Path) -> Result<BTreeMap<String, PathBuf>, DatasetError> {
    let mut all: BTreeMap<String, PathBuf> = BTreeMap::new();
    for path in picture_paths(folder)? {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if let Some(other) = all.insert(stem, path.clone()) {
            let problem = format!("{} has the same name but for its ending", other.display());
            let hint = "pictures and labels are paired by this name: it stands for one file".to_owned();
            return Err(DatasetError::LabelImage { path, problem, hint });
        }
    }
    Ok(all)
}
