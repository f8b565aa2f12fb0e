//! The score over the field: by how much each camera is ahead of the baseline, from the axis to the corner.

use maud::{Markup, html};
use petzval_base::counted;

use super::standing::{Difference, Standing};
use super::view::{Report, camera_colour};
use crate::page::{caption, figure};
use crate::palette::MUTED;
use crate::plot::{Axis, Curve, Key, KeyLine, Marker, Panel, Pen, Points, Sheet, grid, span};
use crate::words::capitalised;

/// Width of the chart and height of the field between its axes, px.
const WIDTH_PX: f64 = 720.0;
const FIELD_PX: f64 = 260.0;

/// Width of the lines, px.
const LINE_PX: f64 = 2.0;

/// Whether there are places to draw. Scores over all pictures at once, such as average precision, have none.
pub(super) fn has_places(report: &Report) -> bool {
    Standing::of(report).is_some_and(|standing| differences(&standing).len() > 1)
}

/// The sentence, the chart, and what it shows.
pub(super) fn place_chart(report: &Report) -> Markup {
    let Some(standing) = Standing::of(report) else { return html! {} };
    let photographs = {
        let mut names: Vec<&str> = report.held_out.iter().map(|picture| &*picture.photograph).collect();
        names.sort_unstable();
        names.dedup();
        names.len()
    };
    html! {
        p { (sentence(&standing)) }
        (figure(&chart(report, &standing).svg()))
        (caption(html! {
            "Each point: the mean over " (counted(photographs, "held-out photograph")) " at one distance from the axis, less that of " (standing.name(standing.baseline)) " on the same pictures, "
            "so that their content cancels."
            @if photographs > 1 { " Bars: the standard error over photographs, where it is larger than the marker." }
            " The figures are those of " code { "pictures.csv" } "."
        }))
    }
}

/// The subject less the baseline at each place where both have a score.
fn differences(standing: &Standing) -> Vec<Difference> {
    let at = |place: usize| standing.at(place, standing.subject, standing.baseline);
    (0..standing.places.len()).map(at).filter(|difference| difference.value.is_finite()).collect()
}

/// At how many distances from the axis the subject is ahead and behind. Places of one distance are one.
fn sentence(standing: &Standing) -> String {
    let (subject, baseline) = (standing.subject, standing.baseline);
    let all = differences(standing);
    let resolved = |d: &&Difference| d.is_resolved(standing.about().decimals);
    let ahead = all.iter().filter(resolved).filter(|d| standing.gain(**d) > 0.0).count();
    let behind = all.iter().filter(resolved).count() - ahead;
    let level = match all.len() - ahead - behind {
        0 => String::new(),
        level => format!(", and within the error of it at {level}"),
    };
    format!(
        "{} is ahead of {} at {ahead} of {} from the axis, behind at {behind}{level}.",
        capitalised(standing.name(subject)),
        standing.name(baseline),
        counted(all.len(), "distance")
    )
}

/// A place, % of the half-diagonal, with a difference there and its error.
type At = (f64, f64, f64);

/// One line for each camera but the baseline, which is the line at zero.
fn chart(report: &Report, standing: &Standing) -> Sheet {
    let baseline = standing.baseline;
    let others: Vec<usize> = (0..report.table.len()).filter(|camera| *camera != baseline).collect();
    let points = |camera: usize| -> Vec<At> {
        let at = |place: usize| {
            let Difference { value, error } = standing.at(place, camera, baseline);
            let error = if error.is_finite() { error } else { 0.0 };
            (100.0 * standing.places[place].relative_field, value, error)
        };
        (0..standing.places.len()).map(at).filter(|(_, value, _)| value.is_finite()).collect()
    };
    let lines: Vec<(usize, Vec<At>)> =
        others.into_iter().map(|camera| (camera, points(camera))).filter(|(_, at)| !at.is_empty()).collect();
    let ends = lines.iter().flat_map(|(_, at)| at.iter().flat_map(|(_, y, e)| [y - e, y + e]));
    let (low, high) = span(ends.chain([0.0])).unwrap_or((0.0, 1.0));
    let air = 0.05 * (high - low).max(1e-6);
    let score = standing.about();
    let unit = if score.unit.is_empty() { String::new() } else { format!(", {}", score.unit) };
    let names = [
        "distance from the axis, % of the half-diagonal",
        &format!("{} against {}{unit}", score.title, standing.name(baseline)),
    ];
    let mut panel =
        Panel::new("", names, Axis::between(0.0, 100.0, 6), Axis::around(low - air, high + air, 5));
    let zero = Pen::thin(MUTED).dashed();
    panel.curves.push(Curve {
        pen: zero.clone(),
        index: 0,
        points: [0.0, 100.0].map(|x| Some([x, 0.0])).into(),
    });
    let mut keys = vec![Key::pen(zero, standing.name(baseline).to_owned())];
    for (i, (camera, at)) in lines.into_iter().enumerate() {
        let name = standing.name(camera);
        let colour = camera_colour(&report.cameras, name, camera).to_owned();
        let pen = Pen { width: LINE_PX, ..Pen::thin(&colour) };
        panel.curves.push(Curve {
            pen,
            index: 0,
            points: at.iter().map(|(x, y, _)| Some([*x, *y])).collect(),
        });
        let marker = Marker::nth(i);
        keys.push(Key { line: KeyLine::Marker(colour.clone(), marker), name: name.to_owned() });
        panel.points.push(Points { colour, marker, is_hollow: false, at });
    }
    let (body, height) = grid(&[panel], 1, WIDTH_PX, FIELD_PX);
    Sheet {
        class: "place-chart",
        keys,
        alt: format!(
            "{} of each camera less that of {}, from the axis to the corner",
            score.title,
            standing.name(baseline)
        ),
        width: WIDTH_PX,
        height,
        body,
        ..Sheet::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn every_camera_has_its_line_and_the_baseline_is_zero() {
        let report = Report { held_out: sample::held_out(), ..sample::report() };
        assert!(has_places(&report) && !has_places(&sample::report()));
        let standing = Standing::of(&report).unwrap();
        assert_eq!(
            sentence(&standing),
            "End-to-end is ahead of nominal at 2 of 3 distances from the axis, behind at 1."
        );
        let svg = chart(&report, &standing).svg();
        assert_eq!(svg.matches("class=\"curve\"").count(), 3);
        assert_eq!(svg.matches("class=\"points\"").count(), 2);
        for text in ["PSNR against nominal, dB", "spot-optimised", "end-to-end", "half-diagonal"] {
            assert!(svg.contains(text), "{text}");
        }
        let page = place_chart(&report).into_string();
        assert!(page.contains("3 held-out photographs") && page.contains("standard error over photographs"));
    }

    #[test]
    fn scores_over_all_pictures_at_once_have_no_places() {
        let mut report = Report { held_out: sample::held_out(), ..sample::report() };
        for picture in &mut report.held_out {
            picture.scores.iter_mut().for_each(|scores| scores[1] = f64::NAN);
        }
        assert!(!has_places(&report));
    }

    #[test]
    fn a_place_within_the_error_is_neither_ahead_nor_behind() {
        let mut report = Report { held_out: sample::held_out(), ..sample::report() };
        for (picture, gain) in report.held_out.iter_mut().step_by(3).zip([-1.0, 0.2, 1.0]) {
            picture.scores[2][1] = picture.scores[0][1] + gain;
        }
        let standing = Standing::of(&report).unwrap();
        assert_eq!(
            sentence(&standing),
            "End-to-end is ahead of nominal at 2 of 3 distances from the axis, behind at 0, and within the error of it at 1."
        );
    }
}
