//! Photographs: the built-in ones, or those of a folder.

use std::collections::BTreeMap;
use std::path::Path;

use petzval_base::{Cancel, FileError};
use petzval_camera::sensor::{Colour, SensorModel};
use petzval_files::load_image_bytes;
use petzval_learn::dataset::{
    CropPlan, DatasetError, Folder, List, NamedPhoto, PhotoSet, PhotoSplit, PictureFile, load_folder,
};
use rayon::prelude::*;
use serde::Deserialize;
use sha2::{Digest, Sha256};

use crate::assets::Assets;
use crate::error::DesignError;
use crate::experiment::{BUILT_IN_PHOTOS, Experiment};
use crate::run::input_list::Pictures;
use crate::task::{PhotosLook, Purpose, Remark, WindowPlan, enlarged_by};

/// Difference between the planes of a picture, of white, above which it is in colour.
const COLOUR: f32 = 0.01;

/// Photographs, and how windows of them are cut.
pub struct Photographs {
    /// Training and held-out photographs, and those of validations where there are any.
    pub set: PhotoSet,
    /// Pictures of the folder that cannot be used, each with the reason.
    pub skipped: Vec<(String, DatasetError)>,
    /// What picture files say that was not obeyed, such as a colour profile, each with the name of the picture.
    pub notes: Vec<(String, String)>,
    /// How training windows are cut.
    pub training_crops: CropPlan,
    /// How held-out windows are cut.
    pub scoring_crops: CropPlan,
}

impl Photographs {
    /// Reads the photographs of an experiment. Where they are for scores alone, all those of its folder are held out.
    pub fn load(plan: &WindowPlan) -> Result<Self, DesignError> {
        let WindowPlan { experiment, assets, training_crops, scoring_crops, purpose, .. } = *plan;
        let Read { set, skipped, notes } = match purpose {
            Purpose::Training => {
                let window = training_crops.window().max(scoring_crops.window());
                let read = load_photos(experiment, assets, window)?;
                let validated = experiment.validation.is_used();
                let set = if validated { read.set.with_validation(VALIDATION_EVERY)? } else { read.set };
                training_crops.check(set.training())?;
                Read { set, ..read }
            }
            Purpose::Scores => {
                all_held_out(Path::new(&experiment.photos), scoring_crops.window(), assets.cancel())?
            }
        };
        scoring_crops.check(set.held_out())?;
        Ok(Self { set, skipped, notes, training_crops, scoring_crops })
    }

    /// Adds every photograph by list, name and light to a hash.
    pub(super) fn add_to(&self, hash: &mut Sha256) {
        for (list, photos) in self.lists() {
            let list = in_words(list).replace('-', " ");
            for photo in photos {
                hash.update(format!("{list}: {} {}x{}", photo.name, photo.image.height, photo.image.width));
                for value in &photo.image.data {
                    hash.update(value.to_le_bytes());
                }
            }
        }
    }

    /// The files of photographs of a folder.
    pub(super) fn files(&self, folder: &str) -> Result<Pictures, DesignError> {
        let place = std::fs::canonicalize(folder).map_err(DesignError::io(Path::new(folder)))?;
        let all: Vec<(List, &NamedPhoto)> = (self.lists().into_iter())
            .flat_map(|(list, photos)| photos.iter().map(move |photo| (list, photo)))
            .collect();
        let file = |(list, photo): &(List, &NamedPhoto)| {
            Ok(PictureFile::read(&place.join(&photo.name), &photo.name, *list)?)
        };
        let files = all.par_iter().map(file).collect::<Result<_, DesignError>>()?;
        Ok(Pictures { place, labels: None, files })
    }

    /// Lists the training, validation, held-out and skipped pictures, and what their files say that is not obeyed.
    pub(super) fn as_remarks(&self) -> Vec<Remark> {
        let listed = |what: &str, names: &[&str]| {
            Remark::Note(format!("{what} pictures ({}): {}", names.len(), names.join(", ")))
        };
        let mut all = Vec::new();
        for (list, photos) in self.lists() {
            if list == List::HeldOut || !photos.is_empty() {
                let names: Vec<&str> = photos.iter().map(|photo| photo.name.as_str()).collect();
                all.push(listed(in_words(list), &names));
            }
        }
        if let Some((_, reason)) = self.skipped.first() {
            let names: Vec<&str> = self.skipped.iter().map(|(name, _)| name.as_str()).collect();
            let skipped = names.len();
            let of = self.set.training().len() + self.set.held_out().len() + skipped;
            let first = if skipped > 1 { "the first: " } else { "" };
            let warning =
                format!("{skipped} of {of} pictures cannot be used and are skipped; {first}{reason}");
            all.extend([Remark::Warning(warning), listed("skipped", &names)]);
        }
        // One line for each note, with the first picture.
        let mut noted: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for (name, note) in &self.notes {
            noted.entry(note).or_default().push(name);
        }
        all.extend(noted.into_iter().map(|(note, names)| {
            let others = match names.len() - 1 {
                0 => String::new(),
                1 => " and another picture".to_owned(),
                n => format!(" and {n} other pictures"),
            };
            Remark::Warning(format!("{}{others}: {note}", names[0]))
        }));
        all
    }

    /// Refuses a sensor without colour filters for photographs in colour, which it cannot show.
    pub(super) fn check_colours(
        &self,
        experiment: &Experiment,
        sensor: &SensorModel,
    ) -> Result<(), DesignError> {
        let photos = || self.set.training().iter().chain(self.set.held_out());
        let coloured = photos().filter(|p| is_coloured(p)).count();
        if coloured == 0 || sensor.cfa.colours() != [Colour::Clear] {
            return Ok(());
        }
        let message = format!(
            "`{}` is monochrome, and {coloured} of {} photographs are in colour: this camera cannot see what its pictures are compared with",
            sensor.name,
            photos().count()
        );
        let hint = "name a sensor with colour filters, or give gray photographs";
        Err(DesignError::misfit(Path::new(&experiment.sensor), &message, hint))
    }

    /// The photographs against a sensor.
    pub(super) fn against(&self, sensor: &SensorModel) -> PhotosLook {
        let enlarged = |photo: &NamedPhoto| enlarged_by(sensor, (photo.image.height, photo.image.width));
        let all = self.lists().into_iter().flat_map(|(_, photos)| photos);
        let enlarged: Vec<f64> = all.map(enlarged).filter(|by| *by > 1.0).collect();
        PhotosLook {
            training: self.set.training().len(),
            held_out: self.set.held_out().len(),
            skipped: self.skipped.len(),
            window: self.training_crops.window().max(self.scoring_crops.window()),
            enlarged: enlarged.len(),
            most_enlarged: enlarged.into_iter().fold(1.0, f64::max),
        }
    }

    /// The lists, in a fixed order.
    fn lists(&self) -> [(List, &[NamedPhoto]); 3] {
        [
            (List::Training, self.set.training()),
            (List::Validation, self.set.validation()),
            (List::HeldOut, self.set.held_out()),
        ]
    }
}

/// The name of a list.
fn in_words(list: List) -> &'static str {
    match list {
        List::Training => "training",
        List::Validation => "validation",
        List::HeldOut => "held-out",
    }
}

fn is_coloured(photo: &NamedPhoto) -> bool {
    let image = &photo.image;
    let (red, rest) = image.data.split_at(image.height * image.width);
    let (green, blue) = rest.split_at(image.height * image.width);
    let differs = |a: &[f32], b: &[f32]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > COLOUR);
    differs(red, green) || differs(green, blue)
}

/// The pictures of a folder, all for scores.
fn all_held_out(folder: &Path, window: usize, cancel: &Cancel) -> Result<Read, DesignError> {
    let Folder { photos, skipped, notes } = usable_photos(folder, window, cancel)?;
    if photos.is_empty() {
        return Err(too_few_photos(folder, &photos, &skipped, "at least one is needed"));
    }
    Ok(Read { set: PhotoSet::for_scores(photos)?, skipped, notes })
}

/// The list of built-in photographs, `photos/photos.toml`; provenance is for readers.
#[derive(Deserialize)]
struct PhotoList {
    training: Vec<PhotoEntry>,
    held_out: Vec<PhotoEntry>,
}

#[derive(Deserialize)]
struct PhotoEntry {
    file: String,
}

/// Photographs in their lists, files that cannot be used, and what is ignored of the others; see [`Folder`].
struct Read {
    set: PhotoSet,
    skipped: Vec<(String, DatasetError)>,
    notes: Vec<(String, String)>,
}

/// Of every so many training pictures, one is kept for validation.
const VALIDATION_EVERY: usize = 4;

/// Every so many pictures of a user's folder, one is held out.
const HELD_OUT_EVERY: usize = 4;

/// The built-in photographs, or a folder's: every fourth of those, by name, is held out.
fn load_photos(experiment: &Experiment, assets: &Assets, window: usize) -> Result<Read, DesignError> {
    if experiment.photos != BUILT_IN_PHOTOS {
        return folder_photos(Path::new(&experiment.photos), window, assets.cancel());
    }
    let list = assets.text("photograph list", "photos", "photos")?;
    let list: PhotoList = toml::from_str(&list.text)
        .map_err(|e| DesignError::input(&list.path)(FileError::from_toml(&list.text, &e)))?;
    let names = |entries: &[PhotoEntry]| entries.iter().map(|e| e.file.clone()).collect::<Vec<_>>();
    let split = PhotoSplit { training: names(&list.training), held_out: names(&list.held_out) };
    let mut notes = Vec::new();
    let photos = split
        .training
        .iter()
        .chain(&split.held_out)
        .map(|name| {
            let picture = load_image_bytes(assets.bytes(&format!("photos/{name}"))?, name)?;
            notes.extend(picture.notes.into_iter().map(|note| (name.clone(), note)));
            Ok(NamedPhoto { name: name.clone(), image: picture.light })
        })
        .collect::<Result<_, DesignError>>()?;
    Ok(Read { set: PhotoSet::new(photos, &split)?, skipped: Vec::new(), notes })
}

/// The pictures of a folder that hold a window, each once.
fn usable_photos(folder: &Path, window: usize, cancel: &Cancel) -> Result<Folder, DesignError> {
    let mut found = load_folder(folder, cancel)?;
    for photo in &mut found.photos {
        // A camera's own picture is softer than its pixels: halve it where enough is left.
        if photo.image.height.min(photo.image.width) >= 2 * window {
            photo.image = photo.image.box_half();
        }
    }
    found.skip(|photo| photo.check_holds(window));
    found.skip_copies();
    found.notes.retain(|(name, _)| found.photos.iter().any(|photo| photo.name == *name));
    Ok(found)
}

fn too_few_photos(
    folder: &Path,
    photos: &[NamedPhoto],
    skipped: &[(String, DatasetError)],
    hint: &str,
) -> DesignError {
    let count = if photos.is_empty() { "no picture" } else { "only one picture" };
    let reasons: Vec<String> = skipped.iter().take(3).map(|(_, reason)| reason.to_string()).collect();
    let message = match &reasons[..] {
        [] => count.to_owned(),
        _ => format!("{count} can be used, {} skipped: {}", skipped.len(), reasons.join("; ")),
    };
    DesignError::misfit(folder, &message, hint)
}

fn folder_photos(folder: &Path, window: usize, cancel: &Cancel) -> Result<Read, DesignError> {
    let Folder { photos, skipped, notes } = usable_photos(folder, window, cancel)?;
    if photos.len() < 2 {
        let hint = "at least two are needed: every fourth, or the last, is held out for scoring";
        return Err(too_few_photos(folder, &photos, &skipped, hint));
    }
    let mut split = PhotoSplit::default();
    for (i, photo) in photos.iter().enumerate() {
        let held_out =
            i % HELD_OUT_EVERY == HELD_OUT_EVERY - 1 || i + 1 == photos.len() && split.held_out.is_empty();
        let list = if held_out { &mut split.held_out } else { &mut split.training };
        list.push(photo.name.clone());
    }
    Ok(Read { set: PhotoSet::new(photos, &split)?, skipped, notes })
}
