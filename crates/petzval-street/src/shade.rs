//! The light that leaves a place of the street towards the camera.

use crate::colour::{Rgb, plus, scaled, times};
use crate::light::Light;
use crate::material::{Material, leaf_normal};
use crate::road::GroundFace;
use crate::street::Street;
use crate::surface::{Place, Surface};
use crate::vector::Vec3;

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Hit {
    Sky,
    Ground { distance: f64, face: GroundFace },
    Part { distance: f64, object: u32, part: u32, face: u32 },
}

/// Share of the sky that houses leave open to a surface in the street.
const OPEN_SKY: f32 = 0.72;
/// Mean reflectance of the street for light that comes from below.
const GROUND: f32 = 0.16;

impl Street {
    /// Luminance in cd/m^2 of what a ray meets; `pixel_rad` is the angle between neighbouring pixels.
    pub(crate) fn light_of(&self, eye: Vec3, ray: Vec3, hit: Hit, pixel_rad: f64) -> Rgb {
        match hit {
            Hit::Sky => self.sky.luminance(ray),
            Hit::Ground { distance, face } => {
                let p = eye + ray * distance;
                let footprint = distance * pixel_rad / (-ray.y).max(0.02).sqrt();
                let (surface, normal) = self.road.surface(p, face, footprint);
                let open = self.contacts.openness(&self.objects, p);
                let light = self.lit(p, ray, normal, normal, surface, open, None);
                self.sky.through_haze(light, distance)
            }
            Hit::Part { distance, object, part, face } => {
                let p = eye + ray * distance;
                let own = (object, part);
                let object = &self.objects[object as usize];
                let part = &object.parts[part as usize];
                let q = part.inverse.point(p);
                let normal = part.inverse.normal(part.shape.normal(q, face));
                // A ray that leaves a crown through its far side sees the back of its leaves.
                let inside = normal.dot(ray) > 0.0;
                let normal = if inside { -normal } else { normal };
                let place = Place {
                    shape: &part.shape,
                    face,
                    own: q,
                    object: object.inverse.point(p),
                    normal: object.inverse.direction(normal),
                    world: p,
                    ray: object.inverse.direction(ray),
                    footprint_m: distance * pixel_rad,
                };
                let surface = part.material.surface(&place);
                let rounding = part.material.rounding_m();
                let shading = match &part.material {
                    Material::Leaves { size_m, seed, .. } => leaf_normal(normal, p, *size_m, *seed),
                    _ if rounding > 0.0 => object.frame.direction(place.rounded_normal(rounding)),
                    _ => normal,
                };
                // Near the ground, and inside crowns, less of the sky is open.
                let open = match &part.material {
                    Material::Leaves { .. } if inside => 0.35,
                    Material::Leaves { .. } => 0.55 + 0.45 * (0.5 + 0.5 * normal.y as f32),
                    _ => 0.6 + 0.4 * (p.y as f32 / 0.7).clamp(0.0, 1.0),
                };
                // A convex part casts no shadow on itself, but a crown has an inside.
                let own = (!part.material.has_gaps()).then_some(own);
                let light = self.lit(p, ray, normal, shading, surface, open, own);
                self.sky.through_haze(light, distance)
            }
        }
    }

    /// Light of a surface: its own, diffuse reflection of sun, sky, ground and lamps, and mirror reflection.
    fn lit(
        &self,
        p: Vec3,
        ray: Vec3,
        geometric: Vec3,
        normal: Vec3,
        surface: Surface,
        open: f32,
        own: Option<(u32, u32)>,
    ) -> Rgb {
        let sky = &self.sky;
        let up = normal.y as f32;
        let above = (0.5 + 0.5 * up) * OPEN_SKY * open;
        // Light from below has been reflected by the street.
        let level = plus(scaled(sky.sun_lx, 0.35 * sky.sun.y as f32), scaled(sky.sky_lx, OPEN_SKY));
        let below = (0.5 - 0.5 * up) * GROUND * open;
        let mut illuminance = plus(scaled(sky.sky_lx, above), scaled(level, below));
        illuminance = plus(illuminance, scaled(sky.scattered_lx, open));

        // The sun, where nothing stands in its way.
        let incidence = sky.sun.dot(normal) as f32;
        let faces_sun = sky.sun_lx[1] > 0.0 && incidence > 0.0;
        let lifted = p + geometric * 2e-3;
        let sunlit = faces_sun && !self.sun.shaded(&self.objects, lifted, own);
        if sunlit {
            illuminance = plus(illuminance, scaled(sky.sun_lx, incidence));
        }
        let after_dark = sky.light != Light::Day;
        if after_dark {
            illuminance = plus(illuminance, scaled(self.lamps.illuminance_lx(p, normal), 0.4 + 0.6 * open));
        }
        let diffuse = scaled(times(surface.albedo, illuminance), std::f32::consts::FRAC_1_PI);
        let mut light = plus(diffuse, surface.emission);

        // Varnish, glass and water reflect more at a grazing angle (Schlick 1994).
        if surface.gloss > 0.0 {
            let cos = -ray.dot(normal);
            let grazing = (1.0 - cos.clamp(0.0, 1.0) as f32).powi(5);
            let most = (15.0 * surface.gloss).min(1.0);
            let mirror = surface.gloss + (most - surface.gloss) * grazing;
            let reflected = ray + normal * (2.0 * cos);
            // A faint reflection is not worth its price.
            if mirror > 0.012 {
                light = plus(light, scaled(sky.reflection(reflected, p), mirror * open));
            }
            if surface.gloss > 0.03 && sunlit {
                // The image of the sun, spread by the unevenness of the surface.
                let near = sky.sun.dot(reflected).max(0.0) as f32;
                light = plus(light, scaled(sky.sun_lx, mirror * 64.0 * near.powi(400)));
            }
            // Only the road has no part: its image of a lamp is a streak.
            if after_dark && own.is_none() && geometric.y > 0.9 && surface.gloss > 0.006 {
                light = plus(light, scaled(self.lamps.streaks(p, reflected), 0.12 * mirror));
            } else if after_dark && surface.gloss > 0.008 {
                light = plus(light, scaled(self.lamps.glints(p, reflected, 60), mirror));
            }
        }
        light
    }
}
