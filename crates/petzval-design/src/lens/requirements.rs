//! What every lens of an experiment must keep, beside the bounds of its variables.

use petzval_files::LensFile;
use petzval_optics::constraint::{Constraint, passing_share, penalty};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::pupil::chief_ray;

use crate::error::{DesignError, Result};
use crate::experiment::{ConstraintConfig, FieldOfView};

/// Requirements of the moving lenses of an experiment, the same for the control and for end to end.
#[derive(Clone, Debug)]
pub struct Requirements {
    /// Clearances, the bounds of a radius that is solved for, and the height at which the nominal lens images the sensor's
    /// corner: the field of view is held. Where the clear apertures of the nominal lens cut light, they may not cut more.
    constraints: Vec<Constraint>,
    /// The field that the nominal lens images in the sensor's corner, rad.
    corner_field_rad: f64,
}

impl Requirements {
    /// Those of a nominal lens: its clearances, its solve's bounds, its own field of view, which it has `in_focus`, and its light at some of the fields
    /// from the axis to the corner, `fields_rad`.
    pub fn new(
        in_focus: &Lens,
        nominal: &LensFile,
        config: &ConstraintConfig,
        fields_rad: &[f64],
    ) -> Result<Self> {
        let corner_field_rad = fields_rad.last().copied().unwrap_or(0.0);
        let lens = &nominal.lens;
        let chief = chief_ray(&in_focus.at_wavelength(in_focus.reference_um), corner_field_rad)
            .ok_or_else(|| DesignError::no_light(in_focus, corner_field_rad, &[]))?;
        let mut constraints = config.of_lens(lens);
        let solved =
            nominal.solves().curvature().and_then(|(surface, radius_mm)| Some((surface, radius_mm?)));
        constraints
            .extend(solved.map(|(surface, radius_mm)| Constraint::SolvedRadius { surface, radius_mm }));
        constraints.push(Constraint::ChiefHeight {
            field_rad: corner_field_rad,
            wanted_mm: chief.y_mm,
            tolerance_mm: config.distortion_tolerance * chief.y_mm.abs(),
        });
        // A lens whose stop alone decides has no such requirement.
        let of_field = |field_rad: &f64| {
            let share = passing_share(in_focus, *field_rad).filter(|share| *share < 1.0)?;
            let least = share - config.light_tolerance;
            Some(Constraint::Light { field_rad: *field_rad, least, scale_mm: in_focus.entrance_pupil_mm })
        };
        constraints.extend(fields_rad.iter().filter_map(of_field));
        Ok(Self { constraints, corner_field_rad })
    }

    /// The same as constraints, at the clear semi-diameters of the lens.
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }

    /// The squares of the violations, mm^2, each with its gradient; with a free field of view without those of its fields.
    pub fn violations(&self, lens: &Lens, field: FieldOfView) -> Result<Vec<(f64, LensGradient)>> {
        let is_of_a_field =
            |c: &Constraint| matches!(c, Constraint::ChiefHeight { .. } | Constraint::Light { .. });
        let counts = |c: &&Constraint| field == FieldOfView::Held || !is_of_a_field(c);
        let square = |constraint: &Constraint| {
            penalty(std::slice::from_ref(constraint), lens)
                .ok_or_else(|| DesignError::no_light(lens, self.corner_field_rad, &lens.wavelengths_um))
        };
        let squares = self.constraints.iter().filter(counts).map(square);
        squares.filter(|square| square.as_ref().map_or(true, |(value, _)| *value > 0.0)).collect()
    }
}
