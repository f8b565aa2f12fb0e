//! The lens as made: every freedom a little off, and the derivatives of a merit by each.

use std::sync::Arc;

use super::freedom::{ARCMIN_PER_RAD, FRINGE_UM};
use super::motion::{RigidMotion, moved_rigidly};
use super::{Freedom, Quantity};
use crate::glass::{Dispersion, Glass, LINE_C_UM, LINE_D_UM, LINE_F_UM};
use crate::gradient::LensGradient;
use crate::lens::{Action, Lens};
use crate::number::Number;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};

/// A freedom and how far it is off, in its unit.
pub(super) type Off = (Freedom, f64);

/// The lens as drawn, ready to be made: what may be moved has a placement.
pub(super) fn drawn(lens: &Lens, freedoms: impl Iterator<Item = Freedom>) -> Lens {
    let mut drawn = lens.clone();
    for freedom in freedoms.filter(|f| f.quantity.is_motion()) {
        for surface in &mut drawn.surfaces[freedom.first..=freedom.last] {
            surface.placement.get_or_insert_default();
        }
    }
    drawn
}

/// The lens with every freedom off by its value. The numbers of the surfaces change first, then surfaces that move alone, then groups,
/// smaller ones first. So a tilted element can sit in a tilted barrel.
///
/// The stop keeps the radius `stop_radius_mm`.
pub(super) fn made(drawn: &Lens, off: &[Off], stop_radius_mm: f64) -> Lens {
    let mut lens = displaced(drawn, off);
    let stop = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
    let pupil_mm = lens.entrance_pupil_mm * stop_radius_mm / stop;
    if pupil_mm.is_finite() && pupil_mm > 0.0 {
        lens.entrance_pupil_mm = pupil_mm;
    }
    lens
}

fn displaced(drawn: &Lens, off: &[Off]) -> Lens {
    let mut lens = drawn.clone();
    // Glass: index and Abbe number of each surface.
    let mut glass = vec![[0.0; 2]; lens.surfaces.len()];
    let mut groups: Vec<(usize, usize)> = Vec::new();
    for (freedom, value) in off.iter().filter(|(_, value)| *value != 0.0) {
        match freedom.quantity {
            Quantity::Index => glass[freedom.first][0] += value,
            Quantity::Abbe => glass[freedom.first][1] += value,
            quantity if quantity.is_motion() => groups.push((freedom.first, freedom.last)),
            quantity => change_number(&mut lens, freedom.first, quantity, *value),
        }
    }
    for (surface, [index, abbe_percent]) in glass.into_iter().enumerate() {
        if index != 0.0 || abbe_percent != 0.0 {
            change_glass(&mut lens, surface, index, abbe_percent);
        }
    }
    groups.sort_by_key(|(first, last)| (last - first, *first));
    groups.dedup();
    for (first, last) in groups {
        let motion = motion_of(off, first, last);
        lens = moved_rigidly(&lens, first, last, &motion);
    }
    lens
}

/// All motions of a group, as one.
fn motion_of(off: &[Off], first: usize, last: usize) -> RigidMotion {
    let mut motion = RigidMotion::default();
    for (freedom, value) in off.iter().filter(|(f, _)| (f.first, f.last) == (first, last)) {
        match freedom.quantity {
            Quantity::DecenterX => motion.shift_mm[0] += value,
            Quantity::DecenterY => motion.shift_mm[1] += value,
            Quantity::Shift => motion.shift_mm[2] += value,
            Quantity::TiltX => motion.tilt_rad[0] += value / ARCMIN_PER_RAD,
            Quantity::TiltY => motion.tilt_rad[1] += value / ARCMIN_PER_RAD,
            _ => {}
        }
    }
    motion
}

/// Changes a number of a surface.
fn change_number(lens: &mut Lens, surface: usize, quantity: Quantity, value: f64) {
    let s = &mut lens.surfaces[surface];
    let clear = s.semi_diameter_mm;
    let fringe_mm = 1e-3 * FRINGE_UM;
    match quantity {
        Quantity::Radius => s.shape.curvature /= 1.0 + value * s.shape.curvature,
        Quantity::RadiusPercent => s.shape.curvature /= 1.0 + 0.01 * value,
        Quantity::Power => s.shape.curvature += value * fringe_mm / (clear * clear),
        Quantity::Conic => s.shape.conic += value,
        Quantity::Irregularity => {
            let amplitude = 2.0 * value * fringe_mm;
            s.shape.asphere[0] -= amplitude / clear.powi(2);
            s.shape.asphere[1] += amplitude / clear.powi(4);
        }
        Quantity::Form(n) => s.shape.asphere[n / 2 - 1] += 1e-3 * value / clear.powi(n as i32),
        Quantity::Thickness => s.thickness_mm += value,
        _ => {}
    }
}

/// Exchanges the glass behind a surface, and behind mirrors that follow it in that glass, for another melt: a table at the
/// wavelengths of the lens and at the lines d, F and C.
fn change_glass(lens: &mut Lens, surface: usize, index: f64, abbe_percent: f64) {
    let glass = lens.surfaces[surface].glass.clone();
    let mut at =
        [lens.wavelengths_um.as_slice(), &[lens.reference_um, LINE_D_UM, LINE_F_UM, LINE_C_UM]].concat();
    at.sort_by(f64::total_cmp);
    at.dedup();
    let nd = glass.nd();
    // At the same n_d, the spread of the indices goes as 1 / V.
    let spread = 1.0 / (1.0 + 0.01 * abbe_percent) - 1.0;
    let melt = at.iter().map(|w| {
        let n = glass.index(*w);
        n + index + if spread == 0.0 { 0.0 } else { (n - nd) * spread }
    });
    let name = format!("{}, n {index:+.6}, V {abbe_percent:+.4} %", glass.name);
    let melt = Arc::new(Glass::new(name, Dispersion::Table { index: melt.collect(), wavelength_um: at }));
    lens.surfaces[surface].glass = melt.clone();
    let behind = lens.surfaces[surface + 1..].iter_mut();
    for mirror in behind.take_while(|s| s.action == Action::Reflect && s.glass == glass) {
        mirror.glass = melt.clone();
    }
}

/// The gradient at a fixed diameter of the stop, from that at a fixed entrance pupil D: by a number x of the lens,
/// `dD/dx = -(D / R) dR/dx`, with R the stop radius that goes with D.
pub(super) fn at_fixed_stop(lens: &Lens, mut gradient: LensGradient) -> LensGradient {
    let sequence = lens.at_wavelength(lens.reference_um);
    let radius = first_order(&sequence).stop_radius_mm;
    let radius_bar = -gradient.entrance_pupil * lens.entrance_pupil_mm / radius;
    if radius_bar.is_finite() {
        let bars = FirstOrderCotangent { stop_radius: radius_bar, ..Default::default() };
        pull_back_first_order(&sequence, bars, &mut gradient);
        gradient.entrance_pupil = 0.0;
    }
    gradient
}

/// The freedoms that are off, with their places in the list.
pub(super) fn active(off: &[Off]) -> Vec<(usize, Off)> {
    off.iter().copied().enumerate().filter(|(_, (_, value))| *value != 0.0).collect()
}

/// The derivative of a merit by freedom `k` of a list, per unit of it, from the gradient at the made lens and a fixed stop. `active` are those of the
/// list that are off. `None` for what has no place in the gradient: the Abbe number, and the distance of a near object.
///
/// How the numbers of the lens follow the freedom is a closed formula (angles of products of rotations, at worst), whose central
/// differences are good to some 1e-9. A lens of 200 surfaces has 1,500 freedoms, so only the surfaces that follow this one are made.
pub(super) fn derivative(
    drawn: &Lens,
    active: &[(usize, Off)],
    k: usize,
    (freedom, value): Off,
    gradient: &LensGradient,
) -> Option<f64> {
    let quantity = freedom.quantity;
    let others = || active.iter().filter(|(i, _)| *i != k);
    let is_moving = |(_, (f, _)): &&(usize, Off)| f.quantity.is_motion();
    match quantity {
        Quantity::Abbe => return None,
        Quantity::Index => return Some(gradient[(freedom.first, Number::Index)]),
        Quantity::Thickness if !others().any(|other| is_moving(&other)) => {
            return Some(gradient[(freedom.first, Number::Thickness)]);
        }
        _ => {}
    }
    // Groups that move carry along all their surfaces; the distance to what is moved belongs to the surface in front.
    let (mut first, mut last) = (freedom.first, freedom.last);
    let reaches_out = |f: &Freedom, first: usize, last: usize| {
        f.first <= last && f.last >= first && (f.first < first || f.last > last)
    };
    while let Some((_, (group, _))) =
        others().filter(is_moving).find(|(_, (f, _))| reaches_out(f, first, last))
    {
        (first, last) = (first.min(group.first), last.max(group.last));
    }
    let start = first.saturating_sub(1);
    let part = Lens {
        name: String::new(),
        source: String::new(),
        surfaces: drawn.surfaces[start..=last].to_vec(),
        stop: 0,
        entrance_pupil_mm: drawn.entrance_pupil_mm,
        object: drawn.object,
        wavelengths_um: Vec::new(),
        reference_um: drawn.reference_um,
        fields_deg: Vec::new(),
    };
    // Glasses have no part in it.
    let is_glass = |f: &Freedom| matches!(f.quantity, Quantity::Index | Quantity::Abbe);
    let within = others().filter(|(_, (f, _))| !is_glass(f) && f.first >= start && f.last <= last);
    let shifted = |(f, value): Off| (Freedom { first: f.first - start, last: f.last - start, ..f }, value);
    let (before, after): (Vec<_>, Vec<_>) = within.partition(|(i, _)| *i < k);
    let at = |value: f64| {
        let own = (k, (freedom, value));
        let all = before.iter().copied().chain([&own]).chain(after.iter().copied());
        displaced(&part, &all.map(|(_, off)| shifted(*off)).collect::<Vec<_>>())
    };
    let step = quantity.step();
    let (above, below) = (at(value + step), at(value - step));
    if above.object != below.object {
        return None;
    }
    let mut sum = 0.0;
    for (i, surface) in above.surfaces.iter().enumerate() {
        // Manufacturing errors leave departures, diffractive structures and thin lenses as they are.
        let stays = |n: &Number| matches!(n, Number::Departure(_) | Number::Phase(_) | Number::Power);
        for number in Number::ALL.into_iter().filter(|n| !stays(n) && surface.has_number(*n)) {
            sum += (number.read(&above, i) - number.read(&below, i)) * gradient[(start + i, number)];
        }
    }
    Some(sum / (2.0 * step))
}
