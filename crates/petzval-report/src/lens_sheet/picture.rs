//! The list of the pictures of a lens.

use maud::Markup;
use petzval_optics::analysis::Analysis;

use super::table::third_order;
use super::{
    axial_colour, cross_section, encircled_energy, fans, field_curvature, illumination, lateral_colour, mtf,
    mtf_by_field, mtf_through_focus, seidel, spots, wavefront,
};
use crate::plot::Sheet;

/// A picture of an analysis.
pub struct Picture {
    /// Its name, that of its file.
    pub name: &'static str,
    draw: fn(&Analysis) -> Sheet,
    /// A table that belongs below it on the page.
    pub(super) below: Option<fn(&Analysis) -> Markup>,
}

/// All pictures, in the order of the page. A new one is a file that draws it and a line here.
pub const PICTURES: &[Picture] = &[
    // The cross-section with rays, to scale.
    Picture { name: "layout", draw: cross_section::cross_section, below: None },
    // Spot diagrams.
    Picture { name: "spots", draw: |analysis| spots::spots(analysis, None), below: None },
    // Ray aberrations over the pupil.
    Picture { name: "ray_fans", draw: fans::ray_fans, below: None },
    // Optical path differences over the pupil.
    Picture { name: "opd_fans", draw: fans::opd_fans, below: None },
    // Modulation over frequency, by waves.
    Picture { name: "mtf", draw: mtf::mtf, below: None },
    // Modulation over frequency, by rays.
    Picture { name: "mtf_geometric", draw: mtf::geometric_mtf, below: None },
    // Modulation over the field.
    Picture { name: "mtf_by_field", draw: mtf_by_field::mtf_by_field, below: None },
    // Modulation over focus.
    Picture { name: "mtf_through_focus", draw: mtf_through_focus::mtf_through_focus, below: None },
    // Tangential and sagittal focus and distortion over the field.
    Picture { name: "field_curvature_distortion", draw: field_curvature::field_curvature, below: None },
    // Lateral colour over the field.
    Picture { name: "lateral_colour", draw: lateral_colour::lateral_colour, below: None },
    // Focus over wavelength and over the pupil.
    Picture { name: "axial_colour", draw: axial_colour::axial_colour, below: None },
    // Energy within circles.
    Picture { name: "encircled_energy", draw: encircled_energy::encircled_energy, below: None },
    // Illumination over the field.
    Picture { name: "relative_illumination", draw: illumination::relative_illumination, below: None },
    // Wavefront errors and Zernike coefficients.
    Picture { name: "wavefront", draw: wavefront::wavefront, below: None },
    // Third-order sums by surface.
    Picture { name: "seidel", draw: seidel::seidel, below: Some(third_order) },
];

impl Picture {
    /// The picture of a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        PICTURES.iter().find(|picture| picture.name == name)
    }

    /// The picture as a stand-alone SVG.
    pub fn svg(&self, analysis: &Analysis) -> String {
        self.sheet(analysis).svg()
    }

    /// The picture before it is drawn.
    pub(super) fn sheet(&self, analysis: &Analysis) -> Sheet {
        (self.draw)(analysis)
    }
}
