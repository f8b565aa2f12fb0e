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
mod lateral_colour;
mod mtf;
mod mtf_by_field;
mod mtf_through_focus;
mod page;
mod picture;
#[cfg(test)]
mod sample;
mod seidel;
mod spots;
mod style;
mod table;
mod wavefront;

pub use page::page;
pub use picture::{PICTURES, Picture};

use petzval_optics::analysis::Analysis;

/// Spot diagrams in boxes of a given side, um, for comparisons.
pub fn spots_in_boxes(analysis: &Analysis, side_um: f64) -> String {
    spots::spots(analysis, Some(side_um)).svg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::assert_readable;
    use crate::sample::surfaces;

    fn picture(analysis: &Analysis, name: &str) -> String {
        Picture::named(name).unwrap().svg(analysis)
    }

    /// Elements of a kind and class within a part of a picture.
    fn count(svg: &str, class: &str) -> usize {
        svg.matches(&format!("class=\"{class}\"")).count()
    }

    #[test]
    fn every_picture_is_described_and_holds_its_curves() {
        let analysis = sample::analysis();
        let (fields, colours) = (3, 3);
        let curves = |name| count(&picture(&analysis, name), "curve");
        assert_eq!(curves("ray_fans"), 2 * fields * colours);
        assert_eq!(curves("opd_fans"), 2 * fields * colours);
        // Two sections a field, and the limit.
        assert_eq!(curves("mtf"), 2 * fields + 1);
        assert_eq!(curves("mtf_geometric"), 2 * fields);
        assert_eq!(curves("mtf_by_field"), 2 * 3);
        assert_eq!(curves("mtf_through_focus"), 2 * fields);
        assert_eq!(curves("field_curvature_distortion"), 3 * colours);
        // The edges of the Airy disk too.
        assert_eq!(curves("lateral_colour"), colours + 2);
        assert_eq!(curves("axial_colour"), colours + 1);
        // By waves and by rays.
        assert_eq!(curves("encircled_energy"), 2 * fields);
        assert_eq!(curves("relative_illumination"), colours);
        let spots = picture(&analysis, "spots");
        assert_eq!((count(&spots, "spot"), count(&spots, "rays")), (fields, fields * colours));
        // Seven sums at seven surfaces and of the lens; terms 4 to 37 at every field.
        assert_eq!(count(&picture(&analysis, "seidel"), "bar"), 7 * 8);
        assert_eq!(count(&picture(&analysis, "wavefront"), "bar"), 34 * fields);
        for Picture { name, .. } in PICTURES {
            let svg = picture(&analysis, name);
            assert!(svg.contains("role=\"img\"") && svg.contains("aria-label=\""), "{}", name);
            assert!(svg.contains("Cooke triplet") && !svg.contains("NaN"), "{}", name);
        }
    }

    #[test]
    fn a_picture_shows_the_values_of_the_analysis() {
        let mut analysis = sample::analysis();
        analysis.spots[1].rms_um = 12.345;
        assert!(picture(&analysis, "spots").contains("RMS 12.35 µm"));
        // A curve that is 1 everywhere lies on the upper edge of its frame, one that is 0 on the lower.
        let points = analysis.mtf[0].frequency_per_mm.len();
        for (value, y) in [(1.0, "0"), (0.0, "420")] {
            for field in &mut analysis.mtf {
                field.geometric.tangential = vec![value; points];
                field.geometric.sagittal = vec![value; points];
            }
            let svg = picture(&analysis, "mtf_geometric");
            let d = svg.split("class=\"curve\" d=\"").nth(1).unwrap().split('"').next().unwrap();
            assert!(d.starts_with(&format!("M0 {y}L")) && d.ends_with(&format!("L816 {y}")), "{d}");
        }
    }

    #[test]
    fn the_nyquist_frequency_is_marked_where_it_lies() {
        let mut analysis = sample::analysis();
        let highest = *analysis.mtf[0].frequency_per_mm.last().unwrap();
        analysis.nyquist_per_mm = Some(0.5 * highest);
        for name in ["mtf", "mtf_geometric"] {
            let svg = picture(&analysis, name);
            assert!(svg.contains(&format!("Nyquist frequency of the pixels, {} cycles/mm", 0.5 * highest)));
            // In the middle of the frame, from its lower to its upper edge.
            assert!(svg.contains("class=\"curve\" d=\"M408 420L408 0\""), "{name}");
        }
        analysis.mtf_by_field.frequency_per_mm[2] = 0.5 * highest;
        assert!(picture(&analysis, "mtf_by_field").contains("cycles/mm, Nyquist"));
    }

    #[test]
    fn missing_data_are_stated() {
        let mut analysis = sample::analysis();
        analysis.mtf[2].diffraction = None;
        analysis.mtf[2].limit = None;
        analysis.third_order = None;
        let mtf = picture(&analysis, "mtf");
        assert!(mtf.contains("15° (by rays)") && !mtf.contains("7.5° (by rays)"));
        assert_eq!(count(&mtf, "curve"), 7);
        analysis.mtf.iter_mut().for_each(|m| m.diffraction = None);
        assert!(picture(&analysis, "mtf").contains("By rays: "));
        assert!(picture(&analysis, "seidel").contains("does not cover"));
        let curves = &mut analysis.field_curves;
        curves.field_deg.iter_mut().for_each(|f| *f = 0.0);
        assert!(picture(&analysis, "lateral_colour").contains("only one field"));
        analysis.no_curves = Some("at 3 degrees no light reaches the image".into());
        let said = "There are no curves over the field: at 3 degrees no light reaches the image.";
        assert!(picture(&analysis, "lateral_colour").contains(said));
    }

    #[test]
    fn figures_of_a_field_that_stands_for_the_axis_name_it() {
        let mut analysis = sample::analysis();
        assert!(picture(&analysis, "relative_illumination").contains("divided by that on the axis"));
        assert!(!page(&analysis, &surfaces(), PICTURES.iter()).contains("field of NA"));
        analysis.first_order.image_na_field_deg = Some(7.5);
        assert!(picture(&analysis, "relative_illumination").contains("divided by that at 7.5°"));
        assert!(picture(&analysis, "axial_colour").contains("rays of 7.5° cross their chief ray"));
        assert!(page(&analysis, &surfaces(), PICTURES.iter()).contains("field of NA"));
    }

    #[test]
    fn names_are_escaped_and_the_page_is_self_contained() {
        let mut analysis = sample::analysis();
        analysis.name = "</title><script>alert(1)</script>\u{7}".into();
        let page = page(&analysis, &surfaces(), PICTURES.iter());
        assert_readable(&page);
        assert!(!page.contains("<script") && !page.contains('\u{7}'));
        assert_eq!(page.matches("<figure").count(), PICTURES.len());
        // Every picture has its headline once, in the contents too, and the prescription is there.
        assert_eq!(page.matches("href=\"#").count(), 3 + PICTURES.len());
        assert_eq!(page.matches(">Spot diagrams<").count(), 2);
        assert!(page.contains("2 stop") && page.contains("mm¹⁻ⁿ"));
        let elsewhere = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!elsewhere.contains("http") && !elsewhere.contains("url(") && !elsewhere.contains("@import"));
    }
}
