//! People on the pavements and on the road.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::RngExt;
use rand_distr::{Distribution, Poisson};

use super::{END, Filler, Purpose, START, id};
use crate::light::Light;
use crate::make::person;

impl Filler<'_> {
    pub(super) fn walkers(&mut self) {
        let layout = self.layout;
        let rng = &mut self.stream(Purpose::Layout, 90);
        let mean = 60.0 * layout.busy * if self.settings.light == Light::Night { 0.7 } else { 1.0 };
        let count = Poisson::new(mean).map_or(0, |people| people.sample(rng) as u64);
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
}
