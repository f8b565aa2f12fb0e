//! `petzval evaluate`: score the cameras of a run again, with exact optics.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::built_in_assets;
use petzval::design::cameras::CameraKind;
use petzval::design::design_loop::{light_path, new_task};
use petzval::design::error::DesignError;
use petzval::design::inputs::check_inputs;
use petzval::design::run::{CameraMetrics, Metrics, RunFolder};
use petzval::design::run_report::{camera_lens, read_metrics};
use petzval::design::scoring::score_camera;
use petzval::design::setup::Setup;
use petzval::learn::loss::Lpips;
use serde_json::json;

use super::{Failure, context, print_json};

/// Score the cameras of a finished run again: lenses by exact tracing, pictures on the held-out photographs.
///
/// Nothing in the run folder is changed. The table says how far each figure is from the run's own.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Run folder
    run: PathBuf,
    /// Where tensors live
    #[arg(long, default_value = "cpu")]
    device: String,
    /// Machine-readable output
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let folder = RunFolder::open(&args.run)?;
    let kept = read_metrics(&folder)?;
    let assets = built_in_assets();
    let experiment = assets.experiment(&folder.config().display().to_string())?;
    let setup = Setup::new(experiment, &assets, context().device(&args.device)?)?;
    check_inputs(&setup, &folder)?;
    let path = light_path(&setup);
    let lpips = Lpips::from_safetensors(&setup.lpips_weights, &setup.device).map_err(DesignError::from)?;
    let mut rows: Vec<CameraMetrics> = Vec::new();
    for kind in CameraKind::ALL {
        eprintln!("scoring {}", kind.name());
        let lens = camera_lens(&folder, kind)?.lens;
        let mut task = new_task(&setup)?;
        task.load(&folder.camera(kind.name())).map_err(DesignError::from)?;
        rows.push(score_camera(&setup, &path, kind.name(), &lens, task.as_ref(), &lpips)?.0);
    }
    let largest = rows.iter().zip(&kept.rows).fold(0.0_f64, |worst, (a, b)| {
        let off = |x: f64, y: f64| (x - y).abs();
        worst
            .max(off(a.one_minus_lpips, b.one_minus_lpips))
            .max(off(a.psnr_db, b.psnr_db))
            .max(off(a.ssim, b.ssim))
            .max(off(a.rms_spot_um, b.rms_spot_um))
    });
    let metrics = Metrics { rows, ..kept };
    if args.json {
        let value = serde_json::to_value(&metrics).map_err(|e| Failure::job(e.to_string()))?;
        return print_json(&json!({ "metrics": value, "largest_difference_from_run": largest }));
    }
    super::design::print_table(&metrics);
    println!("largest difference from the run's own figures: {largest:.3e}");
    Ok(ExitCode::SUCCESS)
}
