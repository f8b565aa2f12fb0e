//! The analyses of a lens as pictures and as one page, in the usual style of lens design programs.
//!
//! The input is an [`Analysis`] and the output is text: nothing here traces a ray. Fields have colours and markers, and
//! so have wavelengths; tangential curves are solid, sagittal ones dashed. Every picture stands alone on white.

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
#[cfg(test)]
mod sample;
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

/// Spot diagrams in boxes of a given side, um, for comparisons.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Elements of a kind and class within a part of a picture.
    fn count(svg: &str, class: &str) -> usize {
        svg.matches(&format!("class=\"{class}\"")).count()
    }

    #[test]
    fn every_picture_is_described_and_holds_its_curves() {
        let analysis = sample::analysis();
        let (fields, colours) = (3, 3);
        let curves = |kind| count(&picture(&analysis, kind), "curve");
        assert_eq!(curves(PictureKind::RayFans), 2 * fields * colours);
        assert_eq!(curves(PictureKind::OpdFans), 2 * fields * colours);
        // Two sections a field, and the limit.
        assert_eq!(curves(PictureKind::Mtf), 2 * fields + 1);
        assert_eq!(curves(PictureKind::MtfGeometric), 2 * fields);
        assert_eq!(curves(PictureKind::MtfByField), 2 * 3);
        assert_eq!(curves(PictureKind::MtfThroughFocus), 2 * fields);
        assert_eq!(curves(PictureKind::FieldCurvatureDistortion), 3 * colours);
        // The edges of the Airy disk too.
        assert_eq!(curves(PictureKind::LateralColour), colours + 2);
        assert_eq!(curves(PictureKind::AxialColour), colours + 1);
        // By waves and by rays.
        assert_eq!(curves(PictureKind::EncircledEnergy), 2 * fields);
        assert_eq!(curves(PictureKind::RelativeIllumination), colours);
        let spots = picture(&analysis, PictureKind::Spots);
        assert_eq!((count(&spots, "spot"), count(&spots, "rays")), (fields, fields * colours));
        // Seven sums at seven surfaces and of the lens; terms 4 to 37 at every field.
        assert_eq!(count(&picture(&analysis, PictureKind::Seidel), "bar"), 7 * 8);
        assert_eq!(count(&picture(&analysis, PictureKind::Wavefront), "bar"), 34 * fields);
        for kind in PictureKind::ALL {
            let svg = picture(&analysis, kind);
            assert!(svg.contains("role=\"img\"") && svg.contains("aria-label=\""), "{}", kind.name());
            assert!(svg.contains("Cooke triplet") && !svg.contains("NaN"), "{}", kind.name());
        }
    }

    #[test]
    fn a_picture_shows_the_values_of_the_analysis() {
        let mut analysis = sample::analysis();
        analysis.spots[1].rms_um = 12.345;
        assert!(picture(&analysis, PictureKind::Spots).contains("RMS 12.35 µm"));
        // A curve that is 1 everywhere lies on the upper edge of its frame, one that is 0 on the lower.
        let points = analysis.mtf[0].frequency_per_mm.len();
        for (value, y) in [(1.0, "0"), (0.0, "420")] {
            for field in &mut analysis.mtf {
                field.geometric.tangential = vec![value; points];
                field.geometric.sagittal = vec![value; points];
            }
            let svg = picture(&analysis, PictureKind::MtfGeometric);
            let d = svg.split("class=\"curve\" d=\"").nth(1).unwrap().split('"').next().unwrap();
            assert!(d.starts_with(&format!("M0 {y}L")) && d.ends_with(&format!("L816 {y}")), "{d}");
        }
    }

    #[test]
    fn missing_data_are_stated() {
        let mut analysis = sample::analysis();
        analysis.mtf[2].diffraction = None;
        analysis.mtf[2].limit = None;
        analysis.third_order = None;
        let mtf = picture(&analysis, PictureKind::Mtf);
        assert!(mtf.contains("15° (by rays)") && !mtf.contains("7.5° (by rays)"));
        assert_eq!(count(&mtf, "curve"), 7);
        analysis.mtf.iter_mut().for_each(|m| m.diffraction = None);
        assert!(picture(&analysis, PictureKind::Mtf).contains("By rays: "));
        assert!(picture(&analysis, PictureKind::Seidel).contains("does not cover"));
        let curves = &mut analysis.field_curves;
        curves.field_deg.iter_mut().for_each(|f| *f = 0.0);
        assert!(picture(&analysis, PictureKind::LateralColour).contains("only one field"));
    }

    #[test]
    fn names_are_escaped_and_the_page_is_self_contained() {
        let mut analysis = sample::analysis();
        analysis.name = "</title><script>alert(1)</script>\u{7}".into();
        let page = page(&analysis, &PictureKind::ALL);
        assert!(!page.contains("<script") && !page.contains('\u{7}'));
        assert_eq!(page.matches("<figure>").count(), PictureKind::ALL.len());
        let elsewhere = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!elsewhere.contains("http") && !elsewhere.contains("url(") && !elsewhere.contains("@import"));
    }
}
