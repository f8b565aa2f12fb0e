//! What was found, as plain data.

use petzval::optics::lens::Lens;
use petzval::optics::merit::Better;
use petzval::optics::tolerance::{
    Distribution, Freedom, MonteCarlo, PERCENTILES, Sensitivities, Shared, Study,
};
use serde_json::{Value, json};

/// Everything that was found.
pub struct Findings<'a> {
    /// The lens as drawn.
    pub lens: &'a Lens,
    /// It with its tolerances and its merit.
    pub study: &'a Study<'a>,
    /// What each tolerance does.
    pub table: Sensitivities,
    /// Lenses made at random, if asked for.
    pub random: Option<MonteCarlo>,
    /// Tolerances that share a loss, if asked for.
    pub shared: Option<Vec<Shared>>,
    /// A merit that lenses have to reach, if one was named.
    pub limit: Option<f64>,
}

impl Findings<'_> {
    /// Rows of the table, the greatest effect first.
    pub fn by_effect(&self) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..self.table.rows.len()).collect();
        let loss = |i: &usize| self.table.rows[*i].worst_loss(self.study.better(), self.table.nominal);
        rows.sort_by(|a, b| loss(b).total_cmp(&loss(a)));
        rows
    }

    /// What a compensator is called: behind the last surface a thickness is the image distance.
    pub fn setting(&self, freedom: &Freedom) -> String {
        if *freedom == Freedom::focus(self.lens) { "image distance".to_owned() } else { freedom.name() }
    }

    /// Which end of the merit the worst percentiles are.
    pub fn way(&self) -> &'static str {
        match self.study.better() {
            Better::Lower => "at most",
            Better::Higher => "at least",
        }
    }
}

/// A freedom as data.
fn freedom(f: &Freedom) -> Value {
    json!({
        "name": f.name(),
        "quantity": f.quantity.to_string(),
        "surfaces": [f.first + 1, f.last + 1],
        "unit": f.quantity.unit(),
    })
}

fn with(mut to: Value, more: Value) -> Value {
    if let (Some(to), Value::Object(more)) = (to.as_object_mut(), more) {
        to.extend(more);
    }
    to
}

/// All figures.
pub fn json(findings: &Findings, worst: usize) -> Value {
    let Findings { lens, study, table, .. } = findings;
    let merit = study.merit();
    let tolerances = study.tolerances();
    let compensators = |at: &[f64]| -> Vec<Value> {
        let named = tolerances.compensators.iter().zip(at);
        named.map(|((f, _), value)| with(freedom(f), json!({ "at": value }))).collect()
    };
    let rows: Vec<Value> = findings
        .by_effect()
        .into_iter()
        .map(|i| {
            let (row, p) = (&table.rows[i], &tolerances.perturbations[i]);
            let distribution = match p.distribution {
                Distribution::Uniform => "uniform",
                Distribution::Normal => "normal",
                Distribution::Parabolic => "parabolic",
            };
            let shared = findings.shared.as_ref().map(|s| &s[i]);
            let row = json!({
                "tolerance": p.tolerance,
                "distribution": distribution,
                "derivative": row.derivative,
                "merit_at_minus": row.at_minus,
                "merit_at_plus": row.at_plus,
                "compensators_at_minus": row.compensators[1],
                "compensators_at_plus": row.compensators[0],
                "inverse_tolerance": shared.map(|s| s.tolerance),
                "inverse_is_free": shared.map(|s| s.is_free),
            });
            with(freedom(&p.freedom), row)
        })
        .collect();
    json!({
        "lens": lens.name,
        "merit": merit.name(),
        "unit": merit.unit(),
        "better": match study.better() { Better::Lower => "lower", Better::Higher => "higher" },
        "nominal": table.nominal,
        "nominal_compensators": compensators(&study.nominal().compensators),
        "sensitivities": rows,
        "estimate": table.estimate.map(|e| json!({
            "root_sum_square": e.root_sum_square,
            "linear_spread": e.linear_spread,
            "mean": e.mean,
            "standard_deviation": e.standard_deviation,
        })),
        "monte_carlo": findings.random.as_ref().map(|r| random(findings, r, worst)),
    })
}

fn random(findings: &Findings, found: &MonteCarlo, worst: usize) -> Value {
    let (mean, deviation) = found.mean_and_deviation();
    let percentiles: Vec<Value> =
        PERCENTILES.iter().map(|p| json!({ "percent": p, "merit": found.percentile(*p) })).collect();
    let travels: Vec<Value> = (findings.study.tolerances().compensators.iter().enumerate())
        .map(|(k, (f, _))| with(freedom(f), travel(findings, found, k)))
        .collect();
    json!({
        "seed": found.seed,
        "trials": found.trials.len(),
        "failed": found.failed(),
        "mean": mean,
        "standard_deviation": deviation,
        "percentiles": percentiles,
        "limit": findings.limit,
        "yield_at_limit": findings.limit.map(|limit| found.yield_at(limit)),
        "compensators": travels,
        "worst": found.worst(worst).into_iter().map(|n| json!({
            "trial": n, "merit": found.trials[n].value,
        })).collect::<Vec<_>>(),
        "yield_curve": found.yield_curve(),
    })
}

/// Where a compensator goes, counted from the lens as drawn.
pub fn travel_of(found: &MonteCarlo, compensator: usize) -> [f64; 4] {
    let at: Vec<f64> = found.trials.iter().filter_map(|t| t.compensators.get(compensator).copied()).collect();
    let count = at.len() as f64;
    let mean = at.iter().sum::<f64>() / count;
    let squares: f64 = at.iter().map(|v| (v - mean).powi(2)).sum();
    let low = at.iter().copied().fold(f64::INFINITY, f64::min);
    let high = at.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [mean, (squares / (count - 1.0)).sqrt(), low, high]
}

fn travel(findings: &Findings, found: &MonteCarlo, compensator: usize) -> Value {
    let [mean, deviation, low, high] = travel_of(found, compensator);
    let nominal = findings.study.nominal().compensators.get(compensator);
    json!({ "nominal": nominal, "mean": mean, "standard_deviation": deviation, "least": low, "greatest": high })
}
