//! Encircled energy over the radius.

use petzval_optics::analysis::Analysis;

use super::mtf::{modulation_frame, sheet};
use super::style::{field_keys, field_pen};
use crate::plot::{Axis, Curve, INK, Key, Names, Pen, Sheet};

/// Energy by waves solid and by rays dashed, or by rays alone.
pub(super) fn encircled_energy(analysis: &Analysis) -> Sheet {
    let data = &analysis.encircled_energy;
    let has_waves = data.iter().all(|e| e.diffraction.is_some());
    let mut curves: Vec<Curve> = Vec::new();
    for (i, energy) in data.iter().enumerate() {
        let over = |pen: Pen, y: &[f64]| Curve::over(pen, i, &energy.radius_um, y.iter().copied().map(Some));
        let by_rays = if has_waves { field_pen(i).dashed().unmarked() } else { field_pen(i) };
        curves.push(over(by_rays, &energy.geometric));
        curves.extend(energy.diffraction.iter().filter(|_| has_waves).map(|y| over(field_pen(i), y)));
    }
    let mut keys = field_keys(analysis);
    if has_waves {
        let line = Pen { width: 1.7, ..Pen::thin(INK) };
        keys.push(Key::pen(line.clone(), "by waves"));
        keys.push(Key::pen(line.dashed(), "by rays"));
    }
    let farthest = data.iter().flat_map(|e| &e.radius_um).copied().fold(0.0, f64::max);
    let frame = modulation_frame(Axis::between(0.0, farthest, 8));
    let names = Names { head: "", x: "radius about the centroid, µm", y: "share of the light" };
    let remark = match has_waves {
        true => "Light within circles about the centroid, mean of the wavelengths.",
        false => "By rays: at some field rays of the stop are lost or the wavefront is too rough for waves.",
    };
    sheet(analysis, "encircled-energy", "Encircled energy", remark, keys, frame.draw(names, &curves))
}
