//! Trucks and buses.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::vehicle::{HEAD_WHITE, Lamps, RED_GLASS, paint_colour, plain};
use crate::colour::{Rgb, scaled};
use crate::families::Drawer;
use crate::material::{LampFace, Material, Paint};
use crate::object::{Builder, Object, ObjectKind};
use crate::surface_class::SurfaceClass;
use crate::texture::Texture;
use crate::vector::{Vec3, vec3};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Build {
    Box,
    Bus,
    Flatbed,
    Coach,
}

const BUILDS: [(Build, &str); 4] =
    [(Build::Box, "box"), (Build::Bus, "bus"), (Build::Flatbed, "flatbed"), (Build::Coach, "coach")];

/// A truck or bus of any family at a place, turned by `yaw`.
pub(crate) fn truck(
    rng: &mut ChaCha8Rng,
    drawer: &mut Drawer,
    place: Vec3,
    yaw: f64,
    lamps: Lamps,
    id: u64,
) -> Object {
    let build = drawer.draw(rng, "truck", &BUILDS);
    let bus = matches!(build, Build::Bus | Build::Coach);
    let length: f64 = if bus { rng.random_range(8.5..12.0) } else { rng.random_range(5.8..9.0) };
    let width: f64 = rng.random_range(2.15..2.5);
    let height: f64 = match build {
        Build::Bus => rng.random_range(2.8..3.2),
        Build::Coach => rng.random_range(3.2..3.7),
        _ => rng.random_range(2.4..2.9),
    };
    let (half, side) = (0.5 * length, 0.5 * width);
    let albedo = paint_colour(rng);
    let (seams_m, seed) = ([half - 1.3, half - 0.2, half - 2.5], rng.random());
    let paint = Paint { albedo, skirt: [0.04; 3], skirt_m: 0.55, seams_m, dirt_m: 1.4, lamps: None, seed };
    let mut b = Builder::at(place, yaw, SurfaceClass::Vehicle);
    let cab_end = if bus { -half } else { half - rng.random_range(1.7..2.2) };
    let sill = if bus { rng.random_range(1.0..1.4) } else { rng.random_range(1.3..1.55) };
    let lean = rng.random_range(0.05..0.25);
    let lower = [
        (vec3(0.0, -1.0, 0.0), vec3(0.0, 0.38, 0.0)),
        (vec3(0.0, 1.0, 0.0), vec3(0.0, sill, 0.0)),
        (vec3(1.0, 0.0, 0.0), vec3(side, 0.0, 0.0)),
        (vec3(-1.0, 0.0, 0.0), vec3(-side, 0.0, 0.0)),
        (vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, half)),
        (vec3(0.0, 0.0, -1.0), vec3(0.0, 0.0, cab_end)),
        (vec3(0.4, 0.0, 1.0), vec3(side - 0.25, 0.0, half)),
        (vec3(-0.4, 0.0, 1.0), vec3(0.25 - side, 0.0, half)),
    ];
    b.convex(&lower, Material::Paint(paint));
    let rear_lean = if bus { 0.03 } else { 0.0 };
    let upper = [
        (vec3(0.0, -1.0, 0.0), vec3(0.0, sill - 0.02, 0.0)),
        (vec3(0.0, 1.0, 0.0), vec3(0.0, height, 0.0)),
        (vec3(1.0, 0.06, 0.0), vec3(side, sill, 0.0)),
        (vec3(-1.0, 0.06, 0.0), vec3(-side, sill, 0.0)),
        (vec3(0.0, lean, 1.0), vec3(0.0, sill, half)),
        (vec3(0.0, rear_lean, -1.0), vec3(0.0, sill, cab_end)),
        (vec3(0.0, 1.0, 0.9), vec3(0.0, height, half - 0.5)),
        (vec3(0.7, 1.0, 0.0), vec3(side - 0.2, height, 0.0)),
        (vec3(-0.7, 1.0, 0.0), vec3(0.2 - side, height, 0.0)),
    ];
    let middle = if bus { None } else { Some(cab_end + 0.3) };
    b.convex(&upper, Material::Cabin { paint, pillar_m: 0.16, middle_pillar_m: middle, inside: 0.05 });
    if bus {
        for i in 1..(length / 1.6) as usize {
            let z = half - 1.6 * i as f64;
            for x in [-1.0, 1.0] {
                let centre = [x * (side - 0.015), 0.5 * (sill + height) - 0.1, z];
                b.block(centre, [0.02, 0.5 * (height - sill) - 0.1, 0.05], plain([0.03; 3]));
            }
        }
    }
    let load = if rng.random_bool(0.5) {
        plain([rng.random_range(0.3..0.7); 3])
    } else {
        Material::Textured(Texture::draw(rng, drawer, 0.8))
    };
    let bed = 0.5 * (cab_end - 0.15 - half);
    let bed_half = 0.5 * (cab_end - 0.15 + half);
    match build {
        Build::Box => {
            let top = rng.random_range(2.9..3.7);
            b.block([0.0, 0.5 * (1.0 + top), bed], [side + 0.04, 0.5 * (top - 1.0), bed_half], load);
        }
        Build::Flatbed => {
            b.block([0.0, 1.1, bed], [side, 0.25, bed_half], Material::Paint(paint));
            let pile = rng.random_range(0.3..1.0);
            b.block([0.0, 1.3 + 0.5 * pile, bed], [0.85 * side, 0.5 * pile, 0.8 * bed_half], load);
        }
        Build::Bus | Build::Coach => {
            let kind = 4 + 6 * rng.random_range(0..99u32);
            let board = Material::Sign { ground: [0.02; 3], figure: [0.5, 0.35, 0.02], kind };
            b.block([0.0, height - 0.32, half - lean * 0.5], [0.7, 0.13, 0.06], board);
        }
    }
    if !bus {
        b.block([0.0, 0.75, bed], [0.5 * side, 0.12, bed_half], plain([0.03; 3]));
        b.block([0.0, 0.55, 0.05 - half], [0.9 * side, 0.06, 0.05], plain([0.05; 3]));
    }
    for x in [-1.0, 1.0] {
        let mut axles = vec![half - 1.3 - if bus { 1.2 } else { 0.0 }, 1.7 - half];
        if length > 8.0 && !bus {
            axles.push(2.8 - half);
        }
        for z in axles {
            let at = |out: f64, up: f64| vec3(x * out, 0.48 + up, z);
            b.cone(at(side - 0.35, 0.06), at(side + 0.006, 0.06), [0.52, 0.52], plain([0.012; 3]));
            let wheel = Material::Wheel { rim: [0.25; 3], rim_share: 0.55, spokes: 8 };
            b.cone(at(side - 0.3, 0.0), at(side + 0.012, 0.0), [0.48, 0.48], wheel);
        }
        let lit = |colour: Rgb, luminance: f32| scaled(colour, luminance);
        let head = Material::Lamp { lit: lit(HEAD_WHITE, lamps.head), dark: [0.5; 3], face: LampFace::Beam };
        b.ball([x * (side - 0.32), 0.78, half - 0.04], [0.16, 0.09, 0.07], head);
        let tail = Material::Lamp { lit: lit(lamps.red, lamps.tail), dark: RED_GLASS, face: LampFace::Full };
        b.block([x * (side - 0.22), 0.85, -half], [0.14, 0.08, 0.025], tail);
        b.block([x * (side + 0.14), sill + 0.5, half - 0.15], [0.09, 0.18, 0.05], plain([0.03; 3]));
    }
    let plate = Material::Sign { ground: [0.7, 0.7, 0.66], figure: [0.03; 3], kind: 4 };
    b.block([0.0, 0.62, -half], [0.26, 0.055, 0.02], plate.clone());
    b.block([0.0, 0.5, half], [0.26, 0.055, 0.02], plate);
    b.finish(id, Some(ObjectKind::Vehicle)).on_ground([side, half], 0.93, 0.35)
}
