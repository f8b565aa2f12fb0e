//! Scores on held-out photographs: exact noise, fixed places from the sensor's centre to its corner.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use burn::prelude::*;
use petzval_camera::image::LinearImage;
use petzval_camera::linear_limit::{LinearLimit, NaturalScenes};
use petzval_camera::sensor::{Exposure, Noise, NoiseMode};
use petzval_camera::tape::srgb_encode_op;
use petzval_learn::loss::LossError;
use petzval_learn::score::detection::{Picture, clusters_of};
use petzval_learn::score::{
    ObjectScore, Score, ScoreDescription, ScoredPair, object_scores, range_of, standard_scores,
};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::spot::spot;
use rayon::prelude::*;

use crate::boxes::{with_detections, with_truth};
use crate::camera::{Camera, host_image, within_range};
use crate::error::DesignError;
use crate::lens::restored::{brightened, percent};
use crate::run::input_list::InputList;
use crate::run::{CameraMetrics, Metrics, PictureScore, RunFolder, VERSION};
use crate::seen_windows::{SeenWindow, clusters};
use crate::setup::Setup;
use crate::shots::{HeldOut, held_out_shots};

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
    /// The network's picture; where objects are found, with their boxes.
    pub output: LinearImage,
    /// The objects of the window and what was found, where objects are looked for.
    pub objects: Option<SeenWindow>,
}

/// Scores cameras by what an experiment names.
pub struct Scorer {
    setup: Arc<Setup>,
    judge: Judge,
}

/// What judges a camera.
enum Judge {
    /// Each finished picture by itself; the score of a camera is the mean.
    Pictures(Vec<Box<dyn Score>>),
    /// What its detector finds in all of them.
    Objects(Vec<ObjectScore>),
}

/// In which pictures objects are looked for.
#[derive(Clone, Copy)]
enum Depth {
    /// In those of all of [`Stage::ALL`](crate::seen_windows::Stage::ALL).
    EveryStage,
    /// In the finished one, for scores alone.
    Finished,
}

impl Scorer {
    /// The scores that `scoring.scores` names, in that order.
    pub fn new(setup: Arc<Setup>) -> Result<Self, DesignError> {
        let experiment = &setup.experiment;
        if !experiment.task.finds_objects() {
            let known = standard_scores(&setup.lpips()?);
            return Self::of_pictures(setup, known);
        }
        let known = object_scores(experiment.task.classes());
        let judge = Judge::Objects(named(&experiment.scoring.scores, known, |score| &score.about.name)?);
        Ok(Self { setup, judge })
    }

    /// The scores of `known`, each of one picture, that `scoring.scores` names, in that order.
    pub fn of_pictures(setup: Arc<Setup>, known: Vec<Box<dyn Score>>) -> Result<Self, DesignError> {
        let judge = Judge::Pictures(named(&setup.experiment.scoring.scores, known, |score| score.name())?);
        Ok(Self { setup, judge })
    }

    /// The experiment whose cameras are scored.
    pub fn setup(&self) -> &Arc<Setup> {
        &self.setup
    }

    /// The scores that are computed.
    pub fn scores(&self) -> Vec<ScoreDescription> {
        match &self.judge {
            Judge::Pictures(scores) => {
                scores.iter().map(|score| ScoreDescription::of(score.as_ref())).collect()
            }
            Judge::Objects(scores) => scores.iter().map(|score| score.about.clone()).collect(),
        }
    }

    /// Scores a camera: its lens by exact tracing, its pictures on the held-out photographs.
    pub fn score(
        &self,
        name: &str,
        camera: &Camera,
    ) -> Result<(CameraMetrics, Vec<ScoredPicture>), DesignError> {
        self.score_watched(name, camera, &|_, _| {})
    }

    /// The same; `tick` is called before each picture, with how many are done and how many there are.
    pub fn score_watched(
        &self,
        name: &str,
        camera: &Camera,
        tick: &dyn Fn(usize, usize),
    ) -> Result<(CameraMetrics, Vec<ScoredPicture>), DesignError> {
        let (Some(lens), Some(captured)) = (camera.psfs().lens(), camera.psfs().captured()) else {
            return Err(DesignError::NoLens);
        };
        let pictures = self.pictures(camera, &|_| true, Depth::EveryStage, tick)?;
        let scored = pictures.iter().map(|p| p.score.clone()).collect();
        let scores = self.over_all(&pictures);
        // The exposure behind the lens for which it is stated: brightness of the image comes on top.
        let (stated, own) = (self.setup.body.exposure, camera.body().exposure);
        let exposed_longer = own.time_s / stated.time_s;
        let own = Exposure { white_e: stated.white_e * exposed_longer, ..own };
        let metrics = camera_metrics(&self.setup, name, lens, captured, scores, scored)?;
        let bright = brightened(camera.psfs().bank().clone(), camera.light());
        let limit = if own == stated {
            self.setup.limit.mean_square(&bright)?
        } else {
            LinearLimit::new(&camera.body().sensor, &own, NaturalScenes::default()).mean_square(&bright)?
        };
        let metrics = CameraMetrics {
            psf_errors: camera.psf_errors(),
            psf_by_rays: camera.psfs().by_rays(),
            restored_error_percent: Some(percent(limit)),
            intervals: self.intervals(&pictures),
            white_e: metrics.white_e * camera.light() * f64::from(exposed_longer),
            ..metrics
        };
        metrics.check_finite()?;
        Ok((metrics, pictures))
    }

    /// Each score over those of the held-out pictures that are chosen by their number.
    pub fn means(
        &self,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
    ) -> Result<BTreeMap<String, f64>, DesignError> {
        Ok(self.over_all(&self.pictures(camera, is_chosen, Depth::Finished, &|_, _| {})?))
    }

    /// The scores of a camera from its pictures, without those for which there is nothing to find.
    fn over_all(&self, pictures: &[ScoredPicture]) -> BTreeMap<String, f64> {
        match &self.judge {
            Judge::Pictures(scores) => {
                let mean = |name: &str| {
                    let sum: f64 = pictures.iter().map(|picture| picture.score.scores[name]).sum();
                    sum / pictures.len() as f64
                };
                scores.iter().map(|score| (score.name().to_owned(), mean(score.name()))).collect()
            }
            Judge::Objects(scores) => {
                let (windows, classes) = (windows_of(pictures), self.setup.experiment.task.classes().len());
                let value = |score: &ObjectScore| {
                    Some((score.about.name.clone(), score.of(&windows, classes, self.setup.field())?))
                };
                scores.iter().filter_map(value).collect()
            }
        }
    }

    /// The ranges in which the scores of a camera lie if other windows had been drawn; none for scores of single pictures.
    fn intervals(&self, pictures: &[ScoredPicture]) -> BTreeMap<String, [f64; 2]> {
        let Judge::Objects(scores) = &self.judge else { return BTreeMap::new() };
        let (windows, classes) = (windows_of(pictures), self.setup.experiment.task.classes().len());
        let clusters = clusters(pictures.iter().filter_map(|picture| picture.objects.as_ref()));
        let interval = |score: &ObjectScore| {
            let range = score.interval(&windows, &clusters, classes, self.setup.field())?;
            Some((score.about.name.clone(), range))
        };
        scores.iter().filter_map(interval).collect()
    }

    /// Takes and scores those of the held-out pictures that are chosen by their number.
    fn pictures(
        &self,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
        how: Depth,
        tick: &dyn Fn(usize, usize),
    ) -> Result<Vec<ScoredPicture>, DesignError> {
        let noise = Noise { mode: NoiseMode::Exact, seed: SCORING_SEED };
        let mut pictures = Vec::new();
        let shots = held_out_shots(&self.setup, camera, is_chosen)?;
        let count = shots.len();
        for (i, HeldOut { name: photo, sequence, relative_field, shot }) in shots.into_iter().enumerate() {
            tick(i, count);
            let at = camera.kept(&shot).placement;
            let shots = [shot];
            let frames = camera.take(&shots, &noise)?;
            // As a stored picture would be.
            let finished = within_range(frames.finished.clone())?;
            let developed = host_image(srgb_encode_op(frames.developed.clone()))?;
            pictures.push(match &self.judge {
                Judge::Pictures(scores) => {
                    let truth_tensor = camera.truths(&shots)?;
                    let pair = ScoredPair {
                        truth: host_image(truth_tensor.clone())?,
                        finished: host_image(finished.clone())?,
                        finished_tensor: finished,
                        truth_tensor,
                    };
                    let mut values = BTreeMap::new();
                    for score in scores {
                        values.insert(score.name().to_owned(), score.of(&pair)?);
                    }
                    ScoredPicture {
                        score: PictureScore { photo, relative_field, scores: values },
                        developed,
                        truth: pair.truth,
                        output: pair.finished,
                        objects: None,
                    }
                }
                Judge::Objects(_) => {
                    let detector = camera.detector().ok_or(LossError::NoDetector)?;
                    let found =
                        |picture: Tensor<4>| Ok::<_, DesignError>(detector.detect(picture)?.swap_remove(0));
                    let found = match how {
                        Depth::EveryStage => [
                            found(camera.truths(&shots)?.clamp(0.0, 1.0))?,
                            found(encoded_light(frames.irradiance))?,
                            found(encoded_light(frames.developed))?,
                            found(finished.clone())?,
                        ],
                        Depth::Finished => [vec![], vec![], vec![], found(finished.clone())?],
                    };
                    let truth = &shots[0].truth;
                    let window = SeenWindow { at: [at.row, at.col], sequence, truth: truth.clone(), found };
                    let mut scene = camera.scenes(&shots)?.swap_remove(0);
                    scene.data = scene.to_srgb();
                    ScoredPicture {
                        score: PictureScore { photo, relative_field, scores: BTreeMap::new() },
                        developed,
                        truth: with_truth(&scene, truth),
                        output: with_detections(&host_image(finished)?, truth, window.finished()),
                        objects: Some(window),
                    }
                }
            });
        }
        Ok(pictures)
    }
}

/// Where the means of scores of single pictures lie in 95 % of draws of the photographs with repetition, low and high. All places of a
/// photograph are drawn together. Empty for less than two photographs.
pub fn ranges_of_means(pictures: &[PictureScore]) -> BTreeMap<String, [f64; 2]> {
    let clusters = clusters_of(pictures.iter().map(|picture| Some(picture.photo.as_str())));
    let names: BTreeSet<&String> = pictures.iter().flat_map(|picture| picture.scores.keys()).collect();
    let range = |name: &String| {
        let values: Vec<f64> =
            pictures.iter().map(|picture| picture.scores.get(name).copied()).collect::<Option<_>>()?;
        range_of(&clusters, |counts| mean_of(&values, counts))
    };
    names.into_iter().filter_map(|name| Some((name.clone(), range(name)?))).collect()
}

/// The mean of values, each counted so often.
fn mean_of(values: &[f64], counts: &[u32]) -> Option<f64> {
    let all: u32 = counts.iter().sum();
    let sum: f64 = values.iter().zip(counts).map(|(value, count)| value * f64::from(*count)).sum();
    (all > 0).then(|| sum / f64::from(all))
}

/// Linear light as a display shows it, within the range of a picture.
fn encoded_light(light: Tensor<4>) -> Tensor<4> {
    srgb_encode_op(light).clamp(0.0, 1.0)
}

/// The objects and detections of all windows.
fn windows_of(pictures: &[ScoredPicture]) -> Vec<Picture> {
    pictures.iter().filter_map(|picture| picture.objects.as_ref().map(SeenWindow::judged)).collect()
}

/// Those of the known scores that are named, in that order.
fn named<S>(names: &[String], known: Vec<S>, name_of: impl Fn(&S) -> &str) -> Result<Vec<S>, DesignError> {
    let all = known.iter().map(&name_of).collect::<Vec<_>>().join(", ");
    let mut known: Vec<Option<S>> = known.into_iter().map(Some).collect();
    let mut scores = Vec::new();
    for name in names {
        let is_it = |s: &&mut Option<S>| s.as_ref().is_some_and(|s| name_of(s) == name);
        match known.iter_mut().find(is_it).and_then(Option::take) {
            Some(score) => scores.push(score),
            None => return Err(DesignError::UnknownScore { name: name.clone(), known: all }),
        }
    }
    Ok(scores)
}

fn camera_metrics(
    setup: &Setup,
    name: &str,
    lens: &Lens,
    psf_captured: f64,
    scores: BTreeMap<String, f64>,
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
    Ok(CameraMetrics {
        camera: name.to_owned(),
        is_ceiling: false,
        restored_error_percent: None,
        intervals: BTreeMap::new(),
        scores,
        rms_spot_um: rms_spot_by_field_um.iter().sum::<f64>() / rms_spot_by_field_um.len() as f64,
        efl_mm: order.efl_mm,
        f_number: order.f_number,
        fov_deg: 2.0 * corner_field.to_degrees(),
        corner_distortion_percent: 100.0 * corner_distortion,
        psf_captured,
        psf_by_rays: 0.0,
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
    collect(setup, run, scores, |_| true)
}

/// [`collect_metrics`] for a run at work, whose pictures need not be read: of the cameras that are finished so far.
pub fn collect_so_far(
    setup: &Setup,
    run: &RunFolder,
    scores: Vec<ScoreDescription>,
) -> Result<Metrics, DesignError> {
    let metrics = collect(setup, run, scores, Path::is_file)?;
    let Some(InputList { held_out: [held_out_images, held_out_places], .. }) = InputList::read(run)? else {
        return Ok(metrics);
    };
    Ok(Metrics { held_out_images, held_out_places, ..metrics })
}

/// The figures of the cameras whose file of figures is wanted.
fn collect(
    setup: &Setup,
    run: &RunFolder,
    scores: Vec<ScoreDescription>,
    is_wanted: impl Fn(&Path) -> bool,
) -> Result<Metrics, DesignError> {
    let figures = setup.variants.iter().map(|variant| run.camera_metrics(&variant.name));
    let rows: Vec<CameraMetrics> = figures
        .filter(|path| is_wanted(path))
        .map(|path| {
            let text = petzval_base::read_text(&path).map_err(DesignError::io(&path))?;
            serde_json::from_str(&text).map_err(|e| DesignError::Run { path, problem: e.to_string() })
        })
        .collect::<Result<_, _>>()?;
    Ok(Metrics {
        held_out_images: setup.held_out_pictures()[0],
        held_out_places: setup.held_out_pictures()[1],
        rows,
        seeds: vec![setup.experiment.seed],
        scores,
        version: VERSION.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_means_are_those_of_photographs_and_not_of_places() {
        // 100 photographs with scores of deviation 1; four places of each have the same score.
        let score = |photo: usize| ((photo * 37 % 100) as f64 - 49.5) / 28.866;
        let picture = |i: usize| PictureScore {
            photo: format!("{}.png", i / 4),
            relative_field: 0.0,
            scores: BTreeMap::from([("psnr_db".to_owned(), 30.0 + score(i / 4))]),
        };
        let pictures: Vec<PictureScore> = (0..400).map(picture).collect();
        let [low, high] = ranges_of_means(&pictures)["psnr_db"];
        // The mean of 100 values of deviation 1 has a deviation of 0.1: the range is 30 -+ 0.196, found from 500 draws.
        assert!((low - 29.804).abs() < 0.04 && (high - 30.196).abs() < 0.04, "{low} {high}");
        assert!(ranges_of_means(&pictures[..4]).is_empty(), "one photograph has no range");
    }
}
