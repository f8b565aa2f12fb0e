//! An experiment made ready: names turned into values, and everything checked before hours are spent.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

use burn::prelude::Device;
use petzval_base::FileError;
use petzval_camera::develop::LinearIsp;
use petzval_camera::isp::{IspParameter, IspSettings};
use petzval_camera::linear_limit::{LinearLimit, NaturalScenes};
use petzval_camera::psf::PsfLayout;
use petzval_camera::render::{Wiener, kernel_radius, with_patches_for};
use petzval_camera::sensor::SensorModel;
use petzval_files::isp_file::{IspFile, parse_isp_file};
use petzval_files::load_image_bytes;
use petzval_learn::camera_network::Network;
use petzval_learn::dataset::{
    CropPlan, DatasetError, Folder, NamedPhoto, PhotoSet, PhotoSplit, Purpose, load_folder,
};
use petzval_learn::detection::{AnyDetector, BackboneKind, DetectorKind, WeightsOf};
use petzval_learn::loss::Lpips;
use petzval_learn::objective::{FindObjects, ImageQuality, Objective};
use petzval_learn::score::{Field, standard_scores};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::image_brightness;
use petzval_optics::psf::PerfectImage;
use serde::Deserialize;

use crate::assets::Assets;
use crate::assets::study::Study;
use crate::block::{Blocks, ExposureBlock, ImitationPlan, IspBlock, Learning, NetworkBlock, OpticsBlock};
use crate::camera::optics_proxy::{ProxyOptics, read_proxy_optics};
use crate::camera::{Body, Camera, Chip, PsfErrors, PsfSource, Psfs, SameTime};
use crate::error::DesignError;
use crate::experiment::{
    BUILT_IN_PHOTOS, BlockName, DetectorConfig, Experiment, ExposureSetting, FieldOfView, NetworkConfig,
    OF_THE_WHOLE_FRAME, SameOf, Stage, StepMethod, TaskKind, TrainingConfig, Variant, places_of,
};
use crate::lens::psf_plan::PsfPlan;
use crate::lens::start::{Start, StartOf};
use crate::scenes::Scenes;

/// Pixels that are exposed around a window whose picture is restored. The filters reach 31 pixels, but nearly all of their weight lies within
/// these, so that the window is restored as it would be in the whole frame.
pub(crate) const SURROUND: usize = 8;

/// Everything that the design loop needs and that does not change during it.
pub struct Setup {
    /// The experiment.
    pub experiment: Experiment,
    /// The cameras that are made and compared.
    pub variants: Vec<Variant>,
    /// Lenses from which variants start, by the name that variants give them and whether their field of view is held; the experiment's own,
    /// held, is always among them.
    starts: BTreeMap<(String, FieldOfView), Arc<Start>>,
    /// Networks that take the place of tracing while lenses move, by the path that variants give.
    pub optics_proxies: BTreeMap<String, Arc<ProxyOptics>>,
    /// Sensor, exposure and device of every camera.
    pub body: Arc<Body>,
    /// PSFs of a lens that moves.
    pub moving_plan: PsfPlan,
    /// PSFs of a lens at rest.
    pub fixed_plan: PsfPlan,
    /// The error of the best linear restoration of raw frames.
    pub limit: Arc<LinearLimit>,
    /// Training and held-out photographs, and those of validations where there are any.
    pub photos: PhotoSet,
    /// The scenes in which objects are to be found, in place of photographs.
    pub scenes: Option<Scenes>,
    /// Pictures of the folder that cannot be used, each with the reason.
    pub skipped_photos: Vec<(String, DatasetError)>,
    /// What picture files say that was not obeyed, such as a colour profile, each with the name of the picture.
    pub photo_notes: Vec<(String, String)>,
    /// How training windows are cut.
    pub training_crops: CropPlan,
    /// How held-out windows are cut; in streets behind the experiment's lens.
    pub scoring_crops: CropPlan,
    /// Weights of the perceptual loss.
    pub lpips_weights: Vec<u8>,
    /// The file of weights from which the networks or detectors of all cameras start; none for those drawn from the seed.
    pub network_weights: Option<Vec<u8>>,
    /// How far differences between cameras scatter with the seed, where that is known of this experiment.
    pub study: Option<Study>,
}

impl Setup {
    /// Resolves an experiment against the built-in library and the file system.
    pub fn new(experiment: Experiment, assets: &Assets, device: Device) -> Result<Self, DesignError> {
        let mut setup = Self::without_photos(experiment, assets, device)?;
        if setup.experiment.task.finds_objects() {
            // Fails now, while there is no run folder yet, if `detector.weights` does not fit the detector.
            setup.network()?;
            let is_validated = setup.experiment.validation.is_used();
            let purpose = if is_validated { Purpose::ValidatedTraining } else { Purpose::Training };
            setup.scenes = Some(setup.scenes_for(purpose)?);
            return Ok(setup);
        }
        let window = setup.training_crops.window().max(setup.scoring_crops.window());
        let read = load_photos(&setup.experiment, assets, window)?;
        (setup.photos, setup.skipped_photos, setup.photo_notes) = (read.photos, read.skipped, read.notes);
        if setup.experiment.validation.is_used() {
            setup.photos = std::mem::take(&mut setup.photos).with_validation(VALIDATION_EVERY)?;
        }
        setup.training_crops.check(setup.photos.training())?;
        setup.scoring_crops.check(setup.photos.held_out())?;
        Ok(setup)
    }

    /// [`Setup::new`] to score cameras on pictures of which none trains: all those of the folder that the experiment names.
    pub fn for_scores(experiment: Experiment, assets: &Assets, device: Device) -> Result<Self, DesignError> {
        let mut setup = Self::without_photos(experiment, assets, device)?;
        if setup.experiment.task.finds_objects() {
            setup.scenes = Some(setup.scenes_for(Purpose::Scores)?);
            return Ok(setup);
        }
        let folder = Path::new(&setup.experiment.photos);
        let Folder { photos, skipped, notes } = usable_photos(folder, setup.scoring_crops.window())?;
        if photos.is_empty() {
            return Err(too_few_photos(folder, &photos, &skipped, "at least one is needed"));
        }
        setup.photos = PhotoSet::for_scores(photos)?;
        (setup.skipped_photos, setup.photo_notes) = (skipped, notes);
        setup.scoring_crops.check(setup.photos.held_out())?;
        Ok(setup)
    }

    fn scenes_for(&self, purpose: Purpose) -> Result<Scenes, DesignError> {
        let crops = [self.training_crops, self.scoring_crops];
        let (pixel_um, nominal) = (self.body.sensor.pixel_um, &self.nominal().lens_file.lens);
        Scenes::new(&self.experiment, crops, &self.fixed_plan, pixel_um, nominal, purpose)
    }

    /// [`Setup::new`] without photographs, for what is not done with them.
    pub fn without_photos(
        experiment: Experiment,
        assets: &Assets,
        device: Device,
    ) -> Result<Self, DesignError> {
        let sensor = assets.sensor(&experiment.sensor)?;
        let psf = &experiment.psf;
        let geometry = psf.geometry(&sensor);
        let moving_plan = psf.plan(&sensor, psf.pupil_cells)?;
        let fixed_plan = psf.plan(&sensor, psf.scoring_pupil_cells)?;
        let exposure = experiment.exposure.exposure();
        if experiment.exposure.vary.contains(&ExposureSetting::Gain) && !sensor.gain_steps.is_empty() {
            let message = format!("`{}` has gain steps, between which nothing can move", sensor.name);
            let hint = "leave \"gain\" out of exposure.vary, and compare the steps of exposure.linear_gain";
            return Err(DesignError::misfit(Path::new(&experiment.sensor), &message, hint));
        }
        let limit = Arc::new(LinearLimit::new(&sensor, &exposure, NaturalScenes::default()));
        let variants = experiment.variants();
        // Where cameras are exposed for the same time, the exposure is stated for the experiment's own lens.
        let stated_brightness = match experiment.exposure.same {
            SameOf::Electrons => None,
            SameOf::Time => {
                let own = assets.lens(&experiment.lens)?.lens;
                Some(image_brightness(&own.at_wavelength(own.reference_um)))
            }
        };
        let mut starts: BTreeMap<(String, FieldOfView), Arc<Start>> = BTreeMap::new();
        let own = (experiment.lens.clone(), FieldOfView::Held);
        for key in [own].into_iter().chain(variants.iter().map(start_key)) {
            if let Entry::Vacant(place) = starts.entry(key) {
                let (lens, field) = place.key();
                let is_it = |v: &&Variant| start_key(v) == *place.key();
                let moves = variants.iter().filter(is_it).any(|v| v.steps_of(BlockName::Optics) > 0);
                let of = StartOf { lens, field: *field, moves, stated_brightness };
                let start = Start::new(of, &experiment, assets, &sensor, &moving_plan, &limit)?;
                place.insert(Arc::new(start));
            }
        }
        for variant in variants.iter().filter(|v| v.steps_of(BlockName::Optics) > 0) {
            if starts[&start_key(variant)].lens_file.variables.is_empty() {
                return Err(DesignError::NothingToMove(variant.lens.clone()));
            }
        }
        let mut optics_proxies: BTreeMap<String, Arc<ProxyOptics>> = BTreeMap::new();
        for variant in &variants {
            let Some(path) = &variant.optics_proxy else { continue };
            let proxy =
                read_proxy_optics(Path::new(path), &starts[&start_key(variant)], &moving_plan, &device)?;
            optics_proxies.insert(path.clone(), Arc::new(proxy));
        }
        let layout = PsfLayout {
            field_radius_mm: fixed_plan.field_radius_mm.clone(),
            grid: experiment.psf.grid,
            pitch_um: experiment.psf.pitch_um,
        };
        let margin = kernel_radius(&geometry, &layout).map_err(|e| {
            let hint =
                "the experiment's psf.grid and psf.pitch_um make the PSF, pixel_um the pixels it covers";
            DesignError::misfit(Path::new(&experiment.sensor), &e, hint)
        })?;
        let development = experiment.development;
        let surround = if development.restore || experiment.isp.is_used() { SURROUND } else { 0 };
        let (sensor_rows, sensor_columns) = (sensor.height, sensor.width);
        let crops = |crop| CropPlan { crop, margin, surround, sensor_rows, sensor_columns };
        let (training_crops, scoring_crops) =
            (crops(experiment.training.crop), crops(experiment.scoring.crop));
        let lpips_weights = assets.bytes("weights/lpips_alex_f16.safetensors")?.to_vec();
        let network_weights = network_weights(&experiment, assets, &device)?;
        let interpolation = development.interpolation();
        interpolation.demosaic.check_array(sensor.cfa).map_err(|e| {
            let hint = "write \"bilinear\" for development.demosaic";
            DesignError::misfit(Path::new(&experiment.sensor), &e, hint)
        })?;
        let isp = LinearIsp { interpolation, ..LinearIsp::default() };
        let chip = chip(&experiment, &variants, assets, &sensor)?;
        // Behind a hardware ISP the linear development is for readers of the report alone.
        let restores = development.restore && chip.is_none();
        let restoration = restores.then(|| Wiener::of_exposure(&sensor, &exposure));
        let same_time = stated_brightness.map(|brightness| SameTime {
            white_e: exposure.white_e,
            brightness,
            // The automatic exposure of a street at night is as long as it may be: what it does not gather stays dark.
            is_normalised: !experiment.finds_in_streets(),
        });
        let study = Study::of(&experiment, assets)?;
        Ok(Self {
            experiment,
            variants,
            starts,
            optics_proxies,
            body: Arc::new(Body {
                sensor,
                geometry,
                exposure,
                truth_exposure: exposure,
                same_time,
                isp,
                restoration,
                chip,
                device,
            }),
            moving_plan,
            fixed_plan,
            limit,
            photos: PhotoSet::default(),
            scenes: None,
            skipped_photos: Vec::new(),
            photo_notes: Vec::new(),
            training_crops,
            scoring_crops,
            lpips_weights,
            network_weights,
            study,
        })
    }

    /// The start of the experiment's own lens.
    pub fn nominal(&self) -> &Arc<Start> {
        &self.starts[&(self.experiment.lens.clone(), FieldOfView::Held)]
    }

    /// The lens from which a variant starts.
    pub fn start(&self, variant: &Variant) -> &Arc<Start> {
        &self.starts[&start_key(variant)]
    }

    /// The camera of a lens, without a network. A lens on its way is sampled as its gradient is; one at rest finely, with
    /// `psf.scoring_fields` and as many patches as `psf.scoring_blend_error` needs.
    pub fn camera(&self, lens: Lens, is_moving: bool) -> Result<Camera, DesignError> {
        let moving = is_moving.then(|| self.moving_plan.clone());
        self.camera_with(lens, moving, PerfectImage::of(self.experiment.psf.kind))
    }

    /// [`Setup::camera`] of a variant's lens, which may be without aberrations.
    pub fn camera_of(&self, variant: &Variant, lens: Lens, is_moving: bool) -> Result<Camera, DesignError> {
        // While a lens moves, its fields are by waves or by rays as they were at the start.
        let moving = is_moving.then(|| self.start(variant).plan().clone());
        self.camera_with(lens, moving, variant.perfect_image)
    }

    fn camera_with(
        &self,
        lens: Lens,
        moving_plan: Option<PsfPlan>,
        perfect_image: PerfectImage,
    ) -> Result<Camera, DesignError> {
        let traced = |lens: Lens, plan: PsfPlan| -> Result<Arc<Psfs>, DesignError> {
            let plan = PsfPlan { perfect_image, ..plan };
            Ok(Arc::new(PsfSource::Traced { lens: Box::new(lens), plan }.psfs()?))
        };
        if let Some(plan) = moving_plan {
            return Camera::new(self.body.clone(), traced(lens, plan)?);
        }
        let psf = &self.experiment.psf;
        let plan = self.fixed_plan.with_fields(psf.scoring_fields);
        let (plan, pupil) = plan.converged(&lens, psf.scoring_pupil_error)?;
        let psfs = traced(lens, plan)?;
        let (geometry, blend) = with_patches_for(&self.body.geometry, psfs.bank(), psf.scoring_blend_error)?;
        let camera = Camera::new(Arc::new(Body { geometry, ..(*self.body).clone() }), psfs)?;
        Ok(camera.with_psf_errors(PsfErrors { pupil, blend: blend.median }))
    }

    /// The camera of a variant's lens on its way, without a network: [`Setup::camera_of`], or with PSFs from the network that the variant names.
    pub fn moving_camera(&self, variant: &Variant, lens: Lens) -> Result<Camera, DesignError> {
        let Some(proxy) = variant.optics_proxy.as_ref().map(|path| self.optics_proxies[path].clone()) else {
            return self.camera_of(variant, lens, true);
        };
        let field_radius_mm = self.moving_plan.field_radius_mm.clone();
        let source = PsfSource::Proxy { lens: Box::new(lens), field_radius_mm, proxy };
        Camera::new(self.body.clone(), Arc::new(source.psfs()?))
    }

    /// The objective of the experiment.
    pub fn objective(&self) -> Result<Box<dyn Objective>, DesignError> {
        Ok(match self.experiment.task {
            TaskKind::ImageQuality => {
                Box::new(ImageQuality::new(self.experiment.loss.clone(), self.lpips()?)?)
            }
            TaskKind::PedestrianVehicle | TaskKind::TrafficLight => Box::new(FindObjects),
        })
    }

    /// Held-out pictures, and places of the sensor at which each of them is scored.
    pub fn held_out_pictures(&self) -> [usize; 2] {
        match self.scenes {
            Some(_) => [self.experiment.street.held_out, 1],
            None => [self.photos.held_out().len(), self.experiment.scoring.places_per_side.pow(2)],
        }
    }

    /// The sensor, as scores of objects by their place need it.
    pub fn field(&self) -> Field {
        let SensorModel { height, width, .. } = self.body.sensor;
        let axis = [0.5 * width as f64, 0.5 * height as f64];
        Field { axis, corner_px: axis[0].hypot(axis[1]) }
    }

    /// The perceptual loss.
    pub fn lpips(&self) -> Result<Lpips, DesignError> {
        Ok(Lpips::from_safetensors(&self.lpips_weights, &self.body.device)?)
    }

    /// A network as a variant starts with it, untrained or with given weights: the same bits for every variant of a run.
    pub fn network(&self) -> Result<NetworkBlock, DesignError> {
        let (experiment, device) = (&self.experiment, &self.body.device);
        if experiment.task.finds_objects() {
            let Some((path, bytes)) = experiment.detector.weights.as_ref().zip(self.network_weights.as_ref())
            else {
                return Ok(NetworkBlock::new(drawn_detector(experiment, device)?));
            };
            return match experiment.detector.safetensors() {
                Some(path) => Ok(NetworkBlock::new(read_detector(experiment, path, bytes, device)?)),
                None => {
                    let drawn = NetworkBlock::new(drawn_detector(experiment, device)?);
                    drawn.with_weights(Path::new(path), bytes)
                }
            };
        }
        let NetworkConfig { kind, base_channels, levels, .. } = experiment.network;
        let drawn = kind.init(base_channels, levels, experiment.seed, device)?;
        let network = match &self.network_weights {
            Some(bytes) => drawn.with_weights(bytes)?,
            None => drawn,
        };
        let block = NetworkBlock::new(network);
        let TrainingConfig { beta2, largest_gradient, .. } = experiment.training;
        let largest_gradient = (largest_gradient > 0.0).then_some(largest_gradient as f32);
        Ok(block.with_learning(Learning { beta2: beta2 as f32, largest_gradient }))
    }

    /// The exposure at the start, of which the settings that the experiment names may move.
    pub fn exposure(&self) -> ExposureBlock {
        let config = &self.experiment.exposure;
        let settings = [(ExposureSetting::Time, config.times_s), (ExposureSetting::Gain, config.gains)];
        let varied = settings.into_iter().filter(|(setting, _)| config.vary.contains(setting));
        ExposureBlock::new(config.exposure(), varied)
    }

    /// The parameters of the hardware ISP at the start, of which those that the experiment names may move.
    pub fn isp(&self) -> Result<IspBlock, DesignError> {
        let Some(chip) = &self.body.chip else {
            return Ok(IspBlock::new(Vec::new(), Vec::new(), Vec::new()));
        };
        let isp = &self.experiment.isp;
        let parameters = chip.parameters();
        let named = isp.vary.iter().flat_map(|name| places_of(name, &parameters));
        let varied: BTreeSet<usize> = named.collect();
        let plan = ImitationPlan {
            isp: chip.isp().clone(),
            values: chip.values().to_vec(),
            scores: Rc::new(standard_scores(&self.lpips()?)),
            device: self.body.device.clone(),
            per_step: isp.proxy_steps,
            warm_up: isp.proxy_warm_up,
            in_all: isp.proxy_steps * (isp.proxy_warm_up + isp.steps),
            seed: self.experiment.seed,
        };
        let varied = varied.into_iter().collect();
        let block = IspBlock::new(parameters, chip.values().to_vec(), varied).with_imitation(plan);
        Ok(if chip.settings().is_some() { block } else { block.without_gradient() })
    }

    /// The blocks as a variant finds them before its first stage, at the numbers of its lens file and the start of its network.
    pub fn blocks(&self, variant: &Variant) -> Result<Blocks, DesignError> {
        let weight = self.experiment.constraints.weight;
        let optics = OpticsBlock::new(self.start(variant).clone(), weight).with_field(variant.field);
        Ok(Blocks { optics, exposure: self.exposure(), isp: self.isp()?, network: self.network()? })
    }

    /// Steps that a block is planned to take for the task until the end of a variant, with those of the variants that it starts from.
    pub fn task_steps(&self, variant: &Variant, block: BlockName) -> usize {
        self.task_steps_until(variant, variant.stages.len(), block)
    }

    /// The same until the end of the first `stages` of the variant.
    pub fn task_steps_until(&self, variant: &Variant, stages: usize, block: BlockName) -> usize {
        let parent = variant.from.as_ref().and_then(|name| self.variants.iter().find(|v| v.name == *name));
        let own: usize = variant.stages[..stages].iter().map(|stage| stage.task_steps_of(block)).sum();
        parent.map_or(0, |parent| self.task_steps(parent, block)) + own
    }

    /// Half the sensor's diagonal, mm.
    pub fn corner_mm(&self) -> f64 {
        self.fixed_plan.field_radius_mm.last().copied().unwrap_or(0.0)
    }
}

/// The weights that the experiment names for its network for pictures or for its detector; none where they are drawn.
fn network_weights(
    experiment: &Experiment,
    assets: &Assets,
    device: &Device,
) -> Result<Option<Vec<u8>>, DesignError> {
    if let (true, Some(path)) = (experiment.task.finds_objects(), &experiment.detector.weights) {
        let path = Path::new(path);
        return Ok(Some(petzval_base::read_whole(path).map_err(DesignError::io(path))?));
    }
    let NetworkConfig { kind, base_channels, levels, ref weights } = experiment.network;
    if !experiment.has_picture_network() || experiment.network.draws_weights() {
        return Ok(None);
    }
    let drawn = kind.init(base_channels, levels, experiment.seed, device)?;
    if experiment.network.has_built_in_weights() {
        let bytes = assets.bytes(experiment.network.built_in_file(experiment.psf.kind))?;
        return Ok(drawn.with_weights(bytes).is_ok().then(|| bytes.to_vec()));
    }
    let path = Path::new(weights);
    let bytes = petzval_base::read_whole(path).map_err(DesignError::io(path))?;
    // Fails now, while there is no run folder yet, if they do not fit.
    drawn.with_weights(&bytes).map_err(|problem| {
        let hint = "give the network.kind, base_channels and levels of the weights, or write \"none\" for network.weights";
        DesignError::misfit(path, &problem, hint)
    })?;
    Ok(Some(bytes))
}

/// The detector of an experiment with weights drawn from its seed.
fn drawn_detector(experiment: &Experiment, device: &Device) -> Result<Network, DesignError> {
    let DetectorConfig { kind, backbone, .. } = experiment.detector;
    let classes = experiment.task.classes().len();
    Ok(Network::Detector(kind.init(backbone, classes, experiment.seed, device)?))
}

/// The detector of an experiment with the weights of a safetensors file: of a detector of torchvision, of a classifier of torchvision for the
/// backbone alone, or `network.safetensors` of a run.
fn read_detector(
    experiment: &Experiment,
    path: &Path,
    bytes: &[u8],
    device: &Device,
) -> Result<Network, DesignError> {
    let DetectorConfig { kind, backbone, .. } = experiment.detector;
    let holds = WeightsOf::file(bytes);
    let misfit = match holds {
        WeightsOf::Detector if kind != DetectorKind::FasterRcnn || backbone == BackboneKind::Small => Some((
            "weights of torchvision, which has no detector of this kind on this backbone",
            "write \"faster-rcnn\" for detector.kind, and the backbone of the weights, such as \"resnet50\", for detector.backbone",
        )),
        WeightsOf::Classifier if backbone == BackboneKind::Small => Some((
            "weights of a classifier of torchvision, which has none on this backbone",
            "write the backbone of the weights, such as \"resnet50\", for detector.backbone",
        )),
        _ => None,
    };
    if let Some((message, hint)) = misfit {
        return Err(DesignError::misfit(path, &message, hint));
    }
    let task = experiment.task;
    let (read, hint) = match holds {
        WeightsOf::Detector => (
            AnyDetector::from_coco(backbone, task.coco_numbers(), bytes, device).map(Network::Detector),
            "weights of a Faster R-CNN of torchvision on detector.backbone are needed, for the 90 classes of COCO or those of the task",
        ),
        WeightsOf::Classifier => (
            kind.from_classifier(backbone, task.classes().len(), experiment.seed, bytes, device)
                .map(Network::Detector),
            "weights of a classifier of torchvision on detector.backbone are needed",
        ),
        WeightsOf::Other => (
            drawn_detector(experiment, device)?.with_weights(bytes),
            "weights of the same kind of detector, backbone and number of classes are needed, or those of torchvision",
        ),
    };
    read.map_err(|problem| DesignError::misfit(path, &problem, hint))
}

/// By what the start of a variant is found.
fn start_key(variant: &Variant) -> (String, FieldOfView) {
    (variant.lens.clone(), variant.field)
}

/// The experiment's hardware ISP, if it names one: the built-in one at the gain of its exposure, or an external one.
fn chip(
    experiment: &Experiment,
    variants: &[Variant],
    assets: &Assets,
    sensor: &SensorModel,
) -> Result<Option<Chip>, DesignError> {
    if !experiment.isp.is_used() {
        return Ok(None);
    }
    let source = assets.text("ISP", "isp", &experiment.isp.preset)?;
    let misfit = |message: &dyn std::fmt::Display| {
        let hint = "name a preset of the built-in ISP (automotive, low-light, quality or real-time), or the description of an external one";
        DesignError::misfit(&source.path, message, hint)
    };
    let chip = match parse_isp_file(&source.text).map_err(DesignError::input(&source.path))? {
        IspFile::Preset(preset) => {
            let gain_ev = f64::from(experiment.exposure.linear_gain).log2();
            let settings = preset.at_gain(gain_ev).map_err(|e| misfit(&e))?;
            if settings.bayer_denoise.radial != 0.0 {
                return Err(misfit(&format!(
                    "sets {OF_THE_WHOLE_FRAME}, which windows of a frame do not know"
                )));
            }
            // A truth of 8 bits would be coarser than the differences that are learnt.
            Chip::built_in(IspSettings { bits: 16, ..settings })
        }
        IspFile::External(_) | IspFile::Settings(_) => {
            let chip = Chip::external(assets.external_isp(&source.path)?);
            variants
                .iter()
                .try_for_each(|variant| check_without_gradient(variant, experiment, &source.path))?;
            chip
        }
        IspFile::Proxy(_) => {
            return Err(misfit(&"is a network that imitates an ISP, by which no camera is scored"));
        }
    };
    if !sensor.cfa.is_bayer() {
        return Err(misfit(&format!("needs a Bayer array, not {}", sensor.cfa)));
    }
    let parameters = chip.parameters();
    if let Some(name) = experiment.isp.vary.iter().find(|name| places_of(name, &parameters).is_empty()) {
        let known: Vec<&str> = parameters.iter().map(|p: &IspParameter| p.name.as_str()).collect();
        let message = format!("no parameter or stage of this ISP is called `{name}`, as isp.vary says");
        let hint = format!("its parameters are {}", known.join(", "));
        return Err(DesignError::misfit(&source.path, &message, &hint));
    }
    Ok(Some(chip))
}

/// Refuses a variant that needs the gradient of an ISP that has none: such an ISP moves by CMA-ES, or by a network that imitates it, and a
/// lens behind it moves only with a network that has learnt enough in an earlier stage.
fn check_without_gradient(
    variant: &Variant,
    experiment: &Experiment,
    path: &Path,
) -> Result<(), DesignError> {
    let mut learnt = 0;
    for (number, stage) in variant.stages.iter().enumerate() {
        let Stage::Task(moves) = stage else {
            // A stage that does not move the ISP forgets the network.
            learnt = 0;
            continue;
        };
        let refuse = |what: &str, hint: &str| {
            let message =
                format!("has no gradient, and stage {} of variant `{}` {what}", number + 1, variant.name);
            Err(DesignError::misfit(path, &message, hint))
        };
        let isp = moves.get(&BlockName::Isp);
        if isp.is_some_and(|s| !matches!(s.method, StepMethod::Evolution | StepMethod::Proxy)) {
            let hint = "write schedule.isp.method = \"proxy\" or \"evolution\" in the stage";
            return refuse("moves its parameters down one", hint);
        }
        let by_proxy = isp.filter(|s| s.method == StepMethod::Proxy).map_or(0, |s| s.steps);
        let is_ready = by_proxy > 0 && learnt > experiment.isp.proxy_warm_up;
        if stage.steps_down_a_gradient(BlockName::Optics) && !is_ready {
            let hint = format!(
                "let a stage before it move the isp alone by the method \"proxy\", for more than isp.proxy_warm_up = {} steps, and move \
                 the isp by it in this stage as well",
                experiment.isp.proxy_warm_up
            );
            return refuse("moves the lens without a network that imitates it yet", &hint);
        }
        learnt = if by_proxy > 0 { learnt + by_proxy } else { 0 };
    }
    Ok(())
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

/// Training and held-out photographs, files that cannot be used, and what is ignored of the others; see [`Folder`].
struct Photos {
    photos: PhotoSet,
    skipped: Vec<(String, DatasetError)>,
    notes: Vec<(String, String)>,
}

/// Of every so many training pictures, one is kept for validation.
const VALIDATION_EVERY: usize = 4;

/// Every so many pictures of a user's folder, one is held out.
const HELD_OUT_EVERY: usize = 4;

/// The built-in photographs, or a folder's: every fourth of those, by name, is held out.
fn load_photos(experiment: &Experiment, assets: &Assets, window: usize) -> Result<Photos, DesignError> {
    if experiment.photos != BUILT_IN_PHOTOS {
        return folder_photos(Path::new(&experiment.photos), window);
    }
    let list = assets.text("photograph list", "photos", "photos")?;
    let list: PhotoList = toml::from_str(&list.text)
        .map_err(|e| DesignError::input(&list.path)(FileError::from_toml(&list.text, &e)))?;
    let names = |entries: &[PhotoEntry]| entries.iter().map(|e| e.file.clone()).collect::<Vec<_>>();
    let split = PhotoSplit { training: names(&list.training), held_out: names(&list.held_out) };
    let mut notes = Vec::new();
    let photos = split
        .training
        .iter()
        .chain(&split.held_out)
        .map(|name| {
            let picture = load_image_bytes(assets.bytes(&format!("photos/{name}"))?, name)?;
            notes.extend(picture.notes.into_iter().map(|note| (name.clone(), note)));
            Ok(NamedPhoto { name: name.clone(), image: picture.light })
        })
        .collect::<Result<_, DesignError>>()?;
    Ok(Photos { photos: PhotoSet::new(photos, &split)?, skipped: Vec::new(), notes })
}

/// The pictures of a folder that hold a window, each once.
fn usable_photos(folder: &Path, window: usize) -> Result<Folder, DesignError> {
    let mut found = load_folder(folder)?;
    for photo in &mut found.photos {
        // A camera's own picture is softer than its pixels: halve it where enough is left.
        if photo.image.height.min(photo.image.width) >= 2 * window {
            photo.image = photo.image.box_half();
        }
    }
    found.skip(|photo| photo.check_holds(window));
    found.skip_copies();
    found.notes.retain(|(name, _)| found.photos.iter().any(|photo| photo.name == *name));
    Ok(found)
}

fn too_few_photos(
    folder: &Path,
    photos: &[NamedPhoto],
    skipped: &[(String, DatasetError)],
    hint: &str,
) -> DesignError {
    let count = if photos.is_empty() { "no picture" } else { "only one picture" };
    let reasons: Vec<String> = skipped.iter().take(3).map(|(_, reason)| reason.to_string()).collect();
    let message = match &reasons[..] {
        [] => count.to_owned(),
        _ => format!("{count} can be used, {} skipped: {}", skipped.len(), reasons.join("; ")),
    };
    DesignError::misfit(folder, &message, hint)
}

fn folder_photos(folder: &Path, window: usize) -> Result<Photos, DesignError> {
    let Folder { photos, skipped, notes } = usable_photos(folder, window)?;
    if photos.len() < 2 {
        let hint = "at least two are needed: every fourth, or the last, is held out for scoring";
        return Err(too_few_photos(folder, &photos, &skipped, hint));
    }
    let mut split = PhotoSplit::default();
    for (i, photo) in photos.iter().enumerate() {
        let held_out =
            i % HELD_OUT_EVERY == HELD_OUT_EVERY - 1 || i + 1 == photos.len() && split.held_out.is_empty();
        let list = if held_out { &mut split.held_out } else { &mut split.training };
        list.push(photo.name.clone());
    }
    Ok(Photos { photos: PhotoSet::new(photos, &split)?, skipped, notes })
}
