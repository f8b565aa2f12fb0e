//! The gradient through the whole camera, against differences of the whole camera.

use crate::common::library;
use petzval_base::Cancel;
use std::collections::BTreeMap;
use std::sync::Arc;

use crate::line_integral::Line;
use petzval_camera::develop::{Demosaic, Domain};
use petzval_camera::image::LinearImage;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Exposure, Noise, NoiseMode};
use petzval_camera::tape::Frames;
use petzval_design::block::{Batch, Block, OpticsBlock};
use petzval_design::camera::{Camera, Labels, PsfSource, SameTime, Shot};
use petzval_design::experiment::{
    DevelopmentConfig, ExposureSetting, FieldOfView, LensGoal, LensSearch, NetworkKind, PsfsBy, StepMethod,
    StepRule, VariantConfig,
};
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_design::lens::start::Start;
use petzval_design::setup::Setup;
use petzval_design::task::Objective;
use petzval_learn::Device;
use petzval_learn::loss::NamedLoss;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::image_brightness;

fn setup() -> Setup {
    setup_with(false)
}

fn setup_with(restore: bool) -> Setup {
    let assets = library();
    let mut experiment = assets.experiment("cooke-triplet-image-quality").unwrap();
    // Without directions that are chosen pixel by pixel, which differences would step across.
    experiment.development =
        DevelopmentConfig { demosaic: Demosaic::Bilinear, domain: Domain::Linear, restore };
    experiment.network.kind = if restore { NetworkKind::Restoration } else { NetworkKind::UNet };
    experiment.psf.kind = PsfsBy::Geometric;
    experiment.psf.fields = 5;
    experiment.psf.pupil_cells = 32;
    experiment.psf.scoring_pupil_cells = 32;
    experiment.training.crop = 64;
    experiment.network.base_channels = 8;
    experiment.network.levels = 2;
    experiment.loss.lpips_weight = 0.2;
    let end_to_end = experiment.variant.last().unwrap().clone();
    experiment.variant.push(VariantConfig { name: "free".into(), field: FieldOfView::Free, ..end_to_end });
    Setup::new(experiment, &assets, Device::flex().autodiff()).unwrap()
}

/// A scene of smooth waves that reaches every frequency the pixels can hold.
fn scene(side: usize, phase: f32) -> LinearImage {
    let mut image = LinearImage::zeros(3, side, side);
    for (i, v) in image.data.iter_mut().enumerate() {
        let (x, y) = ((i % side) as f32, (i / side % side) as f32);
        let wave = (0.5 * x + 0.2 * y + phase).sin() + (0.13 * x - 0.9 * y).cos();
        *v = 0.35 + 0.15 * wave;
    }
    image
}

fn shots(setup: &Setup) -> Vec<Shot> {
    let side = setup.training_crops.window();
    [(100, 200), (568, 928), (1120, 1840)]
        .iter()
        .enumerate()
        .map(|(i, (row, col))| Shot {
            scene: scene(side, i as f32),
            placement: Placement { row: *row, col: *col },
            kept: None,
            frame: i as u64,
            labels: Labels::default(),
            follows_light: i != 1,
        })
        .collect()
}

/// A camera of the nominal lens at some coordinates, with an untrained network behind it.
fn camera(setup: &Setup, x: &[f64]) -> Camera {
    camera_from(setup, setup.nominal(), x)
}

/// The same of another lens.
fn camera_from(setup: &Setup, start: &Start, x: &[f64]) -> Camera {
    camera_with(setup, start, start.space.lens_at(x).unwrap())
}

/// A camera with a lens that sees the fields of the one at the start.
fn camera_with(setup: &Setup, start: &Start, lens: Lens) -> Camera {
    // The gradient is that at fixed fields.
    let moving = &setup.moving_plan;
    let fields = moving.field_angles(&start.space.lens_at(start.space.start()).unwrap()).unwrap();
    let plan = PsfPlan { held_fields_rad: Some(fields), ..moving.clone() };
    let psfs = PsfSource::Traced { lens: Box::new(lens), plan }.psfs().unwrap();
    setup.network().unwrap().attached_to(&Camera::new(setup.body.clone(), Arc::new(psfs)).unwrap())
}

fn loss(setup: &Setup, objective: &dyn Objective, x: &[f64], shots: &[Shot]) -> f64 {
    let camera = camera(setup, x);
    let frames = camera.take(shots, &Noise { mode: NoiseMode::Off, seed: 1 }).unwrap();
    let parts = objective.loss(&camera, &frames, shots).unwrap().parts;
    parts.iter().find(|(name, _)| *name == "total").unwrap().1
}

/// Losses and gradient at a place in the design space. The penalty of the requirements has its own test.
fn gradient_at(setup: &Setup, x: &[f64], shots: &[Shot], noise: Noise) -> (BTreeMap<String, f64>, Vec<f64>) {
    let objective = setup.objective().unwrap();
    let camera = camera(setup, x);
    let loss = |camera: &Camera, frames: &Frames, shots: &[Shot]| objective.loss(camera, frames, shots);
    let batch = Batch::new(&camera, shots, noise, &loss);
    let block = block_at(setup.nominal(), x);
    assert_eq!(block.free_numbers(), block.coordinates().len());
    block.gradient(&batch).unwrap()
}

/// The lens at a place in the design space, without a penalty.
fn block_at(start: &Arc<Start>, x: &[f64]) -> OpticsBlock {
    let mut block = OpticsBlock::new(start.clone(), 0.0);
    let numbers = serde_json::to_vec(x).unwrap();
    block.load_numbers(&BTreeMap::from([("coordinates.json".to_owned(), numbers)])).unwrap();
    block
}

#[test]
fn task_loss_to_lens_coordinates() {
    let setup = setup();
    let objective = setup.objective().unwrap();
    let shots = shots(&setup);
    let noise = || Noise { mode: NoiseMode::Off, seed: 1 };
    let x = setup.nominal().space.start().to_vec();
    let value = |x: &[f64]| loss(&setup, objective.as_ref(), x, &shots);
    let gradient = |x: &[f64]| gradient_at(&setup, x, &shots, noise()).1;
    let (losses, by_x) = gradient_at(&setup, &x, &shots, noise());
    assert_eq!(by_x.len(), setup.nominal().space.dimension());
    assert!((losses["total"] - value(&x)).abs() < 1e-6);

    // The chain behind the PSFs is f32, whose rounding is 1e-4 of the change along such a line. L1, max-pooling and the interpolation between
    // fields have kinks, where slopes jump by 2e-3.
    let slopes = |direction: &[f64], parts: usize| {
        let line = Line { point: &x, direction, half: 2e-3 };
        [line.by_loss(value), line.by_gradients(parts, gradient)]
    };
    // Along the gradient itself the loss changes most.
    let norm = by_x.iter().map(|g| g * g).sum::<f64>().sqrt();
    let steepest: Vec<f64> = by_x.iter().map(|g| g / norm).collect();
    let [numeric, analytic] = slopes(&steepest, 12);
    assert!((analytic / numeric - 1.0).abs() < 2e-3, "along the gradient: {analytic} against {numeric}");

    // Along the coordinates that matter most, one by one.
    let mut order: Vec<usize> = (0..by_x.len()).collect();
    order.sort_by(|a, b| by_x[*b].abs().total_cmp(&by_x[*a].abs()));
    for i in order.into_iter().take(5) {
        let mut direction = vec![0.0; by_x.len()];
        direction[i] = 1.0;
        let [numeric, analytic] = slopes(&direction, 4);
        assert!((analytic / numeric - 1.0).abs() < 5e-3, "coordinate {i}: {analytic} against {numeric}");
    }
}

/// Compares a gradient with the differences along the coordinates that matter most, one by one.
fn along_coordinates(by_x: &[f64], count: usize, difference: impl Fn(&[f64]) -> f64) {
    let mut order: Vec<usize> = (0..by_x.len()).collect();
    order.sort_by(|a, b| by_x[*b].abs().total_cmp(&by_x[*a].abs()));
    for i in order.into_iter().take(count) {
        let mut direction = vec![0.0; by_x.len()];
        direction[i] = 1.0;
        let (analytic, numeric) = (by_x[i], difference(&direction));
        assert!(
            (analytic - numeric).abs() < 1e-2 * analytic.abs(),
            "coordinate {i}: {analytic} against {numeric}"
        );
    }
}

/// The mean square of restored or developed frames around middle grey: a loss without kinks.
fn smooth_loss(frames: &Frames) -> NamedLoss {
    let total = (frames.restored.as_ref().unwrap_or(&frames.developed).clone() - 0.3).powi_scalar(2).mean();
    let value = f64::from(petzval_design::camera::to_host(total.clone()).unwrap()[0]);
    NamedLoss { total, parts: vec![("total", value)] }
}

#[test]
fn a_loss_without_kinks_has_the_gradient_of_its_differences() {
    let setup = setup();
    smooth_gradient(&setup, setup.nominal(), 5e-4);
}

#[test]
fn the_gradient_goes_through_blur_and_filter() {
    // The gradient is smaller than without the filter, and the rounding of differences larger beside it.
    let setup = setup_with(true);
    smooth_gradient(&setup, setup.nominal(), 4e-3);
}

/// A camera as it might be made has a lens with errors and is restored by the lens as drawn: both follow the coordinates.
#[test]
fn the_gradient_of_a_camera_as_made_goes_through_its_lens_and_the_one_that_it_is_taken_for() {
    let mut setup = setup_with(true);
    made_gradient(&setup, setup.nominal());
    // Where cameras have the same time, the light that the lens as made gathers is normalised.
    let start = setup.start(setup.variants.last().unwrap()).clone();
    let own = &setup.nominal().lens_file.lens;
    let brightness = image_brightness(&own.at_wavelength(own.reference_um));
    let mut body = (*setup.body).clone();
    body.same_time = Some(SameTime { white_e: body.exposure.white_e, brightness, is_normalised: true });
    setup.cameras.body = Arc::new(body);
    made_gradient(&setup, &start);
}

fn made_gradient(setup: &Setup, start: &Arc<Start>) {
    let shots = shots(setup);
    let made_at = |x: &[f64]| {
        let mut block = block_at(start, x);
        let drawn = camera_with(setup, start, block.lens().unwrap());
        // Errors so large that the coordinates move the two lenses by different amounts.
        let made = camera_with(setup, start, block.with_errors(0.03, 1, 3).unwrap());
        (block, made, drawn)
    };
    let loss = |_: &Camera, frames: &Frames, _: &[Shot]| Ok(smooth_loss(frames));
    let noise = || Noise { mode: NoiseMode::Off, seed: 1 };
    let gradient = |block: &OpticsBlock, camera: &Camera| {
        let batch = Batch::new(camera, &shots, noise(), &loss);
        block.gradient(&batch).unwrap().1
    };
    let x = start.space.start().to_vec();
    let (block, made, drawn) = made_at(&x);
    let by_x = gradient(&block, &made.taken_for(&drawn));
    let norm = by_x.iter().map(|g| g * g).sum::<f64>().sqrt();
    let along = |direction: &[f64]| {
        let at = |step: f64| {
            let moved: Vec<f64> = x.iter().zip(direction).map(|(x, d)| x + step * d).collect();
            let (_, made, drawn) = made_at(&moved);
            smooth_loss(&made.taken_for(&drawn).take(&shots, &noise()).unwrap()).parts[0].1
        };
        (at(3e-4) - at(-3e-4)) / 6e-4
    };
    let steepest: Vec<f64> = by_x.iter().map(|g| g / norm).collect();
    let numeric = along(&steepest);
    assert!((numeric - norm).abs() < 4e-3 * norm, "{norm} against {numeric}");
    along_coordinates(&by_x, 3, along);
    // Development that knows the lens as made has another gradient.
    let known = gradient(&block, &made);
    let off = by_x.iter().zip(&known).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    assert!(off > 0.05 * norm, "{off} of {norm}");
}

/// Where cameras have the same time, a lens of another focal length has more or less light. A picture of a street is then brighter, unless the
/// automatic exposure shortens its time; a photograph is as bright, with less noise.
#[test]
fn the_gradient_goes_through_the_light_that_a_lens_gathers() {
    let mut setup = setup();
    let start = setup.start(setup.variants.last().unwrap()).clone();
    assert!(start.lens_file.efl_solve.is_none());
    let same_electrons = smooth_gradient(&setup, &start, 5e-4);
    let own = &setup.nominal().lens_file.lens;
    let brightness = image_brightness(&own.at_wavelength(own.reference_um));
    let mut body = (*setup.body).clone();
    let mut with = |is_normalised| {
        let white_e = body.exposure.white_e;
        body.same_time = Some(SameTime { white_e, brightness, is_normalised });
        setup.cameras.body = Arc::new(body.clone());
        smooth_gradient(&setup, &start, 5e-4)
    };
    let (street, photograph) = (with(false), with(true));
    assert!((photograph / same_electrons - 1.0).abs() < 1e-3, "without noise nothing shows: {photograph}");
    assert!((street / same_electrons - 1.0).abs() > 0.05, "{street} {same_electrons}");
}

/// The length of the gradient, after a comparison with differences along it.
fn smooth_gradient(setup: &Setup, start: &Arc<Start>, tolerance: f64) -> f64 {
    let shots = shots(setup);
    let noise = || Noise { mode: NoiseMode::Off, seed: 1 };
    let x = start.space.start().to_vec();
    let from = camera_from(setup, start, &x);
    let loss = |_: &Camera, frames: &Frames, _: &[Shot]| Ok(smooth_loss(frames));
    let batch = Batch::new(&from, &shots, noise(), &loss);
    // The penalty of the requirements has its own test.
    let (_, by_x) = OpticsBlock::new(start.clone(), 0.0).gradient(&batch).unwrap();
    let norm = by_x.iter().map(|g| g * g).sum::<f64>().sqrt();
    let at = |step: f64| {
        let moved: Vec<f64> = x.iter().zip(&by_x).map(|(x, g)| x + step * g / norm).collect();
        let camera = camera_from(setup, start, &moved);
        // Streets are made for the light of the lens.
        let is_street = setup.body.same_time.is_some_and(|same| !same.is_normalised);
        let seen = |shot: &Shot| {
            let mut shot = shot.clone();
            let light = if is_street && shot.follows_light { camera.light() as f32 } else { 1.0 };
            shot.scene.data.iter_mut().for_each(|v| *v *= light);
            shot
        };
        let shots: Vec<Shot> = shots.iter().map(seen).collect();
        smooth_loss(&camera.take(&shots, &noise()).unwrap()).parts[0].1
    };
    let numeric = (at(3e-4) - at(-3e-4)) / 6e-4;
    assert!((numeric - norm).abs() < tolerance * norm, "{norm} against {numeric}");
    norm
}

#[test]
fn the_whole_camera_gives_the_same_bits_on_any_number_of_threads() {
    let gradient = || {
        let setup = setup();
        let shots = shots(&setup);
        let noise = Noise { mode: NoiseMode::Dequantised, seed: 7 };
        let (_, by_x) = gradient_at(&setup, setup.nominal().space.start(), &shots, noise);
        by_x.iter().map(|g| g.to_bits()).collect::<Vec<_>>()
    };
    let on = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(gradient)
    };
    assert_eq!(on(1), on(2));
    assert_eq!(on(1), on(3));
}

#[test]
fn steps_by_the_lifted_curvature_and_by_evolution_lower_the_loss_and_continue_with_the_same_bits() {
    let setup = setup();
    let shots = shots(&setup);
    let noise = || Noise { mode: NoiseMode::Off, seed: 1 };
    let network = setup.network().unwrap();
    let error = |camera: &Camera| {
        let frames = camera.take(&shots, &noise()).unwrap();
        squared(&frames, camera, &shots).parts[0].1
    };
    let block = || OpticsBlock::new(setup.nominal().clone(), 1.0);
    let camera_of =
        |block: &OpticsBlock| network.attached_to(&setup.camera(block.lens().unwrap(), true).unwrap());
    let step = |block: &mut OpticsBlock, method: StepMethod, rate: f64| {
        let camera = camera_of(block);
        let loss = |camera: &Camera, frames: &Frames, shots: &[Shot]| Ok(squared(frames, camera, shots));
        let batch = Batch::new(&camera, &shots, noise(), &loss);
        block.step(&batch, StepRule { method, rate, proximal: 0.0 }).unwrap()
    };
    let after = |method: StepMethod, rate: f64, steps: usize| {
        let mut block = block();
        block.begin_stage(true);
        (0..steps).for_each(|_| drop(step(&mut block, method, rate)));
        (error(&camera_of(&block)), block)
    };
    let before = error(&camera_of(&block()));
    // A generation takes ten lenses without a gradient, and its mean goes on by chance at first.
    for (method, steps, least) in [(StepMethod::Levenberg, 20, 0.85), (StepMethod::Evolution, 16, 0.9)] {
        let (reached, mut whole) = after(method, 0.2, steps);
        assert!(reached < least * before, "{method:?}: {before} {reached}");
        let mut restored = block();
        restored.load_numbers(&whole.save_numbers().unwrap()).unwrap();
        restored.load_progress(&whole.save_progress().unwrap()).unwrap();
        for block in [&mut whole, &mut restored] {
            step(block, method, 0.2);
        }
        assert_eq!(whole.coordinates(), restored.coordinates());
    }
}

#[test]
fn random_steps_draw_lens_and_exposure_anew_and_leave_no_trace_when_the_stage_ends() {
    let mut setup = setup();
    setup.cameras.experiment.exposure.vary = vec![ExposureSetting::Time];
    let mut shots = shots(&setup);
    let nominal = setup.nominal().clone();
    let camera = camera(&setup, nominal.space.start());
    let rule = StepRule { method: StepMethod::Random, rate: 0.5, proximal: 0.0 };
    let mut step = |block: &mut dyn Block, number: u64, rule: StepRule| {
        shots[0].frame = number;
        let loss = |_: &Camera, _: &Frames, _: &[Shot]| panic!("a random step computes no loss");
        let noise = Noise { mode: NoiseMode::Off, seed: 1 };
        let batch = Batch::new(&camera, &shots, noise, &loss);
        assert!(block.step(&batch, rule).unwrap().is_empty());
    };
    let block = || OpticsBlock::new(nominal.clone(), 1.0);
    let mut optics = block();
    optics.begin_stage(true);
    let before = optics.lens().unwrap();
    let mut drawn = |number: u64| {
        step(&mut optics, number, rule);
        optics.drawn_lens().unwrap().unwrap()
    };
    let [first, other, again] = [drawn(3), drawn(4), drawn(3)];
    assert!(first != before && first != other && first == again);
    let curvature = |lens: &Lens| lens.surfaces[0].shape.curvature;
    assert!(curvature(&first) != curvature(&before));
    // The lens as it stands is that of the start. A stage that is continued has the lens that was drawn last, the next stage none.
    assert_eq!(optics.lens().unwrap(), before);
    let mut restored = block();
    restored.load_numbers(&optics.save_numbers().unwrap()).unwrap();
    restored.load_progress(&optics.save_progress().unwrap()).unwrap();
    assert_eq!(restored.drawn_lens().unwrap().unwrap(), first);
    restored.begin_stage(false);
    assert!(restored.drawn_lens().is_none());

    // Behind a stage that improved the lens, draws are about the lens before it as well, also once the camera was finished and taken up again.
    optics.begin_stage(false);
    optics.improve(LensGoal::Spot, 3, LensSearch::default(), &mut |_| Ok(()), &Cancel::default()).unwrap();
    let finished = optics.save_numbers().unwrap();
    let mut optics = block();
    optics.load_numbers(&finished).unwrap();
    optics.begin_stage(true);
    let improved = optics.lens().unwrap();
    let near = StepRule { rate: 1e-4, ..rule };
    let near_before = (0..40)
        .filter(|number| {
            step(&mut optics, *number, near);
            let drawn = curvature(&optics.drawn_lens().unwrap().unwrap());
            (drawn - curvature(&before)).abs() < (drawn - curvature(&improved)).abs()
        })
        .count();
    assert!((10..=30).contains(&near_before), "{near_before} of 40");

    let (mut exposure, stated) = (setup.exposure(), setup.exposure().exposure());
    exposure.begin_stage(true);
    let mut drawn = |number: u64| {
        step(&mut exposure, number, rule);
        exposure.exposure_in_work()
    };
    let [first, other, again] = [drawn(3), drawn(4), drawn(3)];
    assert!(first != stated && first != other && first == again);
    let [shortest, longest] = setup.experiment.exposure.times_s.map(|t| t as f32);
    assert!(shortest <= first.time_s && first.time_s <= longest);
    let of_light = |exposure: &Exposure| exposure.white_e / exposure.time_s;
    assert!((of_light(&first) / of_light(&stated) - 1.0).abs() < 1e-5, "{first:?}");
    let mut restored = setup.exposure();
    restored.load_numbers(&exposure.save_numbers().unwrap()).unwrap();
    restored.load_progress(&exposure.save_progress().unwrap()).unwrap();
    assert_eq!((restored.exposure_in_work(), restored.exposure()), (first, stated));
    restored.begin_stage(false);
    assert_eq!(restored.exposure_in_work(), stated);
}

/// The mean squared error of the finished pictures.
fn squared(frames: &Frames, camera: &Camera, shots: &[Shot]) -> NamedLoss {
    let total = (frames.finished.clone() - camera.truths(shots).unwrap()).powi_scalar(2).mean();
    let value = f64::from(petzval_design::camera::to_host(total.clone()).unwrap()[0]);
    NamedLoss { total, parts: vec![("total", value)] }
}
