//! The sheet of a data set for object detection: classes, defects, and sample pictures with their boxes.

use maud::{Markup, html};

use crate::page::{Page, caption, facts, section};
use crate::plot::plain;
use crate::png;
use crate::rgb_picture::{rgb_picture, shrunk};
use crate::table::{Column, Row, Table};

/// A data set.
#[derive(Clone, Debug, Default)]
pub struct DataSheet {
    /// Names and values; unknown values are left out.
    pub facts: Vec<(&'static str, Option<String>)>,
    /// Name of each class, with boxes, pictures, ignored, small, medium and large boxes, three quantiles of the side in px, and states.
    pub classes: Vec<(String, Vec<String>)>,
    /// Defects by kind.
    pub defects: Vec<DefectRow>,
    /// Pictures with their boxes.
    pub samples: Vec<Sample>,
}

/// The defects of a kind.
#[derive(Clone, Debug)]
pub struct DefectRow {
    /// Whether the cases cannot be used.
    pub is_error: bool,
    /// What is wrong.
    pub sentence: &'static str,
    /// What to do.
    pub hint: &'static str,
    /// Cases.
    pub count: usize,
    /// Some of them.
    pub examples: Vec<String>,
}

/// A picture with its boxes.
#[derive(Clone, Debug)]
pub struct Sample {
    name: String,
    size: [usize; 2],
    png: Vec<u8>,
    boxes: Vec<SampleBox>,
}

/// A box of a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleBox {
    /// Place of its class in the list of classes.
    pub class: usize,
    /// Left and upper edge, width and height, px.
    pub bounds: [f64; 4],
    /// Whether it has to be detected.
    pub counts: bool,
    /// What is known beyond its class, such as its state.
    pub note: String,
}

/// Columns of a shown picture, pixels.
const WIDTH: u32 = 640;

/// Boxes that are drawn in one picture.
const MOST_BOXES: usize = 1000;

/// Colours of classes in turn (Okabe and Ito, without black).
const COLOURS: [&str; 7] = ["#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7"];

/// Colours of classes and states that are named after one.
const NAMED: [(&str, &str); 4] =
    [("red", "#ff3b30"), ("yellow", "#ffd60a"), ("green", "#30d158"), ("off", "#b8b8c0")];

impl Sample {
    /// A picture of three encoded planes, 0..1. It is shrunk at once.
    pub fn new(name: String, encoded: &[f32], height: usize, width: usize, boxes: Vec<SampleBox>) -> Self {
        let png = png::encode(&shrunk(&rgb_picture(encoded, height, width), WIDTH));
        Self { name, size: [width, height], png, boxes }
    }
}

/// The page of a sheet.
pub fn page(sheet: &DataSheet) -> String {
    let errors: usize = sheet.defects.iter().filter(|d| d.is_error).map(|d| d.count).sum();
    let warnings: usize = sheet.defects.iter().filter(|d| !d.is_error).map(|d| d.count).sum();
    let main = html! {
        (facts(sheet.facts.clone()))
        (section("Classes", classes(sheet)))
        (section("Defects", defects(sheet)))
        (section("Samples", samples(sheet)))
    };
    Page {
        title: "Data set".to_owned(),
        style: "
.samples { display: grid; grid-template-columns: repeat(auto-fill, minmax(320px, 1fr)); gap: 1.2rem; }
.samples svg { display: block; width: 100%; height: auto; border-radius: 4px; }
.samples p { margin: .3rem 0 0; overflow-wrap: anywhere; }
.legend { display: flex; flex-wrap: wrap; gap: .3rem 1.2rem; margin: 0 0 1rem; padding: 0; list-style: none; }
.legend span { display: inline-block; width: .9em; height: .9em; border-radius: 2px; margin-right: .45em; vertical-align: -.1em; }
td.note-cell details { margin: 0; }
@media (min-width: 641px) { tr.error > th, tr.note > th { white-space: normal; max-width: 22rem; } }",
        headline: "Data set".to_owned(),
        subtitle: html! {
            @match (errors, warnings) {
                (0, 0) => { "No defects." }
                (0, n) => { "Everything can be used; " (n) " notes." }
                (e, n) => { (e) " cases cannot be used; " (n) " further notes." }
            }
        },
        main,
        ..Page::default()
    }
    .html()
}

fn classes(sheet: &DataSheet) -> Markup {
    let columns = [
        Column::new("class"),
        Column::new("boxes"),
        Column::new("pictures"),
        Column::new("ignored").unit("or crowd"),
        Column::new("small").unit("below 32² px²"),
        Column::new("medium"),
        Column::new("large").unit("above 96² px²"),
        Column::new("5 %").unit("side, px"),
        Column::new("50 %").unit("side, px"),
        Column::new("95 %").unit("side, px"),
        Column::new("states").note(),
    ];
    let rows =
        sheet.classes.iter().map(|(name, cells)| Row::new(plain(name), cells.iter().map(|cell| plain(cell))));
    html! {
        (Table::new(columns).rows(rows).html())
        (caption("Side: square root of the area; 5, 50 and 95 % of the boxes of the class are smaller."))
    }
}

fn defects(sheet: &DataSheet) -> Markup {
    if sheet.defects.is_empty() {
        return html! { p { "None." } };
    }
    let row = |defect: &DefectRow| {
        let examples = html! {
            details {
                summary { (plain(defect.hint)) }
                @for example in &defect.examples { div { (plain(example)) } }
            }
        };
        let kind = if defect.is_error { "error" } else { "note" };
        let cells = [html! { (kind) }, html! { (defect.count) }, examples];
        Row::new(plain(defect.sentence), cells).class(if defect.is_error { "error" } else { "note" })
    };
    let columns = [
        Column::new("defect"),
        Column::new("kind").text(),
        Column::new("cases"),
        Column::new("what to do, and cases").note(),
    ];
    Table::new(columns).rows(sheet.defects.iter().map(row)).html()
}

fn samples(sheet: &DataSheet) -> Markup {
    let class = |i: usize| sheet.classes.get(i).map_or("", |(name, _)| name.as_str());
    html! {
        ul.legend {
            @for (i, (name, _)) in sheet.classes.iter().enumerate() {
                li { span style=(format!("background:{}", colour(i, name))) {} (plain(name)) }
            }
        }
        div.samples {
            @for sample in &sheet.samples { (drawn(sample, &class)) }
        }
        (caption("Dashed boxes do not have to be detected: they are ignored, or hold a crowd."))
    }
}

fn drawn<'a>(sample: &Sample, class: &impl Fn(usize) -> &'a str) -> Markup {
    let [width, height] = sample.size;
    let shown = &sample.boxes[..sample.boxes.len().min(MOST_BOXES)];
    html! {
        div {
            svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {width} {height}")) role="img" aria-label=(plain(&sample.name)) {
                image href=(png::address(&sample.png)) width=(width) height=(height) preserveAspectRatio="none" {}
                @for b in shown {
                    @let [x, y, w, h] = b.bounds;
                    rect x=(x) y=(y) width=(w) height=(h) fill="none" stroke=(colour(b.class, if b.note.is_empty() { class(b.class) } else { &b.note }))
                        stroke-width="2" vector-effect="non-scaling-stroke" stroke-dasharray=[(!b.counts).then_some("5 4")] {
                        title { (plain(class(b.class))) " " (plain(&b.note)) }
                    }
                }
            }
            p.muted {
                (plain(&sample.name)) ", " (sample.boxes.len()) @if sample.boxes.len() == 1 { " box" } @else { " boxes" }
                @if shown.len() < sample.boxes.len() { ", of which " (MOST_BOXES) " are drawn" }
            }
        }
    }
}

/// The colour that a class or state is named after, else one of a series.
fn colour(class: usize, name: &str) -> &'static str {
    let is_said =
        |word: &str| name.split(|c: char| !c.is_alphanumeric()).any(|part| part.eq_ignore_ascii_case(word));
    let named = NAMED.iter().find(|(word, _)| is_said(word));
    named.map_or(COLOURS[class % COLOURS.len()], |(_, colour)| colour)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_defects_and_boxes_are_shown_and_escaped() {
        let boxes = vec![
            SampleBox { class: 0, bounds: [1.0, 2.0, 3.0, 4.0], counts: true, note: "red".into() },
            SampleBox { class: 1, bounds: [0.5, 2.0, 3.0, 4.0], counts: false, note: String::new() },
        ];
        let page = page(&DataSheet {
            facts: vec![("pictures", Some("1".into()))],
            classes: vec![("light <b>".into(), vec!["2".into(); 10]), ("car".into(), vec!["1".into(); 10])],
            defects: vec![DefectRow {
                is_error: true,
                sentence: "A box has no width.",
                hint: "take it out",
                count: 7,
                examples: vec!["box <3>".into()],
            }],
            samples: vec![Sample::new("a&b.png".into(), &[0.5; 1800], 20, 30, boxes)],
        });
        crate::page::assert_readable(&page);
        for words in [
            "light &lt;b&gt;",
            "box &lt;3&gt;",
            "a&amp;b.png, 2 boxes",
            "7 cases cannot be used",
            "stroke-dasharray=\"5 4\"",
        ] {
            assert!(page.contains(words), "{words}");
        }
        // The state gives the colour, else the class.
        assert!(page.contains("stroke=\"#ff3b30\"") && page.contains("stroke=\"#56b4e9\""));
        assert_eq!(page.matches("data:image/png").count(), 1);
    }
}
