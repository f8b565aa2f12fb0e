//! The section of a segmentation: intersection over union of each class by each camera, what is taken for what, and windows as pictures.

use image::{ImageFormat, Rgb, RgbImage};
use maud::{Markup, html};

use super::detection::difference;
use super::ranked_answer::RangedFigure;
use super::view::{Range, TaskSection};
use crate::page::caption;
use crate::table::{Column, Row, Table};
use crate::{number, palette, png};

/// The label of an ignored pixel.
const IGNORED: u8 = 255;

/// Colours of the map of errors: a wrong pixel, and an ignored one.
const WRONG: Rgb<u8> = Rgb([0xd5, 0x5e, 0x00]);
const UNJUDGED: Rgb<u8> = Rgb([0, 0, 0]);

/// How far right pixels keep the brightness of the photo, so that wrong ones stand out.
const DIMMED: f32 = 0.6;

/// What the cameras of a run find.
#[derive(Clone, Debug, Default)]
pub struct SegmentationView {
    /// Names of the classes, in the order of their numbers.
    pub classes: Vec<String>,
    /// The camera that the others are compared with.
    pub baseline: String,
    /// Windows over which figures are.
    pub windows: usize,
    /// Each camera.
    pub cameras: Vec<CameraSegments>,
}

/// What a camera finds.
#[derive(Clone, Debug, Default)]
pub struct CameraSegments {
    /// Its name.
    pub camera: String,
    /// Its place among the cameras of the run, which gives its colour.
    pub number: usize,
    /// The mean of the intersection over union over classes.
    pub mean_iou: Option<SegmentFigure>,
    /// Share of right pixels.
    pub accuracy: Option<SegmentFigure>,
    /// Intersection over union of each class; none of a class that is neither there nor found.
    pub classes: Vec<Option<SegmentFigure>>,
    /// Its mean less that of the baseline.
    pub against_baseline: Option<Range>,
    /// Pixels, `[class of the truth][class that was found]`.
    pub confusion: Vec<Vec<u64>>,
    /// Some windows.
    pub shown: Vec<ShownSegments>,
}

/// A figure, and the range that it has in 95 % of draws of the windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentFigure {
    /// The figure.
    pub value: f64,
    /// The ends of the range.
    pub range: Option<[f64; 2]>,
}

/// A window with its classes.
#[derive(Clone, Debug, Default)]
pub struct ShownSegments {
    /// Its name.
    pub title: String,
    /// The finished picture.
    pub photo_png: Vec<u8>,
    /// Rows of the two maps.
    pub height: usize,
    /// Their columns.
    pub width: usize,
    /// The class of each pixel, row by row; 255 where it is ignored.
    pub truth: Vec<u8>,
    /// The class that was found.
    pub found: Vec<u8>,
}

/// The section. Figures with their ranges are in front, confusion and pictures are folded, but for the pictures of the last camera.
pub fn segmentation_section(view: &SegmentationView) -> TaskSection {
    let last = view.cameras.len().saturating_sub(1);
    let body = html! {
        (by_class(view))
        (caption(format!(
            "Intersection over union of each class, over all labelled pixels of {} windows, with the range that it has in 95 % of draws of the windows with repetition, \
             those of one film or of one picture together. mIoU is the mean over the classes; one that is neither in the truth nor found is left out of it{}. The \
             ranges of cameras overlap more than their differences are uncertain, because all see the same windows: the difference is over the same draws, the \
             mIoU of each camera less that of {}.",
            view.windows,
            absent_in_words(view),
            view.baseline
        )))
        @for (i, camera) in view.cameras.iter().enumerate() {
            details open[i == last] {
                summary { (camera.camera) ": windows" }
                (legend(view))
                @for shown in &camera.shown { (pictures(view, shown)) }
            }
        }
        (caption("Wrong pixels are orange, right ones gray, and ignored ones black. Other windows are among the pictures below, with the classes over them."))
        @for camera in &view.cameras {
            details {
                summary { (camera.camera) ": what is taken for what" }
                (confusion(view, camera))
            }
        }
        (caption("Of the pixels of each class (rows), the share in % that was found as each class (columns)."))
    };
    TaskSection { title: "Segmentation".to_owned(), html: body.into_string() }
}

/// The classes that are neither in the truth nor found, by the camera that finds the most classes.
fn absent_in_words(view: &SegmentationView) -> String {
    let is_absent = |class: usize| view.cameras.iter().all(|camera| camera.classes[class].is_none());
    let absent: Vec<&str> = (0..view.classes.len())
        .filter(|class| is_absent(*class))
        .map(|class| &*view.classes[class])
        .collect();
    if absent.is_empty() { String::new() } else { format!(" (here {})", absent.join(", ")) }
}

/// A row a camera, a column a class.
fn by_class(view: &SegmentationView) -> Markup {
    let cell = |figure: &Option<SegmentFigure>| {
        figure
            .map_or_else(|| html! { "–" }, |figure| RangedFigure::figure(figure.value, figure.range).shown())
    };
    let row = |camera: &CameraSegments| {
        let front = [cell(&camera.mean_iou), difference(camera.against_baseline), cell(&camera.accuracy)];
        let cells = front.into_iter().chain(camera.classes.iter().map(cell));
        Row::new(&camera.camera, cells).of_camera(palette::camera(camera.number))
    };
    let against = format!("against {}", view.baseline);
    let columns =
        ["camera", "mIoU", &against, "right pixels"].into_iter().chain(view.classes.iter().map(|c| &**c));
    Table::new(columns.map(Column::new)).class("scores").rows(view.cameras.iter().map(row)).html()
}

fn legend(view: &SegmentationView) -> Markup {
    html! {
        ul.class-legend {
            @for (class, name) in view.classes.iter().enumerate() {
                @let [red, green, blue] = palette::class_colour(class);
                li { span style=(format!("background:rgb({red} {green} {blue})")) {} (name) }
            }
        }
    }
}

/// Photo, truth, what was found, and where it is wrong.
fn pictures(view: &SegmentationView, shown: &ShownSegments) -> Markup {
    let right = shown.truth.iter().zip(&shown.found).filter(|(truth, found)| truth == found).count();
    let judged = shown.truth.iter().filter(|truth| **truth != IGNORED).count();
    let share = 100.0 * right as f64 / judged.max(1) as f64;
    let all = [
        ("the picture", png::address(&shown.photo_png)),
        ("truth", png::address(&png::encode(&coloured(shown, &shown.truth)))),
        ("found", png::address(&png::encode(&coloured(shown, &shown.found)))),
        ("wrong pixels", png::address(&png::encode(&errors(shown)))),
    ];
    html! {
        div.segments {
            p { (shown.title) span.muted { ", " (number::fixed(share, 1)) " % right: " (names_in(view, shown)) } }
            div.comparison-grid style="--columns:4" {
                @for (what, address) in &all {
                    div.shot {
                        p.shot-name { (what) }
                        img src=(address) alt=(format!("{}: {what}", shown.title)) width=(shown.width) height=(shown.height);
                    }
                }
            }
        }
    }
}

/// The classes of a window, the one of the most pixels first.
fn names_in(view: &SegmentationView, shown: &ShownSegments) -> String {
    let mut counts: Vec<(usize, usize)> = (0..view.classes.len())
        .map(|class| (shown.truth.iter().filter(|truth| usize::from(**truth) == class).count(), class))
        .filter(|(pixels, _)| *pixels > 0)
        .collect();
    counts.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    counts.into_iter().map(|(_, class)| view.classes[class].as_str()).collect::<Vec<_>>().join(", ")
}

/// A map in the colours of its classes; ignored pixels are black.
fn coloured(shown: &ShownSegments, map: &[u8]) -> RgbImage {
    RgbImage::from_fn(shown.width as u32, shown.height as u32, |column, row| {
        match map[row as usize * shown.width + column as usize] {
            IGNORED => UNJUDGED,
            class => Rgb(palette::class_colour(usize::from(class))),
        }
    })
}

/// The picture in gray, with the wrong pixels in a colour. A picture that cannot be read, or of another size, is gray all over.
fn errors(shown: &ShownSegments) -> RgbImage {
    let gray =
        image::load_from_memory_with_format(&shown.photo_png, ImageFormat::Png).map(|photo| photo.to_luma8());
    RgbImage::from_fn(shown.width as u32, shown.height as u32, |column, row| {
        let pixel = row as usize * shown.width + column as usize;
        let truth = shown.truth[pixel];
        if truth == IGNORED {
            return UNJUDGED;
        }
        if truth != shown.found[pixel] {
            return WRONG;
        }
        let value =
            gray.as_ref().ok().and_then(|gray| gray.get_pixel_checked(column, row)).map_or(128, |v| v[0]);
        Rgb([(DIMMED * f32::from(value)) as u8; 3])
    })
}

/// What is taken for what by a camera: shares of the pixels of a class.
fn confusion(view: &SegmentationView, camera: &CameraSegments) -> Markup {
    let row = |(class, pixels): (usize, &Vec<u64>)| {
        let all: u64 = pixels.iter().sum();
        let cells = pixels.iter().map(|count| {
            if all == 0 {
                return html! { "–" };
            }
            let percent = 100.0 * *count as f64 / all as f64;
            // Shares below a twentieth of a percent are no news.
            if percent < 0.05 {
                html! { "·" }
            } else {
                let share = format!("--share:{:.3}", percent / 100.0);
                html! { span.share style=(share) { (number::fixed(percent, 1)) } }
            }
        });
        Row::new(&view.classes[class], cells)
    };
    let columns = ["truth"].into_iter().chain(view.classes.iter().map(|class| &**class)).map(Column::new);
    Table::new(columns).class("confusion").rows(camera.confusion.iter().enumerate().map(row)).html()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> SegmentationView {
        let photo = RgbImage::from_pixel(2, 2, Rgb([200, 200, 200]));
        let shown = ShownSegments {
            title: "scene 1 <a>".to_owned(),
            photo_png: png::encode(&photo),
            height: 2,
            width: 2,
            truth: vec![0, 1, 1, IGNORED],
            found: vec![0, 1, 0, 2],
        };
        let figure = |value| Some(SegmentFigure { value, range: Some([value - 0.05, value + 0.05]) });
        let camera = |name: &str, number, difference| CameraSegments {
            camera: name.to_owned(),
            number,
            mean_iou: figure(0.5),
            accuracy: figure(0.667),
            classes: vec![figure(0.75), figure(0.25), None],
            against_baseline: difference,
            confusion: vec![vec![999, 1, 0], vec![5, 5, 0], vec![0; 3]],
            shown: vec![shown.clone()],
        };
        SegmentationView {
            classes: ["road", "<car>", "sky"].map(str::to_owned).to_vec(),
            baseline: "nominal".to_owned(),
            windows: 96,
            cameras: vec![
                camera("nominal", 0, None),
                camera("end-to-end", 1, Some(Range { value: 0.0412, low: 0.01, high: 0.07 })),
            ],
        }
    }

    #[test]
    fn figures_confusion_and_pictures_are_shown_and_escaped() {
        let TaskSection { title, html } = segmentation_section(&view());
        assert_eq!(title, "Segmentation");
        for words in [
            "&lt;car&gt;",
            "scene 1 &lt;a&gt;",
            "+0.04",
            "(here sky)",
            "of 96 windows",
            "66.7 % right: &lt;car&gt;, road",
            "99.9",
            "50.0",
        ] {
            assert!(html.contains(words), "{words}: {html}");
        }
        // Four pictures of a window of each camera, and nothing from elsewhere.
        assert_eq!(html.matches("data:image/png;base64,").count(), 8);
        assert!(!html.contains("http") && !html.contains("<car>"));
    }

    #[test]
    fn a_wrong_pixel_is_orange_and_an_ignored_one_black() {
        let view = view();
        let map = errors(&view.cameras[0].shown[0]);
        let gray = Rgb([120; 3]);
        assert_eq!([map[(0, 0)], map[(1, 0)], map[(0, 1)], map[(1, 1)]], [gray, gray, WRONG, UNJUDGED]);
        let truth = coloured(&view.cameras[0].shown[0], &view.cameras[0].shown[0].truth);
        assert_eq!(truth[(1, 0)], Rgb(palette::class_colour(1)));
    }

    #[test]
    fn colours_of_classes_differ_for_every_kind_of_sight() {
        // Redness against greenness is what most colour-blind readers miss: classes must differ in lightness or blueness.
        let seen = |class: usize| {
            let [r, g, b] = palette::class_colour(class).map(f64::from);
            [0.35 * r + 0.65 * g, b]
        };
        for a in 0..10 {
            for b in 0..a {
                let [p, q] = [seen(a), seen(b)];
                let apart = (p[0] - q[0]).hypot(p[1] - q[1]);
                assert!(apart > 18.0, "{a} {b}: {apart}");
            }
        }
    }
}
