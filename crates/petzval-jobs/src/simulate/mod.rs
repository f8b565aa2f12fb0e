//! `simulate`: photographs and scenes through a lens onto a sensor.

mod chip;
mod highlights;
mod output;
mod photographs;
mod request;
mod rig;
mod shot;
mod spectral;

pub use petzval_camera::isp::{Demosaic, Domain, Interpolation};
use serde::{Deserialize, Serialize};

use self::request::{is_over_spectrum, result_name};
use self::rig::MOST_SAMPLES;
use crate::context::Context;
use crate::error::JobError;

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
    for (key, value, max) in [
        ("white_e", request.white_e, 1e7),
        ("time_s", Some(request.time_s), 1e4),
        ("gain", Some(request.gain), 1e3),
    ] {
        if let Some(value) = value.filter(|value| !(*value > 0.0 && *value <= max)) {
            let message = format!("not between 0 and {max}");
            return Err(JobError::setting(key, value, message, "a positive number"));
        }
    }
    if let Some(noise) = request.restore.and_then(|restore| restore.noise)
        && !(noise > 0.0 && noise <= 10.0)
    {
        let hint = "0.003 suits 16,000 electrons of white; more for less light";
        return Err(JobError::setting("restore", noise, "not above 0 and at most 10", hint));
    }
    if !(1..=MOST_SAMPLES).contains(&request.samples) {
        let message = format!("not between 1 and {MOST_SAMPLES}");
        let hint = "with 4, a pixel collects the light of 4 x 4 samples of the scene";
        return Err(JobError::setting("samples", request.samples, message, hint));
    }
    // Results are named by their image: two of one name would overwrite each other.
    let mut names = std::collections::BTreeSet::new();
    if let Some(twice) = request.images.iter().find(|path| !names.insert(result_name(path))) {
        return Err(JobError::input(
            format!("{}: another image is called `{}` too", twice.display(), result_name(twice)),
            "results are named by their image; simulate the two into different folders with --out",
        ));
    }
    let images = match is_over_spectrum(request) {
        true => spectral::run(request, context)?,
        false => photographs::run(request, context)?,
    };
    Ok(Response { images })
}
