//! `simulate` for photographs in three colours.

use petzval_camera::image::LinearImage;
use petzval_camera::isp::LinearIsp;
use petzval_design::error::DesignError;

use super::highlights::default_white_e;
use super::output::Facts;
use super::request::{Request, result_name};
use super::rig::Rig;
use super::shot::{Taken, noise, photograph, placed, write_shot};
use crate::context::Context;
use crate::error::{JobError, make_folder};
/// Takes all images.
pub fn run(request: &Request, context: &Context) -> Result<Vec<Facts>, JobError> {
    // Every image is read before anything is written.
    let photos: Vec<(String, LinearImage)> = (request.images.iter())
        .map(|path| Ok((result_name(path), photograph(path, context)?)))
        .collect::<Result<_, JobError>>()?;
    let rig = Rig::new(request, context)?;
    let white_e = match request.white_e {
        Some(white_e) => white_e,
        None => default_white_e(request, &rig.sensor)?,
    };
    let camera = rig.camera(request, rig.sensor.clone(), white_e, LinearIsp::default())?;
    make_folder(&request.out)?;
    let mut written = Vec::new();
    for (frame, (name, photo)) in photos.iter().enumerate() {
        context.progress(frame as u64, photos.len() as u64, name);
        let (picture, frame) = (placed(request, photo, rig.frame), frame as u64);
        let taken = match rig.samples {
            1 => {
                let shot = rig.shot(&picture, frame)?;
                let frames = camera.take(std::slice::from_ref(&shot), &noise(request))?;
                Taken::new(&frames, camera.capture(&shot))?
            }
            _ => {
                let light = rig.light(&picture).map_err(DesignError::from)?;
                Taken::of_light(request, &rig, &camera, &light, frame)?
            }
        };
        let (facts, warning) = write_shot(request, &camera, name, &taken)?;
        warning.into_iter().for_each(|warning| context.warning(warning));
        written.push(facts);
    }
    context.progress(photos.len() as u64, photos.len() as u64, "");
    Ok(written)
}
