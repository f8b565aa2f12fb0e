//! A fourth variant and a further score take a few lines of TOML and this one file.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use crate::common::Silent;
use nalgebra::{DMatrix, DVector};
use petzval_base::Cancel;
use petzval_camera::sensor::NoiseMode;
use petzval_design::block::OpticsBlock;
use petzval_design::design_loop::{DesignLoop, Ending};
use petzval_design::error::DesignError;
use petzval_design::experiment::{
    BlockName, Experiment, FieldOfView, LensGoal, LensSearch, NetworkRole, PsfsBy, Stage,
};
use petzval_design::first_look::{FirstLook, first_look};
use petzval_design::fit::{FitOf, fit};
use petzval_design::inputs::keep_inputs;
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_design::lens::restored::RestoredError;
use petzval_design::library::Library;
use petzval_design::run::{CameraMetrics, Event, Metrics, RunFolder, read_events};
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_design::task::Remark;
use petzval_design::task::pictures::PictureJudge;
use petzval_learn::Device;
use petzval_learn::score::{Score, ScoreError, ScoredPair, standard_scores};
use petzval_optics::constraint::{Constraint, passing_share};
use petzval_optics::design_space::SmoothSpace;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::merit::Merit;
use petzval_optics::number::Number;
use petzval_optics::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use petzval_optics::psf::{PerfectImage, PsfKind};
use petzval_optics::solve::thin_equivalent;
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
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let setup = Setup::new(experiment, &assets, Device::flex().autodiff()).unwrap();
    let folder = RunFolder::create(folder).unwrap();
    keep_inputs(&setup, &assets, &folder, None).unwrap();
    let setup = Arc::new(setup);
    let mut scores = standard_scores(&setup.lpips().unwrap());
    scores.push(Box::new(MeanAbsoluteError));
    let judge = PictureJudge::new(&setup.experiment, scores).unwrap();
    let design = DesignLoop::new(folder, Scorer::with_judge(setup, judge)).unwrap();
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
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let experiment = Experiment::parse(&format!("{TINY}scores = [\"beauty\"]\n")).unwrap();
    let setup = Setup::new(experiment, &assets, Device::flex().autodiff()).unwrap();
    let scores = standard_scores(&setup.lpips().unwrap());
    let error = PictureJudge::new(&setup.experiment, scores).err().unwrap();
    assert!(error.is_input() && error.to_string().contains("psnr_db"), "{error}");
}

/// The spot-optimised lens of the main job: converged, makeable, and the same to the bit. Its fields reach 15.8 degrees, which the lens
/// images in the corner of the sensor; to 14.8 degrees the spots would be 6.84 um.
#[test]
fn spots_are_minimised_to_convergence_under_the_requirements() {
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let setup = Setup::new(Experiment::parse("").unwrap(), &assets, Device::flex().autodiff()).unwrap();
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

/// A lens whose first surface cuts the beams of the corner gets no smaller spots by cutting more; one whose stop alone decides has no such requirement.
#[test]
fn clear_apertures_that_cut_light_may_not_cut_more_of_it() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data");
    let library = Library::from_folder(&folder).unwrap();
    let text = std::fs::read_to_string(folder.join("lenses/cooke-triplet-nominal.toml")).unwrap();
    let cut = text.replacen("semi_diameter_mm = 7.733", "semi_diameter_mm = 5.0", 1);
    assert_ne!(cut, text);
    let library = library.with_text("cut.toml".to_owned(), cut);
    let setup = |lens: &str| {
        let mut experiment = Experiment::parse("").unwrap();
        experiment.lens = lens.to_owned();
        Setup::new(experiment, &library, Device::flex().autodiff()).unwrap()
    };
    let is_light = |c: &Constraint| matches!(c, Constraint::Light { .. });
    let whole = setup("cooke-triplet-nominal");
    assert!(!whole.nominal().requirements.constraints().iter().any(is_light));

    let cut = setup("cut.toml");
    let start = cut.nominal();
    let held: Vec<Constraint> = start.requirements.constraints().iter().copied().filter(is_light).collect();
    assert!(!held.is_empty(), "{:?}", start.requirements);
    let mut block = OpticsBlock::new(start.clone(), 1.0);
    let spot = |block: &mut OpticsBlock, iterations| {
        block.improve(LensGoal::Spot, iterations, LensSearch::default(), &mut |_| Ok(()), &Cancel::default())
    };
    let losses = spot(&mut block, 8).unwrap();
    assert!(losses["penalty_mm2"] < 1e-3, "{losses:?}");
    let lens = block.lens().unwrap();
    for constraint in &held {
        let Constraint::Light { field_rad, least, .. } = constraint else { unreachable!() };
        let share = passing_share(&lens, *field_rad).unwrap();
        assert!(share > least - 5e-3, "{field_rad}: {share} {least}");
    }
    // A lens that lost light all the same gets a remark.
    let mut narrow = start.lens_file.lens.clone();
    narrow.surfaces[0].semi_diameter_mm = 4.5;
    let said = start.darker_corner(&start.lens_file.lens, &narrow).unwrap();
    assert!(
        said.starts_with("in the corner of the sensor ") && said.contains("passes the clear apertures"),
        "{said}"
    );
    assert_eq!(start.darker_corner(&narrow, &start.lens_file.lens), None);
}

/// The error after restoration: its gradient, and what a descent from the spot-optimised lens gains.
#[test]
fn a_lens_is_improved_for_the_restoration_of_its_frames() {
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let text = "[psf]\nfields = 7\ngrid = 96\npupil_cells = 48\n";
    let setup = Setup::new(Experiment::parse(text).unwrap(), &assets, Device::flex().autodiff()).unwrap();
    let start = setup.start(&setup.variants[0]);
    // The gradient is that at fixed fields.
    let space = &start.space;
    let x = space.start().to_vec();
    let lens_at = |x: &[f64]| space.lens_at(x).unwrap();
    let fields = setup.moving_plan.field_angles(&lens_at(&x)).unwrap();
    let plan = PsfPlan { held_fields_rad: Some(fields), ..setup.moving_plan.clone() };
    let merit = start.restored(&plan);
    check_gradient(&merit, space, &x);
    check_lift(&merit, &lens_at(&x), space.space().numbers());
    let mut block = OpticsBlock::new(start.clone(), 1.0);
    let stop = Cancel::default();
    let spot = block.improve(LensGoal::Spot, 100, LensSearch::default(), &mut |_| Ok(()), &stop).unwrap();
    // Stopped at its second iteration, it ends before the third, and the lens is as it was.
    let (before, mut seen) = (block.lens().unwrap(), 0);
    let mut two = |_: BTreeMap<String, f64>| {
        seen += 1;
        if seen == 2 {
            stop.set();
        }
        Ok(())
    };
    let stopped = block.improve(LensGoal::Restored, 30, LensSearch::default(), &mut two, &stop);
    assert!(matches!(stopped, Err(DesignError::Stopped(_))), "{stopped:?}");
    assert_eq!((seen, block.lens().unwrap()), (2, before));
    let stop = Cancel::default();
    let mut course = Vec::new();
    let mut watch = |losses: BTreeMap<String, f64>| {
        course.push(losses["restored_error_percent"]);
        Ok(())
    };
    let restored = block.improve(LensGoal::Restored, 30, LensSearch::default(), &mut watch, &stop);
    let restored = restored.unwrap();
    assert!(course.is_sorted_by(|a, b| a >= b), "{course:?}");
    // Larger spots, that leave less error: from 1.22 to 1.12 % of white with finer PSFs.
    assert!(restored["restored_error_percent"] < 0.95 * course[0], "{restored:?} {}", course[0]);
    assert!(restored["rms_spot_um"] > spot["rms_spot_um"] && restored["penalty_mm2"] < 1e-8, "{restored:?}");
    // What no lens can go below.
    let perfect = merit.value(&thin_equivalent(&start.lens_file.lens)).unwrap();
    assert!(perfect < 0.8 * restored["restored_error_percent"], "{perfect}");
}

/// The residuals to which an error is lifted give back its value and its gradient, and reach zero at some point of the rays: their paraboloid
/// just touches it.
fn check_lift(merit: &RestoredError, lens: &Lens, numbers: &[(usize, Number)]) {
    let (value, gradient) = merit.with_gradient(lens).unwrap();
    let (square, gradient) = (value * value, gradient.unwrap().scaled(2.0 * value));
    let gram = merit.normal_equations(lens, numbers).unwrap();
    let count = numbers.len();
    assert!((gram[(count + 1, count + 1)] / square - 1.0).abs() < 1e-8);
    for (i, number) in numbers.iter().enumerate() {
        let slope = 2.0 * gram[(i, count + 1)];
        assert!((slope - gradient[*number]).abs() <= 1e-8 * slope.abs(), "{i}: {slope}");
        assert!(gram[(i, i)] > 0.0, "{i}");
    }
    // As the numbers change, the stop follows, which is the column behind them.
    let reference = lens.at_wavelength(lens.reference_um);
    let stop_radius = 1.0 / first_order(&reference).stop_radius_mm;
    let mut by_stop = LensGradient::zero(lens.surfaces.len());
    pull_back_first_order(
        &reference,
        FirstOrderCotangent { stop_radius, ..Default::default() },
        &mut by_stop,
    );
    let follow = DMatrix::from_fn(count + 1, count, |row, column| {
        if row == count { by_stop[numbers[column]] } else { f64::from(u8::from(row == column)) }
    });
    let moved = follow.transpose() * gram.view((0, 0), (count + 1, count + 1)) * &follow;
    // Columns of unit length, so that eigenvalues can be compared.
    let size = |i: usize| moved[(i, i)].sqrt();
    let half = DVector::from_fn(count, |i, _| gram[(i, count + 1)] / size(i));
    let moved = DMatrix::from_fn(count, count, |r, c| moved[(r, c)] / (size(r) * size(c))).symmetric_eigen();
    let along = moved.eigenvectors.transpose() * half;
    let most = moved.eigenvalues.max();
    assert!(moved.eigenvalues.min() > -1e-12 * most, "no products of residuals: {}", moved.eigenvalues);
    let reached: f64 = along
        .iter()
        .zip(moved.eigenvalues.iter())
        .filter(|(_, e)| **e > 1e-12 * most)
        .map(|(a, e)| a * a / e)
        .sum();
    assert!((reached / square - 1.0).abs() < 1e-8, "{reached} {square}");
}

/// Compares the gradient of the error after restoration with differences.
fn check_gradient(merit: &RestoredError, space: &SmoothSpace, x: &[f64]) {
    let lens_at = |x: &[f64]| space.lens_at(x).unwrap();
    let (value, gradient) = merit.with_gradient(&lens_at(x)).unwrap();
    assert!((merit.value(&lens_at(x)).unwrap() / value - 1.0).abs() < 1e-12);
    let gradient = space.pull_back(x, &lens_at(x), &gradient.unwrap());
    let size = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    for (i, analytic) in gradient.iter().enumerate() {
        let moved = |h: f64| {
            let mut x = x.to_vec();
            x[i] += h;
            merit.value(&lens_at(&x)).unwrap()
        };
        let numeric = (moved(1e-4) - moved(-1e-4)) / 2e-4;
        assert!(
            (analytic - numeric).abs() < 0.01 * analytic.abs() + 1e-3 * size,
            "{i}: {analytic} {numeric}"
        );
    }
}

/// Where lenses are exposed for the same time, the error after restoration has the electrons that the lens gathers, in a descent and in the
/// table of scores.
#[test]
fn the_error_after_restoration_follows_the_light_of_the_lens() {
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let setup = |white_e: f64, same: &str| {
        let free = format!("field = \"free\"\n{JOINT}");
        let exposure = format!("[exposure]\nwhite_e = {white_e}\nsame = \"{same}\"\n");
        let text = format!("{TINY}{exposure}{}", variant("free", &free));
        Setup::new(Experiment::parse(&text).unwrap(), &assets, Device::flex().autodiff()).unwrap()
    };
    // Noise rules the error at 200 electrons.
    let (same_time, more_electrons) = (setup(200.0, "time"), setup(800.0, "electrons"));
    let start = |setup: &Setup| setup.start(&setup.variants[0]).clone();
    let (own, other) = (start(&same_time), start(&more_electrons));
    let space = &own.space;
    let x = space.start().to_vec();
    let lens = space.lens_at(&x).unwrap();
    let fields = same_time.moving_plan.field_angles(&lens).unwrap();
    let plan = PsfPlan { held_fields_rad: Some(fields), ..same_time.moving_plan.clone() };
    check_gradient(&own.restored(&plan), space, &x);

    // A lens that is four times as bright as that for which the exposure is stated has four times its electrons.
    let merit = own.restored(&plan);
    let dim = RestoredError { stated_brightness: merit.stated_brightness.map(|b| 0.25 * b), ..merit.clone() };
    let [stated, bright, wanted] =
        [&merit, &dim, &other.restored(&plan)].map(|merit| merit.value(&lens).unwrap());
    assert!((bright / wanted - 1.0).abs() < 1e-5 && bright < 0.9 * stated, "{stated} {bright} {wanted}");

    // The table of scores has the same limit.
    let mut dim = same_time;
    let mut body = (*dim.body).clone();
    body.same_time.as_mut().unwrap().brightness *= 0.25;
    dim.cameras.body = Arc::new(body);
    let [bright, wanted] = [dim, more_electrons].map(|setup| {
        let camera = setup.camera(lens.clone(), false).unwrap();
        let row = Scorer::new(Arc::new(setup)).unwrap().score("free", &camera).unwrap().metrics;
        row.restored_error_percent.unwrap()
    });
    assert!((bright / wanted - 1.0).abs() < 1e-5, "{bright} {wanted}");
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
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
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

    let setup = |text: &str| {
        let assets =
            Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data"))
                .unwrap();
        Setup::new(Experiment::parse(&format!("{TINY}{text}")).unwrap(), &assets, Device::flex().autodiff())
            .unwrap()
    };
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
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/experiments");
    for entry in std::fs::read_dir(folder).unwrap() {
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
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data");
    let assets = Library::from_folder(&data).unwrap();
    let [rays, waves] = ["restoration_naf", "restoration_naf_waves"]
        .map(|name| std::fs::read(data.join(format!("weights/{name}.safetensors"))).unwrap());
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
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let text = format!("{TINY}{}", variant("a", &format!("lens = \"box-centre\"\n{NETWORK}")));
    let setup = Setup::new(Experiment::parse(&text).unwrap(), &assets, Device::flex().autodiff()).unwrap();
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
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
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

const VALIDATION: &str = "[validation]\nevery = 2\nwindows = 3\n";

/// The validations of a run: step, camera, block and loss.
fn validations(folder: &Path) -> Vec<(u64, String, String, f64)> {
    let events = read_events(&folder.join("events.jsonl")).unwrap();
    let of = |e: Event| Some((e.step, e.camera, e.block, *e.losses.get("validation")?));
    events.into_iter().filter_map(of).collect()
}

#[test]
fn a_stage_ends_with_the_numbers_of_its_best_validation() {
    let folder = tempfile::tempdir().unwrap();
    // A rate at which the network gets worse.
    let wild = variant(
        "a",
        &format!(
            "{NETWORK}schedule = {{ network = {{ learning_rate = 0.1, final_learning_rate = 1.0 }} }}\n"
        ),
    );
    let made = |name: &str, more: &str| {
        let root = folder.path().join(name);
        let text = format!("{TINY}{}{more}{wild}", VALIDATION.replace("every = 2", "every = 1"));
        let rows = run(Experiment::parse(&text).unwrap(), &root).rows;
        let weights = std::fs::read(root.join("cameras/a/blocks/network/weights.bin")).unwrap();
        (rows, weights, validations(&root))
    };
    let (last, last_weights, losses) = made("last", "");
    let values: Vec<f64> = losses.iter().map(|v| v.3).collect();
    assert_eq!(values.len(), 4);
    let least = (0..4).min_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap();
    assert!(least < 3, "the last step is the best: {values:?}");
    let (best, best_weights, same) = made("best", "keep = \"best\"\n");
    assert_eq!(same, losses);
    assert!(best_weights != last_weights && best[0].scores != last[0].scores);
    assert!(best[0].scores["psnr_db"] > last[0].scores["psnr_db"], "{best:?} {last:?}");

    // Impatience ends the stage soon after, with the same camera.
    let (early, early_weights, fewer) = made("early", "keep = \"best\"\npatience = 1\n");
    assert_eq!(early_weights, best_weights);
    assert_eq!(fewer, losses[..least + 2]);
    assert_eq!(early[0].network_steps, least + 2);

    // A camera that starts from it counts the steps that were taken, and its windows go on after theirs.
    let child = format!("{}from = \"a\"\n{NETWORK}", variant("b", ""));
    let root = folder.path().join("child");
    let impatient = VALIDATION.replace("every = 2", "every = 1") + "patience = 1\n";
    let rows = run(Experiment::parse(&format!("{TINY}{impatient}{wild}{child}")).unwrap(), &root).rows;
    let own = validations(&root).iter().filter(|v| v.1 == "b").count();
    assert_eq!(rows[1].network_steps, rows[0].network_steps + own);
    assert!(rows[0].network_steps < 4);
}

#[test]
fn validation_pictures_are_neither_trained_nor_scored_on_and_moving_lenses_are_validated_at_rest() {
    let assets =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let setup = |text: &str| Setup::new(Experiment::parse(text).unwrap(), &assets, Device::flex().autodiff());
    let text = format!("{TINY}{VALIDATION}{}", variant("a", JOINT));
    let (with, without) = (setup(&text).unwrap(), setup(TINY).unwrap());
    let names = |setup: &Setup, list: &str| -> Vec<String> {
        let listed = |remark: Remark| match remark {
            Remark::Note(text) => Some(text.strip_prefix(list)?.split_once(": ")?.1.to_owned()),
            Remark::Warning(_) => None,
        };
        let all = setup.windows().unwrap().remarks().into_iter().find_map(listed).unwrap_or_default();
        all.split(", ").filter(|name| !name.is_empty()).map(str::to_owned).collect()
    };
    let validation = names(&with, "validation");
    assert_eq!(validation.len(), 2);
    assert!(validation.iter().all(|name| !names(&with, "training").contains(name)));
    assert_eq!(names(&with, "held-out"), names(&without, "held-out"));
    assert_eq!(names(&with, "training").len() + 2, names(&without, "training").len());
    assert!(names(&without, "validation").is_empty());
    let camera = with.camera(with.nominal().lens_file.lens.clone(), true).unwrap();
    let batches = with.validation_shots(&camera).unwrap();
    assert_eq!(batches.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 1]);

    // Losses of a moving lens and of the same lens at rest are comparable: the network hardly changes them in a few steps.
    let folder = tempfile::tempdir().unwrap();
    run(Experiment::parse(&text).unwrap(), folder.path());
    let found = validations(folder.path());
    assert_eq!(found.iter().map(|v| v.2.as_str()).collect::<Vec<_>>(), ["network"; 2]);
    assert!((found[0].3 / found[1].3 - 1.0).abs() < 0.1, "{found:?}");
    let refused = Experiment::parse("[validation]\nkeep = \"best\"\n").unwrap_err().to_string();
    assert!(refused.contains("no validations"), "{refused}");
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

/// The middle of the bounds of a lens images nothing sharply, and stands in an experiment to show that.
#[test]
fn a_lens_that_the_experiment_derives_may_be_out_of_focus() {
    let library =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let experiment = library.experiment("cooke-triplet-image-quality-controls").unwrap();
    let setup = Setup::new(experiment, &library, Device::flex()).unwrap();
    let look = first_look(&setup).unwrap();
    assert!(look.problems.is_empty(), "{:?}", look.problems);
    let said = |words: &str| look.warnings.iter().any(|warning| warning.contains(words));
    assert!(said("middle of its bounds: the PSFs' grid"), "{:?}", look.warnings);
    setup.cancel.set();
    assert!(first_look(&setup).unwrap_err().is_stopped());
}

/// Little area of a sensor lies beyond the outermost field of the spot goal: a corner that loses is said.
#[test]
fn a_corner_that_a_lens_for_least_spots_gives_up_is_said() {
    let library =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let experiment = library.experiment("cooke-triplet-image-quality").unwrap();
    let setup = Setup::new(experiment, &library, Device::flex()).unwrap();
    let start = setup.start(&setup.variants[0]);
    let sharp = &start.lens_file.lens;
    // Half a millimetre at f/4.4 adds some 40 um to the 20 um of the corner.
    let blurred = sharp.with_image_distance(sharp.image_distance_mm() + 0.5);
    let said = start.worse_corner(sharp, &blurred).unwrap();
    assert!(
        said.starts_with("in the corner of the sensor the RMS spot is ") && said.contains("and was 20."),
        "{said}"
    );
    assert_eq!(start.worse_corner(&blurred, sharp), None);
    assert_eq!(start.worse_corner(sharp, sharp), None);
}

/// A grid of 48 um holds 97 % of the triplet's light on the axis, and a quarter of it in the corner of the sensor.
#[test]
fn light_that_the_grid_cuts_off_is_said_before_the_first_step() {
    let library =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let looked_at = |grid: usize| {
        let mut experiment = library.experiment("cooke-triplet-image-quality").unwrap();
        (experiment.psf.grid, experiment.psf.kind) = (grid, PsfsBy::Geometric);
        first_look(&Setup::new(experiment, &library, Device::flex()).unwrap()).unwrap()
    };
    let says_so = |look: &FirstLook| look.warnings.iter().any(|warning| warning.contains("cuts off"));
    assert!(!says_so(&looked_at(128)));
    let look = looked_at(32);
    assert!(look.problems.is_empty() && says_so(&look), "{:?} {:?}", look.problems, look.warnings);
    // The warning is that of the worst row of the table.
    let fields = &look.lenses[0].fields;
    let worst = fields.iter().min_by(|a, b| a.light_on_grid.total_cmp(&b.light_on_grid)).unwrap();
    let place = format!(
        "cuts off {:.0} % of the light at {:.1} degrees",
        100.0 * (1.0 - worst.light_on_grid),
        worst.field_deg
    );
    assert!(look.warnings.iter().any(|warning| warning.contains(&place)), "{place} {:?}", look.warnings);
}

/// The colours of a lens for other light are its ends and their middle, without the digits of rounding: half of 0.8 + 0.9 is 0.8500000000000001.
#[test]
fn colours_of_a_lens_for_the_near_infrared_are_round() {
    let library =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let fitted_in = |um: &[f64]| {
        let mut experiment = library.experiment("cooke-triplet-image-quality").unwrap();
        experiment.psf.kind = PsfsBy::Geometric;
        let pictures = library.facts_of(&experiment).unwrap().pictures;
        let mut lens = library.reported("cooke-triplet-nominal").unwrap();
        (lens.file.lens.wavelengths_um, lens.file.lens.reference_um) = (um.to_vec(), um[0]);
        let of = FitOf { experiment, lens, lens_name: "nir", sensor: None, pictures };
        let fitted = fit(of, &library).unwrap();
        (fitted.experiment.psf.wavelengths_um, fitted.warnings.join("; "))
    };
    let (colours_um, said) = fitted_in(&[0.8, 0.9]);
    assert_eq!(colours_um, [0.9, 0.85, 0.8]);
    assert!(said.contains("made for 0.8 to 0.9 um: psf.wavelengths_um = [0.9, 0.85, 0.8]"), "{said}");
    assert!(fitted_in(&[0.85]).1.contains("made for 0.85 um:"));
}

/// The built-in photographs hold no blur of 1 mm: the grid that is written is narrower than the one that was found, and what is said of its light
/// is measured on it.
#[test]
fn lost_light_is_that_of_the_grid_that_is_written() {
    let singlet = "name = \"f/2 singlet\"\nunits = \"mm\"\n[aperture]\nentrance_pupil_diameter_mm = 12.0\n[object]\ndistance_mm = inf\n\
                   [wavelengths]\num = [0.486, 0.5876, 0.656]\nreference_um = 0.5876\n[fields]\nangle_deg = [0.0, 10.0]\n\
                   [[surface]]\nstop = true\nradius_mm = 25.0\nthickness_mm = 5.0\nglass = \"N-BK7\"\nsemi_diameter_mm = 6.5\n\
                   [[surface]]\nradius_mm = -25.0\nthickness_mm = 23.0\nsemi_diameter_mm = 7.0\n";
    let library =
        Library::from_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data")).unwrap();
    let library = library.with_text("singlet.toml".to_owned(), singlet.to_owned());
    let mut experiment = library.experiment("cooke-triplet-image-quality").unwrap();
    experiment.psf.kind = PsfsBy::Geometric;
    let pictures = library.facts_of(&experiment).unwrap().pictures;
    let lens = library.reported("singlet.toml").unwrap();
    let of = FitOf { experiment, lens, lens_name: "singlet.toml", sensor: None, pictures };
    let fitted = fit(of, &library).unwrap();
    assert!(fitted.notes.iter().any(|note| note.starts_with("psf.grid = ")), "{:?}", fitted.notes);
    let psf = &fitted.experiment.psf;
    let said = format!("the PSF grid of {:.0} um cuts off", psf.grid as f64 * psf.pitch_um);
    assert!(fitted.warnings.iter().any(|warning| warning.contains(&said)), "{said} {:?}", fitted.warnings);
}
