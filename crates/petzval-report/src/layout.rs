//! Lenses in cross-section, to scale, several on pages of one size.

mod drawing;
mod label;
mod symbol;
mod view;

use maud::html;
use petzval_optics::analysis::Layout;

pub(crate) use drawing::Drawing;
pub use view::Extent;
pub(crate) use view::{View, extent_of};

use super::number;
use crate::plot::{plain, px};

/// A lens in cross-section with its annotations.
#[derive(Clone, Copy, Debug)]
pub struct CrossSection<'a> {
    /// Name of the lens.
    pub name: &'a str,
    /// The lens with fans of rays.
    pub layout: &'a Layout,
    /// Fields of the fans, degrees; they are named beside the scale.
    pub fields_deg: &'a [f64],
    /// Half of the height of the image plane, mm.
    pub half_diagonal_mm: f64,
    /// Another lens, whose outlines are drawn dashed with the same first vertex.
    pub ghost: Option<&'a Layout>,
}

impl CrossSection<'_> {
    /// Extent of the drawing.
    pub fn extent(&self) -> Extent {
        extent_of(&self.with_image_plane())
    }

    /// The drawing as a stand-alone SVG picture with a scale in px per mm. It covers at least the given extent, so that
    /// equal extents give pictures of equal size.
    ///
    /// Elements are filled by dispersion and marked V1, V2, ... with their glass.
    pub fn svg(&self, px_per_mm: f64, extent: Extent) -> String {
        let layout = self.with_image_plane();
        let drawing = Drawing { layout: &layout, ghost: self.ghost, key: self.fields_deg };
        let view = View { extent: extent_of(&layout).union(extent), px_per_mm };
        let (width, height) = (view.width(), drawing.height(&view));
        let mut alt = format!("Cross-section of {}: {} elements", self.name, layout.elements.len());
        if let Some(track_mm) = drawing.track() {
            alt += &format!(", total track {} mm", number::fixed(track_mm, 2));
        }
        html! {
            svg xmlns="http://www.w3.org/2000/svg" class="layout" role="img" aria-label=(plain(&alt))
                viewBox=(format!("0 0 {} {}", px(width), px(height))) width=(px(width))
                data-px-per-mm=(px_per_mm) font-family="system-ui, sans-serif" font-size="13"
                fill="none" stroke-linejoin="round" stroke-linecap="butt" {
                (drawing.draw(&view))
            }
        }
        .into_string()
    }

    /// The layout with an image plane as large as the sensor.
    fn with_image_plane(&self) -> Layout {
        let [low, high] = self.layout.image;
        let half = 0.5 * (high[0] - low[0]).hypot(high[1] - low[1]);
        let grow = self.half_diagonal_mm / half;
        if !(grow > 0.0 && grow.is_finite()) {
            return self.layout.clone();
        }
        let end =
            |side: f64| [0, 1].map(|k| 0.5 * (low[k] + high[k]) + 0.5 * side * grow * (high[k] - low[k]));
        Layout { image: [end(-1.0), end(1.0)], ..self.layout.clone() }
    }
}

#[cfg(test)]
mod tests {
    use petzval_optics::lens::Lens;

    use super::*;
    use crate::sample::{cemented_doublet, layout_of, triplet};

    const FIELDS_DEG: [f64; 3] = [0.0, 7.5, 15.0];
    const PX_PER_MM: f64 = 16.0;

    fn section<'a>(name: &'a str, layout: &'a Layout) -> CrossSection<'a> {
        CrossSection { name, layout, fields_deg: &FIELDS_DEG, half_diagonal_mm: 8.0, ghost: None }
    }

    fn drawn(lens: &Lens) -> String {
        section(&lens.name, &layout_of(lens, &FIELDS_DEG, 9)).svg(PX_PER_MM, Extent::default())
    }

    /// The numbers in the first path that follows `class`.
    fn numbers_after(svg: &str, class: &str) -> Vec<f64> {
        let tail = &svg[svg.find(&format!("class=\"{class}\"")).unwrap()..];
        let d = &tail[tail.find(" d=\"").unwrap() + 4..];
        let d = &d[..d.find('"').unwrap()];
        d.split(|c: char| !(c.is_ascii_digit() || c == '.')).filter_map(|n| n.parse().ok()).collect()
    }

    #[test]
    fn every_element_ray_and_bar_is_drawn() {
        let svg = drawn(&triplet());
        assert_eq!(svg.matches("class=\"element\"").count(), 3);
        for name in ["V1", "V2", "V3", "PMMA", "N-SF11", "stop", "total track"] {
            assert!(svg.contains(name), "{name}");
        }
        // Each fan is drawn behind the glass and before it.
        assert_eq!(svg.matches("class=\"fan\"").count(), 6);
        assert_eq!(drawn(&cemented_doublet()).matches("class=\"element\"").count(), 2);
    }

    #[test]
    fn both_axes_have_the_scale_of_the_bar() {
        let svg = drawn(&triplet());
        assert!(svg.contains("data-mm=\"10\""));
        let bar = numbers_after(&svg, "scale-bar");
        assert!((bar[5] - bar[0] - 10.0 * 16.0).abs() < 0.02, "{bar:?}");
        // Outline of V1: 2 x 7.733 mm high.
        let outline = numbers_after(&svg, "element\" fill=\"#cee2f3");
        let ys = outline.iter().skip(1).step_by(2);
        let (low, high) = ys.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        assert!((high - low - 2.0 * 7.733 * 16.0).abs() < 0.03);
    }

    #[test]
    fn a_name_cannot_break_the_picture() {
        let mut lens = triplet();
        lens.name = "\"><script>".into();
        let svg = drawn(&lens);
        assert!(!svg.contains("<script"));
    }

    #[test]
    fn equal_extents_make_pictures_of_equal_size() {
        let layouts = [triplet(), cemented_doublet()].map(|lens| layout_of(&lens, &FIELDS_DEG, 9));
        let extent = layouts.iter().map(|l| section("a", l).extent()).fold(Extent::default(), Extent::union);
        let view_box = |layout: &Layout| {
            let svg = section("a", layout).svg(PX_PER_MM, extent);
            svg.split("viewBox").nth(1).unwrap()[..30].to_string()
        };
        assert_eq!(view_box(&layouts[0]), view_box(&layouts[1]));
    }

    #[test]
    fn the_image_plane_is_as_high_as_the_sensor() {
        let layout = layout_of(&triplet(), &FIELDS_DEG, 9);
        let [low, high] = section("a", &layout).with_image_plane().image;
        assert!((high[1] - low[1] - 16.0).abs() < 1e-9 && (high[1] + low[1]).abs() < 1e-9);
    }
}
