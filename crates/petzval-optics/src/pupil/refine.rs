//! The number of cells of a pupil grid, from a measured error.
//!
//! With v(N) the value on N x N cells and d(N) = |v(N) - v(2N)|, the error of v(2N) is at most the sum of the later
//! differences. If each doubling at least halves the error (a grid of cells is of second order, where smooth beams quarter
//! it), then `|v(2N) - v| <= d(N)` and `|v(N) - v| <= 2 d(N)`.

use super::quadrature::Quadrature;

/// The accuracy that is wanted of a pupil grid, and the numbers of cells that are tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PupilRefinement {
    /// Largest error, as a share of the value.
    pub tolerance: f64,
    /// Cells a side to start with: even, 12 to 4096.
    pub first_cells: usize,
    /// Largest number of cells a side, at most 4096. It is not exceeded.
    pub most_cells: usize,
}

impl Default for PupilRefinement {
    /// One per cent, from 64 cells to 2048.
    fn default() -> Self {
        Self { tolerance: 0.01, first_cells: 64, most_cells: 2048 }
    }
}

/// A value on the grid of cells that was chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Refined<T> {
    /// The value.
    pub value: T,
    /// Cells a side.
    pub cells: usize,
    /// Estimated error, as a share of the value; infinite if a single grid was allowed.
    pub error: f64,
    /// Whether the error is within the tolerance; if not, the largest number of cells was reached.
    pub is_converged: bool,
}

/// Doubles the number of cells until `difference` between the values of successive grids implies an error within the
/// tolerance, and returns the value on the coarsest grid that has it. `None` if the first number of cells is not possible
/// or `value` is `None` on a grid.
pub(crate) fn refine<T>(
    refinement: &PupilRefinement,
    mut value: impl FnMut(&Quadrature) -> Option<T>,
    difference: impl Fn(&T, &T) -> f64,
) -> Option<Refined<T>> {
    let mut cells = refinement.first_cells;
    let mut coarse = value(&Quadrature::grid(cells).ok()?)?;
    let mut error = f64::INFINITY;
    while 2 * cells <= refinement.most_cells {
        let Ok(quadrature) = Quadrature::grid(2 * cells) else { break };
        let fine = value(&quadrature)?;
        let apart = difference(&coarse, &fine);
        if 2.0 * apart <= refinement.tolerance {
            return Some(Refined { value: coarse, cells, error: 2.0 * apart, is_converged: true });
        }
        (coarse, cells, error) = (fine, 2 * cells, apart);
        if error <= refinement.tolerance {
            break;
        }
    }
    Some(Refined { value: coarse, cells, error, is_converged: error <= refinement.tolerance })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A value with an error of first order, the least order for which the rule holds.
    fn first_order(quadrature: &Quadrature) -> Option<f64> {
        Some(1.0 + 3.0 / quadrature.cells as f64)
    }

    #[test]
    fn the_error_bounds_that_of_the_value() {
        for tolerance in [0.1, 0.03, 0.011] {
            let wanted = PupilRefinement { tolerance, first_cells: 16, most_cells: 1024 };
            let found = refine(&wanted, first_order, |a, b| (a - b).abs()).unwrap();
            assert!(found.is_converged && found.error <= tolerance);
            assert!((found.value - 1.0).abs() <= found.error + 1e-12);
            // Half as many cells would not do.
            assert!(found.cells == 16 || 6.0 / found.cells as f64 > tolerance, "{found:?}");
        }
    }

    #[test]
    fn without_convergence_the_finest_grid_and_its_error_are_returned() {
        let wanted = PupilRefinement { tolerance: 1e-3, first_cells: 16, most_cells: 100 };
        let found = refine(&wanted, first_order, |a, b| (a - b).abs()).unwrap();
        assert_eq!((found.cells, found.is_converged), (64, false));
        assert!((found.error - 3.0 / 64.0).abs() < 1e-12);
        let single = PupilRefinement { most_cells: 16, ..wanted };
        let found = refine(&single, first_order, |a, b| (a - b).abs()).unwrap();
        assert_eq!((found.cells, found.is_converged, found.error), (16, false, f64::INFINITY));
        let impossible = PupilRefinement { first_cells: 7, ..wanted };
        assert!(refine(&impossible, first_order, |a, b| (a - b).abs()).is_none());
    }
}
