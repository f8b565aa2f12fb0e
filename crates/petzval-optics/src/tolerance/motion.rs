//! Rigid motions of surfaces: an element that sits askew in its mount.
//!
//! An element turned by `Q = Rx Ry` about the vertex V of its first surface, and shifted by d, takes a surface with vertex p and
//! rotation R to the vertex `V + d + Q (p - V)` and the rotation `Q R`. What its vertex moves across the axis is its decentre;
//! what it moves along the axis goes into the distances to its neighbours, so that all other surfaces and the image stay.

use crate::lens::{Lens, ObjectDistance, Placement};
use crate::vector::{apply, product};

/// A turn about the vertex of the first surface, then a shift.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidMotion {
    /// Shift along x, y and z, mm.
    pub shift_mm: [f64; 3],
    /// Turns about x and, then turned with it, about y, rad: `Q = Rx Ry`.
    pub tilt_rad: [f64; 2],
}

impl RigidMotion {
    /// The turn about a point on the axis, `from_vertex_mm` behind the vertex of the first surface.
    pub fn about(from_vertex_mm: f64, tilt_rad: [f64; 2]) -> Self {
        let turn = Placement { tilt_rad: [tilt_rad[0], tilt_rad[1], 0.0], ..Placement::default() };
        // c - Q c: what brings the point back to where it was.
        let c = [0.0, 0.0, from_vertex_mm];
        let turned = apply(&turn.rotation(), c);
        Self { shift_mm: [0, 1, 2].map(|k| c[k] - turned[k]), tilt_rad }
    }
}

/// A lens with surfaces `first` to `last` moved as one body; every other surface stays, and so do object and image plane.
///
/// None of these surfaces may lead the axis elsewhere (see [`Axis`](crate::lens::Axis)): what follows it would move along.
pub fn moved_rigidly(lens: &Lens, first: usize, last: usize, motion: &RigidMotion) -> Lens {
    let mut moved = lens.clone();
    let [tilt_x, tilt_y] = motion.tilt_rad;
    let turn = Placement { tilt_rad: [tilt_x, tilt_y, 0.0], ..Placement::default() }.rotation();
    let placement = |s: usize| lens.surfaces[s].placement.unwrap_or_default();
    let pivot = placement(first).decenter_mm;
    // Depth of a nominal vertex behind the first, and what the vertex before moved along the axis.
    let (mut depth, mut along_before) = (0.0, 0.0);
    for s in first..=last {
        let placed = placement(s);
        let [x, y] = placed.decenter_mm;
        let turned = apply(&turn, [x - pivot[0], y - pivot[1], depth]);
        moved.surfaces[s].placement = Some(Placement {
            decenter_mm: [0, 1].map(|k| pivot[k] + motion.shift_mm[k] + turned[k]),
            tilt_rad: Placement::tilts_of(&product(turn, placed.rotation())),
            axis: placed.axis,
        });
        let along = motion.shift_mm[2] + turned[2] - depth;
        if s > 0 {
            moved.surfaces[s - 1].thickness_mm += along - along_before;
        } else {
            move_object(&mut moved, along);
        }
        along_before = along;
        depth += lens.surfaces[s].thickness_mm;
    }
    moved.surfaces[last].thickness_mm -= along_before;
    moved
}

/// Keeps a near object where it is while the first vertex, from which it is counted, moves along the axis.
fn move_object(lens: &mut Lens, along_mm: f64) {
    if let ObjectDistance::Finite(distance) = lens.object
        && along_mm != 0.0
    {
        let now = distance + along_mm;
        lens.object = ObjectDistance::Finite(now);
        // A field is the angle under which its object point is seen from there.
        for field in &mut lens.fields_deg {
            *field = (field.to_radians().tan() * distance / now).atan().to_degrees();
        }
    }
}
