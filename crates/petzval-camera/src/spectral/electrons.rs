//! Electrons per pixel for each colour of a sensor's filter array: from spectral images, and as what the sensor takes.

use rayon::prelude::*;

use super::image::SpectralImage;
use super::photons::{OpticsError, PixelOptics};
use super::three_band::ThreeBand;
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{Colour, QuantumEfficiency, SensorModel};

/// Mean electrons that a pixel would collect with each of the sensor's filters over it, before dark current and noise.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourElectrons {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// The colours and their planes, row by row.
    pub planes: Vec<(Colour, Vec<f32>)>,
}

/// Why there is no number of electrons.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ElectronsError {
    /// A colour of the filter array has no quantum efficiency curve.
    #[error("the sensor has {0:?} pixels, but no quantum efficiency curve of that colour")]
    NoCurve(Colour),
    /// The sensor file has no curves at all.
    #[error("the sensor `{0}` has no quantum efficiency curves")]
    NoCurves(String),
    /// The light gives no electrons.
    #[error(
        "white gives no electrons in {0:?} pixels: light and quantum efficiency have no wavelength in common"
    )]
    NoSignal(Colour),
    /// A setting of the optics is no positive number.
    #[error(transparent)]
    Optics(#[from] OpticsError),
}

/// Electrons per unit radiance in each band for each colour of the filter array, `[colour][band]`.
///
/// The sum over the bands of weight times radiance is `sum_l Q_c(l) s_c N(l)` of the spectrum that is linear between the bands.
pub fn band_weights(
    sensor: &SensorModel,
    optics: &PixelOptics,
    band_um: &[f64],
) -> Result<Vec<(Colour, Vec<f64>)>, ElectronsError> {
    optics.validate()?;
    let curves = curves_of(sensor)?;
    sensor
        .cfa
        .colours()
        .into_iter()
        .map(|colour| {
            let curve = curves.curve(colour).ok_or(ElectronsError::NoCurve(colour))?;
            Ok((colour, optics.band_weights(band_um, &curve)))
        })
        .collect()
}

/// The quantum efficiency of a sensor that has one.
pub(super) fn curves_of(sensor: &SensorModel) -> Result<&QuantumEfficiency, ElectronsError> {
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

    /// Electrons of a three-band picture by the 3x3 (or 3x4) matrix of `bands`: the fast path.
    pub fn of_rgb(photo: &LinearImage, bands: &ThreeBand) -> Self {
        let planes = bands
            .rows
            .iter()
            .map(|(colour, row)| {
                let row = row.map(|v| v as f32);
                let plane = |c: usize| photo.plane(c.min(photo.channels.max(1) - 1));
                let (r, g, b) = (plane(0), plane(1), plane(CHANNELS - 1));
                let electrons = (0..r.len()).map(|i| row[0] * r[i] + row[1] * g[i] + row[2] * b[i]).collect();
                (*colour, electrons)
            })
            .collect();
        Self { height: photo.height, width: photo.width, planes }
    }

    /// The light for [`expose`](crate::sensor::expose) with an exposure of `white_e` electrons: at each pixel the value, in
    /// all three planes, for which the sensor collects just the electrons of that pixel's filter.
    ///
    /// A pixel of colour c collects `white_e sum_k response_c[k] E_k`, so `E = electrons / (white_e sum_k response_c[k])`.
    /// This holds for any filter array; the picture is already a mosaic, and only a sensor at the same place may see it.
    pub fn as_light(&self, sensor: &SensorModel, white_e: f64, placement: Placement) -> LinearImage {
        let mut light = LinearImage::zeros(CHANNELS, self.height, self.width);
        let gain: Vec<(Colour, f64)> = Colour::ALL
            .into_iter()
            .map(|c| (c, 1.0 / (white_e * sensor.response(c).iter().sum::<f64>())))
            .collect();
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
