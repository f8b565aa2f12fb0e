//! Lenses that tests share: the nominal Cooke triplet, built by hand, and every lens of `data/lenses`.

use std::sync::Arc;

use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::lens::{ASPHERE_TERMS, Lens, ObjectDistance, Surface, SurfaceShape};

/// The triplet of `data/lenses/cooke-triplet-nominal.toml`.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn nominal_triplet() -> Lens {
    let glass = |name: &str, dispersion| Arc::new(Glass { name: name.into(), dispersion });
    let pmma = glass(
        "PMMA",
        Dispersion::Schott([
            2.1864582,
            -0.00024475348,
            0.014155787,
            -0.00044329781,
            7.7664259e-05,
            -2.9936382e-06,
        ]),
    );
    let flint = glass(
        "N-SF11",
        Dispersion::Sellmeier {
            b: vec![1.73759695, 0.313747346, 1.89878101],
            c_um2: vec![0.013188707, 0.0623068142, 155.23629],
        },
    );
    let surface = |radius: f64, asphere: &[f64], thickness_mm, glass: &Arc<Glass>, semi| {
        let mut a = [0.0; ASPHERE_TERMS];
        a[..asphere.len()].copy_from_slice(asphere);
        Surface {
            label: String::new(),
            shape: SurfaceShape { curvature: 1.0 / radius, conic: 0.0, asphere: a },
            thickness_mm,
            glass: glass.clone(),
            semi_diameter_mm: semi,
        }
    };
    let air = Glass::air();
    Lens {
        name: "Cooke triplet, nominal".into(),
        source: String::new(),
        surfaces: vec![
            surface(11.34, &[0.0, -4.06e-5, 1.3e-7, -5.02e-9, -2.8e-11], 4.014, &pmma, 7.733),
            surface(11.45, &[], 8.11, &air, 6.415),
            surface(-39.57, &[], 3.0, &flint, 4.56),
            surface(39.57, &[], 3.53, &air, 4.161),
            surface(f64::INFINITY, &[], 0.848, &air, 2.7298),
            surface(15.38, &[0.0, -2.07e-4, -4.4e-7, 4.42e-7, -2.23e-8], 2.698, &pmma, 3.594),
            surface(-13.05, &[], 24.525171110552694, &air, 3.606),
        ],
        stop: 4,
        entrance_pupil_mm: 5.7,
        object: ObjectDistance::Infinity,
        wavelengths_um: vec![0.486, 0.55, 0.62],
        reference_um: 0.5875618,
        fields_deg: vec![0.0, 5.0, 10.0, 15.0],
    }
}

/// Every lens of `data/lenses`.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn all_lenses() -> Vec<petzval_optics::format::LensFile> {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data");
    let toml_files = |folder: &str| -> Vec<String> {
        let mut paths: Vec<_> =
            std::fs::read_dir(data.join(folder)).unwrap().map(|e| e.unwrap().path()).collect();
        paths.sort();
        paths
            .iter()
            .filter(|p| p.extension().is_some_and(|e| e == "toml"))
            .map(|p| std::fs::read_to_string(p).unwrap())
            .collect()
    };
    let mut catalog = petzval_optics::glass::Catalog::default();
    for text in toml_files("glasses") {
        catalog.merge(petzval_optics::glass::Catalog::parse(&text).unwrap());
    }
    toml_files("lenses").iter().map(|t| petzval_optics::format::parse_lens(t, &catalog).unwrap()).collect()
}
