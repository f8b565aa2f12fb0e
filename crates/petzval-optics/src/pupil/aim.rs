//! Ray aiming that follows the beam: the one place that supplies guesses for rays through points of the stop.
//!
//! A guess is a launch point of a similar beam or that of first-order optics. Where Newton's method from it makes full
//! steps that leave at most a quarter of the miss each, its ray is the one next to the guess, and taken. The other rays are
//! reached by continuation: the chief ray is followed from the axis through the fields in small steps, then each ray from
//! the chief ray through the stop to its point. Both start at a ray that is known and go to the next one by the same strict
//! Newton's method, so they stay on the branch that is connected with the axis.

use super::launch::paraxial_launch;
use crate::paraxial::{FirstOrder, first_order};
use crate::trace::{AimedRays, Sequence, starts_across};

/// Largest step of the field, rad: 5 degrees.
const LARGEST_FIELD_STEP_RAD: f64 = std::f64::consts::PI / 36.0;

/// Least step of the field, as a share of the largest.
const LEAST_FIELD_STEP: f64 = 1.0 / 512.0;

/// Growth of a step after a success.
const GROWTH: f64 = 1.5;

/// Least step through the stop, as a share of the way from the anchor to the point.
const LEAST_STOP_STEP: f64 = 1.0 / 64.0;

/// Steps through the stop allowed.
const STOP_STEPS: usize = 200;

/// Points of the pupil that are followed through the fields, in the order of trial: the chief ray or, if no light passes
/// the centre of the stop, another ray.
const ANCHORS: [[f64; 2]; 6] = [[0.0, 0.0], [0.0, -0.5], [0.0, 0.5], [0.5, 0.0], [0.0, -0.9], [0.0, 0.9]];

/// Aims the rays of a field at points of the pupil, (x, y) in units of `stop_radius_mm`: at points of the real stop.
///
/// `near_mm` holds launch points of a similar beam, one per point, as first guesses. A ray is `NotAimed` if it cannot be
/// reached by continuation from the axis either. The rays are on the branch that is connected with the axis.
///
/// `stop_radius_mm` is that of the reference wavelength: the stop has one size for all wavelengths.
pub fn aim_at_pupil(
    sequence: &Sequence,
    field_rad: f64,
    stop_radius_mm: f64,
    points: &[[f64; 2]],
    near_mm: Option<&[[f64; 2]]>,
) -> AimedRays {
    let order = first_order(sequence);
    let beam = Beam { sequence, order: &order, field_rad, stop_radius_mm };
    // Aim all rays from their guesses, and those that the beam nearby does not give from first-order optics.
    let mut aimed = match near_mm.filter(|near| near.len() == points.len()) {
        Some(near) => beam.direct(points, near),
        None => beam.direct(points, &beam.paraxial(points)),
    };
    let mut open = open_rays(&aimed, points.len());
    if near_mm.is_some() && !open.is_empty() {
        let of_open: Vec<[f64; 2]> = open.iter().map(|i| points[*i]).collect();
        let again = beam.direct(&of_open, &beam.paraxial(&of_open));
        for (k, i) in open.iter().enumerate() {
            aimed.replace(*i, &again, k);
        }
        open = open_rays(&aimed, points.len());
    }
    if !open.is_empty() {
        beam.follow(points, &open, &mut aimed);
    }
    aimed
}

/// The launch point of the ray of a field through the point `p` of the pupil, in units of `stop_radius_mm`; `None` if there
/// is none. See [`aim_at_pupil`].
pub fn aim_one(sequence: &Sequence, field_rad: f64, stop_radius_mm: f64, p: [f64; 2]) -> Option<[f64; 2]> {
    let aimed = aim_at_pupil(sequence, field_rad, stop_radius_mm, &[p], None);
    aimed.is_aimed(0).then(|| aimed.launch_of(0))
}

/// Rays that still have to be aimed: those without a launch point, and all if the stop is a mirror image of the launch plane
/// for some rays. These are on another branch, except where one section of the beam has crossed the axis before the stop and
/// the other has not.
fn open_rays(aimed: &AimedRays, count: usize) -> Vec<usize> {
    let is_mirrored = |i: usize| aimed.is_aimed(i) && aimed.launch_per_stop_area(i) < 0.0;
    if (0..count).any(is_mirrored) {
        return (0..count).collect();
    }
    (0..count).filter(|i| !aimed.is_aimed(*i)).collect()
}

/// A beam whose rays are followed.
struct Beam<'a> {
    sequence: &'a Sequence,
    order: &'a FirstOrder,
    field_rad: f64,
    stop_radius_mm: f64,
}

/// Where a ray that is followed through the fields is lost.
enum Lost {
    /// It is not found on the axis.
    OnTheAxis,
    /// Between the axis and its field.
    BetweenFields,
}

/// A ray on its way from an anchor to its point of the stop.
struct OnItsWay {
    /// Its place among the rays.
    ray: usize,
    /// Share of the way.
    share: f64,
    step: f64,
    launch_mm: [f64; 2],
    /// d(launch) / d(stop) there.
    launch_by_stop: [[f64; 2]; 2],
}

/// A point on the way from `from` to `to`.
fn between(from: [f64; 2], to: [f64; 2], share: f64) -> [f64; 2] {
    [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]))
}

/// d(launch) / d(stop) of an aimed ray.
fn launch_by_stop(aimed: &AimedRays, ray: usize) -> [[f64; 2]; 2] {
    let [[a, b], [c, d]] = aimed.stop_by_launch_of(ray);
    let det = a * d - b * c;
    [[d / det, -b / det], [-c / det, a / det]]
}

impl Beam<'_> {
    fn targets(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        points.iter().map(|p| p.map(|p| self.stop_radius_mm * p)).collect()
    }

    fn paraxial(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        points.iter().map(|p| paraxial_launch(self.order, self.sequence, self.field_rad, *p)).collect()
    }

    fn direct(&self, points: &[[f64; 2]], guess_mm: &[[f64; 2]]) -> AimedRays {
        AimedRays::direct(self.sequence, self.field_rad, &self.targets(points), guess_mm)
    }

    /// Aims the rays `open` by continuation: an anchor through the fields, then every ray from the anchor.
    fn follow(&self, points: &[[f64; 2]], open: &[usize], aimed: &mut AimedRays) {
        let mut starts = false;
        for anchor in ANCHORS {
            match self.through_fields(anchor) {
                Ok(at_anchor) => return self.through_stop(anchor, &at_anchor, points, open, aimed),
                Err(Lost::BetweenFields) => starts = true,
                Err(Lost::OnTheAxis) => {}
            }
        }
        if starts {
            // Nothing that passes the stop on the axis can be followed to this field.
            open.iter().for_each(|i| aimed.lose(*i));
            return;
        }
        // No ray is found on the axis, as in systems that have no straight axis: there is nothing to follow. Search from
        // the paraxial guesses.
        let of_open: Vec<[f64; 2]> = open.iter().map(|i| points[*i]).collect();
        let guesses = self.paraxial(&of_open);
        let found = AimedRays::new(self.sequence, self.field_rad, &self.targets(&of_open), &guesses);
        for (k, i) in open.iter().enumerate() {
            aimed.replace(*i, &found, k);
        }
    }

    /// Follows the ray through a point of the pupil from the axis to the field.
    ///
    /// The unknown is its distance from the paraxial ray, measured across the direction: it stays finite at 90 degrees. It is
    /// extrapolated linearly over the field.
    fn through_fields(&self, point: [f64; 2]) -> Result<AimedRays, Lost> {
        let target = self.targets(&[point]);
        let paraxial = |field: f64| paraxial_launch(self.order, self.sequence, field, point);
        // Length across the direction of a launch coordinate y.
        let across = |field: f64| if starts_across(self.sequence, field) { 1.0 } else { field.cos() };
        let aim = |field: f64, off: [f64; 2]| {
            let [x, y] = paraxial(field);
            let aimed =
                AimedRays::direct(self.sequence, field, &target, &[[x + off[0], y + off[1] / across(field)]]);
            aimed.is_aimed(0).then_some(aimed)
        };
        let off_of = |field: f64, launch: [f64; 2]| {
            let [x, y] = paraxial(field);
            [launch[0] - x, (launch[1] - y) * across(field)]
        };
        // On the axis, search from the paraxial ray.
        let on_axis = aim(0.0, [0.0; 2]).or_else(|| {
            let aimed = AimedRays::new(self.sequence, 0.0, &target, &[paraxial(0.0)]);
            aimed.is_aimed(0).then_some(aimed)
        });
        let Some(mut last) = on_axis else { return Err(Lost::OnTheAxis) };
        let sign = last.launch_per_stop_area(0).signum();
        let (mut field, mut off) = (0.0, off_of(0.0, last.launch_of(0)));
        let mut slope = [0.0; 2];
        let mut step = LARGEST_FIELD_STEP_RAD;
        // Go outwards: steps that fail are halved.
        while field != self.field_rad {
            let left = self.field_rad - field;
            let next = if left.abs() <= step { self.field_rad } else { field + step * left.signum() };
            let guess = [0, 1].map(|axis| off[axis] + slope[axis] * (next - field));
            match aim(next, guess).filter(|aimed| aimed.launch_per_stop_area(0) * sign > 0.0) {
                Some(aimed) => {
                    let found = off_of(next, aimed.launch_of(0));
                    slope = [0, 1].map(|axis| (found[axis] - off[axis]) / (next - field));
                    (field, off, last) = (next, found, aimed);
                    step = (step * GROWTH).min(LARGEST_FIELD_STEP_RAD);
                }
                None => {
                    step *= 0.5;
                    if step < LEAST_FIELD_STEP * LARGEST_FIELD_STEP_RAD {
                        return Err(Lost::BetweenFields);
                    }
                }
            }
        }
        Ok(last)
    }

    /// Follows rays through the stop, from the ray through `anchor` to their points; those that are not reached are lost.
    fn through_stop(
        &self,
        anchor: [f64; 2],
        at_anchor: &AimedRays,
        points: &[[f64; 2]],
        open: &[usize],
        aimed: &mut AimedRays,
    ) {
        let sign = at_anchor.launch_per_stop_area(0).signum();
        let start = |ray: &usize| OnItsWay {
            ray: *ray,
            share: 0.0,
            step: 1.0,
            launch_mm: at_anchor.launch_of(0),
            launch_by_stop: launch_by_stop(at_anchor, 0),
        };
        let mut on_way: Vec<OnItsWay> = open.iter().map(start).collect();
        for _ in 0..STOP_STEPS {
            if on_way.is_empty() {
                break;
            }
            // Extrapolate each ray by its derivatives to the next point on its way, and aim it there.
            let goal = |w: &OnItsWay| between(anchor, points[w.ray], (w.share + w.step).min(1.0));
            let goals: Vec<[f64; 2]> = on_way.iter().map(goal).collect();
            let guess = |(w, goal): (&OnItsWay, &[f64; 2])| {
                let from = between(anchor, points[w.ray], w.share);
                let by = [0, 1].map(|axis| self.stop_radius_mm * (goal[axis] - from[axis]));
                [0, 1].map(|row| {
                    let [a, b] = w.launch_by_stop[row];
                    w.launch_mm[row] + a * by[0] + b * by[1]
                })
            };
            let guesses: Vec<[f64; 2]> = on_way.iter().zip(&goals).map(guess).collect();
            let tried = self.direct(&goals, &guesses);
            let mut k = 0;
            on_way.retain_mut(|w| {
                let (i, is_there) = (k, w.share + w.step >= 1.0);
                k += 1;
                if tried.is_aimed(i) && tried.launch_per_stop_area(i) * sign > 0.0 {
                    if is_there {
                        aimed.replace(w.ray, &tried, i);
                        return false;
                    }
                    w.share += w.step;
                    w.step *= GROWTH;
                    w.launch_mm = tried.launch_of(i);
                    w.launch_by_stop = launch_by_stop(&tried, i);
                } else {
                    w.step *= 0.5;
                }
                if w.step < LEAST_STOP_STEP {
                    aimed.lose(w.ray);
                    return false;
                }
                true
            });
        }
        on_way.iter().for_each(|w| aimed.lose(w.ray));
    }
}
