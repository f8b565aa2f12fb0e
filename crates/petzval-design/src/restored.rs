//! A merit of a lens in its camera, without training: the error of the best linear restoration of its raw frames.

use std::sync::Arc;

use nalgebra::DMatrix;
use petzval_camera::linear_limit::{LimitGradient, LinearLimit};
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::merit::{Better, Merit, SpotResiduals, lifted_normal_equations};
use petzval_optics::number::Number;

use crate::error::DesignError;
use crate::psf_plan::PsfPlan;

/// The root of the expected squared error that the best linear restoration of raw frames leaves, in percent of white: the mean over
/// sensor and colours, see [`LinearLimit`].
#[derive(Clone)]
pub struct RestoredError {
    /// Fields, wavelengths and grids of the PSFs.
    pub plan: PsfPlan,
    /// Sensor, exposure and scenes.
    pub limit: Arc<LinearLimit>,
    /// Rays over which a descent takes the curvature of the error.
    pub rays: SpotResiduals,
}

const PERCENT: f64 = 100.0;

impl RestoredError {
    fn of(&self, lens: &Lens) -> Result<f64, DesignError> {
        let found = self.limit.mean_square(&self.plan.bank(lens)?)?;
        Ok(percent(found))
    }

    fn gradient(&self, lens: &Lens) -> Result<(f64, LensGradient), DesignError> {
        let traced = self.plan.trace(lens)?;
        let LimitGradient { mean_square, by_values, by_illumination, by_radius } =
            self.limit.gradient(&traced.bank)?;
        let by_radius: Vec<f32> = by_radius.iter().map(|v| *v as f32).collect();
        let by_square = self.plan.gradient(&traced, &by_values, &by_illumination, &by_radius);
        let value = percent(mean_square);
        // d sqrt(q) = dq / (2 sqrt(q))
        Ok((value, by_square.scaled(0.5 * PERCENT * PERCENT / value)))
    }
}

/// The root of the mean over the colours of expected squared errors, in percent of white.
pub(crate) fn percent(mean_square: [f64; 3]) -> f64 {
    PERCENT * (mean_square.iter().sum::<f64>() / 3.0).sqrt()
}

impl Merit for RestoredError {
    fn name(&self) -> String {
        "error after the best linear restoration".to_owned()
    }

    fn unit(&self) -> &str {
        "% of white"
    }

    fn better(&self) -> Better {
        Better::Lower
    }

    fn value(&self, lens: &Lens) -> Option<f64> {
        self.of(lens).ok().filter(|value| value.is_finite())
    }

    fn with_gradient(&self, lens: &Lens) -> Option<(f64, Option<LensGradient>)> {
        let (value, gradient) = self.gradient(lens).ok()?;
        value.is_finite().then_some((value, Some(gradient)))
    }

    fn normal_equations(&self, lens: &Lens, numbers: &[(usize, Number)]) -> Option<DMatrix<f64>> {
        let (value, gradient) = self.gradient(lens).ok()?;
        lifted_normal_equations(&self.rays, lens, numbers, value * value, &gradient.scaled(2.0 * value))
    }
}
