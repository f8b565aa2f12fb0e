//! The design loop: blocks that take turns, one camera after the other, resumable at every step.
//!
//! Every camera gets the same number of network steps on the same data in the same order, and the same
//! noise. The lens of the end-to-end camera steps in between, its gradient coming through the network's loss,
//! the development, the sensor and the renderer to the PSFs, and from there by the adjoint of ray tracing.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use petzval_camera::psf::PsfLayout;
use petzval_camera::render::Placement;
use petzval_camera::sensor::Noise;
use petzval_files::{LensFile, write_lens};
use petzval_learn::dataset::training_crop;
use petzval_learn::loss::Lpips;
use petzval_learn::network::UNetConfig;
use petzval_learn::task::{ImageQualityTask, Task};
use petzval_optics::lens::{Lens, validate};
use serde::{Deserialize, Serialize};

use crate::adam::cosine_rate;
use crate::cameras::CameraKind;
use crate::error::DesignError;
use crate::joint::{joint_gradient, named};
use crate::light_path::{LightPath, PsfLeaves, Shot};
use crate::run::{
    CameraMetrics, Event, EventLog, Metrics, RunFolder, latest_checkpoint, save_checkpoint, write_atomically,
};
use crate::scoring::score_camera;
use crate::setup::Setup;
use crate::spot_design::{MovingLens, SpotMerit};

/// Someone who watches a run.
pub trait Observer {
    /// The run starts or goes on, `done` of `total` steps behind it.
    fn start(&mut self, done: u64, total: u64);
    /// A step was taken.
    fn step(&mut self, event: &Event);
    /// A camera is finished and scored.
    fn camera(&mut self, metrics: &CameraMetrics);
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// All cameras are made and scored.
    Finished(Box<Metrics>),
    /// It was asked to stop, and left a checkpoint at this step.
    Stopped(u64),
}

/// Where a run stands: what a checkpoint holds, apart from the network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Position {
    /// Steps taken by all blocks of all cameras.
    step: u64,
    /// Index of the camera at work; past the last when all are made.
    camera: usize,
    spot_steps: usize,
    optics_steps: usize,
    network_steps: usize,
    moving: MovingLens,
}

impl Position {
    /// Refuses a position that the run of this setup cannot have at this step.
    fn check(&self, setup: &Setup, step: u64) -> Result<(), &'static str> {
        let (e, free) = (&setup.experiment, setup.space.start().len());
        if self.step != step {
            return Err("the checkpoint is of another step than its folder says");
        }
        if self.camera > CameraKind::ALL.len() {
            return Err("there are not as many cameras");
        }
        if self.spot_steps > e.spot.steps
            || self.optics_steps > e.optics.steps
            || self.network_steps > e.training.steps
        {
            return Err("more steps were taken than config.toml asks for; has it been changed?");
        }
        if self.moving.x.len() != free || !self.moving.adam.fits(free) {
            return Err("the lens has other variables; has its file been changed?");
        }
        Ok(())
    }
}

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Turn {
    Spot,
    Optics,
    Network,
    /// The camera is made: score it and go on to the next.
    Score,
}

/// A block of the end-to-end camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepKind {
    /// The network learns behind a fixed lens.
    Network,
    /// The lens moves in front of a held network.
    Optics,
}

/// A run at work.
pub struct DesignLoop<'a> {
    setup: &'a Setup,
    run: &'a RunFolder,
    path: LightPath,
    lpips: Lpips,
    task: Box<dyn Task>,
    position: Position,
    /// PSFs of the lens at hand, made anew only when it has moved.
    current: Option<PsfLeaves>,
    log: EventLog,
}

const POSITION_FILE: &str = "position.json";

impl<'a> DesignLoop<'a> {
    /// Starts a run in an empty folder, or goes on from the latest checkpoint of one.
    pub fn new(setup: &'a Setup, run: &'a RunFolder) -> Result<Self, DesignError> {
        let lpips = Lpips::from_safetensors(&setup.lpips_weights, &setup.device)?;
        let mut task = new_task(setup)?;
        let mut position = Position {
            step: 0,
            camera: 0,
            spot_steps: 0,
            optics_steps: 0,
            network_steps: 0,
            moving: MovingLens::start(&setup.space),
        };
        if let Some((step, folder)) = latest_checkpoint(run)? {
            let path = folder.join(POSITION_FILE);
            let text = std::fs::read_to_string(&path).map_err(DesignError::io(&path))?;
            let damaged = |problem: String| DesignError::Run { path: path.clone(), problem };
            position = serde_json::from_str(&text).map_err(|e| damaged(e.to_string()))?;
            position.check(setup, step).map_err(|problem| damaged(problem.to_owned()))?;
            task.load(&folder)?;
        }
        // Later events go only now that the checkpoint is known to be good.
        let log = EventLog::resume(&run.events(), position.step)?;
        Ok(Self { path: light_path(setup), task, lpips, position, current: None, log, setup, run })
    }

    /// Runs to the end, or until `stop` is set; then the step at hand is finished and a checkpoint written.
    pub fn run(mut self, observer: &mut dyn Observer, stop: &AtomicBool) -> Result<Ending, DesignError> {
        observer.start(self.position.step, self.total_steps());
        while let Some(kind) = CameraKind::ALL.get(self.position.camera).copied() {
            if stop.load(Ordering::Relaxed) {
                self.checkpoint()?;
                return Ok(Ending::Stopped(self.position.step));
            }
            let turn = self.turn(kind);
            let started = Instant::now();
            let step = match turn {
                Turn::Spot => self.spot_step(),
                Turn::Optics => self.optics_step(kind),
                Turn::Network => self.network_step(kind),
                Turn::Score => self.finish_camera(kind, observer),
            };
            let (block, losses, learning_rate) = step.map_err(|error| match error {
                // The lens had light when it started: it is the job that went astray, not the input.
                DesignError::NoLight { field_deg } => DesignError::LostLight {
                    camera: kind.name().to_owned(),
                    step: self.position.step + 1,
                    field_deg,
                },
                other => other,
            })?;
            self.position.step += 1;
            let event = Event {
                step: self.position.step,
                camera: kind.name().to_owned(),
                block: block.to_owned(),
                losses,
                learning_rate,
                seconds: started.elapsed().as_secs_f64(),
            };
            self.log.write(&event)?;
            observer.step(&event);
            let every = self.setup.experiment.checkpoint.every as u64;
            if turn == Turn::Score || self.position.step.is_multiple_of(every) {
                self.checkpoint()?;
            }
        }
        let metrics = self.collect_metrics()?;
        Ok(Ending::Finished(Box::new(metrics)))
    }

    /// Takes one step of a block for the end-to-end camera, out of turn: for measuring its cost.
    pub fn one_step(&mut self, kind: StepKind) -> Result<(), DesignError> {
        match kind {
            StepKind::Network => self.network_step(CameraKind::EndToEnd).map(|_| ()),
            StepKind::Optics => self.optics_step(CameraKind::EndToEnd).map(|_| ()),
        }
    }

    fn total_steps(&self) -> u64 {
        let e = &self.setup.experiment;
        // Scoring a camera is a step too.
        (CameraKind::ALL.len() * (e.training.steps + 1) + e.spot.steps + e.optics.steps) as u64
    }

    /// Whose turn it is. Lens steps are spread evenly over the first part of the network's steps.
    fn turn(&self, kind: CameraKind) -> Turn {
        let (e, p) = (&self.setup.experiment, &self.position);
        if kind == CameraKind::SpotOptimised && p.spot_steps < e.spot.steps {
            return Turn::Spot;
        }
        if kind == CameraKind::EndToEnd && p.optics_steps < e.optics.steps {
            let moving = (e.optics.moving_share * e.training.steps as f64).max(1.0);
            let due = ((p.network_steps + 1) as f64 / moving * e.optics.steps as f64) as usize;
            if p.optics_steps < due || p.network_steps == e.training.steps {
                return Turn::Optics;
            }
        }
        if p.network_steps < e.training.steps { Turn::Network } else { Turn::Score }
    }

    fn spot_step(&mut self) -> Result<Step, DesignError> {
        let spot = self.setup.experiment.spot;
        let rate =
            cosine_rate(spot.learning_rate, spot.final_learning_rate, self.position.spot_steps, spot.steps);
        let merit = SpotMerit {
            space: &self.setup.space,
            fields_rad: &self.setup.spot_fields_rad,
            requirements: &self.setup.requirements,
        };
        let rms_um = merit.step(&mut self.position.moving, rate)?;
        self.check_finite(CameraKind::SpotOptimised, "spot", &self.position.moving.x)?;
        self.position.spot_steps += 1;
        self.current = None;
        Ok(("spot", BTreeMap::from([("rms_spot_um".to_owned(), rms_um)]), rate))
    }

    /// One step of the lens: the network is held, its loss pulled back to the PSFs and through the lens.
    fn optics_step(&mut self, kind: CameraKind) -> Result<Step, DesignError> {
        let optics = self.setup.experiment.optics;
        let taken = self.position.optics_steps;
        let rate = cosine_rate(optics.learning_rate, optics.final_learning_rate, taken, optics.steps);

        // Lens steps draw crops of their own, behind those of all network steps.
        let shots = self.shots((self.setup.experiment.training.steps + taken) as u64)?;
        let x = &self.position.moving.x;
        let found = joint_gradient(self.setup, &self.path, self.task.as_ref(), x, &shots, &self.noise())?;
        self.check_finite(kind, "optics", found.losses.values().chain(&found.by_x))?;
        let moving = &mut self.position.moving;
        moving.adam.step(&mut moving.x, &found.by_x, rate);
        self.position.optics_steps += 1;
        self.current = None;
        Ok(("optics", found.losses, rate))
    }

    /// One step of the network behind the lens as it stands.
    fn network_step(&mut self, kind: CameraKind) -> Result<Step, DesignError> {
        let training = self.setup.experiment.training;
        let step = self.position.network_steps;
        let rate = cosine_rate(training.learning_rate, training.final_learning_rate, step, training.steps);
        let shots = self.shots(step as u64)?;
        let leaves = match self.current.take() {
            Some(leaves) => leaves,
            None => self.leaves(kind)?,
        };
        let developed = self.path.take(&leaves, &shots, &self.noise())?;
        self.current = Some(leaves);
        let truth = self.path.truth(&shots, &self.setup.device)?;
        let loss = self.task.learning_loss(developed, truth)?;
        let losses = named(&loss);
        self.check_finite(kind, "network", losses.values())?;
        self.task.learn(loss, rate);
        self.position.network_steps += 1;
        Ok(("network", losses, rate))
    }

    /// The windows of a step: the same for every camera.
    fn shots(&self, step: u64) -> Result<Vec<Shot>, DesignError> {
        let (setup, batch) = (self.setup, self.setup.experiment.training.batch);
        let (crops, photos) = (&setup.training_crops, setup.photos.training());
        (0..batch)
            .map(|item| {
                let c = training_crop(crops, photos, setup.experiment.seed, step, item as u32)?;
                let window = crops.window();
                let mut scene = photos[c.photo]
                    .image
                    .crop(c.row, c.column, window, window)
                    .map_err(|e| DesignError::Device(e.to_string()))?;
                if c.flip {
                    mirror(&mut scene.data, window);
                }
                let placement = Placement { row: c.sensor_row, col: c.sensor_column };
                Ok(Shot { scene, placement, frame: step * batch as u64 + item as u64 })
            })
            .collect()
    }

    fn noise(&self) -> Noise {
        Noise { mode: self.setup.experiment.training.noise, seed: self.setup.experiment.seed }
    }

    /// The lens of a camera as it stands.
    fn lens(&self, kind: CameraKind) -> Result<Lens, DesignError> {
        match kind {
            CameraKind::Nominal => Ok(self.setup.lens_file.lens.clone()),
            CameraKind::SpotOptimised | CameraKind::EndToEnd => {
                let mut lens = self.setup.space.lens_at(&self.position.moving.x)?;
                lens.name = format!("{}, {}", self.setup.lens_file.lens.name, kind.name());
                Ok(lens)
            }
        }
    }

    /// The PSFs of a camera's lens as it stands. One on its way is sampled as it was for its gradient; one at
    /// rest finely.
    fn leaves(&self, kind: CameraKind) -> Result<PsfLeaves, DesignError> {
        let still_moving =
            kind == CameraKind::EndToEnd && self.position.optics_steps < self.setup.experiment.optics.steps;
        let plan = if still_moving { &self.setup.moving_plan } else { &self.setup.fixed_plan };
        Ok(PsfLeaves::new(&plan.bank(&self.lens(kind)?)?, &self.setup.device, false))
    }

    fn check_finite<'v>(
        &self,
        kind: CameraKind,
        block: &'static str,
        values: impl IntoIterator<Item = &'v f64>,
    ) -> Result<(), DesignError> {
        match values.into_iter().find(|v| !v.is_finite()) {
            None => Ok(()),
            Some(value) => Err(DesignError::Diverged {
                camera: kind.name().to_owned(),
                block,
                step: self.position.step + 1,
                value: *value,
            }),
        }
    }

    fn checkpoint(&self) -> Result<(), DesignError> {
        let keep = self.setup.experiment.checkpoint.keep;
        save_checkpoint(self.run, self.position.step, keep, |folder| {
            let text = DesignError::json("the position of the run", &self.position)?;
            let path = folder.join(POSITION_FILE);
            std::fs::write(&path, text).map_err(DesignError::io(&path))?;
            self.task.save(folder).map_err(DesignError::from)
        })?;
        // A camera that has not begun adds nothing to the history of lenses.
        let p = &self.position;
        if let (Some(kind), true) =
            (CameraKind::ALL.get(p.camera), p.spot_steps + p.optics_steps + p.network_steps > 0)
        {
            let path = self.run.lens_at_step(p.step);
            write_atomically(&path, self.lens_text(&self.lens(*kind)?).as_bytes())?;
        }
        Ok(())
    }

    fn lens_text(&self, lens: &Lens) -> String {
        let file = LensFile { lens: lens.clone(), expect: None, ..self.setup.lens_file.clone() };
        write_lens(&file)
    }

    /// Scores a camera, keeps its lens, network and pictures, and makes room for the next.
    fn finish_camera(&mut self, kind: CameraKind, observer: &mut dyn Observer) -> Result<Step, DesignError> {
        let lens = self.lens(kind)?;
        validate(&lens)
            .map_err(|defect| DesignError::Unmakeable { camera: kind.name().to_owned(), defect })?;
        let (metrics, pictures) =
            score_camera(self.setup, &self.path, kind.name(), &lens, self.task.as_ref(), &self.lpips)?;
        let folder = self.run.camera(kind.name());
        std::fs::create_dir_all(&folder).map_err(DesignError::io(&folder))?;
        for path in [folder.join("lens.toml"), self.run.lens_at_step(self.position.step)] {
            write_atomically(&path, self.lens_text(&lens).as_bytes())?;
        }
        self.task.save(&folder)?;
        let text = DesignError::json("the figures of the run", &metrics)?;
        write_atomically(&folder.join("metrics.json"), text.as_bytes())?;
        crate::pictures::save(self.run, kind.name(), &pictures)?;
        observer.camera(&metrics);

        // The next camera starts from the nominal lens with a new network.
        self.position.camera += 1;
        self.position.spot_steps = 0;
        self.position.optics_steps = 0;
        self.position.network_steps = 0;
        self.position.moving = MovingLens::start(&self.setup.space);
        self.task = new_task(self.setup)?;
        self.current = None;
        let scores = BTreeMap::from([
            ("lpips".to_owned(), 1.0 - metrics.one_minus_lpips),
            ("psnr_db".to_owned(), metrics.psnr_db),
        ]);
        Ok(("score", scores, 0.0))
    }

    fn collect_metrics(&self) -> Result<Metrics, DesignError> {
        let metrics = collect_metrics(self.setup, self.run)?;
        let text = DesignError::json("the figures of the run", &metrics)?;
        write_atomically(&self.run.metrics(), text.as_bytes())?;
        Ok(metrics)
    }
}

/// Block, losses by name, learning rate.
type Step = (&'static str, BTreeMap<String, f64>, f64);

/// The stages of an experiment that do not change.
pub fn light_path(setup: &Setup) -> LightPath {
    LightPath {
        geometry: setup.geometry.clone(),
        layout: PsfLayout {
            field_radius_mm: setup.fixed_plan.field_radius_mm.clone(),
            grid: setup.experiment.psf.grid,
            pitch_um: setup.experiment.psf.pitch_um,
        },
        sensor: setup.sensor.clone(),
        exposure: setup.experiment.exposure.exposure(),
        border: setup.training_crops.margin,
    }
}

/// A new, untrained task: the same bits for every camera of a run.
pub fn new_task(setup: &Setup) -> Result<Box<dyn Task>, DesignError> {
    let e = &setup.experiment;
    let task = ImageQualityTask::new(
        UNetConfig { base_channels: e.network.base_channels, levels: e.network.levels, ..Default::default() },
        e.seed,
        e.loss,
        Lpips::from_safetensors(&setup.lpips_weights, &setup.device)?,
        &setup.device,
    )?;
    Ok(Box::new(task))
}

/// Gathers the figures of the cameras of a run.
pub fn collect_metrics(setup: &Setup, run: &RunFolder) -> Result<Metrics, DesignError> {
    let rows: Vec<CameraMetrics> = CameraKind::ALL
        .iter()
        .map(|kind| {
            let path = run.camera(kind.name()).join("metrics.json");
            let text = std::fs::read_to_string(&path).map_err(DesignError::io(&path))?;
            serde_json::from_str(&text).map_err(|e| DesignError::Run { path, problem: e.to_string() })
        })
        .collect::<Result<_, _>>()?;
    Ok(Metrics {
        held_out_images: setup.photos.held_out().len(),
        held_out_places: setup.experiment.scoring.places_per_side.pow(2),
        rows,
        seeds: vec![setup.experiment.seed],
        ssim_variant: "Gaussian 11x11, sigma 1.5, population covariance, mean over channels".to_owned(),
        lpips_variant: "LPIPS v0.1, AlexNet".to_owned(),
    })
}

/// Mirrors every row of `width` values.
fn mirror(data: &mut [f32], width: usize) {
    data.chunks_exact_mut(width).for_each(<[f32]>::reverse);
}
