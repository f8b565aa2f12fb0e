//! The files of a tolerance analysis: figures, pictures and the worst lenses.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use petzval_files::{LensFile, write_lens, write_tolerances};
use petzval_optics::merit::Better;
use petzval_optics::tolerance::MonteCarlo;
use petzval_report::plot::{Bar, BarChart, BarKey, Chart, Series, bars_svg, chart_svg};

use super::findings::Findings;
use super::report::Report;
use crate::error::{JobError, json, write_file};

/// Bars of the picture.
const BARS: usize = 20;

/// Writes everything into a folder, with so many of the worst lenses; returns the files.
pub(super) fn write_all(
    findings: &Findings,
    report: &Report,
    out: &Path,
    worst: usize,
) -> Result<Vec<PathBuf>, JobError> {
    // A JSON value has its keys in order, as the command prints them.
    let sorted = serde_json::to_value(report).map_err(|e| JobError::failed(e.to_string()))?;
    let mut files = Vec::new();
    let mut add = |name: &str, text: String| {
        files.push(out.join(name));
        write_file(&out.join(name), text)
    };
    add("tolerance.json", json(&sorted)?)?;
    add("tolerances.toml", write_tolerances(findings.study.tolerances()))?;
    add("sensitivities.csv", sensitivities_csv(findings))?;
    add("sensitivity.svg", bars_svg(&bars(findings)))?;
    if let Some(random) = &findings.random {
        add("trials.csv", trials_csv(findings, random))?;
        add("yield.svg", chart_svg(&yield_chart(findings, random)))?;
        for number in random.worst(worst) {
            let off = findings.study.draw(random.seed, number as u64);
            // A lens without an image has no focus, and no file.
            let Some(made) = findings.study.make(&off) else { continue };
            let mut lens = made.lens;
            lens.name = format!("{}, lens {number} of seed {}", findings.lens.name, random.seed);
            lens.source =
                format!("petzval lens tolerance: {} {:.4}", findings.study.merit().name(), made.value);
            add(&format!("lens-{number:05}.toml"), write_lens(&LensFile::of(lens)))?;
        }
    }
    Ok(files)
}

/// A field of a table: quoted where it needs to be.
fn cell(text: &str) -> String {
    if text.contains([',', '"']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

fn maybe(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| v.to_string())
}

fn sensitivities_csv(findings: &Findings) -> String {
    let mut out = String::from(
        "quantity,first_surface,last_surface,unit,tolerance,merit_at_minus,merit_at_plus,derivative\n",
    );
    for i in findings.by_effect() {
        let (row, p) = (&findings.table.rows[i], &findings.study.tolerances().perturbations[i]);
        let f = &p.freedom;
        let _ = writeln!(
            out,
            "{},{},{},{},{},{},{},{}",
            cell(&f.quantity.to_string()),
            f.first + 1,
            f.last + 1,
            f.quantity.unit(),
            p.tolerance,
            maybe(row.at_minus),
            maybe(row.at_plus),
            row.derivative
        );
    }
    out
}

/// Every lens: its merit, where its compensators stand, and its errors.
fn trials_csv(findings: &Findings, random: &MonteCarlo) -> String {
    let tolerances = findings.study.tolerances();
    let named = |name: String, unit: &str| match unit {
        "" => cell(&name),
        unit => cell(&format!("{name} ({unit})")),
    };
    let merit = findings.study.merit();
    let mut head = vec!["trial".to_owned(), named(merit.name(), merit.unit())];
    head.extend(
        tolerances
            .compensators
            .iter()
            .map(|(f, _)| named(format!("set: {}", findings.compensator_name(f)), f.quantity.unit())),
    );
    head.extend(tolerances.perturbations.iter().map(|p| named(p.freedom.name(), p.freedom.quantity.unit())));
    let mut out = head.join(",") + "\n";
    for (number, trial) in random.trials.iter().enumerate() {
        let mut row = vec![number.to_string(), maybe(trial.value)];
        row.extend((0..tolerances.compensators.len()).map(|k| maybe(trial.compensators.get(k).copied())));
        row.extend(findings.study.draw(random.seed, number as u64).iter().map(f64::to_string));
        out += &(row.join(",") + "\n");
    }
    out
}

fn axis(findings: &Findings, what: &str) -> String {
    let merit = findings.study.merit();
    let unit = if merit.unit().is_empty() { String::new() } else { format!(", {}", merit.unit()) };
    format!("{what}{}{unit}", merit.name())
}

/// The share of lenses over the merit that they reach, with marks at the nominal merit and at those of 50 % and 90 %.
fn yield_chart(findings: &Findings, random: &MonteCarlo) -> Chart {
    let unit = findings.study.merit().unit();
    let mut curve: Vec<(f64, f64)> =
        random.yield_curve().into_iter().map(|(merit, share)| (merit, 100.0 * share)).collect();
    if findings.study.better() == Better::Higher {
        curve.reverse();
    }
    let mut series = vec![Series { name: "yield".into(), colour: "#0072b2".into(), points: curve }];
    let mut mark = |name: String, colour: &str, at: f64, share: f64| {
        let points = vec![(at, 0.0), (at, share)];
        series.push(Series { name, colour: colour.into(), points });
    };
    let nominal = findings.table.nominal;
    mark(format!("nominal {} {unit}", three_digits(nominal)), "#5f6670", nominal, 100.0);
    for (percent, colour) in [(50.0, "#009e73"), (90.0, "#d55e00")] {
        if let Some(at) = random.percentile(percent) {
            mark(format!("{percent} %: {} {unit}", three_digits(at)), colour, at, percent);
        }
    }
    Chart {
        alt: format!("Yield of {} lenses over their {}", random.trials.len(), findings.study.merit().name()),
        x_axis: axis(findings, ""),
        y_axis: "lenses that reach it, %".into(),
        series,
        smooth: false,
        from_zero: true,
    }
}

/// The greatest effects as bars.
fn bars(findings: &Findings) -> BarChart {
    let rows = findings.by_effect();
    let bar = |i: &usize| {
        let (row, p) = (&findings.table.rows[*i], &findings.study.tolerances().perturbations[*i]);
        let loss = |v: Option<f64>| {
            v.map_or(f64::INFINITY, |v| findings.study.better().loss(v, findings.table.nominal))
        };
        Bar {
            name: format!(
                "{}, {} {}",
                p.freedom.name(),
                three_digits(p.tolerance),
                p.freedom.quantity.unit()
            ),
            values: vec![loss(row.at_minus), loss(row.at_plus)],
        }
    };
    BarChart {
        alt: format!("What each tolerance costs of the {}", findings.study.merit().name()),
        axis: axis(findings, "loss of "),
        keys: vec![BarKey::nth(0, "at minus the tolerance"), BarKey::nth(1, "at plus")],
        bars: rows.iter().take(BARS).map(bar).collect(),
    }
}

/// A number with three significant digits and no trailing zeros.
pub fn three_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
