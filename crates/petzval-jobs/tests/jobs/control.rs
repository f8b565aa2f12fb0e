//! The stage of a design that makes spots small, against `lens optimize` from the same lens, on lenses of other people.
//!
//! Each prescription in `lenses/` names where its figures are from.

use petzval_base::Cancel;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_camera::linear_limit::{LinearLimit, NaturalScenes};
use petzval_camera::sensor::SensorModel;
use petzval_design::block::OpticsBlock;
use petzval_design::experiment::{Experiment, FieldOfView, LensGoal, LensSearch};
use petzval_design::lens::start::{Start, StartOf};
use petzval_files::{Figure, LensFile, Operand, OperandFile, write_lens};
use petzval_jobs::lens::optimize;
use petzval_jobs::{Context, Silent, built_in_assets};
use petzval_optics::constraint::Constraint;
use petzval_optics::lens::Lens;
use petzval_optics::merit::{Merit, SpotResiduals};
use petzval_optics::optimize::Limits;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::chief_ray;

const LENSES: [&str; 11] = [
    "double-gauss",
    "cooke-triplet-40",
    "tessar",
    "heliar",
    "field-corrector",
    "petzval",
    "telephoto",
    "reverse-telephoto",
    "triplet-telescope",
    "telescope-48-inch",
    // The radius of its second mirror stands at a bound, along which a descent has to turn: straight down it ends 12 % higher.
    "telescope-two-mirrors",
];

/// Iterations at most of either side.
const ITERATIONS: usize = 200;

/// A lens on a sensor that its outermost field just reaches, with requirements in proportion to its size.
struct Case {
    start: Arc<Start>,
    limits: Limits,
    /// Focal length in units of 25 mm.
    size: f64,
    context: Context,
}

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/lenses/{name}.toml"))
}

fn case(lens: &Path, corner_mm: Option<f64>) -> Case {
    let context = Context::new(built_in_assets(), Arc::new(Silent));
    let own = context.assets.lens(&lens.display().to_string()).unwrap().lens;
    let sequence = own.at_wavelength(own.reference_um);
    let order = first_order(&sequence);
    let outermost = own.fields_deg.iter().fold(0.0_f64, |a, b| a.max(*b)).to_radians();
    let corner_mm = corner_mm.unwrap_or_else(|| 0.999 * chief_ray(&sequence, outermost).unwrap().y_mm);
    let mut experiment = Experiment { lens: lens.display().to_string(), ..Experiment::default() };
    let size = order.efl_mm.abs() / 25.0;
    experiment.optics.defocus_mm = size;
    experiment.constraints.element_edge_mm = 0.01 * size;
    experiment.constraints.air_gap_mm = 0.001 * size;
    experiment.constraints.back_focal_mm = 0.5 * order.bfl_mm;
    experiment.psf.fields = 5;
    experiment.psf.pitch_um *= size;
    let mut colours = own.wavelengths_um.clone();
    colours.sort_by(|a, b| b.total_cmp(a));
    experiment.psf.wavelengths_um = [colours[0], colours[1], colours[2]];
    let sensor = context.assets.sensor("imx249-fitted").unwrap();
    let diagonal_px = (sensor.height as f64).hypot(sensor.width as f64);
    let sensor = SensorModel { pixel_um: 2e3 * corner_mm / diagonal_px, ..sensor };
    let plan = experiment.psf.plan(&sensor, 32).unwrap();
    let limit =
        Arc::new(LinearLimit::new(&sensor, &experiment.exposure.exposure(), NaturalScenes::default()));
    let of =
        StartOf { lens: &experiment.lens, field: FieldOfView::Held, moves: true, stated_brightness: None };
    let start = Start::new(of, &experiment, &context.assets, &sensor, &plan, &limit).unwrap();
    let limits = Limits {
        element_edge_mm: Some(experiment.constraints.element_edge_mm),
        air_gap_mm: Some(experiment.constraints.air_gap_mm),
        ..Limits::default()
    };
    Case { start: Arc::new(start), limits, size, context }
}

impl Case {
    fn spots(&self) -> SpotResiduals {
        self.start.spots(&self.start.lens_file.lens)
    }

    fn spot_um(&self, lens: &Lens) -> f64 {
        self.spots().value(lens).unwrap_or(f64::INFINITY)
    }

    /// The lens of the stage for least spots.
    fn control(&self) -> Lens {
        let mut block = OpticsBlock::new(self.start.clone(), 100.0);
        let on = &Cancel::default();
        let losses = block.improve(LensGoal::Spot, ITERATIONS, LensSearch::default(), &mut |_| Ok(()), on);
        let penalty_mm2 = losses.unwrap()["penalty_mm2"];
        assert!(penalty_mm2 < 1e-8 * self.size * self.size, "{penalty_mm2} {:?}", block.remarks());
        block.lens().unwrap()
    }

    /// The lens of `lens optimize` with the same variables, fields, colours and requirements.
    fn optimised(&self) -> Lens {
        let folder = tempfile::tempdir().unwrap();
        let lens = folder.path().join("lens.toml");
        let file = &self.start.lens_file;
        std::fs::write(&lens, write_lens(&LensFile { expect: None, ..file.clone() })).unwrap();
        let held = self.start.requirements.constraints().iter().find_map(|c| match c {
            Constraint::ChiefHeight { field_rad, wanted_mm, tolerance_mm } => {
                Some((*field_rad, *wanted_mm, *tolerance_mm))
            }
            _ => None,
        });
        let (field_rad, wanted_mm, tolerance_mm) = held.unwrap();
        let height = Operand {
            of: Figure::ImageHeight,
            field_deg: Some(field_rad.to_degrees()),
            frequency_per_mm: None,
            waves: false,
            at_least: Some(wanted_mm - tolerance_mm),
            at_most: Some(wanted_mm + tolerance_mm),
            weight_um: 100.0,
        };
        let goal = optimize::Goal {
            operands: Some(OperandFile { spot_weight: 1.0, operand: vec![height] }),
            fields: self.start.spot_fields_rad.iter().map(|f| f.to_degrees()).collect(),
            power: 2.0,
            edge: self.limits.element_edge_mm,
            centre: self.limits.element_edge_mm,
            air: self.limits.air_gap_mm,
            ..optimize::Goal::default()
        };
        let request = optimize::Request {
            start: optimize::Start::New {
                lens: lens.display().to_string().into(),
                out: folder.path().join("run"),
                goal: Box::new(goal),
                global: false,
                seed: 1,
            },
            iterations: Some(ITERATIONS),
            rounds: None,
            seconds: None,
            trade: false,
        };
        let found = optimize::run(&request, &self.context).unwrap().found;
        self.context.assets.import(&found.lens.display().to_string()).unwrap().file.lens
    }
}

#[test]
fn the_control_is_as_good_as_the_exact_optimiser() {
    let mut apart = Vec::new();
    for name in LENSES {
        let case = case(&path(name), None);
        let began = case.spot_um(&case.start.lens_file.lens);
        let [control, optimised] = [case.control(), case.optimised()].map(|lens| case.spot_um(&lens));
        println!("{name}: {began:.3} um, control {control:.3}, lens optimize {optimised:.3}");
        let ratio = control / optimised;
        if !(0.99..=1.01).contains(&ratio) {
            apart.push(format!("{name}: {control:.3} and {optimised:.3} um"));
        }
    }
    assert!(apart.is_empty(), "{apart:?}");
}

/// The image height that is held is the one in focus, not the one on a plane far from focus.
#[test]
fn a_lens_out_of_focus_is_led_where_the_same_lens_in_focus_is() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(path("double-gauss")).unwrap();
    let (plane, far) = ("thickness_mm = 61.4875", "thickness_mm = 64.0");
    assert!(text.contains(plane));
    let moved = folder.path().join("moved.toml");
    std::fs::write(&moved, text.replace(plane, far)).unwrap();
    let [focused, moved] = [path("double-gauss"), moved].map(|lens| case(&lens, Some(22.0)));
    let [near, far] = [&focused, &moved].map(|case| focused.spot_um(&case.control()));
    assert!((far / near - 1.0).abs() < 0.01, "{near} {far}");
}
