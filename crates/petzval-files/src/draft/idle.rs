//! Planes without effect, on which programs hang distances that run against the light.

use petzval_optics::glass::Glass;
use petzval_optics::lens::{Action, SurfaceShape};

use super::item::{Clear, Drafted};
use crate::loss::{Effect, Losses};

/// Leaves out planes without effect (between equal media, without edge and placement, not the stop) beside which a distance runs against the
/// light: the distances on both sides of such a plane are one. Other planes stay. Returns the new index of the stop.
///
/// A plane in front of everything goes with its distance where the object is far; `object_mm` is the distance of a near one.
pub(super) fn without_idle_planes(
    drafted: &mut Vec<Drafted>,
    mut stop: usize,
    object_mm: &mut f64,
    losses: &mut Losses,
) -> usize {
    let mut at = 0;
    while at < drafted.len() {
        let idle = [at, at + 1].into_iter().find(|i| is_idle(drafted, *i) && *i != stop);
        let Some(plane) = idle.filter(|_| runs_against_the_light(drafted, at)) else {
            at += 1;
            continue;
        };
        let removed = drafted.remove(plane);
        let along_mm = removed.surface.thickness_mm;
        match plane.checked_sub(1) {
            Some(before) => {
                let front = &mut drafted[before];
                // The longer of the two decides where their sum leads.
                if along_mm.abs() > front.surface.thickness_mm.abs() {
                    front.places.thickness = Some(removed.thickness_at().clone());
                }
                front.surface.thickness_mm += along_mm;
            }
            None => *object_mm += along_mm,
        }
        stop -= usize::from(plane < stop);
        let message = "a plane without effect is left out: a distance beside it runs against the light";
        removed.record.lose(losses, Effect::NoRay, message);
        at = plane.saturating_sub(1);
    }
    stop
}

fn runs_against_the_light(drafted: &[Drafted], surface: usize) -> bool {
    let mirrors = drafted[..=surface].iter().filter(|d| d.surface.action == Action::Reflect).count();
    let thickness_mm = drafted[surface].surface.thickness_mm;
    if mirrors.is_multiple_of(2) { thickness_mm < 0.0 } else { thickness_mm > 0.0 }
}

/// Whether a surface exists and does nothing to light.
fn is_idle(drafted: &[Drafted], index: usize) -> bool {
    let Some(Drafted { surface, clear, .. }) = drafted.get(index) else { return false };
    let front = index.checked_sub(1).map_or_else(Glass::air, |i| drafted[i].surface.glass.clone());
    surface.shape == SurfaceShape::PLANE
        && surface.action == Action::Refract
        && surface.phase.is_none()
        && surface.placement.is_none()
        && surface.glass == front
        && matches!(clear, Clear::Open(_))
}
