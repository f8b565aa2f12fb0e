//! What a lens is judged by: any scalar, with its gradient if it has one.

use rayon::prelude::*;

use crate::gradient::LensGradient;
use crate::lens::{Lens, ObjectDistance};
use crate::number::Number;
use crate::pupil::PupilSampling;
use crate::spot::field_mean_square_sampled;

/// Which way a merit is good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// The less, the better, and never below zero: a spot, a loss.
    Lower,
    /// The more, the better: contrast, a score.
    Higher,
}

impl Better {
    /// What is made small: the square of what should be low, because sums of squares are nearly quadratic in what is off; or the
    /// negative of what should be high.
    pub(super) fn cost(self, value: f64) -> f64 {
        match self {
            Self::Lower => value * value,
            Self::Higher => -value,
        }
    }

    /// Derivative of the cost by the value.
    pub(super) fn slope(self, value: f64) -> f64 {
        match self {
            Self::Lower => 2.0 * value,
            Self::Higher => -1.0,
        }
    }

    /// Whether a value is at least as good as another.
    pub fn meets(self, value: f64, limit: f64) -> bool {
        match self {
            Self::Lower => value <= limit,
            Self::Higher => value >= limit,
        }
    }

    /// How much worse a value is than another, negative where it is better.
    pub fn loss(self, value: f64, than: f64) -> f64 {
        match self {
            Self::Lower => value - than,
            Self::Higher => than - value,
        }
    }
}

/// A scalar that a lens is judged by. Task losses are merits as well: nothing else is asked of them than these few answers.
pub trait Merit: Sync {
    /// What it is called in tables and on axes.
    fn name(&self) -> String;

    /// Its unit; empty for a plain number.
    fn unit(&self) -> &str;

    /// Which way it is good.
    fn better(&self) -> Better;

    /// Its value; `None` if the lens has none, because rays are lost.
    fn value(&self, lens: &Lens) -> Option<f64>;

    /// Its value and, if it has one, its gradient by every number of the lens. The gradient by decentres and tilts is that of the
    /// surfaces that have a placement.
    fn with_gradient(&self, lens: &Lens) -> Option<(f64, Option<LensGradient>)> {
        self.value(lens).map(|value| (value, None))
    }
}

/// A merit from a function, without a gradient.
pub struct MeritOf<F> {
    /// What it is called.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Which way it is good.
    pub better: Better,
    /// The function.
    pub function: F,
}

impl<F: Fn(&Lens) -> Option<f64> + Sync> Merit for MeritOf<F> {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn unit(&self) -> &str {
        &self.unit
    }

    fn better(&self) -> Better {
        self.better
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        (self.function)(lens)
    }
}

/// Fields that a merit looks at, with their shares.
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
    /// Fields as they are, all of the same share.
    pub fn new(lens: &Lens, fields_deg: &[f64]) -> Self {
        let share = 1.0 / fields_deg.len() as f64;
        let fields = fields_deg.iter().map(|f| (*f, share)).collect();
        Self { fields, both_sides: false, object: lens.object }
    }

    /// The fields of a lens. A rotationally symmetric lens that is made loses its symmetry, so both sides of the axis count,
    /// each by half.
    pub fn of(lens: &Lens) -> Self {
        let one_side = Self::new(lens, &lens.fields_deg);
        if !lens.is_rotationally_symmetric() {
            return one_side;
        }
        let both = |(field, share): &(f64, f64)| match *field == 0.0 {
            true => vec![(0.0, *share)],
            false => vec![(*field, 0.5 * share), (-field, 0.5 * share)],
        };
        Self { fields: one_side.fields.iter().flat_map(both).collect(), both_sides: true, ..one_side }
    }

    /// Mean over the fields of a function of the field (rad) and its gradient, in parallel; `None` if one has none. The bits do
    /// not depend on the number of threads.
    pub(super) fn mean(
        &self,
        lens: &Lens,
        of_field: impl Fn(f64) -> Option<(f64, LensGradient)> + Sync,
    ) -> Option<(f64, LensGradient)> {
        // While the lens is symmetric one side says what both do.
        let by_symmetry = self.both_sides && lens.is_rotationally_symmetric();
        let one_side = |(field, share): &(f64, f64)| match (by_symmetry, *field == 0.0, *field > 0.0) {
            (false, ..) | (true, true, _) => Some((*field, *share)),
            (true, false, true) => Some((*field, 2.0 * share)),
            (true, false, false) => None,
        };
        let fields: Vec<(f64, f64)> = self.fields.iter().filter_map(one_side).collect();
        // A near object stays where it is, also where the first vertex, from which fields are seen, does not.
        let seen = |field_deg: f64| match (self.object, lens.object) {
            (ObjectDistance::Finite(then), ObjectDistance::Finite(now)) if then != now => {
                (field_deg.to_radians().tan() * then / now).atan()
            }
            _ => field_deg.to_radians(),
        };
        let each: Vec<(f64, LensGradient)> =
            fields.par_iter().map(|(field, _)| of_field(seen(*field))).collect::<Option<_>>()?;
        let (mut value, mut gradient) = (0.0, LensGradient::zero(lens.surfaces.len()));
        for ((_, share), (v, g)) in fields.iter().zip(each) {
            value += share * v;
            gradient += &g.scaled(*share);
        }
        gradient.keep_symmetry(&lens.at_wavelength(lens.reference_um));
        if by_symmetry {
            // The derivatives by decentres and tilts of the two sides cancel.
            for surface in 0..lens.surfaces.len() {
                (0..2).for_each(|axis| gradient[(surface, Number::Decenter(axis))] = 0.0);
                (0..3).for_each(|axis| gradient[(surface, Number::Tilt(axis))] = 0.0);
            }
        }
        Some((value, gradient))
    }
}

/// The RMS spot radius, um: the root of the mean square over fields and wavelengths about the centroid of each field.
#[derive(Clone, Debug, PartialEq)]
pub struct RmsSpot {
    /// Fields.
    pub fields: FieldSet,
    /// Rays. [`RmsSpot::new`] says how good its choice is.
    pub sampling: PupilSampling,
}

impl RmsSpot {
    /// Over the fields of a lens, see [`FieldSet::of`].
    ///
    /// Polynomials of degree 6 over the pupil, or of degree 14 where the nominal lens says that 6 are not good to 2e-3 (as where
    /// apertures cut off much of the beam). With 6, on triplets made at the commercial grade the RMS is within 5e-6 of that of degree
    /// 16 (`examples/tolerance_accuracy.rs`), and within 2e-3 of that of a grid of traced rays, which the clear apertures cut.
    pub fn new(lens: &Lens) -> Self {
        let of_degree = |degree| Self { fields: FieldSet::of(lens), sampling: PupilSampling::Degree(degree) };
        let (few, many) = (of_degree(6), of_degree(14));
        let value = |merit: &Self| merit.evaluate(lens, false).map_or(f64::NAN, |(value, _)| value);
        let exact = value(&many);
        if (value(&few) - exact).abs() <= 2e-3 * exact { few } else { many }
    }

    fn evaluate(&self, lens: &Lens, with_gradient: bool) -> Option<(f64, LensGradient)> {
        let (square, gradient) = self
            .fields
            .mean(lens, |field| field_mean_square_sampled(lens, field, self.sampling, with_gradient))?;
        let rms = square.max(0.0).sqrt();
        // d sqrt(q) = dq / (2 sqrt(q)); a perfect spot has no slope.
        let per = if rms > 0.0 { 0.5 / rms } else { 0.0 };
        rms.is_finite().then(|| (rms, gradient.scaled(per)))
    }
}

impl Merit for RmsSpot {
    fn name(&self) -> String {
        "RMS spot".into()
    }

    fn unit(&self) -> &str {
        "um"
    }

    fn better(&self) -> Better {
        Better::Lower
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        self.evaluate(lens, false).map(|(value, _)| value)
    }

    fn with_gradient(&self, lens: &Lens) -> Option<(f64, Option<LensGradient>)> {
        self.evaluate(lens, true).map(|(value, gradient)| (value, Some(gradient)))
    }
}
