//! `train isp-proxy`: a network that imitates an ISP, and what the imitation costs.

mod plan;

use std::collections::BTreeMap;
use std::path::PathBuf;

use petzval_base::Cancel;
use petzval_camera::develop::{Demosaic, Domain};
use petzval_camera::isp::Isp;
use petzval_design::camera::isp_proxy::{Frame, Judge, ParameterSlope, ProxyTrainer, ScoreGap, StepLosses};
use petzval_design::error::DesignError;
use petzval_design::experiment::DevelopmentConfig;
use petzval_design::inputs;
use petzval_design::isp_frames::FrameSource;
use petzval_design::setup::Setup;
use petzval_files::isp_file::IspProxyFile;
use petzval_report::isp_proxy_sheet::{Pair, ScoreRow, Sheet, Slope, page};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::folder::{Kept as AnyKept, Training, WEIGHTS, train};
use super::request::{Request as AnyRequest, located, stopped};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::design::inputs_of;
use crate::error::{JobError, Result};
use crate::event::figures;
use crate::named_isp::{NamedIsp, isp_by_name};
use crate::range::check_ranges;

pub use self::plan::Plan;
pub use petzval_design::camera::isp_proxy::{Gap, ProxyTraining};

/// Frames of a training step, and their side in pixels: with the mirrored pixels around them 32 cells of the filter array, which three
/// levels halve without a rest.
const BATCH: usize = 8;
const SIDE: usize = 62;

/// Side of the held-out frames, pixels.
const HELD_OUT_SIDE: usize = 126;

/// Share of generated pictures among the scenes.
const GENERATED: f64 = 0.5;

/// Held-out frames on the page.
const SHOWN: usize = 3;

/// A training of a proxy.
pub type Request = AnyRequest<Plan>;

/// What the names in a plan stand for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Inputs {
    /// The ISP with its values.
    isp: String,
    /// SHA-256 of lens, sensor and photographs.
    scenes: String,
}

type Kept = AnyKept<Plan, Inputs, StepLosses>;

/// A trained proxy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub proxy: PathBuf,
    /// Page of its pictures beside those of the ISP.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub page: PathBuf,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    behind: Some(|request, context| match request {
        Request::New { plan, .. } => Ok(inputs_of(&context.assets.experiment(&plan.experiment)?)),
        Request::Resume { .. } => Ok(Vec::new()),
    }),
    ..Request::unit(|request, seed| {
        if let Request::New { plan, .. } = request {
            plan.training.seed = seed;
        }
    })
};

/// Trains a proxy and judges it.
///
/// The folder holds the weights, the description with the figures of the imitation (`proxy.toml`), pictures of proxy and ISP side by
/// side (`proxy.html`), and what is needed to continue (`training.json`).
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let plan = request.plan()?;
    let plan = Plan { isp: located(&plan.isp)?, experiment: located(&plan.experiment)?, ..plan };
    check_ranges(&plan.training)?;
    let mut named = isp_by_name(&plan.isp, &context.assets, context.cancel())?;
    named.set(&plan.set)?;
    named.set_bits(16);
    let varied = named.all_places(&plan.vary)?;
    let device = context.device("cpu")?;
    let setup = setup(&plan, context)?;
    let values = named.values(0.0)?;
    let inputs = Inputs { isp: named.in_words(&values), scenes: inputs::Inputs::of(&setup)?.fingerprint };
    let source = FrameSource::new(setup)?;
    let mut trainer =
        ProxyTrainer::new(named.isp(), varied.clone(), values.clone(), plan.training.clone(), &device)?;
    let what = format!("the ISP {}, or lens, sensor and photographs of {},", plan.isp, plan.experiment);
    let (folder, mut kept) = request.open(plan.clone(), inputs, &what)?;
    if kept.step > 0 {
        trainer.load(folder.state(kept.step)?)?;
    }
    let mut training = OnFrames { isp: named.isp(), trainer, source };
    train(&mut training, plan.training.steps, &folder, &mut kept, context)?;
    let OnFrames { trainer, source, .. } = training;

    let response = Response {
        isp: named.isp().name().to_owned(),
        varied: varied.len(),
        steps: kept.step,
        seconds: kept.seconds,
        gap: None,
        proxy: folder.description(),
        page: folder.page(),
    };
    let stop = || stopped::<Plan>(&folder, kept.step, &response, context);
    if kept.step < plan.training.steps {
        return Err(stop());
    }
    let judged = || {
        let frames = source.held_out()?;
        context.note(format!("comparing proxy and ISP on {} frames of unseen scenes", frames.len()));
        let (scores, cancel) = (context.scores()?, context.cancel());
        let judge = Judge { isp: named.isp(), frames: &frames, scores: &scores, cancel };
        let gap = judge.gap(trainer.proxy(), &values, &device)?;
        let sheet = sheet(&named, &gap, pictures(&named, &frames, &trainer, &values, cancel)?);
        Ok((gap, sheet))
    };
    let (gap, sheet) = match judged() {
        // The training is kept; a resumed one compares again.
        Err(JobError::Stopped(_)) => return Err(stop()),
        judged => judged?,
    };
    let description = description(&plan, &named, &varied, &values, &kept, &gap)?;
    let weights = [&trainer.save()?[0][..], &trainer.safetensors()?];
    folder.finish(weights, &page(&sheet), &[], &description, context)?;
    Ok(Response { gap: Some(gap), ..response })
}

/// Lens, sensor and photographs of the plan's experiment, with windows of the training's size.
fn setup(plan: &Plan, context: &Context) -> Result<Setup> {
    let mut experiment = context.assets.experiment(&plan.experiment)?;
    // Only the raw frames are wanted: the shortest development will do.
    experiment.development =
        DevelopmentConfig { demosaic: Demosaic::Bilinear, domain: Domain::Linear, restore: false };
    experiment.seed = plan.training.seed;
    experiment.training.batch = BATCH;
    experiment.training.crop = SIDE;
    experiment.training.dead_leaves = GENERATED;
    experiment.training.relight_ev = 0.0;
    experiment.scoring.crop = HELD_OUT_SIDE;
    experiment.scoring.places_per_side = 3;
    Ok(Setup::new(experiment, &context.assets, context.device("cpu")?)?)
}

/// A proxy in training, and the frames on which it is trained.
struct OnFrames<'a> {
    isp: &'a dyn Isp,
    trainer: ProxyTrainer,
    source: FrameSource,
}

impl Training for OnFrames<'_> {
    type Losses = StepLosses;

    fn step(&mut self, step: usize) -> Result<StepLosses> {
        Ok(self.trainer.step(self.isp, step, &self.source.training(step as u64)?)?)
    }

    fn mean(losses: &[StepLosses]) -> StepLosses {
        let mean = |of: fn(&StepLosses) -> f64| losses.iter().map(of).sum::<f64>() / losses.len() as f64;
        StepLosses {
            picture: mean(|l| l.picture),
            difference: mean(|l| l.difference),
            change: mean(|l| l.change),
        }
    }

    fn words(losses: &StepLosses) -> String {
        let StepLosses { picture, difference, change } = losses;
        format!("errors: picture {picture:.4}, change {difference:.4} of {change:.4}")
    }

    fn by_name(losses: &StepLosses) -> BTreeMap<String, f64> {
        let StepLosses { picture, difference, change } = *losses;
        figures([("picture", picture), ("difference", difference), ("change", change)])
    }

    fn state(&self) -> Result<[Vec<u8>; 2]> {
        Ok(self.trainer.save()?)
    }
}

fn description(
    plan: &Plan,
    named: &NamedIsp,
    varied: &[usize],
    values: &[f64],
    kept: &Kept,
    gap: &Gap,
) -> Result<IspProxyFile> {
    let name = |i: &usize| named.parameters[*i].name.clone();
    Ok(IspProxyFile {
        about: format!(
            "A network that imitates {}, trained by `petzval train isp-proxy` in {} steps; [gap] says how well.",
            named.isp().name(),
            kept.step
        ),
        proxy_of: plan.isp.clone(),
        weights: WEIGHTS.to_owned(),
        base_channels: plan.training.base_channels,
        levels: plan.training.levels,
        varied: varied.iter().map(name).collect(),
        values: named.parameters.iter().map(|p| p.name.clone()).zip(values.iter().copied()).collect(),
        training: table(plan)?,
        gap: table(gap)?,
    })
}

fn table(value: &impl Serialize) -> Result<toml::Table> {
    toml::Table::try_from(value).map_err(|e| JobError::failed(e.to_string()))
}

/// What the page shows.
fn sheet(named: &NamedIsp, gap: &Gap, pictures: Vec<Pair>) -> Sheet {
    let score = |of: &ScoreGap| ScoreRow {
        title: of.score.title.clone(),
        unit: of.score.unit.clone(),
        decimals: of.score.decimals,
        isp: of.isp,
        proxy: of.proxy,
    };
    let slope = |of: &ParameterSlope| Slope { parameter: of.name.clone(), isp: of.isp, proxy: of.proxy };
    Sheet {
        isp: named.isp().name().to_owned(),
        frames: gap.frames,
        psnr_db: [gap.psnr_at_centre_db, gap.psnr_near_db, gap.psnr_far_db],
        scores: gap.scores.iter().map(score).collect(),
        gradient_cosine: gap.gradient_cosine,
        slopes: gap.slopes.iter().map(slope).collect(),
        pictures,
    }
}

/// Some of the frames by ISP and proxy.
fn pictures(
    named: &NamedIsp,
    frames: &[Frame],
    trainer: &ProxyTrainer,
    values: &[f64],
    cancel: &Cancel,
) -> Result<Vec<Pair>> {
    let mut pairs = Vec::new();
    for frame in frames.iter().step_by((frames.len() / SHOWN).max(1)).take(SHOWN) {
        cancel.check()?;
        let isp = named.isp().develop(&frame.raw, values).map_err(DesignError::from)?;
        let proxy = trainer.proxy().develop(&frame.raw, values).map_err(DesignError::from)?;
        pairs.push(Pair { height: isp.height, width: isp.width, isp: isp.encoded(), proxy: proxy.encoded() });
    }
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_in_words_are_those_by_name() {
        let losses = StepLosses { picture: 0.125, difference: 0.02, change: 0.03 };
        assert_eq!(OnFrames::words(&losses), "errors: picture 0.1250, change 0.0200 of 0.0300");
        let named = figures([("picture", 0.125), ("difference", 0.02), ("change", 0.03)]);
        assert_eq!(OnFrames::by_name(&losses), named);
    }
}
