//! What cameras take: windows of training and validation pictures, and held-out photographs at fixed places.

use std::ops::Range;

use petzval_camera::render::Placement;
use petzval_learn::dataset::{
    NamedPhoto, dead_leaves, held_out_placements, light_factors, relight, training_crop,
};
use petzval_learn::detection::Truth;
use rayon::prelude::*;

use crate::camera::{Camera, Shot, crop_window};
use crate::error::DesignError;
use crate::scenes::{Eye, List, Scenes};
use crate::setup::Setup;

/// The number of the first validation window: beyond those of all steps, and of all that blocks learn besides.
const FIRST_VALIDATION: u64 = 1 << 42;

/// The training windows of a step: the same for every variant, but that streets are seen through the chief rays of the camera's lens.
pub fn training_shots(setup: &Setup, camera: &Camera, step: u64) -> Result<Vec<Shot>, DesignError> {
    let training = &setup.experiment.training;
    if let Some(scenes) = &setup.scenes {
        return scene_shots(setup, scenes, Eye::of(camera), step);
    }
    // A window depends on its numbers alone, and a generated one takes milliseconds: they are made side by side.
    (0..training.batch as u32)
        .into_par_iter()
        .map(|item| {
            let seed = setup.experiment.seed;
            let mut shot = shot_of(setup, setup.photos.training(), step, item)?;
            if is_generated(shot.frame, training.dead_leaves) {
                shot.scene = dead_leaves(setup.training_crops.window(), seed, step, item)
            } else {
                relight(&mut shot.scene, light_factors(training.relight_ev, seed, step, item));
            }
            Ok(shot)
        })
        .collect()
}

/// The training windows of a step as a camera would see them if its lens were another one like it, whose image is so many times as large. Only
/// streets change by that.
pub fn magnified_shots(setup: &Setup, camera: &Camera, step: u64, by: f64) -> Result<Vec<Shot>, DesignError> {
    match &setup.scenes {
        Some(scenes) => scene_shots(setup, scenes, Eye::of(camera).magnified(by), step),
        None => training_shots(setup, camera, step),
    }
}

fn scene_shots(setup: &Setup, scenes: &Scenes, eye: Eye, step: u64) -> Result<Vec<Shot>, DesignError> {
    items_of(setup, step).map(|item| scenes.training_shot(eye, item)).collect()
}

/// The windows of a step by their numbers in the run.
pub fn items_of(setup: &Setup, step: u64) -> Range<u64> {
    let batch = setup.experiment.training.batch as u64;
    step * batch..(step + 1) * batch
}

/// The windows of every validation, in batches: photographs alone, as in scores.
pub fn validation_shots(setup: &Setup, camera: &Camera) -> Result<Vec<Vec<Shot>>, DesignError> {
    let (batch, windows) = (setup.experiment.training.batch, setup.experiment.validation.windows);
    let shot = |i: usize| {
        if let Some(scenes) = &setup.scenes {
            return scenes.shot(Eye::of(camera), List::Validation, i as u64);
        }
        let (step, item) = (FIRST_VALIDATION + (i / batch) as u64, (i % batch) as u32);
        shot_of(setup, setup.photos.validation(), step, item)
    };
    let starts = (0..windows).step_by(batch);
    starts.map(|first| (first..windows.min(first + batch)).map(shot).collect()).collect()
}

/// Item `item` of step `step`: a random window of a photograph at a random place of the sensor.
fn shot_of(setup: &Setup, photos: &[NamedPhoto], step: u64, item: u32) -> Result<Shot, DesignError> {
    let crops = &setup.training_crops;
    let c = training_crop(crops, photos, setup.experiment.seed, step, item)?;
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
        frame: step * setup.experiment.training.batch as u64 + u64::from(item),
        truth: Truth::default(),
        follows_light: true,
    })
}

/// A held-out window.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Name of its photograph or scene.
    pub name: String,
    /// The film that it is of, if there are others of it.
    pub sequence: Option<String>,
    /// Distance of its middle from the axis, over that of the sensor's corner.
    pub relative_field: f64,
    /// The window.
    pub shot: Shot,
}

/// Those of the held-out windows that are chosen by their number. They are every photograph at every place, or each of a street of its own.
pub fn held_out_shots(
    setup: &Setup,
    camera: &Camera,
    is_chosen: &dyn Fn(usize) -> bool,
) -> Result<Vec<HeldOut>, DesignError> {
    if let Some(scenes) = &setup.scenes {
        let shot = |i: usize| {
            let shot = scenes.shot(Eye::of(camera), List::HeldOut, i as u64)?;
            Ok(HeldOut {
                name: scenes.name(List::HeldOut, i as u64),
                sequence: scenes.sequence(List::HeldOut, i as u64).map(str::to_owned),
                relative_field: relative_field(setup, camera, &shot),
                shot,
            })
        };
        return (0..setup.experiment.street.held_out).filter(|i| is_chosen(*i)).map(shot).collect();
    }
    let places = held_out_placements(&setup.scoring_crops, setup.experiment.scoring.places_per_side)?;
    let crops = &setup.scoring_crops;
    let mut shots = Vec::new();
    let pictures =
        setup.photos.held_out().iter().flat_map(|photo| places.iter().map(move |place| (photo, place)));
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
        let kept = crop_window(crops, place.sensor_row, place.sensor_column);
        let frame = number as u64;
        let shot =
            Shot { scene, placement, kept: Some(kept), frame, truth: Truth::default(), follows_light: true };
        let relative_field = relative_field(setup, camera, &shot);
        shots.push(HeldOut { name: photo.name.clone(), sequence: None, relative_field, shot });
    }
    Ok(shots)
}

/// Distance of the middle of a shot's window from the axis, over that of the sensor's corner.
fn relative_field(setup: &Setup, camera: &Camera, shot: &Shot) -> f64 {
    let kept = camera.kept(shot);
    let middle = [kept.placement.row + kept.height / 2, kept.placement.col + kept.width / 2];
    camera.body().geometry.radius_mm(middle[0], middle[1]) / setup.corner_mm()
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
