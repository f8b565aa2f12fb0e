//! From digital numbers back to light: the linear, colour-filled picture that a raw frame holds.
//!
//! ```text
//! raw - dark mean -> / (K g white_e) -> / relative QE (white balance) -> bilinear demosaic -> linear RGB
//! ```
//!
//! The map is affine in the digital numbers; its linear part has the exact transpose [`develop_adjoint`].

mod demosaic;

pub use demosaic::{demosaic_bilinear, demosaic_bilinear_adjoint};

use crate::image::{CHANNELS, LinearImage};
use crate::sensor::{Capture, Exposure, Raw, SensorError, SensorModel};

/// Mean digital number of a dark pixel, `BL + K g (mu_r + mu_I t) + mu_el`, DN.
///
/// This, not the black level alone, is what development subtracts.
pub fn dark_mean_dn(sensor: &SensorModel, exposure: &Exposure) -> f64 {
    let dark_e = sensor.read_noise_mean_e + sensor.dark_current_e_per_s * exposure.time_s as f64;
    let gain = sensor.gain_dn_per_e * exposure.linear_gain as f64;
    sensor.black_level_dn + gain * dark_e + sensor.electronics_mean_dn
}

/// Develops a raw frame to linear RGB, 1.0 = white; noise may take values below 0.
pub fn develop(raw: &Raw, sensor: &SensorModel) -> Result<LinearImage, SensorError> {
    let n = raw.height * raw.width;
    check(sensor, &raw.capture, "raw frame", n, raw.dn.len())?;
    // Take off the dark signal, then weigh each colour so that white light gives equal values.
    let dark = dark_mean_dn(sensor, &raw.capture.exposure);
    let scale = light_per_dn(sensor, &raw.capture.exposure);
    let placement = raw.capture.placement;
    let mut mosaic = vec![0.0f32; n];
    for (i, (value, dn)) in mosaic.iter_mut().zip(&raw.dn).enumerate() {
        let colour = sensor.cfa.colour(placement.row + i / raw.width, placement.col + i % raw.width);
        *value = ((*dn as f64 - dark) * colour.plane().map_or(1.0, |c| scale[c])) as f32;
    }
    demosaic_bilinear(&mosaic, raw.height, raw.width, sensor.cfa, placement)
}

/// Transpose of the linear part of [`develop`]: gradient with respect to the digital numbers.
pub fn develop_adjoint(
    d_rgb: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
) -> Result<Vec<f32>, SensorError> {
    let n = d_rgb.height * d_rgb.width;
    check(sensor, capture, "gradient of the developed picture", CHANNELS * n, d_rgb.data.len())?;
    let scale = light_per_dn(sensor, &capture.exposure);
    let placement = capture.placement;
    let mut d_dn = demosaic_bilinear_adjoint(d_rgb, sensor.cfa, placement)?;
    for (i, value) in d_dn.iter_mut().enumerate() {
        let colour = sensor.cfa.colour(placement.row + i / d_rgb.width, placement.col + i % d_rgb.width);
        *value = (*value as f64 * colour.plane().map_or(1.0, |c| scale[c])) as f32;
    }
    Ok(d_dn)
}

/// Lifts the dim corners: divides by relative illumination, at most by `1 / floor`.
///
/// `map` comes from [`crate::render::illumination_map`]; `floor` in (0, 1] bounds the gain where little light arrives.
pub fn correct_shading(
    image: &LinearImage,
    map: &LinearImage,
    floor: f32,
) -> Result<LinearImage, SensorError> {
    let shape = |i: &LinearImage| format!("{}x{}x{}", i.channels, i.height, i.width);
    if shape(image) != shape(map) || image.data.len() != map.data.len() {
        return Err(SensorError::Shape { what: "illumination map", expected: shape(image), got: shape(map) });
    }
    if !(floor > 0.0 && floor <= 1.0) {
        return Err(SensorError::ShadingFloor { value: floor });
    }
    let data = image.data.iter().zip(&map.data).map(|(v, m)| v / m.max(floor)).collect();
    Ok(LinearImage { data, ..*image })
}

/// Linear light per digital number of each colour, `1 / (K g white_e s_c)`.
fn light_per_dn(sensor: &SensorModel, exposure: &Exposure) -> [f64; CHANNELS] {
    let dn_per_unit = sensor.gain_dn_per_e * exposure.linear_gain as f64 * exposure.white_e as f64;
    sensor.relative_qe.map(|qe| 1.0 / (dn_per_unit * qe))
}

fn check(
    sensor: &SensorModel,
    capture: &Capture,
    what: &'static str,
    expected: usize,
    got: usize,
) -> Result<(), SensorError> {
    sensor.validate()?;
    capture.exposure.validate()?;
    if expected == got {
        return Ok(());
    }
    Err(SensorError::Shape { what, expected: format!("{expected} values"), got: format!("{got} values") })
}

#[cfg(test)]
mod tests;
