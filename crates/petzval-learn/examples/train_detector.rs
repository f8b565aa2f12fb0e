//! Trains a small detector on streets seen by perfect optics without noise, and scores it on streets that it has not seen.
//!
//! `cargo run --release -p petzval-learn --example train_detector -- --help` lists what can be chosen.

use std::time::Instant;

use burn::optim::{GradientsAccumulator, GradientsParams};
use burn::prelude::*;
use burn::tensor::TensorData;
use clap::Parser;
use petzval_learn::dataset::{Classes, CropPlan, LabelledWindow, List, StreetPlan, StreetView};
use petzval_learn::detection::{BackboneKind, Detector, DetectorKind, Truth};
use petzval_learn::optimizer::muon_and_adam;
use petzval_learn::score::{Field, judged, object_scores};
use petzval_street::{Families, Light};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Side of the pictures that it is trained on: what costs time is pixels, what teaches is objects.
const CROP: usize = 128;

/// Side of the windows of which every step takes another part.
const WINDOW: usize = 192;

/// Parts of a batch that are computed at the same time.
const PARTS: usize = 2;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Trains a small detector on streets by day that are seen by perfect optics without noise, and scores it on streets that it has not seen.
#[derive(Parser)]
struct Args {
    /// Whether the detector has one stage (FCOS) in place of two (Faster R-CNN)
    #[arg(long)]
    one_stage: bool,
    /// Learn traffic lights in place of pedestrians and vehicles
    #[arg(long)]
    traffic_lights: bool,
    #[arg(long, default_value_t = 3200)]
    steps: usize,
    /// Places on streets that are trained on; every step takes a part of some
    #[arg(long, default_value_t = 2000)]
    windows: u64,
    #[arg(long, default_value_t = 1.2e-3)]
    rate: f64,
    /// Pictures of a step
    #[arg(long, default_value_t = 8)]
    batch: usize,
    /// Of the first weights and of the order of the windows; the streets are the same for every seed
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Train on every other family of shapes and textures, and score on these and on the others
    #[arg(long)]
    half_of_families: bool,
}

fn main() {
    let args = Args::parse();
    let kind = if args.one_stage { DetectorKind::Fcos } else { DetectorKind::FasterRcnn };
    let of = if args.traffic_lights {
        include_str!("../../petzval-data/data/tasks/traffic-light.toml")
    } else {
        include_str!("../../petzval-data/data/tasks/pedestrian-vehicle.toml")
    };
    let of = Classes::parse(of).unwrap();
    let classes = &of.names()[..];
    let families = if args.half_of_families { Families::First } else { Families::All };
    let Args { steps, windows, rate, batch, seed, .. } = args;

    // A lens of 25 mm on a sensor of 1920 x 1200 pixels of 5.86 um.
    let radius_px: Vec<f64> = (0..200).map(|i| 8.0 * f64::from(i)).collect();
    let angle_rad: Vec<f64> = radius_px.iter().map(|r| (r * 5.86e-3 / 25.0).atan()).collect();
    let view = StreetView::new(&radius_px, &angle_rad, [1200, 1920]).unwrap();
    let plan = StreetPlan {
        seed: 1,
        light: Light::Day,
        busy: 0.4,
        classes: of.clone(),
        surfaces: None,
        white_cd_m2: 3.0,
        samples: 2,
        on_objects: 0.9,
        least_side_px: 24.0,
        least_visible: 0.6,
    };
    let crops = |crop| CropPlan::on_1920x1200(crop, 0);
    let look = |list, families, count: u64, crop| -> Vec<LabelledWindow> {
        let window = |i| plan.window(list, families, i, [&view, &view], &crops(crop)).unwrap();
        (0..count).into_par_iter().map(window).collect()
    };
    let started = Instant::now();
    let training = look(List::Training, families, windows, WINDOW);
    let mut scored = vec![("held out", look(List::HeldOut, families, 192, 256))];
    if args.half_of_families {
        scored.push(("held out, other families", look(List::HeldOut, Families::Second, 192, 256)));
    }
    scored.push(("training", training[..96.min(training.len())].to_vec()));
    println!("windows made in {:.1} s", started.elapsed().as_secs_f64());

    let device = Device::flex().autodiff();
    let picture = |window: &LabelledWindow| {
        let scene = window.scene();
        TensorData::new(scene.to_srgb(), [1, 3, scene.height, scene.width])
    };
    let mut detector = kind.init(BackboneKind::Small, classes.len(), seed, &device).unwrap();
    println!("{} weights", detector.num_params());
    let mut optimizer = muon_and_adam(&detector);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (started, mut sum) = (Instant::now(), 0.0);
    for step in 0..steps {
        let mut items = Vec::new();
        for _ in 0..batch {
            let window = &training[random.random_range(0..training.len())];
            let middle = window.middle_of_part(WINDOW, CROP, &mut random);
            let part = window.part(&crops(WINDOW), &crops(CROP), middle);
            items.push(if random.random() { part.mirrored(CROP, 1920) } else { part });
        }
        // Each part of the batch has its own thread and its own copy of the weights, whose gradients are added in order.
        let of_part = |(part, items): (usize, &[LabelledWindow])| {
            let copy = detector.clone().fork(&device);
            let pictures = items.iter().map(|w| Tensor::from_data(picture(w), &device)).collect();
            let truths: Vec<Truth> = items.iter().map(|w| w.truth.clone()).collect();
            let seed = (PARTS * step + part) as u64;
            let loss = copy.loss(Tensor::cat(pictures, 0), &truths, seed).unwrap();
            let gradients = (loss.total * (items.len() as f32 / batch as f32)).backward();
            (loss.parts.last().unwrap().1, GradientsParams::from_grads(gradients, &copy))
        };
        let parts: Vec<_> = items.par_chunks(batch.div_ceil(PARTS)).enumerate().map(of_part).collect();
        let mut gradients = GradientsAccumulator::new();
        for (loss, of_part) in parts {
            sum += loss / PARTS as f64;
            gradients.accumulate(&detector, of_part);
        }
        let share = step as f64 / steps as f64;
        let warm = ((step + 1) as f64 / 100.0).min(1.0);
        let rate = rate * warm * (0.02 + 0.98 * 0.5 * (1.0 + (std::f64::consts::PI * share).cos()));
        detector = optimizer.step(rate, detector, gradients.grads());
        if (step + 1) % 100 == 0 {
            let seconds = started.elapsed().as_secs_f64();
            println!("{:5} loss {:.4}, {:.3} s a step", step + 1, sum / 100.0, seconds / (step + 1) as f64);
            sum = 0.0;
        }
        if (step + 1) % (steps / 2).max(1) == 0 {
            // With its weights held: what a gradient could need is not kept.
            let held = detector.clone().no_grad();
            let score = |windows: &[LabelledWindow]| -> String {
                let judge = |window: &LabelledWindow| {
                    let seen = Tensor::from_data(picture(window), &device);
                    let found = held.detect(seen).unwrap().remove(0);
                    judged(&window.truth, &found, window.at, classes.len())
                };
                let pictures: Vec<_> = windows.iter().map(judge).collect();
                let field = Field { axis: [960.0, 600.0], corner_px: 1132.0 };
                let figure = |s: &petzval_learn::score::ObjectScore| {
                    let value = s.of(&pictures, classes.len(), field);
                    format!("{} {:.3}", s.about.name, value.unwrap_or(f64::NAN))
                };
                object_scores(classes).iter().map(figure).collect::<Vec<_>>().join("  ")
            };
            for (name, windows) in &scored {
                println!("{name}: {}", score(windows));
            }
        }
    }
}
