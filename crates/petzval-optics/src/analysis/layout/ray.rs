//! Fans of a layout: the rays of a field in the plane of the drawing, from before the lens to the image.

use schemars::JsonSchema;
use serde::Serialize;

use crate::lens::{Lens, Place};
use crate::paraxial::first_order;
use crate::pupil::aim_one;
use crate::trace::{Fate, Path, Sequence, launch, starts_across, trace_ray};

/// A ray as a line.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LayoutRay {
    /// Corners, from in front of the lens to the image or to where it is lost.
    pub points: Vec<[f64; 2]>,
    /// Whether it is lost on the way.
    pub is_lost: bool,
}

/// The rays of a field at the lens's reference wavelength, evenly spread over the stop's diameter and aimed by real
/// tracing. They start `lead_mm` in front of the first vertex. A clipped ray ends where it is clipped, and a ray that
/// cannot be aimed is left out.
pub(super) fn fan(
    lens: &Lens,
    places: &[Place],
    field_rad: f64,
    rays: usize,
    lead_mm: f64,
) -> Vec<LayoutRay> {
    let sequence = lens.at_wavelength(lens.reference_um);
    let stop_radius_mm = first_order(&sequence).stop_radius_mm;
    let dummies: Vec<bool> = (0..lens.surfaces.len()).map(|i| lens.is_dummy(i)).collect();
    (0..rays)
        .filter_map(|i| {
            let pupil = 2.0 * i as f64 / (rays - 1) as f64 - 1.0;
            let launch_mm = aim_one(&sequence, field_rad, stop_radius_mm, [0.0, pupil])?;
            Some(line(&sequence, &dummies, places, field_rad, launch_mm, lead_mm))
        })
        .collect()
}

/// Traces a ray and joins its points on the surfaces. `dummies`: the surfaces that do nothing to light.
fn line(
    sequence: &Sequence,
    dummies: &[bool],
    places: &[Place],
    field_rad: f64,
    launch_mm: [f64; 2],
    lead_mm: f64,
) -> LayoutRay {
    let start = launch(sequence, field_rad, launch_mm).ray;
    let path = trace_ray(sequence, start);
    let [_, sin, cos] = start.direction;
    let section = |place: &Place, local: [f64; 3]| {
        let [_, y, z] = place.point(local);
        [z, y]
    };
    // Start in front of the first vertex. A steep ray starts that far in front of the surface that it meets first.
    let first =
        places.first().zip(path.passages.first()).map(|(place, passage)| section(place, passage.point));
    let mut points = match first {
        Some([z, y]) if starts_across(sequence, field_rad) => vec![[z - lead_mm * cos, y - lead_mm * sin]],
        _ => vec![[-lead_mm, start.position[1] - lead_mm * (sin / cos)]],
    };
    let mut is_dummy = vec![false];
    for ((place, passage), dummy) in places.iter().zip(&path.passages).zip(dummies).take(survived(&path)) {
        points.push(section(place, passage.point));
        is_dummy.push(*dummy);
    }
    if let (Fate::Ok, Some(image), Some(place)) = (path.fate, path.image, places.last()) {
        points.push(section(place, image.position));
        is_dummy.push(false);
    }
    LayoutRay { points: without_ways_back(&points, &is_dummy), is_lost: path.fate != Fate::Ok }
}

/// The corners of a ray without dummies to which it would go beyond the surface beside them and back: a plane at the vertex of a concave surface,
/// or across a tilted plate. Light passes such a dummy on a straight line.
fn without_ways_back(points: &[[f64; 2]], is_dummy: &[bool]) -> Vec<[f64; 2]> {
    let step = |from: usize, to: usize| [points[to][0] - points[from][0], points[to][1] - points[from][1]];
    let turns_back = |i: usize| {
        let before = (0..i).rev().find(|j| !is_dummy[*j]);
        let behind = (i + 1..points.len()).find(|j| !is_dummy[*j]);
        before.zip(behind).is_some_and(|(before, behind)| {
            let (there, on) = (step(before, i), step(i, behind));
            there[0] * on[0] + there[1] * on[1] < 0.0
        })
    };
    (0..points.len()).filter(|i| !(is_dummy[*i] && turns_back(*i))).map(|i| points[i]).collect()
}

/// Number of surfaces that the ray meets until it is lost, including the one that stops it.
fn survived(path: &Path) -> usize {
    match path.fate {
        Fate::Clipped(surface) => surface + 1,
        _ => path.passages.len(),
    }
}
