//! `simulate` for photographs in three colours.

use std::borrow::Cow;

use petzval_base::Cancel;
use petzval_camera::image::LinearImage;
use petzval_design::camera::{Body, Camera};
use petzval_design::error::DesignError;

use super::frame::Frame;
use super::highlights::default_white_e;
use super::memory::InMemory;
use super::output::Facts;
use super::patchwise::Patchwise;
use super::request::{Place, Request, result_name};
use super::rig::{Rig, Spread, Turned, check_not_stopped, check_numbers};
use super::shot::{Each, Taken, noise, placed};
use crate::context::Context;
use crate::error::Result;
use crate::event::WarningKind;
use crate::noted::Noted;

/// A camera for photographs in three colours that is opened once: its PSFs are traced for the first of them.
pub struct Photographer {
    request: Request,
    rig: Rig,
    taker: Taker,
}

/// What takes the photographs of a rig.
enum Taker {
    Camera(Turned, Box<Camera>),
    /// Behind a lens without rotational symmetry.
    ByPatch(Box<Patchwise>, Box<Body>),
}

impl Taker {
    fn body(&self) -> &Body {
        match self {
            Self::Camera(_, camera) => camera.body(),
            Self::ByPatch(_, body) => body,
        }
    }
}

/// Photographs by name.
type Photos<'a> = [(String, Cow<'a, LinearImage>)];

impl Photographer {
    /// Opens the camera of a request, whose images and seed do not matter.
    pub fn open(request: &Request, memory: InMemory<'_>, context: &Context) -> Result<Self> {
        check_numbers(request)?;
        memory.check(request)?;
        Self::traced(request, memory, context)
    }

    fn traced(request: &Request, memory: InMemory<'_>, context: &Context) -> Result<Self> {
        let (rig, spread) = Rig::for_photographs(request, memory.psfs, context)?;
        let white_e = match request.white_e {
            Some(white_e) => white_e,
            None => default_white_e(request, &rig.sensor)?,
        };
        let body = rig.body(request, rig.sensor.clone(), white_e, rig.isp);
        let taker = match spread {
            Spread::Turned(turned) => {
                let camera = turned.camera(body)?;
                Taker::Camera(turned, Box::new(camera))
            }
            Spread::ByPatch(lens) => Taker::ByPatch(lens, Box::new(body)),
        };
        Ok(Self { request: request.clone(), rig, taker })
    }

    /// Whether the frames of a request are those of this camera: only images and seed may be others.
    pub fn fits(&self, request: &Request) -> bool {
        let Request { images, seed, .. } = &self.request;
        self.request == Request { images: images.clone(), seed: *seed, ..request.clone() }
    }

    /// Whether it may serve other calls than the one that opened it: an external ISP is stopped with its call.
    pub fn outlasts_its_call(&self) -> bool {
        self.rig.chip.as_ref().is_none_or(|isp| !isp.is_external())
    }

    /// Takes the photographs of a request that it fits; writes nothing.
    pub fn frames(&self, request: &Request, memory: InMemory<'_>, context: &Context) -> Result<Vec<Frame>> {
        memory.check(request)?;
        let mut frames = Vec::new();
        self.take(request, &photos(request, memory, context)?, context, &mut |rig, body, name, taken| {
            let (frame, warnings) = Frame::of(request, rig, body, name, taken)?;
            frames.push(frame);
            Ok((Facts::new(), warnings))
        })?;
        Ok(frames)
    }

    /// Takes photographs, and gives each to `each`.
    fn take(
        &self,
        request: &Request,
        photos: &Photos<'_>,
        context: &Context,
        each: &mut Each<'_>,
    ) -> Result<Vec<Facts>> {
        let Self { rig, taker, .. } = self;
        warn_of_small_pictures(request, rig, photos, context);
        let (mut written, noted) = (Vec::new(), Noted::new(context, "picture"));
        for (frame, (name, photo)) in photos.iter().enumerate() {
            check_not_stopped(frame, request, context)?;
            context.progress(frame as u64, photos.len() as u64, name);
            if let Some(note) = request.place.note(photo, rig.frame) {
                noted.note(name, note);
            }
            let picture = placed(request, photo, rig.frame);
            let taken = self.taken(request, &picture, frame as u64, context.cancel())?;
            let (facts, warnings) = each(rig, taker.body(), name, taken)?;
            warnings.into_iter().for_each(|(kind, text)| noted.warning(name, kind, text));
            written.push(facts);
        }
        context.progress(photos.len() as u64, photos.len() as u64, "");
        Ok(written)
    }

    /// Takes a picture of [`Rig::frame`].
    fn taken(
        &self,
        request: &Request,
        picture: &LinearImage,
        frame: u64,
        cancel: &Cancel,
    ) -> Result<Taken, DesignError> {
        let rig = &self.rig;
        let (turned, camera) = match &self.taker {
            Taker::Camera(turned, camera) => (turned, camera.as_ref()),
            Taker::ByPatch(lens, body) => {
                return Taken::by_patch(request, rig, (lens, body), picture, frame, cancel);
            }
        };
        match rig.samples {
            1 if is_taken_in_strips(request, rig) => {
                let rows = (PIXELS_OF_A_STRIP / rig.window.width / STRIP_ROWS).max(1) * STRIP_ROWS;
                Taken::in_strips(request, rig, (turned, camera), picture, frame, rows)
            }
            1 => {
                let shot = turned.shot(rig, picture, frame)?;
                let frames = camera.take(std::slice::from_ref(&shot), &noise(request))?;
                Taken::new(&frames, camera.capture(&shot))
            }
            _ => {
                let light = turned.light(rig, picture, cancel)?;
                Taken::of_light(request, rig, camera, &light, frame)
            }
        }
    }
}

/// Takes all images, and gives each to `each`.
pub fn run(
    request: &Request,
    memory: InMemory<'_>,
    context: &Context,
    each: &mut Each<'_>,
) -> Result<Vec<Facts>> {
    // Every image is read before anything is taken.
    let photos = photos(request, memory, context)?;
    Photographer::traced(request, memory, context)?.take(request, &photos, context, each)
}

/// Pixels of a frame above which it is taken in strips: with 160 bytes a pixel it has 1.6 GB in one piece.
const LARGEST_PIECE: usize = 10_000_000;

/// Pixels of a strip, which has a multiple of these rows.
const PIXELS_OF_A_STRIP: usize = 2_000_000;
const STRIP_ROWS: usize = 64;

/// Whether frames are taken in strips: large ones, of which nothing is restored, because restoration reads far around a pixel.
fn is_taken_in_strips(request: &Request, rig: &Rig) -> bool {
    rig.window.height * rig.window.width > LARGEST_PIECE && request.restore.is_none()
}

/// The photographs of a request, from memory and from files.
fn photos<'a>(
    request: &Request,
    memory: InMemory<'a>,
    context: &Context,
) -> Result<Vec<(String, Cow<'a, LinearImage>)>> {
    request.images.iter().map(|path| Ok((result_name(path), memory.photograph(path, context)?))).collect()
}

/// A picture laid on the axis one pixel to one that is smaller than what the sensor sees is continued by its edge.
fn warn_of_small_pictures(request: &Request, rig: &Rig, photos: &Photos<'_>, context: &Context) {
    let (height, width) = rig.frame;
    let mut small = photos.iter().filter(|(_, photo)| photo.height < height || photo.width < width);
    if request.place == Place::Centre
        && rig.distortion.is_some()
        && let Some((name, photo)) = small.next()
        && (photo.height, photo.width) == (rig.sensor.height * rig.samples, rig.sensor.width * rig.samples)
    {
        context.warning(WarningKind::Picture, format!(
            "{name}: the picture has as many pixels as the sensor, and the lens projects {width} x {height} of a rectilinear scene onto it: \
             the border repeats the picture's edge; without distortion the picture would fill the frame"
        ));
    }
}

#[cfg(test)]
mod tests {
    use petzval_camera::image::CHANNELS;

    use super::*;
    use crate::context::Silent;

    /// A frame in strips is the frame in one piece, for development that reads around a pixel, with noise and distortion.
    #[test]
    fn strips_make_the_same_frame() {
        let request = Request { size: Some((200, 72)), ..Request::default() };
        let context = Context::new(crate::built_in_assets(), std::sync::Arc::new(Silent));
        let photographer = Photographer::open(&request, InMemory::default(), &context).unwrap();
        let Photographer { rig, taker, .. } = &photographer;
        let Taker::Camera(turned, camera) = taker else { panic!("a lens with rotational symmetry") };
        let (height, width) = rig.frame;
        let value = |i: usize| 0.02 + 0.9 * ((i / 5 * 7919 + i / (3 * width) * 104_729) % 1000) as f32 * 1e-3;
        let data = (0..CHANNELS * height * width).map(value).collect();
        let picture = LinearImage { channels: CHANNELS, height, width, data };
        let shot = turned.shot(rig, &picture, 3).unwrap();
        let frames = camera.take(std::slice::from_ref(&shot), &noise(&request)).unwrap();
        let whole = Taken::new(&frames, camera.capture(&shot)).unwrap();
        let strips = Taken::in_strips(&request, rig, (turned, camera), &picture, 3, 64).unwrap();
        assert_eq!(strips.raw.capture, whole.raw.capture);
        assert_eq!(strips.illumination, whole.illumination);
        let near = |a: &[f32], b: &[f32], most: f32| {
            assert_eq!(a.len(), b.len());
            a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > most).count()
        };
        assert_eq!(near(&strips.irradiance.data, &whole.irradiance.data, 1e-6), 0);
        // A rounding error of the light may move a count of electrons by one in a few pixels of 14,400.
        assert!(near(&strips.raw.dn, &whole.raw.dn, 0.5) <= 5);
        assert!(near(&strips.developed.data, &whole.developed.data, 1e-5) <= 5 * 3 * 25);
        // The picture is no gray plane.
        assert!(near(&whole.developed.data[1..], &whole.developed.data[..14_400 * 3 - 1], 0.01) > 1000);
    }
}
