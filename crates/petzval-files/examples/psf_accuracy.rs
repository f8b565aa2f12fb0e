//! Error of a PSF from pupil polynomials against one of ten million traced rays, for several pupil densities.
//!
//! `cargo run --release -p petzval-files --example psf_accuracy -- crates/petzval-data/data/lenses/cooke-triplet-nominal.toml 15`

mod common;

use common::read_lens;
use petzval_optics::psf::{PsfOptions, psf, psf_traced};
use petzval_optics::pupil::Quadrature;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("a lens file")?;
    let field: f64 = arguments.next().map_or(Ok(15.0), |a| a.parse())?;
    let cells: usize = arguments.next().map_or(Ok(3568), |a| a.parse())?;
    let lens = read_lens(&path)?.lens;
    let options = PsfOptions::default();
    let wavelengths = [0.62, 0.55, 0.486];
    let dense = Quadrature::grid(cells)?;
    println!("{}: {field} deg, reference of {} rays a colour", lens.name, 2 * dense.len());
    let reference =
        psf_traced(&lens, field.to_radians(), &wavelengths, &dense, &options).ok_or("no light")?;
    for cells in [64, 96, 128, 160, 192, 256, 384, 512] {
        let quadrature = Quadrature::grid(cells)?;
        let fast = psf(&lens, field.to_radians(), &wavelengths, &quadrature, &options).ok_or("no light")?;
        let slow =
            psf_traced(&lens, field.to_radians(), &wavelengths, &quadrature, &options).ok_or("no light")?;
        let distance = |p: &[Vec<f64>]| -> f64 {
            let l1 = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>();
            p.iter().zip(&reference.values).map(|(a, b)| l1(a, b)).sum::<f64>() / 3.0
        };
        println!(
            "{cells:4} cells: L1 {:.4} %, of traced rays alone {:.4} %; {:?}; illumination {:+.1e}",
            100.0 * distance(&fast.values),
            100.0 * distance(&slow.values),
            fast.method[0],
            fast.illumination[0] / reference.illumination[0] - 1.0
        );
    }
    Ok(())
}
