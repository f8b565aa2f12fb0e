//! Vehicles in the lanes, at the kerbs and on the streets that cross.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::RngExt;
use rand_distr::{Distribution, Exp};

use super::{END, Filler, Purpose, START, id};
use crate::light::{Light, PointLight};
use crate::make::vehicle::Lamps;
use crate::make::{truck, vehicle};
use crate::vector::{Vec3, vec3};

impl Filler<'_> {
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
            let intensity_cd = [6000.0; 3];
            let lamp = PointLight { position, beam, intensity_cd, power: 40, dipped: true, reach_m: 55.0 };
            self.plan.lights.push(lamp);
        }
    }

    pub(super) fn traffic(&mut self) {
        let layout = self.layout;
        let (time, side) = (layout.time_s, layout.side);
        for lane in 0..layout.lanes {
            let x = side * layout.lane_m * (lane as f64 + 0.5);
            // Cars ahead keep their distance; those in another lane of the same direction drift.
            let rng = &mut self.stream(Purpose::Layout, 10 + lane as u64);
            let gap = Exp::new(layout.busy / 22.0).expect("the rate is not negative");
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

    pub(super) fn parked(&mut self) {
        let layout = self.layout;
        for (row, x) in [-1.0, 1.0].into_iter().enumerate().filter(|(row, _)| layout.parking[*row]) {
            let rng = &mut self.stream(Purpose::Layout, 70 + row as u64);
            let full = self.settings.busy.clamp(0.0, 1.0) * rng.random_range(0.45..0.95);
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
}
