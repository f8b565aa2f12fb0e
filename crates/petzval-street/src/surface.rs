//! A surface at a place of a part.

use crate::colour::Rgb;
use crate::shape::Shape;
use crate::vector::Vec3;

/// A surface at a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Diffuse reflectance.
    pub albedo: Rgb,
    /// Mirror reflectance at square incidence.
    pub gloss: f32,
    /// Light of its own, cd/m^2.
    pub emission: Rgb,
}

/// A place on a part.
pub(crate) struct Place<'a> {
    pub shape: &'a Shape,
    pub face: u32,
    /// In the shape's own coordinates.
    pub own: Vec3,
    /// In the object's coordinates, m.
    pub object: Vec3,
    /// Unit normal in the object's coordinates.
    pub normal: Vec3,
    /// In the world, m.
    pub world: Vec3,
    /// Unit direction in which the camera's ray travels, in the object's coordinates.
    pub ray: Vec3,
    /// Width of a pixel at this distance, m.
    pub footprint_m: f64,
}

impl Place<'_> {
    /// Distance in metres from the nearest edge of the face of a polyhedron, and the normal beyond that edge; `limit_m` and the
    /// face's own normal if no edge is nearer than that.
    pub fn edge(&self, limit_m: f64) -> (f64, Vec3) {
        let mut nearest = (limit_m, self.normal);
        let Shape::Convex(convex) = self.shape else { return nearest };
        let own = convex.planes[self.face as usize].0;
        for (i, (n, d)) in convex.planes.iter().enumerate() {
            // The distance square to the other plane is at most that along the face.
            let gap = d - n.dot(self.own);
            if i == self.face as usize || gap >= nearest.0 {
                continue;
            }
            let cos = own.dot(*n);
            let distance = gap / (1.0 - cos * cos).sqrt().max(0.05);
            if distance < nearest.0 {
                nearest = (distance, *n);
            }
        }
        nearest
    }

    /// The normal with edges of a polyhedron rounded by `radius_m`.
    pub fn rounded_normal(&self, radius_m: f64) -> Vec3 {
        let (distance, other) = self.edge(radius_m);
        if distance >= radius_m {
            return self.normal;
        }
        let share = 0.5 * (1.0 - distance / radius_m);
        (self.normal * (1.0 - share) + other * share).unit()
    }
}
