//! The adjoint against central differences, for every number of the lens.

#[path = "../common/mod.rs"]
mod common;

mod coordinates;
mod first_order;
mod forward;
mod knobs;
mod psfs;
mod spots;

use common::nominal_triplet;
use petzval_optics::lens::{Lens, ObjectDistance};
use petzval_optics::pupil::Quadrature;
use petzval_optics::spot::spot;

/// The lens with an object 400 mm away and its image plane moved to 26.2 mm.
pub fn near(mut lens: Lens) -> Lens {
    lens.object = ObjectDistance::Finite(400.0);
    lens.with_image_distance(26.2)
}

/// Apertures in front of the stop and behind it cut the beam.
pub fn vignetted() -> (Lens, Vec<f64>) {
    let mut lens = nominal_triplet();
    lens.surfaces[0].semi_diameter_mm = 6.6;
    lens.surfaces[5].semi_diameter_mm = 3.1;
    let fields: Vec<f64> = [14.0_f64.to_radians()].to_vec();
    let spot = spot(&lens, fields[0], &Quadrature::grid(40).unwrap()).unwrap();
    let whole =
        petzval_optics::spot::spot(&nominal_triplet(), fields[0], &Quadrature::grid(40).unwrap()).unwrap();
    assert!(
        spot.illumination[1] < 0.985 * whole.illumination[1],
        "{:?} {:?}",
        spot.illumination,
        whole.illumination
    );
    (lens, fields)
}
