//! Names of the files of a bank.

/// Name of the file with the axes.
pub const AXES_FILE: &str = "psf.json";

/// Name of the file with the axes in the earlier form of measured PSFs.
pub const OLD_AXES_FILE: &str = "psfs.toml";

/// Name of the array of PSFs.
pub const VALUES_FILE: &str = "psf.npy";

/// Name of the array of relative illumination.
pub const ILLUMINATION_FILE: &str = "illumination.npy";
