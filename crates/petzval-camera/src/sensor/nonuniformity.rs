//! Non-uniformity: differences between the pixels of one sensor, and noise that the pixels of a row or column share.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::noise::FrameStreams;
use super::{OutOfRange, SensorModel};
use crate::render::Placement;
use petzval_base::random::{Stage, Stream, place};

/// Non-uniformity of a sensor. All zero by default.
///
/// The fixed pattern (DSNU, PRNU, hot pixels) belongs to one specimen of the sensor and is drawn with the seed `specimen`.
/// Row and column noise are drawn anew for every frame. The numbers are standard deviations, split as in EMVA 1288: a
/// pixel's offset is the sum of three independent parts, one of the pixel, one of its row and one of its column.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct NonUniformity {
    /// Number of the specimen: the seed of its fixed pattern.
    pub specimen: u64,
    /// DSNU of single pixels, electrons.
    pub dsnu_pixel_e: f64,
    /// DSNU of rows, electrons.
    pub dsnu_row_e: f64,
    /// DSNU of columns, electrons.
    pub dsnu_column_e: f64,
    /// PRNU of single pixels, percent of the signal.
    pub prnu_pixel_percent: f64,
    /// PRNU of rows, percent of the signal.
    pub prnu_row_percent: f64,
    /// PRNU of columns, percent of the signal.
    pub prnu_column_percent: f64,
    /// Share of the pixels that are hot, 0..1.
    pub hot_pixel_share: f64,
    /// Mean excess dark current of hot pixels, electrons per second. The excess is exponentially distributed.
    pub hot_pixel_e_per_s: f64,
    /// Temporal noise that the pixels of a row share, electrons.
    pub row_noise_e: f64,
    /// Temporal noise that the pixels of a column share, electrons.
    pub column_noise_e: f64,
}

impl NonUniformity {
    /// Checks that every number is finite and in its physical range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let checks = [
            ("nonuniformity.dsnu_pixel_e", self.dsnu_pixel_e, 1e6, "the DSNU of single pixels in electrons"),
            ("nonuniformity.dsnu_row_e", self.dsnu_row_e, 1e6, "the DSNU of rows in electrons"),
            ("nonuniformity.dsnu_column_e", self.dsnu_column_e, 1e6, "the DSNU of columns in electrons"),
            (
                "nonuniformity.prnu_pixel_percent",
                self.prnu_pixel_percent,
                30.0,
                "the PRNU of single pixels in percent",
            ),
            ("nonuniformity.prnu_row_percent", self.prnu_row_percent, 30.0, "the PRNU of rows in percent"),
            (
                "nonuniformity.prnu_column_percent",
                self.prnu_column_percent,
                30.0,
                "the PRNU of columns in percent",
            ),
            (
                "nonuniformity.hot_pixel_share",
                self.hot_pixel_share,
                1.0,
                "the share of hot pixels, 0.001 = one in a thousand",
            ),
            (
                "nonuniformity.hot_pixel_e_per_s",
                self.hot_pixel_e_per_s,
                1e9,
                "the mean dark current of hot pixels in electrons per second",
            ),
            ("nonuniformity.row_noise_e", self.row_noise_e, 1e6, "the temporal noise of rows in electrons"),
            (
                "nonuniformity.column_noise_e",
                self.column_noise_e,
                1e6,
                "the temporal noise of columns in electrons",
            ),
        ];
        for (key, value, high, meaning) in checks {
            if !(0.0..=high).contains(&value) {
                return Err(OutOfRange { key, value, low: 0.0, high, meaning });
            }
        }
        Ok(())
    }
}

/// The fixed pattern of a window of one specimen, row by row.
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
    /// Excess dark current of each pixel, electrons per second; zero except in hot pixels.
    pub dark_e_per_s: Vec<f32>,
}

impl SensorModel {
    /// The fixed pattern of the specimen in the window of `height` x `width` pixels at `placement`. It is the same in every
    /// frame, and the truth against which a characterisation of the specimen is compared. No command writes it.
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

/// The non-uniformity of one pixel in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PixelPattern {
    /// DSNU with row and column noise, electrons.
    pub offset_e: f64,
    /// PRNU: factor on the light.
    pub response: f64,
    /// Dark current of a hot pixel, electrons per second.
    pub dark_e_per_s: f64,
}

/// The non-uniformity that the pixels of one row, or of one column, share: offset in electrons, relative response.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Shared {
    offset_e: f64,
    response: f64,
}

/// Draws the non-uniformity of a specimen and, with temporal streams, the row and column noise of one frame.
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
    /// The pattern of a specimen. With `frame` it includes the row and column noise of that frame.
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

    /// The part that a sensor row shares.
    pub fn of_row(&self, row: usize) -> Shared {
        let [dsnu, prnu] = self.row.normals(place(row, 0));
        let noise = self.temporal.map_or(0.0, |[rows, _]| rows.normals(place(row, 0))[0]);
        Shared {
            offset_e: self.of.dsnu_row_e * dsnu + self.of.row_noise_e * noise,
            response: 0.01 * self.of.prnu_row_percent * prnu,
        }
    }

    /// The part that a sensor column shares.
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

    /// Excess dark current of a pixel, electrons per second: zero unless the pixel is hot.
    #[inline(always)]
    fn hot_of(&self, place: u32) -> f64 {
        self.of.hot_pixel_e_per_s * self.hot.rare_exponential(place, self.of.hot_pixel_share)
    }

    /// Adds the parts of the pixel, its row and its column. The response is at least 0: light never gives negative charge.
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
        // Skip the draws of a non-uniformity that the sensor does not have.
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

/// Working memory of [`Pattern::pixels_row`], reused for the next row.
#[derive(Debug, Default)]
pub(super) struct PatternScratch {
    dsnu: Vec<f64>,
    prnu: Vec<f64>,
    hot: Vec<f64>,
}
