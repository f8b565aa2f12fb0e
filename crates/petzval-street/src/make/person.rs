//! People: limbs of round cones in the poses of a walk, in clothes.

use std::f64::consts::PI;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::colour::{Rgb, from_hue, scaled, surface_colour};
use crate::families::Drawer;
use crate::material::Material;
use crate::object::{Builder, Object, ObjectKind};
use crate::surface_class::SurfaceClass;
use crate::texture::Texture;
use crate::vector::{Vec3, vec3};

/// Shape families of people: what they wear.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Outfit {
    Trousers,
    Coat,
    Skirt,
    Shorts,
    Parka,
    Dress,
}

const OUTFITS: [(Outfit, &str); 6] = [
    (Outfit::Trousers, "trousers"),
    (Outfit::Coat, "coat"),
    (Outfit::Skirt, "skirt"),
    (Outfit::Shorts, "shorts"),
    (Outfit::Parka, "parka"),
    (Outfit::Dress, "dress"),
];

/// A person at a place, facing `yaw`. `phase` is the place in the walk in turns; a person who stands has `stride` 0.
pub(crate) fn person(
    rng: &mut ChaCha8Rng,
    drawer: &mut Drawer,
    place: Vec3,
    yaw: f64,
    [phase, stride]: [f64; 2],
    id: u64,
) -> Object {
    let outfit = drawer.draw(rng, "person", &OUTFITS);
    // Children are shorter and have larger heads.
    let child = rng.random_bool(0.14);
    let height: f64 = if child { rng.random_range(1.1..1.5) } else { rng.random_range(1.52..1.95) };
    let girth = rng.random_range(0.86..1.28) * height / 1.72;
    let head = if child { 0.106 } else { 0.067 * height };
    let skin = skin_colour(rng);
    let mut cloth = |size: f64| {
        let mut texture = Texture::draw(rng, drawer, size);
        texture.contrast *= 0.8;
        Material::Textured(texture)
    };
    let (upper, lower) = (cloth(0.12), cloth(0.2));
    let bare = Material::Plain { albedo: skin, gloss: 0.01 };
    let shoe = Material::Plain { albedo: scaled(surface_colour(rng), 0.5), gloss: 0.02 };

    let hip = 0.515 * height;
    let shoulder = (height - 2.0 * head) * rng.random_range(0.94..0.965);
    let swing = stride * (2.0 * PI * phase).sin();
    let lean = 0.03 * stride;
    let wide = 0.105 * girth;

    // The thigh swings, and the knee of the leg that comes forward bends: hip, knee and ankle of the legs.
    let leg = |side: f64| {
        let swing = -side * swing;
        let lifting = (-side * (2.0 * PI * phase).cos()).max(0.0) * stride;
        let top = vec3(side * 0.085 * girth, hip, 0.0);
        let knee = top + vec3(0.0, -swing.cos(), swing.sin()) * (0.245 * height);
        let angle = swing - 0.15 * stride - 1.1 * lifting;
        [top, knee, knee + vec3(0.0, -angle.cos(), angle.sin()) * (0.235 * height)]
    };
    let legs = [leg(-1.0), leg(1.0)];
    // The body sinks until the lower foot, or the wide end of a trouser leg, stands on the ground.
    let sole = legs[0][2].y.min(legs[1][2].y) - f64::max(0.054, 0.05 * girth);
    let mut b = Builder::at(place - vec3(0.0, sole, 0.0), yaw, SurfaceClass::Pedestrian);
    for (side, [top, knee, ankle]) in [-1.0, 1.0].into_iter().zip(legs) {
        let toe = ankle + vec3(side * 0.02, -0.02, 0.095 * height);
        let bare_shin = matches!(outfit, Outfit::Shorts | Outfit::Skirt | Outfit::Dress);
        let bare_thigh = matches!(outfit, Outfit::Skirt | Outfit::Dress);
        let (thick, loose) = if bare_shin { (0.05, 0.036) } else { (0.058, 0.05) };
        let [thigh, shin] = [bare_thigh, bare_shin].map(|is_bare| if is_bare { &bare } else { &lower });
        b.limb(top, knee, [0.085 * girth, (thick + 0.008) * girth], 1.0, thigh.clone());
        b.limb(knee, ankle, [thick * girth, loose * girth], 1.0, shin.clone());
        b.limb(ankle - vec3(0.0, 0.012, 0.02), toe, [0.042, 0.031], 1.0, shoe.clone());
    }

    // Trunk: flatter than wide.
    let chest = vec3(0.0, shoulder - 0.6 * wide, lean);
    b.limb(vec3(0.0, hip, 0.0), chest, [1.32 * wide, 1.62 * wide], 0.66, upper.clone());
    b.ball([0.0, hip - 0.01, 0.0], [1.42 * wide, 1.0 * wide, 1.05 * wide], lower.clone());
    let hem = |b: &mut Builder, from: f64, to: f64, radius: [f64; 2], material: Material| {
        b.cone(vec3(0.0, to * height, 0.0), vec3(0.0, from * height, 0.0), radius, material);
    };
    match outfit {
        Outfit::Coat => {
            hem(&mut b, 0.62, rng.random_range(0.28..0.42), [1.9 * wide, 1.35 * wide], upper.clone())
        }
        Outfit::Parka => {
            b.ball([0.0, 0.63 * height, 0.0], [1.75 * wide, 0.15 * height, 1.35 * wide], upper.clone());
            b.ball([0.0, shoulder - 0.02, -0.05], [1.0 * wide, 0.7 * wide, 0.9 * wide], upper.clone());
        }
        Outfit::Skirt => {
            hem(&mut b, 0.60, rng.random_range(0.27..0.42), [2.1 * wide, 1.2 * wide], lower.clone())
        }
        Outfit::Dress => {
            hem(&mut b, 0.62, rng.random_range(0.2..0.36), [2.2 * wide, 1.15 * wide], upper.clone())
        }
        Outfit::Trousers | Outfit::Shorts => {}
    }

    // Arms swing against the legs; some carry a telephone or push hands into pockets.
    let sleeve = if outfit == Outfit::Shorts || (outfit == Outfit::Dress && rng.random_bool(0.5)) {
        bare.clone()
    } else {
        upper.clone()
    };
    let raised = rng.random_bool(0.15);
    for (side, sign) in [(-1.0, -1.0), (1.0, 1.0)] {
        let swing = 0.8 * sign * swing;
        let top = vec3(side * 1.75 * wide, shoulder - 0.03, lean);
        let elbow = top + vec3(side * 0.06, -swing.cos(), swing.sin()) * (0.185 * height);
        let bend = swing + 0.25 + if raised && side > 0.0 { 1.7 } else { 0.2 * stride };
        let wrist = elbow + vec3(-side * 0.05, -bend.cos(), bend.sin()) * (0.16 * height);
        b.limb(top, elbow, [0.056 * girth, 0.046 * girth], 1.0, upper.clone());
        b.limb(elbow, wrist, [0.045 * girth, 0.034 * girth], 1.0, sleeve.clone());
        b.ball([wrist.x, wrist.y - 0.03, wrist.z + 0.01], [0.036, 0.055, 0.042], bare.clone());
    }

    // Neck, head, hair or hat.
    let middle = height - head;
    let (neck, chin) = (vec3(0.0, shoulder - 0.05, lean), vec3(0.0, middle - 0.3 * head, 1.3 * lean));
    b.limb(neck, chin, [0.058 * girth, 0.05 * girth], 1.0, bare.clone());
    b.ball([0.0, middle, 0.02 + lean], [0.74 * head, head, 0.84 * head], bare);
    let hair = Material::Plain { albedo: hair_colour(rng), gloss: 0.01 };
    match rng.random_range(0..10) {
        0..=5 => b.ball(
            [0.0, middle + 0.15 * head, lean - 0.12 * head],
            [0.82 * head, 0.92 * head, 0.86 * head],
            hair,
        ),
        6 | 7 => {
            let centre = [0.0, middle + 0.13 * head, lean - 0.14 * head];
            b.ball(centre, [0.84 * head, 0.93 * head, 0.88 * head], hair.clone());
            let (top, tip) = (vec3(0.0, middle, lean - 0.05), vec3(0.0, middle - 1.9 * head, lean - 0.1));
            b.limb(top, tip, [0.68 * head, 0.4 * head], 0.6, hair);
        }
        8 => {
            b.ball([0.0, middle + 0.32 * head, lean], [0.86 * head, 0.78 * head, 0.95 * head], upper.clone())
        }
        _ => {}
    }
    match rng.random_range(0..10) {
        0 | 1 => {
            let bag = Material::Plain { albedo: surface_colour(rng), gloss: 0.01 };
            let [low, high] = [hip + 0.08, shoulder - 0.12].map(|up| vec3(0.0, up, -1.3 * wide));
            b.limb(low, high, [0.13 * girth, 0.12 * girth], 0.7, bag);
        }
        2 | 3 => {
            let bag = Material::Plain { albedo: surface_colour(rng), gloss: 0.01 };
            let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            b.block([side * 2.45 * wide, hip - 0.12, 0.02], [0.05, 0.15, 0.17], bag);
        }
        _ => {}
    }
    b.finish(id, Some(ObjectKind::Pedestrian)).on_ground([0.13, 0.16], 0.5, 0.12)
}

fn skin_colour(rng: &mut ChaCha8Rng) -> Rgb {
    let tone: f32 = rng.random();
    from_hue(0.055 + 0.02 * tone, 0.42 + 0.2 * (1.0 - tone), 0.09 + 0.48 * tone)
}

fn hair_colour(rng: &mut ChaCha8Rng) -> Rgb {
    match rng.random_range(0..6) {
        0..=2 => [0.02, 0.016, 0.013],
        3 => from_hue(0.07, 0.6, rng.random_range(0.05..0.2)),
        4 => from_hue(0.11, 0.5, rng.random_range(0.25..0.5)),
        _ => [rng.random_range(0.2..0.55); 3],
    }
}
