//! Counts of digital numbers, and the histogram of one colour at one point.

use serde::Serialize;

use super::captures::Kind;
use petzval_camera::sensor::Colour;

/// Number of occurrences of each digital number.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Counts {
    /// First digital number that occurs.
    pub first_dn: u32,
    /// Occurrences of `first_dn`, `first_dn + 1`, ...
    pub counts: Vec<u64>,
}

impl Counts {
    /// Counts from a table over all digital numbers from 0.
    pub(super) fn of(table: &[u64]) -> Self {
        let first = table.iter().position(|c| *c > 0).unwrap_or(0);
        let end = table.iter().rposition(|c| *c > 0).map_or(first, |last| last + 1);
        Self { first_dn: first as u32, counts: table[first..end].to_vec() }
    }

    /// Total number of occurrences.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Last digital number that occurs.
    pub fn last_dn(&self) -> u32 {
        self.first_dn + self.counts.len().saturating_sub(1) as u32
    }

    /// The least digital number that a share of the samples, 0 to 1, does not exceed.
    pub fn quantile_dn(&self, share: f64) -> u32 {
        let wanted = share * self.total() as f64;
        let mut below = 0;
        let place = self.counts.iter().position(|count| {
            below += count;
            below as f64 >= wanted
        });
        self.first_dn + place.unwrap_or(0) as u32
    }

    /// Occurrences of one digital number.
    pub fn at(&self, dn: i64) -> u64 {
        let place = usize::try_from(dn - i64::from(self.first_dn)).ok();
        place.and_then(|i| self.counts.get(i)).copied().unwrap_or(0)
    }

    /// The sum of two histograms.
    pub fn merge(&self, other: &Self) -> Self {
        match (self.counts.is_empty(), other.counts.is_empty()) {
            (true, _) => return other.clone(),
            (_, true) => return self.clone(),
            _ => {}
        }
        let (first, last) = (self.first_dn.min(other.first_dn), self.last_dn().max(other.last_dn()));
        let counts = (first..=last).map(|dn| self.at(dn.into()) + other.at(dn.into())).collect();
        Self { first_dn: first, counts }
    }
}

/// The captured histogram of one colour at one point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointHistogram {
    /// Index of the point; all its colours got the same light.
    pub point: usize,
    /// Whether light fell on the sensor.
    pub kind: Kind,
    /// Linear gain.
    pub linear_gain: f64,
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Photons per pixel, if they are known.
    pub photons: Option<f64>,
    /// Black level of this gain above that of the lowest gain, DN, as stated.
    pub black_shift_dn: f64,
    /// Colour; `None` for dark frames, where all pixels are alike.
    pub colour: Option<Colour>,
    /// Pixels; each contributes one sample per frame.
    pub pixels: usize,
    /// Whether the point lies within the range of photon transfer of its colour; dark ones always do.
    pub in_range: bool,
    /// The counts.
    pub counts: Counts,
}
