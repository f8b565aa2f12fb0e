//! `petzval design`: the main job.

use std::path::{Path, PathBuf};

use crate::base::pasted;
use crate::cli::code::Code;
use crate::jobs::design::{self, FITTED};
use crate::jobs::{JobError, experiment, settings_of};

use super::choice::choice;
use super::defaults::word;
use super::failure::Failure;
use super::first_look;
use super::plain::shown;
use super::score_table;
use super::signals;
use super::terminal::{Terminal, ending};

/// Design lens and network together, and compare with controls.
///
/// `petzval experiment list` names the built-in experiments, among them those that look for pedestrians, vehicles and traffic lights. The one that
/// runs without a name compares three variants: the nominal lens, a lens optimised for its RMS spot alone, and lens
/// and network designed together. All get the same number of network steps on the same photographs in the same order,
/// at the same focal length, f-number, field of view and exposure. The run folder holds the resolved experiment, every
/// step, checkpoints, the lenses, held-out pictures, metrics.json and report.html.
///
/// That one takes minutes. An experiment with a detector takes half an hour to six hours on a core; for a trial, lower `street.windows`,
/// `street.held_out` and `training.steps` in a copy of its file (--print-config).
///
/// Ctrl-C gives the current step up, writes a checkpoint and exits with 75; --resume takes that step again and goes on.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Experiment file, or the name of a built-in one; or a lens file, for which `petzval init --lens` would write an experiment
    #[arg(default_value = word(design::NewRun::default().experiment))]
    experiment: String,
    /// Folder of the run [default: runs/<experiment>-seed-<seed>, with --variant runs/<experiment>-<variant>-seed-<seed>; a file experiment.toml is called by its folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Continue the run in this folder; --photos or --data say where its pictures are now, if they were moved
    #[arg(long, value_name = "RUN", conflicts_with_all = ["experiment", "out", "seed", "steps", "full", "variant", "set"])]
    resume: Option<PathBuf>,
    /// Make every camera of the resumed run longer, so that its network takes N steps in all; the lens steps in proportion.
    /// The further steps are a stage of their own, with learning rates that begin and fall again. Not for experiments in which a
    /// variant starts from another, as in those with a detector
    #[arg(long, value_name = "N", requires = "resume", conflicts_with_all = ["experiment", "out", "seed", "steps", "full", "variant", "set"])]
    extend_to: Option<usize>,
    /// Believe this file or folder of the resumed run though it does not agree with its digest, such as checkpoints/step-000012; may be repeated
    #[arg(long, value_name = "NAME", requires = "resume")]
    accept_changed: Vec<String>,
    /// Seed of everything random
    #[arg(long)]
    seed: Option<u64>,
    /// Folder of pictures to use in place of the built-in photographs; every fourth, by name, is held out
    #[arg(long, value_name = "DIR")]
    photos: Option<PathBuf>,
    /// Folder of labelled pictures in place of generated streets: with label images, or with boxes in COCO format; see `petzval data`. The part
    /// `train` trains and the others are held out; the largest trains if none is called so; every fifth sequence is held out where no parts are
    /// named
    #[arg(long, value_name = "DIR", conflicts_with = "photos")]
    data: Option<PathBuf>,
    /// N in place of the experiment's `training.steps`, or of its `isp.steps` where a hardware ISP makes pictures for people; all other steps follow in
    /// proportion, those of a detector that is trained before the cameras as well. Scores take as long as ever
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// The budget of a night on a GPU in place of minutes on two cores. The camera with the most steps gets 40000 network steps of 16
    /// windows, and the network is twice as wide. Give --photos with many pictures as well. A detector and the windows of streets stay as
    /// they are: see detector.backbone and street.windows
    #[arg(long, conflicts_with = "steps")]
    full: bool,
    /// Make only this variant of the experiment, and the variants from which it starts; may be repeated
    #[arg(long, value_name = "NAME")]
    variant: Vec<String>,
    /// A value in place of one of the experiment's file, such as training.steps=400 or psf.kind=diffraction; may be repeated. Keys are paths; a
    /// variant is named by its name, as in variant.end-to-end.noise=off. Values are TOML, and a bare word is a text
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print the experiment, with every default filled in and the changes of these options, and stop
    #[arg(long, conflicts_with = "resume")]
    print_config: bool,
    /// Look at the experiment as before its first step, and stop: spots, light on the PSFs' grid, requirements, field against sensor, photographs
    /// and steps. Exit code 2 says that a run would be worthless
    #[arg(long, conflicts_with_all = ["resume", "print_config"])]
    check: bool,
    /// With --check: machine-readable output
    #[arg(long, requires = "check")]
    json: bool,
    /// Write losses, scores and figures of the lens after every step in a further form, too: event files of TensorBoard, a folder for each
    /// variant below RUN/tensorboard, and the same numbers as RUN/scalars.csv. A run that has them goes on with them
    #[arg(long, value_name = "FORM", value_parser = choice::<design::LogForm>())]
    log: Option<design::LogForm>,
    /// Device for tensors; `petzval doctor` lists them
    #[arg(long, default_value = word(design::Request::default().device))]
    device: String,
}

/// Runs the verb.
pub fn run(args: Args, terminal: &Terminal) -> Result<Code, Failure> {
    let stop = signals::stop_on_signal()?;
    let context = terminal.context().with_cancellation(stop).with_command(terminal.command_line());
    let run = match args.resume {
        Some(run) => design::Run::Resume(design::Resume {
            run,
            extend_to: args.extend_to,
            photos: args.photos,
            data: args.data,
            accept_changed: args.accept_changed,
        }),
        None => design::Run::New(design::NewRun {
            experiment: args.experiment.into(),
            out: args.out,
            changes: design::Changes {
                seed: args.seed,
                photos: args.photos,
                data: args.data,
                steps: args.steps,
                is_full: args.full,
                variant: design::VariantNames::of(args.variant),
                set: settings_of(&args.set)?,
            },
        }),
    };
    if let (true, design::Run::New(new)) = (args.print_config, &run) {
        let resolved = design::resolved(new, &context)?;
        if resolved.lens.ends_with(FITTED) {
            let lens = pasted(Path::new(&new.experiment.to_string()));
            outln!("# Lens and sensor are those that `petzval init --lens {lens}` writes.");
        }
        out!("{}", experiment::with_every_key(&resolved)?);
        return Ok(Code::SUCCESS);
    }
    if let (true, design::Run::New(new)) = (args.check, &run) {
        return first_look::print(&design::look(new, &args.device, &context)?, args.json);
    }
    let request = design::Request { run, device: args.device, log: args.log.into_iter().collect() };
    let design::Response { metrics, report, sentences, .. } = match design::run(&request, &context) {
        Ok(response) => response,
        Err(JobError::Stopped(stopped)) if stopped.resume.is_some() => {
            let run = stopped.kept.first().map_or_else(String::new, |run| pasted(run));
            return Ok(ending(Some(&stopped), &format!("continue with: petzval design --resume {run}")));
        }
        Err(error) => return Err(error.into()),
    };
    score_table::print(&metrics);
    if !sentences.is_empty() {
        outln!();
    }
    sentences.iter().for_each(|sentence| outln!("{sentence}"));
    outln!("\nreport: {}", shown(&report));
    Ok(Code::SUCCESS)
}
