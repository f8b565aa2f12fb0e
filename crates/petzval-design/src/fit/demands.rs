//! What a run of an experiment takes, as far as it is known before the first step, and how large photographs are against its sensor.

use std::collections::BTreeMap;

use petzval_base::{FileError, counted};
use petzval_camera::sensor::SensorModel;
use petzval_files::load_image_bytes;
use serde::Deserialize;

use super::sensor::megapixels;
use super::windows::border;
use crate::assets::Assets;
use crate::error::{DesignError, Result};
use crate::experiment::{BUILT_IN_PHOTOS, Experiment, PicturesKey};
use crate::first_look::{Planned, planned, steps_in_words};
use crate::task::enlarged_by;

/// Memory of `simulate` for each pixel of a whole frame, bytes, measured.
const FRAME_BYTES_A_PIXEL: f64 = 150.0;

/// What to say of an experiment before its first run, one line each. Ends with [`DesignError::Stopped`] before the next photograph once the flag of
/// `assets` is set.
pub fn demands(
    experiment: &Experiment,
    pictures: PicturesKey,
    sensor: &SensorModel,
    assets: &Assets,
) -> Result<Vec<String>> {
    let own = pictures != PicturesKey::Photos || experiment.photos != BUILT_IN_PHOTOS;
    let photos = if own { None } else { enlarged_photos(sensor, assets)? };
    let cameras: Vec<Planned> = experiment.variants().iter().map(planned).collect();
    let steps = format!("a run takes {}", steps_in_words(&cameras));
    Ok(photos.into_iter().chain([steps, work(experiment, sensor)?, whole_frame(sensor)]).collect())
}

/// A built-in photograph in the list of all.
#[derive(Deserialize)]
struct Photo {
    file: String,
}

/// How much a whole frame of the sensor enlarges the built-in photographs; `None` if it does not.
fn enlarged_photos(sensor: &SensorModel, assets: &Assets) -> Result<Option<String>> {
    let list = assets.text("photograph list", "photos", "photos")?;
    let list: BTreeMap<String, Vec<Photo>> = toml::from_str(&list.text)
        .map_err(|e| DesignError::input(&list.path)(FileError::from_toml(&list.text, &e)))?;
    let mut factors = Vec::new();
    for Photo { file } in list.values().flatten() {
        assets.cancel().check()?;
        let picture = load_image_bytes(assets.bytes(&format!("photos/{file}"))?, file)?.light;
        factors.push(enlarged_by(sensor, (picture.height, picture.width)));
    }
    let enlarged = factors.iter().filter(|by| **by > 1.0).count();
    let most = factors.iter().copied().fold(1.0, f64::max);
    Ok((enlarged > 0).then(|| {
        format!(
            "photographs: a whole frame of {} enlarges {enlarged} of the {} built-in ones, up to {most:.1} times; the windows of a run are not enlarged",
            megapixels(sensor),
            factors.len()
        )
    }))
}

/// What steps work on, which decides their time.
fn work(experiment: &Experiment, sensor: &SensorModel) -> Result<String> {
    let psf = &experiment.psf;
    let window = experiment.training.crop + 2 * border(psf, sensor)?;
    let pixels = window.pow(2) as f64 / experiment.training.crop.pow(2) as f64;
    Ok(format!(
        "time goes into {} a network step, of {} pixels a side and {window} with what blur brings into them ({pixels:.1} times the pixels), and into \
         the PSFs of lens steps: {} fields x 3 colours on {} x {} cells; neither grows with the number of the sensor's pixels. The first steps show how \
         long they take on this machine: `petzval design` then prints the time that is left",
        counted(experiment.training.batch, "window"),
        experiment.training.crop,
        psf.fields,
        psf.grid,
        psf.grid
    ))
}

/// The memory of a whole frame.
fn whole_frame(sensor: &SensorModel) -> String {
    let gigabytes = 1e-9 * FRAME_BYTES_A_PIXEL * (sensor.height * sensor.width) as f64;
    format!(
        "`petzval simulate` takes about {gigabytes:.1} GB of memory for a whole frame of {}",
        megapixels(sensor)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_and_windows_follow_from_the_sensor_and_the_experiment() {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        let sensor = petzval_files::parse_sensor(text).unwrap();
        // 2.304 million pixels of 150 bytes.
        assert!(whole_frame(&sensor).contains("0.3 GB") && whole_frame(&sensor).contains("2.3 megapixels"));
        // A grid of 128 um reaches 64 um, 11 pixels of 5.86 um, to each side.
        let mut experiment = Experiment::default();
        (experiment.psf.grid, experiment.psf.pitch_um) = (128, 1.0);
        (experiment.training.crop, experiment.training.batch) = (100, 4);
        let said = work(&experiment, &sensor).unwrap();
        assert!(said.contains("4 windows a network step, of 100 pixels a side and 1"), "{said}");
        assert!(said.contains("on 128 x 128 cells"), "{said}");
    }
}
