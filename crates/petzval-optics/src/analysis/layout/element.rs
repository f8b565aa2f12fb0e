//! Elements: the pieces of glass of a lens, as outlines in its section.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Serialize;

use crate::glass::Glass;
use crate::lens::{Action, Lens, Place, Surface};
use crate::vector::apply;

/// One piece of glass.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LayoutElement {
    /// Name of its glass.
    pub glass: String,
    /// Its index at the d line; `None` where its formula does not hold there.
    pub nd: Option<f64>,
    /// Its Abbe number; `None` where its formula does not hold at the lines.
    pub vd: Option<f64>,
    /// Half its outer diameter, mm.
    pub height_mm: f64,
    /// Middle of its upper and of its lower rim.
    pub rims: [[f64; 2]; 2],
    /// Closed outline.
    pub outline: Vec<[f64; 2]>,
}

/// The kind of a bare surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LineKind {
    /// A mirror.
    Mirror,
    /// A thin lens of positive power.
    ConvergingLens,
    /// A thin lens of negative power.
    DivergingLens,
    /// A surface between equal media that bends light: a diffractive structure.
    Structure,
}

/// A surface that belongs to no piece of glass.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct LayoutLine {
    /// Its kind.
    pub kind: LineKind,
    /// Its profile from the lower to the upper edge.
    pub points: Vec<[f64; 2]>,
    /// Unit direction (z, y) along its axis in the sense of the light: the dark side of a mirror.
    pub back: [f64; 2],
}

/// Number of steps of the profile of a surface, from edge to edge.
const STEPS: usize = 60;

/// Edges thinner than this count as crossing surfaces, mm.
const THINNEST_EDGE_MM: f64 = 0.01;

/// The medium behind every surface: behind a mirror it is the one in front.
fn media(lens: &Lens) -> Vec<Arc<Glass>> {
    let mut media: Vec<Arc<Glass>> = Vec::new();
    for s in &lens.surfaces {
        media.push(match (s.action, media.last()) {
            (Action::Reflect, Some(front)) => front.clone(),
            (Action::Reflect, None) => Glass::air(),
            _ => s.glass.clone(),
        });
    }
    media
}

/// A surface in its place.
#[derive(Clone, Copy)]
struct Wall<'a> {
    surface: &'a Surface,
    place: &'a Place,
    is_cemented: bool,
}

/// The elements of a lens in the order of the light. Elements without air between them are cemented and share one outer
/// diameter. A surface with the same glass on both sides (an inner stop) does not divide an element.
pub(super) fn elements(lens: &Lens, places: &[Place]) -> Vec<LayoutElement> {
    let (surfaces, media) = (&lens.surfaces, media(lens));
    let mut elements = Vec::new();
    let mut first = 0;
    while first < surfaces.len() {
        if media[first].is_air() {
            first += 1;
            continue;
        }
        // Follow the glass to the next air, or to the image plane.
        let length = media[first..].iter().position(|glass| glass.is_air());
        let last = length.map_or(surfaces.len(), |length| first + length);
        let divides = |i: usize| {
            i == first || i == last || media[i] != media[i - 1] || surfaces[i].action == Action::Reflect
        };
        let walls: Vec<usize> = (first..=last).filter(|i| divides(*i)).collect();
        let of_lens = |i: usize| surfaces.get(i);
        let heights = walls.iter().filter_map(|i| of_lens(*i)).map(|s| s.semi_diameter_mm);
        let height_mm = heights.fold(0.0, f64::max);
        let image = Surface { semi_diameter_mm: height_mm, ..Surface::default() };
        let wall = |i: usize| {
            let surface = of_lens(i).unwrap_or(&image);
            let is_cemented = i != first && i != last && surface.action != Action::Reflect;
            Wall { surface, place: &places[i], is_cemented }
        };
        for pair in walls.windows(2) {
            let glass = &media[pair[0]];
            let [nd, vd] = glass.known_nd_and_vd();
            let [front, rear] = sides(wall(pair[0]), wall(pair[1]), height_mm);
            let ends = |side: &[[f64; 2]]| [side.last().copied(), side.first().copied()];
            let middle = |a: Option<[f64; 2]>, b: Option<[f64; 2]>| match (a, b) {
                (Some(a), Some(b)) => [0, 1].map(|k| 0.5 * (a[k] + b[k])),
                _ => places[pair[0]].section([0.0; 2]),
            };
            let ([front_up, front_down], [rear_up, rear_down]) = (ends(&front), ends(&rear));
            elements.push(LayoutElement {
                glass: glass.name.clone(),
                nd,
                vd,
                height_mm,
                rims: [middle(front_up, rear_up), middle(front_down, rear_down)],
                // Join the front from bottom to top, the ground edge, and the rear from top to bottom.
                outline: front.into_iter().chain(rear.into_iter().rev()).collect(),
            });
        }
        first = last;
    }
    elements
}

/// Mirrors, thin lenses and diffractive structures between equal media.
pub(super) fn bare_surfaces(lens: &Lens, places: &[Place]) -> Vec<LayoutLine> {
    let media = media(lens);
    let air = Glass::air();
    let kind = |i: usize| {
        let s = &lens.surfaces[i];
        let before = if i == 0 { &air } else { &media[i - 1] };
        match s.action {
            Action::Reflect => Some(LineKind::Mirror),
            Action::ThinLens { power_per_mm } if power_per_mm < 0.0 => Some(LineKind::DivergingLens),
            Action::ThinLens { .. } => Some(LineKind::ConvergingLens),
            _ if s.phase.is_some() && *before == media[i] => Some(LineKind::Structure),
            _ => None,
        }
    };
    (0..lens.surfaces.len())
        .filter_map(|i| {
            let surface = &lens.surfaces[i];
            let wall = Wall { surface, place: &places[i], is_cemented: false };
            let towards = if i == 0 || lens.light_goes_forwards(i - 1) { 1.0 } else { -1.0 };
            let [_, y, z] = apply(&places[i].rotation, [0.0, 0.0, towards]);
            let length = z.hypot(y).max(f64::MIN_POSITIVE);
            let points = profile(wall, surface.semi_diameter_mm, true);
            Some(LayoutLine { kind: kind(i)?, points, back: [z / length, y / length] })
        })
        .collect()
}

/// Profiles of the front and the rear of an element, from the lower to the upper rim.
fn sides(front: Wall, rear: Wall, height_mm: f64) -> [Vec<[f64; 2]>; 2] {
    // Beyond its clear semi-diameter a free surface continues as a flat, a cemented one with its own shape.
    let flat = [front, rear].map(|wall| profile(wall, height_mm, wall.is_cemented));
    let direction = (rear.place.origin[2] - front.place.origin[2]).signum();
    let has_edge = |f: &[[f64; 2]], r: &[[f64; 2]]| match (f.last(), r.last()) {
        (Some(f), Some(r)) => (r[0] - f[0]) * direction > THINNEST_EDGE_MM,
        _ => false,
    };
    if has_edge(&flat[0], &flat[1]) {
        return flat;
    }
    // The flats of a strong meniscus may cross: then both surfaces continue with their shape to the rim.
    [front, rear].map(|wall| profile(wall, height_mm, true))
}

/// A surface from the lower to the upper rim.
fn profile(wall: Wall, height_mm: f64, goes_on: bool) -> Vec<[f64; 2]> {
    let Wall { surface, place, .. } = wall;
    let sag = |y: f64| surface.shape.sag_at_mm([0.0, y]);
    let curved_mm = if goes_on && sag(height_mm).is_some() && sag(-height_mm).is_some() {
        height_mm
    } else {
        surface.semi_diameter_mm.min(height_mm)
    };
    let mut points: Vec<[f64; 2]> = (0..=STEPS)
        .map(|i| curved_mm * (2.0 * i as f64 / STEPS as f64 - 1.0))
        .filter_map(|y| sag(y).map(|z| [z, y]))
        .collect();
    if let (Some(low), Some(high), true) =
        (points.first().copied(), points.last().copied(), height_mm > curved_mm)
    {
        points.insert(0, [low[0], -height_mm]);
        points.push([high[0], height_mm]);
    }
    points.into_iter().map(|p| place.section(p)).collect()
}
