//! What every lens of an experiment must keep, beside the bounds of its variables.

use petzval_files::LensFile;
use petzval_optics::constraint::{Clearances, chief_height_penalty, clearance_penalty, radius_penalty};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::pupil::chief_ray;

use crate::error::DesignError;

/// Requirements of the moving lenses of an experiment, the same for the control and for end to end.
#[derive(Clone, Debug)]
pub struct Requirements {
    clearances: Clearances,
    /// A radius that is solved for, and its bounds, mm.
    solved_radius: Option<(usize, [f64; 2])>,
    /// The sensor corner's ideal field angle, rad, where the nominal lens images it, mm, and how far a
    /// lens may image it from there, mm: the field of view is held.
    corner: Corner,
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    field_rad: f64,
    y_mm: f64,
    tolerance_mm: f64,
}

impl Requirements {
    /// Those of a nominal lens: its clearances, its solve's bounds, and its own field of view.
    pub fn new(
        nominal: &LensFile,
        clearances: Clearances,
        corner_field_rad: f64,
        distortion_tolerance: f64,
    ) -> Result<Self, DesignError> {
        let lens = &nominal.lens;
        let chief = chief_ray(&lens.at_wavelength(lens.reference_um), corner_field_rad)
            .ok_or(DesignError::NoLight { field_deg: corner_field_rad.to_degrees() })?;
        let solved_radius = nominal.efl_solve.and_then(|solve| Some((solve.surface, solve.radius_mm?)));
        Ok(Self {
            clearances,
            solved_radius,
            corner: Corner {
                field_rad: corner_field_rad,
                y_mm: chief.y_mm,
                tolerance_mm: distortion_tolerance * chief.y_mm.abs(),
            },
        })
    }

    /// The sum of squared violations, mm^2, and its gradient.
    pub fn penalty(&self, lens: &Lens) -> Result<(f64, LensGradient), DesignError> {
        let (mut value, mut gradient) = clearance_penalty(lens, &self.clearances);
        if let Some((surface, bounds)) = self.solved_radius {
            let (v, g) = radius_penalty(lens, surface, bounds);
            value += v;
            gradient += &g;
        }
        let Corner { field_rad, y_mm, tolerance_mm } = self.corner;
        let (v, g) = chief_height_penalty(lens, field_rad, y_mm, tolerance_mm)
            .ok_or(DesignError::NoLight { field_deg: field_rad.to_degrees() })?;
        gradient += &g;
        Ok((value + v, gradient))
    }
}
