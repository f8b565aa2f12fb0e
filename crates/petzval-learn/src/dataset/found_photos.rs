//! The photographs of a folder, a list or shards: which can be used.

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use petzval_base::Cancel;
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_files::{Picture, StoredPicture, digests_of_alike, stored_pictures};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::photo::{Photo, Readers};
use super::shelf::Shelf;
use super::{DatasetError, FirstReads};

/// Bytes of light up to which all pictures of a set are read at its start: 1 GiB, 90 million pixels.
pub const READ_AT_ONCE: u64 = 1 << 30;

/// How photographs are looked for.
#[derive(Clone, Copy, Debug)]
pub struct PhotoSearch<'a> {
    /// Side of the windows that a photograph must hold, pixels.
    pub window: usize,
    /// Bytes of light that are kept.
    pub most_bytes: u64,
    /// Bytes of light up to which all pictures are read at the start, see [`READ_AT_ONCE`].
    pub read_at_once: u64,
    /// What stops the search.
    pub cancel: &'a Cancel,
}

/// The photographs of a place.
#[derive(Debug)]
pub struct FoundPhotos {
    /// Those that can be used, in the order of their set.
    pub photos: Vec<Photo>,
    /// Names of the others, each with the reason.
    pub skipped: Vec<(String, DatasetError)>,
    /// What files say that was not obeyed ([`Picture::notes`]), with the name of the picture; of pictures that are read later nothing is known.
    pub notes: Vec<(String, String)>,
    /// What reads and keeps them.
    pub readers: Readers,
}

impl FoundPhotos {
    /// Whether they are read when they are needed, and not at the start.
    pub fn are_read_later(&self) -> bool {
        self.readers.reads.is_some()
    }
}

/// The photographs of a folder, a list or shards ([`stored_pictures`]) that hold a window, each once.
///
/// A picture both of whose sides are twice that of the window is halved: a camera's own picture is softer than its pixels.
///
/// Pictures whose light takes up to `read_at_once` bytes together are all read: damaged ones are skipped, and those with the light of an earlier
/// one. Of a larger set only the heads of files are read, so that it starts in seconds: pictures are skipped if the head is damaged, or if
/// their file equals an earlier one. What is damaged behind its head is an error when it is read.
///
/// Fails on a place without pictures, and with [`DatasetError::Stopped`] once `cancel` is set.
pub fn find_photos(place: &Path, search: &PhotoSearch) -> Result<FoundPhotos, DatasetError> {
    let stored = stored_pictures(place)?;
    let size = |picture: &StoredPicture| {
        search.cancel.check()?;
        Ok(picture.size())
    };
    let sizes = stored.par_iter().map(size).collect::<Result<Vec<_>, DatasetError>>()?;
    let light_bytes = |[rows, columns]: [usize; 2]| (size_of::<f32>() * CHANNELS * rows * columns) as u64;
    let all: u64 = sizes.iter().flatten().map(|size| light_bytes(*size)).sum();
    let mut found = FoundPhotos {
        photos: Vec::new(),
        skipped: Vec::new(),
        notes: Vec::new(),
        readers: Readers {
            shelf: Shelf::new(search.most_bytes),
            reads: (all > search.read_at_once).then(FirstReads::default),
        },
    };
    let looked_at = if found.are_read_later() {
        let photo = |(picture, size): (StoredPicture, Result<[usize; 2], _>)| {
            let name = picture.name.clone();
            match size {
                Ok(size) => Ok((Photo::stored(picture, size, search.halves(size), None), Vec::new())),
                Err(error) => Err((name, DatasetError::from(error))),
            }
        };
        stored.into_iter().zip(sizes).map(photo).collect()
    } else {
        read_all(stored, search, &found.readers.shelf)?
    };
    for looked_at in looked_at {
        match looked_at {
            Ok((photo, notes)) => {
                found.notes.extend(notes.into_iter().map(|note| (photo.name.clone(), note)));
                found.photos.push(photo);
            }
            Err(skipped) => found.skipped.push(skipped),
        }
    }
    let photos = std::mem::take(&mut found.photos);
    for photo in photos {
        match photo.check_holds(search.window) {
            Ok(()) => found.photos.push(photo),
            Err(reason) => found.skipped.push((photo.name, reason)),
        }
    }
    found.skip_copies(search.cancel)?;
    let used: HashSet<&str> = found.photos.iter().map(|photo| photo.name.as_str()).collect();
    found.notes.retain(|(name, _)| used.contains(name.as_str()));
    Ok(found)
}

impl PhotoSearch<'_> {
    /// Whether a picture of so many rows and columns is halved.
    fn halves(&self, [rows, columns]: [usize; 2]) -> bool {
        rows.min(columns) >= 2 * self.window
    }
}

/// A photograph with what its file says that was not obeyed, or its name with the reason why it cannot be used.
type LookedAt = Result<(Photo, Vec<String>), (String, DatasetError)>;

/// Reads pictures, and keeps their light.
fn read_all(
    stored: Vec<StoredPicture>,
    search: &PhotoSearch,
    shelf: &Shelf<LinearImage>,
) -> Result<Vec<LookedAt>, DatasetError> {
    let read = |picture: StoredPicture| {
        search.cancel.check()?;
        let Picture { light, notes, .. } = match picture.load() {
            Ok(picture) => picture,
            Err(error) => return Ok(Err((picture.name, error.into()))),
        };
        let size = [light.height, light.width];
        let halved = search.halves(size);
        let light = if halved { light.box_half() } else { light };
        let photo = Photo::stored(picture, size, halved, Some(digest_of(&light)));
        shelf.put(&photo.name, Arc::new(light));
        Ok(Ok((photo, notes)))
    };
    stored.into_par_iter().map(read).collect()
}

/// SHA-256 of the light of a picture, with its size.
fn digest_of(light: &LinearImage) -> [u8; 32] {
    let mut hash = Sha256::new();
    hash.update(light.height.to_le_bytes());
    let mut bytes = Vec::with_capacity(size_of::<f32>() * light.width);
    for row in light.data.chunks(light.width.max(1)) {
        bytes.clear();
        bytes.extend(row.iter().flat_map(|value| value.to_le_bytes()));
        hash.update(&bytes);
    }
    hash.finalize().into()
}

impl FoundPhotos {
    /// Takes out every photograph that is the same as an earlier one.
    fn skip_copies(&mut self, cancel: &Cancel) -> Result<(), DatasetError> {
        let digests = if self.are_read_later() {
            let files: Vec<_> = self.photos.iter().map(Photo::file).collect();
            digests_of_alike(&files, cancel)?
        } else {
            self.photos.iter().map(Photo::digest).collect()
        };
        let mut first: HashMap<[u8; 32], String> = HashMap::new();
        let photos = std::mem::take(&mut self.photos);
        for (photo, digest) in photos.into_iter().zip(digests) {
            let earlier = digest.and_then(|digest| first.get(&digest));
            match (earlier, digest) {
                (Some(earlier), _) => {
                    let reason = DatasetError::Copy { name: photo.name.clone(), first: earlier.clone() };
                    self.skipped.push((photo.name, reason));
                }
                (None, digest) => {
                    if let Some(digest) = digest {
                        first.insert(digest, photo.name.clone());
                    }
                    self.photos.push(photo);
                }
            }
        }
        Ok(())
    }
}
