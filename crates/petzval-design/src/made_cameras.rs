//! Cameras as they are made: the lens of a finished camera off by its tolerances and focused again, scored with the network or the ISP that was
//! designed for the lens as drawn.

use std::collections::BTreeMap;

use petzval_base::counted;
use petzval_learn::score::ScoreDescription;
use petzval_optics::merit::{Better, RmsSpot};
use petzval_optics::tolerance::{Failure, MonteCarlo, Study, ToleranceError, Tolerances, Trial};

use crate::camera::Camera;
use crate::error::DesignError;
use crate::run::picture_names::spread_pictures;
use crate::run::{MadeFigures, MadeRow};
use crate::scoring::Scorer;

/// How many cameras are made of a design, and what they are scored on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TrialPlan {
    /// Cameras.
    pub trials: usize,
    /// Seed of their errors.
    pub seed: u64,
    /// Most held-out pictures on which each is scored.
    pub pictures: usize,
    /// Whether development knows the lens that each camera has; if not, it takes it for the lens as drawn.
    pub is_calibrated: bool,
}

/// Scores of cameras that were made from one design, and of the design.
#[derive(Clone, Debug, PartialEq)]
pub struct MadeCameras {
    /// Those of the camera as drawn.
    pub drawn: BTreeMap<String, f64>,
    /// Those of each camera; none for one without an image, or whose lens cannot be built.
    pub trials: Vec<Option<BTreeMap<String, f64>>>,
    /// How many lenses cannot be built.
    pub unbuildable: usize,
}

/// Why cameras cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum MadeError {
    /// The lens does not have these tolerances.
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    /// The camera cannot be scored.
    #[error(transparent)]
    Design(#[from] DesignError),
}

/// How many tolerances and compensators break the symmetry of a lens and are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Decentres and tilts that a lens may have.
    pub tolerances: usize,
    /// Decentres and tilts that are adjusted on every lens.
    pub compensators: usize,
}

impl LeftOut {
    /// What is left out, and what that does to the yield; `None` if nothing is.
    pub fn in_words(self) -> Option<String> {
        let named = |count: usize, what: &str| (count > 0).then(|| counted(count, what));
        let kinds = [named(self.tolerances, "tolerance"), named(self.compensators, "compensator")];
        let bound = match kinds {
            [None, None] => return None,
            [Some(_), None] => "the yield is an upper bound",
            [None, Some(_)] => "the yield is a lower bound",
            [Some(_), Some(_)] => "the yield may be higher or lower with them",
        };
        let are = if self.tolerances + self.compensators == 1 { "is" } else { "are" };
        let kinds = kinds.into_iter().flatten().collect::<Vec<_>>().join(" and ");
        Some(format!(
            "{kinds} {are} left out: with a decentre or tilt a lens has no symmetry, and its pictures cannot be rendered; {bound}"
        ))
    }
}

/// The tolerances and compensators with which a lens keeps its symmetry, and how many others there are. A camera knows its PSFs by their distance
/// from the axis, so that decentres and tilts cannot be rendered.
pub fn symmetric(tolerances: Tolerances) -> (Tolerances, LeftOut) {
    let Tolerances { mut perturbations, mut compensators } = tolerances;
    let all = (perturbations.len(), compensators.len());
    perturbations.retain(|p| p.freedom.quantity.keeps_symmetry());
    compensators.retain(|(freedom, _)| freedom.quantity.keeps_symmetry());
    let left_out =
        LeftOut { tolerances: all.0 - perturbations.len(), compensators: all.1 - compensators.len() };
    (Tolerances { perturbations, compensators }, left_out)
}

/// Makes cameras from a finished one and scores them; `tick` is called after each. All cameras see the same pictures with the same noise.
///
/// Compensators are set where the spots are least and then moved as far from there as in the lens as drawn: a design may want them elsewhere.
pub fn made_cameras(
    scorer: &Scorer,
    drawn: &Camera,
    tolerances: &Tolerances,
    plan: &TrialPlan,
    tick: &mut dyn FnMut(),
) -> Result<MadeCameras, MadeError> {
    let lens = drawn.psfs().lens().ok_or(DesignError::NoLens)?;
    let merit = RmsSpot::new(lens);
    let study = Study::new(lens, tolerances, &merit)?;

    let [photographs, places] = scorer.setup().held_out_pictures()?;
    let chosen = spread_pictures(photographs, places, plan.pictures);
    let score = |camera: &Camera| scorer.means(camera, &|number| chosen.contains(&number));

    let (mut trials, mut unbuildable) = (Vec::with_capacity(plan.trials), 0);
    for number in 0..plan.trials as u64 {
        let made = study.build_from_drawn(&study.draw(plan.seed, number));
        unbuildable += usize::from(matches!(made, Err(Failure::CannotBeBuilt(_))));
        // A lens that brings no light to some part of the sensor is a failed camera.
        let assembled = |lens| {
            let made = drawn.with_lens(lens)?;
            Ok::<_, DesignError>(if plan.is_calibrated { made } else { made.taken_for(drawn) })
        };
        let camera = made.ok().and_then(|lens| assembled(lens).ok());
        trials.push(camera.map(|camera| score(&camera)).transpose()?);
        tick();
    }
    Ok(MadeCameras { drawn: score(drawn)?, trials, unbuildable })
}

impl MadeCameras {
    /// The figures of each score that has a limit, against it.
    pub fn row(self, camera: &str, scores: &[ScoreDescription], limits: &BTreeMap<String, f64>) -> MadeRow {
        let figures = |score: &ScoreDescription| {
            let limit = *limits.get(&score.name)?;
            let trial = |trial: &Option<BTreeMap<String, f64>>| Trial {
                value: trial.as_ref().and_then(|scores| scores.get(&score.name).copied()),
                compensators: Vec::new(),
                can_be_built: true,
            };
            let better = if score.higher_is_better { Better::Higher } else { Better::Lower };
            let made = MonteCarlo { seed: 0, trials: self.trials.iter().map(trial).collect(), better };
            let figures = MadeFigures {
                drawn: self.drawn.get(&score.name).copied(),
                mean: Some(made.mean_and_deviation().0).filter(|mean| mean.is_finite()),
                of_90_percent: made.percentile(90.0),
                share: made.yield_at(limit),
            };
            Some((score.name.clone(), figures))
        };
        MadeRow {
            camera: camera.to_owned(),
            scores: scores.iter().filter_map(figures).collect(),
            trials: self.trials,
            unbuildable: self.unbuildable,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use petzval_camera::sensor::{Noise, NoiseMode};
    use petzval_learn::Device;
    use petzval_optics::tolerance::{Distribution, Freedom, Perturbation, Quantity};

    use super::*;
    use crate::camera::to_host;
    use crate::experiment::Experiment;
    use crate::library::Library;
    use crate::setup::Setup;

    #[test]
    fn a_camera_that_was_not_calibrated_develops_the_light_of_its_lens_by_that_of_the_design() {
        let assets =
            Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data"))
                .unwrap();
        let text = "[psf]\nfields = 3\ngrid = 64\npatches = [2, 2]\npupil_cells = 16\nscoring_pupil_cells = 16\n\
                    scoring_pupil_error = 2.0\n[network]\nbase_channels = 4\nlevels = 1\nweights = \"none\"\n\
                    [training]\nsteps = 1\nbatch = 1\ncrop = 64\n[scoring]\nplaces_per_side = 1\ncrop = 64\n";
        let setup = Setup::new(Experiment::parse(text).unwrap(), &assets, Device::flex()).unwrap();
        let lens = setup.nominal().lens_file.lens.clone();
        let drawn = setup.camera(lens.clone(), true).unwrap();
        let defocused = lens.with_image_distance(lens.image_distance_mm() + 0.2);
        let calibrated = drawn.with_lens(defocused).unwrap();
        let made = calibrated.taken_for(&drawn);

        let shots = setup.training_shots(&drawn, 0).unwrap();
        let noise = Noise { mode: NoiseMode::Exact, seed: 1 };
        let take = |camera: &Camera| camera.take(&shots, &noise).unwrap();
        let (of_made, of_calibrated) = (take(&made), take(&calibrated));
        let host = |tensor: &burn::prelude::Tensor<4>| to_host(tensor.clone()).unwrap();
        assert_eq!(host(&of_made.raw), host(&of_calibrated.raw));
        assert_ne!(host(&of_made.restored.clone().unwrap()), host(&of_calibrated.restored.unwrap()));

        // What it makes of its raw frames is what the camera of the design would make of them.
        let [_, _, height, width] = of_made.raw.dims();
        let develop = |camera: &Camera| {
            let capture = camera.capture(&shots[0]);
            camera.finished_raw(host(&of_made.raw), [height, width], capture).unwrap()
        };
        assert_eq!(develop(&made), develop(&drawn));
        assert_ne!(develop(&made), develop(&calibrated));
        // A lens that is not off makes the camera of the design, to the last bit.
        let exact = take(&drawn.with_lens(lens).unwrap().taken_for(&drawn));
        assert_eq!(host(&exact.finished), host(&take(&drawn).finished));
    }

    #[test]
    fn what_is_left_out_is_named_by_its_kind() {
        let words = |tolerances, compensators| LeftOut { tolerances, compensators }.in_words();
        assert_eq!(words(0, 0), None);
        for (left_out, begins, ends) in [
            ((2, 0), "2 tolerances are left out: ", "an upper bound"),
            ((0, 1), "1 compensator is left out: ", "a lower bound"),
            ((1, 2), "1 tolerance and 2 compensators are left out: ", "may be higher or lower with them"),
        ] {
            let text = words(left_out.0, left_out.1).unwrap();
            assert!(text.starts_with(begins) && text.ends_with(ends), "{text}");
        }
    }

    #[test]
    fn what_keeps_the_symmetry_stays_and_the_kinds_are_counted_apart() {
        let of = |quantity, surface| Freedom::of_surface(quantity, surface);
        let off = |freedom| Perturbation { freedom, tolerance: 0.1, distribution: Distribution::Normal };
        let tolerances = Tolerances {
            perturbations: vec![off(of(Quantity::Thickness, 4)), off(of(Quantity::DecenterX, 0))],
            compensators: vec![
                (of(Quantity::Thickness, 6), None),
                (of(Quantity::Thickness, 5), Some(0.5)),
                (of(Quantity::TiltX, 5), Some(1.0)),
                (of(Quantity::DecenterY, 5), Some(1.0)),
            ],
        };
        let (kept, left_out) = symmetric(tolerances.clone());
        assert_eq!(left_out, LeftOut { tolerances: 1, compensators: 2 });
        assert_eq!(kept.perturbations, tolerances.perturbations[..1]);
        assert_eq!(kept.compensators, tolerances.compensators[..2]);
    }

    #[test]
    fn figures_are_those_of_the_scores_and_a_failed_camera_reaches_nothing() {
        let scores = |value: f64| BTreeMap::from([("ssim".to_owned(), value)]);
        let made: Vec<_> = (1..=10).map(|i| Some(scores(0.1 * f64::from(i)))).chain([None]).collect();
        let made = MadeCameras { drawn: scores(0.95), trials: made, unbuildable: 1 };
        let score = |name: &str| ScoreDescription {
            name: name.into(),
            title: name.to_uppercase(),
            unit: String::new(),
            definition: String::new(),
            decimals: 4,
            higher_is_better: true,
        };
        let row = made.row("a", &[score("ssim"), score("ap50_small")], &scores(0.75));
        assert_eq!(row.unbuildable, 1);
        // In these pictures there was no small object to be found.
        assert_eq!(row.scores.len(), 1);
        let MadeFigures { drawn, mean, of_90_percent, share } = row.scores["ssim"];
        assert!((drawn.unwrap() - 0.95).abs() < 1e-15 && (mean.unwrap() - 0.55).abs() < 1e-12);
        // Ten of eleven have an image, and nine in ten reach the least of these; three reach 0.75.
        assert!((of_90_percent.unwrap() - 0.1).abs() < 1e-12, "{of_90_percent:?}");
        assert!((share - 3.0 / 11.0).abs() < 1e-12);
    }
}
