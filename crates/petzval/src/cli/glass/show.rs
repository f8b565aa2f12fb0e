//! `petzval glass show`: all that is known of a glass.

use std::process::ExitCode;

use petzval::built_in_assets;
use petzval::files::write_catalog;
use petzval::optics::glass::{Glass, LINE_C_UM, LINE_D_UM, LINE_F_UM, LINE_G_UM, Printed};
use serde_json::{Value, json};

use super::figure;
use crate::cli::{Failure, print_json};

/// Show a glass of the catalogue.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Its name, or MAKER:NAME where several makers have one of that name
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

/// Spectral lines at which catalogues print indices: letter, um.
const LINES: [(&str, f64); 14] = [
    ("i", 0.365_014_6),
    ("h", 0.404_656_1),
    ("g", LINE_G_UM),
    ("F'", 0.479_991_4),
    ("F", LINE_F_UM),
    ("e", 0.546_074),
    ("d", LINE_D_UM),
    ("C'", 0.643_846_9),
    ("C", LINE_C_UM),
    ("r", 0.706_518_8),
    ("s", 0.852_11),
    ("t", 1.013_98),
    ("", 1.529_582),
    ("", 2.325_42),
];

/// Path for which transmission is shown, mm.
const PATH_MM: f64 = 10.0;

/// Temperatures between which dn/dT is shown, as on data sheets, degrees Celsius.
const DN_DT_C: [f64; 2] = [20.0, 40.0];

/// The partial dispersion of ordinary glasses, through K7 and F2: `P_gF = 0.6438 - 0.001682 V_d`.
const NORMAL_LINE: [f64; 2] = [0.6438, -0.001682];

/// Runs the verb.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let catalog = built_in_assets().catalog()?;
    let glass = catalog.get(&args.name).map_err(|unknown| {
        let nearest = unknown.nearest.join(", ");
        let hint = format!("the nearest names are {nearest}; `petzval glass list` shows every glass");
        Failure::input(format!("no glass is called `{}`", unknown.name), hint)
    })?;
    let air = match (args.temperature, args.pressure.unwrap_or(1.0)) {
        (None, _) => None,
        (Some(c), atm) if (-200.0..=1000.0).contains(&c) && (0.0..=100.0).contains(&atm) => Some((c, atm)),
        (Some(c), atm) => {
            let message = format!("--temperature {c} --pressure {atm}: no glass is used so");
            return Err(Failure::input(message, "degrees Celsius from -200 to 1000, atm from 0 to 100"));
        }
    };
    if air.is_some() && glass.index_at(LINE_D_UM, DN_DT_C[0], 1.0).is_none() {
        let message = format!("nobody says how {} changes with temperature", glass.name);
        return Err(Failure::input(message, "leave --temperature out"));
    }
    let others: Vec<String> = (catalog.all(&glass.name).iter())
        .filter(|other| **other != glass && !other.maker.is_empty())
        .map(|other| format!("{}:{}", other.maker.to_uppercase(), other.name))
        .collect();
    if args.json {
        return print_json(&to_json(&glass, air, &others));
    }
    print(&glass, air, &others);
    Ok(ExitCode::SUCCESS)
}

/// Change of the index relative to air with temperature, 1/K.
fn dn_dt(glass: &Glass, um: f64) -> Option<f64> {
    let [from, to] = DN_DT_C;
    Some((glass.index_at(um, to, 1.0)? - glass.index_at(um, from, 1.0)?) / (to - from))
}

/// The lines at which the formula holds.
fn lines(glass: &Glass) -> impl Iterator<Item = (&'static str, f64)> {
    LINES.into_iter().filter(|(_, um)| !glass.is_outside_range(*um) && glass.index(*um).is_finite())
}

/// How far the partial dispersion is from the normal line.
fn anomaly(glass: &Glass) -> f64 {
    glass.partial_dispersion_gf() - (NORMAL_LINE[0] + NORMAL_LINE[1] * glass.abbe_vd())
}

/// The glass as its table in a file.
fn table(glass: &Glass) -> String {
    write_catalog([glass]).trim().to_owned()
}

fn to_json(glass: &Glass, air: Option<(f64, f64)>, others: &[String]) -> Value {
    json!({
        "name": glass.name,
        "maker": glass.maker,
        "source": glass.source,
        "status": glass.status.map(|s| s.word()),
        "nd": glass.nd(),
        "vd": glass.abbe_vd(),
        "n_f": glass.index(LINE_F_UM),
        "n_c": glass.index(LINE_C_UM),
        "p_gf": glass.partial_dispersion_gf(),
        "p_gf_anomaly": anomaly(glass),
        "printed_nd": glass.printed_nd.map(|p| p.value),
        "printed_vd": glass.printed_vd.map(|p| p.value),
        "range_um": glass.range_um,
        "density_g_cm3": glass.density_g_cm3,
        "relative_cost": glass.relative_cost,
        "expansion": glass.expansion.iter().map(|e| json!({ "range_c": e.range_c, "per_k": e.per_k })).collect::<Vec<_>>(),
        "temperature_c": air.map(|air| air.0),
        "pressure_atm": air.map(|air| air.1),
        "lines": lines(glass).map(|(line, um)| json!({
            "line": line,
            "um": um,
            "index": glass.index(um),
            "index_at": air.and_then(|(c, atm)| glass.index_at(um, c, atm)),
            "dn_dt_per_k": dn_dt(glass, um),
            "transmission_10_mm": glass.internal_transmission(um, PATH_MM),
        })).collect::<Vec<_>>(),
        "others_of_this_name": others,
        "table": table(glass),
    })
}

fn print(glass: &Glass, air: Option<(f64, f64)>, others: &[String]) {
    let about: Vec<&str> = [glass.maker.as_str(), super::status(glass), glass.source.as_str()]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect();
    println!("{}  {}\n", glass.name, about.join(", "));
    let printed = |printed: Option<Printed>| printed.map_or(String::new(), |p| format!("   printed {p}"));
    println!("  nd         {:>9.6}{}", glass.nd(), printed(glass.printed_nd));
    println!("  Vd         {:>9}{}", figure(glass.abbe_vd(), 4), printed(glass.printed_vd));
    println!("  nF, nC     {:>9.6}, {:.6}", glass.index(LINE_F_UM), glass.index(LINE_C_UM));
    let anomaly = match anomaly(glass) {
        off if off.is_finite() => format!("   {off:+.4} from the normal line"),
        _ => String::new(),
    };
    println!("  PgF        {:>9}{anomaly}", figure(glass.partial_dispersion_gf(), 4));
    if let Some([min, max]) = glass.range_um {
        println!("  range      {min} to {max} um");
    }
    for e in &glass.expansion {
        let [from, to] = e.range_c;
        println!("  expansion  {:>9.2}e-6/K from {from} to {to} C", e.per_k * 1e6);
    }
    if let Some(density) = glass.density_g_cm3 {
        println!("  density    {density:>9.3} g/cm3");
    }
    if let Some(cost) = glass.relative_cost {
        println!("  cost       {cost:>9.2} of the maker's reference glass");
    }
    let at = air.map_or(String::new(), |(c, atm)| format!("   {c} C, {atm} atm"));
    println!("\n  line      um       index   dn/dT 1e-6/K   {PATH_MM} mm let through{at}");
    for (line, um) in lines(glass) {
        let dn_dt = dn_dt(glass, um).map_or("-".to_owned(), |v| format!("{:.2}", v * 1e6));
        let through = glass.internal_transmission(um, PATH_MM).map_or("-".to_owned(), |t| format!("{t:.4}"));
        let warm = air
            .and_then(|(c, atm)| glass.index_at(um, c, atm))
            .map_or(String::new(), |n| format!("{n:>16.6}"));
        let row = format!("  {line:<3} {um:>9.5} {:>11.6} {dn_dt:>14} {through:>19}{warm}", glass.index(um));
        println!("{}", row.trim_end());
    }
    // What a lens file would hold, without the long table of absorption.
    let table = table(glass);
    let formula =
        table.lines().filter(|line| !line.starts_with("transmission") && !line.starts_with("extinction"));
    println!("\n{}", formula.map(|line| format!("  {line}")).collect::<Vec<_>>().join("\n"));
    if !others.is_empty() {
        println!("\n  others of this name: {}", others.join(", "));
    }
}
