//! Pictures and PSFs in memory, checked before a job uses them as it would use a file.

use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::psf::PsfBank;
use petzval_design::error::DesignError;
use petzval_files::raw_file::RawFrame;

use crate::error::{JobError, Result};

/// Refuses pixels that are no picture in linear light: three planes of at least one pixel, finite values that are not negative.
pub(crate) fn check_picture(picture: &LinearImage, name: &str) -> Result<()> {
    let LinearImage { channels, height, width, data } = picture;
    let wrong = |what: String| {
        let hint = "give red, green and blue planes, row by row, in linear light: 0 is black, 1 is white";
        Err(JobError::input(format!("{name}: {what}"), hint))
    };
    if *channels != CHANNELS || *height == 0 || *width == 0 {
        return wrong(format!("a picture of {channels} planes of {width} x {height} pixels"));
    }
    let values = height.checked_mul(*width).and_then(|pixels| pixels.checked_mul(CHANNELS));
    if values != Some(data.len()) {
        return wrong(format!("{} values for {channels} planes of {width} x {height} pixels", data.len()));
    }
    match data.iter().position(|value| !(value.is_finite() && *value >= 0.0)) {
        Some(at) => {
            let (plane, pixel) = (at / (height * width), at % (height * width));
            let (row, column) = (pixel / width, pixel % width);
            wrong(format!("the value {} in plane {plane}, row {row}, column {column}", data[at]))
        }
        None => Ok(()),
    }
}

/// Refuses a raw frame that has not one number for each pixel. `name` is what errors call it.
pub(crate) fn check_numbers<T>(frame: &RawFrame<T>, name: &str) -> Result<()> {
    let RawFrame { height, width, dn, .. } = frame;
    if dn.is_empty() || height.checked_mul(*width) != Some(dn.len()) {
        let message = format!("{name}: {} digital numbers for {width} x {height} pixels", dn.len());
        return Err(JobError::input(message, "give one number for each pixel, row by row"));
    }
    Ok(())
}

/// Refuses PSFs that no picture can be rendered with.
pub(crate) fn check_psfs(bank: &PsfBank) -> Result<()> {
    bank.validate().map_err(|error| {
        let error = DesignError::from(petzval_camera::render::RenderError::from(error));
        JobError::input(format!("the PSFs: {error}"), "")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_has_three_planes_and_every_value_is_light() {
        let whole = LinearImage::filled(3, 2, 4, 0.5);
        assert!(check_picture(&whole, "x").is_ok());
        let says = |picture: &LinearImage| check_picture(picture, "x").unwrap_err().to_string();
        assert_eq!(says(&LinearImage::zeros(1, 2, 4)), "x: a picture of 1 planes of 4 x 2 pixels");
        assert_eq!(says(&LinearImage::zeros(3, 0, 4)), "x: a picture of 3 planes of 4 x 0 pixels");
        let short = LinearImage { data: vec![0.5; 23], ..whole.clone() };
        assert_eq!(says(&short), "x: 23 values for 3 planes of 4 x 2 pixels");
        let huge = LinearImage { channels: 3, height: usize::MAX, width: 2, data: Vec::new() };
        assert!(says(&huge).contains("0 values"));
        for wrong in [f32::NAN, f32::INFINITY, -0.1] {
            let mut picture = whole.clone();
            picture.set(1, 1, 2, wrong);
            assert_eq!(says(&picture), format!("x: the value {wrong} in plane 1, row 1, column 2"));
        }
    }
}
