//! Photographs and PSFs in memory, which a simulation takes in place of files.

use std::borrow::Cow;
use std::path::Path;

use petzval_camera::image::LinearImage;
use petzval_camera::psf::PsfBank;
use petzval_design::error::DesignError;

use super::request::{Kind, Request, kind};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::noted_pictures::NotedPictures;
use crate::pixels::{check_picture, check_psfs};

/// Photographs and PSFs in memory.
#[derive(Clone, Copy, Debug, Default)]
pub struct InMemory<'a> {
    /// Photographs by name: three planes in linear light, 1 is white. `images` of the request lists the names, beside scenes and files.
    pub photos: &'a [(&'a str, &'a LinearImage)],
    /// PSFs in place of those of the lens. No distortion is rendered.
    pub psfs: Option<&'a PsfBank>,
}

impl<'a> InMemory<'a> {
    /// Refuses what is no picture or no bank of PSFs, and what the request does not use.
    pub(super) fn check(&self, request: &Request) -> Result<()> {
        for (name, photo) in self.photos {
            check_picture(photo, name)?;
            if !request.images.iter().any(|image| image == Path::new(name)) {
                let message = format!("{name}: a photograph that `images` does not list");
                return Err(JobError::input(message, "list its name among `images`"));
            }
            if kind(Path::new(name)) != Kind::Photo {
                let message = format!("{name}: the name of a scene or of a spectral image");
                return Err(JobError::input(message, "give the photograph a plain name"));
            }
        }
        match (self.psfs, &request.psfs) {
            (Some(_), Some(path)) => {
                let message = "there are PSFs in memory, too";
                Err(JobError::setting("psfs", path.display(), message, "leave one of the two out"))
            }
            (Some(bank), None) => check_psfs(bank),
            (None, _) => Ok(()),
        }
    }

    /// The light of a photograph in memory or in a file; warns of statements of the file that are ignored.
    pub(super) fn photograph(&self, path: &Path, context: &Context) -> Result<Cow<'a, LinearImage>> {
        if let Some((_, photo)) = self.photos.iter().find(|(name, _)| path == Path::new(name)) {
            return Ok(Cow::Borrowed(*photo));
        }
        Ok(Cow::Owned(NotedPictures::new(context).light(path).map_err(DesignError::from)?))
    }
}
