//! The strip of an ISP: the picture after every stage, with the parameters that made it, on one self-contained page.

use image::RgbImage;
use image::imageops::{FilterType, crop_imm, resize};
use maud::{Markup, html};

use crate::page::{Page, Section, caption, section, with_contents};
use crate::plot::plain;
use crate::rgb_picture::{rgb_picture, shrunk};
use crate::table::{Column, Row, Table};
use crate::{number, png};

/// A frame and what each stage made of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Strip {
    /// Name of the raw file.
    pub raw: String,
    /// Name of the ISP.
    pub isp: String,
    /// The stages, in the order of the light.
    pub steps: Vec<StripStep>,
}

/// The picture after a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StripStep {
    /// Name of the stage.
    pub stage: String,
    /// Stages behind it that change what the values stand for, light or its root, and not the picture.
    pub shared: Vec<String>,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Red, then green, then blue, sRGB-encoded, 0..1.
    pub encoded: Vec<f32>,
    /// Its parameters.
    pub parameters: Vec<StripParameter>,
}

/// A parameter of a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct StripParameter {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit; empty for a plain number.
    pub unit: String,
    /// Whether the value is its default.
    pub is_default: bool,
    /// Its description.
    pub sentence: String,
}

/// Columns of a shown picture, pixels.
const WIDTH: u32 = 720;

/// Side of the part that is shown pixel by pixel, and the size of its pixels.
const CROP: u32 = 80;
const ZOOM: u32 = 3;

/// The page of a strip.
pub fn page(strip: &Strip) -> String {
    let name = |i: usize, step: &StripStep| format!("{}. {}", i + 1, words(&step.stage));
    let sections: Vec<Section> =
        strip.steps.iter().enumerate().map(|(i, step)| section(name(i, step), stage(step))).collect();
    let main = html! {
        (with_contents(&sections))
        (caption(html! {
            "Left the whole picture, at most " (WIDTH) " pixels wide; right the " (CROP) " × " (CROP) " pixels at its centre. "
            "A mosaic is shown with the means of neighbouring pixels for the colours that it lacks, and pictures before gamma by the curve of sRGB. Values other than the default are marked."
        }))
    };
    Page {
        title: format!("{} – {}", strip.raw, strip.isp),
        style: include_str!("page.css"),
        headline: strip.raw.clone(),
        subtitle: html! { "After every stage of " (plain(&strip.isp)) "." },
        main,
        ..Page::default()
    }
    .html()
}

/// The name of a stage in words.
fn words(stage: &str) -> String {
    plain(&stage.replace('_', " "))
}

fn stage(step: &StripStep) -> Markup {
    let picture = rgb_picture(&step.encoded, step.height, step.width);
    let (whole, part) = (shrunk(&picture, WIDTH), centre(&picture));
    let alt = format!("after {}", plain(&step.stage));
    let rows = step.parameters.iter().map(|p| {
        // Values between the knots of a preset have more digits than say anything.
        let rounded = (p.value * 1e6).round() / 1e6;
        let value = if p.is_default {
            html! { (rounded) }
        } else {
            html! { strong { (rounded) } }
        };
        Row::new(
            html! { code { (plain(&p.name)) } },
            [value, html! { (number::unit(&plain(&p.unit))) }, html! { (plain(&p.sentence)) }],
        )
    });
    let columns = [
        Column::new("parameter"),
        Column::new("value"),
        Column::new("unit").units(),
        Column::new("meaning").note(),
    ];
    html! {
        div.stage {
            img src=(png::address(&png::encode(&whole))) alt=(alt);
            img.pixels src=(png::address(&png::encode(&part))) alt=(format!("{alt}, centre"));
        }
        @for shared in &step.shared {
            (caption(html! {
                "It is also the picture after " (words(shared)) ", which only changes what the values stand for: "
                "roots of light in place of light. The parameters of both are below."
            }))
        }
        @if !step.parameters.is_empty() { (Table::new(columns).rows(rows).html()) }
    }
}

fn centre(picture: &RgbImage) -> RgbImage {
    let (width, height) = picture.dimensions();
    let (wide, high) = (CROP.min(width), CROP.min(height));
    let part = crop_imm(picture, (width - wide) / 2, (height - high) / 2, wide, high).to_image();
    resize(&part, ZOOM * wide, ZOOM * high, FilterType::Nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_has_its_picture_and_its_parameters() {
        let parameter = |name: &str, value: f64, is_default: bool| StripParameter {
            name: name.into(),
            value,
            unit: "dB".into(),
            is_default,
            sentence: "A <sentence>.".into(),
        };
        let step = |stage: &str, parameters| StripStep {
            stage: stage.into(),
            shared: if stage == "gain" { vec!["square_root".to_owned()] } else { vec![] },
            height: 20,
            width: 1000,
            encoded: vec![0.5; 60_000],
            parameters,
        };
        let strip = Strip {
            raw: "night <1>.tiff".into(),
            isp: "plain".into(),
            steps: vec![
                step("black", vec![]),
                step("gain", vec![parameter("gain.red", 1.5, false), parameter("gain.blue", 1.0, true)]),
            ],
        };
        let page = page(&strip);
        crate::page::assert_readable(&page);
        for words in [
            "1. black",
            "2. gain",
            "also the picture after square root",
            "<th scope=\"row\"><code>gain.red</code></th>",
            "<strong>1.5</strong>",
            "A &lt;sentence&gt;.",
            "night &lt;1&gt;.tiff",
        ] {
            assert!(page.contains(words), "{words}");
        }
        assert_eq!(page.matches("<img").count(), 4);
        assert!(!page.contains("<strong>1</strong>"));
        let picture = rgb_picture(&strip.steps[0].encoded, 20, 1000);
        assert_eq!(
            (shrunk(&picture, WIDTH).dimensions(), centre(&picture).dimensions()),
            ((720, 14), (240, 60))
        );
    }
}
