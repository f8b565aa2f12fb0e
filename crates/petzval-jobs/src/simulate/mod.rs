//! `simulate`: photographs and scenes through a lens onto a sensor.

mod chip;
mod highlights;
mod memory;
mod output;
mod photographs;
mod request;
mod rig;
mod shot;
pub(crate) mod spectral;

pub use petzval_camera::develop::{Demosaic, Domain, Interpolation};
use petzval_camera::sensor::SensorModel;
use petzval_design::camera::Camera;
use petzval_files::raw_file::{FrameCalibration, RawFrame};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::request::{is_over_spectrum, result_name};
use self::rig::{Rig, check_numbers};
use self::shot::{Each, write_shot};
use crate::context::Context;
use crate::error::JobError;
use crate::results::check_folder;

pub use memory::InMemory;
pub use output::Facts;
pub use request::{PictureAs, Place, RawAs, Request, Restore, Spectral};
pub use shot::Taken;

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Facts about each image, in the order of the request.
    pub images: Vec<Facts>,
}

/// A frame of a simulated camera as values: what `simulate` keeps as files.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Name of the image, as results are named by it.
    pub name: String,
    /// The raw frame and what was developed from it.
    pub taken: Taken,
    /// The sensor, balanced for the light of the scene.
    pub sensor: SensorModel,
    /// Photoelectrons that white gives in a green pixel on the axis.
    pub white_e: f32,
    /// What an ISP may know of the raw frame; none where the sensor has no Bayer array.
    pub calibration: Option<FrameCalibration>,
}

impl Frame {
    /// The raw frame in whole digital numbers, with sensor and exposure: what `isp develop` takes.
    pub fn raw(&self) -> RawFrame {
        RawFrame::from_raw(&self.taken.raw, &self.sensor)
    }
}

/// Takes and develops all images; writes nothing.
pub fn frames(request: &Request, context: &Context) -> Result<Vec<Frame>, JobError> {
    frames_of(request, InMemory::default(), context)
}

/// [`frames`], with photographs and PSFs in memory in place of files.
pub fn frames_of(request: &Request, memory: InMemory<'_>, context: &Context) -> Result<Vec<Frame>, JobError> {
    check_numbers(request)?;
    memory.check(request)?;
    let mut frames = Vec::new();
    take(request, memory, context, &mut |rig, camera, name, taken| {
        let body = camera.body();
        let (sensor, white_e) = (body.sensor.clone(), body.exposure.white_e);
        let calibration = calibration(rig, camera, &taken)?;
        frames.push(Frame { name: name.to_owned(), taken, sensor, white_e, calibration });
        Ok((Facts::new(), None))
    })?;
    Ok(frames)
}

/// What an ISP may know of a frame of a Bayer array.
fn calibration(rig: &Rig, camera: &Camera, taken: &Taken) -> Result<Option<FrameCalibration>, JobError> {
    let body = camera.body();
    let frame = || chip::frame(rig, &body.sensor, taken.for_chip(), body.isp.colour_matrix);
    let frame = body.sensor.cfa.is_bayer().then(frame).transpose()?;
    Ok(frame.map(|frame| FrameCalibration::of(&frame.about)))
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
    let images = take(request, InMemory::default(), context, &mut |rig, camera, name, taken| {
        write_shot(request, rig, camera, name, &taken, context)
    })?;
    Ok(Response { images })
}

/// Takes all images, over the spectrum or in three colours, and gives each frame to `each`; returns the facts that it returns.
fn take(
    request: &Request,
    memory: InMemory<'_>,
    context: &Context,
    each: &mut Each<'_>,
) -> Result<Vec<Facts>, JobError> {
    if is_over_spectrum(request) {
        spectral::run(request, memory, context, each)
    } else {
        photographs::run(request, memory, context, each)
    }
}
