//! The lens as a block: the free coordinates of its design space, moved by Adam, by the curvature of the loss as lifted to the rays, by
//! CMA-ES, or at random.

mod improve;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use petzval_base::random::{Stage, Stream};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::merit::Seen;
use petzval_optics::paraxial::{image_height_per_tangent, pull_back_image_height, pull_back_log_brightness};
use serde::{Deserialize, Serialize};

use super::average::Average;
use super::by_optics::{ByOptics, TheOptics};
use super::by_window::derivatives;
use super::generations::{FirstGeneration, Generations, PointScore};
use super::lifted::{Lift, Lifted};
use super::{Batch, Block, BlockState, Descent, Magnified, as_json, losses_of, parsed};
use crate::camera::{ByLens, Camera, Shot};
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, FieldOfView, StepMethod, StepRule};
use crate::lens::restored::with_brightness;
use crate::lens::sampler::LensSampler;
use crate::lens::start::Start;

const COORDINATES: &str = "coordinates.json";
const EARLIER: &str = "earlier.json";
const PROGRESS: &str = "progress.json";
const OTHER_VARIABLES: &str = "the lens has other variables; has its file been changed?";

/// First standard deviation of a search by CMA-ES, as a share of the range between the bounds of each number: lenses lie in narrow valleys.
const FIRST_DEVIATION: f64 = 0.01;

/// By how much scenes are magnified and reduced for the derivative of a loss by the logarithm of the magnification. A detector finds an object or
/// does not, so that the two losses differ by chance as well. For pedestrians and vehicles by day the derivative is about -0.25; from batch
/// to batch it scatters by 1.9 with a step of 0.02, by 0.9 with 0.05 and by 0.5 with 0.1.
const MAGNIFICATION_STEP: f64 = 0.1;

/// Decay of the average of that derivative over the batches of a stage.
const MAGNIFICATION_DECAY: f64 = 0.95;

/// Name of the loss itself among its parts.
const TOTAL: &str = "total";

/// Name of the sum of squared violations among the losses.
const PENALTY: &str = "penalty_mm2";

/// A lens on its way through its design space.
pub struct OpticsBlock {
    start: Arc<Start>,
    /// Weight of the requirements' penalty in the loss, 1/mm^2.
    constraint_weight: f64,
    /// Whether a lens that moves for the task keeps its field of view.
    field: FieldOfView,
    /// Free coordinates.
    x: Vec<f64>,
    progress: Progress,
    /// The coordinates before each stage so far that improved the lens alone: random steps draw about these lenses as well.
    earlier: Vec<Vec<f64>>,
    /// How far the lens of the next step is off, see [`OpticsBlock::with_errors`]; empty for the lens as drawn.
    errors: Vec<f64>,
    /// By how much each coordinate lowered the loss in the last step.
    lowered: Vec<f64>,
    /// What a person should know of the last improvement of the lens alone.
    remarks: Vec<String>,
}

/// The losses of a batch, and their derivatives by the lens.
struct Slopes {
    losses: BTreeMap<String, f64>,
    /// Of the loss, by way of the PSFs that form the images.
    by_psfs: ByLens,
    /// Of the loss, by way of the PSFs of the lens as drawn, for which development takes a lens with errors.
    by_drawn: Option<ByLens>,
    /// Of the loss, by way of the light that the lens gathers.
    by_light: LensGradient,
    /// Of the loss by the logarithm of the magnification of the scenes, where the lens may change that.
    by_log_magnification: Option<f64>,
    /// The squares of violations of the requirements, mm^2, with their derivatives.
    violations: Vec<(f64, LensGradient)>,
}

/// The losses of a batch, and the derivatives of its loss by the lens, without requirements and magnification.
struct LossSlopes {
    losses: BTreeMap<String, f64>,
    by_psfs: ByLens,
    by_drawn: Option<ByLens>,
    by_light: LensGradient,
}

/// How far a stage has come, beside the coordinates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Progress {
    #[serde(flatten)]
    way: Descent,
    /// Average derivative of the loss by the logarithm of the magnification.
    #[serde(default)]
    by_log_magnification: Average,
    /// Averages of gradient and curvature, of a stage by the lifted loss.
    #[serde(default)]
    lifted: Lifted,
    /// The search of a stage without a gradient.
    #[serde(default)]
    search: Generations,
    /// The coordinates that the last random step drew, which are forgotten when the stage ends.
    #[serde(default)]
    drawn: Option<Vec<f64>>,
}

impl Progress {
    fn from(x: &[f64]) -> Self {
        Self { way: Descent::from(x), ..Self::default() }
    }
}

impl OpticsBlock {
    /// The lens from which a design starts.
    pub fn new(start: Arc<Start>, constraint_weight: f64) -> Self {
        let x = start.space.start().to_vec();
        let progress = Progress::from(&x);
        let (field, earlier, errors, lowered) = (FieldOfView::Held, Vec::new(), Vec::new(), Vec::new());
        let remarks = Vec::new();
        Self { start, constraint_weight, field, progress, x, earlier, errors, lowered, remarks }
    }

    /// The same, which keeps its field of view while it moves for the task, or not.
    pub fn with_field(self, field: FieldOfView) -> Self {
        Self { field, ..self }
    }

    /// What a person should know of the last improvement of the lens alone: that it led nowhere, which requirements are not kept, and which
    /// variables stand on a bound.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// The lens as it stands.
    pub fn lens(&self) -> Result<Lens> {
        Ok(self.start.space.lens_at(&self.x)?)
    }

    /// The lens that the last random step of the stage drew.
    pub fn drawn_lens(&self) -> Option<Result<Lens>> {
        self.progress.drawn.as_ref().map(|x| Ok(self.start.space.lens_at(x)?))
    }

    /// Makes the lens of the next step be off as one that comes out of a workshop: the number of each coordinate by a normal random error of
    /// this standard deviation, as a share of the range between its bounds. Returns that lens. The errors follow from the seed and the number
    /// of the step alone.
    pub fn with_errors(&mut self, share: f64, seed: u64, step: u64) -> Result<Lens> {
        let stream = Stream::new(seed, step, Stage::LensError);
        let error = |(i, range): (usize, f64)| share * range * stream.normals(i as u32)[0];
        self.errors = self.start.space.ranges().into_iter().enumerate().map(error).collect();
        self.lens_in_step()
    }

    /// The lens on which the next step is taken: as it stands, but for its errors.
    fn lens_in_step(&self) -> Result<Lens> {
        Ok(self.start.space.lens_off(&self.x, &self.errors)?)
    }

    /// The free coordinates.
    pub fn coordinates(&self) -> &[f64] {
        &self.x
    }

    /// Losses at the present coordinates, and the derivatives by them of the batch's loss plus the weighted penalty of the
    /// requirements. The camera of the batch has the lens as it stands; or that of [`OpticsBlock::with_errors`], and then may be
    /// [taken for](Camera::taken_for) one with the lens as it stands.
    ///
    /// The gradient comes back on the tape through network, development, sensor and renderer as far as the PSFs, and from
    /// there by the adjoint of ray tracing, or through the network that takes its place. Where the batch can be magnified, the derivative by the
    /// magnification is added, which is a difference of losses.
    pub fn gradient(&self, batch: &Batch) -> Result<(BTreeMap<String, f64>, Vec<f64>)> {
        self.pulled_to_coordinates(self.slopes(batch)?)
    }

    /// Losses, and the derivatives of the batch's loss plus the weighted penalty by the free coordinates.
    fn pulled_to_coordinates(&self, slopes: Slopes) -> Result<(BTreeMap<String, f64>, Vec<f64>)> {
        let lens = self.lens_in_step()?;
        let Slopes { losses, by_psfs, by_drawn, by_light: mut directly, by_log_magnification, violations } =
            slopes;
        if let Some(by_logarithm) = by_log_magnification {
            pull_back_log_magnification(&lens, by_logarithm, &mut directly);
        }
        for (_, by_square) in violations {
            directly += &by_square.scaled(self.constraint_weight);
        }
        let mut gradient = self.by_coordinates(by_psfs, &directly, &self.errors, &lens);
        if let Some(by) = by_drawn {
            // Each of the two lenses follows the coordinates in its own way.
            let lens = self.lens()?;
            let by = self.by_coordinates(by, &LensGradient::zero(lens.surfaces.len()), &[], &lens);
            gradient.iter_mut().zip(by).for_each(|(sum, by)| *sum += by);
        }
        Ok((losses, gradient))
    }

    /// Derivatives by the free coordinates, from those by a lens that has these errors: by way of its PSFs, and directly.
    fn by_coordinates(&self, by: ByLens, directly: &LensGradient, errors: &[f64], lens: &Lens) -> Vec<f64> {
        let space = &self.start.space;
        match by {
            ByLens::Numbers(mut by) => {
                by += directly;
                space.pull_back_off(&self.x, errors, lens, &by)
            }
            ByLens::Coordinates(by) => {
                let by_psfs = space.pull_back_coordinates_off(&self.x, errors, &by);
                let directly = space.pull_back_off(&self.x, errors, lens, directly);
                by_psfs.iter().zip(directly).map(|(a, b)| a + b).collect()
            }
        }
    }

    /// Takes the batch, and pulls the derivatives of its loss back to the lens.
    fn slopes(&self, batch: &Batch) -> Result<Slopes> {
        let lens = self.lens_in_step()?;
        let LossSlopes { mut losses, by_psfs, by_drawn, by_light } = loss_slopes(batch, &lens)?;
        let by_log_magnification =
            batch.magnified.map(|magnified| slope_by_log_magnification(batch, magnified)).transpose()?;
        let violations = self.start.requirements.violations(&lens, self.field)?;
        let penalty_mm2 = violations.iter().fold(0.0, |sum, (square, _)| sum + square);
        losses.insert(PENALTY.to_owned(), penalty_mm2);
        Ok(Slopes { losses, by_psfs, by_drawn, by_light, by_log_magnification, violations })
    }

    /// [`OpticsBlock::slopes`] with the derivative by the magnification averaged over the batches of the stage.
    fn averaged_slopes(&mut self, batch: &Batch) -> Result<Slopes> {
        let mut slopes = self.slopes(batch)?;
        if let Some(by_logarithm) = &mut slopes.by_log_magnification {
            *by_logarithm = self.progress.by_log_magnification.with(*by_logarithm, MAGNIFICATION_DECAY);
        }
        Ok(slopes)
    }

    /// A step by the curvature of the batch's loss as lifted to the rays. Where the rays say nothing, because most of a field are lost, the lens
    /// stays.
    fn step_by_curvature(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        let Slopes { losses, by_psfs, by_drawn, by_light, by_log_magnification, violations } =
            self.averaged_slopes(batch)?;
        let (ByLens::Numbers(mut by_loss), Some(light)) = (by_psfs, batch.camera.psfs().light_gradients())
        else {
            return Err(DesignError::NoGradient("rays, which a network in place of tracing does not have"));
        };
        let (lens, space) = (self.lens_in_step()?, &self.start.space);
        by_loss += &by_light;
        let light = match batch.camera.body().same_time {
            Some(_) => with_brightness(light, &lens),
            None => light,
        };
        // The lift to the rays knows nothing of magnification: it is in the slopes alone.
        let mut by_all = by_loss.clone();
        if let Some(by_logarithm) = by_log_magnification {
            pull_back_log_magnification(&lens, by_logarithm, &mut by_all);
        }
        for (_, by_square) in &violations {
            by_all += &by_square.clone().scaled(self.constraint_weight);
        }
        let mut slopes = space.pull_back_off(&self.x, &self.errors, &lens, &by_all);
        if let Some(ByLens::Numbers(by_drawn)) = by_drawn {
            let by = space.pull_back_off(&self.x, &[], &self.lens()?, &by_drawn);
            slopes.iter_mut().zip(by).for_each(|(sum, by)| *sum += by);
            // The lift is that of one lens: it takes both ways to the loss for ways through the lens with errors.
            by_loss += &by_drawn;
        }
        let value = losses.get(TOTAL).copied().unwrap_or(f64::NAN);
        let rays = self.start.spots(&lens);
        if !(slopes.iter().all(|s| s.is_finite()) && value > 0.0) {
            self.x[0] = f64::NAN;
            return Ok(losses);
        }
        let seen = Seen { rays: &rays, places: true, light: &light };
        let lift = Lift {
            space,
            x: &self.x,
            errors: &self.errors,
            lens: &lens,
            seen,
            violations: &violations,
            constraint_weight: self.constraint_weight,
        };
        let Some(curvature) = lift.curvature(value, &by_loss)? else {
            return Ok(losses);
        };
        // The squares of the residuals add up to the loss: half of its derivatives belong to the curvature.
        let half: Vec<f64> = slopes.iter().map(|s| 0.5 * s).collect();
        let before = self.x.clone();
        self.progress.lifted.step(&mut self.x, &half, &curvature, rule.rate);
        self.progress.way.pull_to_anchor(&mut self.x, rule);
        self.lowered = first_order_decrease(&slopes, &before, &self.x);
        Ok(losses)
    }

    /// A generation of CMA-ES: every lens of it takes the same frames with the same noise, and has the same random errors. Returns the mean
    /// losses of the lenses that have an image.
    fn evolve(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        let mut search = std::mem::take(&mut self.progress.search);
        let middle: Vec<f64> = self.x.iter().map(|x| place_of(*x)).collect();
        let first = FirstGeneration { middle: &middle, deviation: FIRST_DEVIATION, seed: batch.noise.seed };
        let stepped = search.step(first, |point| {
            batch.cancel.check()?;
            let x: Vec<f64> = point.iter().map(|place| coordinate_at(*place)).collect();
            let Ok(lens) = self.start.space.lens_off(&x, &self.errors) else { return Ok(None) };
            // Where the lens brings no light to some part of the sensor there is no camera.
            let Ok(drawn) = self.start.space.lens_at(&x) else { return Ok(None) };
            let camera = || -> Result<Camera> {
                let camera = batch.camera.with_lens(lens.clone())?;
                if self.errors.is_empty() {
                    return Ok(camera);
                }
                // As made, and taken for the lens as drawn.
                Ok(camera.taken_for(&batch.camera.with_lens(drawn)?))
            };
            let Some(camera) = unless_dark(camera())? else { return Ok(None) };
            let Some(violations) = unless_dark(self.start.requirements.violations(&lens, self.field))? else {
                return Ok(None);
            };
            let shots = seen_by(&camera, batch)?;
            let mut losses = losses_of(batch, &camera, &shots)?;
            let penalty_mm2: f64 = violations.iter().map(|(square, _)| square).sum();
            let proximal = self.progress.way.proximal_term(&x, rule);
            let value = losses[TOTAL] + self.constraint_weight * penalty_mm2 + proximal;
            losses.insert(PENALTY.to_owned(), penalty_mm2);
            Ok(Some(PointScore { value, losses }))
        });
        // A generation that fails leaves the search where it was.
        self.progress.search = search;
        let (places, losses) = stepped?;
        self.x = places.iter().map(|place| coordinate_at(*place)).collect();
        Ok(losses)
    }

    /// Draws a lens of which the light arrives, about the one at the start of the stage or one that it was improved from. It follows from the
    /// seed and the number of the batch alone.
    fn draw(&mut self, batch: &Batch, reach: f64) -> Result<()> {
        let number = batch.number();
        let [share, _] = Stream::new(batch.noise.seed, number, Stage::LensError).uniforms(0, 0);
        let place = (share * (self.earlier.len() + 1) as f64) as usize;
        let centre = self.earlier.get(place).unwrap_or(&self.x);
        let sampler = LensSampler::new(self.start.clone(), self.start.plan().clone(), batch.noise.seed);
        self.progress.drawn = Some(sampler.about(centre, reach).coordinates(number)?);
        Ok(())
    }
}

/// Losses of a batch, and the derivatives of its loss by every number of the lens of its camera: by way of the PSFs and of the light that the lens
/// gathers. Requirements and the magnification of scenes are left out. Fails for a camera whose PSFs come from a network in place of tracing.
pub fn loss_by_numbers(batch: &Batch) -> Result<(BTreeMap<String, f64>, LensGradient)> {
    let lens = batch.camera.psfs().lens().ok_or(DesignError::NoLens)?;
    let LossSlopes { losses, by_psfs, by_light, .. } = loss_slopes(batch, lens)?;
    let ByLens::Numbers(mut by) = by_psfs else {
        return Err(DesignError::NoGradient(
            "numbers of a lens, which a network in place of tracing does not give",
        ));
    };
    by += &by_light;
    Ok((losses, by))
}

/// Takes the batch with a camera of this lens, and pulls the derivatives of its loss back to the lens.
fn loss_slopes(batch: &Batch, lens: &Lens) -> Result<LossSlopes> {
    if !batch.camera.has_gradient() {
        return Err(DesignError::NoGradient("an ISP that nothing imitates yet"));
    }
    // The tape ends at the PSFs, and what forms them takes over from them to the lens.
    let (losses, by) = derivatives(batch, &TheOptics(batch.camera))?;
    // A loss that is no number makes the coordinates so; the caller ends the run.
    let ByOptics { own, taken_for } = by.unwrap_or_else(|| ByOptics::not_a_number(batch.camera));
    if own.values.is_none() {
        return Err(DesignError::NoGradient("the PSFs"));
    }
    let by_psfs = own.pulled_back(batch.camera.psfs())?;
    let drawn = batch.camera.psfs_taken_for().zip(taken_for);
    let by_drawn = drawn.map(|(psfs, by)| by.pulled_back(psfs)).transpose()?;

    // What depends on the lens by another way than its PSFs: the light that it gathers.
    let mut by_light = LensGradient::zero(lens.surfaces.len());
    if let Some(by) = own.light {
        let by = f64::from(by[0]);
        pull_back_log_brightness(&lens.at_wavelength(lens.reference_um), by, &mut by_light);
    }
    Ok(LossSlopes { losses, by_psfs, by_drawn, by_light })
}

/// Where a free coordinate lies between the bounds of its number, 0..1.
fn place_of(x: f64) -> f64 {
    0.5 * (1.0 + x.sin())
}

/// The free coordinate at a place between the bounds, see [`place_of`].
fn coordinate_at(place: f64) -> f64 {
    (2.0 * place - 1.0).asin()
}

/// A result; none where light does not arrive at some field, or no chief ray at some place of the sensor.
fn unless_dark<T>(result: Result<T>) -> Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(DesignError::NoLight { .. } | DesignError::OutsideTheImage { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}

/// The scenes of a batch as another camera sees them: those that were made for the magnification and the light of the batch's camera follow
/// those of its lens.
fn seen_by<'s>(camera: &Camera, batch: &Batch<'s>) -> Result<Cow<'s, [Shot]>> {
    let height = |camera: &Camera| {
        let lens = camera.psfs().lens()?;
        Some(image_height_per_tangent(&lens.at_wavelength(lens.reference_um)))
    };
    let magnification = height(camera).zip(height(batch.camera)).map(|(own, other)| own / other);
    let mut shots = match batch.magnified.zip(magnification) {
        Some((magnified, by)) => Cow::Owned(magnified(by)?),
        None => Cow::Borrowed(batch.shots),
    };
    if camera.body().same_time.is_some_and(|same| !same.is_normalised) {
        let brighter = (camera.light() / batch.camera.light()) as f32;
        for shot in shots.to_mut().iter_mut().filter(|shot| shot.follows_light) {
            shot.scene.data.iter_mut().for_each(|v| *v *= brighter);
        }
    }
    Ok(shots)
}

/// The derivative of the batch's loss by the logarithm of the magnification, by a central difference: the same windows with the same noise,
/// a little larger and a little smaller, with their boxes. PSFs and light stay as they are.
fn slope_by_log_magnification(batch: &Batch, magnified: &Magnified) -> Result<f64> {
    let loss_at = |by: f64| -> Result<f64> {
        let shots = magnified(by)?;
        Ok(losses_of(batch, batch.camera, &shots)?[TOTAL])
    };
    let [larger, smaller] = [1.0 + MAGNIFICATION_STEP, 1.0 - MAGNIFICATION_STEP];
    Ok((loss_at(larger)? - loss_at(smaller)?) / (larger / smaller).ln())
}

/// Adds to `by_lens` what follows from a derivative by the logarithm of the magnification.
fn pull_back_log_magnification(lens: &Lens, by_logarithm: f64, by_lens: &mut LensGradient) {
    let sequence = lens.at_wavelength(lens.reference_um);
    let by_height = by_logarithm / image_height_per_tangent(&sequence);
    pull_back_image_height(&sequence, by_height, by_lens);
}

/// By how much a step lowered the loss to first order, by coordinate: `-dL/dx dx`.
fn first_order_decrease(gradient: &[f64], before: &[f64], after: &[f64]) -> Vec<f64> {
    gradient.iter().zip(before.iter().zip(after)).map(|(g, (before, after))| -g * (after - before)).collect()
}

impl Block for OpticsBlock {
    fn name(&self) -> BlockName {
        BlockName::Optics
    }

    fn free_numbers(&self) -> usize {
        self.x.len()
    }

    fn begin_stage(&mut self, is_moving: bool) {
        if is_moving {
            self.x = self.start.space.off_bounds(&self.x);
        }
        self.progress = Progress::from(&self.x);
    }

    fn step(&mut self, batch: &Batch, rule: StepRule) -> Result<BTreeMap<String, f64>> {
        self.lowered.clear();
        let losses = match rule.method {
            StepMethod::Levenberg => self.step_by_curvature(batch, rule)?,
            StepMethod::Evolution => self.evolve(batch, rule)?,
            StepMethod::Random => {
                self.draw(batch, rule.rate)?;
                BTreeMap::new()
            }
            _ => {
                let slopes = self.averaged_slopes(batch)?;
                let (losses, gradient) = self.pulled_to_coordinates(slopes)?;
                let before = self.x.clone();
                self.progress.way.step(&mut self.x, &gradient, rule);
                self.lowered = first_order_decrease(&gradient, &before, &self.x);
                losses
            }
        };
        // The next step begins with the lens as drawn.
        self.errors.clear();
        Ok(losses)
    }

    fn lowered(&self) -> &[f64] {
        &self.lowered
    }

    fn is_finite(&self) -> bool {
        self.x.iter().all(|x| x.is_finite())
    }

    fn save_numbers(&self) -> Result<BlockState> {
        let mut state = as_json(COORDINATES, "the coordinates of the lens", &self.x)?;
        if !self.earlier.is_empty() {
            state.extend(as_json(EARLIER, "the coordinates of earlier lenses", &self.earlier)?);
        }
        Ok(state)
    }

    fn load_numbers(&mut self, state: &BlockState) -> Result<(), String> {
        let x: Vec<f64> = parsed(state, COORDINATES)?;
        if x.len() != self.x.len() {
            return Err(format!("{COORDINATES}: {OTHER_VARIABLES}"));
        }
        let earlier: Vec<Vec<f64>> =
            if state.contains_key(EARLIER) { parsed(state, EARLIER)? } else { Vec::new() };
        if earlier.iter().any(|x| x.len() != self.x.len()) {
            return Err(format!("{EARLIER}: {OTHER_VARIABLES}"));
        }
        (self.x, self.earlier) = (x, earlier);
        Ok(())
    }

    fn save_progress(&self) -> Result<BlockState> {
        as_json(PROGRESS, "the moments of the lens", &self.progress)
    }

    fn load_progress(&mut self, state: &BlockState) -> Result<(), String> {
        let progress: Progress = parsed(state, PROGRESS)?;
        let free = self.x.len();
        let drawn_fits = progress.drawn.iter().all(|x| x.len() == free);
        let fits = progress.way.fits(free) && progress.lifted.fits(free) && progress.search.fits(free);
        if !fits || !drawn_fits {
            return Err(format!("{PROGRESS}: {OTHER_VARIABLES}"));
        }
        self.progress = progress;
        Ok(())
    }
}
