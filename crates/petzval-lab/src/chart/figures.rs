//! All figures of a developed chart.

use petzval_base::statistics::maximum;
use petzval_camera::image::srgb_decode;
use petzval_camera::isp::RgbPicture;
use petzval_camera::render::{Placement, Window};
use petzval_camera::spectral::{TestChart, apply, d65_white, delta_e_2000, lab};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::edges::{EdgeFigures, edge_figures};
use super::patches::{PatchFigures, PatchMeans, PatchNoise};

/// First of the six gray patches.
const FIRST_GRAY: usize = 18;

/// Shares of the linear colours in luminance, ITU-R BT.709.
pub(super) const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// What a developed chart shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChartFigures {
    /// Colour errors with the picture's own lightness.
    pub as_developed: Lightness,
    /// Colour errors after the light of the picture was multiplied by one factor, which brings the luminance of the six grays nearest to
    /// what it should be (least squares).
    pub normalised: Lightness,
    /// The 24 patches, dark skin first.
    pub patches: Vec<PatchFigures>,
    /// The edge targets, that in the middle first.
    pub edges: Vec<EdgeFigures>,
}

/// Colour errors, CIEDE2000.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Lightness {
    /// What the linear light of the picture was multiplied with.
    pub factor: f64,
    /// Mean over the 24 patches.
    pub mean_delta_e_2000: f64,
    /// Largest of the 24 patches.
    pub max_delta_e_2000: f64,
}

/// Measures a developed chart. `wanted_xyz` holds the colours that the patches should have, relative to D65 (Y of white = 1). `place` maps
/// a point of the chart, `[x, y]` in pixels, to the picture.
pub fn measure(
    picture: &RgbPicture,
    chart: &TestChart,
    wanted_xyz: &[[f64; 3]],
    place: impl Fn([f64; 2]) -> [f64; 2],
) -> ChartFigures {
    let encoded = picture.encoded();
    let size = picture.height * picture.width;
    let luminance: Vec<f32> =
        (0..size).map(|i| (0..3).map(|c| LUMINANCE[c] * srgb_decode(encoded[c * size + i])).sum()).collect();
    let moved = |window: &Window| moved(window, picture, &place);

    // Mean colours and noise of the patches.
    let windows: Vec<Window> = chart.patches().iter().map(moved).collect();
    let means: Vec<PatchMeans> =
        windows.iter().map(|window| PatchMeans::of(&encoded, picture.width, window)).collect();
    let (d65, xyz_of_srgb, _) = d65_white();
    let factor = exposure_factor(&means, wanted_xyz);
    let shown =
        |mean: &PatchMeans, factor: f64| lab(apply(&xyz_of_srgb, mean.linear.map(|v| v * factor)), d65);
    let patches = means.iter().zip(&windows).zip(wanted_xyz).map(|((mean, window), xyz)| {
        let wanted = lab(*xyz, d65);
        PatchFigures {
            wanted_lab: wanted,
            lab: shown(mean, 1.0),
            delta_e_2000: delta_e_2000(shown(mean, 1.0), wanted),
            normalised_delta_e_2000: delta_e_2000(shown(mean, factor), wanted),
            noise: PatchNoise::of(&encoded, &luminance, picture.width, window),
        }
    });
    let patches: Vec<PatchFigures> = patches.collect();
    let lightness = |factor: f64, of: fn(&PatchFigures) -> f64| Lightness {
        factor,
        mean_delta_e_2000: patches.iter().map(of).sum::<f64>() / patches.len() as f64,
        max_delta_e_2000: patches.iter().map(of).fold(0.0, maximum),
    };
    let targets = chart.targets();
    let edges =
        targets.iter().map(|target| edge_figures(&luminance, picture.width, target, &moved)).collect();
    ChartFigures {
        as_developed: lightness(1.0, |patch| patch.delta_e_2000),
        normalised: lightness(factor, |patch| patch.normalised_delta_e_2000),
        patches,
        edges,
    }
}

/// The factor of the light that brings the luminance of the grays nearest to what is wanted: `sum m w / sum m m`.
fn exposure_factor(means: &[PatchMeans], wanted_xyz: &[[f64; 3]]) -> f64 {
    let (mut across, mut own) = (0.0, 0.0);
    for (mean, wanted) in means.iter().zip(wanted_xyz).skip(FIRST_GRAY) {
        let found: f64 = mean.linear.iter().zip(LUMINANCE).map(|(v, share)| v * f64::from(share)).sum();
        across += found * wanted[1];
        own += found * found;
    }
    if own > 0.0 { across / own } else { 1.0 }
}

/// The window whose middle lies where the middle of a window of the chart does, inside the picture.
fn moved(window: &Window, picture: &RgbPicture, place: impl Fn([f64; 2]) -> [f64; 2]) -> Window {
    let Placement { row, col } = window.placement;
    let middle = [col as f64 + 0.5 * window.width as f64, row as f64 + 0.5 * window.height as f64];
    let there = place(middle);
    let first = |start: usize, by: f64, side: usize, whole: usize| {
        (start as f64 + by).round().clamp(0.0, whole.saturating_sub(side) as f64) as usize
    };
    let placement = Placement {
        row: first(row, there[1] - middle[1], window.height, picture.height),
        col: first(col, there[0] - middle[0], window.width, picture.width),
    };
    Window { placement, ..*window }
}
