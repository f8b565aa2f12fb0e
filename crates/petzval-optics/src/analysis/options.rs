//! Resolution and range of the analyses.

use super::cone::Cone;
use crate::lens::Lens;
use crate::paraxial::first_order;
use crate::seidel::marginal_and_chief;

/// Resolution and range of the analyses.
#[derive(Clone, Debug, PartialEq)]
pub struct AnalysisOptions {
    /// Cells a side of the pupil of geometric analyses, even.
    pub pupil_cells: usize,
    /// Rings of the pattern of spot diagrams.
    pub spot_rings: usize,
    /// Points of a fan, odd.
    pub fan_points: usize,
    /// Rays of a fan in the layout.
    pub layout_rays: usize,
    /// Points over the field.
    pub field_points: usize,
    /// Pixel pitch of the sensor, um, if one is known: its Nyquist frequency takes the place of the highest frequency in the defaults below.
    pub pixel_pitch_um: Option<f64>,
    /// Highest frequency of MTF curves, cycles/mm; `None`: 100, or about half of the cutoff of the lens if that is less, but beyond the
    /// Nyquist frequency.
    pub max_frequency_per_mm: Option<f64>,
    /// Points of an MTF curve.
    pub frequency_points: usize,
    /// Frequencies of MTF over the field, cycles/mm; empty: a quarter, a half and all of the highest, or of the
    /// Nyquist frequency.
    pub field_frequencies_per_mm: Vec<f64>,
    /// Frequency of MTF through focus, cycles/mm; `None`: half of the highest, or of the Nyquist frequency.
    pub focus_frequency_per_mm: Option<f64>,
    /// Range of through-focus curves to both sides of the image plane, mm; `None`: up to a blur of two periods of the
    /// frequency by the f-number.
    pub focus_range_mm: Option<f64>,
    /// Points of a through-focus curve, odd.
    pub focus_points: usize,
    /// Points of encircled energy.
    pub radius_points: usize,
}

impl Default for AnalysisOptions {
    fn default() -> Self {
        Self {
            pupil_cells: 64,
            spot_rings: 10,
            fan_points: 65,
            layout_rays: 7,
            field_points: 31,
            pixel_pitch_um: None,
            max_frequency_per_mm: None,
            frequency_points: 101,
            field_frequencies_per_mm: Vec::new(),
            focus_frequency_per_mm: None,
            focus_range_mm: None,
            focus_points: 61,
            radius_points: 64,
        }
    }
}

/// Default of the highest frequency, cycles/mm.
const COMMON_FREQUENCY: f64 = 100.0;

/// Least ratio of the highest shown frequency to the Nyquist frequency, so that the mark of the Nyquist frequency lies within the curves.
const SHOWN_OF_NYQUIST: f64 = 1.1;

/// Default of the highest frequency for a lens with a lower cutoff, as a share of the cutoff.
const SHOWN_OF_CUTOFF: f64 = 0.5;

impl AnalysisOptions {
    /// Highest frequency of MTF curves, cycles/mm.
    pub fn highest_frequency(&self, lens: &Lens) -> f64 {
        let shown = || {
            let of_lens = round_up(SHOWN_OF_CUTOFF * cutoff_per_mm(lens)).min(COMMON_FREQUENCY);
            self.nyquist_per_mm().map_or(of_lens, |nyquist| of_lens.max(round_up(SHOWN_OF_NYQUIST * nyquist)))
        };
        self.max_frequency_per_mm.unwrap_or_else(shown)
    }

    /// The Nyquist frequency of the sensor, half a cycle a pixel, cycles/mm.
    pub fn nyquist_per_mm(&self) -> Option<f64> {
        self.pixel_pitch_um.map(|pitch| 1e3 / (2.0 * pitch))
    }

    /// The Nyquist frequency of the sensor; the highest frequency if no sensor is known.
    fn finest(&self, lens: &Lens) -> f64 {
        self.nyquist_per_mm().unwrap_or_else(|| self.highest_frequency(lens))
    }

    /// Frequencies of MTF over the field, cycles/mm.
    pub fn frequencies_by_field(&self, lens: &Lens) -> Vec<f64> {
        if self.field_frequencies_per_mm.is_empty() {
            [0.25, 0.5, 1.0].map(|share| share * self.finest(lens)).to_vec()
        } else {
            self.field_frequencies_per_mm.clone()
        }
    }

    /// Frequency of MTF through focus, cycles/mm.
    pub fn frequency_through_focus(&self, lens: &Lens) -> f64 {
        self.focus_frequency_per_mm.unwrap_or_else(|| 0.5 * self.finest(lens))
    }

    /// Shifts of the image plane of a through-focus curve, mm.
    pub(super) fn defocus_mm(&self, lens: &Lens) -> Vec<f64> {
        let range = self.focus_range_mm.unwrap_or_else(|| {
            // A shift dz blurs a point to a disk of diameter dz / f-number.
            round_up(2.0 * image_f_number(lens) / self.frequency_through_focus(lens))
        });
        evenly(-range, range, self.focus_points.max(3))
    }

    /// Fields from the axis, or from [`Lens::reference_field_deg`], to the full field, degrees; from one end to the other where the lens has fields
    /// on both sides.
    pub(super) fn fields_deg(&self, lens: &Lens) -> Vec<f64> {
        let first = lens.reference_field_deg();
        let lowest = lens.fields_deg.iter().copied().fold(first, f64::min);
        let highest = lens.fields_deg.iter().copied().fold(first, f64::max);
        let count = self.field_points.max(2);
        if lowest == highest {
            return vec![first; count];
        }
        if highest == first { evenly(first, lowest, count) } else { evenly(lowest, highest, count) }
    }
}

/// Evenly spaced numbers from one value to another.
pub(super) fn evenly(from: f64, to: f64, count: usize) -> Vec<f64> {
    let last = (count - 1) as f64;
    (0..count).map(|i| (from * (last - i as f64) + to * i as f64) / last).collect()
}

/// The next round number that is not less.
pub(super) fn round_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 1.0;
    }
    let decade = 10_f64.powf(value.log10().floor());
    let digit = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0]
        .into_iter()
        .find(|d| d * decade >= value * (1.0 - 1e-9));
    digit.unwrap_or(10.0) * decade
}

/// `1 / (2 n' tan U')` of the paraxial cone at the image, by which the light on a sensor is counted: the distance from the exit pupil, divided by
/// the pupil's diameter and the index. [`Cone`] has the numerical aperture of real rays.
pub fn image_f_number(lens: &Lens) -> f64 {
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    let index = sequence.surfaces.last().map_or(1.0, |s| s.n_after.abs());
    let along = (order.image_distance_mm - order.exit_pupil_at_mm).abs();
    if along.is_finite() {
        return along / (order.exit_pupil_mm * index);
    }
    if !order.image_distance_mm.is_finite() {
        return f64::INFINITY;
    }
    // The exit pupil is at infinity: the cone is that of the marginal ray.
    let (marginal, _) = marginal_and_chief(&sequence, 0.0);
    marginal.w.last().map_or(f64::INFINITY, |w| 0.5 / w.abs())
}

/// Cutoff frequency of the MTF on the axis, cycles/mm.
fn cutoff_per_mm(lens: &Lens) -> f64 {
    Cone::of(lens).cutoff_per_mm(lens.reference_um)
}
