//! Glass: the refractive index of a medium as a function of wavelength.

mod catalog;
mod dispersion;

pub use catalog::{Catalog, UnknownGlass};
pub use dispersion::Dispersion;

use std::sync::{Arc, LazyLock};

/// Fraunhofer d line (helium), um.
pub const LINE_D_UM: f64 = 0.587_561_8;
/// Fraunhofer F line (hydrogen), um.
pub const LINE_F_UM: f64 = 0.486_132_7;
/// Fraunhofer C line (hydrogen), um.
pub const LINE_C_UM: f64 = 0.656_272_5;

/// A named optical medium.
#[derive(Clone, Debug, PartialEq)]
pub struct Glass {
    /// Catalogue name, e.g. `N-BK7`; `AIR` for the gap between elements.
    pub name: String,
    /// Its dispersion formula with published coefficients.
    pub dispersion: Dispersion,
}

impl Glass {
    /// Air, whose index is the unit in which catalogues print all others.
    pub fn air() -> Arc<Self> {
        static AIR: LazyLock<Arc<Glass>> =
            LazyLock::new(|| Arc::new(Glass { name: "AIR".into(), dispersion: Dispersion::Constant(1.0) }));
        AIR.clone()
    }

    /// Whether this is the gap between elements rather than a material.
    pub fn is_air(&self) -> bool {
        self.dispersion == Dispersion::Constant(1.0)
    }

    /// Refractive index relative to air at a wavelength in um.
    pub fn index(&self, wavelength_um: f64) -> f64 {
        self.dispersion.index(wavelength_um)
    }

    /// Index at the d line.
    pub fn nd(&self) -> f64 {
        self.index(LINE_D_UM)
    }

    /// Abbe number `(n_d - 1) / (n_F - n_C)`; infinite for a medium without dispersion.
    pub fn abbe_vd(&self) -> f64 {
        (self.nd() - 1.0) / (self.index(LINE_F_UM) - self.index(LINE_C_UM))
    }
}
