//! Windows of photographs for training, made some steps ahead.

use std::sync::Arc;

use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::Placement;
use petzval_learn::dataset::{CropPlan, List, PhotoSet, TrainingCrop, training_crop};

use crate::ahead::Ahead;
use crate::camera::{Labels, Shot, crop_window};
use crate::error::Result;

/// Most steps whose windows are made ahead.
const MOST_STEPS: u64 = 8;

/// Most threads that read photographs.
const MOST_THREADS: usize = 4;

/// Photographs, and how training windows of them are cut.
pub struct TrainingPhotos {
    /// The photographs.
    pub set: PhotoSet,
    /// How windows are cut.
    pub crops: CropPlan,
}

/// What decides a window before its light is changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Item {
    /// Seed of the run.
    pub seed: u64,
    /// Number of the batch.
    pub step: u64,
    /// Number in the batch.
    pub item: u32,
    /// Windows of a batch.
    pub batch: usize,
}

impl Item {
    /// The number of the window in the run.
    pub fn frame(&self) -> u64 {
        self.step * self.batch as u64 + u64::from(self.item)
    }
}

impl TrainingPhotos {
    /// A random window of a photograph of a list at a random place of the sensor.
    pub(super) fn shot(&self, item: &Item, list: List) -> Result<Shot> {
        self.shot_of(item, list, |c| {
            let light = self.set.light(&self.set.list(list)[c.photo])?;
            let window = self.crops.window();
            let mut scene = light.crop(c.row, c.column, window, window)?;
            if c.flip {
                mirror(&mut scene.data, window);
            }
            Ok(scene)
        })
    }

    /// The same with another scene at its place.
    pub(super) fn shot_of(
        &self,
        item: &Item,
        list: List,
        scene: impl FnOnce(&TrainingCrop) -> Result<LinearImage>,
    ) -> Result<Shot> {
        let crops = &self.crops;
        let c = training_crop(crops, self.set.list(list), item.seed, item.step, item.item)?;
        let (row, col) = crops.exposed_at(c.sensor_row, c.sensor_column);
        Ok(Shot {
            scene: scene(&c)?,
            placement: Placement { row, col },
            kept: Some(crop_window(crops, c.sensor_row, c.sensor_column)),
            frame: item.frame(),
            labels: Labels::default(),
            follows_light: true,
        })
    }
}

/// Mirrors every row of `width` values.
fn mirror(data: &mut [f32], width: usize) {
    data.chunks_exact_mut(width).for_each(<[f32]>::reverse);
}

/// The training windows of the next steps, made beside the steps where photographs are not all in memory.
pub(super) struct PhotosAhead {
    ahead: Ahead<Item, Shot>,
    steps: u64,
}

impl PhotosAhead {
    /// Windows for batches of a size, which take at most so many bytes.
    pub fn new(source: &Arc<TrainingPhotos>, batch: usize, most_bytes: u64) -> Self {
        let window = source.crops.window();
        let bytes = (size_of::<f32>() * CHANNELS * window * window * batch) as u64;
        // Two blocks that take turns follow two sequences of batches.
        let steps = (most_bytes / (2 * bytes.max(1))).clamp(1, MOST_STEPS);
        let most = 2 * steps as usize * batch;
        let threads = if source.set.keeps_all() { 0 } else { threads() };
        let source = source.clone();
        let make = move |item: &Item| source.shot(item, List::Training).ok();
        Self { ahead: Ahead::new(threads, most, make), steps }
    }

    /// Steps whose windows are made ahead.
    pub fn steps(&self) -> usize {
        if self.ahead.is_at_work() { self.steps as usize } else { 0 }
    }

    /// Lets windows be made.
    pub fn want(&self, items: impl IntoIterator<Item = Item>) {
        self.ahead.want(items);
    }

    /// A window, if it was made or is in work.
    pub fn take(&self, item: &Item) -> Option<Shot> {
        self.ahead.take(item)
    }
}

/// Threads that read beside the step: none where the run has one thread.
fn threads() -> usize {
    (rayon::current_num_threads() / 2).min(MOST_THREADS)
}
