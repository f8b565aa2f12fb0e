//! Random lenses of a design space.

use std::sync::Arc;

use petzval_optics::lens::{Lens, validate};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::{DesignError, Result};
use crate::lens::psf_plan::{BankWithTape, PsfPlan};
use crate::lens::start::Start;

/// Least width of the draws about the centre over the largest: the logarithm of the width is drawn evenly between them.
const LEAST_WIDTH: f64 = 0.03;

/// Share of the light that the grid of a PSF must hold at every field for which a lens is drawn; else another is drawn.
const LEAST_CAPTURED: f64 = 0.9;

/// Draws after which a space is said to hold no lenses.
const MOST_DRAWN: usize = 2000;

/// Lenses over which the inputs of a network are normalised.
const SCALED_BY: u64 = 2000;

/// Keeps these draws apart from all else that is drawn from a seed.
const OWN: u64 = 0x006c_656e_7365_7321;

/// Random lenses within the bounds of a design space, at foci within its defocus, whose light arrives.
pub struct LensSampler {
    start: Arc<Start>,
    plan: PsfPlan,
    seed: u64,
    /// Free coordinates about which lenses are drawn.
    centre: Vec<f64>,
    /// Largest width of the draws, as a share of the way to the bounds.
    reach: f64,
}

impl LensSampler {
    /// Lenses about a start, sampled on the fields of a plan.
    pub fn new(start: Arc<Start>, plan: PsfPlan, seed: u64) -> Self {
        let centre = start.space.start().to_vec();
        Self { start, plan, seed, centre, reach: 1.0 }
    }

    /// The same about other free coordinates, as far as a share of the way to the bounds.
    pub fn about(self, centre: &[f64], reach: f64) -> Self {
        Self { centre: centre.to_vec(), reach, ..self }
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

    /// Free coordinates about the centre: near it or anywhere within reach.
    fn draw(&self, random: &mut ChaCha8Rng) -> Vec<f64> {
        let width = self.reach * random.random_range(LEAST_WIDTH.ln()..=0.0).exp();
        let places = self.centre.iter().map(|x| {
            let (here, there) = (x.sin(), random.random_range(-1.0..=1.0));
            (here + width * (there - here)).asin()
        });
        places.collect()
    }

    /// Coordinates of random lenses, light or no light, each with an image radius up to the corner's behind them.
    pub fn inputs(&self, corner_mm: f64) -> Vec<Vec<f64>> {
        let space = &self.start.space;
        let input = |number| {
            let mut random = self.random(number);
            let lens = space.lens_at(&self.draw(&mut random)).ok()?;
            let mut row = space.space().coordinates(&lens);
            row.push(random.random_range(0.0..=corner_mm));
            Some(row)
        };
        (0..SCALED_BY).filter_map(input).collect()
    }

    /// The free coordinates of a lens whose light arrives at all fields of the plan.
    pub fn coordinates(&self, number: u64) -> Result<Vec<f64>> {
        self.first(number, |_| self.plan.clone()).map(|(x, ..)| x)
    }

    /// A lens with the PSFs of all fields of the plan.
    pub fn lens(&self, number: u64) -> Result<(Lens, BankWithTape)> {
        self.first(number, |_| self.plan.clone()).map(|(_, lens, traced)| (lens, traced))
    }

    /// A lens with its PSF at one field, drawn evenly from the axis to the corner; other fields of it may have no light.
    pub fn lens_and_field(&self, number: u64) -> Result<(Lens, BankWithTape)> {
        let corner_mm = self.plan.field_radius_mm.last().copied().unwrap_or(0.0);
        self.first(number, |random| {
            let radius_mm = random.random_range(0.0..=corner_mm);
            PsfPlan { field_radius_mm: vec![radius_mm], ..self.plan.clone() }
        })
        .map(|(_, lens, traced)| (lens, traced))
    }

    /// The first lens of a stream of draws whose light arrives.
    fn first(
        &self,
        number: u64,
        plan: impl Fn(&mut ChaCha8Rng) -> PsfPlan,
    ) -> Result<(Vec<f64>, Lens, BankWithTape)> {
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
                return Ok((x, lens, traced));
            }
        }
        Err(DesignError::NoLensInBounds { draws: MOST_DRAWN, percent: 100.0 * LEAST_CAPTURED })
    }
}
