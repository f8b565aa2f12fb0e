//! Light over the spectrum: scenes as radiance per wavelength, and the electrons that they give in each pixel.
//!
//! ```text
//! illuminant x reflectance = radiance -> lens (a PSF per band) -> photons -> quantum efficiency -> electrons per colour
//! RGB photograph -> three smooth reflectances -> the same, or directly by a 3x3 matrix
//! ```
//!
//! A [`Spectrum`] is linear between its samples and zero outside; integrals of products are exact for such curves. Radiance
//! is in W m-2 sr-1 nm-1, wavelengths are in um. [`ThreeBand`] is the fast path for RGB: it gives the same electrons as a
//! [`SpectralImage`] made by [`upsample`].

mod colour;
mod colour_checker;
mod colour_matrix;
mod electrons;
mod illuminant;
mod image;
mod observer;
mod reflectance_scene;
mod scene;
mod spectral_scene;
mod table;
mod test_chart;
mod three_band;
mod upsampling;

pub use crate::spectrum::{
    LIGHT_M_PER_S, OpticsError, PLANCK_J_S, PixelOptics, Spectrum, SpectrumError, band_mean, bands_within,
    even_bands, integral,
};
pub use colour::{
    Matrix3, SRGB_PRIMARIES, apply, bradford, delta_e_1976, delta_e_2000, inverse, lab, product,
    srgb_from_xyz, xyz_from_srgb, xyz_of_lab,
};
pub use colour_checker::{CHART_COLUMNS, CHART_ROWS, ChartData, colour_checker};
pub use colour_matrix::{ColourMatrix, fit_colour_matrix, seen_under};
pub use electrons::{ColourElectrons, ElectronsError, band_weights, share_outside, white_range_um};
pub use illuminant::{
    Illuminant, IlluminantError, blackbody, daylight, daylight_chromaticity, illuminant_names,
};
pub use image::{SpectralImage, SpectralImageError};
pub use observer::{LUMENS_PER_WATT, chromaticity, cie1931, luminous, xyz, xyz_of_reflectance};
pub use reflectance_scene::ReflectanceScene;
pub use scene::SceneKind;
pub use spectral_scene::SpectralScene;
pub use table::SpectrumTable;
pub use test_chart::{EdgeContrast, EdgeTarget, TestChart};
pub use three_band::ThreeBand;
pub use upsampling::{basis_bands, d65_white, reflectance_of_srgb, srgb_basis, upsample};
