//! Elements: the pieces of glass of a lens, as outlines in the y-z plane.

use petzval_optics::glass::Glass;
use petzval_optics::lens::{Lens, Surface};

/// Steps in which the profile of a surface is drawn, from edge to edge.
const STEPS: usize = 60;

/// An edge thinner than this is taken for a crossing, mm.
const THINNEST_EDGE_MM: f64 = 0.01;

/// One piece of glass.
#[derive(Debug)]
pub(super) struct Element<'a> {
    /// What it is made of.
    pub glass: &'a Glass,
    /// Half its outer diameter, mm.
    pub height_mm: f64,
    /// Middle of its rim, mm from the first vertex of the lens.
    pub rim_mm: f64,
    /// Closed outline, (z, y) in mm.
    pub outline: Vec<[f64; 2]>,
}

/// A surface in its place along the axis.
#[derive(Clone, Copy)]
struct Placed<'a> {
    surface: &'a Surface,
    at_mm: f64,
    is_cemented: bool,
}

/// Positions of the vertices, mm from the first.
pub(super) fn vertices_mm(lens: &Lens) -> Vec<f64> {
    let mut at = 0.0;
    lens.surfaces
        .iter()
        .map(|s| {
            let here = at;
            at += s.thickness_mm;
            here
        })
        .collect()
}

/// The elements of a lens from front to rear. Elements without air between them are cemented and share
/// one outer diameter; a surface with the same glass on both sides (an inner stop) divides nothing.
pub(super) fn elements(lens: &Lens) -> Vec<Element<'_>> {
    let at = vertices_mm(lens);
    let surfaces = &lens.surfaces;
    let mut elements = Vec::new();
    let mut first = 0;
    while first < surfaces.len() {
        if surfaces[first].glass.is_air() {
            first += 1;
            continue;
        }
        // Follow the glass to the next air; glass that reaches the image has no rear surface to draw.
        let Some(length) = surfaces[first..].iter().position(|s| s.glass.is_air()) else { break };
        let last = first + length;
        let walls: Vec<usize> =
            (first..=last).filter(|i| *i == first || surfaces[*i].glass != surfaces[*i - 1].glass).collect();
        let height_mm = walls.iter().map(|i| surfaces[*i].semi_diameter_mm).fold(0.0, f64::max);
        let place =
            |i: usize| Placed { surface: &surfaces[i], at_mm: at[i], is_cemented: i != first && i != last };
        for pair in walls.windows(2) {
            let [front, rear] = sides(place(pair[0]), place(pair[1]), height_mm);
            let rim_mm = match (front.last(), rear.last()) {
                (Some(f), Some(r)) => 0.5 * (f[0] + r[0]),
                _ => at[pair[0]],
            };
            elements.push(Element {
                glass: surfaces[pair[0]].glass.as_ref(),
                height_mm,
                rim_mm,
                // The front from bottom to top, the ground edge, the rear from top to bottom.
                outline: front.into_iter().chain(rear.into_iter().rev()).collect(),
            });
        }
        first = last;
    }
    elements
}

/// Profiles of the front and the rear of an element, from the lower to the upper rim.
fn sides(front: Placed, rear: Placed, height_mm: f64) -> [Vec<[f64; 2]>; 2] {
    // Beyond its clear semi-diameter a free surface ends in a flat, a cemented one goes on as it is.
    let flat = [front, rear].map(|p| profile(p, height_mm, p.is_cemented));
    let has_edge = |f: &[[f64; 2]], r: &[[f64; 2]]| match (f.last(), r.last()) {
        (Some(f), Some(r)) => r[0] - f[0] > THINNEST_EDGE_MM,
        _ => false,
    };
    if has_edge(&flat[0], &flat[1]) {
        return flat;
    }
    // The flats of a strong meniscus may meet: then both surfaces go on to the rim.
    [front, rear].map(|p| profile(p, height_mm, true))
}

/// A surface from the lower to the upper rim, (z, y) in mm.
fn profile(placed: Placed, height_mm: f64, goes_on: bool) -> Vec<[f64; 2]> {
    let Placed { surface, at_mm, .. } = placed;
    let sag = |y: f64| surface.shape.sag_mm(y);
    let curved_mm = match goes_on && sag(height_mm).is_some() {
        true => height_mm,
        false => surface.semi_diameter_mm.min(height_mm),
    };
    let mut points: Vec<[f64; 2]> = (0..=STEPS)
        .map(|i| curved_mm * (2.0 * i as f64 / STEPS as f64 - 1.0))
        .filter_map(|y| sag(y).map(|z| [at_mm + z, y]))
        .collect();
    if let (Some(low), Some(high), true) =
        (points.first().copied(), points.last().copied(), height_mm > curved_mm)
    {
        points.insert(0, [low[0], -height_mm]);
        points.push([high[0], height_mm]);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::super::super::sample::{cemented_doublet, triplet};
    use super::*;

    #[test]
    fn a_triplet_has_three_elements_with_edges_of_glass() {
        let lens = triplet();
        let elements = elements(&lens);
        assert_eq!(elements.len(), 3);
        for element in &elements {
            // The highest two points span the edge: as high as the larger semi-diameter, and thick.
            let top: Vec<_> = element.outline.iter().filter(|p| p[1] == element.height_mm).collect();
            assert!(top.len() >= 2);
            let edge = top.iter().map(|p| p[0]).fold(f64::MIN, f64::max)
                - top.iter().map(|p| p[0]).fold(f64::MAX, f64::min);
            assert!(edge > 0.3, "{edge}");
        }
        assert!((elements[0].height_mm - 7.733).abs() < 1e-12);
        assert_eq!(elements[1].glass.name, "N-SF11");
    }

    #[test]
    fn cemented_elements_share_their_inner_surface_and_diameter() {
        let lens = cemented_doublet();
        let elements = elements(&lens);
        assert_eq!(elements.len(), 2);
        assert_eq!(elements[0].height_mm, elements[1].height_mm);
        let rear: Vec<_> = elements[0].outline.iter().rev().take(STEPS + 1).collect();
        let front: Vec<_> = elements[1].outline.iter().take(STEPS + 1).collect();
        assert_eq!(rear, front);
    }
}
