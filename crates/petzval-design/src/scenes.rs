//! The scenes in which an experiment looks for objects: generated streets, or the pictures of a folder. A window is made when it is first
//! needed, streets for the chief rays of the lens that looks, and kept as long as that lens does.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use petzval_camera::render::Placement;
use petzval_learn::dataset::{
    CropPlan, LabelledPictures, LabelledWindow, PictureWindows, StreetPlan, StreetView, Wanted,
};
use petzval_optics::lens::Lens;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::camera::{Camera, Shot, crop_window};
use crate::error::DesignError;
use crate::experiment::{Experiment, STREET, StreetConfig, TaskKind};
use crate::psf_plan::PsfPlan;

pub use petzval_learn::dataset::List;

/// Frames of validations and scores are numbered apart from those of training.
const FIRST_FRAME: [u64; 3] = [0, 1 << 42, 0];

/// Where windows come from.
enum Source {
    /// Streets that are made by seed.
    Streets(StreetPlan),
    /// The pictures of a folder, whose geometry is that of the camera that took them.
    Pictures(LabelledPictures, PictureWindows),
}

/// Windows of scenes, by the projection of the lens that sees them.
pub struct Scenes {
    source: Source,
    /// What of a folder cannot be used, in sentences.
    pub notes: Vec<String>,
    config: StreetConfig,
    seed: u64,
    training_crops: CropPlan,
    scoring_crops: CropPlan,
    /// Field angles of the projection, as those of scores.
    fields: PsfPlan,
    pixel_mm: f64,
    /// The windows that blocks are trained and validated on.
    moving: Mutex<Kept>,
    /// The windows of scores.
    scored: Mutex<Kept>,
}

/// How far a place of the image may have moved since windows were made, for training to go on with them, pixels. Windows of scores are made for
/// the lens that is scored.
const DRIFT_PX: f64 = 0.25;

/// The windows of one projection.
#[derive(Default)]
struct Kept {
    lens: Option<Lens>,
    /// Its field angles at the radii of the plan.
    angles_rad: Vec<f64>,
    view: Option<Arc<StreetView>>,
    windows: HashMap<(List, u64), Arc<LabelledWindow>>,
}

impl Scenes {
    /// The scenes of an experiment on a sensor of these pixels. `crops` are those of training and of scores, and `plan` has the corner of the
    /// sensor. Fails on a folder that cannot be read, or in which a class has no boxes.
    pub fn new(
        experiment: &Experiment,
        crops: [CropPlan; 2],
        plan: &PsfPlan,
        pixel_um: f64,
    ) -> Result<Self, DesignError> {
        let config = experiment.street.clone();
        let wanted = match experiment.task {
            TaskKind::TrafficLight => Wanted::TrafficLights,
            _ => Wanted::PeopleAndVehicles,
        };
        // Scenes are the same for every seed of a run, as photographs are.
        let seed = 1;
        let mut notes = Vec::new();
        let source = match experiment.data.as_str() {
            STREET => Source::Streets(StreetPlan {
                seed,
                light: config.light,
                wanted,
                white_cd_m2: config.white_cd_m2,
                samples: config.samples,
                on_objects: config.on_objects,
                least_side_px: config.least_side_px,
                least_visible: config.least_visible,
            }),
            folder => {
                let crop = experiment.training.crop.max(experiment.scoring.crop);
                let classes = experiment.task.classes();
                let (pictures, defects) = LabelledPictures::load(Path::new(folder), wanted, classes, crop)?;
                notes = defects;
                let (on_objects, least_side_px) = (config.on_objects, config.least_side_px);
                Source::Pictures(pictures, PictureWindows { seed, on_objects, least_side_px })
            }
        };
        let [training_crops, scoring_crops] = crops;
        Ok(Self {
            source,
            notes,
            config,
            seed: experiment.seed,
            training_crops,
            scoring_crops,
            fields: plan.with_fields(experiment.psf.scoring_fields),
            pixel_mm: 1e-3 * pixel_um,
            moving: Mutex::default(),
            scored: Mutex::default(),
        })
    }

    /// What identifies the scenes: of a folder all pictures by name and size, and all boxes; generated streets are known by their experiment.
    pub fn fingerprint(&self) -> String {
        match &self.source {
            Source::Streets(_) => String::new(),
            Source::Pictures(pictures, _) => format!("{pictures:?}"),
        }
    }

    /// The scenes in words: `384 windows of streets in training, 96 in scores`.
    pub fn in_words(&self) -> String {
        let StreetConfig { windows, held_out, .. } = self.config;
        match &self.source {
            Source::Streets(plan) => {
                let light = format!("{:?}", plan.light).to_lowercase();
                format!("streets ({light}): {windows} windows in training, {held_out} in scores")
            }
            Source::Pictures(pictures, _) => {
                let [training, scored] = [List::Training, List::HeldOut].map(|list| pictures.count(list));
                format!(
                    "{windows} windows of {training} pictures in training, {held_out} windows of {scored} in scores"
                )
            }
        }
    }

    /// Item `item` of the training windows of a run: one of a fixed number of windows, every other time mirrored.
    pub fn training_shot(&self, camera: &Camera, item: u64) -> Result<Shot, DesignError> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(item);
        let number = random.random_range(0..self.config.windows as u64);
        let window = self.window(camera, List::Training, number)?;
        let crops = &self.training_crops;
        let window = match random.random() {
            true => Arc::new(window.mirrored(crops.crop, crops.sensor_columns)),
            false => window,
        };
        Ok(shot(&window, crops, item))
    }

    /// Window `number` of a list.
    pub fn shot(&self, camera: &Camera, list: List, number: u64) -> Result<Shot, DesignError> {
        let window = self.window(camera, list, number)?;
        let frame = FIRST_FRAME[usize::from(list == List::Validation)] + number;
        Ok(shot(&window, self.crops(list), frame))
    }

    fn crops(&self, list: List) -> &CropPlan {
        if list == List::HeldOut { &self.scoring_crops } else { &self.training_crops }
    }

    fn window(&self, camera: &Camera, list: List, number: u64) -> Result<Arc<LabelledWindow>, DesignError> {
        let (kept, drift_px) = match list {
            List::HeldOut => (&self.scored, 0.0),
            List::Training | List::Validation => (&self.moving, DRIFT_PX),
        };
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        let crops = self.crops(list);
        let window = match &self.source {
            Source::Streets(plan) => {
                let lens = camera.psfs().lens().ok_or(DesignError::NoLens)?;
                let view = self.view(lens, drift_px, &mut kept)?;
                if let Some(window) = kept.windows.get(&(list, number)) {
                    return Ok(window.clone());
                }
                let families = match list {
                    List::HeldOut => self.config.held_out_families,
                    _ => self.config.families,
                };
                plan.window(list, families, number, &view, crops)?
            }
            Source::Pictures(pictures, how) => {
                if let Some(window) = kept.windows.get(&(list, number)) {
                    return Ok(window.clone());
                }
                pictures.window(how, list, number, crops)?
            }
        };
        let window = Arc::new(window);
        kept.windows.insert((list, number), window.clone());
        Ok(window)
    }

    /// How a lens sees by its chief rays, or the view for which windows are kept if no place of the image has moved further since.
    /// Otherwise the windows are forgotten.
    fn view(&self, lens: &Lens, drift_px: f64, kept: &mut Kept) -> Result<Arc<StreetView>, DesignError> {
        if let Some(view) = kept.view.as_ref().filter(|_| kept.lens.as_ref() == Some(lens)) {
            return Ok(view.clone());
        }
        let angles_rad = self.fields.field_angles(lens)?;
        let radius_px: Vec<f64> = self.fields.field_radius_mm.iter().map(|r| r / self.pixel_mm).collect();
        kept.lens = Some(lens.clone());
        if let Some(view) = &kept.view
            && moved_px(&radius_px, &kept.angles_rad, &angles_rad) <= drift_px
        {
            return Ok(view.clone());
        }
        let sensor = [self.scoring_crops.sensor_rows, self.scoring_crops.sensor_columns];
        let view = Arc::new(StreetView::new(&radius_px, &angles_rad, sensor)?);
        kept.windows.clear();
        (kept.angles_rad, kept.view) = (angles_rad, Some(view.clone()));
        Ok(view)
    }
}

/// How far the farthest of the fields that land at some radii moves from one projection to another, pixels.
fn moved_px(radius_px: &[f64], from_rad: &[f64], to_rad: &[f64]) -> f64 {
    let place = |i: usize| {
        let (low, high) = (i.max(1) - 1, i.max(1));
        let px_per_rad = (radius_px[high] - radius_px[low]) / (to_rad[high] - to_rad[low]);
        (px_per_rad * (to_rad[i] - from_rad[i])).abs()
    };
    (0..radius_px.len()).map(place).fold(0.0, f64::max)
}

/// A window as a camera takes it.
fn shot(window: &LabelledWindow, crops: &CropPlan, frame: u64) -> Shot {
    let [row, column] = window.at;
    let exposed = crops.exposed_at(row, column);
    Shot {
        scene: window.scene(),
        placement: Placement { row: exposed.0, col: exposed.1 },
        kept: Some(crop_window(crops, row, column)),
        frame,
        truth: window.truth.clone(),
    }
}
