//! Edges and gaps that the lens at the start keeps: better lenses keep them too.
//!
//! Every limit is a penalty, and requirements that cannot be met together may outweigh those of edges and gaps.

use petzval_optics::constraint::Constraint;
use petzval_optics::lens::Lens;
use petzval_optics::optimize::{Analysis, Descent, Problem};

use super::goal::LEAST_MM;
use super::progress::with_this_lens;

/// An edge or a gap is broken from this far beyond its limit, mm. A penalty ends a little beyond. A tenth of the least limit leaves room between
/// the surfaces of a gap that counts as kept.
const BROKEN_MM: f64 = 0.1 * LEAST_MM;

/// Whether a constraint is one without which a lens cannot be built.
fn is_of_building(what: &Constraint) -> bool {
    matches!(
        what,
        Constraint::Edge { .. }
            | Constraint::Centre { .. }
            | Constraint::Air { .. }
            | Constraint::AirEdge { .. }
            | Constraint::Reach { .. }
    )
}

/// The edges, gaps and shapes that a lens breaks.
fn broken(lens: &Analysis) -> impl Iterator<Item = &Constraint> {
    lens.violations.iter().filter(|(what, mm)| *mm >= BROKEN_MM && is_of_building(what)).map(|(what, _)| what)
}

/// The first edge, gap or shape that a lens breaks and the lens at the start does not. None without a start.
pub(super) fn newly_broken<'a>(start: Option<&Analysis>, lens: &'a Analysis) -> Option<&'a Constraint> {
    let start = start?;
    broken(lens).find(|what| broken(start).all(|own| own != *what))
}

/// A descent that ends at a lens which breaks no edge or gap that the start keeps, and whether it went on beyond that lens. Where its own end
/// breaks one, it ends at `last`, the last lens on its way that breaks none. `None` if there is no such lens.
pub(super) fn ending_kept(
    problem: &Problem,
    start: Option<&Analysis>,
    descent: Descent,
    last: Option<Lens>,
) -> Option<(Descent, bool)> {
    if newly_broken(start, &descent.best).is_none() {
        return Some((descent, false));
    }
    let OnTheWay { best, at, .. } = OnTheWay::as_it_is(problem, last?)?;
    newly_broken(start, &best).is_none().then_some((Descent { best, at, ..descent }, true))
}

/// A lens on the way of a descent.
#[derive(Clone, Debug)]
pub(super) struct OnTheWay {
    /// The lens.
    pub best: Analysis,
    /// Its coordinates.
    pub at: Vec<f64>,
    /// The iteration.
    pub iteration: usize,
}

impl OnTheWay {
    /// A lens of a file or of another problem, measured as it is; `None` if its rays are lost.
    pub fn as_it_is(problem: &Problem, lens: Lens) -> Option<Self> {
        let descent = with_this_lens(problem, lens)?;
        Some(Self { best: descent.best, at: descent.at, iteration: 0 })
    }
}
