//! The grid of the PSFs: fine enough for the pixels, and large enough for the light of the lens.

use petzval_base::Cancel;
use petzval_camera::sensor::SensorModel;
use petzval_optics::lens::Lens;
use petzval_optics::wave::NoWaves;

use crate::error::Result;
use crate::experiment::{PsfConfig, PsfsBy};
use crate::lens::psf_plan::LEAST_IMAGE;

/// Fields on which a grid is tried.
const FIELDS: usize = 9;

/// Pupil cells a side meanwhile.
const CELLS: usize = 64;

/// Cells a pixel takes in a grid that is chosen for a sensor with pixels of another size: those of the built-in experiments.
const CELLS_A_PIXEL: f64 = 6.0;

/// Largest cell, as a share of a pixel.
const COARSEST: f64 = 0.45;

/// Least share of the light that a grid should hold at every field: a lens that moves needs some room.
const HELD: f64 = 0.99;

/// Grids that are tried, as factors of cells a side and of their size.
const TRIED: [(usize, f64); 7] = [(1, 1.0), (1, 1.5), (1, 2.0), (2, 1.5), (2, 2.0), (4, 1.5), (4, 2.0)];

/// Bounds of `psf.pitch_um` and of `psf.grid`.
const PITCH_UM: [f64; 2] = [0.05, 50.0];
const MOST_CELLS: usize = 1024;

/// Sets grid and pitch to the smallest that hold the light of a lens on a sensor; returns what to say of another grid. Ends with
/// [`DesignError::Stopped`](crate::error::DesignError::Stopped) before the next field once `cancel` is set.
pub(super) fn fit(
    psf: &mut PsfConfig,
    sensor: &SensorModel,
    lens: &Lens,
    cancel: &Cancel,
) -> Result<Option<String>> {
    let before = (psf.grid, psf.pitch_um);
    let of_pixel = sensor.pixel_um / CELLS_A_PIXEL;
    // The pitch of the experiment does for pixels like those of the built-in ones.
    let is_usual = (0.5..=2.0).contains(&(of_pixel / psf.pitch_um));
    let finest_um = if is_usual { psf.pitch_um } else { rounded(of_pixel) };
    let mut most = (0.0, before.0, finest_um);
    let mut error = None;
    for (cells, size) in TRIED {
        let pitch_um = (finest_um * size).min(COARSEST * sensor.pixel_um).clamp(PITCH_UM[0], PITCH_UM[1]);
        let pitch_um = without_noise(pitch_um);
        let grid = (before.0 * cells).min(MOST_CELLS);
        let held = match share_held(&PsfConfig { grid, pitch_um, ..psf.clone() }, sensor, lens, cancel) {
            Ok((held, _)) => held,
            Err(stopped) if stopped.is_stopped() => return Err(stopped),
            // No light of some field lies on this grid.
            Err(problem) => {
                error = Some(problem);
                continue;
            }
        };
        if held > most.0 {
            most = (held, grid, pitch_um);
        }
        if held >= HELD {
            break;
        }
    }
    let (held, grid, pitch_um) = most;
    if held == 0.0
        && let Some(error) = error
    {
        return Err(error);
    }
    (psf.grid, psf.pitch_um) = (grid, pitch_um);
    let size_um = grid as f64 * pitch_um;
    Ok(((grid, pitch_um) != before).then(|| {
        format!(
            "psf: a grid of {grid} x {grid} cells of {pitch_um} um, {size_um:.0} um wide, holds {:.1} % of the light at the worst place",
            100.0 * held
        )
    }))
}

/// Least share of the light of a lens, over fields and colours, that a grid holds, and the field of it, rad.
fn share_held(psf: &PsfConfig, sensor: &SensorModel, lens: &Lens, cancel: &Cancel) -> Result<(f64, f64)> {
    let tried = PsfConfig { fields: FIELDS, ..psf.clone() };
    Ok(tried.plan(sensor, CELLS)?.trace_unless(cancel, lens)?.least_captured())
}

/// What to say of a grid, once nothing changes it any more, that holds too little of the light of a lens.
pub(super) fn lost_light(
    psf: &PsfConfig,
    sensor: &SensorModel,
    lens: &Lens,
    cancel: &Cancel,
) -> Result<Option<String>> {
    let (held, field_rad) = share_held(psf, sensor, lens, cancel)?;
    let lost = psf.lost_light(held, Some(field_rad.to_degrees()));
    let why = if held < LEAST_IMAGE {
        "the lens is far from an image there"
    } else {
        "a larger psf.grid or psf.pitch_um holds more"
    };
    Ok(lost.map(|lost| format!("{lost}; {why}")))
}

/// Takes rays for a lens of which no wave can be computed at some field.
pub(super) fn rays_or_waves(
    psf: &mut PsfConfig,
    sensor: &SensorModel,
    lens: &Lens,
    cancel: &Cancel,
) -> Result<Option<String>> {
    let by_rays = psf.plan(sensor, CELLS)?.trace_unless(cancel, lens)?.by_rays();
    let rough = psf.rough_fields(by_rays, NoWaves::of(lens));
    if rough.is_some() {
        psf.kind = PsfsBy::Geometric;
    }
    Ok(rough.map(|rough| format!("psf.kind: geometric, rays alone; by waves, {rough}")))
}

/// A pitch to two significant digits.
fn rounded(um: f64) -> f64 {
    let unit = 10.0_f64.powf(um.log10().floor() - 1.0);
    without_noise((um / unit).round() * unit)
}

/// A length, um, without the digits that rounding leaves behind: 0.6 for 0.6000000000000001.
pub(super) fn without_noise(um: f64) -> f64 {
    format!("{um:.6}").parse().unwrap_or(um)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pitch_has_no_digits_of_rounding() {
        assert_eq!(without_noise(0.4 * 1.5), 0.6);
        assert_eq!(without_noise(0.45 * 5.86), 2.637);
        assert_eq!(rounded(5.86 / CELLS_A_PIXEL), 0.98);
    }
}
