//! A lens, its tolerances and what it is judged by, made ready.

use nalgebra::{DMatrix, DVector};

use super::compensator::{Cost, least};
use super::made::{self, Off, active, at_fixed_stop, derivative, drawn};
use super::{Failure, Freedom, Perturbation, ToleranceError, draw};
use crate::gradient::LensGradient;
use crate::lens::{Lens, LensDefect, validate};
use crate::merit::{Better, Merit};
use crate::paraxial::first_order;

/// What may be off, and what is set anew on every lens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tolerances {
    /// What may be off.
    pub perturbations: Vec<Perturbation>,
    /// What is set so that the merit is best, with the greatest travel to either side, if it has one, in its unit.
    pub compensators: Vec<(Freedom, Option<f64>)>,
}

impl Tolerances {
    /// Checks them against a lens.
    pub fn check(&self, lens: &Lens) -> Result<(), ToleranceError> {
        let positive = |freedom: &Freedom, tolerance: f64| {
            if tolerance > 0.0 && tolerance.is_finite() {
                Ok(())
            } else {
                Err(ToleranceError::NotPositive { what: freedom.name(), tolerance })
            }
        };
        for p in &self.perturbations {
            p.freedom.check(lens)?;
            positive(&p.freedom, p.tolerance)?;
        }
        for (freedom, travel) in &self.compensators {
            freedom.check(lens)?;
            positive(freedom, travel.unwrap_or(1.0))?;
        }
        Ok(())
    }
}

/// A lens as made, its compensators set.
#[derive(Clone, Debug)]
pub struct Made {
    /// The lens.
    pub lens: Lens,
    /// Its merit.
    pub value: f64,
    /// Where its compensators stand, counted from the lens as drawn, in their units.
    pub compensators: Vec<f64>,
    /// The gradient of the merit by the numbers of the lens, at a fixed diameter of the stop; `None` if the merit has none.
    pub gradient: Option<LensGradient>,
}

/// A lens with its tolerances and its merit.
pub struct Study<'a> {
    tolerances: &'a Tolerances,
    merit: &'a dyn Merit,
    /// The lens as drawn, with a placement on every surface that may be moved.
    drawn: Lens,
    stop_radius_mm: f64,
    /// Freedoms: the perturbations, then the compensators.
    freedoms: Vec<Freedom>,
    limits: Vec<Option<f64>>,
    nominal: Made,
    /// Second derivatives of the cost by the compensators.
    hessian: DMatrix<f64>,
    /// How far each compensator goes per unit of each perturbation: `[compensator, perturbation]`.
    follow: DMatrix<f64>,
}

impl<'a> Study<'a> {
    /// Makes it ready: sets the compensators of the nominal lens and learns how they follow each perturbation.
    pub fn new(
        lens: &Lens,
        tolerances: &'a Tolerances,
        merit: &'a dyn Merit,
    ) -> Result<Self, ToleranceError> {
        tolerances.check(lens)?;
        let freedoms: Vec<Freedom> = (tolerances.perturbations.iter().map(|p| p.freedom))
            .chain(tolerances.compensators.iter().map(|(freedom, _)| *freedom))
            .collect();
        let (perturbed, compensated) = (tolerances.perturbations.len(), tolerances.compensators.len());
        let mut study = Self {
            tolerances,
            merit,
            drawn: drawn(lens, freedoms.iter().copied()),
            stop_radius_mm: first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm,
            freedoms,
            limits: tolerances.compensators.iter().map(|(_, travel)| *travel).collect(),
            nominal: Made {
                lens: lens.clone(),
                value: f64::NAN,
                compensators: vec![0.0; compensated],
                gradient: None,
            },
            hessian: DMatrix::identity(compensated, compensated),
            follow: DMatrix::zeros(compensated, perturbed),
        };
        let still = vec![0.0; perturbed];
        // The Hessian at a far start may be far off, so that of the best place is taken afterwards.
        for _ in 0..2 {
            study.learn_compensators()?;
            let nominal = study.build(&still).ok().or_else(|| study.make(&still));
            study.nominal = nominal.ok_or(ToleranceError::NoMerit)?;
        }
        Ok(study)
    }

    /// The lens as it should be, its compensators set.
    pub fn nominal(&self) -> &Made {
        &self.nominal
    }

    /// Its tolerances.
    pub fn tolerances(&self) -> &Tolerances {
        self.tolerances
    }

    /// What it is judged by.
    pub fn merit(&self) -> &dyn Merit {
        self.merit
    }

    /// Which way the merit is good.
    pub fn better(&self) -> Better {
        self.merit.better()
    }

    /// What every perturbation is off by in a trial.
    pub fn draw(&self, seed: u64, trial: u64) -> Vec<f64> {
        draw(&self.tolerances.perturbations, seed, trial)
    }

    /// The lens with every perturbation set to its value in `off`, in the order of the tolerances; `None` if it forms no image. Its parts may
    /// run into each other: see [`Study::build`].
    pub fn make(&self, off: &[f64]) -> Option<Made> {
        self.compensated(off, &|_| true)
    }

    /// [`Study::make`] of a lens that can be built, by the check of [`validate`]. Fails with the reason if it cannot, or forms no image.
    ///
    /// Where the best place of the compensators would push parts into each other, they stay where these still fit.
    pub fn build(&self, off: &[f64]) -> Result<Made, Failure> {
        let Some(made) = self.make(off) else {
            let lens = self.lens(&self.off(off, &self.nominal.compensators));
            return Err(defect(&lens).map_or(Failure::NoImage, Failure::CannotBeBuilt));
        };
        let Some(found) = defect(&made.lens) else { return Ok(made) };
        self.compensated(off, &|lens| defect(lens).is_none()).ok_or(Failure::CannotBeBuilt(found))
    }

    /// [`Study::build`] with compensators that begin where the lens as drawn has them: they move by as much as errors move their best places. Without
    /// errors it is the lens as drawn. Travels are kept.
    pub fn build_from_drawn(&self, off: &[f64]) -> Result<Lens, Failure> {
        let made = self.build(off)?;
        let moved = made.compensators.iter().zip(&self.nominal.compensators).zip(&self.limits);
        let within = |((at, nominal), limit): ((&f64, &f64), &Option<f64>)| {
            limit.map_or(at - nominal, |limit| (at - nominal).clamp(-limit, limit))
        };
        let lens = self.lens(&self.off(off, &moved.map(within).collect::<Vec<_>>()));
        defect(&lens).map_or(Ok(lens), |found| Err(Failure::CannotBeBuilt(found)))
    }

    /// The lens off by `off` with its compensators where the merit is best among lenses that are `allowed`; `None` if none of them forms an image.
    fn compensated(&self, off: &[f64], allowed: &dyn Fn(&Lens) -> bool) -> Option<Made> {
        let perturbed = off.len();
        // To first order the compensators follow like this.
        let follows = &self.follow * DVector::from_column_slice(off);
        let start: Vec<f64> =
            self.nominal.compensators.iter().zip(follows.iter()).map(|(at, moved)| at + moved).collect();
        let mut cost = |compensators: &[f64]| {
            let made = self.look(off, compensators, allowed)?;
            let by = (perturbed..self.freedoms.len())
                .map(|k| self.by_compensator(off, &made, k))
                .collect::<Option<_>>()?;
            Some(Cost { value: self.better().cost(made.value), by, note: made })
        };
        // Where the first guess brings no light, the nominal place may, or that of the drawing.
        let starts = [start, self.nominal.compensators.clone(), vec![0.0; self.limits.len()]];
        let least = starts.iter().find_map(|at| least(&mut cost, at, &self.hessian, &self.limits))?;
        Some(least.cost.note)
    }

    /// The lens with compensators at given places; `None` if it is not `allowed` or forms no image.
    fn look(&self, off: &[f64], compensators: &[f64], allowed: &dyn Fn(&Lens) -> bool) -> Option<Made> {
        let lens = self.lens(&self.off(off, compensators));
        if !allowed(&lens) {
            return None;
        }
        let (value, gradient) = self.merit.with_gradient(&lens)?;
        let gradient = gradient.map(|g| at_fixed_stop(&lens, g));
        value.is_finite().then(|| Made { lens, value, compensators: compensators.to_vec(), gradient })
    }

    /// Derivative of the cost by compensator `k` of the freedoms, by differences if need be.
    fn by_compensator(&self, off: &[f64], made: &Made, k: usize) -> Option<f64> {
        let all = self.off(off, &made.compensators);
        match made.gradient.as_ref().and_then(|g| derivative(&self.drawn, &active(&all), k, all[k], g)) {
            Some(by) => Some(self.better().slope(made.value) * by),
            None => self.difference(&all, k),
        }
    }

    /// Derivatives of the merit of a made lens, off by `off`, by each perturbation, per unit, the compensators following: where
    /// the merit is best, moving them changes nothing to first order. `None` where a perturbation has no place in the gradient, or
    /// the merit has no gradient.
    pub fn derivatives(&self, off: &[f64], made: &Made) -> Vec<Option<f64>> {
        let all = self.off(off, &made.compensators);
        let active = active(&all);
        let by = |k: usize| derivative(&self.drawn, &active, k, all[k], made.gradient.as_ref()?);
        (0..off.len()).map(by).collect()
    }

    fn off(&self, off: &[f64], compensators: &[f64]) -> Vec<Off> {
        self.freedoms.iter().copied().zip(off.iter().chain(compensators).copied()).collect()
    }

    /// The lens with its perturbations and compensators at given places.
    fn lens(&self, off: &[Off]) -> Lens {
        made::made(&self.drawn, off, self.stop_radius_mm)
    }

    /// Derivative of the cost by a freedom, by central differences of the merit.
    fn difference(&self, off: &[Off], k: usize) -> Option<f64> {
        let step = off[k].0.quantity.step();
        let at = |moved: f64| {
            let mut off = off.to_vec();
            off[k].1 += moved;
            Some(self.better().cost(self.merit.value(&self.lens(&off))?))
        };
        Some((at(step)? - at(-step)?) / (2.0 * step))
    }

    /// Derivatives of the merit of the nominal lens by each perturbation, per unit, the compensators following: by gradient where
    /// there is one, else by central differences.
    pub fn nominal_derivatives(&self) -> Vec<f64> {
        let still = vec![0.0; self.tolerances.perturbations.len()];
        let off = self.off(&still, &self.nominal.compensators);
        let per = self.better().slope(self.nominal.value);
        let by_difference = |k: usize| {
            self.difference(&off, k).map_or(f64::NAN, |by| if per == 0.0 { 0.0 } else { by / per })
        };
        let by_gradient = self.derivatives(&still, &self.nominal);
        by_gradient.into_iter().enumerate().map(|(k, by)| by.unwrap_or_else(|| by_difference(k))).collect()
    }

    /// Second derivatives around the nominal lens, by differences of derivatives.
    fn learn_compensators(&mut self) -> Result<(), ToleranceError> {
        let perturbed = self.tolerances.perturbations.len();
        let still = vec![0.0; perturbed];
        let compensated = self.limits.len();
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(compensated);
        for c in 0..compensated {
            // Wide enough that merits by differences still show a change of their slope.
            let step = 10.0 * self.freedoms[perturbed + c].quantity.step();
            let at = |moved: f64| {
                let mut compensators = self.nominal.compensators.clone();
                compensators[c] += moved;
                let made = self.look(&still, &compensators, &|_| true)?;
                let per = self.better().slope(made.value);
                let by = self.derivatives(&still, &made).into_iter().map(|by| by.map_or(0.0, |by| per * by));
                let count = self.freedoms.len();
                let more = (perturbed..count).map(|k| self.by_compensator(&still, &made, k));
                by.map(Some).chain(more).collect::<Option<Vec<f64>>>()
            };
            let (above, below) =
                (at(step).ok_or(ToleranceError::NoMerit)?, at(-step).ok_or(ToleranceError::NoMerit)?);
            let bend = |(a, b): (&f64, &f64)| (a - b) / (2.0 * step);
            rows.push(above.iter().zip(&below).map(bend).collect());
        }
        let bend = |r: usize, c: usize| 0.5 * (rows[r][perturbed + c] + rows[c][perturbed + r]);
        let mut hessian = DMatrix::from_fn(compensated, compensated, bend);
        if hessian.clone().cholesky().is_none() {
            // No least here: each by itself, downhill.
            let size = |i: usize| hessian[(i, i)].abs().max(1e-12);
            hessian = DMatrix::from_fn(compensated, compensated, |r, c| if r == c { size(r) } else { 0.0 });
        }
        let mixed = DMatrix::from_fn(compensated, perturbed, |c, p| rows[c][p]);
        // At the best place the slope stays zero: H dc + (mixed) dp = 0.
        let follow = hessian.clone().cholesky().map(|factor| -factor.solve(&mixed));
        self.follow = follow.unwrap_or_else(|| DMatrix::zeros(compensated, perturbed));
        self.hessian = hessian;
        Ok(())
    }
}

/// How small a surface without an edge of its own may become, as a share of its clear semi-diameter, so that a lens can be built.
const NARROWEST: f64 = 0.15;

/// Why a lens with errors cannot be built. The sizes of surfaces without an edge are no parts: such surfaces may be smaller, as they are when a
/// lens file is read.
fn defect(lens: &Lens) -> Option<LensDefect> {
    let found = validate(lens).err()?;
    let mut narrow = lens.clone();
    for (_, surface) in narrow.surfaces.iter_mut().enumerate().filter(|(i, s)| s.is_open && *i != lens.stop) {
        surface.semi_diameter_mm *= NARROWEST;
    }
    if narrow == *lens { Some(found) } else { validate(&narrow).err() }
}
