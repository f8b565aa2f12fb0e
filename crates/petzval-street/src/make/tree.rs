//! Trees and hedges.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::colour::{Rgb, from_hue};
use crate::families::Drawer;
use crate::material::Material;
use crate::object::{Builder, Object};
use crate::vector::{Vec3, vec3};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Growth {
    Round,
    Column,
    Spreading,
    Conifer,
}

const GROWTHS: [(Growth, &str); 4] = [
    (Growth::Round, "round"),
    (Growth::Column, "column"),
    (Growth::Spreading, "spreading"),
    (Growth::Conifer, "conifer"),
];

fn leaf_colour(rng: &mut ChaCha8Rng) -> Rgb {
    // Mostly green, sometimes in autumn.
    let hue = if rng.random_bool(0.8) { rng.random_range(0.2..0.31) } else { rng.random_range(0.04..0.16) };
    from_hue(hue, rng.random_range(0.45..0.75), rng.random_range(0.08..0.22))
}

/// A tree of any family.
pub(crate) fn tree(rng: &mut ChaCha8Rng, drawer: &mut Drawer, place: Vec3, id: u64) -> Object {
    let growth = drawer.draw(rng, "tree", &GROWTHS);
    let mut b = Builder::at(place, rng.random_range(0.0..6.0));
    let bark = Material::Bark { albedo: [0.13, 0.11, 0.09].map(|c: f32| c * rng.random_range(0.6..1.4)), seed: rng.random() };
    let height: f64 = rng.random_range(5.0..12.0);
    let trunk = match growth {
        Growth::Conifer => 0.15 * height,
        Growth::Column => 0.25 * height,
        _ => rng.random_range(0.28..0.42) * height,
    };
    let thick = 0.014 * height + 0.05;
    b.cone(vec3(0.0, 0.0, 0.0), vec3(0.0, trunk, 0.0), [1.15 * thick, 0.9 * thick], bark.clone());
    b.cone(vec3(0.0, trunk, 0.0), vec3(0.15, 0.75 * height, 0.1), [0.9 * thick, 0.3 * thick], bark.clone());
    let leaves = Material::Leaves {
        albedo: leaf_colour(rng),
        density: rng.random_range(0.42..0.62),
        size_m: rng.random_range(0.12..0.3),
        seed: rng.random(),
    };
    let crown = 0.5 * (height - trunk);
    let middle = trunk + crown;
    let puff = |b: &mut Builder, at: Vec3, radii: [f64; 3]| b.ball([at.x, at.y, at.z], radii, leaves.clone());
    let blobs = rng.random_range(6..10);
    for i in 0..blobs {
        let turn = 2.4 * f64::from(i) + rng.random_range(-0.5..0.5);
        let share = (f64::from(i) + 0.5) / f64::from(blobs);
        let mut r = |low: f64, high: f64| rng.random_range(low..high);
        let (out, up, size) = match growth {
            Growth::Round => (0.55 * crown, middle + crown * r(-0.5, 0.55), crown * r(0.42, 0.6)),
            Growth::Spreading => (0.9 * crown, middle + crown * r(-0.15, 0.5), crown * r(0.42, 0.6)),
            Growth::Column => (0.16 * crown, trunk + 2.0 * crown * share, crown * r(0.26, 0.36)),
            Growth::Conifer => {
                let narrow = 1.05 - share;
                (0.12 * crown * narrow, trunk + 1.9 * crown * share, 0.55 * crown * narrow)
            }
        };
        let (sin, cos) = turn.sin_cos();
        let at = vec3(out * cos, up, out * sin);
        puff(&mut b, at, [size, size * r(0.7, 1.0), size * r(0.85, 1.1)]);
        if matches!(growth, Growth::Round | Growth::Spreading) {
            b.cone(vec3(0.0, 0.9 * trunk, 0.0), at, [0.4 * thick, 0.15 * thick], bark.clone());
        }
    }
    b.finish(id, None).on_ground([thick, thick], 0.6, 0.5)
}

/// A hedge or bush.
pub(crate) fn bush(rng: &mut ChaCha8Rng, place: Vec3, id: u64) -> Object {
    let mut b = Builder::at(place, rng.random_range(0.0..3.0));
    let leaves =
        Material::Leaves { albedo: leaf_colour(rng), density: 0.75, size_m: rng.random_range(0.06..0.14), seed: rng.random() };
    for i in 0..3 {
        let size = rng.random_range(0.4..0.8);
        let at = [0.7 * f64::from(i) - 0.7, 0.7 * size, rng.random_range(-0.2..0.2)];
        b.ball(at, [1.1 * size, size, 0.9 * size], leaves.clone());
    }
    b.finish(id, None).on_ground([1.2, 0.5], 0.7, 0.4)
}
