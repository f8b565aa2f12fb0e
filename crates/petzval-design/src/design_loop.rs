//! The design loop: variants one after the other, their stages, and in each stage the blocks that take turns. It can be
//! resumed at every step.
//!
//! Every variant trains on windows and noise that are drawn from the seed of the experiment and the count of steps alone, never from a
//! variant's place in the list. Networks of variants with as many steps see the same windows in the same order. Those of a lens or an ISP
//! also depend on how many steps the blocks behind it take (`batch_number`).

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use petzval_base::Cancel;
use petzval_files::{LensFile, write_lens};
use petzval_learn::guest::GuestError;
use petzval_optics::design_space::{EflSolve, MagnificationSolve};
use petzval_optics::lens::{Lens, validate};
use petzval_optics::number::Number;
use petzval_optics::paraxial::image_height_per_tangent;

use crate::block::{Batch, Block, BlockState, Blocks, ExposureBlock, IspBlock, NetworkBlock, Sight};
use crate::camera::{Camera, ChipValues, Shot};
use crate::error::{DesignError, Result};
use crate::experiment::{
    BlockName, FieldOfView, LensGoal, LensSearch, PERFECT_LENS, Schedule, Stage, StepMethod, StepRule,
    Variant, turn_of,
};
use crate::pace::UnitsLeft;
use crate::position::{Done, Latest, POSITION_FILE, Position, Restored, last_variant};
use crate::report::run_report::camera_lens;
use crate::run::{
    CameraMetrics, ChangedFile, DigestCheck, Digests, Event, EventLog, Kept, Metrics, RunFolder, RunRecord,
    SCORE, first_reads, forget_most_memory, latest_checkpoint, load_blocks, note_digests, save_blocks,
    save_checkpoint, set_aside, write_file,
};
use crate::run_progress::TOTAL;
use crate::scoring::{Scored, Scorer, collect_metrics};
use crate::setup::Setup;
use crate::task::{Objective, SceneView};
use crate::validation::{VALIDATION, Validations, validation_loss};

/// Someone who watches a run.
pub trait Observer {
    /// The run starts or continues; `done` of its `total` steps are taken.
    fn start(&mut self, done: u64, total: u64);
    /// What is left of it by what moves; comes after the start.
    fn plan(&mut self, _left: Vec<UnitsLeft>) {}
    /// A step was taken.
    fn step(&mut self, event: &Event);
    /// Something that a person should know.
    fn note(&mut self, _text: &str) {}
    /// A file or a folder of the run is whole; `what` says what it holds.
    fn file(&mut self, _path: &Path, _what: &str) {}
    /// A camera is being scored: so many of its windows are done.
    fn scoring(&mut self, _camera: &str, _done: usize, _of: usize) {}
    /// A camera is finished and scored.
    fn camera(&mut self, metrics: &CameraMetrics);
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// All cameras are made and scored.
    Finished(Box<Metrics>),
    /// The run was stopped; it left a checkpoint at this step.
    Stopped(u64),
}

/// The camera of a variant's lens at rest as it is scored: with the network, and the hardware ISP in whole numbers.
pub fn finished_camera(
    setup: &Setup,
    variant: &Variant,
    lens: Lens,
    exposure: &ExposureBlock,
    isp: &IspBlock,
    network: &NetworkBlock,
) -> Result<Camera> {
    Ok(finished(&setup.camera_of(variant, lens, false)?, exposure, isp, network))
}

/// A camera with its exposure, the network, and the hardware ISP in whole numbers.
fn finished(camera: &Camera, exposure: &ExposureBlock, isp: &IspBlock, network: &NetworkBlock) -> Camera {
    let camera = network.attached_to(&camera.exposed_as(&exposure.exposure()));
    if camera.body().chip.is_some() { camera.with_chip(ChipValues::Exact(isp.values())) } else { camera }
}

/// The lens of a variant as its blocks stand.
fn lens_of(setup: &Setup, variant: &Variant, blocks: &Blocks) -> Result<Lens> {
    let file = &setup.start(variant).lens_file;
    if !variant.moves_lens() {
        return Ok(file.lens.clone());
    }
    Ok(Lens { name: format!("{}, {}", file.lens.name, variant.name), ..blocks.optics.lens()? })
}

/// Sets what the network of a variant with this lens sees, if it looks at finished pictures. Earlier variants of the run must be finished.
pub fn set_sight(network: &mut NetworkBlock, run: &RunFolder, variant: &Variant, lens: &Lens) -> Result<()> {
    network.set_sight(Sight { sees: variant.sees, zoom: zoom_of(run, variant, lens)? });
    Ok(())
}

/// By how much pictures of a variant with this lens are enlarged for its detector, in a run whose earlier variants are finished.
pub fn zoom_of(run: &RunFolder, variant: &Variant, lens: &Lens) -> Result<f64> {
    let Some(other) = &variant.zoomed_like else { return Ok(1.0) };
    let scale = |lens: &Lens| image_height_per_tangent(&lens.at_wavelength(lens.reference_um));
    Ok(scale(&camera_lens(run, other)?.lens) / scale(lens))
}

/// A run in work.
pub struct DesignLoop {
    setup: Arc<Setup>,
    run: RunFolder,
    objective: Box<dyn Objective>,
    scorer: Scorer,
    blocks: Blocks,
    position: Position,
    /// The camera of the lens as it stands, made anew only when the lens has moved.
    camera: Option<Camera>,
    validations: Validations,
    log: EventLog,
    /// When the last checkpoint was written.
    kept_at: Instant,
    /// The next step after so long writes one.
    keep_every: Duration,
    /// Whether a step reads its windows and has changed nothing yet.
    waits_for_windows: bool,
}

/// A step that ends so long after the last checkpoint writes one, however few steps lie between them.
const KEPT_EVERY: Duration = Duration::from_secs(60);

/// A loss of so many times the first one of its block in the stage, and of so many times white, is no way to a camera.
const DIVERGED: f64 = 100.0;

/// Does some work, and meanwhile makes the windows of a batch that the camera will take next, where they take long to make.
fn beside_windows<R>(setup: &Setup, camera: &Camera, batch: Option<u64>, work: impl FnOnce() -> R) -> R {
    let (Ok(windows), Some(batch)) = (setup.windows(), batch) else { return work() };
    if !windows.are_slow() || rayon::current_num_threads() == 1 {
        return work();
    }
    let (view, experiment) = (SceneView::of(camera), &setup.experiment);
    // On the threads of the caller's pool: a process that was forked has none of those of the global pool. Work itself stays on this thread, as it
    // may wait for windows that another one makes.
    rayon::in_place_scope(|scope| {
        scope.spawn(move |_| windows.make_ahead(experiment, view, batch));
        work()
    })
}

/// The step of a block for the task: on which windows, and by which rule.
pub struct StepOf<'a> {
    /// The experiment.
    pub setup: &'a Setup,
    /// The variant whose block it is.
    pub variant: &'a Variant,
    /// What the step is for.
    pub objective: &'a dyn Objective,
    /// The block that moves.
    pub block: BlockName,
    /// How it moves.
    pub rule: StepRule,
    /// Number of the batch.
    pub number: u64,
    /// Number of the batch that the same camera will take next; its windows are made meanwhile.
    pub next: Option<u64>,
    /// Whether all windows are taken together, as a GPU does, also on the CPU.
    pub is_whole: bool,
}

/// What gives a step up between its windows: the flag of the run. A network of a user may remember the windows that it saw: it finishes its step.
fn may_give_up(setup: &Setup, network: &NetworkBlock) -> Cancel {
    if network.is_of_guest() { Cancel::default() } else { setup.cancel.clone() }
}

/// Takes the step of a block with a camera whose blocks are held. Returns the losses before the step. Fails with [`DesignError::Stopped`] between
/// two windows once [`Setup::cancel`] is set.
pub fn step_of(step: &StepOf, camera: &Camera, blocks: &mut Blocks) -> Result<BTreeMap<String, f64>> {
    let shots = step.setup.training_shots(camera, step.number)?;
    step_on(step, camera, blocks, &shots)
}

/// [`step_of`] on training windows that are there already.
fn step_on(
    step: &StepOf,
    camera: &Camera,
    blocks: &mut Blocks,
    shots: &[Shot],
) -> Result<BTreeMap<String, f64>> {
    let StepOf { setup, variant, objective, block, rule, number, next, is_whole } = *step;
    // A network behind the ISP needs no gradient by it, nor do a search and the differences of an exposure: they see the pictures that will be
    // scored.
    let needs_none =
        matches!(block, BlockName::Network | BlockName::Exposure) || rule.method == StepMethod::Evolution;
    let exact = (needs_none && camera.body().chip.is_some())
        .then(|| camera.with_chip(ChipValues::Exact(blocks.isp.values())));
    let camera = exact.as_ref().unwrap_or(camera);
    let magnified = |by: f64| setup.magnified_shots(camera, number, by);
    let is_magnified = block == BlockName::Optics
        && variant.field == FieldOfView::Free
        && setup.windows()?.follow_the_lens();
    let batch = Batch {
        camera,
        shots,
        noise: setup.noise(variant),
        loss: objective,
        further: &|number| setup.training_shots(camera, number),
        magnified: is_magnified.then_some(&magnified),
        is_whole,
        cancel: may_give_up(setup, &blocks.network),
    };
    let stepped = beside_windows(setup, camera, next, || blocks.get_mut(block).step(&batch, rule));
    // A network of a user that failed on the tape has given no gradient, whatever block moves.
    blocks.network.check()?;
    stepped
}

/// What one step did.
struct Step {
    block: &'static str,
    losses: BTreeMap<String, f64>,
    /// By how much each free number of the block lowered the loss.
    lowered: Vec<f64>,
    learning_rate: f64,
}

impl Step {
    /// A step that is not down a gradient.
    fn new(block: &'static str, losses: BTreeMap<String, f64>) -> Self {
        Self { block, losses, lowered: Vec::new(), learning_rate: 0.0 }
    }
}

impl DesignLoop {
    /// Starts a run in an empty folder, or continues one from its latest checkpoint.
    pub fn new(run: RunFolder, scorer: Scorer) -> Result<Self> {
        let folder = run.clone();
        Self::checked(run, scorer, &DigestCheck::new(&folder, &[], &|_: &str| ()))
    }

    /// The same for a run whose files must agree with their digests. A damaged checkpoint is set aside, with a warning, for the one before
    /// it. Fails if all are damaged, and if a finished camera or the events until the checkpoint were changed. Without the folder of
    /// checkpoints a run begins again, with a warning; one that is finished is refused.
    pub fn checked(run: RunFolder, scorer: Scorer, check: &DigestCheck) -> Result<Self> {
        forget_most_memory();
        let setup = scorer.setup().clone();
        let first = setup.variants.first().map(|v| v.name.clone());
        let Latest { restored, damaged } = Latest::read(&setup, &run, check)?;
        if let (None, Some((folder, why))) = (&restored, damaged.first()) {
            let problem = format!(
                "no checkpoint of this run is whole, the latest: {why}; hint: put it back from a copy, add `--accept-changed \
                 checkpoints/{}` if you mean the change, or take the folder checkpoints away: then the run begins again",
                folder.file_name().unwrap_or_default().to_string_lossy()
            );
            return Err(DesignError::Run { path: run.root().to_path_buf(), problem });
        }
        if restored.is_none() && run.metrics().is_file() {
            let problem = format!(
                "the run is finished, and its checkpoints are gone; hint: put the folder checkpoints back from a copy, or begin another run: \
                 petzval design {} --out FOLDER",
                run.config().display()
            );
            return Err(DesignError::Run { path: run.root().to_path_buf(), problem });
        }
        if restored.is_none() && !run.checkpoints().is_dir() {
            check.warn(&format!("{}: no checkpoint is left, and the run begins again", run.root().display()));
        }
        let Restored { position, blocks, validations, events } = match restored {
            Some(restored) => restored,
            None => {
                let position = Position { variant: first, ..Position::default() };
                let blocks = setup.blocks(last_variant(&setup, &position, &run)?)?;
                Restored { position, blocks, validations: Validations::default(), events: None }
            }
        };
        let variant = last_variant(&setup, &position, &run)?;
        check.check_cameras(position.finished.keys().map(String::as_str))?;
        let mut blocks = blocks;
        let lens = lens_of(&setup, variant, &blocks)?;
        set_sight(&mut blocks.network, &run, variant, &lens)?;
        // Later events go only now that the checkpoint is known to be good.
        let path = run.events();
        if let Some((latest, _)) = damaged.first().filter(|_| path.is_file()) {
            // Those after the older checkpoint go, too.
            let kept = latest.join("events.jsonl");
            std::fs::copy(&path, &kept).map_err(DesignError::io(&kept))?;
        }
        let at_checkpoint = events.map(|events| EventLog::resume_at(&path, &events)).transpose()?;
        let log = match at_checkpoint {
            Some(Some(log)) => log,
            Some(None) => {
                let change = ChangedFile { name: "events.jsonl".to_owned(), is_missing: !path.is_file() };
                if !check.is_accepted(&change) {
                    check.refuse(vec![change])?;
                }
                EventLog::resume(&path, position.step)?
            }
            None => EventLog::resume(&path, position.step)?,
        };
        for (folder, why) in damaged {
            let aside = set_aside(&folder)?;
            check.warn(&format!(
                "a checkpoint is damaged: {why}; the run goes on from the one of step {}, and the damaged one is kept as {}",
                position.step,
                aside.display()
            ));
        }
        let objective = setup.objective()?;
        let camera = None;
        Ok(Self {
            objective,
            scorer,
            blocks,
            position,
            camera,
            validations,
            log,
            setup,
            run,
            kept_at: Instant::now(),
            keep_every: KEPT_EVERY,
            waits_for_windows: false,
        })
    }

    /// The same run with a checkpoint after every step that ends so long after the last one; 60 s otherwise.
    pub fn keeping_every(self, keep_every: Duration) -> Self {
        Self { keep_every, ..self }
    }

    /// Runs to the end, or until [`Setup::cancel`] is set. The step in work is then given up, between two windows, and a checkpoint of the state
    /// before it is written: the resumed run takes the step again, to the same bits. So is the improvement or the score of a whole lens.
    pub fn run(mut self, observer: &mut dyn Observer) -> Result<Ending> {
        let setup = self.setup.clone();
        let stop = &setup.cancel;
        // A run that was extended after its end goes on with its first camera. This counts as a step, and has a checkpoint of its own:
        // otherwise a run killed later could take up a camera that is longer already.
        if self.position.variant.is_none() && self.position.next(&setup).is_some() {
            self.begin_next()?;
            self.position.step += 1;
            self.checkpoint(observer)?;
        }
        observer.start(self.position.step, self.position.step + self.position.left(&setup) as u64);
        observer.plan(self.position.units_left(&setup.variants));
        while let Some(variant) = self.position.variant(&setup) {
            if stop.is_set() {
                self.checkpoint(observer)?;
                return Ok(Ending::Stopped(self.position.step));
            }
            let started = Instant::now();
            let stage = variant.stages.get(self.position.stage);
            let goes_on = !self.validations.have_run_out(setup.experiment.validation.patience);
            let turn = stage.filter(|_| goes_on);
            let turn = turn.and_then(|s| s.turn(&self.position.taken).map(|block| (s, block)));
            let step = match (stage, turn) {
                (_, Some((Stage::Lens { goal, iterations, search }, _))) => {
                    self.improve_lens(variant, *goal, *iterations, *search, observer, stop)
                }
                (_, Some((Stage::Task(moves), block))) => self.step(variant, moves, block),
                (Some(stage), None) => {
                    self.keep_last_of_stage(observer)?;
                    self.end_stage(variant, stage)?;
                    continue;
                }
                (None, None) => self.finish_variant(variant, observer),
            };
            if let Err(error) = &step
                && stop.is_set()
                && error.is_stopped()
            {
                let is_for_task = matches!(turn, Some((Stage::Task(_), _)));
                return self.given_up(error, is_for_task, observer);
            }
            let Step { block, losses, lowered, learning_rate } = match step {
                Ok(step) => step,
                Err(error) => {
                    // A picture that cannot be read: once it can, the run goes on from here.
                    if self.waits_for_windows {
                        self.checkpoint(observer)?;
                    }
                    return Err(self.astray(error, variant, turn.map(|(_, block)| block))?);
                }
            };
            self.position.step += 1;
            let event = Event {
                step: self.position.step,
                camera: variant.name.clone(),
                block: block.to_owned(),
                losses,
                lowered,
                learning_rate,
                seconds: started.elapsed().as_secs_f64(),
            };
            self.position.seconds += event.seconds;
            self.log.write(&event)?;
            observer.step(&event);
            let every = self.setup.experiment.checkpoint.every as u64;
            if turn.is_none() || self.position.step.is_multiple_of(every) {
                self.checkpoint(observer)?;
            } else if self.kept_at.elapsed() >= self.keep_every {
                self.keep(observer)?;
            }
        }
        let metrics = collect_metrics(&self.setup, &self.run, self.scorer.scores())?;
        let metrics = self.scorer.with_reasons(metrics);
        let text = DesignError::json("the figures of the run", &metrics)?;
        write_file(&self.run.metrics_csv(), metrics.csv().as_bytes())?;
        observer.file(&self.run.metrics_csv(), "table");
        if let Some(pictures) = metrics.pictures_csv() {
            write_file(&self.run.pictures_csv(), pictures.as_bytes())?;
            observer.file(&self.run.pictures_csv(), "table");
        }
        // Last: a run that has it is complete.
        write_file(&self.run.metrics(), text.as_bytes())?;
        observer.file(&self.run.metrics(), "figures");
        note_digests(&self.run, &self.run.figures())?;
        RunRecord::finish(&self.run, self.position.seconds)?;
        Ok(Ending::Finished(Box::new(metrics)))
    }

    /// Ends a run whose step was given up, after a checkpoint of the state before the step; its events go.
    fn given_up(
        mut self,
        error: &DesignError,
        is_for_task: bool,
        observer: &mut dyn Observer,
    ) -> Result<Ending> {
        // A network of a user may have learnt from a part of the step, or have ended: the run goes on from its last checkpoint.
        let has_learnt = is_for_task && !self.waits_for_windows && self.blocks.network.is_of_guest();
        if has_learnt || matches!(error, DesignError::Guest(GuestError::Stopped(_))) {
            return Ok(Ending::Stopped(self.last_kept()?));
        }
        self.log = EventLog::resume(&self.run.events(), self.position.step)?;
        self.checkpoint(observer)?;
        Ok(Ending::Stopped(self.position.step))
    }

    /// The step of the latest checkpoint; 0 before the first.
    fn last_kept(&self) -> Result<u64> {
        Ok(latest_checkpoint(&self.run)?.map_or(0, |(step, _)| step))
    }

    /// Keeps the last step of a stage. A score or the improvement of a whole lens may follow: these take long, and keep nothing on their way.
    fn keep_last_of_stage(&mut self, observer: &mut dyn Observer) -> Result<()> {
        if self.last_kept()? < self.position.step { self.keep(observer) } else { Ok(()) }
    }

    /// One step of a block for the task.
    fn step(
        &mut self,
        variant: &Variant,
        moves: &BTreeMap<BlockName, Schedule>,
        block: BlockName,
    ) -> Result<Step> {
        let (taken, before) = (self.position.taken(block), self.position.before(block));
        let rule = moves[&block].rule(taken);
        let camera = match (block, moves[&block].error_share) {
            (BlockName::Optics, share) if share > 0.0 => {
                self.erring_camera(variant, moves, share, before + taken)?
            }
            _ => self.camera(variant, moves)?,
        };
        // The block that counts the steps of the stage is the last.
        let is_clock = moves.keys().next_back() == Some(&block);
        let is_due = is_clock && self.setup.experiment.validation.is_due(taken + 1, moves[&block].steps);
        let can_go_back = is_due && !self.blocks.network.is_of_guest();
        let earlier = can_go_back.then(|| self.as_it_stands(block)).transpose()?;
        let at = StepOf {
            setup: &self.setup,
            variant,
            objective: &*self.objective,
            block,
            rule,
            number: self.batch_number(moves, block, taken),
            next: self.next_batch(moves, block),
            is_whole: false,
        };
        self.waits_for_windows = true;
        let shots = self.setup.training_shots(&camera, at.number)?;
        self.waits_for_windows = false;
        let losses = step_on(&at, &camera, &mut self.blocks, &shots)?;
        let lowered = self.blocks.get_mut(block).lowered().to_vec();
        let step = Step { block: block.name(), losses, lowered, learning_rate: rule.rate };
        let mut step = self.after_step(variant, block, step)?;
        // While a network learns to imitate the ISP nothing improves, which would be taken for the end of a stage.
        let rests = self.blocks.isp.is_warming_up();
        if is_due && !rests {
            let validated = self.validate(variant, moves);
            if let Some(earlier) = earlier
                && validated.as_ref().is_err_and(DesignError::is_stopped)
            {
                self.take_back(block, earlier)?;
            }
            step.losses.insert(VALIDATION.to_owned(), validated?);
        }
        Ok(step)
    }

    /// What a step of a block changes.
    fn as_it_stands(&mut self, block: BlockName) -> Result<(Position, BlockState)> {
        let block = self.blocks.get_mut(block);
        let mut state = block.save_numbers()?;
        state.extend(block.save_progress()?);
        Ok((self.position.clone(), state))
    }

    /// Takes a step of a block back: its validation was cancelled.
    fn take_back(&mut self, block: BlockName, (position, state): (Position, BlockState)) -> Result<()> {
        let moved = self.blocks.get_mut(block);
        let problem = |problem| DesignError::Unwritable { what: "the state before a step", problem };
        moved.load_numbers(&state).and_then(|()| moved.load_progress(&state)).map_err(problem)?;
        self.position = position;
        self.camera = None;
        Ok(())
    }

    /// The number of the batch on which a block takes its step after `taken` of this stage.
    fn batch_number(&self, moves: &BTreeMap<BlockName, Schedule>, block: BlockName, taken: usize) -> u64 {
        // Within a stage each block draws windows of its own, behind those of all blocks after it in the light. They do not depend on stages
        // to come, which an extension may add; so a later stage may show a block windows that an earlier one showed to another.
        let later = BlockName::ALL.into_iter().filter(|other| *other > block);
        let at_end = |other| self.position.before(other) + moves.get(&other).map_or(0, |s| s.steps);
        let offset: usize = later.map(at_end).sum();
        (offset + self.position.before(block) + taken) as u64
    }

    /// The number of the batch after the step that a block is about to take; `None` if the stage ends, or another lens will look.
    fn next_batch(&self, moves: &BTreeMap<BlockName, Schedule>, block: BlockName) -> Option<u64> {
        let mut taken = self.position.taken.clone();
        *taken.entry(block).or_default() += 1;
        let next = turn_of(moves, &taken).filter(|_| !block.moves_psfs())?;
        Some(self.batch_number(moves, next, taken.get(&next).copied().unwrap_or(0)))
    }

    /// Validates the camera as it would be scored if it were finished now: with a lens at rest, and the hardware ISP in whole numbers. PSFs of a
    /// lens on its way are coarser, so that losses before and after it comes to rest could not be compared. Returns the loss.
    fn validate(&mut self, variant: &Variant, moves: &BTreeMap<BlockName, Schedule>) -> Result<f64> {
        let at_rest = if self.is_moving(moves) {
            self.setup.camera_of(variant, self.lens(variant)?, false)?
        } else {
            self.camera(variant, moves)?
        };
        let Blocks { exposure, isp, network, .. } = &self.blocks;
        let camera = finished(&at_rest, exposure, isp, network);
        let noise = self.setup.noise(variant);
        let shots = self.setup.validation_shots(&camera)?;
        let cancel = may_give_up(&self.setup, &self.blocks.network);
        let loss = validation_loss(&camera, &shots, &noise, self.objective.as_ref(), &cancel)?;
        if !loss.is_finite() {
            let (camera, step) = (variant.name.clone(), self.position.step + 1);
            return Err(DesignError::Diverged {
                camera,
                block: VALIDATION,
                step,
                value: loss,
                first: None,
                hint: "",
            });
        }
        self.validations.add(loss, &self.blocks, self.setup.experiment.validation.keep)?;
        self.position.validation = self.validations.course();
        Ok(loss)
    }

    /// Improves the lens alone. Every iteration is an event; all of them are one step, which an interrupted run takes again.
    fn improve_lens(
        &mut self,
        variant: &Variant,
        goal: LensGoal,
        iterations: usize,
        search: LensSearch,
        observer: &mut dyn Observer,
        stop: &Cancel,
    ) -> Result<Step> {
        let (step, log) = (self.position.step + 1, &mut self.log);
        let mut started = Instant::now();
        let mut watch = |losses| {
            let seconds = started.elapsed().as_secs_f64();
            started = Instant::now();
            let (camera, block) = (variant.name.clone(), goal.event().to_owned());
            let event =
                Event { step, camera, block, losses, lowered: Vec::new(), learning_rate: 0.0, seconds };
            observer.step(&event);
            log.write(&event)
        };
        let losses = self.blocks.optics.improve(goal, iterations, search, &mut watch, stop)?;
        for remark in self.blocks.optics.remarks() {
            observer.note(&format!("{}, lens for {}: {remark}", variant.name, goal.in_words()));
        }
        self.after_step(variant, BlockName::Optics, Step::new(goal.event(), losses))
    }

    /// Counts a step that a block took, and refuses one that led to what is no number.
    fn after_step(&mut self, variant: &Variant, block: BlockName, step: Step) -> Result<Step> {
        let moved = self.blocks.get_mut(block).is_finite();
        let total = step.losses.get(TOTAL).copied();
        let first = total.map(|total| *self.position.first_losses.entry(block).or_insert(total));
        let has_grown = |total: &f64| first.is_some_and(|first| *total > DIVERGED * first.max(1.0));
        let lost = step.losses.values().copied().find(|v| !v.is_finite()).or(total.filter(has_grown));
        if let Some(value) = lost.or((!moved).then_some(f64::NAN)) {
            let camera = variant.name.clone();
            return Err(DesignError::Diverged {
                camera,
                block: step.block,
                step: self.position.step + 1,
                value,
                first: first.filter(|_| value.is_finite()),
                hint: "",
            });
        }
        *self.position.taken.entry(block).or_default() += 1;
        if block.moves_psfs() {
            self.camera = None;
        }
        Ok(step)
    }

    /// What is said of a step that led nowhere: where, from which checkpoint the run was still good, and what to try.
    fn astray(&self, error: DesignError, variant: &Variant, block: Option<BlockName>) -> Result<DesignError> {
        let (camera, step) = (variant.name.clone(), self.position.step + 1);
        let error = match error {
            // The lens had light when it started: it is the job that went astray, not the input.
            DesignError::NoLight { field_deg, lost } => {
                DesignError::LostLight { camera, step, field_deg, lost }
            }
            DesignError::OutsideTheImage { radius_mm } => DesignError::LostImage { camera, step, radius_mm },
            other => other,
        };
        let is_astray = matches!(
            error,
            DesignError::Diverged { .. } | DesignError::LostLight { .. } | DesignError::LostImage { .. }
        );
        if !is_astray {
            return Ok(error);
        }
        let rate = variant.stages.get(self.position.stage).and_then(|stage| match stage {
            Stage::Task(moves) => {
                block.and_then(|block| Some((block.name(), moves.get(&block)?.learning_rate)))
            }
            Stage::Lens { .. } => None,
        });
        let last_good = latest_checkpoint(&self.run)?.map(|(step, _)| step);
        Ok(DesignError::Astray { error: Box::new(error), last_good, rate, config: self.run.config() })
    }

    /// Goes on to the next stage of the variant.
    fn end_stage(&mut self, variant: &Variant, stage: &Stage) -> Result<()> {
        self.validations.end(&mut self.blocks)?;
        self.position.validation = None;
        self.position.first_losses.clear();
        for (block, taken) in std::mem::take(&mut self.position.taken) {
            if let Stage::Task(_) = stage {
                *self.position.before.entry(block).or_default() += taken;
            }
        }
        self.position.stage += 1;
        self.camera = None;
        let next = variant.stages.get(self.position.stage);
        // A finished ISP keeps the network that imitates it: an extension of the run goes on with it.
        self.blocks.begin_stage(|block| match next {
            Some(stage) => stage.improves(block),
            None => block == BlockName::Isp,
        });
        Ok(())
    }

    /// The lens of a variant as it stands.
    fn lens(&self, variant: &Variant) -> Result<Lens> {
        lens_of(&self.setup, variant, &self.blocks)
    }

    /// Whether the lens has steps to come in a stage.
    fn is_moving(&self, moves: &BTreeMap<BlockName, Schedule>) -> bool {
        let moves_psfs = |(block, schedule): (&BlockName, &Schedule)| {
            let is_drawn = schedule.method == StepMethod::Random;
            block.moves_psfs() && (is_drawn || self.position.taken(*block) < schedule.steps)
        };
        moves.iter().any(moves_psfs)
    }

    /// The camera of a variant as it stands, with its network held.
    fn camera(&mut self, variant: &Variant, moves: &BTreeMap<BlockName, Schedule>) -> Result<Camera> {
        let is_moving = self.is_moving(moves);
        // The lens comes to rest, and is sampled finely, when its last step is taken: that step has dropped this camera.
        let camera = match self.camera.take() {
            Some(camera) => camera,
            None if is_moving => {
                let drawn = self.blocks.optics.drawn_lens().transpose()?;
                let lens = drawn.map_or_else(|| self.lens(variant), Ok)?;
                self.setup.moving_camera(variant, lens)?
            }
            None => self.setup.camera_of(variant, self.lens(variant)?, false)?,
        };
        self.camera = Some(camera.clone());
        Ok(self.blocks.held(&camera))
    }

    /// The camera of a variant for a lens step as it might be made: its lens has random errors, of which development knows nothing.
    fn erring_camera(
        &mut self,
        variant: &Variant,
        moves: &BTreeMap<BlockName, Schedule>,
        share: f64,
        step: usize,
    ) -> Result<Camera> {
        let drawn = self.camera(variant, moves)?;
        let lens = self.blocks.optics.with_errors(share, self.setup.experiment.seed, step as u64)?;
        Ok(self.blocks.held(&self.setup.moving_camera(variant, lens)?).taken_for(&drawn))
    }

    /// Keeps the step in a checkpoint, and the lens in the history of lenses.
    fn checkpoint(&mut self, observer: &mut dyn Observer) -> Result<()> {
        self.keep(observer)?;
        // A variant that has not begun adds nothing to the history of lenses.
        let p = &self.position;
        if let (Some(variant), true) = (p.variant(&self.setup), p.stage > 0 || !p.taken.is_empty()) {
            let path = self.run.lens_at_step(p.step);
            write_file(&path, self.lens_text(variant, &self.lens(variant)?).as_bytes())?;
            observer.file(&path, "lens");
        }
        Ok(())
    }

    /// Keeps the step in a checkpoint. The history of lenses, which a report shows, does not depend on how long steps take.
    fn keep(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let keep = self.setup.experiment.checkpoint.keep;
        if let Some(reads) = self.setup.windows()?.first_reads() {
            first_reads::add(&self.run, reads.take_fresh())?;
        }
        let events = self.log.digest()?;
        save_checkpoint(&self.run, self.position.step, keep, Some(events), |folder| {
            let text = DesignError::json("the position of the run", &self.position)?;
            let path = folder.join(POSITION_FILE);
            write_file(&path, text.as_bytes())?;
            save_blocks(folder, self.blocks.all(), Kept::NumbersAndProgress)?;
            self.validations.save(folder)
        })?;
        if let Some((step, folder)) = latest_checkpoint(&self.run)?
            && step == self.position.step
        {
            observer.file(&folder, "checkpoint");
        }
        self.kept_at = Instant::now();
        Ok(())
    }

    /// The file of a variant's lens. The bounds of a solved radius are a limit with a price, which a step may pass by a little: they are
    /// widened to the radius then, because a lens outside its bounds cannot be read again.
    fn lens_text(&self, variant: &Variant, lens: &Lens) -> String {
        let file = self.setup.start(variant).lens_file.clone();
        let widened = |surface: usize, radius_mm: Option<[f64; 2]>| {
            let radius = Number::Curvature.read_stated(lens, surface);
            radius_mm.map(|[min, max]| [min.min(radius), max.max(radius)])
        };
        let efl_solve = file.efl_solve.map(|s| EflSolve { radius_mm: widened(s.surface, s.radius_mm), ..s });
        let magnification_solve = file
            .magnification_solve
            .map(|s| MagnificationSolve { radius_mm: widened(s.surface, s.radius_mm), ..s });
        write_lens(&LensFile { lens: lens.clone(), expect: None, efl_solve, magnification_solve, ..file })
    }

    /// Scores a variant, keeps its lens, network and pictures, and makes room for the next.
    fn finish_variant(&mut self, variant: &Variant, observer: &mut dyn Observer) -> Result<Step> {
        let lens = self.lens(variant)?;
        validate(&lens).map_err(|defect| DesignError::Unmakeable { camera: variant.name.clone(), defect })?;
        let Blocks { exposure, isp, network, .. } = &self.blocks;
        let camera = finished_camera(&self.setup, variant, lens.clone(), exposure, isp, network)?;
        let watching = RefCell::new(&mut *observer);
        let tick = |done, of| watching.borrow_mut().scoring(&variant.name, done, of);
        let Scored { metrics, pictures, findings } =
            self.scorer.score_watched(&variant.name, &camera, &tick)?;
        let [isp_steps, network_steps] =
            [BlockName::Isp, BlockName::Network].map(|block| self.position.before(block));
        let is_ceiling = variant.lens == PERFECT_LENS;
        let metrics = CameraMetrics { is_ceiling, isp_steps, network_steps, ..metrics };
        let folder = self.run.camera(&variant.name);
        std::fs::create_dir_all(&folder).map_err(DesignError::io(&folder))?;
        for path in [folder.join("lens.toml"), self.run.lens_at_step(self.position.step)] {
            write_file(&path, self.lens_text(variant, &lens).as_bytes())?;
            observer.file(&path, "lens");
        }
        save_blocks(&folder, self.blocks.all(), Kept::Numbers)?;
        let weights = match self.blocks.network.free_numbers() {
            0 => None,
            _ => self.blocks.network.to_safetensors()?,
        };
        if let Some(weights) = weights {
            let path = self.run.camera_weights(&variant.name);
            write_file(&path, &weights)?;
            observer.file(&path, "weights");
        }
        let text = DesignError::json("the figures of the run", &metrics)?;
        let path = self.run.camera_metrics(&variant.name);
        write_file(&path, text.as_bytes())?;
        observer.file(&path, "figures");
        crate::pictures::save(&self.run, &variant.name, &pictures)?;
        findings.save(&folder)?;
        Digests::of_folder(&folder)?.write(&folder)?;
        observer.file(&folder, "camera");
        observer.camera(&metrics);
        let done =
            Done { stages: variant.stages.len(), steps: Some(std::mem::take(&mut self.position.before)) };
        self.position.finished.insert(variant.name.clone(), done);
        self.begin_next()?;
        let losses = metrics.scores.clone();
        Ok(Step::new(SCORE, losses))
    }

    /// Makes the next variant ready: from its lens with a new network, from the variant that it names, or, if the run was extended,
    /// from its own finished camera.
    fn begin_next(&mut self) -> Result<()> {
        let setup = self.setup.clone();
        let Position { step, finished, seconds, .. } = std::mem::take(&mut self.position);
        self.position = Position { step, finished, seconds, ..Position::default() };
        self.camera = None;
        let Some(next) = self.position.next(&setup) else { return Ok(()) };
        let stage = self.position.finished(next);
        self.position.variant = Some(next.name.clone());
        self.position.stage = stage;
        self.blocks = setup.blocks(next)?;
        let own = (stage > 0).then_some(&next.name);
        if let Some(from) = own.or(next.from.as_ref()) {
            let keeps_lens = stage > 0 || next.keeps_lens;
            let taken = self.blocks.all_mut().into_iter();
            let taken = taken.filter(|block| keeps_lens || block.name() != BlockName::Optics);
            load_blocks(&self.run.camera(from), taken, Kept::Numbers)?;
            // It sees other windows than those that it was trained on.
            self.position.before = self.position.steps_behind(from, &setup);
            let first = next.stages.get(stage);
            self.blocks.begin_stage(|block| first.is_some_and(|stage| stage.improves(block)));
        }
        let lens = self.lens(next)?;
        set_sight(&mut self.blocks.network, &self.run, next, &lens)
    }
}
