//! The MTF at slanted edges: for each edge its picture with the fitted path, its profile, and the modulation of each channel.

use maud::{Markup, html};
use petzval_camera::sensor::Colour;
use petzval_lab::edge_mtf::{EdgeMtf, NYQUIST, Region, RegionPicture};

use crate::number;
use crate::palette::{INK, LIMIT, MUTED, mosaic};
use crate::plot::{Axis, Curve, Key, Panel, Pen, Sheet, WIDTH_PX, grid, px, span};
use crate::png::gray_png;

/// An edge and its channels.
#[derive(Clone, Debug)]
pub struct EdgePanel<'a> {
    /// Where it is.
    pub region: Region,
    /// The channels that could be measured.
    pub channels: Vec<&'a EdgeMtf>,
    /// What the first of them shows of the region.
    pub picture: Option<RegionPicture>,
}

/// Height of a frame, px.
const HEIGHT_PX: f64 = 210.0;

/// Left edge and longest side of a picture, and the space between its top and that of its row, px.
const LEFT_PX: f64 = 18.0;
const PICTURE_PX: f64 = 226.0;
const HEAD_PX: f64 = 30.0;

/// The highest frequency that is drawn, cycles per pixel.
const HIGHEST: f64 = 0.75;

/// Pixels of the profile that are drawn on either side of the edge, beyond twice the distance over which it rises.
const BESIDE_PX: f64 = 4.0;

/// A standard error that is drawn, of the modulation.
const SHOWN_ERROR: f64 = 0.003;

/// The sheet as SVG. `source` names the frame and how it became light.
pub fn mtf_svg(source: &str, edges: &[EdgePanel]) -> String {
    let channels = || edges.iter().flat_map(|edge| &edge.channels);
    let all: Vec<(f64, f64)> = channels().flat_map(|of| shown(of)).collect();
    let last = span(all.iter().map(|p| p.0)).map_or(NYQUIST, |(_, high)| high);
    let highest = span(all.iter().map(|p| p.1)).map_or(1.0, |(_, high)| high.clamp(1.0, 2.0));
    let beside = LEFT_PX + PICTURE_PX;
    let mut top = 0.0;
    let mut rows: Vec<Markup> = Vec::new();
    for edge in edges {
        let panels = [profile(edge), response(edge, last, 1.05 * highest)];
        let (body, height) = grid(&panels, 2, WIDTH_PX - beside, HEIGHT_PX);
        rows.push(html! {
            g transform=(format!("translate(0 {})", px(top))) {
                text x=(px(LEFT_PX)) y="17" fill=(INK) font-size="12.5" font-weight="600" { (head(edge)) }
                (picture(edge))
                g transform=(format!("translate({} 0)", px(beside))) { (body) }
            }
        });
        top += height;
    }
    let mut keys: Vec<Key> = Vec::new();
    for of in channels() {
        if keys.iter().all(|key| key.name != of.channel) {
            keys.push(Key::pen(pen(&of.channel), of.channel.clone()));
        }
    }
    keys.push(Key::pen(nyquist_pen(), "Nyquist's frequency of the pixels"));
    if channels().any(has_errors) {
        keys.push(Key::remark("thin: plus and minus one standard error"));
    }
    Sheet {
        class: "mtf",
        title: "MTF at slanted edges".into(),
        remark: source.into(),
        keys,
        alt: "Picture, profile and modulation over frequency of every edge".into(),
        width: WIDTH_PX,
        height: top,
        body: html! { @for row in &rows { (row) } },
        foot: Vec::new(),
    }
    .svg()
}

/// Frequencies and modulation as drawn.
fn shown(of: &EdgeMtf) -> Vec<(f64, f64)> {
    let points = of.frequency_per_px.iter().zip(&of.modulation).map(|(f, m)| (*f, *m));
    points.filter(|(frequency, _)| *frequency <= HIGHEST).collect()
}

fn has_errors(of: &&EdgeMtf) -> bool {
    of.standard_errors.modulation.iter().any(|error| *error > SHOWN_ERROR)
}

/// The region with the path of its edge.
fn picture(edge: &EdgePanel) -> Markup {
    let Some(picture) = &edge.picture else { return html! {} };
    let [[top, left], [bottom, right]] = picture.corners;
    let scale = PICTURE_PX.min(HEIGHT_PX * (right - left) / (bottom - top)) / (right - left);
    let (width, height) = (scale * (right - left), scale * (bottom - top));
    let gray: Vec<u8> =
        picture.values.iter().map(|v| (255.0 * v.clamp(0.0, 1.0).sqrt()).round() as u8).collect();
    let path = edge.channels.first().map(|of| of.path.as_slice()).unwrap_or_default();
    let points: Vec<String> = path
        .iter()
        .map(|[row, col]| format!("{},{}", px(scale * (col - left)), px(scale * (row - top))))
        .collect();
    html! {
        g transform=(format!("translate({} {})", px(LEFT_PX), px(HEAD_PX))) {
            @if let Some(source) = gray_png(&gray, picture.width, picture.height) {
                image width=(px(width)) height=(px(height)) preserveAspectRatio="none" href=(source)
                    style="image-rendering: pixelated" {}
            }
            rect width=(px(width)) height=(px(height)) stroke=(LIMIT) {}
            polyline class="path" points=(points.join(" ")) stroke="#d55e00" stroke-width="1.4" {}
        }
        @for (i, line) in facts(edge).iter().enumerate() {
            text x=(px(LEFT_PX)) y=(px(HEAD_PX + height + 16.0 + 14.0 * i as f64)) fill=(MUTED) font-size="11" { (line) }
        }
    }
}

/// What is to be known of an edge beside its curves.
fn facts(edge: &EdgePanel) -> Vec<String> {
    let Some(of) = edge.channels.first() else { return Vec::new() };
    let mut lines = Vec::new();
    if let (Some(mtf50), Some(error)) = (of.mtf50_per_px, of.standard_errors.mtf50_per_px) {
        lines.push(format!("MTF50 of {}: {}", of.channel, with_error(mtf50, error)));
    }
    let mut also = vec![format!("sagitta {:.2} px", of.sagitta_px)];
    if let Some(fall) = of.light_fall {
        also.push(format!("light changes by {:.0} %", 100.0 * fall));
    }
    if of.left_out > 0 {
        also.push(format!("{} px left out", of.left_out));
    }
    lines.push(also.join(", "));
    lines
}

/// Most decimals of a frequency, cycles per pixel.
const MOST_DECIMALS: usize = 5;

/// A frequency that ends where its error begins.
fn with_error(value: f64, error: f64) -> String {
    format!("{} cycles per px", number::with_error(value, error, MOST_DECIMALS))
}

/// The profile of every channel.
fn profile(edge: &EdgePanel) -> Panel {
    let rises = |of: &&EdgeMtf| {
        let between = of.profile.iter().filter(|(_, v)| (0.1..0.9).contains(v)).map(|(at, _)| at.abs());
        between.fold(0.0, f64::max)
    };
    let reach = BESIDE_PX + 2.0 * edge.channels.iter().map(rises).fold(0.0, f64::max);
    let near = |of: &EdgeMtf| {
        of.profile.iter().filter(|(at, _)| at.abs() <= reach).map(|(x, y)| Some([*x, *y])).collect::<Vec<_>>()
    };
    let values = || edge.channels.iter().flat_map(|of| near(of)).flatten().map(|[_, v]| v);
    let (low, high) = span(values()).unwrap_or((0.0, 1.0));
    let mut panel = Panel::new(
        "profile",
        ["distance from the edge, pixels", "share of the step"],
        Axis::between(-reach, reach, 5),
        Axis::between(low.min(-0.05), high.max(1.05), 5),
    );
    panel.curves.extend(edge.channels.iter().map(|of| Curve {
        pen: pen(&of.channel),
        index: 0,
        points: near(of),
    }));
    panel
}

/// The modulation of every channel.
fn response(edge: &EdgePanel, last: f64, highest: f64) -> Panel {
    let mut panel = Panel::new(
        "modulation",
        ["frequency, cycles per pixel", "modulation"],
        Axis::between(0.0, last, 6),
        Axis::between(0.0, highest, 5),
    );
    let upright = [0.0, highest].map(|y| Some([NYQUIST, y]));
    panel.curves.push(Curve { pen: nyquist_pen(), index: 0, points: upright.into() });
    for of in &edge.channels {
        let points = |sign: f64| {
            let errors = of.standard_errors.modulation.iter().chain(std::iter::repeat(&0.0));
            let along = shown(of).into_iter().zip(errors);
            along.map(|((x, y), error)| Some([x, (y + sign * error).clamp(0.0, highest)])).collect()
        };
        panel.curves.push(Curve { pen: pen(&of.channel), index: 0, points: points(0.0) });
        if has_errors(of) {
            for sign in [-1.0, 1.0] {
                let pen = Pen { width: 0.7, ..pen(&of.channel) };
                panel.curves.push(Curve { pen, index: 0, points: points(sign) });
            }
        }
    }
    panel
}

fn head(edge: &EdgePanel) -> String {
    let Region { row, col, .. } = edge.region;
    let lies = edge.channels.first().map_or(String::new(), |of| {
        let side = if of.is_upright { "upright" } else { "lying" };
        format!(": {side} edge, {:.1}°", of.angle_deg)
    });
    format!("row {row}, column {col}{lies}")
}

fn pen(channel: &str) -> Pen {
    let colour = Colour::ALL.into_iter().find(|colour| colour.name() == channel);
    Pen { width: 1.8, ..Pen::thin(mosaic(colour)) }
}

fn nyquist_pen() -> Pen {
    Pen::thin(LIMIT).dashed()
}

#[cfg(test)]
mod tests {
    use petzval_lab::edge_mtf::StandardErrors;

    use super::*;

    #[test]
    fn every_edge_has_a_panel_and_every_channel_a_curve() {
        let channel = |name: &str| EdgeMtf {
            gap_px: 0.1,
            channel: name.into(),
            is_upright: true,
            angle_deg: 5.0,
            mtf50_per_px: Some(0.2),
            mtf_at_half_nyquist: 0.4,
            levels: [0.2, 0.8],
            overshoot: 0.0,
            undershoot: 0.0,
            standard_errors: StandardErrors {
                mtf50_per_px: Some(0.004),
                modulation: vec![0.0, 0.01, 0.01, 0.0],
                ..StandardErrors::default()
            },
            scatter: 0.0,
            sagitta_px: 0.4,
            light_fall: Some(0.25),
            left_out: 64,
            coarse_step: None,
            profile: vec![(-1.0, 0.0), (0.0, 0.5), (1.0, 1.0)],
            path: vec![[40.0, 30.0], [104.0, 36.0]],
            frequency_per_px: vec![0.0, 0.25, 0.5, 1.0],
            modulation: vec![1.0, 0.4, 0.1, 0.0],
        };
        let (red, blue) = (channel("red"), channel("blue"));
        let edge = |row| EdgePanel {
            region: Region { row, col: 8, height: 64, width: 64 },
            channels: vec![&red, &blue],
            picture: Some(RegionPicture {
                height: 2,
                width: 2,
                values: vec![0.0, 1.0, 0.0, 1.0],
                corners: [[row as f64, 8.0], [row as f64 + 64.0, 72.0]],
            }),
        };
        let svg = mtf_svg("a <frame>", &[edge(40), edge(240)]);
        // In each row two profiles, two channels with their errors, and Nyquist's line.
        assert_eq!(svg.matches("class=\"curve\"").count(), 18);
        assert_eq!((svg.matches("data:image/png").count(), svg.matches("class=\"path\"").count()), (2, 2));
        for words in [
            "a &lt;frame&gt;",
            "0.200 ± 0.004",
            "light changes by 25 %",
            "64 px left out",
            "row 40, column 8: upright edge, 5.0°",
            "row 240",
            ">red<",
            ">blue<",
        ] {
            assert!(svg.contains(words), "{words}\n{svg}");
        }
    }
}
