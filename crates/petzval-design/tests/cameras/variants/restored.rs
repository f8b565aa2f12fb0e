//! Lenses for the least error after restoration: gradient, light, and an improved lens.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::setup_of;
use nalgebra::{DMatrix, DVector};
use petzval_base::Cancel;
use petzval_design::block::OpticsBlock;
use petzval_design::error::DesignError;
use petzval_design::experiment::{LensGoal, LensSearch};
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_design::lens::restored::RestoredError;
use petzval_design::scoring::Scorer;
use petzval_design::setup::Setup;
use petzval_optics::design_space::SmoothSpace;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::merit::Merit;
use petzval_optics::number::Number;
use petzval_optics::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use petzval_optics::solve::thin_equivalent;

use super::{JOINT, TINY, variant};

/// The error after restoration: its gradient, and what a descent from the spot-optimised lens gains.
#[test]
fn a_lens_is_improved_for_the_restoration_of_its_frames() {
    let text = "[psf]\nfields = 7\ngrid = 96\npupil_cells = 48\n";
    let setup = setup_of(text);
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
    let setup = |white_e: f64, same: &str| {
        let free = format!("field = \"free\"\n{JOINT}");
        let exposure = format!("[exposure]\nwhite_e = {white_e}\nsame = \"{same}\"\n");
        let text = format!("{TINY}{exposure}{}", variant("free", &free));
        setup_of(&text)
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
