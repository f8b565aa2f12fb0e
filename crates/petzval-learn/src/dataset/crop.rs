//! Crops: random windows of training photographs, and fixed places for held-out pictures, with their sensor positions.

use rand::RngExt;
use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

use super::{DatasetError, Photo};

/// Size of the training windows, and the sensor on which they are placed.
///
/// A photograph has one pixel per sensor pixel. The network receives `crop x crop` sensor pixels. The window of the
/// photograph extends `margin` pixels further on every side, because the lens blurs light from there into the crop. Where development
/// reads pixels around the crop, `surround` more of them are exposed on every side; at the border of the sensor, where there are none, as
/// many more on the other side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CropPlan {
    /// Side of the square that the network receives, pixels.
    pub crop: usize,
    /// Border of the window on every side, at least the kernel radius of the PSF, pixels.
    pub margin: usize,
    /// Pixels that are exposed around the crop on every side.
    pub surround: usize,
    /// Rows of the sensor.
    pub sensor_rows: usize,
    /// Columns of the sensor.
    pub sensor_columns: usize,
}

impl CropPlan {
    /// A crop on the 1920 x 1200 sensor.
    pub fn on_1920x1200(crop: usize, margin: usize) -> Self {
        Self { crop, margin, surround: 0, sensor_rows: 1200, sensor_columns: 1920 }
    }

    /// The same with a crop that is so many times as large (`by > 0`), as far as the sensor reaches. Its side changes by an even number of pixels,
    /// because crops of a colour mosaic have whole cells.
    pub fn scaled(&self, by: f64) -> Self {
        let more = 2.0 * (0.5 * (by - 1.0) * self.crop as f64).round();
        let most = self.sensor_rows.min(self.sensor_columns).saturating_sub(2 * self.surround);
        let most = most - (most.abs_diff(self.crop) % 2).min(most);
        Self { crop: ((self.crop as f64 + more) as usize).min(most), ..*self }
    }

    /// The same with the crop that a window of so many pixels along a side holds, see [`CropPlan::window`].
    pub fn of_window(&self, side: usize) -> Self {
        Self { crop: side.saturating_sub(2 * (self.surround + self.margin)), ..*self }
    }

    /// Side of the square that is exposed, `crop + 2 surround`, pixels.
    pub fn exposed(&self) -> usize {
        self.crop.saturating_add(self.surround.saturating_mul(2))
    }

    /// Side of the photograph window, `crop + 2 surround + 2 margin`, pixels.
    pub fn window(&self) -> usize {
        self.exposed().saturating_add(self.margin.saturating_mul(2))
    }

    /// First sensor row and column that are exposed for a crop at a row and column: the square around it, moved inside the sensor.
    pub fn exposed_at(&self, sensor_row: usize, sensor_column: usize) -> (usize, usize) {
        let start = |at: usize, sensor: usize| {
            at.saturating_sub(self.surround).min(sensor.saturating_sub(self.exposed()))
        };
        (start(sensor_row, self.sensor_rows), start(sensor_column, self.sensor_columns))
    }

    /// Checks that the sensor can hold the crop.
    pub fn check_sensor(&self) -> Result<(), DatasetError> {
        if self.crop == 0 || self.exposed() > self.sensor_rows.min(self.sensor_columns) {
            let (rows, columns) = (self.sensor_rows, self.sensor_columns);
            return Err(DatasetError::SensorTooSmall { rows, columns, crop: self.exposed() });
        }
        Ok(())
    }

    /// Checks that the sensor and every photograph can hold the crop. Fails on an empty list.
    pub fn check(&self, photos: &[Photo]) -> Result<(), DatasetError> {
        self.check_sensor()?;
        if photos.is_empty() {
            return Err(DatasetError::EmptyList { list: "training" });
        }
        photos.iter().try_for_each(|photo| photo.check_holds(self.window()))
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
    /// Whether the window is mirrored left to right.
    pub flip: bool,
    /// First sensor row of the crop (margin not included).
    pub sensor_row: usize,
    /// First sensor column of the crop (margin not included).
    pub sensor_column: usize,
}

/// Draws item `item` of step `step`: photograph, window, mirroring and sensor position, each uniformly distributed.
///
/// The result depends on the arguments alone, so a resumed run draws the same items as an uninterrupted one. The generator
/// is ChaCha8 keyed by `seed`; the step selects its stream and the item the place in the stream. The centre of the crop is
/// uniform over the whole sensor, and a crop that extends beyond the sensor is moved inside. A crop uniform over the
/// positions where it fits would hardly ever cover the sensor's corners.
pub fn training_crop(
    plan: &CropPlan,
    photos: &[Photo],
    seed: u64,
    step: u64,
    item: u32,
) -> Result<TrainingCrop, DatasetError> {
    plan.check(photos)?;

    // Give every item its own block of 64 words. It draws at most 11, apart from very rare rejections.
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(step);
    generator.set_word_pos(u128::from(item) * 64);

    let photo = generator.random_range(0..photos.len());
    let Photo { height, width, .. } = photos[photo];
    let window = plan.window();
    Ok(TrainingCrop {
        photo,
        row: generator.random_range(0..=height - window),
        column: generator.random_range(0..=width - window),
        flip: generator.random(),
        sensor_row: around(generator.random_range(0..plan.sensor_rows), plan.crop, plan.sensor_rows),
        sensor_column: around(generator.random_range(0..plan.sensor_columns), plan.crop, plan.sensor_columns),
    })
}

/// First pixel of a crop centred at `centre`, moved inside the sensor.
pub(super) fn around(centre: usize, crop: usize, sensor: usize) -> usize {
    centre.saturating_sub(crop / 2).min(sensor - crop)
}

/// A fixed place on the sensor at which held-out pictures are scored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOutPlacement {
    /// First sensor row of the crop.
    pub sensor_row: usize,
    /// First sensor column of the crop.
    pub sensor_column: usize,
    /// Distance of the crop centre from the sensor centre, relative to the outermost possible crop centre, 0..1.
    pub relative_field: f64,
}

/// Places on a grid of `per_side` x `per_side` over a quadrant of the sensor, sorted from its centre to its corner. Their
/// mean represents the picture area, over which training crops are spread.
///
/// Successive grid places are mirrored into the four quadrants in turn, so that they also differ in direction. `per_side` 1
/// gives the centre, 0 an empty list. Fails if the sensor cannot hold the crop.
pub fn held_out_placements(plan: &CropPlan, per_side: usize) -> Result<Vec<HeldOutPlacement>, DatasetError> {
    plan.check_sensor()?;
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
