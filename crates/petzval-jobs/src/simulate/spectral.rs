//! `simulate` over the spectrum: spectral images, built-in scenes, and photographs under a given light.

mod conditions;
mod light;

use std::borrow::Cow;
use std::path::Path;

use petzval_camera::develop::LinearIsp;
use petzval_camera::image::LinearImage;
use petzval_camera::isp::RawInput;
use petzval_camera::spectral::{ColourElectrons, Illuminant, ReflectanceScene, SceneKind, SpectralScene};
use petzval_design::camera::Camera;
use petzval_design::error::DesignError;
use petzval_design::spectral_light::{Bands, render_spectral};
use petzval_files::spectral_file::load_spectral;

use self::conditions::Conditions;
use self::light::Light;
use super::chip;
use super::highlights::default_white_e;
use super::memory::InMemory;
use super::output::Facts;
use super::request::{Kind, Request, kind, result_name, scene_name};
use super::rig::{Rig, Turned, check_not_stopped, check_numbers};
use super::shot::{Each, Taken, placed};
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::noted::Noted;

/// Takes all images, and gives each to `each`.
pub fn run(
    request: &Request,
    memory: InMemory<'_>,
    context: &Context,
    each: &mut Each<'_>,
) -> Result<Vec<Facts>> {
    check(request)?;
    let (mut rig, turned) = Rig::new(request, memory.psfs, context)?;
    let mut conditions = Conditions::new(request, &mut rig, context)?;
    let mut shared = Light::over_all(request, &conditions, &rig)?;
    if let Some(white_e) = request.white_e {
        // Electrons are proportional to the illuminance.
        conditions.lux *= f64::from(white_e) / shared.white.white_e();
        shared = Light::over_all(request, &conditions, &rig)?;
    }
    // Every image is read before anything is taken; only one of them at a time is in memory.
    let mut first = None;
    let opened = |path: &Path, rig: &Rig, shared: &Light, context: &Context| {
        let photo = |path: &Path| memory.photograph(path, context);
        open(request, path, &conditions, rig, shared, &photo)
    };
    for path in &request.images {
        first = Some(opened(path, &rig, &shared, context)?);
    }
    first = first.filter(|_| request.images.len() == 1);
    if request.images.iter().any(|path| kind(path) != Kind::Spectral) {
        shared.warn(&conditions, &rig, None, context);
    }
    // Warnings about files have been shown.
    let silent = context.silent();
    let (mut written, noted) = (Vec::new(), Noted::new(context, "picture"));
    let mut last_note = String::new();
    for (frame, path) in request.images.iter().enumerate() {
        check_not_stopped(frame, request, context)?;
        let (opened, own) = match first.take() {
            Some(opened) => opened,
            None => opened(path, &rig, &shared, &silent)?,
        };
        let light = own.as_ref().unwrap_or(&shared);
        if let Some(own) = &own {
            own.warn(&conditions, &rig, Some(path), context);
        }
        let name = result_name(path);
        let frame = frame as u64;
        let electrons = electrons(request, (&rig, &turned), &conditions, light, &opened, &name, context)
            .map_err(|error| named(path, error))?;
        let (camera, taken) = take(request, (&rig, &turned), light, &electrons, frame)?;
        let (mut facts, warnings) = each(&rig, camera.body(), &name, taken)?;
        warnings.into_iter().for_each(|(kind, text)| noted.warning(&name, kind, text));
        facts.extend(light.facts(request, &conditions));
        written.push(facts);
        let note = light.says(request, &conditions);
        if note != last_note {
            context.note(&note);
            last_note = note;
        }
    }
    Ok(written)
}

/// The electrons of an opened scene.
fn electrons(
    request: &Request,
    (rig, turned): (&Rig, &Turned),
    conditions: &Conditions,
    light: &Light,
    opened: &Opened,
    name: &str,
    context: &Context,
) -> Result<ColourElectrons, DesignError> {
    match opened {
        Opened::Bands(scene) => over_bands(request, rig, conditions, light, scene, name, context),
        // The matrix is the integral over the spectrum, only the PSFs are those of three wavelengths.
        Opened::ThreeBands(photo) => {
            Ok(ColourElectrons::of_rgb(&turned.light(rig, photo, context.cancel())?, &light.white))
        }
    }
}

/// A frame of these electrons, by a camera that is balanced for the light.
fn take(
    request: &Request,
    (rig, turned): (&Rig, &Turned),
    light: &Light,
    electrons: &ColourElectrons,
    frame: u64,
) -> Result<(Camera, Taken), DesignError> {
    let white_e = light.white.white_e();
    let matrix = light.matrix.as_ref().filter(|_| !request.spectral.no_colour_matrix);
    // The sensor balanced for this light, and the matrix fitted to it.
    let isp = LinearIsp { colour_matrix: matrix.map(|m| m.matrix), ..rig.isp };
    let camera = turned.camera(rig.body(request, light.sensor.clone(), white_e as f32, isp))?;
    let on_pixels = electrons.as_light(&light.sensor, white_e, rig.window.placement);
    let taken = Taken::of_light(request, rig, &camera, &on_pixels, frame)?;
    Ok((camera, taken))
}

/// A scene of reflectances as the image signal processor of a request receives it.
pub struct SceneFrame {
    /// The frame.
    pub frame: RawInput,
    /// The light on the scene.
    pub illuminant: Illuminant,
    /// Illuminance of the scene, lux.
    pub lux: f64,
    /// Photoelectrons of white in a green pixel on the axis.
    pub white_e: f64,
}

/// Takes the scene that `draw` makes on so many rows and columns of samples, without writing anything. Shares of materials are coverage of the
/// sample; the lens sees the light at its middle ([`LinearImage::point_values`]). Without
/// `white_e` and an illuminance, white is as bright as in photographs by default.
pub fn scene_frame(
    request: &Request,
    draw: impl FnOnce(usize, usize) -> ReflectanceScene,
    context: &Context,
) -> Result<SceneFrame> {
    check_numbers(request)?;
    let (mut rig, turned) = Rig::new(request, None, context)?;
    let mut conditions = Conditions::new(request, &mut rig, context)?;
    let mut light = Light::over_all(request, &conditions, &rig)?;
    let white_e = match (request.white_e, request.spectral.illuminance_lux) {
        (Some(white_e), _) => Some(white_e),
        (None, Some(_)) => None,
        (None, None) => Some(default_white_e(request, &light.sensor)?),
    };
    if let Some(white_e) = white_e {
        // Electrons are proportional to the illuminance.
        conditions.lux *= f64::from(white_e) / light.white.white_e();
        light = Light::over_all(request, &conditions, &rig)?;
    }
    light.warn(&conditions, &rig, None, context);
    let (illuminant, lux) = (&conditions.illuminant, conditions.lux);
    let scene = draw(rig.sensor.height * rig.samples, rig.sensor.width * rig.samples);
    let opened = Opened::Bands(SpectralScene::surfaces_as_points(scene, illuminant, lux, &light.band_um));
    let electrons = electrons(request, (&rig, &turned), &conditions, &light, &opened, "chart", context)?;
    let (camera, taken) = take(request, (&rig, &turned), &light, &electrons, 0)?;
    let body = camera.body();
    let frame = chip::frame(&rig, &body.sensor, taken.for_chip(), body.isp.colour_matrix)?;
    let white_e = light.white.white_e();
    Ok(SceneFrame { frame, illuminant: conditions.illuminant, lux, white_e })
}

/// Options that fit neither a run over the spectrum nor each other.
fn check(request: &Request) -> Result<()> {
    for name in request.images.iter().filter_map(|path| scene_name(path)) {
        scene(name)?;
    }
    let first = |wanted: Kind| request.images.iter().find(|path| kind(path) == wanted);
    if let (Some(bands), Some(file)) = (request.spectral.bands, first(Kind::Spectral)) {
        return Err(JobError::input(
            format!("--bands {bands}: {} has bands of its own", file.display()),
            "leave --bands out, or simulate scenes and photographs apart from spectral images",
        ));
    }
    if let (Some(white_e), Some(file)) = (request.white_e, first(Kind::Spectral)) {
        return Err(JobError::input(
            format!("--white-e {white_e}: {} has radiances of its own", file.display()),
            "leave --white-e out; --time-s and --gain set the exposure",
        ));
    }
    if let (Some(white_e), Some(lux)) = (request.white_e, request.spectral.illuminance_lux) {
        return Err(JobError::input(
            format!(
                "--white-e {white_e}: --illuminance-lux {lux} says already how many electrons white gives"
            ),
            "leave one of the two out",
        ));
    }
    let spectral = first(Kind::Scene).or_else(|| first(Kind::Spectral));
    if let Some(path) = spectral.filter(|_| request.spectral.three_band) {
        return Err(JobError::input(
            format!("--three-band: {} is no photograph of three bands", path.display()),
            "leave --three-band out, or give photographs",
        ));
    }
    Ok(())
}

/// The built-in scene of a name.
fn scene(name: &str) -> Result<SceneKind> {
    SceneKind::named(name).ok_or_else(|| {
        let known = SceneKind::ALL.map(SceneKind::name).join(", scene:");
        JobError::input(format!("no scene called `{name}`"), format!("there are scene:{known}"))
    })
}

/// What is taken: a scene over its bands, or a photograph on the sensor in three.
enum Opened {
    Bands(SpectralScene),
    ThreeBands(LinearImage),
}

/// What an image holds, and its light if its bands are its own.
fn open<'a>(
    request: &Request,
    path: &Path,
    conditions: &Conditions,
    rig: &Rig,
    shared: &Light,
    photograph: &dyn Fn(&Path) -> Result<Cow<'a, LinearImage>>,
) -> Result<(Opened, Option<Light>)> {
    let (illuminant, lux, band_um) = (&conditions.illuminant, conditions.lux, &shared.band_um);
    if let Some(name) = scene_name(path) {
        let drawn = scene(name)?.draw(rig.sensor.height * rig.samples, rig.sensor.width * rig.samples);
        return Ok((Opened::Bands(SpectralScene::surfaces(drawn, illuminant, lux, band_um)), None));
    }
    if kind(path) == Kind::Spectral {
        let image = load_spectral(path).map_err(DesignError::from)?;
        let light = Light::in_file(request, conditions, rig, path, &image.wavelength_um)?;
        return Ok((Opened::Bands(SpectralScene::image(image)), Some(light)));
    }
    let photo = photograph(path)?;
    let photo = placed(request, &photo, rig.frame);
    let opened = if request.spectral.three_band {
        Opened::ThreeBands(photo)
    } else {
        Opened::Bands(SpectralScene::print(photo, illuminant, lux, band_um))
    };
    Ok((opened, None))
}

/// Electrons of a scene whose bands go through the lens one by one.
fn over_bands(
    request: &Request,
    rig: &Rig,
    conditions: &Conditions,
    light: &Light,
    scene: &SpectralScene,
    name: &str,
    context: &Context,
) -> Result<ColourElectrons, DesignError> {
    let bands = Bands {
        um: &scene.band_um,
        weights: &light.weights,
        samples: rig.samples,
        planes: &|three| placed(request, &scene.planes(three), rig.frame),
        distortion: rig.distortion.as_ref(),
    };
    let total = bands.seen().len() as u64;
    let count = std::cell::Cell::new(0);
    context.progress(0, total, name);
    let done = |_band: usize| {
        count.set(count.get() + 1);
        context.progress(count.get(), total, name);
    };
    let (lens, plan) = (&conditions.lens, &conditions.plan);
    render_spectral(lens, plan, &rig.geometry, &bands, rig.window, &done, context.cancel())
}

/// A failure with the name of the scene in which it arose.
fn named(path: &Path, error: DesignError) -> JobError {
    if !error.is_input() {
        return error.into();
    }
    let hint = "the lens is traced at the wavelength of each band to which the sensor answers: check the focus, and the bands of the scene";
    JobError::input(format!("{}: {error}", path.display()), hint)
}
