//! Modulation over frequency.

use petzval_optics::analysis::{Analysis, FieldMtf, MtfCurve};

use super::style::{WIDTH_PX, field_keys, field_pen, foot, section_curves, section_keys};
use crate::plot::{Axis, Curve, Frame, Key, Names, Pen, Sheet};

/// The field between the axes, px.
const SIZE_PX: [f64; 2] = [816.0, 420.0];

/// By waves, with the limit; by rays where there are no waves.
pub(super) fn mtf(analysis: &Analysis) -> Sheet {
    let diffraction: Option<Vec<&MtfCurve>> = analysis.mtf.iter().map(|m| m.diffraction.as_ref()).collect();
    match diffraction {
        Some(curves) => {
            let remark = "By waves, mean of the wavelengths: tangential lines solid, sagittal lines dashed.";
            let nearest = analysis.mtf.iter().min_by(|a, b| a.field_deg.abs().total_cmp(&b.field_deg.abs()));
            let limit = nearest.and_then(|m| Some((m, m.limit.as_ref()?)));
            draw(analysis, "mtf", "MTF", remark, &curves, limit)
        }
        None => {
            let remark =
                "By rays: at some field rays of the stop are lost or the wavefront is too rough for waves.";
            draw(analysis, "mtf", "MTF", remark, &by_rays(analysis), None)
        }
    }
}

/// By rays.
pub(super) fn geometric_mtf(analysis: &Analysis) -> Sheet {
    let remark = "By rays, mean of the wavelengths: tangential lines solid, sagittal lines dashed.";
    draw(analysis, "mtf-geometric", "Geometric MTF", remark, &by_rays(analysis), None)
}

fn by_rays(analysis: &Analysis) -> Vec<&MtfCurve> {
    analysis.mtf.iter().map(|m| &m.geometric).collect()
}

fn draw(
    analysis: &Analysis,
    class: &'static str,
    title: &str,
    remark: &str,
    fields: &[&MtfCurve],
    limit: Option<(&FieldMtf, &MtfCurve)>,
) -> Sheet {
    let mut curves: Vec<Curve> = Vec::new();
    let mut keys = field_keys(analysis);
    keys.extend(section_keys());
    if let Some((at, limit)) = limit {
        let pen = Pen { width: 2.2, ..Pen::thin("#b3b9c1") };
        let over = |y: &[f64]| Curve::over(pen.clone(), 0, &at.frequency_per_mm, y.iter().copied().map(Some));
        curves.push(over(&limit.tangential));
        keys.push(Key::pen(pen, "diffraction limit"));
    }
    for (i, (curve, at)) in fields.iter().zip(&analysis.mtf).enumerate() {
        curves.extend(section_curves(&field_pen(i), i, &at.frequency_per_mm, curve));
    }
    let highest = analysis.mtf.iter().flat_map(|m| &m.frequency_per_mm).copied().fold(0.0, f64::max);
    let frame = modulation_frame(Axis::between(0.0, highest, 8));
    let names = Names { head: "", x: "spatial frequency, cycles/mm", y: "modulation" };
    sheet(analysis, class, title, remark, keys, frame.draw(names, &curves))
}

/// Modulation from 0 to 1 over any axis.
pub(super) fn modulation_frame(x: Axis) -> Frame {
    let y = Axis::between(0.0, 1.0, 5);
    Frame { left: 70.0, top: 14.0, width: SIZE_PX[0], height: SIZE_PX[1], x, y }
}

/// A sheet with such a frame.
pub(super) fn sheet(
    analysis: &Analysis,
    class: &'static str,
    title: &str,
    remark: &str,
    keys: Vec<Key>,
    body: maud::Markup,
) -> Sheet {
    Sheet {
        class,
        title: title.into(),
        remark: remark.into(),
        keys,
        alt: format!("{title} of {}", analysis.name),
        width: WIDTH_PX,
        height: SIZE_PX[1] + 62.0,
        body,
        foot: foot(analysis),
    }
}
