//! The pupil: rays through points of the stop, and the beam that fills it.

mod aim;
mod basis;
mod beam;
mod dense;
mod image_area;
mod launch;
mod linear;
mod lost;
mod map;
mod polynomial;
mod quadrature;
mod refine;
mod samples;

pub use aim::{aim_at_pupil, aim_one};
pub use basis::PupilSampling;
pub(crate) use basis::{PupilBasis, check_points};
pub use beam::{
    Beam, BeamCotangent, BeamTangent, ChiefRay, chief_ray, field_imaged_at, pull_back_chief, trace_beam,
};
pub(crate) use dense::{DenseCotangent, DenseMap, DenseTangent, Points, PointsCotangent, PupilRows};
pub use image_area::ImageArea;
pub(crate) use launch::launch_radius_mm;
pub use launch::paraxial_launch;
pub use lost::{LostRay, RayLoss, where_lost};
pub(crate) use map::PupilMap;
pub(crate) use polynomial::{PupilPolynomial, Sides, Symmetry};
pub use quadrature::{Quadrature, QuadratureError};
pub(crate) use refine::refine;
pub use refine::{PupilRefinement, Refined};
pub(crate) use samples::{PupilSamples, SamplesCotangent, optical_paths};
