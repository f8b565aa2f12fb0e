//! `lens tolerance`: how sensitive a lens is to errors in its making, and how good lenses made at random are.

mod files;
mod findings;
mod part;
mod report;
mod trials;
mod wide;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use petzval_base::{Cancelled, Tally};
use petzval_design::error::DesignError;
use petzval_files::{LensFile, ToleranceFile, parse_tolerances};
use petzval_optics::analysis::first_order_table;
use petzval_optics::lens::Lens;
use petzval_optics::merit::{self, Mtf, RmsSpot};
use petzval_optics::tolerance::{
    self, MonteCarlo, Sensitivities, Study, ToleranceError, Tolerances, Trial as MadeLens, inverse,
    sensitivities,
};
use petzval_optics::wave::NoWaves;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::findings::Findings;
use super::focus::{check_image, colours_out_of_best_focus, is_virtual_at_best, virtual_image};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder};
use crate::event::WarningKind;
use crate::input::LensInput;
use crate::range::check_ranges;
use crate::results::check_folder;

pub use part::{MadeLenses, Part};
pub use report::{
    Better, Compensator, Estimate, Percentile, Quantity, RandomLenses, Report, Sensitivity, Travel, Worst,
};

pub use trials::{Trial, Trials};
pub(crate) use wide::warn_of_wide_tolerances;

pub use petzval_optics::psf::PsfKind;
pub use petzval_report::tolerance_sheet::three_digits;

petzval_base::parameters! {
    /// A lens with its tolerances, and what to find out.
    pub struct Request {
        /// Spatial frequency of the MTF, cycles/mm, 0.01 to 10000.
        frequency: f64 = 40.0, "cycles/mm", 0.01..1e4, Log, "in cycles per mm, 0.01 to 10000; 100 is the Nyquist frequency of a 5 um pixel";
        /// How many lenses are made at random, 1000000 at most.
        trials: usize = 1000, "", 0..1_000_000, Linear, "at most 1000000; 0 leaves the random lenses out";
        /// How many of the worst lenses are named and written.
        worst: usize = 3, "", 0..1_000_000, Linear, "3 is usual";
        /// A value of the merit; the response gives the number of lenses that reach it.
        limit: Option<f64> = None, "", 1e-12..1e12, Log, "a merit: um for the RMS spot, 0 to 1 for the MTF";
        /// A loss of the merit; the response gives the tolerance of each quantity that costs this loss over the root of their number: together they cost it as a root sum
        /// square.
        inverse: Option<f64> = None, "", 1e-12..1e12, Log, "a loss of the merit above 0: um for the RMS spot, less than 1 for the MTF";
    }
    also {
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = LensInput::default();
        /// Tolerance file.
        tolerances: Option<PathBuf> = None;
        /// Tolerances of good practice for everything that the file does not name; precision without a file.
        grade: Option<Grade> = None;
        /// What a lens is judged by, over its fields (on both sides of the axis) and wavelengths.
        merit: Merit = Merit::default();
        /// Whether the MTF takes light for rays or for waves.
        kind: PsfKind = PsfKind::default();
        /// What is adjusted on every lens.
        compensate: Compensate = Compensate::default();
        /// Seed of the random lenses.
        seed: u64 = crate::usual::seed();
        /// Only random lenses of these numbers, as a part of `trials` that is joined with others later; sensitivities are then left to the joining.
        part: Option<Part> = None;
        /// Whether the response lists every random lens with its errors: some 50 numbers each.
        list_trials: bool = false;
        /// Folder for the results; nothing is written without one.
        out: Option<PathBuf> = None;
    }
}

/// How exactly a lens is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Grade {
    /// What any shop holds.
    Commercial,
    /// Good optics.
    Precision,
    /// As well as can be had at a price.
    High,
}

impl From<Grade> for tolerance::Grade {
    fn from(grade: Grade) -> Self {
        match grade {
            Grade::Commercial => Self::Commercial,
            Grade::Precision => Self::Precision,
            Grade::High => Self::High,
        }
    }
}

/// What a lens is judged by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Merit {
    /// RMS spot radius, um.
    #[default]
    Rms,
    /// Contrast at a spatial frequency, 0 to 1.
    Mtf,
}

/// What is adjusted on every lens.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Compensate {
    /// The image plane goes where the merit is best.
    #[default]
    Focus,
    /// Nothing but the compensators of the tolerance file.
    None,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// All figures, as in `tolerance.json`.
    pub report: Report,
    /// Names of the compensators, in the order of the figures.
    pub compensators: Vec<String>,
    /// Every random lens, if the request lists them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trials: Option<Trials>,
    /// The lenses of a part, if the request names one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made: Option<MadeLenses>,
    /// The files that were written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub files: Vec<PathBuf>,
}

impl Request {
    fn check(&self) -> Result<()> {
        check_ranges(self)?;
        self.check_part()?;
        if self.merit == Merit::Rms {
            return Ok(());
        }
        let hint = "an MTF lies between 0 and 1";
        match (self.limit.filter(|limit| *limit > 1.0), self.inverse.filter(|loss| *loss >= 1.0)) {
            (Some(limit), _) => Err(JobError::setting("limit", limit, "no MTF is above 1", hint)),
            (None, Some(loss)) => Err(JobError::setting("inverse", loss, "no MTF loses so much", hint)),
            (None, None) => Ok(()),
        }
    }

    /// Fails if the part is none of the lenses, or if the request wants what a part does not have.
    fn check_part(&self) -> Result<()> {
        let Some(Part { from, to }) = self.part else { return Ok(()) };
        if from >= to || to > self.trials {
            let message = format!("must hold lenses between 0 and {}, the trials", self.trials);
            let hint = "0..500 are the first five hundred";
            return Err(JobError::setting("part", format!("{from}..{to}"), message, hint));
        }
        let whole = [("inverse", self.inverse.is_some()), ("out", self.out.is_some())];
        match whole.into_iter().find(|(_, is_given)| *is_given) {
            None => Ok(()),
            Some((flag, _)) => Err(JobError::input(
                format!("lenses {from}..{to} alone have no --{flag}"),
                "it belongs to the whole analysis: `petzval unit gather` joins parts of it",
            )),
        }
    }

    /// The tolerance file, with the grade for everything that it does not name.
    fn tolerance_file(&self, lens: &Lens) -> Result<ToleranceFile> {
        let mut file = match &self.tolerances {
            None => ToleranceFile { grade: Some(tolerance::Grade::Precision), ..ToleranceFile::default() },
            Some(path) => read(path, lens)?,
        };
        if let Some(grade) = self.grade {
            file.grade = Some(grade.into());
        }
        Ok(file)
    }

    fn merit(&self, lens: &Lens) -> Box<dyn merit::Merit> {
        match self.merit {
            Merit::Rms => Box::new(RmsSpot::new(lens)),
            Merit::Mtf => Box::new(Mtf::new(lens, self.frequency, self.kind)),
        }
    }
}

pub(crate) fn read(path: &Path, lens: &Lens) -> Result<ToleranceFile> {
    let text = petzval_base::read_text(path)
        .map_err(|e| JobError::input(format!("{}: {e}", path.display()), "--tolerances takes a TOML file"))?;
    Ok(parse_tolerances(&text, lens).map_err(DesignError::input(path))?)
}

/// A lens with what may be off and what it is judged by, as a request names them.
struct Subject {
    name: String,
    lens: Lens,
    tolerances: Tolerances,
    merit: Box<dyn merit::Merit>,
}

impl Subject {
    fn of(request: &Request, context: &Context) -> Result<Self> {
        request.check()?;
        let (name, context) = request.lens.placed(context)?;
        let lens = context.assets.lens(&name)?.lens;
        check_image(&name, &lens)?;
        if let Some(said) = virtual_image(&lens).filter(|_| is_virtual_at_best(&lens)) {
            context.warning(WarningKind::OutOfFocus, format!("{name}: {said}, so that no sensor sees it"));
        }
        if request.merit == Merit::Mtf
            && request.kind == PsfKind::Diffraction
            && let Some(no_waves) = NoWaves::of(&lens)
        {
            return Err(JobError::input(format!("{name}: {no_waves}"), "take rays: --kind geometric"));
        }
        let file = request.tolerance_file(&lens)?;
        let tolerances = file.tolerances(&lens, request.compensate == Compensate::Focus);
        warn_of_wide_tolerances(&name, &lens, (request.tolerances.as_deref(), &file), &tolerances, &context);
        if tolerances.perturbations.is_empty() {
            return Err(JobError::input(
                "nothing is off: there is no tolerance",
                "give a --grade, or name some in the file",
            ));
        }
        let cutoff = first_order_table(&lens).cutoff_per_mm;
        if request.merit == Merit::Mtf && request.frequency >= cutoff {
            return Err(JobError::setting(
                "frequency",
                request.frequency,
                format!("the lens resolves nothing beyond {cutoff:.1} cycles/mm"),
                "the cutoff is 1 / (wavelength x working f-number)",
            ));
        }
        if request.merit == Merit::Rms
            && request.compensate == Compensate::Focus
            && let Some(said) = colours_out_of_best_focus(&lens)
        {
            context.warning(WarningKind::OutOfFocus, format!("{name}: {said}"));
        }
        let merit = request.merit(&lens);
        Ok(Self { name, lens, tolerances, merit })
    }

    fn study(&self) -> Result<Study<'_>> {
        Study::new(&self.lens, &self.tolerances, self.merit.as_ref()).map_err(|error| {
            let hint = match error {
                ToleranceError::NoMerit => "`petzval lens show` says which field has no spot",
                _ => "correct the tolerance file",
            };
            JobError::input(format!("{}: {error}", self.name), hint)
        })
    }
}

/// The random lens of a number, from 0, as the same request makes it.
pub fn lens_of_trial(request: &Request, number: usize, context: &Context) -> Result<LensFile> {
    let subject = Subject::of(request, context)?;
    if number >= request.trials {
        let hint = match request.trials {
            0 => "the request makes no lenses".to_owned(),
            trials => format!("a number from 0 to {}", trials - 1),
        };
        return Err(JobError::setting("trial", number, "there is no such lens", hint));
    }
    trials::made_again(&subject.lens, &subject.study()?, request.seed, number as u64)
        .map_err(|failure| JobError::setting("trial", number, failure.to_string(), "take another"))
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit::seeded(
    |request, seed| request.seed = seed,
    |request, folder| request.out = request.out.take().map(|_| folder.to_owned()),
);

/// Finds the sensitivities, makes the random lenses, and writes the results.
///
/// Files in the folder, if the request names one: `tolerance.html` (the page), `tolerance.json` (all figures), `sensitivities.csv`, `trials.csv` (every
/// lens with all its errors), `tolerances.toml` (every tolerance, ready to be edited), `yield.svg`, `sensitivity.svg`, and the
/// worst lenses.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let subject = Subject::of(request, context)?;
    let study = subject.study()?;
    make_place(request, context)?;
    if let Some(part) = request.part {
        return one_part(request, &subject, &study, part, context);
    }
    let all = Part { from: 0, to: request.trials };
    let random = match request.trials {
        0 => None,
        _ => Some(lenses(request, &study, all, context)?),
    };
    analysed(request, &subject, &study, random, context)
}

/// Makes the folder of the results, if the request names one. Fails if it holds results that the context does not let be overwritten.
fn make_place(request: &Request, context: &Context) -> Result<()> {
    let Some(out) = &request.out else { return Ok(()) };
    check_folder(
        out,
        ["tolerance.html", "tolerance.json", "tolerances.toml", "sensitivities.csv", "trials.csv"],
        context,
    )?;
    make_folder(out)
}

/// Makes the random lenses of a part.
fn lenses(request: &Request, study: &Study, part: Part, context: &Context) -> Result<MonteCarlo> {
    let count = (part.to - part.from) as u64;
    counted(context, "lenses", count, |tick| part::made(study, request.seed, part, tick))
}

/// The response of a part: figures of its lenses, without sensitivities.
fn one_part(
    request: &Request,
    subject: &Subject,
    study: &Study,
    part: Part,
    context: &Context,
) -> Result<Response> {
    let random = lenses(request, study, part, context)?;
    let made = MadeLenses::of(part, &random);
    let table = Sensitivities { nominal: study.nominal().value, rows: Vec::new(), estimate: None };
    let findings = Findings {
        lens: &subject.lens,
        study,
        table,
        random: Some(random),
        first: part.from,
        shared: None,
        limit: request.limit,
    };
    let report = report::report(&findings, request.worst);
    let trials = findings.random.as_ref().filter(|_| request.list_trials);
    let trials = trials.map(|random| trials::trials(&findings, random));
    Ok(Response {
        report,
        compensators: findings.compensators(),
        trials,
        made: Some(made),
        files: Vec::new(),
    })
}

/// The analysis with lenses that are made already: sensitivities, figures and files.
fn analysed(
    request: &Request,
    subject: &Subject,
    study: &Study,
    random: Option<MonteCarlo>,
    context: &Context,
) -> Result<Response> {
    let Subject { lens, tolerances, .. } = subject;
    let count = tolerances.perturbations.len() as u64;
    let table = counted(context, "sensitivities", count, |tick| sensitivities(study, tick))?;
    let shared = match request.inverse {
        None => None,
        Some(loss) => Some(counted(context, "inverse", count, |tick| inverse(study, loss, tick))?),
    };
    let findings = Findings { lens, study, table, random, first: 0, shared, limit: request.limit };
    let report = report::report(&findings, request.worst);
    let files = match &request.out {
        Some(out) => files::write_all(&findings, &report, out, request.worst, context)?,
        None => Vec::new(),
    };
    let listed = findings.random.as_ref().filter(|_| request.list_trials);
    let trials = listed.map(|random| trials::trials(&findings, random));
    Ok(Response { report, compensators: findings.compensators(), trials, made: None, files })
}

/// Joins parts of the lenses to the analysis that `request`, which has no part, gives in one run: the same to the bit. Sensitivities are computed
/// here, once, and files are written if the request has a folder.
///
/// Fails if the parts are of another lens, seed or merit, if a lens is missing, or if one is in two parts that differ.
pub fn join(request: &Request, parts: &[Response], context: &Context) -> Result<Response> {
    let request = Request { part: None, ..request.clone() };
    let subject = Subject::of(&request, context)?;
    let study = subject.study()?;
    make_place(&request, context)?;
    let mut trials: Vec<Option<MadeLens>> = vec![None; request.trials];
    for response in parts {
        let made = response.made.as_ref().ok_or_else(|| {
            JobError::input(
                "a response holds no part of the lenses",
                "give responses of requests with `part`",
            )
        })?;
        let Part { from, to } = made.part;
        let wrong = |message: &str, hint: &str| {
            JobError::input(format!("lenses {from} to {}: {message}", to.saturating_sub(1)), hint)
        };
        let report = &response.report;
        let seed = report.monte_carlo.as_ref().map(|random| random.seed);
        let is_same = report.lens == subject.lens.name
            && report.merit == study.merit().name()
            && report.nominal.to_bits() == study.nominal().value.to_bits()
            && seed == Some(request.seed);
        if !is_same {
            return Err(wrong(
                "they are of another lens, merit, seed or instruction set",
                "join parts of one request, on a machine that computes as theirs did",
            ));
        }
        let count = to.saturating_sub(from);
        if to > trials.len() || made.merits.len() != count || made.compensators.len() != count {
            return Err(wrong("there are no such lenses", "`trials` is the number of all of them"));
        }
        let lenses = made.merits.iter().zip(&made.compensators);
        let unbuildable: BTreeSet<usize> = made.unbuildable.iter().copied().collect();
        for (number, (place, (value, compensators))) in (from..).zip(trials[from..to].iter_mut().zip(lenses))
        {
            let can_be_built = !unbuildable.contains(&number);
            let trial = MadeLens { value: *value, compensators: compensators.clone(), can_be_built };
            if place.as_ref().is_some_and(|there| *there != trial) {
                return Err(wrong("another part has them as well, and differs", "make the parts again"));
            }
            *place = Some(trial);
        }
    }
    if let Some(missing) = trials.iter().position(Option::is_none) {
        let message = format!("lens {missing} of {} is in no part", trials.len());
        return Err(JobError::input(message, "make the parts that are missing"));
    }
    let random = MonteCarlo {
        seed: request.seed,
        trials: trials.into_iter().flatten().collect(),
        better: study.better(),
    };
    analysed(&request, &subject, &study, Some(random).filter(|random| !random.trials.is_empty()), context)
}

/// Does a part of the job that calls `tick` after each unit of its work, until the job is cancelled.
fn counted<T>(
    context: &Context,
    text: &str,
    total: u64,
    work: impl FnOnce(&(dyn Fn() -> Result<(), Cancelled> + Sync)) -> Result<T, Cancelled>,
) -> Result<T> {
    let done = Tally::default();
    let tick = || {
        done.add(1, |done| context.progress(done, total, text));
        context.cancel().check()
    };
    let ended = context.cancel().check().and_then(|()| work(&tick));
    ended.map_err(|_| context.stopped(format!("cancelled before the {text} were computed")).into())
}
