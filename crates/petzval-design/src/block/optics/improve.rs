//! A lens that is improved alone, for its spots or for the restoration of its frames, without pictures.

use std::collections::BTreeMap;

use petzval_base::Cancel;
use petzval_optics::design_space::{AtBound, Focus};
use petzval_optics::lens::Lens;
use petzval_optics::merit::SpotResiduals;
use petzval_optics::optimize::{
    Analysis, Apertures, Descent, LevenbergOptions, Problem, SOFT_UM_PER_MM, Search, SearchOptions, descend,
    descend_softly,
};
use petzval_optics::pupil::PupilSampling;

use super::{OpticsBlock, PENALTY};
use crate::error::{DesignError, Result};
use crate::experiment::{LensGoal, LensSearch};

/// The cost of a violated requirement, um per mm: so stiff that the requirements are kept to 1e-6 mm.
const STIFFNESS_UM_PER_MM: f64 = 1e4;

/// The share of the merit, squared, below which another descent takes the place of the usual one: half a percent of the spot.
const WORTH_IT: f64 = 0.99;

/// A gain from which on a lens has moved, as a share.
const GAIN: f64 = 1e-6;

/// A requirement counts as violated from here, mm.
const KEPT_MM: f64 = 1e-4;

/// Gain of an iteration from which on a lens is not improved further, as a share. An error after restoration costs seconds, and its last
/// thousandth does not show in a picture.
fn tolerance(goal: LensGoal) -> f64 {
    match goal {
        LensGoal::Spot => LevenbergOptions::default().tolerance,
        LensGoal::Restored => 1e-4,
    }
}

impl OpticsBlock {
    /// Makes the spots, or the error after restoration, as small as the requirements allow, by Levenberg and Marquardt's method from the
    /// lens as it stands or from the best that a search finds. `watch` sees the losses after every round and before every iteration; those at
    /// the end are returned. With `stop` set it ends before the next iteration or round, with [`DesignError::Stopped`] and the lens as it was.
    ///
    /// The result is never worse than the lens at the start, with what violated requirements cost.
    pub fn improve(
        &mut self,
        goal: LensGoal,
        iterations: usize,
        search: LensSearch,
        watch: &mut dyn FnMut(BTreeMap<String, f64>) -> Result<()>,
        stop: &Cancel,
    ) -> Result<BTreeMap<String, f64>> {
        let goes_on = || !stop.is_set();
        let check = || stop.check().map_err(DesignError::from);
        let watch = &mut |losses: BTreeMap<String, f64>| check().and_then(|()| watch(losses));
        let start = self.lens()?;
        let lens = match search.rounds {
            0 => start.clone(),
            _ => self.searched(goal, start.clone(), search, watch)?,
        };
        let problem = |lens: Lens| self.start.problem(goal, lens, STIFFNESS_UM_PER_MM);
        let options =
            LevenbergOptions { iterations, tolerance: tolerance(goal), ..LevenbergOptions::default() };
        let mut seen = Ok(());
        let mut best = descend_softly(&problem(lens.clone()), &options, &mut |_, analysis, _| {
            seen = watch(lens_losses(analysis));
            seen.is_ok()
        })?;
        seen?;
        // Spots cost little: the stiff penalty alone leads further from some lenses.
        if goal == LensGoal::Spot {
            let other = descend(&problem(lens.clone()), &options, &mut |_, _, _| goes_on())?;
            for other in std::iter::once(other).chain(as_exactly(&problem(lens), &options, &goes_on)) {
                if other.best.merit < WORTH_IT * best.best.merit {
                    best = other;
                }
            }
        }
        check()?;
        self.earlier.push(self.x.clone());
        let as_it_is = LevenbergOptions { iterations: 0, ..options };
        let begun = descend(&problem(start), &as_it_is, &mut |_, _, _| true)?;
        let gain = 1.0 - (best.best.merit / begun.best.merit).sqrt();
        let corner = self.start.worse_corner(&begun.best.lens, &best.best.lens);
        let darker = self.start.darker_corner(&begun.best.lens, &best.best.lens);
        if gain <= 0.0 {
            best = begun;
        } else {
            self.x = self.start.space.free(&best.at);
        }
        self.remarks = self.remarks_on(&best, gain);
        self.remarks.extend(corner.filter(|_| goal == LensGoal::Spot && gain > 0.0));
        self.remarks.extend(darker.filter(|_| gain > 0.0));
        Ok(lens_losses(&best.best))
    }

    /// The remarks on a descent that gained this share of the root of its merit.
    fn remarks_on(&self, descent: &Descent, gain: f64) -> Vec<String> {
        let mut remarks = Vec::new();
        if gain < GAIN {
            remarks.push("the lens ends where it began: no step makes it better".to_owned());
        }
        let broken = descent.best.violations.iter().filter(|(_, mm)| *mm > KEPT_MM);
        let broken: Vec<String> = broken.map(|(what, mm)| format!("{what}, by {mm:.4} mm")).collect();
        if !broken.is_empty() {
            remarks.push(format!("not kept: {}", broken.join("; ")));
        }
        let held = descent.best.violations.iter().filter(|(_, mm)| *mm <= KEPT_MM);
        let held: Vec<String> = held.map(|(what, _)| what.to_string()).collect();
        if !held.is_empty() {
            remarks.push(format!("at its limit: {}", held.join(", ")));
        }
        let bounds = self.start.space.space().at_bounds(&descent.at);
        if !bounds.is_empty() {
            let bounds: Vec<String> = bounds.iter().map(AtBound::to_string).collect();
            remarks.push(format!("on a bound: {}", bounds.join(", ")));
        }
        remarks
    }

    /// The best lens of a global search within the bounds, `lens` among them.
    fn searched(
        &self,
        goal: LensGoal,
        lens: Lens,
        LensSearch { rounds, seed }: LensSearch,
        watch: &mut dyn FnMut(BTreeMap<String, f64>) -> Result<()>,
    ) -> Result<Lens> {
        let problem = self.start.problem(goal, lens.clone(), SOFT_UM_PER_MM);
        let mut search = Search::new(&problem, SearchOptions { seed, ..SearchOptions::default() })?;
        for _ in 0..rounds {
            search.advance();
            if let Some(best) = search.best() {
                watch(lens_losses(&best.analysis))?;
            }
        }
        Ok(search.best().map_or(lens, |best| best.analysis.lens.clone()))
    }
}

/// Descents as `lens optimize` makes them, with a free image plane and clear radii as the beams need them, and from the end of each one of the
/// problem as it is.
fn as_exactly(problem: &Problem, options: &LevenbergOptions, goes_on: &dyn Fn() -> bool) -> Vec<Descent> {
    let merit = SpotResiduals { sampling: PupilSampling::Degree(6), ..problem.merit.clone() };
    let (apertures, focus) = (Apertures::Fitted, Focus::Free);
    let free = Problem { merit, apertures, focus, ..problem.clone() };
    let ends = [descend, descend_softly].map(|way| way(&free, options, &mut |_, _, _| goes_on()));
    let as_it_is = |end: Descent| {
        let problem = Problem { base: end.best.lens, ..problem.clone() };
        descend(&problem, options, &mut |_, _, _| goes_on()).ok()
    };
    ends.into_iter().flatten().filter_map(as_it_is).collect()
}

/// The root of the mean square spot over the fields, the error after restoration if that is the goal, and the sum of squared violations of the
/// requirements.
fn lens_losses(analysis: &Analysis) -> BTreeMap<String, f64> {
    let squares: f64 = analysis.rms_um.iter().map(|rms| rms * rms).sum();
    let penalty_mm2 = analysis.violations.iter().fold(0.0, |sum, (_, mm)| sum + mm * mm);
    let restored = analysis.goals.first().map(|percent| ("restored_error_percent".to_owned(), *percent));
    let spot = ("rms_spot_um".to_owned(), (squares / analysis.rms_um.len() as f64).sqrt());
    [spot, (PENALTY.to_owned(), penalty_mm2)].into_iter().chain(restored).collect()
}
