//! Which lamps light each stretch of the street.

use crate::colour::{Rgb, plus};
use crate::light::PointLight;
use crate::vector::Vec3;

/// Length of a stretch, m.
const STRETCH_M: f64 = 8.0;
const FIRST_M: f64 = -40.0;
const STRETCHES: usize = 60;
/// The lamps whose light reaches each stretch of the street.
pub(crate) struct LampGrid {
    stretches: Vec<Vec<PointLight>>,
}

impl LampGrid {
    pub fn new(lights: &[PointLight]) -> Self {
        let stretch = |i: usize| {
            let (from, to) = (FIRST_M + STRETCH_M * i as f64, FIRST_M + STRETCH_M * (i + 1) as f64);
            let reaches = |light: &&PointLight| {
                let (z, reach) = (light.position.z, light.reach_m);
                // A narrow beam lights nothing behind it.
                let (behind, ahead) =
                    (light.power > 8 && light.beam.z > 0.0, light.power > 8 && light.beam.z < 0.0);
                let low = if behind { z } else { z - reach };
                let high = if ahead { z } else { z + reach };
                low < to && high > from
            };
            lights.iter().filter(reaches).copied().collect()
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

    /// What a wet road shows of the lamps in a direction. Ripples spread the image of a lamp far up and down but little to the
    /// sides, so it is a streak: a lobe of widths 0.03 rad across and 0.25 rad up and down.
    pub fn streaks(&self, p: Vec3, direction: Vec3) -> Rgb {
        let (across_rad, up_rad) = (0.03, 0.25);
        let peak = 1.0 / (std::f64::consts::PI * across_rad * up_rad);
        self.at(p).iter().fold([0.0; 3], |sum, light| {
            let to = light.position - p;
            let ahead = to.x * direction.x + to.z * direction.z;
            let beside = to.x * direction.z - to.z * direction.x;
            if ahead <= 0.0 || beside.abs() > 3.0 * across_rad * ahead {
                return sum;
            }
            let to = to.unit();
            let level = (to.x.hypot(to.z) * direction.x.hypot(direction.z)).max(1e-6);
            let across = (to.x * direction.z - to.z * direction.x) / level / across_rad;
            let up = (to.y - direction.y) / up_rad;
            let spread = across * across + up * up;
            if spread > 9.0 {
                return sum;
            }
            let lobe = (peak * (-spread).exp()) as f32;
            plus(sum, light.illuminance_lx(p, to).map(|e| e * lobe))
        })
    }
}
