//! What a report shows of a lens: its cross-section, its prescription, its spots and its light over the field, all traced exactly.

use petzval_files::lens_toml::special_lines;
use petzval_optics::analysis::{AnalysisOptions, FieldMtf, Layout, field_mtf, layout};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::PupilRefinement;
use petzval_optics::spot::spot_converged;
use petzval_report::design_report::FieldPoint;
use petzval_report::prescription::SurfaceView;
use rayon::prelude::*;

/// Rays of a fan in a layout.
const FAN_RAYS: usize = 9;

/// The accuracy of spots and light: half a per cent, finer than a plot shows.
const SPOTS: PupilRefinement = PupilRefinement { tolerance: 5e-3, first_cells: 32, most_cells: 512 };

/// Fields from the axis to the edge.
const FIELDS: usize = 25;

/// The cross-section of a lens with fans of rays of some fields.
pub fn section(lens: &Lens, fields_deg: &[f64]) -> Layout {
    let lens = Lens { fields_deg: fields_deg.to_vec(), ..lens.clone() };
    layout(&lens, &AnalysisOptions { layout_rays: FAN_RAYS, ..AnalysisOptions::default() })
}

/// The surfaces of a lens. The semi-diameter of the stop is the one that the entrance pupil needs.
pub fn surfaces(lens: &Lens) -> Vec<SurfaceView> {
    let stop_mm = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm.abs();
    let surface = |(i, s): (usize, &petzval_optics::lens::Surface)| SurfaceView {
        radius_mm: 1.0 / s.shape.curvature,
        thickness_mm: s.thickness_mm,
        glass: if s.glass.is_air() { String::new() } else { s.glass.name.clone() },
        semi_diameter_mm: if i == lens.stop { stop_mm } else { s.semi_diameter_mm },
        conic: s.shape.conic,
        asphere: (2..).step_by(2).zip(s.shape.asphere).filter(|(_, a)| *a != 0.0).collect(),
        more: special_lines(s).lines().map(str::to_owned).collect(),
        is_stop: i == lens.stop,
    };
    lens.surfaces.iter().enumerate().map(surface).collect()
}

/// Modulation at given fields up to a frequency, over all wavelengths; a field without an image is left out.
pub fn modulation(
    lens: &Lens,
    fields_deg: &[f64],
    wavelengths_um: &[f64],
    most_per_mm: f64,
) -> Vec<FieldMtf> {
    let lens = Lens { wavelengths_um: wavelengths_um.to_vec(), ..lens.clone() };
    let options = AnalysisOptions { max_frequency_per_mm: Some(most_per_mm), ..AnalysisOptions::default() };
    fields_deg.par_iter().filter_map(|field| field_mtf(&lens, *field, &options).ok()).collect()
}

/// Spots and light at given fields, over all wavelengths; a field without light is left out.
pub fn at_fields(lens: &Lens, fields_rad: &[f64], wavelengths_um: &[f64]) -> Vec<FieldPoint> {
    let lens = Lens { wavelengths_um: wavelengths_um.to_vec(), ..lens.clone() };
    fields_rad
        .par_iter()
        .filter_map(|field| Some(spot_converged(&lens, *field, &SPOTS)?.value))
        .map(|s| FieldPoint {
            field_deg: s.field_rad.to_degrees(),
            rms_um: s.rms_poly_um,
            illumination: s.illumination.iter().sum::<f64>() / s.illumination.len() as f64,
        })
        .collect()
}

/// Spots and light at evenly spaced fields up to the full field, rad.
pub fn to_full_field(lens: &Lens, full_rad: f64, wavelengths_um: &[f64]) -> Vec<FieldPoint> {
    let fields: Vec<f64> = (0..FIELDS).map(|i| full_rad * i as f64 / (FIELDS - 1) as f64).collect();
    at_fields(lens, &fields, wavelengths_um)
}
