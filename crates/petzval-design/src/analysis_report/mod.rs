//! The analyses of a lens as pictures and as one page, in the look that optical engineers know.
//!
//! [`Analysis`] goes in and text comes out: nothing here traces a ray. Fields have colours and markers, and so have wavelengths;
//! tangential curves are solid, sagittal ones dashed. Every picture stands alone on white.

mod axial_colour;
mod cross_section;
mod encircled_energy;
mod fans;
mod field_curvature;
mod illumination;
mod kind;
mod lateral_colour;
mod mtf;
mod mtf_by_field;
mod mtf_through_focus;
mod page;
mod seidel;
mod spots;
mod style;
mod table;
mod wavefront;

pub use kind::PictureKind;
pub use page::page;

use petzval_optics::analysis::Analysis;

use crate::plot::Sheet;

/// A picture as a stand-alone SVG.
pub fn picture(analysis: &Analysis, kind: PictureKind) -> String {
    sheet(analysis, kind).svg()
}

/// Spot diagrams in boxes of a given side rather than one that fits, um; for comparisons.
pub fn spots_in_boxes(analysis: &Analysis, side_um: f64) -> String {
    spots::spots(analysis, Some(side_um)).svg()
}

fn sheet(analysis: &Analysis, kind: PictureKind) -> Sheet {
    match kind {
        PictureKind::Layout => cross_section::cross_section(analysis),
        PictureKind::Spots => spots::spots(analysis, None),
        PictureKind::RayFans => fans::ray_fans(analysis),
        PictureKind::OpdFans => fans::opd_fans(analysis),
        PictureKind::Mtf => mtf::mtf(analysis),
        PictureKind::MtfGeometric => mtf::geometric_mtf(analysis),
        PictureKind::MtfByField => mtf_by_field::mtf_by_field(analysis),
        PictureKind::MtfThroughFocus => mtf_through_focus::mtf_through_focus(analysis),
        PictureKind::FieldCurvatureDistortion => field_curvature::field_curvature(analysis),
        PictureKind::LateralColour => lateral_colour::lateral_colour(analysis),
        PictureKind::AxialColour => axial_colour::axial_colour(analysis),
        PictureKind::EncircledEnergy => encircled_energy::encircled_energy(analysis),
        PictureKind::RelativeIllumination => illumination::relative_illumination(analysis),
        PictureKind::Wavefront => wavefront::wavefront(analysis),
        PictureKind::Seidel => seidel::seidel(analysis),
    }
}
