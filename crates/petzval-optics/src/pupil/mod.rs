//! The pupil: where rays pass the stop, and what a beam that fills it does.

mod beam;
mod flux;
mod quadrature;

pub use beam::{
    Beam, BeamCotangent, ChiefRay, chief_ray, field_imaged_at, paraxial_launch, pull_back_chief, trace_beam,
};
pub use quadrature::{Quadrature, QuadratureError};
