//! Trees and hedges.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::colour::{Rgb, from_hue, scaled};
use crate::families::Drawer;
use crate::material::Material;
use crate::object::{Builder, Object};
use crate::surface_class::SurfaceClass;
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
    let mut b = Builder::at(place, rng.random_range(0.0..6.0), SurfaceClass::Vegetation);
    let bark =
        Material::Bark { albedo: scaled([0.13, 0.11, 0.09], rng.random_range(0.6..1.4)), seed: rng.random() };
    let height: f64 = rng.random_range(5.5..12.0);
    // Street trees are pruned so that people and trucks pass below.
    let trunk: f64 = match growth {
        Growth::Conifer => rng.random_range(0.8..2.0),
        Growth::Column => rng.random_range(1.6..2.6),
        _ => rng.random_range(0.32..0.45) * height,
    };
    let thick = 0.012 * height + 0.04;
    b.cone(vec3(0.0, 0.0, 0.0), vec3(0.0, trunk, 0.0), [1.15 * thick, 0.9 * thick], bark.clone());
    b.cone(vec3(0.0, trunk, 0.0), vec3(0.15, 0.75 * height, 0.1), [0.9 * thick, 0.3 * thick], bark.clone());
    let leaves = Material::Leaves {
        albedo: leaf_colour(rng),
        density: rng.random_range(0.5..0.7),
        size_m: rng.random_range(0.06..0.14),
        seed: rng.random(),
    };
    let crown = 0.5 * (height - trunk);
    let middle = trunk + crown;
    let blobs = rng.random_range(11..18);
    for i in 0..blobs {
        let turn = 2.4 * f64::from(i) + rng.random_range(-0.6..0.6);
        let share = (f64::from(i) + 0.5) / f64::from(blobs);
        let mut r = |low: f64, high: f64| rng.random_range(low..high);
        // Where a tuft of leaves sits: from the axis, above the ground, and its radius.
        let (out, up, size) = match growth {
            Growth::Round => {
                let level = r(-0.85, 0.85);
                (
                    0.75 * crown * (1.0 - level * level).sqrt() * r(0.5, 1.0),
                    middle + crown * level,
                    crown * r(0.3, 0.48),
                )
            }
            Growth::Spreading => {
                (1.15 * crown * r(0.1, 1.0), middle + crown * r(-0.4, 0.6), crown * r(0.3, 0.5))
            }
            Growth::Column => (0.2 * crown * r(0.2, 1.0), trunk + 2.0 * crown * share, crown * r(0.22, 0.32)),
            Growth::Conifer => {
                let narrow = 1.08 - share;
                (
                    0.3 * crown * narrow * r(0.3, 1.0),
                    trunk + 1.9 * crown * share,
                    0.42 * crown * narrow * r(0.8, 1.2),
                )
            }
        };
        let (sin, cos) = turn.sin_cos();
        let at = [out * cos, up, out * sin];
        b.ball(at, [size * r(0.85, 1.15), size * r(0.6, 0.95), size * r(0.85, 1.15)], leaves.clone());
        if matches!(growth, Growth::Round | Growth::Spreading) && i % 3 == 0 {
            let (fork, tip) = (vec3(0.0, 0.9 * trunk, 0.0), vec3(at[0], at[1], at[2]));
            b.cone(fork, tip, [0.4 * thick, 0.15 * thick], bark.clone());
        }
    }
    b.finish(id, None).on_ground([thick, thick], 0.6, 0.5)
}

/// A hedge or bush.
pub(crate) fn bush(rng: &mut ChaCha8Rng, place: Vec3, id: u64) -> Object {
    let mut b = Builder::at(place, rng.random_range(0.0..3.0), SurfaceClass::Vegetation);
    let leaves = Material::Leaves {
        albedo: leaf_colour(rng),
        density: 0.75,
        size_m: rng.random_range(0.06..0.14),
        seed: rng.random(),
    };
    for i in 0..3 {
        let size = rng.random_range(0.4..0.8);
        let at = [0.7 * f64::from(i) - 0.7, 0.7 * size, rng.random_range(-0.2..0.2)];
        b.ball(at, [1.1 * size, size, 0.9 * size], leaves.clone());
    }
    b.finish(id, None).on_ground([1.2, 0.5], 0.7, 0.4)
}
