//! How far a lens violates a constraint, as a merit.

use super::{Better, Merit};
use crate::constraint::{Constraint, penalty};
use crate::gradient::LensGradient;
use crate::lens::Lens;

/// By how much a constraint is violated, mm; 0 where it is kept. Edges are measured at the clear semi-diameters of the lens.
#[derive(Clone, Debug)]
pub struct Violation(pub Constraint);

impl Merit for Violation {
    fn name(&self) -> String {
        self.0.to_string()
    }

    fn unit(&self) -> &str {
        "mm"
    }

    fn better(&self) -> Better {
        Better::Lower
    }

    fn bound(&self) -> Option<&Constraint> {
        Some(&self.0)
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        penalty(std::slice::from_ref(&self.0), lens).map(|(square, _)| square.sqrt())
    }

    fn with_gradient(&self, lens: &Lens) -> Option<(f64, Option<LensGradient>)> {
        let (square, by_square) = penalty(std::slice::from_ref(&self.0), lens)?;
        let violation = square.sqrt();
        // d sqrt(q) = dq / (2 sqrt(q)); a constraint that is kept has no slope.
        let per = if violation > 0.0 { 0.5 / violation } else { 0.0 };
        Some((violation, Some(by_square.scaled(per))))
    }
}
