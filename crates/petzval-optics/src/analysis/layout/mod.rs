//! The layout: a lens in its y-z section, with rays, in the coordinates of its first vertex.

mod element;
mod ray;

pub use element::{LayoutElement, LayoutLine, LineKind};
pub use ray::LayoutRay;

use schemars::JsonSchema;
use serde::Serialize;

use super::AnalysisOptions;
use crate::lens::{Lens, ObjectDistance, places};
use crate::paraxial::first_order;
use element::{bare_surfaces, elements};

/// A lens in its y-z section; points are (z, y) in mm from the first vertex.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Layout {
    /// Pieces of glass in the order of the light.
    pub elements: Vec<LayoutElement>,
    /// Surfaces that belong to no piece of glass.
    pub lines: Vec<LayoutLine>,
    /// `[field]`: rays of the reference wavelength through the vertical diameter of the stop.
    pub rays: Vec<Vec<LayoutRay>>,
    /// The optical axis through the vertices to the image.
    pub axis: Vec<[f64; 2]>,
    /// The two edges of the stop, each from its rim outwards.
    pub stop: [[[f64; 2]; 2]; 2],
    /// The image plane from edge to edge, as far as the fields reach.
    pub image: [[f64; 2]; 2],
}

/// Share of the lens's size by which rays start in front of it.
const LEAD: f64 = 0.14;

/// The layout of a lens with rays of its own fields.
pub fn layout(lens: &Lens, options: &AnalysisOptions) -> Layout {
    let places = places(lens);
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    let size = places.iter().map(|p| p.origin[2].abs().max(p.origin[1].abs())).fold(0.0, f64::max);
    let (elements, lines) = (elements(lens, &places), bare_surfaces(lens, &places));
    // Rays start in front of all surfaces (also of the secondary of a telescope), but not before their object.
    let outlines = elements.iter().map(|e| &e.outline).chain(lines.iter().map(|l| &l.points));
    let foremost = outlines.flatten().map(|p| p[0]).fold(0.0, f64::min);
    let object_mm = match lens.object {
        ObjectDistance::Infinity => f64::INFINITY,
        ObjectDistance::Finite(distance) if distance > 0.0 => distance,
        // Light that converges to a virtual object comes from anywhere.
        ObjectDistance::Finite(_) => f64::INFINITY,
    };
    let lead_mm = (LEAD * size - foremost).min(object_mm);
    let count = options.layout_rays.max(2);
    let fan = |field_deg: &f64| ray::fan(lens, &places, field_deg.to_radians(), count, lead_mm);
    let rays: Vec<Vec<LayoutRay>> = lens.fields_deg.iter().map(fan).collect();
    // Draw the edges of the stop over half a radius outwards.
    let stop = &places[lens.stop];
    let inner = order.stop_radius_mm.abs();
    let outer = inner + (0.5 * inner).max(0.04 * size);
    let sag = lens.surfaces[lens.stop].shape.sag_at_mm([0.0, inner]).unwrap_or(0.0);
    let image = &places[lens.surfaces.len()];
    let reached = |of: &[LayoutRay]| {
        let at_image = of.iter().filter(|r| !r.is_lost).filter_map(|r| r.points.last().copied());
        at_image.map(|p| image.height_of(p).abs()).fold(0.0, f64::max)
    };
    let half_image = rays.iter().map(|r| reached(r)).fold(0.5 * inner, f64::max);
    Layout {
        elements,
        lines,
        rays,
        axis: places.iter().map(|p| p.section([0.0; 2])).collect(),
        stop: [1.0, -1.0].map(|side| [inner, outer].map(|r| stop.section([sag, side * r]))),
        image: [-1.0, 1.0].map(|side| image.section([0.0, side * half_image])),
    }
}
