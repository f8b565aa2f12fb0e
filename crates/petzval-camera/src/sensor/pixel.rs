//! One pixel of one exposure: the physics, step by step. [`crate::sensor::expose()`] applies the same steps to whole rows.

use super::fixed_pattern::{Pattern, PixelPattern};
use super::noise::FrameStreams;
use super::{Capture, Electronics, Noise, SensorModel};
use crate::image::CHANNELS;
use petzval_base::random::place;

/// A pixel's digital number and its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelReading {
    /// Digital number.
    pub dn: f32,
    /// Its derivative with respect to the light in the pixel ([`SensorModel::response`] times irradiance), DN per unit.
    pub by_light: f32,
}

/// Reading of sensor pixel `(row, col)` under `irradiance` (red, green, blue; 1.0 = white). This is the readable reference
/// of [`crate::sensor::expose_with_tape`], which gives the same bits.
///
/// `capture.placement` is not used. Irradiance that is not finite gives NaN.
pub fn expose_pixel(
    irradiance: [f32; CHANNELS],
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
    (row, col): (usize, usize),
) -> PixelReading {
    let streams = FrameStreams::new(noise, capture);
    let chain = Chain::new(sensor, capture, streams.noisy());
    let pattern = Pattern::new(&sensor.nonuniformity, Some(&streams)).pixel(row, col);
    let at = place(row, col);
    let light = light(sensor.response(sensor.cfa.colour(row, col)), irradiance);
    let rate = chain.rate_e(light, &pattern);
    let (electrons, d_rate) = streams.electrons(rate, at);
    let z = if streams.noisy() { streams.read.normals(at) } else { [0.0; 2] };
    chain.read_out(&Charge { light, electrons, d_rate }, &pattern, z)
}

/// The light that the filter passes: response times irradiance, 1.0 = white in green.
#[inline(always)]
pub(super) fn light(response: [f64; CHANNELS], irradiance: [f32; CHANNELS]) -> f64 {
    response[0] * irradiance[0] as f64
        + response[1] * irradiance[1] as f64
        + response[2] * irradiance[2] as f64
}

/// The charge of a pixel at the end of the exposure.
#[derive(Debug, Clone, Copy)]
pub(super) struct Charge {
    /// Light, 1.0 = white in green.
    pub light: f64,
    /// Electrons, and their derivative with respect to the mean.
    pub electrons: f64,
    pub d_rate: f64,
}

/// The numbers of sensor and exposure that every pixel needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chain {
    white_e: f64,
    time_s: f64,
    dark_current_e_per_s: f64,
    full_well_e: f64,
    read_mean_e: f64,
    read_noise_e: f64,
    gain_dn_per_e: f64,
    black_level_dn: f64,
    electronics_mean_dn: f64,
    electronics_noise_dn: f64,
    after_adc: bool,
    rounds: bool,
    max_dn: f64,
}

impl Chain {
    pub fn new(sensor: &SensorModel, capture: &Capture, noisy: bool) -> Self {
        Self {
            white_e: capture.exposure.white_e as f64,
            time_s: capture.exposure.time_s as f64,
            dark_current_e_per_s: sensor.dark_current_e_per_s,
            full_well_e: sensor.full_well_e,
            read_mean_e: sensor.read_noise_mean_e,
            read_noise_e: sensor.read_noise_e,
            gain_dn_per_e: sensor.gain_dn_per_e * capture.exposure.linear_gain as f64,
            black_level_dn: sensor.black_level_dn,
            electronics_mean_dn: sensor.electronics_mean_dn,
            electronics_noise_dn: sensor.electronics_noise_dn,
            after_adc: sensor.electronics == Electronics::AfterAdc,
            rounds: noisy,
            max_dn: sensor.max_dn(),
        }
    }

    /// Mean electrons: light frees charge with the pixel's own response, and dark current adds to it. Light that is negative or
    /// not finite counts as none.
    #[inline(always)]
    pub fn rate_e(&self, light: f64, pattern: &PixelPattern) -> f64 {
        let known = if light.is_finite() { light.max(0.0) } else { 0.0 };
        known * self.white_e * pattern.response
            + (self.dark_current_e_per_s + pattern.dark_e_per_s) * self.time_s
    }

    /// From charge to digital number, with two standard normal numbers for read and electronics noise.
    #[inline(always)]
    pub fn read_out(
        &self,
        charge: &Charge,
        pattern: &PixelPattern,
        [z_read, z_el]: [f64; 2],
    ) -> PixelReading {
        // Clip the charge at the full well.
        let well_passes = if charge.electrons < self.full_well_e { 1.0 } else { 0.0 };
        let n = charge.electrons.min(self.full_well_e);

        // Add the pixel's offset and read noise, then amplify electrons to digital numbers.
        let e = n + self.read_mean_e + pattern.offset_e + self.read_noise_e * z_read;
        let signal = self.gain_dn_per_e * e + self.black_level_dn;
        let electronics = self.electronics_mean_dn + self.electronics_noise_dn * z_el;

        // Round and clip in the converter. Electronics noise added after the converter is rounded a second time.
        let (value, passes) = if self.after_adc {
            let (digital, first) = self.convert(signal);
            let (value, second) = self.convert(digital + electronics);
            (value, first * second)
        } else {
            self.convert(signal + electronics)
        };

        // Differentiate the number with respect to light. Rounding passes derivatives unchanged.
        let per_electron = passes * self.gain_dn_per_e;
        let by_rate = per_electron * well_passes * charge.d_rate;
        let by_light = if charge.light < 0.0 { 0.0 } else { by_rate * self.white_e * pattern.response };
        let known = |v: f64| if charge.light.is_finite() { v as f32 } else { f32::NAN };
        PixelReading { dn: known(value), by_light: known(by_light) }
    }

    /// The converter's number for a signal `v` in DN, and the share of a derivative that it passes: 1 inside its range, 0
    /// outside.
    #[inline(always)]
    fn convert(&self, v: f64) -> (f64, f64) {
        let passes = if (v >= 0.0) & (v <= self.max_dn) { 1.0 } else { 0.0 };
        let rounded = if self.rounds { v.round_ties_even() } else { v };
        (rounded.max(0.0).min(self.max_dn), passes)
    }
}
