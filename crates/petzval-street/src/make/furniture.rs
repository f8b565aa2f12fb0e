//! Street lamps, signs, bins, posts and boards: what is neither labelled nor a house.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::vehicle::plain;
use crate::colour::{Rgb, scaled, surface_colour};
use crate::families::Drawer;
use crate::light::{Light, PointLight};
use crate::material::{LampFace, Material};
use crate::object::{Builder, Object};
use crate::surface_class::SurfaceClass;
use crate::texture::Texture;
use crate::vector::{Vec3, vec3};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Thing {
    Bin,
    Bollard,
    Cabinet,
    Column,
    Board,
    Pillar,
}

const THINGS: [(Thing, &str); 6] = [
    (Thing::Bin, "bin"),
    (Thing::Bollard, "bollard"),
    (Thing::Cabinet, "cabinet"),
    (Thing::Column, "column"),
    (Thing::Board, "board"),
    (Thing::Pillar, "pillar"),
];

/// A thing on the pavement, some of the size of a person.
pub(crate) fn thing(rng: &mut ChaCha8Rng, drawer: &mut Drawer, place: Vec3, yaw: f64, id: u64) -> Object {
    let thing = drawer.draw(rng, "thing", &THINGS);
    let mut b = Builder::at(place, yaw, SurfaceClass::Furniture);
    let coat = Material::Plain { albedo: scaled(surface_colour(rng), 0.7), gloss: 0.02 };
    let texture = Material::Textured(Texture::draw(rng, drawer, 0.3));
    let up = |y: f64| vec3(0.0, y, 0.0);
    let half: f64 = match thing {
        Thing::Bin => {
            let top = rng.random_range(0.8..1.15);
            b.cone(up(0.0), up(top), [0.22, 0.28], coat);
            b.cone(up(top), up(top + 0.1), [0.29, 0.2], plain([0.05; 3]));
            0.25
        }
        Thing::Bollard => {
            let top = rng.random_range(0.7..1.1);
            b.cone(up(0.0), up(top), [0.07, 0.06], coat);
            b.ball([0.0, top, 0.0], [0.075, 0.06, 0.075], plain([0.4, 0.05, 0.04]));
            0.07
        }
        Thing::Cabinet => {
            let half = [rng.random_range(0.3..0.7), rng.random_range(0.5..0.8), 0.2];
            b.block([0.0, half[1], 0.0], half, coat);
            half[0]
        }
        Thing::Column => {
            let radius = rng.random_range(0.35..0.65);
            b.cone(up(0.0), up(2.9), [radius, radius], texture);
            b.ball([0.0, 2.9, 0.0], [radius + 0.06, 0.3, radius + 0.06], coat);
            radius
        }
        Thing::Board => {
            for x in [-0.6, 0.6] {
                b.cone(vec3(x, 0.0, 0.0), vec3(x, 2.2, 0.0), [0.04, 0.04], coat.clone());
            }
            b.block([0.0, 1.5, 0.0], [0.6, 0.85, 0.05], texture);
            0.6
        }
        Thing::Pillar => {
            b.limb(up(0.2), up(rng.random_range(1.1..1.6)), [0.2, 0.16], 0.8, texture);
            b.ball([0.0, 1.75, 0.0], [0.13, 0.15, 0.13], coat);
            0.2
        }
    };
    b.finish(id, None).on_ground([half, 0.25], 0.6, 0.2)
}

/// A traffic sign on a post, or a board with coloured discs that are no lamps.
pub(crate) fn sign(rng: &mut ChaCha8Rng, place: Vec3, yaw: f64, id: u64) -> Object {
    let mut b = Builder::at(place, yaw, SurfaceClass::Pole);
    let top = rng.random_range(2.2..3.4);
    let post = Material::Plain { albedo: [0.28; 3], gloss: 0.02 };
    b.cone(vec3(0.0, 0.0, -0.05), vec3(0.0, 0.5 * top, -0.05), [0.035, 0.035], post.clone());
    b.cone(vec3(0.0, 0.5 * top, -0.05), vec3(0.0, top, -0.05), [0.035, 0.035], post);
    let strong: [Rgb; 5] =
        [[0.5, 0.02, 0.02], [0.02, 0.08, 0.4], [0.6, 0.4, 0.01], [0.01, 0.25, 0.08], [0.03, 0.03, 0.03]];
    b.go_on_as(SurfaceClass::Sign);
    let mut up = top;
    for _ in 0..rng.random_range(1..3) {
        let size: f64 = rng.random_range(0.22..0.36);
        let (ground, figure) = (strong[rng.random_range(0..5)], strong[rng.random_range(0..5)]);
        let white = [0.7; 3];
        let colours = if rng.random_bool(0.5) { (white, figure) } else { (ground, white) };
        let material =
            Material::Sign { ground: colours.0, figure: colours.1, kind: rng.random_range(0..1000) };
        match rng.random_range(0..4) {
            0 | 1 => b.cone(vec3(0.0, up, -0.01), vec3(0.0, up, 0.01), [size, size], material),
            2 => b.block([0.0, up, 0.0], [size, size, 0.01], material),
            _ => {
                // Three discs on a dark board look like a signal and are none.
                b.block([0.0, up, 0.0], [0.17, 0.45, 0.02], plain([0.03; 3]));
                for (i, colour) in
                    [[0.5, 0.02, 0.02], [0.6, 0.42, 0.02], [0.02, 0.3, 0.12]].into_iter().enumerate()
                {
                    let y = up + 0.28 - 0.28 * i as f64;
                    b.cone(vec3(0.0, y, 0.0), vec3(0.0, y, 0.03), [0.1, 0.1], plain(colour));
                }
            }
        }
        up -= 2.0 * size + 0.08;
    }
    b.finish(id, None).on_ground([0.05, 0.05], 0.5, 0.12)
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mast {
    Arm,
    Straight,
    Lantern,
    Double,
}

const MASTS: [(Mast, &str); 4] =
    [(Mast::Arm, "arm"), (Mast::Straight, "straight"), (Mast::Lantern, "lantern"), (Mast::Double, "double")];

/// What all street lamps of a street have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LampStyle {
    mast: Mast,
    height: f64,
    arm: f64,
    tint: Rgb,
    /// Illuminance of the road below the lamp, lx; zero by day.
    below_lx: f32,
    metal: f32,
}

impl LampStyle {
    /// The street lamps of a street.
    pub fn draw(rng: &mut ChaCha8Rng, drawer: &mut Drawer, light: Light) -> Self {
        let mast = drawer.draw(rng, "mast", &MASTS);
        let warm: f32 = rng.random_range(0.0..1.0);
        let on = light == Light::Night || (light == Light::Dusk && rng.random_bool(0.5));
        Self {
            mast,
            height: if mast == Mast::Lantern {
                rng.random_range(3.8..5.0)
            } else {
                rng.random_range(6.0..9.5)
            },
            arm: rng.random_range(0.8..2.2),
            tint: [1.05 + 0.5 * warm, 1.0 - 0.04 * warm, 0.95 - 0.65 * warm],
            below_lx: if on { 10f32.powf(rng.random_range(0.75..1.45)) } else { 0.0 },
            metal: rng.random_range(0.05..0.3),
        }
    }

    /// One street lamp whose arm reaches along `yaw`, and the light that it gives. Some are broken.
    pub fn place(
        &self,
        rng: &mut ChaCha8Rng,
        place: Vec3,
        yaw: f64,
        id: u64,
    ) -> (Object, Option<PointLight>) {
        let mut b = Builder::at(place, yaw, SurfaceClass::Pole);
        let metal = Material::Plain { albedo: [self.metal; 3], gloss: 0.02 };
        let pieces = 5;
        for i in 0..pieces {
            let at = |k: i32| vec3(0.0, self.height * f64::from(k) / f64::from(pieces), 0.0);
            let radius = |k: i32| 0.085 - 0.03 * f64::from(k) / f64::from(pieces);
            b.cone(at(i), at(i + 1), [radius(i), radius(i + 1)], metal.clone());
        }
        let on = self.below_lx > 0.0 && rng.random_bool(0.94);
        // A lamp's face of 0.05 m^2 sends its intensity downward.
        let intensity = self.below_lx * (self.height * self.height) as f32;
        let lit = if on { scaled(self.tint, (intensity / 0.06).min(40_000.0)) } else { [0.0; 3] };
        let lamp = Material::Lamp { lit, dark: [0.4; 3], face: LampFace::Full };
        let arms: &[f64] = match self.mast {
            Mast::Arm => &[1.0],
            Mast::Double => &[-1.0, 1.0],
            _ => &[],
        };
        let top = self.height;
        for side in arms {
            let end = vec3(0.0, top + 0.2, side * self.arm);
            b.cone(vec3(0.0, top - 0.05, 0.0), end, [0.04, 0.035], metal.clone());
            b.ball([0.0, top + 0.22, end.z], [0.13, 0.07, 0.34], metal.clone());
            b.ball([0.0, top + 0.17, end.z], [0.10, 0.05, 0.26], lamp.clone());
        }
        let mut reach = if self.mast == Mast::Arm { self.arm } else { 0.0 };
        match self.mast {
            Mast::Straight => {
                b.ball([0.0, top + 0.03, 0.25], [0.14, 0.06, 0.32], metal);
                b.ball([0.0, top - 0.01, 0.25], [0.1, 0.05, 0.24], lamp);
                reach = 0.25;
            }
            Mast::Lantern => {
                b.cone(vec3(0.0, top, 0.0), vec3(0.0, top + 0.45, 0.0), [0.12, 0.2], lamp);
                b.cone(vec3(0.0, top + 0.45, 0.0), vec3(0.0, top + 0.62, 0.0), [0.24, 0.04], metal);
            }
            Mast::Arm | Mast::Double => {}
        }
        let object = b.finish(id, None).on_ground([0.09, 0.09], 0.5, 0.15);
        let light = on.then(|| PointLight {
            position: object.frame.point(vec3(0.0, top, reach)),
            beam: vec3(0.0, -1.0, 0.0),
            intensity_cd: scaled(self.tint, intensity),
            power: 1,
            dipped: false,
            reach_m: 48.0,
        });
        (object, light)
    }
}
