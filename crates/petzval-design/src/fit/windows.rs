//! Windows of photographs that the built-in ones can hold: wide PSFs need much of a photograph around each window.

use std::path::Path;

use petzval_camera::psf::PsfLayout;
use petzval_camera::render::kernel_radius;
use petzval_camera::sensor::SensorModel;

use crate::cameras::SURROUND;
use crate::error::DesignError;
use crate::experiment::{BUILT_IN_PHOTOS, Experiment, PicturesKey, PsfConfig};

/// Shortest side of the built-in photographs, pixels.
const SHORTEST: usize = 200;

/// Smallest windows that are trained on and scored, pixels: LPIPS needs as many.
const LEAST: usize = 64;

/// Pixels around a window that blur and restoration bring into it.
pub(super) fn border(psf: &PsfConfig, sensor: &SensorModel) -> Result<usize, DesignError> {
    let layout = PsfLayout {
        field_radius_mm: psf.plan(sensor, psf.pupil_cells)?.field_radius_mm,
        grid: psf.grid,
        pitch_um: psf.pitch_um,
    };
    let margin = kernel_radius(&psf.geometry(sensor), &layout)
        .map_err(|e| DesignError::misfit(Path::new(&sensor.name), &e, "name a smaller sensor"))?;
    Ok(margin + SURROUND)
}

/// Makes windows smaller, and if that is not enough the grid of the PSFs, so that the built-in photographs hold a window with all that blur brings
/// into it; returns what to say then.
pub(super) fn fit(
    experiment: &mut Experiment,
    pictures: PicturesKey,
    sensor: &SensorModel,
) -> Result<Vec<String>, DesignError> {
    if pictures != PicturesKey::Photos || experiment.photos != BUILT_IN_PHOTOS {
        return Ok(Vec::new());
    }
    let room = |psf: &PsfConfig| -> Result<usize, DesignError> {
        // Whole cells of a colour array.
        Ok(SHORTEST.saturating_sub(2 * border(psf, sensor)?) / 2 * 2)
    };
    let mut notes = Vec::new();
    let before = experiment.psf.grid;
    while room(&experiment.psf)? < LEAST && experiment.psf.grid > LEAST {
        experiment.psf.grid = (experiment.psf.grid - experiment.psf.grid / 8) / 2 * 2;
    }
    if experiment.psf.grid != before {
        notes.push(format!(
            "psf.grid = {} in place of {before}: the built-in photographs, of {SHORTEST} pixels at least, hold no wider blur; with larger photographs \
             of your own, raise it again",
            experiment.psf.grid
        ));
    }
    let most = room(&experiment.psf)?;
    let crops =
        [("training.crop", &mut experiment.training.crop), ("scoring.crop", &mut experiment.scoring.crop)];
    for (key, crop) in crops {
        if *crop > most {
            notes
                .push(format!("{key} = {most} in place of {crop}: as much as the built-in photographs hold"));
            *crop = most;
        }
    }
    Ok(notes)
}

#[cfg(test)]
mod tests {
    use super::*;

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
            assert!(experiment.scoring.crop >= LEAST && experiment.scoring.crop < 120);
            assert!(experiment.psf.grid.is_multiple_of(2));
        }
    }
}
