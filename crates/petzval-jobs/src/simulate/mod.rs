//! `simulate`: photographs and scenes through a lens onto a sensor.

mod accuracy;
mod chip;
mod frame;
mod highlights;
mod memory;
mod output;
mod patchwise;
mod photographs;
mod request;
mod rig;
mod shot;
pub(crate) mod spectral;
pub mod view;

pub use petzval_camera::develop::{Demosaic, Domain, Interpolation};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::request::result_name;
use self::rig::check_numbers;
use self::shot::Each;
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::results::check_folder;

pub use frame::Frame;
pub use memory::InMemory;
pub use output::Facts;
pub use photographs::Photographer;
pub use request::{PictureAs, Place, RawAs, Request, Restore, Spectral, is_over_spectrum};
pub use shot::Taken;

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Facts about each image, in the order of the request.
    pub images: Vec<Facts>,
}

/// Takes and develops all images; writes nothing.
pub fn frames(request: &Request, context: &Context) -> Result<Vec<Frame>> {
    frames_of(request, InMemory::default(), context)
}

/// [`frames`], with photographs and PSFs in memory in place of files.
pub fn frames_of(request: &Request, memory: InMemory<'_>, context: &Context) -> Result<Vec<Frame>> {
    check_numbers(request)?;
    memory.check(request)?;
    let mut frames = Vec::new();
    take(request, memory, context, &mut |rig, body, name, taken| {
        let (frame, warnings) = Frame::of(request, rig, body, name, taken)?;
        frames.push(frame);
        Ok((Facts::new(), warnings))
    })?;
    Ok(frames)
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit::seeded(|request, seed| request.seed = seed, |request, folder| request.out = folder.to_owned());

/// Takes and develops all images, and writes raw frames and pictures.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
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
    let images = take(request, InMemory::default(), context, &mut |rig, body, name, taken| {
        let (frame, warnings) = Frame::of(request, rig, body, name, taken)?;
        Ok((frame.write(formats, &request.out, context)?, warnings))
    })?;
    Ok(Response { images })
}

/// Takes all images, over the spectrum or in three colours, and gives each frame to `each`; returns the facts that it returns.
fn take(
    request: &Request,
    memory: InMemory<'_>,
    context: &Context,
    each: &mut Each<'_>,
) -> Result<Vec<Facts>> {
    if is_over_spectrum(request) {
        spectral::run(request, memory, context, each)
    } else {
        photographs::run(request, memory, context, each)
    }
}
