//! `petzval design`: the main job.

use std::path::PathBuf;
use std::process::ExitCode;

use petzval::design::experiment::commented_toml;
use petzval::design::run::Metrics;
use petzval::jobs::design::{self, DEFAULT_EXPERIMENT, RunEnding};
use petzval::learn::score::Column;

use super::{EXIT_STOPPED, Failure, context, signals};

/// Design lens and network together, and compare with two controls.
///
/// The built-in experiment compares three variants, which get the same number of network steps on the same photographs in
/// the same order, at the same focal length, f-number, field of view and exposure: the nominal lens, a lens optimised for
/// its RMS spot alone, and lens and network designed together. The run folder holds the resolved experiment, every step,
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
    #[arg(long, value_name = "RUN", conflicts_with_all = ["experiment", "out", "seed", "photos", "steps", "variant"])]
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
    /// Make this variant of the experiment alone, and those from which it starts
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// Print the experiment with every key, default and change, and stop
    #[arg(long, conflicts_with = "resume")]
    print_config: bool,
    /// Where tensors live: see `petzval doctor`
    #[arg(long, default_value = "cpu")]
    device: String,
}

/// Runs the verb.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let stop = signals::stop_on_signal()?;
    let context = context().with_cancellation(stop).with_command(command_line());
    let new = design::NewRun {
        experiment: args.experiment,
        out: args.out,
        changes: design::Changes {
            seed: args.seed,
            photos: args.photos,
            steps: args.steps,
            variant: args.variant,
        },
    };
    if args.print_config {
        let experiment = design::resolved(&new, &context)?;
        print!("{}", commented_toml(&experiment)?);
        return Ok(ExitCode::SUCCESS);
    }
    let run = args.resume.map_or(design::Run::New(new), design::Run::Resume);
    let response = design::run(&design::Request { run, device: args.device }, &context)?;
    match response.ending {
        RunEnding::Stopped { step } => {
            // A path with spaces must survive being pasted.
            let root = response.run.display().to_string();
            let root = if root.contains(char::is_whitespace) { format!("'{root}'") } else { root };
            eprintln!("stopped at step {step}; go on with: petzval design --resume {root}");
            Ok(ExitCode::from(EXIT_STOPPED))
        }
        RunEnding::Finished { metrics, columns, report } => {
            print_table(&metrics, &columns);
            println!("\nreport: {}", report.display());
            Ok(ExitCode::SUCCESS)
        }
    }
}

fn command_line() -> String {
    std::env::args().collect::<Vec<_>>().join(" ")
}

/// The table that a run ends with.
pub fn print_table(metrics: &Metrics, columns: &[Column]) {
    let width = |c: &Column| c.title.chars().count().max(c.decimals + 4) + 1;
    print!("\n{:<16}", "camera");
    columns.iter().for_each(|c| print!(" {:>w$}", c.title, w = width(c)));
    println!(" {:>12} {:>8} {:>6} {:>8}", "RMS spot um", "EFL mm", "f/#", "FOV deg");
    for r in &metrics.rows {
        print!("{:<16}", r.camera);
        for c in columns {
            let value = r.scores.get(&c.name).copied().unwrap_or(f64::NAN);
            print!(" {value:>w$.d$}", w = width(c), d = c.decimals);
        }
        println!(" {:>12.2} {:>8.3} {:>6.3} {:>8.2}", r.rms_spot_um, r.efl_mm, r.f_number, r.fov_deg);
    }
    println!(
        "means over {} held-out photographs at {} places each; exposure {} e- of white; {} network steps each",
        metrics.held_out_images,
        metrics.held_out_places,
        metrics.rows.first().map_or(0.0, |r| r.white_e),
        metrics.rows.first().map_or(0, |r| r.network_steps),
    );
}
