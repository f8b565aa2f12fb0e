//! Random lenses of a design space.

use std::sync::Arc;

use petzval_optics::lens::{Lens, validate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::proxy::{ProxyDomain, Scale};
use crate::error::DesignError;
use crate::psf_plan::{BankWithTape, PsfPlan};
use crate::start::Start;

/// Widths of the draws about the start, as shares of the way to the bounds: the logarithm is drawn evenly between these.
const WIDTHS: [f64; 2] = [0.03, 1.0];

/// Share of the light that the grid of a PSF must hold at every field for which a lens is drawn; else another is drawn.
const LEAST_CAPTURED: f64 = 0.9;

/// Draws after which a space is said to hold no lenses.
const MOST_DRAWN: usize = 2000;

/// Lenses over which inputs are normalised.
const SCALED_BY: u64 = 2000;

/// Keeps these draws apart from all else that is drawn from a seed.
const OWN: u64 = 0x006c_656e_7365_7321;

/// Random lenses within the bounds of a design space, at foci within its defocus, whose light arrives.
pub struct LensSampler {
    start: Arc<Start>,
    plan: PsfPlan,
    seed: u64,
}

impl LensSampler {
    /// Lenses about a start, sampled on the fields of a plan.
    pub fn new(start: Arc<Start>, plan: PsfPlan, seed: u64) -> Self {
        Self { start, plan, seed }
    }

    /// The lenses' start.
    pub fn start(&self) -> &Start {
        &self.start
    }

    /// The fields and grids on which they are sampled.
    pub fn plan(&self) -> &PsfPlan {
        &self.plan
    }

    fn random(&self, number: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed ^ OWN);
        random.set_stream(number);
        random
    }

    /// Free coordinates about the start: near it or anywhere between the bounds.
    fn draw(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let [least, most] = WIDTHS.map(f64::ln);
        let width = random.random_range(least..=most).exp();
        let start = self.start.space.start();
        let places = start.iter().map(|x| {
            let (here, there) = (x.sin(), random.random_range(-1.0..=1.0));
            (here + width * (there - here)).asin()
        });
        places.collect()
    }

    /// Mean and deviation of the coordinates of random lenses, light or no light, and of the fields.
    pub fn scale(&self, domain: &ProxyDomain) -> Scale {
        let space = &self.start.space;
        let mut rows = Vec::new();
        for number in 0..SCALED_BY {
            let mut random = self.random(number);
            if let Ok(lens) = space.lens_at(&self.draw(&mut random)) {
                let mut row = space.space().coordinates(&lens);
                row.push(random.random_range(0.0..=domain.corner_mm));
                rows.push(row);
            }
        }
        let count = rows.len().max(1) as f64;
        let inputs = space.dimension() + 1;
        let mean: Vec<f64> = (0..inputs).map(|i| rows.iter().map(|r| r[i]).sum::<f64>() / count).collect();
        let variance = |i: usize| rows.iter().map(|r| (r[i] - mean[i]).powi(2)).sum::<f64>() / count;
        let deviation = (0..inputs).map(|i| variance(i).sqrt().max(f64::MIN_POSITIVE)).collect();
        Scale { deviation, mean }
    }

    /// A lens with the PSFs of all fields of the plan.
    pub fn lens(&self, number: u64) -> Result<(Lens, BankWithTape), DesignError> {
        self.first(number, |_| self.plan.clone())
    }

    /// A lens with its PSF at one field, drawn evenly from the axis to the corner; other fields of it may have no light.
    pub fn lens_and_field(&self, number: u64) -> Result<(Lens, BankWithTape), DesignError> {
        let corner_mm = self.plan.field_radius_mm.last().copied().unwrap_or(0.0);
        self.first(number, |random| {
            let radius_mm = random.random_range(0.0..=corner_mm);
            PsfPlan { field_radius_mm: vec![radius_mm], ..self.plan.clone() }
        })
    }

    /// The first lens of a stream of draws whose light arrives.
    fn first(
        &self,
        number: u64,
        plan: impl Fn(&mut ChaCha8Rng) -> PsfPlan,
    ) -> Result<(Lens, BankWithTape), DesignError> {
        let mut random = self.random(number);
        for _ in 0..MOST_DRAWN {
            let x = self.draw(&mut random);
            let plan = plan(&mut random);
            let Ok(lens) = self.start.space.lens_at(&x) else { continue };
            if validate(&lens).is_err() {
                continue;
            }
            let Ok(traced) = plan.trace(&lens) else { continue };
            if traced.captured() >= LEAST_CAPTURED {
                return Ok((lens, traced));
            }
        }
        Err(DesignError::NoLensInBounds { draws: MOST_DRAWN, percent: 100.0 * LEAST_CAPTURED })
    }
}
