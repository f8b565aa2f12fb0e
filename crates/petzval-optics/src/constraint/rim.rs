//! Rims: how far two neighbouring surfaces are apart where their clear radii end.

use super::clear_radii::{ClearRadii, direction_of_light};
use crate::lens::{Departure, Lens, Surface, SurfaceShape, azimuths, reach_mm};

/// Share of the reach of a shape up to which it counts: its slope is infinite at the reach itself.
const COUNTS: f64 = 0.999;

/// A height at which the sag of a surface is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Height {
    /// From the axis, mm.
    pub mm: f64,
    /// The surface whose clear radius it follows; `None` where the shape itself ends before.
    pub follows: Option<usize>,
}

/// Where two surfaces come nearest at their rims.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rim {
    /// Distance from the former to the latter, mm, positive in the direction of light.
    pub thickness_mm: f64,
    /// Direction across the axis.
    pub direction: [f64; 2],
    /// Heights at which the two sags are taken.
    pub heights: [Height; 2],
}

/// The thinnest place between a surface and the next at their rims, over several directions across the axis.
///
/// A surface has its shape up to its own clear radius, mount included, and goes on as a flat. An element is measured at the rim of its
/// larger and of its smaller surface. Air is measured at the rim of the smaller surface only, since there is a mount beyond. `None` if a
/// sag is no number.
pub(super) fn thinnest(lens: &Lens, clear: &dyn ClearRadii, surface: usize, element: bool) -> Option<Rim> {
    let pair = [surface, surface + 1];
    let ends = pair.map(|s| Height { mm: clear.radius_mm(s) + clear.mount_mm(), follows: Some(s) });
    let [small, large] = if ends[0].mm > ends[1].mm { [ends[1], ends[0]] } else { ends };
    let light = direction_of_light(lens, surface);
    let [front, back] = pair.map(|s| &lens.surfaces[s]);
    let rim = |direction: [f64; 2], at: Height| {
        let lesser = |own: Height| if own.mm < at.mm { own } else { at };
        let heights = [0, 1].map(|k| within_reach([front, back][k], direction, lesser(ends[k])));
        let sag = |s: &Surface, h: Height| s.shape.sag_at_mm(direction.map(|v| v * h.mm));
        let along_z = front.thickness_mm + sag(back, heights[1])? - sag(front, heights[0])?;
        Some(Rim { thickness_mm: light * along_z, direction, heights })
    };
    let at: &[Height] = if element { &[large, small] } else { &[small] };
    let directions = azimuths(&[front, back]);
    let all = directions.iter().flat_map(|d| at.iter().map(|at| rim(*d, *at)));
    let all: Vec<Rim> = all.collect::<Option<_>>()?;
    all.into_iter().min_by(|a, b| a.thickness_mm.total_cmp(&b.thickness_mm))
}

/// A height, or the one up to which the shape of a surface counts if that is less.
fn within_reach(surface: &Surface, direction: [f64; 2], height: Height) -> Height {
    let far_mm = height.mm / COUNTS;
    if surface.shape.sag_at_mm(direction.map(|v| v * far_mm)).is_some() {
        return height;
    }
    Height { mm: COUNTS * reach_mm(&surface.shape, direction, far_mm), follows: None }
}

/// How far from its vertex a conic counts, mm; `None` for a shape that goes on for ever, or is no conic of revolution.
pub(super) fn reach(shape: &SurfaceShape) -> Option<f64> {
    if matches!(shape.departure, Departure::Biconic { .. } | Departure::Toroid { .. }) {
        return None;
    }
    let square = (1.0 + shape.conic) * shape.curvature * shape.curvature;
    (square > 0.0).then(|| COUNTS / square.sqrt())
}
