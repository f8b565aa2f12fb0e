//! Error of an RMS spot by quadrature against a fine grid of traced rays, and its cost, by degree.
//!
//! `cargo run --release -p petzval-files --example spot_accuracy -- crates/petzval-data/data/lenses/cooke-triplet-nominal.toml`

mod common;

use std::time::Instant;

use common::read_lens;
use petzval_optics::number::Number;
use petzval_optics::pupil::{PupilSampling, Quadrature};
use petzval_optics::spot::{mean_square_spot_sampled, mean_square_spot_traced};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("a lens file")?;
    let lens = read_lens(&path)?.lens;
    let fields: Vec<f64> = (0..13).map(|i| f64::to_radians(15.0 * f64::from(i) / 12.0)).collect();
    let (reference, slopes) =
        mean_square_spot_traced(&lens, &fields, &Quadrature::grid(384)?).ok_or("no light")?;
    println!("{}: RMS {:.6} um of 13 fields to 15 degrees", lens.name, reference.sqrt());
    for degree in [4, 6, 8, 10, 12, 16, 20] {
        let start = Instant::now();
        let mut found = None;
        for _ in 0..20 {
            found = mean_square_spot_sampled(&lens, &fields, PupilSampling::Degree(degree));
        }
        let took = start.elapsed().as_secs_f64() / 20.0;
        let (value, gradient) = found.ok_or("no light")?;
        let by = |g: &petzval_optics::gradient::LensGradient| {
            (0..g.surfaces()).map(|i| g[(i, Number::Curvature)]).collect::<Vec<_>>()
        };
        let (a, b) = (by(&gradient), by(&slopes));
        let off: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
        let size: f64 = b.iter().map(|b| b * b).sum::<f64>().sqrt();
        println!(
            "degree {degree:2}: RMS off by {:+.1e}, gradient by {:.1e}; {:.3} ms",
            value.sqrt() / reference.sqrt() - 1.0,
            off / size,
            1e3 * took
        );
    }
    Ok(())
}
