//! The MTF at slanted edges: a panel for each edge, a curve for each channel.

use petzval_camera::sensor::Colour;
use petzval_lab::edge_mtf::{EdgeMtf, NYQUIST, Region};

use crate::palette::{LIMIT, mosaic};
use crate::plot::{Axis, Curve, Key, Panel, Pen, Sheet, WIDTH_PX, grid, span};

/// An edge and its channels.
#[derive(Clone, Debug)]
pub struct EdgePanel<'a> {
    /// Where it is.
    pub region: Region,
    /// The channels that could be measured.
    pub channels: Vec<&'a EdgeMtf>,
}

/// Height of a frame, px.
const HEIGHT_PX: f64 = 230.0;

/// The highest frequency that is drawn, cycles per pixel.
const HIGHEST: f64 = 0.75;

/// The sheet as SVG. `source` names the frame and how it became light.
pub fn mtf_svg(source: &str, edges: &[EdgePanel]) -> String {
    let channels = || edges.iter().flat_map(|edge| &edge.channels);
    let shown = |of: &EdgeMtf| {
        let points = of.frequency_per_px.iter().zip(&of.modulation).map(|(f, m)| (*f, *m));
        points.filter(|(frequency, _)| *frequency <= HIGHEST).collect::<Vec<_>>()
    };
    let all: Vec<(f64, f64)> = channels().flat_map(|of| shown(of)).collect();
    let last = span(all.iter().map(|p| p.0)).map_or(NYQUIST, |(_, high)| high);
    let highest = span(all.iter().map(|p| p.1)).map_or(1.0, |(_, high)| high.max(1.0));
    let panel = |edge: &EdgePanel| {
        let mut panel = Panel::new(
            head(edge),
            ["frequency, cycles per pixel", "modulation"],
            Axis::between(0.0, last, 6),
            Axis::between(0.0, 1.05 * highest, 5),
        );
        let upright = [0.0, 1.05 * highest].map(|y| Some([NYQUIST, y]));
        panel.curves.push(Curve { pen: nyquist_pen(), index: 0, points: upright.into() });
        panel.curves.extend(edge.channels.iter().map(|of| {
            let points = shown(of).into_iter().map(|(x, y)| Some([x, y])).collect();
            Curve { pen: pen(&of.channel), index: 0, points }
        }));
        panel
    };
    let panels: Vec<Panel> = edges.iter().map(panel).collect();
    let columns = if panels.len() == 1 { 1 } else { 2 };
    let (body, height) = grid(&panels, columns, WIDTH_PX, HEIGHT_PX);
    let mut keys: Vec<Key> = Vec::new();
    for of in channels() {
        if keys.iter().all(|key| key.name != of.channel) {
            keys.push(Key::pen(pen(&of.channel), of.channel.clone()));
        }
    }
    keys.push(Key::pen(nyquist_pen(), "Nyquist's frequency of the pixels"));
    Sheet {
        class: "mtf",
        title: "MTF at slanted edges".into(),
        remark: source.into(),
        keys,
        alt: "Modulation over frequency at every edge".into(),
        width: WIDTH_PX,
        height,
        body,
        foot: Vec::new(),
    }
    .svg()
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
    use super::*;

    #[test]
    fn every_edge_has_a_panel_and_every_channel_a_curve() {
        let channel = |name: &str| EdgeMtf {
            channel: name.into(),
            is_upright: true,
            angle_deg: 5.0,
            mtf50_per_px: Some(0.2),
            mtf_at_half_nyquist: 0.4,
            levels: [0.2, 0.8],
            overshoot: 0.0,
            undershoot: 0.0,
            scatter: 0.0,
            frequency_per_px: vec![0.0, 0.25, 0.5, 1.0],
            modulation: vec![1.0, 0.4, 0.1, 0.0],
        };
        let (red, blue) = (channel("red"), channel("blue"));
        let edge = |row| EdgePanel {
            region: Region { row, col: 8, height: 64, width: 64 },
            channels: vec![&red, &blue],
        };
        let svg = mtf_svg("a <frame>", &[edge(40), edge(240)]);
        // Two channels and Nyquist's line in each panel.
        assert_eq!(svg.matches("class=\"curve\"").count(), 6);
        for words in ["a &lt;frame&gt;", "row 40, column 8: upright edge, 5.0°", "row 240", ">red<", ">blue<"]
        {
            assert!(svg.contains(words), "{words}\n{svg}");
        }
    }
}
