//! The RMS spot radius as a merit.

use super::{Better, FieldSet, Merit};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::pupil::PupilSampling;
use crate::spot::field_mean_square_sampled;

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
        match self.fields.in_name() {
            several if several.is_empty() => "RMS spot (root mean square over the fields)".to_owned(),
            one => format!("RMS spot{one}"),
        }
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

    fn fields_of_rays(&self, lens: &Lens) -> Option<Vec<(f64, f64)>> {
        Some(self.fields.seen(lens))
    }
}
