//! What was found, as files: figures, pictures and the worst lenses.

use std::fmt::Write;
use std::path::Path;

use petzval::design::run::write_atomically;
use petzval::files::{LensFile, write_lens, write_tolerances};
use petzval::optics::merit::Better;
use petzval::optics::tolerance::MonteCarlo;
use petzval::report::chart::{Bar, BarChart, Chart, Series, bars_svg, chart_svg};

use super::result::{self, Findings};
use super::table::short;
use crate::cli::Failure;

/// Bars of the picture.
const BARS: usize = 20;

/// Writes everything below a folder.
pub fn write(findings: &Findings, out: &Path, worst: usize) -> Result<(), Failure> {
    let write = |name: &str, text: &str| -> Result<(), Failure> {
        Ok(write_atomically(&out.join(name), text.as_bytes())?)
    };
    let figures = serde_json::to_string_pretty(&result::json(findings, worst));
    write("tolerance.json", &figures.map_err(|e| Failure::job(e.to_string()))?)?;
    write("tolerances.toml", &write_tolerances(findings.study.tolerances()))?;
    write("sensitivities.csv", &sensitivities_csv(findings))?;
    write("sensitivity.svg", &bars_svg(&bars(findings)))?;
    let Some(random) = &findings.random else { return Ok(()) };
    write("trials.csv", &trials_csv(findings, random))?;
    write("yield.svg", &chart_svg(&yield_chart(findings, random)))?;
    for number in random.worst(worst) {
        let off = findings.study.draw(random.seed, number as u64);
        // A lens without an image is one all the same, but where its focus would be nobody knows.
        let Some(made) = findings.study.make(&off) else { continue };
        let mut lens = made.lens;
        lens.name = format!("{}, lens {number} of seed {}", findings.lens.name, random.seed);
        lens.source = format!("petzval lens tolerance: {} {:.4}", findings.study.merit().name(), made.value);
        write(&format!("lens-{number:05}.toml"), &write_lens(&LensFile::of(lens)))?;
    }
    Ok(())
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

/// Every lens: its merit, where its compensators stand, and what is off.
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
            .map(|(f, _)| named(format!("set: {}", findings.setting(f)), f.quantity.unit())),
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

/// The share of lenses over the merit that they reach, with the nominal merit and what half and nine tenths of them reach.
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
    mark(format!("nominal {} {unit}", short(nominal)), "#5f6670", nominal, 100.0);
    for (percent, colour) in [(50.0, "#009e73"), (90.0, "#d55e00")] {
        if let Some(at) = random.percentile(percent) {
            mark(format!("{percent} %: {} {unit}", short(at)), colour, at, percent);
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
            name: format!("{}, {} {}", p.freedom.name(), short(p.tolerance), p.freedom.quantity.unit()),
            values: [loss(row.at_minus), loss(row.at_plus)],
        }
    };
    BarChart {
        alt: format!("What each tolerance costs of the {}", findings.study.merit().name()),
        axis: axis(findings, "loss of "),
        names: ["at minus the tolerance".into(), "at plus".into()],
        bars: rows.iter().take(BARS).map(bar).collect(),
    }
}
