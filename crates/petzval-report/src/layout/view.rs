//! Views: the part of the section in a drawing, and its position on the page.

use petzval_optics::analysis::Layout;

use crate::plot::{px, span};

/// Space around the drawing, and above and below it for labels, px.
pub(super) const MARGIN_PX: f64 = 16.0;
const LABELS_PX: f64 = 30.0;

/// Largest extent of rays beyond the lens, as a share of its size: a ray at a large angle must not make the lens small.
const BEYOND: f64 = 0.25;

/// The part of the y-z plane that a drawing shows, mm; z counts from the first vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extent {
    /// Left edge, negative in front of the lens.
    pub z_min_mm: f64,
    /// Right edge.
    pub z_max_mm: f64,
    /// Lower edge, negative below the axis.
    pub y_min_mm: f64,
    /// Upper edge.
    pub y_max_mm: f64,
}

impl Extent {
    /// The smallest extent that contains both.
    pub fn union(self, other: Self) -> Self {
        Self {
            z_min_mm: self.z_min_mm.min(other.z_min_mm),
            z_max_mm: self.z_max_mm.max(other.z_max_mm),
            y_min_mm: self.y_min_mm.min(other.y_min_mm),
            y_max_mm: self.y_max_mm.max(other.y_max_mm),
        }
    }
}

/// The extent of the drawing of a section.
pub(crate) fn extent_of(layout: &Layout) -> Extent {
    let solid = || {
        let elements = layout.elements.iter().flat_map(|e| &e.outline);
        let lines = layout.lines.iter().flat_map(|l| &l.points);
        elements
            .chain(lines)
            .chain(&layout.axis)
            .chain(layout.stop.iter().flatten())
            .chain(&layout.image)
            .copied()
    };
    let along = |k: usize| span(solid().map(|p| p[k])).unwrap_or((0.0, 1.0));
    let (z, y) = (along(0), along(1));
    let beyond = BEYOND * (z.1 - z.0).max(y.1 - y.0);
    let with_rays = |k: usize, (low, high): (f64, f64)| {
        let rays = layout.rays.iter().flatten().flat_map(|r| &r.points).map(|p| p[k]);
        let reached = rays.map(|v| v.clamp(low - beyond, high + beyond));
        span(reached.chain([low, high])).unwrap_or((low, high))
    };
    let ((z_min_mm, z_max_mm), (y_min_mm, y_max_mm)) = (with_rays(0, z), with_rays(1, y));
    Extent { z_min_mm, z_max_mm, y_min_mm, y_max_mm }
}

/// The map from mm in the drawing plane to px on the page.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    /// Shown part.
    pub extent: Extent,
    /// Scale of both axes.
    pub px_per_mm: f64,
}

impl View {
    /// The largest view that fits a page of a size, px.
    pub fn fitting(extent: Extent, [width, height]: [f64; 2]) -> Self {
        let across = (width - 3.0 * MARGIN_PX) / (extent.z_max_mm - extent.z_min_mm).max(1e-9);
        let upwards = (height - MARGIN_PX - 2.0 * LABELS_PX) / (extent.y_max_mm - extent.y_min_mm).max(1e-9);
        Self { extent, px_per_mm: across.min(upwards) }
    }

    pub fn x(&self, z_mm: f64) -> f64 {
        MARGIN_PX + (z_mm - self.extent.z_min_mm) * self.px_per_mm
    }

    pub fn y(&self, y_mm: f64) -> f64 {
        MARGIN_PX + LABELS_PX + (self.extent.y_max_mm - y_mm) * self.px_per_mm
    }

    pub fn width(&self) -> f64 {
        self.x(self.extent.z_max_mm) + 2.0 * MARGIN_PX
    }

    /// Lower edge of the drawing with its labels.
    pub fn bottom(&self) -> f64 {
        self.y(self.extent.y_min_mm) + LABELS_PX
    }

    /// A point (z, y).
    pub fn at(&self, [z, y]: [f64; 2]) -> [f64; 2] {
        [self.x(z), self.y(y)]
    }

    /// A line through points (z, y).
    pub fn path(&self, points: &[[f64; 2]], closed: bool) -> String {
        let mut d = String::new();
        for (i, point) in points.iter().enumerate() {
            let [x, y] = self.at(*point);
            d += &format!("{}{} {}", if i == 0 { 'M' } else { 'L' }, px(x), px(y));
        }
        if closed {
            d.push('Z');
        }
        d
    }
}
