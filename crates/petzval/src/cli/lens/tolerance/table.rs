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
        println!(
            "{:<width$} {:>10} {quantity:<7} {} {} {:>+11.4}{should}",
            p.freedom.name(),
            short(p.tolerance),
            change(row.at_minus),
            change(row.at_plus),
            row.derivative * p.tolerance,
        );
    }
    if shown < rows.len() {
        println!("and {} more of less effect (--all)", rows.len() - shown);
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
    println!("  root sum square          {:>9.4} {unit}", e.root_sum_square);
    println!("  mean, second order       {:>9.4} {unit}", e.mean);
    println!(
        "  standard deviation       {:>9.4} {unit}   (by slopes alone {:.4})",
        e.standard_deviation, e.linear_spread
    );
}

/// What lenses made at random say.
fn lenses(findings: &Findings, random: &MonteCarlo) {
    let unit = findings.study.merit().unit();
    let (mean, deviation) = random.mean_and_deviation();
    println!("\n{} lenses at random, seed {}", random.trials.len(), random.seed);
    if random.failed() > 0 {
        println!("  without an image         {:>9}", random.failed());
    }
    // One lens has no spread, and none no mean.
    let shown = |v: f64| if v.is_finite() { format!("{v:.4} {unit}") } else { "-".to_owned() };
    println!("  mean                     {:>9}", shown(mean));
    println!("  standard deviation       {:>9}", shown(deviation));
    for percent in PERCENTILES {
        let value = random.percentile(percent).map_or("no image".to_owned(), |v| format!("{v:.4} {unit}"));
        println!("  {percent:>2.0} % have {:<8}       {:>9}", findings.way(), value);
    }
    if let Some(limit) = findings.limit {
        let share = 100.0 * random.yield_at(limit);
        println!("  yield: {share:.1} % have {} {limit} {unit}", findings.way());
    }
    for (k, (freedom, _)) in findings.study.tolerances().compensators.iter().enumerate() {
        let [mean, deviation, low, high] = travel_of(random, k);
        let unit = freedom.quantity.unit();
        println!(
            "  {} moves by {mean:+.4} +- {deviation:.4} {unit} ({low:+.4} ... {high:+.4})",
            findings.setting(freedom)
        );
    }
}

/// Three significant digits without needless zeros.
pub fn short(value: f64) -> String {
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn of_unit(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(", {unit}") }
}
