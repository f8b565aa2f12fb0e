//! The table of scores that `design` and `evaluate` print.

use crate::jobs::design::Metrics;

use super::number::figure;

/// Prints the table at the end of a run.
pub fn print(metrics: &Metrics) {
    print_on(metrics, &metrics.scored_on());
}

/// Prints the table with what the cameras are scored on.
pub fn print_on(metrics: &Metrics, scored_on: &str) {
    // A score of which no camera has a value has no column: a warning says why.
    let is_there = |name: &str| metrics.rows.iter().any(|row| row.scores.contains_key(name));
    let columns: Vec<_> = (metrics.scores.iter())
        .filter(|s| is_there(&s.name))
        .map(|s| (s, s.heading(), s.heading().chars().count().max(s.decimals + 4) + 1))
        .collect();
    out!("\n{:<16}", "camera");
    columns.iter().for_each(|(_, heading, width)| out!(" {heading:>width$}"));
    out!(" {:>14} {:>12} {:>8}", "linear limit %", "RMS spot um", "EFL mm");
    let has_isp = metrics.rows.iter().any(|r| r.isp_steps > 0);
    let has_network = metrics.rows.iter().any(|r| r.network_steps > 0);
    out!(" {:>6} {:>8}", "f/#", "FOV deg");
    if has_isp {
        out!(" {:>10}", "ISP steps");
    }
    if has_network {
        out!(" {:>14}", "network steps");
    }
    outln!();
    for r in &metrics.rows {
        out!("{:<16}", r.camera);
        for (score, _, width) in &columns {
            let value = figure(r.scores.get(&score.name).copied(), score.decimals);
            out!(" {value:>width$}");
        }
        out!(
            " {:>14} {:>12.2} {:>8.3} {:>6.3} {:>8.2}",
            figure(r.restored_error_percent, 3),
            r.rms_spot_um,
            r.efl_mm,
            r.f_number,
            r.fov_deg,
        );
        if has_isp {
            out!(" {:>10}", r.isp_steps);
        }
        if has_network {
            out!(" {:>14}", r.network_steps);
        }
        outln!();
    }
    outln!(
        "{} {scored_on}; exposure {} e- of white",
        if metrics.is_of_objects() { "over" } else { "means over" },
        metrics.electrons_of_white(),
    );
}
