//! What was found, for people.

use petzval::optics::tolerance::{MonteCarlo, PERCENTILES};

use super::result::{Findings, travel_of};

/// Rows that are shown unless all are asked for.
const ROWS: usize = 20;

/// Prints it.
pub fn print(findings: &Findings, all: bool) {
    let (study, table) = (findings.study, &findings.table);
    let merit = study.merit();
    let unit = merit.unit();
    let set: Vec<String> = study.tolerances().compensators.iter().map(|(f, _)| findings.setting(f)).collect();
    println!("{}: {}\n", findings.lens.name, merit.name());
    if set.is_empty() {
        println!("nothing is set anew on a lens");
    } else {
        println!("set anew on every lens: {}", set.join(", "));
    }
    println!("nominal {:.4} {unit}\n", table.nominal);
    sensitivities(findings, all);
    estimate(findings);
    if let Some(random) = &findings.random {
        lenses(findings, random);
    }
}

/// What each tolerance does, the greatest effect first.
fn sensitivities(findings: &Findings, all: bool) {
    let (study, table) = (findings.study, &findings.table);
    let unit = study.merit().unit();
    let rows = findings.by_effect();
    let shown = if all { rows.len() } else { rows.len().min(ROWS) };
    let width = rows.iter().map(|i| study.tolerances().perturbations[*i].freedom.name().len()).max();
    let width = width.unwrap_or(0).max(8);
    let inverse = if findings.shared.is_some() { format!("{:>18}", "should be") } else { String::new() };
    println!("change of the merit{}, with one quantity off by its tolerance", of_unit(unit));
    println!("{:<width$} {:>18} {:>10} {:>10} {:>11}{inverse}", "", "tolerance", "minus", "plus", "by slope");
    for i in &rows[..shown] {
        let (row, p) = (&table.rows[*i], &study.tolerances().perturbations[*i]);
        let change = |v: Option<f64>| {
            v.map_or_else(|| format!("{:>10}", "no image"), |v| format!("{:>+10.4}", v - table.nominal))
        };
        let quantity = p.freedom.quantity.unit();
        let should = findings.shared.as_ref().map_or_else(String::new, |shared| {
            let s = &shared[*i];
            let more = if s.is_free { ">" } else { "" };
            format!("{:>10} {quantity:<7}", format!("{more}{}", short(s.tolerance)))
        });
        let line = format!(
            "{:<width$} {:>10} {quantity:<7} {} {} {:>+11.4}{should}",
            p.freedom.name(),
            short(p.tolerance),
            change(row.at_minus),
            change(row.at_plus),
            row.derivative * p.tolerance,
        );
        println!("{}", line.trim_end());
    }
    if shown < rows.len() {
        println!("and {} more of less effect (--all)", rows.len() - shown);
    }
}

/// A named figure with its unit; one lens has no spread, and none no mean.
fn figure(name: &str, value: Option<f64>, unit: &str) -> String {
    match value.filter(|v| v.is_finite()) {
        Some(v) => format!("  {name:<25} {v:>9.4} {unit}"),
        None => format!("  {name:<25} {:>9}", "none"),
    }
}

/// What the table says of lenses as built.
fn estimate(findings: &Findings) {
    let unit = findings.study.merit().unit();
    println!("\nas built, by the table");
    let Some(e) = findings.table.estimate else {
        println!("  nothing: a lens at a tolerance brings no image");
        return;
    };
    println!("{}", figure("root sum square", Some(e.root_sum_square), unit));
    println!("{}", figure("mean, second order", Some(e.mean), unit));
    println!("{}", figure("standard deviation", Some(e.standard_deviation), unit));
    println!("{}", figure("the same by slopes alone", Some(e.linear_spread), unit));
}

/// What lenses made at random say.
fn lenses(findings: &Findings, random: &MonteCarlo) {
    let unit = findings.study.merit().unit();
    let (mean, deviation) = random.mean_and_deviation();
    println!("\n{} lenses at random, seed {}", random.trials.len(), random.seed);
    if random.failed() > 0 {
        println!("  {:<25} {:>9}", "without an image", random.failed());
    }
    println!("{}", figure("mean", Some(mean), unit));
    println!("{}", figure("standard deviation", Some(deviation), unit));
    for percent in PERCENTILES {
        let name = format!("{percent:>2.0} % have {}", findings.way());
        println!("{}", figure(&name, random.percentile(percent), unit));
    }
    if let Some(limit) = findings.limit {
        let share = 100.0 * random.yield_at(limit);
        println!("  yield: {share:.1} % have {} {limit} {unit}", findings.way());
    }
    for (k, (freedom, _)) in findings.study.tolerances().compensators.iter().enumerate() {
        let [mean, deviation, low, high] = travel_of(random, k);
        let unit = freedom.quantity.unit();
        if !deviation.is_finite() {
            println!("  {}: too few lenses to say how it moves", findings.setting(freedom));
            continue;
        }
        println!(
            "  {} moves by {mean:+.4} +- {deviation:.4} {unit} ({low:+.4} ... {high:+.4})",
            findings.setting(freedom)
        );
    }
}

/// Three significant digits without needless zeros.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn of_unit(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(", {unit}") }
}
