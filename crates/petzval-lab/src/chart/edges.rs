//! Sharpness at an edge target.

use petzval_camera::render::Window;
use petzval_camera::spectral::EdgeTarget;
use serde::{Deserialize, Serialize};

use crate::sfr::{EdgeResponse, Plane, Sfr, slanted_edge};

/// Sharpness at an edge target: means over its four sides, of the linear luminance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeFigures {
    /// Contrast of the target.
    pub contrast: String,
    /// Distance from the middle of the frame, of half of its diagonal.
    pub field: f64,
    /// Where half of the modulation is left, cycles per pixel; none if more is left up to 1.
    pub mtf50_per_px: Option<f64>,
    /// Modulation across upright edges at 0, 0.01, ... 1 cycles per pixel; empty where no side could be measured.
    pub across_upright: Vec<f64>,
    /// Modulation across lying edges.
    pub across_lying: Vec<f64>,
    /// Overshoot above the bright level, of the step.
    pub overshoot: f64,
    /// Undershoot below the dark level, of the step.
    pub undershoot: f64,
    /// Why sides could not be measured.
    pub failures: Vec<String>,
}

/// Measures a target in a plane. `moved` tells where a window of the chart lies in it.
pub(super) fn edge_figures(
    luminance: &[f32],
    width: usize,
    target: &EdgeTarget,
    moved: &impl Fn(&Window) -> Window,
) -> EdgeFigures {
    let plane = Plane { values: luminance, width };
    let mut failures = Vec::new();
    let mut sides = |windows: &[Window; 2]| -> Vec<EdgeResponse> {
        let measured = windows.iter().map(|window| slanted_edge(&plane, &moved(window)));
        measured.filter_map(|side| side.map_err(|e| failures.push(e.to_string())).ok()).collect()
    };
    let [upright, lying] = [sides(&target.upright), sides(&target.lying)];
    let mean = |of: &[&EdgeResponse]| Sfr::mean(&of.iter().map(|side| &side.sfr).collect::<Vec<_>>());
    let all: Vec<&EdgeResponse> = upright.iter().chain(&lying).collect();
    let over_all =
        |of: fn(&EdgeResponse) -> f64| all.iter().map(|side| of(side)).sum::<f64>() / all.len().max(1) as f64;
    let modulation = |sides: &[EdgeResponse]| {
        mean(&sides.iter().collect::<Vec<_>>()).map(|sfr| sfr.modulation).unwrap_or_default()
    };
    EdgeFigures {
        contrast: target.contrast.name().to_owned(),
        field: target.field,
        mtf50_per_px: mean(&all).and_then(|sfr| sfr.mtf50()),
        across_upright: modulation(&upright),
        across_lying: modulation(&lying),
        overshoot: over_all(|side| side.overshoot),
        undershoot: over_all(|side| side.undershoot),
        failures,
    }
}
