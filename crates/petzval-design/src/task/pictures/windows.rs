//! Windows of photographs: at random for training and validation, at fixed places for scores.

use std::collections::BTreeMap;

use petzval_camera::render::Placement;
use petzval_camera::sensor::SensorModel;
use petzval_learn::dataset::{FirstReads, List, dead_leaves, held_out_placements, light_factors, relight};
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::Photographs;
use super::ahead::Item;
use crate::camera::{Camera, Labels, Shot, crop_window};
use crate::cameras::Cameras;
use crate::error::Result;
use crate::experiment::{BUILT_IN_PHOTOS, Experiment};
use crate::run::hex;
use crate::run::input_list::BUILT_IN;
use crate::task::{Content, HeldOut, PhotosLook, Remark, WindowInputs, Windows, in_batches, relative_field};

/// The number of the first validation window: beyond those of all steps, and of all that blocks learn besides.
const FIRST_VALIDATION: u64 = 1 << 42;

impl Windows for Photographs {
    fn training(&self, cameras: &Cameras, _: &Camera, step: u64) -> Result<Vec<Shot>> {
        let (training, seed) = (&cameras.experiment.training, cameras.experiment.seed);
        let item = |item: u32| Item { seed, step, item, batch: training.batch };
        let is_generated = |item: &Item| is_generated(item.frame(), training.dead_leaves);
        let items: Vec<Item> = (0..training.batch as u32).map(item).collect();
        // Windows in work are waited for here, and not by the threads below.
        let ready: Vec<Option<Shot>> = items.iter().map(|item| self.ahead.take(item)).collect();
        // A window depends on its numbers alone, and a generated one takes milliseconds: they are made side by side.
        let shots = ready.into_par_iter().zip(&items).map(|(ready, item)| {
            if is_generated(item) {
                let scene = dead_leaves(self.source.crops.window(), seed, step, item.item);
                return self.source.shot_of(item, List::Training, |_| Ok(scene));
            }
            let mut shot = ready.map_or_else(|| self.source.shot(item, List::Training), Ok)?;
            relight(&mut shot.scene, light_factors(training.relight_ev, seed, step, item.item));
            Ok(shot)
        });
        let shots = shots.collect::<Result<Vec<_>>>();
        let next = (step + 1..).take(self.ahead.steps());
        let next = next.flat_map(|step| items.iter().map(move |item| Item { step, ..*item }));
        self.ahead.want(next.filter(|item| !is_generated(item)));
        shots
    }

    /// Photographs alone, as in scores.
    fn validation(&self, cameras: &Cameras, _: &Camera) -> Result<Vec<Vec<Shot>>> {
        let experiment = &cameras.experiment;
        let batch = experiment.training.batch;
        let shot = |i: usize| {
            let (step, item) = (FIRST_VALIDATION + (i / batch) as u64, (i % batch) as u32);
            self.source.shot(&Item { seed: experiment.seed, step, item, batch }, List::Validation)
        };
        in_batches(experiment, experiment.validation.windows, shot)
    }

    /// Every photograph at every place.
    fn held_out(
        &self,
        cameras: &Cameras,
        camera: &Camera,
        is_chosen: &dyn Fn(usize) -> bool,
    ) -> Result<Vec<HeldOut>> {
        let crops = &self.scoring_crops;
        let places = held_out_placements(crops, cameras.experiment.scoring.places_per_side)?;
        let photos = self.set().held_out();
        let window_of = |number: usize| {
            let (photo, place) = (&photos[number / places.len()], &places[number % places.len()]);
            let light = self.set().light(photo)?;
            // The middle of the photograph, wherever it lands on the sensor: places differ by the lens alone.
            let (row, col) = crops.exposed_at(place.sensor_row, place.sensor_column);
            let (placement, window) = (Placement { row, col }, crops.window());
            let start = |whole: usize, inset: usize| {
                ((whole - crops.crop) / 2).saturating_sub(crops.margin + inset).min(whole - window)
            };
            let from_row = start(light.height, place.sensor_row - row);
            let from_column = start(light.width, place.sensor_column - col);
            let scene = light.crop(from_row, from_column, window, window)?;
            let kept = Some(crop_window(crops, place.sensor_row, place.sensor_column));
            let labels = Labels::default();
            let shot = Shot { scene, placement, kept, frame: number as u64, labels, follows_light: true };
            let relative_field = relative_field(cameras, camera, &shot);
            Ok(HeldOut { name: photo.name.clone(), sequence: None, relative_field, shot })
        };
        (0..photos.len() * places.len()).filter(|number| is_chosen(*number)).map(window_of).collect()
    }

    fn held_out_pictures(&self, experiment: &Experiment) -> [usize; 2] {
        [self.set().held_out().len(), experiment.scoring.places_per_side.pow(2)]
    }

    fn check_sensor(&self, experiment: &Experiment, sensor: &SensorModel) -> Result<()> {
        self.check_colours(experiment, sensor)
    }

    fn photos_look(&self, cameras: &Cameras) -> Option<PhotosLook> {
        Some(self.against(&cameras.body.sensor))
    }

    fn inputs(&self, experiment: &Experiment, content: Content, hash: &mut Sha256) -> Result<WindowInputs> {
        if experiment.photos != BUILT_IN_PHOTOS {
            let are_read = content == Content::All || !self.are_read_later();
            let pictures = self.files(&experiment.photos, are_read)?;
            if are_read {
                self.add_to(hash)?;
            } else {
                pictures.add_names_to(hash);
            }
            return Ok(WindowInputs { pictures: Some(pictures), ..WindowInputs::default() });
        }
        self.add_to(hash)?;
        let mut own = Sha256::new();
        self.add_to(&mut own)?;
        let parts = BTreeMap::from([(BUILT_IN.to_owned(), hex(own))]);
        Ok(WindowInputs { parts, pictures: None })
    }

    fn first_reads(&self) -> Option<&FirstReads> {
        self.set().first_reads()
    }

    fn remarks(&self) -> Vec<Remark> {
        self.as_remarks()
    }
}

/// Whether a window of a run is a generated picture: evenly spread over the windows, so that their share is met at any time.
fn is_generated(window: u64, share: f64) -> bool {
    let before = |window: u64| (window as f64 * share).floor();
    before(window + 1) > before(window)
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
