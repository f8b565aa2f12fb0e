//! The files of a tolerance analysis: figures, pictures and the worst lenses.

use std::path::{Path, PathBuf};

use petzval_base::{csv_number, csv_text};
use petzval_files::{write_lens, write_tolerances};
use petzval_optics::tolerance::{Freedom, MonteCarlo};
use petzval_report::tolerance_sheet::{
    BuiltEstimate, CompensatorTravel, RandomLenses, ToleranceRow, ToleranceSheet, WorstLens, page,
    sensitivity_svg, yield_svg,
};

use super::findings::Findings;
use super::report::{self, Better, Report, Sensitivity};
use super::trials::made_again;
use crate::context::Context;
use crate::error::{JobError, Result, json, write_file};
use crate::results::what_is;

/// Errors of one of the worst lenses that the page names.
const HARMFUL: usize = 5;

/// Writes everything into a folder, with so many of the worst lenses; returns the files.
pub(super) fn write_all(
    findings: &Findings,
    report: &Report,
    out: &Path,
    worst: usize,
    context: &Context,
) -> Result<Vec<PathBuf>> {
    // A JSON value has its keys in order, as the command prints them.
    let sorted = serde_json::to_value(report).map_err(|e| JobError::failed(e.to_string()))?;
    let mut files = Vec::new();
    let mut add = |name: &str, text: String| {
        let path = out.join(name);
        write_file(&path, text)?;
        context.wrote(&path, if name.starts_with("lens-") { "lens" } else { what_is(&path) });
        files.push(path);
        Ok::<_, JobError>(())
    };
    add("tolerance.json", json(&sorted)?)?;
    add("tolerances.toml", write_tolerances(findings.study.tolerances()))?;
    add("sensitivities.csv", sensitivities_csv(findings))?;
    let sheet = sheet(findings, report);
    add("tolerance.html", page(&sheet))?;
    add("sensitivity.svg", sensitivity_svg(&sheet))?;
    if let Some(random) = &findings.random {
        add("trials.csv", trials_csv(findings, random))?;
        if let Some(random) = &sheet.random {
            add("yield.svg", yield_svg(&sheet, random))?;
        }
        for number in random.worst(worst) {
            let lens = made_again(findings.lens, findings.study, random.seed, number as u64);
            if let Ok(lens) = lens {
                add(&format!("lens-{number:05}.toml"), write_lens(&lens))?;
            }
        }
    }
    Ok(files)
}

fn sensitivities_csv(findings: &Findings) -> String {
    let head = [
        "quantity",
        "first_surface",
        "last_surface",
        "unit",
        "tolerance",
        "merit_at_minus",
        "merit_at_plus",
        "derivative",
    ];
    let lines = findings.by_effect().into_iter().map(|i| {
        let (row, p) = (&findings.table.rows[i], &findings.study.tolerances().perturbations[i]);
        let f = &p.freedom;
        [
            f.quantity.to_string(),
            (f.first + 1).to_string(),
            (f.last + 1).to_string(),
            f.quantity.unit().to_owned(),
            p.tolerance.to_string(),
            csv_number(row.at_minus),
            csv_number(row.at_plus),
            row.derivative.to_string(),
        ]
    });
    csv_text([head.map(str::to_owned)].into_iter().chain(lines))
}

/// Every lens: its merit, where its compensators stand, and its errors.
fn trials_csv(findings: &Findings, random: &MonteCarlo) -> String {
    let tolerances = findings.study.tolerances();
    let named = |name: String, unit: &str| if unit.is_empty() { name } else { format!("{name} ({unit})") };
    let merit = findings.study.merit();
    let compensators = tolerances.compensators.iter();
    let set =
        compensators.map(|(f, _)| named(format!("set: {}", findings.compensator_name(f)), f.quantity.unit()));
    let errors = tolerances.perturbations.iter().map(|p| named(p.freedom.name(), p.freedom.quantity.unit()));
    let first = ["trial".to_owned(), named(merit.name(), merit.unit())];
    let head: Vec<String> = first.into_iter().chain(set).chain(errors).collect();
    let lines = random.trials.iter().enumerate().map(|(number, trial)| {
        let set = (0..tolerances.compensators.len()).map(|k| csv_number(trial.compensators.get(k).copied()));
        let errors = findings.study.draw(random.seed, number as u64);
        let first = [number.to_string(), csv_number(trial.value)].into_iter();
        first.chain(set).chain(errors.iter().map(f64::to_string)).collect()
    });
    csv_text([head].into_iter().chain(lines))
}

/// The analysis as its page and pictures show it.
fn sheet(findings: &Findings, report: &Report) -> ToleranceSheet {
    let row = |s: &Sensitivity| ToleranceRow {
        name: s.quantity.name.clone(),
        tolerance: s.tolerance,
        unit: s.quantity.unit.clone(),
        distribution: s.distribution.clone(),
        merit_at: [s.merit_at_minus, s.merit_at_plus],
        is_unbuildable: [&s.defect_at_minus, &s.defect_at_plus].map(Option::is_some),
        even_share: s.inverse_tolerance.zip(s.inverse_is_free),
    };
    let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
    ToleranceSheet {
        lens: report.lens.clone(),
        merit: report.merit.clone(),
        unit: report.unit.clone(),
        higher_is_better: report.better == Better::Higher,
        nominal: report.nominal,
        compensators: findings.compensators(),
        rows: report.sensitivities.iter().map(row).collect(),
        estimate: report.estimate.as_ref().map(|e| BuiltEstimate {
            root_sum_square: known(e.root_sum_square),
            mean: known(e.mean),
            standard_deviation: known(e.standard_deviation),
        }),
        random: findings
            .random
            .as_ref()
            .zip(report.monte_carlo.as_ref())
            .map(|(found, r)| random_lenses(findings, found, r)),
    }
}

fn random_lenses(findings: &Findings, found: &MonteCarlo, report: &report::RandomLenses) -> RandomLenses {
    let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let travel = |(t, (freedom, _)): (&report::Travel, &(Freedom, Option<f64>))| CompensatorTravel {
        name: findings.compensator_name(freedom),
        unit: t.quantity.unit.clone(),
        places: [t.mean, t.standard_deviation, t.least, t.greatest].map(known),
    };
    let worst = |w: &report::Worst| WorstLens {
        number: w.trial,
        merit: w.merit,
        errors: harmful_errors(findings, &findings.study.draw(found.seed, w.trial as u64)),
    };
    RandomLenses {
        seed: found.seed,
        trials: found.trials.len(),
        unbuildable: found.unbuildable(),
        merits: found.sorted(),
        mean_and_deviation: [report.mean, report.standard_deviation].map(known),
        percentiles: report.percentiles.iter().map(|p| (p.percent, p.merit)).collect(),
        limit: report.limit.zip(report.yield_at_limit),
        travels: report
            .compensators
            .iter()
            .zip(&findings.study.tolerances().compensators)
            .map(travel)
            .collect(),
        worst: report.worst.iter().map(worst).collect(),
    }
}

/// The errors of a lens that alone would cost most, over their tolerances, the most harmful first.
///
/// The loss by an error of `x` tolerances is `a x + b x^2`, the parabola through the lens as drawn and those at both ends.
fn harmful_errors(findings: &Findings, off: &[f64]) -> Vec<(String, f64)> {
    let better = findings.study.better();
    let loss = |merit: Option<f64>| merit.map_or(f64::INFINITY, |m| better.loss(m, findings.table.nominal));
    let mut all: Vec<(f64, String, f64)> = Vec::new();
    for ((row, p), off) in findings.table.rows.iter().zip(&findings.study.tolerances().perturbations).zip(off)
    {
        let (share, plus, minus) = (off / p.tolerance, loss(row.at_plus), loss(row.at_minus));
        // An end without an image counts as the worst that can be.
        let cost = match (plus.is_finite(), minus.is_finite()) {
            (true, true) => 0.5 * (plus - minus) * share + 0.5 * (plus + minus) * share * share,
            _ => f64::INFINITY,
        };
        if cost > 0.0 {
            all.push((cost, p.freedom.name(), share));
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    all.into_iter().take(HARMFUL).map(|(_, name, share)| (name, share)).collect()
}
