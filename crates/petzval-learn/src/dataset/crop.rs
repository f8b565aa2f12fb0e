//! Which window of which picture falls where on the sensor.

use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use super::{DatasetError, NamedPhoto};

/// How training windows are cut: their size and the sensor they are placed on.
///
/// A photograph is one scene pixel per sensor pixel. The network sees `crop x crop` sensor pixels; the photograph must
/// reach `margin` pixels further on every side, so that light blurred in from outside the crop is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CropPlan {
    /// Side of the square the network sees, pixels.
    pub crop: usize,
    /// Extra photograph on every side for the PSF's reach, pixels.
    pub margin: usize,
    /// Rows of the sensor.
    pub sensor_rows: usize,
    /// Columns of the sensor.
    pub sensor_columns: usize,
}

impl CropPlan {
    /// A crop on the 1920 x 1200 sensor.
    pub fn on_1920x1200(crop: usize, margin: usize) -> Self {
        Self { crop, margin, sensor_rows: 1200, sensor_columns: 1920 }
    }

    /// Side of the photograph window, `crop + 2 margin`, pixels.
    pub fn window(&self) -> usize {
        self.crop.saturating_add(self.margin.saturating_mul(2))
    }

    /// Refuses a crop that the sensor or one of the photographs cannot hold.
    pub fn check(&self, photos: &[NamedPhoto]) -> Result<(), DatasetError> {
        if self.crop == 0 || self.crop > self.sensor_rows || self.crop > self.sensor_columns {
            return Err(DatasetError::SensorTooSmall {
                rows: self.sensor_rows,
                columns: self.sensor_columns,
                crop: self.crop,
            });
        }
        if photos.is_empty() {
            return Err(DatasetError::EmptyList { list: "training" });
        }
        let needed = self.window();
        match photos.iter().find(|p| p.image.height < needed || p.image.width < needed) {
            None => Ok(()),
            Some(small) => Err(DatasetError::PhotoTooSmall {
                name: small.name.clone(),
                height: small.image.height,
                width: small.image.width,
                needed,
            }),
        }
    }
}

/// One training item: a window of a photograph and its place on the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TrainingCrop {
    /// Index into the training photographs.
    pub photo: usize,
    /// First row of the window (margin included) in the photograph.
    pub row: usize,
    /// First column of the window (margin included) in the photograph.
    pub column: usize,
    /// Mirror the window left to right.
    pub flip: bool,
    /// First sensor row of the crop (margin not included).
    pub sensor_row: usize,
    /// First sensor column of the crop (margin not included).
    pub sensor_column: usize,
}

/// Draws item `item` of step `step`: a uniform photograph, window, mirror image and sensor position.
///
/// A pure function of its arguments: the generator is ChaCha8 keyed by `seed`, with the step as its stream and the item
/// as its place in the stream, so a resumed run draws what an uninterrupted one does. The crop's centre is uniform over
/// the whole sensor, and a crop that would stick out is moved inside: were its corner uniform over the places where it
/// fits, the sensor's own corners would hardly ever be seen.
pub fn training_crop(
    plan: &CropPlan,
    photos: &[NamedPhoto],
    seed: u64,
    step: u64,
    item: u32,
) -> Result<TrainingCrop, DatasetError> {
    plan.check(photos)?;

    // Give every item its own 64-word block: it draws at most 11 words but for rejections, which are very rare.
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(step);
    generator.set_word_pos(u128::from(item) * 64);

    let photo = generator.random_range(0..photos.len());
    let image = &photos[photo].image;
    let window = plan.window();
    Ok(TrainingCrop {
        photo,
        row: generator.random_range(0..=image.height - window),
        column: generator.random_range(0..=image.width - window),
        flip: generator.random(),
        sensor_row: around(generator.random_range(0..plan.sensor_rows), plan.crop, plan.sensor_rows),
        sensor_column: around(generator.random_range(0..plan.sensor_columns), plan.crop, plan.sensor_columns),
    })
}

/// First pixel of a crop around `centre`, moved inside the sensor.
fn around(centre: usize, crop: usize, sensor: usize) -> usize {
    centre.saturating_sub(crop / 2).min(sensor - crop)
}

/// A fixed place on the sensor where held-out pictures are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOutPlacement {
    /// First sensor row of the crop.
    pub sensor_row: usize,
    /// First sensor column of the crop.
    pub sensor_column: usize,
    /// Distance of the crop centre from the sensor centre over the distance of the outermost possible crop centre, 0..1.
    pub relative_field: f64,
}

/// Places on a grid of `per_side` x `per_side` over a quadrant of the sensor, from its centre (first) to its corner
/// (last): their mean stands for the picture area, as training crops do, which lie anywhere.
///
/// Successive places go to the four quadrants in turn, so that they also differ in direction. `per_side` 1 gives the
/// centre; 0 gives none.
pub fn held_out_placements(plan: &CropPlan, per_side: usize) -> Result<Vec<HeldOutPlacement>, DatasetError> {
    if plan.crop == 0 || plan.crop > plan.sensor_rows || plan.crop > plan.sensor_columns {
        return Err(DatasetError::SensorTooSmall {
            rows: plan.sensor_rows,
            columns: plan.sensor_columns,
            crop: plan.crop,
        });
    }
    let quadrants = [(1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0)];
    let reach_rows = (plan.sensor_rows - plan.crop) as f64 / 2.0;
    let reach_columns = (plan.sensor_columns - plan.crop) as f64 / 2.0;
    let share = |i: usize| if per_side > 1 { i as f64 / (per_side - 1) as f64 } else { 0.0 };
    let mut places: Vec<HeldOutPlacement> = (0..per_side * per_side)
        .map(|i| {
            let (down, right) = (share(i / per_side), share(i % per_side));
            let reach = reach_rows.hypot(reach_columns);
            let relative_field =
                if reach > 0.0 { (down * reach_rows).hypot(right * reach_columns) / reach } else { 0.0 };
            let (sign_down, sign_right) = quadrants[i % 4];
            HeldOutPlacement {
                sensor_row: (reach_rows * (1.0 + sign_down * down)).round() as usize,
                sensor_column: (reach_columns * (1.0 + sign_right * right)).round() as usize,
                relative_field,
            }
        })
        .collect();
    places.sort_by(|a, b| a.relative_field.total_cmp(&b.relative_field));
    Ok(places)
}
