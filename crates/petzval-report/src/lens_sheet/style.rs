//! The common style: pens and names of fields, wavelengths and sections, and the foot of every picture.

use petzval_optics::analysis::{Analysis, MtfCurve};

pub(super) use crate::number::short;
use crate::palette::{self, INK};
use crate::plot::{Axis, Curve, Key, Marker, Pen, Sheet, WIDTH_PX, span};

/// The pen of the i-th field.
pub(super) fn field_pen(i: usize) -> Pen {
    Pen::marked(palette::field(i), Marker::nth(i))
}

/// Number of wavelengths shorter than the i-th.
fn rank(analysis: &Analysis, i: usize) -> usize {
    let um = &analysis.wavelengths_um;
    (0..um.len()).filter(|j| (um[*j], *j) < (um[i], i)).count()
}

/// The pen of the i-th wavelength.
pub(super) fn wavelength_pen(analysis: &Analysis, i: usize) -> Pen {
    let rank = rank(analysis, i);
    Pen::marked(palette::wavelength(rank, analysis.wavelengths_um.len()), Marker::nth(rank + 1))
}

/// Text of an angle.
pub(super) fn field_name(field_deg: f64) -> String {
    format!("{}°", short(field_deg, 2))
}

/// Text of a wavelength.
pub(super) fn wavelength_name(um: f64) -> String {
    format!("{} µm", short(um, 4))
}

/// One entry for each field.
pub(super) fn field_keys(analysis: &Analysis) -> Vec<Key> {
    let entry = |(i, field): (usize, &f64)| Key::pen(field_pen(i), field_name(*field));
    analysis.fields_deg.iter().enumerate().map(entry).collect()
}

/// One entry for each field. If some fields have waves, those without are marked as geometric.
pub(super) fn field_keys_with_method(analysis: &Analysis, has_waves: &[bool]) -> Vec<Key> {
    let mut keys = field_keys(analysis);
    if has_waves.contains(&true) {
        for (key, _) in keys.iter_mut().zip(has_waves).filter(|(_, has)| !**has) {
            key.name += " (by rays)";
        }
    }
    keys
}

/// Method of the curves, from the fields that have waves.
pub(super) fn method(has_waves: &[bool]) -> &'static str {
    match (has_waves.contains(&true), has_waves.contains(&false)) {
        (true, false) => "By waves",
        (true, true) => "By waves where all rays through the stop arrive and the wavefront is smooth enough",
        (false, _) => "By rays: rays through the stop are lost or wavefronts are too rough for waves",
    }
}

/// Largest ratio of the fields' ranges on a common scale; beyond it each field has its own scale.
pub(super) const COMMON: f64 = 12.0;

/// The range of every field's scale: one for all, or one for each if a common scale would make some fields invisible.
pub(super) fn scales(reach: &[f64]) -> Vec<f64> {
    let largest = reach.iter().copied().filter(|r| r.is_finite()).fold(0.0, f64::max);
    let least = reach.iter().copied().fold(f64::INFINITY, f64::min);
    // Limit the magnification of a field without aberration.
    let own = |r: &f64| r.max(1e-3 * largest);
    if largest > COMMON * least.max(1e-3 * largest) {
        reach.iter().map(own).collect()
    } else {
        vec![largest; reach.len()]
    }
}

/// Whether scales differ.
pub(super) fn are_own(scales: &[f64]) -> bool {
    scales.windows(2).any(|pair| pair[0] != pair[1])
}

/// One entry for each wavelength.
pub(super) fn wavelength_keys(analysis: &Analysis) -> Vec<Key> {
    let entry = |(i, um): (usize, &f64)| Key::pen(wavelength_pen(analysis, i), wavelength_name(*um));
    analysis.wavelengths_um.iter().enumerate().map(entry).collect()
}

/// The meaning of solid and dashed lines.
pub(super) fn section_keys() -> [Key; 2] {
    let line = Pen { width: 1.7, ..Pen::thin(INK) };
    [Key::pen(line.clone(), "tangential"), Key::pen(line.dashed(), "sagittal")]
}

/// The lens and its wavelengths.
pub(super) fn foot(analysis: &Analysis) -> Vec<Key> {
    let wavelengths: Vec<String> = analysis.wavelengths_um.iter().map(|um| short(*um, 4)).collect();
    let colours = match wavelengths.len() {
        1 => format!("wavelength {} µm", wavelengths[0]),
        _ => format!("wavelengths {} µm", wavelengths.join(", ")),
    };
    vec![Key::name(&analysis.name), Key::remark(colours)]
}

/// Both sections of a curve of modulation.
pub(super) fn section_curves(pen: &Pen, index: usize, x: &[f64], curve: &MtfCurve) -> [Curve; 2] {
    let over = |pen: Pen, y: &[f64]| Curve::over(pen, index, x, y.iter().copied().map(Some));
    [over(pen.clone(), &curve.tangential), over(pen.clone().dashed(), &curve.sagittal)]
}

/// Smaller values, mm, um or %, are rounding.
const NOTHING: f64 = 1e-6;

/// An axis for curves on both sides of zero.
pub(super) fn axis_with_zero(curves: &[Curve]) -> Axis {
    let (low, high) = span(curves.iter().flat_map(|c| c.values(0)).chain([0.0])).unwrap_or((0.0, 0.0));
    if high - low < NOTHING { Axis::about_zero(1.0) } else { Axis::around(low, high, 5) }
}

/// Whether a lens has only one field, so that curves over the field have no length.
pub(super) fn has_one_field(field_deg: &[f64]) -> bool {
    field_deg.windows(2).all(|pair| pair[0] == pair[1])
}

/// A sheet about a lens without a picture yet, as wide as the page.
pub(super) fn blank(analysis: &Analysis, class: &'static str, title: &str) -> Sheet {
    Sheet { class, title: title.into(), width: WIDTH_PX, foot: foot(analysis), ..Sheet::default() }
}

/// The field to which figures of the axis belong, in a sentence.
pub(super) fn axis_name(analysis: &Analysis) -> String {
    let field_deg = analysis.first_order.image_na_field_deg;
    field_deg.map_or_else(|| "on the axis".to_owned(), |deg| format!("at {}", field_name(deg)))
}

/// Replaces curves over the field if there is only one field, or if a field between those of the lens has no light.
pub(super) fn without_curves(analysis: &Analysis, class: &'static str, title: &str) -> Sheet {
    Sheet {
        remark: match &analysis.no_curves {
            Some(reason) => format!("There are no curves over the field: {reason}."),
            None => "The lens has only one field: there are no curves over the field.".into(),
        },
        alt: match &analysis.no_curves {
            Some(reason) => format!("{title} of {}: {reason}", analysis.name),
            None => format!("{title} of {}: there is only one field", analysis.name),
        },
        height: 20.0,
        ..blank(analysis, class, title)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_share_a_scale_unless_one_would_be_invisible() {
        assert_eq!(scales(&[5.0, 50.0, 20.0]), [50.0; 3]);
        assert_eq!(scales(&[5.0, 500.0, 20.0]), [5.0, 500.0, 20.0]);
        assert_eq!(scales(&[0.0, 500.0]), [0.5, 500.0]);
        assert_eq!(scales(&[0.0, 0.0]), [0.0, 0.0]);
        assert!(!are_own(&scales(&[3.0])));
    }

    #[test]
    fn numbers_are_as_short_as_they_can_be() {
        assert_eq!(field_name(5.0), "5°");
        assert_eq!(field_name(-7.25), "\u{2212}7.25°");
        assert_eq!(wavelength_name(0.486), "0.486 µm");
        assert_eq!(short(100.0, 0), "100");
    }
}
