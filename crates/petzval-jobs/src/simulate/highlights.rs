//! How much light the sensor holds: the default exposure, where highlights end, and the warning about them.

use petzval_camera::develop::white_capacity_e;
use petzval_camera::sensor::SensorModel;
use petzval_design::error::DesignError;

use super::request::{Request, is_over_spectrum};
use crate::error::{JobError, Result};

/// Default white, as a share of the white at which the sensor saturates: half a stop below.
const DEFAULT_SHARE: f64 = 0.7;

/// Digits of a default or of a number that is offered.
const DIGITS: i32 = 2;

/// Share of saturated pixels from which there is a warning: hot pixels are fewer.
const WARNED_SHARE: f64 = 1e-3;

/// Electrons of white by default.
pub fn default_white_e(request: &Request, sensor: &SensorModel) -> Result<f32> {
    let share_e = DEFAULT_SHARE * capacity_e(request, sensor)?;
    Ok((share_e / place(share_e)).round() as f32 * place(share_e) as f32)
}

/// Electrons of white with which the first colour saturates. Refuses an exposure in which the dark current leaves no room
/// for light.
pub fn capacity_e(request: &Request, sensor: &SensorModel) -> Result<f64> {
    let capacity_e = white_capacity_e(sensor, f64::from(request.time_s), f64::from(request.gain));
    let capacity_e = capacity_e.map_err(DesignError::from)?;
    if capacity_e > 0.0 {
        return Ok(capacity_e);
    }
    Err(JobError::input(
        format!(
            "--time-s {} at --gain {}: dark current alone saturates the pixels",
            request.time_s, request.gain
        ),
        "expose for less time, or at a lower gain",
    ))
}

/// The value of the last of the [`DIGITS`] digits of a positive number.
fn place(value: f64) -> f64 {
    10f64.powi(value.log10().floor() as i32 + 1 - DIGITS)
}

/// A positive number cut to [`DIGITS`] digits.
fn cut(value: f64) -> f64 {
    // Dividing by a power of ten rather than multiplying with its inverse gives the number that is meant: 0.0017.
    let last = value.log10().floor() as i32 + 1 - DIGITS;
    let digits = (value / place(value) * (1.0 + 1e-9)).floor();
    if last < 0 { digits / 10f64.powi(-last) } else { digits * 10f64.powi(last) }
}

/// How near a shot comes to what the sensor holds.
pub struct Saturation {
    /// Light at which highlights end, 1 = white.
    pub highest: f64,
    /// Share of the pixels that are saturated.
    pub share: f64,
}

impl Saturation {
    /// The saturation of a shot with the share `share` of saturated pixels, if white gives `white_e` electrons.
    pub fn of(request: &Request, sensor: &SensorModel, white_e: f32, share: f64) -> Result<Self> {
        Ok(Self { highest: capacity_e(request, sensor)? / f64::from(white_e), share })
    }

    /// Light that a display shows as white: white, or the end of the highlights if that is less.
    pub fn display_white(&self) -> f32 {
        self.highest.min(1.0) as f32
    }

    /// The warning of a shot that many pixels cannot hold, with settings that would hold it.
    pub fn warning(&self, request: &Request, sensor: &SensorModel, white_e: f32) -> Option<String> {
        if self.share < WARNED_SHARE {
            return None;
        }
        let saturated = format!("{:.1} % of the pixels are saturated", 100.0 * self.share);
        if self.highest >= 1.0 {
            return Some(format!("{saturated}: the scene is brighter than white there"));
        }
        let mut ways = vec![if is_over_spectrum(request) && request.white_e.is_none() {
            format!("--time-s {}", cut(f64::from(request.time_s) * self.highest))
        } else {
            format!("--white-e {}", cut(f64::from(white_e) * self.highest))
        }];
        // What white gives in the colour that saturates first.
        let time_s = f64::from(request.time_s);
        let strongest_e = sensor.light_capacity_e(time_s, f64::from(request.gain)) / self.highest;
        let is_stepped = !sensor.gain_steps.is_empty();
        if let Some(gain) = sensor.gain_for(strongest_e, time_s) {
            ways.push(format!("--gain {}", if is_stepped { gain } else { cut(gain) }));
        }
        Some(format!(
            "{saturated}: white is {:.2} times what the sensor holds at gain {}; {} holds it",
            1.0 / self.highest,
            request.gain,
            ways.join(" or ")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_cut_to_two_digits() {
        for (value, expected) in
            [(15_897.0, 15_000.0), (1.789, 1.7), (0.001_777, 0.001_7), (100.0, 100.0), (7.0, 7.0)]
        {
            assert_eq!(cut(value), expected);
        }
    }
}
