//! How long it takes to build a street and to see a window or a whole frame of it.

use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use petzval_street::{Light, Projection, Street, StreetSettings, Window};

/// The window of a training step around the horizon, on one thread and in all lights; a frame on all threads.
fn street(criterion: &mut Criterion) {
    let projection = Projection::rectilinear(4266.0, 1400.0, 1200, 1920).expect("a valid lens");
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    let mut group = criterion.benchmark_group("street");
    for light in [Light::Day, Light::Dusk, Light::Night] {
        let streets: Vec<Street> =
            (0..8).map(|sequence| Street::new(&StreetSettings::new(sequence, light))).collect();
        group.bench_function(format!("window 224 x 224, 3 x 3 samples, one thread, {light:?}"), |bench| {
            let mut turn = 0;
            bench.iter(|| {
                let street = &streets[turn % streets.len()];
                let window = Window { row: 480, col: 400 + 150 * (turn % 7) as i64, height: 224, width: 224 };
                turn += 1;
                single.install(|| street.see(&projection, &street.pose(), window, 3))
            });
        });
    }
    let street = Street::new(&StreetSettings::new(1, Light::Day));
    let frame = Window { row: 0, col: 0, height: 1200, width: 1920 };
    group.bench_function("frame 1200 x 1920, 2 x 2 samples, all threads", |bench| {
        bench.iter(|| street.see(&projection, &street.pose(), frame, 2));
    });
    group.bench_function("build a street", |bench| {
        let mut sequence = 0;
        bench.iter(|| {
            sequence += 1;
            Street::new(&StreetSettings::new(sequence, Light::Day))
        });
    });
    group.bench_function("objects near", |bench| {
        bench.iter(|| street.objects_near(&projection, &street.pose()))
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(4));
    targets = street
}
criterion_main!(benches);
