//! The track: the greatest distance between any two of the vertices and the image plane.

use super::place::STRAIGHT;
use super::{Axis, Lens, Placement, places};
use crate::gradient::LensGradient;
use crate::number::Number;
use crate::vector::{Matrix3, Vec3, apply, dot, half_turned, product, transposed};

/// The two ends of the track: indices of surfaces, with that of the image plane behind the last.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Track {
    from: usize,
    to: usize,
    length_mm: f64,
}

impl Lens {
    /// The track, mm: the greatest distance between any two of the vertices and the image plane.
    ///
    /// On a straight axis it is measured along the axis, in a [folded](Lens::is_folded) lens in space. Not finite if the image distance is not.
    pub fn track_mm(&self) -> f64 {
        track(self).length_mm
    }
}

/// The track of a lens.
fn track(lens: &Lens) -> Track {
    let whole_mm = lens.total_track_mm();
    if !whole_mm.is_finite() {
        return Track { from: 0, to: lens.surfaces.len(), length_mm: whole_mm };
    }
    if lens.is_folded() { in_space(lens) } else { along_axis(lens) }
}

/// The track of a lens with a straight axis.
fn along_axis(lens: &Lens) -> Track {
    let mut at = vec![0.0];
    for s in &lens.surfaces {
        at.push(at[at.len() - 1] + s.thickness_mm);
    }
    let furthest =
        |sign: f64| (0..at.len()).max_by(|a, b| (sign * at[*a]).total_cmp(&(sign * at[*b]))).unwrap_or(0);
    let (low, high) = (furthest(-1.0), furthest(1.0));
    Track { from: low.min(high), to: low.max(high), length_mm: at[high] - at[low] }
}

/// The track of a lens whose axis bends.
fn in_space(lens: &Lens) -> Track {
    let at: Vec<Vec3> = places(lens).iter().map(|place| place.origin).collect();
    let pairs = (0..at.len()).flat_map(|to| (0..to).map(move |from| (from, to)));
    let ends = pairs.map(|(from, to)| Track { from, to, length_mm: length(between(at[from], at[to])) });
    let none = Track { from: 0, to: 0, length_mm: 0.0 };
    ends.max_by(|a, b| a.length_mm.total_cmp(&b.length_mm)).unwrap_or(none)
}

fn between(a: Vec3, b: Vec3) -> Vec3 {
    [0, 1, 2].map(|k| b[k] - a[k])
}

fn length(v: Vec3) -> f64 {
    dot(v, v).sqrt()
}

/// Adds the gradient of a loss that depends on the [track](Lens::track_mm), `bar` per mm. It has a kink where two pairs of ends are equally far apart.
pub(crate) fn pull_back_track(lens: &Lens, bar: f64, gradient: &mut LensGradient) {
    let Track { from, to, length_mm } = track(lens);
    if !lens.is_folded() {
        let along_z = lens.surfaces[from..to].iter().map(|s| s.thickness_mm).sum::<f64>();
        (from..to).for_each(|i| gradient[(i, Number::Thickness)] += bar * along_z.signum());
        return;
    }
    if length_mm == 0.0 {
        return;
    }
    let places = places(lens);
    let end = places[to].origin;
    // The track grows by what its far end moves along this direction, less what its near end does.
    let outwards = between(places[from].origin, end).map(|v| v * bar / length_mm);
    let beyond = |turn: &Matrix3, unit: usize| (0..3).map(|k| outwards[k] * turn[k][unit]).sum::<f64>();
    for (i, surface) in lens.surfaces.iter().enumerate().take(to + 1).skip(from) {
        let here = places[i].rotation;
        let mut behind = here;
        if let Some(placement) = &surface.placement {
            let rotation = placement.rotation();
            let front = product(here, transposed(&rotation));
            behind = product(front, axis_turn(placement.axis, &rotation));
            let goes_on = placement.axis != Axis::Returns;
            // A decentre moves its own vertex, and all that follows unless the axis returns.
            let ends_moved = f64::from(i == to || goes_on) - f64::from(i == from);
            for axis in 0..2 {
                gradient[(i, Number::Decenter(axis))] += ends_moved * beyond(&front, axis);
            }
            // A tilt turns what follows about the vertex.
            if goes_on && i < to {
                let rest = apply(&transposed(&behind), between(places[i].origin, end));
                for (axis, turn) in axis_turn_by_tilt(placement).iter().enumerate() {
                    gradient[(i, Number::Tilt(axis))] += dot(outwards, apply(&front, apply(turn, rest)));
                }
            }
        }
        if i < to {
            gradient[(i, Number::Thickness)] += beyond(&behind, 2);
        }
    }
}

/// Rotation from the axis behind a surface to that in front, by the rotation `R` of the surface: `R` where the axis follows it, and where it bends
/// `R D R^T D` with `D = diag(-1, -1, 1)`.
fn axis_turn(axis: Axis, rotation: &Matrix3) -> Matrix3 {
    match axis {
        Axis::Returns => STRAIGHT,
        Axis::Follows => *rotation,
        Axis::Bends => product(*rotation, transposed(&half_turned(rotation))),
    }
}

/// Derivatives of [`axis_turn`] by the three tilts.
fn axis_turn_by_tilt(placement: &Placement) -> [Matrix3; 3] {
    let rotation = placement.rotation();
    placement.rotation_by_tilt().map(|by| match placement.axis {
        Axis::Returns => [[0.0; 3]; 3],
        Axis::Follows => by,
        Axis::Bends => {
            let first = product(by, transposed(&half_turned(&rotation)));
            let second = product(rotation, transposed(&half_turned(&by)));
            [0, 1, 2].map(|r| [0, 1, 2].map(|c| first[r][c] + second[r][c]))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::{nominal_triplet, special_lenses, telescope};
    use crate::constraint::{Constraint, SemiDiameters};
    use crate::lens::{Action, Surface};

    /// A lens of one surface, a fold mirror of 45 degrees 35 mm behind it, and the image plane 26 mm behind the mirror.
    fn folded() -> Lens {
        let tilt_rad = [45_f64.to_radians(), 0.0, 0.0];
        let placement = Some(Placement { tilt_rad, axis: Axis::Bends, ..Placement::default() });
        let mirror =
            Surface { action: Action::Reflect, placement, thickness_mm: -26.0, ..Surface::default() };
        let surfaces = vec![Surface { thickness_mm: 35.0, ..Surface::default() }, mirror];
        Lens { surfaces, stop: 0, ..nominal_triplet() }
    }

    #[test]
    fn the_track_of_a_folded_lens_is_measured_in_space() {
        let lens = folded();
        let wanted_mm = 35_f64.hypot(26.0);
        assert!((lens.track_mm() - wanted_mm).abs() < 1e-12, "{}", lens.track_mm());
        let limit = Constraint::Track { most_mm: 36.0 };
        let excess_mm = limit.excess_mm(&lens, &SemiDiameters(&lens)).unwrap();
        assert!((excess_mm - (wanted_mm - 36.0)).abs() < 1e-12, "{excess_mm}");
        assert!(!lens.with_image_distance(f64::NEG_INFINITY).track_mm().is_finite());
    }

    /// The derivatives against central differences, by every number that moves a vertex.
    #[test]
    fn the_track_has_its_own_gradient() {
        let placed = |decenter_mm, tilt_rad, axis| Some(Placement { decenter_mm, tilt_rad, axis });
        let bent = special_lenses().into_iter().find(|lens| lens.name == "folded").unwrap();
        let mut broken = bent.clone();
        broken.surfaces[0].placement = placed([0.3, -0.2], [0.02, 0.01, 0.0], Axis::Returns);
        broken.surfaces[4].placement = placed([0.1, 0.2], [0.1, -0.2, 0.3], Axis::Follows);
        // Long enough for the image plane to be an end.
        let mut far = broken.clone();
        far.surfaces.last_mut().unwrap().thickness_mm = 90.0;
        // A mirror that sends light nearly back is an end itself.
        let mut steep = folded();
        steep.surfaces[1].placement = placed([0.0; 2], [0.2, 0.0, 0.0], Axis::Bends);
        for lens in [folded(), bent, broken, far, steep, telescope()] {
            let clear = SemiDiameters(&lens);
            let gradient = Constraint::Track { most_mm: 1.0 }.gradient(&lens, &clear, 1.0).unwrap();
            let ([x, y], [a, b, c]) = ([0, 1].map(Number::Decenter), [0, 1, 2].map(Number::Tilt));
            let numbers = [Number::Thickness, x, y, a, b, c];
            for (i, number) in (0..lens.surfaces.len()).flat_map(|i| numbers.map(|n| (i, n))) {
                let value = number.read(&lens, i);
                if value.is_nan() {
                    assert_eq!(gradient[(i, number)], 0.0);
                    continue;
                }
                let step = 1e-5;
                let at = |value: f64| {
                    let mut moved = lens.clone();
                    number.write(&mut moved, i, value);
                    moved.track_mm()
                };
                let numeric = (at(value + step) - at(value - step)) / (2.0 * step);
                let exact = gradient[(i, number)];
                assert!((exact - numeric).abs() < 1e-6, "{}: {i} {number}: {exact} {numeric}", lens.name);
            }
        }
    }
}
