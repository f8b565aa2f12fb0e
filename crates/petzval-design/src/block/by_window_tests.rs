//! Derivatives by windows of their own against those of the batch as a whole, and on any number of threads.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::prelude::*;
use petzval_base::Cancel;
use petzval_camera::sensor::{Noise, NoiseMode};
use petzval_camera::tape::Frames;
use petzval_learn::detection::DetectorKind;
use petzval_learn::loss::NamedLoss;
use petzval_learn::network::{NetworkKind, Segmenter};

use super::by_window::{By, Losses, derivatives, losses_of};
use super::network::ByWeights;
use super::{Batch, CameraNetwork, OpticsBlock, Sight};
use crate::camera::{Camera, Shot};
use crate::error::{DesignError, Result};
use crate::experiment::{BlockName, Experiment, PsfsBy, StepMethod, StepRule};
use crate::library::Library;
use crate::objective::{Objective, WindowsOf};
use crate::setup::Setup;
use crate::task::objects::{DetectorNetwork, Finding};
use crate::task::pictures::Finishing;
use crate::task::segments::Segmenting;

/// Cameras and windows that take a fraction of a second.
const SMALL: &str = r#"
[psf]
fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
[training]
steps = 4
batch = 3
"#;

const STREETS: &str = "crop = 96\n[street]\nwindows = 3\nheld_out = 1\nsamples = 1\n";

const VARIANT: &str =
    "[[variant]]\nname = \"end-to-end\"\n[[variant.stage]]\nmoves = [\"optics\", \"network\"]\n";

const FINISHING: Finishing = Finishing { beta2: 0.99, largest_gradient: None };

const NOISE: Noise = Noise { mode: NoiseMode::Exact, seed: 4 };

/// An experiment of a task on small cameras.
fn setup(task: &str, more: &str, change: impl Fn(&mut Experiment)) -> Setup {
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let text = format!("name = \"small\"\ntask = \"{task}\"{SMALL}{more}{VARIANT}");
    let mut experiment = Experiment::parse(&text).unwrap();
    change(&mut experiment);
    Setup::new(experiment, &assets, Device::flex().autodiff()).unwrap()
}

fn pictures(psfs: PsfsBy) -> Setup {
    setup("image-quality", "crop = 64\n", |experiment| {
        experiment.psf.kind = psfs;
        experiment.network.base_channels = 8;
        experiment.network.levels = 2;
        experiment.network.weights = "none".to_owned();
    })
}

/// The setup of a task on streets.
fn streets(task: &str) -> Setup {
    setup(task, STREETS, |_| ())
}

/// The nominal camera with three training windows.
fn three_windows(setup: &Setup) -> (Camera, Vec<Shot>) {
    let camera = setup.camera(setup.nominal().lens_file.lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 0).unwrap();
    assert_eq!(shots.len(), 3);
    (camera, shots)
}

/// A result on 1, 2, 3 and 8 threads.
fn on_threads<R: Send>(work: impl Fn() -> R + Sync) -> Vec<R> {
    let on = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(&work);
    [1, 2, 3, 8].map(on).into()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// The same bits everywhere, and nearly those of the whole: `|difference| < 1e-5 |whole|`.
fn check(found: &[(Losses, Vec<f64>)], whole: &(Losses, Vec<f64>)) {
    let (losses, derivatives) = &found[0];
    for (others, other) in &found[1..] {
        assert_eq!(others, losses);
        assert_eq!(bits(other), bits(derivatives));
    }
    assert_eq!(losses.keys().collect::<Vec<_>>(), whole.0.keys().collect::<Vec<_>>());
    for (name, loss) in losses {
        assert!((loss - whole.0[name]).abs() <= 1e-5 * whole.0[name].abs(), "{name}: {loss} {:?}", whole.0);
    }
    assert_eq!(derivatives.len(), whole.1.len());
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let off = norm(&mut derivatives.iter().zip(&whole.1).map(|(a, b)| a - b));
    let all = norm(&mut whole.1.iter().copied());
    assert!(all > 0.0 && off < 1e-5 * all, "{off} of {all}");
}

/// The gradients of all weights in the order of the network.
struct Gradients<'g> {
    by: &'g GradientsParams,
    values: Vec<f64>,
}

impl ModuleVisitor for Gradients<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(gradient) = self.by.get::<D>(param.id) {
            let data = gradient.into_data().try_to_vec::<f32>().unwrap();
            self.values.extend(data.into_iter().map(f64::from));
        }
    }
}

/// Every weight moved a little, so that a last layer which starts at zero hides nothing.
struct Moved;

impl ModuleMapper for Moved {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        param.map(|weights| {
            let is_tracked = weights.is_require_grad();
            let device = weights.device();
            let (shape, count) = (weights.dims(), weights.dims().iter().product::<usize>());
            let off: Vec<f32> = (0..count).map(|i| 0.02 * (1.3 * i as f32 + 0.4).sin()).collect();
            let off = Tensor::<D>::from_data(TensorData::new(off, shape), &device);
            (weights.detach().set_require_grad(false) + off).set_require_grad(is_tracked)
        })
    }
}

/// The same derivatives from windows that are taken two by two.
struct TwoByTwo<'a, C: CameraNetwork>(ByWeights<'a, C>);

impl<C: CameraNetwork> By for TwoByTwo<'_, C> {
    type Leaves = C::Module;
    type Derivatives = GradientsParams;

    fn leaves(&self) -> C::Module {
        self.0.leaves()
    }

    fn camera(&self, network: &C::Module) -> Camera {
        self.0.camera(network)
    }

    fn take(&self, camera: &Camera, of: &C::Module, shots: &[Shot], noise: &Noise) -> Result<Frames> {
        self.0.take(camera, of, shots, noise)
    }

    fn read(&self, network: &C::Module, by: burn::tensor::Gradients) -> Result<GradientsParams> {
        self.0.read(network, by)
    }

    fn plus(&self, sum: GradientsParams, own: GradientsParams) -> GradientsParams {
        self.0.plus(sum, own)
    }

    fn windows_together(&self, _: usize) -> usize {
        2
    }
}

/// Checks the derivatives by the weights of a network behind the nominal lens.
fn check_weights<C: CameraNetwork>(setup: &Setup, network: C::Module, how: &C) {
    let (camera, shots) = three_windows(setup);
    let objective = setup.objective().unwrap();
    assert_ne!(objective.windows(), WindowsOf::Whole);
    let network = network.map(&mut Moved);
    let by = ByWeights { network: &network, how, camera: &camera, sight: Sight::default() };
    let values = |(losses, by): (Losses, Option<GradientsParams>)| {
        let mut gradients = Gradients { by: &by.unwrap(), values: Vec::new() };
        network.visit(&mut gradients);
        (losses, gradients.values)
    };
    let whole = |c: &Camera, f: &Frames, s: &[Shot]| objective.loss(c, f, s);
    let whole = values(derivatives(&Batch::new(&camera, &shots, NOISE, &whole), &by).unwrap());
    let batch = || Batch::new(&camera, &shots, NOISE, objective.as_ref());
    let found = on_threads(|| values(derivatives(&batch(), &by).unwrap()));
    check(&found, &whole);
    // Losses alone are those of the step.
    let attached = by.camera(&network.clone().no_grad());
    let alone = losses_of(&batch(), &attached, &shots).unwrap();
    for (name, loss) in &found[0].0 {
        assert!((loss - alone[name]).abs() <= 1e-6 * loss.abs(), "{name}: {loss} {alone:?}");
    }
    check(&[values(derivatives(&batch(), &TwoByTwo(by)).unwrap())], &whole);
}

#[test]
fn windows_of_pictures_give_the_gradient_of_the_batch_by_the_weights() {
    let setup = pictures(PsfsBy::Geometric);
    let network = NetworkKind::RestorationNaf.init(8, 2, 5, &setup.body.device).unwrap();
    check_weights(&setup, network, &FINISHING);
}

#[test]
fn windows_of_objects_give_the_gradient_of_the_batch_by_the_weights() {
    let setup = streets("pedestrian-vehicle");
    let how = Finding { classes: setup.experiment.classes() };
    for kind in [DetectorKind::FasterRcnn, DetectorKind::Fcos] {
        let backbone = setup.experiment.detector.backbone;
        let detector = kind.init(backbone, setup.experiment.class.len(), 5, &setup.body.device).unwrap();
        check_weights(&setup, DetectorNetwork::Detector(detector), &how);
    }
}

#[test]
fn windows_of_classes_give_the_gradient_of_the_batch_by_the_weights() {
    let setup = streets("street-segmentation");
    let network = Segmenter::init(setup.experiment.class.len(), 4, 2, 5, &setup.body.device).unwrap();
    check_weights(&setup, network, &Segmenting);
}

#[test]
fn windows_give_the_gradient_of_the_batch_by_the_lens() {
    for psfs in [PsfsBy::Geometric, PsfsBy::Diffraction] {
        check_lens(&pictures(psfs));
    }
}

/// Checks the derivatives by the nominal lens.
fn check_lens(setup: &Setup) {
    let (start, variant) = (setup.nominal().clone(), &setup.variants[0]);
    let camera = setup.moving_camera(variant, start.lens_file.lens.clone()).unwrap();
    let camera = setup.blocks(variant).unwrap().held(&camera);
    let shots = setup.training_shots(&camera, 0).unwrap();
    let objective = setup.objective().unwrap();
    let block = OpticsBlock::new(start, 1.0);
    let taken = |goal: &dyn Objective| block.gradient(&Batch::new(&camera, &shots, NOISE, goal)).unwrap();
    let whole = |c: &Camera, f: &Frames, s: &[Shot]| objective.loss(c, f, s);
    check(&on_threads(|| taken(objective.as_ref())), &taken(&whole));
}

#[test]
fn windows_of_a_lens_that_detects_give_the_gradient_of_the_batch() {
    check_lens(&streets("pedestrian-vehicle"));
}

#[test]
fn a_loss_that_is_no_number_has_no_derivatives() {
    /// Windows apart, of which the second has no number for a loss.
    struct Broken(Box<dyn Objective>);

    impl Objective for Broken {
        fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss> {
            let mut loss = self.0.loss(camera, frames, shots)?;
            if shots[0].frame % 3 == 1 {
                loss.parts.iter_mut().for_each(|(_, value)| *value = f64::NAN);
            }
            Ok(loss)
        }

        fn windows(&self) -> WindowsOf {
            WindowsOf::Apart
        }
    }

    let setup = pictures(PsfsBy::Geometric);
    let (camera, shots) = three_windows(&setup);
    assert_eq!(shots.iter().filter(|shot| shot.frame % 3 == 1).count(), 1);
    let network = NetworkKind::UNet.init(8, 1, 5, &setup.body.device).unwrap();
    let by = ByWeights { network: &network, how: &FINISHING, camera: &camera, sight: Sight::default() };
    let goal = Broken(setup.objective().unwrap());
    let (losses, gradients) = derivatives(&Batch::new(&camera, &shots, NOISE, &goal), &by).unwrap();
    assert!(losses["total"].is_nan() && gradients.is_none());
    // The lens turns into what is no number, too; the caller ends the run.
    let block = OpticsBlock::new(Arc::clone(setup.nominal()), 1.0);
    let tracked = setup.network().unwrap().attached_to(&camera);
    let (losses, gradient) = block.gradient(&Batch::new(&tracked, &shots, NOISE, &goal)).unwrap();
    assert!(losses["total"].is_nan() && gradient.iter().any(|g| g.is_nan()));
}

/// An objective that cancels its batch while it looks at the second window.
struct Cancelling {
    of: Box<dyn Objective>,
    cancel: Cancel,
    looks: AtomicUsize,
}

impl Objective for Cancelling {
    fn loss(&self, camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss> {
        if self.looks.fetch_add(1, Ordering::SeqCst) == 1 {
            self.cancel.set();
        }
        self.of.loss(camera, frames, shots)
    }

    fn windows(&self) -> WindowsOf {
        WindowsOf::Apart
    }
}

/// The numbers of a block after two steps; before them one may be cancelled.
fn after_two_steps(
    setup: &Setup,
    name: BlockName,
    method: StepMethod,
    is_cancelled: bool,
) -> super::BlockState {
    let variant = &setup.variants[0];
    let mut blocks = setup.blocks(variant).unwrap();
    let camera = setup.moving_camera(variant, setup.nominal().lens_file.lens.clone()).unwrap();
    let camera = blocks.held(&camera);
    let shots = setup.training_shots(&camera, 0).unwrap();
    let rule = StepRule { method, rate: 0.01, proximal: 0.0 };
    let block = blocks.get_mut(name);
    block.begin_stage(true);
    if is_cancelled {
        let (of, cancel, looks) = (setup.objective().unwrap(), Cancel::default(), AtomicUsize::new(0));
        let goal = Cancelling { of, cancel: cancel.clone(), looks };
        let stepped = block.step(&Batch { cancel, ..Batch::new(&camera, &shots, NOISE, &goal) }, rule);
        assert!(matches!(stepped, Err(DesignError::Stopped(_))), "{stepped:?}");
        assert_eq!(goal.looks.into_inner(), 2, "a window was begun after the step was cancelled");
    }
    let goal = setup.objective().unwrap();
    for _ in 0..2 {
        block.step(&Batch::new(&camera, &shots, NOISE, goal.as_ref()), rule).unwrap();
    }
    block.save_numbers().unwrap()
}

#[test]
fn a_cancelled_step_is_taken_again_with_the_same_bits() {
    let setup = pictures(PsfsBy::Geometric);
    // There a window begins after the one before.
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (name, method) in [
        (BlockName::Network, StepMethod::Gradient),
        (BlockName::Optics, StepMethod::Gradient),
        (BlockName::Optics, StepMethod::Evolution),
    ] {
        let after = |is_cancelled| one_thread.install(|| after_two_steps(&setup, name, method, is_cancelled));
        assert!(after(true) == after(false), "{name:?} {method:?}");
    }
}
