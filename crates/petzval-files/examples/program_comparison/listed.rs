//! Values of other programs, as listed in `tests/fixtures/program_comparison.json`, and the lenses to which they belong.

use std::sync::Arc;

use petzval_optics::glass::{Dispersion, Glass};
use petzval_optics::lens::{ASPHERE_TERMS, Lens, ObjectDistance, Surface, SurfaceShape};
use serde::Deserialize;

/// The whole file.
#[derive(Deserialize)]
pub struct Listed {
    pub frequencies_per_mm: Vec<f64>,
    /// Height difference of two close rays, in pupil radii.
    pub near_axis_height: f64,
    pub lenses: Vec<ListedLens>,
}

/// A lens and the values that the other programs give for it.
#[derive(Deserialize)]
pub struct ListedLens {
    pub name: String,
    /// Name of the built-in lens, if it is one.
    pub file: Option<String>,
    pub entrance_pupil_mm: f64,
    pub fields_deg: Vec<f64>,
    pub wavelengths_um: Vec<f64>,
    pub reference_um: f64,
    /// Wavelengths of the indices, um.
    pub index_um: Vec<f64>,
    pub surfaces: Vec<ListedSurface>,
    pub optiland: Optiland,
    pub rayoptics: RayOptics,
}

/// A surface. Without a radius it is a plane; without an index it is followed by air.
#[derive(Deserialize)]
pub struct ListedSurface {
    pub radius_mm: Option<f64>,
    pub conic: f64,
    pub asphere_from_r2: Option<Vec<f64>>,
    pub thickness_mm: f64,
    pub is_stop: bool,
    pub index: Option<Vec<f64>>,
}

/// First-order properties by paraxial formulas. Distances count from the first and the last vertex.
#[derive(Clone, Deserialize)]
pub struct Paraxial {
    pub efl_mm: f64,
    pub bfl_mm: f64,
    pub entrance_pupil_at_mm: f64,
    pub exit_pupil_at_mm: f64,
    pub exit_pupil_mm: f64,
}

/// First-order properties by a traced ray close to the axis. Foci of the wavelengths count from the image plane.
#[derive(Clone, Deserialize)]
pub struct NearAxis {
    pub efl_mm: f64,
    pub bfl_mm: f64,
    pub focus_mm: Vec<f64>,
}

/// Rays of a field under one way of aiming.
#[derive(Clone, Deserialize)]
pub struct AtField {
    /// Height of the chief ray, by wavelength.
    pub chief_mm: Vec<f64>,
    pub reference_chief_mm: f64,
    pub sagittal_focus_mm: f64,
    pub tangential_focus_mm: f64,
    pub opd_rms_waves: f64,
    /// ray-optics only: the same with the other sign in its formula for the reference sphere.
    pub opd_rms_by_the_sphere_waves: Option<f64>,
    pub rms_um: f64,
    pub rms_poly_um: f64,
    /// ray-optics only: sagittal and tangential focus by its Coddington trace, mm.
    pub coddington_mm: Option<[f64; 2]>,
    /// Radius of the reference sphere, if it is not the sphere through the paraxial exit pupil.
    pub reference_sphere_mm: Option<f64>,
}

/// Modulation at the listed frequencies.
#[derive(Clone, Deserialize)]
pub struct Modulation {
    pub geometric_tangential: Vec<f64>,
    pub geometric_sagittal: Vec<f64>,
    pub fft_tangential: Vec<f64>,
    pub fft_sagittal: Vec<f64>,
}

/// Values of Optiland.
#[derive(Deserialize)]
pub struct Optiland {
    pub paraxial: Paraxial,
    pub near_axis: NearAxis,
    pub seidel_mm: [f64; 5],
    pub paraxial_aim: Vec<AtField>,
    pub stop_aim: Vec<AtField>,
    /// RMS wavefront by field, with Optiland's default tolerance for aspheres.
    pub opd_rms_waves_as_it_comes: Vec<f64>,
    pub mtf: Vec<Modulation>,
    /// Rays along a side of the pupil, then the modulation at each frequency.
    pub fft_on_axis_by_rays: Vec<Vec<f64>>,
}

/// Values of ray-optics.
#[derive(Deserialize)]
pub struct RayOptics {
    pub paraxial: Paraxial,
    pub near_axis: NearAxis,
    /// Axis crossing, from the last vertex, of the ray through the middle of the stop at 0.01 degrees.
    pub narrow_chief_crosses_mm: f64,
    pub seidel_mm: [f64; 5],
    pub seidel_by_surface_mm: Vec<[f64; 5]>,
    pub shifted_aim: Vec<AtField>,
}

/// Reads the list.
pub fn listed() -> Listed {
    let text = include_str!("../../tests/fixtures/program_comparison.json");
    serde_json::from_str(text).expect("the listed values")
}

impl ListedLens {
    /// The lens as given to the other programs: without clear apertures.
    pub fn lens(&self) -> Lens {
        let surface = |s: &ListedSurface| {
            let mut asphere = [0.0; ASPHERE_TERMS];
            for (to, from) in asphere.iter_mut().zip(s.asphere_from_r2.iter().flatten()) {
                *to = *from;
            }
            let dispersion = match &s.index {
                Some(index) => {
                    Dispersion::Table { wavelength_um: self.index_um.clone(), index: index.clone() }
                }
                None => Dispersion::Constant(1.0),
            };
            Surface {
                shape: SurfaceShape {
                    curvature: s.radius_mm.map_or(0.0, |r| 1.0 / r),
                    conic: s.conic,
                    asphere,
                    ..SurfaceShape::PLANE
                },
                thickness_mm: s.thickness_mm,
                glass: Arc::new(Glass::new("as listed", dispersion)),
                semi_diameter_mm: 1e3,
                ..Surface::default()
            }
        };
        Lens {
            name: self.name.clone(),
            source: String::new(),
            surfaces: self.surfaces.iter().map(surface).collect(),
            stop: self.surfaces.iter().position(|s| s.is_stop).expect("a stop"),
            entrance_pupil_mm: self.entrance_pupil_mm,
            object: ObjectDistance::Infinity,
            reference_um: self.reference_um,
            wavelengths_um: self.wavelengths_um.clone(),
            fields_deg: self.fields_deg.clone(),
        }
    }
}
