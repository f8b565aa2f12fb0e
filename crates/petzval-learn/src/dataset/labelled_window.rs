//! A window of a scene with the objects that are to be found in it.

use half::f16;
use petzval_camera::image::{CHANNELS, LinearImage};

use crate::detection::{BBox, Object, Truth};

/// Brightest light that is kept, in units of white; sensors are full long before.
const BRIGHTEST: f32 = 6e4;

/// Least share of an object inside a window for it to be asked for.
pub(super) const LEAST_INSIDE: f64 = 0.4;

/// The part of a box inside a crop whose first pixel is at `first`, row and column, in pixels of the crop, and its share of the box; none where
/// less than a pixel is left.
pub(super) fn inside(whole: &BBox, first: [usize; 2], crop: usize) -> Option<(BBox, f64)> {
    let bbox = whole.moved([-(first[1] as f32), -(first[0] as f32)]).clipped([crop, crop]);
    bbox.is_at_least(1.0).then(|| (bbox, f64::from(bbox.area() / whole.area().max(1e-6))))
}

/// Which scenes windows are taken from; those of different lists have nothing in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum List {
    /// Those that blocks are trained on.
    Training,
    /// Those of validations.
    Validation,
    /// Those in which cameras are scored.
    HeldOut,
}

/// What is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// Pedestrians (class 0) and vehicles (class 1).
    PeopleAndVehicles,
    /// Traffic lights for the camera's lane, by what they show: red, yellow, green, off (classes 0 to 3). Lights for people on foot and
    /// for other lanes are not among them, and finding them is a mistake.
    TrafficLights,
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
}

impl LabelledWindow {
    /// A window of `side` x `side` pixels of light in units of white, three planes.
    pub fn new(side: usize, light: impl Iterator<Item = f32>, at: [usize; 2], truth: Truth) -> Self {
        let planes: Vec<f16> = light.map(|v| f16::from_f32(v.min(BRIGHTEST))).collect();
        assert_eq!(planes.len(), CHANNELS * side * side, "a window has three planes");
        Self { side, planes, at, truth }
    }

    /// The light of the scene, three planes.
    pub fn scene(&self) -> LinearImage {
        let data = self.planes.iter().map(|v| v.to_f32()).collect();
        LinearImage { channels: CHANNELS, height: self.side, width: self.side, data }
    }

    /// The window as a mirror shows it, at the mirrored place of a sensor of so many columns. A lens is symmetric, so it sees this as well.
    pub fn mirrored(&self, crop: usize, sensor_columns: usize) -> Self {
        let mut planes = self.planes.clone();
        planes.chunks_exact_mut(self.side).for_each(<[f16]>::reverse);
        let width = crop as f32;
        let flip = |b: BBox| BBox::new(width - b.x2, b.y1, width - b.x1, b.y2);
        let objects = self.truth.objects.iter().map(|o| Object { bbox: flip(o.bbox), ..*o }).collect();
        let ignored = self.truth.ignored.iter().map(|b| flip(*b)).collect();
        let at = [self.at[0], sensor_columns - crop - self.at[1]];
        Self { side: self.side, planes, at, truth: Truth { objects, ignored } }
    }
}
