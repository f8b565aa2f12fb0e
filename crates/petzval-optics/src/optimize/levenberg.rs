//! Levenberg and Marquardt's method with bounds.
//!
//! Each Jacobian serves several trial steps: damping values around the last good one are tried, the best is taken, and if
//! none improves the merit, stronger damping is tried on the same Jacobian. Coordinates on a bound that the gradient pushes
//! against are held; a step that leaves the bounds is cut at them.

use nalgebra::{DMatrix, DVector};

use super::analysis::{Analysis, LimitRow, Linearised, analyse, linearise, obstacle};
use super::descent_state::{DescentProgress, DescentState, Stop};
use super::problem::Problem;
use crate::design_space::{DesignSpace, DesignSpaceError, Focus};

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevenbergOptions {
    /// Iterations, each with a new Jacobian.
    pub iterations: usize,
    /// Three iterations in a row that improve the RMS (the root of the merit) by less than this share are the last.
    pub tolerance: f64,
    /// Whether steps follow the curvature of broken limits: each is tried a second time, corrected by how far the first one left the limits.
    /// Without it a descent along a curved limit takes many short steps.
    pub follows_limits: bool,
}

impl Default for LevenbergOptions {
    fn default() -> Self {
        Self { iterations: 200, tolerance: 1e-7, follows_limits: false }
    }
}

/// The result of a descent.
#[derive(Clone, Debug)]
pub struct Descent {
    /// The best lens.
    pub best: Analysis,
    /// Its coordinates: one per variable (a curvature for a radius), then the image distance if it is free.
    pub at: Vec<f64>,
    /// Iterations done.
    pub iterations: usize,
    /// Why it ended.
    pub stop: Stop,
    /// What is needed to go on from there.
    pub state: DescentState,
}

impl Descent {
    fn new(progress: DescentProgress, stop: Stop) -> Self {
        let state = DescentState { stop: (stop != Stop::Interrupted).then_some(stop), ..progress.state() };
        let DescentProgress { best, at, iterations, .. } = progress;
        Self { best, at, iterations, stop, state }
    }
}

/// Iterations of little gain after which a descent ends.
const CALM_ITERATIONS: usize = 3;

/// Damping that is tried beside the last good one, as factors.
const AROUND: [f64; 3] = [0.1, 1.0, 10.0];

/// Stronger damping, when all of these fail.
const STRONGER: [f64; 4] = [1e2, 1e4, 1e6, 1e9];

/// The step of the damped model with these coordinates free; the others do not move.
fn damped_step(model: &Linearised, free: &[usize], damping: f64) -> Option<DVector<f64>> {
    let count = free.len();
    let hessian = DMatrix::from_fn(count, count, |r, c| {
        let value = model.hessian[(free[r], free[c])];
        if r == c { value * (1.0 + damping) + 1e-300 } else { value }
    });
    let gradient = DVector::from_fn(count, |r, _| -model.gradient[free[r]]);
    let step = hessian.cholesky()?.solve(&gradient);
    let mut all = DVector::zeros(model.gradient.len());
    for (i, value) in free.iter().zip(step.iter()) {
        all[*i] = *value;
    }
    all.iter().all(|v| v.is_finite()).then_some(all)
}

/// Where a damped step leads within the bounds: it is cut at them. Coordinates that stand on a bound already and would be
/// pushed through it are held, and the others solved for again.
fn bounded_step(at: &[f64], bounds: &[[f64; 2]], model: &Linearised, damping: f64) -> Option<Vec<f64>> {
    let pushes_out = |i: usize| {
        (at[i] <= bounds[i][0] && model.gradient[i] > 0.0)
            || (at[i] >= bounds[i][1] && model.gradient[i] < 0.0)
    };
    let mut free: Vec<usize> = (0..at.len()).filter(|i| !pushes_out(*i)).collect();
    let mut next = at.to_vec();
    for _ in 0..4 {
        let step = damped_step(model, &free, damping)?;
        let mut crossed = Vec::new();
        for &i in &free {
            let wanted = at[i] + step[i];
            next[i] = wanted.clamp(bounds[i][0], bounds[i][1]);
            if next[i] != wanted && (at[i] == bounds[i][0] || at[i] == bounds[i][1]) {
                crossed.push(i);
            }
        }
        if crossed.is_empty() {
            return Some(next);
        }
        // Held where they are; the rest must make do without them.
        free.retain(|i| !crossed.contains(i));
        for i in crossed {
            next[i] = at[i];
        }
    }
    Some(next)
}

/// As [`bounded_step`], and not through a constraint that the lens keeps: the penalty of each that the step would break is added to the model,
/// and the step solved for again.
fn limited_step(at: &[f64], bounds: &[[f64; 2]], model: &Linearised, damping: f64) -> Option<Vec<f64>> {
    let mut next = bounded_step(at, bounds, model, damping)?;
    let mut stiffer = model.clone();
    while !stiffer.kept.is_empty() {
        let step = DVector::from_fn(at.len(), |i, _| next[i] - at[i]);
        let kept = std::mem::take(&mut stiffer.kept);
        let (broken, kept): (Vec<LimitRow>, Vec<LimitRow>) =
            kept.into_iter().partition(|k| k.after(&step) > 0.0);
        stiffer.kept = kept;
        if broken.is_empty() {
            break;
        }
        broken.iter().for_each(|k| stiffer.add(k.residual_um, &k.row));
        next = bounded_step(at, bounds, &stiffer, damping)?;
    }
    Some(next)
}

/// Goes down from coordinates `start`; `watch` sees every accepted lens and says whether to go on.
pub(super) fn descend_from(
    problem: &Problem,
    space: &DesignSpace,
    start: Vec<f64>,
    options: &LevenbergOptions,
    watch: &mut dyn FnMut(usize, &Analysis, &[f64]) -> bool,
) -> Option<Descent> {
    let best = analyse(problem, space.lens_at(&start).ok()?, None)?;
    let progress = DescentProgress::new(best, start);
    go_down(problem, space, progress, options, &mut |progress| {
        watch(progress.iterations, &progress.best, &progress.at)
    })
}

/// Goes on with a descent; `watch` sees it before every iteration and at the end, and says whether to go on.
fn go_down(
    problem: &Problem,
    space: &DesignSpace,
    mut progress: DescentProgress,
    options: &LevenbergOptions,
    watch: &mut dyn FnMut(&DescentProgress) -> bool,
) -> Option<Descent> {
    while progress.iterations < options.iterations {
        if !watch(&progress) {
            return Some(Descent::new(progress, Stop::Interrupted));
        }
        let DescentProgress { best, at, damping, .. } = &progress;
        let mapped = space.map(at).ok()?;
        let Some(model) = linearise(problem, space, &mapped, best) else {
            return Some(Descent::new(progress, Stop::Stuck));
        };
        let mut found: Option<(Analysis, Vec<f64>, f64)> = None;
        let analysed = |at: &[f64]| analyse(problem, space.lens_at(at).ok()?, Some(best));
        let attempt = |factor: f64, found: &mut Option<(Analysis, Vec<f64>, f64)>| {
            let tried = (damping * factor).clamp(1e-12, 1e12);
            let Some(next) = limited_step(at, space.bounds(), &model, tried) else { return };
            let Some(analysis) = analysed(&next) else { return };
            let follow = || {
                let step = DVector::from_fn(at.len(), |i, _| next[i] - at[i]);
                let bent = model.bent(&step, &analysis, problem.stiffness_um_per_mm);
                let next = limited_step(at, space.bounds(), &bent, tried)?;
                Some((analysed(&next)?, next))
            };
            let followed = if options.follows_limits && !model.broken.is_empty() { follow() } else { None };
            for (analysis, next) in std::iter::once((analysis, next)).chain(followed) {
                let to_beat = found.as_ref().map_or(best.merit, |(a, ..)| a.merit);
                if analysis.merit < to_beat {
                    *found = Some((analysis, next, tried));
                }
            }
        };
        for factor in AROUND {
            attempt(factor, &mut found);
        }
        for factor in STRONGER {
            if found.is_some() {
                break;
            }
            attempt(factor, &mut found);
        }
        let Some((analysis, next, tried)) = found else { return Some(Descent::new(progress, Stop::Stuck)) };
        let gain = 1.0 - (analysis.merit / progress.best.merit).sqrt();
        let calm = if gain < options.tolerance { progress.calm + 1 } else { 0 };
        let iterations = progress.iterations + 1;
        progress = DescentProgress { best: analysis, at: next, iterations, damping: tried, calm };
        if calm == CALM_ITERATIONS {
            watch(&progress);
            return Some(Descent::new(progress, Stop::Converged));
        }
    }
    watch(&progress);
    Some(Descent::new(progress, Stop::Exhausted))
}

/// Goes on from the state of an interrupted descent of the same problem: to the same bits as without interruption. One that ended for want of a
/// better lens stays as it is. `watch` sees the descent before every iteration and at the end, and says whether to go on. Fails if the state is
/// none of this problem.
pub fn descend_on(
    problem: &Problem,
    options: &LevenbergOptions,
    state: &DescentState,
    watch: &mut dyn FnMut(&DescentProgress) -> bool,
) -> Result<Descent, DesignSpaceError> {
    let space = problem.space()?;
    let progress = DescentProgress::restore(problem, &space, state).ok_or(DesignSpaceError::NoRays)?;
    match state.stop {
        Some(stop @ (Stop::Converged | Stop::Stuck)) => Ok(Descent::new(progress, stop)),
        _ => go_down(problem, &space, progress, options, watch).ok_or(DesignSpaceError::NoRays),
    }
}

/// As [`descend`]; `watch` sees all of the descent, and so its state.
pub fn descend_watched(
    problem: &Problem,
    options: &LevenbergOptions,
    watch: &mut dyn FnMut(&DescentProgress) -> bool,
) -> Result<Descent, DesignSpaceError> {
    let once = LevenbergOptions { iterations: 0, ..*options };
    let start = descend(problem, &once, &mut |_, _, _| true)?;
    descend_on(problem, options, &start.state.going_on(), watch)
}

/// Goes down from the problem's own lens, its numbers moved inside their bounds; `watch` sees the lens before every iteration
/// and at the end, with the iteration and the coordinates, and says whether to go on.
pub fn descend(
    problem: &Problem,
    options: &LevenbergOptions,
    watch: &mut dyn FnMut(usize, &Analysis, &[f64]) -> bool,
) -> Result<Descent, DesignSpaceError> {
    let space = problem.space()?;
    let start = own_start(problem, &space)?;
    descend_from(problem, &space, start, options, watch).ok_or(DesignSpaceError::NoRays)
}

/// Stiffness of a soft penalty, um per mm.
pub const SOFT_UM_PER_MM: f64 = 1e2;

/// Goes down along a soft penalty for limits, and from its end along that of the problem, with the iterations of both together. Along a stiff
/// penalty a descent follows a narrow curved valley, and may end in a worse minimum.
pub fn descend_softly(
    problem: &Problem,
    options: &LevenbergOptions,
    watch: &mut dyn FnMut(usize, &Analysis, &[f64]) -> bool,
) -> Result<Descent, DesignSpaceError> {
    let soft = Problem { stiffness_um_per_mm: SOFT_UM_PER_MM, ..problem.clone() };
    descend_by_way_of(&soft, problem, options, watch)
}

/// How far the image plane may stand from the paraxial focus on the way of [`descend_in_focus`], as a share of its distance.
const DEFOCUS: f64 = 0.05;

/// Goes down with the image plane at the paraxial focus and a defocus from there, along the limits that bind, and from the end with the plane of
/// the problem, with the iterations of both together. Where the image distance changes much, a free plane has to follow all other numbers, and
/// keeps their steps within its depth of focus; and a curved limit keeps them within its stiffness.
pub fn descend_in_focus(
    problem: &Problem,
    options: &LevenbergOptions,
    watch: &mut dyn FnMut(usize, &Analysis, &[f64]) -> bool,
) -> Result<Descent, DesignSpaceError> {
    let range_mm = DEFOCUS * problem.base.image_distance_mm().abs();
    let focus = Focus::Paraxial { range_mm };
    let options = LevenbergOptions { follows_limits: true, ..*options };
    descend_by_way_of(&Problem { focus, ..problem.clone() }, problem, &options, watch)
}

/// Goes down by the spots alone, within the limits, and from the end by all that the problem minimises, with the iterations of both together. Far
/// from its best, a figure such as contrast has hardly a slope, or one that leads elsewhere.
pub fn descend_by_spots(
    problem: &Problem,
    options: &LevenbergOptions,
    watch: &mut dyn FnMut(usize, &Analysis, &[f64]) -> bool,
) -> Result<Descent, DesignSpaceError> {
    let by_spots = Problem { spot_weight: 1.0, goals: Vec::new(), ..problem.clone() };
    descend_by_way_of(&by_spots, problem, options, watch)
}

/// Goes down another problem of the same lens first, and from its end down this one, with the iterations of both together.
fn descend_by_way_of(
    way: &Problem,
    problem: &Problem,
    options: &LevenbergOptions,
    watch: &mut dyn FnMut(usize, &Analysis, &[f64]) -> bool,
) -> Result<Descent, DesignSpaceError> {
    // A quarter of the iterations is left for the problem in any case: on the way its limits may not be kept.
    let most = LevenbergOptions { iterations: options.iterations - options.iterations / 4, ..*options };
    let first = descend(way, &most, watch)?;
    if first.stop == Stop::Interrupted {
        return Ok(first);
    }
    let done = first.iterations;
    let left = LevenbergOptions { iterations: options.iterations - done, ..*options };
    let there = Problem { base: first.best.lens, ..problem.clone() };
    let second =
        descend(&there, &left, &mut |iteration, analysis, at| watch(done + iteration, analysis, at))?;
    let iterations = done + second.iterations;
    let state = DescentState { iterations, ..second.state.clone() };
    Ok(Descent { iterations, state, ..second })
}

/// Coordinates of the problem's own lens inside its bounds: with the image plane of its file, or at the paraxial focus where that is better. A
/// solve may have moved the focus far from where the file puts the image plane. The error says what prevents a start there.
pub(super) fn own_start(problem: &Problem, space: &DesignSpace) -> Result<Vec<f64>, DesignSpaceError> {
    let start = space.start();
    let lens = space.lens_at(&start)?;
    let mut refocused = start.clone();
    space.refocus(&mut refocused);
    let merit = |at: &[f64]| Some(analyse(problem, space.lens_at(at).ok()?, None)?.merit);
    match (merit(&start), merit(&refocused)) {
        (Some(as_it_is), Some(then)) if as_it_is <= then => Ok(start),
        (Some(_), None) => Ok(start),
        (_, Some(_)) => Ok(refocused),
        (None, None) => Err(obstacle(problem, &lens)),
    }
}
