//! What a camera sees: a picture in linear light and the objects in it.

use std::collections::BTreeMap;

use crate::error::StreetError;
use crate::light::LampState;
use crate::object::{Object, ObjectKind};
use crate::pose::Pose;
use crate::projection::Projection;
use crate::street::Street;
use crate::surface_class::SurfaceClass;
use crate::vector::{Frame, Vec3};

/// A picture of a window.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Luminance in cd/m^2 of each colour channel, shape `[3, height, width]`, red first. A gray surface has equal channels in
    /// white light. Finite and not negative.
    pub planes: Vec<f32>,
    /// The class of most samples of each pixel, shape `[height, width]`.
    pub classes: Vec<SurfaceClass>,
    /// The objects whose outline reaches into the window, hidden or not, in the order of their `id`.
    pub objects: Vec<SeenObject>,
}

/// An object in a picture. Boxes are `[x1, y1, x2, y2]` in sensor pixels: pixel (row, col) covers `col..col + 1`, `row..row + 1`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SeenObject {
    /// What it is.
    pub kind: ObjectKind,
    /// Its number, the same at every moment of a sequence.
    pub id: u64,
    /// The box of all of it, as if nothing hid it and the window had no end.
    pub whole: [f64; 4],
    /// The box of its visible samples in the window; `None` if none is visible.
    pub visible: Option<[f64; 4]>,
    /// Share 0..1 of its samples in the window that nothing hides.
    pub visible_share: f64,
    /// Share 0..1 of the area of `whole` that lies in the window.
    pub inside_share: f64,
    /// Distance of its middle from the camera, m.
    pub distance_m: f64,
    /// What a light shows; `None` for other objects.
    pub lamp: Option<LampState>,
}

/// An object near enough to be seen, before anything is drawn: it may be hidden.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NearObject {
    /// What it is.
    pub kind: ObjectKind,
    /// Its number, the same at every moment of a sequence.
    pub id: u64,
    /// The box of all of it in sensor pixels, not clipped to the sensor.
    pub whole: [f64; 4],
    /// Distance of its middle from the camera, m.
    pub distance_m: f64,
    /// What a light shows; `None` for other objects.
    pub lamp: Option<LampState>,
}

/// Cosine of the widest angle at which outlines are projected: what lies further beside the camera, or behind it, counts as if it lay there.
const LEAST_COSINE: f64 = 0.1;

impl Object {
    /// The box of its outline in sensor pixels; `None` if all of it is beside or behind the camera.
    pub(crate) fn whole_box(&self, projection: &Projection, camera: &Frame) -> Option<[f64; 4]> {
        let inverse = camera.inverse();
        let mut whole = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let mut is_in_front = false;
        for p in self.parts.iter().flat_map(|part| part.outline(camera.origin)) {
            let v = inverse.point(p);
            let (mut place, cosine) = projection.pixel(v);
            if cosine < LEAST_COSINE {
                place = projection.pixel(turned_to_front(v)).0
            } else {
                is_in_front = true
            }
            let [x, y] = place;
            whole = [whole[0].min(x), whole[1].min(y), whole[2].max(x), whole[3].max(y)];
        }
        is_in_front.then_some(whole)
    }
}

/// The direction on the same side of the camera at the widest angle.
fn turned_to_front(v: Vec3) -> Vec3 {
    let across = v.x.hypot(v.y).max(f64::MIN_POSITIVE);
    let sine = (1.0 - LEAST_COSINE * LEAST_COSINE).sqrt();
    Vec3 { x: sine * v.x / across, y: sine * v.y / across, z: LEAST_COSINE }
}

/// The common area of two boxes.
pub(crate) fn overlap(a: [f64; 4], b: [f64; 4]) -> f64 {
    (a[2].min(b[2]) - a[0].max(b[0])).max(0.0) * (a[3].min(b[3]) - a[1].max(b[1])).max(0.0)
}

impl Street {
    /// The labelled objects whose boxes reach into the sensor, hidden or not, without drawing anything. A caller chooses windows
    /// by it. The order is that of their `id`.
    pub fn objects_near(&self, projection: &Projection, pose: &Pose) -> Result<Vec<NearObject>, StreetError> {
        pose.check()?;
        let camera = pose.frame();
        let sensor = [0.0, 0.0, projection.columns() as f64, projection.rows() as f64];
        let widest = projection.widest_rad();
        let near = |object: &Object| {
            let kind = object.kind?;
            let to = camera.inverse().point(object.centre);
            let distance_m = to.length();
            // Most objects are beside the field: compare angles before projecting outlines.
            let angle = to.x.hypot(to.y).atan2(to.z) - (object.radius / distance_m).min(1.0).asin();
            if angle > widest {
                return None;
            }
            let whole = object.whole_box(projection, &camera)?;
            let seen = NearObject { kind, id: object.id, whole, distance_m, lamp: object.lamp };
            (overlap(whole, sensor) > 0.0).then_some(seen)
        };
        let mut all: Vec<NearObject> = self.objects.iter().filter_map(near).collect();
        all.sort_by_key(|object| object.id);
        Ok(all)
    }

    /// The box `[x1, y1, x2, y2]` of all of a labelled object in sensor pixels, also where it lies beside the sensor. `None` if the street has no
    /// such object, or if all of it is beside or behind the camera.
    pub fn box_of(
        &self,
        projection: &Projection,
        pose: &Pose,
        id: u64,
    ) -> Result<Option<[f64; 4]>, StreetError> {
        pose.check()?;
        let object = self.objects.iter().find(|object| object.kind.is_some() && object.id == id);
        Ok(object.and_then(|object| object.whole_box(projection, &pose.frame())))
    }
}

/// Counts of an object's samples.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tally {
    /// Samples that meet the object, hidden or not.
    pub all: u32,
    pub visible: u32,
    pub extent: [f64; 4],
}

impl Default for Tally {
    fn default() -> Self {
        let extent = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        Self { all: 0, visible: 0, extent }
    }
}

impl Tally {
    /// Counts a visible sample whose cell of the pixel is `cell`.
    pub fn show(&mut self, cell: [f64; 4]) {
        self.visible += 1;
        self.all += 1;
        let e = &mut self.extent;
        *e = [e[0].min(cell[0]), e[1].min(cell[1]), e[2].max(cell[2]), e[3].max(cell[3])];
    }

    /// Adds the counts of another tile.
    pub fn join(&mut self, other: &Self) {
        self.all += other.all;
        self.visible += other.visible;
        let (a, b) = (self.extent, other.extent);
        self.extent = [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])];
    }
}

/// The objects in a window from the counts of their samples.
pub(crate) fn seen_objects(
    street: &Street,
    projection: &Projection,
    camera: &Frame,
    window: [f64; 4],
    tallies: &BTreeMap<u32, Tally>,
) -> Vec<SeenObject> {
    let seen = |(&i, tally): (&u32, &Tally)| {
        let object = &street.objects[i as usize];
        let whole = object.whole_box(projection, camera)?;
        let area = (whole[2] - whole[0]) * (whole[3] - whole[1]);
        let share = f64::from(tally.visible) / f64::from(tally.all.max(1));
        Some(SeenObject {
            kind: object.kind?,
            id: object.id,
            whole,
            visible: (tally.visible > 0).then_some(tally.extent),
            visible_share: share,
            inside_share: (overlap(whole, window) / area.max(1e-12)).min(1.0),
            distance_m: (object.centre - camera.origin).length(),
            lamp: object.lamp,
        })
    };
    let mut all: Vec<SeenObject> = tallies.iter().filter_map(seen).collect();
    all.sort_by_key(|object| object.id);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Material;
    use crate::object::Builder;

    /// The box of a block 3 m to the right of a lens of 45 degrees, between two distances in front of it.
    fn box_of_block([near, far]: [f64; 2]) -> Option<[f64; 4]> {
        let projection = Projection::rectilinear(1000.0, 2500.0, 1000, 2000).unwrap();
        let mut builder = Builder::at(Vec3::default(), 0.0, SurfaceClass::Vehicle);
        let material = Material::Plain { albedo: [0.5; 3], gloss: 0.0 };
        builder.block([3.5, 0.0, 0.5 * (near + far)], [0.5, 1.0, 0.5 * (far - near)], material);
        builder.finish(1, Some(ObjectKind::Vehicle)).whole_box(&projection, &Frame::WORLD)
    }

    #[test]
    fn a_vehicle_that_is_partly_beside_the_camera_has_a_box_that_begins_where_it_is_seen() {
        let [whole, front] = [box_of_block([-4.0, 8.0]).unwrap(), box_of_block([4.0, 8.0]).unwrap()];
        // Its left end is that of its far face, and its right end far beyond the sensor.
        assert!((whole[0] - (1000.0 + 1000.0 * 3.0 / 8.0)).abs() < 1.0 && whole[0] == front[0], "{whole:?}");
        assert!(whole[2] > 4000.0 && front[2] < 2001.0, "{whole:?} {front:?}");
        assert_eq!(box_of_block([-8.0, -4.0]), None);
        assert_eq!(box_of_block([-8.0, 0.1]), None);
    }
}
