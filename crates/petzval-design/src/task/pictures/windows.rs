//! Windows of photographs: at random for training and validation, at fixed places for scores.

use std::collections::BTreeMap;

use petzval_camera::render::Placement;
use petzval_camera::sensor::SensorModel;
use petzval_learn::dataset::{
    NamedPhoto, dead_leaves, held_out_placements, light_factors, relight, training_crop,
};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::Photographs;
use crate::camera::{Camera, Labels, Shot, crop_window};
use crate::cameras::Cameras;
use crate::error::DesignError;
use crate::experiment::{BUILT_IN_PHOTOS, Experiment};
use crate::run::hex;
use crate::run::input_list::BUILT_IN;
use crate::task::{HeldOut, PhotosLook, Remark, WindowInputs, Windows, in_batches, relative_field};

/// The number of the first validation window: beyond those of all steps, and of all that blocks learn besides.
const FIRST_VALIDATION: u64 = 1 << 42;

impl Windows for Photographs {
    fn training(&self, cameras: &Cameras, _: &Camera, step: u64) -> Result<Vec<Shot>, DesignError> {
        let (training, seed) = (&cameras.experiment.training, cameras.experiment.seed);
        // A window depends on its numbers alone, and a generated one takes milliseconds: they are made side by side.
        (0..training.batch as u32)
            .into_par_iter()
            .map(|item| {
                let mut shot = self.shot(&cameras.experiment, self.set.training(), step, item)?;
                if is_generated(shot.frame, training.dead_leaves) {
                    shot.scene = dead_leaves(self.training_crops.window(), seed, step, item)
                } else {
                    relight(&mut shot.scene, light_factors(training.relight_ev, seed, step, item));
                }
                Ok(shot)
            })
            .collect()
    }

    /// Photographs alone, as in scores.
    fn validation(&self, cameras: &Cameras, _: &Camera) -> Result<Vec<Vec<Shot>>, DesignError> {
        let experiment = &cameras.experiment;
        let batch = experiment.training.batch;
        let shot = |i: usize| {
            let (step, item) = (FIRST_VALIDATION + (i / batch) as u64, (i % batch) as u32);
            self.shot(experiment, self.set.validation(), step, item)
        };
        in_batches(experiment, experiment.validation.windows, shot)
    }

    /// Every photograph at every place.
    fn held_out(
        &self,
        cameras: &Cameras,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
    ) -> Result<Vec<HeldOut>, DesignError> {
        let crops = &self.scoring_crops;
        let places = held_out_placements(crops, cameras.experiment.scoring.places_per_side)?;
        let mut windows = Vec::new();
        let pictures =
            self.set.held_out().iter().flat_map(|photo| places.iter().map(move |place| (photo, place)));
        for (number, (photo, place)) in pictures.enumerate().filter(|(number, _)| is_chosen(*number)) {
            // The middle of the photograph, wherever it lands on the sensor: places differ by the lens alone.
            let (row, col) = crops.exposed_at(place.sensor_row, place.sensor_column);
            let (placement, window) = (Placement { row, col }, crops.window());
            let start = |whole: usize, inset: usize| {
                ((whole - crops.crop) / 2).saturating_sub(crops.margin + inset).min(whole - window)
            };
            let from_row = start(photo.image.height, place.sensor_row - row);
            let from_column = start(photo.image.width, place.sensor_column - col);
            let scene = photo.image.crop(from_row, from_column, window, window)?;
            let kept = Some(crop_window(crops, place.sensor_row, place.sensor_column));
            let labels = Labels::default();
            let shot = Shot { scene, placement, kept, frame: number as u64, labels, follows_light: true };
            let relative_field = relative_field(cameras, camera, &shot);
            windows.push(HeldOut { name: photo.name.clone(), sequence: None, relative_field, shot });
        }
        Ok(windows)
    }

    fn held_out_pictures(&self, experiment: &Experiment) -> [usize; 2] {
        [self.set.held_out().len(), experiment.scoring.places_per_side.pow(2)]
    }

    fn check_sensor(&self, experiment: &Experiment, sensor: &SensorModel) -> Result<(), DesignError> {
        self.check_colours(experiment, sensor)
    }

    fn photos_look(&self, cameras: &Cameras) -> Option<PhotosLook> {
        Some(self.against(&cameras.body.sensor))
    }

    fn inputs(&self, experiment: &Experiment, hash: &mut Sha256) -> Result<WindowInputs, DesignError> {
        self.add_to(hash);
        if experiment.photos != BUILT_IN_PHOTOS {
            let pictures = Some(self.files(&experiment.photos)?);
            return Ok(WindowInputs { pictures, ..WindowInputs::default() });
        }
        let mut own = Sha256::new();
        self.add_to(&mut own);
        let parts = BTreeMap::from([(BUILT_IN.to_owned(), hex(own))]);
        Ok(WindowInputs { parts, pictures: None })
    }

    fn remarks(&self) -> Vec<Remark> {
        self.as_remarks()
    }
}

impl Photographs {
    /// Item `item` of step `step`: a random window of a photograph at a random place of the sensor.
    fn shot(
        &self,
        experiment: &Experiment,
        photos: &[NamedPhoto],
        step: u64,
        item: u32,
    ) -> Result<Shot, DesignError> {
        let crops = &self.training_crops;
        let c = training_crop(crops, photos, experiment.seed, step, item)?;
        let window = crops.window();
        let (row, col) = crops.exposed_at(c.sensor_row, c.sensor_column);
        let mut scene = photos[c.photo].image.crop(c.row, c.column, window, window)?;
        if c.flip {
            mirror(&mut scene.data, window);
        }
        Ok(Shot {
            scene,
            placement: Placement { row, col },
            kept: Some(crop_window(crops, c.sensor_row, c.sensor_column)),
            frame: step * experiment.training.batch as u64 + u64::from(item),
            labels: Labels::default(),
            follows_light: true,
        })
    }
}

/// Whether a window of a run is a generated picture: evenly spread over the windows, so that their share is met at any time.
fn is_generated(window: u64, share: f64) -> bool {
    let before = |window: u64| (window as f64 * share).floor();
    before(window + 1) > before(window)
}

/// Mirrors every row of `width` values.
fn mirror(data: &mut [f32], width: usize) {
    data.chunks_exact_mut(width).for_each(<[f32]>::reverse);
}

#[cfg(test)]
mod tests {
    use super::is_generated;

    #[test]
    fn generated_windows_have_their_share_at_any_time() {
        for share in [0.0, 0.3, 1.0 / 3.0, 0.5, 1.0] {
            let mut count = 0;
            for window in 0..2000_u64 {
                count += u64::from(is_generated(window, share));
                assert!((count as f64 - share * (window + 1) as f64).abs() <= 1.0, "{share} {window}");
            }
        }
        let late = (0..1000).filter(|k| is_generated(1_000_000_000 + k, 0.3)).count();
        assert!((299..=301).contains(&late), "{late}");
    }
}
