//! Development: from digital numbers back to light, a linear picture with three colours per pixel.
//!
//! ```text
//! raw - dark mean -> / (K g white_e) -> / response to white (white balance) -> bilinear demosaic -> linear RGB
//! ```
//!
//! The map is affine in the digital numbers; its linear part has the exact transpose [`develop_adjoint`]. Development does
//! not clip saturated colours, so its gradient stays linear. For pictures to look at, apply [`clip_highlights`] first.

mod bilinear;
mod clear;
mod demosaic;
mod highlights;
mod interpolation;
mod linear;
mod linear_interpolation;
mod noise_level;
mod stabilise;

use bilinear::GRADIENT;
pub(crate) use bilinear::check_mosaic;
pub use bilinear::{demosaic_bilinear, demosaic_bilinear_adjoint};
pub use demosaic::Demosaic;
pub(crate) use highlights::clip_levels_dn;
pub use highlights::{clip_highlights, saturated_share, white_capacity_e};
pub use interpolation::{Domain, Interpolation};
pub(crate) use linear::highest_light;
pub use linear::{LinearIsp, SHADING_FLOOR};
pub use noise_level::stabilised_noise;
pub(crate) use noise_level::{Electrons, MEAN_LIGHT, NATURAL_POWER};
pub use stabilise::Stabiliser;

use std::borrow::Cow;

use self::clear::ClearColours;
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{Capture, Colour, Exposure, Raw, SensorError, SensorModel};

/// Mean digital number of a dark pixel, `BL + K g (mu_r + mu_I t) + mu_el`, DN.
///
/// Development subtracts this, not the black level alone. It is the mean of an ordinary pixel: hot pixels stay bright.
pub fn dark_mean_dn(sensor: &SensorModel, exposure: &Exposure) -> f64 {
    let dark_e = sensor.read_noise_mean_e + sensor.dark_current_e_per_s * exposure.time_s as f64;
    let gain = sensor.gain_dn_per_e * exposure.linear_gain as f64;
    sensor.black_level_dn + gain * dark_e + sensor.electronics_mean_dn
}

/// Develops a raw frame to linear RGB, 1.0 = white. Noise can make values negative.
pub fn develop(raw: &Raw, sensor: &SensorModel) -> Result<LinearImage, SensorError> {
    develop_by(raw, &Interpolation::default(), sensor)
}

/// [`develop`] with another interpolation of the colours.
pub fn develop_by(
    raw: &Raw,
    interpolation: &Interpolation,
    sensor: &SensorModel,
) -> Result<LinearImage, SensorError> {
    let mut picture =
        interpolation.apply(&balanced_mosaic(raw, sensor)?, raw.height, sensor, &raw.capture)?;
    // Colours without a filter come from the clear pixels, less what these see of the other colours.
    if let Some(clear) = ClearColours::of(sensor)? {
        clear.apply(&mut picture);
    }
    Ok(picture)
}

/// The cotangent of the interpolated planes from that of the picture.
fn of_planes<'a>(d_rgb: &'a LinearImage, sensor: &SensorModel) -> Result<Cow<'a, LinearImage>, SensorError> {
    let Some(clear) = ClearColours::of(sensor)? else { return Ok(Cow::Borrowed(d_rgb)) };
    let mut d_planes = d_rgb.clone();
    clear.pull_back(&mut d_planes);
    Ok(Cow::Owned(d_planes))
}

/// The light of each pixel of a raw frame, 1 = white: without the dark signal, and scaled by colour so that white light gives equal
/// values.
fn balanced_mosaic(raw: &Raw, sensor: &SensorModel) -> Result<Vec<f32>, SensorError> {
    let n = raw.height * raw.width;
    check(sensor, &raw.capture, "raw frame", n, raw.dn.len())?;
    // Subtract the dark signal, then scale each colour so that white light gives equal values.
    let dark = dark_mean_dn(sensor, &raw.capture.exposure);
    let scale = light_per_dn(sensor, &raw.capture.exposure);
    let placement = raw.capture.placement;
    let (width, period) = (raw.width.max(1), sensor.cfa.cols());
    let mut mosaic = vec![0.0f32; n];
    for (row, (values, dn)) in mosaic.chunks_mut(width).zip(raw.dn.chunks(width)).enumerate() {
        let of = |col| scale[sensor.cfa.colour(placement.row + row, placement.col + col) as usize];
        let scales: Vec<f64> = (0..period).map(of).collect();
        for (values, dn) in values.chunks_mut(period).zip(dn.chunks(period)) {
            for ((value, dn), scale) in values.iter_mut().zip(dn).zip(&scales) {
                *value = ((f64::from(*dn) - dark) * scale) as f32;
            }
        }
    }
    Ok(mosaic)
}

/// Transpose of the linear part of [`develop`]: from the cotangent of the picture to the cotangent of the digital numbers.
pub fn develop_adjoint(
    d_rgb: &LinearImage,
    sensor: &SensorModel,
    capture: &Capture,
) -> Result<Vec<f32>, SensorError> {
    let n = d_rgb.height * d_rgb.width;
    check(sensor, capture, GRADIENT, CHANNELS * n, d_rgb.data.len())?;
    let d_planes = of_planes(d_rgb, sensor)?;
    let d_mosaic = demosaic_bilinear_adjoint(&d_planes, sensor.cfa, capture.placement)?;
    Ok(per_dn(d_mosaic, d_rgb.width, sensor, capture))
}

/// The cotangent of the digital numbers of `raw` from that of its picture by [`develop_by`].
pub fn develop_by_adjoint(
    d_rgb: &LinearImage,
    raw: &Raw,
    interpolation: &Interpolation,
    sensor: &SensorModel,
) -> Result<Vec<f32>, SensorError> {
    let (n, capture) = (raw.height * raw.width, &raw.capture);
    if (raw.height, raw.width) != (d_rgb.height, d_rgb.width) {
        let shape = |height: usize, width: usize| format!("{height} x {width} pixels");
        let (expected, got) = (shape(raw.height, raw.width), shape(d_rgb.height, d_rgb.width));
        return Err(SensorError::shape(GRADIENT, expected, got));
    }
    check(sensor, capture, GRADIENT, CHANNELS * n, d_rgb.data.len())?;
    let d_planes = of_planes(d_rgb, sensor)?;
    let d_mosaic = interpolation.adjoint(&balanced_mosaic(raw, sensor)?, &d_planes, sensor, capture)?;
    Ok(per_dn(d_mosaic, d_rgb.width, sensor, capture))
}

/// The cotangent of digital numbers from that of the light of their pixels.
fn per_dn(mut d_mosaic: Vec<f32>, width: usize, sensor: &SensorModel, capture: &Capture) -> Vec<f32> {
    let (scale, placement) = (light_per_dn(sensor, &capture.exposure), capture.placement);
    for (i, value) in d_mosaic.iter_mut().enumerate() {
        let colour = sensor.cfa.colour(placement.row + i / width, placement.col + i % width);
        *value = (*value as f64 * scale[colour as usize]) as f32;
    }
    d_mosaic
}

/// Checks that a mosaic of this size of a sensor can be demosaiced.
pub(crate) fn check_colours(sensor: &SensorModel, height: usize, width: usize) -> Result<(), SensorError> {
    if sensor.cfa.is_bayer() {
        return Ok(());
    }
    ClearColours::of(sensor)?;
    linear_interpolation::LinearInterpolation::new(sensor.cfa, Placement::default(), height, width)
        .map(|_| ())
}

/// Corrects shading: divides the image by the relative illumination.
///
/// `map` comes from [`crate::render::illumination_map`] and has the shape of the image. `floor` in (0, 1] limits the
/// amplification of dim corners to `1 / floor`. Fails on another shape or floor.
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

/// Linear light per digital number of red, green, blue and clear pixels, `1 / (K g white_e s)`, where `s` is the response
/// of a pixel to white light.
pub(crate) fn light_per_dn(sensor: &SensorModel, exposure: &Exposure) -> [f64; Colour::ALL.len()] {
    let dn_per_unit = sensor.gain_dn_per_e * exposure.linear_gain as f64 * exposure.white_e as f64;
    Colour::ALL.map(|colour| 1.0 / (dn_per_unit * sensor.response(colour).iter().sum::<f64>()))
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
