//! A photograph, which may not be read yet.

use std::sync::Arc;

use petzval_camera::image::LinearImage;
use petzval_files::{StoredPicture, load_image_bytes};

use super::shelf::Shelf;
use super::{DatasetError, FirstReads};

/// A picture, and its name in lists, logs and errors.
#[derive(Clone, Debug)]
pub struct Photo {
    /// Its name, such as `coffee.png`.
    pub name: String,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    light: Light,
}

/// Where the light of a photograph is.
#[derive(Clone, Debug)]
enum Light {
    Here(Arc<LinearImage>),
    Stored {
        picture: Arc<StoredPicture>,
        /// Whether every 2 x 2 pixels of the file are one of the photograph.
        halved: bool,
        /// SHA-256 of its light, if all pictures were read at the start.
        digest: Option<[u8; 32]>,
    },
}

/// What the photographs of a set share.
#[derive(Debug)]
pub struct Readers {
    /// Light that is kept.
    pub shelf: Shelf<LinearImage>,
    /// Digests of files from their first read, where they are not read at the start.
    pub reads: Option<FirstReads>,
}

impl Default for Readers {
    /// For photographs that are all in memory.
    fn default() -> Self {
        Self { shelf: Shelf::new(0), reads: None }
    }
}

impl Photo {
    /// A photograph in memory, linear light.
    pub fn here(name: impl Into<String>, image: LinearImage) -> Self {
        let LinearImage { height, width, .. } = image;
        Self { name: name.into(), height, width, light: Light::Here(Arc::new(image)) }
    }

    /// A photograph of a file of so many rows and columns, which become half as many if it is to be halved.
    pub(super) fn stored(
        picture: StoredPicture,
        [rows, columns]: [usize; 2],
        halved: bool,
        digest: Option<[u8; 32]>,
    ) -> Self {
        let by = if halved { 2 } else { 1 };
        let name = picture.name.clone();
        let light = Light::Stored { picture: Arc::new(picture), halved, digest };
        Self { name, height: rows / by, width: columns / by, light }
    }

    /// The same photograph under another name.
    pub fn renamed(&self, name: &str) -> Self {
        Self { name: name.to_owned(), ..self.clone() }
    }

    /// Its file; none of a photograph in memory.
    pub fn file(&self) -> Option<&StoredPicture> {
        match &self.light {
            Light::Here(_) => None,
            Light::Stored { picture, .. } => Some(picture),
        }
    }

    /// SHA-256 of its light, if it was read at the start.
    pub(super) fn digest(&self) -> Option<[u8; 32]> {
        match &self.light {
            Light::Here(_) => None,
            Light::Stored { digest, .. } => *digest,
        }
    }

    /// Whether both are known to have the same light.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        match (&self.light, &other.light) {
            (Light::Here(own), Light::Here(other)) => own == other,
            _ => self.digest().is_some() && self.digest() == other.digest(),
        }
    }

    /// Its light: the kept one, or read from its file. Fails with the name of the file, and if it has another size than when the set was listed or
    /// another content than at its first read.
    pub fn light(&self, readers: &Readers) -> Result<Arc<LinearImage>, DatasetError> {
        let (picture, halved) = match &self.light {
            Light::Here(image) => return Ok(image.clone()),
            Light::Stored { picture, halved, .. } => (picture, *halved),
        };
        // Light is kept by the name in the place: a photograph may have got another one.
        readers.shelf.get(&picture.name, || {
            let bytes = picture.bytes()?;
            let image = load_image_bytes(&bytes, &picture.display())?.light;
            // A damaged picture is not noted: it may be repaired.
            if let Some(reads) = &readers.reads {
                reads.note(&self.name, || picture.path().to_owned(), &bytes)?;
            }
            drop(bytes);
            let image = if halved { image.box_half() } else { image };
            if (image.height, image.width) != (self.height, self.width) {
                let path = picture.path().to_owned();
                return Err(DatasetError::Changed { path, name: self.name.clone() });
            }
            Ok(image)
        })
    }

    /// Refuses a picture that cannot hold a square window of `needed` pixels a side.
    pub fn check_holds(&self, needed: usize) -> Result<(), DatasetError> {
        let Self { height, width, .. } = *self;
        if height >= needed && width >= needed {
            return Ok(());
        }
        Err(DatasetError::PhotoTooSmall { name: self.name.clone(), height, width, needed })
    }
}
