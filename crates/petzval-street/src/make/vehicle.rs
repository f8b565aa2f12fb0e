//! Cars: a lower body and a cabin, both convex, with wheels, lamps and plates.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::colour::{Rgb, from_hue, scaled};
use crate::families::Drawer;
use crate::light::Light;
use crate::material::{CarLamps, Material, Paint};
use crate::object::{Builder, Object, ObjectKind};
use crate::surface_class::SurfaceClass;
use crate::vector::{Vec3, vec3};

/// Shape families of cars.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Body {
    Hatchback,
    Saloon,
    Suv,
    Estate,
    Van,
    Coupe,
    City,
    Pickup,
}

const BODIES: [(Body, &str); 8] = [
    (Body::Hatchback, "hatchback"),
    (Body::Saloon, "saloon"),
    (Body::Suv, "suv"),
    (Body::Estate, "estate"),
    (Body::Van, "van"),
    (Body::Coupe, "coupe"),
    (Body::City, "city"),
    (Body::Pickup, "pickup"),
];

/// How a vehicle's lamps burn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lamps {
    /// Luminance of a head lamp along its beam, of a tail lamp and of a brake lamp, cd/m^2.
    pub head: f32,
    pub tail: f32,
    /// Channels of the tail lamps at unit luminance.
    pub red: Rgb,
}

impl Lamps {
    /// The lamps of a vehicle that is driving or parked.
    pub fn draw(rng: &mut ChaCha8Rng, light: Light, driving: bool, red: Rgb) -> Self {
        let braking = driving && rng.random_bool(0.35);
        if !driving {
            return Self { head: 0.0, tail: 0.0, red };
        }
        let head = match light {
            Light::Day if rng.random_bool(0.5) => 10f32.powf(rng.random_range(4.0..4.8)),
            Light::Day => 0.0,
            _ => 10f32.powf(rng.random_range(4.7..6.0)),
        };
        let tail = match (light, braking) {
            (_, true) => rng.random_range(1500.0..3000.0),
            (Light::Day, false) => 0.0,
            _ => rng.random_range(500.0..900.0),
        };
        Self { head, tail, red }
    }
}

/// Colours as they are sold: mostly white, gray and black.
pub(crate) fn paint_colour(rng: &mut ChaCha8Rng) -> Rgb {
    match rng.random_range(0..10) {
        0 | 1 => [rng.random_range(0.55..0.8); 3],
        2..=4 => {
            let gray = rng.random_range(0.08..0.45);
            from_hue(rng.random(), rng.random_range(0.0..0.12), gray)
        }
        5 | 6 => [rng.random_range(0.015..0.05); 3],
        _ => from_hue(rng.random(), rng.random_range(0.5..0.95), rng.random_range(0.08..0.6)),
    }
}

pub(crate) const RED_GLASS: Rgb = [0.22, 0.015, 0.012];
pub(crate) const HEAD_WHITE: Rgb = [1.0, 1.0, 0.96];

/// The sizes of a car, m. Places along the car are measured from its middle, forward positive.
struct Sizes {
    length: f64,
    width: f64,
    height: f64,
    belt: f64,
    bonnet: f64,
    /// Foot of the windscreen, front and rear edge of the roof, foot of the rear window.
    cabin: [f64; 4],
    boot: f64,
    wheel: f64,
}

fn sizes(rng: &mut ChaCha8Rng, body: Body) -> Sizes {
    let mut r = |low: f64, high: f64| rng.random_range(low..high);
    let (length, width, height) = match body {
        Body::Hatchback => (r(3.9, 4.4), r(1.72, 1.84), r(1.42, 1.54)),
        Body::Saloon => (r(4.4, 5.0), r(1.78, 1.92), r(1.40, 1.50)),
        Body::Suv => (r(4.2, 4.9), r(1.80, 1.98), r(1.60, 1.82)),
        Body::Estate => (r(4.4, 4.95), r(1.76, 1.90), r(1.44, 1.56)),
        Body::Van => (r(4.6, 5.9), r(1.85, 2.08), r(1.85, 2.5)),
        Body::Coupe => (r(4.1, 4.6), r(1.78, 1.92), r(1.24, 1.38)),
        Body::City => (r(2.7, 3.6), r(1.58, 1.70), r(1.45, 1.58)),
        Body::Pickup => (r(4.9, 5.5), r(1.84, 2.0), r(1.72, 1.88)),
    };
    let belt = match body {
        Body::Van => r(1.05, 1.25),
        Body::Suv | Body::Pickup => r(1.02, 1.14),
        Body::Coupe => r(0.82, 0.9),
        _ => r(0.88, 1.0),
    };
    let half = 0.5 * length;
    let nose = match body {
        Body::Van => r(0.35, 0.8),
        Body::City => r(0.5, 0.75),
        Body::Coupe | Body::Saloon => r(1.2, 1.45),
        _ => r(0.95, 1.25),
    };
    let foot = half - nose;
    let rake = match body {
        Body::Van => r(0.35, 0.6),
        Body::Suv | Body::Pickup | Body::City => r(0.5, 0.7),
        _ => r(0.65, 0.9),
    };
    let (roof_end, rear_foot) = match body {
        Body::Saloon => (-half + r(1.2, 1.5), -half + r(0.55, 0.8)),
        Body::Coupe => (-half + r(1.5, 1.8), -half + r(0.35, 0.6)),
        Body::Pickup => (-half + r(1.9, 2.2), -half + r(1.7, 1.85)),
        Body::Van => (-half + r(0.12, 0.25), -half + 0.06),
        Body::Hatchback | Body::City => (-half + r(0.4, 0.65), -half + 0.1),
        Body::Suv | Body::Estate => (-half + r(0.3, 0.5), -half + 0.1),
    };
    Sizes {
        length,
        width,
        height,
        belt,
        bonnet: belt - r(0.1, 0.22),
        cabin: [foot, foot - rake, roof_end, rear_foot],
        boot: belt - r(0.0, 0.06),
        wheel: match body {
            Body::Suv | Body::Pickup => r(0.35, 0.40),
            Body::City => r(0.27, 0.30),
            _ => r(0.30, 0.345),
        },
    }
}

/// A car of any family at a place, turned by `yaw`.
pub(crate) fn car(
    rng: &mut ChaCha8Rng,
    drawer: &mut Drawer,
    place: Vec3,
    yaw: f64,
    lamps: Lamps,
    id: u64,
) -> Object {
    let body = drawer.draw(rng, "car", &BODIES);
    let s = sizes(rng, body);
    let (half, side) = (0.5 * s.length, 0.5 * s.width);
    let albedo = paint_colour(rng);
    let black_skirt = rng.random_bool(0.45);
    let [foot, roof_front, roof_end, rear_foot] = s.cabin;
    let pillar = 0.5 * (roof_front + roof_end) + rng.random_range(-0.1..0.25);
    let paint = Paint {
        albedo,
        skirt: if black_skirt { [0.03; 3] } else { scaled(albedo, 0.8) },
        skirt_m: rng.random_range(0.26..0.5),
        seams_m: [foot - 0.25, pillar, rear_foot.max(-half + 0.9) + 0.1],
        dirt_m: rng.random_range(0.1..0.8),
        lamps: Some(car_lamps(rng, &s, side, body, lamps)),
        seed: rng.random(),
    };
    let mut b = Builder::at(place, yaw, SurfaceClass::Vehicle);
    let clearance = s.wheel * 0.62;

    lower_body(&mut b, &s, clearance, paint);
    // The cabin stands on the belt line; its sides lean in.
    let (low, high) = (side - 0.05, side - rng.random_range(0.16..0.28));
    let pillar_m = rng.random_range(0.05..0.09);
    let inside = rng.random_range(0.005..0.06);
    let cargo = body == Body::Van && rng.random_bool(0.5);
    let material = Material::Cabin {
        paint: Paint { skirt_m: 0.0, ..paint },
        pillar_m: if cargo { 0.16 } else { pillar_m },
        middle_pillar_m: Some(pillar),
        inside,
    };
    let cut = s.belt - 0.04;
    let (rise, top) = (s.height - cut, s.height);
    b.convex(
        &[
            (vec3(0.0, -1.0, 0.0), vec3(0.0, cut, 0.0)),
            (vec3(0.0, 1.0, 0.0), vec3(0.0, top, 0.0)),
            (vec3(rise, low - high, 0.0), vec3(low, cut, 0.0)),
            (vec3(-rise, low - high, 0.0), vec3(-low, cut, 0.0)),
            (vec3(0.0, foot - roof_front, rise), vec3(0.0, cut, foot)),
            (vec3(0.0, roof_end - rear_foot, -rise), vec3(0.0, cut, rear_foot)),
            // The roof is vaulted: it falls to the front, to the rear and to both sides.
            (vec3(0.0, 1.0, 0.16), vec3(0.0, top - 0.015, roof_front - 0.25)),
            (vec3(0.0, 1.0, -0.14), vec3(0.0, top - 0.015, roof_end + 0.35)),
            (vec3(0.35, 1.0, 0.0), vec3(high - 0.16, top - 0.01, 0.0)),
            (vec3(-0.35, 1.0, 0.0), vec3(0.16 - high, top - 0.01, 0.0)),
        ],
        material,
    );
    if body == Body::Pickup {
        // The bed behind the cabin is an open box; from outside its rim shows.
        let centre = [0.0, s.belt + 0.01, 0.5 * (rear_foot - half)];
        b.block(centre, [side - 0.14, 0.03, 0.5 * (rear_foot + half) - 0.12], plain([0.02; 3]));
    }
    if body == Body::Suv && rng.random_bool(0.5) {
        for x in [-1.0, 1.0] {
            let centre = [x * (high - 0.06), top + 0.03, 0.5 * (roof_front + roof_end)];
            b.block(centre, [0.02, 0.02, 0.7], plain([0.05; 3]));
        }
    }
    wheels(rng, &mut b, &s, side);
    details(rng, &mut b, &s, side, albedo);
    b.finish(id, Some(ObjectKind::Vehicle)).on_ground([side, half], 0.93, 0.25)
}

/// The body below the belt line: the hull of a profile, with sides that bulge and corners that are cut.
fn lower_body(b: &mut Builder, s: &Sizes, clearance: f64, paint: Paint) {
    let (half, side) = (0.5 * s.length, 0.5 * s.width);
    let [foot, _, _, rear_foot] = s.cabin;
    // Profile from the front sill over the bonnet and boot to the rear sill: (along, up).
    let profile = [
        (half - 0.22, clearance),
        (half - 0.03, clearance + 0.14),
        (half, 0.62 * s.bonnet),
        (half - 0.10, 0.93 * s.bonnet),
        (half - 0.30, s.bonnet),
        (foot.min(half - 0.4), s.belt),
        (rear_foot.max(-half + 0.25), s.belt),
        (-half + 0.06, s.boot),
        (-half, 0.6 * s.boot),
        (-half + 0.04, clearance + 0.12),
        (-half + 0.25, clearance),
    ];
    let hull = convex_hull(&profile);
    let mut planes: Vec<(Vec3, Vec3)> = Vec::new();
    for (i, &(z0, y0)) in hull.iter().enumerate() {
        let (z1, y1) = hull[(i + 1) % hull.len()];
        planes.push((vec3(0.0, z0 - z1, y1 - y0), vec3(0.0, y0, z0)));
    }
    for x in [-1.0, 1.0] {
        let widest = 0.58 * s.belt;
        planes.push((vec3(x, 0.12, 0.0), vec3(x * side, widest, 0.0)));
        planes.push((vec3(x, -0.10, 0.0), vec3(x * side, widest, 0.0)));
        planes.push((vec3(x, 1.1, 0.0), vec3(x * (side - 0.07), s.belt - 0.005, 0.0)));
        for z in [-1.0, 1.0] {
            planes.push((vec3(0.55 * x, 0.0, z), vec3(x * (side - 0.30), 0.0, z * half)));
            planes.push((vec3(x, 0.0, 0.30 * z), vec3(x * (side - 0.05), 0.0, z * (half - 0.30))));
        }
    }
    b.convex(&planes, Material::Paint(paint));
}

/// The convex hull of points (x, y), anticlockwise, by Andrew's monotone chain (1979).
fn convex_hull(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.partial_cmp(b).expect("sizes are finite"));
    let chain = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut chain: Vec<(f64, f64)> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0) > 1e-9 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter().copied());
    hull.extend(chain(&mut sorted.iter().rev().copied()));
    hull
}

pub(crate) fn plain(albedo: Rgb) -> Material {
    Material::Plain { albedo, gloss: 0.01 }
}

fn wheels(rng: &mut ChaCha8Rng, b: &mut Builder, s: &Sizes, side: f64) {
    let rim = [rng.random_range(0.08..0.5); 3];
    let spokes = rng.random_range(5..11);
    let base = 0.5 * s.length - rng.random_range(0.72..0.88) * (s.length / 4.4);
    for x in [-1.0, 1.0] {
        for z in [-base, base * rng.random_range(0.98..1.03)] {
            let at = |out: f64, up: f64| vec3(x * out, s.wheel + up, z);
            let wheel = Material::Wheel { rim, rim_share: 0.66, spokes };
            // The arch is a dark disc that the tyre stands out of; it ends above the ground.
            let arch = s.wheel + 0.02;
            b.cone(at(side - 0.28, 0.04), at(side - 0.004, 0.04), [arch, arch], plain([0.012; 3]));
            b.cone(at(side - 0.22, 0.0), at(side + 0.006, 0.0), [s.wheel, s.wheel], wheel);
        }
    }
}

/// Where the lamps lie in the body, and how they burn.
fn car_lamps(rng: &mut ChaCha8Rng, s: &Sizes, side: f64, body: Body, lamps: Lamps) -> CarLamps {
    let mut r = |low: f64, high: f64| rng.random_range(low..high);
    let head =
        [side - r(0.38, 0.58), side - r(0.02, 0.08), s.bonnet * r(0.66, 0.74), s.bonnet * r(0.84, 0.94)];
    let (wide, tall) = match body {
        // Tall narrow lamps beside the tailgate, or wide low ones.
        Body::Hatchback | Body::Estate | Body::Van | Body::Pickup => (r(0.12, 0.24), r(0.22, 0.4)),
        _ => (r(0.25, 0.5), r(0.1, 0.18)),
    };
    let foot = s.boot * r(0.62, 0.76);
    CarLamps {
        half_m: 0.5 * s.length,
        head,
        tail: [side - 0.03 - wide, side - r(0.0, 0.03), foot, foot + tall],
        raised_m: r(0.0, 0.07),
        head_lit: scaled(HEAD_WHITE, lamps.head),
        tail_lit: scaled(lamps.red, lamps.tail),
    }
}

/// Plates, grille and mirrors.
fn details(rng: &mut ChaCha8Rng, b: &mut Builder, s: &Sizes, side: f64, albedo: Rgb) {
    let half = 0.5 * s.length;
    let mirror = if rng.random_bool(0.4) { [0.02; 3] } else { albedo };
    for x in [-1.0, 1.0] {
        b.ball([x * (side + 0.07), s.belt + 0.07, s.cabin[0] - 0.35], [0.10, 0.075, 0.06], plain(mirror));
    }
    let tail_up = 0.8 * s.boot;
    let plate =
        |seed: u32| Material::Sign { ground: [0.7, 0.7, 0.66], figure: [0.03; 3], kind: 4 + 6 * seed };
    let seed = rng.random_range(0..1000);
    b.block([0.0, 0.48 * s.bonnet, half - 0.005], [0.26, 0.055, 0.015], plate(seed));
    let rear = if rng.random_bool(0.5) { 0.45 } else { 0.72 } * s.boot;
    b.block([0.0, rear, 0.0 - half], [0.26, 0.055, 0.018], plate(seed));
    let grille = rng.random_range(0.05..0.13);
    let wide = side * rng.random_range(0.3..0.55);
    b.block([0.0, 0.72 * s.bonnet, half - 0.045], [wide, grille, 0.05], plain([0.02; 3]));
    b.block([0.0, 0.36, half - 0.04], [0.6 * side, 0.07, 0.03], plain([0.015; 3]));
    if rng.random_bool(0.4) {
        // A strip of trim across the boot.
        let tone = if rng.random_bool(0.5) { 0.4 } else { 0.03 };
        b.block([0.0, tail_up, 0.02 - half], [0.5 * side, 0.018, 0.025], plain([tone; 3]));
    }
}
