//! A part of the lenses that are made at random, by number, and the analysis that parts become together.

use petzval_base::Cancelled;
use petzval_optics::tolerance::{MonteCarlo, Study, Trial};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Request, Response, Subject, analysed};
use crate::context::Context;
use crate::error::JobError;

/// Lenses of these numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// The first, from 0.
    pub from: usize,
    /// The one behind the last, at most `trials`.
    pub to: usize,
}

/// Lenses of a part, with all that an analysis needs of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MadeLenses {
    /// Their numbers.
    pub part: Part,
    /// Merit of each; none without an image.
    pub merits: Vec<Option<f64>>,
    /// Where the compensators of each stand, in their units; empty without an image.
    pub compensators: Vec<Vec<f64>>,
}

impl MadeLenses {
    pub(super) fn of(part: Part, made: &MonteCarlo) -> Self {
        Self {
            part,
            merits: made.trials.iter().map(|trial| trial.value).collect(),
            compensators: made.trials.iter().map(|trial| trial.compensators.clone()).collect(),
        }
    }
}

impl Request {
    /// Fails if the part is none of the lenses, or if the request wants what a part does not have.
    pub(super) fn check_part(&self) -> Result<(), JobError> {
        let Some(Part { from, to }) = self.part else { return Ok(()) };
        if from >= to || to > self.trials {
            let message = format!("must hold lenses between 0 and {}, the trials", self.trials);
            let hint = "0..500 are the first five hundred";
            return Err(JobError::setting("part", format!("{from}..{to}"), message, hint));
        }
        let whole = [("inverse", self.inverse.is_some()), ("out", self.out.is_some())];
        match whole.into_iter().find(|(_, is_given)| *is_given) {
            None => Ok(()),
            Some((flag, _)) => Err(JobError::input(
                format!("lenses {from}..{to} alone have no --{flag}"),
                "it belongs to the whole analysis: `petzval unit gather` joins parts of it",
            )),
        }
    }
}

/// Makes the lenses of some numbers, in parallel; the bits of each depend on the seed and its number alone. `tick` is called after each; its
/// error ends the work.
pub(super) fn made(
    study: &Study,
    seed: u64,
    Part { from, to }: Part,
    tick: &(dyn Fn() -> Result<(), Cancelled> + Sync),
) -> Result<MonteCarlo, Cancelled> {
    let trial = |number: usize| {
        let made = study.make(&study.draw(seed, number as u64));
        tick()?;
        // Without an image, or with one of which nothing can be said, a lens cannot be ranked.
        let made = made.filter(|made| made.value.is_finite());
        Ok(Trial {
            value: made.as_ref().map(|made| made.value),
            compensators: made.map_or_else(Vec::new, |made| made.compensators),
        })
    };
    let trials = (from..to).into_par_iter().map(trial).collect::<Result<_, Cancelled>>()?;
    Ok(MonteCarlo { seed, trials, better: study.better() })
}

/// Joins parts of the lenses to the analysis that `request`, which has no part, gives in one run: the same to the bit. Sensitivities are computed
/// here, once, and files are written if the request has a folder.
///
/// Fails if the parts are of another lens, seed or merit, if a lens is missing, or if one is in two parts that differ.
pub fn join(request: &Request, parts: &[Response], context: &Context) -> Result<Response, JobError> {
    let request = Request { part: None, ..request.clone() };
    let subject = Subject::of(&request, context)?;
    let study = subject.study()?;
    let mut trials: Vec<Option<Trial>> = vec![None; request.trials];
    for response in parts {
        let made = response.made.as_ref().ok_or_else(|| {
            JobError::input(
                "a response holds no part of the lenses",
                "give responses of requests with `part`",
            )
        })?;
        let Part { from, to } = made.part;
        let wrong = |message: &str, hint: &str| {
            JobError::input(format!("lenses {from} to {}: {message}", to.saturating_sub(1)), hint)
        };
        let report = &response.report;
        let seed = report.monte_carlo.as_ref().map(|random| random.seed);
        let is_same = report.lens == subject.lens.name
            && report.merit == study.merit().name()
            && report.nominal.to_bits() == study.nominal().value.to_bits()
            && seed == Some(request.seed);
        if !is_same {
            return Err(wrong(
                "they are of another lens, merit, seed or instruction set",
                "join parts of one request, on a machine that computes as theirs did",
            ));
        }
        let count = to.saturating_sub(from);
        if to > trials.len() || made.merits.len() != count || made.compensators.len() != count {
            return Err(wrong("there are no such lenses", "`trials` is the number of all of them"));
        }
        let lenses = made.merits.iter().zip(&made.compensators);
        for (place, (value, compensators)) in trials[from..to].iter_mut().zip(lenses) {
            let trial = Trial { value: *value, compensators: compensators.clone() };
            if place.as_ref().is_some_and(|there| *there != trial) {
                return Err(wrong("another part has them as well, and differs", "make the parts again"));
            }
            *place = Some(trial);
        }
    }
    if let Some(missing) = trials.iter().position(Option::is_none) {
        let message = format!("lens {missing} of {} is in no part", trials.len());
        return Err(JobError::input(message, "make the parts that are missing"));
    }
    let random = MonteCarlo {
        seed: request.seed,
        trials: trials.into_iter().flatten().collect(),
        better: study.better(),
    };
    analysed(&request, &subject, &study, Some(random).filter(|random| !random.trials.is_empty()), context)
}
