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

/// Least range between the dark and saturation, DN: below it no frame can be developed. A converter of one bit has 1.
const LEAST_RANGE_DN: f64 = 2.0;

/// Electrons of white by default.
pub fn default_white_e(request: &Request, sensor: &SensorModel) -> Result<f32> {
    let share_e = DEFAULT_SHARE * capacity_e(request, sensor)?;
    Ok((share_e / place(share_e)).round() as f32 * place(share_e) as f32)
}

/// Electrons of white with which the first colour saturates. Refuses a sensor without range for light at the gain, and an exposure in
/// which the dark current leaves none.
pub fn capacity_e(request: &Request, sensor: &SensorModel) -> Result<f64> {
    check_range(request, sensor)?;
    let (time_s, gain) = (f64::from(request.time_s), f64::from(request.gain));
    let capacity_e = white_capacity_e(sensor, time_s, gain).map_err(DesignError::from)?;
    let light_dn = sensor.light_capacity_e(time_s, gain) * sensor.gain_dn_per_e * gain;
    if capacity_e > 0.0 && light_dn >= (1.0 - 1e-9) * least_range_dn(sensor) {
        return Ok(capacity_e);
    }
    let effect = if light_dn > 0.0 {
        format!("dark current leaves {light_dn:.2} DN for light")
    } else {
        "dark current alone saturates the pixels".to_owned()
    };
    Err(JobError::input(
        format!("--time-s {} at --gain {}: {effect}", request.time_s, request.gain),
        "expose for less time, or at a lower gain",
    ))
}

/// Least range of a sensor, DN.
fn least_range_dn(sensor: &SensorModel) -> f64 {
    LEAST_RANGE_DN.min(sensor.max_dn())
}

/// Refuses a sensor that has no range for light at the gain, however short the exposure: `2^bits - 1` above the dark, or `K g FWC`.
fn check_range(request: &Request, sensor: &SensorModel) -> Result<()> {
    let (least_dn, max_dn) = (least_range_dn(sensor), sensor.max_dn());
    let gain_dn_per_e = sensor.gain_dn_per_e * f64::from(request.gain);
    let SensorModel { bits, black_level_dn, full_well_e, .. } = *sensor;
    let dark_dn = black_level_dn + sensor.electronics_mean_dn + gain_dn_per_e * sensor.read_noise_mean_e;
    if max_dn - dark_dn < least_dn {
        return Err(JobError::input(
            format!(
                "{}: `black_level_dn = {black_level_dn}` leaves no range for light: the dark lies at {dark_dn:.2} DN, and {bits} bits end at {max_dn} DN",
                request.sensor
            ),
            format!(
                "lower `black_level_dn` of the sensor by {:.0} DN or more, or raise its `bits`",
                (least_dn - (max_dn - dark_dn)).ceil()
            ),
        ));
    }
    let well_dn = gain_dn_per_e * full_well_e;
    if well_dn < least_dn {
        return Err(JobError::input(
            format!(
                "{}: `full_well_e = {full_well_e}` times `gain_dn_per_e = {}` at --gain {} is {well_dn:.2} DN: full pixels are no brighter than black",
                request.sensor, sensor.gain_dn_per_e, request.gain
            ),
            format!(
                "correct the two in the sensor, or raise --gain: their product with it must be {least_dn} DN or more"
            ),
        ));
    }
    Ok(())
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
    fn a_sensor_without_range_is_refused_with_the_cause() {
        let request = Request::default();
        let sensor = SensorModel {
            bits: 8,
            black_level_dn: 10.0,
            gain_dn_per_e: 0.02,
            full_well_e: 12_000.0,
            dark_current_e_per_s: 0.0,
            read_noise_mean_e: 0.0,
            electronics_mean_dn: 0.0,
            ..crate::built_in_assets().sensor("imx249-fitted").unwrap()
        };
        let refused = |request: &Request, sensor: SensorModel| match capacity_e(request, &sensor) {
            Err(error) => error.to_string(),
            Ok(capacity_e) => panic!("{capacity_e} e-"),
        };
        assert!(capacity_e(&request, &sensor).is_ok());
        for black_level_dn in [254.0, 255.0] {
            let said = refused(&request, SensorModel { black_level_dn, ..sensor.clone() });
            let wanted = format!("`black_level_dn = {black_level_dn}` leaves no range for light");
            assert!(said.contains(&wanted) && !said.contains("dark current"), "{said}");
        }
        let small = SensorModel { full_well_e: 1.0, ..sensor.clone() };
        let said = refused(&request, small.clone());
        assert!(
            said.contains("`full_well_e = 1` times `gain_dn_per_e = 0.02` at --gain 1 is 0.02 DN"),
            "{said}"
        );
        // What the hints name works.
        assert!(capacity_e(&Request { gain: 100.0, ..request.clone() }, &small).is_ok());
        let lowered = SensorModel { black_level_dn: 253.0, ..sensor.clone() };
        assert!(capacity_e(&request, &lowered).is_ok());
        // A converter of one bit has a range of 1.
        assert!(
            capacity_e(&request, &SensorModel { bits: 1, black_level_dn: 0.0, ..sensor.clone() }).is_ok()
        );
        // The well holds 12,000 electrons.
        for (dark_current_e_per_s, said) in [(11_990.0, "leaves 0.20 DN"), (13_000.0, "alone saturates")] {
            let dark = SensorModel { dark_current_e_per_s, ..sensor.clone() };
            let found = refused(&Request { time_s: 1.0, ..request.clone() }, dark);
            assert!(found.contains(said) && found.contains("--time-s 1"), "{found}");
        }
    }

    #[test]
    fn numbers_are_cut_to_two_digits() {
        for (value, expected) in
            [(15_897.0, 15_000.0), (1.789, 1.7), (0.001_777, 0.001_7), (100.0, 100.0), (7.0, 7.0)]
        {
            assert_eq!(cut(value), expected);
        }
    }
}
