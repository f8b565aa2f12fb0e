//! Windows of generated streets: the light of a scene as a lens projects it, and the objects that are to be found in it.

use std::collections::BTreeMap;

use petzval_camera::image::CHANNELS;
use petzval_street::{
    Families, LampColours, LampState, Light, NearObject, ObjectKind, Projection, SeenObject, Street,
    StreetError, StreetSettings, Window,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::labelled_window::{LEAST_INSIDE, inside};
use super::{CropPlan, LabelledWindow, List, Wanted};
use crate::detection::{BBox, Object, Truth};

/// A window is placed on objects whose longer side is at most this share of its own.
const LARGEST_SHARE: f64 = 0.7;

/// Windows that are looked at before one is taken in which there is nothing to find, although it was to lie on an object.
const ATTEMPTS: usize = 4;

/// The automatic exposure makes the geometric mean of a street's luminance this share of white.
const MIDDLE_GRAY: f64 = 0.18;

/// Sensor pixels along a side of a pixel of the light meter.
const METERED_PX: f64 = 40.0;

/// Least luminance that the light meter counts, cd/m^2.
const DARKEST_CD_M2: f64 = 1e-4;

/// How a lens sees streets: the projection on its sensor, and on the few pixels of a light meter.
#[derive(Clone, Debug, PartialEq)]
pub struct StreetView {
    sensor: Projection,
    meter: Projection,
}

impl StreetView {
    /// A view from field angles (rad) at image radii (pixels), see [`Projection::new`].
    pub fn new(
        radius_px: &[f64],
        angle_rad: &[f64],
        [rows, columns]: [usize; 2],
    ) -> Result<Self, StreetError> {
        let coarse = |side: usize| (side as f64 / METERED_PX).ceil() as usize;
        let meter_px = radius_px.iter().map(|r| r / METERED_PX).collect();
        Ok(Self {
            sensor: Projection::new(radius_px.to_vec(), angle_rad.to_vec(), rows, columns)?,
            meter: Projection::new(meter_px, angle_rad.to_vec(), coarse(rows), coarse(columns))?,
        })
    }

    /// The geometric mean of the luminance of everything on the sensor, cd/m^2.
    fn luminance(&self, street: &Street) -> Result<f64, StreetError> {
        let (height, width) = (self.meter.rows(), self.meter.columns());
        let seen = street.see(&self.meter, &street.pose(), Window { row: 0, col: 0, height, width }, 1)?;
        let pixels = height * width;
        let log = |i: usize| {
            let sum: f32 = (0..CHANNELS).map(|c| seen.planes[c * pixels + i]).sum();
            f64::from(sum / CHANNELS as f32).max(DARKEST_CD_M2).ln()
        };
        Ok(((0..pixels).map(log).sum::<f64>() / pixels as f64).exp())
    }
}

/// Moments of a sequence from which a window may be taken.
const MOMENTS: u32 = 12;

/// How windows of streets are chosen and labelled.
#[derive(Clone, Debug, PartialEq)]
pub struct StreetPlan {
    /// Seed of the streets.
    pub seed: u64,
    /// Time of day.
    pub light: Light,
    /// What is looked for.
    pub wanted: Wanted,
    /// Luminance that becomes 1 at the longest exposure, cd/m^2. Brighter streets are exposed for less.
    pub white_cd_m2: f64,
    /// Samples along a side of a pixel.
    pub samples: usize,
    /// Share of the windows that lie on an object.
    pub on_objects: f64,
    /// Least longer side of an object that counts, pixels.
    pub least_side_px: f64,
    /// Least share of an object that must be seen for it to count, 0..1.
    pub least_visible: f64,
}

impl StreetPlan {
    /// Window `number` of a list as a lens sees it: a street of its own, at a place of the sensor that lies on an object or anywhere. It depends
    /// on the arguments alone. The object, and where it lies in the window, are chosen in the view of a `reference` lens, so that cameras that
    /// are compared look at the same objects.
    pub fn window(
        &self,
        list: List,
        families: Families,
        number: u64,
        [view, reference]: [&StreetView; 2],
        crops: &CropPlan,
    ) -> Result<LabelledWindow, StreetError> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed ^ 0x5743_1e7a_90b2_6d15);
        random.set_stream(match list {
            List::Training => 3 * number,
            List::Validation => 3 * number + 1,
            List::HeldOut => 3 * number + 2,
        });
        let street = Street::new(&StreetSettings {
            sequence: random.next_u64(),
            moment: random.random_range(0..MOMENTS),
            light: self.light,
            families,
            lamp_colours: LampColours::default(),
        });

        // Place the crop on an object of interest, somewhere inside, or anywhere.
        let near = street.objects_near(&reference.sensor, &street.pose())?;
        let sensor = [crops.sensor_rows, crops.sensor_columns];
        let counts = |o: &&NearObject| {
            let [x1, y1, x2, y2] = o.whole;
            let (x, y) = (0.5 * (x1 + x2), 0.5 * (y1 + y2));
            let is_on_sensor = (0.0..sensor[1] as f64).contains(&x) && (0.0..sensor[0] as f64).contains(&y);
            class_of(self.wanted, o.kind, o.lamp).is_some()
                && (self.least_side_px..LARGEST_SHARE * crops.crop as f64).contains(&longer_side(o.whole))
                && is_on_sensor
        };
        let wanted: Vec<&NearObject> = near.iter().filter(counts).collect();
        // Rare classes are looked at as often as others.
        let mut by_class: BTreeMap<usize, Vec<&NearObject>> = BTreeMap::new();
        for object in &wanted {
            let class = class_of(self.wanted, object.kind, object.lamp);
            by_class.entry(class.unwrap_or(0)).or_default().push(object);
        }
        let by_class: Vec<Vec<&NearObject>> = by_class.into_values().collect();
        let on_object = random.random_bool(self.on_objects) && !wanted.is_empty();
        let first = |middle: [f64; 2]| -> [usize; 2] {
            std::array::from_fn(|i| {
                let first = middle[i] - 0.5 * crops.crop as f64;
                first.clamp(0.0, (sensor[i] - crops.crop) as f64) as usize
            })
        };
        let around = |[x1, y1, x2, y2]: [f64; 4], off: [f64; 2]| {
            first([0.5 * (y1 + y2) + off[0], 0.5 * (x1 + x2) + off[1]])
        };
        // A window's place, and for one on an object its number and how far its middle is from that of the window.
        let mut place = || -> ([usize; 2], Option<(u64, [f64; 2])>) {
            let (pick, within): ([f64; 2], [f64; 2]) = (random.random(), random.random());
            if !on_object {
                return (first([within[0] * sensor[0] as f64, within[1] * sensor[1] as f64]), None);
            }
            let of_class = &by_class[(pick[0] * by_class.len() as f64) as usize];
            let object = of_class[(pick[1] * of_class.len() as f64) as usize];
            // The object's middle lies in the middle half of the crop.
            let off = within.map(|share| (share - 0.5) * 0.5 * crops.crop as f64);
            (around(object.whole, off), Some((object.id, off)))
        };
        let (mut at, mut on) = place();
        // An object may be hidden: look with few samples before the picture is made.
        for _ in 1..ATTEMPTS {
            let window =
                Window { row: at[0] as i64, col: at[1] as i64, height: crops.crop, width: crops.crop };
            if on.is_none() {
                break;
            }
            let seen = street.see(&reference.sensor, &street.pose(), window, 1)?;
            if !self.truth(&seen.objects, at, crops.crop).objects.is_empty() {
                break;
            }
            (at, on) = place();
        }
        // The same object through the lens that looks, unless it sees it no more.
        if let Some((id, off)) = on {
            let own = street.objects_near(&view.sensor, &street.pose())?;
            if let Some(object) = own.iter().find(|object| object.id == id) {
                at = around(object.whole, off);
            }
        }

        // See it with the border that the lens blurs light from.
        let (row, column) = crops.exposed_at(at[0], at[1]);
        let side = crops.window();
        let seen = street.see(
            &view.sensor,
            &street.pose(),
            Window {
                row: row as i64 - crops.margin as i64,
                col: column as i64 - crops.margin as i64,
                height: side,
                width: side,
            },
            self.samples,
        )?;
        let white = self.white_cd_m2.max(view.luminance(&street)? / MIDDLE_GRAY) as f32;
        let light = seen.planes.iter().map(|v| v / white);
        Ok(LabelledWindow::new(side, light, at, self.truth(&seen.objects, at, crops.crop)))
    }

    /// The objects of a crop in its own pixels. Objects of a class that are too small, too hidden or cut off too much are ignored.
    fn truth(&self, objects: &[SeenObject], at: [usize; 2], crop: usize) -> Truth {
        let mut truth = Truth::default();
        for object in objects {
            let Some(class) = class_of(self.wanted, object.kind, object.lamp) else { continue };
            let [x1, y1, x2, y2] = object.whole;
            let whole = BBox::new(x1 as f32, y1 as f32, x2 as f32, y2 as f32);
            let Some((bbox, share)) = inside(&whole, at, crop) else { continue };
            let counts = longer_side(object.whole) >= self.least_side_px
                && object.visible_share >= self.least_visible
                && share >= LEAST_INSIDE;
            match counts {
                true => truth.objects.push(Object { bbox, class }),
                // What cannot be seen at all is not there.
                false if object.visible_share > 0.0 => truth.ignored.push(bbox),
                false => {}
            }
        }
        truth
    }
}

/// The class of an object; none for what is not looked for.
fn class_of(wanted: Wanted, kind: ObjectKind, lamp: Option<LampState>) -> Option<usize> {
    match (wanted, kind, lamp) {
        (Wanted::PeopleAndVehicles, ObjectKind::Pedestrian, _) => Some(0),
        (Wanted::PeopleAndVehicles, ObjectKind::Vehicle, _) => Some(1),
        (Wanted::TrafficLights, ObjectKind::TrafficLight, Some(lamp)) => Some(match lamp {
            LampState::Red => 0,
            LampState::Yellow => 1,
            LampState::Green => 2,
            LampState::Off => 3,
        }),
        _ => None,
    }
}

fn longer_side([x1, y1, x2, y2]: [f64; 4]) -> f64 {
    (x2 - x1).max(y2 - y1)
}
