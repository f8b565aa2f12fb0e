//! Houses along the street.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::vehicle::plain;
use crate::colour::{from_hue, scaled, surface_colour};
use crate::facade::Facade;
use crate::families::Drawer;
use crate::light::Light;
use crate::material::Material;
use crate::object::{Builder, Object};
use crate::surface_class::SurfaceClass;
use crate::texture::Texture;
use crate::vector::{Vec3, vec3};

/// A house of `width_m` whose front stands at `place` (its middle) and looks along `yaw`; it is `depth_m` deep.
pub(crate) fn house(
    rng: &mut ChaCha8Rng,
    drawer: &mut Drawer,
    light: Light,
    place: Vec3,
    yaw: f64,
    [width_m, height_m, depth_m]: [f64; 3],
    id: u64,
) -> Object {
    let mut b = Builder::at(place, yaw, SurfaceClass::Building);
    let facade = Arc::new(Facade::draw(rng, drawer, light, height_m));
    let (half, deep) = (0.5 * width_m, 0.5 * depth_m);
    b.block([0.0, 0.5 * height_m, -deep], [half, 0.5 * height_m, deep], Material::Facade(facade));
    let trim = plain(from_hue(
        rng.random_range(0.02..0.16),
        rng.random_range(0.0..0.25),
        rng.random_range(0.08..0.5),
    ));
    if rng.random_bool(0.6) {
        // A cornice along the edge of the roof.
        let high = rng.random_range(0.12..0.3);
        b.block([0.0, height_m, -deep], [half + 0.12, high, deep + 0.25], trim.clone());
    }
    if rng.random_bool(0.45) {
        // A pitched roof.
        let rise = rng.random_range(1.5..4.0);
        let tone = rng.random_range(0.08..0.3);
        let tile = from_hue(rng.random_range(0.01..0.08), rng.random_range(0.0..0.6), tone);
        let colours = [tile, scaled(tile, 0.6)];
        let tiles = Material::Textured(Texture { contrast: 0.5, colours, ..Texture::draw(rng, drawer, 0.4) });
        let ridge = vec3(0.0, height_m + rise, -deep);
        b.convex(
            &[
                (vec3(0.0, -1.0, 0.0), vec3(0.0, height_m, 0.0)),
                (vec3(1.0, 0.0, 0.0), vec3(half, 0.0, 0.0)),
                (vec3(-1.0, 0.0, 0.0), vec3(-half, 0.0, 0.0)),
                (vec3(0.0, deep, rise), ridge),
                (vec3(0.0, deep, -rise), ridge),
            ],
            tiles,
        );
        let x = half * rng.random_range(-0.7..0.7);
        b.block([x, height_m + rise, -0.8 * deep], [0.3, 0.7, 0.4], trim.clone());
    }
    if rng.random_bool(0.3) {
        // Balconies.
        let x = half * rng.random_range(-0.6..0.6);
        for floor in 1..(height_m / 3.2) as usize {
            let up = 3.2 * floor as f64;
            b.block([x, up + 0.05, 0.5], [1.3, 0.07, 0.5], trim.clone());
            b.block([x, up + 0.55, 0.98], [1.3, 0.45, 0.02], trim.clone());
        }
    }
    if rng.random_bool(0.35) {
        // An awning over the pavement.
        let cloth = Material::Textured(Texture::draw(rng, drawer, 0.3));
        let width = half * rng.random_range(0.25..0.8);
        b.tipped_block([rng.random_range(-0.2..0.2) * half, 2.75, 0.65], [width, 0.03, 0.7], -0.45, cloth);
    }
    if rng.random_bool(0.4) {
        // A sign that stands out from the wall; some are round.
        let kind = rng.random_range(0..1000);
        let sign = Material::Sign { ground: surface_colour(rng), figure: surface_colour(rng), kind };
        let x = half * rng.random_range(-0.9..0.9);
        let centre = [x, rng.random_range(2.7..4.2), 0.5];
        b.turned_block(centre, [0.4, 0.3, 0.05], std::f64::consts::FRAC_PI_2, sign);
    }
    b.finish(id, None).on_ground([half, 0.3], 0.45, 0.6)
}
