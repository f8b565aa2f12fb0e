//! One shot: the frame that the camera takes, and what is developed from it.

use petzval_base::Cancel;
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::{Placement, Window};
use petzval_camera::sensor::{Capture, Noise, NoiseMode, Raw, expose};
use petzval_camera::tape::Frames;
use petzval_design::camera::{Body, Camera, Shot, host_image, to_host};
use petzval_design::error::DesignError;

use super::output::Facts;
use super::patchwise::Patchwise;
use super::request::Request;
use super::rig::{Rig, Turned};
use crate::error::Result;
use crate::event::WarningKind;

/// Rows above and below a strip that are exposed and developed with it. No demosaicing reads as far; it is a multiple of every filter array.
const SURROUND_ROWS: usize = 32;

/// The noise of a request.
pub fn noise(request: &Request) -> Noise {
    let mode = if request.no_noise { NoiseMode::Off } else { NoiseMode::Exact };
    Noise { mode, seed: request.seed }
}

/// A picture laid on a frame of so many rows and columns.
pub fn placed(request: &Request, picture: &LinearImage, frame: (usize, usize)) -> LinearImage {
    request.place.lay(picture, frame)
}

/// One frame and what was developed from it, on the host.
#[derive(Clone, Debug)]
pub struct Taken {
    /// Light on the pixels in three colours: 1 is white on the axis.
    pub irradiance: LinearImage,
    /// The raw frame, in digital numbers.
    pub raw: Raw,
    /// The developed picture in linear light, restored where the request restores: 1 is white.
    pub developed: LinearImage,
    /// The developed picture before its restoration; none where nothing is restored.
    pub unrestored: Option<LinearImage>,
    /// Light of each pixel relative to the axis, in three colours.
    pub illumination: LinearImage,
}

/// Warnings of a frame.
pub type Warnings = Vec<(WarningKind, String)>;

/// What happens to each frame: called with what took it and with the name of its image, returns facts about it and warnings.
pub type Each<'a> = dyn FnMut(&Rig, &Body, &str, Taken) -> Result<(Facts, Warnings)> + 'a;

impl Taken {
    /// The first frame of a camera's shots, copied from the device. Its picture is the restored one where the camera restores.
    pub fn new(frames: &Frames, capture: Capture) -> Result<Self, DesignError> {
        let [_, _, height, width] = frames.raw.dims();
        let raw = Raw { height, width, dn: to_host(frames.raw.clone())?, capture };
        let developed = host_image(frames.developed.clone())?;
        let (developed, unrestored) = match &frames.restored {
            Some(restored) => (host_image(restored.clone())?, Some(developed)),
            None => (developed, None),
        };
        let irradiance = host_image(frames.irradiance.clone())?;
        let illumination = host_image(frames.illumination.clone())?;
        Ok(Self { irradiance, raw, developed, unrestored, illumination })
    }

    /// The frame of a picture of the rig, taken in strips of so many rows, an even number. It has the same values as in one piece, but for the
    /// rounding of the transforms that spread the light, and needs a quarter of the memory. Nothing of it may be restored.
    pub fn in_strips(
        request: &Request,
        rig: &Rig,
        (turned, camera): (&Turned, &Camera),
        picture: &LinearImage,
        frame: u64,
        rows: usize,
    ) -> Result<Self, DesignError> {
        let Window { placement, height, width } = rig.window;
        let capture = Capture { exposure: camera.body().exposure, placement, frame };
        let planes = || LinearImage::zeros(CHANNELS, height, width);
        let raw = Raw { height, width, dn: vec![0.0; height * width], capture };
        let mut whole =
            Self { irradiance: planes(), raw, developed: planes(), unrestored: None, illumination: planes() };
        for first in (0..height).step_by(rows) {
            // Development reads pixels around the strip.
            let end = (first + rows).min(height);
            let (from, to) = (first.saturating_sub(SURROUND_ROWS), (end + SURROUND_ROWS).min(height));
            let at = |row: usize| Placement { row: placement.row + row, ..placement };
            let exposed = Window { placement: at(from), height: to - from, width };
            let kept = Window { placement: at(first), height: end - first, width };
            let shot = Shot { kept: Some(kept), ..turned.shot_of(rig, picture, &exposed, frame)? };
            let taken = Self::new(&camera.take(&[shot], &noise(request))?, capture)?;
            let strip = first * width..end * width;
            whole.raw.dn[strip.clone()].copy_from_slice(&taken.raw.dn);
            for (all, part) in [
                (&mut whole.irradiance, &taken.irradiance),
                (&mut whole.developed, &taken.developed),
                (&mut whole.illumination, &taken.illumination),
            ] {
                for c in 0..CHANNELS {
                    all.plane_mut(c)[strip.clone()].copy_from_slice(part.plane(c));
                }
            }
        }
        Ok(whole)
    }

    /// The frame of a picture of the rig behind a lens without rotational symmetry.
    pub fn by_patch(
        request: &Request,
        rig: &Rig,
        (lens, body): (&Patchwise, &Body),
        picture: &LinearImage,
        frame: u64,
        cancel: &Cancel,
    ) -> Result<Self, DesignError> {
        let [irradiance, illumination] = lens.light(&rig.window.scene(picture, lens.border()), cancel)?;
        let capture = Capture { exposure: body.exposure, placement: rig.window.placement, frame };
        let raw = expose(&irradiance, &body.sensor, &capture, &noise(request))?;
        let developed = body.isp.develop(&raw, &illumination, &body.sensor)?;
        Ok(Self { irradiance, raw, developed, unrestored: None, illumination })
    }

    /// The raw frame, and the relative illumination of its pixels.
    pub fn for_chip(&self) -> (&Raw, &LinearImage) {
        (&self.raw, &self.illumination)
    }

    /// A frame of light that lies on the pixels already.
    pub fn of_light(
        request: &Request,
        rig: &Rig,
        camera: &Camera,
        light: &LinearImage,
        frame: u64,
    ) -> Result<Self, DesignError> {
        let exposure = camera.body().exposure;
        let capture = Capture { exposure, placement: rig.window.placement, frame };
        Self::new(&camera.take_light(light, capture, &noise(request))?, capture)
    }
}
