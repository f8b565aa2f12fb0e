//! The page: first the result, then its explanation, last the configuration of the run.

use maud::{Markup, PreEscaped, html};

use super::answer::answer;
use super::attribution::{attribution, has_attribution};
use super::caveats::caveats;
use super::change::change_table;
use super::frames::frames;
use super::made::made_table;
use super::mtf::{has_mtf, mtf};
use super::picture::{ends, has_ends, has_more, more_pictures, most_gain, pictures};
use super::place_chart::{has_places, place_chart};
use super::progress::progress;
use super::psf_table::psf_table;
use super::reading::reading;
use super::score_table::score_table;
use super::view::{CameraView, FieldPoint, LossCurve, Report, baseline, camera_colour};
use crate::layout::{CrossSection, Extent};
use crate::number;
use crate::page::{Page, Section, caption, facts, figure, section, with_contents};
use crate::palette;
use crate::plot::{Axes, Chart, Series, chart_svg};
use crate::prescription::{first_order_line, prescription};

/// Width of a layout drawing, px.
const LAYOUT_PX: f64 = 1020.0;

/// The whole page.
pub(super) fn page(report: &Report) -> String {
    let has_cameras = !report.cameras.is_empty();
    let has_settings = report.cameras.iter().any(|c| !c.setting_changes.is_empty());
    let answer = answer(report);
    let has_answer = answer.is_some();
    let sections = [
        section_of("At work", report.progress.is_some(), || progress(report)),
        section_of("Axis and corner", has_answer && has_ends(report), || ends(report)),
        section_of("Score over the field", has_places(report), || place_chart(report)),
        result(report, has_answer),
        // Without an answer no picture stands before this section.
        section_of("Pictures", !has_answer && !report.pictures.is_empty(), || pictures(report)),
        section_of("Pictures", has_answer && has_more(report), || more_pictures(report)),
        section_of("Whole frames", !report.frames.is_empty(), || frames(report)),
        section_of("As made", report.made.is_some(), || made_table(report)),
        section_of("Lenses", has_cameras, || lenses(report)),
        section_of("Exposure and image signal processor", has_settings, || settings(report)),
        section_of("Modulation transfer functions", has_mtf(report), || mtf(report)),
        section_of("Point-spread functions", has_psfs(report), || psf_table(report)),
        section_of("Over the field", has_cameras, || over_the_field(report)),
        section_of("Over the run", !report.losses.is_empty(), || over_the_run(report)),
        section_of("What lowered the loss", has_attribution(report), || attribution(report)),
        how_it_was_made(report),
    ];
    let of_task = report.task.sections.iter().map(|own| section(&own.title, PreEscaped(own.html.clone())));
    // Behind the progress: the task is what a reader came for.
    let (first, rest) = sections.split_at(1);
    let all = first.iter().flatten().cloned().chain(of_task).chain(rest.iter().flatten().cloned());
    let main = with_contents(&all.collect::<Vec<Section>>());
    // Without an answer the page begins with what the run is; with one this stands below the answer, in the result.
    let subtitle = if has_answer {
        html! {}
    } else {
        html! { (report.subtitle) }
    };
    Page {
        title: report.title.clone(),
        style: include_str!("page.css"),
        headline: report.title.clone(),
        subtitle,
        lead: html! {
            @if let Some(answer) = &answer { (answer.shown()) (most_gain(report)) }
            (list_of_warnings(&caveats(report)))
        },
        main,
        script: Some((viewer(), include_str!("page.js"))),
    }
    .html()
}

/// A section under a headline, unless it is empty.
fn section_of(headline: &str, is_there: bool, body: impl FnOnce() -> Markup) -> Option<Section> {
    is_there.then(|| section(headline, body()))
}

/// The scores, what they say in sentences, and folded the remarks.
fn result(report: &Report, has_answer: bool) -> Option<Section> {
    section_of("Result", !report.table.is_empty() || !report.notes.is_empty(), || {
        html! {
            @if has_answer { p { (report.subtitle) } }
            @if report.task.ranking.is_some() {
                // The score that ranks cameras stands above with its range; the others fill a wide table.
                details { summary { "All scores and lenses" } (score_table(report)) }
            } @else {
                (score_table(report))
            }
            (list_of_warnings(&report.warnings))
            @for sentence in reading(report) { p.reading { (sentence) } }
            @if let Some(files) = &report.left_out { p.muted { (files) "." } }
            @if !report.notes.is_empty() {
                details {
                    summary { "How scores and lenses are measured" }
                    ul.notes { @for note in &report.notes { li { (note) } } }
                }
            }
        }
    })
}

/// Warnings as a list; nothing without any.
fn list_of_warnings(warnings: &[String]) -> Markup {
    html! { @if !warnings.is_empty() { ul.warnings { @for warning in warnings { li { (warning) } } } } }
}

/// Layouts on one scale, with the changes.
pub(crate) fn lenses(report: &Report) -> Markup {
    let name = report.table.get(baseline(&report.table)).map(|row| &row.camera);
    let is_it = |camera: &&CameraView| Some(&camera.name) == name;
    let baseline = report.cameras.iter().find(is_it).or(report.cameras.first());
    let section = |i: usize| CrossSection {
        name: &report.cameras[i].name,
        layout: &report.cameras[i].layout,
        fields_deg: &report.layout_fields_deg,
        half_diagonal_mm: report.half_diagonal_mm,
        ghost: baseline.map(|b| &b.layout).filter(|ghost| **ghost != report.cameras[i].layout),
    };
    let sections: Vec<CrossSection> = (0..report.cameras.len()).map(section).collect();
    let extent = sections.iter().map(CrossSection::extent).fold(Extent::default(), Extent::union);
    let px_per_mm = LAYOUT_PX / (extent.z_max_mm - extent.z_min_mm).max(1e-6);
    let rays = baseline.and_then(|b| b.layout.rays.first()).map_or(0, Vec::len);
    html! {
        @for (i, camera) in report.cameras.iter().enumerate() {
            (lens(camera, i, &sections[i].svg(px_per_mm, extent)))
        }
        (caption(html! {
            "All layouts are on one scale. Fans of " (rays) " rays are aimed at the stop by real tracing "
            "at " (number::fixed(report.reference_um, 4)) " µm; a ray that is clipped ends in a dot. "
            "Glass is blue for crowns and plastics of low dispersion, sand for flints."
            @if let (Some(b), true) = (baseline, report.cameras.len() > 1) {
                " Dashed: the elements of " (b.name) "."
            }
        }))
    }
}

/// One lens: its layout, its changes and its prescription.
fn lens(camera: &CameraView, i: usize, layout_svg: &str) -> Markup {
    html! {
        article.lens {
            h3 style=(palette::camera_style(palette::camera(i))) { (camera.name) }
            p.muted { (first_order_line(&camera.first_order)) }
            (figure(layout_svg))
            @if !camera.changes.is_empty() {
                details open {
                    summary { "What changed (" (camera.changes.len()) ")" }
                    (change_table(&camera.changes, |name| html! { (name) }))
                }
            }
            details {
                summary { "Prescription" }
                (prescription(&camera.surfaces))
            }
        }
    }
}

/// What moved of every camera's exposure and hardware ISP.
fn settings(report: &Report) -> Markup {
    html! {
        @for (i, camera) in report.cameras.iter().enumerate().filter(|(_, c)| !c.setting_changes.is_empty()) {
            article.lens {
                h3 style=(palette::camera_style(palette::camera(i))) { (camera.name) }
                details open {
                    summary { "Parameters that moved (" (camera.setting_changes.len()) ")" }
                    (change_table(&camera.setting_changes, |key| html! { code { (key) } }))
                }
            }
        }
        (caption("From the values of experiment and preset to those of the finished camera, with which every score was taken, the ISP in whole numbers."))
    }
}

/// Spot radius and illumination of every camera from the axis to the full field.
pub(crate) fn over_the_field(report: &Report) -> Markup {
    let chart = |what: &str, y_axis: &str, value: fn(&FieldPoint) -> f64| {
        let series = report.cameras.iter().enumerate().map(|(i, camera)| Series {
            name: camera.name.clone(),
            colour: palette::camera(i).into(),
            points: camera.over_field.iter().map(|p| (p.field_deg, value(p))).collect(),
            ..Series::default()
        });
        figure(&chart_svg(&Chart {
            alt: format!("{what} over the field angle, one curve per camera"),
            x_axis: "field angle, degrees".into(),
            y_axis: y_axis.into(),
            series: series.collect(),
            ..Chart::default()
        }))
    };
    html! {
        div.charts {
            (chart("RMS spot radius", "RMS spot radius, µm", |p| p.rms_um))
            (chart("Relative illumination", "relative illumination, %", |p| 100.0 * p.illumination))
        }
        (caption("Traced from the lenses above: means over the three wavelengths, spots about their common centroid."))
    }
}

/// One chart for each block and loss, one curve for each camera.
pub(crate) fn over_the_run(report: &Report) -> Markup {
    let mut groups: Vec<Vec<&LossCurve>> = Vec::new();
    for curve in &report.losses {
        let is_same = |g: &&mut Vec<&LossCurve>| g[0].block == curve.block && g[0].label == curve.label;
        match groups.iter_mut().find(is_same) {
            Some(group) => group.push(curve),
            None => groups.push(vec![curve]),
        }
    }
    html! {
        div.charts {
            @for group in &groups { (figure(&chart_svg(&loss_chart(group, report)))) }
        }
        (caption(
            "Faint: every step. Thick: smoothed by local straight lines. Axes are logarithmic where values span more than a decade.",
        ))
    }
}

fn loss_chart(group: &[&LossCurve], report: &Report) -> Chart {
    let series = group.iter().enumerate().map(|(i, curve)| Series {
        name: curve.camera.clone(),
        colour: camera_colour(&report.cameras, &curve.camera, i).into(),
        points: curve.points.iter().map(|(step, value)| (*step as f64, *value)).collect(),
        ..Series::default()
    });
    let (block, label) = (&group[0].block, &group[0].label);
    Chart {
        alt: format!("{label} over the steps of the {block}"),
        x_axis: format!("step of the {block}"),
        y_axis: label.clone(),
        series: series.collect(),
        marks: Vec::new(),
        smooth: true,
        axes: Axes::OfData,
    }
}

fn has_psfs(report: &Report) -> bool {
    report.cameras.iter().any(|c| !c.psfs.is_empty())
}

/// The machine, and the configuration with which to repeat the run.
fn how_it_was_made(report: &Report) -> Option<Section> {
    let is_there = !report.environment.is_empty() || !report.config_toml.is_empty();
    section_of("How it was made", is_there, || {
        html! {
            @if !report.command_line.is_empty() { pre.command { code { "$ " (report.command_line) } } }
            @if !report.environment.is_empty() {
                (facts(report.environment.iter().map(|(name, value)| (name.as_str(), Some(value.clone())))))
            }
            @if !report.config_toml.is_empty() {
                details {
                    summary { "Configuration, as resolved" }
                    pre.config { code { (report.config_toml) } }
                }
            }
        }
    })
}

/// The enlarged view, which the script fills.
fn viewer() -> Markup {
    html! {
        dialog #viewer aria-label="Picture, large" {
            img alt="" {}
            div.viewer-bar {
                button type="button" data-step="-1" aria-label="previous camera" { "←" }
                output {}
                button type="button" data-step="1" aria-label="next camera" { "→" }
                button type="button" data-close="" aria-label="close" { "✕" }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::assert_readable;
    use crate::sample;

    #[test]
    fn the_page_is_self_contained() {
        let page = page(&sample::report());
        let elsewhere = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!elsewhere.contains("http://") && !elsewhere.contains("https://"));
        assert!(!page.contains("@import") && !page.contains("url("));
        for source in page.split("src=\"").skip(1) {
            assert!(
                source.starts_with("data:image/png;base64,") || source.starts_with("data:image/jpeg;base64,")
            );
        }
    }

    #[test]
    fn every_section_exists_and_every_picture_is_described() {
        let report = sample::report();
        let page = page(&report);
        for headline in [
            "Result",
            "Pictures",
            "Whole frames",
            "Lenses",
            "Modulation transfer functions",
            "Point-spread functions",
            "Over the field",
            "Over the run",
            "How it was made",
        ] {
            assert!(page.contains(&format!("<h2>{headline}</h2>")), "{headline}");
            assert!(page.contains(&format!("\">{headline}</a>")), "{headline} in the contents");
        }
        assert_readable(&page);
        assert_eq!(page.matches("class=\"layout\"").count(), 3);
        assert_eq!(page.matches("class=\"psf-picture\"").count(), 15);
        assert!(page.contains("class=\"ghost\""));
        assert_eq!(page.matches("<img").count(), page.matches(" alt=\"").count());
        assert!(!page.contains("NaN"));
    }

    #[test]
    fn the_answer_comes_first_and_what_explains_it_in_the_order_of_its_worth() {
        let report = sample::answered();
        let page = page(&report);
        assert_readable(&page);
        let at = |text: &str| page.find(text).unwrap_or_else(|| panic!("{text}"));
        let order = [
            "End-to-end scores highest in PSNR: +1.30",
            "class=\"numbers\"",
            "Most gain: +3.0",
            "<nav class=\"contents\"",
            "<h2>Axis and corner</h2>",
            "On the axis: \u{2212}0.9",
            "In the corner: +2.9",
            "<h2>Score over the field</h2>",
            "End-to-end is ahead of nominal at 2 of 3 distances from the axis",
            "<h2>Result</h2>",
            "<h2>Pictures</h2>",
            "In the zone",
            "Median gain",
            "1 more held-out picture<",
            "<h2>Lenses</h2>",
            "<h2>How it was made</h2>",
            "petzval design",
        ];
        let places: Vec<usize> = order.iter().map(|text| at(text)).collect();
        assert!(places.is_sorted(), "{:?}", order.iter().zip(places).collect::<Vec<_>>());
        // Each picture once: truth and three cameras, twice for those before the pictures and with the raw frame for the others.
        assert_eq!(page.matches("class=\"comparison\"").count(), report.pictures.len());
        // The run is described once.
        assert_eq!(page.matches("of a report").count(), 1);
        // A run at work has no answer, and all its pictures in one place.
        let progress = Some(super::super::Progress::default());
        let page = super::page(&Report { progress, ..sample::answered() });
        assert!(!page.contains("scores highest") && !page.contains("<h2>Axis and corner</h2>"));
        assert_eq!(page.matches("class=\"comparison\"").count(), report.pictures.len());
    }

    #[test]
    fn names_are_escaped_everywhere() {
        let mut report = sample::report();
        let bad = "<script>alert(1)</script>";
        report.title = bad.into();
        report.config_toml = bad.into();
        report.notes.push(bad.into());
        report.environment.push((bad.into(), bad.into()));
        report.table[1].camera = bad.into();
        report.cameras[1].name = bad.into();
        report.cameras[1].surfaces[0].glass = bad.into();
        report.cameras[1].layout.elements[0].glass = bad.into();
        report.losses[0].label = bad.into();
        assert!(!page(&report).contains("alert(1)</script>"));
    }

    #[test]
    fn an_empty_report_is_a_page() {
        let page = page(&Report::default());
        assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>"));
        assert!(!page.contains("<h2>"));
    }
}
