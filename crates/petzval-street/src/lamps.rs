//! Which lamps light each stretch of the street.

use crate::colour::{Rgb, plus};
use crate::light::PointLight;
use crate::vector::{Vec3, vec3};

/// Length of a stretch, m.
const STRETCH_M: f64 = 8.0;
const FIRST_M: f64 = -40.0;
const STRETCHES: usize = 60;
/// Lamps that light a stretch.
const MOST: usize = 6;

/// The strongest lamps of each stretch of the street.
pub(crate) struct LampGrid {
    stretches: Vec<Vec<PointLight>>,
}

impl LampGrid {
    pub fn new(lights: &[PointLight]) -> Self {
        let stretch = |i: usize| {
            let z = FIRST_M + STRETCH_M * (i as f64 + 0.5);
            // Weigh a lamp by what it gives to surfaces that face it near the ground.
            let weight = |light: &PointLight| {
                let p = vec3(
                    light.position.x * 0.7,
                    0.8,
                    z.clamp(light.position.z - 40.0, light.position.z + 40.0),
                );
                let [_, green, _] = light.illuminance_lx(p, (light.position - p).unit());
                green / (1.0 + 0.1 * (z - p.z).abs() as f32)
            };
            let mut lit: Vec<(f32, PointLight)> =
                lights.iter().map(|l| (weight(l), *l)).filter(|(w, _)| *w > 0.01).collect();
            lit.sort_by(|a, b| b.0.total_cmp(&a.0));
            lit.into_iter().take(MOST).map(|(_, light)| light).collect()
        };
        Self { stretches: if lights.is_empty() { Vec::new() } else { (0..STRETCHES).map(stretch).collect() } }
    }

    fn at(&self, p: Vec3) -> &[PointLight] {
        let place = ((p.z - FIRST_M) / STRETCH_M).max(0.0) as usize;
        self.stretches.get(place).map_or(&[], Vec::as_slice)
    }

    /// Illuminance of a surface by all lamps near it, lx.
    pub fn illuminance_lx(&self, p: Vec3, normal: Vec3) -> Rgb {
        self.at(p).iter().fold([0.0; 3], |sum, light| plus(sum, light.illuminance_lx(p, normal)))
    }

    /// What a glossy surface shows of the lamps in a direction: illuminance times a lobe of `(n + 1) / 2 pi cos^n`.
    pub fn glints(&self, p: Vec3, direction: Vec3, power: i32) -> Rgb {
        let peak = (power + 1) as f32 / std::f32::consts::TAU;
        self.at(p).iter().fold([0.0; 3], |sum, light| {
            let to = light.position - p;
            let along = to.dot(direction);
            if along < 0.0 || along * along < 0.7 * to.dot(to) {
                return sum;
            }
            let to = to.unit();
            let cos = to.dot(direction);
            let square_on = light.illuminance_lx(p, to);
            plus(sum, square_on.map(|e| e * peak * cos.powi(power) as f32))
        })
    }
}
