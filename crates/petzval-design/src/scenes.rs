//! The scenes in which an experiment looks for objects: generated streets, or the pictures of a folder. A window is made when it is first
//! needed, streets for the chief rays of the lens that looks, and kept as long as that lens does.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use petzval_camera::render::Placement;
use petzval_learn::dataset::{
    CropPlan, LabelledPictures, LabelledWindow, PictureFile, PictureWindows, Purpose, StreetPlan, StreetView,
};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::image_height_per_tangent;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::camera::{Camera, Shot, crop_window};
use crate::error::DesignError;
use crate::experiment::{Experiment, STREET, StreetConfig};
use crate::lens::psf_plan::PsfPlan;

pub use petzval_learn::dataset::List;

/// The first frame of validations, beyond those of all steps. Scores have a noise of their own.
const FIRST_VALIDATION: u64 = 1 << 62;

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
}

/// A camera as it looks at scenes. Unlike the camera it can be lent to another thread.
#[derive(Clone, Copy, Debug)]
pub struct Eye<'a> {
    /// Its lens; none if its PSFs were measured.
    lens: Option<&'a Lens>,
    /// Brightness of the image, against that of the experiment's lens.
    light: f64,
    /// Size of the image, against that of the lens.
    magnification: f64,
}

impl<'a> Eye<'a> {
    /// That of a camera.
    pub fn of(camera: &'a Camera) -> Self {
        Self { lens: camera.psfs().lens(), light: camera.light(), magnification: 1.0 }
    }

    /// The same, with an image that is so many times as large.
    pub fn magnified(self, by: f64) -> Self {
        Self { magnification: by * self.magnification, ..self }
    }
}

/// The windows of one projection.
#[derive(Default)]
struct Kept {
    lens: Option<Lens>,
    view: Option<Arc<StreetView>>,
    windows: HashMap<(List, u64), Arc<LabelledWindow>>,
}

impl Scenes {
    /// The scenes of an experiment on a sensor of these pixels. `crops` are those of training and of scores, and `plan` has the corner of the
    /// sensor. Fails on a folder that cannot be read, or in which nothing is
    /// left for its `purpose`. Places of windows in streets are chosen in the view of the `nominal` lens.
    pub fn new(
        experiment: &Experiment,
        crops: [CropPlan; 2],
        plan: &PsfPlan,
        pixel_um: f64,
        nominal: &Lens,
        purpose: Purpose,
    ) -> Result<Self, DesignError> {
        let config = experiment.street.clone();
        let wanted = experiment.task.wanted();
        // Scenes are the same for every seed of a run, as photographs are.
        let seed = 1;
        let mut notes = Vec::new();
        let source = match experiment.data.as_str() {
            STREET => Source::Streets(StreetPlan {
                seed,
                light: config.light,
                busy: config.busy,
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
                let (on_objects, least_side_px) = (config.on_objects, config.least_side_px);
                let folder = Path::new(folder);
                let (pictures, defects) =
                    LabelledPictures::load(folder, wanted, classes, crop, least_side_px, purpose)?;
                notes = defects;
                Source::Pictures(pictures, PictureWindows { seed, on_objects, least_side_px })
            }
        };
        let [training_crops, scoring_crops] = crops;
        crops.iter().try_for_each(CropPlan::check_sensor)?;
        let (fields, pixel_mm) = (plan.with_fields(experiment.psf.scoring_fields), 1e-3 * pixel_um);
        Ok(Self {
            reference: view_of(nominal, &fields, &scoring_crops, pixel_mm)?,
            reference_height_mm: image_height_mm(nominal),
            validation_windows: experiment.validation.windows,
            source,
            notes,
            config,
            seed: experiment.seed,
            training_crops,
            scoring_crops,
            fields,
            pixel_mm,
            moving: Mutex::default(),
            scored: Mutex::default(),
        })
    }

    /// Whether what a camera sees of the scenes depends on the focal length of its lens. Pictures of a folder keep the geometry that they have.
    pub fn follow_the_lens(&self) -> bool {
        matches!(self.source, Source::Streets(_))
    }

    /// The pictures of a folder: their files, what identifies them with their boxes, and the boxes alone. None of streets, which follow from
    /// the experiment and the version of the program. Reads every file.
    pub fn pictures(&self) -> Result<Option<(Vec<PictureFile>, String, String)>, DesignError> {
        let Source::Pictures(pictures, _) = &self.source else { return Ok(None) };
        let files = pictures.files()?;
        let known = pictures.fingerprint(&files);
        Ok(Some((files, known, pictures.labels())))
    }

    /// What a window of a list is called: its number from 1 on, and the picture that it is of.
    pub fn name(&self, list: List, number: u64) -> String {
        let scene = format!("scene {}", number + 1);
        match &self.source {
            Source::Streets(_) => scene,
            Source::Pictures(pictures, _) => {
                format!("{scene}, {}", pictures.name(list, [number, self.windows_of(list)]))
            }
        }
    }

    /// The film of a window of a list, of which others resemble it; none of a street, which is seen once.
    pub fn sequence(&self, list: List, number: u64) -> Option<&str> {
        match &self.source {
            Source::Streets(_) => None,
            Source::Pictures(pictures, _) => Some(pictures.sequence(list, [number, self.windows_of(list)])),
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
                if training == 0 {
                    return format!("{held_out} windows of {scored} pictures in scores");
                }
                format!(
                    "{windows} windows of {training} pictures in training, {held_out} windows of {scored} in scores"
                )
            }
        }
    }

    /// Item `item` of the training windows of a run: one of a fixed number of windows, every other time mirrored.
    pub fn training_shot(&self, eye: Eye, item: u64) -> Result<Shot, DesignError> {
        let (number, mut random) = self.training_window(item);
        let window = self.window(eye, List::Training, number)?;
        let [own, crops] = [self.crops(List::Training), self.training_crops].map(|c| self.behind(eye, c));
        let is_mirrored = random.random();
        let mut window = if own == crops {
            window
        } else {
            // Chosen in the view as it is, and followed where it grows: a magnified window may show one object more or less.
            let unmagnified = Eye { magnification: 1.0, ..eye };
            let chosen = self.window(unmagnified, List::Training, number)?;
            let middle = chosen.middle_of_part(own.crop, crops.crop, &mut random);
            let axis = [crops.sensor_rows, crops.sensor_columns].map(|side| 0.5 * side as f32);
            let by = eye.magnification as f32;
            let middle = [0, 1].map(|i| axis[i] + by * (middle[i] - axis[i]));
            Arc::new(window.part(&own, &crops, middle))
        };
        if is_mirrored {
            window = Arc::new(window.mirrored(crops.crop, crops.sensor_columns));
        }
        Ok(shot(&window, &crops, item))
    }

    /// The window that a training item shows, and what draws the rest of it.
    fn training_window(&self, item: u64) -> (u64, ChaCha8Rng) {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(item);
        (random.random_range(0..self.config.windows as u64), random)
    }

    /// Makes the windows of training items that are soon asked for. An error comes back when they are.
    pub fn prepare(&self, eye: Eye, mut items: Range<u64>) {
        let _later = items
            .try_for_each(|item| self.window(eye, List::Training, self.training_window(item).0).map(|_| ()));
    }

    /// Window `number` of a list.
    pub fn shot(&self, eye: Eye, list: List, number: u64) -> Result<Shot, DesignError> {
        let window = self.window(eye, list, number)?;
        let frame = if list == List::Validation { FIRST_VALIDATION + number } else { number };
        Ok(shot(&window, &self.crops(list), frame))
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

    fn window(&self, eye: Eye, list: List, number: u64) -> Result<Arc<LabelledWindow>, DesignError> {
        let kept = if list == List::HeldOut { &self.scored } else { &self.moving };
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        let crops = self.crops(list);
        let window = match &self.source {
            Source::Streets(plan) => {
                let lens = eye.lens.ok_or(DesignError::NoLens)?;
                let view = self.view(lens, eye.light, &mut kept)?;
                let families = match list {
                    List::HeldOut => self.config.held_out_families,
                    _ => self.config.families,
                };
                if eye.magnification != 1.0 {
                    // Seen once, and not kept.
                    let view = view.magnified(eye.magnification)?;
                    let window = plan.window(list, families, number, [&view, &self.reference], &crops)?;
                    return Ok(Arc::new(window));
                }
                if let Some(window) = kept.windows.get(&(list, number)) {
                    return Ok(window.clone());
                }
                plan.window(list, families, number, [&view, &self.reference], &crops)?
            }
            Source::Pictures(pictures, how) => {
                if let Some(window) = kept.windows.get(&(list, number)) {
                    return Ok(window.clone());
                }
                pictures.window(how, list, [number, self.windows_of(list)], &crops)?
            }
        };
        let window = Arc::new(window);
        kept.windows.insert((list, number), window.clone());
        Ok(window)
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

    /// How windows are cut behind the lens of an eye, which are cut like `crops` behind the experiment's lens.
    fn behind(&self, eye: Eye, crops: CropPlan) -> CropPlan {
        match (&self.source, eye.lens) {
            (Source::Streets(_), Some(lens)) => crops.scaled(self.scale(lens)),
            _ => crops,
        }
    }

    /// Size of the image of a lens, in units of that of the experiment's lens.
    fn scale(&self, lens: &Lens) -> f64 {
        image_height_mm(lens) / self.reference_height_mm
    }

    /// How a lens whose image has such a brightness sees by its chief rays. Windows of another lens are forgotten.
    fn view(&self, lens: &Lens, light: f64, kept: &mut Kept) -> Result<Arc<StreetView>, DesignError> {
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

/// Paraxial image height of a lens per tangent of the field angle, mm: its focal length.
fn image_height_mm(lens: &Lens) -> f64 {
    image_height_per_tangent(&lens.at_wavelength(lens.reference_um))
}

/// The view of a lens: the field angles whose chief rays land at the radii of a plan.
fn view_of(
    lens: &Lens,
    fields: &PsfPlan,
    crops: &CropPlan,
    pixel_mm: f64,
) -> Result<StreetView, DesignError> {
    let radius_px: Vec<f64> = fields.field_radius_mm.iter().map(|r| r / pixel_mm).collect();
    let sensor = [crops.sensor_rows, crops.sensor_columns];
    Ok(StreetView::new(&radius_px, &fields.field_angles(lens)?, sensor)?)
}

/// A window as a camera takes it; its crop may be larger or smaller than that of the plan.
fn shot(window: &LabelledWindow, crops: &CropPlan, frame: u64) -> Shot {
    let crops = crops.of_window(window.side());
    let [row, column] = window.at;
    let exposed = crops.exposed_at(row, column);
    Shot {
        scene: window.scene(),
        placement: Placement { row: exposed.0, col: exposed.1 },
        kept: Some(crop_window(&crops, row, column)),
        frame,
        truth: window.truth.clone(),
        follows_light: window.follows_light,
    }
}
