//! The cameras of an experiment: names turned into lenses, PSF plans, sensor and ISP, and everything checked before hours are spent.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::Path;
use std::sync::Arc;

use burn::prelude::Device;
use petzval_base::Cancel;
use petzval_camera::develop::LinearIsp;
use petzval_camera::isp::{IspParameter, IspSettings};
use petzval_camera::linear_limit::{LinearLimit, NaturalScenes};
use petzval_camera::psf::{PsfBank, PsfLayout};
use petzval_camera::render::{Wiener, kernel_radius, with_patches_for};
use petzval_camera::sensor::SensorModel;
use petzval_files::isp_file::{IspFile, parse_isp_file};
use petzval_files::psf_file::{axes_file, read_psfs};
use petzval_learn::dataset::CropPlan;
use petzval_learn::loss::Lpips;
use petzval_learn::score::Field;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::image_brightness;
use petzval_optics::psf::PerfectImage;

use crate::assets::Assets;
use crate::camera::optics_proxy::{ProxyOptics, read_proxy_optics};
use crate::camera::{Body, Camera, Chip, PsfErrors, PsfSource, Psfs, SameTime};
use crate::error::{DesignError, Result};
use crate::experiment::{
    BlockName, Experiment, ExposureSetting, FieldOfView, OF_THE_WHOLE_FRAME, PsfsBy, SameOf, Stage,
    StepMethod, TaskFacts, Variant, places_of,
};
use crate::lens::psf_plan::PsfPlan;
use crate::lens::start::{Start, StartOf};

/// Pixels that are exposed around a window whose picture is restored. The filters reach 31 pixels, but nearly all of their weight lies within
/// these, so that the window is restored as it would be in the whole frame.
pub(crate) const SURROUND: usize = 8;

/// The cameras of an experiment: what does not change while they are designed.
pub struct Cameras {
    /// The experiment.
    pub experiment: Experiment,
    /// What its task decides.
    pub facts: TaskFacts,
    /// The cameras that are made and compared.
    pub variants: Vec<Variant>,
    /// Lenses from which variants start, by the name that variants give them and whether their field of view is held; the experiment's own,
    /// held, is always among them.
    starts: BTreeMap<(String, FieldOfView), Arc<Start>>,
    /// Networks that take the place of tracing while lenses move, by the path that variants give.
    optics_proxies: BTreeMap<String, Arc<ProxyOptics>>,
    /// Sensor, exposure and device of every camera.
    pub body: Arc<Body>,
    /// PSFs of a lens that moves.
    pub moving_plan: PsfPlan,
    /// PSFs of a lens at rest.
    pub fixed_plan: PsfPlan,
    /// The error of the best linear restoration of raw frames.
    pub limit: Arc<LinearLimit>,
    /// How training windows are cut.
    pub training_crops: CropPlan,
    /// How held-out windows are cut; in streets behind the experiment's lens.
    pub scoring_crops: CropPlan,
    /// Weights of the perceptual loss.
    lpips_weights: Vec<u8>,
    /// PSFs that every camera has in place of those of its lens.
    given: Option<Arc<PsfBank>>,
}

impl Cameras {
    /// The place of a camera among all of the run, which gives its colour.
    pub fn place_of(&self, camera: &str) -> Option<usize> {
        self.variants.iter().position(|variant| variant.name == camera)
    }

    /// Resolves an experiment against the built-in library and the file system.
    pub fn new(experiment: Experiment, facts: &TaskFacts, assets: &Assets, device: Device) -> Result<Self> {
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
        let named = experiment.psf.named_file().filter(|_| experiment.psf.kind == PsfsBy::File);
        let given = named.map(|file| given_bank(Path::new(file))).transpose()?;
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
            is_normalised: !experiment.sees_streets(facts),
        });
        let cameras = Self {
            experiment,
            facts: *facts,
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
            training_crops,
            scoring_crops,
            lpips_weights,
            given: None,
        };
        match given {
            Some(bank) => cameras.with_psfs(Arc::new(bank)),
            None => Ok(cameras),
        }
    }

    /// The same cameras with these PSFs in place of those of their lenses. They form the images, and development and restoration know them: a camera
    /// whose PSFs were measured is calibrated by them.
    pub fn with_psfs(self, bank: Arc<PsfBank>) -> Result<Self> {
        // Windows of scenes reach as far beyond what is exposed as the PSFs do.
        let margin = kernel_radius(&self.body.geometry, &bank.layout()).map_err(|e| {
            let hint = "grid and pitch_um of the file make the PSF, pixel_um the pixels it covers";
            DesignError::misfit(Path::new(&self.experiment.sensor), &e, hint)
        })?;
        let (training_crops, scoring_crops) =
            (CropPlan { margin, ..self.training_crops }, CropPlan { margin, ..self.scoring_crops });
        Ok(Self { given: Some(bank), training_crops, scoring_crops, ..self })
    }

    /// The PSFs that every camera has in place of those of its lens, if there are any.
    pub fn given_psfs(&self) -> Option<&PsfBank> {
        self.given.as_deref()
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
    pub fn camera(&self, lens: Lens, is_moving: bool) -> Result<Camera> {
        let moving = is_moving.then(|| self.moving_plan.clone());
        self.camera_with(lens, moving, PerfectImage::of(self.experiment.psf.kind.traced()))
    }

    /// [`Cameras::camera`] of a variant's lens, which may be without aberrations.
    pub fn camera_of(&self, variant: &Variant, lens: Lens, is_moving: bool) -> Result<Camera> {
        // While a lens moves, its fields are by waves or by rays as they were at the start.
        let moving = is_moving.then(|| self.start(variant).plan().clone());
        self.camera_with(lens, moving, variant.perfect_image)
    }

    fn camera_with(
        &self,
        lens: Lens,
        moving_plan: Option<PsfPlan>,
        perfect_image: PerfectImage,
    ) -> Result<Camera> {
        // PSFs of a file are those of every lens; else they are traced.
        let formed = |lens: Lens, plan: PsfPlan| -> Result<Arc<Psfs>> {
            let (lens, plan) = (Box::new(lens), PsfPlan { perfect_image, ..plan });
            let source = match self.given.clone() {
                Some(bank) => PsfSource::Given { bank, lens: Some(lens) },
                None => PsfSource::Traced { lens, plan },
            };
            Ok(Arc::new(source.psfs()?))
        };
        if let Some(plan) = moving_plan {
            return Camera::new(self.body.clone(), formed(lens, plan)?);
        }
        let psf = &self.experiment.psf;
        let plan = self.fixed_plan.with_fields(psf.scoring_fields);
        let (plan, pupil) = match &self.given {
            Some(_) => (plan, 0.0),
            None => plan.converged(&lens, psf.scoring_pupil_error, &Cancel::default())?,
        };
        let psfs = formed(lens, plan)?;
        let (geometry, blend) = with_patches_for(&self.body.geometry, psfs.bank(), psf.scoring_blend_error)?;
        let camera = Camera::new(Arc::new(Body { geometry, ..(*self.body).clone() }), psfs)?;
        Ok(camera.with_psf_errors(PsfErrors { pupil, blend: blend.median }))
    }

    /// The camera of a variant's lens on its way, without a network: [`Cameras::camera_of`], or with PSFs from the network that the variant names.
    pub fn moving_camera(&self, variant: &Variant, lens: Lens) -> Result<Camera> {
        let proxy = variant.optics_proxy.as_ref().filter(|_| self.given.is_none());
        let Some(proxy) = proxy.map(|path| self.optics_proxies[path].clone()) else {
            return self.camera_of(variant, lens, true);
        };
        let field_radius_mm = self.moving_plan.field_radius_mm.clone();
        let source = PsfSource::Proxy { lens: Box::new(lens), field_radius_mm, proxy };
        Camera::new(self.body.clone(), Arc::new(source.psfs()?))
    }

    /// The sensor, as scores of objects by their place need it.
    pub fn field(&self) -> Field {
        let SensorModel { height, width, .. } = self.body.sensor;
        let axis = [0.5 * width as f64, 0.5 * height as f64];
        Field { axis, corner_px: axis[0].hypot(axis[1]) }
    }

    /// The perceptual loss.
    pub fn lpips(&self) -> Result<Lpips> {
        Ok(Lpips::from_safetensors(&self.lpips_weights, &self.body.device)?)
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

/// The PSFs of a file as cameras take them.
pub fn given_bank(path: &Path) -> Result<PsfBank> {
    let bank = read_psfs(path)?.for_cameras();
    bank.map_err(|fault| DesignError::input(&axes_file(path))(fault.in_file()))
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
) -> Result<Option<Chip>> {
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

/// Refuses a variant that needs the gradient of an ISP that has none. Such an ISP moves by CMA-ES, or by a network that imitates it. A lens
/// behind it moves only with a network that has learnt enough in an earlier stage.
fn check_without_gradient(variant: &Variant, experiment: &Experiment, path: &Path) -> Result<()> {
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
