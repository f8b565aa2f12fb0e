//! Sun and sky: what they look like, and how they light a surface.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::colour::{Rgb, blend, plus, scaled};
use crate::light::Light;
use crate::noise::fractal2;
use crate::texture::smooth;
use crate::vector::{Vec3, vec3};

/// Sun, sky and haze of a street.
#[derive(Clone, Debug)]
pub(crate) struct Sky {
    pub light: Light,
    /// Unit direction towards the sun.
    pub sun: Vec3,
    /// Illuminance of a surface square to the sun, lx.
    pub sun_lx: Rgb,
    /// Illuminance of level ground by the open sky, lx.
    pub sky_lx: Rgb,
    /// Illuminance from all sides by light that the street scatters, lx.
    pub scattered_lx: Rgb,
    /// Share of the sky behind clouds, 0..1.
    cover: f32,
    /// Luminance of clouds, cd/m^2.
    cloud: Rgb,
    /// Luminance of the clear sky at the zenith and at the horizon, cd/m^2.
    zenith: Rgb,
    horizon: Rgb,
    /// Mean luminance of the street's surfaces, which reflections show below the skyline, cd/m^2.
    pub street: Rgb,
    /// Distance in which haze takes all but 37 % of the contrast, m.
    haze_m: f64,
    seed: u32,
    cloud_size: f64,
}

impl Sky {
    /// A sky of a time of day.
    pub fn draw(rng: &mut ChaCha8Rng, light: Light) -> Self {
        let azimuth: f64 = rng.random_range(0.0..std::f64::consts::TAU);
        let elevation: f64 = rng.random_range(14f64..62.0).to_radians();
        let sun = vec3(elevation.cos() * azimuth.sin(), elevation.sin(), elevation.cos() * azimuth.cos());
        let overcast = rng.random_bool(0.3);
        let tint = |amount: f32| [1.0 - amount, 1.0, 1.0 + amount];
        let cover: f32 = if overcast { rng.random_range(0.75..1.0) } else { rng.random_range(0.0..0.6) };
        let (sun_lx, sky_lx) = match light {
            Light::Day if overcast => {
                let sun = rng.random_range(0.0..0.12f32) * 80_000.0;
                (scaled(tint(-0.05), sun), scaled(tint(0.03), rng.random_range(9_000.0..24_000.0)))
            }
            // A low sun shines through more air: it is weaker and warmer.
            Light::Day => {
                let air = (-0.21 / elevation.sin()).exp() as f32;
                let warm = 0.05 + 0.1 * (1.0 - elevation.sin() as f32);
                let sun = 118_000.0 * air * rng.random_range(0.92..1.05f32);
                let sky = rng.random_range(12_000.0..20_000.0);
                (scaled(tint(-warm), sun), scaled(tint(0.14), sky))
            }
            Light::Dusk => {
                let tone = rng.random_range(-0.15..0.3);
                ([0.0; 3], scaled(tint(tone), 10f32.powf(rng.random_range(1.05..2.0))))
            }
            // The glow of a town on haze or clouds.
            Light::Night => ([0.0; 3], scaled(tint(-0.25), rng.random_range(0.02..0.15))),
        };
        let mean = scaled(sky_lx, std::f32::consts::FRAC_1_PI);
        let clouds = rng.random_range(1.0..1.7f32);
        let (zenith, horizon) = match light {
            Light::Day if overcast => (scaled(mean, 1.15), scaled(mean, 0.8)),
            Light::Day => ([0.55 * mean[0], 0.8 * mean[1], 1.2 * mean[2]], scaled(mean, 1.3)),
            Light::Dusk => {
                let glow = rng.random_range(0.0..1.0f32);
                (
                    [0.6 * mean[0], 0.75 * mean[1], mean[2]],
                    [1.5 + glow, 1.5, 1.4 - 0.6 * glow].map(|c| c * mean[1]),
                )
            }
            Light::Night => (scaled(mean, 0.6), scaled(mean, 1.6)),
        };
        let cloud = match light {
            Light::Day if overcast => scaled(mean, 1.2),
            Light::Day => plus(scaled(mean, clouds), scaled(sun_lx, 0.02 * clouds)),
            Light::Dusk => scaled(plus(mean, horizon), 0.45),
            Light::Night => scaled(mean, 1.8),
        };
        let level = plus(scaled(sun_lx, 0.3 * sun.y as f32), scaled(sky_lx, 0.55));
        let scattered_lx = match light {
            Light::Night => scaled([1.2, 1.0, 0.75], 10f32.powf(rng.random_range(-0.6..0.1))),
            _ => scaled(level, 0.1),
        };
        let street = plus(scaled(level, 0.18 * std::f32::consts::FRAC_1_PI), scaled(scattered_lx, 0.15));
        let haze_m = 10f64.powf(rng.random_range(3.0..4.2));
        let (seed, cloud_size) = (rng.random(), rng.random_range(0.6..2.0));
        Self {
            light,
            sun,
            sun_lx,
            sky_lx,
            scattered_lx,
            cover,
            cloud,
            zenith,
            horizon,
            street,
            haze_m,
            seed,
            cloud_size,
        }
    }

    /// Luminance of the sky in a direction above the horizon, cd/m^2.
    pub fn luminance(&self, d: Vec3) -> Rgb {
        let up = d.y.max(0.0) as f32;
        let mut sky = blend(self.horizon, self.zenith, 1.0 - (-4.0 * up).exp());
        // Haze glows around the sun; the disc itself is not drawn.
        if self.sun_lx[1] > 0.0 {
            let near = self.sun.dot(d).max(0.0) as f32;
            let glow = 0.016 * near.powi(8) + 0.06 * near.powi(60);
            sky = plus(sky, scaled(self.sun_lx, glow * (1.0 - 0.8 * self.cover)));
        }
        // Clouds lie in a layer; towards the horizon it is seen from the side.
        let scale = self.cloud_size / (d.y.max(0.0) + 0.12);
        let density = fractal2(d.x * scale, d.z * scale, 5, self.seed);
        let threshold = 0.78 - 0.55 * self.cover;
        let cover = smooth(threshold - 0.12, threshold + 0.12, density);
        let shade = 0.5 + fractal2(1.7 * d.x * scale + 9.0, 1.7 * d.z * scale, 3, self.seed ^ 5);
        blend(sky, scaled(self.cloud, shade), 0.92 * cover)
    }

    /// What a reflection in a direction shows, cd/m^2: the sky above a ragged skyline, the street below it.
    pub fn reflection(&self, d: Vec3, at: Vec3) -> Rgb {
        // A cheap stand-in for the azimuth that rises around the compass.
        let turn = 2.2 * d.x / (d.x.abs() + d.z.abs() + 1e-9) + 3.0 * f64::from(u8::from(d.z < 0.0));
        let skyline = 0.18 + 0.22 * f64::from(fractal2(turn + 0.01 * at.z, 0.3 * at.x, 2, self.seed ^ 77));
        let above = smooth(-0.03, 0.03, (d.y - skyline) as f32);
        let mottle = 0.5 + fractal2(5.0 * turn + 0.3 * at.z, 6.0 * d.y, 2, self.seed ^ 78);
        let sky = blend(self.horizon, self.zenith, (d.y.max(0.0) as f32).sqrt());
        let sky = blend(sky, self.cloud, 0.6 * self.cover);
        blend(scaled(self.street, mottle), sky, above)
    }

    /// The light of a surface at a distance, after haze, cd/m^2.
    pub fn through_haze(&self, light: Rgb, distance_m: f64) -> Rgb {
        let kept = (-distance_m / self.haze_m).exp() as f32;
        blend(scaled(self.horizon, 0.7), light, kept)
    }
}
