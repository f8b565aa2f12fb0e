//! Exposure time and gain as a block: where they go, what of a camera follows them, and what stays.

use std::sync::Arc;

use crate::common::{finished, library, setup_of};
use petzval_camera::sensor::{Noise, NoiseMode};
use petzval_camera::tape::Frames;
use petzval_design::block::{Batch, Block, ExposureBlock};
use petzval_design::camera::{Camera, Shot, to_host};
use petzval_design::design_loop::finished_camera;
use petzval_design::error::DesignError;
use petzval_design::experiment::{BlockName, Experiment, StepMethod, StepRule};
use petzval_design::inputs::keep_inputs;
use petzval_design::report::run_report::{camera_lens, report_of_run};
use petzval_design::run::{Kept, RunFolder, load_blocks};
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_learn::Device;
use petzval_learn::loss::NamedLoss;

const NOISE: Noise = Noise { mode: NoiseMode::Exact, seed: 1 };

/// An experiment that runs in about a second.
const TINY: &str = r#"
[psf]
fields = 3
grid = 64
patches = [2, 2]
pupil_cells = 16
scoring_pupil_cells = 16
scoring_pupil_error = 2.0
[network]
base_channels = 4
levels = 1
[training]
steps = 4
batch = 2
crop = 64
[scoring]
places_per_side = 1
crop = 64
"#;

const MOVES: &str = "[[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"exposure\", \"network\"]\n";

fn setup(more: &str) -> Setup {
    setup_of(&format!("{TINY}{more}"))
}

/// The mean squared error of the finished pictures.
fn loss_of(camera: &Camera, frames: &Frames, shots: &[Shot]) -> Result<NamedLoss, DesignError> {
    let total = (frames.finished.clone() - camera.truths(shots)?).powi_scalar(2).mean();
    let value = f64::from(to_host(total.clone())?[0]);
    Ok(NamedLoss { total, parts: vec![("total", value)] })
}

fn rule(rate: f64) -> StepRule {
    StepRule { method: StepMethod::Gradient, rate, proximal: 0.0 }
}

/// Takes steps of the exposure alone. Returns the losses before the first and the last one.
fn steps(setup: &Setup, block: &mut ExposureBlock, count: usize) -> [f64; 2] {
    let camera = setup.camera(setup.nominal().lens_file.lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 3).unwrap();
    block.begin_stage(true);
    let losses: Vec<f64> = (0..count)
        .map(|step| {
            let camera = camera.exposed_as(&block.exposure());
            let batch = Batch::new(&camera, &shots, NOISE, &loss_of);
            let rate = 0.06 * (1.0 - step as f64 / count as f64);
            block.step(&batch, rule(rate)).unwrap()["total"]
        })
        .collect();
    [losses[0], losses[count - 1]]
}

#[test]
fn time_and_gain_go_where_pictures_are_best() {
    let exposure = |text: &str| format!("[exposure]\n{text}\n{MOVES}");
    // In the dark longer, for the photons.
    let dark = setup(&exposure("white_e = 60.0\ntime_s = 0.001\nlinear_gain = 20.0\nvary = [\"time\"]"));
    let mut block = dark.exposure();
    let [before, after] = steps(&dark, &mut block, 25);
    let found = block.exposure();
    assert!(after < 0.5 * before && found.time_s > 0.005, "{before} {after} {found:?}");
    assert!((found.white_e / 60.0 - found.time_s / 0.001).abs() < 1e-3, "the light stays: {found:?}");

    // Where white saturates, shorter, but no shorter than that.
    let bright = setup(&exposure("white_e = 150000.0\ntime_s = 0.01\nvary = [\"time\"]"));
    let mut block = bright.exposure();
    let [before, after] = steps(&bright, &mut block, 25);
    let capacity_e = bright.body.sensor.light_capacity_e(0.01, 1.0) as f32;
    let found = block.exposure();
    assert!(after < 0.5 * before && found.white_e < 1.5 * capacity_e, "{before} {after} {found:?}");
    assert!(found.white_e > 0.3 * capacity_e, "{found:?} {capacity_e}");

    // A gain of 1 has steps of the converter that are coarser than the noise; a high one saturates at few electrons.
    let coarse = setup(&exposure("white_e = 400.0\nvary = [\"gain\"]"));
    let mut block = coarse.exposure();
    let [before, after] = steps(&coarse, &mut block, 25);
    let found = block.exposure();
    assert!(
        after < before && found.linear_gain > 2.0 && found.white_e == 400.0,
        "{before} {after} {found:?}"
    );
    let white_fits = coarse.body.sensor.light_capacity_e(0.005, found.linear_gain.into());
    assert!(white_fits > 250.0, "{found:?} {white_fits}");
}

#[test]
fn a_stage_goes_on_with_the_same_bits() {
    let setup = setup(&format!("[exposure]\nwhite_e = 500.0\nvary = [\"time\", \"gain\"]\n{MOVES}"));
    let camera = setup.camera(setup.nominal().lens_file.lens.clone(), true).unwrap();
    let shots = setup.training_shots(&camera, 0).unwrap();
    let step = |block: &mut ExposureBlock| {
        let camera = camera.exposed_as(&block.exposure());
        let batch = Batch::new(&camera, &shots, NOISE, &loss_of);
        block.step(&batch, rule(0.05)).unwrap()
    };
    let mut whole = setup.exposure();
    let start = whole.exposure();
    step(&mut whole);
    let mut restored = setup.exposure();
    restored.load_numbers(&whole.save_numbers().unwrap()).unwrap();
    restored.load_progress(&whole.save_progress().unwrap()).unwrap();
    for _ in 0..2 {
        assert_eq!(step(&mut whole), step(&mut restored));
    }
    assert_eq!(whole.exposure(), restored.exposure());
    assert!(whole.exposure() != start && whole.changes().count() == 2);
    let other = ExposureBlock::new(start, []);
    assert!(ExposureBlock::load_numbers(&mut restored, &other.save_numbers().unwrap()).is_err());
}

#[test]
fn a_lens_that_gathers_more_light_keeps_its_lead_at_another_time_and_the_truth_stays() {
    let camera = |same: &str| {
        let setup =
            setup(&format!("[exposure]\nwhite_e = 500.0\nsame = \"{same}\"\nvary = [\"time\"]\n{MOVES}"));
        let lens = setup.nominal().lens_file.lens.clone();
        let slow = petzval_optics::lens::Lens { entrance_pupil_mm: 0.5 * lens.entrance_pupil_mm, ..lens };
        (setup.camera(slow, true).unwrap(), setup)
    };
    let longer = |camera: &Camera| {
        let own = ExposureBlock::new(camera.body().truth_exposure, []).exposure();
        camera.exposed_as(&petzval_camera::sensor::Exposure {
            white_e: 4.0 * own.white_e,
            time_s: 4.0 * own.time_s,
            ..own
        })
    };
    for (same, share) in [("electrons", 1.0), ("time", 0.25)] {
        let (own, setup) = camera(same);
        let exposed = longer(&own);
        assert!((own.body().exposure.white_e / (500.0 * share) - 1.0).abs() < 1e-3, "{same}");
        assert!((exposed.body().exposure.white_e / (2000.0 * share) - 1.0).abs() < 1e-3, "{same}");
        assert_eq!(exposed.body().truth_exposure.white_e, 500.0);
        // With another lens it keeps its time.
        let again = exposed.with_lens(own.psfs().lens().unwrap().clone()).unwrap();
        assert_eq!(again.body().exposure, exposed.body().exposure);
        let shots = setup.training_shots(&own, 0).unwrap();
        let truth = |camera: &Camera| to_host(camera.truths(&shots).unwrap()).unwrap();
        assert_eq!(truth(&own), truth(&exposed));
    }
}

#[test]
fn a_run_keeps_the_exposure_of_its_cameras_and_reports_it() {
    let text = "[exposure]\nwhite_e = 100.0\nlinear_gain = 20.0\nvary = [\"time\"]\nsteps = 8\nlearning_rate = 0.1\n";
    let setup = Arc::new(setup(&format!("{text}{MOVES}")));
    let folder = tempfile::tempdir().unwrap();
    let (run, metrics) = finished(&setup, folder.path());
    let row = &metrics.rows[0];
    assert!(row.white_e > 150.0, "{}", row.white_e);
    // The finished camera is there again, with its exposure, and scores the same.
    let (mut exposure, mut network) = (setup.exposure(), setup.network().unwrap());
    let blocks: [&mut dyn Block; 2] = [&mut exposure, &mut network];
    load_blocks(&run.camera("a"), blocks, Kept::Numbers).unwrap();
    let lens = camera_lens(&run, "a").unwrap().lens;
    let camera =
        finished_camera(&setup, &setup.variants[0], lens, &exposure, &setup.isp().unwrap(), &network)
            .unwrap();
    assert_eq!(Scorer::new(setup.clone()).unwrap().score("a", &camera).unwrap().metrics.scores, row.scores);
    std::fs::write(run.environment(), "{}").unwrap();
    let report = report_of_run(&setup, &run, "").unwrap();
    let [change] = &report.cameras[0].setting_changes[..] else { panic!("the time alone moved") };
    assert_eq!((change.parameter.as_str(), change.unit.as_str()), ("exposure.time_s", "s"));
    assert!((change.to / change.from - row.white_e / 100.0).abs() < 1e-5, "{change:?}");
    assert_eq!(setup.variants[0].task_steps_of(BlockName::Exposure), 8);
}

/// A network learns behind lenses and exposures that are drawn for each of its steps, and another run starts from it.
#[test]
fn a_network_that_learnt_behind_many_lenses_is_the_start_of_another_run() {
    let text = "[exposure]\nvary = [\"time\"]\n[[variant]]\nname = \"any\"\n[[variant.stage]]\n\
        moves = [\"optics\", \"exposure\", \"network\"]\n\
        schedule.optics = { method = \"random\", steps = 2, learning_rate = 0.5 }\n\
        schedule.exposure = { method = \"random\", steps = 2, learning_rate = 1.0 }\n\
        schedule.network = { steps = 2 }\n";
    let learnt = Arc::new(setup(text));
    let folder = tempfile::tempdir().unwrap();
    let assets = library();
    let (run, metrics) = finished(&learnt, folder.path());
    // The camera that is scored has the lens and the exposure that are stated.
    let (made, stated) = (camera_lens(&run, "any").unwrap().lens, &learnt.nominal().lens_file.lens);
    for (made, stated) in made.surfaces.iter().zip(&stated.surfaces) {
        assert!((made.shape.curvature - stated.shape.curvature).abs() < 1e-12, "{}", stated.label);
        assert!((made.thickness_mm - stated.thickness_mm).abs() < 1e-9, "{}", stated.label);
    }
    assert_eq!(metrics.rows[0].white_e, f64::from(learnt.body.exposure.white_e));

    let weights = run.camera("any").join("network.safetensors");
    let given = format!("[network]\nweights = \"{}\"\n", weights.display());
    let with = |network: &str| {
        let text = format!("{}{}", TINY.replace("[network]\n", network), MOVES.replace("\"exposure\", ", ""));
        Setup::new(Experiment::parse(&text).unwrap(), &assets, Device::flex().autodiff())
    };
    let started = Arc::new(with(&given).unwrap());
    let bytes = std::fs::read(&weights).unwrap();
    assert_eq!(started.network().unwrap().to_safetensors().unwrap().unwrap(), bytes);
    // The run keeps them, and its configuration names its own copy.
    let kept = RunFolder::create(&folder.path().join("kept")).unwrap();
    keep_inputs(&Scorer::new(started).unwrap(), &assets, &kept, None).unwrap();
    assert_eq!(std::fs::read(kept.input("network.safetensors")).unwrap(), bytes);
    let again = Setup::new(assets.experiment_of_run(&kept).unwrap(), &assets, Device::flex().autodiff());
    assert_eq!(again.unwrap().task.given_weights().unwrap(), bytes);
    // Weights of another size are refused before anything is begun.
    let Err(refused) = with(&format!("{given}kind = \"u-net\"\n")) else {
        panic!("another network takes the weights");
    };
    assert!(format!("{refused:?}").contains("network.kind"), "{refused:?}");
}

#[test]
fn exposures_that_cannot_move_are_refused_with_a_hint() {
    let refused = |text: &str| Experiment::parse(text).unwrap_err().to_string();
    for (exposure, words) in [
        ("vary = [\"time\", \"time\"]", "twice"),
        ("vary = [\"time\"]\ntime_s = 1.0", "does not hold the stated 1"),
        ("vary = [\"gain\"]\ngains = [4.0, 2.0]", "the range 4 to 2"),
        ("vary = [\"aperture\"]", "no such value"),
        ("steps = 5", "the camera has no block `exposure`"),
    ] {
        let said = refused(&format!("{TINY}[exposure]\n{exposure}\n{MOVES}"));
        assert!(said.contains(words) && said.contains("line"), "{exposure}: {said}");
    }
    let streets = "task = \"pedestrian-vehicle\"\n[exposure]\nvary = [\"time\"]\n";
    assert!(refused(&format!("{streets}{MOVES}")).contains("exposed automatically"));
    let random = |moves: &str, schedule: &str| {
        let stage = format!(
            "[[variant.stage]]\nmoves = [{moves}]\nschedule.optics = {{ method = \"random\"{schedule} }}\n"
        );
        refused(&format!("{TINY}[[variant]]\nname = \"a\"\n{stage}"))
    };
    for (moves, schedule, words) in [
        ("\"optics\", \"network\"", "", "need a reach"),
        ("\"optics\", \"network\"", ", learning_rate = 0.5, error_share = 0.01", "have no error_share"),
        ("\"optics\"", ", learning_rate = 0.5", "nothing learns"),
    ] {
        let said = random(moves, schedule);
        assert!(said.contains(words) && said.contains("line"), "{schedule}: {said}");
    }
    let stage = |schedule: &str| {
        format!(
            "{TINY}[[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"optics\", \"network\"]\nschedule.optics = {{ {schedule} }}\n"
        )
    };
    for (schedule, words) in [
        ("method = \"evolution\", learning_rate = 0.1", "has no learning_rate"),
        ("method = \"levenberg\"", "needs learning_rate"),
    ] {
        let said = refused(&stage(schedule));
        assert!(said.contains(words) && said.contains("line"), "{schedule}: {said}");
    }
    // What has no gradient stands behind a lens that needs none.
    for (from, to) in [
        ("batch = 2", "batch = 2\nnoise = \"exact\""),
        ("[scoring]", "[development]\ndemosaic = \"rcd\"\n[scoring]"),
    ] {
        let with = |schedule: &str| stage(schedule).replace(from, to);
        let said = refused(&with(""));
        assert!(said.contains("has no gradient to the lens"), "{said}");
        Experiment::parse(&with("method = \"evolution\"")).unwrap();
    }
    let weights = refused("task = \"traffic-light\"\n[network]\nweights = \"mine.safetensors\"\n");
    assert!(weights.contains("no network for pictures"), "{weights}");
    let method = "[[variant]]\nname = \"a\"\n[[variant.stage]]\nmoves = [\"exposure\", \"network\"]\n\
        schedule = { exposure = { method = \"evolution\" } }\n";
    assert!(
        refused(&format!("{TINY}[exposure]\nvary = [\"time\"]\n{method}"))
            .contains("does not step by this method")
    );
}
