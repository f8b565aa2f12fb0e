//! The plan of a street: what stands, drives and walks where at a moment.

mod furniture;
mod houses;
mod signals;
mod traffic;
mod walkers;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::families::Drawer;
use crate::light::PointLight;
use crate::object::{Object, ObjectKind};
use crate::pose::Pose;
use crate::road::{Crossing, LaneLine, Road};
use crate::settings::StreetSettings;
use crate::vector::vec3;

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
    /// Density of traffic and people, 0..1.6.
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
    let dash_m = if rng.random_bool(0.7) { dashed } else { [1.0, 0.0] };
    let mut lines = vec![LaneLine { x: 0.0, width_m: 0.13, dash_m }];
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
        busy: settings.busy.clamp(0.0, 1.0) * rng.random_range(0.4..1.6),
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
}
