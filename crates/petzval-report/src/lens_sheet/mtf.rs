//! Modulation over frequency.

use petzval_optics::analysis::{Analysis, MtfCurve};

use super::style::{
    blank, field_keys, field_keys_with_method, field_pen, method, section_curves, section_keys, short,
};
use crate::palette::{LIMIT, MUTED};
use crate::plot::{Axis, Curve, Frame, Key, Names, Pen, Sheet};

/// The field between the axes, px.
const SIZE_PX: [f64; 2] = [816.0, 420.0];

/// Diffraction MTF with the diffraction limit; geometric MTF for fields without waves.
pub(super) fn mtf(analysis: &Analysis) -> Sheet {
    let has_waves: Vec<bool> = analysis.mtf.iter().map(|m| m.diffraction.is_some()).collect();
    let fields: Vec<&MtfCurve> =
        analysis.mtf.iter().map(|m| m.diffraction.as_ref().unwrap_or(&m.geometric)).collect();
    let mut keys = field_keys_with_method(analysis, &has_waves);
    keys.extend(section_keys());
    // Draw only the limit of the field nearest to the axis: it hardly changes over the field.
    let limits = analysis.mtf.iter().filter_map(|m| Some((m, m.limit.as_ref()?)));
    let limit =
        limits.min_by(|a, b| a.0.field_deg.abs().total_cmp(&b.0.field_deg.abs())).map(|(at, limit)| {
            let pen = Pen { width: 2.2, ..Pen::thin(LIMIT) };
            keys.push(Key::pen(pen.clone(), "diffraction limit"));
            Curve::over(pen, 0, &at.frequency_per_mm, limit.tangential.iter().copied().map(Some))
        });
    let remark = format!("{}; mean of the wavelengths.", method(&has_waves));
    draw(analysis, "mtf", "MTF", &remark, keys, limit, &fields)
}

/// Geometric MTF.
pub(super) fn geometric_mtf(analysis: &Analysis) -> Sheet {
    let fields: Vec<&MtfCurve> = analysis.mtf.iter().map(|m| &m.geometric).collect();
    let mut keys = field_keys(analysis);
    keys.extend(section_keys());
    draw(analysis, "mtf-geometric", "Geometric MTF", "By rays, mean of the wavelengths.", keys, None, &fields)
}

fn draw(
    analysis: &Analysis,
    class: &'static str,
    title: &str,
    remark: &str,
    keys: Vec<Key>,
    limit: Option<Curve>,
    fields: &[&MtfCurve],
) -> Sheet {
    let mut curves: Vec<Curve> = limit.into_iter().collect();
    for (i, (curve, at)) in fields.iter().zip(&analysis.mtf).enumerate() {
        curves.extend(section_curves(&field_pen(i), i, &at.frequency_per_mm, curve));
    }
    let mut keys = keys;
    if let Some(nyquist) = analysis.nyquist_per_mm {
        let pen = Pen::thin(MUTED).dashed();
        keys.push(Key::pen(
            pen.clone(),
            format!("Nyquist frequency of the pixels, {} cycles/mm", short(nyquist, 1)),
        ));
        curves.push(Curve { pen, index: 0, points: [0.0, 1.0].map(|y| Some([nyquist, y])).into() });
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

/// A sheet with a frame of modulation.
pub(super) fn sheet(
    analysis: &Analysis,
    class: &'static str,
    title: &str,
    remark: &str,
    keys: Vec<Key>,
    body: maud::Markup,
) -> Sheet {
    Sheet {
        remark: remark.into(),
        keys,
        alt: format!("{title} of {}", analysis.name),
        height: SIZE_PX[1] + 62.0,
        body,
        ..blank(analysis, class, title)
    }
}
