//! Workloads of the camera: a full frame rendered and exposed.

use std::sync::Arc;

use petzval_base::simd::level;
use petzval_base::simd::widest;
use petzval_camera::develop::Demosaic;
use petzval_camera::image::LinearImage;
use petzval_camera::isp::{Mesh, RawInput};
use petzval_camera::render::{Placement, RenderGeometry, kernel_radius, render, with_patches_for};
use petzval_camera::sensor::{
    Capture, CfaPattern, Exposure, Noise, NoiseMode, NonUniformity, SensorModel, expose,
};
use petzval_design::error::DesignError;
use petzval_design::experiment::PsfConfig;
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_optics::psf::PsfOptions;
use petzval_optics::pupil::Quadrature;

use super::workload::{Prepared, Workload};
use crate::built_in::built_in_assets;
use crate::error::{JobError, Result};
use crate::named_isp::isp_by_name;

const FRAME: (usize, usize) = (1200, 1920);
const ORIGIN: Placement = Placement { row: 0, col: 0 };

pub(super) fn workloads() -> Vec<Workload> {
    vec![
        Workload { name: "render_1200x1920", simd: widest, prepare: rendering },
        Workload { name: "sensor_1200x1920", simd: level, prepare: sensor },
        Workload { name: "malvar_1200x1920", simd: widest, prepare: || demosaicing(Demosaic::Malvar) },
        Workload { name: "rcd_1200x1920", simd: widest, prepare: || demosaicing(Demosaic::Rcd) },
        Workload { name: "menon_1200x1920", simd: widest, prepare: || demosaicing(Demosaic::Menon) },
        Workload { name: "isp_1200x1920", simd: level, prepare: || chip("real-time") },
        Workload { name: "isp_quality_1200x1920", simd: level, prepare: || chip("quality") },
    ]
}

/// A frame of smooth texture, three planes.
fn texture(height: usize, width: usize) -> LinearImage {
    let mut image = LinearImage::zeros(3, height, width);
    for (i, v) in image.data.iter_mut().enumerate() {
        let (x, y) = ((i % width) as f32, (i / width % height) as f32);
        *v = 0.4 + 0.2 * (0.11 * x).sin() * (0.07 * y).cos() + 0.1 * (0.9 * x + 0.7 * y).sin();
    }
    image
}

fn rendering() -> Result<Prepared> {
    let lens = built_in_assets().lens("cooke-triplet-nominal")?.lens;
    let quadrature = Quadrature::grid(64).map_err(DesignError::from)?;
    let plan = PsfPlan::new(31, 6.634, [0.62, 0.55, 0.486], PsfOptions::default(), quadrature);
    let bank = plan.bank(&lens)?;
    // As many patches as `simulate` and scoring take.
    let error = PsfConfig::default().scoring_blend_error;
    let (geometry, blend) =
        with_patches_for(&RenderGeometry::default(), &bank, error).map_err(DesignError::from)?;
    let border = kernel_radius(&geometry, &bank.layout()).map_err(DesignError::from)?;
    let scene = texture(FRAME.0 + 2 * border, FRAME.1 + 2 * border);
    let work = format!(
        "1920 x 1200 RGB, {} x {} blended PSFs from 31 fields, error {:.3} (L1, median), kernels included",
        geometry.patches.0, geometry.patches.1, blend.median
    );
    Ok(Prepared::new(work, move || Ok(render(&geometry, &bank, &scene, ORIGIN).map_err(DesignError::from)?)))
}

/// A raw frame of texture with noise, developed by the automotive ISP, shading and distortion included.
fn chip(preset: &str) -> Result<Prepared> {
    let sensor = built_in_assets().sensor("imx249-fitted")?;
    let exposure = Exposure { white_e: 16_000.0, time_s: 0.005, linear_gain: 1.0 };
    let capture = Capture { exposure, placement: ORIGIN, frame: 0 };
    let noise = Noise { mode: NoiseMode::Exact, seed: 1 };
    let light = texture(FRAME.0, FRAME.1);
    let raw = expose(&light, &sensor, &capture, &noise).map_err(DesignError::from)?;
    let mut frame = RawInput::from_raw(&raw, &sensor).map_err(DesignError::from)?;
    // A lens that dims towards the corners and stretches by a few pixels.
    let mesh = |of: fn(f32, f32) -> f32| {
        let node = |i: usize| of((i / 33) as f32 / 16.0 - 1.0, (i % 33) as f32 / 16.0 - 1.0);
        (0..33 * 33).map(node).collect::<Vec<f32>>()
    };
    let dimming = mesh(|y, x| 1.0 - 0.25 * (y * y + x * x));
    frame.about.shading = Some(Mesh { rows: 33, cols: 33, planes: vec![dimming; 3] });
    let planes = vec![mesh(|y, x| 4.0 * y * (y * y + x * x)), mesh(|y, x| 6.0 * x * (y * y + x * x))];
    frame.about.warp = Some(Mesh { rows: 33, cols: 33, planes });
    let isp = isp_by_name(preset, &built_in_assets(), &Arc::default())?;
    let values = isp.values(frame.about.gain_ev)?;
    let stages = isp.stage_times(&frame, &values)?;
    let stages: Vec<String> = stages.iter().map(|(stage, s)| format!("{stage} {:.1}", 1e3 * s)).collect();
    let work = format!(
        "1920 x 1200 raw, all stages of the preset {preset} of the automotive ISP, fixed-point; by the clock, ms: {}",
        stages.join(", ")
    );
    Ok(Prepared::new(work, move || {
        isp.isp().develop(&frame, &values).map_err(|e| JobError::failed(e.to_string()))
    })
    .counted((FRAME.0 * FRAME.1) as f64, "pixels"))
}

/// A mosaic of texture, demosaiced.
fn demosaicing(method: Demosaic) -> Result<Prepared> {
    let mosaic = texture(FRAME.0, FRAME.1).plane(1).to_vec();
    Ok(Prepared::new(format!("1920 x 1200 Bayer mosaic, {}", method.name()), move || {
        let picture = method.apply(&mosaic, FRAME.0, FRAME.1, CfaPattern::RGGB, ORIGIN);
        Ok(picture.map_err(DesignError::from)?)
    })
    .counted((FRAME.0 * FRAME.1) as f64, "pixels"))
}

/// A frame of an uneven specimen with every noise on, on one thread.
fn sensor() -> Result<Prepared> {
    let nonuniformity = NonUniformity {
        specimen: 1,
        dsnu_pixel_e: 3.0,
        dsnu_row_e: 0.5,
        dsnu_column_e: 0.8,
        prnu_pixel_percent: 1.0,
        prnu_row_percent: 0.1,
        prnu_column_percent: 0.2,
        hot_pixel_share: 1e-3,
        hot_pixel_e_per_s: 500.0,
        row_noise_e: 0.5,
        column_noise_e: 0.5,
    };
    let sensor = SensorModel { nonuniformity, ..built_in_assets().sensor("imx249-fitted")? };
    let light = texture(FRAME.0, FRAME.1);
    let exposure = Exposure { white_e: 16000.0, time_s: 0.005, linear_gain: 1.0 };
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let alone = alone.map_err(|e| JobError::failed(format!("no thread for the bench: {e}")))?;
    let mut frame = 0;
    let work = "1920 x 1200 Bayer frame, exact Poisson, read and electronics noise, DSNU, PRNU, hot pixels, row and \
               column noise";
    Ok(Prepared::new(work, move || {
        frame += 1;
        let capture = Capture { exposure, placement: ORIGIN, frame };
        let noise = Noise { mode: NoiseMode::Exact, seed: 1 };
        let raw = alone.install(|| expose(&light, &sensor, &capture, &noise));
        Ok(raw.map_err(DesignError::from)?)
    })
    .on_one_thread()
    .counted((FRAME.0 * FRAME.1) as f64, "pixels"))
}
