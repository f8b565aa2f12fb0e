//! A hardware ISP in the loop: gradients through its floating-point form, pictures and scores by its fixed-point form.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use crate::common::library;
use petzval_base::Cancel;
use petzval_camera::isp::{HardwareIsp, Isp, IspError, IspParameter, RawInput, RgbPicture};
use petzval_camera::render::{Placement, Window};
use petzval_camera::sensor::{Noise, NoiseMode};
use petzval_camera::tape::Frames;
use petzval_design::assets::OutsideIsp;
use petzval_design::block::{Batch, Block, IspBlock, OpticsBlock};
use petzval_design::camera::{Camera, ChipValues, PsfSource, Shot, ideal_input, to_host};
use petzval_design::design_loop::finished_camera;
use petzval_design::error::DesignError;
use petzval_design::experiment::{Experiment, StepMethod, StepRule};
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_design::setup::Setup;
use petzval_files::isp_file::parse_external_isp;
use petzval_learn::Device;
use petzval_learn::loss::NamedLoss;

const QUIET: Noise = Noise { mode: NoiseMode::Off, seed: 1 };

fn setup(more: &str) -> Result<Setup, DesignError> {
    setup_of("quality", more)
}

fn setup_of(preset: &str, more: &str) -> Result<Setup, DesignError> {
    let assets = library();
    let text = format!(
        "[psf]\nfields = 5\npupil_cells = 32\nscoring_pupil_cells = 32\nscoring_pupil_error = 2.0\n\
         [training]\ncrop = 64\nbatch = 3\nrelight_ev = 0.0\n[isp]\npreset = \"{preset}\"\n{more}\
         [[variant]]\nname = \"nominal\"\n[[variant.stage]]\nmoves = [\"optics\", \"isp\"]\n"
    );
    Setup::new(Experiment::parse(&text).unwrap(), &assets, Device::flex().autodiff())
}

/// The mean squared error of the finished pictures: a loss without kinks of its own.
fn loss_of(camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss, DesignError> {
    let total = (frames.finished.clone() - camera.truths(shots)?).powi_scalar(2).mean();
    let value = f64::from(to_host(total.clone())?[0]);
    Ok(NamedLoss { total, parts: vec![("total", value)] })
}

fn value(camera: &Camera, shots: &[Shot]) -> f64 {
    let frames = camera.take(shots, &QUIET).unwrap();
    loss_of(camera, &frames, shots).unwrap().parts[0].1
}

#[test]
fn the_gradient_by_parameters_and_lens_is_that_of_differences() {
    // Malvar's method chooses no direction pixel by pixel, which differences would step across.
    let vary = "vary = [\"luma_denoise\", \"chroma_denoise\", \"sharpen\", \"gamma\"]\n";
    let setup = setup_of("automotive", vary).unwrap();
    let start = setup.nominal();
    let camera = setup.camera(start.lens_file.lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 3).unwrap();
    let isp = setup.isp().unwrap();
    let held = camera.with_chip(isp.held(&camera.body().device));
    let batch = Batch::new(&held, &shots, QUIET, &loss_of);
    let (losses, by_place) = isp.gradient(&batch).unwrap();
    assert!((losses["total"] / value(&held, &shots) - 1.0).abs() < 1e-5);
    assert_eq!(by_place.len(), isp.free_numbers());
    let most = by_place.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    let parameters = HardwareIsp::default().parameters();
    let mut compared = 0;
    for ((parameter, from, _), analytic) in isp.changes().iter().zip(&by_place) {
        let name = &parameter.name;
        if analytic.abs() < 0.02 * most {
            continue;
        }
        let i = parameters.iter().position(|p| p.name == *name).unwrap();
        let about = &parameters[i].about;
        let place = about.unit_of(*from);
        let (low, high) = ((place - 0.004).max(0.0), (place + 0.004).min(1.0));
        let moved = |place: f64| {
            let mut values = isp.values();
            values[i] = about.value_at(place);
            let moved = IspBlock::new(parameters.clone(), values, Vec::new());
            value(&camera.with_chip(moved.held(&camera.body().device)), &shots)
        };
        let numeric = (moved(high) - moved(low)) / (high - low);
        assert!((analytic - numeric).abs() < 0.05 * numeric.abs(), "{name}: {analytic} {numeric}");
        compared += 1;
    }
    assert!(compared >= 3, "{by_place:?}");

    // And by the lens, along the steepest direction, at fixed fields.
    let x = start.space.start().to_vec();
    let fields = setup.moving_plan.field_angles(&start.space.lens_at(&x).unwrap()).unwrap();
    let camera_at = |x: &[f64]| {
        let plan = PsfPlan { held_fields_rad: Some(fields.clone()), ..setup.moving_plan.clone() };
        let source = PsfSource::Traced { lens: Box::new(start.space.lens_at(x).unwrap()), plan };
        Camera::new(setup.body.clone(), Arc::new(source.psfs().unwrap())).unwrap()
    };
    let from = camera_at(&x).with_chip(isp.held(&camera.body().device));
    let batch = Batch { camera: &from, ..batch };
    let block = OpticsBlock::new(setup.start(&setup.variants[0]).clone(), 0.0);
    let by_x = block.gradient(&batch).unwrap().1;
    let norm = by_x.iter().map(|g| g * g).sum::<f64>().sqrt();
    let along = |step: f64| {
        let moved: Vec<f64> = x.iter().zip(&by_x).map(|(x, g)| x + step * g / norm).collect();
        let moved = camera_at(&moved);
        value(&moved.with_chip(isp.held(&moved.body().device)), &shots)
    };
    let numeric = (along(2e-3) - along(-2e-3)) / 4e-3;
    assert!((numeric / norm - 1.0).abs() < 0.05, "{numeric} {norm}");
    // The chip itself has the same slope, within the rounding of its integers.
    let on_chip = |step: f64| {
        let moved: Vec<f64> = x.iter().zip(&by_x).map(|(x, g)| x + step * g / norm).collect();
        value(&camera_at(&moved).with_chip(ChipValues::Exact(isp.values())), &shots)
    };
    let of_chip = (on_chip(0.01) - on_chip(-0.01)) / 0.02;
    assert!((of_chip / norm - 1.0).abs() < 0.15, "{of_chip} {norm}");
}

#[test]
fn steps_by_the_smooth_form_improve_the_pictures_of_the_chip() {
    let setup = setup("").unwrap();
    let lens = setup.nominal().lens_file.lens.clone();
    let camera = setup.camera(lens, true).unwrap();
    let shots = setup.training_shots(&camera, 0).unwrap();
    let loss = loss_of;
    let mut isp = setup.isp().unwrap();
    let on_chip = |isp: &IspBlock| value(&camera.with_chip(ChipValues::Exact(isp.values())), &shots);
    let smooth = |isp: &IspBlock| value(&camera.with_chip(isp.held(&camera.body().device)), &shots);
    let before = (on_chip(&isp), smooth(&isp));
    // Both forms make the same pictures but for rounding.
    assert!((before.0 / before.1 - 1.0).abs() < 0.02, "{before:?}");
    isp.begin_stage(true);
    for _ in 0..25 {
        let batch = Batch::new(&camera, &shots, QUIET, &loss);
        isp.step(&batch, rule(StepMethod::Gradient)).unwrap();
    }
    let after = (on_chip(&isp), smooth(&isp));
    assert!(after.0 < 0.97 * before.0 && after.1 < 0.97 * before.1, "{before:?} {after:?}");
    assert!(isp.changes().iter().any(|(_, from, to)| from != to));
    // A block that is kept and read has the same values.
    let mut restored = setup.isp().unwrap();
    restored.load_numbers(&isp.save_numbers().unwrap()).unwrap();
    restored.load_progress(&isp.save_progress().unwrap()).unwrap();
    assert_eq!(restored.values(), isp.values());
    assert!(restored.load_numbers(&BTreeMap::new()).unwrap_err().contains("places.json"));
}

fn rule(method: StepMethod) -> StepRule {
    StepRule { method, rate: 0.03, proximal: 0.0 }
}

#[test]
fn the_chip_is_improved_without_its_gradient_and_a_search_continues_with_the_same_bits() {
    let setup = setup("vary = [\"luma_denoise\", \"sharpen\"]\n").unwrap();
    let camera = setup.camera(setup.nominal().lens_file.lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 0).unwrap();
    let batch = || Batch::new(&camera, &shots, QUIET, &loss_of);
    let on_chip = |isp: &IspBlock| value(&camera.with_chip(ChipValues::Exact(isp.values())), &shots);
    let (mut isp, mut losses) = (setup.isp().unwrap(), Vec::new());
    let before = on_chip(&isp);
    isp.begin_stage(true);
    for _ in 0..12 {
        losses.push(isp.step(&batch(), rule(StepMethod::Evolution)).unwrap()["total"]);
    }
    assert!(on_chip(&isp) < 0.97 * before, "{before} {losses:?}");
    assert!(losses[11] < losses[0], "{losses:?}");
    let mut restored = setup.isp().unwrap();
    restored.load_numbers(&isp.save_numbers().unwrap()).unwrap();
    restored.load_progress(&isp.save_progress().unwrap()).unwrap();
    for block in [&mut isp, &mut restored] {
        block.step(&batch(), rule(StepMethod::Evolution)).unwrap();
    }
    assert_eq!(restored.values(), isp.values());
}

/// A step that is cancelled after the network that imitates the chip has learnt from its first windows.
#[test]
fn a_cancelled_step_leaves_the_network_that_imitates_the_chip_as_it_was() {
    let setup =
        setup("vary = [\"gamma.exponent\"]\nproxy_warm_up = 5\nproxy_steps = 2\nsteps = 1\n").unwrap();
    let camera = setup.camera(setup.nominal().lens_file.lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 0).unwrap();
    let further = |number: u64| setup.training_shots(&camera, number);
    let batch = || Batch { further: &further, ..Batch::new(&camera, &shots, QUIET, &loss_of) };
    let mut isp = setup.isp().unwrap();
    isp.begin_stage(true);
    isp.step(&batch(), rule(StepMethod::Proxy)).unwrap();
    // The moments of its optimiser may be written in any order.
    let kept = |isp: &IspBlock| {
        let mut state = isp.save_numbers().unwrap();
        assert!(state.remove("imitation-optimizer.bin").is_some());
        state
    };
    let before = kept(&isp);

    let cancel = Cancel::default();
    let cancelling = |number: u64| {
        cancel.set();
        further(number)
    };
    let cancelled = Batch { further: &cancelling, cancel: cancel.clone(), ..batch() };
    let stepped = isp.step(&cancelled, rule(StepMethod::Proxy));
    assert!(matches!(stepped, Err(DesignError::Stopped(_))), "{stepped:?}");
    assert!(kept(&isp) == before);
}

#[test]
#[ignore = "trains a network as an ISP for over a minute; `cargo xtask full` runs it"]
fn a_network_that_imitates_the_chip_leads_it_and_the_lens_and_continues_with_the_same_bits() {
    // The rate at which the network learns has fallen when it begins to lead: weights that still jump would make other figures on every machine.
    let isp = "vary = [\"gain.stops\", \"gamma.exponent\"]\nproxy_warm_up = 50\nproxy_steps = 4\nsteps = 1\n";
    let setup = setup(isp).unwrap();
    let camera = setup.camera(setup.nominal().lens_file.lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 0).unwrap();
    // The darker the better, so that both parameters have somewhere to go.
    let darkness = |frames: &Frames| {
        let total = frames.finished.clone().powi_scalar(2).mean();
        let value = f64::from(to_host(total.clone()).unwrap()[0]);
        NamedLoss { total, parts: vec![("total", value)] }
    };
    let loss = |_: &Camera, frames: &Frames, _: &[Shot]| Ok(darkness(frames));
    let further = |number: u64| setup.training_shots(&camera, number);
    let batch = || Batch { further: &further, ..Batch::new(&camera, &shots, QUIET, &loss) };
    let on_chip = |isp: &IspBlock| {
        let camera = camera.with_chip(ChipValues::Exact(isp.values()));
        darkness(&camera.take(&shots, &QUIET).unwrap()).parts[0].1
    };
    let mut isp = setup.isp().unwrap();
    let (before, start) = (on_chip(&isp), isp.values());
    isp.begin_stage(true);
    let step = |isp: &mut IspBlock| isp.step(&batch(), rule(StepMethod::Proxy)).unwrap();
    let first = step(&mut isp);
    assert!(first.contains_key("imitation_gradient_cosine") && !first.contains_key("total"), "{first:?}");
    for _ in 1..50 {
        step(&mut isp);
    }
    // So far the network has learnt and the parameters have rested.
    assert_eq!(isp.values(), start);
    isp.begin_stage(true);
    let judged = step(&mut isp);
    assert!(judged["imitation_psnr_db"] > first["imitation_psnr_db"] + 0.5, "{first:?} {judged:?}");
    assert!(judged.contains_key("total"), "{judged:?}");
    // The gap of a score is what the ISP has beyond the network: less than what separates their pictures.
    assert!(judged["imitation_gap_psnr_db"].abs() < 6.0, "{judged:?}");
    assert!(judged["imitation_gap_ssim"].abs() < 0.2 && judged.contains_key("imitation_gap_one_minus_lpips"));
    let mut restored = setup.isp().unwrap();
    restored.load_numbers(&isp.save_numbers().unwrap()).unwrap();
    restored.load_progress(&isp.save_progress().unwrap()).unwrap();
    for _ in 0..2 {
        assert_eq!(step(&mut isp), step(&mut restored));
    }
    assert_eq!(restored.values(), isp.values());
    for _ in 0..10 {
        step(&mut isp);
    }
    // The way of the network is the way of the chip.
    let after = on_chip(&isp);
    assert!(after < 0.9 * before, "{before} {after}");

    // Its slopes are near those of the ISP in floating point. Here none is near zero, where the direction of a gradient is chance.
    let mut smooth = setup.isp().unwrap();
    let mut numbers = isp.save_numbers().unwrap();
    numbers.retain(|part, _| part == "places.json");
    smooth.load_numbers(&numbers).unwrap();
    let [network, form] = [&isp, &smooth].map(|isp| isp.gradient(&batch()).unwrap().1);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let cosine = |a: &[f64], b: &[f64]| dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
    assert!(cosine(&network, &form) > 0.95, "{network:?} {form:?}");

    // The lens moves by it, too: its gradient is near that through the ISP in floating point.
    let optics = setup.blocks(&setup.variants[0]).unwrap().optics;
    let gradient = |chip: ChipValues| {
        let held = camera.with_chip(chip);
        let batch = Batch { camera: &held, ..batch() };
        optics.gradient(&batch).unwrap().1
    };
    let device = &camera.body().device;
    let (a, b) = (gradient(isp.held(device)), gradient(smooth.held(device)));
    let cosine = cosine(&a, &b);
    assert!(cosine > 0.6 && cosine < 0.99999, "{cosine}");
}

#[test]
fn a_scored_camera_develops_in_whole_numbers_and_its_truth_is_the_preset_on_perfect_optics() {
    let setup = setup("").unwrap();
    let lens = setup.nominal().lens_file.lens.clone();
    let (isp, network) = (setup.isp().unwrap(), setup.network().unwrap());
    let camera =
        finished_camera(&setup, &setup.variants[0], lens, &setup.exposure(), &isp, &network).unwrap();
    let shot = Shot { kept: None, ..setup.training_shots(&camera, 0).unwrap().remove(0) };
    let shots = [Shot { placement: Placement { row: 300, col: 501 }, ..shot }];
    let finished = to_host(camera.take(&shots, &QUIET).unwrap().finished).unwrap();
    // Numbers of 16 bits.
    assert!(finished.iter().all(|v| (v * 65535.0 - (v * 65535.0).round()).abs() < 0.01));
    let settings = camera.body().chip.as_ref().unwrap().settings().unwrap().clone();
    let scene = camera.scenes(&shots).unwrap().remove(0);
    let ideal = ideal_input(&scene, &camera.capture(&shots[0]), &camera.body().sensor).unwrap();
    let wanted = HardwareIsp { settings: settings.clone() }.develop(&ideal, &settings.values()).unwrap();
    assert_eq!(to_host(camera.truths(&shots).unwrap()).unwrap(), wanted.encoded());
    // A window is cut out of what is developed around it.
    let whole = camera.take(&shots, &QUIET).unwrap().finished.dims();
    let kept = Some(Window {
        placement: Placement { row: 308, col: 509 },
        height: whole[2] - 16,
        width: whole[3] - 16,
    });
    let window = [Shot { kept, ..shots[0].clone() }];
    let all = camera.truths(&shots).unwrap().slice([0..1, 0..3, 8..whole[2] - 8, 8..whole[3] - 8]);
    assert_eq!(to_host(camera.truths(&window).unwrap()).unwrap(), to_host(all).unwrap());
}

#[test]
fn parameters_that_do_not_exist_and_blocks_that_are_not_there_are_refused() {
    let refused = |text: &str| Experiment::parse(text).unwrap_err().to_string();
    let moves =
        |block: &str| format!("[[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"{block}\"]\n");
    assert!(refused(&moves("isp")).contains("the camera has no block `isp`"));
    let behind = format!("[isp]\npreset = \"quality\"\n{}", moves("network"));
    assert!(refused(&behind).contains("the camera has no block `network`"));
    let evolving = format!("{}schedule.network.method = \"evolution\"\n", moves("network"));
    assert!(refused(&evolving).contains("does not step by this method"));
    let isp = |more: &str| refused(&format!("[isp]\npreset = \"quality\"\n{more}{}", moves("isp")));
    assert!(isp("vary = [\"sharpen\", \"sharpness\"]\n").contains("`sharpness`"));
    assert!(isp("vary = []\n").contains("names no parameter"));
    assert!(isp("vary = [\"bayer_denoise.radial\"]\n").contains("the whole frame"));
    assert!(isp("[training]\ncrop = 97\n").contains("must be even"));
    let missing = not_ready("[isp]\npreset = \"nowhere\"\n");
    assert!(missing.contains("nowhere") && missing.contains("automotive"), "{missing}");
}

/// What is said of an experiment that cannot be made ready.
fn not_ready(isp: &str) -> String {
    let assets = library();
    let text = format!("{isp}[[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"isp\"]\n");
    let setup = Setup::new(Experiment::parse(&text).unwrap(), &assets, Device::flex().autodiff());
    setup.err().unwrap().to_string()
}

/// An ISP of which this program knows nothing but its pictures: the green pixel of each block of four, with a gain and a gamma.
struct Foreign;

impl Isp for Foreign {
    fn name(&self) -> &str {
        "a foreign ISP"
    }

    fn parameters(&self) -> Vec<IspParameter> {
        let parameter = |name: &str, min, max, default| {
            let text = format!(
                "name = \"{name}\"\nmin = {min:?}\nmax = {max:?}\ndefault = {default:?}\nsentence = \"\"\n"
            );
            let text = format!("name = \"foreign\"\ncommand = [\"true\"]\n[[parameter]]\n{text}");
            parse_external_isp(&text).unwrap().parameters.remove(0)
        };
        vec![parameter("tone.gain", 0.25, 4.0, 0.6), parameter("tone.gamma", 1.0, 3.0, 1.4)]
    }

    fn develop(&self, frame: &RawInput, values: &[f64]) -> Result<RgbPicture, IspError> {
        let (height, width) = (frame.height, frame.width);
        let light = |i: usize| {
            let (row, col) = (i / width / 2 * 2, i % width / 2 * 2 + 1);
            let dn = f64::from(frame.dn[row * width + col.min(width - 1)]);
            (dn - frame.about.black_dn) / (frame.about.white_dn - frame.about.black_dn)
        };
        let tone = |i: usize| (values[0] * light(i)).clamp(0.0, 1.0).powf(1.0 / values[1]);
        let plane: Vec<u16> = (0..height * width).map(|i| (tone(i) * 65535.0).round() as u16).collect();
        Ok(RgbPicture { height, width, bits: 16, data: plane.repeat(3) })
    }
}

/// A variant that moves the ISP, and then the lens with it, and the description that the experiment names.
fn foreign_setup(folder: &Path, isp: &str, variant: &str) -> Result<Setup, DesignError> {
    let description = folder.join("lab.toml");
    let text = "name = \"a\"\ncommand = [\"true\"]\n[[parameter]]\nname = \"tone.gain\"\nmin = 0\nmax = 1\ndefault = 1\nsentence = \"\"\n";
    std::fs::write(&description, text).unwrap();
    let assets = library().with_external_isps(Arc::new(|_| {
        let defaults = Foreign.defaults();
        Ok(OutsideIsp { isp: Arc::new(Foreign), values: defaults, description: "version 1".to_owned() })
    }));
    let text = format!(
        "[psf]\nfields = 5\npupil_cells = 32\nscoring_pupil_cells = 32\nscoring_pupil_error = 2.0\n\
         [training]\ncrop = 64\nbatch = 2\n[isp]\npreset = {:?}\n{isp}{variant}",
        description.display().to_string()
    );
    Setup::new(Experiment::parse(&text).unwrap(), &assets, Device::flex().autodiff())
}

const FOREIGN: &str = "vary = [\"tone\"]\nproxy_steps = 2\nproxy_warm_up = 20\n";

#[test]
fn an_isp_outside_this_program_moves_by_evolution_and_leads_lens_and_itself_by_a_network() {
    let folder = tempfile::tempdir().unwrap();
    let stages = "[[variant]]\nname = \"a\"\n\
        [[variant.stage]]\nmoves = [\"isp\"]\nschedule.isp = { method = \"proxy\", steps = 21 }\n\
        [[variant.stage]]\nmoves = [\"optics\", \"isp\"]\nschedule.isp = { method = \"proxy\", steps = 3 }\n";
    let setup = foreign_setup(folder.path(), FOREIGN, stages).unwrap();
    let camera = setup.camera(setup.nominal().lens_file.lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 0).unwrap();
    // Twice as bright as it is now, so that the gain has somewhere to go.
    let loss = |_: &Camera, frames: &Frames, _: &[Shot]| {
        let total = (frames.finished.clone() - 0.8).powi_scalar(2).mean();
        let value = f64::from(to_host(total.clone())?[0]);
        Ok(NamedLoss { total, parts: vec![("total", value)] })
    };
    let further = |number: u64| setup.training_shots(&camera, number);
    let batch = || Batch { further: &further, ..Batch::new(&camera, &shots, QUIET, &loss) };
    let by_itself = |isp: &IspBlock| {
        let camera = camera.with_chip(ChipValues::Exact(isp.values()));
        let frames = camera.take(&shots, &QUIET).unwrap();
        loss(&camera, &frames, &shots).unwrap().parts[0].1
    };

    // Without any gradient.
    let mut evolved = setup.isp().unwrap();
    evolved.begin_stage(true);
    let before = by_itself(&evolved);
    for _ in 0..6 {
        evolved.step(&batch(), rule(StepMethod::Evolution)).unwrap();
    }
    assert!(by_itself(&evolved) < 0.9 * before, "{before} {}", by_itself(&evolved));

    // Nothing leads a lens down a gradient before a network has learnt; a search needs none.
    let mut isp = setup.isp().unwrap();
    let mut optics = setup.blocks(&setup.variants[0]).unwrap().optics;
    optics.begin_stage(true);
    let developed = camera.with_chip(ChipValues::Exact(isp.values()));
    let searched =
        optics.step(&Batch { camera: &developed, ..batch() }, rule(StepMethod::Evolution)).unwrap();
    assert!(searched["total"] > 0.0 && optics.coordinates() != setup.nominal().space.start());
    let device = &camera.body().device;
    let gradient = |isp: &IspBlock| {
        let held = camera.with_chip(isp.held(device));
        optics.gradient(&Batch { camera: &held, ..batch() })
    };
    isp.begin_stage(true);
    assert!(matches!(gradient(&isp), Err(DesignError::NoGradient(_))));
    assert!(matches!(isp.step(&batch(), rule(StepMethod::Gradient)), Err(DesignError::NoGradient(_))));
    for _ in 0..20 {
        isp.step(&batch(), rule(StepMethod::Proxy)).unwrap();
    }
    // So far the network has learnt and the parameters have rested. From the next step on it leads, also in the stage that follows.
    assert_eq!(isp.values(), Foreign.defaults());
    isp.step(&batch(), rule(StepMethod::Proxy)).unwrap();
    isp.begin_stage(true);
    for _ in 0..8 {
        isp.step(&batch(), rule(StepMethod::Proxy)).unwrap();
    }
    assert!(by_itself(&isp) < 0.98 * before, "{before} {}", by_itself(&isp));
    let slopes = gradient(&isp).unwrap().1;
    assert!(slopes.iter().all(|s| s.is_finite()) && slopes.iter().any(|s| *s != 0.0), "{slopes:?}");
}

#[test]
fn what_an_isp_without_gradient_cannot_do_is_refused_before_anything_runs() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |isp: &str, stages: &str| {
        let variant = format!("[[variant]]\nname = \"a\"\n{stages}");
        foreign_setup(folder.path(), isp, &variant).err().unwrap().to_string()
    };
    let stage = |moves: &str, more: &str| format!("[[variant.stage]]\nmoves = [{moves}]\n{more}\n");
    let by_proxy = "schedule.isp.method = \"proxy\"";
    let message = refused(FOREIGN, &stage("\"isp\"", ""));
    assert!(message.contains("has no gradient") && message.contains("method = \"proxy\""), "{message}");
    // A network that has learnt nothing must not lead a lens, nor one that has been forgotten.
    let message = refused(FOREIGN, &stage("\"optics\", \"isp\"", by_proxy));
    assert!(message.contains("moves the lens") && message.contains("proxy_warm_up = 20"), "{message}");
    let taught = stage("\"isp\"", "schedule.isp = { method = \"proxy\", steps = 21 }");
    let message = refused(FOREIGN, &format!("{taught}{}", stage("\"optics\"", "")));
    assert!(message.contains("stage 2") && message.contains("moves the lens"), "{message}");
    let searches = stage(
        "\"optics\", \"isp\"",
        "schedule.optics.method = \"evolution\"\nschedule.isp.method = \"evolution\"",
    );
    foreign_setup(folder.path(), FOREIGN, &format!("[[variant]]\nname = \"a\"\n{searches}")).unwrap();
    let message = refused("", &stage("\"isp\"", by_proxy));
    assert!(message.contains("`bayer_denoise`") && message.contains("tone.gain, tone.gamma"), "{message}");
}
