//! What a surface does to light: refract, reflect, act as a thin lens; and diffractive structures.

use std::f64::consts::PI;

use crate::number::PHASE_TERMS;

/// What a surface does to light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Action {
    /// It refracts, by Snell's law.
    #[default]
    Refract,
    /// It reflects. The medium behind is that in front, and distances are negative until the next mirror.
    Reflect,
    /// A thin lens without aberrations at any conjugates, on a plane: slopes change by `-power` times the height,
    /// `n' tan' = n tan - power (x, y)`.
    ThinLens {
        /// Power, 1/mm: the reciprocal of the focal length in air.
        power_per_mm: f64,
    },
}

/// A diffractive structure, with the order of diffraction that is looked at.
///
/// It adds `order * wavelength * psi(x, y)` to the optical path, where psi counts periods; by the grating equation
/// the tangential part of `n' d' - n d` is that of `order * wavelength * grad psi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// Order of diffraction; 0 passes as if nothing were there.
    pub order: i32,
    /// The structure.
    pub pattern: Pattern,
}

/// How a diffractive structure is laid out, seen along the axis of its surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// Straight lines along x at equal distances in y: `psi = y lines_per_mm`.
    Grating {
        /// Lines per mm.
        lines_per_mm: f64,
    },
    /// Rings, a binary (kinoform) lens: `2 pi psi = A_1 v + A_2 v^2 + ...`, `v = (r/h)^2`.
    Binary {
        /// The normalisation radius h, mm.
        norm_radius_mm: f64,
        /// A_1 ... A_8, rad.
        coefficients_rad: [f64; PHASE_TERMS],
    },
}

impl Phase {
    /// What each of its numbers (lines per mm, or coefficients) adds to the coefficients of the optical path, mm: of y for a
    /// grating, of r^2, r^4, ... for rings.
    pub(crate) fn path_per_number(&self, wavelength_um: f64) -> [f64; PHASE_TERMS] {
        let per_period = f64::from(self.order) * wavelength_um * 1e-3;
        let mut by = [0.0; PHASE_TERMS];
        match self.pattern {
            Pattern::Grating { .. } => by[0] = per_period,
            Pattern::Binary { norm_radius_mm: h, .. } => {
                for (i, by) in by.iter_mut().enumerate() {
                    *by = per_period / (2.0 * PI * h.powi(2 * i as i32 + 2));
                }
            }
        }
        by
    }

    /// Its numbers: lines per mm first, or the coefficients.
    pub(crate) fn numbers(&self) -> [f64; PHASE_TERMS] {
        match self.pattern {
            Pattern::Grating { lines_per_mm } => {
                let mut all = [0.0; PHASE_TERMS];
                all[0] = lines_per_mm;
                all
            }
            Pattern::Binary { coefficients_rad, .. } => coefficients_rad,
        }
    }

    /// Number `index`, to be changed; `None` if there is no such number.
    pub fn number_mut(&mut self, index: usize) -> Option<&mut f64> {
        match &mut self.pattern {
            Pattern::Grating { lines_per_mm } => (index == 0).then_some(lines_per_mm),
            Pattern::Binary { coefficients_rad, .. } => coefficients_rad.get_mut(index),
        }
    }
}
