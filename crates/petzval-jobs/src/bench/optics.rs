//! Workloads of the lens: rays, spots, PSFs, and their gradients, on the nominal triplet.

use petzval_base::simd::level;
use petzval_camera::psf::PsfBank;
use petzval_design::error::DesignError;
use petzval_design::experiment::PsfConfig;
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_design::lens::view::surfaces;
use petzval_optics::analysis::{AnalysisOptions, analyze};
use petzval_optics::design_space::{EflSolve, Solves, Variable};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::merit::SpotResiduals;
use petzval_optics::number::Number;
use petzval_optics::optimize::{LevenbergOptions, Problem, descend};
use petzval_optics::paraxial::first_order;
use petzval_optics::psf::{PsfCotangent, PsfKind, PsfOptions, psf, psf_with_tape};
use petzval_optics::pupil::{PupilSampling, Quadrature};
use petzval_optics::spot::mean_square_spot_sampled;
use petzval_optics::trace::{RayBundle, Seeds, launch, pull_back, trace};
use petzval_report::lens_sheet::{PICTURES, page};

use super::workload::{Prepared, Workload};
use crate::built_in::built_in_assets;
use crate::error::{JobError, Result};

const FIELD_DEG: f64 = 15.0;
const WAVELENGTHS_UM: [f64; 3] = [0.62, 0.55, 0.486];

pub(super) fn workloads() -> Vec<Workload> {
    vec![
        Workload { name: "trace", simd: level, prepare: || tracing(nominal()?) },
        Workload { name: "trace_all_aspheres", simd: level, prepare: || tracing(all_aspheres(nominal()?)) },
        Workload { name: "trace_adjoint", simd: level, prepare: adjoint },
        Workload {
            name: "spot_gradient_same_rays",
            simd: level,
            prepare: || spot_gradient(PupilSampling::Fine, 1024),
        },
        Workload {
            name: "spot_gradient",
            simd: level,
            prepare: || spot_gradient(PupilSampling::Degree(4), 56),
        },
        Workload { name: "psf_rgb", simd: level, prepare: psf_rgb },
        Workload { name: "psf_rgb_gradient", simd: level, prepare: psf_rgb_gradient },
        Workload { name: "psf_13_fields", simd: level, prepare: psf_13_fields },
        Workload { name: "joint_psfs", simd: level, prepare: joint_psfs },
        Workload { name: "joint_psfs_waves", simd: level, prepare: joint_psfs_waves },
        Workload { name: "lm_iteration", simd: level, prepare: lm_iteration },
        Workload { name: "triplet_recovery", simd: level, prepare: triplet_recovery },
        Workload { name: "lens_analyze", simd: level, prepare: lens_analyze },
    ]
}

pub(super) fn nominal() -> Result<Lens> {
    Ok(built_in_assets().lens("cooke-triplet-nominal")?.lens)
}

/// The same lens with a small r^4 term on every surface, so that every surface needs Newton's method.
fn all_aspheres(mut lens: Lens) -> Lens {
    for surface in &mut lens.surfaces {
        if surface.shape.is_conic() {
            surface.shape.asphere[1] = 1e-7;
        }
    }
    lens
}

fn quadrature(cells: usize) -> Result<Quadrature> {
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

fn tracing(lens: Lens) -> Result<Prepared> {
    let (sequence, start) = (lens.at_wavelength(lens.reference_um), bundle(&lens));
    let units = (start.len() * sequence.surfaces.len()) as f64;
    Ok(Prepared::new("128 x 128 rays through 7 surfaces", move || {
        let mut rays = start.clone();
        trace(&sequence, &mut rays);
        Ok(rays)
    })
    .on_one_thread()
    .counted(units, "surface intersections"))
}

fn adjoint() -> Result<Prepared> {
    let lens = nominal()?;
    let (sequence, start) = (lens.at_wavelength(lens.reference_um), bundle(&lens));
    let units = (start.len() * sequence.surfaces.len()) as f64;
    let mut seeds = Seeds::zero(start.len());
    seeds.image_x.fill(1.0);
    seeds.image_y.fill(1.0);
    let work = "128 x 128 rays forward and back, every number of the lens";
    Ok(Prepared::new(work, move || {
        let mut gradient = LensGradient::zero(sequence.surfaces.len());
        pull_back(&sequence, &start, &seeds, None, &mut gradient);
        Ok(gradient)
    })
    .on_one_thread()
    .counted(units, "surface intersections"))
}

fn spot_gradient(sampling: PupilSampling, rays: usize) -> Result<Prepared> {
    let lens = nominal()?;
    let fields: Vec<f64> = (0..13).map(|i| (FIELD_DEG * f64::from(i) / 12.0).to_radians()).collect();
    let work =
        format!("RMS spot and gradient, 13 fields x 3 wavelengths x {rays} rays (mirror images counted)");
    Ok(Prepared::new(work, move || Ok(mean_square_spot_sampled(&lens, &fields, sampling))))
}

fn psf_rgb() -> Result<Prepared> {
    let (lens, quadrature) = (nominal()?, quadrature(160)?);
    let work = "RGB PSF 128 x 128 at 1 um, 15 degrees, pupil of 160 x 160 cells";
    Ok(Prepared::new(work, move || {
        let options = PsfOptions::default();
        Ok(psf(&lens, FIELD_DEG.to_radians(), &WAVELENGTHS_UM, &quadrature, &options))
    })
    .on_one_thread())
}

fn psf_rgb_gradient() -> Result<Prepared> {
    let (lens, quadrature) = (nominal()?, quadrature(160)?);
    let template: Vec<f64> = (0..128 * 128).map(|i| f64::from(i % 7)).collect();
    let work = "the same with the gradient to every number of the lens";
    Ok(Prepared::new(work, move || {
        let options = PsfOptions::default();
        let field = FIELD_DEG.to_radians();
        let Some((psf, tape)) = psf_with_tape(&lens, field, &WAVELENGTHS_UM, &quadrature, &options) else {
            return Err(JobError::failed("no light at 15 degrees"));
        };
        let cotangent =
            PsfCotangent { values: vec![template.clone(); 3], illumination: vec![1.0; 3], chief_y: 0.0 };
        Ok(tape.gradient(&psf, &quadrature, &cotangent))
    })
    .on_one_thread())
}

fn psf_13_fields() -> Result<Prepared> {
    let lens = nominal()?;
    let plan = PsfPlan::new(13, 6.634, WAVELENGTHS_UM, PsfOptions::default(), quadrature(160)?);
    let work = "13 fields x RGB, 128 x 128 at 1 um, pupil of 160 x 160 cells";
    Ok(Prepared::new(work, move || Ok(plan.bank(&lens)?)))
}

/// The optics of `joint_step` by rays: its settings are those of the built-in experiments.
fn joint_psfs() -> Result<Prepared> {
    let PsfConfig { pupil_cells, .. } = PsfConfig::default();
    joint_psfs_of(PsfKind::Geometric, &format!("pupil of {pupil_cells} x {pupil_cells} cells"))
}

/// The same by waves.
fn joint_psfs_waves() -> Result<Prepared> {
    joint_psfs_of(PsfKind::Diffraction, "by waves")
}

fn joint_psfs_of(kind: PsfKind, how: &str) -> Result<Prepared> {
    let (lens, config) = (nominal()?, PsfConfig { kind: kind.into(), ..PsfConfig::default() });
    let plan = config.plan(&built_in_assets().sensor("imx249-fitted")?, config.pupil_cells)?;
    let work = format!(
        "{} fields x RGB, {} x {}, {how}, and back to every number of the lens",
        config.fields, config.grid, config.grid
    );
    Ok(Prepared::new(work, move || {
        let traced = plan.trace(&lens)?;
        let PsfBank { values, illumination, field_radius_mm, .. } = &traced.bank;
        let by_radius = vec![1.0; field_radius_mm.len()];
        Ok(plan.gradient(&traced, values, illumination, &by_radius))
    }))
}

/// A variable with bounds at half and twice its value, or at a thousandth of a mm^(1-n) to both sides if it is zero.
fn around(lens: &Lens, surface: usize, number: Number) -> Variable {
    let value = number.read_stated(lens, surface);
    let (min, max) = if value == 0.0 { (-1e-3, 1e-3) } else { (0.5 * value, 2.0 * value) };
    Variable { surface, number, min: min.min(max), max: max.max(min) }
}

/// The last curvature keeps the focal length of the nominal lens.
fn nominal_efl(lens: &Lens) -> Solves {
    let efl_mm = first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
    Solves { efl: Some(EflSolve { surface: 6, efl_mm, radius_mm: None }), ..Solves::default() }
}

fn lm_iteration() -> Result<Prepared> {
    let lens = nominal()?;
    let mut variables: Vec<Variable> = Vec::new();
    for surface in [0, 1, 2, 3, 5] {
        variables.push(around(&lens, surface, Number::Curvature));
    }
    for surface in [0, 1, 3, 4, 5] {
        variables.push(around(&lens, surface, Number::Thickness));
    }
    for surface in [0, 5] {
        variables.push(around(&lens, surface, Number::Conic));
        for order in [2, 4, 6, 8, 10, 12, 14, 16] {
            let tiny = 10f64.powi(-2 - order);
            let limits = |v: f64| (v - v.abs() - tiny, v + v.abs() + tiny);
            let number = Number::Asphere(order as usize / 2 - 1);
            let (min, max) = limits(number.read(&lens, surface));
            variables.push(Variable { surface, number, min, max });
        }
    }
    let count = variables.len();
    let problem = Problem {
        variables,
        solves: nominal_efl(&lens),
        merit: SpotResiduals {
            fields_rad: (0..10).map(|i| (FIELD_DEG * f64::from(i) / 9.0).to_radians()).collect(),
            field_weights: vec![1.0; 10],
            wavelengths_um: WAVELENGTHS_UM.to_vec(),
            sampling: PupilSampling::Fine,
            power: 1.0,
        },
        ..Problem::new(lens)
    };
    let work = format!(
        "Jacobian and three trial steps; 10 fields x 3 wavelengths x 1024 rays (mirror images counted), {count} variables \
             and the image plane"
    );
    Ok(Prepared::new(work, move || {
        let options = LevenbergOptions { iterations: 1, tolerance: 0.0, ..LevenbergOptions::default() };
        descend(&problem, &options, &mut |_, _, _| true).map_err(|e| JobError::failed(e.to_string()))
    })
    .on_one_thread())
}

fn triplet_recovery() -> Result<Prepared> {
    let lens = nominal()?;
    let still = Problem::new(lens.clone());
    let go = |problem: &Problem| {
        descend(problem, &LevenbergOptions::default(), &mut |_, _, _| true)
            .map_err(|e| JobError::failed(e.to_string()))
    };
    let nominal_um = go(&still)?.best.mean_rms_um();
    let solves = nominal_efl(&lens);
    let mut disturbed = lens;
    for (i, s) in disturbed.surfaces.iter_mut().enumerate() {
        s.shape.curvature *= if i % 2 == 0 { 1.05 } else { 0.95 };
    }
    let variables = [0, 1, 2, 3, 5].map(|s| around(&disturbed, s, Number::Curvature)).to_vec();
    let problem = Problem { variables, solves, ..Problem::new(disturbed) };
    let work = "every curvature 5 % off, to no more than the nominal RMS spot; 4 fields x 3 wavelengths";
    Ok(Prepared::new(work, move || {
        let options = LevenbergOptions::default();
        let target = nominal_um * (1.0 + 1e-9);
        let descent = descend(&problem, &options, &mut |_, analysis, _| analysis.mean_rms_um() > target)
            .map_err(|e| JobError::failed(e.to_string()))?;
        if descent.best.mean_rms_um() > target {
            return Err(JobError::failed(format!("only {:.3} um", descent.best.mean_rms_um())));
        }
        Ok(())
    })
    .on_one_thread())
}

fn lens_analyze() -> Result<Prepared> {
    let lens = nominal()?;
    let work = "every analysis, as data, 15 pictures and a page; 4 fields x 3 wavelengths";
    Ok(Prepared::new(work, move || {
        let analysis = analyze(&lens, &AnalysisOptions::default(), &|| Ok(()))
            .map_err(|e| JobError::failed(e.to_string()))?;
        std::hint::black_box(serde_json::to_string(&analysis).map_err(|e| JobError::failed(e.to_string()))?);
        for picture in PICTURES {
            std::hint::black_box(picture.svg(&analysis));
        }
        std::hint::black_box(page(&analysis, &surfaces(&lens), PICTURES));
        Ok(())
    }))
}
