//! `camera-view`: a window of the sensor at one place of the image, developed, as values; quickly while a lens changes, and exactly.
//!
//! The exact picture is the one that `simulate` takes of light on the image plane: its PSFs are traced at as many fields, with as many rays and
//! blended between as many patches as a score needs. The quick one takes few fields, few rays and few patches. Behind a lens without rotational
//! symmetry each patch in the window has the PSF of its own place.

use std::path::Path;
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use petzval_camera::develop::{LinearIsp, saturated_share};
use petzval_camera::image::{CHANNELS, LinearImage, display_bytes, spread, srgb_decode};
use petzval_camera::isp::{Mesh, RawInput};
use petzval_camera::render::{Placement, RenderGeometry, Window, kernel_radius, with_patches_for};
use petzval_camera::sensor::{Capture, Colour, Exposure, Noise, Raw, SensorModel, expose};
use petzval_camera::spectral::{Illuminant, SceneKind, apply, d65_white, xyz_of_reflectance};
use petzval_design::camera::{Body, Camera, Developed, Labels, PsfSource, Psfs, Shot};
use petzval_design::error::DesignError;
use petzval_design::experiment::PsfConfig;
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_files::{Picture, load_image, load_image_bytes};
use petzval_learn::Device;
use petzval_optics::lens::Lens;
use petzval_optics::psf::PerfectImage;
use petzval_optics::pupil::chief_ray;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::accuracy::{coarse_patches, coarse_pupil};
use super::chip::{MESH, picture};
use super::highlights::{Saturation, default_white_e};
use super::patchwise;
use super::request::scene_name;
use super::shot::noise;
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::input::{LensInput, SensorInput};
use crate::lens::edit::{Edit, edited};
use crate::named_isp::isp_by_name;
use crate::range::check_ranges;
use crate::raw::mtf::{self, Edge, Region};

/// Fields and pupil cells a side of quick PSFs.
const QUICK_FIELDS: usize = 7;
const QUICK_CELLS: usize = 32;

/// Cells of quick PSFs are so many times as wide as exact ones, over the same area.
const QUICK_PITCH: f64 = 2.0;

/// Patches of quick PSFs, rows and columns.
const QUICK_PATCHES: (usize, usize) = (3, 5);

/// Rows of an array of pixels that is fitted to the image circle.
const ROWS: std::ops::RangeInclusive<f64> = 64.0..=4800.0;

/// The corner of an array that fits, as a share of the image circle's radius.
const FITS: std::ops::RangeInclusive<f64> = 0.85..=1.0;

petzval_base::parameters! {
    /// A camera, and the place of its image that is looked at.
    pub struct Request {
        /// Where: x and y from the upper left corner of the array, as shares of its width and height.
        at: Vec<f64> = vec![0.5, 0.5], "", 0..1, Linear, "0.5, 0.5 is the axis";
        /// Photoelectrons that white gives in a green pixel on the axis; 70 % of what saturates the first colour if left out.
        white_e: Option<f32> = None, "e-", 1e-3..1e7, Log, "a positive number of photoelectrons: 16000 is usual";
        /// Stops by which the picture is exposed more than `white_e` says.
        exposure_ev: f32 = 0.0, "stops", -16..8, Linear, "one stop is twice the light";
        /// Exposure time, s.
        time_s: f32 = 0.005, "s", 1e-9..1e4, Log, "5 ms is 0.005";
        /// Linear analogue gain.
        gain: f32 = 1.0, "", 1e-6..1e3, Log, "a positive number; 1 is the gain of the sensor file";
        /// Rows and columns that are developed; fewer where the array has no more.
        size: Vec<usize> = vec![512, 512], "pixels", 16..1024, Log, "512 x 512 are usual";
        /// Rows and columns of the array; those of the sensor's pixels that fill the image circle if left empty.
        array: Vec<usize> = Vec::new(), "pixels", 2..65536, Log, "those of an earlier response";
    }
    also {
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = LensInput::default();
        /// Changes of the lens that come first, in this order.
        edits: Vec<Edit> = Vec::new();
        /// Sensor: a built-in name, the path of a file, or the sensor itself.
        sensor: SensorInput = crate::usual::sensor().into();
        /// The scene: a built-in photograph, the path of a picture, or `scene:NAME`. One that is smaller than the array, and every built-in scene, lies
        /// at the place that is looked at; a larger one covers the array.
        photo: String = "scene:siemens-star".to_owned();
        /// Few fields, few rays, few patches, for a lens that is being dragged.
        quick: bool = false;
        /// Whether the raw frame is given as well.
        raw: bool = false;
        /// An ISP in place of linear development: the name of a preset, `neutral`, or a file of settings or of the description of an external ISP.
        isp: Option<String> = None;
        /// Further values of its parameters, each `stage.key=value`.
        set: Vec<String> = Vec::new();
        /// Regions of the window with one slanted edge each, whose MTF is measured in the developed picture, as `raw-mtf` measures it.
        edges: Vec<Region> = Vec::new();
        /// Leave out temporal noise; the fixed pattern (DSNU, PRNU, hot pixels) stays.
        no_noise: bool = false;
        /// Seed of the noise.
        seed: u64 = crate::usual::seed();
    }
}

/// A window of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// The developed picture: red, green and blue of each pixel, sRGB-encoded, 8 bits each, row by row, in base64.
    pub rgb: String,
    /// The raw frame between its black level and saturation, 8 bits a pixel, row by row, in base64.
    pub raw: Option<String>,
    /// Row and column of the first pixel in the array.
    pub placement: [usize; 2],
    /// Rows and columns of the array.
    pub array: [usize; 2],
    /// Whether the array is the sensor's; else its pixels in one that fits the image circle.
    pub is_own_array: bool,
    /// Pixel pitch, um.
    pub pixel_um: f64,
    /// Distance of the middle of the window from the axis, mm.
    pub image_radius_mm: f64,
    /// The same as a share of the radius to the array's corner.
    pub relative_radius: f64,
    /// Photoelectrons of white in a green pixel on the axis.
    pub white_e: f32,
    /// Share of the window's pixels that are saturated.
    pub saturated_share: f64,
    /// Signal to noise of a pixel of the raw frame at 18 % of white on the axis, dB; mean over the colours. Photons, dark current and reading count.
    pub gray_snr_db: f64,
    /// How the values of the window are spread.
    pub histogram: Histogram,
    /// Whether this is the quick picture.
    pub is_quick: bool,
    /// Fields at which PSFs were traced; places, behind a lens without rotational symmetry.
    pub psf_fields: usize,
    /// Pupil cells a side.
    pub pupil_cells: usize,
    /// Patches between which PSFs are blended, rows and columns.
    pub patches: [usize; 2],
    /// How many times the scene was enlarged; 1 if each of its pixels is one of the sensor.
    pub enlarged: f64,
    /// The edges in the regions of the request.
    #[serde(default)]
    pub edges: Vec<Edge>,
}

/// How the values of a window are spread, in [`BINS`] bins of equal width each.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Histogram {
    /// Pixels of the raw frame, from the black level to the largest number.
    pub raw: Vec<u32>,
    /// Pixels of the developed picture by colour, from black to white as they are encoded: red, green, blue.
    pub developed: Vec<Vec<u32>>,
}

/// Light of middle gray, of white.
const GRAY: f64 = 0.18;

/// Bins of a histogram.
pub const BINS: usize = 64;

/// A camera that is kept for further windows, with what the response says of its PSFs.
struct Kept {
    camera: Camera,
    fields: usize,
    cells: usize,
    /// What is to be said of its PSFs with each of its pictures.
    warnings: Vec<(WarningKind, String)>,
}

/// Takes and develops the window.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    if let (None, Some(set)) = (&request.isp, request.set.first()) {
        let message = "there is no ISP whose parameter it could be";
        return Err(JobError::setting("set", set, message, "name one as `isp`"));
    }
    let ([x, y], [rows, columns]) = (pair("at", &request.at)?, pair("size", &request.size)?);
    let lens = edited(&request.lens, &request.edits, context)?;
    let own = request.sensor.read(&context.assets)?;
    let sensor = arrayed(&own, &lens.file.lens, &request.array)?;
    let simulated = super::Request {
        white_e: request.white_e,
        time_s: request.time_s,
        gain: request.gain,
        no_noise: request.no_noise,
        seed: request.seed,
        ..super::Request::default()
    };
    let white_e = match request.white_e {
        Some(white_e) => white_e,
        None => default_white_e(&simulated, &sensor)?,
    };
    let white_e = white_e * request.exposure_ev.exp2();
    let exposure = Exposure { white_e, time_s: request.time_s, linear_gain: request.gain };
    let window = window_at([x, y], [rows, columns], &sensor);
    let behind = Behind { lens: &lens.file.lens, toml: &lens.toml, sensor: &sensor, exposure, window };
    let noise = noise(&simulated);
    let Looked { taken, geometry, fields, cells, enlarged } = if lens.file.lens.is_rotationally_symmetric() {
        behind.by_azimuth(request, &noise, context)?
    } else {
        behind.by_patch(request, &noise, context)?
    };
    let share = saturated_share(&taken.raw, &sensor);
    let display_white = Saturation::of(&simulated, &sensor, white_e, share)?.display_white();
    let rgb = match &request.isp {
        Some(name) => by_isp(name, &request.set, (&taken.raw, &taken.illumination), &sensor, context)?,
        None => display_bytes(&taken.picture, display_white),
    };
    let edges = edges(request, &taken.picture, &rgb, sensor.pixel_um, context)?;
    let raw = raw_bytes(&taken.raw, &sensor);
    let middle = [window.placement.row + window.height / 2, window.placement.col + window.width / 2];
    let image_radius_mm = geometry.radius_mm(middle[0], middle[1]);
    Ok(Response {
        height: window.height,
        width: window.width,
        histogram: Histogram { raw: spread(&raw, 1, BINS).concat(), developed: spread(&rgb, CHANNELS, BINS) },
        rgb: STANDARD.encode(rgb),
        raw: request.raw.then(|| STANDARD.encode(raw)),
        placement: [window.placement.row, window.placement.col],
        array: [sensor.height, sensor.width],
        is_own_array: [sensor.height, sensor.width] == [own.height, own.width],
        pixel_um: sensor.pixel_um,
        image_radius_mm,
        relative_radius: image_radius_mm / corner_mm(&sensor),
        white_e,
        saturated_share: share,
        gray_snr_db: 20.0 * signal_to_noise(&sensor, &exposure, GRAY).log10(),
        is_quick: request.quick,
        psf_fields: fields,
        pupil_cells: cells,
        patches: [geometry.patches.0, geometry.patches.1],
        enlarged,
        edges,
    })
}

/// A window that is looked at, and what is in front of it.
struct Behind<'a> {
    lens: &'a Lens,
    /// The text of the lens.
    toml: &'a str,
    sensor: &'a SensorModel,
    exposure: Exposure,
    window: Window,
}

/// The window as it was taken.
struct Looked {
    taken: Developed,
    geometry: RenderGeometry,
    fields: usize,
    cells: usize,
    enlarged: f64,
}

impl Behind<'_> {
    /// Through a lens with rotational symmetry: a camera turns the PSFs of one azimuth about the axis.
    fn by_azimuth(&self, request: &Request, noise: &Noise, context: &Context) -> Result<Looked> {
        let Self { lens, toml, sensor, exposure, window } = *self;
        // The camera is that of its lens, sensor and exposure; windows, scenes and noise share it.
        let key = format!("camera {} {exposure:?} {sensor:?} {toml}", request.quick);
        let kept = context.kept().get_or(&key, || {
            let psf = PsfConfig::default();
            if request.quick {
                quick_camera(&psf, lens, sensor, exposure)
            } else {
                exact_camera(&psf, lens, sensor, exposure, context)
            }
        })?;
        kept.warnings.iter().for_each(|(kind, text)| context.warning(*kind, text.clone()));
        let geometry = kept.camera.body().geometry.clone();
        let border =
            kernel_radius(&geometry, &kept.camera.psfs().bank().layout()).map_err(DesignError::from)?;
        let (scene, enlarged) = scene(&request.photo, &window, border, sensor, context)?;
        let shot = Shot {
            scene,
            placement: window.placement,
            kept: None,
            frame: 0,
            labels: Labels::default(),
            follows_light: true,
        };
        let taken = kept.camera.developed(&shot, noise)?;
        Ok(Looked { taken, geometry, fields: kept.fields, cells: kept.cells, enlarged })
    }

    /// Through any other lens: PSFs are those of the places of the patches in the window.
    fn by_patch(&self, request: &Request, noise: &Noise, context: &Context) -> Result<Looked> {
        let Self { lens, toml, sensor, exposure, window } = *self;
        let array = [sensor.height, sensor.width];
        let key = format!("patches {} {window:?} {array:?} {} {toml}", request.quick, sensor.pixel_um);
        let kept = context.kept().get_or(&key, || {
            let psf = PsfConfig::default();
            if request.quick {
                let psf = quick_psf(&psf);
                let plan = psf.plan(sensor, QUICK_CELLS)?;
                patchwise::Behind { lens, sensor, psf: &psf, plan, window }.quick(QUICK_PATCHES, context)
            } else {
                let plan = psf.plan(sensor, psf.scoring_pupil_cells)?;
                patchwise::Behind { lens, sensor, psf: &psf, plan, window }.exact(context)
            }
        })?;
        let lost = PsfConfig::default().lost_light(kept.captured[0], None);
        lost.into_iter().for_each(|text| context.warning(WarningKind::LostLight, text));
        kept.warnings.iter().for_each(|(kind, text)| context.warning(*kind, text.clone()));
        let (scene, enlarged) = scene(&request.photo, &window, kept.border(), sensor, context)?;
        let [light, illumination] = kept.light(&scene, context.cancel())?;
        let capture = Capture { exposure, placement: window.placement, frame: 0 };
        let raw = expose(&light, sensor, &capture, noise).map_err(DesignError::from)?;
        let picture = LinearIsp::default().develop(&raw, &illumination, sensor).map_err(DesignError::from)?;
        let taken = Developed { raw, illumination, picture };
        let (fields, cells) = (kept.places, kept.cells);
        Ok(Looked { taken, geometry: kept.geometry.clone(), fields, cells, enlarged })
    }
}

/// PSFs of fewer and wider cells, over the same area.
fn quick_psf(psf: &PsfConfig) -> PsfConfig {
    let grid = (psf.grid as f64 / QUICK_PITCH) as usize;
    PsfConfig { pitch_um: QUICK_PITCH * psf.pitch_um, grid, ..psf.clone() }
}

/// Two numbers.
fn pair<T: Copy + std::fmt::Debug>(key: &'static str, values: &[T]) -> Result<[T; 2]> {
    let wrong =
        |_| JobError::setting(key, format!("{values:?}"), "two numbers are needed", "give two numbers");
    values.try_into().map_err(wrong)
}

/// Half of the diagonal of a sensor, mm.
fn corner_mm(sensor: &SensorModel) -> f64 {
    0.5e-3 * sensor.pixel_um * (sensor.height as f64).hypot(sensor.width as f64)
}

/// The sensor, or its pixels in an array of the same shape whose corner lies at the edge of the image circle.
fn arrayed(sensor: &SensorModel, lens: &Lens, array: &[usize]) -> Result<SensorModel> {
    if !array.is_empty() {
        let [height, width] = pair("array", array)?;
        return Ok(SensorModel { height, width, ..sensor.clone() });
    }
    let full_rad = lens.outermost_field_deg().to_radians();
    let circle_mm = chief_ray(&lens.at_wavelength(lens.reference_um), full_rad).map_or(0.0, |c| c.y_mm.abs());
    let share = corner_mm(sensor) / circle_mm;
    if circle_mm == 0.0 || !share.is_finite() || FITS.contains(&share) {
        return Ok(sensor.clone());
    }
    // Whole tiles of the colour array, within the circle.
    let whole = |count: f64, tile: usize| ((count / tile as f64).floor() as usize).max(1) * tile;
    let rows = (sensor.height as f64 / share).clamp(*ROWS.start(), *ROWS.end());
    let columns = rows * sensor.width as f64 / sensor.height as f64;
    let (height, width) = (whole(rows, sensor.cfa.rows().max(2)), whole(columns, sensor.cfa.cols().max(2)));
    Ok(SensorModel { height, width, ..sensor.clone() })
}

/// The window whose middle is nearest to a place. It starts with a whole tile of the colour array.
fn window_at([x, y]: [f64; 2], [rows, columns]: [usize; 2], sensor: &SensorModel) -> Window {
    let along = |at: f64, part: usize, whole: usize, tile: usize| {
        let tile = tile.max(2);
        let part = part.min(whole) / tile * tile;
        let start = (at * whole as f64 - 0.5 * part as f64).max(0.0) as usize;
        (start.min(whole - part) / tile * tile, part)
    };
    let (row, height) = along(y, rows, sensor.height, sensor.cfa.rows());
    let (col, width) = along(x, columns, sensor.width, sensor.cfa.cols());
    Window { placement: Placement { row, col }, height, width }
}

/// The camera of few fields, rays and patches.
fn quick_camera(psf: &PsfConfig, lens: &Lens, sensor: &SensorModel, exposure: Exposure) -> Result<Kept> {
    let psf = quick_psf(psf);
    let plan = psf.plan(sensor, QUICK_CELLS)?.with_fields(QUICK_FIELDS);
    let plan = PsfPlan { perfect_image: PerfectImage::AiryDisk, ..plan };
    let geometry = RenderGeometry { patches: QUICK_PATCHES, ..psf.geometry(sensor) };
    let psfs = PsfSource::Traced { lens: Box::new(lens.clone()), plan }.psfs()?;
    let warnings = lost_light(&psf, &psfs).into_iter().collect();
    kept((psfs, geometry), sensor, exposure, (QUICK_FIELDS, QUICK_CELLS), warnings)
}

/// The camera as pictures are scored.
fn exact_camera(
    psf: &PsfConfig,
    lens: &Lens,
    sensor: &SensorModel,
    exposure: Exposure,
    context: &Context,
) -> Result<Kept> {
    let plan = psf.plan(sensor, psf.scoring_pupil_cells)?.with_fields(psf.scoring_fields);
    let plan = PsfPlan { perfect_image: PerfectImage::AiryDisk, ..plan };
    let (plan, error) = plan.converged(lens, psf.scoring_pupil_error, context.cancel())?;
    context.check(|| "stopped before the PSFs were traced")?;
    let sizes = (plan.field_radius_mm.len(), plan.quadrature.cells);
    let psfs = PsfSource::Traced { lens: Box::new(lens.clone()), plan }.psfs()?;
    let (geometry, blend) = with_patches_for(&psf.geometry(sensor), psfs.bank(), psf.scoring_blend_error)
        .map_err(DesignError::from)?;
    let of_psfs = [coarse_pupil(psf, sizes.1, error), coarse_patches(psf, &geometry, &blend)];
    let warnings = lost_light(psf, &psfs).into_iter().chain(of_psfs.into_iter().flatten()).collect();
    kept((psfs, geometry), sensor, exposure, sizes, warnings)
}

/// What to say of PSFs whose grid cuts off light.
fn lost_light(psf: &PsfConfig, psfs: &Psfs) -> Option<(WarningKind, String)> {
    let lost = psf.lost_light(psfs.captured()?, None)?;
    Some((WarningKind::LostLight, lost))
}

fn kept(
    (psfs, geometry): (Psfs, RenderGeometry),
    sensor: &SensorModel,
    exposure: Exposure,
    (fields, cells): (usize, usize),
    warnings: Vec<(WarningKind, String)>,
) -> Result<Kept> {
    let body = Body {
        sensor: sensor.clone(),
        geometry,
        exposure,
        truth_exposure: exposure,
        same_time: None,
        isp: LinearIsp::default(),
        restoration: None,
        chip: None,
        device: Device::flex(),
    };
    Ok(Kept { camera: Camera::new(Arc::new(body), Arc::new(psfs))?, fields, cells, warnings })
}

/// The light of a scene on a window and on the border that its PSFs reach into; and how many times the scene was enlarged.
fn scene(
    name: &str,
    window: &Window,
    border: usize,
    sensor: &SensorModel,
    context: &Context,
) -> Result<(LinearImage, f64)> {
    let (height, width) = (window.height + 2 * border, window.width + 2 * border);
    if let Some(scene) = scene_name(Path::new(name)) {
        let key = format!("scene {name} {} {}", window.height, window.width);
        let drawn = context.kept().get_or(&key, || drawn(scene, window.height, window.width))?;
        return Ok((drawn.window_replicate(-(border as isize), -(border as isize), height, width), 1.0));
    }
    let picture = context.kept().get_or(&format!("photo {name}"), || loaded(name, context))?;
    for note in &picture.notes {
        context.warning(WarningKind::Picture, format!("{name}: {note}"));
    }
    let photo = &picture.light;
    let covers = photo.height >= sensor.height && photo.width >= sensor.width;
    let (rows, columns) = if covers {
        (sensor.height, sensor.width)
    } else {
        (photo.height.max(window.height), photo.width.max(window.width))
    };
    let laid = context
        .kept()
        .get_or(&format!("laid {name} {rows} {columns}"), || Ok::<_, JobError>(photo.cover(rows, columns)))?;
    let enlarged = (rows as f64 / photo.height as f64).max(columns as f64 / photo.width as f64);
    // Of a photograph that covers the array the window shows its place; one that does not goes with the window.
    let start = |at: usize, part: usize, whole: usize| {
        let at = if covers { at } else { (whole - part) / 2 };
        at as isize - border as isize
    };
    let row = start(window.placement.row, window.height, rows);
    let col = start(window.placement.col, window.width, columns);
    Ok((laid.window_replicate(row, col, height, width), enlarged))
}

/// A photograph by built-in name or by path.
fn loaded(name: &str, context: &Context) -> Result<Picture> {
    let built_in = || context.assets.bytes(&format!("photos/{name}.png")).ok();
    let picture = if !Path::new(name).exists()
        && let Some(bytes) = built_in()
    {
        load_image_bytes(bytes, name)
    } else {
        load_image(Path::new(name))
    };
    Ok(picture.map_err(DesignError::from)?)
}

/// A built-in scene of matt surfaces in daylight, in linear light.
fn drawn(name: &str, height: usize, width: usize) -> Result<LinearImage> {
    let kind = SceneKind::named(name).ok_or_else(|| {
        let known = SceneKind::ALL.map(SceneKind::name).join(", scene:");
        JobError::setting(
            "photo",
            format!("scene:{name}"),
            "there is no such scene",
            format!("scene:{known}"),
        )
    })?;
    let scene = kind.draw(height, width);
    let daylight = Illuminant::named("D65").map_err(|e| JobError::failed(e.to_string()))?.irradiance(1.0);
    let (_, _, to_srgb) = d65_white();
    let colour = |reflectance| apply(&to_srgb, xyz_of_reflectance(reflectance, &daylight));
    let colours: Vec<[f64; 3]> = scene.materials.iter().map(colour).collect();
    let mut light = LinearImage::zeros(CHANNELS, height, width);
    for (i, (a, b, share)) in scene.pixels.iter().enumerate() {
        let (a, b) = (colours[usize::from(*a)], colours[usize::from(*b)]);
        for channel in 0..CHANNELS {
            let mixed = (1.0 - share) * a[channel] as f32 + share * b[channel] as f32;
            light.data[channel * height * width + i] = mixed.max(0.0);
        }
    }
    Ok(light)
}

/// Signal to noise of a pixel of light `x` (1 is white), the mean over the colours of the array: `n x / sqrt(n x + d + s^2)` with `n` electrons of
/// white, `d` of dark current, and the noise `s` of the readout in electrons.
fn signal_to_noise(sensor: &SensorModel, exposure: &Exposure, light: f64) -> f64 {
    let electronics_e =
        sensor.electronics_noise_dn / (sensor.gain_dn_per_e * f64::from(exposure.linear_gain));
    let dark = sensor.dark_current_e_per_s * f64::from(exposure.time_s)
        + sensor.read_noise_e.powi(2)
        + electronics_e.powi(2);
    let colours = sensor.cfa.colours();
    let of_colour = |colour: &Colour| {
        let electrons = light * f64::from(exposure.white_e) * sensor.response(*colour).iter().sum::<f64>();
        electrons / (electrons + dark).sqrt()
    };
    colours.iter().map(of_colour).sum::<f64>() / colours.len().max(1) as f64
}

/// What an ISP makes of the raw frame, 8 bits a colour, pixel by pixel. It is calibrated by the illumination of the lens; distortion stays.
fn by_isp(
    name: &str,
    set: &[String],
    (raw, illumination): (&Raw, &LinearImage),
    sensor: &SensorModel,
    context: &Context,
) -> Result<Vec<u8>> {
    if !sensor.cfa.is_bayer() {
        let message = format!("the ISP needs a Bayer array, not {}", sensor.cfa);
        return Err(JobError::setting("isp", name, message, "name another sensor, or leave the ISP out"));
    }
    let mut isp = isp_by_name(name, &context.assets, context.cancel())?;
    isp.set(set)?;
    let mut frame = RawInput::from_raw(raw, sensor).map_err(DesignError::from)?;
    frame.about.shading = Some(Mesh::of_picture(illumination, MESH, MESH));
    let (developed, warnings) = picture(&isp, &frame)?;
    warnings.into_iter().for_each(|(kind, text)| context.warning(kind, format!("{name}: {text}")));
    let encoded = developed.encoded();
    let pixels = encoded.len() / CHANNELS;
    let byte = |i: usize| (255.0 * encoded[i]).round() as u8;
    Ok((0..pixels).flat_map(|i| [byte(i), byte(pixels + i), byte(2 * pixels + i)]).collect())
}

/// The edges in the regions that the request names: in linear light, or behind an ISP in its picture, whose sRGB curve is undone.
fn edges(
    request: &Request,
    linear: &LinearImage,
    rgb: &[u8],
    pixel_um: f64,
    context: &Context,
) -> Result<Vec<Edge>> {
    if request.edges.is_empty() {
        return Ok(Vec::new());
    }
    let mut decoded = LinearImage::zeros(CHANNELS, linear.height, linear.width);
    let light = if request.isp.is_some() {
        for (i, pixel) in rgb.chunks_exact(CHANNELS).enumerate() {
            for (channel, value) in pixel.iter().enumerate() {
                decoded.plane_mut(channel)[i] = srgb_decode(f32::from(*value) / 255.0);
            }
        }
        &decoded
    } else {
        linear
    };
    let request =
        mtf::Request { regions: request.edges.clone(), pixel_um: Some(pixel_um), ..mtf::Request::default() };
    Ok(mtf::edges(&request, "the window", mtf::Pixels::Picture(light), context)?.edges)
}

/// A raw frame between its black level and saturation, 8 bits a pixel.
fn raw_bytes(raw: &Raw, sensor: &SensorModel) -> Vec<u8> {
    let black = sensor.black_level_dn as f32;
    let most = ((1u64 << sensor.bits) - 1) as f32;
    let byte = |dn: &f32| (255.0 * ((dn - black) / (most - black)).clamp(0.0, 1.0)).round() as u8;
    raw.dn.iter().map(byte).collect()
}
