//! Computes `crates/petzval-data/data/spectra/srgb-basis.csv`: the three smoothest reflectances whose mixtures give linear sRGB.
//!
//! `cargo run --release -p petzval-camera --example srgb_basis > crates/petzval-data/data/spectra/srgb-basis.csv`
//!
//! Minimise `sum_k |D rho_k|^2` (D: second differences over 380..780 nm every 5 nm) subject to
//!
//! * `XYZ(rho_k; D65) = ` column k of the matrix of linear sRGB with that white,
//! * `rho_R + rho_G + rho_B = 1` and `0 <= rho_k <= 1` at every wavelength.
//!
//! Method: Mallett and Yuksel 2019. Eliminating `rho_B = 1 - rho_R - rho_G` leaves a convex quadratic program. A
//! primal-dual interior-point method solves it.

use nalgebra::{DMatrix, DVector};
use petzval_camera::spectral::{Illuminant, Spectrum, cie1931, integral, xyz_from_srgb};

const SAMPLES: usize = 81;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let wavelength_um: Vec<f64> = (0..SAMPLES).map(|i| 0.38 + 0.005 * i as f64).collect();
    let d65 = Illuminant::named("D65")?.power;

    // XYZ of a reflectance is linear in its samples: integrate each hat function for its weight.
    let hat = |i: usize| {
        Spectrum::new(wavelength_um.clone(), (0..SAMPLES).map(|k| f64::from(u8::from(k == i))).collect())
    };
    let mut weights = DMatrix::zeros(3, SAMPLES);
    for i in 0..SAMPLES {
        for (row, curve) in cie1931().iter().enumerate() {
            weights[(row, i)] = integral(&[&hat(i)?, &d65, curve]);
        }
    }
    // Scale to Y = 1 for white over the whole range of the observer, as the library does.
    let luminance = integral(&[&d65, &cie1931()[1]]);
    weights /= luminance;
    let white = [0, 1, 2].map(|row| weights.row(row).sum());
    let primaries = xyz_from_srgb(white);

    // Variables: samples of rho_R, then of rho_G.
    let n = 2 * SAMPLES;
    let mut differences = DMatrix::zeros(SAMPLES - 2, SAMPLES);
    for i in 0..SAMPLES - 2 {
        (differences[(i, i)], differences[(i, i + 1)], differences[(i, i + 2)]) = (1.0, -2.0, 1.0);
    }
    let bending = differences.transpose() * &differences;
    let mut p = DMatrix::zeros(n, n);
    for (row, col, factor) in [(0, 0, 2.0), (1, 1, 2.0), (0, 1, 1.0), (1, 0, 1.0)] {
        p.view_mut((row * SAMPLES, col * SAMPLES), (SAMPLES, SAMPLES)).copy_from(&(&bending * factor));
    }
    let (mut a, mut b) = (DMatrix::zeros(6, n), DVector::zeros(6));
    for k in 0..2 {
        a.view_mut((3 * k, k * SAMPLES), (3, SAMPLES)).copy_from(&weights);
        for row in 0..3 {
            b[3 * k + row] = primaries[row][k];
        }
    }
    // rho_R >= 0, rho_G >= 0, rho_R + rho_G <= 1. Together these also bound all three by 1.
    let m = 3 * SAMPLES;
    let (mut g, mut h) = (DMatrix::zeros(m, n), DVector::zeros(m));
    for i in 0..SAMPLES {
        g[(i, i)] = -1.0;
        g[(SAMPLES + i, SAMPLES + i)] = -1.0;
        (g[(2 * SAMPLES + i, i)], g[(2 * SAMPLES + i, SAMPLES + i)]) = (1.0, 1.0);
        h[2 * SAMPLES + i] = 1.0;
    }
    let x = quadratic_program(&p, &a, &b, &g, &h).ok_or("the quadratic program has no solution")?;

    println!("# Computed by the example srgb_basis of petzval-camera; method of Mallett and Yuksel 2019.");
    println!("wavelength_nm,red,green,blue");
    for i in 0..SAMPLES {
        let (red, green) = (x[i].clamp(0.0, 1.0), x[SAMPLES + i].clamp(0.0, 1.0));
        println!("{},{red:.12},{green:.12},{:.12}", 380 + 5 * i, (1.0 - red - green).max(0.0));
    }
    Ok(())
}

/// Minimises `x' P x / 2` subject to `A x = b`, `G x <= h`, following the central path `s_i z_i = mu` to mu = 1e-16.
fn quadratic_program(
    p: &DMatrix<f64>,
    a: &DMatrix<f64>,
    b: &DVector<f64>,
    g: &DMatrix<f64>,
    h: &DVector<f64>,
) -> Option<DVector<f64>> {
    let (n, equalities, inequalities) = (p.nrows(), a.nrows(), g.nrows());
    let mut x = DVector::from_element(n, 1.0 / 3.0);
    let mut y = DVector::zeros(equalities);
    let (mut s, mut z) = (DVector::from_element(inequalities, 1.0), DVector::from_element(inequalities, 1.0));
    for _ in 0..200 {
        let mu = s.dot(&z) / inequalities as f64;
        let dual = p * &x + a.transpose() * &y + g.transpose() * &z;
        let (equal, slack) = (a * &x - b, g * &x + &s - h);
        if mu < 1e-16 && equal.amax() < 1e-13 && slack.amax() < 1e-13 {
            return Some(x);
        }
        // Eliminate slacks and multipliers from Newton's equations for s z = mu / 5.
        let target = 0.2 * mu;
        let ratio = z.component_div(&s);
        let pull = DVector::from_fn(inequalities, |i, _| ratio[i] * slack[i] - z[i] + target / s[i]);
        let mut kkt = DMatrix::zeros(n + equalities, n + equalities);
        kkt.view_mut((0, 0), (n, n)).copy_from(&(p + g.transpose() * DMatrix::from_diagonal(&ratio) * g));
        kkt.view_mut((0, n), (n, equalities)).copy_from(&a.transpose());
        kkt.view_mut((n, 0), (equalities, n)).copy_from(a);
        let mut right = DVector::zeros(n + equalities);
        right.rows_mut(0, n).copy_from(&-(&dual + g.transpose() * &pull));
        right.rows_mut(n, equalities).copy_from(&-equal);
        let step = kkt.lu().solve(&right)?;
        let (dx, dy) = (step.rows(0, n).into_owned(), step.rows(n, equalities).into_owned());
        let ds = -(&slack + g * &dx);
        let dz = DVector::from_fn(inequalities, |i, _| target / s[i] - z[i] - ratio[i] * ds[i]);
        // Shorten the step so that every slack and multiplier keeps at least a hundredth of its value.
        let room = |v: &DVector<f64>, d: &DVector<f64>| {
            v.iter().zip(d.iter()).filter(|(_, d)| **d < 0.0).map(|(v, d)| -0.99 * v / d).fold(1.0, f64::min)
        };
        let length = room(&s, &ds).min(room(&z, &dz));
        x += length * dx;
        y += length * dy;
        s += length * ds;
        z += length * dz;
    }
    None
}
