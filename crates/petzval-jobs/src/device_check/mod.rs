//! The check of a device before a training: its convolutions beside the CPU's, its memory over many steps.

mod networks;

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use petzval_camera::device::{DeviceFacts, facts, keep_tuning_in};
use petzval_design::convolutions::convolutions_of;
use petzval_design::run::{RunFolder, VERSION, write_file};
use petzval_design::setup::Setup;
use petzval_learn::Device;
use petzval_learn::convolution::Convolution;
use petzval_learn::device_check::{ConvolutionCheck, MemoryCheck, check_convolution, check_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::device::{device, keep_tuning_for_the_user};
use crate::error::{JobError, Result, json};

use networks::all_convolutions;

/// Largest difference by the largest value of a pass where all numbers have 24 bits.
const TOLERANCE: f64 = 1e-5;

/// The same where a card rounds factors to TF32, which has 11.
const TOLERANCE_TF32: f64 = 2e-3;

/// Steps of the check of memory, and what they are taken on.
const STEPS: usize = 300;
const BATCH: [usize; 4] = [4, 8, 96, 96];

/// The same on a device that is a program on the CPU, which is slow.
const SOFTWARE_BATCH: [usize; 4] = [1, 8, 16, 16];

/// What the check of a device found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DeviceReport {
    /// Its name in requests: `cpu`, `wgpu` or `cuda`.
    pub device: String,
    /// Its own name, such as that of a card; empty for the CPU.
    pub name: String,
    /// Its driver with the driver's version; empty where it is not known.
    pub driver: String,
    /// True if it is a program on the CPU in place of a card. Then every batch is one picture, and memory is looked at on smaller ones.
    pub is_software: bool,
    /// Version of Petzval.
    pub version: String,
    /// Largest permitted difference from the CPU, by the largest value of a pass.
    pub tolerance: f64,
    /// The convolutions that were tried, from little work to much.
    pub convolutions: Vec<ConvolutionCheck>,
    /// Those for which there was no time.
    pub left_out: Vec<Convolution>,
    /// Networks at which there was no time to look.
    pub networks_left_out: Vec<String>,
    /// Memory over many steps; none where the device says nothing of it, or there was no time.
    pub memory: Option<MemoryCheck>,
    /// How it ended.
    pub verdict: Verdict,
    /// Seconds that it took.
    pub seconds: f64,
}

/// How the check of a device ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Everything agrees with the CPU, and memory stays.
    Passed,
    /// What there was time for agrees.
    Unfinished,
    /// Something differs, grows or fails: nothing may be trained on the device.
    Failed,
}

impl DeviceReport {
    /// Every problem, on one line each.
    pub fn problems(&self) -> Vec<String> {
        let of =
            |check: &ConvolutionCheck| Some(format!("{}: {}", check.convolution, check.problem.as_ref()?));
        let memory = self.memory.as_ref().and_then(|memory| memory.problem.clone());
        self.convolutions.iter().filter_map(of).chain(memory).collect()
    }

    /// Whether it was made for the same device, driver and version. A driver that a card does not name may be another one every time.
    fn is_of(&self, other: &Subject) -> bool {
        if !self.name.is_empty() && self.driver.is_empty() {
            return false;
        }
        let theirs = (&*other.device, &*other.facts.name, &*other.facts.driver, VERSION);
        (&*self.device, &*self.name, &*self.driver, &*self.version) == theirs
    }
}

/// A device that is checked.
struct Subject {
    device: String,
    facts: DeviceFacts,
    tensors: Device,
}

impl Subject {
    fn new(name: &str, device: &Device) -> Self {
        let cpu = || DeviceFacts { name: String::new(), driver: String::new(), is_software: false };
        Self { device: name.to_owned(), facts: facts(device).unwrap_or_else(cpu), tensors: device.clone() }
    }

    fn tolerance(&self) -> f64 {
        if self.device == "cuda" { TOLERANCE_TF32 } else { TOLERANCE }
    }

    /// The name in requests, with that of the card.
    fn in_words(&self) -> String {
        [&*self.device, &*self.facts.name].join(" ").trim().to_owned()
    }

    /// Takes `steps` steps of memory; then checks convolutions, from little work to much, and begins none once the time is over. All steps
    /// and one convolution are taken however short the time.
    fn check(
        &self,
        convolutions: BTreeSet<Convolution>,
        steps: usize,
        limit: Option<Duration>,
        context: &Context,
    ) -> Result<DeviceReport> {
        let started = Instant::now();
        let is_over = || limit.is_some_and(|limit| started.elapsed() > limit);
        // A kernel is compiled and tuned at its first use; times are those of the next.
        let repetitions = if self.facts.is_software { 1 } else { 3 };
        let batch = |c: Convolution| if self.facts.is_software { c.with_batch(1) } else { c };
        let mut left_out: Vec<Convolution> = convolutions.into_iter().map(batch).collect();
        left_out.sort_by(|a, b| a.products().total_cmp(&b.products()).then_with(|| a.cmp(b)));
        left_out.dedup();
        let total = (left_out.len() + steps) as u64;

        // Memory first: its steps are few kinds of kernels, and what is left of the time goes to the shapes.
        let memory = if steps == 0 {
            None
        } else {
            let input = if self.facts.is_software { SOFTWARE_BATCH } else { BATCH };
            let mut taken = |step: usize| {
                context.progress(step as u64, total, format!("memory of {}", self.in_words()));
            };
            let checked = check_memory(&self.tensors, input, steps, context.cancel(), &mut taken);
            checked.map_err(|_| context.stopped("stopped while the memory of the device was checked"))?
        };
        let mut checks = Vec::with_capacity(left_out.len());
        let mut waiting = left_out.into_iter();
        // The first one is tried in any case.
        while checks.is_empty() || !is_over() {
            let Some(convolution) = waiting.next() else { break };
            context.check(|| "stopped while the device was checked")?;
            context.progress((steps + checks.len()) as u64, total, convolution.to_string());
            checks.push(check_convolution(&convolution, &self.tensors, self.tolerance(), repetitions));
        }
        let left_out: Vec<Convolution> = waiting.collect();
        let mut report = DeviceReport {
            device: self.device.clone(),
            name: self.facts.name.clone(),
            driver: self.facts.driver.clone(),
            is_software: self.facts.is_software,
            version: VERSION.to_owned(),
            tolerance: self.tolerance(),
            convolutions: checks,
            left_out,
            networks_left_out: Vec::new(),
            memory,
            verdict: Verdict::Passed,
            seconds: started.elapsed().as_secs_f64(),
        };
        if !report.problems().is_empty() {
            report.verdict = Verdict::Failed;
        } else if !report.left_out.is_empty() {
            report.verdict = Verdict::Unfinished;
        }
        Ok(report)
    }
}

/// Checks a device with the convolutions of every network of Petzval. A third of the seconds at most goes to the CPU, which names the
/// convolutions; what has begun ends later.
pub(crate) fn check_device(name: &str, seconds: usize, context: &Context) -> Result<DeviceReport> {
    let started = Instant::now();
    let tensors = device(name)?;
    let subject = Subject::new(name, &tensors);
    context.note(format!("checking {} against the CPU, for about {seconds} s", subject.in_words()));
    let limit = Duration::from_secs(seconds as u64);
    let found = all_convolutions(started + limit / 3, context)?;
    let limit = limit.saturating_sub(started.elapsed());
    let mut report = subject.check(found.convolutions, STEPS, Some(limit), context)?;
    report.networks_left_out = found.left_out;
    if report.verdict == Verdict::Passed && !report.networks_left_out.is_empty() {
        report.verdict = Verdict::Unfinished;
    }
    report.seconds = started.elapsed().as_secs_f64();
    Ok(report)
}

/// The check that a training needs before its first step on a device other than the CPU: all convolutions of a step of its network, or of its
/// first block with a gradient.
///
/// It does not try the other sizes that a run meets: the windows of validations, held-out pictures and their scores, and windows that are
/// enlarged for a detector behind another lens. `petzval doctor` checks memory.
pub(crate) struct Gate<'a> {
    /// Name of the device in requests.
    pub(crate) device: &'a str,
    /// The training.
    pub(crate) setup: &'a Setup,
    /// Keeps the verdict, and which kernels are the fastest.
    pub(crate) folder: &'a RunFolder,
}

impl Gate<'_> {
    /// Fails if the device may not train. The verdict holds for the run, as long as device, driver and version are the same.
    pub(crate) fn pass(&self, context: &Context) -> Result<()> {
        if self.device == "cpu" {
            return Ok(());
        }
        let tuning = self.folder.tuning();
        let had_tuning = tuning.exists();
        crate::error::make_folder(&tuning)?;
        keep_tuning_in(&tuning);
        self.check(context).inspect_err(|_| {
            // A run that is refused stays as it was, and no later work may look for its tuning there.
            keep_tuning_for_the_user();
            if !had_tuning && let Err(error) = std::fs::remove_dir_all(&tuning) {
                context.note(format!("{}: {error}; the tuning of a refused run stays", tuning.display()));
            }
        })
    }

    fn check(&self, context: &Context) -> Result<()> {
        let subject = Subject::new(self.device, &self.setup.body.device);
        let kept = self.folder.device();
        if kept_verdict(&kept)
            .is_some_and(|report| report.verdict == Verdict::Passed && report.is_of(&subject))
        {
            return Ok(());
        }
        context.note(format!("checking {} with the convolutions of this run", subject.in_words()));
        let convolutions = guarded(&subject, || Ok(convolutions_of(self.setup)?))?;
        // Memory is looked at by `doctor`: its steps take longer than those of a short run.
        let report = subject.check(convolutions, 0, None, context)?;
        if let Some(refused) = refused(&report, &subject.in_words()) {
            return Err(refused);
        }
        let most = report.convolutions.iter().filter_map(|c| Some(c.errors?.largest())).fold(0.0, f64::max);
        context.note(format!(
            "{}: {} convolutions agree with the CPU within {most:.1e} of their largest values, in {:.1} s",
            subject.in_words(),
            report.convolutions.len(),
            report.seconds
        ));
        write_file(&kept, json(&report)?.as_bytes())?;
        Ok(())
    }
}

/// Does some work on a device that is not checked yet: a panic is one of the device.
fn guarded<R>(subject: &Subject, work: impl FnOnce() -> Result<R>) -> Result<R> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let (text, _) = crate::panic_place::of(&*panic);
        let text = text.lines().map(str::trim).collect::<Vec<_>>().join(" ");
        let message = format!("{} fails in a step, and nothing is trained on it: {text}", subject.in_words());
        Err(JobError::setting("device", &subject.device, message, what_helps(&subject.device)))
    })
}

/// What a user can do about a device that may not train.
fn what_helps(device: &str) -> String {
    format!(
        "`petzval doctor --device {device}` shows everything; a newer driver may help; --device cpu is always right"
    )
}

/// Why nothing may be trained on a device; none if it passed.
fn refused(report: &DeviceReport, device: &str) -> Option<JobError> {
    let problems = report.problems();
    let first = problems.first()?;
    let others = match problems.len() {
        1 => String::new(),
        count => format!(", and {} more", count - 1),
    };
    let message = format!("{device} computes wrongly, and nothing is trained on it: {first}{others}");
    Some(JobError::setting("device", &report.device, message, what_helps(&report.device)))
}

/// The verdict of an earlier start of the run; none if there is none that can be read: then the device is checked again.
fn kept_verdict(path: &Path) -> Option<DeviceReport> {
    if !path.is_file() {
        return None;
    }
    serde_json::from_str(&petzval_base::read_text(path).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use petzval_learn::device_check::of_proxies;

    use super::*;
    use crate::context::Silent;

    fn context() -> Context {
        Context::new(crate::built_in_assets(), Arc::new(Silent))
    }

    fn subject() -> Subject {
        Subject::new("cpu", &device("cpu").unwrap())
    }

    #[test]
    fn what_there_is_time_for_is_checked_from_little_work_to_much() {
        let all: BTreeSet<Convolution> = of_proxies(1).unwrap();
        let count = all.len();
        let report = subject().check(all.clone(), 3, Some(Duration::ZERO), &context()).unwrap();
        assert_eq!(report.verdict, Verdict::Unfinished);
        assert_eq!(report.convolutions.len() + report.left_out.len(), count);
        assert_eq!(report.memory, None);
        assert!(report.left_out.is_sorted_by(|a, b| a.products() <= b.products()));

        let small: BTreeSet<Convolution> = all.into_iter().filter(|c| c.products() < 1e6).collect();
        let report = subject().check(small.clone(), 0, None, &context()).unwrap();
        assert_eq!((report.verdict, report.convolutions.len()), (Verdict::Passed, small.len()));
        assert!(report.left_out.is_empty() && report.problems().is_empty() && !small.is_empty());

        // The same with one that differs.
        let mut failed = report;
        failed.convolutions[0].problem = Some("differs".to_owned());
        assert!(failed.problems()[0].ends_with(": differs"));
        // A verdict holds for its device, driver and version alone.
        assert!(failed.is_of(&subject()));
        failed.driver = "another".to_owned();
        assert!(!failed.is_of(&subject()));
        // A card whose driver nobody knows is checked every time.
        let mut card = subject();
        (card.facts.name, failed.name, failed.driver) = ("card".into(), "card".into(), String::new());
        assert!(!failed.is_of(&card));
        (card.facts.driver, failed.driver) = ("7".into(), "7".into());
        assert!(failed.is_of(&card));
    }

    #[test]
    fn a_run_is_refused_on_a_device_that_failed_and_keeps_the_verdict_of_one_that_passed() {
        let context = context();
        let mut experiment = context.assets.experiment(crate::experiment::DEFAULT_EXPERIMENT).unwrap();
        (experiment.training.batch, experiment.training.crop) = (1, 32);
        let setup = Setup::new(experiment, &context.assets, device("cpu").unwrap()).unwrap();
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(&root.path().join("run")).unwrap();

        // The CPU under another name stands for a card. A check that is cancelled leaves the folder as it was.
        let gate = Gate { device: "card", setup: &setup, folder: &folder };
        let cancelled = self::context();
        cancelled.cancel().set();
        assert!(matches!(gate.pass(&cancelled), Err(JobError::Stopped(_))));
        assert!(!folder.tuning().exists() && !folder.device().exists());
        gate.pass(&context).unwrap();
        let report = kept_verdict(&folder.device()).unwrap();
        assert_eq!((report.verdict, &*report.device), (Verdict::Passed, "card"));
        assert!(report.convolutions.len() > 20 && folder.tuning().is_dir());
        assert!(refused(&report, "card").is_none());

        // A second start believes it; a verdict of another version is made anew, as is one that cannot be read.
        let kept = json(&report).unwrap();
        for (text, is_kept) in [(kept.clone(), true), (kept.replace(VERSION, "0.0.1"), false)] {
            std::fs::write(folder.device(), &text).unwrap();
            gate.pass(&context).unwrap();
            assert_eq!(std::fs::read_to_string(folder.device()).unwrap() == text, is_kept, "{text}");
        }
        std::fs::write(folder.device(), "{").unwrap();
        assert_eq!(kept_verdict(&folder.device()), None);

        let mut failed = report;
        failed.convolutions[3].problem = Some("differs".to_owned());
        failed.convolutions[5].problem = Some("differs as well".to_owned());
        let Some(JobError::Setting { key: "device", message, hint, .. }) = refused(&failed, "card 7") else {
            panic!()
        };
        assert!(message.starts_with("card 7 computes wrongly, and nothing is trained on it: "), "{message}");
        assert!(message.ends_with(": differs, and 1 more") && hint.contains("petzval doctor --device card"));
    }

    #[test]
    fn a_device_that_panics_is_refused() {
        let refused = guarded(&subject(), || -> Result<()> { panic!("lost\n  for ever") });
        let Err(JobError::Setting { key: "device", value, message, hint }) = refused else { panic!() };
        assert_eq!(value, "cpu");
        assert_eq!(message, "cpu fails in a step, and nothing is trained on it: lost for ever");
        assert!(hint.contains("petzval doctor --device cpu"), "{hint}");
        assert_eq!(guarded(&subject(), || Ok(7)).unwrap(), 7);
    }

    #[test]
    fn a_check_that_is_cancelled_ends_as_every_job() {
        let context = context();
        context.cancel().set();
        let ended = subject().check(of_proxies(1).unwrap(), 0, None, &context);
        assert!(matches!(ended, Err(JobError::Stopped(_))));
    }
}
