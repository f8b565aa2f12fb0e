//! Classes of pixels drawn over a picture, for people to look at.

use petzval_camera::image::LinearImage;
use petzval_learn::dataset::{ClassMap, IGNORED};
use petzval_report::class_colour;

/// Share of a class's colour in a pixel; the rest is the picture.
const SHARE: f32 = 0.55;

/// A picture, sRGB-encoded, whose pixels are tinted in the colours of their classes. Ignored pixels stay as they are.
pub(super) fn with_classes(picture: &LinearImage, map: &ClassMap) -> LinearImage {
    let mut drawn = picture.clone();
    let pixels = picture.height * picture.width;
    for (pixel, class) in map.classes.iter().enumerate().filter(|(_, class)| **class != IGNORED) {
        for (channel, value) in class_colour(usize::from(*class)).into_iter().enumerate() {
            let shown = &mut drawn.data[channel * pixels + pixel];
            *shown += SHARE * (f32::from(value) / 255.0 - *shown);
        }
    }
    drawn
}
