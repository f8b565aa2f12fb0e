//! Spot diagrams: positions of the rays of a field on the image plane.

use std::f64::consts::TAU;

use petzval_base::statistics::maximum;
use schemars::JsonSchema;
use serde::Serialize;

use super::lens_at_field::{LensAtField, pupil};
use super::{AnalysisError, AnalysisOptions};
use crate::lens::Lens;
use crate::pupil::aim_at_pupil;
use crate::spot::spot;
use crate::trace::trace;

/// The spot diagram of a field.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SpotDiagram {
    /// The field, degrees.
    pub field_deg: f64,
    /// Position of the chief ray of the reference wavelength, mm.
    pub chief_mm: [f64; 2],
    /// `[wavelength][ray]`: (x, y) relative to the chief ray, um, of rays that fill the stop evenly in rings, without
    /// rays that are lost or blocked.
    pub points_um: Vec<Vec<[f64; 2]>>,
    /// Centroid of all light from the chief ray, um.
    pub centroid_um: [f64; 2],
    /// RMS radius about the centroid of all wavelengths, each ray weighted by its light, um; computed from a dense
    /// pupil, not from the points shown.
    pub rms_um: f64,
    /// `[wavelength]`: RMS radius about the wavelength's own centroid, um.
    pub rms_by_wavelength_um: Vec<f64>,
    /// Greatest distance of a point shown from the centroid, um.
    pub geometric_radius_um: f64,
    /// Radius of the first dark ring of a perfect lens of that f-number on the axis, um.
    pub airy_radius_um: f64,
}

/// Points of equal density over the unit disk, in rings: one point, then 6, 12, 18, ...
fn hexapolar(rings: usize) -> Vec<[f64; 2]> {
    let mut points = vec![[0.0; 2]];
    for ring in 1..=rings {
        let radius = ring as f64 / rings as f64;
        for k in 0..6 * ring {
            let (sin, cos) = (TAU * k as f64 / (6 * ring) as f64).sin_cos();
            points.push([radius * sin, radius * cos]);
        }
    }
    points
}

/// The spot diagram of a field.
pub fn spot_diagram(
    lens: &Lens,
    field_deg: f64,
    options: &AnalysisOptions,
) -> Result<SpotDiagram, AnalysisError> {
    let field = LensAtField::new(lens, field_deg)?;
    let points = hexapolar(options.spot_rings.max(1));
    let [x, y] = field.chief_mm;
    let points_um = field.colours.iter().map(|colour| {
        let aimed = aim_at_pupil(colour, field.field_rad, field.stop_radius_mm, &points, None);
        let mut rays = aimed.bundle(colour);
        trace(colour, &mut rays);
        let passes = |i: &usize| rays.fate(*i).reaches_image() && rays.transmission(*i) > 0.5;
        let place = |i: usize| rays.ray(i).position;
        let passing =
            (0..points.len()).filter(passes).map(place).map(|p| [1e3 * (p[0] - x), 1e3 * (p[1] - y)]);
        passing.collect()
    });
    let points_um: Vec<Vec<[f64; 2]>> = points_um.collect();
    let radii = spot(lens, field.field_rad, &pupil(options.pupil_cells))
        .ok_or(AnalysisError::NoLight { field_deg })?;
    let centroid_um = [1e3 * (radii.centroid_x_mm - x), 1e3 * (radii.centroid_y_mm - y)];
    let from_centroid = |p: &[f64; 2]| (p[0] - centroid_um[0]).hypot(p[1] - centroid_um[1]);
    Ok(SpotDiagram {
        field_deg,
        chief_mm: field.chief_mm,
        geometric_radius_um: points_um.iter().flatten().map(from_centroid).fold(0.0, maximum),
        points_um,
        centroid_um,
        rms_um: radii.rms_poly_um,
        rms_by_wavelength_um: radii.rms_um,
        airy_radius_um: field.airy_radius_um(),
    })
}
