//! Workloads of the lens: rays, spots, PSFs, and their gradients, on the nominal triplet.

use petzval::built_in_assets;
use petzval::design::error::DesignError;
use petzval::design::optics::PsfPlan;
use petzval::optics::gradient::LensGradient;
use petzval::optics::lens::Lens;
use petzval::optics::psf::{PsfCotangent, PsfOptions, psf, psf_with_tape};
use petzval::optics::pupil::{PupilSampling, Quadrature};
use petzval::optics::spot::mean_square_spot_sampled;
use petzval::optics::trace::{RayBundle, Seeds, launch, pull_back, trace};

use super::{Failure, Prepared, Workload};
use crate::cli::doctor::simd_level;

const FIELD_DEG: f64 = 15.0;
const WAVELENGTHS_UM: [f64; 3] = [0.62, 0.55, 0.486];

pub(super) fn workloads() -> Vec<Workload> {
    vec![
        Workload { name: "trace", simd: simd_level, prepare: || tracing(nominal()?) },
        Workload {
            name: "trace_all_aspheres",
            simd: simd_level,
            prepare: || tracing(all_aspheres(nominal()?)),
        },
        Workload { name: "trace_adjoint", simd: simd_level, prepare: adjoint },
        Workload {
            name: "spot_gradient_same_rays",
            simd: simd_level,
            prepare: || spot_gradient(PupilSampling::Fine, 1024),
        },
        Workload {
            name: "spot_gradient",
            simd: simd_level,
            prepare: || spot_gradient(PupilSampling::Degree(4), 56),
        },
        Workload { name: "psf_rgb", simd: simd_level, prepare: psf_rgb },
        Workload { name: "psf_rgb_gradient", simd: simd_level, prepare: psf_rgb_gradient },
        Workload { name: "psf_13_fields", simd: simd_level, prepare: psf_13_fields },
    ]
}

fn nominal() -> Result<Lens, Failure> {
    Ok(built_in_assets().lens("cooke-triplet-nominal")?.lens)
}

/// The same lens with a small r^4 term on every surface, so that each needs Newton's method.
fn all_aspheres(mut lens: Lens) -> Lens {
    for surface in &mut lens.surfaces {
        if surface.shape.is_conic() {
            surface.shape.asphere[1] = 1e-7;
        }
    }
    lens
}

fn quadrature(cells: usize) -> Result<Quadrature, Failure> {
    Ok(Quadrature::grid(cells).map_err(DesignError::from)?)
}

/// A square bundle of 128 x 128 rays that passes the entrance pupil off axis.
fn bundle(lens: &Lens) -> RayBundle {
    let sequence = lens.at_wavelength(lens.reference_um);
    let field = 10f64.to_radians();
    let mut rays = RayBundle::new(128 * 128);
    for i in 0..128 * 128 {
        let p = [i % 128, i / 128].map(|k| (k as f64 + 0.5) / 64.0 - 1.0);
        let at = [2.0 * p[0], 2.0 * p[1] - 20.6 * field.tan()];
        rays.set(i, launch(&sequence, field, at).ray);
    }
    rays
}

fn tracing(lens: Lens) -> Result<Prepared, Failure> {
    let (sequence, start) = (lens.at_wavelength(lens.reference_um), bundle(&lens));
    let units = (start.len() * sequence.surfaces.len()) as f64;
    Ok(Prepared {
        work: "128 x 128 rays through 7 surfaces".to_owned(),
        units: Some((units, "surface intersections")),
        single_thread: true,
        run: Box::new(move || {
            let mut rays = start.clone();
            trace(&sequence, &mut rays);
            std::hint::black_box(&rays);
            Ok(())
        }),
    })
}

fn adjoint() -> Result<Prepared, Failure> {
    let lens = nominal()?;
    let (sequence, start) = (lens.at_wavelength(lens.reference_um), bundle(&lens));
    let units = (start.len() * sequence.surfaces.len()) as f64;
    let mut seeds = Seeds::zero(start.len());
    seeds.image_x.fill(1.0);
    seeds.image_y.fill(1.0);
    Ok(Prepared {
        work: "128 x 128 rays forward and back, every number of the lens".to_owned(),
        units: Some((units, "surface intersections")),
        single_thread: true,
        run: Box::new(move || {
            let mut gradient = LensGradient::zero(sequence.surfaces.len());
            pull_back(&sequence, &start, &seeds, None, &mut gradient);
            std::hint::black_box(&gradient);
            Ok(())
        }),
    })
}

fn spot_gradient(sampling: PupilSampling, rays: usize) -> Result<Prepared, Failure> {
    let lens = nominal()?;
    let fields: Vec<f64> = (0..13).map(|i| (FIELD_DEG * f64::from(i) / 12.0).to_radians()).collect();
    Ok(Prepared {
        work: format!(
            "RMS spot and gradient, 13 fields x 3 wavelengths x {rays} rays (mirror images counted)"
        ),
        units: None,
        single_thread: false,
        run: Box::new(move || {
            std::hint::black_box(mean_square_spot_sampled(&lens, &fields, sampling));
            Ok(())
        }),
    })
}

fn psf_rgb() -> Result<Prepared, Failure> {
    let (lens, quadrature) = (nominal()?, quadrature(160)?);
    Ok(Prepared {
        work: "RGB PSF 128 x 128 at 1 um, 15 degrees, pupil of 160 x 160 cells".to_owned(),
        units: None,
        single_thread: true,
        run: Box::new(move || {
            let options = PsfOptions::default();
            std::hint::black_box(psf(&lens, FIELD_DEG.to_radians(), &WAVELENGTHS_UM, &quadrature, &options));
            Ok(())
        }),
    })
}

fn psf_rgb_gradient() -> Result<Prepared, Failure> {
    let (lens, quadrature) = (nominal()?, quadrature(160)?);
    let template: Vec<f64> = (0..128 * 128).map(|i| f64::from(i % 7)).collect();
    Ok(Prepared {
        work: "the same with the gradient to every number of the lens".to_owned(),
        units: None,
        single_thread: true,
        run: Box::new(move || {
            let options = PsfOptions::default();
            let field = FIELD_DEG.to_radians();
            let Some((psf, tape)) = psf_with_tape(&lens, field, &WAVELENGTHS_UM, &quadrature, &options)
            else {
                return Err(Failure::job("no light at 15 degrees"));
            };
            let wish = PsfCotangent { values: vec![template.clone(); 3], illumination: vec![1.0; 3] };
            std::hint::black_box(tape.gradient(&psf, &quadrature, &wish));
            Ok(())
        }),
    })
}

fn psf_13_fields() -> Result<Prepared, Failure> {
    let lens = nominal()?;
    let plan = PsfPlan::new(13, 6.634, WAVELENGTHS_UM, PsfOptions::default(), quadrature(160)?);
    Ok(Prepared {
        work: "13 fields x RGB, 128 x 128 at 1 um, pupil of 160 x 160 cells".to_owned(),
        units: None,
        single_thread: false,
        run: Box::new(move || {
            std::hint::black_box(plan.bank(&lens)?);
            Ok(())
        }),
    })
}
