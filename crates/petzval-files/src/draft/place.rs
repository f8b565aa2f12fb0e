//! Converts coordinate breaks: a break that belongs to a surface becomes its placement, any other becomes a plane without
//! effect on light.
//!
//! A break moves the axis by a shift and rotations about x, y and z as in [`Placement`], or in the reverse order: rotations
//! about z, y and x, then the shift. The reverse order with all numbers negated undoes a break of the first kind.

use std::sync::Arc;

use super::item::{Break, Clear, Drafted, Item, Places};
use super::record::Record;
use petzval_base::FileError;
use petzval_optics::glass::Glass;
use petzval_optics::lens::{Action, Axis, Placement, Surface};

impl Break {
    fn moves_nothing(&self) -> bool {
        self.decenter_mm == [0.0; 2] && self.tilt_rad == [0.0; 3]
    }

    /// Whether the order of shift and rotations makes no difference: it is a shift alone, or one rotation.
    fn has_no_order(&self) -> bool {
        let shifts = self.decenter_mm != [0.0; 2];
        let turns = self.tilt_rad.iter().filter(|t| **t != 0.0).count();
        turns == 0 || (turns == 1 && !shifts)
    }

    /// Whether shift and rotations have the order of a placement.
    fn is_placement(&self) -> bool {
        !self.tilt_first || self.has_no_order()
    }

    fn placement(&self) -> Placement {
        Placement { decenter_mm: self.decenter_mm, tilt_rad: self.tilt_rad, axis: Axis::Follows }
    }
}

/// Whether a break returns the axis to its position before a placement.
fn undoes(b: &Break, placed: &Placement) -> bool {
    (b.tilt_first || b.has_no_order())
        && b.decenter_mm == placed.decenter_mm.map(|v| -v)
        && b.tilt_rad == placed.tilt_rad.map(|v| -v)
}

/// Shift and rotations of the break, in reverse order, that returns the axis to its position before a placement.
pub(crate) fn undone(placed: &Placement) -> ([f64; 2], [f64; 3]) {
    (placed.decenter_mm.map(|v| 0.0 - v), placed.tilt_rad.map(|v| 0.0 - v))
}

/// Whether a break rotates the axis behind a mirror as the mirror reflects light: rotations `(x, y, -z)` in reverse order.
///
/// With the mirror's rotation R and D = diag(-1, -1, 1), the axis behind the mirror is rotated by `D R^T D` relative to it.
fn bends(b: &Break, placed: &Placement) -> bool {
    let [x, y, z] = placed.tilt_rad;
    b.decenter_mm == [0.0; 2] && b.tilt_rad == [x, y, -z] && (b.tilt_first || b.has_no_order())
}

/// Whether a bend of the axis at a mirror can be written with one angle: a single rotation about x or y.
pub(crate) fn is_bend(placed: &Placement) -> bool {
    let [x, y, z] = placed.tilt_rad;
    placed.axis == Axis::Bends && z == 0.0 && (x == 0.0 || y == 0.0)
}

/// Converts items to surfaces with placements and media; also returns the index of the stop among them.
pub(super) fn lower(items: Vec<Item>, stop_item: usize) -> Result<(Vec<Drafted>, usize), FileError> {
    let mut surfaces: Vec<Drafted> = Vec::with_capacity(items.len());
    let mut stop = None;
    let mut rest = items.into_iter().enumerate().peekable();
    while let Some((index, item)) = rest.next() {
        let mut drafted = match item {
            Item::Surface(drafted) => *drafted,
            Item::Break(b) => {
                // Give the break to the next surface if it can be its placement, else make planes of it.
                check_angles(&b.tilt_rad, &b.record)?;
                if index == stop_item {
                    return Err(b.record.error("a coordinate break cannot be the aperture stop"));
                }
                let taken = rest.next_if(|(_, next)| {
                    let free = |d: &Drafted| d.surface.placement.is_none();
                    b.is_placement()
                        && b.thickness_mm == 0.0
                        && matches!(next, Item::Surface(drafted) if free(drafted))
                });
                match taken {
                    Some((next, Item::Surface(mut drafted))) => {
                        if next == stop_item {
                            stop = Some(surfaces.len());
                        }
                        drafted.surface.placement = (!b.moves_nothing()).then(|| b.placement());
                        *drafted
                    }
                    _ => {
                        let front = surfaces.last().map_or_else(Glass::air, |d| d.surface.glass.clone());
                        surfaces.extend(dummies(&b, &front));
                        continue;
                    }
                }
            }
        };
        if index == stop_item {
            stop = Some(surfaces.len());
        }
        if let Some(placed) = &drafted.surface.placement {
            check_angles(&placed.tilt_rad, &drafted.record)?;
        }
        // A second break at the same vertex belongs to the surface if it returns the axis, or bends it at a mirror.
        let placement = drafted.surface.placement;
        if let Some(mut placed) = placement.filter(|p| p.axis == Axis::Follows)
            && drafted.surface.thickness_mm == 0.0
        {
            let mirror = drafted.surface.action == Action::Reflect;
            let belongs = |item: &Item| match item {
                Item::Break(b) => undoes(b, &placed) || (mirror && bends(b, &placed)),
                Item::Surface(_) => false,
            };
            if let Some((second, Item::Break(b))) = rest.next_if(|(_, item)| belongs(item)) {
                if second == stop_item {
                    return Err(b.record.error("a coordinate break cannot be the aperture stop"));
                }
                placed.axis = if undoes(&b, &placed) { Axis::Returns } else { Axis::Bends };
                drafted.surface.thickness_mm = b.thickness_mm;
                drafted.surface.placement = Some(placed);
                drafted.places.thickness = b.thickness_at.or(Some(b.record));
            }
        }
        push(&mut surfaces, drafted);
    }
    let stop = stop.ok_or_else(|| Record::default().error("no surface is the aperture stop"))?;
    Ok((surfaces, stop))
}

/// Adds a surface. The medium behind a mirror is the one in front of it.
fn push(surfaces: &mut Vec<Drafted>, mut drafted: Drafted) {
    if drafted.surface.action == Action::Reflect {
        drafted.surface.glass = surfaces.last().map_or_else(Glass::air, |d| d.surface.glass.clone());
    }
    surfaces.push(drafted);
}

/// Planes in the medium in front that only move the axis.
fn dummies(b: &Break, front: &Arc<Glass>) -> Vec<Drafted> {
    let mut moves: Vec<Placement> = Vec::new();
    if b.moves_nothing() {
        moves.push(Placement { axis: Axis::Returns, ..Placement::default() });
    } else if b.is_placement() {
        moves.push(b.placement());
    } else {
        let [x, y, z] = b.tilt_rad;
        for tilt_rad in [[0.0, 0.0, z], [0.0, y, 0.0], [x, 0.0, 0.0]] {
            if tilt_rad != [0.0; 3] {
                moves.push(Placement { tilt_rad, axis: Axis::Follows, ..Placement::default() });
            }
        }
        if b.decenter_mm != [0.0; 2] {
            moves.push(Placement { decenter_mm: b.decenter_mm, axis: Axis::Follows, ..Placement::default() });
        }
    }
    let last = moves.len() - 1;
    let dummy = |(i, placement): (usize, Placement)| Drafted {
        surface: Surface {
            thickness_mm: if i == last { b.thickness_mm } else { 0.0 },
            placement: (placement.axis == Axis::Follows).then_some(placement),
            glass: front.clone(),
            ..Surface::default()
        },
        clear: Clear::Open(0.0),
        record: b.record.clone(),
        places: Places { thickness: b.thickness_at.clone(), ..Places::default() },
        offset: None,
    };
    moves.into_iter().enumerate().map(dummy).collect()
}

/// Checks that light along the axis meets a rotated surface from the front.
pub(crate) fn check_angles([x, y, _]: &[f64; 3], record: &Record) -> Result<(), FileError> {
    if x.cos() > 1e-6 && y.cos() > 1e-6 {
        Ok(())
    } else {
        let message = "a surface turned by 90 degrees or more is edge-on to light along the axis in front of it, \
                        and cannot be traced";
        Err(record.error(message).hint("it cannot be dropped: without the turn the lens forms another image"))
    }
}
