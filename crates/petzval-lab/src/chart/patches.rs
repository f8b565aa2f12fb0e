//! Mean colour and noise of a patch.

use nalgebra::{Matrix3, Vector3};
use petzval_camera::image::srgb_decode;
use petzval_camera::isp::{BT709, ycbcr};
use petzval_camera::render::Window;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Colour and noise of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PatchFigures {
    /// Colour that it should have, CIELAB relative to D65.
    pub wanted_lab: [f64; 3],
    /// Colour that it has.
    pub lab: [f64; 3],
    /// Their difference, CIEDE2000.
    pub delta_e_2000: f64,
    /// Their difference after the lightness of the whole picture was normalised.
    pub normalised_delta_e_2000: f64,
    /// Noise.
    pub noise: PatchNoise,
}

/// Standard deviations over a patch, without its linear gradient.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PatchNoise {
    /// Of luma (ITU-R BT.709), as a share of encoded white.
    pub luma: f64,
    /// Of the colour difference Cb, as a share of encoded white.
    pub cb: f64,
    /// Of the colour difference Cr, as a share of encoded white.
    pub cr: f64,
    /// Mean over standard deviation of the linear luminance, dB; none where every pixel has the same.
    pub snr_db: Option<f64>,
}

/// Mean linear light of a patch.
pub(super) struct PatchMeans {
    pub linear: [f64; 3],
}

impl PatchMeans {
    /// The means over a window of a picture of three encoded planes.
    pub fn of(encoded: &[f32], width: usize, window: &Window) -> Self {
        let size = encoded.len() / 3;
        let mean = |c: usize| {
            let sum: f64 = pixels(window, width).map(|i| f64::from(srgb_decode(encoded[c * size + i]))).sum();
            sum / (window.height * window.width) as f64
        };
        Self { linear: [0, 1, 2].map(mean) }
    }
}

impl PatchNoise {
    /// The noise of a window of a picture, of three encoded planes and of its linear luminance.
    pub fn of(encoded: &[f32], luminance: &[f32], width: usize, window: &Window) -> Self {
        let size = encoded.len() / 3;
        let differences: Vec<[f64; 3]> = pixels(window, width)
            .map(|i| ycbcr([0, 1, 2].map(|c| f64::from(encoded[c * size + i])), BT709))
            .collect();
        let [luma, cb, cr] =
            [0, 1, 2].map(|k| scatter(&differences.iter().map(|v| v[k]).collect::<Vec<f64>>(), window.width));
        let light: Vec<f64> = pixels(window, width).map(|i| f64::from(luminance[i])).collect();
        let mean = light.iter().sum::<f64>() / light.len() as f64;
        let deviation = scatter(&light, window.width);
        let snr_db = (mean > 0.0 && deviation > 0.0).then(|| 20.0 * (mean / deviation).log10());
        Self { luma, cb, cr, snr_db }
    }
}

/// Places of the pixels of a window in a plane.
fn pixels(window: &Window, width: usize) -> impl Iterator<Item = usize> {
    let start = window.placement.row * width + window.placement.col;
    let columns = window.width;
    (0..window.height).flat_map(move |row| start + row * width..start + row * width + columns)
}

/// Standard deviation about the plane `a + b row + c col` of least squares, so that shading does not count as noise.
fn scatter(values: &[f64], width: usize) -> f64 {
    let height = values.len() / width;
    let place = |i: usize| {
        let centred = |at: usize, len: usize| (at as f64 + 0.5) / len as f64 - 0.5;
        Vector3::new(1.0, centred(i / width, height), centred(i % width, width))
    };
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (i, v) in values.iter().enumerate() {
        normal += place(i) * place(i).transpose();
        right += place(i) * *v;
    }
    let Some(plane) = normal.try_inverse().map(|inverse| inverse * right) else { return 0.0 };
    let squares: f64 = values.iter().enumerate().map(|(i, v)| (v - plane.dot(&place(i))).powi(2)).sum();
    (squares / (values.len() as f64 - 3.0).max(1.0)).sqrt()
}
