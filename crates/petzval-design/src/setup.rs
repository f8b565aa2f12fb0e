//! An experiment made ready: names turned into values, and everything checked before hours are spent.

use std::path::Path;

use burn::prelude::Device;
use petzval_base::FileError;
use petzval_camera::psf::PsfLayout;
use petzval_camera::render::{RenderGeometry, kernel_radius};
use petzval_camera::sensor::SensorModel;
use petzval_files::LensFile;
use petzval_files::load_image_bytes;
use petzval_learn::dataset::{CropPlan, NamedPhoto, PhotoSet, PhotoSplit, load_folder};
use petzval_optics::design_space::{DesignSpace, Focus, SmoothSpace, Solves};
use petzval_optics::psf::PsfOptions;
use petzval_optics::pupil::Quadrature;
use serde::Deserialize;

use crate::assets::Assets;
use crate::error::DesignError;
use crate::experiment::Experiment;
use crate::optics::PsfPlan;
use crate::requirements::Requirements;
use crate::spot_design::area_quantile_radii_mm;

/// Everything that the design loop needs and that does not change during it.
pub struct Setup {
    /// The experiment.
    pub experiment: Experiment,
    /// The nominal lens file.
    pub lens_file: LensFile,
    /// Where the lens may go.
    pub space: SmoothSpace,
    /// What every moving lens must keep.
    pub requirements: Requirements,
    /// Fields of the spot-optimised control, rad: equal areas of the sensor each.
    pub spot_fields_rad: Vec<f64>,
    /// The sensor.
    pub sensor: SensorModel,
    /// Sensor grid and PSF patches.
    pub geometry: RenderGeometry,
    /// PSFs of a lens that moves.
    pub moving_plan: PsfPlan,
    /// PSFs of a lens at rest.
    pub fixed_plan: PsfPlan,
    /// Training and held-out photographs.
    pub photos: PhotoSet,
    /// How training windows are cut.
    pub training_crops: CropPlan,
    /// How held-out windows are cut.
    pub scoring_crops: CropPlan,
    /// Weights of the perceptual loss.
    pub lpips_weights: Vec<u8>,
    /// Where tensors live, with automatic differentiation.
    pub device: Device,
}

/// The name under which the built-in photographs go.
pub const BUILT_IN_PHOTOS: &str = "built-in";

impl Setup {
    /// Resolves an experiment against the built-in library and the file system.
    pub fn new(experiment: Experiment, assets: &Assets, device: Device) -> Result<Self, DesignError> {
        let mut setup = Self::without_photos(experiment, assets, device)?;
        let window = setup.training_crops.window().max(setup.scoring_crops.window());
        setup.photos = load_photos(&setup.experiment, assets, window)?;
        setup.training_crops.check(setup.photos.training())?;
        setup.scoring_crops.check(setup.photos.held_out())?;
        Ok(setup)
    }

    /// [`Setup::new`] without photographs, for what is not done with them.
    pub fn without_photos(
        experiment: Experiment,
        assets: &Assets,
        device: Device,
    ) -> Result<Self, DesignError> {
        let mut lens_file = assets.lens(&experiment.lens)?;
        // Spots and pictures are judged in the same colours.
        let mut colours = experiment.psf.wavelengths_um.to_vec();
        colours.sort_by(f64::total_cmp);
        lens_file.lens.wavelengths_um = colours;
        if lens_file.variables.is_empty() {
            return Err(DesignError::NothingToMove(experiment.lens.clone()));
        }
        let sensor = assets.sensor(&experiment.sensor)?;
        let space = DesignSpace::new(
            lens_file.lens.clone(),
            lens_file.variables.clone(),
            lens_file.pickups.clone(),
            Solves { efl: lens_file.efl_solve, length: lens_file.length_solve },
            Focus::Paraxial { range_mm: experiment.optics.defocus_mm },
        )
        .and_then(SmoothSpace::new)
        .map_err(|e| {
            let hint = "correct the lens file, or optics.defocus_mm of the experiment for its image plane";
            misfit(Path::new(&experiment.lens), &e, hint)
        })?;
        let [rows, columns] = experiment.psf.patches;
        let geometry = RenderGeometry {
            sensor_height: sensor.height,
            sensor_width: sensor.width,
            pixel_um: sensor.pixel_um,
            patches: (rows, columns),
        };
        let corner_mm = 0.5e-3 * sensor.pixel_um * (sensor.height as f64).hypot(sensor.width as f64);
        let plan = |cells: usize| -> Result<PsfPlan, DesignError> {
            let psf = &experiment.psf;
            let options = PsfOptions { grid: psf.grid, pitch_um: psf.pitch_um, kind: psf.kind };
            let quadrature = Quadrature::grid(cells)?;
            Ok(PsfPlan::new(psf.fields, corner_mm, psf.wavelengths_um, options, quadrature))
        };
        let moving_plan = plan(experiment.psf.pupil_cells)?;
        let fixed_plan = plan(experiment.psf.scoring_pupil_cells)?;
        let nominal = &lens_file.lens;
        let requirements = Requirements::new(
            &lens_file,
            experiment.constraints.clearances(),
            moving_plan.field_angle(nominal, corner_mm),
            experiment.constraints.distortion_tolerance,
        )?;
        let spot_fields_rad =
            area_quantile_radii_mm(sensor.height, sensor.width, sensor.pixel_um, experiment.psf.fields)
                .iter()
                .map(|radius| moving_plan.field_angle(nominal, *radius))
                .collect();
        let layout = PsfLayout {
            field_radius_mm: fixed_plan.field_radius_mm.clone(),
            grid: experiment.psf.grid,
            pitch_um: experiment.psf.pitch_um,
        };
        let margin = kernel_radius(&geometry, &layout).map_err(|e| {
            let hint =
                "the experiment's psf.grid and psf.pitch_um make the PSF, pixel_um the pixels it covers";
            misfit(Path::new(&experiment.sensor), &e, hint)
        })?;
        let crops =
            |crop| CropPlan { crop, margin, sensor_rows: sensor.height, sensor_columns: sensor.width };
        let (training_crops, scoring_crops) =
            (crops(experiment.training.crop), crops(experiment.scoring.crop));
        // A lens whose light does not arrive is told now, not after the first step.
        moving_plan.bank(&lens_file.lens).map_err(|e| {
            let hint =
                "`petzval lens show` lists the light of each field; PSFs may also miss a small psf.grid";
            misfit(Path::new(&experiment.lens), &e, hint)
        })?;
        let lpips_weights = assets.bytes("weights/lpips_alex_f16.safetensors")?.to_vec();
        Ok(Self {
            experiment,
            lens_file,
            space,
            requirements,
            spot_fields_rad,
            sensor,
            geometry,
            moving_plan,
            fixed_plan,
            photos: PhotoSet::default(),
            training_crops,
            scoring_crops,
            lpips_weights,
            device,
        })
    }

    /// Half the sensor's diagonal, mm.
    pub fn corner_mm(&self) -> f64 {
        self.fixed_plan.field_radius_mm.last().copied().unwrap_or(0.0)
    }
}

/// The list of built-in photographs, `photos/photos.toml`; provenance is for readers.
#[derive(Deserialize)]
struct PhotoList {
    training: Vec<PhotoEntry>,
    held_out: Vec<PhotoEntry>,
}

#[derive(Deserialize)]
struct PhotoEntry {
    file: String,
}

/// Every so many pictures of a user's folder, one is held out.
const HELD_OUT_EVERY: usize = 4;

/// The built-in photographs, or a folder's: every fourth of those, by name, is held out.
fn load_photos(experiment: &Experiment, assets: &Assets, window: usize) -> Result<PhotoSet, DesignError> {
    if experiment.photos != BUILT_IN_PHOTOS {
        return folder_photos(Path::new(&experiment.photos), window);
    }
    let list = assets.text("photograph list", "photos", "photos")?;
    let list: PhotoList = toml::from_str(&list.text)
        .map_err(|e| DesignError::input(&list.path)(FileError::from_toml(&list.text, &e)))?;
    let names = |entries: &[PhotoEntry]| entries.iter().map(|e| e.file.clone()).collect::<Vec<_>>();
    let split = PhotoSplit { training: names(&list.training), held_out: names(&list.held_out) };
    let photos = split
        .training
        .iter()
        .chain(&split.held_out)
        .map(|name| {
            let image = load_image_bytes(assets.bytes(&format!("photos/{name}"))?, name)?;
            Ok(NamedPhoto { name: name.clone(), image })
        })
        .collect::<Result<_, DesignError>>()?;
    Ok(PhotoSet::new(photos, &split)?)
}

fn folder_photos(folder: &Path, window: usize) -> Result<PhotoSet, DesignError> {
    let mut photos = load_folder(folder)?;
    if photos.len() < 2 {
        let hint = "at least two are needed: every fourth, or the last, is held out for scoring";
        return Err(misfit(folder, &"only one picture", hint));
    }
    for photo in &mut photos {
        // A camera's own picture is softer than its pixels: halve it where enough is left.
        if photo.image.height.min(photo.image.width) >= 2 * window {
            photo.image = photo.image.box_half();
        }
    }
    let mut split = PhotoSplit::default();
    for (i, photo) in photos.iter().enumerate() {
        let held_out =
            i % HELD_OUT_EVERY == HELD_OUT_EVERY - 1 || i + 1 == photos.len() && split.held_out.is_empty();
        let list = if held_out { &mut split.held_out } else { &mut split.training };
        list.push(photo.name.clone());
    }
    Ok(PhotoSet::new(photos, &split)?)
}

/// Input that is well-formed, and does not fit the rest.
fn misfit(path: &Path, message: &dyn std::fmt::Display, hint: &str) -> DesignError {
    DesignError::input(path)(FileError {
        line: None,
        column: None,
        key: String::new(),
        value: String::new(),
        message: message.to_string(),
        hint: Some(hint.to_owned()),
    })
}
