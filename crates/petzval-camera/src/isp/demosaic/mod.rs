//! Demosaicing: the two colours that each pixel of a Bayer array did not measure.
//!
//! Every method here is written for values in which noise is about equal everywhere, such as the square root of light: there, edges are about as steep in the dark as in the light, and the comparison of
//! neighbours is fair. On linear light the same methods lose several decibels.

mod malvar;
mod menon;
mod rcd;
mod tile;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::develop::demosaic_bilinear;
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{CfaPattern, SensorError};
use tile::Tile;

/// A method of demosaicing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Demosaic {
    /// The mean of the nearest pixels of a colour. The only one for arrays other than Bayer's.
    Bilinear,
    /// Linear 5x5 filters that correct the bilinear value by the Laplacian of the measured colour (Malvar, He, Cutler 2004).
    Malvar,
    /// Directional ratios of a low-pass, weighted by gradients: ratio-corrected demosaicing (Sanz Rodriguez 2017).
    Rcd,
    /// Directional filtering with an a-posteriori decision and refinement (Menon, Andriani, Calvagno 2007).
    #[default]
    Menon,
}

impl Demosaic {
    /// All methods, the quickest first.
    pub const ALL: [Self; 4] = [Self::Bilinear, Self::Malvar, Self::Rcd, Self::Menon];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bilinear => "bilinear",
            Self::Malvar => "malvar",
            Self::Rcd => "rcd",
            Self::Menon => "menon",
        }
    }

    /// The picture of a mosaic whose top-left pixel is at `placement` of the sensor, three planes. Borders mirror about the outermost
    /// pixel, which keeps the phase of the array.
    ///
    /// Fails if the mosaic has the wrong length or less than 2x2 pixels, or if the array is not Bayer's and the method is not
    /// [`Demosaic::Bilinear`].
    pub fn apply(
        self,
        mosaic: &[f32],
        height: usize,
        width: usize,
        cfa: CfaPattern,
        placement: Placement,
    ) -> Result<LinearImage, SensorError> {
        let of_tile = match self {
            Self::Bilinear => return demosaic_bilinear(mosaic, height, width, cfa, placement),
            Self::Malvar => malvar::interpolate,
            Self::Rcd => rcd::interpolate,
            Self::Menon => menon::interpolate,
        };
        let shape = |expected: &str, got: String| SensorError::Shape {
            what: "mosaic",
            expected: expected.into(),
            got,
        };
        if mosaic.len() != height * width || height < 2 || width < 2 {
            let got = format!("{} values for {height}x{width}", mosaic.len());
            return Err(shape("height x width values, at least 2x2 pixels", got));
        }
        if !cfa.is_bayer() {
            return Err(shape("a Bayer array; other arrays are interpolated bilinearly", format!("{cfa:?}")));
        }
        // Strips of rows, each with a mirrored border as wide as the method reaches.
        let strips: Vec<(usize, [Vec<f32>; CHANNELS])> = (0..height.div_ceil(tile::STRIP_ROWS))
            .into_par_iter()
            .map(|strip| {
                let first = strip * tile::STRIP_ROWS;
                let rows = tile::STRIP_ROWS.min(height - first);
                (first, of_tile(&Tile::cut(mosaic, (height, width), (first, rows), cfa, placement)))
            })
            .collect();
        let mut out = LinearImage::zeros(CHANNELS, height, width);
        for (first, planes) in strips {
            for (c, plane) in planes.into_iter().enumerate() {
                out.plane_mut(c)[first * width..][..plane.len()].copy_from_slice(&plane);
            }
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests;
