//! Apertures off the vertex of their surface.

use petzval_optics::glass::Glass;
use petzval_optics::lens::{Lens, Placement, Surface};
use petzval_optics::paraxial::first_order;

use super::field::Fields;
use super::item::{Clear, Drafted, Offset, Places};
use crate::loss::{Effect, Losses};

/// Treats the apertures that stand off the vertex of their surface. Returns the lens and its surfaces.
///
/// Clear semi-diameters are about the vertex, so the circle that encloses an aperture takes its place. On the stop that would let light through
/// where the aperture cuts the beam: there a shifted plane of its size, right in front of the stop, clips the beam instead. The plane needs a lens
/// whose fields lie in the y-z plane, and a stop that is not shifted itself.
pub(super) fn with_planes(
    mut lens: Lens,
    mut drafted: Vec<Drafted>,
    fields: &Fields,
    losses: &mut Losses,
) -> (Lens, Vec<Drafted>) {
    let beam_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm.abs();
    let in_plane = fields.points.iter().all(|[x, _]| *x == 0.0);
    let stop = lens.stop;
    for i in (0..drafted.len()).rev() {
        let Some(Offset { at_mm, radius_mm, record }) = drafted[i].offset.take() else { continue };
        let is_cut = radius_mm - at_mm[0].hypot(at_mm[1]) < beam_mm;
        if i != stop || !is_cut || !in_plane || drafted[i].surface.placement.is_some() {
            let message = "the aperture is off the vertex; a circle about the vertex encloses it";
            record.lose(losses, Effect::Approximated, message);
            continue;
        }
        let message =
            "the aperture of the stop is off the vertex; a shifted plane in front of the stop clips the beam";
        record.lose(losses, Effect::Approximated, message);
        let surface = Surface {
            label: "aperture of the stop".to_owned(),
            glass: i.checked_sub(1).map_or_else(Glass::air, |before| drafted[before].surface.glass.clone()),
            placement: Some(Placement { decenter_mm: at_mm, ..Placement::default() }),
            ..Surface::default()
        };
        drafted[i].clear = Clear::Open(0.0);
        lens.surfaces.insert(i, surface.clone());
        lens.stop += 1;
        let (clear, places) = (Clear::Edge(radius_mm), Places::default());
        drafted.insert(i, Drafted { surface, clear, record, places, offset: None });
    }
    (lens, drafted)
}
