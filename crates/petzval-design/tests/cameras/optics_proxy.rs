//! The network in place of ray tracing: what it learns, its gradient, and its place in a camera.

use crate::common::library;
use burn::prelude::*;
use petzval_design::camera::optics_proxy::{OpticsJudge, OpticsTraining, ProxyDomain, ProxyOpticsTrainer};
use petzval_design::experiment::Experiment;
use petzval_design::lens::sampler::LensSampler;
use petzval_design::setup::Setup;

const STEPS: usize = 60;
const LEARNT_BY_HEART: usize = 400;

fn setup() -> Setup {
    let assets = library();
    let text = "[psf]\nfields = 3\npupil_cells = 24\nscoring_pupil_cells = 24\nscoring_pupil_error = 2.0\n";
    Setup::without_windows(Experiment::parse(text).unwrap(), &assets, Device::flex().autodiff()).unwrap()
}

fn sampler(setup: &Setup, seed: u64) -> LensSampler {
    LensSampler::new(setup.nominal().clone(), setup.moving_plan.clone(), seed)
}

fn trainer(setup: &Setup, seed: u64) -> ProxyOpticsTrainer {
    let training = OpticsTraining { steps: STEPS, batch: 4, seed, hidden: 32, channels: 8 };
    let domain = ProxyDomain::of(&setup.moving_plan).unwrap();
    ProxyOpticsTrainer::new(sampler(setup, seed), domain, training, &setup.body.device).unwrap()
}

#[test]
fn lenses_are_drawn_within_their_bounds_with_their_light_and_come_again() {
    let setup = setup();
    let sampler = sampler(&setup, 3);
    let space = sampler.start().space.space();
    let mut lenses = Vec::new();
    for number in 0..6 {
        let (lens, traced) = sampler.lens(number).unwrap();
        assert!(traced.captured() >= 0.9);
        for (at, [low, high]) in space.coordinates(&lens).iter().zip(space.bounds()) {
            assert!(at >= low && at <= high);
        }
        assert_eq!(lens, sampler.lens(number).unwrap().0);
        lenses.push(lens);
    }
    assert!(lenses.windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn training_brings_the_illumination_nearer_and_continues_with_the_same_bits() {
    let setup = setup();
    let mut whole = trainer(&setup, 1);
    let unseen = sampler(&setup, 99);
    let clock = || 0.0;
    let judge = OpticsJudge { sampler: &unseen, lenses: 4, limit: &setup.limit, clock: &clock };
    let before = judge.gap(whole.proxy(), &|_| Ok(())).unwrap();
    for step in 0..STEPS - 2 {
        whole.step(step).unwrap();
    }
    let after = judge.gap(whole.proxy(), &|_| Ok(())).unwrap();
    // The PSFs themselves take some hundred steps of a larger network.
    assert!(after.illumination < 0.5 * before.illumination, "{before:?} {after:?}");
    assert_eq!((after.lenses, after.fields.len()), (4, 3));

    let mut restored = trainer(&setup, 1);
    restored.load(whole.save().unwrap()).unwrap();
    for step in STEPS - 2..STEPS {
        assert_eq!(whole.step(step).unwrap(), restored.step(step).unwrap());
    }
    assert_eq!(whole.save().unwrap()[0], restored.save().unwrap()[0]);
    assert!(restored.load([vec![1, 2, 3], Vec::new()]).is_err());
}

#[test]
#[ignore = "trains a network for half a minute; `cargo xtask full` runs it"]
fn the_psfs_of_some_lenses_are_learnt_by_heart() {
    let setup = setup();
    let mut trainer = trainer(&setup, 1);
    let first = trainer.step(0).unwrap();
    let mut last = first;
    for _ in 0..LEARNT_BY_HEART {
        last = trainer.step(0).unwrap();
    }
    assert!(last.psf < 0.6 * first.psf && last.slope < first.slope + 0.1, "{first:?} {last:?}");
}

#[test]
fn its_gradient_by_the_coordinates_is_that_of_differences() {
    let setup = setup();
    let start = setup.nominal().clone();
    let trainer = trainer(&setup, 1);
    let (proxy, radii) = (trainer.proxy(), &setup.moving_plan.field_radius_mm);
    let x = start.space.start().to_vec();
    let lens = start.space.lens_at(&x).unwrap();
    let formed = proxy.psfs(&lens, radii).unwrap();
    let bank = &formed.bank;
    assert!(bank.values.chunks(128 * 128).all(|psf| (psf.iter().sum::<f32>() - 1.0).abs() < 1e-3));
    // A loss with a weight of its own for every cell and every illumination.
    let weight = |i: usize| (0.37 * i as f32).sin();
    let by_values: Vec<f32> = (0..bank.values.len()).map(|i| 100.0 * weight(i)).collect();
    let by_light: Vec<f32> = (0..bank.illumination.len()).map(|i| weight(i + 5)).collect();
    let loss = |x: &[f64]| {
        let bank = proxy.psfs(&start.space.lens_at(x).unwrap(), radii).unwrap().bank;
        let sum = |values: &[f32], by: &[f32]| {
            values.iter().zip(by).map(|(v, b)| f64::from(*v) * f64::from(*b)).sum::<f64>()
        };
        sum(&bank.values, &by_values) + sum(&bank.illumination, &by_light)
    };
    let by = formed.by_coordinates(&by_values, &by_light).unwrap();
    let slopes = start.space.pull_back_coordinates(&x, &by);
    let largest = slopes.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    for i in 0..x.len() {
        let at = |step: f64| {
            let mut moved = x.clone();
            moved[i] += step;
            loss(&moved)
        };
        const STEP: f64 = 3e-4;
        let difference = (at(STEP) - at(-STEP)) / (2.0 * STEP);
        assert!((slopes[i] - difference).abs() < 0.03 * largest, "{i}: {} {difference}", slopes[i]);
    }
}
