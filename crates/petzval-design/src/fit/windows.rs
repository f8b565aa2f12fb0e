//! Windows that the photographs of an experiment can hold: wide PSFs need much of a photograph around each window.

use std::path::Path;

use petzval_camera::psf::PsfLayout;
use petzval_camera::render::kernel_radius;
use petzval_camera::sensor::SensorModel;
use petzval_files::stored_pictures;
use petzval_learn::dataset::LEAST_SCORED;
use rayon::prelude::*;

use crate::cameras::SURROUND;
use crate::error::{DesignError, Result};
use crate::experiment::{BUILT_IN_PHOTOS, Experiment, PicturesKey, PsfConfig};

/// Shortest side of the built-in photographs, pixels.
const SHORTEST: usize = 200;

/// Pixels around a window that blur and restoration bring into it.
pub(super) fn border(psf: &PsfConfig, sensor: &SensorModel) -> Result<usize> {
    let layout = PsfLayout {
        field_radius_mm: psf.plan(sensor, psf.pupil_cells)?.field_radius_mm,
        grid: psf.grid,
        pitch_um: psf.pitch_um,
    };
    let margin = kernel_radius(&psf.geometry(sensor), &layout)
        .map_err(|e| DesignError::misfit(Path::new(&sensor.name), &e, "name a smaller sensor"))?;
    Ok(margin + SURROUND)
}

/// The photographs that windows are taken of.
struct Photographs {
    /// What they are called.
    named: String,
    /// Shorter side, pixels, that all of the built-in ones have at least, and half of others.
    side: usize,
    /// What allows wider blur.
    hint: &'static str,
}

/// The photographs of an experiment; `None` if their sizes cannot be read, which a run refuses by itself. A few small ones are left out by a run, so that
/// the middle of them counts.
fn photographs(photos: &str) -> Option<Photographs> {
    if photos == BUILT_IN_PHOTOS {
        return Some(Photographs {
            named: format!("the built-in photographs, of {SHORTEST} pixels at least,"),
            side: SHORTEST,
            hint: "with larger photographs of your own, raise it again",
        });
    }
    let stored = stored_pictures(Path::new(photos)).ok()?;
    let sizes = stored.par_iter().filter_map(|picture| picture.size().ok());
    let mut sides: Vec<usize> = sizes.map(|[rows, columns]| rows.min(columns)).collect();
    sides.sort_unstable();
    let side = *sides.get(sides.len().saturating_sub(1) / 2)?;
    let named = format!("half of the photographs in {photos}, of {side} pixels at most,");
    Some(Photographs { named, side, hint: "larger ones hold more" })
}

/// Makes windows smaller, and if that is not enough the grid of the PSFs, so that the photographs of the experiment hold a window with all that blur
/// brings into it; returns what to say then.
pub(super) fn fit(
    experiment: &mut Experiment,
    pictures: PicturesKey,
    sensor: &SensorModel,
) -> Result<Vec<String>> {
    if pictures != PicturesKey::Photos {
        return Ok(Vec::new());
    }
    let Some(Photographs { named, side, hint }) = photographs(&experiment.photos) else {
        return Ok(Vec::new());
    };
    let room = |psf: &PsfConfig| -> Result<usize> {
        // Whole cells of a colour array.
        Ok(side.saturating_sub(2 * border(psf, sensor)?) / 2 * 2)
    };
    let mut notes = Vec::new();
    let before = experiment.psf.grid;
    while room(&experiment.psf)? < LEAST_SCORED && experiment.psf.grid > LEAST_SCORED {
        experiment.psf.grid = (experiment.psf.grid - experiment.psf.grid / 8) / 2 * 2;
    }
    if experiment.psf.grid != before {
        notes.push(format!(
            "psf.grid = {} in place of {before}: {named} hold no wider blur; {hint}",
            experiment.psf.grid
        ));
    }
    let most = room(&experiment.psf)?;
    let crops =
        [("training.crop", &mut experiment.training.crop), ("scoring.crop", &mut experiment.scoring.crop)];
    for (key, crop) in crops {
        if *crop > most {
            notes.push(format!("{key} = {most} in place of {crop}: {named} hold no larger window"));
            *crop = most;
        }
    }
    Ok(notes)
}

#[cfg(test)]
mod tests {
    use petzval_base::parameter::Parameters;
    use petzval_camera::image::LinearImage;

    use super::*;
    use crate::experiment::ScoringConfig;

    #[test]
    fn the_least_window_is_that_of_the_table() {
        let table = ScoringConfig::table();
        let crop = table.parameters.iter().find(|parameter| parameter.name == "crop").unwrap();
        assert_eq!(crop.min, LEAST_SCORED as f64);
    }

    #[test]
    fn the_built_in_photographs_are_no_smaller() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../petzval-data/data/photos");
        let pictures = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let pictures = pictures.filter(|path| path.extension().is_some_and(|ending| ending == "png"));
        let sides = pictures.map(|path| {
            let (width, height) = petzval_files::picture_size(&path).unwrap();
            width.min(height) as usize
        });
        assert_eq!(sides.min(), Some(SHORTEST));
    }

    #[test]
    fn windows_shrink_before_the_grid_does() {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        let sensor = petzval_files::parse_sensor(text).unwrap();
        let mut usual = Experiment::default();
        assert!(fit(&mut usual, PicturesKey::Photos, &sensor).unwrap().is_empty());
        assert_eq!(usual, Experiment::default());
        for (grid, pitch_um, keeps_grid) in [(256, 1.5, true), (512, 2.0, false)] {
            let mut experiment = Experiment::default();
            (experiment.psf.grid, experiment.psf.pitch_um) = (grid, pitch_um);
            assert!(!fit(&mut experiment, PicturesKey::Photos, &sensor).unwrap().is_empty());
            assert_eq!(experiment.psf.grid == grid, keeps_grid);
            assert!(experiment.scoring.crop >= LEAST_SCORED && experiment.scoring.crop < 120);
            assert!(experiment.psf.grid.is_multiple_of(2));
        }
    }

    /// A grid that the built-in photographs cannot hold stays with larger photographs of the user's own; the few small ones of a folder do not count.
    #[test]
    fn windows_fit_the_photographs_of_the_experiment() {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        let sensor = petzval_files::parse_sensor(text).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, height: usize, width: usize| {
            let gray = LinearImage::filled(3, height, width, 0.5);
            petzval_files::save_png(&gray, &folder.path().join(name)).unwrap();
        };
        write("a.png", 768, 900);
        write("b.png", 900, 768);
        write("c.png", 64, 64);
        let own = Experiment {
            photos: folder.path().to_str().unwrap().to_owned(),
            psf: PsfConfig { grid: 512, pitch_um: 2.0, ..Experiment::default().psf },
            ..Experiment::default()
        };
        let mut fitted = own.clone();
        assert_eq!(fit(&mut fitted, PicturesKey::Photos, &sensor).unwrap(), Vec::<String>::new());
        assert_eq!(fitted, own);

        // As small as the built-in ones: the same grid, with words about the folder.
        for name in ["a.png", "b.png"] {
            write(name, SHORTEST, 300);
        }
        let notes = fit(&mut fitted, PicturesKey::Photos, &sensor).unwrap().join("; ");
        let mut built_in = Experiment { photos: BUILT_IN_PHOTOS.to_owned(), ..own.clone() };
        fit(&mut built_in, PicturesKey::Photos, &sensor).unwrap();
        assert_eq!(fitted.psf.grid, built_in.psf.grid);
        assert_eq!(fitted.scoring.crop, built_in.scoring.crop);
        assert!(notes.contains(&own.photos) && !notes.contains("built-in"), "{notes}");

        // What has no pictures is refused by the run itself.
        let mut missing = Experiment { photos: "nowhere".to_owned(), ..own.clone() };
        assert!(fit(&mut missing, PicturesKey::Photos, &sensor).unwrap().is_empty());
        assert_eq!(missing.psf, own.psf);
    }
}
