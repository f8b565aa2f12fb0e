//! Scores on held-out pictures: exact noise, fixed places from the sensor's centre to its corner.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use petzval_camera::linear_limit::{LinearLimit, NaturalScenes};
use petzval_camera::sensor::{Exposure, Noise, NoiseMode};
use petzval_camera::tape::srgb_encode_op;
use petzval_learn::score::detection::clusters_of;
use petzval_learn::score::{ScoreDescription, range_of};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::spot::spot;
use rayon::prelude::*;

use crate::camera::{Camera, host_image, within_range};
use crate::error::{DesignError, Result};
use crate::lens::restored::{brightened, percent};
use crate::run::input_list::InputList;
use crate::run::{CameraMetrics, Metrics, PictureScore, RunFolder, VERSION, read_json};
use crate::setup::Setup;
use crate::task::{Depth, Findings, Judge, ScoredPicture, Taken};

/// Seed of the noise in scored frames: the same for every camera and every run.
const SCORING_SEED: u64 = 0x5C0_12E;

/// Held-out windows that are in memory at a time.
const WINDOWS_AT_A_TIME: usize = 64;

/// Scores cameras by what an experiment names.
pub struct Scorer {
    setup: Arc<Setup>,
    judge: Box<dyn Judge>,
}

/// A camera with its scores.
pub struct Scored {
    /// Its figures.
    pub metrics: CameraMetrics,
    /// Its held-out pictures.
    pub pictures: Vec<ScoredPicture>,
    /// What was found in them.
    pub findings: Box<dyn Findings>,
}

impl Scorer {
    /// The scores that `scoring.scores` names, in that order.
    pub fn new(setup: Arc<Setup>) -> Result<Self> {
        let judge = setup.task.judge(&setup)?;
        Ok(Self { setup, judge })
    }

    /// Scores by a judge of one's own.
    pub fn with_judge(setup: Arc<Setup>, judge: impl Judge + 'static) -> Self {
        Self { setup, judge: Box::new(judge) }
    }

    /// The experiment whose cameras are scored.
    pub fn setup(&self) -> &Arc<Setup> {
        &self.setup
    }

    /// The scores that are computed.
    pub fn scores(&self) -> Vec<ScoreDescription> {
        self.judge.scores()
    }

    /// The figures of cameras with the reasons for scores of which some camera has no value.
    pub fn with_reasons(&self, metrics: Metrics) -> Metrics {
        let mut without_value = self.judge.reasons_for_none();
        without_value.retain(|name, _| metrics.rows.iter().any(|row| !row.scores.contains_key(name)));
        Metrics { without_value, ..metrics }
    }

    /// Scores a camera: its lens by exact tracing, its pictures on the held-out photographs. Ends with [`DesignError::Stopped`] before the next
    /// picture once [`Setup::cancel`] is set.
    pub fn score(&self, name: &str, camera: &Camera) -> Result<Scored> {
        self.score_watched(name, camera, &|_, _| {})
    }

    /// The same; `tick` is called before each picture, with how many are done and how many there are.
    pub fn score_watched(&self, name: &str, camera: &Camera, tick: &dyn Fn(usize, usize)) -> Result<Scored> {
        let (Some(lens), Some(captured)) = (camera.psfs().lens(), camera.psfs().captured()) else {
            return Err(DesignError::NoLens);
        };
        let (pictures, findings) = self.pictures(camera, &|_| true, Depth::EveryStage, tick)?;
        let scored = pictures.iter().map(|p| p.score.clone()).collect();
        let scores = findings.scores();
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
            intervals: findings.intervals(),
            white_e: metrics.white_e * camera.light() * f64::from(exposed_longer),
            ..metrics
        };
        metrics.check_finite()?;
        Ok(Scored { metrics, pictures, findings })
    }

    /// Each score over those of the held-out pictures that are chosen by their number.
    pub fn means(&self, camera: &Camera, is_chosen: &dyn Fn(usize) -> bool) -> Result<BTreeMap<String, f64>> {
        Ok(self.pictures(camera, is_chosen, Depth::Finished, &|_, _| {})?.1.scores())
    }

    /// Takes and scores those of the held-out pictures that are chosen by their number.
    fn pictures(
        &self,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
        depth: Depth,
        tick: &dyn Fn(usize, usize),
    ) -> Result<(Vec<ScoredPicture>, Box<dyn Findings>)> {
        let noise = Noise { mode: NoiseMode::Exact, seed: SCORING_SEED };
        let mut findings = self.judge.begin(depth);
        let mut pictures = Vec::new();
        let all: usize = self.setup.held_out_pictures()?.iter().product();
        let chosen: Vec<usize> = (0..all).filter(|number| is_chosen(*number)).collect();
        let count = chosen.len();
        // A few windows at a time: those of a large set would not fit in memory together.
        for some in chosen.chunks(WINDOWS_AT_A_TIME) {
            let is_one_of_them = |number: usize| some.binary_search(&number).is_ok();
            for window in self.setup.held_out_shots(camera, &is_one_of_them)? {
                self.setup.cancel.check()?;
                tick(pictures.len(), count);
                let frames = camera.take(std::slice::from_ref(&window.shot), &noise)?;
                // As a stored picture would be.
                let finished = within_range(frames.finished.clone())?;
                let developed = host_image(srgb_encode_op(frames.developed.clone()))?;
                pictures.push(findings.add(Taken { camera, window, frames, finished, developed })?);
            }
        }
        Ok((pictures, findings))
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

fn camera_metrics(
    setup: &Setup,
    name: &str,
    lens: &Lens,
    psf_captured: f64,
    scores: BTreeMap<String, f64>,
    pictures: Vec<PictureScore>,
) -> Result<CameraMetrics> {
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
    let spots = angles
        .par_iter()
        .map(|field| {
            spot(lens, *field, &setup.fixed_plan.quadrature)
                .ok_or_else(|| DesignError::no_light(lens, *field, &lens.wavelengths_um))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let rms_spot_by_field_um: Vec<f64> = spots.iter().map(|spot| spot.rms_poly_um).collect();
    let corner_light = spots.first().zip(spots.last()).map(|(axis, corner)| {
        let light = corner.relative_illumination(axis);
        light.iter().sum::<f64>() / light.len() as f64
    });
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
        corner_light_percent: corner_light.map(|share| 100.0 * share),
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
pub fn collect_metrics(setup: &Setup, run: &RunFolder, scores: Vec<ScoreDescription>) -> Result<Metrics> {
    collect(setup, run, scores, setup.held_out_pictures()?, |_| true)
}

/// [`collect_metrics`] for a run at work, whose pictures need not be read: of the cameras that are finished so far.
pub fn collect_so_far(setup: &Setup, run: &RunFolder, scores: Vec<ScoreDescription>) -> Result<Metrics> {
    let held_out = InputList::read(run)?.map_or([0, 0], |list| list.held_out);
    collect(setup, run, scores, held_out, Path::is_file)
}

/// The figures of the cameras whose file of figures is wanted.
fn collect(
    setup: &Setup,
    run: &RunFolder,
    scores: Vec<ScoreDescription>,
    [held_out_images, held_out_places]: [usize; 2],
    is_wanted: impl Fn(&Path) -> bool,
) -> Result<Metrics> {
    let figures = setup.variants.iter().map(|variant| run.camera_metrics(&variant.name));
    let rows: Vec<CameraMetrics> =
        figures.filter(|path| is_wanted(path)).map(|path| read_json(&path)).collect::<Result<_, _>>()?;
    Ok(Metrics {
        held_out_images,
        held_out_places,
        rows,
        seeds: vec![setup.experiment.seed],
        scores,
        without_value: BTreeMap::new(),
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
