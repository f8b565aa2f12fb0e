//! A frame of a simulated camera as values, and its files.

use std::path::Path;

use petzval_camera::develop::saturated_share;
use petzval_camera::image::LinearImage;
use petzval_camera::isp::RgbPicture;
use petzval_camera::sensor::SensorModel;
use petzval_design::camera::Body;
use petzval_files::isp_file::picture_png_bytes;
use petzval_files::raw_file::{FrameCalibration, RawFrame};
use serde_json::json;

use super::chip;
use super::highlights::Saturation;
use super::output::{self, Facts};
use super::request::{PictureAs, RawAs, Request};
use super::rig::{CHIP_BITS, Rig};
use super::shot::{Taken, Warnings};
use crate::context::Context;
use crate::error::{JobError, Result, make_folder};
use crate::event::WarningKind;
use crate::results::check_folder;

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
    /// Light that a display shows as white: 1, or the end of the highlights if that is less.
    pub display_white: f32,
    /// Share of the pixels that are saturated.
    pub saturated_share: f64,
    /// What an ISP may know of the raw frame; none where the sensor has no Bayer array.
    pub calibration: Option<FrameCalibration>,
    /// The picture of the ISP that the request names, sRGB-encoded.
    pub by_isp: Option<RgbPicture>,
}

impl Frame {
    /// A frame that a camera of the rig took, with warnings if many of its pixels are saturated, and of an ISP whose registers cut off what
    /// develops it.
    pub(super) fn of(
        request: &Request,
        rig: &Rig,
        body: &Body,
        name: &str,
        taken: Taken,
    ) -> Result<(Self, Warnings)> {
        let (sensor, white_e) = (body.sensor.clone(), body.exposure.white_e);
        let saturation = Saturation::of(request, &sensor, white_e, saturated_share(&taken.raw, &sensor))?;
        let saturated = saturation.warning(request, &sensor, white_e);
        let mut warnings: Warnings =
            saturated.into_iter().map(|text| (WarningKind::Saturation, text)).collect();
        // ISPs take frames of a Bayer array.
        let input = || chip::frame(rig, &sensor, taken.for_chip(), body.isp.colour_matrix);
        let input = sensor.cfa.is_bayer().then(input).transpose()?;
        let by_isp = rig
            .chip
            .as_ref()
            .zip(input.as_ref())
            .map(|(isp, frame)| chip::picture(isp, frame))
            .transpose()?;
        let by_isp = by_isp.map(|(picture, clipped)| {
            warnings.extend(clipped);
            picture
        });
        let frame = Self {
            name: name.to_owned(),
            white_e,
            display_white: saturation.display_white(),
            saturated_share: saturation.share,
            calibration: input.as_ref().map(|frame| FrameCalibration::of(&frame.about)),
            by_isp,
            taken,
            sensor,
        };
        Ok((frame, warnings))
    }

    /// The raw frame in whole digital numbers, with sensor and exposure: what `isp develop` takes.
    pub fn raw(&self) -> RawFrame {
        RawFrame::from_raw(&self.taken.raw, &self.sensor)
    }

    /// The developed picture as a display shows it: sRGB-encoded, white within 0 to 1.
    pub fn encoded(&self) -> LinearImage {
        let LinearImage { channels, height, width, ref data } = self.taken.developed;
        let data = data.iter().map(|light| light / self.display_white).collect();
        let shown = LinearImage { channels, height, width, data };
        LinearImage { data: shown.to_srgb(), ..shown }
    }

    /// Writes the raw frame, its calibration and its pictures into a folder, as `simulate` does; returns facts about them.
    pub fn write(&self, formats: (RawAs, PictureAs), folder: &Path, context: &Context) -> Result<Facts> {
        check_folder(folder, output::names(formats, &self.name, self.by_isp.is_some()), context)?;
        make_folder(folder)?;
        let by_chip = self.by_isp.as_ref().map(|picture| picture_png_bytes(picture, CHIP_BITS));
        let more = output::More {
            calibration: self.calibration.clone(),
            by_chip: by_chip.transpose().map_err(JobError::failed)?,
        };
        let picture = (&self.taken.developed, self.display_white);
        let mut facts =
            output::write(formats, folder, &self.name, &self.taken.raw, &self.sensor, picture, &more)?;
        output::report_files(&facts, context);
        for (key, value) in [
            ("white_e", json!(self.white_e)),
            ("saturated_share", json!(self.saturated_share)),
            ("display_white", json!(self.display_white)),
        ] {
            facts.insert(key.to_owned(), value);
        }
        Ok(facts)
    }
}
