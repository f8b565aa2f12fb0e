//! Encircled energy: the share of the light of a point within a circle.

use petzval_base::statistics::maximum;
use schemars::JsonSchema;
use serde::Serialize;

use super::lens_at_field::{LensAtField, pupil};
use super::options::{evenly, round_up};
use super::{AnalysisError, AnalysisOptions};
use crate::lens::Lens;
use crate::psf::{PsfKind, PsfOptions, psf};
use crate::pupil::{Beam, Quadrature};
use crate::spot::spot;

/// Cells a side of the diffraction PSF.
const CELLS: usize = 192;

/// Parts a side into which a cell is divided at a circle.
const PARTS: usize = 4;

/// Energy within circles about the centroid of the light of all colours, as shares of all light that reaches the image.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct EncircledEnergy {
    /// The field, degrees.
    pub field_deg: f64,
    /// Radii, um.
    pub radius_um: Vec<f64>,
    /// By rays.
    pub geometric: Vec<f64>,
    /// By waves; `None` where rays of the stop are lost or the wavefront is too rough for its polynomials.
    pub diffraction: Option<Vec<f64>>,
}

/// Encircled energy of a field, up to a radius that holds all rays and, on the axis of a perfect lens, five dark rings.
pub fn encircled_energy(
    lens: &Lens,
    field_deg: f64,
    options: &AnalysisOptions,
) -> Result<EncircledEnergy, AnalysisError> {
    let field = LensAtField::new(lens, field_deg)?;
    let quadrature = pupil(options.pupil_cells);
    let beams = field.beams(&quadrature)?;
    let no_light = AnalysisError::NoLight { field_deg };
    let centre = spot(lens, field.field_rad, &quadrature).ok_or(no_light)?;
    let centre_mm = [centre.centroid_x_mm, centre.centroid_y_mm];
    // Distance of every ray with its share of all light.
    let mut rays: Vec<(f64, f64)> = Vec::new();
    for beam in &beams {
        let unit = 1.0 / (beam.light() * beams.len() as f64);
        let distance = |i: usize| 1e3 * (beam.x_mm[i] - centre_mm[0]).hypot(beam.y_mm[i] - centre_mm[1]);
        rays.extend(
            (0..beam.weight.len())
                .filter(|i| beam.weight[*i] > 0.0)
                .map(|i| (distance(i), unit * beam.weight[i])),
        );
    }
    let farthest = rays.iter().map(|r| r.0).fold(0.0, maximum);
    // Light that leaves a section parallel has no dark ring.
    let rings = Some(4.0 * field.airy_radius_um()).filter(|radius| radius.is_finite()).unwrap_or(0.0);
    let radius = round_up(1.1 * farthest.max(rings));
    let radius_um = evenly(0.0, radius, options.radius_points.max(2));
    let geometric = within(rays.into_iter(), &radius_um);
    let diffraction = by_waves(&field, &beams, &quadrature, centre_mm, &radius_um);
    Ok(EncircledEnergy { field_deg, radius_um, geometric, diffraction })
}

/// Light within each of some radii at equal distances from 0 on, from (distance, light).
fn within(light: impl Iterator<Item = (f64, f64)>, radius_um: &[f64]) -> Vec<f64> {
    let step = radius_um.get(1).copied().unwrap_or(1.0);
    let mut within = vec![0.0; radius_um.len()];
    for (distance, share) in light {
        if let Some(ring) = within.get_mut((distance / step).ceil() as usize) {
            *ring += share;
        }
    }
    let mut sum = 0.0;
    within.iter_mut().for_each(|ring| {
        sum += *ring;
        *ring = sum;
    });
    within
}

fn by_waves(
    field: &LensAtField,
    beams: &[Beam],
    quadrature: &Quadrature,
    centre_mm: [f64; 2],
    radius_um: &[f64],
) -> Option<Vec<f64>> {
    let shift_um = [0, 1].map(|axis| 1e3 * (centre_mm[axis] - field.chief_mm[axis]));
    let reach = radius_um.last()? + shift_um[0].abs().max(shift_um[1].abs());
    let grid = PsfOptions { grid: CELLS, pitch_um: 2.0 * reach / CELLS as f64, kind: PsfKind::Diffraction };
    let found = psf(field.lens, field.field_rad, &field.lens.wavelengths_um, quadrature, &grid)?;
    let part = grid.pitch_um / PARTS as f64;
    let place = |k: usize| ((k as f64 + 0.5) - 0.5 * (CELLS * PARTS) as f64) * part;
    let unit = 1.0 / (beams.len() * PARTS * PARTS) as f64;
    let of_cell = |cell: usize| -> f64 {
        unit * found.values.iter().zip(&found.captured).map(|(v, captured)| v[cell] * captured).sum::<f64>()
    };
    let shares: Vec<f64> = (0..CELLS * CELLS).map(of_cell).collect();
    let light = (0..CELLS * PARTS).flat_map(|y| (0..CELLS * PARTS).map(move |x| (x, y))).map(|(x, y)| {
        let (dx, dy) = (place(x) - shift_um[0], place(y) - shift_um[1]);
        ((dx * dx + dy * dy).sqrt(), shares[y / PARTS * CELLS + x / PARTS])
    });
    Some(within(light, radius_um))
}
