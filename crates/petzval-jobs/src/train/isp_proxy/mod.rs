//! `train isp-proxy`: a network that imitates an ISP, and what the imitation costs.

mod folder;
mod plan;

use std::path::PathBuf;
use std::time::Instant;

use petzval_camera::isp::{Demosaic, Domain, RgbPicture};
use petzval_design::experiment::DevelopmentConfig;
use petzval_design::isp_proxy::{Frame, FrameSource, Judge, ProxyTrainer, StepLosses};
use petzval_design::setup::Setup;
use petzval_files::isp_file::IspProxyFile;
use petzval_report::isp_strip::{Strip, StripStep, page};
use serde::{Deserialize, Serialize};

use self::folder::{Kept, ProxyFolder, WEIGHTS};
use crate::context::Context;
use crate::error::JobError;
use crate::isp::{NamedIsp, isp_by_name};

pub use self::plan::{Plan, Record};
pub use petzval_design::isp_proxy::{Gap, ProxyTraining};

/// Frames of a training step, and their side in pixels: with the mirrored pixels around them 32 cells of the filter array, which three
/// levels halve without a rest.
const BATCH: usize = 8;
const SIDE: usize = 62;

/// Side of the held-out frames, pixels.
const HELD_OUT_SIDE: usize = 126;

/// Share of generated pictures among the scenes.
const GENERATED: f64 = 0.5;

/// Steps between two records of the losses, and between two states from which training can continue.
const RECORD_EVERY: usize = 50;
const KEEP_EVERY: usize = 250;

/// Held-out frames on the page.
const SHOWN: usize = 3;

/// A training that begins, or one that is continued.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Request {
    /// From untrained weights.
    New {
        /// What is imitated, and how.
        plan: Box<Plan>,
        /// Folder for results and state; it must not hold a training.
        out: PathBuf,
    },
    /// Where the training in a folder ended.
    Resume {
        /// The folder.
        folder: PathBuf,
    },
}

/// A trained proxy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// Name of the ISP.
    pub isp: String,
    /// Number of parameters that vary.
    pub varied: usize,
    /// Steps that were taken.
    pub steps: usize,
    /// Time that they took, s.
    pub seconds: f64,
    /// How far the proxy is from the ISP; none if the job was cancelled.
    pub gap: Option<Gap>,
    /// Description of the proxy, which every verb takes that takes an ISP.
    pub proxy: PathBuf,
    /// Page of its pictures beside those of the ISP.
    pub page: PathBuf,
}

/// Trains a proxy and judges it.
///
/// The folder holds the weights, the description with the figures of the imitation (`proxy.toml`), pictures of proxy and ISP side by
/// side (`proxy.html`), and what is needed to continue (`training.json`).
pub fn run(request: &Request, context: &Context) -> Result<Response, JobError> {
    let (plan, resumed) = match request {
        Request::New { plan, .. } => (Plan::clone(plan), None),
        Request::Resume { folder } => {
            let (folder, kept) = ProxyFolder::open(folder)?;
            (kept.plan.clone(), Some((folder, kept)))
        }
    };
    if !(1..=1_000_000).contains(&plan.training.steps) {
        let hint = "4000 take minutes on two cores";
        return Err(JobError::setting("steps", plan.training.steps, "must lie between 1 and 1000000", hint));
    }
    let mut named = isp_by_name(&plan.isp, &context.assets)?;
    named.set(&plan.set)?;
    named.set_bits(16);
    let varied = named.all_places(&plan.vary)?;
    let device = context.device("cpu")?;
    let source = FrameSource::new(setup(&plan, context)?)?;
    let values = named.values(0.0)?;
    let mut trainer = ProxyTrainer::new(named.isp(), varied.clone(), values.clone(), plan.training, &device)?;
    let (folder, mut kept) = match (resumed, request) {
        (Some((folder, kept)), _) => {
            trainer.load(folder.state(&kept)?)?;
            (folder, kept)
        }
        (None, Request::New { out, .. }) => (ProxyFolder::create(out)?, Kept::new(plan.clone())),
        (None, Request::Resume { .. }) => return Err(JobError::failed("the training was not read")),
    };
    train(&mut trainer, &source, &folder, &mut kept, context)?;

    let response = Response {
        isp: named.isp().name().to_owned(),
        varied: varied.len(),
        steps: kept.step,
        seconds: kept.seconds,
        gap: None,
        proxy: folder.description(),
        page: folder.page(),
    };
    if kept.step < plan.training.steps {
        return Ok(response);
    }
    let frames = source.held_out()?;
    context.note(format!("comparing proxy and ISP on {} frames of unseen scenes", frames.len()));
    let judge = Judge { isp: named.isp(), frames: &frames, scores: &context.scores()? };
    let gap = judge.gap(trainer.proxy(), &values, &device)?;
    let description = description(&plan, &named, &varied, &values, &kept, &gap)?;
    let strip = strip(&named, &frames, &trainer, &values)?;
    folder.finish(&trainer.save()?[0], &description, &page(&strip))?;
    Ok(Response { gap: Some(gap), ..response })
}

/// Lens, sensor and photographs of the plan's experiment, with windows of the training's size.
fn setup(plan: &Plan, context: &Context) -> Result<Setup, JobError> {
    let mut experiment = context.assets.experiment(&plan.experiment)?;
    // Only the raw frames are wanted: the shortest development will do.
    experiment.development =
        DevelopmentConfig { demosaic: Demosaic::Bilinear, domain: Domain::Linear, restore: false };
    experiment.seed = plan.training.seed;
    experiment.training.batch = BATCH;
    experiment.training.crop = SIDE;
    experiment.training.dead_leaves = GENERATED;
    experiment.scoring.crop = HELD_OUT_SIDE;
    experiment.scoring.places_per_side = 3;
    Ok(Setup::new(experiment, &context.assets, context.device("cpu")?)?)
}

/// Goes on until the last step or until the job is cancelled.
fn train(
    trainer: &mut ProxyTrainer,
    source: &FrameSource,
    folder: &ProxyFolder,
    kept: &mut Kept,
    context: &Context,
) -> Result<(), JobError> {
    let steps = kept.plan.training.steps;
    let none = StepLosses { picture: 0.0, difference: 0.0, change: 0.0 };
    let (mut sum, mut count) = (none, 0);
    let mut clock = Instant::now();
    while kept.step < steps {
        let losses = trainer.step(kept.step, &source.training(kept.step as u64)?)?;
        kept.step += 1;
        sum.picture += losses.picture;
        sum.difference += losses.difference;
        sum.change += losses.change;
        count += 1;
        if kept.step.is_multiple_of(RECORD_EVERY) || kept.step == steps {
            let mean = |sum: f64| sum / f64::from(count);
            let losses = StepLosses {
                picture: mean(sum.picture),
                difference: mean(sum.difference),
                change: mean(sum.change),
            };
            kept.history.push(Record { step: kept.step, losses });
            let text = format!(
                "errors: picture {:.4}, change {:.4} of {:.4}",
                losses.picture, losses.difference, losses.change
            );
            context.progress(kept.step as u64, steps as u64, text);
            (sum, count) = (none, 0);
        }
        let is_cancelled = context.is_cancelled();
        if kept.step.is_multiple_of(KEEP_EVERY) || kept.step == steps || is_cancelled {
            kept.seconds += clock.elapsed().as_secs_f64();
            clock = Instant::now();
            folder.keep(kept, &trainer.save()?)?;
        }
        if is_cancelled {
            break;
        }
    }
    Ok(())
}

fn description(
    plan: &Plan,
    named: &NamedIsp,
    varied: &[usize],
    values: &[f64],
    kept: &Kept,
    gap: &Gap,
) -> Result<IspProxyFile, JobError> {
    let path = std::path::Path::new(&plan.isp);
    let proxy_of = match path.is_file() {
        true => std::path::absolute(path).map_err(|e| JobError::failed(e.to_string()))?.display().to_string(),
        false => plan.isp.clone(),
    };
    let name = |i: &usize| named.parameters[*i].name.clone();
    Ok(IspProxyFile {
        about: format!(
            "A network that imitates {}, trained by `petzval train isp-proxy` in {} steps; [gap] says how well.",
            named.isp().name(),
            kept.step
        ),
        proxy_of,
        weights: WEIGHTS.to_owned(),
        base_channels: plan.training.base_channels,
        levels: plan.training.levels,
        varied: varied.iter().map(name).collect(),
        values: named.parameters.iter().map(|p| p.name.clone()).zip(values.iter().copied()).collect(),
        training: table(plan)?,
        gap: table(gap)?,
    })
}

fn table(value: &impl Serialize) -> Result<toml::Table, JobError> {
    toml::Table::try_from(value).map_err(|e| JobError::failed(e.to_string()))
}

/// The pictures of ISP and proxy, one below the other.
fn strip(
    named: &NamedIsp,
    frames: &[Frame],
    trainer: &ProxyTrainer,
    values: &[f64],
) -> Result<Strip, JobError> {
    let failed = |e: petzval_camera::isp::IspError| JobError::failed(e.to_string());
    let step = |who: &str, i: usize, picture: &RgbPicture| StripStep {
        stage: format!("{who}, frame {}", i + 1),
        height: picture.height,
        width: picture.width,
        encoded: picture.encoded(),
        parameters: Vec::new(),
    };
    let mut steps = Vec::new();
    for (i, frame) in frames.iter().step_by((frames.len() / SHOWN).max(1)).take(SHOWN).enumerate() {
        for (who, isp) in [("ISP", named.isp()), ("proxy", trainer.proxy())] {
            steps.push(step(who, i, &isp.develop(&frame.raw, values).map_err(failed)?));
        }
    }
    Ok(Strip {
        raw: "frames of unseen scenes".to_owned(),
        isp: format!("{} and its proxy", named.isp().name()),
        steps,
    })
}
