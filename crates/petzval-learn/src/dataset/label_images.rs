//! Pictures with labels for each of their pixels: `FOLDER/pictures/NAME.*` with `FOLDER/labels/NAME.png` or `.tif`.
//!
//! Labels are pictures of indices (see `petzval_files::load_label_image`), which the classes name in `values`. A window takes the labels of its own
//! pixels as they are: pictures are never scaled, so that no label is ever interpolated.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_base::Cancel;
use petzval_files::coco::content_digest;
use petzval_files::{PictureNotes, is_picture_turned, picture_size, picture_statements};
use rayon::prelude::*;

use super::label_file::{LabelFile, pixels_of_classes};
use super::labelled_pictures::{LabelledPicture, PART, list_by_place};
use super::photo_set::picture_paths;
use super::small_pictures::SmallPictures;
use super::{Classes, DatasetError, IGNORED, LabelledPictures, List, Purpose};
use crate::detection::Truth;

/// The folders of pictures and of labels.
const FOLDERS: [&str; 2] = ["pictures", "labels"];

/// A picture with the pixels of each of its classes.
struct Checked {
    picture: LabelledPicture,
    /// Whether EXIF turns the picture.
    is_turned: bool,
    /// What its file says that is not obeyed.
    statements: Vec<String>,
    pixels: [usize; IGNORED as usize],
}

impl LabelledPictures {
    /// Reads the pictures of a folder that have labels for each pixel, and checks all labels. Returned with sentences on what cannot be used. Every
    /// fifth picture by name is held out, or the last where there are fewer; for [`Purpose::ValidatedTraining`] the one before each of
    /// these is for validation.
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
        let [pictures, mut labels] = [by_stem(&folder.join(FOLDERS[0]))?, by_stem(&folder.join(FOLDERS[1]))?];
        let of_values = Arc::new(classes.of_values());
        let pairs: Vec<(&PathBuf, Option<PathBuf>)> =
            pictures.iter().map(|(stem, picture)| (picture, labels.remove(stem))).collect();
        let read = |(picture, labels): (&PathBuf, Option<PathBuf>)| {
            cancel.check()?;
            checked(picture, labels, &of_values)
        };
        let checked: Vec<Result<Checked, DatasetError>> = pairs.into_par_iter().map(read).collect();

        let mut notes = Vec::new();
        if let Some(alone) = labels.values().next() {
            let others = and_others(labels.len());
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
        let mut found = Self::default();
        let (mut small, mut pixels) = (SmallPictures::new(crop), [[0; IGNORED as usize]; 2]);
        let mut turned: Vec<String> = Vec::new();
        let mut noted = PictureNotes::default();
        let count = checked.len();
        for (number, checked) in checked.into_iter().enumerate() {
            let Checked { picture, is_turned, statements, pixels: own } = checked?;
            noted.add(&picture.name, &statements);
            if is_turned {
                turned.push(picture.name.clone());
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
        if let Some(first) = turned.first() {
            let others = and_others(turned.len());
            note(format!(
                "EXIF turns {first}{others}; labels are taken as those of the turned picture, which the report shows"
            ));
        }
        noted.clauses().into_iter().for_each(&mut note);
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
                return Err(at(format!("no picture is left for {name}"), hint));
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
    picture: &Path,
    labels: Option<PathBuf>,
    of_values: &Arc<BTreeMap<u16, u8>>,
) -> Result<Checked, DatasetError> {
    let Some(path) = labels else {
        let hint = "add FOLDER/labels/NAME.png with its name, or take the picture out".to_owned();
        let problem = "this picture has no labels".to_owned();
        return Err(DatasetError::LabelImage { path: picture.to_owned(), problem, hint });
    };
    let (width, height) = picture_size(picture)?;
    let (is_turned, statements) = (is_picture_turned(picture)?, picture_statements(picture)?);
    let digest = content_digest(&path).map_err(|source| DatasetError::Io { path: path.clone(), source })?;
    let labels = LabelFile { path, of_values: of_values.clone(), digest };
    let classes = labels.read()?;
    let size = [height as usize, width as usize];
    if [classes.height, classes.width] != size {
        let problem = format!(
            "{} x {} labels for a picture of {width} x {height} pixels",
            classes.width, classes.height
        );
        return Err(labels.wrong(problem, "every pixel of the picture, the right way up, needs one label"));
    }
    let name = format!("{}/{}", FOLDERS[0], picture.file_name().unwrap_or_default().to_string_lossy());
    let (path, truth) = (picture.to_owned(), Truth::default());
    let picture = LabelledPicture { path, sequence: name.clone(), name, size, truth, labels: Some(labels) };
    Ok(Checked { picture, is_turned, statements, pixels: pixels_of_classes(&classes) })
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
