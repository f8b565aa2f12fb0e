use super::*;

/// Evaluations until the value is below `goal`, at most `most`.
fn evaluations(
    f: impl Fn(&[f64]) -> f64,
    start: &[f64],
    settings: EvolutionSettings,
    goal: f64,
    most: usize,
) -> Option<usize> {
    let mut search = Evolution::new(start, settings).unwrap();
    while search.evaluations() < most {
        let points = search.ask();
        assert!(points.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
        search.tell(&points.iter().map(|x| f(x)).collect::<Vec<_>>());
        if let Some(best) = search.best().filter(|best| best.value < goal) {
            assert_eq!(f(&best.at), best.value);
            return Some(best.evaluation);
        }
    }
    None
}

fn seed(seed: u64) -> EvolutionSettings {
    EvolutionSettings { seed, ..EvolutionSettings::default() }
}

#[test]
fn it_finds_the_centre_of_a_sphere() {
    let sphere = |x: &[f64]| x.iter().map(|x| (x - 0.37).powi(2)).sum::<f64>();
    for s in 1..=5 {
        let needed = evaluations(sphere, &[0.9; 10], seed(s), 1e-12, 3000);
        assert!(needed.is_some(), "seed {s}");
    }
    // A single coordinate has no covariance to learn.
    assert!(evaluations(sphere, &[0.9], seed(1), 1e-12, 600).is_some());
}

#[test]
fn it_learns_the_axes_of_an_ellipsoid() {
    // Semi-axes from 1 to 1000, along diagonals.
    let ellipsoid = |x: &[f64]| {
        let n = x.len();
        (0..n)
            .map(|i| {
                let along = (0..n).map(|j| {
                    let axis = (std::f64::consts::PI * (2 * j + 1) as f64 * i as f64 / (2 * n) as f64).cos();
                    axis * (x[j] - 0.4)
                });
                10.0_f64.powf(6.0 * i as f64 / (n - 1) as f64) * along.sum::<f64>().powi(2)
            })
            .sum::<f64>()
    };
    for s in 1..=3 {
        let needed = evaluations(ellipsoid, &[0.6; 8], seed(s), 1e-10, 8000);
        assert!(needed.is_some(), "seed {s}");
    }
}

#[test]
fn it_follows_the_valley_of_rosenbrock() {
    // The cube is -2..2; the minimum is at 1. A second, local minimum attracts some searches, which restart.
    let rosenbrock = |x: &[f64]| {
        let x: Vec<f64> = x.iter().map(|x| 4.0 * x - 2.0).collect();
        x.windows(2).map(|p| 100.0 * (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2)).sum::<f64>()
    };
    for s in 1..=3 {
        let needed = evaluations(rosenbrock, &[0.4; 8], seed(s), 1e-9, 30_000);
        assert!(needed.is_some(), "seed {s}");
    }
}

#[test]
fn weak_coordinates_are_found_beside_strong_ones() {
    // Like an ISP: gains of red and blue, exposure and gamma decide most, denoising little, and its best value is the last of its range.
    let f = |x: &[f64]| {
        let curve = |light: f64, factor: f64, gamma: f64| (light * factor).min(1.0).powf(1.0 / gamma);
        let [red, blue] = [x[2], x[3]].map(|x| 0.25 * 16.0_f64.powf(x));
        let errors = (0..36).map(|i| {
            let (light, gain) = (0.02 + 0.08 * (i / 3) as f64, [red, 1.0, blue][i % 3]);
            let factor = (4.0 * x[0]).exp2() * gain;
            (curve(light, factor, 1.4 + 1.6 * x[5]) - curve(light, 1.0, 2.4)).powi(2)
        });
        errors.sum::<f64>() / 36.0 + 1e-4 * (2.0 - x[1]) + 1.2e-4 * x[4] + 1.6e-3 * x[4] * x[4]
    };
    let start = [0.175, 0.0, 0.62, 0.37, 0.5, 0.25];
    let mut needed: Vec<usize> = (1..=9)
        .map(|s| {
            let settings = EvolutionSettings { first_deviation: 0.2, ..seed(s) };
            evaluations(f, &start, settings, 1.05e-4, 2000).unwrap_or(2000)
        })
        .collect();
    needed.sort_unstable();
    assert!(needed[4] <= 500, "{needed:?}");
}

#[test]
fn an_optimum_on_faces_of_the_cube_is_found() {
    let target = [0.0, 1.0, 0.5, -0.4, 1.7, 0.0];
    let nearest = [0.0, 1.0, 0.5, 0.0, 1.0, 0.0];
    let f = |x: &[f64]| x.iter().zip(target).map(|(x, t)| (x - t).powi(2)).sum::<f64>();
    for s in 1..=3 {
        assert!(evaluations(f, &[0.5; 6], seed(s), f(&nearest) + 1e-6, 4000).is_some(), "seed {s}");
    }
}

#[test]
fn restarts_escape_from_local_minima() {
    // Rastrigin: a grid of local minima.
    let rastrigin = |x: &[f64]| {
        let wave = |x: f64| x * x + 10.0 - 10.0 * (std::f64::consts::TAU * x).cos();
        x.iter().map(|x| wave(10.24 * x - 5.5)).sum::<f64>()
    };
    let mut search = Evolution::new(&[0.1; 4], seed(3)).unwrap();
    let mut needed = None;
    while needed.is_none() && search.evaluations() < 60_000 {
        let values: Vec<f64> = search.ask().iter().map(|x| rastrigin(x)).collect();
        search.tell(&values);
        needed = search.best().filter(|best| best.value < 1e-6).map(|best| best.evaluation);
    }
    assert!(needed.is_some() && search.restarts() > 0, "{needed:?} after {} restarts", search.restarts());
}

#[test]
fn a_search_that_is_kept_and_read_continues_with_the_same_bits() {
    let f = |x: &[f64]| x.iter().enumerate().map(|(i, x)| (i + 1) as f64 * (x - 0.2).abs()).sum::<f64>();
    let run = |mut search: Evolution, generations: usize| {
        for _ in 0..generations {
            let values: Vec<f64> = search.ask().iter().map(|x| f(x)).collect();
            search.tell(&values);
        }
        search
    };
    // A wide tolerance, so that restarts happen too.
    let settings = EvolutionSettings { least_deviation: 1e-2, ..seed(9) };
    let start = Evolution::new(&[0.7; 7], settings).unwrap();
    let whole = run(start.clone(), 120);
    assert!(whole.restarts() > 0);
    for stop in [0, 1, 17, 60] {
        let text = serde_json::to_string(&run(start.clone(), stop)).unwrap();
        let read: Evolution = serde_json::from_str(&text).unwrap();
        assert_eq!(run(read, 120 - stop), whole, "stopped after {stop}");
    }
    let other = run(Evolution::new(&[0.7; 7], seed(10)).unwrap(), 5);
    assert_ne!(other.ask(), run(start, 5).ask());
}

#[test]
fn failed_evaluations_are_the_worst_and_lose_nothing() {
    let f = |x: &[f64]| if x[0] > 0.6 { f64::NAN } else { (x[0] - 0.55).powi(2) + (x[1] - 0.5).powi(2) };
    assert!(evaluations(f, &[0.5, 0.5], seed(4), 1e-9, 2000).is_some());
    // Nothing but failures: no best point, and the state still reads back.
    let mut search = Evolution::new(&[0.5, 0.5], seed(4)).unwrap();
    for _ in 0..60 {
        search.tell(&vec![f64::NAN; search.population()]);
    }
    assert!(search.best().is_none() && search.restarts() > 0);
    let text = serde_json::to_string(&search).unwrap();
    assert_eq!(serde_json::from_str::<Evolution>(&text).unwrap(), search);
}

#[test]
fn settings_out_of_range_are_refused() {
    let new = |start: &[f64], settings| Evolution::new(start, settings).map(|_| ());
    assert!(new(&[], seed(1)).is_err());
    assert!(new(&[0.5, 1.1], seed(1)).is_err());
    assert!(new(&[f64::NAN], seed(1)).is_err());
    for first_deviation in [0.0, 1.1, f64::NAN] {
        assert!(new(&[0.5], EvolutionSettings { first_deviation, ..seed(1) }).is_err());
    }
    let error = new(&[0.5], EvolutionSettings { population: Some(3), ..seed(1) }).unwrap_err();
    assert_eq!(error.to_string(), "population is 3; it must be 4 to 4096");
}
