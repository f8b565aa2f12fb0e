//! Street lamps, trees, things and signs, and the light of the camera's own car.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{END, Filler, Purpose, START, id};
use crate::colour::scaled;
use crate::light::{Light, PointLight};
use crate::make::furniture::{self, LampStyle};
use crate::make::tree;
use crate::vector::vec3;

impl Filler<'_> {
    pub(super) fn furniture(&mut self, rng: &mut ChaCha8Rng) {
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
                let id = id(Purpose::Tree, 1000 * row + index);
                self.plan.objects.push(tree::tree(stream, self.drawer, foot, id));
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
            let intensity_cd = scaled([1.0, 1.0, 0.95], 4500.0);
            let lamp = PointLight { position, beam, intensity_cd, power: 36, dipped: true, reach_m: 75.0 };
            self.plan.lights.push(lamp);
        }
    }
}
