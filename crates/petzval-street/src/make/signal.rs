//! Traffic lights and lights for people on foot.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::vehicle::plain;
use crate::colour::{Rgb, scaled};
use crate::families::Drawer;
use crate::light::{LampColours, LampState};
use crate::material::{LampFace, Material};
use crate::object::{Builder, Object, ObjectKind};
use crate::surface_class::SurfaceClass;
use crate::vector::{Vec3, vec3};

/// How the lamps are shielded from the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hood {
    Roof,
    Tunnel,
    Cut,
    Bare,
}

const HOODS: [(Hood, &str); 4] =
    [(Hood::Roof, "roof"), (Hood::Tunnel, "tunnel"), (Hood::Cut, "cut"), (Hood::Bare, "bare")];

/// What all signals of one approach have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    hood: Hood,
    /// Diameter of a lamp, m.
    lamp_m: f64,
    housing: Rgb,
    board: bool,
    /// Luminance of a lamp that is on, cd/m^2.
    luminance: f32,
    /// Angle of the arrow, if the lamps are arrows.
    arrow: Option<f64>,
}

impl Style {
    /// The style of an approach.
    pub fn draw(rng: &mut ChaCha8Rng, drawer: &mut Drawer) -> Self {
        let hood = drawer.draw(rng, "hood", &HOODS);
        let housing = match rng.random_range(0..10) {
            0..=6 => [rng.random_range(0.015..0.05); 3],
            7 | 8 => [0.03, rng.random_range(0.05..0.09), 0.045],
            _ => [0.45, 0.3, 0.03],
        };
        Self {
            hood,
            lamp_m: if rng.random_bool(0.45) { 0.3 } else { 0.2 },
            housing,
            board: rng.random_bool(0.35),
            luminance: 10f32.powf(rng.random_range(3.48..4.17)),
            arrow: None,
        }
    }

    /// The same style with arrows that point `angle` rad from upward to the right.
    pub fn with_arrow(self, angle: f64) -> Self {
        Self { arrow: Some(angle), ..self }
    }

    /// Height of the housing, m.
    pub fn height_m(&self) -> f64 {
        3.0 * self.pitch() + 0.04
    }

    fn pitch(&self) -> f64 {
        self.lamp_m + 0.06
    }
}

/// Reflectances of the dark lamps from top to bottom.
const DARK: [Rgb; 3] = [[0.022, 0.006, 0.006], [0.022, 0.015, 0.006], [0.006, 0.016, 0.014]];

/// The housing of a traffic light. `foot` is the middle of its lower edge; its lamps face along `yaw`.
pub(crate) fn housing(
    style: &Style,
    foot: Vec3,
    yaw: f64,
    state: LampState,
    colours: &LampColours,
    kind: ObjectKind,
    id: u64,
) -> Object {
    let mut b = Builder::at(foot, yaw, SurfaceClass::Signal);
    let (pitch, radius) = (style.pitch(), 0.5 * style.lamp_m);
    let (half_w, half_h, half_d) = (radius + 0.055, 0.5 * style.height_m(), 0.09);
    let shell = Material::Plain { albedo: style.housing, gloss: 0.015 };
    b.block([0.0, half_h, -half_d], [half_w, half_h, half_d], shell.clone());
    let on = [LampState::Red, LampState::Yellow, LampState::Green];
    let tints = [colours.red, colours.yellow, colours.green];
    for i in 0..3 {
        let up = 0.02 + pitch * (2.5 - i as f64);
        let lit = if state == on[i] { scaled(tints[i], style.luminance) } else { [0.0; 3] };
        let face = style.arrow.map_or(LampFace::Full, LampFace::Arrow);
        let lamp = Material::Lamp { lit, dark: DARK[i], face };
        b.cone(vec3(0.0, up, -0.05), vec3(0.0, up, 0.012), [radius, radius], lamp);
        hood(&mut b, style, up, radius, &shell);
    }
    let mut object = b.finish(id, Some(kind));
    object.lamp = Some(state);
    object
}

/// A hood over a lamp: a roof, and sides of more or less length.
fn hood(b: &mut Builder, style: &Style, up: f64, radius: f64, shell: &Material) {
    let length = match style.hood {
        Hood::Bare => return,
        Hood::Roof => 0.7 * radius,
        Hood::Cut => 1.1 * radius,
        Hood::Tunnel => 1.5 * radius,
    };
    let r = radius + 0.012;
    b.block([0.0, up + r, length], [0.62 * r, 0.007, length], shell.clone());
    if style.hood == Hood::Roof {
        return;
    }
    for side in [-1.0, 1.0] {
        // The sides of a cut hood are shorter below.
        let frame = crate::vector::Frame {
            origin: vec3(side * 0.82 * r, up + 0.72 * r, length),
            x: vec3(0.707, -0.707 * side, 0.0) * (0.34 * r),
            y: vec3(0.707 * side, 0.707, 0.0) * 0.007,
            z: vec3(0.0, 0.0, length),
        };
        b.add(crate::shape::Shape::Cube, frame, shell.clone());
        let (low, long) = if style.hood == Hood::Tunnel { (0.62, length) } else { (0.3, 0.65 * length) };
        b.block([side * r, up + (0.45 - low) * r, long], [0.007, low * r, long], shell.clone());
    }
}

/// The board behind a housing; it is no part of the light.
pub(crate) fn backboard(style: &Style, foot: Vec3, yaw: f64, id: u64) -> Option<Object> {
    if !style.board {
        return None;
    }
    let mut b = Builder::at(foot, yaw, SurfaceClass::Signal);
    let (half_w, half_h) = (0.5 * style.lamp_m + 0.2, 0.5 * style.height_m() + 0.14);
    b.block([0.0, 0.5 * style.height_m(), -0.10], [half_w, half_h, 0.008], plain([0.025; 3]));
    b.block([0.0, 0.5 * style.height_m(), -0.112], [half_w + 0.03, half_h + 0.03, 0.004], plain([0.6; 3]));
    Some(b.finish(id, None))
}

/// A pole with an optional arm: from the ground to `top_m`, then `arm_m` metres to the left (negative) or right.
pub(crate) fn pole(rng: &mut ChaCha8Rng, foot: Vec3, yaw: f64, top_m: f64, arm_m: f64, id: u64) -> Object {
    let mut b = Builder::at(foot, yaw, SurfaceClass::Pole);
    let metal = Material::Plain { albedo: [rng.random_range(0.05..0.35); 3], gloss: 0.02 };
    let radius = if arm_m == 0.0 { 0.055 } else { 0.1 };
    // Short pieces keep the spheres around them small.
    let pieces = (top_m / 1.5).ceil();
    for i in 0..pieces as usize {
        let (low, high) = (top_m * i as f64 / pieces, top_m * (i + 1) as f64 / pieces);
        b.cone(vec3(0.0, low, 0.0), vec3(0.0, high, 0.0), [radius, radius], metal.clone());
    }
    if arm_m != 0.0 {
        let rise = 0.25;
        let pieces = (arm_m.abs() / 1.5).ceil();
        for i in 0..pieces as usize {
            let at = |k: f64| vec3(arm_m * k / pieces, top_m - 0.1 + rise * k / pieces, 0.0);
            b.cone(at(i as f64), at(i as f64 + 1.0), [0.06, 0.06], metal.clone());
        }
    }
    b.finish(id, None).on_ground([radius, radius], 0.5, 0.15)
}

/// A light for people on foot: two lamps, a standing red and a walking green figure.
pub(crate) fn pedestrian_light(
    rng: &mut ChaCha8Rng,
    foot: Vec3,
    yaw: f64,
    colours: &LampColours,
    walk: bool,
    id: u64,
) -> Object {
    let mut b = Builder::at(foot, yaw, SurfaceClass::Signal);
    let radius = 0.1;
    let shell = Material::Plain { albedo: [rng.random_range(0.015..0.06); 3], gloss: 0.015 };
    b.block([0.0, 0.27, -0.08], [0.15, 0.27, 0.08], shell.clone());
    let luminance = 10f32.powf(rng.random_range(3.3..3.9));
    for (i, up) in [0.4, 0.14].into_iter().enumerate() {
        let (colour, dark) = if i == 0 { (colours.red, DARK[0]) } else { (colours.green, DARK[2]) };
        let lit = if walk == (i == 1) { scaled(colour, luminance) } else { [0.0; 3] };
        let lamp = Material::Lamp { lit, dark, face: LampFace::Figure { walking: i == 1 } };
        b.cone(vec3(0.0, up, -0.05), vec3(0.0, up, 0.01), [radius, radius], lamp);
        b.block([0.0, up + radius + 0.01, 0.07], [0.1, 0.007, 0.07], shell.clone());
    }
    let mut object = b.finish(id, Some(ObjectKind::PedestrianLight));
    object.lamp = Some(if walk { LampState::Green } else { LampState::Red });
    object
}
