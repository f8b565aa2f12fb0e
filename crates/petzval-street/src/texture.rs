//! Two-coloured patterns of cloth, plaster and boards.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::colour::{Rgb, blend, surface_colour};
use crate::families::Drawer;
use crate::noise::{cells2, fractal2, hash, leaves2, unit, value2};

/// How a pattern is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pattern {
    /// Soft patches.
    Mottled,
    /// Level stripes of uneven width.
    Striped,
    /// Overlapping discs.
    Leaves,
    /// Crossed stripes.
    Plaid,
    /// Cells with dark edges.
    Cells,
    /// Small dots.
    Speckled,
    /// Two halves, one above the other.
    Halves,
    /// Fine upright strokes.
    Brushed,
}

const PATTERNS: [(Pattern, &str); 8] = [
    (Pattern::Mottled, "mottled"),
    (Pattern::Striped, "striped"),
    (Pattern::Leaves, "leaves"),
    (Pattern::Plaid, "plaid"),
    (Pattern::Cells, "cells"),
    (Pattern::Speckled, "speckled"),
    (Pattern::Halves, "halves"),
    (Pattern::Brushed, "brushed"),
];

/// A pattern of two reflectances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Texture {
    pub pattern: Pattern,
    /// Reflectance of the ground and of the figure.
    pub colours: [Rgb; 2],
    /// Features per metre.
    pub frequency: f64,
    /// How strongly the figure shows, 0..1.
    pub contrast: f32,
    pub seed: u32,
}

impl Texture {
    /// A texture of any family whose features are about `size_m` metres large.
    pub fn draw(rng: &mut ChaCha8Rng, drawer: &mut Drawer, size_m: f64) -> Self {
        let pattern = drawer.draw(rng, "texture", &PATTERNS);
        let colours = [surface_colour(rng), surface_colour(rng)];
        let frequency = 1.0 / (size_m * 2f64.powf(rng.random_range(-1.0..1.0)));
        // Many surfaces are nearly of one colour.
        let contrast = rng.random::<f32>().powf(1.2);
        Self { pattern, colours, frequency, contrast, seed: rng.random() }
    }

    /// The reflectance at a place (across, up) in metres. `footprint_m` is the width of a pixel there: finer detail is averaged.
    pub fn at(&self, across: f64, up: f64, footprint_m: f64) -> Rgb {
        let (u, v) = (across * self.frequency, up * self.frequency);
        let seed = self.seed;
        let figure = match self.pattern {
            Pattern::Mottled => smooth(0.42, 0.58, fractal2(u, v, 3, seed)),
            Pattern::Striped => {
                let warped = v + 0.3 * f64::from(value2(0.4 * u, v, seed));
                step(unit(hash(warped.floor() as i32, 3, 0, seed)) - 0.5)
            }
            Pattern::Leaves => leaves2(0.6 * u, 0.6 * v, seed),
            Pattern::Plaid => {
                let line = |x: f64, k: i32| unit(hash((2.0 * x).floor() as i32, k, 0, seed));
                0.5 * (step(line(u, 5) - 0.55) + step(line(v, 6) - 0.55))
            }
            Pattern::Cells => {
                let (tone, edge) = cells2(0.8 * u, 0.8 * v, seed);
                if edge < 0.08 { 1.0 } else { 0.6 * tone }
            }
            Pattern::Speckled => {
                let (tone, edge) = cells2(2.0 * u, 2.0 * v, seed);
                step(tone - 0.7) * smooth(0.1, 0.3, edge)
            }
            Pattern::Halves => step(v as f32 - 0.5 + 0.1 * value2(2.0 * u, 0.0, seed)),
            Pattern::Brushed => {
                0.5 * (fractal2(6.0 * u, 0.7 * v, 2, seed) + fractal2(0.5 * u, 0.2 * v, 2, seed + 1))
            }
        };
        // Far away the pattern melts into its mean.
        let resolved = (0.7 / (footprint_m * self.frequency).max(1e-9)).min(1.0) as f32;
        let figure = 0.5 + (figure - 0.5) * resolved;
        blend(self.colours[0], self.colours[1], figure * self.contrast)
    }
}

fn step(x: f32) -> f32 {
    if x > 0.0 { 1.0 } else { 0.0 }
}

/// A smooth rise from 0 at `low` to 1 at `high`.
pub(crate) fn smooth(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
