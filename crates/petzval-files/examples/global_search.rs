//! Global search: starts from random lenses inside the bounds of a lens file, for two seconds per seed.
//!
//! `cargo run --release -p petzval-files --example global_search -- crates/petzval-data/data/lenses/cooke-triplet-nominal.toml [bfl-held|efl-free]`

mod common;

use std::time::Instant;

use common::read_lens;
use petzval_optics::merit::SpotResiduals;
use petzval_optics::optimize::{LevenbergOptions, Limits, Problem, Search, SearchOptions, descend};
use petzval_optics::pupil::PupilSampling;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("a lens file")?;
    let how = std::env::args().nth(2).unwrap_or_default();
    let seconds: f64 = std::env::args().nth(3).map_or(Ok(2.0), |a| a.parse())?;
    let file = read_lens(&path)?;
    let mut problem = Problem::new(file.lens);
    problem.variables = file.variables;
    problem.merit.wavelengths_um = vec![0.5875618];
    if how != "efl-free" {
        problem.solves = petzval_optics::design_space::Solves {
            efl: file.efl_solve.map(|s| petzval_optics::design_space::EflSolve { efl_mm: 25.0, ..s }),
            ..Default::default()
        };
    }
    if how == "bfl-held" {
        problem.limits = Limits { back_focal_mm: Some([24.395, 24.405]), ..Limits::default() };
    }
    for seed in 1..=6 {
        let start = Instant::now();
        let mut search =
            Search::new(&problem, SearchOptions { seed, own_lens: false, ..SearchOptions::default() })?;
        let mut log = String::new();
        while start.elapsed().as_secs_f64() < seconds {
            let before = search.best().map_or(f64::INFINITY, |f| f.analysis.merit);
            search.advance();
            if let Some(best) = search.best()
                && best.analysis.merit < 0.999 * before
            {
                log += &format!(" {:.2}s {:.3}", start.elapsed().as_secs_f64(), best.analysis.merit.sqrt());
            }
        }
        let (rounds, descents) = search.progress();
        if let Some(best) = search.best() {
            // Evaluate the same lens with ten times as many rays, refocused.
            let fine = Problem {
                base: best.analysis.lens.clone(),
                variables: Vec::new(),
                solves: petzval_optics::design_space::Solves::default(),
                merit: SpotResiduals { sampling: PupilSampling::Degree(20), ..problem.merit.clone() },
                ..problem.clone()
            };
            let fine = descend(&fine, &LevenbergOptions::default(), &mut |_, _, _| true)?;
            print!("{:.3} um by 736 rays; ", fine.best.mean_rms_um());
            println!(
                "seed {seed}: {:.3} um {:?} {rounds} rounds {descents} descents {:?};{log}",
                best.analysis.mean_rms_um(),
                best.analysis.rms_um.iter().map(|r| (r * 100.0).round() / 100.0).collect::<Vec<_>>(),
                best.analysis.violations
            );
        }
    }
    Ok(())
}
