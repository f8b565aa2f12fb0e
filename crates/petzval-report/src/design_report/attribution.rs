//! What lowered the loss: the numbers of the lenses, by surface and one by one.

use maud::{Markup, html};

use super::view::{Attribution, CameraView, Report, camera_colour};
use crate::number;
use crate::page::{caption, figure};
use crate::plot::{Bar, BarChart, BarKey, bars_svg};
use crate::table::{Column, Row, Table};

/// Printed decimals of a loss.
const DECIMALS: usize = 4;

/// Whether some lens moved for the task.
pub(super) fn has_attribution(report: &Report) -> bool {
    report.cameras.iter().any(|camera| !camera.attribution.is_empty())
}

/// A bar for each surface and camera, and a table of all numbers.
pub(super) fn attribution(report: &Report) -> Markup {
    let moved: Vec<&CameraView> = report.cameras.iter().filter(|c| !c.attribution.is_empty()).collect();
    html! {
        div.charts { (figure(&bars_svg(&by_surface(report, &moved)))) }
        details {
            summary { "Every number" }
            (by_number(&moved))
        }
        (caption(
            "Sums over all lens steps for the task: the change of each number times the slope of the batch's loss by it, penalties included, and \
             solves following. Positive: the loss fell. To first order, and of each step on its own batch, whose noise the step follows: sums \
             tell which numbers led, not by how much the loss of other pictures fell."
        ))
    }
}

fn by_surface(report: &Report, moved: &[&CameraView]) -> BarChart {
    let sum = |camera: &CameraView, surface: &str| {
        let of_surface = camera.attribution.iter().filter(|a| a.surface == surface);
        of_surface.map(|a| a.lowered).sum::<f64>()
    };
    let bar = |surface: &str| Bar {
        name: surface.to_owned(),
        values: moved.iter().map(|camera| sum(camera, surface)).collect(),
    };
    let key = |(i, camera): (usize, &&CameraView)| BarKey {
        name: camera.name.clone(),
        colour: camera_colour(&report.cameras, &camera.name, i).to_owned(),
    };
    BarChart {
        alt: "By how much the numbers of each surface lowered the loss, one bar per camera".into(),
        axis: "decrease of the loss, first order".into(),
        keys: moved.iter().enumerate().map(key).collect(),
        bars: distinct(moved, |a| &a.surface).into_iter().map(bar).collect(),
    }
}

fn by_number(moved: &[&CameraView]) -> Markup {
    let columns = ["surface", "number"].map(|name| Column::new(name).text());
    let cameras = moved.iter().map(|camera| Column::new(&camera.name));
    let mut rows: Vec<(&Attribution, Vec<f64>)> = Vec::new();
    for (place, camera) in moved.iter().enumerate() {
        for a in &camera.attribution {
            let is_it = |(of, _): &&mut (&Attribution, Vec<f64>)| {
                (&of.surface, &of.number) == (&a.surface, &a.number)
            };
            match rows.iter_mut().find(is_it) {
                Some((_, values)) => values[place] = a.lowered,
                None => {
                    let mut values = vec![f64::NAN; moved.len()];
                    values[place] = a.lowered;
                    rows.push((a, values));
                }
            }
        }
    }
    let rows = rows.into_iter().map(|(a, values)| {
        let values = values.into_iter().map(|v| html! { (number::signed(v, DECIMALS)) });
        Row::new(&a.surface, [html! { (a.number) }].into_iter().chain(values))
    });
    Table::new(columns.into_iter().chain(cameras)).rows(rows).html()
}

/// The different texts of all cameras, in the order in which they come.
fn distinct<'a>(moved: &[&'a CameraView], text: fn(&Attribution) -> &String) -> Vec<&'a str> {
    let mut found: Vec<&str> = Vec::new();
    for name in moved.iter().flat_map(|camera| &camera.attribution).map(text) {
        if !found.contains(&name.as_str()) {
            found.push(name);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn surfaces_have_the_sums_of_their_numbers_and_cameras_their_columns() {
        let mut report = sample::report();
        assert!(!has_attribution(&report));
        let of = |surface: &str, number: &str, lowered: f64| Attribution {
            surface: surface.into(),
            number: number.into(),
            lowered,
        };
        report.cameras[1].attribution = vec![of("V1", "radius", 0.02), of("V1", "conic constant", -0.005)];
        report.cameras[2].attribution = vec![of("V1", "radius", 0.01), of("image <plane>", "defocus", 0.03)];
        assert!(has_attribution(&report));
        let moved: Vec<&CameraView> = report.cameras[1..].iter().collect();
        let chart = by_surface(&report, &moved);
        let values: Vec<&[f64]> = chart.bars.iter().map(|bar| &bar.values[..]).collect();
        assert!((values[0][0] - 0.015).abs() < 1e-15 && values[0][1] == 0.01, "{values:?}");
        assert_eq!(values[1], [0.0, 0.03]);
        let page = attribution(&report).into_string();
        assert!(page.contains("image &lt;plane&gt;") && page.contains("+0.0200") && !page.contains("NaN"));
        assert_eq!(by_number(&moved).into_string().matches("<tr").count(), 4);
    }
}
