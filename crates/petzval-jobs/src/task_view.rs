//! `task-view`: a lens by the task of an experiment, while it is being dragged. It gives the loss of a fixed batch, its slopes by every number of
//! the lens, and the share of the gap to a lens without aberrations. Pictures show what the network reads in them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use petzval_camera::image::LinearImage;
use petzval_camera::sensor::Noise;
use petzval_design::block::{Batch, Block, Blocks, Sight, loss_by_numbers, losses_of};
use petzval_design::camera::{Camera, Shot};
use petzval_design::design_loop::set_sight;
use petzval_design::experiment::Variant;
use petzval_design::inputs::{SetupFor, check_parts_or_accepted, setup_of_run};
use petzval_design::report::run_report::camera_lens;
use petzval_design::run::{DigestCheck, Kept, RunFolder, load_blocks};
use petzval_design::setup::Setup;
use petzval_design::task::Purpose;
use petzval_files::lens_toml::parameter_name;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::{Lens, ObjectDistance, Surface};
use petzval_optics::number::Number;
use petzval_optics::solve::thin_equivalent;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::apply::none_finished;
use crate::context::Context;
use crate::design::{NewExperiment, NewRun, inputs_of, prepared, resolved};
use crate::error::{JobError, Result};
use crate::event::WarningKind;
use crate::experiment::DEFAULT_EXPERIMENT;
use crate::input::{ExperimentInput, LensInput};
use crate::lens::edit::{Edit, edited};
use crate::own_lens::is_lens;
use crate::range::check_ranges;

/// The loss itself among its parts.
const TOTAL: &str = "total";

/// Changes for which the loss is stated: of the sag at the edge of the clear aperture, and of a thickness, mm.
const SAG_MM: f64 = 1e-3;
const THICKNESS_MM: f64 = 1e-2;

/// By this name the library of the job knows the lens to which an experiment is fitted.
const FITTED: &str = "lens of the page";

petzval_base::parameters! {
    /// A lens, and what it is looked at for.
    pub struct Request {
        /// Windows of the batch that are taken; fewer are quicker, and more are nearer to what a step of a design sees.
        windows: usize = 4, "windows", 1..64, Log, "no more than training.batch of the experiment count";
    }
    also {
        /// Lens: a built-in name, the path of a file, or the lens itself.
        lens: LensInput = LensInput::default();
        /// Changes of the lens that come first, in this order.
        edits: Vec<Edit> = Vec::new();
        /// The lens at which the gap begins; the experiment's own if none is named. An empty experiment is fitted to it.
        start: Option<LensInput> = None;
        /// Experiment whose task, sensor and network are taken: a built-in name, the path of a file, or the experiment itself. An empty name fits the
        /// default one to `start`, as `init` does.
        experiment: ExperimentInput = ExperimentInput::from(DEFAULT_EXPERIMENT);
        /// A run whose experiment and finished camera are taken in place of `experiment`.
        run: Option<PathBuf> = None;
        /// The camera of that run, whose network, ISP and exposure are taken; the last one that is finished if none is named.
        camera: Option<String> = None;
        /// Number of the batch.
        batch: u64 = 0;
        /// Whether the slopes are computed.
        slopes: bool = true;
        /// Whether the pictures are given.
        pictures: bool = false;
    }
}

/// A lens by the task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// Title of the experiment.
    pub experiment: String,
    /// The camera whose network and blocks are taken.
    pub camera: String,
    /// Where its network comes from.
    pub network: String,
    /// Windows of the batch.
    pub windows: usize,
    /// The loss.
    pub loss: f64,
    /// Its parts, by name.
    pub parts: BTreeMap<String, f64>,
    /// The loss of the lens at which the gap begins.
    pub start_loss: f64,
    /// The loss of a lens without aberrations of the same focal length and pupil; none for objects at a finite distance.
    pub perfect_loss: Option<f64>,
    /// The share of the gap between the two that this lens closes; none where there is no gap.
    pub closed: Option<f64>,
    /// Slopes by surface; empty if they were not requested.
    pub surfaces: Vec<SurfaceSlopes>,
    /// The pictures, if they were requested.
    pub pictures: Vec<Picture>,
}

/// The slopes of the loss by the numbers of a surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SurfaceSlopes {
    /// The surface, from 1.
    pub surface: usize,
    /// Its numbers.
    pub numbers: Vec<Slope>,
}

/// The slope of the loss by a number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Slope {
    /// The number: `curvature_per_mm`, or as lens files name it.
    pub number: String,
    /// Derivative of the loss by the number, which is a curvature (1/mm), a conic constant, a thickness (mm) or a coefficient of the asphere.
    pub slope: f64,
    /// The change of the number for which `change` is stated.
    pub step: f64,
    /// By how much the loss changes for that change, to first order.
    pub change: f64,
    /// What the change is, in words.
    pub of: String,
}

/// A window of the batch as the camera takes it, with what its network reads in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Picture {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Red, green and blue of each pixel, 8 bits each, row by row, in base64.
    pub rgb: String,
    /// Field of the middle of the window as a share of the radius to the sensor's corner.
    pub relative_radius: f64,
}

/// An experiment that is ready, with the network of a camera.
struct Ready {
    setup: Setup,
    variant: Variant,
    /// Its camera with network, ISP and exposure held, with the lens at which the variant starts.
    held: Camera,
    network: String,
}

/// Looks at the lens.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    check_ranges(request)?;
    let lens = edited(&request.lens, &request.edits, context)?.file.lens;
    let start = request.start.as_ref().map(|start| edited(start, &[], context)).transpose()?;
    let key = key_of(request, start.as_ref().map_or("", |start| &start.toml), context)?;
    let ready = context
        .kept()
        .get_or(&key, || ready(request, start.as_ref().map(|start| start.toml.as_str()), context))?;
    let Ready { setup, variant, held, network } = &*ready;
    let start_toml = start.as_ref().map_or_else(String::new, |start| start.toml.clone());
    let own = start.map_or_else(|| setup.start(variant).lens_file.lens.clone(), |start| start.file.lens);
    let noise = setup.noise(variant);
    let objective = setup.objective()?;
    let loss_of = |lens: Lens| -> Result<f64> {
        let camera = held.with_lens(lens)?;
        let shots = shots(setup, &camera, request)?;
        Ok(losses_of(&Batch::new(&camera, &shots, noise, &*objective), &camera, &shots)?[TOTAL])
    };
    let bounds = format!("{key} {} {}", request.batch, request.windows);
    let gap = context.kept().get_or(&format!("gap {bounds} {start_toml}"), || {
        let start = loss_of(own.clone())?;
        context.check(|| "stopped before the loss of a perfect lens was computed")?;
        let is_far = own.object == ObjectDistance::Infinity;
        let perfect = is_far.then(|| loss_of(thin_equivalent(&own))).transpose()?;
        Ok::<_, JobError>((start, perfect))
    })?;
    let (start_loss, perfect_loss) = *gap;
    context.check(|| "stopped before the slopes were computed")?;
    let camera = held.with_lens(lens.clone())?;
    let shots = shots(setup, &camera, request)?;
    let batch = Batch::new(&camera, &shots, noise, &*objective);
    let (parts, slopes) = if request.slopes {
        let (parts, by) = loss_by_numbers(&batch)?;
        (parts, Some(by))
    } else {
        (losses_of(&batch, &camera, &shots)?, None)
    };
    let loss = parts[TOTAL];
    if !loss.is_finite() {
        return Err(JobError::failed(
            "the loss is no number: the light of this lens does not reach the windows",
        ));
    }
    let gap = perfect_loss.map(|perfect| start_loss - perfect).filter(|gap| *gap > 0.0);
    let pictures = if request.pictures { pictures(setup, &camera, &shots, &noise)? } else { Vec::new() };
    Ok(Response {
        experiment: setup.experiment.name.clone(),
        camera: variant.name.clone(),
        network: network.clone(),
        windows: shots.len(),
        loss,
        parts,
        start_loss,
        perfect_loss,
        closed: gap.map(|gap| (start_loss - loss) / gap),
        surfaces: slopes.map_or_else(Vec::new, |by| surfaces(&lens, &by)),
        pictures,
    })
}

/// What the experiment that is kept was made from.
fn key_of(request: &Request, start: &str, context: &Context) -> Result<String> {
    if let Some(run) = &request.run {
        let path = std::fs::canonicalize(run).unwrap_or_else(|_| run.clone());
        // A run in work finishes further cameras while the page is open.
        let cameras = std::fs::read_dir(path.join("cameras")).into_iter().flatten().flatten();
        let finished = cameras.filter(|camera| camera.path().join("metrics.json").is_file()).count();
        return Ok(format!("task of {} {:?} {finished}", path.display(), request.camera));
    }
    let text = serde_json::to_string(&request.experiment).map_err(|e| JobError::failed(e.to_string()))?;
    let name = request.experiment.name();
    if name.is_empty() {
        return Ok(format!("task fitted to {start}"));
    }
    // A file may change while the page is open.
    let content = context
        .assets
        .text("experiment", "experiments", &name)
        .map_or_else(|_| String::new(), |text| text.text);
    if is_lens(&name, context) {
        return Ok(format!("task {text} {content}"));
    }
    let new = NewRun { experiment: request.experiment.clone(), ..NewRun::default() };
    let changed = |path: &PathBuf| std::fs::metadata(path).and_then(|about| about.modified()).ok();
    let inputs: Vec<_> = inputs_of(&resolved(&new, context)?).iter().map(changed).collect();
    Ok(format!("task {text} {content} {inputs:?}"))
}

/// Makes the experiment ready: its task with windows, and the blocks of a camera.
fn ready(request: &Request, start: Option<&str>, context: &Context) -> Result<Ready> {
    let device = context.device("cpu")?;
    if let Some(run) = &request.run {
        let folder = RunFolder::open(run)?;
        let experiment = context.assets.experiment_of_run(&folder)?;
        let needed = SetupFor::Windows(Purpose::Training, None);
        let setup = setup_of_run(&folder, experiment, &context.assets, device, needed)?;
        let finished = folder.finished(setup.variants.iter().map(|variant| variant.name.as_str()));
        let name = match &request.camera {
            Some(name) if finished.contains(&name.as_str()) => name.clone(),
            Some(name) => {
                let hint = format!("finished are {}", finished.join(", "));
                return Err(JobError::setting(
                    "camera",
                    name,
                    "the run has no finished camera of this name",
                    hint,
                ));
            }
            None => last(&finished, &setup).ok_or_else(|| match none_finished(&folder) {
                JobError::Input { message, hint, .. } => {
                    JobError::input(message, format!("{hint}, or name its experiment in place of the run"))
                }
                other => other,
            })?,
        };
        let variant = variant_named(&setup, &name)?;
        let mut blocks = setup.blocks(&variant)?;
        let parts: [&mut dyn Block; 3] = [&mut blocks.exposure, &mut blocks.isp, &mut blocks.network];
        let warn = |text: &str| context.warning(WarningKind::ChangedFile, text);
        let check = DigestCheck::new(&folder, &[], &warn);
        check.check_cameras([name.as_str()])?;
        check_parts_or_accepted(&setup, &folder, &check)?;
        load_blocks(&folder.camera(&name), parts, Kept::Numbers)?;
        set_sight(&mut blocks.network, &folder, &variant, &camera_lens(&folder, &name)?.lens)?;
        let network = format!("of the finished camera {name}");
        return with_camera(setup, variant, &blocks, network);
    }
    let NewExperiment { experiment, context: own, .. } = if request.experiment.name().is_empty() {
        let Some(toml) = start else {
            let hint = "name an experiment, or the lens to which one is fitted";
            return Err(JobError::setting(
                "start",
                "",
                "there is no lens to which the experiment could be fitted",
                hint,
            ));
        };
        let file = (format!("lenses/{FITTED}.toml"), toml.to_owned());
        let context = context.clone().with_assets(context.assets.clone().with_files([file]));
        prepared(&NewRun { experiment: FITTED.into(), ..NewRun::default() }, &context)?
    } else {
        prepared(&NewRun { experiment: request.experiment.clone(), ..NewRun::default() }, context)?
    };
    let setup = Setup::new(experiment, &own.assets, device)?;
    let all: Vec<&str> = setup.variants.iter().map(|variant| variant.name.as_str()).collect();
    let name = last(&all, &setup).ok_or_else(|| JobError::failed("the experiment has no variant"))?;
    let variant = variant_named(&setup, &name)?;
    let mut blocks = setup.blocks(&variant)?;
    blocks.network.set_sight(Sight { sees: variant.sees, zoom: 1.0 });
    let network = match setup.task.given_weights() {
        Some(_) => "with the weights that the experiment names",
        None => "untrained, drawn from the seed: losses and slopes say little yet",
    };
    // The zoom follows from the lens of a finished camera.
    let zoom = if variant.zoomed_like.is_some() { "; without the digital zoom of this camera" } else { "" };
    with_camera(setup, variant, &blocks, format!("{network}{zoom}"))
}

/// Holds the blocks of a variant in a camera. Its PSFs are traced, also where a network takes their place while a lens moves.
fn with_camera(setup: Setup, variant: Variant, blocks: &Blocks, network: String) -> Result<Ready> {
    let lens = setup.start(&variant).lens_file.lens.clone();
    let held = blocks.held(&setup.camera_of(&variant, lens, true)?);
    Ok(Ready { setup, variant, held, network })
}

/// The last of these variants whose lens moves; the last of all if none does.
fn last(names: &[&str], setup: &Setup) -> Option<String> {
    let known =
        |name: &&&str| setup.variants.iter().any(|variant| variant.name == **name && variant.moves_lens());
    names.iter().rev().find(known).or(names.last()).map(|name| (*name).to_owned())
}

fn variant_named(setup: &Setup, name: &str) -> Result<Variant> {
    let found = setup.variants.iter().find(|variant| variant.name == name);
    found.cloned().ok_or_else(|| JobError::failed(format!("the experiment has no variant `{name}`")))
}

/// The windows of the batch that a camera takes.
fn shots(setup: &Setup, camera: &Camera, request: &Request) -> Result<Vec<Shot>> {
    let mut shots = setup.training_shots(camera, request.batch)?;
    shots.truncate(request.windows);
    Ok(shots)
}

/// The slopes by the numbers of every surface that are stated in its file: curvature, conic constant, asphere, and the distance to the next surface.
fn surfaces(lens: &Lens, by: &LensGradient) -> Vec<SurfaceSlopes> {
    let of_surface = |(i, surface): (usize, &Surface)| {
        let slopes = by.of_surface(i);
        let mut numbers = Vec::new();
        for number in [Number::Curvature, Number::Conic, Number::Thickness]
            .into_iter()
            .chain((0..surface.shape.asphere.len()).map(Number::Asphere))
        {
            let Some((step, of)) = step_of(surface, number) else { continue };
            let slope = slopes[number.slot()];
            if slope.is_finite() {
                let name = match number {
                    // Lens files state a radius, by which the slope would be another.
                    Number::Curvature => "curvature_per_mm".to_owned(),
                    other => parameter_name(surface, other),
                };
                numbers.push(Slope { number: name, slope, step, change: slope * step, of: of.to_owned() });
            }
        }
        SurfaceSlopes { surface: i + 1, numbers }
    };
    lens.surfaces.iter().enumerate().map(of_surface).collect()
}

/// The change of a number that moves the edge of the clear aperture by 1 um along the axis, or a thickness by 0.01 mm; none for a number that does
/// nothing to the surface.
///
/// With `z = c r^2 / (1 + q)`, `q = sqrt(1 - (1 + k) c^2 r^2)`: `dz/dc = r^2 / (q (1 + q))`, `dz/dk = c^3 r^4 / (2 q (1 + q)^2)`, `dz/da_j = r^j`.
fn step_of(surface: &Surface, number: Number) -> Option<(f64, &'static str)> {
    let (r, c, k) = (surface.semi_diameter_mm, surface.shape.curvature, surface.shape.conic);
    let q = (1.0 - (1.0 + k) * (c * r).powi(2)).sqrt();
    let by_number = match number {
        Number::Thickness => return Some((THICKNESS_MM, "0.01 mm of thickness")),
        Number::Curvature => r.powi(2) / (q * (1.0 + q)),
        // A conic constant that stands in no file is none of the design.
        Number::Conic if k != 0.0 => c.powi(3) * r.powi(4) / (2.0 * q * (1.0 + q).powi(2)),
        Number::Asphere(j) if surface.shape.asphere[j] != 0.0 => r.powi(2 + 2 * j as i32),
        _ => return None,
    };
    let step = SAG_MM / by_number;
    step.is_finite().then_some((step, "1 µm of sag at the edge"))
}

/// The windows as the camera takes them, with what its network reads in them.
fn pictures(setup: &Setup, camera: &Camera, shots: &[Shot], noise: &Noise) -> Result<Vec<Picture>> {
    let corner_mm = setup.corner_mm();
    let mut pictures = Vec::with_capacity(shots.len());
    for shot in shots {
        let picture = camera.finished(shot.clone(), noise)?;
        let shown = setup.task.drawn(camera, picture)?.shown;
        let kept = camera.kept(shot);
        let middle = [kept.placement.row + kept.height / 2, kept.placement.col + kept.width / 2];
        let radius_mm = camera.body().geometry.radius_mm(middle[0], middle[1]);
        pictures.push(Picture {
            height: shown.height,
            width: shown.width,
            rgb: STANDARD.encode(bytes(&shown)),
            relative_radius: radius_mm / corner_mm,
        });
    }
    Ok(pictures)
}

/// An sRGB-encoded picture, 8 bits a colour, pixel by pixel.
fn bytes(picture: &LinearImage) -> Vec<u8> {
    let pixels = picture.height * picture.width;
    let byte = |i: usize| (255.0 * picture.data[i].clamp(0.0, 1.0)).round() as u8;
    (0..pixels).flat_map(|i| [byte(i), byte(pixels + i), byte(2 * pixels + i)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_move_the_edge_by_a_micrometre() {
        let lens = crate::built_in_assets().lens("cooke-triplet-nominal").unwrap().lens;
        let mut checked = 0;
        for surface in &lens.surfaces {
            let mut surface = surface.clone();
            surface.shape.conic = -0.7;
            surface.shape.asphere[1] = 1e-6;
            let edge = |surface: &Surface| surface.shape.sag_at_mm([0.0, surface.semi_diameter_mm]);
            let before = edge(&surface).unwrap();
            type Move = fn(&mut Surface, f64);
            let moved: [(Number, Move); 3] = [
                (Number::Curvature, |surface, by| surface.shape.curvature += by),
                (Number::Conic, |surface, by| surface.shape.conic += by),
                (Number::Asphere(1), |surface, by| surface.shape.asphere[1] += by),
            ];
            for (number, change) in moved {
                let Some((step, _)) = step_of(&surface, number) else { continue };
                // A thousandth of the step, where the sag is straight.
                let mut other = surface.clone();
                change(&mut other, 1e-3 * step);
                let by = 1e3 * (edge(&other).unwrap() - before);
                assert!((by - SAG_MM).abs() < 1e-4 * SAG_MM, "{number:?}: {by}");
                checked += 1;
            }
        }
        assert!(checked >= 15, "{checked}");
    }
}
