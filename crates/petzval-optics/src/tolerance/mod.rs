//! Tolerances: the effect of manufacturing errors on a lens, and the accuracy that it needs.
//!
//! A [`Freedom`] is a quantity of a surface or of an element that may deviate from the drawing. A [`Perturbation`] states its range and
//! distribution. A compensator is a freedom that is adjusted on every lens, as the focus is. A [`Study`] holds them with the lens and a
//! [`Merit`](crate::merit::Merit), any scalar of a lens. It gives
//!
//! - [`sensitivities`]: the merit at plus and minus each tolerance, its derivative, and the estimated merit of the lens as built;
//! - [`monte_carlo`]: the merit of lenses made at random, with its percentiles and the yield;
//! - [`inverse`]: the tolerances that share an allowed loss evenly.
//!
//! The stop is a piece of metal: it keeps its diameter, and the entrance pupil follows from it.
//!
//! A lens whose parts would run into each other [cannot be built](Failure): it counts as failed, as one without an image does.
//!
//! # First and second order
//!
//! Errors that keep the symmetry of a lens (radii, thicknesses, indices) change the merit to first order. Its spread is
//! `sqrt(sum (g_i sigma_i)^2)` as long as the perturbations are small. Decentres and tilts of a rotationally symmetric lens have no first
//! order, if fields on both sides of the axis count. Their effect is of second order, and only evaluations at plus and minus the tolerance
//! show it. [`Estimate`] has both.

mod compensator;
mod freedom;
mod grade;
mod inverse;
mod made;
mod monte_carlo;
mod motion;
mod perturbation;
mod sensitivity;
mod study;

use crate::lens::LensDefect;

pub use freedom::{ARCMIN_PER_RAD, FRINGE_UM, Freedom, Quantity, elements};
pub use grade::{Grade, default_tolerances};
pub use inverse::{Shared, inverse};
pub use monte_carlo::{MonteCarlo, PERCENTILES, Trial, monte_carlo, trial};
pub use motion::{RigidMotion, moved_rigidly};
pub use perturbation::{Distribution, Perturbation, draw};
pub use sensitivity::{Estimate, Sensitivities, Sensitivity, sensitivities};
pub use study::{Made, Study, Tolerances};

/// Why a lens with errors counts as failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// Some field brings no light to the image.
    #[error("this lens brings no image")]
    NoImage,
    /// Its parts do not fit together.
    #[error("this lens cannot be built: {0}")]
    CannotBeBuilt(LensDefect),
}

/// Tolerances that a lens cannot have. Surfaces are counted from 1.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say what the fields are")]
pub enum ToleranceError {
    #[error("surface {surface} does not exist: the lens has {count} surfaces")]
    NoSuchSurface { surface: usize, count: usize },
    #[error("surface {surface} has no {what}")]
    NoSuchNumber { surface: usize, what: &'static str },
    #[error("a form error has an even order from 2 to 16, not {order}")]
    NoSuchOrder { order: usize },
    #[error("{what}: a group of surfaces can only be moved, this is a quantity of one surface")]
    NotOfAGroup { what: String },
    #[error(
        "surface {surface} leads the axis elsewhere: all that follows would move with it, and it has no place of its own"
    )]
    AxisMoves { surface: usize },
    #[error("{what}: the tolerance {tolerance} is no positive number")]
    NotPositive { what: String, tolerance: f64 },
    #[error(
        "the merit of the nominal lens is not to be had: some field brings no light to the image or, by diffraction, its wavefront is \
         too rough or rays of the stop are lost"
    )]
    NoMerit,
}
