//! Labelled scenes: generated streets, or the pictures of a folder. A window is made when it is first needed, streets for the chief rays of the
//! lens that looks, and kept as long as that lens does. A task says which labels its windows have.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use petzval_base::Cancel;
use petzval_camera::render::Placement;
use petzval_learn::dataset::{
    self, Classes, CropPlan, DatasetError, FirstReads, LabelledPictures, LabelledWindow, List, PictureFile,
    PictureWindows, PlacedWindow, Shelf, StreetPlan, StreetView,
};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::image_height_per_tangent;
use petzval_street::SurfaceClass;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use crate::camera::{Camera, Labels, Shot, crop_window};
use crate::cameras::Cameras;
use crate::error::{DesignError, Result};
use crate::experiment::{Experiment, STREET, StreetConfig};
use crate::lens::psf_plan::PsfPlan;
use crate::run::hex;
use crate::run::input_list::Pictures;
use crate::task::{
    Content, HeldOut, Purpose, Remark, SceneView, WindowInputs, WindowPlan, Windows, in_batches,
    relative_field,
};

/// The first frame of validations, beyond those of all steps. Scores have a noise of their own.
const FIRST_VALIDATION: u64 = 1 << 62;

/// The pictures of a folder, with sentences on what of it cannot be used.
pub type ReadPictures = Result<(LabelledPictures, Vec<String>), DatasetError>;

/// The labels of scenes.
#[derive(Clone)]
pub struct SceneLabels {
    /// The classes of objects in streets, on which windows are placed.
    pub classes: Classes,
    /// The class of each surface of streets; none where windows need no map of classes.
    pub surfaces: Option<[u8; SurfaceClass::ALL.len()]>,
    /// Reads the pictures of a folder.
    pub pictures: fn(&PicturePlan) -> ReadPictures,
    /// What a shot carries of its window.
    pub of_window: fn(&LabelledWindow) -> Labels,
}

/// Which pictures of a folder are read.
pub struct PicturePlan<'a> {
    /// The folder.
    pub folder: &'a Path,
    /// The classes of the experiment.
    pub classes: &'a Classes,
    /// Side of the largest window, pixels.
    pub crop: usize,
    /// Least longer side of an object that counts, pixels.
    pub least_side_px: f64,
    /// What they are for.
    pub purpose: dataset::Purpose,
    /// What stops the reading.
    pub cancel: &'a Cancel,
}

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
    labels_of: fn(&LabelledWindow) -> Labels,
    /// What of a folder cannot be used, in sentences.
    notes: Vec<String>,
    config: StreetConfig,
    seed: u64,
    training_crops: CropPlan,
    scoring_crops: CropPlan,
    /// Field angles of the projection, as those of scores.
    fields: PsfPlan,
    /// The view of the experiment's lens, in which places of windows are chosen.
    reference: StreetView,
    /// Paraxial image height of that lens per tangent of the field angle, mm.
    reference_height_mm: f64,
    validation_windows: usize,
    pixel_mm: f64,
    /// The windows that blocks are trained and validated on.
    moving: Mutex<Kept>,
    /// The windows of scores.
    scored: Mutex<Kept>,
    /// The windows of streets before a lens sees them.
    placed: Mutex<HashMap<(List, u64), Arc<PlacedWindow>>>,
    /// The windows of pictures.
    shelf: Shelf<LabelledWindow>,
    /// Stops the making of windows of scores, and of those that are made ahead.
    cancel: Cancel,
}

/// An item of the training windows.
struct TrainingItem {
    number: u64,
    /// Its whole window in the view of a step.
    seen: Arc<LabelledWindow>,
    /// The same without magnification.
    unmagnified: Arc<LabelledWindow>,
    /// What draws the part that is shown.
    random: ChaCha8Rng,
}

/// The windows of one projection.
#[derive(Default)]
struct Kept {
    lens: Option<Lens>,
    view: Option<Arc<StreetView>>,
    windows: HashMap<(List, u64), Arc<LabelledWindow>>,
}

impl Scenes {
    /// The scenes of an experiment. Fails on a folder that cannot be read, or in which nothing is left for its purpose. Places of windows in
    /// streets are chosen in the view of the experiment's lens.
    pub fn new(plan: &WindowPlan, labels: SceneLabels) -> Result<Self> {
        let WindowPlan { experiment, training_crops, scoring_crops, fixed_plan, pixel_um, nominal, .. } =
            *plan;
        let config = experiment.street.clone();
        // Scenes are the same for every seed of a run, as photographs are.
        let seed = 1;
        let mut notes = Vec::new();
        let source = match experiment.data.as_str() {
            STREET => Source::Streets(StreetPlan {
                seed,
                light: config.light,
                busy: config.busy,
                classes: labels.classes,
                surfaces: labels.surfaces,
                white_cd_m2: config.white_cd_m2,
                samples: config.samples,
                on_objects: config.on_objects,
                least_side_px: config.least_side_px,
                least_visible: config.least_visible,
            }),
            folder => {
                let crop = experiment.training.crop.max(experiment.scoring.crop);
                let (on_objects, least_side_px) = (config.on_objects, config.least_side_px);
                let folder = Path::new(folder);
                let purpose = match plan.purpose {
                    Purpose::Scores => dataset::Purpose::Scores,
                    _ if experiment.validation.is_used() => dataset::Purpose::ValidatedTraining,
                    _ => dataset::Purpose::Training,
                };
                let (classes, cancel) = (&experiment.classes(), plan.assets.cancel());
                let (pictures, defects) = (labels.pictures)(&PicturePlan {
                    folder,
                    classes,
                    crop,
                    least_side_px,
                    purpose,
                    cancel,
                })?;
                notes = defects;
                Source::Pictures(pictures, PictureWindows { seed, on_objects, least_side_px })
            }
        };
        [training_crops, scoring_crops].iter().try_for_each(CropPlan::check_sensor)?;
        let fields = fixed_plan.with_fields(experiment.psf.scoring_fields);
        let pixel_mm = 1e-3 * pixel_um;
        Ok(Self {
            reference: view_of(nominal, &fields, &scoring_crops, pixel_mm)?,
            reference_height_mm: image_height_mm(nominal),
            validation_windows: experiment.validation.windows,
            source,
            labels_of: labels.of_window,
            notes,
            config,
            seed: experiment.seed,
            training_crops,
            scoring_crops,
            fields,
            pixel_mm,
            moving: Mutex::default(),
            scored: Mutex::default(),
            placed: Mutex::default(),
            shelf: Shelf::new(experiment.reading.bytes()),
            cancel: plan.assets.cancel().clone(),
        })
    }

    /// The files of the pictures of a folder, with so much of their content.
    fn files(&self, pictures: &LabelledPictures, content: Content) -> Result<Vec<PictureFile>> {
        let are_read = content == Content::All || pictures.first_reads().is_none();
        Ok(pictures.files(are_read, &self.cancel)?)
    }

    /// What a window of a list is called: its number from 1 on, and the picture that it is of.
    fn name(&self, list: List, number: u64) -> String {
        let scene = format!("scene {}", number + 1);
        match &self.source {
            Source::Streets(_) => scene,
            Source::Pictures(pictures, _) => {
                format!("{scene}, {}", pictures.name(list, [number, self.windows_of(list)]))
            }
        }
    }

    /// The film of a window of a list, of which others resemble it; none of a street, which is seen once.
    fn sequence(&self, list: List, number: u64) -> Option<&str> {
        match &self.source {
            Source::Streets(_) => None,
            Source::Pictures(pictures, _) => Some(pictures.sequence(list, [number, self.windows_of(list)])),
        }
    }

    /// The scenes in words: `384 windows of streets in training, 96 in scores`.
    fn in_words(&self) -> String {
        let StreetConfig { windows, held_out, .. } = self.config;
        match &self.source {
            Source::Streets(plan) => {
                let light = format!("{:?}", plan.light).to_lowercase();
                format!("streets ({light}): {windows} windows in training, {held_out} in scores")
            }
            Source::Pictures(pictures, _) => {
                let [training, scored] = [List::Training, List::HeldOut].map(|list| pictures.count(list));
                if training == 0 {
                    return format!("{held_out} windows of {scored} pictures in scores");
                }
                format!(
                    "{windows} windows of {training} pictures in training, {held_out} windows of {scored} in scores"
                )
            }
        }
    }

    /// The training windows of a step. First they are all there, one after the other: a window may wait for the thread that makes it. Then all threads
    /// cut them.
    fn training_shots(&self, experiment: &Experiment, view: SceneView, step: u64) -> Result<Vec<Shot>> {
        let item = |number| {
            // A street takes a second.
            self.cancel.check()?;
            self.training_item(view, number)
        };
        let items: Vec<TrainingItem> = items_of(experiment, step).map(item).collect::<Result<_>>()?;
        Ok(items.into_par_iter().map(|item| self.training_shot(view, item)).collect())
    }

    /// Item `number` of the training windows of a run: one of a fixed number of windows.
    fn training_item(&self, view: SceneView, number: u64) -> Result<TrainingItem> {
        let (window, random) = self.training_window(number);
        let seen = self.window(view, List::Training, window)?;
        // A part is chosen in the view as it is, and followed where it grows: a magnified window may show one object more or less.
        let unmagnified = if view.magnification == 1.0 {
            seen.clone()
        } else {
            self.window(SceneView { magnification: 1.0, ..view }, List::Training, window)?
        };
        Ok(TrainingItem { number, seen, unmagnified, random })
    }

    /// The part of its window that a training item shows, every other time mirrored.
    fn training_shot(&self, view: SceneView, item: TrainingItem) -> Shot {
        let TrainingItem { number, seen: mut window, unmagnified, mut random } = item;
        let [own, crops] = [self.crops(List::Training), self.training_crops].map(|c| self.behind(view, c));
        let is_mirrored = random.random();
        if own != crops {
            let middle = unmagnified.middle_of_part(own.crop, crops.crop, &mut random);
            let axis = [crops.sensor_rows, crops.sensor_columns].map(|side| 0.5 * side as f32);
            let by = view.magnification as f32;
            let middle = [0, 1].map(|i| axis[i] + by * (middle[i] - axis[i]));
            window = Arc::new(window.part(&own, &crops, middle));
        }
        if is_mirrored {
            window = Arc::new(window.mirrored(crops.crop, crops.sensor_columns));
        }
        self.shot_of(&window, &crops, number)
    }

    /// The window that a training item shows, and what draws the rest of it.
    fn training_window(&self, item: u64) -> (u64, ChaCha8Rng) {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(item);
        (random.random_range(0..self.config.windows as u64), random)
    }

    /// Makes the windows of training items that are soon needed. An error comes back when they are.
    fn prepare(&self, view: SceneView, mut items: Range<u64>) {
        let make = |item| -> Result<()> {
            self.cancel.check()?;
            self.window(view, List::Training, self.training_window(item).0).map(|_| ())
        };
        let _later = match &self.source {
            Source::Streets(_) => items.try_for_each(make),
            Source::Pictures(..) => items.into_par_iter().try_for_each(make),
        };
    }

    /// Window `number` of a list.
    fn shot(&self, view: SceneView, list: List, number: u64) -> Result<Shot> {
        let window = self.window(view, list, number)?;
        let frame = if list == List::Validation { FIRST_VALIDATION + number } else { number };
        Ok(self.shot_of(&window, &self.crops(list), frame))
    }

    /// A window as a camera takes it; its crop may be larger or smaller than that of the plan.
    fn shot_of(&self, window: &LabelledWindow, crops: &CropPlan, frame: u64) -> Shot {
        let crops = crops.of_window(window.side());
        let [row, column] = window.at;
        let exposed = crops.exposed_at(row, column);
        Shot {
            scene: window.scene(),
            placement: Placement { row: exposed.0, col: exposed.1 },
            kept: Some(crop_window(&crops, row, column)),
            frame,
            labels: (self.labels_of)(window),
            follows_light: window.follows_light,
        }
    }

    /// How the windows of a list are cut behind the experiment's lens. Behind a lens of another focal length those of streets have the size at which
    /// they show the same part of the street.
    ///
    /// Training windows of streets are larger than a crop: a street costs much more than its pixels, and
    /// every step takes another part of it.
    fn crops(&self, list: List) -> CropPlan {
        let crops = self.training_crops;
        match (list, &self.source) {
            (List::HeldOut, _) => self.scoring_crops,
            (List::Training, Source::Streets(_)) => {
                // By an even number of pixels: scaled, a crop then still fits into its window.
                let most = crops.sensor_rows.min(crops.sensor_columns) - 2 * crops.surround;
                let more = (self.config.spare * crops.crop as f64) as usize;
                CropPlan { crop: crops.crop + more.min(most - crops.crop) / 2 * 2, ..crops }
            }
            _ => crops,
        }
    }

    fn window(&self, view: SceneView, list: List, number: u64) -> Result<Arc<LabelledWindow>> {
        let crops = self.crops(list);
        let window = match &self.source {
            Source::Pictures(pictures, how) => {
                let window = || pictures.window(how, list, [number, self.windows_of(list)], &crops);
                return Ok(self.shelf.get(&format!("{list:?} {number}"), window)?);
            }
            Source::Streets(plan) => {
                let kept = if list == List::HeldOut { &self.scored } else { &self.moving };
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                let lens = view.lens.ok_or(DesignError::NoLens)?;
                let magnification = view.magnification;
                let view = self.view(lens, view.light, &mut kept)?;
                let placed = self.placed(plan, list, number, &crops)?;
                if magnification != 1.0 {
                    // Seen once, and not kept.
                    let view = view.magnified(magnification)?;
                    return Ok(Arc::new(plan.seen(&placed, [&view, &self.reference], &crops)?));
                }
                if let Some(window) = kept.windows.get(&(list, number)) {
                    return Ok(window.clone());
                }
                let window = Arc::new(plan.seen(&placed, [&view, &self.reference], &crops)?);
                kept.windows.insert((list, number), window.clone());
                window
            }
        };
        Ok(window)
    }

    /// A window of streets before a lens sees it, chosen once for all lenses of a run.
    fn placed(
        &self,
        plan: &StreetPlan,
        list: List,
        number: u64,
        crops: &CropPlan,
    ) -> Result<Arc<PlacedWindow>> {
        let mut all = self.placed.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(placed) = all.get(&(list, number)) {
            return Ok(placed.clone());
        }
        let families = match list {
            List::HeldOut => self.config.held_out_families,
            _ => self.config.families,
        };
        let placed = Arc::new(plan.placed(list, families, number, &self.reference, crops)?);
        all.insert((list, number), placed.clone());
        Ok(placed)
    }

    /// Windows that a run takes of a list.
    fn windows_of(&self, list: List) -> u64 {
        let count = match list {
            List::Training => self.config.windows,
            List::Validation => self.validation_windows,
            List::HeldOut => self.config.held_out,
        };
        count as u64
    }

    /// How windows are cut behind the lens of a view, which are cut like `crops` behind the experiment's lens.
    fn behind(&self, view: SceneView, crops: CropPlan) -> CropPlan {
        match (&self.source, view.lens) {
            (Source::Streets(_), Some(lens)) => crops.scaled(self.scale(lens)),
            _ => crops,
        }
    }

    /// Size of the image of a lens, in units of that of the experiment's lens.
    fn scale(&self, lens: &Lens) -> f64 {
        image_height_mm(lens) / self.reference_height_mm
    }

    /// How a lens whose image has such a brightness sees by its chief rays. Windows of another lens are forgotten.
    fn view(&self, lens: &Lens, light: f64, kept: &mut Kept) -> Result<Arc<StreetView>> {
        if let Some(view) = kept.view.as_ref().filter(|_| kept.lens.as_ref() == Some(lens)) {
            return Ok(view.clone());
        }
        let view = view_of(lens, &self.fields, &self.scoring_crops, self.pixel_mm)?;
        let view = view.with_light(light).with_scale(self.scale(lens));
        let view = Arc::new(view);
        *kept = Kept { lens: Some(lens.clone()), view: Some(view.clone()), windows: HashMap::new() };
        Ok(view)
    }
}

impl Windows for Scenes {
    /// The same for every variant, but that streets are seen through the chief rays of the camera's lens.
    fn training(&self, cameras: &Cameras, camera: &Camera, step: u64) -> Result<Vec<Shot>> {
        self.training_shots(&cameras.experiment, SceneView::of(camera), step)
    }

    /// Only streets change by it.
    fn magnified(&self, cameras: &Cameras, camera: &Camera, step: u64, by: f64) -> Result<Option<Vec<Shot>>> {
        self.training_shots(&cameras.experiment, SceneView::of(camera).magnified(by), step).map(Some)
    }

    /// Pictures of a folder keep the geometry that they have.
    fn follow_the_lens(&self) -> bool {
        matches!(self.source, Source::Streets(_))
    }

    fn validation(&self, cameras: &Cameras, camera: &Camera) -> Result<Vec<Vec<Shot>>> {
        let shot = |i: usize| {
            self.cancel.check()?;
            self.shot(SceneView::of(camera), List::Validation, i as u64)
        };
        in_batches(&cameras.experiment, self.validation_windows, shot)
    }

    /// Each of a street of its own, or of a picture of a folder.
    fn held_out(
        &self,
        cameras: &Cameras,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
    ) -> Result<Vec<HeldOut>> {
        let window = |i: usize| {
            // A street takes a second.
            self.cancel.check()?;
            let shot = self.shot(SceneView::of(camera), List::HeldOut, i as u64)?;
            Ok(HeldOut {
                name: self.name(List::HeldOut, i as u64),
                sequence: self.sequence(List::HeldOut, i as u64).map(str::to_owned),
                relative_field: relative_field(cameras, camera, &shot),
                shot,
            })
        };
        (0..self.config.held_out).filter(|i| is_chosen(*i)).map(window).collect()
    }

    fn held_out_pictures(&self, _: &Experiment) -> [usize; 2] {
        [self.config.held_out, 1]
    }

    fn make_ahead(&self, experiment: &Experiment, view: SceneView, step: u64) {
        self.prepare(view, items_of(experiment, step));
    }

    fn are_slow(&self) -> bool {
        true
    }

    /// Nothing of streets, which follow from the experiment and the version of the program.
    fn inputs(&self, experiment: &Experiment, content: Content, hash: &mut Sha256) -> Result<WindowInputs> {
        let Source::Pictures(pictures, _) = &self.source else { return Ok(WindowInputs::default()) };
        let files = self.files(pictures, content)?;
        hash.update(pictures.fingerprint(&files));
        let place = Path::new(&experiment.data);
        let place = std::fs::canonicalize(place).map_err(DesignError::io(place))?;
        let labels = Some(hex(Sha256::new_with_prefix(pictures.labels())));
        let pictures = Pictures { place, labels, label_files: pictures.label_files(), files };
        Ok(WindowInputs { pictures: Some(pictures), ..WindowInputs::default() })
    }

    fn first_reads(&self) -> Option<&FirstReads> {
        match &self.source {
            Source::Streets(_) => None,
            Source::Pictures(pictures, _) => pictures.first_reads(),
        }
    }

    fn remarks(&self) -> Vec<Remark> {
        let notes = self.notes.iter().map(|note| Remark::Warning(note.clone()));
        [Remark::Note(self.in_words())].into_iter().chain(notes).collect()
    }
}

/// The windows of a step by their numbers in the run.
fn items_of(experiment: &Experiment, step: u64) -> Range<u64> {
    let batch = experiment.training.batch as u64;
    step * batch..(step + 1) * batch
}

/// Paraxial image height of a lens per tangent of the field angle, mm: its focal length.
fn image_height_mm(lens: &Lens) -> f64 {
    image_height_per_tangent(&lens.at_wavelength(lens.reference_um))
}

/// The view of a lens: the field angles whose chief rays land at the radii of a plan.
fn view_of(lens: &Lens, fields: &PsfPlan, crops: &CropPlan, pixel_mm: f64) -> Result<StreetView> {
    let radius_px: Vec<f64> = fields.field_radius_mm.iter().map(|r| r / pixel_mm).collect();
    let sensor = [crops.sensor_rows, crops.sensor_columns];
    Ok(StreetView::new(&radius_px, &fields.field_angles(lens)?, sensor)?)
}
