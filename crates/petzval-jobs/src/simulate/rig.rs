//! The rig of a simulation: PSFs in front of a sensor, and the cameras made of them.

use std::sync::Arc;

use petzval_base::Cancel;
use petzval_camera::develop::LinearIsp;
use petzval_camera::develop::develop;
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::psf::PsfBank;
use petzval_camera::render::{
    Distortion, MAX_SIDE, Placement, RenderGeometry, Window, kernel_radius, light_on_pixels, with_patches_for,
};
use petzval_camera::sensor::{Capture, Exposure, Noise, NoiseMode, SensorModel, expose};
use petzval_design::camera::{Body, Camera, Labels, PsfSource, Psfs, Shot};
use petzval_design::error::DesignError;
use petzval_design::experiment::PsfConfig;
use petzval_design::lens::psf_plan::{LEAST_IMAGE, PsfPlan};
use petzval_learn::Device;
use petzval_optics::lens::Lens;
use petzval_optics::psf::PerfectImage;

use super::accuracy::{coarse_patches, coarse_pupil};
use super::highlights::capacity_e;
use super::patchwise::{self, Patchwise};
use super::request::Request;
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::given_psfs;
use crate::lens::focus::focus_elsewhere;
use crate::named_isp::{NamedIsp, isp_by_name};
use crate::range::check_ranges;

/// Most pixels of a simulated frame, and most samples of its scene: the largest sensors have 150 million pixels. Each pixel takes about
/// 160 bytes, each further sample 12.
const MOST_PIXELS: usize = 200_000_000;

/// Bits of the pictures of an image signal processor.
pub const CHIP_BITS: u32 = 8;

/// Everything that all photographs of a simulation share.
pub struct Rig {
    pub geometry: RenderGeometry,
    pub sensor: SensorModel,
    /// The pixels that are read.
    pub window: Window,
    /// Where the points of a scene land, if its distortion is rendered.
    pub distortion: Option<Distortion>,
    /// Samples of a scene along a side of a pixel.
    pub samples: usize,
    /// Rows and columns, in samples, of the pictures that are taken: those of the sensor, or what the lens projects onto it.
    pub frame: (usize, usize),
    /// Development without a colour matrix.
    pub isp: LinearIsp,
    /// The image signal processor whose picture is wanted, too.
    pub chip: Option<NamedIsp>,
    /// The lens and how its PSFs are traced; none behind given PSFs, and behind a lens without rotational symmetry.
    pub traced: Option<(Lens, PsfPlan)>,
}

/// What spreads the light of photographs.
pub enum Spread {
    /// PSFs of one azimuth.
    Turned(Turned),
    /// Those of the place of each patch, behind a lens without rotational symmetry.
    ByPatch(Box<Patchwise>),
}

/// PSFs of one azimuth, which are turned about the axis.
pub struct Turned {
    psfs: Arc<Psfs>,
    /// Light that they need from outside the window, pixels.
    border: usize,
}

/// What of a rig does not depend on its optics. Every setting is checked.
struct Checked {
    sensor: SensorModel,
    window: Window,
    samples: usize,
    chip: Option<NamedIsp>,
}

impl Checked {
    fn new(request: &Request, context: &Context) -> Result<Self> {
        let sensor = request.sensor.read(&context.assets)?;
        if sensor.height.saturating_mul(sensor.width) > MOST_PIXELS {
            return Err(JobError::input(
                format!("{}: a frame of {} x {} pixels", request.sensor, sensor.width, sensor.height),
                format!("`height` times `width` of the sensor may be at most {MOST_PIXELS}"),
            ));
        }
        let mut chip = request
            .isp
            .as_ref()
            .map(|name| isp_by_name(name, &context.assets, context.cancel()))
            .transpose()?;
        if let Some(chip) = &mut chip {
            chip.set_bits(CHIP_BITS);
            if !sensor.cfa.is_bayer() {
                let message = format!("{}: the ISP needs a Bayer array, not {}", request.sensor, sensor.cfa);
                return Err(JobError::input(message, "leave --isp out, or name another sensor"));
            }
        }
        let (samples, warning) = request.samples_of(&sensor);
        warning.into_iter().for_each(|warning| context.warning(WarningKind::Picture, warning));
        let sides = [sensor.height, sensor.width].map(|side| side * samples);
        if sides[0].saturating_mul(sides[1]) > MOST_PIXELS || sides.into_iter().any(|side| side > MAX_SIDE) {
            return Err(JobError::input(
                format!(
                    "--samples {samples}: a scene of {} x {} samples on {}",
                    sides[1], sides[0], request.sensor
                ),
                format!(
                    "a scene may have {MOST_PIXELS} samples, at most {MAX_SIDE} along a side: take fewer"
                ),
            ));
        }
        request.development.demosaic.check_array(sensor.cfa).map_err(|error| {
            JobError::setting(
                "demosaic",
                request.development.demosaic.name(),
                error.to_string(),
                "take bilinear",
            )
        })?;
        rehearse(request, &sensor)?;
        let window = window(request, &sensor)?;
        Ok(Self { sensor, window, samples, chip })
    }
}

/// Development without a colour matrix.
fn isp_of(request: &Request) -> LinearIsp {
    LinearIsp { interpolation: request.development, ..LinearIsp::default() }
}

/// Says how much of the light the grid of the PSFs cuts off, if it does. Refuses a lens without an image, and one out of focus, of which less
/// than half is left. `least` and `most` are the shares of the fields that lose most and least.
fn report_light(
    request: &Request,
    psf: &PsfConfig,
    [least, most]: [f64; 2],
    lens: Option<&Lens>,
    context: &Context,
) -> Result<()> {
    let Some(lost) = psf.lost_light(least, None) else { return Ok(()) };
    // A defocus is the usual cause, and no larger grid mends it.
    let name = request.lens.to_string();
    let elsewhere = lens.and_then(|lens| focus_elsewhere(&name, lens));
    // In focus the light may be lost at the rim of a wide field alone.
    if let Some(hint) = elsewhere.as_ref().filter(|_| least < LEAST_IMAGE) {
        let message = format!("{name}: {lost}; from less than half, this is no picture of the lens");
        return Err(JobError::input(message, hint.clone()));
    }
    if most < LEAST_IMAGE {
        let message = format!("{name}: {lost}, and more than half everywhere: the lens forms no image there");
        return Err(JobError::input(message, "take a lens that images points to points on its image plane"));
    }
    context.warning(WarningKind::LostLight, lost);
    if let Some(elsewhere) = elsewhere {
        context.warning(WarningKind::OutOfFocus, format!("{name}: {elsewhere}"));
    }
    Ok(())
}

impl Rig {
    /// The rig of a request, with PSFs in place of those of its lens if there are any; every setting is checked before a lens is
    /// traced. Refuses a lens without rotational symmetry.
    pub fn new(request: &Request, in_memory: Option<&PsfBank>, context: &Context) -> Result<(Self, Turned)> {
        Self::turned(request, in_memory, Checked::new(request, context)?, context)
    }

    /// [`Rig::new`] for photographs in three colours, which any lens takes.
    pub fn for_photographs(
        request: &Request,
        in_memory: Option<&PsfBank>,
        context: &Context,
    ) -> Result<(Self, Spread)> {
        let checked = Checked::new(request, context)?;
        if in_memory.is_none() && request.psfs.is_none() {
            let lens = request.lens.read(&context.assets)?.lens;
            if !lens.is_rotationally_symmetric() {
                let (rig, made) = Self::by_patch(request, &lens, checked, context)?;
                return Ok((rig, Spread::ByPatch(Box::new(made))));
            }
        }
        let (rig, turned) = Self::turned(request, in_memory, checked, context)?;
        Ok((rig, Spread::Turned(turned)))
    }

    /// Behind a lens without rotational symmetry. Its distortion is not rendered: it differs between azimuths.
    fn by_patch(
        request: &Request,
        lens: &Lens,
        checked: Checked,
        context: &Context,
    ) -> Result<(Self, Patchwise)> {
        let Checked { sensor, window, samples, chip } = checked;
        let without = "a lens without rotational symmetry is simulated without it";
        if samples > 1 {
            return Err(JobError::setting("samples", samples, without, "leave it out, or take 1"));
        }
        if request.restore.is_some() {
            return Err(JobError::input(format!("--restore: {without}"), "leave it out"));
        }
        let psf = PsfConfig::default();
        let plan = psf.plan(&sensor, psf.scoring_pupil_cells)?;
        let made = patchwise::Behind { lens, sensor: &sensor, psf: &psf, plan, window }.exact(context)?;
        context.note(format!(
            "a lens without rotational symmetry: PSFs are traced at {} places, and straight lines stay straight",
            made.places
        ));
        report_light(request, &psf, made.captured, Some(lens), context)?;
        made.warnings.iter().for_each(|(kind, text)| context.warning(*kind, text));
        let rig = Self {
            geometry: made.geometry.clone(),
            window,
            distortion: None,
            samples,
            frame: (sensor.height, sensor.width),
            isp: isp_of(request),
            chip,
            traced: None,
            sensor,
        };
        Ok((rig, made))
    }

    /// With PSFs that are turned about the axis.
    fn turned(
        request: &Request,
        in_memory: Option<&PsfBank>,
        checked: Checked,
        context: &Context,
    ) -> Result<(Self, Turned)> {
        let Checked { sensor, window, samples, chip } = checked;
        // As cameras are scored: fields, wavelengths, grids and patches of an experiment by default.
        let psf = PsfConfig::default();
        let coarse = psf.geometry(&sensor);
        // The distortion of given PSFs, where their file has it.
        let mut distortion = None;
        let given = |bank: Arc<PsfBank>| PsfSource::Given { bank, lens: None };
        let (source, traced) = match (in_memory, &request.psfs) {
            (Some(bank), _) => (given(Arc::new(bank.clone())), None),
            (None, Some(path)) => {
                let file = given_psfs::bank_of(path)?;
                if !request.no_distortion {
                    distortion = file.distortion().map_err(given_psfs::in_file(path))?;
                }
                (given(Arc::new(file.for_cameras().map_err(given_psfs::in_file(path))?)), None)
            }
            (None, None) => {
                let lens = request.lens.read(&context.assets)?.lens;
                let plan = psf.plan(&sensor, psf.scoring_pupil_cells)?.with_fields(psf.scoring_fields);
                // A picture is what a camera takes: even a lens without aberrations has its pupil.
                let plan = PsfPlan { perfect_image: PerfectImage::AiryDisk, ..plan };
                let (plan, error) = plan.converged(&lens, psf.scoring_pupil_error, context.cancel())?;
                if let Some((kind, text)) = coarse_pupil(&psf, plan.quadrature.cells, error) {
                    context.warning(kind, text);
                }
                let source = PsfSource::Traced { lens: Box::new(lens.clone()), plan: plan.clone() };
                (source, Some((lens, plan)))
            }
        };
        let psfs = Arc::new(source.psfs()?);
        let captured = psfs.captured_range().unwrap_or([1.0; 2]);
        report_light(request, &psf, captured, traced.as_ref().map(|(lens, _)| lens), context)?;
        let (geometry, blend) =
            with_patches_for(&coarse, psfs.bank(), psf.scoring_blend_error).map_err(DesignError::from)?;
        if let Some((kind, text)) = coarse_patches(&psf, &geometry, &blend) {
            context.warning(kind, text);
        }
        let border = kernel_radius(&geometry, &psfs.bank().layout()).map_err(DesignError::from)?;
        if let Some((lens, plan)) = traced.as_ref().filter(|_| !request.no_distortion) {
            distortion = Some(plan.distortion(lens)?);
        }
        let frame = match &distortion {
            Some(distortion) => distortion.ideal_frame(&geometry).map_err(DesignError::from)?,
            None => (sensor.height, sensor.width),
        };
        let frame = (frame.0 * samples, frame.1 * samples);
        if frame.0.saturating_mul(frame.1) > MOST_PIXELS {
            return Err(JobError::input(
                format!(
                    "this lens projects a scene of {} x {} samples onto {}",
                    frame.1, frame.0, request.sensor
                ),
                format!(
                    "a scene may have {MOST_PIXELS}: leave distortion out, or take fewer samples a pixel"
                ),
            ));
        }
        let isp = isp_of(request);
        let rig = Self { geometry, sensor, window, distortion, samples, frame, isp, chip, traced };
        Ok((rig, Turned { psfs, border }))
    }

    /// A camera with a sensor, without its optics, at the exposure of the request where white gives `white_e` electrons.
    pub fn body(&self, request: &Request, sensor: SensorModel, white_e: f32, isp: LinearIsp) -> Body {
        let exposure = Exposure { white_e, time_s: request.time_s, linear_gain: request.gain };
        let (geometry, device) = (self.geometry.clone(), Device::flex());
        let restoration = request.restore.as_ref().map(|restore| restore.filter(&sensor, &exposure));
        Body {
            sensor,
            geometry,
            exposure,
            truth_exposure: exposure,
            same_time: None,
            isp,
            restoration,
            chip: None,
            device,
        }
    }
}

impl Turned {
    /// A camera of a body with these PSFs.
    pub fn camera(&self, body: Body) -> Result<Camera, DesignError> {
        Camera::new(Arc::new(body), self.psfs.clone())
    }

    /// The light of a picture of [`Rig::frame`] on the pixels of the window.
    pub fn light(
        &self,
        rig: &Rig,
        picture: &LinearImage,
        cancel: &Cancel,
    ) -> Result<LinearImage, DesignError> {
        let (bank, distortion) = (self.psfs.bank(), rig.distortion.as_ref());
        Ok(light_on_pixels(&rig.geometry, bank, picture, distortion, &rig.window, rig.samples, cancel)?)
    }

    /// A picture of [`Rig::frame`], of one sample a pixel, as a shot of the window.
    pub fn shot(&self, rig: &Rig, picture: &LinearImage, frame: u64) -> Result<Shot, DesignError> {
        self.shot_of(rig, picture, &rig.window, frame)
    }

    /// The same of another window of the sensor.
    pub fn shot_of(
        &self,
        rig: &Rig,
        picture: &LinearImage,
        window: &Window,
        frame: u64,
    ) -> Result<Shot, DesignError> {
        let scene = match &rig.distortion {
            Some(distortion) => distortion.project(&rig.geometry, picture, window, self.border)?,
            None => window.scene(picture, self.border),
        };
        Ok(Shot {
            scene,
            placement: window.placement,
            kept: None,
            frame,
            labels: Labels::default(),
            follows_light: true,
        })
    }
}

/// Ends a cancelled job between two pictures; those that were taken before stay.
pub fn check_not_stopped(taken: usize, request: &Request, context: &Context) -> Result<()> {
    context.check(|| format!("stopped after {taken} of {} pictures", request.images.len()))
}

/// Refuses numbers outside their ranges.
pub fn check_numbers(request: &Request) -> Result<()> {
    check_ranges(request)?;
    check_ranges(&request.spectral)?;
    let Some(restore) = &request.restore else { return Ok(()) };
    check_ranges(restore).map_err(|error| match error {
        // The noise is the value of the option.
        JobError::Setting { value, message, hint, .. } => {
            JobError::Setting { key: "restore", value, message, hint }
        }
        other => other,
    })
}

/// The pixels that are read: all, or those of --size in the middle.
fn window(request: &Request, sensor: &SensorModel) -> Result<Window> {
    let whole = (sensor.height, sensor.width);
    let (height, width) = request.size.unwrap_or(whole);
    let tile = (sensor.cfa.rows(), sensor.cfa.cols());
    let is_too_small = height < tile.0.max(2) || width < tile.1.max(2);
    Window::middle(whole, tile, height, width).filter(|_| !is_too_small).ok_or_else(|| {
        JobError::input(
            format!("--size {height}x{width}: no part of the sensor that can be developed"),
            format!("rows x columns, from a tile of the filter array to {}x{}", whole.0, whole.1),
        )
    })
}

/// Takes and develops one dark tile of the filter array, so that settings which the sensor refuses are refused before a lens is
/// traced and a folder is made.
fn rehearse(request: &Request, sensor: &SensorModel) -> Result<()> {
    let side = |tile: usize, whole: usize| tile.max(2).min(whole);
    let (height, width) = (side(sensor.cfa.rows(), sensor.height), side(sensor.cfa.cols(), sensor.width));
    let exposure = Exposure { white_e: 1.0, time_s: request.time_s, linear_gain: request.gain };
    let capture = Capture { exposure, placement: Placement { row: 0, col: 0 }, frame: 0 };
    let dark = LinearImage::zeros(CHANNELS, height, width);
    let raw = expose(&dark, sensor, &capture, &Noise { mode: NoiseMode::Off, seed: 0 })
        .map_err(DesignError::from)?;
    develop(&raw, sensor).map_err(DesignError::from)?;
    capacity_e(request, sensor).map(|_| ())
}
