//! `petzval design`: the main job.

mod progress;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use petzval::built_in_assets;
use petzval::design::design_loop::{DesignLoop, Ending};
use petzval::design::experiment::Experiment;
use petzval::design::inputs::{check_inputs, keep_inputs};
use petzval::design::run::{Metrics, RunFolder, write_atomically};
use petzval::design::setup::{BUILT_IN_PHOTOS, Setup};

use super::{EXIT_STOPPED, Failure, context, doctor, report, signals};

/// The experiment that runs when none is named.
const DEFAULT_EXPERIMENT: &str = "cooke-triplet-image-quality";

/// Design lens and network together, and compare with two controls.
///
/// Three cameras get the same number of network steps on the same photographs in the same order, at the same
/// focal length, f-number, field of view and exposure: the nominal lens, a lens optimised for its RMS spot
/// alone, and lens and network designed together. The run folder holds the resolved experiment, every step,
/// checkpoints, the lenses, held-out pictures, metrics.json and report.html.
///
/// Ctrl-C finishes the step at hand, writes a checkpoint and exits with 75; --resume goes on from there.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Experiment file, or the name of a built-in one
    #[arg(default_value = DEFAULT_EXPERIMENT)]
    experiment: String,
    /// Folder of the run [default: runs/<experiment>-seed-<seed>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with the run in this folder
    #[arg(long, value_name = "RUN", conflicts_with_all = ["experiment", "out", "seed", "photos", "steps"])]
    resume: Option<PathBuf>,
    /// Seed of everything random
    #[arg(long)]
    seed: Option<u64>,
    /// Folder of pictures to use in place of the built-in photographs; every fourth, by name, is held out
    #[arg(long, value_name = "DIR")]
    photos: Option<PathBuf>,
    /// Network steps of each camera, in place of the experiment's; lens steps in proportion
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Where tensors live: see `petzval doctor`
    #[arg(long, default_value = "cpu")]
    device: String,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let stop = signals::stop_on_signal()?;
    let assets = built_in_assets();
    let device = context().device(&args.device)?;
    let (setup, folder) = match &args.resume {
        Some(root) => {
            let folder = RunFolder::open(root)?;
            let experiment = assets.experiment(&folder.config().display().to_string())?;
            let setup = Setup::new(experiment, &assets, device)?;
            check_inputs(&setup, &folder)?;
            (setup, folder)
        }
        None => {
            let experiment = changed(assets.experiment(&args.experiment)?, &args)?;
            // Everything is checked before the folder is made, so that a mistake leaves nothing behind.
            let setup = Setup::new(experiment, &assets, device)?;
            let root = args.out.clone().unwrap_or_else(|| default_root(&args.experiment, &setup.experiment));
            let folder = RunFolder::create(&root)?;
            let environment = doctor::environment();
            let text = serde_json::to_string_pretty(&environment).map_err(|e| Failure::job(e.to_string()))?;
            write_atomically(&folder.environment(), text.as_bytes())?;
            keep_inputs(&setup, &assets, &folder)?;
            (setup, folder)
        }
    };
    let _only_one = folder.lock()?;
    eprintln!("{}", setup.experiment.name);
    eprintln!("run folder: {}", folder.root().display());
    let mut progress = progress::Progress::new();
    let ending = DesignLoop::new(&setup, &folder)?.run(&mut progress, &stop)?;
    progress.finish();
    match ending {
        Ending::Stopped(step) => {
            // A path with spaces must survive being pasted.
            let root = folder.root().display().to_string();
            let root = if root.contains(char::is_whitespace) { format!("'{root}'") } else { root };
            eprintln!("stopped at step {step}; go on with: petzval design --resume {root}");
            Ok(ExitCode::from(EXIT_STOPPED))
        }
        Ending::Finished(metrics) => {
            let report = report::write(&setup, &folder)?;
            print_table(&metrics);
            println!("\nreport: {}", report.display());
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// The experiment with what the command line changes; paths are made absolute, so that `config.toml` can be
/// run again from anywhere.
fn changed(mut experiment: Experiment, args: &Args) -> Result<Experiment, Failure> {
    if let Some(seed) = args.seed {
        experiment.seed = seed;
    }
    if let Some(photos) = &args.photos {
        experiment.photos = absolute(photos)?;
    }
    for name in [&mut experiment.lens, &mut experiment.sensor] {
        if Path::new(name.as_str()).is_file() {
            *name = absolute(Path::new(name.as_str()))?;
        }
    }
    if experiment.photos != BUILT_IN_PHOTOS && Path::new(&experiment.photos).is_dir() {
        experiment.photos = absolute(Path::new(&experiment.photos))?;
    }
    if let Some(steps) = args.steps {
        if steps == 0 {
            return Err(Failure::input("--steps 0: nothing to do", "give at least one network step"));
        }
        let share = steps as f64 / experiment.training.steps as f64;
        experiment.optics.steps = (experiment.optics.steps as f64 * share).ceil() as usize;
        experiment.spot.steps = (experiment.spot.steps as f64 * share).ceil() as usize;
        experiment.training.steps = steps;
    }
    Ok(experiment)
}

fn absolute(path: &Path) -> Result<String, Failure> {
    let path = std::fs::canonicalize(path).map_err(|error| {
        Failure::input(format!("{}: {error}", path.display()), "give a folder or file that exists")
    })?;
    Ok(path.display().to_string())
}

fn default_root(name: &str, experiment: &Experiment) -> PathBuf {
    let stem = Path::new(name).file_stem().map_or_else(|| "run".into(), |s| s.to_string_lossy().into_owned());
    Path::new("runs").join(format!("{stem}-seed-{}", experiment.seed))
}

/// The table that a run ends with.
pub fn print_table(metrics: &Metrics) {
    println!(
        "\n{:<16} {:>9} {:>9} {:>7} {:>12} {:>8} {:>6} {:>8}",
        "camera", "1-LPIPS", "PSNR dB", "SSIM", "RMS spot um", "EFL mm", "f/#", "FOV deg"
    );
    for r in &metrics.rows {
        println!(
            "{:<16} {:>9.4} {:>9.2} {:>7.4} {:>12.2} {:>8.3} {:>6.3} {:>8.2}",
            r.camera, r.one_minus_lpips, r.psnr_db, r.ssim, r.rms_spot_um, r.efl_mm, r.f_number, r.fov_deg
        );
    }
    println!(
        "means over {} held-out photographs at {} places each; exposure {} e- of white; {} network steps each",
        metrics.held_out_images,
        metrics.held_out_places,
        metrics.rows.first().map_or(0.0, |r| r.white_e),
        metrics.rows.first().map_or(0, |r| r.network_steps),
    );
}
