//! One picture by several cameras, side by side: whole, and pixel by pixel at three places of the field.

use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};
use maud::{Markup, html};

use crate::page::{Page, Section, caption, section};
use crate::plot::plain;
use crate::png;
use crate::rgb_picture::{rgb_picture, shrunk};

/// A picture by one camera, as the page shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    name: String,
    whole: RgbImage,
    parts: [RgbImage; 3],
}

/// Columns of a whole picture, pixels.
const WIDTH: u32 = 480;

/// Side of the parts that are shown pixel by pixel, and the size of their pixels.
const CROP: u32 = 120;
const ZOOM: u32 = 2;

/// Where the parts lie, from the centre of the picture to its corner, and their headlines.
const PLACES: [(f64, &str); 3] = [(0.0, "Centre"), (0.5, "Half-way to the corner"), (1.0, "Corner")];

impl View {
    /// A picture of three sRGB-encoded planes, 0..1.
    pub fn new(name: &str, encoded: &[f32], height: usize, width: usize) -> Self {
        let picture = rgb_picture(encoded, height, width);
        Self {
            name: name.to_owned(),
            whole: shrunk(&picture, WIDTH),
            parts: PLACES.map(|(share, _)| part(&picture, share)),
        }
    }

    fn figure(&self, shown: &RgbImage, place: &str) -> Markup {
        html! {
            figure {
                img src=(png::address(&png::encode(shown))) alt=(format!("{}, {place}", plain(&self.name)));
                figcaption { (plain(&self.name)) }
            }
        }
    }
}

/// The page of a picture.
pub fn page(picture: &str, views: &[View]) -> String {
    let row = |place: &str, shown: &dyn Fn(&View) -> RgbImage| -> Section {
        section(place, html! { div.views { @for view in views { (view.figure(&shown(view), place)) } } })
    };
    let parts =
        PLACES.iter().enumerate().map(|(i, (_, place))| row(place, &move |view| view.parts[i].clone()));
    let main = html! {
        (row("Whole", &|view| view.whole.clone()))
        @for part in parts { (part) }
        (caption(html! {
            "Whole pictures are at most " (WIDTH) " pixels wide. The others show " (CROP) " × " (CROP) " pixels, each " (ZOOM) " times as large."
        }))
    };
    Page {
        title: format!("{picture} side by side"),
        style: include_str!("page.css"),
        headline: picture.to_owned(),
        subtitle: html! { "The same picture by every camera." },
        main,
        ..Page::default()
    }
    .html()
}

/// The part of a picture so far from its centre towards the lower right corner, its pixels enlarged.
fn part(picture: &RgbImage, share: f64) -> RgbImage {
    let (width, height) = picture.dimensions();
    let (wide, high) = (CROP.min(width), CROP.min(height));
    let from = |whole: u32, part: u32| (0.5 * (1.0 + share) * f64::from(whole - part)) as u32;
    let part = crop_imm(picture, from(width, wide), from(height, high), wide, high).to_image();
    resize(&part, ZOOM * wide, ZOOM * high, FilterType::Nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_camera_has_its_whole_picture_and_three_parts_of_it() {
        // A ramp from left to right: its parts grow brighter towards the corner.
        let (height, width) = (300, 400);
        let plane = (0..height * width).map(|i| (i % width) as f32 / width as f32);
        let ramp: Vec<f32> = plane.clone().chain(plane.clone()).chain(plane).collect();
        let view = View::new("wide <1>", &ramp, height, width);
        let first = |part: &RgbImage| f64::from(part.get_pixel(0, 0)[0]) / 255.0;
        // The first columns of the parts: 140, 210 and 280 of 400.
        for (part, wanted) in view.parts.iter().zip([0.35, 0.525, 0.7]) {
            assert!((first(part) - wanted).abs() < 0.01, "{} {wanted}", first(part));
            assert_eq!(part.dimensions(), (ZOOM * CROP, ZOOM * CROP));
        }
        let page = page("night", &[view.clone(), View::new("tiny", &[0.5; 12], 2, 2), view]);
        crate::page::assert_readable(&page);
        assert_eq!(page.matches("<img").count(), 12);
        assert!(page.contains("wide &lt;1&gt;") && page.contains("<h2>Corner</h2>"));
    }
}
