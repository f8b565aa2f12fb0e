//! Sharpness at an edge target.

use petzval_camera::render::Window;
use petzval_camera::spectral::EdgeTarget;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::sfr::{EdgeResponse, Estimate, Plane, Sfr, slanted_edge};

/// Sharpness at an edge target: means over its four sides, of the linear luminance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EdgeFigures {
    /// Contrast of the target.
    pub contrast: String,
    /// Distance from the middle of the frame, of half of its diagonal.
    pub field: f64,
    /// Where half of the modulation is left, cycles per pixel; none if more is left up to 1.
    pub mtf50_per_px: Option<f64>,
    /// Its standard error from the noise of the pixels, cycles per pixel.
    pub mtf50_standard_error: Option<f64>,
    /// Modulation across upright edges at 0, 0.01, ... 1 cycles per pixel; empty where no side could be measured.
    pub across_upright: Vec<f64>,
    /// Modulation across lying edges.
    pub across_lying: Vec<f64>,
    /// Standard errors of the modulation across upright edges.
    pub across_upright_error: Vec<f64>,
    /// Standard errors of the modulation across lying edges.
    pub across_lying_error: Vec<f64>,
    /// Overshoot above the bright level, of the step; none where no side could be measured.
    pub overshoot: Option<f64>,
    /// Undershoot below the dark level, of the step.
    pub undershoot: Option<f64>,
    /// Standard errors of overshoot and undershoot, of the step.
    pub overshoot_error: Option<[f64; 2]>,
    /// The profile of the first side: distance from the edge, pixels, and value from 0, dark, to 1, bright.
    pub profile: Vec<(f64, f64)>,
    /// Why sides could not be measured.
    pub failures: Vec<String>,
}

/// Measures a target in a plane. `moved` maps a window of the chart to its place in the plane.
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
    let count = all.len() as f64;
    let over_all = |of: fn(&EdgeResponse) -> Estimate| {
        (!all.is_empty()).then(|| all.iter().map(|side| of(side).value).sum::<f64>() / count)
    };
    let error = |of: fn(&EdgeResponse) -> Estimate| {
        all.iter().map(|side| of(side).standard_error.powi(2)).sum::<f64>().sqrt() / count
    };
    let of_sides = |sides: &[EdgeResponse]| {
        let sfr = mean(&sides.iter().collect::<Vec<_>>());
        sfr.map(|sfr| (sfr.modulation, sfr.standard_error)).unwrap_or_default()
    };
    let mtf50 = mean(&all).and_then(|sfr| sfr.mtf50());
    let (across_upright, across_upright_error) = of_sides(&upright);
    let (across_lying, across_lying_error) = of_sides(&lying);
    EdgeFigures {
        contrast: target.contrast.name().to_owned(),
        field: target.field,
        mtf50_per_px: mtf50.map(|at| at.frequency),
        mtf50_standard_error: mtf50.map(|at| at.standard_error),
        across_upright,
        across_lying,
        across_upright_error,
        across_lying_error,
        overshoot: over_all(|side| side.overshoot),
        undershoot: over_all(|side| side.undershoot),
        overshoot_error: (!all.is_empty())
            .then(|| [error(|side| side.overshoot), error(|side| side.undershoot)]),
        profile: all.first().map(|side| side.profile.clone()).unwrap_or_default(),
        failures,
    }
}
