//! Traffic lights at the crossings, and lights for people on foot.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::RngExt;

use super::{Filler, Purpose, id};
use crate::light::LampState;
use crate::make::signal::{self, Style};
use crate::object::ObjectKind;

impl Filler<'_> {
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

    pub(super) fn signals(&mut self) {
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
                    let housing = signal::housing(&style, place, yaw, other, &colours, kind, next());
                    self.plan.objects.push(housing);
                }
            }
        }
    }
}
