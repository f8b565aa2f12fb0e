//! Measuring real cameras: from captures back to the numbers of the forward model.
//!
//! [`emva`] characterises a sensor from flat and dark frames (EMVA 1288, and the joint fit of the paper's supplement,
//! section 10). [`psf_calibration`] measures point-spread functions from captures of a pinhole (section 11).
//! [`sfr`] measures the response by frequency at slanted edges (ISO 12233), [`chart`] colours, noise and sharpness of a developed test chart,
//! [`edge_mtf`] the MTF of a camera at slanted edges of any frame.
//! The forward model itself is in `petzval-camera`.

pub mod chart;
pub mod edge_mtf;
pub mod emva;
pub mod psf_calibration;
pub mod sfr;
