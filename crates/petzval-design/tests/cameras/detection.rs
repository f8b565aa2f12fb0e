//! Cameras that look for objects: streets seen through their lenses, the gradient of a detector's loss by the lens, and a run from its start to
//! its scores.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::{finished, library, setup_of};
use crate::line_integral::Line;
use burn::prelude::*;
use petzval_camera::image::LinearImage;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Noise, NoiseMode};
use petzval_camera::tape::Frames;
use petzval_design::block::{Batch, Block, OpticsBlock, Sight};
use petzval_design::camera::{Camera, ChipValues, Labels, PsfSource, Shot};
use petzval_design::design_loop::zoom_of;
use petzval_design::error::DesignError;
use petzval_design::experiment::{
    DetectorInput, Experiment, FieldOfView, NetworkRole, StepMethod, StepRule, VariantConfig,
};
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_design::run::{Kept, load_blocks};
use petzval_design::setup::Setup;
use petzval_design::task::HeldOut;
use petzval_design::task::objects::seen_windows::{SeenWindow, Stage};
use petzval_learn::Device;
use petzval_learn::dataset::{List, StreetPlan, StreetView};
use petzval_learn::detection::{BBox, Object, Truth};
use petzval_learn::loss::NamedLoss;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::image_height_per_tangent;
use petzval_optics::pupil::chief_ray;

/// An experiment that runs in seconds.
const TINY: &str = r#"
name = "tiny"
task = "pedestrian-vehicle"
[psf]
fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
[street]
windows = 4
held_out = 4
samples = 1
[training]
steps = 4
batch = 2
crop = 96
[optics]
steps = 3
[scoring]
crop = 96
scores = ["ap50", "ap50_vehicle", "ap50_edge"]
"#;

fn setup(more: &str) -> Setup {
    setup_of(&format!("{TINY}{more}"))
}

/// The objects of a window.
fn truth(shot: &Shot) -> &Truth {
    shot.labels.of().unwrap()
}

#[test]
fn windows_are_seen_through_the_chief_rays_of_the_lens() {
    let setup = setup("[[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"network\"]\n");
    let lens = setup.nominal().lens_file.lens.clone();
    let camera = setup.camera(lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 0).unwrap();
    let boxes = |shots: &[Shot]| shots.iter().map(|s| truth(s).objects.len()).sum::<usize>();
    // The same step gives the same windows; other steps give others.
    let again = setup.training_shots(&camera, 0).unwrap();
    assert!(shots.iter().zip(&again).all(|(a, b)| a.scene == b.scene && truth(a) == truth(b)));
    let all: Vec<Shot> = (0..6).flat_map(|step| setup.training_shots(&camera, step).unwrap()).collect();
    assert!(boxes(&all) > 3 && all.iter().any(|shot| shot.scene != shots[0].scene));
    for shot in &all {
        assert!(shot.scene.data.iter().all(|v| v.is_finite() && *v >= 0.0));
        let inside = |v: f32| (0.0..=96.0).contains(&v);
        let corners = truth(shot).objects.iter().flat_map(|o| [o.bbox.x1, o.bbox.y1, o.bbox.x2, o.bbox.y2]);
        assert!(corners.into_iter().all(inside));
    }
    // A lens that moves the image by a fraction of a pixel sees the same objects, at nearly the same places.
    let nearly = lens.with_image_distance(lens.image_distance_mm() + 1e-3);
    let nearly = setup.camera(nearly, true).unwrap();
    let [own, others] = [&camera, &nearly].map(|camera| setup.held_out_shots(camera, &|_| true).unwrap());
    // A few of them are the same as among all.
    let few = setup.held_out_shots(&camera, &|number| number == 1).unwrap();
    assert!(few.len() == 1 && few[0].name == own[1].name && few[0].shot.scene == own[1].shot.scene);
    assert!(own.iter().zip(&others).any(|(a, b)| a.shot.scene != b.shot.scene));
    for (HeldOut { shot: a, .. }, HeldOut { shot: b, .. }) in own.iter().zip(&others) {
        assert_eq!(truth(a).objects.len(), truth(b).objects.len());
        for (a, b) in truth(a).objects.iter().zip(&truth(b).objects) {
            assert!(a.class == b.class && a.bbox.iou(&b.bbox) > 0.8, "{a:?} {b:?}");
        }
    }
    // A lens of a longer focal length sees other windows.
    let assets = library();
    let long = assets.import("cooke-triplet-image-quality-software-isp").unwrap().file.lens;
    let height = |lens: &Lens| image_height_per_tangent(&lens.at_wavelength(lens.reference_um));
    let longer = height(&long) / height(&setup.nominal().lens_file.lens);
    let long = setup.camera(long, true).unwrap();
    let seen = setup.training_shots(&long, 0).unwrap();
    assert!(shots.iter().zip(&seen).all(|(a, b)| a.scene != b.scene));
    // They show as much of the street, on more pixels.
    let [training, scoring] = [setup.training_crops, setup.scoring_crops].map(|crops| crops.scaled(longer));
    let side = scoring.crop;
    assert!(longer > 1.25 && side as f64 > 1.25 * setup.scoring_crops.crop as f64);
    assert!(seen.iter().all(|shot| [shot.scene.height, shot.scene.width] == [training.window(); 2]));
    assert_eq!(training.crop, 2 * ((48.0 * longer).round() as usize));
    // Their objects are the same, larger; the distortion of the two lenses differs a little.
    let (mut whole, mut same) = (0, 0);
    for step in 0..8 {
        let [here, there] = [&camera, &long].map(|camera| setup.training_shots(camera, step).unwrap());
        for (here, there) in here.iter().zip(&there) {
            let is_whole = |b: &BBox| b.x1.min(b.y1) > 4.0 && b.x2.max(b.y2) < 92.0;
            for object in truth(here).objects.iter().filter(|o| is_whole(&o.bbox)) {
                let [x1, y1, x2, y2] = [object.bbox.x1, object.bbox.y1, object.bbox.x2, object.bbox.y2]
                    .map(|side| side * longer as f32);
                let larger = BBox::new(x1, y1, x2, y2);
                let is_it = |o: &Object| o.class == object.class && o.bbox.iou(&larger) > 0.7;
                whole += 1;
                same += usize::from(truth(there).objects.iter().any(is_it));
            }
        }
    }
    assert!(whole >= 5 && same * 10 >= whole * 8, "{same} of {whole}");
    for HeldOut { shot, .. } in setup.held_out_shots(&long, &|_| true).unwrap() {
        let kept = long.kept(&shot);
        assert_eq!([kept.height, kept.width], [side; 2]);
    }
}

#[test]
fn boxes_lie_where_chief_rays_that_are_traced_land() {
    let setup = setup("[[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"network\"]\n");
    let lens = setup.nominal().lens_file.lens.clone();
    let camera = setup.camera(lens.clone(), true).unwrap();
    let (config, crops) = (&setup.experiment.street, &setup.scoring_crops);
    let plan = StreetPlan {
        seed: 1,
        light: config.light,
        busy: config.busy,
        classes: setup.experiment.classes(),
        surfaces: None,
        white_cd_m2: config.white_cd_m2,
        samples: config.samples,
        on_objects: config.on_objects,
        least_side_px: config.least_side_px,
        least_visible: config.least_visible,
    };
    // From the angle to the place, where the program goes from the place to the angle. The corner is at 15.8 degrees; this lens has 6 % distortion.
    let sequence = lens.at_wavelength(lens.reference_um);
    let angles: Vec<f64> = (0..=64).map(|i| f64::from(i) * 0.276 / 64.0).collect();
    let pixel_mm = 1e-3 * setup.body.sensor.pixel_um;
    let radii = |height: &dyn Fn(f64) -> f64| -> Vec<f64> {
        angles.iter().map(|angle| if *angle > 0.0 { height(*angle) / pixel_mm } else { 0.0 }).collect()
    };
    let traced = radii(&|angle| chief_ray(&sequence, angle).unwrap().y_mm);
    let straight = radii(&|angle| image_height_per_tangent(&sequence) * angle.tan());
    let view =
        |radii: &[f64]| StreetView::new(radii, &angles, [crops.sensor_rows, crops.sensor_columns]).unwrap();
    let boxes = |radii: &[f64], number: u64| {
        let view = view(radii);
        let window =
            plan.window(List::HeldOut, config.held_out_families, number, [&view, &view], crops).unwrap();
        (window.at, window.truth.objects)
    };
    let (mut compared, mut distorted) = (0, false);
    for (number, shot) in (0..).zip(setup.held_out_shots(&camera, &|_| true).unwrap()) {
        let found = truth(&shot.shot).objects.clone();
        let (_, expected) = boxes(&traced, number);
        assert_eq!(found.len(), expected.len());
        for (a, b) in found.iter().zip(&expected) {
            let sides = |o: &Object| [o.bbox.x1, o.bbox.y1, o.bbox.x2, o.bbox.y2];
            let is_near = sides(a).iter().zip(sides(b)).all(|(a, b)| (a - b).abs() < 0.1);
            assert!(a.class == b.class && is_near, "{number}: {a:?} {b:?}");
            compared += 1;
        }
        // A lens of the same focal length without distortion would show them elsewhere.
        let on_sensor = |(at, objects): ([usize; 2], Vec<Object>)| -> Vec<BBox> {
            objects.iter().map(|o| o.bbox.moved([at[1] as f32, at[0] as f32])).collect()
        };
        let [there, here] = [boxes(&straight, number), boxes(&traced, number)].map(on_sensor);
        distorted |= there.iter().zip(&here).any(|(a, b)| (a.centre()[0] - b.centre()[0]).abs() > 1.0);
    }
    assert!(compared >= 4 && distorted, "{compared} boxes");
}

#[test]
fn a_detector_leads_the_isp_by_a_network_in_its_place_or_as_a_black_box() {
    let more = "[isp]\npreset = \"real-time\"\nvary = [\"sharpen\"]\nsteps = 3\nproxy_warm_up = 2\nproxy_steps = 1\n\
        [[variant]]\nname = \"by-proxy\"\n\
        [[variant.stage]]\nmoves = [\"isp\"]\nschedule.isp = { method = \"proxy\", steps = 4 }\n\
        [[variant.stage]]\nmoves = [\"optics\", \"isp\"]\nschedule.isp = { method = \"proxy\", steps = 2 }\n\
        [[variant]]\nname = \"by-evolution\"\n\
        [[variant.stage]]\nmoves = [\"isp\", \"network\"]\nschedule.isp = { method = \"evolution\", steps = 2 }\n";
    let setup = Arc::new(setup(more));
    let folder = tempfile::tempdir().unwrap();
    let (run, metrics) = finished(&setup, folder.path());
    let start = setup.isp().unwrap().values();
    for (row, steps) in metrics.rows.iter().zip([6, 2]) {
        assert_eq!(row.isp_steps, steps);
        let mut isp = setup.isp().unwrap();
        load_blocks(&run.camera(&row.camera), [&mut isp as _], Kept::Numbers).unwrap();
        assert!(isp.values() != start, "{}: the parameters stay", row.camera);
        assert!(row.scores["ap50"].is_finite());
    }
    let lens = petzval_design::report::run_report::camera_lens(&run, "by-proxy").unwrap().lens;
    assert!(lens != setup.nominal().lens_file.lens, "the loss reaches the lens through the network");
}

#[test]
fn a_run_trains_a_detector_behind_a_moving_lens_and_scores_what_it_finds() {
    let more = "[isp]\npreset = \"real-time\"\nvary = [\"sharpen\"]\nsteps = 2\n\
        [[variant]]\nname = \"trained\"\n[[variant.stage]]\nmoves = [\"network\"]\n\
        [[variant]]\nname = \"end-to-end\"\nfrom = \"trained\"\nlens = \"cooke-triplet-spot\"\n\
        [[variant.stage]]\nmoves = [\"optics\", \"isp\", \"network\"]\n";
    let setup = Arc::new(setup(more));
    let folder = tempfile::tempdir().unwrap();
    let (run, metrics) = finished(&setup, folder.path());
    let spot = setup.start(&setup.variants[1]).lens_file.lens.clone();
    assert_eq!((metrics.held_out_images, metrics.held_out_places), (4, 1));
    for row in &metrics.rows {
        // A score for which there is nothing to find, such as objects at the edge, is left out.
        assert!(row.scores.contains_key("ap50") && row.scores.values().all(|v| (0.0..=1.0).contains(v)));
        assert!(row.scores.keys().all(|name| ["ap50", "ap50_vehicle", "ap50_edge"].contains(&name.as_str())));
        let [low, high] = row.intervals["ap50"];
        assert!(low <= row.scores["ap50"] && row.scores["ap50"] <= high);
        assert_eq!(row.pictures.len(), 4);
    }
    let [trained, joint] = &metrics.rows[..] else { panic!("two cameras") };
    // The second takes over the detector of the first, and starts from a lens of its own.
    assert_eq!((trained.network_steps, joint.network_steps, joint.isp_steps), (4, 8, 2));
    let lens = petzval_design::report::run_report::camera_lens(&run, "end-to-end").unwrap().lens;
    let moved = lens.surfaces.iter().zip(&spot.surfaces).any(|(a, b)| a.shape != b.shape);
    let away = (joint.efl_mm - trained.efl_mm).abs() / trained.efl_mm;
    assert!(moved && away < 0.02, "{away}");
    // A run that names the weights starts with them.
    let weights = run.camera("trained").join("blocks/network/weights.bin");
    let next = setup_of(&format!("{TINY}{more}[detector]\nweights = {weights:?}\n"));
    let start = next.network().unwrap().save_numbers().unwrap();
    assert!(start["weights.bin"] == std::fs::read(&weights).unwrap());
    for state in ["00-truth.png", "00-end-to-end-output.png"] {
        assert!(run.picture(state).is_file(), "{state}");
    }
}

/// A lens whose field of view is free takes another focal length, with other light at the same exposure time; its control sees enlarged pictures
/// through a lens that stays.
#[test]
fn a_lens_with_a_free_field_has_a_control_that_is_zoomed_like_it() {
    let more = "[exposure]\nsame = \"time\"\n\
        [[variant]]\nname = \"nominal\"\n[[variant.stage]]\nmoves = [\"network\"]\n\
        [[variant]]\nname = \"free\"\nfrom = \"nominal\"\nlens = \"cooke-triplet-nominal\"\nfield = \"free\"\n\
        [[variant.stage]]\nmoves = [\"optics\", \"network\"]\n\
        schedule = { optics = { learning_rate = 0.2 } }\n\
        [[variant]]\nname = \"zoomed\"\nfrom = \"nominal\"\nzoomed_like = \"free\"\n\
        [[variant.stage]]\nmoves = [\"network\"]\nschedule = { network = { steps = 1 } }\n";
    let setup = Arc::new(setup(more));
    let folder = tempfile::tempdir().unwrap();
    let (run, metrics) = finished(&setup, folder.path());
    let [nominal, free, zoomed] = &metrics.rows[..] else { panic!("three cameras") };
    let ratio = free.efl_mm / nominal.efl_mm;
    assert!((ratio - 1.0).abs() > 0.005, "the focal length is free: {ratio}");
    // White has the electrons of the image's brightness.
    assert!((free.white_e / nominal.white_e * ratio * ratio - 1.0).abs() < 1e-6, "{}", free.white_e);
    assert_eq!(zoomed.efl_mm, nominal.efl_mm);
    let lens = petzval_design::report::run_report::camera_lens(&run, "zoomed").unwrap().lens;
    let zoom = zoom_of(&run, &setup.variants[2], &lens).unwrap();
    assert!((zoom / ratio - 1.0).abs() < 1e-9, "{zoom} {ratio}");
    assert_eq!(zoom_of(&run, &setup.variants[0], &lens).unwrap(), 1.0);
    // Alone, it needs the lens like which it is zoomed; and this lens must not move afterwards.
    let names = |of: &Experiment| of.variant.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&setup.experiment.only(&["zoomed"]).unwrap()), ["nominal", "free", "zoomed"]);
    assert_eq!(names(&setup.experiment.only(&["free"]).unwrap()), ["nominal", "free"]);
    let unchained = |v: &VariantConfig| VariantConfig { from: None, ..v.clone() };
    let unchained = Experiment {
        variant: setup.experiment.variant.iter().map(unchained).collect(),
        ..setup.experiment.clone()
    };
    assert!(
        unchained
            .extended_to(9, NetworkRole::Reads)
            .unwrap_err()
            .0
            .contains("`zoomed` is zoomed like the finished `free`")
    );
}

/// A detector that sees the scenes without blur and noise learns and is scored so, also behind a hardware ISP.
#[test]
fn neither_noise_nor_blur_reaches_a_detector_that_sees_the_truth() {
    let variant = |name: &str, more: &str, moves: &str| {
        format!("[[variant]]\nname = \"{name}\"\n{more}\n[[variant.stage]]\nmoves = [{moves}]\n")
    };
    let more = [
        "[isp]\npreset = \"real-time\"\nvary = [\"sharpen\"]\nsteps = 2\n".to_owned(),
        variant("nominal", "", "\"isp\", \"network\""),
        variant("truth", "from = \"nominal\"\nsees = \"truth\"", "\"network\""),
        variant("truth-again", "from = \"nominal\"\nsees = \"truth\"\nnoise = \"off\"", "\"network\""),
        variant("without-noise", "from = \"nominal\"\nnoise = \"off\"", "\"network\""),
    ];
    let setup = Arc::new(setup(&more.concat()));
    let folder = tempfile::tempdir().unwrap();
    let (run, metrics) = finished(&setup, folder.path());
    let [_, truth, again, _] = &metrics.rows[..] else { panic!("four cameras") };
    assert_eq!(truth.scores, again.scores);
    let weights = |camera: &str| std::fs::read(run.camera(camera).join("network.safetensors")).unwrap();
    assert!(weights("truth") == weights("truth-again"));
    assert!(weights("truth") != weights("without-noise"));
    // In scores it sees what others see of the scene.
    let stages = |camera: &str, stages: [Stage; 2]| {
        let path = run.camera(camera).join("objects.json");
        let windows: Vec<SeenWindow> = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        stages.map(|stage| windows.iter().flat_map(|w| w.found[stage as usize].clone()).collect::<Vec<_>>())
    };
    let [scene, finished] = stages("truth", [Stage::Scene, Stage::Finished]);
    assert!(!scene.is_empty() && scene == finished);
    let [scene, finished] = stages("nominal", [Stage::Scene, Stage::Finished]);
    assert!(scene != finished);

    let lens = setup.nominal().lens_file.lens.clone();
    let with_input = |sees: DetectorInput| {
        let mut network = setup.network().unwrap();
        network.set_sight(Sight { sees, zoom: 1.0 });
        network.attached_to(&setup.camera(lens.clone(), true).unwrap())
    };
    let [camera, of_truth] = [DetectorInput::Picture, DetectorInput::Truth].map(with_input);
    let shots = setup.training_shots(&camera, 0).unwrap();
    let noise = Noise { mode: NoiseMode::Exact, seed: 1 };
    let values = |tensor: Tensor<4>| tensor.into_data().try_to_vec::<f32>().unwrap();
    let seen = |camera: &Camera| values(camera.take(&shots, &noise).unwrap().finished);
    let truth = values(camera.truths(&shots).unwrap());
    assert!(seen(&of_truth) == truth && seen(&camera) != truth);
    // A raw frame does not contain it.
    let capture = camera.capture(&shots[0]);
    let raw = |camera: &Camera| camera.finished_raw(vec![100.0; 64 * 64], [64, 64], capture);
    assert!(raw(&camera).is_ok());
    assert!(matches!(raw(&of_truth), Err(DesignError::NoTruth)));
}

/// Variants that contradict themselves are refused where they stand.
#[test]
fn what_a_detector_looks_at_has_its_conditions() {
    let one = "[[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"optics\", \"network\"]\n";
    let refused = |more: &str| Experiment::parse(&format!("{TINY}{one}{more}")).unwrap_err().to_string();
    let stays = "[[variant.stage]]\nmoves = [\"network\"]\n";
    for (variant, stages, wanted) in [
        ("field = \"free\"", stays, "does not move for the task"),
        (
            "field = \"free\"\nfrom = \"a\"",
            "[[variant.stage]]\nmoves = [\"optics\"]\n",
            "`b` has a field that is free, and takes its lens from `a`, whose field is held",
        ),
        ("zoomed_like = \"c\"", stays, "which is no earlier variant"),
        ("zoomed_like = \"a\"", "[[variant.stage]]\nmoves = [\"optics\"]\n", "the lens of `b` moves"),
        (
            "sees = \"truth\"",
            "[[variant.stage]]\nmoves = [\"optics\", \"network\"]\n",
            "its detector sees the truth, which `optics` cannot change",
        ),
        ("sees = \"truth\"", "[[variant.stage]]\nmoves = []\n", "the stage moves no block"),
    ] {
        let said = refused(&format!("[[variant]]\nname = \"b\"\n{variant}\n{stages}"));
        assert!(said.contains(wanted) && said.contains("hint: "), "{said}");
    }
    for (variant, wanted) in [
        ("zoomed_like = \"a\"", "only a detector sees zoomed pictures"),
        ("sees = \"truth\"", "only a detector can see the truth"),
    ] {
        let pictures = format!("{one}[[variant]]\nname = \"b\"\n{variant}\n{stays}");
        let said = Experiment::parse(&pictures).unwrap_err().to_string();
        assert!(said.contains(wanted) && said.contains("line"), "{said}");
    }
}

#[test]
fn a_lens_that_may_magnify_knows_what_that_does_to_the_loss() {
    let more = "[detector]\nkind = \"fcos\"\n\
        [[variant]]\nname = \"a\"\nfield = \"free\"\n[[variant.stage]]\nmoves = [\"optics\", \"network\"]\n";
    let setup = setup(more);
    let start = setup.start(&setup.variants[0]).clone();
    let x = start.space.start().to_vec();
    let camera = setup.camera(start.space.lens_at(&x).unwrap(), true).unwrap();
    let camera = setup.network().unwrap().attached_to(&camera);
    let (step, noise) = (1, Noise { mode: NoiseMode::Off, seed: 1 });
    let shots = setup.training_shots(&camera, step).unwrap();

    // Magnified scenes show the same objects, in boxes that are larger by as much.
    let magnified = |by: f64| setup.magnified_shots(&camera, step, by);
    let same = magnified(1.0).unwrap();
    assert!(shots.iter().zip(&same).all(|(a, b)| a.scene == b.scene && truth(a) == truth(b)));
    let larger = magnified(1.05).unwrap();
    let pairs = shots.iter().zip(&larger).flat_map(|(a, b)| truth(a).objects.iter().zip(&truth(b).objects));
    // An object that an edge of the window cuts off does not grow.
    let inside = |o: &Object| o.bbox.x1 > 0.5 && o.bbox.y1 > 0.5 && o.bbox.x2 < 95.5 && o.bbox.y2 < 95.5;
    let whole: Vec<_> = pairs.filter(|(a, b)| inside(a) && inside(b)).collect();
    assert!(!whole.is_empty());
    for (a, b) in whole {
        assert_eq!(a.class, b.class);
        for (before, after) in [(a.bbox.width(), b.bbox.width()), (a.bbox.height(), b.bbox.height())] {
            assert!((after / before - 1.05).abs() < 0.02, "{a:?} {b:?}");
        }
    }

    // Crops follow the scene, also if a larger window shows one object more or less. Their middles lie 5 % farther from the axis, as far as
    // the sensor reaches. Only the shift of a crop inside its window adds some pixels.
    let side = setup.training_crops.window() as f64;
    let middle = |shot: &Shot| {
        let Placement { row, col } = shot.placement;
        [row as f64 + 0.5 * side - 600.0, col as f64 + 0.5 * side - 960.0]
    };
    for step in 2..14 {
        let seen = setup.training_shots(&camera, step).unwrap();
        let larger = setup.magnified_shots(&camera, step, 1.05).unwrap();
        for (before, after) in seen.iter().zip(&larger).map(|(a, b)| (middle(a), middle(b))) {
            let most = [600.0, 960.0].map(|half| half - 0.5 * side);
            let expected = [0, 1].map(|i| (1.05 * before[i]).clamp(-most[i], most[i]));
            assert!((0..2).all(|i| (after[i] - expected[i]).abs() < 8.0), "{before:?} {after:?}");
        }
    }

    // What the gradient has by way of the magnification is the difference of losses, times what the coordinates do to the focal length.
    let objective = setup.objective().unwrap();
    let loss = |camera: &Camera, frames: &Frames, shots: &[Shot]| -> Result<NamedLoss, DesignError> {
        objective.loss(camera, frames, shots)
    };
    let batch = |magnified| Batch { magnified, ..Batch::new(&camera, &shots, noise, &loss) };
    let block = OpticsBlock::new(start.clone(), 0.0).with_field(FieldOfView::Free);
    let [with, without] = [Some(&magnified as _), None].map(|m| block.gradient(&batch(m)).unwrap().1);
    let value = |by: f64| {
        let shots = magnified(by).unwrap();
        let frames = camera.take(&shots, &noise).unwrap();
        loss(&camera, &frames, &shots).unwrap().parts.last().unwrap().1
    };
    let slope = (value(1.1) - value(0.9)) / (1.1_f64 / 0.9).ln();
    assert!(slope != 0.0);
    let log_height = |x: &[f64]| {
        let lens = start.space.lens_at(x).unwrap();
        image_height_per_tangent(&lens.at_wavelength(lens.reference_um)).ln()
    };
    let mut largest = 0.0_f64;
    for i in 0..x.len() {
        let at = |step: f64| {
            let mut x = x.clone();
            x[i] += step;
            log_height(&x)
        };
        let expected = slope * (at(1e-5) - at(-1e-5)) / 2e-5;
        let found = with[i] - without[i];
        largest = largest.max(expected.abs());
        assert!((found - expected).abs() < 1e-3 * slope.abs(), "{i}: {found} {expected}");
    }
    assert!(largest > 0.01 * slope.abs(), "no coordinate changes the focal length");

    // Its average over the steps of a stage goes on from a checkpoint.
    let rule = StepRule { method: StepMethod::Gradient, rate: 1e-3, proximal: 0.0 };
    let reversed = |by: f64| magnified(2.0 - by);
    let mut whole = OpticsBlock::new(start.clone(), 0.0).with_field(FieldOfView::Free);
    whole.begin_stage(true);
    whole.step(&batch(Some(&magnified)), rule).unwrap();
    let mut resumed = OpticsBlock::new(start.clone(), 0.0).with_field(FieldOfView::Free);
    resumed.load_numbers(&whole.save_numbers().unwrap()).unwrap();
    resumed.load_progress(&whole.save_progress().unwrap()).unwrap();
    for block in [&mut whole, &mut resumed] {
        block.step(&batch(Some(&reversed)), rule).unwrap();
    }
    assert_eq!(whole.coordinates(), resumed.coordinates());
    let progress = |block: &OpticsBlock| {
        let text = block.save_progress().unwrap().remove("progress.json").unwrap();
        serde_json::from_slice::<serde_json::Value>(&text).unwrap()["by_log_magnification"].clone()
    };
    // 0.95 times the first derivative less the second, which is about as large.
    assert!(progress(&whole)["sum"].as_f64().unwrap().abs() < 0.01 * slope.abs() + 1e-3);
    assert_eq!(progress(&whole)["values"], 2);
    whole.begin_stage(true);
    assert_eq!(progress(&whole)["values"], 0);
}

#[test]
fn a_detectors_loss_has_its_gradient_by_the_lens_through_software() {
    gradient_by_the_lens("[development]\ndemosaic = \"bilinear\"\ndomain = \"linear\"\nrestore = false\n");
}

#[test]
fn a_detectors_loss_has_its_gradient_by_the_lens_through_the_hardware_isp() {
    gradient_by_the_lens("[isp]\npreset = \"real-time\"\nvary = [\"sharpen\"]\n");
}

/// Compares the gradient of the loss of a detector of one stage with differences. The proposals of one of two stages jump, so that its own test has
/// the gradient by the picture, for fixed proposals.
fn gradient_by_the_lens(development: &str) {
    let more = format!(
        "{development}[detector]\nkind = \"fcos\"\n\
        [[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"optics\", \"network\"]\n"
    );
    let text = TINY.replace("fields = 3", "fields = 5").replace("pupil_cells = 16", "pupil_cells = 32");
    let setup = setup_of(&format!("{text}{more}"));
    let nominal = setup.nominal().clone();
    let lens_at = |x: &[f64]| nominal.space.lens_at(x).unwrap();
    let x = nominal.space.start().to_vec();
    // The gradient is that at fixed fields.
    let fields = setup.moving_plan.field_angles(&lens_at(&x)).unwrap();
    let network = setup.network().unwrap();
    let camera = |x: &[f64]| -> Camera {
        let plan = PsfPlan { held_fields_rad: Some(fields.clone()), ..setup.moving_plan.clone() };
        let psfs = PsfSource::Traced { lens: Box::new(lens_at(x)), plan }.psfs().unwrap();
        let camera = network.attached_to(&Camera::new(setup.body.clone(), Arc::new(psfs)).unwrap());
        let Some(chip) = &setup.body.chip else { return camera };
        let values: Vec<f32> = chip.values().iter().map(|v| *v as f32).collect();
        let values = Tensor::from_data(values.as_slice(), &Device::flex().autodiff());
        camera.with_chip(ChipValues::OnTape(Box::new(values)))
    };
    let objective = setup.objective().unwrap();
    let loss = |camera: &Camera, frames: &Frames, shots: &[Shot]| -> Result<NamedLoss, DesignError> {
        objective.loss(camera, frames, shots)
    };
    // Waves that reach every frequency the pixels can hold, far off the axis, with objects by decree.
    let side = setup.training_crops.window();
    let wave = |i: usize| {
        let (x, y) = ((i % side) as f32, (i / side % side) as f32);
        0.4 + 0.19 * ((0.5 * x + 0.2 * y).sin() + (0.13 * x - 0.9 * y).cos())
    };
    let data: Vec<f32> = (0..3 * side * side).map(wave).collect();
    let objects = [(10.0, 20.0, 40.0, 80.0, 0), (50.0, 30.0, 90.0, 60.0, 1)];
    let objects = objects.map(|(x1, y1, x2, y2, class)| Object { bbox: BBox::new(x1, y1, x2, y2), class });
    let shot = |row: usize, col: usize| Shot {
        scene: LinearImage { channels: 3, height: side, width: side, data: data.clone() },
        placement: Placement { row, col },
        kept: None,
        frame: 0,
        labels: Labels::new(Truth { objects: objects.to_vec(), ..Truth::default() }),
        follows_light: true,
    };
    let shots = [shot(100, 200), shot(1000, 1700)];
    let noise = Noise { mode: NoiseMode::Off, seed: 1 };
    let gradient = |x: &[f64]| {
        let camera = camera(x);
        let mut block = OpticsBlock::new(nominal.clone(), 0.0);
        let numbers = serde_json::to_vec(x).unwrap();
        block.load_numbers(&BTreeMap::from([("coordinates.json".to_owned(), numbers)])).unwrap();
        block.gradient(&Batch::new(&camera, &shots, noise, &loss)).unwrap().1
    };
    let value = |x: &[f64]| {
        let camera = camera(x);
        let frames = camera.take(&shots, &noise).unwrap();
        loss(&camera, &frames, &shots).unwrap().parts.last().unwrap().1
    };
    // Rectifiers and the interpolation between fields have so many kinks that slopes scatter by a tenth, and the rounding of f32 is 1e-3 of the
    // change along such a line.
    let by_x = gradient(&x);
    let norm = by_x.iter().map(|g| g * g).sum::<f64>().sqrt();
    assert!(norm > 0.0);
    let steepest: Vec<f64> = by_x.iter().map(|g| g / norm).collect();
    let line = Line { point: &x, direction: &steepest, half: 1e-3 };
    let [numeric, analytic] = [line.by_loss(value), line.by_gradients(16, gradient)];
    assert!((analytic / numeric - 1.0).abs() < 0.02, "{analytic} {numeric}");
}
