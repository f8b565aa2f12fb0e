//! A fourth variant and a further score take a few lines of TOML and the score below.

mod light;
mod restored;
mod validation;

use std::path::Path;
use std::sync::Arc;

use crate::common::{Silent, data_folder, library, setup_of};
use petzval_base::Cancel;
use petzval_camera::sensor::NoiseMode;
use petzval_design::block::OpticsBlock;
use petzval_design::design_loop::{DesignLoop, Ending};
use petzval_design::experiment::{
    BlockName, Experiment, FieldOfView, LensGoal, LensSearch, NetworkRole, Stage,
};
use petzval_design::inputs::keep_inputs;
use petzval_design::run::{CameraMetrics, Metrics, RunFolder, read_events};
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_design::task::pictures::PictureJudge;
use petzval_learn::Device;
use petzval_learn::score::{Score, ScoreError, ScoredPair, standard_scores};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::psf::{PerfectImage, PsfKind};
use petzval_optics::spot::mean_square_spot;

/// The mean absolute difference of sRGB-encoded values.
struct MeanAbsoluteError;

impl Score for MeanAbsoluteError {
    fn name(&self) -> &'static str {
        "mean_absolute_error"
    }

    fn title(&self) -> &'static str {
        "MAE"
    }

    fn definition(&self) -> &'static str {
        "mean absolute difference of sRGB-encoded values"
    }

    fn decimals(&self) -> usize {
        4
    }

    fn higher_is_better(&self) -> bool {
        false
    }

    fn of(&self, pair: &ScoredPair) -> Result<f64, ScoreError> {
        let differences = pair.finished.data.iter().zip(&pair.truth.data);
        let sum: f64 = differences.map(|(a, b)| f64::from((a - b).abs())).sum();
        Ok(sum / pair.truth.data.len() as f64)
    }
}

/// An experiment that runs in about a second.
const TINY: &str = r#"
name = "tiny"
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
batch = 1
crop = 64
[optics]
steps = 3
[scoring]
places_per_side = 1
crop = 64
"#;

const NETWORK: &str = "[[variant.stage]]\nmoves = [\"network\"]\n";

const SPOT: &str = "[[variant.stage]]\ngoal = \"spot\"\nmoves = [\"optics\"]\n";

const JOINT: &str = "[[variant.stage]]\nmoves = [\"optics\", \"network\"]\n";

fn variant(name: &str, more: &str) -> String {
    format!("[[variant]]\nname = \"{name}\"\n{more}")
}

/// Runs an experiment to its end with the further score.
fn run(experiment: Experiment, folder: &Path) -> Metrics {
    let assets = library();
    let setup = Setup::new(experiment, &assets, Device::flex().autodiff()).unwrap();
    let folder = RunFolder::create(folder).unwrap();
    let setup = Arc::new(setup);
    let mut scores = standard_scores(&setup.lpips().unwrap());
    scores.push(Box::new(MeanAbsoluteError));
    let judge = PictureJudge::new(&setup.experiment, scores).unwrap();
    let scorer = Scorer::with_judge(setup, judge);
    keep_inputs(&scorer, &assets, &folder, None).unwrap();
    let design = DesignLoop::new(folder, scorer).unwrap();
    match design.run(&mut Silent).unwrap() {
        Ending::Finished(metrics) => *metrics,
        Ending::Stopped(step) => panic!("stopped at {step}"),
    }
}

#[test]
fn a_fourth_variant_and_a_further_score_are_toml_and_one_file() {
    let scores = "scores = [\"psnr_db\", \"mean_absolute_error\"]\n";
    let three = [
        variant("nominal", NETWORK),
        variant("spot-optimised", &format!("{SPOT}{NETWORK}")),
        variant("end-to-end", JOINT),
    ]
    .concat();
    let slowly = "schedule.optics.learning_rate = 1e-6\n";
    let fourth = variant("refined", &format!("from = \"spot-optimised\"\n{JOINT}{slowly}"));
    let text = format!("{TINY}{scores}{three}{fourth}");
    let folder = tempfile::tempdir().unwrap();
    let all = run(Experiment::parse(&text).unwrap(), &folder.path().join("all"));
    let names: Vec<&str> = all.rows.iter().map(|r| r.camera.as_str()).collect();
    assert_eq!(names, ["nominal", "spot-optimised", "end-to-end", "refined"]);
    for row in &all.rows {
        assert_eq!(row.scores.keys().collect::<Vec<_>>(), ["mean_absolute_error", "psnr_db"]);
        assert!(row.scores["mean_absolute_error"] > 0.0 && row.scores["mean_absolute_error"] < 1.0);
    }
    let spot = |name: &str| all.rows.iter().find(|r| r.camera == name).unwrap().rms_spot_um;
    // It goes on from where the other variant ended, not from the nominal lens: its own steps are too short to be seen.
    let step = (spot("spot-optimised") - spot("nominal")).abs();
    let own = (spot("refined") - spot("spot-optimised")).abs();
    assert!(own < 0.01 * step, "{own} {step}");

    // A variant alone, or at another place of the list, is the same camera to the last bit.
    let alone = Experiment::parse(&text).unwrap().only(&["end-to-end"]).unwrap();
    let alone = run(alone, &folder.path().join("alone"));
    assert_eq!(alone.rows, all.rows[2..3]);
    let only = Experiment::parse(&text).unwrap().only(&["refined"]).unwrap();
    let names: Vec<&str> = only.variant.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["spot-optimised", "refined"]);
}

#[test]
fn variants_that_cannot_be_made_are_refused_with_a_hint() {
    let refused = |variants: &str| Experiment::parse(&format!("{TINY}{variants}")).unwrap_err().to_string();
    for (variants, words) in [
        (variant("a", ""), "missing"),
        (variant("a/b", NETWORK), "folder"),
        (variant("a", NETWORK).repeat(2), "two variants"),
        (variant("a", &format!("from = \"b\"\n{NETWORK}")), "no earlier variant"),
        (variant("a", "[[variant.stage]]\nmoves = []\n"), "moves no block"),
        (variant("a", "[[variant.stage]]\nmoves = [\"network\", \"network\"]\n"), "moves twice"),
        (variant("a", &format!("{NETWORK}schedule.optics.steps = 7\n")), "does not move"),
        (variant("a", &format!("{NETWORK}schedule.network.learning_rate = -0.5\n")), "must lie between"),
        (variant("a", "[[variant.stage]]\ngoal = \"spot\"\nmoves = [\"network\"]\n"), "lens alone"),
        (variant("a", &format!("{SPOT}schedule.optics.steps = 3\n{NETWORK}")), "takes no schedule"),
        (variant("a", "[[variant.stage]]\nmoves = [\"isp\"]\n"), "isp"),
        (variant("a", &format!("noise = \"exact\"\n{JOINT}")), "no gradient to the lens"),
        (variant("a", &format!("noise = \"loud\"\n{JOINT}")), "loud"),
        (
            variant("a", &format!("perfect_image = \"point\"\n{NETWORK}")),
            "not said to be without aberrations",
        ),
        (variant("a", &format!("lens = \"perfect\"\nperfect_image = \"disk\"\n{NETWORK}")), "airy-disk"),
    ] {
        let said = refused(&variants);
        assert!(said.contains(words), "{variants}: {said}");
    }
}

#[test]
fn an_unknown_score_is_refused_with_the_known_ones() {
    let setup = setup_of(&format!("{TINY}scores = [\"beauty\"]\n"));
    let scores = standard_scores(&setup.lpips().unwrap());
    let error = PictureJudge::new(&setup.experiment, scores).err().unwrap();
    assert!(error.is_input() && error.to_string().contains("psnr_db"), "{error}");
}

/// The spot-optimised lens of the main job: converged, makeable, and the same to the bit. Its fields reach 15.8 degrees, which the lens
/// images in the corner of the sensor; to 14.8 degrees the spots would be 6.84 um.
#[test]
fn spots_are_minimised_to_convergence_under_the_requirements() {
    let setup = setup_of("");
    let minimised = || {
        let mut block = OpticsBlock::new(setup.start(&setup.variants[0]).clone(), 1.0);
        let mut iterations = 0;
        let losses = block.improve(
            LensGoal::Spot,
            setup.experiment.spot.iterations,
            LensSearch::default(),
            &mut |_| {
                iterations += 1;
                Ok(())
            },
            &Cancel::default(),
        );
        (losses.unwrap(), iterations, block.lens().unwrap())
    };
    let (losses, iterations, lens) = minimised();
    assert!(losses["rms_spot_um"] < 7.30, "{losses:?}");
    assert!(losses["penalty_mm2"] < 1e-12, "{losses:?}");
    assert!(iterations < setup.experiment.spot.iterations, "{iterations}");
    assert_eq!(minimised(), (losses.clone(), iterations, lens.clone()));
    // The coordinates of the block say the same lens.
    let requirements = &setup.nominal().requirements;
    assert!(
        requirements.violations(&lens, FieldOfView::Held).unwrap().iter().all(|(square, _)| *square < 1e-12)
    );
    let (square_um2, _) = mean_square_spot(&lens, &setup.nominal().spot_fields_rad).unwrap();
    assert!((square_um2.sqrt() / losses["rms_spot_um"] - 1.0).abs() < 0.02, "{}", square_um2.sqrt());
}

#[test]
fn a_variant_that_starts_from_another_has_its_lens_and_counts_its_steps() {
    let parent = variant("parent", &format!("lens = \"cooke-triplet-spot\"\n{NETWORK}"));
    let text = format!("{TINY}{parent}{}", variant("child", &format!("from = \"parent\"\n{NETWORK}")));
    let folder = tempfile::tempdir().unwrap();
    let metrics = run(Experiment::parse(&text).unwrap(), folder.path());
    let [parent, child] = &metrics.rows[..] else { panic!("two rows") };
    assert_eq!((parent.network_steps, child.network_steps), (4, 8));
    assert_eq!(parent.rms_spot_um, child.rms_spot_um);
    let lens =
        |name: &str| std::fs::read_to_string(folder.path().join("cameras").join(name).join("lens.toml"));
    assert!(lens("parent").unwrap() == lens("child").unwrap());
}

#[test]
fn a_lens_without_variables_stays_in_a_control_and_moves_near_its_own_numbers() {
    let assets = library();
    let setup = |lens: &str, stage: &str| {
        let text = format!("{TINY}{}", variant("a", &format!("lens = \"{lens}\"\n{stage}")));
        Setup::new(Experiment::parse(&text).unwrap(), &assets, Device::flex().autodiff())
    };
    let [stays, moves] = [NETWORK, JOINT].map(|stage| setup("eight-element-achromat", stage).unwrap());
    let file = |setup: &Setup| setup.start(&setup.variants[0]).lens_file.clone();
    assert!(file(&stays).variables.is_empty() && file(&stays).efl_solve.is_none());
    let (before, after) = (file(&stays), file(&moves));
    assert_eq!(before.lens.surfaces, after.lens.surfaces);
    assert!(after.efl_solve.is_some() && after.variables.len() > 8, "{:?}", after.variables);
    for v in &after.variables {
        let value = v.number.read_stated(&after.lens, v.surface);
        assert!(v.min < value && value < v.max, "{v:?} {value}");
    }
    // A thin lens has nothing that could move.
    let refused = setup("perfect", JOINT).err().unwrap().to_string();
    assert!(refused.contains("no variables"), "{refused}");
}

/// Beside lenses without diffraction a perfect lens has none, unless its variant says so; what starts from the variant has it as well.
#[test]
fn a_perfect_lens_is_a_point_or_an_airy_disk() {
    let image = |text: &str, name: &str| {
        let variants = Experiment::parse(&format!("{TINY}{text}")).unwrap().variants();
        variants.iter().find(|v| v.name == name).unwrap().perfect_image
    };
    let perfect = |more: &str| variant("a", &format!("lens = \"perfect\"\n{more}{NETWORK}"));
    assert_eq!(image(&perfect(""), "a"), PerfectImage::Point);
    let disk = perfect("perfect_image = \"airy-disk\"\n");
    assert_eq!(image(&disk, "a"), PerfectImage::AiryDisk);
    let child = |more: &str| format!("{disk}{}", variant("b", &format!("from = \"a\"\n{more}{NETWORK}")));
    assert_eq!(image(&child(""), "b"), PerfectImage::AiryDisk);
    assert_eq!(image(&child("lens = \"perfect\"\n"), "b"), PerfectImage::Point);
    let waves = TINY.replace("[psf]\n", "[psf]\nkind = \"diffraction\"\n");
    assert_ne!(waves, TINY);
    let by_waves = Experiment::parse(&format!("{waves}{}", perfect(""))).unwrap().variants();
    assert_eq!(by_waves[0].perfect_image, PerfectImage::AiryDisk);

    let setup = |text: &str| setup_of(&format!("{TINY}{text}"));
    let brightest = |setup: &Setup| {
        let variant = &setup.variants[0];
        let lens = setup.start(variant).lens_file.lens.clone();
        let [at_rest, moving] = [false, true].map(|is_moving| {
            let camera = setup.camera_of(variant, lens.clone(), is_moving).unwrap();
            camera.psfs().bank().values.iter().copied().fold(0.0, f32::max)
        });
        assert_eq!(at_rest, moving);
        at_rest
    };
    // A point between four cells gives a quarter of its light to each.
    assert!((brightest(&setup(&perfect(""))) - 0.25).abs() < 1e-6);
    assert!(brightest(&setup(&disk)) < 0.24);
}

#[test]
fn every_built_in_experiment_says_whether_its_psfs_are_by_rays_or_by_waves() {
    for entry in std::fs::read_dir(data_folder().join("experiments")).unwrap() {
        let path = entry.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        let table: toml::Table = text.parse().unwrap();
        let kind = table["psf"].get("kind").and_then(|kind| kind.as_str()).map(str::to_owned);
        assert!(kind.is_some(), "{}", path.display());
        // A detector learns behind an Airy disk, and a perfect camera by rays has a point.
        for variant in Experiment::parse(&text).unwrap().variants() {
            let has_disk = variant.name == "trained" || kind.as_deref() == Some("diffraction");
            let wanted = if has_disk { PerfectImage::AiryDisk } else { PerfectImage::Point };
            if variant.lens == "perfect" {
                assert_eq!(variant.perfect_image, wanted, "{}: {}", path.display(), variant.name);
            }
        }
    }
}

/// Networks start from weights that learnt behind PSFs of the experiment's kind, or of the kind that it names.
#[test]
fn built_in_weights_are_those_for_the_psfs_of_the_experiment() {
    let assets = library();
    let [rays, waves] = ["restoration_naf", "restoration_naf_waves"]
        .map(|name| std::fs::read(data_folder().join(format!("weights/{name}.safetensors"))).unwrap());
    assert_ne!(rays, waves);
    let started = |kind: PsfKind, weights: &str| {
        let mut experiment = assets.experiment("cooke-triplet-image-quality").unwrap();
        experiment.psf.kind = kind.into();
        experiment.network.weights = weights.to_owned();
        let setup = Setup::without_windows(experiment, &assets, Device::flex().autodiff()).unwrap();
        assert!(setup.experiment.network.has_built_in_weights());
        setup.task.given_weights().unwrap().to_vec()
    };
    assert_eq!(started(PsfKind::Geometric, "built-in"), rays);
    assert_eq!(started(PsfKind::Diffraction, "built-in"), waves);
    assert_eq!(started(PsfKind::Diffraction, "built-in-rays"), rays);
    assert_eq!(started(PsfKind::Geometric, "built-in-waves"), waves);
    // Cameras that are scored with other PSFs keep the weights from which they started.
    let mut network = assets.experiment("cooke-triplet-image-quality").unwrap().network;
    network.pin_weights(PsfKind::Diffraction);
    assert_eq!(started(PsfKind::Geometric, &network.weights), waves);
}

#[test]
fn an_extension_adds_a_stage_to_every_variant_that_trains_the_network() {
    let text = [
        variant("unequal", &format!("{NETWORK}schedule.network.steps = 6\n")),
        variant("lens-only", SPOT),
        variant("end-to-end", &format!("{SPOT}{JOINT}schedule.optics.learning_rate = 0.5\n")),
    ];
    let experiment = Experiment::parse(&format!("{TINY}{}", text.concat())).unwrap();
    let longer = experiment.extended_to(8, NetworkRole::Finishes).unwrap();
    let steps = |e: &Experiment| {
        let of = |v: &petzval_design::experiment::Variant| {
            [v.steps_of(BlockName::Network), v.task_steps_of(BlockName::Optics)]
        };
        e.variants().iter().map(of).collect::<Vec<_>>()
    };
    assert_eq!(steps(&experiment), [[6, 0], [0, 0], [4, 3]]);
    assert_eq!(steps(&longer), [[8, 0], [0, 0], [8, 6]]);
    assert_eq!(longer.variant[1], experiment.variant[1]);
    let added = &longer.variant[2].stage[2].schedule[&BlockName::Optics];
    assert_eq!((added.steps, added.learning_rate), (Some(3), Some(0.5)));
    // The file of the longer experiment says the same, and another extension goes on from there.
    assert_eq!(Experiment::parse(&longer.to_toml().unwrap()).unwrap(), longer);
    assert_eq!(longer.extended_to(8, NetworkRole::Finishes).unwrap(), longer);
    assert_eq!(steps(&longer.extended_to(10, NetworkRole::Finishes).unwrap()), [[10, 0], [0, 0], [10, 8]]);
    assert_eq!(longer.differences(&experiment).len(), 2);

    assert!(
        experiment
            .extended_to(5, NetworkRole::Finishes)
            .unwrap_err()
            .0
            .contains("`unequal` has 6 network steps already")
    );
    let child = variant("child", &format!("from = \"unequal\"\n{NETWORK}"));
    let chain = Experiment::parse(&format!("{TINY}{}{child}", text[0])).unwrap();
    assert!(
        chain
            .extended_to(9, NetworkRole::Finishes)
            .unwrap_err()
            .0
            .contains("`child` starts from the finished `unequal`")
    );
}

#[test]
fn a_camera_made_without_noise_is_scored_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let scored = |name: &str, text: &str| {
        run(Experiment::parse(text).unwrap(), &folder.path().join(name)).rows.remove(0)
    };
    let own = scored("own", &format!("{TINY}{}", variant("a", &format!("noise = \"off\"\n{JOINT}"))));
    // Training alone is without noise: as where the whole experiment trains so.
    let joint = variant("a", JOINT);
    let noisy = scored("noisy", &format!("{TINY}{joint}"));
    let quiet = TINY.replace("[training]\n", "[training]\nnoise = \"off\"\n");
    assert_eq!(scored("quiet", &format!("{quiet}{joint}")), own);
    assert_ne!(noisy.scores, own.scores);
    assert_eq!(noisy.rms_spot_by_field_um.len(), own.rms_spot_by_field_um.len());
}

#[test]
fn the_lens_in_the_middle_of_its_bounds_keeps_the_focal_length() {
    let text = format!("{TINY}{}", variant("a", &format!("lens = \"box-centre\"\n{NETWORK}")));
    let setup = setup_of(&text);
    let (start, nominal) = (setup.start(&setup.variants[0]), setup.nominal());
    let lens = &start.lens_file.lens;
    for v in &start.lens_file.variables {
        let (value, middle) = (v.number.read_stated(lens, v.surface), 0.5 * (v.min + v.max));
        assert!((value - middle).abs() < 1e-9 * (v.max - v.min), "{v:?}: {value}");
    }
    let efl_mm = |lens: &Lens| first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
    assert!((efl_mm(lens) - efl_mm(&nominal.lens_file.lens)).abs() < 1e-9);
    // It is a lens that can be made, and is scored.
    let folder = tempfile::tempdir().unwrap();
    let row = run(Experiment::parse(&text).unwrap(), folder.path()).rows.remove(0);
    assert!(row.rms_spot_um > 12.0 && !row.is_ceiling, "{}", row.rms_spot_um);
}

/// `sequential` moves each block as often as the joint design, from a lens that was improved as often; `noise-off` alone is made without noise.
#[test]
fn built_in_controls_take_the_steps_of_the_joint_design() {
    let assets = library();
    for (name, last) in [
        ("cooke-triplet-image-quality-controls", vec![BlockName::Network]),
        ("cooke-triplet-image-quality-hardware-isp", vec![BlockName::Isp]),
        ("pedestrian-vehicle-controls", vec![BlockName::Isp, BlockName::Network]),
    ] {
        let variants = assets.experiment(name).unwrap().variants();
        let called = |wanted: &str| variants.iter().find(|v| v.name == wanted).unwrap();
        let [sequential, joint] = ["sequential", "end-to-end"].map(called);
        for block in BlockName::ALL {
            assert_eq!(sequential.task_steps_of(block), joint.task_steps_of(block), "{name}: {block:?}");
        }
        // What is behind the lens, the lens, what is behind it.
        let task = sequential.stages.iter().filter_map(|stage| match stage {
            Stage::Task(moves) => Some(moves.keys().copied().collect::<Vec<_>>()),
            Stage::Lens { .. } => None,
        });
        assert_eq!(task.collect::<Vec<_>>(), [last.clone(), vec![BlockName::Optics], last]);
        let before = |stages: &[Stage]| stages.iter().take_while(|s| matches!(s, Stage::Lens { .. })).count();
        assert_eq!(before(&sequential.stages), before(&joint.stages));
    }
    for name in ["cooke-triplet-image-quality-controls", "pedestrian-vehicle-controls"] {
        let variants = assets.experiment(name).unwrap().variants();
        let called = |wanted: &str| variants.iter().find(|v| v.name == wanted).unwrap();
        let [off, joint] = ["noise-off", "end-to-end"].map(called);
        assert_eq!((off.noise, joint.noise), (NoiseMode::Off, NoiseMode::Dequantised));
        assert_eq!(off.stages.last(), joint.stages.last());
    }
}

#[test]
fn errors_of_a_lens_change_its_way_and_small_ones_hardly() {
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str, share: f64| {
        let schedule = format!("schedule = {{ optics = {{ error_share = {share} }} }}\n");
        let text = format!("{TINY}{}", variant("a", &format!("{JOINT}{schedule}")));
        run(Experiment::parse(&text).unwrap(), &folder.path().join(name)).rows.remove(0)
    };
    let (drawn, robust, near) = (made("drawn", 0.0), made("robust", 0.01), made("near", 1e-7));
    assert_eq!(made("again", 0.01), robust);
    let off = |row: &CameraMetrics| (row.rms_spot_um / drawn.rms_spot_um - 1.0).abs();
    assert!(off(&robust) > 0.02 && off(&near) < 1e-3 && near != drawn, "{} {}", off(&robust), off(&near));
    assert!((drawn.efl_mm - robust.efl_mm).abs() < 1e-9);
    let network = "[[variant.stage]]\nmoves = [\"network\"]\nschedule.network.error_share = 0.01\n";
    let refused = Experiment::parse(&format!("{TINY}{}", variant("a", network))).unwrap_err().to_string();
    assert!(refused.contains("has no errors"), "{refused}");
}

#[test]
fn every_lens_step_says_what_each_coordinate_did_to_the_loss() {
    let folder = tempfile::tempdir().unwrap();
    run(
        Experiment::parse(&format!("{TINY}{}", variant("a", &format!("{SPOT}{JOINT}")))).unwrap(),
        folder.path(),
    );
    let events = read_events(&folder.path().join("events.jsonl")).unwrap();
    for event in &events {
        let is_lens_step = event.block == "optics";
        assert_eq!(event.lowered.len(), if is_lens_step { 19 } else { 0 }, "{event:?}");
        // The first step of Adam is against the sign of every slope.
        assert!(event.lowered.iter().all(|v| v.is_finite()));
    }
    let first = events.iter().find(|e| e.block == "optics").unwrap();
    assert!(first.lowered.iter().all(|v| *v >= 0.0) && first.lowered.iter().any(|v| *v > 0.0), "{first:?}");
}
