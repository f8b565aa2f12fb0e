//! The pupil: where rays pass the stop, and what a beam that fills it does.

mod basis;
mod beam;
mod dense;
mod linear;
mod map;
mod polynomial;
mod quadrature;
mod samples;

pub(crate) use basis::PupilBasis;
pub use basis::PupilSampling;
pub use beam::{
    Beam, BeamCotangent, ChiefRay, chief_ray, field_imaged_at, paraxial_launch, pull_back_chief, trace_beam,
};
pub(crate) use dense::{DenseCotangent, DenseMap, Points, PointsCotangent, PupilRows};
pub(crate) use map::PupilMap;
pub(crate) use polynomial::Sides;
pub use quadrature::{Quadrature, QuadratureError};
pub(crate) use samples::{PupilSamples, SamplesCotangent};
