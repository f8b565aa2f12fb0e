//! Scores on held-out photographs: exact noise, fixed places from the sensor's centre to its corner.

use std::collections::BTreeMap;
use std::sync::Arc;

use burn::prelude::*;
use petzval_camera::image::LinearImage;
use petzval_camera::sensor::{Noise, NoiseMode};
use petzval_camera::tape::srgb_encode_op;
use petzval_learn::score::{Score, ScoreDescription, ScoredPair};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::spot::spot;
use rayon::prelude::*;

use crate::camera::{Camera, to_host};
use crate::error::DesignError;
use crate::restored::percent;
use crate::run::{CameraMetrics, Metrics, PictureScore, RunFolder, VERSION};
use crate::setup::Setup;
use crate::shots::held_out_shots;

/// Seed of the noise in scored frames: the same for every camera and every run.
const SCORING_SEED: u64 = 0x5C0_12E;

/// A scored picture in its three states, sRGB-encoded.
pub struct ScoredPicture {
    /// Its scores.
    pub score: PictureScore,
    /// The photograph.
    pub truth: LinearImage,
    /// The developed raw frame, before the network.
    pub developed: LinearImage,
    /// The network's picture.
    pub output: LinearImage,
}

/// Scores cameras by what an experiment names.
pub struct Scorer {
    setup: Arc<Setup>,
    scores: Vec<Box<dyn Score>>,
}

impl Scorer {
    /// The scores of `known` that `scoring.scores` names, in that order.
    pub fn new(setup: Arc<Setup>, known: Vec<Box<dyn Score>>) -> Result<Self, DesignError> {
        let mut known: Vec<Option<Box<dyn Score>>> = known.into_iter().map(Some).collect();
        let mut scores = Vec::new();
        for name in &setup.experiment.scoring.scores {
            let is_it = |s: &&mut Option<Box<dyn Score>>| s.as_ref().is_some_and(|s| s.name() == name);
            match known.iter_mut().find(is_it).and_then(Option::take) {
                Some(score) => scores.push(score),
                None => {
                    let names: Vec<&str> = known.iter().flatten().map(|s| s.name()).collect();
                    return Err(DesignError::UnknownScore { name: name.clone(), known: names.join(", ") });
                }
            }
        }
        Ok(Self { setup, scores })
    }

    /// The experiment whose cameras are scored.
    pub fn setup(&self) -> &Arc<Setup> {
        &self.setup
    }

    /// The scores that are computed.
    pub fn scores(&self) -> Vec<ScoreDescription> {
        self.scores.iter().map(|score| ScoreDescription::of(score.as_ref())).collect()
    }

    /// Scores a camera: its lens by exact tracing, its pictures on the held-out photographs.
    pub fn score(
        &self,
        name: &str,
        camera: &Camera,
    ) -> Result<(CameraMetrics, Vec<ScoredPicture>), DesignError> {
        let (Some(lens), Some(captured)) = (camera.psfs().lens(), camera.psfs().captured()) else {
            return Err(DesignError::NoLens);
        };
        let pictures = self.pictures(camera, &|_| true)?;
        let scored = pictures.iter().map(|p| p.score.clone()).collect();
        let metrics = camera_metrics(&self.setup, name, lens, captured, scored)?;
        let limit = self.setup.limit.mean_square(camera.psfs().bank())?;
        let metrics = CameraMetrics {
            psf_errors: camera.psf_errors(),
            restored_error_percent: Some(percent(limit)),
            ..metrics
        };
        Ok((metrics, pictures))
    }

    /// The mean of each score over those of the held-out pictures that are chosen by their number.
    pub fn means(
        &self,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
    ) -> Result<BTreeMap<String, f64>, DesignError> {
        let pictures = self.pictures(camera, is_chosen)?;
        let mean = |name: &str| {
            let sum: f64 = pictures.iter().map(|picture| picture.score.scores[name]).sum();
            sum / pictures.len() as f64
        };
        Ok(self.scores.iter().map(|score| (score.name().to_owned(), mean(score.name()))).collect())
    }

    /// Takes and scores those of the held-out pictures that are chosen by their number.
    fn pictures(
        &self,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
    ) -> Result<Vec<ScoredPicture>, DesignError> {
        let noise = Noise { mode: NoiseMode::Exact, seed: SCORING_SEED };
        let mut pictures = Vec::new();
        let shots = held_out_shots(&self.setup, camera)?.into_iter().enumerate();
        for (_, (photo, relative_field, shot)) in shots.filter(|(number, _)| is_chosen(*number)) {
            let shots = [shot];
            let frames = camera.take(&shots, &noise)?;
            let truth_tensor = camera.truths(&shots)?;
            // As a stored picture would be.
            let finished_tensor = frames.finished.clamp(0.0, 1.0);
            let pair = ScoredPair {
                truth: host_image(truth_tensor.clone())?,
                finished: host_image(finished_tensor.clone())?,
                finished_tensor,
                truth_tensor,
            };
            let mut scores = BTreeMap::new();
            for score in &self.scores {
                scores.insert(score.name().to_owned(), score.of(&pair)?);
            }
            pictures.push(ScoredPicture {
                score: PictureScore { photo, relative_field, scores },
                developed: host_image(srgb_encode_op(frames.developed))?,
                truth: pair.truth,
                output: pair.finished,
            });
        }
        Ok(pictures)
    }
}

fn host_image(tensor: Tensor<4>) -> Result<LinearImage, DesignError> {
    let [_, channels, height, width] = tensor.dims();
    Ok(LinearImage { channels, height, width, data: to_host(tensor)? })
}

fn camera_metrics(
    setup: &Setup,
    name: &str,
    lens: &Lens,
    psf_captured: f64,
    pictures: Vec<PictureScore>,
) -> Result<CameraMetrics, DesignError> {
    let reference = lens.at_wavelength(lens.reference_um);
    let order = first_order(&reference);
    let angles = setup.fixed_plan.field_angles(lens)?;
    // The field of view ends where the light of the sensor's corner comes from.
    let (corner_mm, corner_field) = (setup.corner_mm(), angles.last().copied().unwrap_or(0.0));
    let corner_distortion = match setup.fixed_plan.distortion(lens) {
        Ok(map) => corner_mm / map.ideal_mm(corner_mm) - 1.0,
        Err(DesignError::TooWideForAPicture { .. }) => -1.0,
        Err(other) => return Err(other),
    };
    let rms_spot_by_field_um: Vec<f64> = angles
        .par_iter()
        .map(|field| {
            spot(lens, *field, &setup.fixed_plan.quadrature)
                .map(|s| s.rms_poly_um)
                .ok_or(DesignError::NoLight { field_deg: field.to_degrees() })
        })
        .collect::<Result<_, _>>()?;
    let names = pictures.first().map(|p| p.scores.keys().cloned().collect::<Vec<_>>()).unwrap_or_default();
    let mean = |name: &String| pictures.iter().map(|p| p.scores[name]).sum::<f64>() / pictures.len() as f64;
    Ok(CameraMetrics {
        camera: name.to_owned(),
        is_ceiling: false,
        restored_error_percent: None,
        scores: names.into_iter().map(|name| (name.clone(), mean(&name))).collect(),
        rms_spot_um: rms_spot_by_field_um.iter().sum::<f64>() / rms_spot_by_field_um.len() as f64,
        efl_mm: order.efl_mm,
        f_number: order.f_number,
        fov_deg: 2.0 * corner_field.to_degrees(),
        corner_distortion_percent: 100.0 * corner_distortion,
        psf_captured,
        psf_errors: None,
        white_e: f64::from(setup.experiment.exposure.white_e),
        isp_steps: 0,
        network_steps: setup.experiment.training.steps,
        rms_spot_by_field_um,
        pictures,
    })
}

/// Gathers the figures of the finished cameras of a run.
pub fn collect_metrics(
    setup: &Setup,
    run: &RunFolder,
    scores: Vec<ScoreDescription>,
) -> Result<Metrics, DesignError> {
    let rows: Vec<CameraMetrics> = (setup.variants.iter())
        .map(|variant| {
            let path = run.camera(&variant.name).join("metrics.json");
            let text = std::fs::read_to_string(&path).map_err(DesignError::io(&path))?;
            serde_json::from_str(&text).map_err(|e| DesignError::Run { path, problem: e.to_string() })
        })
        .collect::<Result<_, _>>()?;
    Ok(Metrics {
        held_out_images: setup.photos.held_out().len(),
        held_out_places: setup.experiment.scoring.places_per_side.pow(2),
        rows,
        seeds: vec![setup.experiment.seed],
        scores,
        version: VERSION.to_owned(),
    })
}
