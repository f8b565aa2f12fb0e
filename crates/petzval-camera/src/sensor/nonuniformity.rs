//! Non-uniformity: differences between the pixels of one sensor, and noise that the pixels of a row or column share.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::OutOfRange;

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
