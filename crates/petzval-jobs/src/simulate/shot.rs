//! One shot: the frame that the camera takes, what is developed from it, and the files of both.

use petzval_camera::develop::saturated_share;
use petzval_camera::image::LinearImage;
use petzval_camera::sensor::{Capture, Noise, NoiseMode, Raw};
use petzval_camera::tape::Frames;
use petzval_design::camera::{Camera, to_host};
use petzval_design::error::DesignError;
use petzval_files::raw_file::FrameCalibration;
use serde_json::json;

use super::chip;
use super::highlights::Saturation;
use super::output::{self, Facts};
use super::request::Request;
use super::rig::Rig;
use crate::context::Context;
use crate::error::{JobError, make_folder};

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
    /// The raw frame, in digital numbers.
    pub raw: Raw,
    /// The developed picture in linear light, restored where the request restores: 1 is white.
    pub developed: LinearImage,
    /// Light of each pixel relative to the axis, in three colours.
    pub illumination: LinearImage,
}

/// What happens to each frame: called with what took it and with the name of its image, returns facts about it and a warning.
pub type Each<'a> = dyn FnMut(&Rig, &Camera, &str, Taken) -> Result<(Facts, Option<String>), JobError> + 'a;

impl Taken {
    /// The first frame of a camera's shots, copied from the device. Its picture is the restored one where the camera restores.
    pub fn new(frames: &Frames, capture: Capture) -> Result<Self, DesignError> {
        let [_, channels, height, width] = frames.developed.dims();
        let raw = Raw { height, width, dn: to_host(frames.raw.clone())?, capture };
        let data = to_host(frames.restored.as_ref().unwrap_or(&frames.developed).clone())?;
        let developed = LinearImage { channels, height, width, data };
        let data = to_host(frames.illumination.clone())?;
        Ok(Self { raw, developed, illumination: LinearImage { channels: 3, height, width, data } })
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

/// Writes the results of a shot; returns facts about them, and a warning if many pixels are saturated.
pub fn write_shot(
    request: &Request,
    rig: &Rig,
    camera: &Camera,
    name: &str,
    taken: &Taken,
    context: &Context,
) -> Result<(Facts, Option<String>), JobError> {
    make_folder(&request.out)?;
    let (sensor, white_e) = (&camera.body().sensor, camera.body().exposure.white_e);
    let share = saturated_share(&taken.raw, sensor);
    let saturation = Saturation::of(request, sensor, white_e, share)?;
    let display_white = saturation.display_white();
    let formats = (request.raw_format, request.picture_format);
    let picture = (&taken.developed, display_white);
    let colour_matrix = camera.body().isp.colour_matrix;
    // ISPs take frames of a Bayer array.
    let frame = sensor.cfa.is_bayer().then(|| chip::frame(rig, sensor, taken.for_chip(), colour_matrix));
    let frame = frame.transpose()?;
    let by_chip = rig.chip.as_ref().zip(frame.as_ref()).map(|(isp, frame)| chip::png(isp, frame));
    let more = output::More {
        calibration: frame.map(|frame| FrameCalibration::of(&frame.about)),
        by_chip: by_chip.transpose()?,
    };
    let mut facts = output::write(formats, &request.out, name, &taken.raw, sensor, picture, &more)?;
    output::report_files(&facts, context);
    for (key, value) in [
        ("white_e", json!(white_e)),
        ("saturated_share", json!(saturation.share)),
        ("display_white", json!(display_white)),
    ] {
        facts.insert(key.to_owned(), value);
    }
    Ok((facts, saturation.warning(request, sensor, name, white_e)))
}
