//! Electrons per pixel for each colour of a sensor's filter array, from spectral images and RGB photographs.

use rayon::prelude::*;

use super::illuminant::Illuminant;
use super::image::SpectralImage;
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{Colour, QuantumEfficiency, SensorModel};
use crate::spectrum::Spectrum;
use crate::spectrum::{OpticsError, PixelOptics};

/// Mean electrons that each pixel would collect behind each of the sensor's filters, before dark current and noise.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourElectrons {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// The colours and their planes, row by row.
    pub planes: Vec<(Colour, Vec<f32>)>,
}

/// Why electrons cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ElectronsError {
    /// A colour of the filter array has no quantum efficiency curve.
    #[error("the sensor has {0:?} pixels, but no quantum efficiency curve of that colour")]
    NoCurve(Colour),
    /// The sensor file has no curves.
    #[error("the sensor `{0}` has no quantum efficiency curves")]
    NoCurves(String),
    /// The light gives no electrons.
    #[error(
        "white gives no electrons in {0:?} pixels: light, transmission and quantum efficiency have no wavelength in common"
    )]
    NoSignal(Colour),
    /// No pixel collects light in the bands of the scene.
    #[error(
        "no pixel of the sensor answers to light of {low_um}..{high_um} um, or the lens lets none of it through"
    )]
    NoBand {
        /// Shortest wavelength, um.
        low_um: f64,
        /// Longest wavelength, um.
        high_um: f64,
    },
    /// A setting of the optics is not a positive number.
    #[error(transparent)]
    Optics(#[from] OpticsError),
}

/// Electrons per unit radiance (W m-2 sr-1 nm-1) in each band for each colour of the filter array, `[colour][band]`.
///
/// The sum over the bands of weight times radiance equals `sum_l Q_c(l) s_c N(l)` of the spectrum that is linear between the
/// bands.
pub fn band_weights(
    sensor: &SensorModel,
    optics: &PixelOptics,
    band_um: &[f64],
) -> Result<Vec<(Colour, Vec<f64>)>, ElectronsError> {
    optics.validate()?;
    let colours = sensor.cfa.colours().into_iter().map(|colour| {
        let curve = curve_of(sensor, colour)?;
        Ok((colour, optics.band_weights(band_um, &curve)))
    });
    colours.collect()
}

/// Shortest and longest wavelength, um, at which white gives electrons: light, transmission and the efficiency of at least
/// one colour of the filter array are not zero there.
pub fn white_range_um(
    sensor: &SensorModel,
    optics: &PixelOptics,
    light: &Illuminant,
) -> Result<(f64, f64), ElectronsError> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for colour in sensor.cfa.colours() {
        let curve = curve_of(sensor, colour)?;
        let factors = [Some(&curve), Some(&light.power), optics.transmission.as_ref()];
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for factor in factors.into_iter().flatten() {
            let (first, last) = factor.support_um().ok_or(ElectronsError::NoSignal(colour))?;
            (from, to) = (from.max(first), to.min(last));
        }
        if from >= to {
            return Err(ElectronsError::NoSignal(colour));
        }
        (low, high) = (low.min(from), high.max(to));
    }
    Ok((low, high))
}

/// Share (0..1) of the electrons of white that comes from wavelengths outside `range_um`. It is the largest over the
/// colours of the filter array.
pub fn share_outside(
    sensor: &SensorModel,
    optics: &PixelOptics,
    light: &Illuminant,
    range_um: (f64, f64),
) -> Result<f64, ElectronsError> {
    let white = light.white_radiance(1.0);
    let inside = white.within(range_um);
    let mut largest = 0.0f64;
    for colour in sensor.cfa.colours() {
        let curve = curve_of(sensor, colour)?;
        let all = optics.electrons(&white, &curve);
        let kept = inside.as_ref().map_or(0.0, |light| optics.electrons(light, &curve));
        if all <= 0.0 {
            return Err(ElectronsError::NoSignal(colour));
        }
        largest = largest.max(1.0 - kept / all);
    }
    Ok(largest)
}

/// The efficiency of the pixels of one colour.
fn curve_of(sensor: &SensorModel, colour: Colour) -> Result<Spectrum, ElectronsError> {
    curves_of(sensor)?.curve(colour).ok_or(ElectronsError::NoCurve(colour))
}

/// The quantum efficiency of a sensor, or an error if it has none.
fn curves_of(sensor: &SensorModel) -> Result<&QuantumEfficiency, ElectronsError> {
    sensor.quantum_efficiency.as_ref().ok_or_else(|| ElectronsError::NoCurves(sensor.name.clone()))
}

impl ColourElectrons {
    /// No electrons, for these colours.
    pub fn none(colours: &[Colour], height: usize, width: usize) -> Self {
        let planes = colours.iter().map(|c| (*c, vec![0.0; height * width])).collect();
        Self { height, width, planes }
    }

    /// Electrons of a spectral image, with [`band_weights`] of its bands.
    pub fn of(image: &SpectralImage, weights: &[(Colour, Vec<f64>)]) -> Self {
        let colours: Vec<Colour> = weights.iter().map(|(c, _)| *c).collect();
        let mut electrons = Self::none(&colours, image.height, image.width);
        for band in 0..image.bands() {
            electrons.add(image.plane(band), weights, band);
        }
        electrons
    }

    /// Adds the electrons of one band, whose radiance is given row by row.
    pub fn add(&mut self, radiance: &[f32], weights: &[(Colour, Vec<f64>)], band: usize) {
        for ((_, plane), (_, weight)) in self.planes.iter_mut().zip(weights) {
            let weight = weight[band] as f32;
            plane.par_iter_mut().zip(radiance).for_each(|(e, l)| *e += weight * l);
        }
    }

    /// The irradiance for [`expose`](crate::sensor::expose) with an exposure of `white_e` electrons. Each pixel has one value in
    /// all three planes, with which the sensor collects the electrons of that pixel's filter.
    ///
    /// A pixel of colour c collects `white_e sum_k response_c[k] E_k`, so `E = electrons / (white_e sum_k response_c[k])`.
    /// This holds for any filter array. The result is already a mosaic: use it only with a capture at the same `placement`.
    pub fn as_light(&self, sensor: &SensorModel, white_e: f64, placement: Placement) -> LinearImage {
        let mut light = LinearImage::zeros(CHANNELS, self.height, self.width);
        let gain =
            Colour::ALL.into_iter().map(|c| (c, 1.0 / (white_e * sensor.response(c).iter().sum::<f64>())));
        let gain: Vec<(Colour, f64)> = gain.collect();
        for row in 0..self.height {
            for col in 0..self.width {
                let colour = sensor.cfa.colour(placement.row + row, placement.col + col);
                let per_electron = gain.iter().find(|(c, _)| *c == colour).map_or(0.0, |(_, g)| *g);
                let plane = self.planes.iter().find(|(c, _)| *c == colour);
                let electrons = plane.map_or(0.0, |(_, p)| p[row * self.width + col]);
                for c in 0..CHANNELS {
                    light.set(c, row, col, (f64::from(electrons) * per_electron) as f32);
                }
            }
        }
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::CfaPattern;
    use crate::spectral::ThreeBand;
    use crate::spectrum::bands::{bands_within, even_bands};

    /// A monochrome sensor with a quantum efficiency of 0.6 from 0.3 to 1.1 um.
    fn mono() -> SensorModel {
        let text = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
        let curves =
            QuantumEfficiency { wavelength_um: vec![0.3, 1.1], clear: vec![0.6, 0.6], ..Default::default() };
        SensorModel {
            quantum_efficiency: Some(curves),
            cfa: CfaPattern::MONO,
            ..toml::from_str::<SensorModel>(text).unwrap()
        }
    }

    #[test]
    fn infrared_light_of_a_bulb_gives_most_electrons_of_a_mono_sensor() {
        let light = Illuminant::named("blackbody:2856").unwrap();
        let optics = PixelOptics { pixel_um: 5.86, f_number: 4.4, time_s: 0.005, transmission: None };
        let range = white_range_um(&mono(), &optics, &light).unwrap();
        assert_eq!(range, (0.3, 1.1));
        let bands = even_bands(range.0, range.1, bands_within(range, 0.02));
        let white = ThreeBand::new(&mono(), &optics, &light, 500.0, &bands).unwrap().white_e();
        let efficiency = Spectrum::new(vec![0.3, 1.1], vec![0.6, 0.6]).unwrap();
        let exact = optics.electrons(&light.white_radiance(500.0), &efficiency);
        assert!((white / exact - 1.0).abs() < 2e-3, "{white} {exact}");
        // The visible alone is a seventh of it.
        let left_out = share_outside(&mono(), &optics, &light, (0.4, 0.7)).unwrap();
        assert!((left_out - (1.0 - 1.0 / 6.56)).abs() < 2e-3, "{left_out}");
        assert!(share_outside(&mono(), &optics, &light, range).unwrap().abs() < 1e-12);
    }

    #[test]
    fn the_range_is_the_overlap_of_light_glass_and_pixels() {
        let light = Illuminant::named("FL11").unwrap();
        let glass = Spectrum::new(vec![0.2, 0.45, 0.5, 0.6, 0.65], vec![0.0, 0.0, 0.9, 0.9, 0.0]).unwrap();
        let optics = PixelOptics { pixel_um: 5.86, f_number: 4.4, time_s: 0.005, transmission: Some(glass) };
        assert_eq!(white_range_um(&mono(), &optics, &light), Ok((0.45, 0.65)));
        let opaque = Spectrum::new(vec![0.2, 2.0], vec![0.0, 0.0]).unwrap();
        let dark = PixelOptics { transmission: Some(opaque), ..optics };
        assert_eq!(white_range_um(&mono(), &dark, &light), Err(ElectronsError::NoSignal(Colour::Clear)));
    }
}
