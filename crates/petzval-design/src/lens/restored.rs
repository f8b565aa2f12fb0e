//! A merit of a lens in its camera, without training: the error of the best linear restoration of its raw frames.

use std::sync::Arc;

use nalgebra::DMatrix;
use petzval_camera::linear_limit::{LimitGradient, LinearLimit};
use petzval_camera::psf::PsfBank;
use petzval_optics::gradient::LensGradient;
use petzval_optics::lens::Lens;
use petzval_optics::merit::{Better, Merit, Seen, SpotResiduals, lifted_normal_equations};
use petzval_optics::number::Number;
use petzval_optics::paraxial::{image_brightness, pull_back_log_brightness};

use crate::error::Result;
use crate::lens::psf_plan::{BankWithTape, PsfPlan};

/// The root of the expected squared error that the best linear restoration of raw frames leaves, in percent of white: the mean over
/// sensor and colours, see [`LinearLimit`].
#[derive(Clone)]
pub struct RestoredError {
    /// Fields, wavelengths and grids of the PSFs.
    pub plan: PsfPlan,
    /// Sensor, exposure and scenes.
    pub limit: Arc<LinearLimit>,
    /// Brightness of the image behind which the exposure is stated, see [`image_brightness`], if all lenses are exposed for the same time;
    /// none where they have the same electrons.
    pub stated_brightness: Option<f64>,
    /// Rays over which a descent takes the curvature of the error.
    pub rays: SpotResiduals,
}

const PERCENT: f64 = 100.0;

impl RestoredError {
    /// Light of a lens, in units of that for which the exposure is stated.
    fn light(&self, lens: &Lens) -> f64 {
        let own = || image_brightness(&lens.at_wavelength(lens.reference_um));
        self.stated_brightness.map_or(1.0, |stated| own() / stated)
    }

    fn of(&self, lens: &Lens) -> Result<f64> {
        let found = self.limit.mean_square(&brightened(self.plan.bank(lens)?, self.light(lens)))?;
        Ok(percent(found))
    }

    fn gradient(&self, lens: &Lens, traced: &BankWithTape) -> Result<(f64, LensGradient)> {
        let light = self.light(lens);
        let bright = brightened(traced.bank.clone(), light);
        let LimitGradient { mean_square, by_values, by_illumination, by_radius } =
            self.limit.gradient(&bright)?;
        let by_radius: Vec<f32> = by_radius.iter().map(|v| *v as f32).collect();
        let by_relative: Vec<f32> = by_illumination.iter().map(|by| by * light as f32).collect();
        let mut by_square = self.plan.gradient(traced, &by_values, &by_relative, &by_radius);
        if self.stated_brightness.is_some() {
            let by_light =
                bright.illumination.iter().zip(&by_illumination).map(|(i, by)| f64::from(i * by)).sum();
            pull_back_log_brightness(&lens.at_wavelength(lens.reference_um), by_light, &mut by_square);
        }
        let value = percent(mean_square);
        // d sqrt(q) = dq / (2 sqrt(q))
        Ok((value, by_square.scaled(0.5 * PERCENT * PERCENT / value)))
    }
}

/// The derivatives of the light of each field, with a further row of their length for the light that the lens gathers for all of them.
pub(crate) fn with_brightness(mut light: Vec<LensGradient>, lens: &Lens) -> Vec<LensGradient> {
    let mut by = LensGradient::zero(lens.surfaces.len());
    pull_back_log_brightness(&lens.at_wavelength(lens.reference_um), 1.0, &mut by);
    let of_all_fields = (light.len() as f64).sqrt();
    light.push(by.scaled(of_all_fields));
    light
}

/// A bank whose image is brighter by a factor: its illumination is no longer relative.
pub(crate) fn brightened(mut bank: PsfBank, light: f64) -> PsfBank {
    bank.illumination.iter_mut().for_each(|i| *i *= light as f32);
    bank
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
        let (value, gradient) = self.gradient(lens, &self.plan.trace(lens).ok()?).ok()?;
        value.is_finite().then_some((value, Some(gradient)))
    }

    fn normal_equations(&self, lens: &Lens, numbers: &[(usize, Number)]) -> Option<DMatrix<f64>> {
        let traced = self.plan.trace(lens).ok()?;
        let (value, gradient) = self.gradient(lens, &traced).ok()?;
        let light = self.plan.light_gradients(&traced);
        let light = if self.stated_brightness.is_some() { with_brightness(light, lens) } else { light };
        let by_square = gradient.scaled(2.0 * value);
        // The best restoration moves the light of every field back to its place.
        let seen = Seen { rays: &self.rays, places: false, light: &light };
        lifted_normal_equations(seen, lens, numbers, value * value, &by_square)
    }
}
