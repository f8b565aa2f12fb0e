//! What is found: precision over recall, average precision by size and place, where objects are lost, misses and false alarms.

use std::collections::BTreeSet;
use std::io::Cursor;

use image::{ImageFormat, Rgba};
use maud::{Markup, html};

use super::ranked_answer::RangedFigure;
use super::view::{
    CameraDetection, DetectionView, GroupFigure, Mistake, Range, RankedCamera, Ranking, RankingWords,
    TaskPart, TaskSection,
};
use crate::number;
use crate::page::{caption, figure};
use crate::plot::{Axes, Chart, Series, chart_svg};
use crate::table::{Column, Row, Table};
use crate::{palette, png};

/// Decimals of average precisions.
const DECIMALS: usize = 3;

/// The score of objects by which cameras are ranked, and the one that is read beside it.
const SCORES: [&str; 2] = ["AP50", "AP"];

/// What the boxes over the pictures are.
const BOXES: &str = "Boxes in the scene: blue are objects that count, gray those that are ignored. Boxes in the pictures of cameras are detections with a score \
                     of 0.5 or more: green where an object of the class is, yellow where one of another class is, gray on objects that are ignored, red \
                     where nothing is.";

/// What a report shows where objects are looked for.
pub fn detection_part(view: &DetectionView) -> TaskPart {
    let [score, further] = SCORES.map(str::to_owned);
    let camera = |camera: &CameraDetection| {
        let (value, range) = ap50(camera).unzip();
        RankedCamera {
            camera: camera.camera.clone(),
            value,
            range: range.flatten(),
            against_baseline: camera.against_baseline,
            design_against: camera.design_against,
        }
    };
    let ranking = Ranking {
        score,
        further: vec![further],
        words: RankingWords { most: "finds most", nothing: "finds no object", anything: "finds an object" },
        baseline: view.baseline.clone(),
        design: view.design.clone(),
        cameras: view.cameras.iter().map(camera).collect(),
    };
    TaskPart {
        sections: vec![TaskSection { title: "Detection".to_owned(), html: section(view).into_string() }],
        ranking: Some(ranking),
        legend: Some(BOXES.to_owned()),
        counted: "objects found".to_owned(),
    }
}

/// The average precision of all objects, with its range.
fn ap50(camera: &CameraDetection) -> Option<(f64, Option<[f64; 2]>)> {
    let all = camera.groups.first().filter(|group| group.value.is_finite())?;
    Some((all.value, all.range))
}

/// The section. AP50 with its range is in front, the rest is folded.
fn section(view: &DetectionView) -> Markup {
    html! {
        (front(view))
        (caption(format!(
            "Average precision of all objects at an overlap of 0.5, with the range that it has in 95 % of draws of the {} windows with repetition, those of one film \
             or of one picture together; a single film has no range. The ranges of cameras overlap more than their differences are uncertain, because all see the same windows: the \
             differences are over the same draws, the AP50 of each camera less that of {}, and the AP50 of {} less that of each camera.",
            view.windows, view.baseline, view.design
        )))
        details {
            summary { "AP50 by class, size and place" }
            (by_group(view))
            (caption("Small: the range in 95 % of draws."))
        }
        details {
            summary { "Precision over recall" }
            div.charts { @for class in classes(view) { (figure(&chart_svg(&precision_recall(view, class)))) } }
        }
        details {
            summary { "Where objects are lost" }
            (lost(view))
            (caption(
                "Beside the picture are objects on which a window lies and which the lens of the experiment would show, but this one does not. The detector \
                 of each camera looks at four pictures of every window: what the camera would make of the scene with perfect optics and \
                 without noise; the light on the pixels; the raw frame in a plain development; the finished picture. An object that is not found in the \
                 last (score 0.5, overlap 0.5) is counted at the first in which it is not found. A detector was trained on finished pictures, unless the list of cameras says that it sees the scenes: the \
                 tones of the second and third are not those that it knows, so that losses there are upper bounds.",
            ))
            (at_stages(view))
            (caption(
                "AP50 of the detector of each camera in the same four pictures. The first is what it finds behind perfect optics and without noise. It need \
                 not be the best: a detector that was trained on finished pictures knows their noise and tones.",
            ))
        }
        @for camera in &view.cameras { (mistakes(camera)) }
        (caption("Misses: the largest objects that are not found (blue). False alarms: the surest detections where no object of their class is (red). At \
             most one of a window; other boxes in the colours of the pictures."))
    }
}

/// A row a camera: AP50 with its range, and its differences with theirs.
fn front(view: &DetectionView) -> Markup {
    let columns = [
        "camera".to_owned(),
        "AP50".to_owned(),
        "95 % range".to_owned(),
        format!("against {}", view.baseline),
        format!("{} against it", view.design),
    ];
    let row = |camera: &CameraDetection| {
        let found = ap50(camera).map(|(value, range)| RangedFigure::figure(value, range));
        let ends = found.as_ref().and_then(|found| found.ends.as_ref());
        let value = html! { b { (found.as_ref().map_or("–", |found| &*found.value)) } };
        let range = html! { @if let Some([low, high]) = ends { (low) " … " (high) } @else { "–" } };
        let differences = [camera.against_baseline, camera.design_against].map(difference);
        let cells = [value, range].into_iter().chain(differences);
        Row::new(&camera.camera, cells).of_camera(palette::camera(camera.number))
    };
    Table::new(columns.iter().map(Column::new)).class("scores").rows(view.cameras.iter().map(row)).html()
}

/// A difference with its range below it.
pub(super) fn difference(range: Option<Range>) -> Markup {
    range.map_or_else(|| html! { "–" }, |range| RangedFigure::difference(range).shown())
}

fn classes(view: &DetectionView) -> BTreeSet<&str> {
    view.cameras.iter().flat_map(|c| c.curves.iter().map(|curve| curve.class.as_str())).collect()
}

/// A row a camera, a column a group of objects.
fn by_group(view: &DetectionView) -> Markup {
    let mut names: Vec<&str> = Vec::new();
    for figure in view.cameras.iter().flat_map(|c| &c.groups) {
        if !names.contains(&figure.name.as_str()) {
            names.push(&figure.name);
        }
    }
    let cell = |group: Option<&GroupFigure>| {
        group.map_or_else(|| html! { "–" }, |group| RangedFigure::figure(group.value, group.range).shown())
    };
    let row = |camera: &CameraDetection| {
        let cells = names.iter().map(|name| cell(camera.groups.iter().find(|g| g.name == **name)));
        Row::new(&camera.camera, cells).of_camera(palette::camera(camera.number))
    };
    let columns = ["camera"].into_iter().chain(names.iter().copied()).map(Column::new);
    Table::new(columns).class("scores").rows(view.cameras.iter().map(row)).html()
}

/// Precision over recall of a class, one curve a camera.
fn precision_recall(view: &DetectionView, class: &str) -> Chart {
    let series = |camera: &CameraDetection| {
        let curve = camera.curves.iter().find(|curve| curve.class == class)?;
        Some(Series {
            name: camera.camera.clone(),
            colour: palette::camera(camera.number).to_owned(),
            points: curve.points.clone(),
            ..Series::default()
        })
    };
    Chart {
        alt: format!("Precision over recall of the class {class}, one curve per camera"),
        x_axis: format!("recall, {class}"),
        y_axis: "precision".to_owned(),
        series: view.cameras.iter().filter_map(series).collect(),
        axes: Axes::Shares,
        ..Chart::default()
    }
}

/// How many objects are found, and where the others are lost.
fn lost(view: &DetectionView) -> Markup {
    let columns = [
        Column::new("camera"),
        Column::new("objects"),
        Column::new("found"),
        Column::new("beside the picture"),
        Column::new("not found in the scene"),
        Column::new("lost by the lens"),
        Column::new("by the sensor"),
        Column::new("by the ISP"),
    ];
    let row = |camera: &CameraDetection| {
        let l = &camera.lost;
        let counts = [l.objects, l.found, l.beside, l.in_scene, l.by_lens, l.by_sensor, l.by_isp];
        let cells = counts.map(|count| html! { (count) });
        Row::new(&camera.camera, cells).of_camera(palette::camera(camera.number))
    };
    Table::new(columns).class("scores").rows(view.cameras.iter().map(row)).html()
}

/// How well the detector of each camera does in the picture of each stage.
fn at_stages(view: &DetectionView) -> Markup {
    let columns =
        ["camera", "AP50 in the scene", "in the light", "in the raw frame", "in the finished picture"];
    let cell = |value: Option<f64>| html! { (value.map_or("–".to_owned(), |v| number::fixed(v, DECIMALS))) };
    let row = |camera: &CameraDetection| {
        let colour = palette::camera(camera.number);
        Row::new(&camera.camera, camera.ap50_at_stages.map(cell)).of_camera(colour)
    };
    let rows = view.cameras.iter().map(row);
    Table::new(columns.map(Column::new)).class("scores").rows(rows).html()
}

/// Misses and false alarms of a camera.
fn mistakes(camera: &CameraDetection) -> Markup {
    const MISSED: [u8; 3] = [26, 230, 255];
    const ALARM: [u8; 3] = [255, 51, 51];
    let colour = palette::camera(camera.number);
    let strip = |name: &str, all: &[Mistake], colour: [u8; 3]| {
        html! {
            @if !all.is_empty() {
                p.muted { (name) }
                div.mistakes {
                    @for mistake in all {
                        @if let Some(png) = crop(mistake, colour) {
                            div { img src=(png::address(&png)) alt=(format!("{name}: {}", mistake.title)); div.shot-note { (mistake.title) } }
                        }
                    }
                }
            }
        }
    };
    html! {
        details {
            summary { span.shot-name style=(palette::camera_style(colour)) { (camera.camera) } ": misses and false alarms" }
            (strip("Misses", &camera.misses, MISSED))
            (strip("False alarms", &camera.false_alarms, ALARM))
        }
    }
}

/// The surroundings of a mistake, with its box; nothing if the picture cannot be decoded.
fn crop(mistake: &Mistake, colour: [u8; 3]) -> Option<Vec<u8>> {
    let mut picture =
        image::load_from_memory_with_format(&mistake.picture_png, ImageFormat::Png).ok()?.to_rgba8();
    let (width, height) = picture.dimensions();
    let [x1, y1, x2, y2] = mistake.bbox;
    let within = |v: f32, size: u32| (v.round().max(0.0) as u32).min(size - 1);
    let (left, right) = (within(x1, width), within(x2 - 1.0, width));
    let (top, bottom) = (within(y1, height), within(y2 - 1.0, height));
    let paint = Rgba([colour[0], colour[1], colour[2], 255]);
    (left..=right).for_each(|x| [top, bottom].into_iter().for_each(|y| picture.put_pixel(x, y, paint)));
    (top..=bottom).for_each(|y| [left, right].into_iter().for_each(|x| picture.put_pixel(x, y, paint)));
    // A square twice as large as the longer side, within the picture.
    let side = (2 * (right - left).max(bottom - top)).max(48).min(width.min(height));
    let first = |low: u32, high: u32, size: u32| {
        ((low + high) / 2).saturating_sub(side / 2).min(size.saturating_sub(side))
    };
    let (x, y) = (first(left, right, width), first(top, bottom, height));
    let mut out = Cursor::new(Vec::new());
    image::imageops::crop_imm(&picture, x, y, side, side)
        .to_image()
        .write_to(&mut out, ImageFormat::Png)
        .ok()?;
    Some(out.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design_report::{GroupFigure, LostObjects, PrecisionCurve, Range, Report, pictures};
    use crate::sample;

    #[test]
    fn the_section_shows_figures_losses_and_mistakes() {
        let mistake = Mistake {
            picture_png: sample::picture_png(64, 32, 0),
            bbox: [40.0, 10.0, 70.0, 30.0],
            title: "a <person>".into(),
        };
        let camera = |name: &str, against| CameraDetection {
            camera: name.to_owned(),
            number: 0,
            curves: vec![PrecisionCurve { class: "person".into(), points: vec![(0.1, 1.0), (0.8, 0.5)] }],
            groups: vec![
                GroupFigure { name: "AP50".into(), value: 0.7126, range: Some([0.651, 0.774]) },
                GroupFigure { name: "small".into(), value: 0.4321, range: None },
            ],
            against_baseline: against,
            design_against: None,
            ap50_at_stages: [Some(0.8314), Some(0.25), None, Some(0.7126)],
            lost: LostObjects {
                objects: 91,
                found: 61,
                beside: 1,
                in_scene: 11,
                by_lens: 12,
                by_sensor: 4,
                by_isp: 2,
            },
            misses: vec![mistake.clone(), Mistake { picture_png: vec![1, 2], ..mistake.clone() }],
            false_alarms: Vec::new(),
        };
        let better = Range { value: 0.0214, low: -0.003, high: 0.041 };
        let part = detection_part(&DetectionView {
            baseline: "nominal".into(),
            design: "end-to-end".into(),
            windows: 192,
            cameras: vec![
                CameraDetection {
                    design_against: Some(Range { value: 0.0114, low: -0.013, high: 0.031 }),
                    ..camera("nominal", None)
                },
                camera("end-to-end", Some(better)),
            ],
        });
        let page = part.sections[0].html.clone();
        let ranked: Vec<Option<f64>> =
            part.ranking.iter().flat_map(|r| &r.cameras).map(|camera| camera.value).collect();
        assert_eq!(ranked, [Some(0.7126); 2]);
        let report = Report { task: part, ..sample::report() };
        assert!(pictures(&report).into_string().contains("Boxes in the scene"));
        for text in [
            "0.71",
            "0.65 … 0.77",
            "0.432",
            "+0.021",
            "+0.041",
            "+0.011",
            "end-to-end against it",
            ">61<",
            ">12<",
            "0.831",
            "recall, person",
            "a &lt;person&gt;",
        ] {
            assert!(page.contains(text), "{text}: {page}");
        }
        // AP50 with its range is in front, and everything else is folded.
        let (front, folded) = page.split_once("<details").unwrap();
        assert!(
            front.contains("<b>0.71</b>") && front.contains("0.65 … 0.77") && front.contains("+0.021"),
            "{front}"
        );
        assert!(!front.contains("0.432") && !front.contains("<svg") && !front.contains("<img"));
        assert!(!page.contains("<details open"));
        assert!(folded.contains("0.432") && folded.contains("<svg"));
        // The picture that cannot be decoded is left out.
        assert_eq!(page.matches("<img").count(), 2);
    }

    #[test]
    fn a_crop_holds_the_box_and_stays_in_the_picture() {
        let mistake = Mistake {
            picture_png: sample::picture_png(128, 96, 0),
            bbox: [110.0, 4.0, 140.0, 30.0],
            title: String::new(),
        };
        let cut = image::load_from_memory(&crop(&mistake, [255, 0, 0]).unwrap()).unwrap().to_rgb8();
        assert_eq!(cut.dimensions(), (50, 50));
        // Its right edge is the picture's, in red.
        assert_eq!(cut.get_pixel(49, 10).0, [255, 0, 0]);
        assert_eq!(cut.get_pixel(32, 10).0, [255, 0, 0]);
    }
}
