//! `petzval glass show`: all data of a glass.

use crate::jobs::glass::show::{self, DN_DT_C, PATH_MM};

use crate::cli::code::Code;
use crate::cli::failure::Failure;
use crate::cli::number::figure;
use crate::cli::terminal::{Terminal, print_response};

/// Show a glass of the catalogue.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Name of the glass, or MAKER:NAME if several makers have a glass of this name
    name: String,
    /// Temperature of the glass and of the air around it, degrees Celsius, for the column of indices
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    temperature: Option<f64>,
    /// Pressure of that air, atm; 0 is vacuum
    #[arg(long, value_name = "ATM", requires = "temperature")]
    pressure: Option<f64>,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let request = show::Request { name: args.name, temperature: args.temperature, pressure: args.pressure };
    let response = show::run(&request, &terminal.context())?;
    print_response(args.json, &response.glass, || print(&response))
}

fn print(response: &show::Response) {
    let glass = &response.glass;
    let status = glass.status.as_deref().unwrap_or_default();
    let about: Vec<&str> = [glass.maker.as_str(), status, glass.source.as_str()]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect();
    outln!("{}  {}\n", glass.name, about.join(", "));
    let printed =
        |printed: &Option<String>| printed.as_ref().map_or(String::new(), |p| format!("   printed {p}"));
    outln!("  nd         {:>9}{}", figure(glass.nd, 6), printed(&response.printed_nd));
    outln!("  Vd         {:>9}{}", figure(glass.vd, 4), printed(&response.printed_vd));
    outln!("  nF, nC     {:>9}, {}", figure(glass.n_f, 6), figure(glass.n_c, 6));
    let anomaly =
        glass.p_gf_anomaly.map_or(String::new(), |anomaly| format!("   {anomaly:+.4} from the normal line"));
    outln!("  PgF        {:>9}{anomaly}", figure(glass.p_gf, 4));
    if let Some([min, max]) = glass.range_um {
        outln!("  range      {min} to {max} um");
    }
    for e in &glass.expansion {
        let [from, to] = e.range_c;
        outln!("  expansion  {:>9.2}e-6/K from {from} to {to} C", e.per_k * 1e6);
    }
    if let Some(density) = glass.density_g_cm3 {
        outln!("  density    {density:>9.3} g/cm3");
    }
    if let Some(cost) = glass.relative_cost {
        outln!("  cost       {cost:>9.2} of the maker's reference glass");
    }
    let at = match (glass.temperature_c, glass.pressure_atm) {
        (Some(c), Some(atm)) => format!("   {c} C, {atm} atm"),
        _ => String::new(),
    };
    outln!("\n  line      um       index   dn/dT 1e-6/K   {PATH_MM} mm let through{at}");
    for line in &glass.lines {
        let dn_dt = figure(line.dn_dt_per_k.map(|v| v * 1e6), 2);
        let through = figure(line.transmission_10_mm, 4);
        let in_air = line.index_at.map_or(String::new(), |n| format!(" {n:>15.6}"));
        let row = format!(
            "  {:<3} {:>9.5} {:>11.6} {dn_dt:>14} {through:>19}{in_air}",
            line.line, line.um, line.index
        );
        outln!("{}", row.trim_end());
    }
    if glass.lines.iter().any(|line| line.dn_dt_per_k.is_some()) {
        let [from, to] = DN_DT_C;
        outln!("  dn/dT: of the index relative to air of the same temperature, mean from {from} to {to} C");
    }
    // Print the table for a lens file, without its long lists of absorption.
    let is_short = |line: &&str| !line.starts_with("transmission") && !line.starts_with("extinction");
    let table: Vec<String> = glass.table.lines().filter(is_short).map(|line| format!("  {line}")).collect();
    outln!("\n{}", table.join("\n"));
    if !glass.others_of_this_name.is_empty() {
        outln!("\n  other glasses of this name: {}", glass.others_of_this_name.join(", "));
    }
}
