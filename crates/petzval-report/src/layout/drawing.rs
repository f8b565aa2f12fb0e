//! The drawing: elements, mirrors, rays, the stop and the image, with names and dimensions.

use maud::{Markup, html};
use petzval_optics::analysis::{Layout, LayoutRay, LineKind};

use super::View;
use super::label::{CHARACTER_PX, Label, settle};
use super::symbol;
use super::view::MARGIN_PX;
use crate::palette::{AXIS, INK, MUTED, PAPER};
use crate::plot::{plain, px};
use crate::{number, palette};

/// Height of the rows of dimensions below the drawing, px: the scale bar, and the total track above it if there is one.
const SCALE_PX: f64 = 36.0;
const TRACK_PX: f64 = 30.0;

/// Distance of names from the rims, px.
const NAME_PX: f64 = 11.0;

/// A section to draw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawing<'a> {
    /// The section.
    pub layout: &'a Layout,
    /// Another section, whose elements are drawn dashed.
    pub ghost: Option<&'a Layout>,
    /// Fields to name beside the scale bar, degrees; empty if they are named elsewhere.
    pub key: &'a [f64],
}

impl Drawing<'_> {
    /// Height of the drawing with its labels and dimensions, px.
    pub fn height(&self, view: &View) -> f64 {
        view.bottom() + SCALE_PX + if self.track().is_some() { TRACK_PX } else { 0.0 }
    }

    /// The drawing, from the upper left corner.
    pub fn draw(&self, view: &View) -> Markup {
        let section = self.layout;
        html! {
            (self.axis(view))
            (self.fans(view, 0.35))
            g stroke=(INK) stroke-width="1.3" {
                @for element in &section.elements {
                    path class="element" fill=(palette::glass(element.vd.unwrap_or(f64::INFINITY))) fill-opacity="0.82"
                        d=(view.path(&element.outline, true)) {}
                }
            }
            (self.fans(view, 0.9))
            @for line in &section.lines { (symbol::line(view, line)) }
            @if let Some(ghost) = self.ghost {
                g stroke=(MUTED) stroke-width="0.9" stroke-dasharray="4 3" opacity="0.8" {
                    @for element in &ghost.elements { path class="ghost" d=(view.path(&element.outline, true)) {} }
                }
            }
            (symbol::stop(view, &section.stop))
            path class="image-plane" d=(view.path(&section.image, false)) stroke=(INK) stroke-width="2" {}
            (self.labels(view))
            (self.dimensions(view))
        }
    }

    /// The optical axis, dash-dotted, from the left edge through the vertices to behind the image.
    fn axis(&self, view: &View) -> Markup {
        let mut points: Vec<[f64; 2]> = Vec::new();
        let lead = view.extent.z_min_mm - 0.5 * MARGIN_PX / view.px_per_mm;
        points.push([lead, 0.0]);
        points.extend(&self.layout.axis);
        if let [.., before, last] = self.layout.axis[..] {
            let along = [0, 1].map(|k| last[k] - before[k]);
            let length = along[0].hypot(along[1]);
            if length > 0.0 {
                points.push([0, 1].map(|k| last[k] + along[k] / length * MARGIN_PX / view.px_per_mm));
            }
        }
        html! {
            path class="axis" d=(view.path(&points, false)) stroke=(AXIS) stroke-width="0.8"
                stroke-dasharray="12 3 2 3" {}
        }
    }

    /// The rays of all fields; those that leave the picture end at its edge.
    fn fans(&self, view: &View, opacity: f64) -> Markup {
        let (right, bottom) = (view.width(), view.bottom());
        html! {
            svg width=(px(right)) height=(px(bottom)) {
                @for (i, fan) in self.layout.rays.iter().enumerate() { (rays(view, fan, palette::field(i), opacity)) }
            }
        }
    }

    /// Names above the elements and the stop, glasses below.
    fn labels(&self, view: &View) -> Markup {
        let mut above: Vec<Label> = Vec::new();
        let mut below: Vec<Label> = Vec::new();
        for (i, element) in self.layout.elements.iter().enumerate() {
            let [upper, lower] = element.rims;
            above.push(outside(view, lower, upper, format!("V{}", i + 1)));
            below.push(outside(view, upper, lower, plain(&element.glass)));
        }
        let [[inner, outer], _] = self.layout.stop;
        above.push(outside(view, inner, outer, "stop".into()));
        settle(&mut above, -1.0);
        settle(&mut below, 1.0);
        html! {
            g text-anchor="middle" stroke-linejoin="round" {
                @for label in &above {
                    text x=(px(label.x)) y=(px(label.y)) fill=(INK) font-size="13" font-weight="600" { (label.text) }
                }
                @for label in &below {
                    text x=(px(label.x)) y=(px(label.y)) fill=(MUTED) font-size="12" { (label.text) }
                }
            }
        }
    }

    /// Distance from the first vertex to the image, if both lie on a straight axis.
    pub fn track(&self) -> Option<f64> {
        let is_folded = self.layout.lines.iter().any(|l| l.kind == LineKind::Mirror);
        let is_straight = self.layout.axis.iter().all(|p| p[1].abs() < 1e-9);
        let length = self.layout.axis.last()?[0];
        (is_straight && !is_folded && length > 0.0).then_some(length)
    }

    /// The total track between arrows; below it the scale bar and the key to the fans.
    fn dimensions(&self, view: &View) -> Markup {
        let row_y = self.height(view) - 16.0;
        let bar_mm = number::round_length(0.2 * (view.extent.z_max_mm - view.extent.z_min_mm));
        let bar_x = view.x(self.track().map_or(view.extent.z_min_mm, |_| 0.0));
        let bar_end = bar_x + bar_mm * view.px_per_mm;
        let key_end = view.x(view.extent.z_max_mm);
        html! {
            @if let Some(length) = self.track() { (self.track_arrow(view, length)) }
            g class="scale-bar" data-mm=(bar_mm) stroke=(INK) stroke-width="1.6" {
                path d=(format!("M{x} {a}V{b}M{x} {y}H{e}M{e} {a}V{b}", x = px(bar_x), e = px(bar_end),
                    y = px(row_y), a = px(row_y - 4.0), b = px(row_y + 4.0))) {}
            }
            text x=(px(bar_end + 8.0)) y=(px(row_y + 4.5)) fill=(INK) font-size="13" { (format!("{bar_mm} mm")) }
            g class="fields" font-size="13" {
                @for (i, field) in self.key.iter().enumerate() {
                    @let x = key_end - 78.0 * (self.key.len() - i) as f64 + 22.0;
                    line x1=(px(x)) x2=(px(x + 18.0)) y1=(px(row_y)) y2=(px(row_y))
                        stroke=(palette::field(i)) stroke-width="2.4" {}
                    text x=(px(x + 23.0)) y=(px(row_y + 4.5)) fill=(INK) { (number::fixed(*field, 1)) "°" }
                }
            }
        }
    }

    fn track_arrow(&self, view: &View, length: f64) -> Markup {
        let (from, to) = (view.x(0.0), view.x(length));
        let y = view.bottom() + 6.0;
        let head = |x: f64, inwards: f64| {
            let tail = x + 7.0 * inwards;
            format!("M{} {}L{} {}L{} {}Z", px(x), px(y), px(tail), px(y - 2.5), px(tail), px(y + 2.5))
        };
        let image_low = self.layout.image.iter().map(|p| p[1]).fold(0.0, f64::min);
        html! {
            g class="total-track" stroke=(MUTED) stroke-width="0.8" {
                @for (x, y_mm) in [(from, 0.0), (to, image_low)] {
                    line x1=(px(x)) x2=(px(x)) y1=(px(view.y(y_mm) + 4.0)) y2=(px(y + 5.0)) stroke-dasharray="1 3" {}
                }
                line x1=(px(from)) x2=(px(to)) y1=(px(y)) y2=(px(y)) {}
                path d=(head(from, 1.0)) fill=(MUTED) {}
                path d=(head(to, -1.0)) fill=(MUTED) {}
            }
            text x=(px(0.5 * (from + to))) y=(px(y - 5.0)) text-anchor="middle" fill=(INK) font-size="13"
                stroke=(PAPER) stroke-width="4" paint-order="stroke" {
                "total track " (number::fixed(length, 2)) " mm"
            }
        }
    }
}

/// A fan, one line a ray; a lost ray ends in a dot.
fn rays(view: &View, fan: &[LayoutRay], colour: &str, opacity: f64) -> Markup {
    html! {
        g class="fan" stroke=(colour) stroke-width="0.9" opacity=(opacity) {
            @for ray in fan {
                path d=(view.path(&ray.points, false)) {}
                @if let (true, Some(end)) = (ray.is_lost, ray.points.last()) {
                    @let [x, y] = view.at(*end);
                    circle cx=(px(x)) cy=(px(y)) r="1.6" fill=(colour) stroke="none" {}
                }
            }
        }
    }
}

/// A name beyond the end of a line from one point (z, y) to another.
fn outside(view: &View, from: [f64; 2], to: [f64; 2], name: String) -> Label {
    let ([fx, fy], [x, y]) = (view.at(from), view.at(to));
    let length = (x - fx).hypot(y - fy).max(1e-9);
    let [u, v] = [(x - fx) / length, (y - fy) / length];
    let half_width = 0.5 * CHARACTER_PX * name.chars().count() as f64;
    Label::new(name, x + u * (NAME_PX + half_width), y + v * NAME_PX + 4.0)
}
