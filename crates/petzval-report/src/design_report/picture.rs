//! Pictures: a scene and the picture of each camera, with a part of them enlarged.

use std::io::Cursor;

use image::ImageFormat;
use maud::{Markup, html};
use petzval_base::counted;

use super::detail::focus;
use super::standing::{Standing, place_in_words};
use super::view::{CameraPicture, PictureView, Report, Role, camera_colour};
use crate::number;
use crate::page::caption;
use crate::{palette, png};

/// Side of the enlarged part, as a share of the picture's side.
const ZOOM: f64 = 0.25;

/// Number of pictures that are shown at once; the others are shown on demand.
const UNFOLDED: usize = 6;

/// Pictures that the page shows before this section: that of most gain as part of the answer, and those on the axis and in the corner.
const SHOWN_BEFORE: [Role; 3] = [Role::MostGain, Role::Axis, Role::Corner];

/// The picture of a role, with its place in [`Report::pictures`].
fn of_role(report: &Report, role: Role) -> Option<(usize, &PictureView)> {
    report.pictures.iter().enumerate().find(|(_, picture)| picture.role == Some(role))
}

/// The picture of most gain, as part of the answer.
pub(super) fn most_gain(report: &Report) -> Markup {
    html! {
        @if let Some((i, picture)) = of_role(report, Role::MostGain) {
            div.answer-pictures { (comparison(report, picture, i, Rows::Finished)) }
        }
    }
}

/// Whether there are pictures on the axis and in the corner.
pub(super) fn has_ends(report: &Report) -> bool {
    [Role::Axis, Role::Corner].into_iter().any(|role| of_role(report, role).is_some())
}

/// The pictures on the axis and in the corner.
pub(super) fn ends(report: &Report) -> Markup {
    html! {
        @for (i, picture) in [Role::Axis, Role::Corner].into_iter().filter_map(|role| of_role(report, role)) {
            (comparison(report, picture, i, Rows::Finished))
        }
        (caption(
            "One picture of each place, of the photograph with the most detail that is not shown above. The framed part is the one with the most \
             detail. Select a picture to see it large; the arrow keys then switch cameras in place."
        ))
    }
}

/// Whether there are pictures beside those of the answer and of both ends of the field.
pub(super) fn has_more(report: &Report) -> bool {
    report.pictures.iter().any(|picture| !is_shown_before(picture))
}

fn is_shown_before(picture: &PictureView) -> bool {
    picture.role.is_some_and(|role| SHOWN_BEFORE.contains(&role))
}

/// The other pictures of a page that begins with its answer.
pub(super) fn more_pictures(report: &Report) -> Markup {
    let others: Vec<(usize, &PictureView)> =
        report.pictures.iter().enumerate().filter(|(_, picture)| !is_shown_before(picture)).collect();
    shown(report, &others)
}

/// All pictures. A click enlarges a picture, and arrow keys then switch between the cameras.
pub(crate) fn pictures(report: &Report) -> Markup {
    shown(report, &report.pictures.iter().enumerate().collect::<Vec<_>>())
}

/// Pictures with their places in [`Report::pictures`]: those with a role, or the first ones, and the others folded.
fn shown(report: &Report, all: &[(usize, &PictureView)]) -> Markup {
    let (on_page, in_all) = (report.pictures.len(), report.pictures_in_all);
    let chosen = all.iter().take_while(|(_, picture)| picture.role.is_some()).count();
    let (first, rest) = all.split_at(if chosen > 0 { chosen } else { all.len().min(UNFOLDED) });
    html! {
        @if on_page < in_all {
            p { (on_page) " of " (in_all) " held-out pictures: by what is gained in them, by place and by photograph; the others are spread evenly. The scores are of all." }
        }
        @for (i, picture) in first { (comparison(report, picture, *i, Rows::All)) }
        @if !rest.is_empty() {
            details {
                summary { (counted(rest.len(), "more held-out picture")) }
                @for (i, picture) in rest { (comparison(report, picture, *i, Rows::All)) }
            }
        }
        (caption(
            "Below each picture the framed part is enlarged without smoothing: the largest object that is to be found, or the part with the most detail; the last row is the raw frame in a plain development, \
             without network or hardware ISP. Select a picture to see it large; the arrow keys then switch cameras in place.",
        ))
        @if let Some(legend) = &report.task.legend { (caption(legend)) }
    }
}

/// What is shown of each camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rows {
    /// The finished picture.
    Finished,
    /// The raw frame in a plain development as well.
    All,
}

/// The name of a role above its picture.
fn in_words(role: Role) -> &'static str {
    match role {
        Role::MostGain => "Most gain",
        Role::Axis => "On the axis",
        Role::Corner => "In the corner",
        Role::Zone => "In the zone",
        Role::MedianGain => "Median gain",
        Role::LeastGain => "Least gain",
    }
}

/// Why a picture is shown, and what is gained in it: `Most gain: +4.1 dB against nominal`.
fn reason(report: &Report, picture: &PictureView) -> Option<String> {
    let role = picture.role?;
    let (standing, scores) = (Standing::of(report)?, report.held_out.get(picture.number)?);
    let gain = standing.gain_in(scores);
    let role = match role {
        Role::MostGain if gain < 0.0 => "Least loss",
        Role::LeastGain if gain < 0.0 => "Most loss",
        role => in_words(role),
    };
    let about = standing.about();
    let gain = match scores.found.is_empty() {
        _ if !gain.is_finite() => return Some(role.to_owned()),
        true => {
            let sign = if about.higher_is_better { gain } else { -gain };
            let unit = if about.unit.is_empty() { about.title.clone() } else { about.unit.clone() };
            // One picture is worth a digit less than the mean over all.
            format!("{}\u{a0}{unit}", number::signed(sign, about.decimals.saturating_sub(1)))
        }
        false => format!("{} {}", number::signed(gain, 0), report.task.counted),
    };
    let [camera, baseline] = [standing.subject, standing.baseline].map(|camera| standing.name(camera));
    Some(format!("{role}: {gain}, {camera} against {baseline}"))
}

/// One scene in columns: truth, then the cameras.
fn comparison(report: &Report, picture: &PictureView, group: usize, rows: Rows) -> Markup {
    let focus = picture.focus.unwrap_or_else(|| focus(&picture.truth_png, ZOOM));
    let (columns, corner) = (picture.cameras.len() + 1, corner(focus));
    let place = report.held_out.get(picture.number).map(|scores| place_in_words(scores.relative_field));
    let reason = reason(report, picture);
    // Scores over all pictures at once, as of objects that are found, have no value for one.
    let has_value =
        |i: &usize| picture.cameras.iter().any(|shot| shot.scores.get(*i).is_some_and(|v| v.is_finite()));
    let shown: Vec<usize> = (0..report.scores.len()).filter(has_value).collect();
    html! {
        article.comparison {
            p {
                b { (reason.as_ref().unwrap_or(&picture.title)) }
                span.muted {
                    @if reason.is_some() { " " (picture.title) }
                    @if let Some(place) = place { ", " (place) }
                }
            }
            div.comparison-grid style=(format!("--columns:{columns}")) {
                div.shot {
                    div.shot-name style="--camera:currentColor" { "truth" span.muted { " the scene" } }
                    (framed(&picture.truth_png, &format!("{}: the scene", picture.title), "truth", group, corner))
                    @if !shown.is_empty() {
                        div.shot-scores.muted { @for i in &shown { span { (report.scores[*i].title) } } }
                    }
                    (zoomed(&picture.truth_png, &format!("{}: the scene, enlarged", picture.title), corner))
                    div.shot-note { "the framed part, enlarged" }
                }
                @for (i, shot) in picture.cameras.iter().enumerate() {
                    (camera_column(report, picture, shot, i, (&shown, group, corner, rows)))
                }
            }
        }
    }
}

fn camera_column(
    report: &Report,
    picture: &PictureView,
    shot: &CameraPicture,
    i: usize,
    (shown, group, corner, rows): (&[usize], usize, [f64; 2], Rows),
) -> Markup {
    let colour = camera_colour(&report.cameras, &shot.camera, i);
    let alt = |what: &str| format!("{}: {what} of the {} camera", picture.title, shot.camera);
    html! {
        div.shot {
            div.shot-name style=(palette::camera_style(colour)) { (shot.camera) }
            (framed(&shot.output_png, &alt("finished picture"), &shot.camera, group, corner))
            @if !shown.is_empty() {
                div.shot-scores {
                    @for i in shown {
                        // One picture is worth a digit less than the mean over all.
                        @let score = &report.scores[*i];
                        @let text = number::with_unit(shot.scores[*i], score.decimals.saturating_sub(1), &score.unit);
                        span { @if *i == 0 { b { (text) } } @else { (text) } }
                    }
                }
            }
            (zoomed(&shot.output_png, &alt("finished picture, enlarged,"), corner))
            @if rows == Rows::All {
                div.shot-note { (if report.has_isp { "after the ISP" } else { "after the network" }) }
                (zoomed(&shot.developed_png, &alt("developed raw frame, enlarged,"), corner))
                div.shot-note { (if report.has_isp { "developed plainly" } else { "before the network" }) }
            }
        }
    }
}

/// The left and the upper edge of the enlarged part around a place, shares of width and height.
fn corner(focus: [f64; 2]) -> [f64; 2] {
    focus.map(|middle| (middle - 0.5 * ZOOM).clamp(0.0, 1.0 - ZOOM))
}

/// A picture with a frame around the enlarged part.
fn framed(png: &[u8], alt: &str, name: &str, group: usize, [left, top]: [f64; 2]) -> Markup {
    let [right, bottom] = [left, top].map(|edge| 1.0 - ZOOM - edge);
    let [left, top, right, bottom] = [left, top, right, bottom].map(|share| number::fixed(100.0 * share, 2));
    html! {
        button.frame type="button" data-group=(group) data-name=(name) {
            img src=(png::address(png)) alt=(alt);
            i style=(format!("inset:{top}% {right}% {bottom}% {left}%")) {}
        }
    }
}

/// The enlarged part of a picture; nothing if it cannot be decoded.
fn zoomed(png: &[u8], alt: &str, corner: [f64; 2]) -> Markup {
    html! {
        @if let Some(part) = part(png, corner) { img.pixels.zoom src=(png::address(&part)) alt=(alt); }
    }
}

fn part(png: &[u8], [left, top]: [f64; 2]) -> Option<Vec<u8>> {
    let picture = image::load_from_memory_with_format(png, ImageFormat::Png).ok()?;
    let side = |length: u32| ((f64::from(length) * ZOOM).round() as u32).max(1);
    let (w, h) = (side(picture.width()), side(picture.height()));
    let first =
        |share: f64, length: u32, part: u32| ((share * f64::from(length)).round() as u32).min(length - part);
    let (x, y) = (first(left, picture.width(), w), first(top, picture.height(), h));
    let mut out = Cursor::new(Vec::new());
    picture.crop_imm(x, y, w, h).write_to(&mut out, ImageFormat::Png).ok()?;
    Some(out.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn the_enlarged_part_is_a_quarter_of_each_side_and_lies_in_the_picture() {
        let png = sample::picture_png(64, 32, 0);
        let whole = image::load_from_memory(&png).unwrap().to_rgb8();
        for (focus, (x, y)) in [([0.5, 0.5], (24, 12)), ([0.25, 0.75], (8, 20)), ([0.02, 1.0], (0, 24))] {
            let cut = image::load_from_memory(&part(&png, corner(focus)).unwrap()).unwrap().to_rgb8();
            assert_eq!(cut.dimensions(), (16, 8));
            assert_eq!(cut.get_pixel(0, 0), whole.get_pixel(x, y), "{focus:?}");
        }
        // The frame lies where the part is cut out.
        let page = framed(&png, "", "", 0, corner([0.25, 0.75])).into_string();
        assert!(page.contains("inset:62.50% 62.50% 12.50% 12.50%"), "{page}");
    }

    #[test]
    fn a_choice_of_the_pictures_says_how_many_there_are() {
        let mut report = sample::report();
        assert!(!pictures(&report).into_string().contains("held-out pictures: by what"));
        report.pictures_in_all = 450;
        assert!(pictures(&report).into_string().contains("2 of 450 held-out pictures: by what is gained"));
    }

    #[test]
    fn what_is_lost_is_no_gain() {
        let mut report = sample::answered();
        assert!(reason(&report, &report.pictures[0]).unwrap().starts_with("Most gain: +3.0"));
        // The baseline has 3.5 dB more in this picture.
        report.held_out[report.pictures[0].number].scores[0][1] += 3.5;
        let said = reason(&report, &report.pictures[0]).unwrap();
        assert!(said.starts_with("Least loss: \u{2212}0.5"), "{said}");
        report.pictures[0].role = Some(Role::LeastGain);
        let said = reason(&report, &report.pictures[0]).unwrap();
        assert!(said.starts_with("Most loss: \u{2212}0.5"), "{said}");
    }

    #[test]
    fn a_broken_picture_is_shown_by_its_alt_text() {
        let mut report = sample::report();
        report.pictures[0].truth_png = vec![1, 2, 3];
        report.pictures[0].title = "a \"quoted\" <scene>".into();
        let page = pictures(&report).into_string();
        assert!(page.contains("a &quot;quoted&quot; &lt;scene&gt;: the scene"));
    }
}
