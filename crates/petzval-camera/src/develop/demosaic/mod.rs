//! Demosaicing: the two colours that each pixel of a Bayer array did not measure.
//!
//! The methods that compare neighbours want values in which noise and edges are about alike in the dark and in the light, such as the
//! [square root](super::Stabiliser) of light.

mod malvar;
mod menon;
mod rcd;
mod tile;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::develop::{check_mosaic, demosaic_bilinear, demosaic_bilinear_adjoint};
use crate::image::{CHANNELS, LinearImage};
use crate::render::Placement;
use crate::sensor::{CfaPattern, SensorError};
use tile::{Plane, Tile};

/// A method of demosaicing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Demosaic {
    /// The mean of the nearest pixels of a colour. In linear development the only one for arrays other than Bayer's.
    Bilinear,
    /// Linear 5x5 filters that correct the bilinear value by the Laplacian of the measured colour (Malvar, He, Cutler 2004).
    Malvar,
    /// Directional ratios of a low-pass, weighted by gradients: ratio-corrected demosaicing (Sanz Rodriguez 2017).
    Rcd,
    /// Directional filtering with an a-posteriori decision and refinement (Menon, Andriani, Calvagno 2007).
    Menon,
}

impl Demosaic {
    /// All methods.
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
        self.check_array(cfa)?;
        check_mosaic(mosaic.len(), height, width)?;
        // Strips of rows, each with a mirrored border as wide as the method reaches.
        let strips: Vec<(usize, [Vec<f32>; CHANNELS])> = strips(height)
            .map(|(first, rows)| {
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

    /// Checks that the method interpolates the colours of an array.
    pub fn check_array(self, cfa: CfaPattern) -> Result<(), SensorError> {
        if self == Self::Bilinear || cfa.is_bayer() {
            return Ok(());
        }
        let expected = format!("a Bayer array for {}; other arrays are interpolated bilinearly", self.name());
        let got = format!("{} x {} pixels of {:?}", cfa.rows(), cfa.cols(), cfa.colours());
        Err(SensorError::shape("colour filter array", expected, got))
    }

    /// Whether [`Demosaic::adjoint`] exists: not for RCD, whose values are quotients of the mosaic.
    pub fn is_differentiable(self) -> bool {
        self != Self::Rcd
    }

    /// The error of a method without a gradient where one is needed.
    pub(crate) fn without_gradient(self) -> SensorError {
        let expected = "bilinear, malvar or menon, which have a gradient";
        SensorError::shape("method of demosaicing", expected, self.name())
    }

    /// The cotangent of a mosaic from that of its picture: the transpose of [`Demosaic::apply`], where the directions that Menon's method
    /// takes at `mosaic` stay. Fails as that does, and for RCD.
    pub fn adjoint(
        self,
        mosaic: &[f32],
        d_rgb: &LinearImage,
        cfa: CfaPattern,
        placement: Placement,
    ) -> Result<Vec<f32>, SensorError> {
        let (height, width) = (d_rgb.height, d_rgb.width);
        let of_tile = match self {
            Self::Bilinear => return demosaic_bilinear_adjoint(d_rgb, cfa, placement),
            Self::Malvar => malvar::adjoint,
            Self::Menon => menon::adjoint,
            Self::Rcd => return Err(self.without_gradient()),
        };
        self.check_array(cfa)?;
        check_mosaic(mosaic.len(), height, width)?;
        let strips: Vec<(Tile, usize, Plane)> = strips(height)
            .map(|(first, rows)| {
                let tile = Tile::cut(mosaic, (height, width), (first, rows), cfa, placement);
                let bars = [0, 1, 2].map(|c| tile.framed(&d_rgb.plane(c)[first * width..][..rows * width]));
                let bar = of_tile(&tile, bars);
                (tile, first, bar)
            })
            .collect();
        // Add the strips in their order: the same bits for any number of threads.
        let mut d_mosaic = vec![0.0; height * width];
        for (tile, first, bar) in strips {
            tile.fold(&bar, first, (height, width), &mut d_mosaic);
        }
        Ok(d_mosaic)
    }
}

/// First row and number of rows of each strip, in parallel.
fn strips(height: usize) -> impl IndexedParallelIterator<Item = (usize, usize)> {
    (0..height.div_ceil(tile::STRIP_ROWS)).into_par_iter().map(move |strip| {
        let first = strip * tile::STRIP_ROWS;
        (first, tile::STRIP_ROWS.min(height - first))
    })
}

#[cfg(test)]
mod tests;
