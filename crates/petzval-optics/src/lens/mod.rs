//! The lens: an immutable list of surfaces in the order that light meets them.

mod action;
mod departure;
mod numbers;
mod place;
mod placement;
mod shape;
mod surface;
mod track;
mod validate;

pub use action::{Action, Pattern, Phase};
pub use departure::{Departure, ODD_TERMS, Q_TERMS, XY_DEGREE, XY_TERMS, xy_index, xy_powers};
pub(crate) use place::{Place, places};
pub use placement::{Axis, Placement};
pub use shape::SurfaceShape;
pub use surface::Surface;
pub(crate) use track::pull_back_track;
pub use validate::{LensDefect, traceable, validate};
pub(crate) use validate::{azimuths, reach_mm};

pub use crate::number::ASPHERE_TERMS;

use crate::glass::Glass;

/// Where the object is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectDistance {
    /// Collimated light; a field is the angle of the chief ray to the axis.
    Infinity,
    /// Distance from the object plane to the first vertex, mm; a field is the angle under which the object point is seen from the first vertex.
    /// Negative of a virtual object, to which light converges that meets the lens before.
    Finite(f64),
}

impl ObjectDistance {
    /// Fields are nearer to the axis than this, degrees: 180 from infinity, where light may even come from behind the lens; 90 from an
    /// object plane.
    pub fn field_limit_deg(self) -> f64 {
        match self {
            Self::Infinity => 180.0,
            Self::Finite(_) => 90.0,
        }
    }
}

/// A compound lens. History is a list of lenses: nothing changes one in place.
///
/// The last surface's thickness reaches to the image plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// What it is called in tables and reports.
    pub name: String,
    /// Where its numbers come from.
    pub source: String,
    /// Surfaces and the stop, in the order that light meets them.
    pub surfaces: Vec<Surface>,
    /// Index of the aperture stop in `surfaces`.
    pub stop: usize,
    /// Entrance pupil diameter, mm. The stop's radius follows from it to first order.
    pub entrance_pupil_mm: f64,
    /// Object plane.
    pub object: ObjectDistance,
    /// Wavelengths in which the lens is judged, um, ascending.
    pub wavelengths_um: Vec<f64>,
    /// Wavelength of first-order properties and of the reference chief ray, um.
    pub reference_um: f64,
    /// Fields at which the lens is judged, degrees, ascending.
    pub fields_deg: Vec<f64>,
}

/// Field, as a share of the outermost, up to which the fields of a lens reach the axis.
const NEAR_AXIS: f64 = 0.1;

impl Lens {
    /// Angle between the axis and the outermost field, on either side of it, degrees; 0 without a field off the axis.
    pub fn outermost_field_deg(&self) -> f64 {
        self.fields_deg.iter().fold(0.0, |most, field| field.abs().max(most))
    }

    /// The field that stands for the axis, degrees: figures "on the axis" are those of its beam, and illumination is relative to it.
    ///
    /// It is 0 in a rotationally symmetric lens, and where the fields reach the axis or nearly so. Where all fields of another lens lie on
    /// one side of the axis, as behind a grating, no beam need come from there: then it is the field nearest to the axis.
    pub fn reference_field_deg(&self) -> f64 {
        let nearer = |a: f64, b: &f64| if b.abs() < a.abs() { *b } else { a };
        let nearest = self.fields_deg.iter().fold(f64::INFINITY, nearer);
        let is_one_sided = self.fields_deg.iter().all(|field| field * nearest > 0.0);
        let is_away = nearest.is_finite() && nearest.abs() > NEAR_AXIS * self.outermost_field_deg();
        if is_one_sided && is_away && !self.is_rotationally_symmetric() { nearest } else { 0.0 }
    }

    /// Whether the y-z plane, in which the fields lie, is a plane of symmetry.
    pub fn is_mirror_symmetric(&self) -> bool {
        self.surfaces
            .iter()
            .all(|s| s.shape.is_mirror_symmetric() && s.placement.is_none_or(|p| p.is_mirror_symmetric()))
    }

    /// Whether every surface is rotationally symmetric and on the axis.
    pub fn is_rotationally_symmetric(&self) -> bool {
        self.surfaces.iter().all(|s| {
            let straight = s.placement.is_none_or(|p| p.decenter_mm == [0.0; 2] && p.tilt_rad == [0.0; 3]);
            let lines = s.phase.is_some_and(|p| matches!(p.pattern, Pattern::Grating { .. }));
            s.shape.is_rotationally_symmetric() && straight && !lines
        })
    }

    /// Whether light travels along +z behind a surface: it has met an even number of mirrors.
    pub fn light_goes_forwards(&self, surface: usize) -> bool {
        self.surfaces[..=surface].iter().filter(|s| s.action == Action::Reflect).count().is_multiple_of(2)
    }

    /// Whether the distance behind a surface to the next one leads against the light. [Planes without effect](Lens::is_idle_plane) between the
    /// two do not count: light passes them on a straight line, in whatever order they stand.
    pub fn goes_against_the_light(&self, surface: usize) -> bool {
        // The distance from the last surface with an effect; in front of the first one there is none.
        let Some(from) = (0..=surface).rev().find(|i| !self.is_idle_plane(*i)) else { return false };
        let gap_mm = self.gap_behind_mm(from);
        if self.light_goes_forwards(surface) { gap_mm < 0.0 } else { gap_mm > 0.0 }
    }

    /// Distance from a surface to the next one, or to the image plane, that is not a [plane without effect](Lens::is_idle_plane), mm.
    pub fn gap_behind_mm(&self, surface: usize) -> f64 {
        let idle = (surface + 1..self.surfaces.len()).take_while(|i| self.is_idle_plane(*i));
        self.surfaces[surface].thickness_mm + idle.map(|i| self.surfaces[i].thickness_mm).sum::<f64>()
    }

    /// Whether a surface is a plane that does nothing to light and keeps the direction of the axis: a stop, a dummy to measure from or to clip at, or
    /// a coordinate break that only shifts the axis. It is no thing that glass or mirrors could run into.
    pub fn is_idle_plane(&self, surface: usize) -> bool {
        let s = &self.surfaces[surface];
        s.shape == SurfaceShape::PLANE
            && s.placement.is_none_or(|p| p.axis == Axis::Returns || p.tilt_rad == [0.0; 3])
            && self.is_dummy(surface)
    }

    /// Whether a surface does nothing to light: it lies between equal media, without a mirror, a thin lens or a structure.
    pub fn is_dummy(&self, surface: usize) -> bool {
        let s = &self.surfaces[surface];
        let front = surface.checked_sub(1).map_or_else(Glass::air, |i| self.surfaces[i].glass.clone());
        s.glass == front && s.action == Action::Refract && s.phase.is_none()
    }

    /// The stop, if it stands at the rim of one of its neighbours. Such a stop is a plane without effect on light. A thickness from it or
    /// to it is negative, while its neighbours stand in the order of the light.
    ///
    /// The rim of a curved surface lies in front of its vertex or behind it, and where the rim limits the light, the stop is a plane there.
    /// Rays are traced to that plane first, and from there back along the same straight line to the surface.
    pub fn stop_at_rim(&self) -> Option<usize> {
        let surface = self.surfaces.get(self.stop)?;
        let is_plane = surface.shape == SurfaceShape::PLANE && surface.placement.is_none();
        if !is_plane || !self.is_dummy(self.stop) {
            return None;
        }
        let light = if self.light_goes_forwards(self.stop) { 1.0 } else { -1.0 };
        let behind = light * surface.thickness_mm;
        let is_at_rim = match self.stop.checked_sub(1).map(|i| light * self.surfaces[i].thickness_mm) {
            None => behind < 0.0,
            Some(before) => before.min(behind) < 0.0 && before + behind >= 0.0,
        };
        is_at_rim.then_some(self.stop)
    }

    /// Whether the gap behind a surface begins or ends at a [stop at a rim](Lens::stop_at_rim): it is no gap between two things.
    pub fn is_beside_stop_at_rim(&self, surface: usize) -> bool {
        self.stop_at_rim().is_some_and(|stop| surface == stop || surface + 1 == stop)
    }

    /// Whether the distance behind a surface leads against the light from or to a [plane without effect](Lens::is_idle_plane), while the whole
    /// distance between the two things around it follows the light: it is no gap between two things, and may stay.
    pub fn steps_back_at_idle_plane(&self, surface: usize) -> bool {
        let thickness_mm = self.surfaces[surface].thickness_mm;
        let steps_back =
            if self.light_goes_forwards(surface) { thickness_mm < 0.0 } else { thickness_mm > 0.0 };
        let is_idle = |i: usize| i < self.surfaces.len() && self.is_idle_plane(i);
        steps_back && (is_idle(surface) || is_idle(surface + 1)) && !self.goes_against_the_light(surface)
    }

    /// Distance from the first vertex to the image plane, mm.
    pub fn total_track_mm(&self) -> f64 {
        self.surfaces.iter().map(|s| s.thickness_mm).sum()
    }

    /// Whether mirrors bend the axis, so that distances along z before and behind them do not add.
    pub fn is_folded(&self) -> bool {
        let turns =
            |s: &Surface| s.placement.is_some_and(|p| p.axis != Axis::Returns && p.tilt_rad != [0.0; 3]);
        self.surfaces.iter().any(turns) && self.surfaces.iter().any(|s| s.action == Action::Reflect)
    }

    /// Distance from the last vertex to the image plane, mm.
    pub fn image_distance_mm(&self) -> f64 {
        self.surfaces.last().map_or(0.0, |s| s.thickness_mm)
    }

    /// A distance along z behind the last surface, mm, as counted in the direction of the light: positive away from the lens. Behind an odd number of
    /// mirrors the two have opposite signs.
    pub fn away_from_lens_mm(&self, along_z_mm: f64) -> f64 {
        let forwards = self.surfaces.len().checked_sub(1).is_none_or(|last| self.light_goes_forwards(last));
        // A difference, not a negation: 0 keeps its sign.
        if forwards { along_z_mm } else { 0.0 - along_z_mm }
    }

    /// A copy with another distance from the last vertex to the image plane, mm.
    pub fn with_image_distance(&self, distance_mm: f64) -> Self {
        let mut lens = self.clone();
        if let Some(last) = lens.surfaces.last_mut() {
            last.thickness_mm = distance_mm;
        }
        lens
    }
}
