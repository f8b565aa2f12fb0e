//! The layout of the report: lenses in cross-section, to scale, on a common page.

mod drawing;
mod label;
mod symbol;
mod view;

use maud::html;
use petzval_optics::analysis::{AnalysisOptions, Layout, layout};
use petzval_optics::lens::Lens;

pub(crate) use drawing::Drawing;
pub use view::Extent;
pub(crate) use view::{View, extent_of};

use super::number;
use crate::plot::{plain, px};

/// What to draw besides the lens, and how large.
#[derive(Clone, Debug)]
pub struct LayoutOptions {
    /// Scale of both axes, px per mm.
    pub px_per_mm: f64,
    /// Fields whose ray fans are drawn, rad.
    pub fields_rad: Vec<f64>,
    /// Rays of each fan.
    pub rays: usize,
    /// Half the height of the image plane, mm.
    pub half_diagonal_mm: f64,
    /// Another lens whose outlines are dashed in behind this one, first vertex on first vertex.
    pub ghost: Option<Lens>,
    /// What the drawing must at least hold: equal extents make drawings of equal size.
    pub extent: Extent,
}

/// What the drawing of a lens with these options needs to hold.
pub fn layout_extent(lens: &Lens, options: &LayoutOptions) -> Extent {
    extent_of(&section(lens, options)).union(options.extent)
}

/// The section of a lens with the fields and the sensor of the options.
fn section(lens: &Lens, options: &LayoutOptions) -> Layout {
    let fields_deg = options.fields_rad.iter().map(|f| f.to_degrees()).collect();
    let lens = Lens { fields_deg, ..lens.clone() };
    let rays = AnalysisOptions { layout_rays: options.rays, ..AnalysisOptions::default() };
    let found = layout(&lens, &rays);
    let [low, high] = found.image;
    let half = 0.5 * (high[0] - low[0]).hypot(high[1] - low[1]);
    let grow = options.half_diagonal_mm / half;
    if !(grow > 0.0 && grow.is_finite()) {
        return found;
    }
    let end = |side: f64| [0, 1].map(|k| 0.5 * (low[k] + high[k]) + 0.5 * side * grow * (high[k] - low[k]));
    Layout { image: [end(-1.0), end(1.0)], ..found }
}

/// The cross-section of a lens as a stand-alone SVG picture.
///
/// Elements are filled by dispersion and marked V1, V2, ... with their glass; the smaller of an
/// element's two surfaces ends in a flat at the outer diameter, as its maker would grind it. Rays are
/// those of the reference wavelength, aimed at the stop. The lens is one that
/// [`validate`](petzval_optics::lens::validate) accepts.
pub fn layout_svg(lens: &Lens, options: &LayoutOptions) -> String {
    let section = section(lens, options);
    let ghost = options.ghost.as_ref().map(|ghost| layout(ghost, &AnalysisOptions::default()));
    let fields_deg: Vec<f64> = options.fields_rad.iter().map(|f| f.to_degrees()).collect();
    let drawing = Drawing { layout: &section, ghost: ghost.as_ref(), key: &fields_deg };
    let extent = extent_of(&section).union(options.extent);
    let view = View { extent, px_per_mm: options.px_per_mm };
    let (width, height) = (view.width(), drawing.height(&view));
    let alt = format!(
        "Cross-section of {}: {} elements, total track {} mm",
        lens.name,
        section.elements.len(),
        number::fixed(lens.total_track_mm(), 2)
    );
    html! {
        svg xmlns="http://www.w3.org/2000/svg" class="layout" role="img" aria-label=(plain(&alt))
            viewBox=(format!("0 0 {} {}", px(width), px(height))) width=(px(width))
            data-px-per-mm=(options.px_per_mm) font-family="system-ui, sans-serif" font-size="13"
            fill="none" stroke-linejoin="round" stroke-linecap="butt" {
            (drawing.draw(&view))
        }
    }
    .into_string()
}

#[cfg(test)]
mod tests {
    use super::super::sample::{cemented_doublet, triplet};
    use super::*;

    fn options() -> LayoutOptions {
        LayoutOptions {
            px_per_mm: 16.0,
            fields_rad: [0.0_f64, 7.5, 15.0].map(f64::to_radians).to_vec(),
            rays: 9,
            half_diagonal_mm: 8.0,
            ghost: None,
            extent: Extent::default(),
        }
    }

    /// The numbers in the first path that follows `class`.
    fn numbers_after(svg: &str, class: &str) -> Vec<f64> {
        let tail = &svg[svg.find(&format!("class=\"{class}\"")).unwrap()..];
        let d = &tail[tail.find(" d=\"").unwrap() + 4..];
        let d = &d[..d.find('"').unwrap()];
        d.split(|c: char| !(c.is_ascii_digit() || c == '.')).filter_map(|n| n.parse().ok()).collect()
    }

    #[test]
    fn every_element_ray_and_bar_is_there() {
        let svg = layout_svg(&triplet(), &options());
        assert_eq!(svg.matches("class=\"element\"").count(), 3);
        for name in ["V1", "V2", "V3", "PMMA", "N-SF11", "stop", "total track"] {
            assert!(svg.contains(name), "{name}");
        }
        // Each fan is drawn behind the glass and before it.
        assert_eq!(svg.matches("class=\"fan\"").count(), 6);
        assert_eq!(layout_svg(&cemented_doublet(), &options()).matches("class=\"element\"").count(), 2);
    }

    #[test]
    fn both_axes_have_the_scale_of_the_bar() {
        let svg = layout_svg(&triplet(), &options());
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
        let svg = layout_svg(&lens, &options());
        assert!(!svg.contains("<script"));
    }

    #[test]
    fn equal_extents_make_pictures_of_equal_size() {
        let (a, b) = (triplet(), cemented_doublet());
        let mut options = options();
        options.extent = layout_extent(&a, &options).union(layout_extent(&b, &options));
        let view_box = |svg: &str| svg.split("viewBox").nth(1).unwrap()[..30].to_string();
        assert_eq!(view_box(&layout_svg(&a, &options)), view_box(&layout_svg(&b, &options)));
    }
}
