//! Counter-based random numbers of a frame: the same seed, frame, stage and pixel give the same number.
//!
//! A noise source draws from a [`Stream`], which has no state. The number of a sensor pixel is a function of the seed (the
//! key of the generator) and of the frame, the stage and the pixel's place on the sensor (the counter). Crops, threads and
//! vector widths therefore cannot change it. The functions of one pixel are the readable reference; the `_row` functions
//! are loops over them that compile to vector code.

mod elementary;
mod philox;
mod poisson;

use elementary::{ln, sin_cos_turns, unit};
use philox::philox4x32;
pub use poisson::{PoissonScratch, poisson, poisson_row};

/// What a stream serves: a noise source, or a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Stage {
    /// Shot noise: the Poisson count of electrons.
    Shot = 1,
    /// Read noise and electronics noise of a pixel.
    Read = 2,
    /// The dither of dequantised counts.
    Dither = 3,
    /// Noise that a row shares.
    Row = 4,
    /// Noise that a column shares.
    Column = 5,
    /// DSNU and PRNU of a pixel.
    FixedPixel = 6,
    /// DSNU and PRNU of a row.
    FixedRow = 7,
    /// DSNU and PRNU of a column.
    FixedColumn = 8,
    /// Whether a pixel is hot, and its excess dark current.
    Hot = 9,
    /// A point of a random search; its generation takes the place of the frame.
    Search = 10,
    /// The errors of a lens that is designed to be made; the step takes the place of the frame.
    LensError = 11,
    /// The exposure of a frame, where a network is to learn many.
    Exposure = 12,
}

/// The random numbers of one noise source in one frame.
#[derive(Debug, Clone, Copy)]
pub struct Stream {
    key: [u32; 2],
    stage: Stage,
    frame: [u32; 2],
}

/// Counter of a sensor pixel. Sensors have at most 65536 rows and columns, so each pixel has its own counter.
#[inline(always)]
pub fn place(row: usize, col: usize) -> u32 {
    (row as u32) << 16 | col as u32 & 0xFFFF
}

impl Stream {
    /// The stream of a stage in a frame.
    pub fn new(seed: u64, frame: u64, stage: Stage) -> Self {
        let halves = |v: u64| [v as u32, (v >> 32) as u32];
        Self { key: halves(seed), stage, frame: halves(frame) }
    }

    /// Two independent numbers, uniform in the open interval (0, 1). `attempt` (below 2^24) selects the pair at a place.
    #[inline(always)]
    pub fn uniforms(self, place: u32, attempt: u32) -> [f64; 2] {
        let [low, high] = self.frame;
        let [a, b] = philox4x32([place, (self.stage as u32) << 24 | attempt, low, high], self.key);
        [unit(a), unit(b)]
    }

    /// Two independent standard normal numbers, by the transform of Box and Muller (1958):
    /// `sqrt(-2 ln u) (cos, sin)(2 pi v)`. With 52-bit uniforms their magnitude is at most 8.6.
    #[inline(always)]
    pub fn normals(self, place: u32) -> [f64; 2] {
        let [u, v] = self.uniforms(place, 0);
        let radius = (-2.0 * ln(u)).sqrt();
        let (sin, cos) = sin_cos_turns(v);
        [radius * cos, radius * sin]
    }

    /// An exponentially distributed number of mean 1 with probability `share`, else 0.
    #[inline(always)]
    pub fn rare_exponential(self, place: u32, share: f64) -> f64 {
        let [u, v] = self.uniforms(place, 0);
        if u < share { -ln(v) } else { 0.0 }
    }

    /// [`Self::uniforms`] of consecutive pixels of a row, from `first` on.
    #[inline(always)]
    pub fn uniforms_row(self, first: u32, u: &mut [f64], v: &mut [f64]) {
        for (i, (u, v)) in u.iter_mut().zip(v).enumerate() {
            [*u, *v] = self.uniforms(first.wrapping_add(i as u32), 0);
        }
    }

    /// [`Self::normals`] of consecutive pixels of a row, from `first` on.
    #[inline(always)]
    pub fn normals_row(self, first: u32, a: &mut [f64], b: &mut [f64]) {
        for (i, (a, b)) in a.iter_mut().zip(b).enumerate() {
            [*a, *b] = self.normals(first.wrapping_add(i as u32));
        }
    }
}

#[cfg(test)]
mod tests;
