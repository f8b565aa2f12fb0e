//! The pattern of one specimen of a sensor: what its non-uniformity draws for each pixel, row and column.

#[cfg(any(feature = "wgpu", feature = "cuda"))]
use super::capture::Capture;
use super::model::SensorModel;
use super::noise::FrameStreams;
#[cfg(any(feature = "wgpu", feature = "cuda"))]
use super::noise::Noise;
use super::nonuniformity::NonUniformity;
use crate::render::Placement;
use petzval_base::random::{Stage, Stream, place};

/// What is fixed in a window of one specimen of a sensor, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedPattern {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Offset of each pixel, electrons (DSNU).
    pub offset_e: Vec<f32>,
    /// Factor on the light of each pixel (PRNU), about 1.
    pub response: Vec<f32>,
    /// Dark current of each pixel above that of the sensor, electrons per second; zero but for hot pixels.
    pub dark_e_per_s: Vec<f32>,
}

impl SensorModel {
    /// The fixed pattern of the specimen in the window of `height` x `width` pixels at `placement`, whatever the frame:
    /// the truth that a characterisation of the specimen is held to. For programs; no command writes it.
    pub fn fixed_pattern(&self, placement: Placement, height: usize, width: usize) -> FixedPattern {
        let pattern = Pattern::new(&self.nonuniformity, None);
        let pixels = |i: usize| pattern.pixel(placement.row + i / width, placement.col + i % width);
        let all: Vec<PixelPattern> = (0..height * width).map(pixels).collect();
        FixedPattern {
            height,
            width,
            offset_e: all.iter().map(|p| p.offset_e as f32).collect(),
            response: all.iter().map(|p| p.response as f32).collect(),
            dark_e_per_s: all.iter().map(|p| p.dark_e_per_s as f32).collect(),
        }
    }
}

/// What the rows, then the columns of a window have in common in a frame: offset in electrons, and part of the response, of each in turn.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
pub(crate) fn shared_lines(
    sensor: &SensorModel,
    capture: &Capture,
    noise: &Noise,
    height: usize,
    width: usize,
) -> Vec<f32> {
    let streams = FrameStreams::new(noise, capture);
    let pattern = Pattern::new(&sensor.nonuniformity, Some(&streams));
    let Placement { row, col } = capture.placement;
    let rows = (row..row + height).map(|row| pattern.of_row(row));
    let columns = (col..col + width).map(|col| pattern.of_column(col));
    rows.chain(columns).flat_map(|shared| [shared.offset_e as f32, shared.response as f32]).collect()
}

/// What sets one pixel apart in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PixelPattern {
    /// DSNU with row and column noise, electrons.
    pub offset_e: f64,
    /// PRNU: factor on the light.
    pub response: f64,
    /// Dark current of a hot pixel, electrons per second.
    pub dark_e_per_s: f64,
}

/// What the pixels of one row, or of one column, have in common.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Shared {
    offset_e: f64,
    response: f64,
}

/// Draws of a specimen, and of one frame where it has temporal streams.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pattern<'a> {
    of: &'a NonUniformity,
    temporal: Option<[Stream; 2]>,
    pixel: Stream,
    row: Stream,
    column: Stream,
    hot: Stream,
}

impl<'a> Pattern<'a> {
    /// The pattern of a specimen; with `frame`, also the noise that rows and columns have in it.
    pub fn new(of: &'a NonUniformity, frame: Option<&FrameStreams>) -> Self {
        let stream = |stage| Stream::new(of.specimen, 0, stage);
        Self {
            of,
            temporal: frame.filter(|f| f.noisy()).map(|f| [f.row, f.column]),
            pixel: stream(Stage::FixedPixel),
            row: stream(Stage::FixedRow),
            column: stream(Stage::FixedColumn),
            hot: stream(Stage::Hot),
        }
    }

    /// What a sensor row has in common.
    pub fn of_row(&self, row: usize) -> Shared {
        let [dsnu, prnu] = self.row.normals(place(row, 0));
        let noise = self.temporal.map_or(0.0, |[rows, _]| rows.normals(place(row, 0))[0]);
        Shared {
            offset_e: self.of.dsnu_row_e * dsnu + self.of.row_noise_e * noise,
            response: 0.01 * self.of.prnu_row_percent * prnu,
        }
    }

    /// What a sensor column has in common.
    pub fn of_column(&self, col: usize) -> Shared {
        let [dsnu, prnu] = self.column.normals(place(0, col));
        let noise = self.temporal.map_or(0.0, |[_, columns]| columns.normals(place(0, col))[0]);
        Shared {
            offset_e: self.of.dsnu_column_e * dsnu + self.of.column_noise_e * noise,
            response: 0.01 * self.of.prnu_column_percent * prnu,
        }
    }

    /// The pattern of one sensor pixel.
    pub fn pixel(&self, row: usize, col: usize) -> PixelPattern {
        let at = place(row, col);
        self.combine(self.of_row(row), self.of_column(col), self.pixel.normals(at), self.hot_of(at))
    }

    /// Hot pixels are few and each has a dark current of its own.
    #[inline(always)]
    fn hot_of(&self, place: u32) -> f64 {
        self.of.hot_pixel_e_per_s * self.hot.rare_exponential(place, self.of.hot_pixel_share)
    }

    /// A pixel's own part, its row's and its column's add up; no pixel answers light with negative charge.
    #[inline(always)]
    fn combine(
        &self,
        row: Shared,
        column: Shared,
        [dsnu, prnu]: [f64; 2],
        dark_e_per_s: f64,
    ) -> PixelPattern {
        let own = 0.01 * self.of.prnu_pixel_percent * prnu;
        PixelPattern {
            offset_e: self.of.dsnu_pixel_e * dsnu + row.offset_e + column.offset_e,
            response: (1.0 + own + row.response + column.response).max(0.0),
            dark_e_per_s,
        }
    }

    /// [`Self::pixel`] of consecutive pixels of a row from sensor column `first_col` on; `columns` holds their
    /// [`Self::of_column`].
    #[inline(always)]
    pub fn pixels_row(
        &self,
        row: usize,
        first_col: usize,
        columns: &[Shared],
        scratch: &mut PatternScratch,
        out: &mut PatternRow,
    ) {
        let (n, first, of_row) = (columns.len(), place(row, first_col), self.of_row(row));
        let PatternScratch { dsnu, prnu, hot } = scratch;
        for values in [&mut *dsnu, prnu, hot, &mut out.offset_e, &mut out.response, &mut out.dark_e_per_s] {
            values.resize(n, 0.0);
        }
        // What a sensor does not have costs nothing.
        if self.of.dsnu_pixel_e != 0.0 || self.of.prnu_pixel_percent != 0.0 {
            self.pixel.normals_row(first, dsnu, prnu);
        }
        if self.of.hot_pixel_share * self.of.hot_pixel_e_per_s != 0.0 {
            for (i, hot) in hot.iter_mut().enumerate() {
                *hot = self.hot_of(first.wrapping_add(i as u32));
            }
        }
        let (dsnu, prnu, hot) = (&dsnu[..n], &prnu[..n], &hot[..n]);
        let PatternRow { offset_e, response, dark_e_per_s } = out;
        let (offset_e, response) = (&mut offset_e[..n], &mut response[..n]);
        let dark_e_per_s = &mut dark_e_per_s[..n];
        for i in 0..n {
            let pixel = self.combine(of_row, columns[i], [dsnu[i], prnu[i]], hot[i]);
            (offset_e[i], response[i], dark_e_per_s[i]) =
                (pixel.offset_e, pixel.response, pixel.dark_e_per_s);
        }
    }
}

/// [`PixelPattern`] of a row.
#[derive(Debug, Default)]
pub(super) struct PatternRow {
    pub offset_e: Vec<f64>,
    pub response: Vec<f64>,
    pub dark_e_per_s: Vec<f64>,
}

/// Memory of [`Pattern::pixels_row`], to be used again for the next row.
#[derive(Debug, Default)]
pub(super) struct PatternScratch {
    dsnu: Vec<f64>,
    prnu: Vec<f64>,
    hot: Vec<f64>,
}
