//! Encircled energy over the radius.

use petzval_optics::analysis::Analysis;

use super::mtf::{modulation_frame, sheet};
use super::style::{COMMON, field_keys, field_pen};
use crate::palette::INK;
use crate::plot::{Axis, Curve, Key, Names, Pen, Sheet, round_up};

/// Energy by diffraction solid and by rays dashed, or by rays alone.
pub(super) fn encircled_energy(analysis: &Analysis) -> Sheet {
    let data = &analysis.encircled_energy;
    let has_waves: Vec<bool> = data.iter().map(|e| e.diffraction.is_some()).collect();
    let mut curves: Vec<Curve> = Vec::new();
    for (i, energy) in data.iter().enumerate() {
        let over = |pen: Pen, y: &[f64]| Curve::over(pen, i, &energy.radius_um, y.iter().copied().map(Some));
        let by_rays = if has_waves[i] { field_pen(i).unmarked() } else { field_pen(i) };
        curves.push(over(by_rays.dashed(), &energy.geometric));
        curves.extend(energy.diffraction.iter().map(|y| over(field_pen(i), y)));
    }
    let mut keys = field_keys(analysis);
    let line = Pen { width: 1.7, ..Pen::thin(INK) };
    keys.push(Key::pen(line.clone(), "by waves"));
    keys.push(Key::pen(line.dashed(), "by rays"));
    // Reach far enough for the widest spot, but not so far that the narrowest is a vertical line.
    let reach = || curves.iter().map(settled).filter(|r| *r > 0.0);
    let farthest = reach().fold(0.0, f64::max).min(COMMON * reach().fold(f64::INFINITY, f64::min));
    let frame = modulation_frame(Axis::between(0.0, round_up(1.2 * farthest), 8));
    let names = Names { head: "", x: "radius about the centroid, µm", y: "share of the light" };
    let remark = if has_waves.contains(&false) {
        "Light within circles about the centroid, mean of the wavelengths; waves where all rays of the stop arrive."
    } else {
        "Light within circles about the centroid, mean of the wavelengths."
    };
    sheet(analysis, "encircled-energy", "Encircled energy", remark, keys, frame.draw(names, &curves))
}

/// The radius beyond which a curve hardly rises.
fn settled(curve: &Curve) -> f64 {
    let last = curve.points.iter().flatten().last().map_or(0.0, |p| p[1]);
    curve.points.iter().flatten().find(|p| p[1] >= 0.985 * last).map_or(0.0, |p| p[0])
}
