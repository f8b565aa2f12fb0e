//! Lenses made at random, one by one.

use petzval_files::LensFile;
use petzval_optics::lens::Lens;
use petzval_optics::tolerance::{Failure, MonteCarlo, Study};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::findings::Findings;
use super::report::Quantity;

/// Every lens that was made at random, with its errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Trials {
    /// What is adjusted on every lens, in the order of [`Trial::compensators`].
    pub compensators: Vec<Quantity>,
    /// What is off, in the order of [`Trial::errors`].
    pub errors: Vec<Quantity>,
    /// The lenses by number.
    pub lenses: Vec<Trial>,
}

/// One lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Trial {
    /// Its merit; `None` without an image, or if it cannot be built.
    pub merit: Option<f64>,
    /// Where its compensators stand, counted from the lens as drawn, in their units; empty without a merit.
    pub compensators: Vec<f64>,
    /// What each quantity is off by, in its unit.
    pub errors: Vec<f64>,
}

/// Lists the lenses. Their errors follow from seed and number.
pub(super) fn trials(findings: &Findings, random: &MonteCarlo) -> Trials {
    let tolerances = findings.study.tolerances();
    let compensator = |(freedom, _): &(_, _)| Quantity {
        name: findings.compensator_name(freedom),
        ..Quantity::from(freedom)
    };
    let lens = |(number, trial): (usize, &petzval_optics::tolerance::Trial)| Trial {
        merit: trial.value,
        compensators: trial.compensators.clone(),
        errors: findings.study.draw(random.seed, (findings.first + number) as u64),
    };
    Trials {
        compensators: tolerances.compensators.iter().map(compensator).collect(),
        errors: tolerances.perturbations.iter().map(|p| (&p.freedom).into()).collect(),
        lenses: random.trials.iter().enumerate().map(lens).collect(),
    }
}

/// The lens of a number, made again with its compensators set. Fails where it brings no image, for such a lens has no focus, or cannot be built.
pub(super) fn made_again(drawn: &Lens, study: &Study, seed: u64, number: u64) -> Result<LensFile, Failure> {
    let made = study.build(&study.draw(seed, number))?;
    let mut lens = made.lens;
    lens.name = format!("{}, lens {number} of seed {seed}", drawn.name);
    lens.source = format!("petzval lens tolerance: {} {:.4}", study.merit().name(), made.value);
    Ok(LensFile::of(lens))
}
