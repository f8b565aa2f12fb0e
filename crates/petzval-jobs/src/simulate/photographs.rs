//! `simulate` for photographs in three colours.

use std::borrow::Cow;

use petzval_camera::image::LinearImage;
use petzval_design::error::DesignError;

use super::highlights::default_white_e;
use super::memory::InMemory;
use super::output::Facts;
use super::request::{Place, Request, result_name};
use super::rig::{Rig, check_not_stopped};
use super::shot::{Each, Taken, noise, placed};
use crate::context::Context;
use crate::error::JobError;
use crate::event::WarningKind;

/// Takes all images, and gives each to `each`.
pub fn run(
    request: &Request,
    memory: InMemory<'_>,
    context: &Context,
    each: &mut Each<'_>,
) -> Result<Vec<Facts>, JobError> {
    // Every image is read before anything is taken.
    let photos: Vec<(String, Cow<'_, LinearImage>)> = (request.images.iter())
        .map(|path| Ok((result_name(path), memory.photograph(path, context)?)))
        .collect::<Result<_, JobError>>()?;
    let rig = Rig::new(request, memory.psfs, context)?;
    let white_e = match request.white_e {
        Some(white_e) => white_e,
        None => default_white_e(request, &rig.sensor)?,
    };
    let camera = rig.camera(request, rig.sensor.clone(), white_e, rig.isp)?;
    warn_of_small_pictures(request, &rig, &photos, context);
    let mut written = Vec::new();
    for (frame, (name, photo)) in photos.iter().enumerate() {
        check_not_stopped(frame, request, context)?;
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
        let (facts, warning) = each(&rig, &camera, name, taken)?;
        warning.into_iter().for_each(|warning| context.warning(WarningKind::Saturation, warning));
        written.push(facts);
    }
    context.progress(photos.len() as u64, photos.len() as u64, "");
    Ok(written)
}

/// A picture laid on the axis one pixel to one that is smaller than what the sensor sees is continued by its edge.
fn warn_of_small_pictures(
    request: &Request,
    rig: &Rig,
    photos: &[(String, Cow<'_, LinearImage>)],
    context: &Context,
) {
    let (height, width) = rig.frame;
    let mut small = photos.iter().filter(|(_, photo)| photo.height < height || photo.width < width);
    if request.place == Place::Centre
        && rig.distortion.is_some()
        && let Some((name, photo)) = small.next()
        && (photo.height, photo.width) == (rig.sensor.height * rig.samples, rig.sensor.width * rig.samples)
    {
        context.warning(WarningKind::Picture, format!(
            "{name}: the picture has as many pixels as the sensor, and the lens projects {height}x{width} of a rectilinear scene onto it: \
             the border repeats the picture's edge; without distortion the picture would fill the frame"
        ));
    }
}
