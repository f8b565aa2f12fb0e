//! `report`: the page of a finished run, written again from what its folder holds, and whole frames of its cameras.

use std::path::{Path, PathBuf};

use petzval_camera::image::LinearImage;
use petzval_design::error::DesignError;
use petzval_design::inputs::{SetupFor, check_parts_or_accepted, setup_of_run};
use petzval_design::report::run_report::read_metrics;
use petzval_design::run::picture_names::whole_name;
use petzval_design::run::{DigestCheck, RunFolder, write_file};
use petzval_design::setup::Setup;
use petzval_files::encoded_png_bytes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::apply::taken;
use crate::context::Context;
use crate::error::Result;
use crate::evaluate::camera_of;
use crate::event::WarningKind;
use crate::noted_pictures::NotedPictures;
use crate::run_figures::check_figures;
use crate::run_page::{warn_of_changed_config, write};
use crate::simulate::Place;

/// Seed of the noise of whole frames.
const SEED: u64 = 1;

/// A finished run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Its folder.
    pub run: PathBuf,
    /// A photograph that every camera takes over its whole sensor. The frames stay in the folder, for later reports.
    pub photo: Option<PathBuf>,
    /// Files or folders of the run, by their path below it, that may differ from their digests.
    pub accept_changed: Vec<String>,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The page.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub report: PathBuf,
}

/// Writes the report.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let folder = RunFolder::open(&request.run)?;
    let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
    let check = DigestCheck::of_request(&folder, &request.accept_changed, &warn)?;
    check_figures(&read_metrics(&folder)?, &check)?;
    warn_of_changed_config(&folder, context)?;
    let experiment = context.assets.experiment_of_run(&folder)?;
    let device = context.device("cpu")?;
    let setup = setup_of_run(&folder, experiment, &context.assets, device, SetupFor::Cameras)?;
    check_parts_or_accepted(&setup, &folder, &check)?;
    if let Some(photo) = &request.photo {
        take_whole_frames(&setup, &folder, photo, context)?;
    }
    Ok(Response { report: write(&setup, &folder, context)?.0 })
}

/// Takes a photograph over the whole sensor by every camera, and keeps the scene and the frames in the run folder.
fn take_whole_frames(setup: &Setup, folder: &RunFolder, photo: &Path, context: &Context) -> Result<()> {
    let sensor = &setup.body.sensor;
    let light = NotedPictures::new(context).light(photo).map_err(DesignError::from)?;
    let scene = Place::Fill.lay(&light, (sensor.height, sensor.width));
    let encoded = LinearImage { data: scene.to_srgb(), ..scene.clone() };
    let mut frames = vec![(whole_name(None), encoded)];
    for (i, variant) in setup.variants.iter().enumerate() {
        context.check(|| "cancelled before the whole frames were taken")?;
        context.progress(i as u64, setup.variants.len() as u64, format!("whole frame of {}", variant.name));
        let camera = camera_of(setup, folder, &variant.name)?;
        frames.push((whole_name(Some(&variant.name)), taken(&camera, &scene, SEED, 0)?));
    }
    for (name, frame) in frames {
        let png = encoded_png_bytes(&frame).map_err(DesignError::from)?;
        write_file(&folder.picture(&name), &png)?;
        context.wrote(folder.picture(&name), "picture");
    }
    Ok(())
}
