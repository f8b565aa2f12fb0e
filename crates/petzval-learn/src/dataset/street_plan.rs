//! Windows of generated streets: the light of a scene as a lens projects it, the objects that are to be found in it, and the classes of its pixels.

use std::collections::BTreeMap;

use petzval_camera::image::CHANNELS;
use petzval_street::{
    Families, LampColours, Light, NearObject, Projection, Seen, SeenObject, Street, StreetError,
    StreetSettings, SurfaceClass, Window,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::labelled_window::{LARGEST_SHARE, LEAST_INSIDE, crop_around, drawn_by_class, inside, off_middle};
use super::{ClassMap, Classes, CropPlan, LabelledWindow, List};
use crate::detection::{BBox, Ignored, Object, Truth};

/// The automatic exposure makes the geometric mean of a street's luminance this share of white.
const MIDDLE_GRAY: f64 = 0.18;

/// Sensor pixels along a side of a pixel of the finder.
const FINDER_PX: f64 = 8.0;

/// Least luminance that the light meter counts, cd/m^2.
const DARKEST_CD_M2: f64 = 1e-4;

/// Moments of a sequence from which a window may be taken.
const MOMENTS: u32 = 12;

/// How a lens sees streets: the projection on its sensor, and on the few pixels of a finder, which shows what is where before a picture is
/// made; and how bright its image is.
#[derive(Clone, Debug, PartialEq)]
pub struct StreetView {
    sensor: Projection,
    finder: Projection,
    light: f64,
    /// Size of the image, against that of the lens from which the view was made.
    magnification: f64,
    /// Size of the image of that lens, in units of that of the lens in whose view places are chosen.
    scale: f64,
}

/// What the finder shows of a street.
struct Found {
    /// The geometric mean of the luminance of everything on the sensor, cd/m^2.
    luminance_cd_m2: f64,
    /// Share 0..1 of each object on the sensor that nothing hides, by the object's number.
    visible_shares: BTreeMap<u64, f64>,
}

impl StreetView {
    /// A view from field angles (rad) at image radii (pixels), see [`Projection::new`].
    pub fn new(
        radius_px: &[f64],
        angle_rad: &[f64],
        [rows, columns]: [usize; 2],
    ) -> Result<Self, StreetError> {
        let coarse = |side: usize| (side as f64 / FINDER_PX).ceil() as usize;
        let finder_px = radius_px.iter().map(|r| r / FINDER_PX).collect();
        Ok(Self {
            sensor: Projection::new(radius_px.to_vec(), angle_rad.to_vec(), rows, columns)?,
            finder: Projection::new(finder_px, angle_rad.to_vec(), coarse(rows), coarse(columns))?,
            light: 1.0,
            magnification: 1.0,
            scale: 1.0,
        })
    }

    /// This view with the image `scale` times as large as behind the lens in whose view places are chosen.
    pub fn with_scale(self, scale: f64) -> Self {
        Self { scale, ..self }
    }

    /// This view with the image `light` times as bright as behind the reference lens, for which [`StreetPlan::white_cd_m2`] holds.
    pub fn with_light(self, light: f64) -> Self {
        Self { light, ..self }
    }

    /// The view of a lens like this one, whose image is so many times as large: every chief ray lands so many times as far from the axis.
    pub fn magnified(&self, by: f64) -> Result<Self, StreetError> {
        let (sensor, finder) = (self.sensor.magnified(by)?, self.finder.magnified(by)?);
        Ok(Self { sensor, finder, magnification: by * self.magnification, ..*self })
    }

    fn look_through_finder(&self, street: &Street) -> Result<Found, StreetError> {
        let (height, width) = (self.finder.rows(), self.finder.columns());
        let seen = street.see(&self.finder, &street.pose(), Window { row: 0, col: 0, height, width }, 1)?;
        let pixels = height * width;
        let log = |i: usize| {
            let sum: f32 = (0..CHANNELS).map(|c| seen.planes[c * pixels + i]).sum();
            f64::from(sum / CHANNELS as f32).max(DARKEST_CD_M2).ln()
        };
        Ok(Found {
            luminance_cd_m2: ((0..pixels).map(log).sum::<f64>() / pixels as f64).exp(),
            visible_shares: seen.objects.iter().map(|o| (o.id, o.visible_share)).collect(),
        })
    }
}

/// How windows of streets are chosen and labelled.
#[derive(Clone, Debug, PartialEq)]
pub struct StreetPlan {
    /// Seed of the streets.
    pub seed: u64,
    /// Time of day.
    pub light: Light,
    /// Traffic and people, of those in a busy town, 0..1.
    pub busy: f64,
    /// What is looked for.
    pub classes: Classes,
    /// The class of each surface by its number, where windows have maps of classes, see [`Classes::of_surfaces`].
    pub surfaces: Option<[u8; SurfaceClass::ALL.len()]>,
    /// Luminance that becomes 1 at the longest exposure, cd/m^2. Brighter streets are exposed for less.
    pub white_cd_m2: f64,
    /// Samples along a side of a pixel.
    pub samples: usize,
    /// Share of the windows that lie on an object.
    pub on_objects: f64,
    /// Least longer side of an object that counts, pixels.
    pub least_side_px: f64,
    /// Least share of an object that must be seen for it to count.
    pub least_visible: f64,
}

/// A window before a lens sees it: its street, its place there and its exposure. These are chosen in the view of a reference lens, so that cameras
/// that are compared look at the same objects in the same light. To choose costs about half as much as to see, and is done once for all lenses.
#[derive(Clone, Debug)]
pub struct PlacedWindow {
    list: List,
    street: StreetSettings,
    /// The geometric mean of the luminance of everything on the sensor, cd/m^2.
    luminance_cd_m2: f64,
    /// The objects of the street in the reference view.
    near: Vec<NearObject>,
    place: Place,
}

/// Where a window lies.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// Its middle is so far (rows and columns, pixels) from that of the object with this number.
    OnObject { id: u64, off: [f64; 2] },
    /// Its middle, as shares of the sensor's rows and columns.
    Anywhere([f64; 2]),
}

impl StreetPlan {
    /// Window `number` of a list as a lens sees it: a street of its own, at a place of the sensor that lies on an object or anywhere. It depends
    /// on the arguments alone. [`Self::placed`] and [`Self::seen`] say what the two views are for.
    pub fn window(
        &self,
        list: List,
        families: Families,
        number: u64,
        [view, reference]: [&StreetView; 2],
        crops: &CropPlan,
    ) -> Result<LabelledWindow, StreetError> {
        self.seen(&self.placed(list, families, number, reference, crops)?, [view, reference], crops)
    }

    /// Chooses window `number` of a list: the exposure, the object, and where it lies in the window, in the view of a `reference` lens. `crops` is
    /// how windows are cut in that view.
    pub fn placed(
        &self,
        list: List,
        families: Families,
        number: u64,
        reference: &StreetView,
        crops: &CropPlan,
    ) -> Result<PlacedWindow, StreetError> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed ^ 0x5743_1e7a_90b2_6d15);
        random.set_stream(match list {
            List::Training => 3 * number,
            List::Validation => 3 * number + 1,
            List::HeldOut => 3 * number + 2,
        });
        let settings = StreetSettings {
            sequence: random.next_u64(),
            moment: random.random_range(0..MOMENTS),
            light: self.light,
            busy: self.busy,
            families,
            lamp_colours: LampColours::default(),
        };
        let street = Street::new(&settings);
        let found = reference.look_through_finder(&street)?;
        let near = street.objects_near(&reference.sensor, &street.pose())?;
        let place = self.place(&near, &found, crops, &mut random);
        Ok(PlacedWindow { list, street: settings, luminance_cd_m2: found.luminance_cd_m2, near, place })
    }

    /// A chosen window as a lens sees it. Reference view and `crops` are those in which it was chosen; in another view windows
    /// have the size at which they show the same part of the street. A [magnified](StreetView::magnified) view keeps the size of its windows.
    /// It is also in the reference view that objects are large enough to count, so that the same objects count with a lens of another focal
    /// length. If such a lens no longer shows enough of the chosen object of a held-out
    /// window for it to count, it is [beside](Truth::beside) the picture: a narrower field misses what it does not show.
    pub fn seen(
        &self,
        placed: &PlacedWindow,
        [view, reference]: [&StreetView; 2],
        crops: &CropPlan,
    ) -> Result<LabelledWindow, StreetError> {
        let street = Street::new(&placed.street);
        let PlacedWindow { list, ref near, place, .. } = *placed;
        let (reference_crops, crops) = (crops, &crops.scaled(view.scale));
        // In the reference view a window that extends beyond the sensor is moved inside. A longer lens moves it at least as far. A shorter one, which
        // shows what lies beyond, has to move it too, to show the same.
        let is_shorter = crops.crop < reference_crops.crop;
        let on_sensor =
            |middle: [f64; 2]| if is_shorter { middle_inside(middle, reference_crops) } else { middle };
        // All of the chosen object as the lens images it, also where that is beside the sensor.
        let chosen = match place {
            Place::Anywhere(_) => None,
            Place::OnObject { id, .. } => street.box_of(&view.sensor, &street.pose(), id)?,
        };
        let at = match place {
            Place::Anywhere(shares) => {
                let there = on_sensor([0, 1].map(|i| shares[i] * sensor(crops)[i] as f64));
                // The same part of the street.
                let larger = view.scale * view.magnification;
                let middle = [0, 1].map(|i| {
                    let axis = 0.5 * sensor(crops)[i] as f64;
                    axis + larger * (there[i] - axis)
                });
                crop_around(middle, sensor(crops), crops.crop)
            }
            Place::OnObject { id, off } => {
                let from = near.iter().find(|object| object.id == id).map_or([0.0; 2], |o| middle(o.whole));
                let there = [0, 1].map(|i| from[i] + off[i]);
                let moved = on_sensor(there);
                let off = [0, 1].map(|i| view.scale * (off[i] + (moved[i] - there[i])));
                crop_off(crops, chosen.unwrap_or_default(), off)
            }
        };

        // See it with the border that the lens blurs light from.
        let see = |view: &StreetView, crops: &CropPlan, at: [usize; 2]| {
            let side = crops.window();
            let (row, column) = crops.exposed_at(at[0], at[1]);
            let (row, col) = (row as i64 - crops.margin as i64, column as i64 - crops.margin as i64);
            let window = Window { row, col, height: side, width: side };
            street.see(&view.sensor, &street.pose(), window, self.samples)
        };
        let seen = see(view, crops, at)?;
        let [longest, automatic] = [self.white_cd_m2 / view.light, placed.luminance_cd_m2 / MIDDLE_GRAY];
        let white = longest.max(automatic) as f32;
        let light = seen.planes.iter().map(|v| v / white);
        let mut truth = self.truth(&seen.objects, near, at, crops.crop);
        if let (List::HeldOut, Place::OnObject { id, off }, Some(whole)) = (list, place, chosen) {
            let is_enough = |whole: [f64; 4], crops: &CropPlan, at| {
                inside(&sensor_box(whole), at, crops.crop).is_some_and(|(_, share)| share >= LEAST_INSIDE)
            };
            let there = near.iter().find(|object| object.id == id).filter(|_| !is_enough(whole, crops, at));
            let class = there.and_then(|object| self.classes.of_street(object.kind, object.lamp));
            if let Some((object, class)) = there.zip(class) {
                // It counts only if it does in the reference view, whose picture is needed for this alone.
                let at_there = crop_off(reference_crops, object.whole, off);
                let is_visible =
                    |seen: &SeenObject| seen.id == id && seen.visible_share >= self.least_visible;
                if is_enough(object.whole, reference_crops, at_there)
                    && see(reference, reference_crops, at_there)?.objects.iter().any(is_visible)
                {
                    let bbox = sensor_box(whole).moved([-(at[1] as f32), -(at[0] as f32)]);
                    truth.beside.push(Object { bbox, class });
                }
            }
        }
        let window =
            LabelledWindow::new(crops.window(), light, at, truth).following_light(longest >= automatic);
        Ok(match &self.surfaces {
            Some(classes) => window.with_classes(class_map(&seen, classes, crops, at)),
            None => window,
        })
    }

    /// Draws a place on an object that counts, of every class as often as of the others, or anywhere.
    fn place(&self, near: &[NearObject], found: &Found, crops: &CropPlan, random: &mut ChaCha8Rng) -> Place {
        let sides = self.least_side_px..LARGEST_SHARE * crops.crop as f64;
        let counts = |object: &NearObject| {
            let middle = middle(object.whole);
            let is_on_sensor = (0..2).all(|i| (0.0..sensor(crops)[i] as f64).contains(&middle[i]));
            let share = found.visible_shares.get(&object.id);
            is_on_sensor
                && sides.contains(&longer_side(object.whole))
                && share.is_some_and(|share| *share >= self.least_visible)
        };
        let with_class =
            |object: &NearObject| Some((self.classes.of_street(object.kind, object.lamp)?, object.id));
        let counted = near.iter().filter(|object| counts(object)).filter_map(with_class);
        let is_on_object = random.random_bool(self.on_objects);
        let drawn = if is_on_object { drawn_by_class(counted, random) } else { None };
        let Some(id) = drawn else { return Place::Anywhere(random.random()) };
        Place::OnObject { id, off: off_middle(random.random(), crops.crop) }
    }

    /// The objects of a crop in its own pixels. Objects of a class that are too small, too hidden or cut off too much are ignored; how large
    /// they are is measured in the `reference` view, unless they are beside it.
    fn truth(&self, objects: &[SeenObject], reference: &[NearObject], at: [usize; 2], crop: usize) -> Truth {
        let mut truth = Truth::default();
        for object in objects {
            let Some(class) = self.classes.of_street(object.kind, object.lamp) else { continue };
            let Some((bbox, share)) = inside(&sensor_box(object.whole), at, crop) else { continue };
            let there = reference.iter().find(|near| near.id == object.id);
            let counts = longer_side(there.map_or(object.whole, |near| near.whole)) >= self.least_side_px
                && object.visible_share >= self.least_visible
                && share >= LEAST_INSIDE;
            match counts {
                true => truth.objects.push(Object { bbox, class }),
                // What cannot be seen at all is not there.
                false if object.visible_share > 0.0 => truth.ignored.push(Ignored::of_all(bbox)),
                false => {}
            }
        }
        truth
    }
}

/// The classes of the pixels of a crop, of which `seen` shows the window with its border.
fn class_map(
    seen: &Seen,
    classes: &[u8; SurfaceClass::ALL.len()],
    crops: &CropPlan,
    at: [usize; 2],
) -> ClassMap {
    let all = seen.classes.iter().map(|surface| classes[*surface as usize]).collect();
    let exposed = crops.exposed_at(at[0], at[1]);
    let first = [at[0] - exposed.0, at[1] - exposed.1].map(|inset| inset + crops.margin);
    ClassMap::new(seen.height, seen.width, all).part(first, crops.crop)
}

/// Rows and columns of the sensor.
fn sensor(crops: &CropPlan) -> [usize; 2] {
    [crops.sensor_rows, crops.sensor_columns]
}

/// The middle, row and column, of the crop around a place that lies inside the sensor.
fn middle_inside(middle: [f64; 2], crops: &CropPlan) -> [f64; 2] {
    let half = 0.5 * crops.crop as f64;
    [0, 1].map(|i| middle[i].clamp(half, (sensor(crops)[i] as f64 - half).max(half)))
}

/// First row and column of the crop whose middle is so far from that of a box.
fn crop_off(crops: &CropPlan, whole: [f64; 4], off: [f64; 2]) -> [usize; 2] {
    let middle = middle(whole);
    crop_around([0, 1].map(|i| middle[i] + off[i]), sensor(crops), crops.crop)
}

/// A box on the sensor.
fn sensor_box(whole: [f64; 4]) -> BBox {
    let [x1, y1, x2, y2] = whole.map(|v| v as f32);
    BBox::new(x1, y1, x2, y2)
}

/// Row and column of the middle of a box.
fn middle([x1, y1, x2, y2]: [f64; 4]) -> [f64; 2] {
    [0.5 * (y1 + y2), 0.5 * (x1 + x2)]
}

fn longer_side([x1, y1, x2, y2]: [f64; 4]) -> f64 {
    (x2 - x1).max(y2 - y1)
}
