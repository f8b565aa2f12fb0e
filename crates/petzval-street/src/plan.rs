//! The plan of a street: what stands, drives and walks where at a moment.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Exp, Normal, Poisson};

use crate::colour::scaled;
use crate::families::Drawer;
use crate::light::{LampState, Light, PointLight};
use crate::make::furniture::{self, LampStyle};
use crate::make::signal::{self, Style};
use crate::make::vehicle::Lamps;
use crate::make::{house, person, tree, truck, vehicle};
use crate::object::{Object, ObjectKind};
use crate::pose::Pose;
use crate::road::{Crossing, LaneLine, Road};
use crate::settings::StreetSettings;
use crate::vector::{Vec3, vec3};

/// Seconds between two moments.
pub(crate) const STEP_S: f64 = 1.0;
/// First and last place of the street, m.
const START: f64 = -14.0;
const END: f64 = 350.0;
/// How far the camera may drive, m.
const FARTHEST_CAMERA: f64 = 130.0;

/// What a random stream serves. Each object has a stream of its own, so that it is the same at every moment.
#[derive(Clone, Copy)]
#[repr(u64)]
pub(crate) enum Purpose {
    Layout = 1,
    Sky,
    House,
    Tree,
    Lamp,
    Thing,
    Sign,
    Parked,
    Own,
    Oncoming,
    Across,
    Walker,
    Signal,
    State,
    BackRow,
}

/// The random stream of one object of a street.
pub(crate) fn stream(sequence: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    // The finaliser of MurmurHash3 (Appleby) separates streams whose numbers differ in few bits.
    let mut h = sequence
        ^ (purpose as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ index.wrapping_mul(0xd1b5_4a32_d192_ed03);
    for factor in [0xff51_afd7_ed55_8ccd, 0xc4ce_b9fe_1a85_ec53] {
        h = (h ^ h >> 33).wrapping_mul(factor);
    }
    ChaCha8Rng::seed_from_u64(h ^ h >> 33)
}

fn id(purpose: Purpose, index: u64) -> u64 {
    (purpose as u64) << 32 | index
}

/// A street at a moment.
pub(crate) struct Plan {
    pub road: Road,
    pub pose: Pose,
    pub objects: Vec<Object>,
    pub lights: Vec<PointLight>,
}

/// Numbers that hold for the whole street.
struct Layout {
    /// 1 where traffic keeps to the right, -1 where it keeps to the left.
    side: f64,
    lanes: usize,
    lane_m: f64,
    /// Whether cars park on the left and on the right.
    parking: [bool; 2],
    pavement_m: f64,
    /// Which crossings have traffic lights.
    signals: Vec<bool>,
    own_lane: usize,
    time_s: f64,
    camera_z: f64,
    busy: f64,
}

/// Lays a street out and fills it.
pub(crate) fn plan(settings: &StreetSettings, drawer: &mut Drawer) -> Plan {
    let rng = &mut stream(settings.sequence, Purpose::Layout, 0);
    let (road, layout) = lay_out(rng, settings);
    let pose = mount_camera(rng, &road, &layout);
    let mut plan = Plan { road, pose, objects: Vec::new(), lights: Vec::new() };
    let mut filler = Filler { settings, layout: &layout, drawer, plan: &mut plan };
    filler.traffic();
    filler.parked();
    filler.signals();
    filler.walkers();
    filler.furniture(rng);
    filler.houses(rng);
    // A crown right in front of the camera would show nothing but itself.
    let [x, y, z] = plan.pose.position_m;
    let eye = vec3(x, y, z);
    let crown = |object: &Object| object.parts.iter().any(|part| part.material.has_gaps());
    plan.objects.retain(|object| !crown(object) || (object.centre - eye).length() > object.radius + 4.0);
    plan
}

fn lay_out(rng: &mut ChaCha8Rng, settings: &StreetSettings) -> (Road, Layout) {
    let side = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
    let lanes = if rng.random_bool(0.3) { 2 } else { 1 };
    let lane_m: f64 = rng.random_range(2.8..3.5);
    let parking = [rng.random_bool(0.6), rng.random_bool(0.6)];
    let strip = if parking[0] || parking[1] { 2.15 } else { 0.4 };
    let half_m = lanes as f64 * lane_m + strip;
    let bend = if rng.random_bool(0.5) { rng.random_range(-1.0 / 700.0..1.0 / 700.0) } else { 0.0 };

    // Streets that cross, and zebra crossings before and behind them.
    let mut crossings = Vec::new();
    let mut z = rng.random_range(24.0..75.0);
    while z < 300.0 {
        let half = rng.random_range(3.2..7.0);
        crossings.push(Crossing { z, half_m: half });
        z += rng.random_range(45.0..110.0);
    }
    let signals =
        crossings.iter().enumerate().map(|(i, _)| rng.random_bool(if i == 0 { 0.85 } else { 0.7 })).collect();
    let (mut zebras, mut stops) = (Vec::new(), Vec::new());
    for crossing in &crossings {
        let edge = crossing.half_m;
        if rng.random_bool(0.7) {
            zebras.push([crossing.z - edge - 4.0, crossing.z - edge - 1.2]);
            zebras.push([crossing.z + edge + 1.2, crossing.z + edge + 4.0]);
        }
        let (from, to) = if side > 0.0 { (0.0, half_m - strip) } else { (strip - half_m, 0.0) };
        stops.push([crossing.z - edge - 5.0, from, to]);
        stops.push([crossing.z + edge + 5.0, -to, -from]);
    }
    let dashed = [rng.random_range(1.5..4.0), rng.random_range(2.0..6.0)];
    let mut lines = vec![LaneLine {
        x: 0.0,
        width_m: 0.13,
        dash_m: if rng.random_bool(0.7) { dashed } else { [1.0, 0.0] },
    }];
    for x in [-1.0, 1.0] {
        for lane in 1..lanes {
            lines.push(LaneLine { x: x * lane as f64 * lane_m, width_m: 0.12, dash_m: dashed });
        }
        if rng.random_bool(0.6) {
            lines.push(LaneLine { x: x * lanes as f64 * lane_m, width_m: 0.1, dash_m: [1.0, 0.0] });
        }
    }
    let gray = |rng: &mut ChaCha8Rng, low: f32, high: f32, warm: f32| {
        let tone = rng.random_range(low..high);
        [tone * (1.0 + warm), tone, tone * (1.0 - warm)]
    };
    let warm = rng.random_range(-0.06..0.12);
    let road = Road {
        bend_per_m: bend,
        half_m,
        kerb_m: rng.random_range(0.06..0.15),
        crossings,
        lines,
        zebras,
        stops,
        asphalt: gray(rng, 0.06, 0.16, 0.03),
        slabs: gray(rng, 0.12, 0.35, warm),
        paint: gray(rng, 0.4, 0.65, 0.02),
        slab_m: [0.3, 0.5, 0.6, 1.2][rng.random_range(0..4)],
        wet: if rng.random_bool(0.3) { rng.random_range(0.3..1.0) } else { 0.0 },
        seed: rng.random(),
    };
    let speed_m_s = if rng.random_bool(0.2) { 0.0 } else { rng.random_range(3.0..12.0) };
    let time_s = STEP_S * f64::from(settings.moment);
    let layout = Layout {
        side,
        lanes,
        lane_m,
        parking,
        pavement_m: rng.random_range(2.2..5.0),
        signals,
        own_lane: rng.random_range(0..lanes),
        time_s,
        camera_z: (speed_m_s * time_s).min(FARTHEST_CAMERA),
        busy: rng.random_range(0.4..1.6),
    };
    (road, layout)
}

/// The camera behind the windscreen of a car in its lane, with the tolerances of mounting and driving.
fn mount_camera(rng: &mut ChaCha8Rng, road: &Road, layout: &Layout) -> Pose {
    let mut normal = |sigma: f64, limit: f64| {
        let value: f64 = Normal::new(0.0, sigma).expect("sigma is positive").sample(rng);
        value.clamp(-limit, limit)
    };
    let x = layout.side * layout.lane_m * (layout.own_lane as f64 + 0.5) + normal(0.2, 0.5);
    let height = 1.4 + normal(0.12, 0.25);
    let z = layout.camera_z;
    let place = road.place(x, height, z);
    Pose {
        position_m: [place.x, place.y, place.z],
        // The car looks along the bend ahead.
        yaw_rad: road.heading(z + 12.0) + normal(0.03, 0.09),
        pitch_rad: normal(0.012, 0.035),
        roll_rad: normal(0.008, 0.025),
    }
}

/// Fills a plan with objects.
struct Filler<'a> {
    settings: &'a StreetSettings,
    layout: &'a Layout,
    drawer: &'a mut Drawer,
    plan: &'a mut Plan,
}

impl Filler<'_> {
    fn stream(&self, purpose: Purpose, index: u64) -> ChaCha8Rng {
        stream(self.settings.sequence, purpose, index)
    }

    /// Whether a place along the street is within `gap_m` of a street that crosses.
    fn near_crossing(&self, z: f64, gap_m: f64) -> bool {
        self.plan.road.crossings.iter().any(|c| (z - c.z).abs() < c.half_m + gap_m)
    }

    /// Adds an object that touches no other vehicle and leaves the camera room.
    fn add(&mut self, object: Object, gap_m: f64) -> bool {
        let [x, _, z] = self.plan.pose.position_m;
        let eye = vec3(x, 0.0, z);
        let near =
            object.ground_distance(eye) < if object.kind == Some(ObjectKind::Vehicle) { 1.2 } else { 4.5 };
        if near
            || self
                .plan
                .objects
                .iter()
                .any(|o| o.kind == Some(ObjectKind::Vehicle) && o.collides(&object, gap_m))
        {
            return false;
        }
        self.plan.objects.push(object);
        true
    }

    /// Cars, and now and then a truck, in the lanes.
    fn vehicle(&mut self, purpose: Purpose, index: u64, place: Vec3, yaw: f64, driving: bool) {
        let rng = &mut self.stream(purpose, index);
        let light = self.settings.light;
        let lamps = Lamps::draw(rng, light, driving, self.settings.lamp_colours.red);
        let number = id(purpose, index);
        let object = if rng.random_bool(0.12) {
            truck::truck(rng, self.drawer, place, yaw, lamps, number)
        } else {
            vehicle::car(rng, self.drawer, place, yaw, lamps, number)
        };
        // At night its head lamps light the road in front of it.
        let half = object.footprint.map_or(2.0, |f| f.half_m[1]);
        let beam = object.frame.direction(vec3(0.0, -0.05, 1.0)).unit();
        let position = object.frame.point(vec3(0.0, 0.65, half + 0.1));
        if self.add(object, 0.5) && driving && light == Light::Night {
            self.plan.lights.push(PointLight {
                position,
                beam,
                intensity_cd: [6000.0; 3],
                power: 40,
                dipped: true,
                reach_m: 55.0,
            });
        }
    }

    fn traffic(&mut self) {
        let layout = self.layout;
        let (time, side) = (layout.time_s, layout.side);
        for lane in 0..layout.lanes {
            let x = side * layout.lane_m * (lane as f64 + 0.5);
            // Cars ahead keep their distance; those in another lane of the same direction drift.
            let rng = &mut self.stream(Purpose::Layout, 10 + lane as u64);
            let gap = Exp::new(1.0 / (22.0 / layout.busy)).expect("the rate is positive");
            let own = lane == layout.own_lane;
            let drift = if own { 0.0 } else { rng.random_range(-3.0..3.0) * time };
            let mut z = if own { rng.random_range(9.0..16.0) } else { rng.random_range(-4.0..10.0) };
            for index in 0..14 {
                z += gap.sample(rng) + if index == 0 { 0.0 } else { 7.5 };
                let sway = rng.random_range(-0.25..0.25);
                let at = layout.camera_z + z + drift;
                if z > 230.0 || at > END - 8.0 {
                    break;
                }
                let yaw = self.plan.road.heading(at) + 0.1 * sway;
                let place = self.plan.road.place(x + sway, 0.0, at);
                self.vehicle(Purpose::Own, (lane * 100 + index) as u64, place, yaw, true);
            }

            // Oncoming cars.
            let rng = &mut self.stream(Purpose::Layout, 20 + lane as u64);
            let speed = rng.random_range(0.0..12.0);
            let mut z = rng.random_range(0.0..20.0);
            for index in 0..24 {
                z += 8.0 + gap.sample(rng);
                let sway = rng.random_range(-0.25..0.25);
                if z > END {
                    break;
                }
                let at = START + (z - speed * time - START).rem_euclid(END - START - 6.0);
                let yaw = PI + self.plan.road.heading(at) + 0.1 * sway;
                let place = self.plan.road.place(-x + sway, 0.0, at);
                self.vehicle(Purpose::Oncoming, (lane * 100 + index) as u64, place, yaw, true);
            }
        }
        // Cars on the streets that cross, seen from the side.
        let crossings = self.plan.road.crossings.clone();
        for (i, crossing) in crossings.iter().enumerate() {
            for k in 0..3u64 {
                let rng = &mut self.stream(Purpose::Layout, 40 + 8 * i as u64 + k);
                let direction = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
                let speed: f64 = rng.random_range(0.0..7.0);
                let start: f64 = rng.random_range(-32.0..32.0);
                let x = (start + direction * speed * time + 32.0).rem_euclid(64.0) - 32.0;
                let z = crossing.z - side * direction * 0.45 * crossing.half_m;
                let place = vec3(self.plan.road.axis(crossing.z) + x, 0.0, z);
                let yaw = direction * FRAC_PI_2 + rng.random_range(-0.15..0.15);
                self.vehicle(Purpose::Across, 8 * i as u64 + k, place, yaw, true);
            }
        }
    }

    fn parked(&mut self) {
        let layout = self.layout;
        for (row, x) in [-1.0, 1.0].into_iter().enumerate().filter(|(row, _)| layout.parking[*row]) {
            let rng = &mut self.stream(Purpose::Layout, 70 + row as u64);
            let full = rng.random_range(0.45..0.95);
            let mut z = START + rng.random_range(0.0..6.0);
            for index in 0..80u64 {
                z += rng.random_range(5.1..6.6);
                let (taken, turned, sway) =
                    (rng.random_bool(full), rng.random_bool(0.1), rng.random_range(-0.15..0.15));
                if z > END - 8.0 {
                    break;
                }
                let zebra = self.plan.road.zebras.iter().any(|&[from, to]| z > from - 4.0 && z < to + 4.0);
                if !taken || zebra || self.near_crossing(z, 6.0) {
                    continue;
                }
                let along = if (x * layout.side > 0.0) != turned { 0.0 } else { PI };
                let place = self.plan.road.place(x * (self.plan.road.half_m - 1.08) + 0.5 * sway, 0.0, z);
                let yaw = along + self.plan.road.heading(z) + 0.2 * sway;
                self.vehicle(Purpose::Parked, row as u64 * 1000 + index, place, yaw, false);
            }
        }
    }

    /// What the lights of an approach show; it changes every few moments.
    fn state(&self, index: u64) -> LampState {
        let offset = self.stream(Purpose::State, index).random_range(0..4u64);
        let period = (u64::from(self.settings.moment) + offset) / 4;
        match self.stream(Purpose::State, (index + 1) << 20 | period).random_range(0..100) {
            0..40 => LampState::Red,
            40..55 => LampState::Yellow,
            55..94 => LampState::Green,
            _ => LampState::Off,
        }
    }

    fn signals(&mut self) {
        let (layout, colours) = (self.layout, self.settings.lamp_colours);
        let crossings = self.plan.road.crossings.clone();
        for (i, crossing) in crossings.iter().enumerate().filter(|(i, _)| layout.signals[*i]) {
            let i = i as u64;
            let rng = &mut self.stream(Purpose::Signal, i);
            let style = Style::draw(rng, self.drawer);
            let (side, half) = (layout.side, self.plan.road.half_m);
            let state = self.state(2 * i);
            let mut count = 0;
            let mut next = || {
                count += 1;
                id(Purpose::Signal, 100 * i + count)
            };
            let near = crossing.z - crossing.half_m - rng.random_range(3.0..5.5);
            let far = crossing.z + crossing.half_m + rng.random_range(1.0..4.0);
            let facing = PI + rng.random_range(-0.12..0.12);
            // A housing hangs in front of what carries it.
            let hang = |this: &mut Self, x: f64, y: f64, z: f64, style: Style, state, number: [u64; 2]| {
                let foot = this.plan.road.place(x, y, z - 0.26);
                let kind = ObjectKind::TrafficLight;
                this.plan
                    .objects
                    .push(signal::housing(&style, foot, facing, state, &colours, kind, number[0]));
                this.plan.objects.extend(signal::backboard(&style, foot, facing, number[1]));
            };
            let height = rng.random_range(2.3..3.3);
            let arrow_angle = [-FRAC_PI_2, 0.0, FRAC_PI_2][rng.random_range(0..3)];
            let arrows = rng.random_bool(0.2);
            let main = if arrows { style.with_arrow(arrow_angle) } else { style };

            // On a pole beside the lane, before or behind the crossing.
            let mut beside = vec![(side, near)];
            if rng.random_bool(0.45) {
                beside.push((-side, near + rng.random_range(-1.0..1.0)));
            }
            if rng.random_bool(0.4) {
                beside.push((if rng.random_bool(0.5) { side } else { -side }, far));
            }
            for (x, z) in beside {
                let x = x * (half + 0.55);
                let foot = self.plan.road.place(x, 0.0, z);
                let pole = signal::pole(rng, foot, 0.0, height + style.height_m() + 0.1, 0.0, next());
                self.plan.objects.push(pole);
                hang(self, x, height, z, main, state, [next(), next()]);
                if rng.random_bool(0.45) {
                    // A light for people on foot at the same pole.
                    let walk = rng.random_bool(0.5);
                    let turn = rng.random_range(-0.3..0.3)
                        + if rng.random_bool(0.6) { PI } else { x.signum() * FRAC_PI_2 };
                    let foot = self.plan.road.place(x + 0.24, height - 0.75, z - 0.1);
                    let light = signal::pedestrian_light(rng, foot, turn, &colours, walk, next());
                    self.plan.objects.push(light);
                }
            }

            // Over the lanes, on an arm.
            if rng.random_bool(0.6) {
                let z = if rng.random_bool(0.5) { near } else { far };
                let top = rng.random_range(5.3..6.6);
                let reach = half + 0.7 - layout.lane_m * rng.random_range(0.2..0.7);
                let foot = self.plan.road.place(side * (half + 0.7), 0.0, z);
                self.plan.objects.push(signal::pole(rng, foot, 0.0, top, -side * reach, next()));
                let low = top - 0.5 * style.height_m();
                for lane in 0..layout.lanes {
                    let x = side * layout.lane_m * (lane as f64 + 0.5);
                    hang(self, x, low, z, main, state, [next(), next()]);
                }
                if rng.random_bool(0.3) {
                    let x = side * layout.lane_m * 0.5 + 0.75;
                    let own = self.state(2 * i + 1);
                    hang(self, x, low, z, style.with_arrow(arrow_angle), own, [next(), next()]);
                }
            }

            // The lights of the other approaches turn their backs or sides to the camera.
            for (x, z, yaw) in [(-side, far, 0.0), (-side, near + 1.0, -FRAC_PI_2), (side, far, FRAC_PI_2)] {
                if rng.random_bool(0.45) {
                    let x = x * (half + 1.1);
                    let foot = self.plan.road.place(x, 0.0, z);
                    self.plan.objects.push(signal::pole(rng, foot, 0.0, height + 0.9, 0.0, next()));
                    let place = self.plan.road.place(x, height, z + 0.26 * f64::cos(yaw));
                    let yaw = yaw + rng.random_range(-0.2..0.2);
                    let kind = ObjectKind::TurnedLight;
                    let other = self.state(2 * i + 1);
                    self.plan.objects.push(signal::housing(
                        &style,
                        place,
                        yaw,
                        other,
                        &colours,
                        kind,
                        next(),
                    ));
                }
            }
        }
    }

    fn walkers(&mut self) {
        let layout = self.layout;
        let rng = &mut self.stream(Purpose::Layout, 90);
        let mean = 60.0 * layout.busy * if self.settings.light == Light::Night { 0.7 } else { 1.0 };
        let count = Poisson::new(mean).expect("the mean is positive").sample(rng) as u64;
        for index in 0..count {
            let rng = &mut self.stream(Purpose::Walker, index);
            let half = self.plan.road.half_m;
            let x = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let speed: f64 = rng.random_range(0.9..1.7);
            let direction = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let kerb = self.plan.road.kerb_m;
            let moved = direction * speed * layout.time_s;
            // Most walk along the pavements; some cross, some stand at the kerb or between cars.
            let (across, z, heading, stands) = match rng.random_range(0..100) {
                0..66 => {
                    let across = x * (half + rng.random_range(0.5..layout.pavement_m - 0.4));
                    let z = START + (rng.random_range(0.0..END - START) + moved).rem_euclid(END - START);
                    (across, z, if direction > 0.0 { 0.0 } else { PI }, rng.random_bool(0.12))
                }
                66..88 => {
                    let zebras = &self.plan.road.zebras;
                    let z = match rng.random_range(0..zebras.len() + 2) {
                        i if i < zebras.len() => rng.random_range(zebras[i][0]..zebras[i][1]),
                        _ => rng.random_range(10.0..220.0),
                    };
                    let span = 2.0 * half + 4.0;
                    let across = (rng.random_range(0.0..span) + moved).rem_euclid(span) - 0.5 * span;
                    (across, z, direction * FRAC_PI_2, false)
                }
                _ => {
                    let across = x * (half + rng.random_range(-1.2..0.8));
                    (across, rng.random_range(8.0..260.0), rng.random_range(0.0..2.0 * PI), true)
                }
            };
            let on_road = across.abs() < half || self.near_crossing(z, 0.0);
            let place = self.plan.road.place(across, if on_road { 0.0 } else { kerb }, z);
            let yaw = self.plan.road.heading(z) + heading + rng.random_range(-0.25..0.25);
            let stride = if stands { 0.0 } else { rng.random_range(0.3..0.55) };
            let phase = rng.random::<f64>() + speed * layout.time_s / 1.4;
            let object =
                person::person(rng, self.drawer, place, yaw, [phase, stride], id(Purpose::Walker, index));
            self.add(object, 0.15);
        }
    }

    fn furniture(&mut self, rng: &mut ChaCha8Rng) {
        let (layout, light) = (self.layout, self.settings.light);
        let (half, kerb) = (self.plan.road.half_m, self.plan.road.kerb_m);
        // The front of an object on one side looks at the road.
        let inward = |x: f64, heading: f64| -x * FRAC_PI_2 + heading;
        let style = LampStyle::draw(rng, self.drawer, light);
        let (spacing, both) = (rng.random_range(22.0..38.0), rng.random_bool(0.5));
        for (row, x) in [-1.0f64, 1.0].into_iter().enumerate() {
            let row = row as u64;
            let mut index = 0;
            let mut z = START + spacing * 0.5 * row as f64;
            while z < END - 5.0 {
                if (both || row == 0) && !self.near_crossing(z, 1.0) {
                    let stream = &mut self.stream(Purpose::Lamp, 1000 * row + index);
                    let foot = self.plan.road.place(x * (half + 0.45), 0.0, z);
                    let yaw = inward(x, self.plan.road.heading(z));
                    let (object, lamp) =
                        style.place(stream, foot, yaw, id(Purpose::Lamp, 1000 * row + index));
                    self.plan.objects.push(object);
                    self.plan.lights.extend(lamp);
                }
                z += spacing;
                index += 1;
            }
            let trees = rng.random_bool(0.5);
            let gap: f64 = rng.random_range(7.0..18.0);
            let mut z = START + rng.random_range(0.0..gap);
            for index in 0..60 {
                z += gap * rng.random_range(0.8..1.2);
                if !trees || z > END || self.near_crossing(z, 6.0) {
                    continue;
                }
                let stream = &mut self.stream(Purpose::Tree, 1000 * row + index);
                let foot = self.plan.road.place(x * (half + 0.95), 0.0, z);
                self.plan.objects.push(tree::tree(
                    stream,
                    self.drawer,
                    foot,
                    id(Purpose::Tree, 1000 * row + index),
                ));
            }
        }
        for index in 0..rng.random_range(16..48u64) {
            let rng = &mut self.stream(Purpose::Thing, index);
            let x = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let z = rng.random_range(START..260.0);
            if self.near_crossing(z, 1.0) {
                continue;
            }
            let across = x
                * (half + if rng.random_bool(0.5) { 0.6 } else { rng.random_range(0.5..layout.pavement_m) });
            let place = self.plan.road.place(across, kerb, z);
            let yaw = rng.random_range(0.0..PI);
            let object = furniture::thing(rng, self.drawer, place, yaw, id(Purpose::Thing, index));
            self.plan.objects.push(object);
        }
        for index in 0..rng.random_range(8..22u64) {
            let rng = &mut self.stream(Purpose::Sign, index);
            let x = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let place = self.plan.road.place(x * (half + 0.5), 0.0, rng.random_range(8.0..260.0));
            // Half of the signs show the camera their faces, the others their backs.
            let yaw = rng.random_range(-0.2..0.2) + if rng.random_bool(0.6) { PI } else { 0.0 };
            let sign = furniture::sign(rng, place, yaw, id(Purpose::Sign, index));
            self.plan.objects.push(sign);
        }
        // The camera's own head lamps.
        if light == Light::Night {
            let frame = self.plan.pose.frame();
            let [x, _, z] = self.plan.pose.position_m;
            let position = vec3(x, 0.65, z) + frame.z * 1.5;
            let beam = (vec3(frame.z.x, 0.0, frame.z.z).unit() + vec3(0.0, -0.04, 0.0)).unit();
            self.plan.lights.push(PointLight {
                position,
                beam,
                intensity_cd: scaled([1.0, 1.0, 0.95], 4500.0),
                power: 36,
                dipped: true,
                reach_m: 75.0,
            });
        }
    }

    fn houses(&mut self, rng: &mut ChaCha8Rng) {
        let (layout, light) = (self.layout, self.settings.light);
        let line = self.plan.road.half_m + layout.pavement_m;
        let storeys: f64 = rng.random_range(2.0..6.5);
        for (row, x) in [-1.0f64, 1.0].into_iter().enumerate() {
            let mut z = START;
            let mut index = 0;
            while z < END {
                let number = 1000 * row as u64 + index;
                index += 1;
                let rng = &mut self.stream(Purpose::House, number);
                let width: f64 = rng.random_range(8.0..21.0);
                let crossing = self
                    .plan
                    .road
                    .crossings
                    .iter()
                    .find(|c| z < c.z + c.half_m + 2.5 && z + width > c.z - c.half_m - 2.5);
                if let Some(crossing) = crossing {
                    // Fill up to the corner if there is room for a house, and go on behind the crossing.
                    let room = crossing.z - crossing.half_m - 2.5 - z;
                    let behind = crossing.z + crossing.half_m + 2.5;
                    if room > 4.0 {
                        self.front(rng, number, x, z, [room, line], storeys, light);
                    }
                    z = behind;
                    continue;
                }
                if rng.random_bool(0.1) {
                    // A gap with bushes and a tree.
                    for k in 0..4 {
                        let at = z + width * (0.2 + 0.2 * f64::from(k));
                        let place = self.plan.road.place(x * (line + rng.random_range(0.6..3.0)), 0.0, at);
                        self.plan.objects.push(tree::bush(
                            rng,
                            place,
                            id(Purpose::Tree, 5000 + 10 * number + k as u64),
                        ));
                    }
                    let place = self.plan.road.place(x * (line + 4.0), 0.0, z + 0.5 * width);
                    self.plan.objects.push(tree::tree(
                        rng,
                        self.drawer,
                        place,
                        id(Purpose::Tree, 5009 + 10 * number),
                    ));
                } else {
                    self.front(rng, number, x, z, [width, line], storeys, light);
                }
                z += width + if rng.random_bool(0.15) { rng.random_range(0.5..3.0) } else { 0.0 };
            }
            // A second row shows in the gaps and above the roofs.
            for index in 0..17u64 {
                let number = 100 * row as u64 + index;
                let rng = &mut self.stream(Purpose::BackRow, number);
                let z = START + 22.0 * index as f64;
                let back = line + rng.random_range(26.0..40.0);
                let size = [rng.random_range(14.0..24.0), rng.random_range(9.0..26.0), 12.0];
                let place = self.plan.road.place(x * back, 0.0, z);
                let yaw = -x * FRAC_PI_2 + self.plan.road.heading(z);
                self.plan.objects.push(house::house(
                    rng,
                    self.drawer,
                    light,
                    place,
                    yaw,
                    size,
                    id(Purpose::BackRow, number),
                ));
            }
        }
        // Houses close the street at its end.
        for k in 0..5u64 {
            let rng = &mut self.stream(Purpose::BackRow, 900 + k);
            let size = [rng.random_range(16.0..24.0), rng.random_range(9.0..22.0), 12.0];
            let place = self.plan.road.place(19.0 * (k as f64 - 2.0), 0.0, END + 4.0);
            self.plan.objects.push(house::house(
                rng,
                self.drawer,
                light,
                place,
                PI,
                size,
                id(Purpose::BackRow, 900 + k),
            ));
        }
    }

    /// A house in the front row, from `z` on.
    fn front(
        &mut self,
        rng: &mut ChaCha8Rng,
        number: u64,
        x: f64,
        z: f64,
        [width, line]: [f64; 2],
        storeys: f64,
        light: Light,
    ) {
        let middle = z + 0.5 * width;
        let height = 3.1 * (storeys + rng.random_range(-1.2..1.6)).max(1.3);
        let setback = if rng.random_bool(0.25) { rng.random_range(0.0..3.0) } else { 0.0 };
        let place = self.plan.road.place(x * (line + setback), 0.0, middle);
        let yaw = -x * FRAC_PI_2 + self.plan.road.heading(middle);
        let object = house::house(
            rng,
            self.drawer,
            light,
            place,
            yaw,
            [width, height, 11.0],
            id(Purpose::House, number),
        );
        self.plan.objects.push(object);
    }
}
