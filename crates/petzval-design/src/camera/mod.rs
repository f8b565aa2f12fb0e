//! The camera: lens, PSFs, sensor, exposure, development and network as one immutable value.
//!
//! Every verb that takes a picture goes through [`Camera::take`], so that a network trains on the pictures that
//! `simulate` makes. A camera changes by making another: [`Setup`](crate::setup::Setup) makes one from a lens,
//! [`Camera::with_network`] puts a network behind it.

mod chip;
mod host;
pub mod isp_proxy;
mod labels;
pub mod optics_proxy;
mod psf_source;

use std::any::Any;
use std::sync::{Arc, OnceLock};

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::develop::{LinearIsp, stabilised_noise};
use petzval_camera::image::LinearImage;
use petzval_camera::psf::PsfBank;
use petzval_camera::render::{
    KNOTS, PatchKernels, Placement, RenderGeometry, Wiener, Window, kernel_radius, patch_kernels,
};
use petzval_camera::sensor::{Capture, Exposure, Noise, Raw, SensorModel};
use petzval_camera::tape::{
    Frames, PlacedScene, Restoration, expose_op, field_map, illumination_op, linear_isp_op, on_device,
    render_op, restore_op, srgb_encode_op,
};
use petzval_learn::dataset::CropPlan;
use petzval_learn::network::{NetworkInput, PictureNetwork};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::image_brightness;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result};
use crate::experiment::DetectorInput;

pub use chip::{Chip, ChipValues, ideal_input, raw_inputs};

pub use host::{host_image, to_host, within_range};
pub use labels::Labels;
pub use psf_source::{ByLens, PsfSource, Psfs};

/// Most values of the kernels of a camera that are kept: 64 MB.
const MOST_KERNEL_VALUES: usize = 16_000_000;

/// One window of a photograph at a place of the sensor, taken as one frame.
#[derive(Clone, Debug)]
pub struct Shot {
    /// The scene: the pixels that are exposed, and around them the border that the PSF reaches into; linear light.
    pub scene: LinearImage,
    /// Sensor position of the first exposed pixel.
    pub placement: Placement,
    /// The window of which frames are kept; none keeps all that is exposed. Development reads pixels around it.
    pub kept: Option<Window>,
    /// Number of the frame; it keys the noise.
    pub frame: u64,
    /// What the task knows of the window that is kept.
    pub labels: Labels,
    /// With [`SameTime`]: true if the exposure time is fixed; false if auto-exposure compensates the lens's brightness.
    pub follows_light: bool,
}

/// Cameras that are exposed for the same time, so that a lens which gathers more light gives more electrons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SameTime {
    /// Electrons of white behind a lens of that brightness.
    pub white_e: f32,
    /// Brightness of the image of a lens, see [`image_brightness`].
    pub brightness: f64,
    /// Whether a digital gain makes pictures as bright as behind that lens, so that more light shows as less noise alone; if not, they are
    /// brighter.
    pub is_normalised: bool,
}

/// Everything of a camera except its optics and its network.
#[derive(Clone)]
pub struct Body {
    /// The sensor.
    pub sensor: SensorModel,
    /// Sensor grid, and patches of constant PSF.
    pub geometry: RenderGeometry,
    /// Exposure of every frame.
    pub exposure: Exposure,
    /// Exposure of the frames that truths behind a hardware ISP are developed from. It stays where [`Body::exposure`] moves: a picture must not
    /// come nearer to its truth because both saturate.
    pub truth_exposure: Exposure,
    /// How the electrons follow the light of the lens; none where the time does, and every camera has the same electrons.
    pub same_time: Option<SameTime>,
    /// Development.
    pub isp: LinearIsp,
    /// Restoration of developed pictures with the PSFs of the camera; none leaves their blur.
    pub restoration: Option<Wiener>,
    /// A hardware ISP that makes the finished pictures in place of restoration and network.
    pub chip: Option<Chip>,
    /// Where the tensors live, with automatic differentiation if gradients are needed.
    pub device: Device,
}

/// How far the PSFs of a camera are from exact ones: sums of absolute differences, of PSFs of unit sum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PsfErrors {
    /// By the pupil cells: the largest over fields and colours.
    pub pupil: f64,
    /// By the blend between patches: the median over places of the sensor.
    pub blend: f64,
}

/// PSFs, and the kernels of all patches of a sensor that are made of them when the first picture needs them.
#[derive(Clone)]
struct Optics {
    psfs: Arc<Psfs>,
    kernels: Arc<OnceLock<Option<Arc<PatchKernels>>>>,
}

/// A camera.
#[derive(Clone)]
pub struct Camera {
    body: Arc<Body>,
    /// What forms its images.
    optics: Optics,
    /// What development takes its optics for, in a camera that was made and not calibrated; none where it knows them.
    taken_for: Option<Optics>,
    /// Brightness of the image, in units of that of [`SameTime`]; 1 without it.
    light: f64,
    border: usize,
    /// What finishes its pictures.
    network: Option<Arc<dyn PictureNetwork>>,
    /// What looks at its finished pictures, of the type that its task gave it.
    reader: Option<Arc<dyn Any + Send + Sync>>,
    /// What the reader sees.
    sees: DetectorInput,
    chip: Option<ChipValues>,
    psf_errors: Option<PsfErrors>,
}

impl Optics {
    fn leaves(&self, device: &Device) -> PsfLeaves {
        PsfLeaves::new(self.psfs.bank(), device)
    }

    /// The kernels of all patches, which reach as far as `border` pixels; none where they would be too large to keep.
    fn kernels(&self, geometry: &RenderGeometry, border: usize) -> Result<Option<Arc<PatchKernels>>> {
        if let Some(kernels) = self.kernels.get() {
            return Ok(kernels.clone());
        }
        let bank = self.psfs.bank();
        let values = geometry.patch_count() * 3 * (2 * border + 1).pow(2);
        let kernels = if values <= MOST_KERNEL_VALUES {
            let all = vec![true; geometry.patch_count()];
            Some(Arc::new(patch_kernels(geometry, &bank.layout(), &bank.values, &all)?))
        } else {
            None
        };
        Ok(self.kernels.get_or_init(|| kernels).clone())
    }
}

/// All exposed pixels of a shot up to their development, before anything finishes it.
pub struct Developed {
    /// Digital numbers of the mosaic.
    pub raw: Raw,
    /// Relative illumination of the pixels that development corrects for, three planes.
    pub illumination: LinearImage,
    /// Linear light, three planes, 1 = white.
    pub picture: LinearImage,
}

/// What a camera makes of raw frames.
struct Processed {
    /// Linear light, `[batch, 3, height, width]`.
    developed: Tensor<4>,
    /// The same with the blur of the lens divided out, where the camera does.
    restored: Option<Tensor<4>>,
    /// The picture, sRGB-encoded.
    finished: Tensor<4>,
}

/// The PSFs of a camera as tensors that the frames depend on.
pub struct PsfLeaves {
    /// `[field, channel, row, column]`.
    pub values: Tensor<4>,
    /// Relative illumination, `[field, channel]`.
    pub illumination: Tensor<2>,
    /// Image radius of each field, mm.
    pub radius_mm: Tensor<1>,
    /// Brightness of the image in units of itself, `[1]`: its gradient is that by the logarithm of [`image_brightness`]. Frames depend on it
    /// where cameras have the [`SameTime`].
    pub light: Tensor<1>,
}

/// The PSFs of a camera as tensors: those that form its images, and those by which development corrects where it takes them for others.
pub struct OpticsLeaves {
    /// Those that form the images.
    pub own: PsfLeaves,
    /// Those for which development takes them; none where it knows them.
    pub taken_for: Option<PsfLeaves>,
}

impl PsfLeaves {
    pub(crate) fn new(bank: &PsfBank, device: &Device) -> Self {
        let (fields, grid) = (bank.field_radius_mm.len(), bank.grid);
        let values = TensorData::new(bank.values.clone(), [fields, 3, grid, grid]);
        let illumination = TensorData::new(bank.illumination.clone(), [fields, 3]);
        let radius_mm: Vec<f32> = bank.field_radius_mm.iter().map(|r| *r as f32).collect();
        Self {
            values: Tensor::from_data(values, device),
            illumination: Tensor::from_data(illumination, device),
            radius_mm: Tensor::from_data(TensorData::new(radius_mm, [fields]), device),
            light: Tensor::ones([1], device),
        }
    }

    pub(crate) fn tracked(self) -> Self {
        Self {
            values: self.values.require_grad(),
            illumination: self.illumination.require_grad(),
            radius_mm: self.radius_mm.require_grad(),
            light: self.light.require_grad(),
        }
    }
}

impl Camera {
    /// A camera without a network.
    pub fn new(body: Arc<Body>, psfs: Arc<Psfs>) -> Result<Self> {
        let border = kernel_radius(&body.geometry, &psfs.bank().layout())?;
        let optics = Optics { psfs, kernels: Arc::default() };
        let camera = Self {
            body,
            optics,
            taken_for: None,
            light: 1.0,
            border,
            network: None,
            reader: None,
            sees: DetectorInput::Picture,
            chip: None,
            psf_errors: None,
        };
        let Some(same) = camera.body.same_time else { return Ok(camera) };
        let lens = camera.psfs().lens().ok_or(DesignError::NoLens)?;
        let light = image_brightness(&lens.at_wavelength(lens.reference_um)) / same.brightness;
        let white_e = same.white_e * if same.is_normalised { light as f32 } else { 1.0 };
        let exposed = camera.with_exposure(Exposure { white_e, ..camera.body.exposure });
        Ok(Self { light, ..exposed })
    }

    /// The same camera with another lens, whose PSFs are traced as those of this one; how exact they are is not known.
    pub fn with_lens(&self, lens: Lens) -> Result<Self> {
        let plan = self.psfs().plan().ok_or(DesignError::NoLens)?.clone();
        let psfs = PsfSource::Traced { lens: Box::new(lens), plan }.psfs()?;
        let bare = Self::new(self.body.clone(), Arc::new(psfs))?;
        let (network, reader, chip) = (self.network.clone(), self.reader.clone(), self.chip.clone());
        Ok(Self { network, reader, sees: self.sees, chip, ..bare })
    }

    /// The same camera as it was made from a design with a lens that is off, and not calibrated: development corrects shading and blur by the
    /// lens of the design. Its exposure is metered, so that brightness follows the lens that it has.
    pub fn taken_for(&self, design: &Self) -> Self {
        Self { taken_for: Some(design.known().clone()), ..self.clone() }
    }

    /// The optics by which development corrects.
    fn known(&self) -> &Optics {
        self.taken_for.as_ref().unwrap_or(&self.optics)
    }

    /// The same camera, whose PSFs are known to have these errors.
    pub fn with_psf_errors(self, errors: PsfErrors) -> Self {
        Self { psf_errors: Some(errors), ..self }
    }

    /// The same camera at another exposure.
    pub fn with_exposure(&self, exposure: Exposure) -> Self {
        let mut body = Body { exposure, ..(*self.body).clone() };
        // The regularisation follows the noise.
        body.restoration = body.restoration.map(|_| Wiener::of_exposure(&body.sensor, &exposure));
        Self { body: Arc::new(body), ..self.clone() }
    }

    /// The same camera, exposed for another time and with another gain in the same light. `exposure` is stated as that of the experiment is;
    /// behind a lens that gathers more light in the same time, white has as many more electrons.
    pub fn exposed_as(&self, exposure: &Exposure) -> Self {
        let own = self.body.exposure;
        if (exposure.time_s, exposure.linear_gain) == (own.time_s, own.linear_gain) {
            return self.clone();
        }
        let Some(same) = self.body.same_time else { return self.with_exposure(*exposure) };
        let white_e = own.white_e * (exposure.white_e / same.white_e);
        let exposed = self.with_exposure(Exposure { white_e, ..*exposure });
        let same_time = Some(SameTime { white_e: exposure.white_e, ..same });
        let body = Body { same_time, ..(*exposed.body).clone() };
        Self { body: Arc::new(body), ..exposed }
    }

    /// Brightness of the image, in units of that of [`SameTime`]; 1 where every camera has the same electrons.
    pub fn light(&self) -> f64 {
        self.light
    }

    /// The errors of the PSFs, if they were measured.
    pub fn psf_errors(&self) -> Option<PsfErrors> {
        self.psf_errors
    }

    /// The same camera with a network behind the development.
    pub fn with_network(&self, network: Arc<dyn PictureNetwork>) -> Self {
        Self { network: Some(network), ..self.clone() }
    }

    /// The same camera with something that looks at this input.
    pub fn with_reader<R: Any + Send + Sync>(&self, reader: R, sees: DetectorInput) -> Self {
        Self { reader: Some(Arc::new(reader)), sees, ..self.clone() }
    }

    /// What looks at its finished pictures, if it is of this type.
    pub fn reader<R: Any>(&self) -> Option<&R> {
        self.reader.as_ref()?.downcast_ref()
    }

    /// The same camera with other values of its hardware ISP.
    pub fn with_chip(&self, values: ChipValues) -> Self {
        Self { chip: Some(values), ..self.clone() }
    }

    /// Whether finished pictures have a gradient by the PSFs: behind a hardware ISP that runs as the chip does they have none.
    pub fn has_gradient(&self) -> bool {
        !matches!(self.chip, Some(ChipValues::Exact(_)))
    }

    /// Sensor, exposure and device.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The PSFs, with what their gradient needs.
    pub fn psfs(&self) -> &Psfs {
        &self.optics.psfs
    }

    /// Pixels of scene that the PSF reaches into around a window.
    pub fn border(&self) -> usize {
        self.border
    }

    /// The same camera, whose kernels are still to be made.
    pub(crate) fn without_kernels(&self) -> Self {
        let anew = |optics: &Optics| Optics { psfs: optics.psfs.clone(), kernels: Arc::default() };
        Self { optics: anew(&self.optics), taken_for: self.taken_for.as_ref().map(anew), ..self.clone() }
    }

    /// Whether windows may be taken one by one from several threads, and are as they would be in a batch. That holds on the CPU alone. A network of a
    /// user sees a batch in one call, and the values of a hardware ISP can have a tape: with these the windows are taken together.
    pub(crate) fn takes_windows_alone(&self) -> bool {
        let is_ours = self.network.as_ref().is_none_or(|network| !network.takes_whole_batches());
        let is_held = match &self.chip {
            None | Some(ChipValues::Exact(_)) => true,
            Some(ChipValues::OnTape(values)) => !values.is_tracked(),
            Some(ChipValues::Imitated { .. }) => false,
        };
        is_ours && is_held && self.body.device.clone().without_autodiff() == Device::flex()
    }

    /// Makes the kernels of all patches, as far as they are kept, so that threads which take its pictures find them.
    pub(crate) fn make_kernels(&self) -> Result<()> {
        for optics in [&self.optics, self.known()] {
            optics.kernels(&self.body.geometry, self.border)?;
        }
        Ok(())
    }

    /// Takes a batch of shots of one size: light, raw frames, developed, restored and finished pictures.
    ///
    /// The graph of the frames leads to the weights of a network that is tracked, and no further.
    pub fn take(&self, shots: &[Shot], noise: &Noise) -> Result<Frames> {
        self.take_through(&self.leaves(|leaves| leaves), shots, noise)
    }

    /// The PSFs as leaf tensors of a new tape.
    pub(crate) fn tracked_leaves(&self) -> OpticsLeaves {
        self.leaves(PsfLeaves::tracked)
    }

    /// The PSFs as tensors, as `made` makes them of those that are not tracked.
    fn leaves(&self, made: impl Fn(PsfLeaves) -> PsfLeaves) -> OpticsLeaves {
        let of = |optics: &Optics| made(optics.leaves(&self.body.device));
        OpticsLeaves { own: of(&self.optics), taken_for: self.taken_for.as_ref().map(of) }
    }

    /// The PSFs for which development takes those of the camera; none where it knows them.
    pub fn psfs_taken_for(&self) -> Option<&Psfs> {
        self.taken_for.as_ref().map(|optics| &*optics.psfs)
    }

    /// [`Camera::take`] with a graph that leads to these leaves.
    pub(crate) fn take_through(
        &self,
        leaves: &OpticsLeaves,
        shots: &[Shot],
        noise: &Noise,
    ) -> Result<Frames> {
        let (known, light) = self.light_of(leaves, shots)?;
        let captures: Vec<Capture> = shots.iter().map(|s| self.capture(s)).collect();
        let kept: Vec<Window> = shots.iter().map(|s| self.kept(s)).collect();
        let frames = self.expose(known, light, &captures, &kept, noise)?;
        // The picture is thrown away where the detector does not see it: simple, and no slower than the other cameras.
        Ok(match self.sees {
            DetectorInput::Picture => frames,
            DetectorInput::Truth => Frames { finished: self.truths(shots)?, ..frames },
        })
    }

    /// Takes one shot, and develops it, whatever finishes the pictures of this camera.
    pub fn developed(&self, shot: &Shot, noise: &Noise) -> Result<Developed> {
        let (leaves, shots) = (self.leaves(|leaves| leaves), std::slice::from_ref(shot));
        let (_, [irradiance, illumination]) = self.light_of(&leaves, shots)?;
        let (capture, Body { sensor, isp, .. }) = (self.capture(shot), &*self.body);
        let raw = expose_op(irradiance, sensor, &[capture], noise)?;
        let [_, _, height, width] = raw.dims();
        let raw = Raw { height, width, dn: to_host(raw)?, capture };
        let illumination = host_image(illumination)?;
        let picture = isp.develop(&raw, &illumination, sensor)?;
        Ok(Developed { raw, illumination, picture })
    }

    /// The light of shots on the pixels and the relative illumination that development corrects, with the PSFs that it knows.
    fn light_of<'a>(
        &self,
        leaves: &'a OpticsLeaves,
        shots: &[Shot],
    ) -> Result<(&'a PsfLeaves, [Tensor<4>; 2])> {
        // The lens spreads every point by the PSF of its place and dims it off the axis.
        let (irradiance, own_illumination) = self.image(&leaves.own, shots)?;
        // Development knows the lens, or takes it for another.
        let (known, illumination) = match (&self.taken_for, &leaves.taken_for) {
            (Some(optics), Some(psfs)) => {
                let placements: Vec<Placement> = shots.iter().map(|s| s.placement).collect();
                let illumination = self.illumination(optics, psfs, &placements, self.exposed(shots))?;
                (psfs, self.calibrated(illumination, self.gathered(&leaves.own, shots)))
            }
            _ => (&leaves.own, own_illumination),
        };
        Ok((known, [irradiance, illumination]))
    }

    /// Takes one frame of light that lies on the pixels already, such as light that was simulated over the spectrum; three
    /// planes, 1 = white on the axis.
    pub fn take_light(&self, light: &LinearImage, capture: Capture, noise: &Noise) -> Result<Frames> {
        let LinearImage { height, width, .. } = *light;
        let device = &self.body.device;
        let psfs = self.known().leaves(device);
        let illumination = self.illumination(self.known(), &psfs, &[capture.placement], [height, width])?;
        let kept = Window { placement: capture.placement, height, width };
        let light = [on_device(light, device), illumination];
        self.expose(&psfs, light, &[capture], &[kept], noise)
    }

    /// From light on the pixels to finished pictures of the windows that are kept.
    pub(crate) fn expose(
        &self,
        psfs: &PsfLeaves,
        [irradiance, illumination]: [Tensor<4>; 2],
        captures: &[Capture],
        kept: &[Window],
        noise: &Noise,
    ) -> Result<Frames> {
        // The sensor turns light into digital numbers behind its colour filters.
        let raw = expose_op(irradiance.clone(), &self.body.sensor, captures, noise)?;
        let Processed { developed, restored, finished } =
            self.process(psfs, &raw, &illumination, captures, kept)?;
        let cut = |frames: Tensor<4>| cut(frames, captures, kept);
        let (irradiance, illumination, raw) = (cut(irradiance), cut(illumination), cut(raw));
        Ok(Frames { irradiance, illumination, raw, developed, restored, finished })
    }

    /// The finished picture of one shot, sRGB-encoded, 0 to 1.
    pub fn finished(&self, shot: Shot, noise: &Noise) -> Result<LinearImage> {
        host_image(within_range(self.take(&[shot], noise)?.finished)?)
    }

    /// The finished picture of a raw frame of the whole sensor or a window of it, sRGB-encoded, 0 to 1: digital numbers row by row, as
    /// this camera or a real one with the same sensor and lens took them. The exposure of `capture` says what is white.
    pub fn finished_raw(
        &self,
        dn: Vec<f32>,
        [height, width]: [usize; 2],
        capture: Capture,
    ) -> Result<LinearImage> {
        self.check_sees_frames()?;
        let device = &self.body.device;
        let psfs = self.known().leaves(device);
        let illumination = self.illumination(self.known(), &psfs, &[capture.placement], [height, width])?;
        let raw = Tensor::from_data(TensorData::new(dn, [1, 1, height, width]), device);
        let whole = Window { placement: capture.placement, height, width };
        let finished = self.process(&psfs, &raw, &illumination, &[capture], &[whole])?.finished;
        host_image(within_range(finished)?)
    }

    /// Refuses a camera whose reader sees the truth, which a raw frame does not contain.
    pub fn check_sees_frames(&self) -> Result<()> {
        match self.sees {
            DetectorInput::Picture => Ok(()),
            DetectorInput::Truth => Err(DesignError::NoTruth),
        }
    }

    /// From raw frames to finished pictures of the windows that are kept.
    fn process(
        &self,
        psfs: &PsfLeaves,
        raw: &Tensor<4>,
        illumination: &Tensor<4>,
        captures: &[Capture],
        kept: &[Window],
    ) -> Result<Processed> {
        // Development turns them back into light, balances white and lifts the dim corners.
        let developed = self.develop(raw.clone(), illumination.clone(), captures)?;
        // Restoration divides out the blur of the PSFs: those of the lens, or of the design that stands for a made camera.
        let restored = self.restore(psfs, developed.clone(), captures)?;
        // A hardware ISP makes its picture of the raw frame.
        let by_chip = self.by_chip(raw, illumination, captures)?;
        // Pixels around the windows have served their neighbours.
        let cut = |frames: Tensor<4>| cut(frames, captures, kept);
        let (developed, restored) = (cut(developed), restored.map(cut));
        // The network finishes what a display would show.
        let finished = match by_chip {
            Some(picture) => cut(picture),
            None => self.finish(developed.clone(), restored.clone(), kept)?,
        };
        Ok(Processed { developed, restored, finished })
    }

    /// Irradiance and relative illumination of a batch of shots.
    pub(crate) fn image(&self, psfs: &PsfLeaves, shots: &[Shot]) -> Result<(Tensor<4>, Tensor<4>)> {
        let (layout, geometry) = (self.psfs().bank().layout(), &self.body.geometry);
        let [height, width] = self.exposed(shots);
        let scenes =
            shots.iter().map(|s| PlacedScene { scene: s.scene.clone(), placement: s.placement }).collect();
        let placements: Vec<Placement> = shots.iter().map(|s| s.placement).collect();
        let (values, radius_mm) = (psfs.values.clone(), psfs.radius_mm.clone());
        let kernels = self.optics.kernels(geometry, self.border)?;
        let blurred = render_op(values, radius_mm, &layout, geometry, kernels, scenes)?;
        let illumination = self.illumination(&self.optics, psfs, &placements, [height, width])?;
        let irradiance = blurred * illumination.clone();
        let Some(light) = self.gathered(psfs, shots) else { return Ok((irradiance, illumination)) };
        Ok((irradiance * light.clone(), self.calibrated(illumination, Some(light))))
    }

    /// The light of each frame in units of itself, `[batch, 1, 1, 1]`, where cameras have the same time: a lens that moves changes that of all
    /// pixels. None where every camera has the same electrons.
    fn gathered(&self, psfs: &PsfLeaves, shots: &[Shot]) -> Option<Tensor<4>> {
        self.body.same_time?;
        let follows: Vec<f32> = shots.iter().map(|s| f32::from(u8::from(s.follows_light))).collect();
        let follows = TensorData::new(follows, [shots.len(), 1, 1, 1]);
        let follows: Tensor<4> = Tensor::from_data(follows, &self.body.device);
        Some((psfs.light.clone() - 1.0).reshape([1, 1, 1, 1]) * follows + 1.0)
    }

    /// The relative illumination by which development divides: with the light that a lens gathers if it normalises by that.
    fn calibrated(&self, illumination: Tensor<4>, light: Option<Tensor<4>>) -> Tensor<4> {
        match light.filter(|_| self.body.same_time.is_some_and(|same| same.is_normalised)) {
            Some(light) => illumination * light,
            None => illumination,
        }
    }

    /// Relative illumination of the pixels of windows, by the optics whose PSFs these are.
    fn illumination(
        &self,
        optics: &Optics,
        psfs: &PsfLeaves,
        placements: &[Placement],
        [height, width]: [usize; 2],
    ) -> Result<Tensor<4>> {
        let (layout, geometry) = (optics.psfs.bank().layout(), &self.body.geometry);
        let (table, radius_mm) = (psfs.illumination.clone(), psfs.radius_mm.clone());
        Ok(illumination_op(table, radius_mm, &layout, geometry, placements, height, width)?)
    }

    /// Develops raw frames `[batch, 1, height, width]` to linear light `[batch, 3, height, width]`.
    ///
    /// The shading is corrected by `illumination`, that of the lens itself in a calibrated camera. The gradient includes both: the light that the
    /// lens loses, and the gain that makes up for it.
    pub fn develop(
        &self,
        raw: Tensor<4>,
        illumination: Tensor<4>,
        captures: &[Capture],
    ) -> Result<Tensor<4>> {
        Ok(linear_isp_op(raw, illumination, &self.body.isp, &self.body.sensor, captures)?)
    }

    /// Takes the blur of the lens out of developed pictures, if the body restores: by the filters of the PSFs, regularised by the curves
    /// that the network was trained with. The gradient by the PSFs is that of the filters; a lens that moves is filtered otherwise.
    pub(crate) fn restore(
        &self,
        psfs: &PsfLeaves,
        developed: Tensor<4>,
        captures: &[Capture],
    ) -> Result<Option<Tensor<4>>> {
        let Some(wiener) = self.body.restoration else { return Ok(None) };
        let fixed = || {
            let curves = TensorData::new(wiener.curves.as_flattened().to_vec(), [3, KNOTS]);
            Tensor::from_data(curves, &self.body.device)
        };
        let curves = self.network.as_ref().and_then(|n| n.curves()).unwrap_or_else(fixed);
        let known = self.known();
        let restoration = Restoration {
            wiener,
            layout: known.psfs.bank().layout(),
            geometry: self.body.geometry.clone(),
            ready: known.kernels(&self.body.geometry, self.border)?,
            placements: captures.iter().map(|c| c.placement).collect(),
        };
        let (values, radius_mm) = (psfs.values.clone(), psfs.radius_mm.clone());
        Ok(Some(restore_op(developed, values, radius_mm, curves, restoration)?))
    }

    /// What the network makes of the pictures of windows, sRGB-encoded; without a network, the pictures encoded.
    pub(crate) fn finish(
        &self,
        developed: Tensor<4>,
        restored: Option<Tensor<4>>,
        windows: &[Window],
    ) -> Result<Tensor<4>> {
        let [.., height, width] = developed.dims();
        let body = &self.body;
        let Some(network) = &self.network else { return Ok(srgb_encode_op(restored.unwrap_or(developed))) };
        let placements: Vec<Placement> = windows.iter().map(|w| w.placement).collect();
        let field = field_map(&body.geometry, &placements, [height, width], &body.device)?;
        let noise = field.zeros_like() + stabilised_noise(&body.sensor, &body.exposure);
        let encoded = srgb_encode_op(developed);
        let restored = restored.map(srgb_encode_op);
        let finished = network.finish_in_tiles(&NetworkInput { developed: encoded, restored, field, noise });
        network.check()?;
        Ok(finished)
    }

    /// What the hardware ISP makes of raw frames, if the body has one: in whole numbers unless its values are on the tape.
    fn by_chip(
        &self,
        raw: &Tensor<4>,
        illumination: &Tensor<4>,
        captures: &[Capture],
    ) -> Result<Option<Tensor<4>>> {
        let Some(chip) = &self.body.chip else { return Ok(None) };
        let inputs = raw_inputs(raw, illumination, captures, &self.body.sensor)?;
        let values = self.chip.clone().unwrap_or_else(|| ChipValues::Exact(chip.values().to_vec()));
        Ok(Some(chip::develop(chip, &values, raw.clone(), illumination, &inputs)?))
    }

    /// What finished pictures should be, `[batch, 3, height, width]`, sRGB-encoded: the scenes themselves; behind a hardware ISP what it
    /// makes of them, with its own values, through perfect optics and without noise.
    pub fn truths(&self, shots: &[Shot]) -> Result<Tensor<4>> {
        let device = &self.body.device;
        let Some(chip) = &self.body.chip else { return Ok(encoded(&self.scenes(shots)?, device)) };
        // As the frames: developed with what is exposed around the windows.
        let size @ [height, width] = self.exposed(shots);
        let ideal = |shot: &Shot| {
            let scene = shot.scene.crop(self.border, self.border, height, width)?;
            let capture = Capture { exposure: self.body.truth_exposure, ..self.capture(shot) };
            ideal_input(&scene, &capture, &self.body.sensor)
        };
        let inputs = shots.iter().map(ideal).collect::<Result<Vec<_>>>()?;
        let developed = chip::exact(chip, chip.values(), &inputs, size, device)?;
        let captures: Vec<Capture> = shots.iter().map(|s| self.capture(s)).collect();
        let kept: Vec<Window> = shots.iter().map(|s| self.kept(s)).collect();
        Ok(cut(developed, &captures, &kept))
    }

    /// The windows of the scenes that are kept, without what only PSFs and development need: what a perfect camera would take.
    pub fn scenes(&self, shots: &[Shot]) -> Result<Vec<LinearImage>> {
        let window = |shot: &Shot| {
            let kept = self.kept(shot);
            let (down, right) = inset(shot.placement, &kept);
            Ok(shot.scene.crop(self.border + down, self.border + right, kept.height, kept.width)?)
        };
        shots.iter().map(window).collect()
    }

    /// The window of which a shot's frames are kept.
    pub fn kept(&self, shot: &Shot) -> Window {
        let [height, width] = self.exposed(std::slice::from_ref(shot));
        shot.kept.unwrap_or(Window { placement: shot.placement, height, width })
    }

    /// Rows and columns that the shots expose.
    fn exposed(&self, shots: &[Shot]) -> [usize; 2] {
        let side = |whole: usize| whole.saturating_sub(2 * self.border);
        shots.first().map_or([0, 0], |s| [side(s.scene.height), side(s.scene.width)])
    }

    /// How a shot is captured.
    pub fn capture(&self, shot: &Shot) -> Capture {
        Capture { exposure: self.body.exposure, placement: shot.placement, frame: shot.frame }
    }
}

/// Scenes in linear light as a display shows them.
fn encoded(scenes: &[LinearImage], device: &Device) -> Tensor<4> {
    let [height, width] = scenes.first().map_or([0, 0], |s| [s.height, s.width]);
    let data: Vec<f32> = scenes.iter().flat_map(LinearImage::to_srgb).collect();
    Tensor::from_data(TensorData::new(data, [scenes.len(), 3, height, width]), device)
}

/// The window of the sensor that a crop covers.
pub fn crop_window(plan: &CropPlan, row: usize, col: usize) -> Window {
    Window { placement: Placement { row, col }, height: plan.crop, width: plan.crop }
}

/// Rows and columns from the first exposed pixel to the first that is kept.
fn inset(exposed: Placement, kept: &Window) -> (usize, usize) {
    (kept.placement.row - exposed.row, kept.placement.col - exposed.col)
}

/// The windows that are kept of exposed frames.
pub(crate) fn cut(frames: Tensor<4>, captures: &[Capture], kept: &[Window]) -> Tensor<4> {
    let [_, channels, height, width] = frames.dims();
    if kept.iter().all(|window| (window.height, window.width) == (height, width)) {
        return frames;
    }
    let windows = captures.iter().zip(kept).enumerate().map(|(i, (capture, window))| {
        let (down, right) = inset(capture.placement, window);
        frames.clone().slice([i..i + 1, 0..channels, down..down + window.height, right..right + window.width])
    });
    Tensor::cat(windows.collect(), 0)
}
