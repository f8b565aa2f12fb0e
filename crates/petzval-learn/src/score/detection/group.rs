//! Some of the objects, such as the small ones or those far from the optical axis.

use super::picture::{FoundObject, Picture, TrueObject, Xywh};

type IsObject<'a> = Box<dyn Fn(&Picture, &TrueObject) -> bool + Sync + 'a>;
type IsDetection<'a> = Box<dyn Fn(&Picture, &FoundObject) -> bool + Sync + 'a>;

/// Some of the objects. The others are ignored: nobody has to detect them, and whoever does is neither right nor wrong.
pub struct Group<'a> {
    pub(super) has_object: IsObject<'a>,
    pub(super) has_detection: IsDetection<'a>,
}

impl<'a> Group<'a> {
    /// Everything.
    pub fn all() -> Self {
        Self { has_object: Box::new(|_, _| true), has_detection: Box::new(|_, _| true) }
    }

    /// The objects for which a function is true. A detection that matches no object counts as a mistake where `detections` is true.
    pub fn of(
        objects: impl Fn(&Picture, &TrueObject) -> bool + Sync + 'a,
        detections: impl Fn(&Picture, &FoundObject) -> bool + Sync + 'a,
    ) -> Self {
        Self { has_object: Box::new(objects), has_detection: Box::new(detections) }
    }

    /// Objects with an area of `low` to `high`, both included, px^2. Detections are judged by the area of their bounds.
    pub fn of_area(low: f64, high: f64) -> Self {
        let is_in = move |area: f64| (low..=high).contains(&area);
        Self::of(
            move |_, object| is_in(object.area),
            move |_, found| is_in(found.bounds[2] * found.bounds[3]),
        )
    }

    /// Objects whose middle is from `low` up to `high` px away from a point, such as the one that the optical axis meets.
    pub fn of_distance(from: [f64; 2], low: f64, high: f64) -> Self {
        let is_in = move |[x, y, width, height]: Xywh| {
            let distance = (x + 0.5 * width - from[0]).hypot(y + 0.5 * height - from[1]);
            (low..high).contains(&distance)
        };
        Self::of(move |_, object| is_in(object.bounds), move |_, found| is_in(found.bounds))
    }
}
