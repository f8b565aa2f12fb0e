//! Photographs: the built-in ones, or those of a folder, a list or tar shards.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use petzval_base::{FileError, counted};
use petzval_camera::image::LinearImage;
use petzval_camera::sensor::{Colour, SensorModel};
use petzval_files::{PictureNotes, load_image_bytes};
use petzval_learn::dataset::{
    CropPlan, DatasetError, FoundPhotos, List, Photo, PhotoSearch, PhotoSet, PhotoSplit, PictureFile,
    READ_AT_ONCE, find_photos,
};
use rayon::prelude::*;
use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::ahead::{PhotosAhead, TrainingPhotos};
use crate::assets::Assets;
use crate::error::{DesignError, Result};
use crate::experiment::{BUILT_IN_PHOTOS, Experiment};
use crate::run::input_list::Pictures;
use crate::task::{PhotosLook, Purpose, Remark, WindowPlan, enlarged_by};

/// Difference between the planes of a picture, of white, above which it is in colour.
const COLOUR: f32 = 0.01;

/// Most pictures of a set that is read later which are looked at for colour, evenly spread.
const MOST_SEEN_FOR_COLOUR: usize = 64;

/// Most names of a list that a remark shows, and how many of a longer one.
const NAMED: usize = 200;
const NAMED_OF_MORE: usize = 20;

/// Photographs, and how windows of them are cut.
pub struct Photographs {
    /// Training and held-out photographs, and those of validations where there are any, with the cut of training windows.
    pub source: Arc<TrainingPhotos>,
    /// Pictures of the folder that cannot be used, each with the reason.
    pub skipped: Vec<(String, DatasetError)>,
    /// What picture files say that was not obeyed, such as a colour profile, each with the name of the picture.
    pub notes: Vec<(String, String)>,
    /// How held-out windows are cut.
    pub scoring_crops: CropPlan,
    /// Training windows of the next steps.
    pub(super) ahead: PhotosAhead,
    /// Held-out pictures that `scoring.pictures` leaves out.
    not_scored: usize,
}

impl Photographs {
    /// Lists the photographs of an experiment, and reads those of a small set ([`find_photos`]). Where they are for scores alone, all those of its
    /// folder are held out.
    pub fn load(plan: &WindowPlan) -> Result<Self> {
        let WindowPlan { experiment, assets, training_crops, scoring_crops, purpose, .. } = *plan;
        let memory = experiment.reading.bytes();
        // Windows of the next steps take a part of the memory, and what is being decoded.
        let search = |window: usize| PhotoSearch {
            window,
            most_bytes: memory / 4 * 3,
            read_at_once: READ_AT_ONCE,
            cancel: assets.cancel(),
        };
        let Read { set, skipped, notes } = match purpose {
            Purpose::Training => {
                let search = search(training_crops.window().max(scoring_crops.window()));
                let read = load_photos(experiment, assets, &search)?;
                let validated = experiment.validation.is_used();
                let set = if validated { read.set.with_validation(VALIDATION_EVERY)? } else { read.set };
                training_crops.check(set.training())?;
                Read { set, ..read }
            }
            Purpose::TrainingOf(listed) => {
                let window = training_crops.window().max(scoring_crops.window());
                let limits_scores = experiment.scoring.pictures > 0;
                let read =
                    photos_of_run(Path::new(&experiment.photos), listed, limits_scores, &search(window))?;
                training_crops.check(read.set.training())?;
                read
            }
            Purpose::Scores => all_held_out(Path::new(&experiment.photos), &search(scoring_crops.window()))?,
        };
        let all = set.held_out().len();
        let set = set.with_held_out(experiment.scoring.pictures);
        scoring_crops.check(set.held_out())?;
        let not_scored = all - set.held_out().len();
        let source = Arc::new(TrainingPhotos { set, crops: training_crops });
        let ahead = PhotosAhead::new(&source, experiment.training.batch, memory / 8);
        Ok(Self { source, skipped, notes, scoring_crops, ahead, not_scored })
    }

    /// The photographs.
    pub fn set(&self) -> &PhotoSet {
        &self.source.set
    }

    /// Whether they are read when they are needed, and not at the start.
    pub(super) fn are_read_later(&self) -> bool {
        self.set().first_reads().is_some()
    }

    /// Adds every photograph by list, name and light to a hash. Reads them all.
    pub(super) fn add_to(&self, hash: &mut Sha256) -> Result<()> {
        for (list, photos) in self.lists() {
            let list = in_words(list).replace('-', " ");
            for photo in photos {
                let light = self.set().light(photo)?;
                hash.update(format!("{list}: {} {}x{}", photo.name, light.height, light.width));
                for value in &light.data {
                    hash.update(value.to_le_bytes());
                }
            }
        }
        Ok(())
    }

    /// The files of photographs of a folder, a list or shards, with the digest of each if they `are_read`.
    pub(super) fn files(&self, place: &str, are_read: bool) -> Result<Pictures> {
        let place = std::fs::canonicalize(place).map_err(DesignError::io(Path::new(place)))?;
        let all: Vec<(List, &Photo)> = (self.lists().into_iter())
            .flat_map(|(list, photos)| photos.iter().map(move |photo| (list, photo)))
            .collect();
        let file = |(list, photo): &(List, &Photo)| {
            let stored = photo.file().map(|file| PictureFile::stored(file, *list, are_read)).transpose()?;
            Ok(stored.map(|file| PictureFile { name: photo.name.clone(), ..file }))
        };
        let files = all.par_iter().map(file).collect::<Result<Vec<_>>>()?;
        Ok(Pictures { place, files: files.into_iter().flatten().collect(), ..Pictures::default() })
    }

    /// Lists the training, validation, held-out and skipped pictures, and what their files say that is not obeyed.
    pub(super) fn as_remarks(&self) -> Vec<Remark> {
        let listed = |what: &str, names: &[&str]| {
            let shown = if names.len() > NAMED { NAMED_OF_MORE } else { names.len() };
            let more = match names.len() - shown {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            Remark::Note(format!("{what} pictures ({}): {}{more}", names.len(), names[..shown].join(", ")))
        };
        let mut all = Vec::new();
        // Pictures for scores alone may be any: nobody has held them out.
        let trains = !self.set().training().is_empty();
        for (list, photos) in self.lists() {
            if list == List::HeldOut || !photos.is_empty() {
                let names: Vec<&str> = photos.iter().map(|photo| photo.name.as_str()).collect();
                all.push(listed(if trains { in_words(list) } else { "scored" }, &names));
            }
        }
        if let Some((_, reason)) = self.skipped.first() {
            let names: Vec<&str> = self.skipped.iter().map(|(name, _)| name.as_str()).collect();
            let skipped = names.len();
            let of = self.set().training().len() + self.set().held_out().len() + skipped;
            let first = if skipped > 1 { "the first: " } else { "" };
            let warning =
                format!("{skipped} of {of} pictures cannot be used and are skipped; {first}{reason}");
            all.extend([Remark::Warning(warning), listed("skipped", &names)]);
        }
        if self.are_read_later() {
            let text = "pictures are read when they are needed; a damaged one stops the run then, and `petzval data check` finds it before";
            all.push(Remark::Note(text.to_owned()));
        }
        if self.not_scored > 0 {
            let further =
                counted(self.not_scored, if trains { "further held-out picture" } else { "further picture" });
            all.push(Remark::Note(format!("not scored, by `scoring.pictures`: {further}")));
        }
        let mut noted = PictureNotes::default();
        for (name, note) in &self.notes {
            noted.add(name, [note]);
        }
        all.extend(noted.clauses().into_iter().map(Remark::Warning));
        all
    }

    /// Refuses a sensor without colour filters for photographs in colour, which it cannot show. Of a set that is read later some are looked at.
    pub(super) fn check_colours(&self, experiment: &Experiment, sensor: &SensorModel) -> Result<()> {
        if sensor.cfa.colours() != [Colour::Clear] {
            return Ok(());
        }
        let photos: Vec<&Photo> = self.set().training().iter().chain(self.set().held_out()).collect();
        let seen = if self.are_read_later() { photos.len().min(MOST_SEEN_FOR_COLOUR) } else { photos.len() };
        let is_coloured = |i: usize| {
            let light = self.set().light(photos[i * photos.len() / seen])?;
            Ok(is_coloured(&light))
        };
        let coloured = (0..seen).into_par_iter().map(is_coloured).collect::<Result<Vec<bool>>>()?;
        let coloured = coloured.into_iter().filter(|is_coloured| *is_coloured).count();
        if coloured == 0 {
            return Ok(());
        }
        let message = format!(
            "`{}` is monochrome, and {coloured} of {seen} photographs are in colour: this camera cannot see what its pictures are compared with",
            sensor.name
        );
        let hint = "name a sensor with colour filters, or give gray photographs";
        Err(DesignError::misfit(Path::new(&experiment.sensor), &message, hint))
    }

    /// The photographs against a sensor.
    pub(super) fn against(&self, sensor: &SensorModel) -> PhotosLook {
        let enlarged = |photo: &Photo| enlarged_by(sensor, (photo.height, photo.width));
        let all = self.lists().into_iter().flat_map(|(_, photos)| photos);
        let enlarged: Vec<f64> = all.map(enlarged).filter(|by| *by > 1.0).collect();
        PhotosLook {
            training: self.set().training().len(),
            held_out: self.set().held_out().len(),
            skipped: self.skipped.len(),
            window: self.source.crops.window().max(self.scoring_crops.window()),
            enlarged: enlarged.len(),
            most_enlarged: enlarged.into_iter().fold(1.0, f64::max),
        }
    }

    /// The lists, in a fixed order.
    fn lists(&self) -> [(List, &[Photo]); 3] {
        [
            (List::Training, self.set().training()),
            (List::Validation, self.set().validation()),
            (List::HeldOut, self.set().held_out()),
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

fn is_coloured(image: &LinearImage) -> bool {
    let (red, rest) = image.data.split_at(image.height * image.width);
    let (green, blue) = rest.split_at(image.height * image.width);
    let differs = |a: &[f32], b: &[f32]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > COLOUR);
    differs(red, green) || differs(green, blue)
}

/// The pictures of a place, all for scores.
fn all_held_out(place: &Path, search: &PhotoSearch) -> Result<Read> {
    let FoundPhotos { photos, skipped, notes, readers } = find_photos(place, search)?;
    if photos.is_empty() {
        return Err(too_few_photos(place, photos.len(), &skipped, "at least one is needed"));
    }
    Ok(Read { set: PhotoSet::for_scores(photos, readers)?, skipped, notes })
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

/// Photographs in their lists, files that cannot be used, and what is ignored of the others; see [`FoundPhotos`].
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
fn load_photos(experiment: &Experiment, assets: &Assets, search: &PhotoSearch) -> Result<Read> {
    if experiment.photos != BUILT_IN_PHOTOS {
        return own_photos(Path::new(&experiment.photos), search);
    }
    let split = built_in_photos(assets)?;
    let mut notes = Vec::new();
    let photos = split
        .training
        .iter()
        .chain(&split.held_out)
        .map(|name| {
            let picture = load_image_bytes(assets.bytes(&format!("photos/{name}"))?, name)?;
            notes.extend(picture.notes.into_iter().map(|note| (name.clone(), note)));
            Ok(Photo::here(name.clone(), picture.light))
        })
        .collect::<Result<_>>()?;
    Ok(Read { set: PhotoSet::new(photos, &split)?, skipped: Vec::new(), notes })
}

/// The names of the built-in photographs, by their list.
pub(crate) fn built_in_photos(assets: &Assets) -> Result<PhotoSplit> {
    let list = assets.text("photograph list", "photos", "photos")?;
    let list: PhotoList = toml::from_str(&list.text)
        .map_err(|e| DesignError::input(&list.path)(FileError::from_toml(&list.text, &e)))?;
    let names = |entries: &[PhotoEntry]| entries.iter().map(|e| e.file.clone()).collect::<Vec<_>>();
    Ok(PhotoSplit { training: names(&list.training), held_out: names(&list.held_out) })
}

fn too_few_photos(place: &Path, found: usize, skipped: &[(String, DatasetError)], hint: &str) -> DesignError {
    let count = if found == 0 { "no picture" } else { "only one picture" };
    let reasons: Vec<String> = skipped.iter().take(3).map(|(_, reason)| reason.to_string()).collect();
    let message = match &reasons[..] {
        [] => count.to_owned(),
        _ => format!("{count} can be used, {} skipped: {}", skipped.len(), reasons.join("; ")),
    };
    DesignError::misfit(place, &message, hint)
}

fn own_photos(place: &Path, search: &PhotoSearch) -> Result<Read> {
    let FoundPhotos { photos, skipped, notes, readers } = find_photos(place, search)?;
    let count = photos.len();
    if count < 2 {
        let hint = "at least two are needed: every fourth, or the last, is held out for scoring";
        return Err(too_few_photos(place, count, &skipped, hint));
    }
    let (mut training, mut held_out) = (Vec::new(), Vec::new());
    for (i, photo) in photos.into_iter().enumerate() {
        let is_held_out = i % HELD_OUT_EVERY == HELD_OUT_EVERY - 1 || i + 1 == count && held_out.is_empty();
        let list = if is_held_out { &mut held_out } else { &mut training };
        list.push(photo);
    }
    let set = PhotoSet::of_lists([training, Vec::new(), held_out], readers)?;
    Ok(Read { set, skipped, notes })
}

/// The photographs of a run at a place where they may have other names and another order: each with the name, in the list and at the place in it
/// that it has in the run. They are known by the SHA-256 of their files.
///
/// Fails where one is missing, and where the place holds more than the run had: those are other pictures. Where the run `limits_scores`, it had
/// held-out ones that are not `listed`.
fn photos_of_run(place: &Path, listed: &Pictures, limits_scores: bool, search: &PhotoSearch) -> Result<Read> {
    let FoundPhotos { photos, skipped, notes, readers } = find_photos(place, search)?;
    let others = || DesignError::misfit(place, &"holds other pictures than those of the run", "name another");
    let held_out = listed.files.iter().filter(|file| file.list == List::HeldOut).count();
    let trained = listed.files.len() - held_out;
    let most_held_out = (trained / (HELD_OUT_EVERY - 1)).max(1);
    let most = trained + if limits_scores { held_out.max(most_held_out) } else { held_out };
    if photos.len() > most {
        return Err(others());
    }
    let digest = |photo: &Photo| {
        search.cancel.check()?;
        let file = photo.file().map(|file| PictureFile::stored(file, List::HeldOut, true)).transpose()?;
        Ok(file.and_then(|file| file.sha256))
    };
    let digests = photos.par_iter().map(digest).collect::<Result<Vec<_>, DatasetError>>()?;
    let known = digests.into_iter().zip(photos).filter_map(|(digest, photo)| Some((digest?, photo)));
    let by_digest: HashMap<String, Photo> = known.collect();
    let mut lists: [Vec<Photo>; 3] = Default::default();
    for file in &listed.files {
        let found = file.sha256.as_ref().and_then(|sha256| by_digest.get(sha256)).ok_or_else(others)?;
        let list = match file.list {
            List::Training => 0,
            List::Validation => 1,
            List::HeldOut => 2,
        };
        lists[list].push(found.renamed(&file.name));
    }
    Ok(Read { set: PhotoSet::of_lists(lists, readers)?, skipped, notes })
}
