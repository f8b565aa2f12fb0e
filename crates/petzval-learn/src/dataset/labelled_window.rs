//! A window of a scene with the objects that are to be found in it, or the class of each of its pixels.

use std::collections::BTreeMap;

use half::f16;
use petzval_camera::image::{CHANNELS, LinearImage};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{ClassMap, CropPlan, TakesBytes};
use crate::detection::{BBox, Ignored, Object, Truth};

/// Brightest light that is kept, in units of white; sensors are full long before.
const BRIGHTEST: f32 = 6e4;

/// A window is placed on objects whose longer side is at most this share of its own.
pub(super) const LARGEST_SHARE: f64 = 0.7;

/// Least share of an object inside a window for the object to count.
pub(super) const LEAST_INSIDE: f64 = 0.4;

/// The part of a box inside a crop whose first pixel is at `first`, row and column, in pixels of the crop, and its share of the box; none where
/// less than a pixel is left.
pub(super) fn inside(whole: &BBox, first: [usize; 2], crop: usize) -> Option<(BBox, f64)> {
    let bbox = whole.moved([-(first[1] as f32), -(first[0] as f32)]).clipped([crop, crop]);
    bbox.is_at_least(1.0).then(|| (bbox, f64::from(bbox.area() / whole.area().max(1e-6))))
}

/// First row and column of the crop around a place, row and column, of a picture or a sensor with so many rows and columns. A crop that extends
/// beyond them is moved inside.
pub(super) fn crop_around(middle: [f64; 2], sides: [usize; 2], crop: usize) -> [usize; 2] {
    std::array::from_fn(|i| {
        let most = sides[i].saturating_sub(crop) as f64;
        (middle[i] - 0.5 * crop as f64).clamp(0.0, most) as usize
    })
}

/// How far the middle of a crop lies from that of its object, so that the object's lies in the middle half of the crop, at these shares 0..1 of it.
pub(super) fn off_middle(shares: [f64; 2], crop: usize) -> [f64; 2] {
    shares.map(|share| (share - 0.5) * 0.5 * crop as f64)
}

/// One of these objects, each with its class: first a class is drawn, then one of its objects, so that rare classes are drawn as often as frequent
/// ones. None if there is no object.
pub(super) fn drawn_by_class<T>(
    objects: impl Iterator<Item = (usize, T)>,
    random: &mut ChaCha8Rng,
) -> Option<T> {
    let mut by_class: BTreeMap<usize, Vec<T>> = BTreeMap::new();
    for (class, object) in objects {
        by_class.entry(class).or_default().push(object);
    }
    if by_class.is_empty() {
        return None;
    }
    let class = random.random_range(0..by_class.len());
    let mut of_class = by_class.into_values().nth(class)?;
    let place = random.random_range(0..of_class.len());
    Some(of_class.swap_remove(place))
}

/// Which scenes windows are taken from; those of different lists have nothing in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum List {
    /// Those that blocks are trained on.
    Training,
    /// Those of validations.
    Validation,
    /// Those in which cameras are scored.
    HeldOut,
}

/// What the pictures of a folder are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Training and scores.
    Training,
    /// Training, validation and scores.
    ValidatedTraining,
    /// Scores alone: all of them are held out.
    Scores,
}

/// A window of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledWindow {
    side: usize,
    /// The light, three planes, with the border of the plan; half precision keeps hundreds of windows in memory.
    planes: Vec<f16>,
    /// First sensor row and column of the crop, without border.
    pub at: [usize; 2],
    /// The objects, in pixels of the crop.
    pub truth: Truth,
    /// The class of each pixel of the crop; none where no task has need of it.
    pub classes: Option<ClassMap>,
    /// Whether the exposure time is the same behind every lens. A lens that gathers more light then has more electrons; in a bright street the
    /// automatic exposure makes all alike.
    pub follows_light: bool,
}

impl TakesBytes for LabelledWindow {
    fn bytes(&self) -> u64 {
        let classes = self.classes.as_ref().map_or(0, |map| map.classes.len());
        (size_of_val(self.planes.as_slice()) + classes) as u64
    }
}

impl LabelledWindow {
    /// A window of `side` x `side` pixels of light in units of white, three planes.
    pub fn new(side: usize, light: impl Iterator<Item = f32>, at: [usize; 2], truth: Truth) -> Self {
        let planes: Vec<f16> = light.map(|v| f16::from_f32(v.min(BRIGHTEST))).collect();
        assert_eq!(planes.len(), CHANNELS * side * side, "a window has three planes");
        Self { side, planes, at, truth, classes: None, follows_light: true }
    }

    /// Side of the window with its border, pixels.
    pub fn side(&self) -> usize {
        self.side
    }

    /// The same window, with [`LabelledWindow::follows_light`], which a new one does.
    pub fn following_light(self, follows_light: bool) -> Self {
        Self { follows_light, ..self }
    }

    /// The same window with the class of each pixel of its crop.
    pub fn with_classes(self, classes: ClassMap) -> Self {
        Self { classes: Some(classes), ..self }
    }

    /// The light of the scene, three planes.
    pub fn scene(&self) -> LinearImage {
        let data = self.planes.iter().map(|v| v.to_f32()).collect();
        LinearImage { channels: CHANNELS, height: self.side, width: self.side, data }
    }

    /// Draws the middle of a smaller crop of `crop` pixels out of this one of `own`: near an object, of every class as often as of the others, or
    /// anywhere if there is none. Row and column of the sensor; it may lie so near an edge that the crop would not fit.
    pub fn middle_of_part(&self, own: usize, crop: usize, random: &mut ChaCha8Rng) -> [f32; 2] {
        let objects = self.truth.objects.iter().map(|object| (object.class, object));
        let middle: [f32; 2] = match drawn_by_class(objects, random) {
            None => std::array::from_fn(|_| random.random::<f32>() * own as f32),
            Some(object) => {
                let [x, y] = object.bbox.centre();
                // The object's middle lies in the middle half of the crop.
                [y, x].map(|at| at + (random.random::<f32>() - 0.5) * 0.5 * crop as f32)
            }
        };
        [0, 1].map(|i| self.at[i] as f32 + middle[i])
    }

    /// A smaller crop around `middle`, a row and a column of the sensor, out of this one, which was cut by the plan `own`; moved inside where it
    /// would extend beyond it. The two plans differ in their crop alone.
    ///
    /// # Panics
    /// Panics if the crop of `plan` is the larger one.
    pub fn part(&self, own: &CropPlan, plan: &CropPlan, middle: [f32; 2]) -> Self {
        let spare = own.crop.checked_sub(plan.crop).expect("a part is no larger than the whole");
        let first: [usize; 2] = std::array::from_fn(|i| {
            let middle = middle[i] - self.at[i] as f32;
            (middle - 0.5 * plan.crop as f32).clamp(0.0, spare as f32) as usize
        });
        let at = [0, 1].map(|i| self.at[i] + first[i]);
        // Where its border begins in this window: at the edge of the sensor the border is on the other side.
        let [whole, part] = [own.exposed_at(self.at[0], self.at[1]), plan.exposed_at(at[0], at[1])];
        let (top, left, side) = (part.0 - whole.0, part.1 - whole.1, plan.window());
        let planes = self.planes.chunks_exact(self.side * self.side);
        let rows = planes.flat_map(|plane| plane.chunks_exact(self.side).skip(top).take(side));
        let planes = rows.flat_map(|row| &row[left..left + side]).copied().collect();
        let mut truth = Truth::default();
        for object in &self.truth.objects {
            match inside(&object.bbox, first, plan.crop) {
                Some((bbox, share)) if share >= LEAST_INSIDE => {
                    truth.objects.push(Object { bbox, ..*object })
                }
                Some((bbox, _)) => truth.ignored.push(Ignored::of_all(bbox)),
                None => {}
            }
        }
        let part = |region: &Ignored| Some(region.with_box(inside(&region.bbox, first, plan.crop)?.0));
        truth.ignored.extend(self.truth.ignored.iter().filter_map(part));
        let classes = self.classes.as_ref().map(|classes| classes.part(first, plan.crop));
        Self { side, planes, at, truth, classes, follows_light: self.follows_light }
    }

    /// The window as a mirror shows it, at the mirrored place of a sensor of so many columns. A lens is symmetric, so it sees this as well.
    pub fn mirrored(&self, crop: usize, sensor_columns: usize) -> Self {
        let mut planes = self.planes.clone();
        planes.chunks_exact_mut(self.side).for_each(<[f16]>::reverse);
        let width = crop as f32;
        let flip = |b: BBox| BBox::new(width - b.x2, b.y1, width - b.x1, b.y2);
        let mirrored = |o: &Object| Object { bbox: flip(o.bbox), ..*o };
        let Truth { objects, ignored, beside } = &self.truth;
        let truth = Truth {
            objects: objects.iter().map(mirrored).collect(),
            ignored: ignored.iter().map(|region| region.with_box(flip(region.bbox))).collect(),
            beside: beside.iter().map(mirrored).collect(),
        };
        let at = [self.at[0], sensor_columns - crop - self.at[1]];
        let classes = self.classes.as_ref().map(ClassMap::mirrored);
        Self { side: self.side, planes, at, truth, classes, follows_light: self.follows_light }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    /// Every pixel of the light says where on the sensor it is.
    #[test]
    fn a_part_shows_the_same_places_of_the_sensor_and_an_object() {
        let plan = |crop| CropPlan { crop, margin: 3, surround: 5, sensor_rows: 90, sensor_columns: 120 };
        let (own, small) = (plan(48), plan(20));
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for at in [[0, 0], [2, 70], [42, 72], [20, 33]] {
            let side = own.window();
            let exposed = own.exposed_at(at[0], at[1]);
            let place = |origin: (usize, usize), i: usize, side: usize| {
                let (row, column) = (i / side % side, i % side);
                ((origin.0 + row) * 1000 + origin.1 + column) as f32
            };
            // Half precision holds integers up to 2048.
            let short = |v: f32| v % 2039.0;
            let light = (0..CHANNELS * side * side).map(|i| short(place(exposed, i, side)));
            let bbox = BBox::new(30.0, 8.0, 36.0, 14.0);
            let far = Object { bbox, class: 1 };
            let truth = Truth {
                objects: vec![far],
                ignored: vec![Ignored { bbox: BBox::new(0.0, 0.0, 48.0, 48.0), class: Some(1) }],
                ..Truth::default()
            };
            // So does the class of every pixel of the crop.
            let class = |row: usize, column: usize| ((row * 1000 + column) % 251) as u8;
            let classes = (0..own.crop * own.crop).map(|i| class(at[0] + i / own.crop, at[1] + i % own.crop));
            let classes = ClassMap::new(own.crop, own.crop, classes.collect());
            let window = LabelledWindow::new(side, light, at, truth).with_classes(classes);
            for _ in 0..20 {
                let middle = window.middle_of_part(own.crop, small.crop, &mut random);
                let part = window.part(&own, &small, middle);
                let origin = small.exposed_at(part.at[0], part.at[1]);
                let side = small.window();
                let light = part.scene();
                assert_eq!([light.height, light.width], [side; 2]);
                assert!((0..light.data.len()).all(|i| light.data[i] == short(place(origin, i, side))));
                let classes = part.classes.as_ref().unwrap();
                assert_eq!([classes.height, classes.width], [small.crop; 2]);
                let is_there = |i: usize| {
                    classes.classes[i] == class(part.at[0] + i / small.crop, part.at[1] + i % small.crop)
                };
                assert!((0..small.crop * small.crop).all(is_there));
                // A mirror shows the classes of each row from right to left.
                let mirrored = part.mirrored(small.crop, own.sensor_columns).classes.unwrap();
                for (row, flipped) in classes.classes.chunks(20).zip(mirrored.classes.chunks(20)) {
                    assert!(row.iter().eq(flipped.iter().rev()));
                }
                // The object is where it was on the sensor, and wholly in the part as far as the offset allows.
                let object = part.truth.objects[0];
                let moved = [1, 0].map(|i| part.at[i] as f32 - at[i] as f32);
                assert_eq!(
                    object,
                    Object { bbox: bbox.moved(moved.map(|v| -v)).clipped([20, 20]), class: 1 }
                );
                assert_eq!(
                    part.truth.ignored,
                    [Ignored { bbox: BBox::new(0.0, 0.0, 20.0, 20.0), class: Some(1) }]
                );
            }
        }
    }
}
