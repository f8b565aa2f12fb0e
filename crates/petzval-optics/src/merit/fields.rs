//! The fields over which a merit is averaged.

use rayon::prelude::*;

use crate::gradient::LensGradient;
use crate::lens::{Lens, ObjectDistance};
use crate::number::Number;
use crate::paraxial::{FirstOrderCotangent, first_order, pull_back_first_order};
use crate::pupil::{ChiefRay, chief_ray, pull_back_chief};
use crate::trace::Sequence;

/// Fields of a merit, with their shares.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldSet {
    /// Angle, degrees, and share; the shares add up to 1.
    fields: Vec<(f64, f64)>,
    /// Whether every field has its counterpart on the other side of the axis, with the same share.
    both_sides: bool,
    /// The object of the lens that they are fields of.
    object: ObjectDistance,
}

impl FieldSet {
    /// The fields `fields_deg` on their own side of the axis only, all with the same share.
    pub fn new(lens: &Lens, fields_deg: &[f64]) -> Self {
        let share = 1.0 / fields_deg.len() as f64;
        let fields = fields_deg.iter().map(|f| (*f, share)).collect();
        Self { fields, both_sides: false, object: lens.object }
    }

    /// The fields of a lens. Manufacturing errors break the symmetry of a rotationally symmetric lens, so both sides of its axis count,
    /// each by half.
    pub fn of(lens: &Lens) -> Self {
        let one_side = Self::new(lens, &lens.fields_deg);
        if !lens.is_rotationally_symmetric() {
            return one_side;
        }
        let both = |(field, share): &(f64, f64)| {
            if *field == 0.0 {
                vec![(0.0, *share)]
            } else {
                vec![(*field, 0.5 * share), (-field, 0.5 * share)]
            }
        };
        Self { fields: one_side.fields.iter().flat_map(both).collect(), both_sides: true, ..one_side }
    }

    /// `, 10 deg` for a single field, nothing for several.
    pub(super) fn in_name(&self) -> String {
        match self.fields[..] {
            // Without the rounding of radians.
            [(field_deg, _)] => format!(", {} deg", (1e9 * field_deg).round() / 1e9),
            _ => String::new(),
        }
    }

    /// While the lens is symmetric, one side of the axis says what both do.
    fn is_one_side(&self, lens: &Lens) -> bool {
        self.both_sides && lens.is_rotationally_symmetric()
    }

    /// The fields as a lens sees them, rad, and their shares.
    pub(super) fn seen(&self, lens: &Lens) -> Vec<(f64, f64)> {
        let by_symmetry = self.is_one_side(lens);
        let one_side = |(field, share): &(f64, f64)| match (by_symmetry, *field == 0.0, *field > 0.0) {
            (false, ..) | (true, true, _) => Some((*field, *share)),
            (true, false, true) => Some((*field, 2.0 * share)),
            (true, false, false) => None,
        };
        // A near object stays where it is, also where the first vertex, from which fields are seen, does not.
        let seen = |field_deg: f64| match (self.object, lens.object) {
            (ObjectDistance::Finite(then), ObjectDistance::Finite(now)) if then != now => {
                (field_deg.to_radians().tan() * then / now).atan()
            }
            _ => field_deg.to_radians(),
        };
        self.fields.iter().filter_map(one_side).map(|(field, share)| (seen(field), share)).collect()
    }

    /// Mean over the fields of a function of the field (rad) and its gradient, in parallel; `None` if one has none. The bits do
    /// not depend on the number of threads.
    pub(super) fn mean(
        &self,
        lens: &Lens,
        of_field: impl Fn(f64) -> Option<(f64, LensGradient)> + Sync,
    ) -> Option<(f64, LensGradient)> {
        let fields = self.seen(lens);
        let each: Vec<(f64, LensGradient)> =
            fields.par_iter().map(|(field, _)| of_field(*field)).collect::<Option<_>>()?;
        let (mut value, mut gradient) = (0.0, LensGradient::zero(lens.surfaces.len()));
        for ((_, share), (v, g)) in fields.iter().zip(each) {
            value += share * v;
            gradient += &g.scaled(*share);
        }
        gradient.keep_symmetry(&lens.at_wavelength(lens.reference_um));
        if self.is_one_side(lens) {
            // The derivatives by decentres and tilts of the two sides cancel.
            for surface in 0..lens.surfaces.len() {
                (0..2).for_each(|axis| gradient[(surface, Number::Decenter(axis))] = 0.0);
                (0..3).for_each(|axis| gradient[(surface, Number::Tilt(axis))] = 0.0);
            }
        }
        Some((value, gradient))
    }
}

/// The chief ray and the stop of a field at the reference wavelength, to which the waves of all wavelengths refer: lateral colour then counts.
pub(super) struct FieldRays {
    reference: Sequence,
    chief: ChiefRay,
    /// Radius of the stop, mm.
    pub stop_radius_mm: f64,
}

impl FieldRays {
    /// `None` if the chief ray is lost.
    pub fn new(lens: &Lens, field_rad: f64) -> Option<Self> {
        let reference = lens.at_wavelength(lens.reference_um);
        let chief = chief_ray(&reference, field_rad)?;
        Some(Self { stop_radius_mm: first_order(&reference).stop_radius_mm, chief, reference })
    }

    /// Where the chief ray lands, mm.
    pub fn chief_mm(&self) -> [f64; 2] {
        [self.chief.x_mm, self.chief.y_mm]
    }

    /// Adds the gradient of a loss by its derivatives by where the chief ray lands and by the stop radius, per mm, one of each for every beam.
    pub fn pull_back(&self, bars: impl Iterator<Item = ([f64; 2], f64)>, gradient: &mut LensGradient) {
        let (mut chief_bar, mut stop_radius) = ([0.0; 2], 0.0);
        for ([x, y], stop) in bars {
            chief_bar = [chief_bar[0] + x, chief_bar[1] + y];
            stop_radius += stop;
        }
        pull_back_chief(&self.reference, &self.chief, chief_bar, gradient);
        let bars = FirstOrderCotangent { stop_radius, ..Default::default() };
        pull_back_first_order(&self.reference, bars, gradient);
    }
}
