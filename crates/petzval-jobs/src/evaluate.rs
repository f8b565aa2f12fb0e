//! `evaluate`: the cameras of a finished run scored again, with exact optics.

use std::path::PathBuf;

use petzval_design::block::Block;
use petzval_design::design_loop::finished_camera;
use petzval_design::inputs::check_inputs;
use petzval_design::run::{CameraMetrics, Kept, Metrics, RunFolder, load_blocks};
use petzval_design::run_report::{camera_lens, read_metrics};
use petzval_design::setup::Setup;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::design::scorer;
use crate::error::JobError;
use crate::report::warn_of_changed_config;

/// A finished run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Its folder.
    pub run: PathBuf,
    /// Where tensors live.
    pub device: String,
}

/// The figures, computed again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// The figures.
    pub metrics: Metrics,
    /// Largest absolute difference between a score or a spot radius and that of the run.
    pub largest_difference_from_run: f64,
}

/// Scores the cameras: lenses by exact tracing, pictures on the held-out photographs. The run folder stays as it is.
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let folder = RunFolder::open(&request.run)?;
    let kept = read_metrics(&folder)?;
    warn_of_changed_config(&folder, context)?;
    let experiment = context.assets.experiment_of_run(&folder)?;
    let setup = Setup::new(experiment, &context.assets, context.device(&request.device)?)?;
    check_inputs(&setup, &folder)?;
    let scorer = scorer(setup)?;
    let setup = scorer.setup();
    if scorer.scores() != kept.scores {
        return Err(JobError::input(
            format!("{}: the run has other scores than its config.toml names", request.run.display()),
            "put scoring.scores back as it was",
        ));
    }
    let mut rows: Vec<CameraMetrics> = Vec::new();
    for row in &kept.rows {
        context.note(format!("scoring {}", row.camera));
        let (mut isp, mut network) = (setup.isp(), setup.network()?);
        let blocks: [&mut dyn Block; 2] = [&mut isp, &mut network];
        load_blocks(&folder.camera(&row.camera), blocks, Kept::Numbers)?;
        let lens = camera_lens(&folder, &row.camera)?.lens;
        let camera = finished_camera(setup, lens, &isp, &network)?;
        let found = scorer.score(&row.camera, &camera)?.0;
        rows.push(CameraMetrics {
            is_ceiling: row.is_ceiling,
            isp_steps: row.isp_steps,
            network_steps: row.network_steps,
            ..found
        });
    }
    let largest = rows.iter().zip(&kept.rows).fold(0.0_f64, |worst, (a, b)| {
        let scores = a.scores.iter().map(|(name, value)| value - b.scores.get(name).unwrap_or(&f64::NAN));
        let off = scores.chain([a.rms_spot_um - b.rms_spot_um]).map(f64::abs);
        // `max` alone would drop a NaN.
        off.fold(worst, |worst, off| if worst.is_nan() || off.is_nan() { f64::NAN } else { worst.max(off) })
    });
    Ok(Response { metrics: Metrics { rows, ..kept }, largest_difference_from_run: largest })
}
