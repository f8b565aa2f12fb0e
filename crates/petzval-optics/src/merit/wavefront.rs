//! The RMS wavefront error as a merit.

use super::{Better, FieldRays, FieldSet, Merit};
use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::wave::SampledWave;

/// The RMS wavefront error, waves: the root of the mean of the variance over fields and wavelengths. The variance is that of the optical
/// path, in waves of each wavelength, weighted by light. The path is measured to one reference sphere for all wavelengths of a field; its
/// centre on the image plane minimises the error.
///
/// Lateral colour counts, since one sphere serves all wavelengths. At one wavelength it is the `rms_centroid_waves` of
/// [`wavefront`](crate::analysis::wavefront). A lens whose rays through the stop are lost, or one with thin lenses, has none.
#[derive(Clone, Debug)]
pub struct RmsWavefront {
    /// Fields.
    pub fields: FieldSet,
}

impl RmsWavefront {
    /// Over the fields of a lens, see [`FieldSet::of`].
    pub fn new(lens: &Lens) -> Self {
        Self { fields: FieldSet::of(lens) }
    }

    /// Mean square of a field.
    fn of_field(lens: &Lens, field_rad: f64, with_gradient: bool) -> Option<(f64, LensGradient)> {
        let rays = FieldRays::new(lens, field_rad)?;
        let at_wavelength = |um: &f64| {
            let sequence = lens.at_wavelength(*um);
            SampledWave::new(&sequence, field_rad, rays.stop_radius_mm, rays.chief_mm())
                .map(|wave| (sequence, wave))
        };
        let beams: Vec<_> = lens.wavelengths_um.iter().map(at_wavelength).collect::<Option<_>>()?;
        let moments: Vec<_> = beams.iter().map(|(_, wave)| wave.moments()).collect();
        // Find the shift of the common centre that makes the sum of the variances least: of_tilts shift = with_tilt.
        let sum = |of: &dyn Fn(usize) -> f64| (0..beams.len()).map(of).sum::<f64>();
        let [xx, xy, yy] = [0, 1, 2].map(|k| sum(&|b| moments[b].of_tilts[k]));
        let [x, y] = [0, 1].map(|k| sum(&|b| moments[b].with_tilt[k]));
        let is_half = beams.iter().all(|(_, wave)| wave.is_half());
        let shift_mm = if is_half {
            [0.0, y / yy]
        } else {
            let determinant = xx * yy - xy * xy;
            [(yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant]
        };
        let along = if is_half { shift_mm[1] * y } else { shift_mm[0] * x + shift_mm[1] * y };
        let share = 1.0 / beams.len() as f64;
        let mean_square = share * (sum(&|b| moments[b].variance) - along);
        let mut gradient = LensGradient::zero(lens.surfaces.len());
        if with_gradient {
            let by_beam =
                beams.iter().map(|(sequence, wave)| wave.pull_back(sequence, shift_mm, share, &mut gradient));
            let by_beam: Vec<_> = by_beam.collect();
            rays.pull_back(by_beam.into_iter(), &mut gradient);
        }
        mean_square.is_finite().then_some((mean_square, gradient))
    }

    fn evaluate(&self, lens: &Lens, with_gradient: bool) -> Option<(f64, LensGradient)> {
        let (square, gradient) =
            self.fields.mean(lens, |field| Self::of_field(lens, field, with_gradient))?;
        let rms = square.max(0.0).sqrt();
        // d sqrt(q) = dq / (2 sqrt(q)); a perfect wavefront has no slope.
        let per = if rms > 0.0 { 0.5 / rms } else { 0.0 };
        Some((rms, gradient.scaled(per)))
    }
}

impl Merit for RmsWavefront {
    fn name(&self) -> String {
        format!("RMS wavefront error{}", self.fields.in_name())
    }

    fn unit(&self) -> &str {
        "waves"
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

    /// Rays land where the slopes of the wavefront lead them.
    fn fields_of_rays(&self, lens: &Lens) -> Option<Vec<(f64, f64)>> {
        Some(self.fields.seen(lens))
    }
}
