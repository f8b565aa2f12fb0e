//! Modulation transfer functions: one chart a field, with the curves of every camera.

use maud::{Markup, html};
use petzval_optics::analysis::{FieldMtf, MtfCurve};

use super::view::Report;
use crate::number;
use crate::page::{caption, figure};
use crate::palette::{self, INK, LIMIT};
use crate::plot::{Chart, Mark, Series, chart_svg};

/// Fields this near to each other are one, degrees.
const SAME_FIELD_DEG: f64 = 1e-6;

/// Whether some lens has a modulation.
pub(super) fn has_mtf(report: &Report) -> bool {
    report.cameras.iter().any(|camera| !camera.mtf.is_empty())
}

/// The charts of the fields, and how they were computed.
pub(super) fn mtf(report: &Report) -> Markup {
    html! {
        div.charts {
            @for field_deg in &report.layout_fields_deg { (figure(&chart_svg(&chart(report, *field_deg)))) }
        }
        (caption(
            "Modulation of the lenses above at the sensor, mean of the three wavelengths, traced exactly. By waves where every camera of a \
             chart has a smooth wavefront from the whole stop, otherwise by rays. The Nyquist frequency of the pixels is half a cycle \
             a pixel; finer detail folds back.",
        ))
    }
}

/// The curves of all cameras at a field, by one method, so that they can be compared.
fn chart(report: &Report, field_deg: f64) -> Chart {
    let at = |m: &&FieldMtf| (m.field_deg - field_deg).abs() < SAME_FIELD_DEG;
    let of_camera: Vec<(usize, &FieldMtf)> =
        report.cameras.iter().enumerate().filter_map(|(i, c)| Some((i, c.mtf.iter().find(at)?))).collect();
    let by_waves = of_camera.iter().all(|(_, m)| m.diffraction.is_some());
    let curve = |m: &'_ FieldMtf| -> MtfCurve {
        m.diffraction.as_ref().filter(|_| by_waves).unwrap_or(&m.geometric).clone()
    };
    let mut series = Vec::new();
    for (i, m) in &of_camera {
        let MtfCurve { sagittal, tangential } = curve(m);
        for (values, is_dashed) in [(tangential, false), (sagittal, true)] {
            series.push(Series {
                name: if is_dashed { String::new() } else { report.cameras[*i].name.clone() },
                colour: palette::camera(*i).into(),
                is_dashed,
                points: m.frequency_per_mm.iter().copied().zip(values).collect(),
            });
        }
    }
    let section = |name: &str, is_dashed: bool| Series {
        name: name.into(),
        colour: INK.into(),
        is_dashed,
        points: Vec::new(),
    };
    series.extend([section("tangential", false), section("sagittal", true)]);
    let field = number::fixed(field_deg, 1);
    Chart {
        alt: format!("Modulation over spatial frequency at {field} degrees, two curves per camera"),
        x_axis: "spatial frequency, cycles/mm".into(),
        y_axis: format!("modulation at {field}°{}", if by_waves { "" } else { ", by rays" }),
        series,
        marks: vec![Mark {
            name: format!("Nyquist frequency, {} cycles/mm", number::fixed(report.nyquist_per_mm, 1)),
            colour: LIMIT.into(),
            at: report.nyquist_per_mm,
        }],
        ..Chart::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    #[test]
    fn every_camera_has_its_two_curves_at_every_field_by_one_method() {
        let mut report = sample::report();
        let chart = chart(&report, 7.5);
        // Two curves a camera, and the entries of the key for both sections.
        assert_eq!(chart.series.len(), 2 * report.cameras.len() + 2);
        let known = &report.cameras[1].mtf[1];
        assert_eq!(known.field_deg, 7.5);
        let waves = known.diffraction.as_ref().unwrap();
        assert!(chart.series[2].points.iter().map(|p| p.1).eq(waves.tangential.iter().copied()));
        assert!(chart.series[3].points.iter().map(|p| p.1).eq(waves.sagittal.iter().copied()));
        assert!(chart.series[3].is_dashed && chart.marks[0].at == report.nyquist_per_mm);

        // Waves of one camera are not drawn beside rays of another.
        report.cameras[2].mtf[1].diffraction = None;
        let rays = super::chart(&report, 7.5);
        let geometric = &report.cameras[1].mtf[1].geometric;
        assert!(rays.series[2].points.iter().map(|p| p.1).eq(geometric.tangential.iter().copied()));
        assert!(rays.y_axis.ends_with("7.5°, by rays"));
    }
}
