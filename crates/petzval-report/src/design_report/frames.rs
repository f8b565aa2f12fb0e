//! Whole frames: one photograph over the whole sensor, by every camera.

use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, ImageFormat};
use maud::{Markup, html};

use super::view::{FrameView, Report, camera_colour};
use crate::page::caption;
use crate::{palette, png};

/// Quality of the JPEGs, of 100: a lossless frame takes several MB, a JPEG of this quality a tenth, without visible loss.
const QUALITY: u8 = 90;

/// Each frame as wide as the page; a click shows it large, and arrow keys then switch between the cameras.
pub(super) fn frames(report: &Report) -> Markup {
    html! {
        div.frames { @for (i, frame) in report.frames.iter().enumerate() { (one(report, frame, i)) } }
        (caption(
            "One photograph over the whole sensor, through lens, sensor, development and network or hardware ISP, with exact \
             noise; first the scene as it lies on the sensor. Shown as JPEG; the run folder has them without loss. Select a frame to see it large; the arrow keys then switch \
             cameras in place.",
        ))
    }
}

fn one(report: &Report, frame: &FrameView, i: usize) -> Markup {
    let style = if report.cameras.iter().any(|camera| camera.name == frame.name) {
        palette::camera_style(camera_colour(&report.cameras, &frame.name, i))
    } else {
        "--camera:currentColor".to_owned()
    };
    html! {
        div.shot {
            div.shot-name style=(style) { (frame.name) }
            button.frame type="button" data-group="whole" data-name=(frame.name) {
                img src=(png::jpeg_address(&jpeg(&frame.png))) alt=(format!("Whole frame: {}", frame.name));
            }
        }
    }
}

/// The frame as a JPEG; nothing if it cannot be decoded, and the page then shows its alt text.
fn jpeg(png: &[u8]) -> Vec<u8> {
    let mut jpeg = Vec::new();
    if let Ok(frame) = image::load_from_memory_with_format(png, ImageFormat::Png) {
        let frame = DynamicImage::ImageRgb8(frame.into_rgb8());
        // Writing to memory does not fail.
        let _ = frame.write_with_encoder(JpegEncoder::new_with_quality(&mut jpeg, QUALITY));
    }
    jpeg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn every_frame_has_its_name_and_those_of_cameras_their_colour() {
        let report = sample::report();
        let page = frames(&report).into_string();
        assert_eq!(page.matches("data:image/jpeg;base64,").count(), report.frames.len());
        for frame in &report.frames {
            assert!(page.contains(&format!("data-name=\"{}\"", frame.name)));
        }
        assert_eq!(page.matches("currentColor").count(), 1);
    }
}
