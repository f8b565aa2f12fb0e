mod estimators;
mod fast_path;
mod frame;
mod moments;

use super::*;
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;

fn imx249() -> SensorModel {
    toml::from_str::<SensorModel>(include_str!("../../../../petzval-data/data/sensors/imx249-fitted.toml"))
        .unwrap()
}

/// Every kind of non-uniformity at once.
fn uneven(specimen: u64) -> NonUniformity {
    NonUniformity {
        specimen,
        dsnu_pixel_e: 3.0,
        dsnu_row_e: 1.0,
        dsnu_column_e: 1.5,
        prnu_pixel_percent: 1.2,
        prnu_row_percent: 0.4,
        prnu_column_percent: 0.6,
        hot_pixel_share: 0.01,
        hot_pixel_e_per_s: 800.0,
        row_noise_e: 0.8,
        column_noise_e: 0.7,
    }
}

fn capture(white_e: f32, time_s: f32, linear_gain: f32) -> Capture {
    Capture { exposure: Exposure { white_e, time_s, linear_gain }, placement: Placement::default(), frame: 0 }
}

fn noise(mode: NoiseMode) -> Noise {
    Noise { mode, seed: 20 }
}

/// Number of values, mean, variance and fourth central moment.
fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64, f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let central = |p: i32| values.clone().map(|v| (v - mean).powi(p)).sum::<f64>() / n;
    (n, mean, central(2), central(4))
}
