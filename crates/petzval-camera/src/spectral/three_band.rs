//! RGB as the fast path: the electrons of each filter colour are a fixed mixture of red, green and blue.
//!
//! The spectra that [`upsample`](super::upsample) gives to RGB colours are linear in RGB, and electrons are linear in the
//! spectrum. Three integrals over the spectrum are therefore enough, one per primary:
//!
//! ```text
//! electrons_c = sum_k M_ck rgb_k,   M_ck = sum_l Q_c(l) s_c N_k(l)
//! ```
//!
//! with N_k the photons of primary k. The sums of the rows are the electrons of white. That of green pixels is `white_e`;
//! relative to it, the sums are the `relative_qe` by which a sensor file summarises the spectrum.

use super::electrons::{ColourElectrons, ElectronsError, band_weights};
use super::illuminant::Illuminant;
use super::upsampling::basis_bands;
use crate::image::{CHANNELS, LinearImage};
use crate::sensor::{Colour, SensorModel};
use crate::spectrum::PixelOptics;

/// Electrons per unit of linear red, green and blue, 1.0 = the perfect diffuser, for each colour of a filter array.
#[derive(Debug, Clone, PartialEq)]
pub struct ThreeBand {
    /// The colours with their row of the matrix.
    pub rows: Vec<(Colour, [f64; 3])>,
}

impl ThreeBand {
    /// The matrix of a sensor and a lens that images matt surfaces under `light` with an illuminance of `lux`. Integrals are
    /// sums over the bands `band_um` (um, ascending, at least two). Fails if a colour has no curve, or no electrons for white.
    pub fn new(
        sensor: &SensorModel,
        optics: &PixelOptics,
        light: &Illuminant,
        lux: f64,
        band_um: &[f64],
    ) -> Result<Self, ElectronsError> {
        let primaries = basis_bands(light, lux, band_um);
        let rows: Vec<(Colour, [f64; 3])> = band_weights(sensor, optics, band_um)?
            .into_iter()
            .map(|(colour, weights)| {
                let sum = |band: &Vec<f64>| weights.iter().zip(band).map(|(w, l)| w * l).sum();
                (colour, primaries.each_ref().map(sum))
            })
            .collect();
        let dark = rows.iter().find(|(_, row)| row.iter().sum::<f64>() <= 0.0);
        dark.map_or(Ok(()), |(colour, _)| Err(ElectronsError::NoSignal(*colour)))?;
        Ok(Self { rows })
    }

    /// Electrons that white gives in a pixel of a colour; `None` if the array has no such pixel.
    pub fn white_of(&self, colour: Colour) -> Option<f64> {
        self.rows.iter().find(|(c, _)| *c == colour).map(|(_, row)| row.iter().sum())
    }

    /// Electrons that white gives in a green pixel. In an array without green pixels it is a pixel of the first colour.
    pub fn white_e(&self) -> f64 {
        let first = self.rows.first().map_or(0.0, |(_, row)| row.iter().sum());
        self.white_of(Colour::Green).unwrap_or(first)
    }

    /// The sensor with the relative efficiencies for this light, which also set the white balance of development. Colours
    /// without pixels keep their efficiency.
    pub fn balanced(&self, sensor: &SensorModel) -> SensorModel {
        let white_e = self.white_e();
        let mut balanced = sensor.clone();
        for (colour, row) in &self.rows {
            match colour.plane() {
                Some(plane) => balanced.relative_qe[plane] = row.iter().sum::<f64>() / white_e,
                None => balanced.clear_response = row.map(|v| v / white_e),
            }
        }
        balanced
    }
}

impl ColourElectrons {
    /// Electrons of a three-band picture by the 3x3 (or 3x4) matrix of `bands`: the fast path.
    pub fn of_rgb(photo: &LinearImage, bands: &ThreeBand) -> Self {
        let planes = bands.rows.iter().map(|(colour, row)| {
            let row = row.map(|v| v as f32);
            let plane = |c: usize| photo.plane(c.min(photo.channels.max(1) - 1));
            let (r, g, b) = (plane(0), plane(1), plane(CHANNELS - 1));
            let electrons = (0..r.len()).map(|i| row[0] * r[i] + row[1] * g[i] + row[2] * b[i]).collect();
            (*colour, electrons)
        });
        let planes = planes.collect();
        Self { height: photo.height, width: photo.width, planes }
    }
}

#[cfg(test)]
mod tests {
    use super::super::electrons::ColourElectrons;
    use super::super::upsampling::{srgb_basis, upsample};
    use super::*;
    use crate::image::{CHANNELS, LinearImage};
    use crate::render::Placement;
    use crate::sensor::{Capture, CfaPattern, Exposure, Noise, NoiseMode, QuantumEfficiency, expose};
    use crate::spectrum::bands::even_bands;
    use rand::{RngExt, SeedableRng};

    fn sensor() -> SensorModel {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        let curves = include_str!("../../../petzval-data/data/quantum-efficiency/imx219.toml");
        let mut sensor = toml::from_str::<SensorModel>(text).unwrap();
        sensor.quantum_efficiency = Some(toml::from_str::<QuantumEfficiency>(curves).unwrap());
        sensor
    }

    fn optics() -> PixelOptics {
        PixelOptics { pixel_um: 5.86, f_number: 3.5, time_s: 0.005, transmission: None }
    }

    fn photo() -> LinearImage {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let data = (0..CHANNELS * 40 * 30).map(|_| rng.random::<f32>()).collect();
        LinearImage::from_data(CHANNELS, 40, 30, data).unwrap()
    }

    #[test]
    fn the_matrix_gives_the_electrons_of_the_spectral_path() {
        for (name, bands) in [
            ("D65", even_bands(0.38, 0.78, 81)),
            ("A", even_bands(0.4, 0.7, 16)),
            ("FL11", even_bands(0.4, 0.7, 7)),
        ] {
            let light = Illuminant::named(name).unwrap();
            let matrix = ThreeBand::new(&sensor(), &optics(), &light, 500.0, &bands).unwrap();
            let fast = ColourElectrons::of_rgb(&photo(), &matrix);
            let weights = band_weights(&sensor(), &optics(), &bands).unwrap();
            let slow = ColourElectrons::of(&upsample(&photo(), &light, 500.0, &bands), &weights);
            for ((colour, a), (_, b)) in fast.planes.iter().zip(&slow.planes) {
                let white = matrix.white_of(*colour).unwrap();
                let worst =
                    a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs()) / white).fold(0.0, f64::max);
                assert!(worst < 1e-6, "{name} {colour:?}: {worst}");
            }
        }
    }

    #[test]
    fn few_bands_are_close_to_the_exact_integral() {
        for name in ["D65", "A", "FL11", "LED-B3"] {
            let light = Illuminant::named(name).unwrap();
            let radiance = light.white_radiance(500.0);
            let curves = sensor().quantum_efficiency.unwrap();
            for (count, limit) in [(81, 3e-3), (31, 1.1e-2), (16, 3.5e-2)] {
                let bands = even_bands(0.38, 0.78, count);
                let matrix = ThreeBand::new(&sensor(), &optics(), &light, 500.0, &bands).unwrap();
                let mut worst = 0.0f64;
                for (colour, row) in &matrix.rows {
                    for (k, basis) in srgb_basis().iter().enumerate() {
                        let exact = optics()
                            .electrons(&radiance.times(basis).unwrap(), &curves.curve(*colour).unwrap());
                        worst = worst.max((row[k] - exact).abs() / matrix.white_of(*colour).unwrap());
                    }
                }
                assert!(worst < limit, "{name}, {count} bands: {worst}");
            }
        }
    }

    #[test]
    fn the_sensor_collects_the_electrons_of_each_filter() {
        let bands = even_bands(0.4, 0.7, 16);
        for cfa in ["GBRG", "mono", "WR/GW"] {
            let mut sensor = SensorModel { cfa: cfa.parse::<CfaPattern>().unwrap(), ..sensor() };
            let curves = sensor.quantum_efficiency.as_mut().unwrap();
            curves.clear = curves.green.iter().map(|v| (v + 0.2) / 1.3).collect();
            let light = Illuminant::named("D50").unwrap();
            let matrix = ThreeBand::new(&sensor, &optics(), &light, 2000.0, &bands).unwrap();
            let balanced = matrix.balanced(&sensor);
            let electrons = ColourElectrons::of_rgb(&photo(), &matrix);
            let placement = Placement { row: 3, col: 5 };
            let seen = electrons.as_light(&balanced, matrix.white_e(), placement);
            let exposure = Exposure { white_e: matrix.white_e() as f32, time_s: 0.0, linear_gain: 1.0 };
            let capture = Capture { exposure, placement, frame: 0 };
            let raw = expose(&seen, &balanced, &capture, &Noise { mode: NoiseMode::Off, seed: 1 }).unwrap();
            for (i, dn) in raw.dn.iter().enumerate() {
                let colour = sensor.cfa.colour(3 + i / 30, 5 + i % 30);
                let plane = &electrons.planes.iter().find(|(c, _)| *c == colour).unwrap().1;
                let dark = sensor.black_level_dn + sensor.electronics_mean_dn;
                let expected = sensor.gain_dn_per_e * (f64::from(plane[i]) + sensor.read_noise_mean_e) + dark;
                let expected = expected.min(sensor.max_dn());
                assert!(
                    (f64::from(*dn) - expected).abs() < 1e-3 * expected.max(1.0),
                    "{cfa} {i}: {dn} {expected}"
                );
            }
        }
    }

    #[test]
    fn relative_efficiency_is_one_for_green_and_follows_the_light() {
        let bands = even_bands(0.4, 0.7, 31);
        let relative = |name: &str| {
            let light = Illuminant::named(name).unwrap();
            ThreeBand::new(&sensor(), &optics(), &light, 500.0, &bands)
                .unwrap()
                .balanced(&sensor())
                .relative_qe
        };
        let (day, bulb) = (relative("D65"), relative("A"));
        assert_eq!((day[1], bulb[1]), (1.0, 1.0));
        assert!(bulb[0] > 1.2 * day[0] && bulb[2] < 0.8 * day[2], "{day:?} {bulb:?}");
        let lux = |lux: f64| {
            let light = Illuminant::named("D65").unwrap();
            ThreeBand::new(&sensor(), &optics(), &light, lux, &bands).unwrap().white_e()
        };
        assert!((lux(1000.0) / lux(500.0) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn missing_curves_are_named() {
        let light = Illuminant::named("D65").unwrap();
        let bands = even_bands(0.4, 0.7, 4);
        let matrix = |sensor: &SensorModel| ThreeBand::new(sensor, &optics(), &light, 1.0, &bands);
        let none = SensorModel { quantum_efficiency: None, ..sensor() };
        assert!(matches!(matrix(&none), Err(ElectronsError::NoCurves(_))));
        let mono = SensorModel { cfa: CfaPattern::MONO, ..sensor() };
        assert_eq!(matrix(&mono), Err(ElectronsError::NoCurve(Colour::Clear)));
    }
}
