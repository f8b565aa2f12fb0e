//! Spectral lines at which glasses are measured.

/// Fraunhofer d line (helium), um.
pub const LINE_D_UM: f64 = 0.587_561_8;
/// Fraunhofer F line (hydrogen), um.
pub const LINE_F_UM: f64 = 0.486_132_7;
/// Fraunhofer C line (hydrogen), um.
pub const LINE_C_UM: f64 = 0.656_272_5;
/// Mercury's g line, um.
pub const LINE_G_UM: f64 = 0.435_834_3;
