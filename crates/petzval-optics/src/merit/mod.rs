//! Merits: scalars that a lens is judged by, with their gradients where they have them.
//!
//! Spots ([`RmsSpot`], and by residuals [`SpotResiduals`]), contrast ([`Mtf`]) and wavefronts ([`RmsWavefront`]) are merits alike; a task loss
//! implements [`Merit`].

mod fields;
mod lifted;
mod mtf;
mod residuals;
mod spot;
mod violation;
mod wavefront;

use fields::FieldRays;
pub use fields::FieldSet;
pub use lifted::{Seen, lifted_normal_equations};
pub use mtf::Mtf;
pub use residuals::SpotResiduals;
pub(crate) use residuals::{Beams, Landings, Lost, MOUNT_MM, Reach};
pub use spot::RmsSpot;
pub use violation::Violation;
pub use wavefront::RmsWavefront;

use nalgebra::DMatrix;

use crate::constraint::Constraint;
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::number::Number;

/// Which way a merit is good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// The less, the better, and never below zero: a spot, a loss.
    Lower,
    /// The more, the better: contrast, a score.
    Higher,
}

impl Better {
    /// The cost of a value. If low values are better it is the square, because sums of squares are nearly quadratic in small errors. If
    /// high values are better it is the negative.
    pub(crate) fn cost(self, value: f64) -> f64 {
        match self {
            Self::Lower => value * value,
            Self::Higher => -value,
        }
    }

    /// Derivative of the cost by the value.
    pub(crate) fn slope(self, value: f64) -> f64 {
        match self {
            Self::Lower => 2.0 * value,
            Self::Higher => -1.0,
        }
    }

    /// Whether a value is at least as good as another.
    pub fn meets(self, value: f64, limit: f64) -> bool {
        match self {
            Self::Lower => value <= limit,
            Self::Higher => value >= limit,
        }
    }

    /// How much worse a value is than another, negative where it is better.
    pub fn loss(self, value: f64, than: f64) -> f64 {
        match self {
            Self::Lower => value - than,
            Self::Higher => than - value,
        }
    }
}

/// A scalar that a lens is judged by.
pub trait Merit: Send + Sync {
    /// What it is called in tables and on axes.
    fn name(&self) -> String;

    /// Its unit; empty for a plain number.
    fn unit(&self) -> &str;

    /// Which way it is good.
    fn better(&self) -> Better;

    /// Its value; `None` if the lens has none, because rays are lost.
    fn value(&self, lens: &Lens) -> Option<f64>;

    /// Its value and, if it has one, its gradient by every number of the lens. The gradient by decentres and tilts is that of the
    /// surfaces that have a placement.
    fn with_gradient(&self, lens: &Lens) -> Option<(f64, Option<LensGradient>)> {
        self.value(lens).map(|value| (value, None))
    }

    /// The fields, rad, and their shares, if it sees a lens by where the rays of these fields land about their centroids; `None` if it sees
    /// something else. These rays lend their curvature to a merit that is a single figure: by [`lifted_normal_equations`] where high values are
    /// better, and by their spot, scaled to the size of the figure, where low values are.
    fn fields_of_rays(&self, _lens: &Lens) -> Option<Vec<(f64, f64)>> {
        None
    }

    /// The constraint whose violation it is; `None` of other figures.
    fn bound(&self) -> Option<&Constraint> {
        None
    }

    /// The normal equations of its residuals r, whose squares add up to the squared value: the products of the columns
    /// `dr/d(number)` of each of the numbers, `dr/d(ln stop radius)` and `r`, in this order. `None` if it has no residuals, or the
    /// lens has no value.
    fn normal_equations(&self, _lens: &Lens, _numbers: &[(usize, Number)]) -> Option<DMatrix<f64>> {
        None
    }
}
