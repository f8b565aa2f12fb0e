//! The figures of a tolerance analysis as plain data.

use petzval_optics::merit;
use petzval_optics::tolerance::{Distribution, Failure, Freedom, MonteCarlo, PERCENTILES};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::findings::Findings;
use crate::finite::finite;

/// All figures of a tolerance analysis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Name of the lens.
    pub lens: String,
    /// Name of the merit.
    pub merit: String,
    /// Its unit; empty for a plain number.
    pub unit: String,
    /// Which values of it are better.
    pub better: Better,
    /// The merit of the lens as drawn, compensators adjusted.
    pub nominal: f64,
    /// Where the compensators of that lens stand.
    pub nominal_compensators: Vec<Compensator>,
    /// What each tolerance does, the greatest effect first.
    pub sensitivities: Vec<Sensitivity>,
    /// Lenses as built, estimated from the sensitivities; `None` if a lens at a tolerance brings no image or cannot be built.
    pub estimate: Option<Estimate>,
    /// Lenses made at random.
    pub monte_carlo: Option<RandomLenses>,
}

/// Which values of a merit are better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Better {
    /// Small ones.
    Lower,
    /// Large ones.
    Higher,
}

/// A quantity of one or several surfaces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quantity {
    /// The quantity with its surfaces, for people.
    pub name: String,
    /// The quantity.
    pub quantity: String,
    /// The first and the last surface, from 1.
    pub surfaces: [usize; 2],
    /// Unit; empty for a plain number.
    pub unit: String,
}

impl From<&Freedom> for Quantity {
    fn from(freedom: &Freedom) -> Self {
        Self {
            name: freedom.name(),
            quantity: freedom.quantity.to_string(),
            surfaces: [freedom.first + 1, freedom.last + 1],
            unit: freedom.quantity.unit().to_owned(),
        }
    }
}

/// A compensator and where it stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Compensator {
    /// What is adjusted.
    #[serde(flatten)]
    pub quantity: Quantity,
    /// Distance from the lens as drawn, in its unit.
    pub at: f64,
}

/// What a tolerance does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sensitivity {
    /// What is off.
    #[serde(flatten)]
    pub quantity: Quantity,
    /// The tolerance, in its unit.
    pub tolerance: f64,
    /// Distribution of the errors: uniform, normal or parabolic.
    pub distribution: String,
    /// Derivative of the merit per unit of the quantity, compensators following.
    pub derivative: f64,
    /// Merit at minus the tolerance, compensators adjusted; `None` without an image, or if that lens cannot be built.
    pub merit_at_minus: Option<f64>,
    /// Merit at plus the tolerance.
    pub merit_at_plus: Option<f64>,
    /// Where the compensators stand at minus the tolerance.
    pub compensators_at_minus: Vec<f64>,
    /// Where they stand at plus the tolerance.
    pub compensators_at_plus: Vec<f64>,
    /// The tolerance that costs an even share of the loss of the request.
    pub inverse_tolerance: Option<f64>,
    /// Whether even a far wider tolerance than this costs less than that share.
    pub inverse_is_free: Option<bool>,
    /// Why the lens at minus the tolerance cannot be built.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub defect_at_minus: Option<String>,
    /// Why the lens at plus the tolerance cannot be built.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub defect_at_plus: Option<String>,
}

/// The merit of lenses as built, estimated from the sensitivities, in the unit of the merit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Estimate {
    /// The nominal merit, worse by the root of the sum of squares of the changes at the tolerances.
    pub root_sum_square: Option<f64>,
    /// Standard deviation to first order.
    pub linear_spread: Option<f64>,
    /// Mean to second order.
    pub mean: Option<f64>,
    /// Standard deviation to second order.
    pub standard_deviation: Option<f64>,
}

/// Lenses made at random.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RandomLenses {
    /// Their seed.
    pub seed: u64,
    /// How many were made.
    pub trials: usize,
    /// How many of them have no merit: they bring no image or cannot be built.
    pub failed: usize,
    /// How many of these cannot be built.
    #[serde(default)]
    pub unbuildable: usize,
    /// Mean merit of the others.
    pub mean: Option<f64>,
    /// Standard deviation of their merit; `None` for fewer than two.
    pub standard_deviation: Option<f64>,
    /// The merits that shares of all lenses reach.
    pub percentiles: Vec<Percentile>,
    /// The merit of the request.
    pub limit: Option<f64>,
    /// Share of all lenses that reach it.
    pub yield_at_limit: Option<f64>,
    /// How far the compensators go.
    pub compensators: Vec<Travel>,
    /// The worst lenses, the worst first, without those that cannot be built.
    pub worst: Vec<Worst>,
    /// Merit and share of all lenses that reach it, from the best lens to the worst.
    pub yield_curve: Vec<(f64, f64)>,
}

/// The merit that a share of all lenses reaches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Percentile {
    /// The share, percent.
    pub percent: f64,
    /// The merit; `None` if so many lenses have none.
    pub merit: Option<f64>,
}

/// How far a compensator goes, counted from the lens as drawn, in its unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Travel {
    /// What is adjusted.
    #[serde(flatten)]
    pub quantity: Quantity,
    /// Where it stands on the lens without errors.
    pub nominal: Option<f64>,
    /// Mean over the lenses.
    pub mean: Option<f64>,
    /// Standard deviation; `None` for fewer than two lenses.
    pub standard_deviation: Option<f64>,
    /// Its lowest place.
    pub least: Option<f64>,
    /// Its highest place.
    pub greatest: Option<f64>,
}

/// One of the worst lenses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Worst {
    /// Its number.
    pub trial: usize,
    /// Its merit; `None` without an image.
    pub merit: Option<f64>,
}

/// Gathers the figures; of the lenses made at random it names this many of the worst.
pub(super) fn report(findings: &Findings, worst: usize) -> Report {
    let (study, table) = (findings.study, &findings.table);
    let merit = study.merit();
    let nominal_at = study.nominal().compensators.iter();
    Report {
        lens: findings.lens.name.clone(),
        merit: merit.name(),
        unit: merit.unit().to_owned(),
        better: match study.better() {
            merit::Better::Lower => Better::Lower,
            merit::Better::Higher => Better::Higher,
        },
        nominal: table.nominal,
        nominal_compensators: (study.tolerances().compensators.iter().zip(nominal_at))
            .map(|((freedom, _), at)| Compensator { quantity: freedom.into(), at: *at })
            .collect(),
        sensitivities: findings.by_effect().into_iter().map(|i| sensitivity(findings, i)).collect(),
        estimate: table.estimate.as_ref().map(|e| Estimate {
            root_sum_square: finite(e.root_sum_square),
            linear_spread: finite(e.linear_spread),
            mean: finite(e.mean),
            standard_deviation: finite(e.standard_deviation),
        }),
        monte_carlo: findings.random.as_ref().map(|random| random_lenses(findings, random, worst)),
    }
}

fn sensitivity(findings: &Findings, i: usize) -> Sensitivity {
    let (row, p) = (&findings.table.rows[i], &findings.study.tolerances().perturbations[i]);
    let distribution = match p.distribution {
        Distribution::Uniform => "uniform",
        Distribution::Normal => "normal",
        Distribution::Parabolic => "parabolic",
    };
    let shared = findings.shared.as_ref().map(|shared| &shared[i]);
    let [at_plus, at_minus] = &row.compensators;
    let defect = |failure: &Option<Failure>| match failure {
        Some(Failure::CannotBeBuilt(defect)) => Some(defect.to_string()),
        _ => None,
    };
    let [defect_at_plus, defect_at_minus] = row.failures.each_ref().map(defect);
    Sensitivity {
        quantity: (&p.freedom).into(),
        tolerance: p.tolerance,
        distribution: distribution.to_owned(),
        derivative: row.derivative,
        merit_at_minus: row.at_minus,
        merit_at_plus: row.at_plus,
        compensators_at_minus: at_minus.clone(),
        compensators_at_plus: at_plus.clone(),
        inverse_tolerance: shared.map(|s| s.tolerance),
        inverse_is_free: shared.map(|s| s.is_free),
        defect_at_minus,
        defect_at_plus,
    }
}

fn random_lenses(findings: &Findings, found: &MonteCarlo, worst: usize) -> RandomLenses {
    let (mean, deviation) = found.mean_and_deviation();
    let percentile = |percent: &f64| Percentile { percent: *percent, merit: found.percentile(*percent) };
    RandomLenses {
        seed: found.seed,
        trials: found.trials.len(),
        failed: found.failed(),
        unbuildable: found.unbuildable(),
        mean: finite(mean),
        standard_deviation: finite(deviation),
        percentiles: PERCENTILES.iter().map(percentile).collect(),
        limit: findings.limit,
        yield_at_limit: findings.limit.map(|limit| found.yield_at(limit)),
        compensators: (findings.study.tolerances().compensators.iter().enumerate())
            .map(|(k, (freedom, _))| travel(findings, found, k, freedom))
            .collect(),
        worst: (found.worst(worst).into_iter())
            .map(|place| Worst { trial: findings.first + place, merit: found.trials[place].value })
            .collect(),
        yield_curve: found.yield_curve(),
    }
}

/// How far compensator `k` goes.
fn travel(findings: &Findings, found: &MonteCarlo, k: usize, freedom: &Freedom) -> Travel {
    let at: Vec<f64> = found.trials.iter().filter_map(|t| t.compensators.get(k).copied()).collect();
    let count = at.len() as f64;
    let mean = at.iter().sum::<f64>() / count;
    let squares: f64 = at.iter().map(|v| (v - mean).powi(2)).sum();
    Travel {
        quantity: freedom.into(),
        nominal: findings.study.nominal().compensators.get(k).copied(),
        mean: finite(mean),
        standard_deviation: finite((squares / (count - 1.0)).sqrt()),
        least: finite(at.iter().copied().fold(f64::INFINITY, f64::min)),
        greatest: finite(at.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
    }
}
