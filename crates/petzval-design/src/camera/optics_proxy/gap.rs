//! How far a network's PSFs are from exact ones, on lenses that training has not seen.

use petzval_base::Cancelled;
use petzval_base::statistics::maximum;
use petzval_camera::linear_limit::{LimitGradient, LinearLimit};
use petzval_camera::psf::PsfBank;
use petzval_optics::lens::Lens;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::proxy::ProxyOptics;
use crate::error::Result;
use crate::lens::psf_plan::{BankWithTape, PsfPlan};
use crate::lens::sampler::LensSampler;

/// What the network costs. Means over lenses, fields and colours, unless said otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OpticsGap {
    /// Lenses.
    pub lenses: usize,
    /// Sum of absolute differences between the PSFs of network and tracing, both of unit sum: 0 to 2.
    pub l1: f64,
    /// Distance between the centroids of the two PSFs, um.
    pub centroid_um: f64,
    /// RMS spot radius of the exact PSFs about their centroids, um.
    pub exact_rms_um: f64,
    /// Absolute error of the RMS spot radius, um.
    pub rms_um: f64,
    /// Absolute error of the relative illumination.
    pub illumination: f64,
    /// The same by field.
    pub fields: Vec<OpticsFieldGap>,
    /// Cosine between the two gradients of the error after the best linear restoration by the free coordinates of the lens: the median
    /// over the lenses.
    pub gradient_cosine: f64,
    /// The cosine that a tenth of the lenses stays below.
    pub low_gradient_cosine: f64,
    /// Time of the PSFs of one lens, all fields.
    pub psfs: Seconds,
    /// Time of the gradient of a loss by the lens, from its derivatives by the PSFs.
    pub gradient: Seconds,
}

/// The errors at one field; see [`OpticsGap`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OpticsFieldGap {
    /// Image radius, mm.
    pub radius_mm: f64,
    /// Of the PSFs.
    pub l1: f64,
    /// Of the centroid, um.
    pub centroid_um: f64,
    /// RMS spot radius of the exact PSFs, um.
    pub exact_rms_um: f64,
    /// Of the RMS spot radius, um.
    pub rms_um: f64,
    /// Of the relative illumination.
    pub illumination: f64,
}

/// CPU time, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Seconds {
    /// By exact tracing.
    pub exact: f64,
    /// By the network.
    pub proxy: f64,
}

/// What networks are judged on.
pub struct OpticsJudge<'a> {
    /// Lenses that training does not draw.
    pub sampler: &'a LensSampler,
    /// How many of them.
    pub lenses: usize,
    /// The merit whose gradients are compared.
    pub limit: &'a LinearLimit,
    /// CPU time of the process so far, s.
    pub clock: &'a dyn Fn() -> f64,
}

/// The comparison of one lens.
struct OneLens {
    fields: Vec<OpticsFieldGap>,
    cosine: f64,
    psfs: Seconds,
    gradient: Seconds,
}

impl OpticsJudge<'_> {
    /// Compares a network with exact tracing; `watch` hears the number of lenses that are done; its error ends the
    /// comparison.
    pub fn gap(
        &self,
        proxy: &ProxyOptics,
        watch: &dyn Fn(usize) -> Result<(), Cancelled>,
    ) -> Result<OpticsGap> {
        let mut all = Vec::with_capacity(self.lenses);
        for number in 0..self.lenses {
            let (lens, _) = self.sampler.lens(number as u64)?;
            all.push(self.one(&lens, proxy)?);
            watch(number + 1)?;
        }
        let count = all.len().max(1) as f64;
        let mean = |of: &dyn Fn(&OneLens) -> f64| all.iter().map(of).sum::<f64>() / count;
        let radii = &self.sampler.plan().field_radius_mm;
        let fields: Vec<OpticsFieldGap> = (0..radii.len())
            .map(|i| OpticsFieldGap {
                radius_mm: radii[i],
                l1: mean(&|one| one.fields[i].l1),
                centroid_um: mean(&|one| one.fields[i].centroid_um),
                exact_rms_um: mean(&|one| one.fields[i].exact_rms_um),
                rms_um: mean(&|one| one.fields[i].rms_um),
                illumination: mean(&|one| one.fields[i].illumination),
            })
            .collect();
        let over_fields =
            |of: fn(&OpticsFieldGap) -> f64| fields.iter().map(of).sum::<f64>() / fields.len().max(1) as f64;
        let mut cosines: Vec<f64> = all.iter().map(|one| one.cosine).collect();
        cosines.sort_by(f64::total_cmp);
        // Between neighbouring values by straight lines.
        let quantile = |share: f64| {
            let at = (cosines.len() - 1) as f64 * share;
            let below = at as usize;
            let above = (below + 1).min(cosines.len() - 1);
            cosines[below] + (at - below as f64) * (cosines[above] - cosines[below])
        };
        let seconds = |of: fn(&OneLens) -> Seconds| Seconds {
            exact: mean(&|one| of(one).exact),
            proxy: mean(&|one| of(one).proxy),
        };
        Ok(OpticsGap {
            lenses: all.len(),
            l1: over_fields(|f| f.l1),
            centroid_um: over_fields(|f| f.centroid_um),
            exact_rms_um: over_fields(|f| f.exact_rms_um),
            rms_um: over_fields(|f| f.rms_um),
            illumination: over_fields(|f| f.illumination),
            gradient_cosine: quantile(0.5),
            low_gradient_cosine: quantile(0.1),
            psfs: seconds(|one| one.psfs),
            gradient: seconds(|one| one.gradient),
            fields,
        })
    }

    fn one(&self, lens: &Lens, proxy: &ProxyOptics) -> Result<OneLens> {
        let (plan, space) = (self.sampler.plan(), &self.sampler.start().space);
        let x = space.free(&space.space().coordinates(lens));
        let mut timed = Timed { clock: self.clock, last: (self.clock)() };

        let traced = plan.trace(lens)?;
        let exact_psfs = timed.lap();
        let predicted = proxy.psfs(lens, &plan.field_radius_mm)?;
        let proxy_psfs = timed.lap();
        let (by_exact, by_predicted) =
            (self.limit.gradient(&traced.bank)?, self.limit.gradient(&predicted.bank)?);
        timed.lap();
        let exact_slopes = space.pull_back(&x, lens, &pulled(plan, &traced, &by_exact));
        let exact_gradient = timed.lap();
        let LimitGradient { by_values, by_illumination, .. } = &by_predicted;
        let proxy_slopes =
            space.pull_back_coordinates(&x, &predicted.by_coordinates(by_values, by_illumination)?);
        let proxy_gradient = timed.lap();

        Ok(OneLens {
            fields: compare(&traced.bank, &predicted.bank),
            cosine: cosine(&exact_slopes, &proxy_slopes),
            psfs: Seconds { exact: exact_psfs, proxy: proxy_psfs },
            gradient: Seconds { exact: exact_gradient, proxy: proxy_gradient },
        })
    }
}

fn pulled(
    plan: &PsfPlan,
    traced: &BankWithTape,
    by: &LimitGradient,
) -> petzval_optics::gradient::LensGradient {
    let by_radius: Vec<f32> = by.by_radius.iter().map(|v| *v as f32).collect();
    plan.gradient(traced, &by.by_values, &by.by_illumination, &by_radius)
}

/// Laps on a clock.
struct Timed<'a> {
    clock: &'a dyn Fn() -> f64,
    last: f64,
}

impl Timed<'_> {
    fn lap(&mut self) -> f64 {
        let now = (self.clock)();
        now - std::mem::replace(&mut self.last, now)
    }
}

fn cosine(a: &[f64], b: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let lengths = (dot(a, a) * dot(b, b)).sqrt();
    if lengths > 0.0 { dot(a, b) / lengths } else { 0.0 }
}

/// The errors of every field, means over the colours.
fn compare(exact: &PsfBank, predicted: &PsfBank) -> Vec<OpticsFieldGap> {
    let (grid, pitch_um) = (exact.grid, exact.pitch_um);
    let cells = grid * grid;
    let colours = exact.illumination.len() / exact.field_radius_mm.len().max(1);
    let one = |field: usize| {
        let mut gap = OpticsFieldGap {
            radius_mm: exact.field_radius_mm[field],
            l1: 0.0,
            centroid_um: 0.0,
            exact_rms_um: 0.0,
            rms_um: 0.0,
            illumination: 0.0,
        };
        for place in (0..colours).map(|c| field * colours + c) {
            let [a, b] = [exact, predicted].map(|bank| &bank.values[place * cells..][..cells]);
            let [at_a, at_b] = [a, b].map(|psf| moments(psf, grid, pitch_um));
            gap.l1 += a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>();
            gap.centroid_um += (at_a.x_um - at_b.x_um).hypot(at_a.y_um - at_b.y_um);
            gap.exact_rms_um += at_a.rms_um;
            gap.rms_um += (at_a.rms_um - at_b.rms_um).abs();
            gap.illumination += f64::from((exact.illumination[place] - predicted.illumination[place]).abs());
        }
        let share = 1.0 / colours.max(1) as f64;
        for sum in
            [&mut gap.l1, &mut gap.centroid_um, &mut gap.exact_rms_um, &mut gap.rms_um, &mut gap.illumination]
        {
            *sum *= share;
        }
        gap
    };
    (0..exact.field_radius_mm.len()).map(one).collect()
}

/// Centroid of a PSF of unit sum, and the root mean square distance from it.
struct Moments {
    x_um: f64,
    y_um: f64,
    rms_um: f64,
}

fn moments(psf: &[f32], grid: usize, pitch_um: f64) -> Moments {
    let at = |i: usize| (i as f64 - 0.5 * (grid - 1) as f64) * pitch_um;
    let mean = |of: &dyn Fn(f64, f64) -> f64| {
        psf.iter().enumerate().map(|(i, v)| f64::from(*v) * of(at(i % grid), at(i / grid))).sum::<f64>()
    };
    let (x_um, y_um) = (mean(&|x, _| x), mean(&|_, y| y));
    let square = mean(&|x, y| (x - x_um).powi(2) + (y - y_um).powi(2));
    Moments { x_um, y_um, rms_um: maximum(square, 0.0).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_a_shifted_psf_are_its_shift() {
        // A point, and the same point two cells further along x and one along y, half as bright.
        let point = |x: usize, y: usize, light: f32| {
            let mut values = vec![0.0; 64];
            values[8 * y + x] = 1.0;
            PsfBank {
                field_radius_mm: vec![0.0],
                grid: 8,
                pitch_um: 1.5,
                values: values.repeat(3),
                illumination: vec![light; 3],
            }
        };
        let [gap] = compare(&point(3, 3, 1.0), &point(5, 4, 0.5))[..] else { panic!("one field") };
        assert!((gap.l1 - 2.0).abs() < 1e-9);
        assert!((gap.centroid_um - 1.5 * 5.0_f64.sqrt()).abs() < 1e-9);
        assert!(gap.rms_um.abs() < 1e-9 && gap.exact_rms_um.abs() < 1e-9);
        assert!((gap.illumination - 0.5).abs() < 1e-9);
    }

    #[test]
    fn cosines_are_those_of_angles() {
        assert!((cosine(&[1.0, 1.0], &[1.0, 0.0]) - 0.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(cosine(&[0.0, 0.0], &[1.0, 0.0]), 0.0);
    }
}
