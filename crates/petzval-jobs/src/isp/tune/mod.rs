//! `isp tune`: parameters of an ISP that bring its pictures nearest to references, found without a gradient.
//!
//! The ISP is seen only through its interface, so that ours, a proxy and real hardware are tuned alike.

mod cases;
mod folder;
mod plan;
mod reference_colours;

use std::path::PathBuf;
use std::time::Instant;

use petzval_base::simd::level;
use petzval_camera::image::LinearImage;
use petzval_camera::isp::{IspError, RgbPicture};
use petzval_design::error::DesignError;
use petzval_design::evolution::{Evolution, EvolutionSettings};
use petzval_design::path_text::path_text;
use petzval_files::is_picture_turned;
use petzval_learn::score::{Score, ScoreDescription, ScoredPair};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::cases::{Case, cases, fingerprint};
use self::folder::{Checkpoint, TuneFolder};
use super::frame::{Source, noted_frames, read_frame, read_one, warn_of_clipped};
use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, Stopped};
use crate::event::{Event, WarningKind, figures};
use crate::named_isp::{NamedIsp, about_frame, isp_by_name};
use crate::noted_pictures::NotedPictures;

pub use self::folder::Generation;
pub use self::plan::Plan;

/// A search that begins, or one that is continued, and how far it goes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Where it starts.
    pub start: Start,
    /// Settings that are tried in all, those before an interruption included. If none are given, a new search tries 500, and one that is
    /// continued as many as it began with.
    #[serde(default)]
    pub evaluations: Option<usize>,
}

/// Settings that a search tries if nobody says how many.
const EVALUATIONS: usize = 500;

/// Where a search starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Start {
    /// At the settings of an ISP.
    New {
        /// What is tuned for what.
        plan: Box<Plan>,
        /// Folder for results and state; it must not hold a search.
        out: PathBuf,
    },
    /// Where the search in a folder ended.
    Resume {
        /// The folder.
        folder: PathBuf,
    },
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The score.
    pub objective: ScoreDescription,
    /// Mean score of the settings at the start.
    pub start: f64,
    /// Mean score of the best settings.
    pub best: f64,
    /// The parameters that varied.
    pub parameters: Vec<Tuned>,
    /// Frames that each setting was tried on.
    pub frames: usize,
    /// Every frame with the picture that it should become.
    pub pairs: Vec<Pair>,
    /// Settings that were tried.
    pub evaluations: usize,
    /// Generations of the search.
    pub generations: u64,
    /// How many times the search began again.
    pub restarts: usize,
    /// Time that all of it took, s.
    pub seconds: f64,
    /// File of the best settings.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub tuned: PathBuf,
    /// File of all generations.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub history: PathBuf,
}

/// A frame and its reference.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Pair {
    /// The raw frame.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub raw: PathBuf,
    /// The picture that it should become.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub reference: PathBuf,
}

/// A parameter that varied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tuned {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Its value at the start.
    pub start: f64,
    /// Its value in the best settings.
    pub best: f64,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> = AsUnit {
    seed: Some(|request, seed| {
        if let Start::New { plan, .. } = &mut request.start {
            plan.seed = seed;
        }
    }),
    place: Some(|request, folder| {
        if let Start::New { out, .. } = &mut request.start {
            *out = folder.to_owned();
        }
    }),
    going_on: Some(|request, folder| {
        TuneFolder::is_in(folder)
            .then(|| Request { start: Start::Resume { folder: folder.to_owned() }, ..request.clone() })
    }),
    out_in: Some("/start/new"),
    ..AsUnit::PLAIN
};

/// Tunes the ISP.
///
/// The folder holds the best settings (`tuned.toml`), all generations (`history.json`) and what is needed to continue (`search.json`);
/// all are written after every generation. Once it is cancelled, [`JobError::Stopped`] holds the response with the best settings so far.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let (plan, resumed) = match &request.start {
        Start::New { plan, .. } => {
            // The state of the search keeps them as text.
            [&plan.raws, &plan.reference].into_iter().try_for_each(|path| path_text(path).map(drop))?;
            (Plan::clone(plan), None)
        }
        Start::Resume { folder } => {
            let (folder, kept) = TuneFolder::open(folder)?;
            (kept.plan.clone(), Some((folder, kept)))
        }
    };
    let mut named = isp_by_name(&plan.isp, &context.assets, context.cancel())?;
    named.set(&plan.set)?;
    let places = named.all_places(&plan.vary)?;
    let device = context.device("cpu")?;
    let score = score_of(&plan.objective, context)?;
    let cases = cases(&plan)?;
    for Case { raw, reference } in &cases {
        context.note(format!("{} -> {}", raw.display(), reference.display()));
    }
    let base = base_values(&named, &plan, &cases, context)?;
    let inputs = fingerprint(&named, &base, &cases)?;
    let tuner = Tuner { named, base, places, plan, cases, score, device, context };

    let (folder, mut kept) = match (resumed, &request.start) {
        (Some((folder, kept)), _) => {
            tuner.check_same(&kept, &inputs, &folder)?;
            request.evaluations.map_or(Ok(()), |budget| check_budget(budget, 1))?;
            (folder, kept)
        }
        (None, Start::New { out, .. }) => {
            let search = tuner.search()?;
            check_budget(request.evaluations.unwrap_or(EVALUATIONS), 1 + search.population())?;
            tuner.check_frames()?;
            let folder = TuneFolder::create(out)?;
            (folder, Checkpoint::new(tuner.plan.clone(), inputs, tuner.names(), search))
        }
        (None, Start::Resume { .. }) => return Err(JobError::failed("the search was not read")),
    };
    let is_resumed = matches!(request.start, Start::Resume { .. });
    if is_resumed && kept.evaluations.is_none() && request.evaluations.is_none() {
        context.warning(WarningKind::OtherVersion, format!(
            "an earlier version began the search and did not keep how many settings it tries; it goes on to {EVALUATIONS}"
        ));
    }
    if is_resumed && !kept.simd.is_empty() && kept.simd != level() {
        context.warning(WarningKind::InstructionSet, format!(
            "the search was begun with the instruction set {}, and goes on with {}: it may end at other settings than without interruption",
            kept.simd,
            level()
        ));
    }
    let budget = request.evaluations.or(kept.evaluations).unwrap_or(EVALUATIONS);
    let is_new_budget = kept.evaluations.replace(budget) != Some(budget);
    let tried = 1 + kept.search.evaluations();
    if kept.start.is_some() && tried + kept.search.population() > budget {
        context.note(format!(
            "{tried} of {budget} settings are tried: nothing is left; more with --evaluations"
        ));
    }
    let found = tuner.tune(budget, &folder, &mut kept)?;
    // Every generation keeps the budget; without one it is kept here. A search that fails leaves the folder as it was.
    if is_new_budget {
        tuner.keep(&folder, &kept)?;
    }
    if context.is_cancelled() {
        let again = Request {
            start: Start::Resume { folder: folder.root().to_path_buf() },
            evaluations: request.evaluations,
        };
        let stopped = context.stopped("stopped").keeping(folder.root());
        return Err(stopped.going_on_with(&again).with_response(&found).into());
    }
    Ok(found)
}

fn check_budget(evaluations: usize, least: usize) -> Result<()> {
    if evaluations >= least && evaluations <= 10_000_000 {
        Ok(())
    } else {
        Err(JobError::setting(
            "evaluations",
            evaluations,
            format!("must lie between {least} and 10000000: the start and one generation at least"),
            "a hundred for each varied parameter is usual",
        ))
    }
}

/// The values at the start: those of the preset at the gain of the frames.
fn base_values(named: &NamedIsp, plan: &Plan, cases: &[Case], context: &Context) -> Result<Vec<f64>> {
    let mut gains_ev = Vec::new();
    for case in cases {
        gains_ev.push(read_frame(&case.raw, &plan.frame, &context.silent())?.about.gain_ev);
    }
    let first = gains_ev[0];
    if gains_ev.iter().any(|ev| (ev - first).abs() > 0.1) {
        context.warning(
            WarningKind::RawFrame,
            "the frames have different gains; one setting is tuned for all of them, from that at the first",
        );
    }
    named.values(first)
}

/// The score of a name.
fn score_of(name: &str, context: &Context) -> Result<Box<dyn Score>> {
    let mut all = context.scores()?;
    let known: Vec<&str> = all.iter().map(|score| score.name()).collect();
    let is_named = |known: &&str| *known == name || name.eq_ignore_ascii_case(short_name(known));
    match known.iter().position(is_named) {
        Some(i) => Ok(all.swap_remove(i)),
        None => {
            let short: Vec<&str> = known.iter().map(|known| short_name(known)).collect();
            let hint = format!("give one of {}", short.join(", "));
            Err(JobError::setting("objective", name, "no such score", hint))
        }
    }
}

/// The name of a score as the command takes it, in any case of its letters.
fn short_name(full: &str) -> &str {
    SHORT.iter().find(|(_, known)| *known == full).map_or(full, |(short, _)| *short)
}

/// Short names of scores.
const SHORT: [(&str, &str); 2] = [("psnr", "psnr_db"), ("lpips", "one_minus_lpips")];

/// The score of a setting, or why the ISP failed at it.
type Scored = std::result::Result<f64, String>;

/// The picture of a frame, or why there is none.
type Developed = std::result::Result<RgbPicture, IspError>;

/// Everything that a search needs and does not change.
struct Tuner<'a> {
    named: NamedIsp,
    /// Values of all parameters at the start.
    base: Vec<f64>,
    places: Vec<usize>,
    plan: Plan,
    cases: Vec<Case>,
    score: Box<dyn Score>,
    device: petzval_learn::Device,
    context: &'a Context,
}

impl Tuner<'_> {
    fn names(&self) -> Vec<String> {
        self.places.iter().map(|i| self.named.parameters[*i].name.clone()).collect()
    }

    /// A new search from the settings of the plan.
    fn search(&self) -> Result<Evolution> {
        let unit = |i: &usize| self.named.parameters[*i].about.unit_of(self.base[*i]);
        let start: Vec<f64> = self.places.iter().map(unit).collect();
        let settings = EvolutionSettings {
            seed: self.plan.seed,
            first_deviation: 0.2,
            least_deviation: 1e-5,
            least_change: 1e-9,
            ..EvolutionSettings::default()
        };
        Evolution::new(&start, settings).map_err(|e| JobError::input(e.to_string(), ""))
    }

    /// All values of a point of the cube.
    fn values(&self, point: &[f64]) -> Vec<f64> {
        let mut values = self.base.clone();
        for (i, unit) in self.places.iter().zip(point) {
            values[*i] = self.named.parameters[*i].about.value_at(*unit);
        }
        values
    }

    /// Checks that a kept search is one of these inputs.
    fn check_same(&self, kept: &Checkpoint, inputs: &str, folder: &TuneFolder) -> Result<()> {
        if kept.inputs == inputs && kept.varied == self.names() {
            Ok(())
        } else {
            Err(JobError::input(
                format!(
                    "{}: raw frames, references or the ISP have changed since the search began",
                    folder.root().display()
                ),
                "restore them, or begin a new search in another folder",
            ))
        }
    }

    /// Checks every frame and its reference before anything is written.
    fn check_frames(&self) -> Result<()> {
        let (pictures, frames) = (NotedPictures::new(self.context), noted_frames(self.context));
        let mut gray = Vec::new();
        for case in &self.cases {
            let frame = read_one(Source::File(&case.raw), &self.plan.frame, &frames)?;
            frame.note_turn(&case.raw, &frames);
            warn_of_clipped((&self.named, &self.base), &frame.input, &case.raw, &frames)?;
            if frame.orientation.is_none()
                && is_picture_turned(&case.reference).map_err(DesignError::Image)?
            {
                frames.warning(
                    case.raw.display(),
                    WarningKind::RawFrame,
                    "its reference is turned by an orientation, and the frame states none: state `orientation` in its sidecar if both lie alike"
                        .to_owned(),
                );
            }
            let reference = case.read_reference(frame.turned_size(), &pictures)?;
            if case.is_gray(&reference)? {
                gray.push(case);
            }
        }
        self.check_gray(&gray)
    }

    /// Refuses frames whose references are all gray, unless the ISP is an external one, which may make gray pictures. Some may be gray: a chart is.
    fn check_gray(&self, gray: &[&Case]) -> Result<()> {
        let Some(first) = gray.first().filter(|_| !self.named.is_external()) else { return Ok(()) };
        if gray.len() == self.cases.len() {
            return Err(first.misleads(
                "its three colours are equal at every pixel: tuning would lead to a mosaic or to a gray picture",
            ));
        }
        self.context.warning(
            WarningKind::Picture,
            format!(
                "{} of {} references are gray, the first is {}: tuning leads their frames to gray pictures",
                gray.len(),
                self.cases.len(),
                first.reference.display()
            ),
        );
        Ok(())
    }

    /// Writes a search that has a start.
    fn keep(&self, folder: &TuneFolder, kept: &Checkpoint) -> Result<()> {
        if kept.start.is_none() {
            return Ok(());
        }
        folder.save(kept, &self.tuned(kept)?)?;
        self.context.wrote(folder.tuned(), "settings");
        self.context.wrote(folder.history(), "figures");
        Ok(())
    }

    /// Goes on until the budget is spent or the job is cancelled.
    fn tune(&self, budget: usize, folder: &TuneFolder, kept: &mut Checkpoint) -> Result<Response> {
        let sign = if self.score.higher_is_better() { 1.0 } else { -1.0 };
        if kept.start.is_none()
            && let Some(mut scores) = self.scores(std::slice::from_ref(&self.base))?
            && let Some(score) = scores.pop()
        {
            let hint = "run the ISP at these values, and mend it or begin at others with --set";
            kept.start = Some(score.map_err(|reason| self.failed_at(&self.base, &reason, hint))?);
            self.keep(folder, kept)?;
        }
        while let Some(start) = kept.start
            && 1 + kept.search.evaluations() + kept.search.population() <= budget
            && !self.context.is_cancelled()
        {
            self.report(kept, budget, start, sign);
            let clock = Instant::now();
            let points: Vec<Vec<f64>> = kept.search.ask().iter().map(|point| self.values(point)).collect();
            // A generation that is interrupted is made again from the same state.
            let Some(scores) = self.scores(&points)? else { break };
            let failed = self.count_failures(&points, &scores, folder, kept)?;
            // What is no number counts as the worst.
            let values = scores.iter().map(|score| score.as_ref().map_or(f64::NAN, |score| -sign * score));
            kept.search.tell(&values.collect::<Vec<_>>());
            kept.seconds += clock.elapsed().as_secs_f64();
            let best = scores.iter().flatten().map(|score| sign * score).fold(f64::NEG_INFINITY, f64::max);
            kept.history.push(Generation {
                generation: kept.search.generation(),
                evaluations: 1 + kept.search.evaluations(),
                best_of_generation: sign * best,
                failed,
                best: self.best(kept).0,
                deviation: kept.search.deviation(),
                restarts: kept.search.restarts(),
                seconds: kept.seconds,
            });
            self.keep(folder, kept)?;
        }
        let Some(start) = kept.start else {
            let message = "stopped before the settings at the start were scored; nothing is kept";
            return Err(Stopped::new(message).into());
        };
        self.report(kept, budget, start, sign);
        let (best, values) = self.best(kept);
        let parameters = self.places.iter().map(|i| Tuned {
            name: self.named.parameters[*i].name.clone(),
            unit: self.named.parameters[*i].about.unit.to_owned(),
            start: self.base[*i],
            best: values[*i],
        });
        Ok(Response {
            objective: ScoreDescription::of(self.score.as_ref()),
            start,
            best,
            parameters: parameters.collect(),
            frames: self.cases.len(),
            pairs: self
                .cases
                .iter()
                .map(|Case { raw, reference }| Pair { raw: raw.clone(), reference: reference.clone() })
                .collect(),
            evaluations: 1 + kept.search.evaluations(),
            generations: kept.search.generation(),
            restarts: kept.search.restarts(),
            seconds: kept.seconds,
            tuned: folder.tuned(),
            history: folder.history(),
        })
    }

    /// Counts the settings of a generation at which the ISP failed, and warns of them. Fails if there is no other: then the ISP itself may be broken,
    /// and the search goes on from before this generation once it is mended.
    fn count_failures(
        &self,
        points: &[Vec<f64>],
        scores: &[Scored],
        folder: &TuneFolder,
        kept: &Checkpoint,
    ) -> Result<usize> {
        let failures =
            || points.iter().zip(scores).filter_map(|(values, score)| Some((values, score.as_ref().err()?)));
        let (failed, all) = (failures().count(), points.len());
        let Some((values, reason)) = failures().next() else { return Ok(0) };
        if failed == all {
            let hint = format!(
                "all {all} settings of a generation failed; run the ISP at these values and mend it, then go on with `petzval isp tune --resume {}`",
                folder.root().display()
            );
            return Err(self.failed_at(values, reason, &hint));
        }
        let before: usize = kept.history.iter().map(|generation| generation.failed).sum();
        self.context.warning(
            WarningKind::LeftOut,
            format!(
                "generation {}: {failed} of {all} settings failed and count as the worst, {} since the search began; first at {}: {reason}",
                kept.search.generation() + 1,
                before + failed,
                self.varied(values)
            ),
        );
        Ok(failed)
    }

    /// The error of an ISP at a setting.
    fn failed_at(&self, values: &[f64], reason: &str, hint: &str) -> JobError {
        JobError::failed(format!("{reason}; at {}; hint: {hint}", self.varied(values)))
    }

    /// The values of the varied parameters in words.
    fn varied(&self, values: &[f64]) -> String {
        let named =
            self.places.iter().map(|i| format!("{} = {}", self.named.parameters[*i].name, values[*i]));
        named.collect::<Vec<_>>().join(", ")
    }

    /// Score and values of the best settings; those at the start until better ones are found.
    fn best(&self, kept: &Checkpoint) -> (f64, Vec<f64>) {
        let sign = if self.score.higher_is_better() { 1.0 } else { -1.0 };
        let start = kept.start.unwrap_or(f64::NAN);
        match kept.search.best() {
            Some(best) if -best.value > sign * start => (-sign * best.value, self.values(&best.at)),
            _ => (start, self.base.clone()),
        }
    }

    /// The settings file of the best settings.
    fn tuned(&self, kept: &Checkpoint) -> Result<String> {
        let (score, values) = self.best(kept);
        let head = format!(
            "Tuned by `petzval isp tune`: {} {score:.4} {}, {:.4} before; {} settings tried on {} frames.",
            self.score.title(),
            self.score.unit(),
            kept.start.unwrap_or(f64::NAN),
            1 + kept.search.evaluations(),
            self.cases.len()
        );
        self.named.settings_toml(&head, &values)
    }

    fn report(&self, kept: &Checkpoint, budget: usize, start: f64, sign: f64) {
        let (best, _) = self.best(kept);
        let (done, total) = (1 + kept.search.evaluations() as u64, budget as u64);
        self.context.event(&progress(done, total, &*self.score, best, sign * (best - start)));
    }

    /// Mean score of each list of values over all frames, or why the ISP failed at it; none if the job is cancelled meanwhile.
    ///
    /// Frame after frame, so that only one frame and its pictures are in memory.
    fn scores(&self, points: &[Vec<f64>]) -> Result<Option<Vec<Scored>>> {
        // What files say was said when the frames were checked.
        let silent = self.context.silent();
        let (references, frames) = (NotedPictures::new(&silent), noted_frames(&silent));
        let mut sums: Vec<Scored> = vec![Ok(0.0); points.len()];
        for case in &self.cases {
            if self.context.is_cancelled() {
                return Ok(None);
            }
            let frame = read_one(Source::File(&case.raw), &self.plan.frame, &frames)?;
            let truth = case.read_reference(frame.turned_size(), &references)?;
            let isp = self.named.isp();
            // A setting that failed on a frame is not tried on the others.
            let develop =
                |(values, sum): (&Vec<f64>, &Scored)| sum.is_ok().then(|| isp.develop(&frame.input, values));
            let pictures: Vec<Option<Developed>> = points.par_iter().zip(&sums).map(develop).collect();
            for (sum, picture) in sums.iter_mut().zip(pictures) {
                match picture {
                    None => {}
                    Some(Ok(picture)) => {
                        let score = self.score_of_picture(frame.turned(picture), &truth, case)?;
                        if let Ok(sum) = sum {
                            *sum += score / self.cases.len() as f64;
                        }
                    }
                    Some(Err(IspError::Stopped(_))) => return Ok(None),
                    Some(Err(error @ IspError::External(_))) => {
                        *sum = Err(about_frame(&case.raw)(error).to_string());
                    }
                    Some(Err(error)) => return Err(about_frame(&case.raw)(error)),
                }
            }
        }
        Ok(Some(sums))
    }

    /// The score of a picture of a frame against its reference.
    fn score_of_picture(&self, picture: RgbPicture, truth: &LinearImage, case: &Case) -> Result<f64> {
        let RgbPicture { height, width, .. } = picture;
        if (height, width) != (truth.height, truth.width) {
            return Err(JobError::failed(format!(
                "{}: the ISP made {width} x {height} pixels, and the reference has {} x {}",
                case.raw.display(),
                truth.width,
                truth.height
            )));
        }
        let finished = LinearImage { channels: 3, height, width, data: picture.encoded() };
        let pair = ScoredPair::new(finished, truth.clone(), &self.device);
        self.score.of(&pair).map_err(|e| JobError::failed(e.to_string()))
    }
}

/// How far a search has come, with its best score and by how much that is better than the score at the start.
fn progress(done: u64, total: u64, score: &dyn Score, best: f64, improvement: f64) -> Event {
    let (name, title, unit, decimals) = (score.name(), score.title(), score.unit(), score.decimals());
    let text = format!("{title}: {best:.decimals$} {unit}, {improvement:+.decimals$} from the start");
    let figures = figures([(name.to_owned(), best), (format!("{name}_improvement"), improvement)]);
    Event::Progress { done, total, text, figures }
}

#[cfg(test)]
mod tests {
    use petzval_learn::score::ScoreError;

    use super::*;

    /// A score in dB, of which nothing is computed.
    struct Psnr;

    impl Score for Psnr {
        fn name(&self) -> &'static str {
            "psnr_db"
        }

        fn title(&self) -> &'static str {
            "PSNR"
        }

        fn unit(&self) -> &'static str {
            "dB"
        }

        fn definition(&self) -> &'static str {
            ""
        }

        fn decimals(&self) -> usize {
            2
        }

        fn of(&self, _: &ScoredPair) -> Result<f64, ScoreError> {
            Ok(0.0)
        }
    }

    #[test]
    fn progress_has_the_figures_of_its_line_as_numbers() {
        let event = progress(9, 40, &Psnr, 31.126, 0.75);
        assert_eq!(event.to_string(), "PSNR: 31.13 dB, +0.75 from the start");
        let json = serde_json::to_value(&event).unwrap();
        assert_eq!(json["figures"], serde_json::json!({"psnr_db": 31.126, "psnr_db_improvement": 0.75}));
        assert_eq!([&json["done"], &json["total"]], [9, 40]);
    }
}
