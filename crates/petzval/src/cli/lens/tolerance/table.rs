//! The figures of a tolerance analysis as a table.

use crate::jobs::lens::tolerance::{Better, RandomLenses, Report, Response, three_digits};

/// Number of rows without --all.
const ROWS: usize = 20;

/// Prints the table.
pub fn print(response: &Response, all: bool) {
    let Response { report, compensators, .. } = response;
    outln!("{}: {}\n", report.lens, report.merit);
    if compensators.is_empty() {
        outln!("nothing is adjusted on a lens");
    } else {
        outln!("adjusted on every lens: {}", compensators.join(", "));
    }
    outln!("nominal {:.4} {}\n", report.nominal, report.unit);
    if response.made.is_none() {
        sensitivities(report, all);
        estimate(report);
    }
    if let Some(random) = &report.monte_carlo {
        lenses(report, random, compensators);
    }
}

/// Prints the effect of each tolerance, the greatest first.
fn sensitivities(report: &Report, all: bool) {
    let rows = &report.sensitivities;
    let shown = if all { rows.len() } else { rows.len().min(ROWS) };
    let width = rows.iter().map(|row| row.quantity.name.len()).max().unwrap_or(0).max(8);
    let has_inverse = rows.iter().any(|row| row.inverse_tolerance.is_some());
    let inverse = if has_inverse { format!(" {:>18}", "should be") } else { String::new() };
    let of_unit = if report.unit.is_empty() { String::new() } else { format!(", {}", report.unit) };
    outln!("change of the merit{of_unit}, with one quantity off by its tolerance");
    outln!("{:<width$} {:>18} {:>10} {:>10} {:>11}{inverse}", "", "tolerance", "minus", "plus", "by slope");
    for row in &rows[..shown] {
        let change = |merit: Option<f64>, defect: &Option<String>| {
            let none = if defect.is_some() { "not built" } else { "no image" };
            merit.map_or_else(|| format!("{none:>10}"), |merit| format!("{:>+10.4}", merit - report.nominal))
        };
        let unit = &row.quantity.unit;
        let should = row.inverse_tolerance.map_or_else(String::new, |tolerance| {
            let more = if row.inverse_is_free == Some(true) { ">" } else { "" };
            format!(" {:>10} {unit:<7}", format!("{more}{}", three_digits(tolerance)))
        });
        let line = format!(
            "{:<width$} {:>10} {unit:<7} {} {} {:>+11.4}{should}",
            row.quantity.name,
            three_digits(row.tolerance),
            change(row.merit_at_minus, &row.defect_at_minus),
            change(row.merit_at_plus, &row.defect_at_plus),
            row.derivative * row.tolerance,
        );
        outln!("{}", line.trim_end());
    }
    if shown < rows.len() {
        outln!("and {} more of less effect (--all)", rows.len() - shown);
    }
}

/// A named figure with its unit, or `none`: one lens has no spread, and no lens has no mean.
fn figure(name: &str, value: Option<f64>, unit: &str) -> String {
    match value {
        Some(v) => format!("  {name:<25} {v:>9.4} {unit}"),
        None => format!("  {name:<25} {:>9}", "none"),
    }
}

/// Prints the estimate for built lenses from the sensitivities.
fn estimate(report: &Report) {
    let unit = &report.unit;
    outln!("\nas built, by the table");
    let Some(e) = &report.estimate else {
        outln!("  no estimate: a lens with one quantity at its tolerance has no image or cannot be built");
        return;
    };
    outln!("{}", figure("root sum square", e.root_sum_square, unit));
    outln!("{}", figure("mean, second order", e.mean, unit));
    outln!("{}", figure("standard deviation", e.standard_deviation, unit));
    outln!("{}", figure("the same by slopes alone", e.linear_spread, unit));
}

/// Prints the statistics of random lenses.
fn lenses(report: &Report, random: &RandomLenses, compensators: &[String]) {
    let unit = &report.unit;
    let reach = match report.better {
        Better::Lower => "at most",
        Better::Higher => "at least",
    };
    outln!("\n{} lenses at random, seed {}", random.trials, random.seed);
    let without_image = random.failed.saturating_sub(random.unbuildable);
    for (what, count) in [("without an image", without_image), ("cannot be built", random.unbuildable)] {
        if count > 0 {
            outln!("  {what:<25} {count:>9}");
        }
    }
    outln!("{}", figure("mean", random.mean, unit));
    outln!("{}", figure("standard deviation", random.standard_deviation, unit));
    for percentile in &random.percentiles {
        let name = format!("{:>2.0} % have {reach}", percentile.percent);
        outln!("{}", figure(&name, percentile.merit, unit));
    }
    if let (Some(limit), Some(share)) = (random.limit, random.yield_at_limit) {
        outln!("  yield: {:.1} % have {reach} {limit} {unit}", 100.0 * share);
    }
    for (travel, name) in random.compensators.iter().zip(compensators) {
        match (travel.mean, travel.standard_deviation, travel.least, travel.greatest) {
            (Some(mean), Some(deviation), Some(least), Some(greatest)) => outln!(
                "  {name} moves by {mean:+.4} +- {deviation:.4} {} ({least:+.4} ... {greatest:+.4})",
                travel.quantity.unit
            ),
            _ => outln!("  {name}: too few lenses for statistics"),
        }
    }
}
