//! Saturation of a sensor: at the maximum of its converter, or below it at the full well.

use super::SensorModel;

impl SensorModel {
    /// Mean digital number of a saturated pixel at linear gain g, DN:
    ///
    /// ```text
    /// W = min(2^bits - 1, BL + mu_el + K g (FWC + mu_r))
    /// ```
    ///
    /// This is the largest number of the converter or the mean reading of a full well, offsets of the read-out included. Read
    /// and electronics noise scatter the readings of full wells about it.
    pub fn white_level_dn(&self, linear_gain: f64) -> f64 {
        let zero_dn = self.black_level_dn + self.electronics_mean_dn;
        let full_dn = self.gain_dn_per_e * linear_gain * (self.full_well_e + self.read_noise_mean_e);
        (zero_dn + full_dn).min(self.max_dn())
    }

    /// Photoelectrons that saturate a pixel, `(W - BL - mu_el) / (K g) - mu_r - mu_I t`: dark current fills the same well. The
    /// result is zero or negative if a dark pixel is already saturated.
    pub fn light_capacity_e(&self, time_s: f64, linear_gain: f64) -> f64 {
        let range_dn = self.white_level_dn(linear_gain) - self.black_level_dn - self.electronics_mean_dn;
        let dark_e = self.read_noise_mean_e + self.dark_current_e_per_s * time_s;
        range_dn / (self.gain_dn_per_e * linear_gain) - dark_e
    }

    /// The largest linear gain at which a pixel holds `light_e` photoelectrons without saturation. For a sensor with gain steps
    /// it is the largest of those steps that does. `None` if the well is too small at any gain, or if every step is too large.
    pub fn gain_for(&self, light_e: f64, time_s: f64) -> Option<f64> {
        let collected_e = light_e + self.dark_current_e_per_s * time_s;
        let range_dn = self.max_dn() - self.black_level_dn - self.electronics_mean_dn;
        let most = range_dn / (self.gain_dn_per_e * (collected_e + self.read_noise_mean_e));
        if collected_e > self.full_well_e || most.is_nan() || most <= 0.0 {
            return None;
        }
        if self.gain_steps.is_empty() {
            return Some(most);
        }
        self.gain_steps.iter().copied().filter(|step| *step <= most).max_by(f64::total_cmp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{CHANNELS, LinearImage};
    use crate::render::Placement;
    use crate::sensor::{Capture, Exposure, Noise, NoiseMode, expose};

    fn sensor(full_well_e: f64) -> SensorModel {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        SensorModel { full_well_e, ..toml::from_str::<SensorModel>(text).unwrap() }
    }

    /// Noiseless digital number of a green pixel with `light_e` photoelectrons.
    fn exposed_dn(sensor: &SensorModel, light_e: f64, gain: f32) -> f64 {
        let light = LinearImage::filled(CHANNELS, 2, 2, 1.0);
        let exposure = Exposure { white_e: light_e as f32, time_s: 0.02, linear_gain: gain };
        let capture = Capture { exposure, placement: Placement::default(), frame: 0 };
        let noise = Noise { mode: NoiseMode::Off, seed: 0 };
        f64::from(expose(&light, sensor, &capture, &noise).unwrap().dn[1])
    }

    #[test]
    fn an_exposure_far_beyond_the_capacity_gives_the_white_level() {
        // The converter saturates first, or the well: 10,000 e- at 7.1 e- per DN.
        for (well_e, gain) in
            [(33_723.0, 1.0), (33_723.0, 4.0), (10_000.0, 1.0), (10_000.0, 2.0), (10_000.0, 8.0)]
        {
            let sensor = sensor(well_e);
            let white = sensor.white_level_dn(gain);
            assert!((exposed_dn(&sensor, 1e6, gain as f32) - white).abs() < 1e-3, "{well_e} {gain}");
            let capacity = sensor.light_capacity_e(0.02, gain);
            assert!((exposed_dn(&sensor, capacity, gain as f32) - white).abs() < 1e-2, "{well_e} {gain}");
            assert!(exposed_dn(&sensor, 0.99 * capacity, gain as f32) < 0.995 * white, "{well_e} {gain}");
        }
        let well = sensor(10_000.0);
        assert!((well.white_level_dn(1.0) - (119.0 + 1.15 + 0.14 * 10_003.25)).abs() < 1e-9);
        assert_eq!(well.white_level_dn(4.0), 4095.0);
    }

    #[test]
    fn gain_for_light_is_the_largest_gain_without_saturation() {
        let sensor = sensor(33_723.0);
        let gain = sensor.gain_for(5000.0, 0.02).unwrap();
        assert!((sensor.light_capacity_e(0.02, gain) - 5000.0).abs() < 1e-6);
        assert_eq!(sensor.gain_for(40_000.0, 0.02), None);
        let stepped = SensorModel { gain_steps: vec![1.0, 4.0, 16.0], ..sensor };
        assert_eq!(stepped.gain_for(5000.0, 0.02), Some(4.0));
        assert_eq!(stepped.gain_for(30_000.0, 0.02), None);
    }
}
