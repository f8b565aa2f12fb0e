//! `simulate`: photographs and scenes through a lens onto a sensor.

mod chip;
mod highlights;
mod output;
mod photographs;
mod request;
mod rig;
mod shot;
pub(crate) mod spectral;

pub use petzval_camera::develop::{Demosaic, Domain, Interpolation};
use serde::{Deserialize, Serialize};

use self::request::{is_over_spectrum, result_name};
use self::rig::check_numbers;
use crate::context::Context;
use crate::error::JobError;
use crate::results::check_folder;

pub use output::Facts;
pub use request::{PictureAs, Place, RawAs, Request, Restore, Spectral};

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// Facts about each image, in the order of the request.
    pub images: Vec<Facts>,
}

/// Takes and develops all images, and writes raw frames and pictures.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    check_numbers(request)?;
    // Results are named by their image: two of one name would overwrite each other.
    let mut names = std::collections::BTreeSet::new();
    if let Some(twice) = request.images.iter().find(|path| !names.insert(result_name(path))) {
        return Err(JobError::input(
            format!("{}: another image is called `{}` too", twice.display(), result_name(twice)),
            "results are named by their image; simulate the two into different folders with --out",
        ));
    }
    let formats = (request.raw_format, request.picture_format);
    let written = names.iter().flat_map(|name| output::names(formats, name, request.isp.is_some()));
    check_folder(&request.out, written, context)?;
    let images = if is_over_spectrum(request) {
        spectral::run(request, context)?
    } else {
        photographs::run(request, context)?
    };
    Ok(Response { images })
}
