//! The layout: a lens in cross-section, drawn to scale as lens designers know it.
//!
//! Light comes from the left and fields send it upwards; both axes have the same scale.

mod element;
mod fan;
mod label;

use element::{elements, vertices_mm};
use fan::{FanRay, fan};
use label::{Label, settle};
use maud::{Markup, html};
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;

use super::{number, palette};

/// Space around the drawing, and height of the two rows of dimensions below it, px.
const MARGIN_PX: f64 = 16.0;
const LABELS_PX: f64 = 30.0;
const DIMENSIONS_PX: f64 = 66.0;

/// Colour of outlines and dimensions.
const INK: &str = "#22272e";

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

/// The part of the y-z plane that a drawing shows, mm; z counts from the first vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extent {
    /// Left edge, negative in front of the lens.
    pub z_min_mm: f64,
    /// Right edge.
    pub z_max_mm: f64,
    /// From the axis to the upper and the lower edge.
    pub half_height_mm: f64,
}

impl Extent {
    /// The smallest extent that holds both.
    pub fn union(self, other: Self) -> Self {
        Self {
            z_min_mm: self.z_min_mm.min(other.z_min_mm),
            z_max_mm: self.z_max_mm.max(other.z_max_mm),
            half_height_mm: self.half_height_mm.max(other.half_height_mm),
        }
    }
}

/// What the drawing of a lens with these options needs to hold.
pub fn layout_extent(lens: &Lens, options: &LayoutOptions) -> Extent {
    extent_of(lens, options, &fans(lens, options)).union(options.extent)
}

/// Fans start this far in front of the first vertex, mm.
fn lead_mm(lens: &Lens) -> f64 {
    0.14 * lens.total_track_mm()
}

/// One fan for each field.
fn fans(lens: &Lens, options: &LayoutOptions) -> Vec<Vec<FanRay>> {
    let lead = lead_mm(lens);
    options.fields_rad.iter().map(|field| fan(lens, *field, options.rays, lead)).collect()
}

fn extent_of(lens: &Lens, options: &LayoutOptions, fans: &[Vec<FanRay>]) -> Extent {
    let glass = elements(lens).iter().map(|e| e.height_mm).fold(0.0, f64::max);
    let rays = fans.iter().flatten().flat_map(|r| &r.points).map(|p| p[1].abs()).fold(0.0, f64::max);
    // A ray that leaves at a wild angle must not make the lens small.
    let tallest = glass.max(options.half_diagonal_mm);
    Extent {
        z_min_mm: -lead_mm(lens),
        z_max_mm: lens.total_track_mm(),
        half_height_mm: tallest.max(stop(lens).outer_mm).max(rays.min(1.5 * tallest)),
    }
}

/// The stop as two bars.
struct StopBars {
    at_mm: f64,
    inner_mm: f64,
    outer_mm: f64,
}

fn stop(lens: &Lens) -> StopBars {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    let inner_mm = order.stop_radius_mm.abs();
    let sag = lens.surfaces[lens.stop].shape.sag_mm(inner_mm).unwrap_or(0.0);
    StopBars {
        at_mm: vertices_mm(lens)[lens.stop] + sag,
        inner_mm,
        outer_mm: inner_mm + (0.5 * inner_mm).max(0.04 * lens.total_track_mm()),
    }
}

/// From mm in the drawing plane to px on the page.
struct Frame {
    extent: Extent,
    px_per_mm: f64,
}

impl Frame {
    fn x(&self, z_mm: f64) -> f64 {
        MARGIN_PX + (z_mm - self.extent.z_min_mm) * self.px_per_mm
    }

    fn y(&self, y_mm: f64) -> f64 {
        MARGIN_PX + LABELS_PX + (self.extent.half_height_mm - y_mm) * self.px_per_mm
    }

    fn width(&self) -> f64 {
        self.x(self.extent.z_max_mm) + 2.0 * MARGIN_PX
    }

    fn bottom(&self) -> f64 {
        self.y(-self.extent.half_height_mm) + LABELS_PX
    }

    fn path(&self, points: &[[f64; 2]], closed: bool) -> String {
        let mut d = String::new();
        for (i, [z, y]) in points.iter().enumerate() {
            let verb = if i == 0 { 'M' } else { 'L' };
            d += &format!("{verb}{} {}", px(self.x(*z)), px(self.y(*y)));
        }
        if closed {
            d.push('Z');
        }
        d
    }
}

/// A coordinate for SVG; what is not finite goes to the corner.
fn px(value: f64) -> String {
    if value.is_finite() { format!("{value:.2}") } else { "0".into() }
}

/// The cross-section of a lens as a stand-alone SVG picture.
///
/// Elements are filled by dispersion and marked V1, V2, ... with their glass; the smaller of an
/// element's two surfaces ends in a flat at the outer diameter, as its maker would grind it. Rays are
/// those of the reference wavelength, aimed at the stop. The lens is one that
/// [`validate`](petzval_optics::lens::validate) accepts.
pub fn layout_svg(lens: &Lens, options: &LayoutOptions) -> String {
    let fans = fans(lens, options);
    let extent = extent_of(lens, options, &fans).union(options.extent);
    let frame = Frame { extent, px_per_mm: options.px_per_mm };
    let (width, height) = (frame.width(), frame.bottom() + DIMENSIONS_PX);
    let alt = format!(
        "Cross-section of {}: {} elements, total track {} mm",
        lens.name,
        elements(lens).len(),
        number::fixed(lens.total_track_mm(), 2)
    );
    html! {
        svg xmlns="http://www.w3.org/2000/svg" class="layout" role="img" aria-label=(alt)
            viewBox=(format!("0 0 {} {}", px(width), px(height))) width=(px(width))
            data-px-per-mm=(options.px_per_mm) font-family="system-ui, sans-serif" font-size="13"
            fill="none" stroke-linejoin="round" stroke-linecap="butt" {
            (axis(&frame))
            @for (i, fan) in fans.iter().enumerate() { (rays(&frame, fan, palette::field(i), 0.35)) }
            (glass(&frame, lens))
            @for (i, fan) in fans.iter().enumerate() { (rays(&frame, fan, palette::field(i), 0.9)) }
            @if let Some(ghost) = &options.ghost { (outlines(&frame, ghost)) }
            (stop_and_image(&frame, lens, options))
            (labels(&frame, lens))
            (dimensions(&frame, lens, options))
        }
    }
    .into_string()
}

/// The optical axis, dash-dot, from edge to edge.
fn axis(frame: &Frame) -> Markup {
    let y = px(frame.y(0.0));
    html! {
        line class="axis" x1=(px(0.5 * MARGIN_PX)) x2=(px(frame.width() - 0.5 * MARGIN_PX)) y1=(y) y2=(y)
            stroke="#8a919b" stroke-width="0.8" stroke-dasharray="12 3 2 3" {}
    }
}

/// A fan, one line a ray; a lost ray ends in a dot.
fn rays(frame: &Frame, fan: &[FanRay], colour: &str, opacity: f64) -> Markup {
    html! {
        g class="fan" stroke=(colour) stroke-width="0.9" opacity=(opacity) {
            @for ray in fan {
                path d=(frame.path(&ray.points, false)) {}
                @if let (true, Some([z, y])) = (ray.is_lost, ray.points.last()) {
                    circle cx=(px(frame.x(*z))) cy=(px(frame.y(*y))) r="1.6" fill=(colour) stroke="none" {}
                }
            }
        }
    }
}

/// The elements, filled and outlined.
fn glass(frame: &Frame, lens: &Lens) -> Markup {
    html! {
        g stroke=(INK) stroke-width="1.3" {
            @for element in elements(lens) {
                path class="element" fill=(palette::glass(element.glass)) fill-opacity="0.82"
                    d=(frame.path(&element.outline, true)) {}
            }
        }
    }
}

/// The elements of the lens that this one came from, dashed.
fn outlines(frame: &Frame, lens: &Lens) -> Markup {
    html! {
        g stroke="#5f6670" stroke-width="0.9" stroke-dasharray="4 3" opacity="0.8" {
            @for element in elements(lens) {
                path class="ghost" d=(frame.path(&element.outline, true)) {}
            }
        }
    }
}

/// Two bars that leave the stop's diameter open, and the image plane.
fn stop_and_image(frame: &Frame, lens: &Lens, options: &LayoutOptions) -> Markup {
    let StopBars { at_mm, inner_mm, outer_mm } = stop(lens);
    let x = frame.x(at_mm);
    let image = px(frame.x(lens.total_track_mm()));
    html! {
        g class="stop" stroke=(INK) stroke-width="2.6" {
            @for side in [1.0, -1.0] {
                @let (edge, rim) = (px(frame.y(side * inner_mm)), px(frame.y(side * outer_mm)));
                line x1=(px(x)) x2=(px(x)) y1=(edge) y2=(rim) {}
                line x1=(px(x - 4.0)) x2=(px(x + 4.0)) y1=(edge) y2=(edge) stroke-width="1.6" {}
            }
        }
        line class="image-plane" x1=(image) x2=(image) y1=(px(frame.y(options.half_diagonal_mm)))
            y2=(px(frame.y(-options.half_diagonal_mm))) stroke=(INK) stroke-width="2" {}
    }
}

/// Names above the elements and the stop, glasses below.
fn labels(frame: &Frame, lens: &Lens) -> Markup {
    let stop = stop(lens);
    let mut above: Vec<Label> = Vec::new();
    let mut below: Vec<Label> = Vec::new();
    for (i, element) in elements(lens).iter().enumerate() {
        let x = frame.x(element.rim_mm);
        above.push(Label::new(format!("V{}", i + 1), x, frame.y(element.height_mm) - 7.0));
        below.push(Label::new(element.glass.name.clone(), x, frame.y(-element.height_mm) + 16.0));
    }
    above.push(Label::new("stop".into(), frame.x(stop.at_mm), frame.y(stop.outer_mm) - 7.0));
    settle(&mut above, -1.0);
    settle(&mut below, 1.0);
    html! {
        g text-anchor="middle" {
            @for label in &above {
                text x=(px(label.x)) y=(px(label.y)) fill=(INK) font-weight="600" { (label.text) }
            }
            @for label in &below {
                text x=(px(label.x)) y=(px(label.y)) fill="#5f6670" font-size="12" { (label.text) }
            }
        }
    }
}

/// The total track between arrows; below it the scale bar and the key to the fans.
fn dimensions(frame: &Frame, lens: &Lens, options: &LayoutOptions) -> Markup {
    let (from, to) = (frame.x(0.0), frame.x(lens.total_track_mm()));
    let track_y = frame.bottom() + 6.0;
    let row_y = frame.bottom() + DIMENSIONS_PX - 16.0;
    let bar_mm = number::round_length(0.2 * lens.total_track_mm());
    let bar_x = frame.x(0.0);
    let bar_end = bar_x + bar_mm * frame.px_per_mm;
    let arrow = |x: f64, inwards: f64| {
        let tail = x + 7.0 * inwards;
        format!(
            "M{} {}L{} {}L{} {}Z",
            px(x),
            px(track_y),
            px(tail),
            px(track_y - 2.5),
            px(tail),
            px(track_y + 2.5)
        )
    };
    let track = format!("total track {} mm", number::fixed(lens.total_track_mm(), 2));
    html! {
        g class="total-track" stroke="#5f6670" stroke-width="0.8" {
            @for (x, y_mm) in [(from, 0.0), (to, -options.half_diagonal_mm)] {
                line x1=(px(x)) x2=(px(x)) y1=(px(frame.y(y_mm) + 4.0)) y2=(px(track_y + 5.0))
                    stroke-dasharray="1 3" {}
            }
            line x1=(px(from)) x2=(px(to)) y1=(px(track_y)) y2=(px(track_y)) {}
            path d=(arrow(from, 1.0)) fill="#5f6670" {}
            path d=(arrow(to, -1.0)) fill="#5f6670" {}
        }
        text x=(px(0.5 * (from + to))) y=(px(track_y - 5.0)) text-anchor="middle" fill=(INK)
            stroke="#ffffff" stroke-width="4" paint-order="stroke" { (track) }
        g class="scale-bar" data-mm=(bar_mm) stroke=(INK) stroke-width="1.6" {
            path d=(format!("M{x} {a}V{b}M{x} {y}H{e}M{e} {a}V{b}", x = px(bar_x), e = px(bar_end),
                y = px(row_y), a = px(row_y - 4.0), b = px(row_y + 4.0))) {}
        }
        text x=(px(bar_end + 8.0)) y=(px(row_y + 4.5)) fill=(INK) { (format!("{bar_mm} mm")) }
        g class="fields" {
            @for (i, field) in options.fields_rad.iter().enumerate() {
                @let x = to - 78.0 * (options.fields_rad.len() - i) as f64 + 22.0;
                line x1=(px(x)) x2=(px(x + 18.0)) y1=(px(row_y)) y2=(px(row_y))
                    stroke=(palette::field(i)) stroke-width="2.4" {}
                text x=(px(x + 23.0)) y=(px(row_y + 4.5)) fill=(INK) {
                    (number::fixed(field.to_degrees(), 1)) "°"
                }
            }
        }
    }
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
