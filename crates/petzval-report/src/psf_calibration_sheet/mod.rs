//! Measured and simulated PSFs: a sheet of pictures and a page with the figures.

mod page;
mod sheet;

pub use page::page;
pub use sheet::sheet_png;

use petzval_lab::psf_calibration::CalibratedPosition;
use petzval_lab::psf_calibration::compare::Comparison;
use petzval_lab::psf_calibration::estimate::FieldEstimate;

/// The results of a calibration.
pub struct Calibration {
    /// Name of the folder of captures.
    pub captures: String,
    /// Name of the sensor.
    pub sensor: String,
    /// Name of the lens that the simulated PSFs are of, if any.
    pub lens: Option<String>,
    /// Measured positions in the order of the manifest, each with its simulation if there is a lens.
    pub positions: Vec<(CalibratedPosition, Option<Comparison>)>,
    /// The fits of the fields of the bank.
    pub fields: Vec<FieldEstimate>,
}

/// Positions in rows of one direction, as the paper shows them; in each row the radius ascends.
fn by_direction(calibration: &Calibration) -> Vec<(String, Vec<usize>)> {
    let mut rows: Vec<(i64, Vec<usize>)> = Vec::new();
    for (index, (position, _)) in calibration.positions.iter().enumerate() {
        let degrees = position.azimuth_rad.to_degrees().rem_euclid(360.0).round() as i64 % 360;
        match rows.iter_mut().find(|(direction, _)| *direction == degrees) {
            Some((_, members)) => members.push(index),
            None => rows.push((degrees, vec![index])),
        }
    }
    let radius = |i: &usize| calibration.positions[*i].0.field_radius_mm;
    for (_, members) in &mut rows {
        members.sort_by(|a, b| radius(a).total_cmp(&radius(b)));
    }
    let name = |degrees: i64| match degrees {
        0 | 180 => "horizontal".to_owned(),
        90 | 270 => "vertical".to_owned(),
        other => format!("{other}°"),
    };
    rows.into_iter().map(|(degrees, members)| (name(degrees), members)).collect()
}

#[cfg(test)]
mod tests;
