//! Error of the RMS spots of randomly perturbed lenses against many more rays, and their cost, by degree.
//!
//! `cargo run --release -p petzval-files --example tolerance_accuracy -- crates/petzval-data/data/lenses/cooke-triplet-nominal.toml [TRIALS]`

mod common;

use std::time::Instant;

use common::read_lens;
use petzval_optics::merit::{Merit, RmsSpot};
use petzval_optics::pupil::PupilSampling;
use petzval_optics::tolerance::{
    Distribution, Freedom, Grade, Study, Tolerances, default_tolerances, monte_carlo,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("a lens file")?;
    let trials: usize = std::env::args().nth(2).map_or(Ok(200), |n| n.parse())?;
    let lens = read_lens(&path)?.lens;
    for grade in [Grade::Commercial, Grade::Precision] {
        let tolerances = Tolerances {
            perturbations: default_tolerances(&lens, grade, Distribution::Normal, false),
            compensators: vec![(Freedom::focus(&lens), None)],
        };
        println!("{}, {grade:?}: {} perturbations", lens.name, tolerances.perturbations.len());
        let fine = RmsSpot { sampling: PupilSampling::Degree(16), ..RmsSpot::new(&lens) };
        for degree in [4, 6, 8, 10] {
            let merit = RmsSpot { sampling: PupilSampling::Degree(degree), ..RmsSpot::new(&lens) };
            let study = Study::new(&lens, &tolerances, &merit)?;
            let start = Instant::now();
            let found = monte_carlo(&study, 1, trials, &|| Ok(()))?;
            let took = start.elapsed().as_secs_f64();
            let (mut worst, mut square) = (0.0_f64, 0.0);
            let checked = trials.min(60);
            for (number, trial) in found.trials.iter().enumerate().take(checked) {
                let made = study.make(&study.draw(1, number as u64)).ok_or("no image")?;
                let exact = fine.value(&made.lens).ok_or("no image")?;
                let off = trial.value.ok_or("no image")? / exact - 1.0;
                worst = worst.max(off.abs());
                square += off * off / checked as f64;
            }
            let (mean, deviation) = found.mean_and_deviation();
            println!(
                "degree {degree:2}: {:.2} ms a lens; merit {mean:.3} +- {deviation:.3} um, off by {:.1e} RMS, {worst:.1e} at worst",
                1e3 * took / trials as f64,
                square.sqrt()
            );
        }
    }
    Ok(())
}
