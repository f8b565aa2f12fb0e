//! The global search.

use super::*;

#[test]
fn a_search_gives_the_same_on_any_number_of_threads_and_after_a_break() {
    let problem = Problem {
        merit: SpotResiduals {
            wavelengths_um: vec![0.5876],
            sampling: crate::pupil::PupilSampling::Degree(4),
            ..problem().merit
        },
        ..problem()
    };
    let options = SearchOptions { seed: 7, round: 8, ..SearchOptions::default() };
    let search = |threads: usize, rounds: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut search = Search::new(&problem, options).unwrap();
            (0..rounds).for_each(|_| {
                search.advance();
            });
            search.state()
        })
    };
    let whole = search(1, 6);
    assert_eq!(search(3, 6), whole);
    let mut resumed = Search::resume(&problem, options, &search(2, 4)).unwrap();
    resumed.advance();
    resumed.advance();
    assert_eq!(resumed.state(), whole);

    // It only gets better, and better than the lens that it could have begun with.
    let start = descend(&problem, &LevenbergOptions::default(), &mut |_, _, _| true).unwrap().best.merit;
    let mut search = Search::new(&problem, options).unwrap();
    let mut before = f64::INFINITY;
    for _ in 0..8 {
        let improved = search.advance();
        let merit = search.best().unwrap().analysis.merit;
        assert!(merit <= before && improved == (merit < before));
        before = merit;
    }
    assert!(before <= 1.01 * start, "{before} {start}");
    // Every candidate makes a descent or is counted as dropped.
    let (rounds, descents) = search.progress();
    assert_eq!(descents + search.dropped(), rounds * options.round as u64);
}

#[test]
fn a_search_exchanges_glasses() {
    // The flint of the triplet may become a crown that makes colour worse; the search must find its way back.
    let lens = nominal_triplet();
    let flint = lens.surfaces[2].glass.clone();
    let plastic = lens.surfaces[0].glass.clone();
    let mut base = problem();
    base.base.surfaces[2].glass = plastic.clone();
    let limited = Problem {
        glasses: vec![GlassChoice { surface: 2, candidates: vec![plastic, flint.clone()] }],
        ..base.clone()
    };
    let options = SearchOptions { seed: 3, round: 8, ..SearchOptions::default() };
    let mut search = Search::new(&limited, options).unwrap();
    (0..6).for_each(|_| {
        search.advance();
    });
    let best = search.best().unwrap();
    assert_eq!(best.analysis.lens.surfaces[2].glass, flint);
    assert_eq!(best.glasses, [1]);
    let mut stuck = Search::new(&base, options).unwrap();
    (0..6).for_each(|_| {
        stuck.advance();
    });
    let without = stuck.best().map_or(f64::INFINITY, |f| f.analysis.merit);
    assert!(best.analysis.merit < 0.8 * without, "{} {without}", best.analysis.merit);
    // It goes on with the glasses that it had.
    let resumed = Search::resume(&limited, options, &search.state()).unwrap();
    assert_eq!(resumed.best().unwrap().analysis.merit, best.analysis.merit);

    let none = Problem { glasses: vec![GlassChoice { surface: 2, candidates: Vec::new() }], ..base };
    assert_eq!(Search::new(&none, options).err(), Some(DesignSpaceError::NoGlass { surface: 3 }));
}
