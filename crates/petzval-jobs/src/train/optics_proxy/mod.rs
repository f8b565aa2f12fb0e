//! `train optics-proxy`: a network in place of ray tracing, as the paper had it, and what it costs.

use std::collections::BTreeMap;
use std::path::PathBuf;

use cpu_time::ProcessTime;
use petzval_camera::psf::PsfBank;
use petzval_design::camera::optics_proxy::{
    FILES, OpticsFieldGap, OpticsGap, OpticsJudge, OpticsLosses, ProxyDomain, ProxyOptics, ProxyOpticsTrainer,
};
use petzval_design::experiment::PsfsBy;
use petzval_design::lens::sampler::LensSampler;
use petzval_design::setup::Setup;
use petzval_files::optics_proxy_file::OpticsProxyFile;
use petzval_files::write_lens;
use petzval_report::optics_proxy_sheet::{FieldGap, Gap as ShownGap, PsfRow, Sheet, page};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::folder::{Kept as AnyKept, Training, WEIGHTS, train};
use super::request::{Request as AnyRequest, located, stopped};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::design::inputs_of;
use crate::error::{JobError, Result};
use crate::event::figures;
use crate::experiment::DEFAULT_EXPERIMENT;
use crate::range::check_ranges;

/// Lenses on which a network is judged.
const JUDGED_LENSES: usize = 50;

/// Lenses on the page, and fields of each.
const SHOWN_LENSES: usize = 3;
const SHOWN_FIELDS: usize = 5;

/// Turns the seed of a training into that of the lenses on which it is judged.
const UNSEEN: u64 = 0x756e_7365_656e;

petzval_base::parameters! {
    /// What is imitated, and how.
    pub struct Plan {
        /// Experiment that gives lens, bounds, sensor and PSFs.
        experiment: String = DEFAULT_EXPERIMENT.to_owned();
        /// Steps and size of the network.
        training: OpticsTraining = OpticsTraining::default();
    }
}

pub use petzval_design::camera::optics_proxy::OpticsTraining;

/// A training of a network.
pub type Request = AnyRequest<Plan>;

/// What the experiment of a plan stands for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Inputs {
    /// The lens file with its bounds.
    lens: String,
    domain: ProxyDomain,
    defocus_mm: f64,
}

type Kept = AnyKept<Plan, Inputs, OpticsLosses>;

/// A trained network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Name of the lens.
    pub lens: String,
    /// Numbers of the lens among the inputs.
    pub numbers: usize,
    /// Steps that were taken.
    pub steps: usize,
    /// Time that they took, s.
    pub seconds: f64,
    /// How far its PSFs are from exact ones; none if the job was cancelled.
    pub gap: Option<OpticsGap>,
    /// Description of the network, which a variant of an experiment takes as `optics_proxy`.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub proxy: PathBuf,
    /// Page of its PSFs beside exact ones.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub page: PathBuf,
}

impl Training for ProxyOpticsTrainer {
    type Losses = OpticsLosses;

    fn step(&mut self, step: usize) -> Result<OpticsLosses> {
        Ok(Self::step(self, step)?)
    }

    fn mean(losses: &[OpticsLosses]) -> OpticsLosses {
        let mean = |of: fn(&OpticsLosses) -> f64| losses.iter().map(of).sum::<f64>() / losses.len() as f64;
        OpticsLosses {
            psf: mean(|l| l.psf),
            slope: mean(|l| l.slope),
            illumination: mean(|l| l.illumination),
        }
    }

    fn words(losses: &OpticsLosses) -> String {
        let OpticsLosses { psf, slope, illumination } = losses;
        format!("errors: PSF {psf:.3}, slopes {slope:.3}, illumination {illumination:.4}")
    }

    fn by_name(losses: &OpticsLosses) -> BTreeMap<String, f64> {
        let OpticsLosses { psf, slope, illumination } = *losses;
        figures([("psf", psf), ("slope", slope), ("illumination", illumination)])
    }

    fn state(&self) -> Result<[Vec<u8>; 2]> {
        Ok(self.save()?)
    }
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

/// Trains a network and judges it on lenses that it has not seen.
///
/// The folder holds the weights, the lens with the bounds within which lenses are drawn, the description with the figures of the
/// comparison (`proxy.toml`), PSFs of network and tracing side by side (`proxy.html`), and what is needed to continue (`training.json`).
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let plan = request.plan()?;
    let plan = Plan { experiment: located(&plan.experiment)?, ..plan };
    check_ranges(&plan.training)?;
    let device = context.device("cpu")?;
    let mut experiment = context.assets.experiment(&plan.experiment)?;
    if experiment.psf.kind != PsfsBy::Geometric {
        experiment.psf.kind = PsfsBy::Geometric;
        context.note(
            "the network learns the PSFs of rays: experiments that use it have psf.kind = \"geometric\"",
        );
    }
    let setup = Setup::without_windows(experiment, &context.assets, device.clone())?;
    let start = setup.nominal().clone();
    if start.space.space().variables().is_empty() {
        let hint = "add [[variable]] entries with bounds to its file, or name another experiment";
        return Err(JobError::setting("lens", &setup.experiment.lens, "has no variables", hint));
    }
    let domain = ProxyDomain::of(&setup.moving_plan).map_err(|(key, hint)| {
        JobError::setting("experiment", &plan.experiment, format!("{key} cannot be imitated"), hint)
    })?;
    let sampler = |seed: u64| LensSampler::new(start.clone(), setup.moving_plan.clone(), seed);
    let mut trainer =
        ProxyOpticsTrainer::new(sampler(plan.training.seed), domain.clone(), plan.training.clone(), &device)?;
    let inputs = Inputs {
        lens: write_lens(&start.lens_file),
        domain: domain.clone(),
        defocus_mm: setup.experiment.optics.defocus_mm,
    };
    let what = format!("the lens, its bounds or the PSFs of {}", plan.experiment);
    let (folder, mut kept) = request.open(plan.clone(), inputs, &what)?;
    if kept.step > 0 {
        trainer.load(folder.state(kept.step)?)?;
    }
    train(&mut trainer, plan.training.steps, &folder, &mut kept, context)?;

    let response = Response {
        lens: start.lens_file.lens.name.clone(),
        numbers: start.space.dimension(),
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
    context
        .note(format!("comparing network and tracing on {JUDGED_LENSES} lenses that training has not seen"));
    let unseen = sampler(plan.training.seed ^ UNSEEN);
    let clock = || ProcessTime::now().as_duration().as_secs_f64();
    let judge = OpticsJudge { sampler: &unseen, lenses: JUDGED_LENSES, limit: &setup.limit, clock: &clock };
    let watch = |done| {
        context.progress(done as u64, JUDGED_LENSES as u64, "comparing");
        context.cancel().check()
    };
    let gap = match judge.gap(trainer.proxy(), &watch) {
        // The training is kept; a resumed one compares again.
        Err(error) if error.is_stopped() => return Err(stop()),
        gap => gap?,
    };
    let sheet = sheet(&unseen, trainer.proxy(), &gap)?;
    let description = description(&plan, &setup, &domain, trainer.proxy(), &kept, &gap)?;
    let weights = [&trainer.save()?[0][..], &trainer.safetensors()?];
    folder.finish(weights, &page(&sheet), &[(FILES[1], &kept.inputs.lens)], &description, context)?;
    Ok(Response { gap: Some(gap), ..response })
}

fn description(
    plan: &Plan,
    setup: &Setup,
    domain: &ProxyDomain,
    proxy: &ProxyOptics,
    kept: &Kept,
    gap: &OpticsGap,
) -> Result<OpticsProxyFile> {
    let table = |value: toml::ser::Error| JobError::failed(value.to_string());
    Ok(OpticsProxyFile {
        about: format!(
            "A network that gives the PSFs of lenses about \"{}\", trained by `petzval train optics-proxy` in {} steps; [gap] says how \
             well.",
            setup.nominal().lens_file.lens.name,
            kept.step
        ),
        lens: FILES[1].to_owned(),
        weights: WEIGHTS.to_owned(),
        wavelengths_um: domain.wavelengths_um,
        grid: domain.grid,
        pitch_um: domain.pitch_um,
        corner_mm: domain.corner_mm,
        defocus_mm: setup.experiment.optics.defocus_mm,
        hidden: plan.training.hidden,
        channels: plan.training.channels,
        mean: proxy.scale().mean.clone(),
        deviation: proxy.scale().deviation.clone(),
        training: toml::Table::try_from(plan).map_err(table)?,
        gap: toml::Table::try_from(gap).map_err(table)?,
    })
}

/// PSFs of unseen lenses, exact ones above those of the network.
fn sheet(unseen: &LensSampler, proxy: &ProxyOptics, gap: &OpticsGap) -> Result<Sheet> {
    let radii = &unseen.plan().field_radius_mm;
    let last = radii.len() - 1;
    let shown: Vec<usize> = (0..SHOWN_FIELDS).map(|i| i * last / (SHOWN_FIELDS - 1)).collect();
    let mut rows = Vec::new();
    for number in 0..SHOWN_LENSES {
        let (lens, traced) = unseen.lens(number as u64)?;
        let predicted = proxy.psfs(&lens, radii)?;
        for (who, bank) in [("exact", &traced.bank), ("network", &predicted.bank)] {
            let psfs = shown.iter().map(|field| psf(bank, *field)).collect();
            rows.push(PsfRow { name: format!("lens {}, {who}", number + 1), psfs });
        }
    }
    let name = unseen.start().lens_file.lens.name.clone();
    let fields_mm = shown.iter().map(|field| radii[*field]).collect();
    let (grid, pitch_um) = (proxy.domain().grid, proxy.domain().pitch_um);
    Ok(Sheet { lens: name, grid, pitch_um, fields_mm, rows, gap: shown_gap(gap) })
}

/// The figures of the comparison as the page shows them.
fn shown_gap(gap: &OpticsGap) -> ShownGap {
    let field = |of: &OpticsFieldGap| FieldGap {
        radius_mm: of.radius_mm,
        l1: of.l1,
        exact_rms_um: of.exact_rms_um,
        rms_um: of.rms_um,
    };
    ShownGap {
        lenses: gap.lenses,
        l1: gap.l1,
        exact_rms_um: gap.exact_rms_um,
        rms_um: gap.rms_um,
        centroid_um: gap.centroid_um,
        illumination: gap.illumination,
        gradient_cosine: [gap.gradient_cosine, gap.low_gradient_cosine],
        psfs_s: [gap.psfs.exact, gap.psfs.proxy],
        gradient_s: [gap.gradient.exact, gap.gradient.proxy],
        fields: gap.fields.iter().map(field).collect(),
    }
}

/// The three colours of a field.
fn psf(bank: &PsfBank, field: usize) -> Vec<f32> {
    let cells = 3 * bank.grid * bank.grid;
    bank.values[field * cells..][..cells].to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_in_words_are_those_by_name() {
        let losses = OpticsLosses { psf: 1.86, slope: 0.958, illumination: 0.0771 };
        let words = "errors: PSF 1.860, slopes 0.958, illumination 0.0771";
        assert_eq!(ProxyOpticsTrainer::words(&losses), words);
        let named = figures([("psf", 1.86), ("slope", 0.958), ("illumination", 0.0771)]);
        assert_eq!(ProxyOpticsTrainer::by_name(&losses), named);
    }
}
