//! Houses on both sides, behind them, and at the end of the street.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{END, Filler, Purpose, START, id};
use crate::light::Light;
use crate::make::{house, tree};

impl Filler<'_> {
    pub(super) fn houses(&mut self, rng: &mut ChaCha8Rng) {
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
                let mut crossings = self.plan.road.crossings.iter();
                let crossing =
                    crossings.find(|c| z < c.z + c.half_m + 2.5 && z + width > c.z - c.half_m - 2.5);
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
                        let id = id(Purpose::Tree, 5000 + 10 * number + k as u64);
                        self.plan.objects.push(tree::bush(rng, place, id));
                    }
                    let place = self.plan.road.place(x * (line + 4.0), 0.0, z + 0.5 * width);
                    let id = id(Purpose::Tree, 5009 + 10 * number);
                    self.plan.objects.push(tree::tree(rng, self.drawer, place, id));
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
                let id = id(Purpose::BackRow, number);
                let object = house::house(rng, self.drawer, light, place, yaw, size, id);
                self.plan.objects.push(object);
            }
        }
        // Houses close the street at its end.
        for k in 0..5u64 {
            let rng = &mut self.stream(Purpose::BackRow, 900 + k);
            let size = [rng.random_range(16.0..24.0), rng.random_range(9.0..22.0), 12.0];
            let place = self.plan.road.place(19.0 * (k as f64 - 2.0), 0.0, END + 4.0);
            let id = id(Purpose::BackRow, 900 + k);
            self.plan.objects.push(house::house(rng, self.drawer, light, place, PI, size, id));
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
        let (size, id) = ([width, height, 11.0], id(Purpose::House, number));
        self.plan.objects.push(house::house(rng, self.drawer, light, place, yaw, size, id));
    }
}
