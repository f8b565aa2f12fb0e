//! PSFs for the renderer from measured ones: cells smaller than a pixel, the axis of the field up.
//!
//! A pixel has integrated the light over its area already. The renderer integrates what it is given over pixels *again*,
//! and turns it first; measured pixels used as its cells would be blurred twice as soon as they are turned. So the bank
//! holds not the pixels but the light that explains them: cells `x >= 0` of a third of a pixel with
//!
//! ```text
//! y_j = (A_j x)_j + noise,    A_j: turn to the azimuth of position j, put at its centroid, integrate over pixels
//! ```
//!
//! `A_j` is the renderer's own operator ([`Landing`]), so rendering a point returns what was measured. Positions
//! of one field radius at several azimuths and sub-pixel phases see the same x, which is what makes cells below a pixel
//! knowable. Each channel is fitted to the *mosaic's* own pixels of its colour: nothing is demosaiced.
//!
//! The fit is Richardson and Lucy's, with the read noise as the offset of Snyder et al. (J. Opt. Soc. Am. A 10, 1014,
//! 1993): `x <- x A'[(y + b)/(A x + b)] / A'1`, `b = var(y) T - y` in electrons. It stops when the residuals are as large
//! as the noise (mean squared residual over variance at 1), or at 2000 rounds. Cells beyond half the crop stay dark.
//!
//! The middle of the grid is the green centroid, not the chief ray, which a measured spot does not show: lateral colour between
//! channels is kept, the distance between chief ray and centroid is lost, as distortion is.

use rayon::prelude::*;

use super::landing::{Landing, Spot};
use super::measure::{CROP, Frame, Measured};
use super::merge::Merged;
use crate::image::CHANNELS;
use crate::psf::{PsfBank, PsfError};

/// Cells of the bank along a pixel.
pub const CELLS_PER_PIXEL: usize = 3;

/// Cells along a side of the bank's grid.
pub const GRID: usize = CROP * CELLS_PER_PIXEL;

/// Rounds of the fit at most.
const ROUNDS: usize = 2000;

/// Two positions closer in radius than this are of one field, mm.
pub const SAME_FIELD_MM: f64 = 0.05;

/// One measured place, as the estimate needs it.
#[derive(Debug, Clone, Copy)]
pub struct Place<'a> {
    /// Radius of the field, mm.
    pub field_radius_mm: f64,
    /// Direction away from the axis, rad from the columns towards higher rows.
    pub azimuth_rad: f64,
    /// Factor from the light of the source to relative illumination before it is divided by that of the innermost field.
    pub light_factor: f64,
    /// The window.
    pub frame: &'a Frame,
    /// Rates and variances.
    pub merged: &'a Merged,
    /// PSF and centroid.
    pub measured: &'a Measured,
}

/// How the cells of a field came out.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldEstimate {
    /// Mean radius of its positions, mm.
    pub field_radius_mm: f64,
    /// Positions that see it.
    pub positions: usize,
    /// Mean squared residual over the variance, per channel; 1 where the bank explains the pixels down to noise.
    pub chi2: [f64; CHANNELS],
    /// Rounds of the fit, per channel.
    pub rounds: [usize; CHANNELS],
}

/// The bank of measured PSFs, and how each field was fitted.
///
/// The field nearest to the axis also stands for the axis if no position is on it.
pub fn estimate_bank(
    places: &[Place],
    pixel_um: f64,
) -> Result<(PsfBank, Vec<FieldEstimate>), PsfError> {
    let mut order: Vec<&Place> = places.iter().collect();
    order.sort_by(|a, b| a.field_radius_mm.total_cmp(&b.field_radius_mm));
    let mut fields: Vec<Vec<&Place>> = Vec::new();
    for place in order {
        match fields.last_mut() {
            Some(field) if place.field_radius_mm - field[0].field_radius_mm < SAME_FIELD_MM => field.push(place),
            _ => fields.push(vec![place]),
        }
    }
    if fields.is_empty() {
        return Err(PsfError::NoField);
    }
    let pitch_um = pixel_um / CELLS_PER_PIXEL as f64;
    let mut bank = PsfBank {
        field_radius_mm: Vec::new(),
        grid: GRID,
        pitch_um,
        values: Vec::new(),
        illumination: Vec::new(),
    };
    let mut axis_light = [0.0; CHANNELS];
    let mut estimates = Vec::new();
    for field in &fields {
        let count = field.len() as f64;
        let radius_mm = field.iter().map(|p| p.field_radius_mm).sum::<f64>() / count;
        let landings: Vec<Landing> = field.iter().map(|p| landing(p, pixel_um)).collect();
        let channels: Vec<(Vec<f64>, f64, usize)> =
            (0..CHANNELS).into_par_iter().map(|c| fit(field, &landings, c)).collect();
        for (c, (cells, _, _)) in channels.iter().enumerate() {
            let sum: f64 = cells.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            bank.values.extend(cells.iter().map(|v| (v / sum) as f32));
            let light =
                field.iter().map(|p| p.light_factor * p.measured.psf.light_e_per_s[c]).sum::<f64>() / count;
            if estimates.is_empty() {
                axis_light[c] = light;
            }
            bank.illumination.push((light / axis_light[c]) as f32);
        }
        bank.field_radius_mm.push(radius_mm);
        estimates.push(FieldEstimate {
            field_radius_mm: radius_mm,
            positions: field.len(),
            chi2: [0, 1, 2].map(|c| channels[c].1),
            rounds: [0, 1, 2].map(|c| channels[c].2),
        });
    }
    // The renderer's fields start on the axis.
    if bank.field_radius_mm[0] < SAME_FIELD_MM {
        bank.field_radius_mm[0] = 0.0;
    } else {
        let first = CHANNELS * GRID * GRID;
        bank.field_radius_mm.insert(0, 0.0);
        bank.values = [&bank.values[..first], &bank.values[..]].concat();
        bank.illumination = [&bank.illumination[..CHANNELS], &bank.illumination[..]].concat();
    }
    bank.validate()?;
    Ok((bank, estimates))
}

/// The renderer's operator for one position: cells to pixels of the window.
fn landing(place: &Place, pixel_um: f64) -> Landing {
    let [row, col] = place.measured.psf.centroid_px[1];
    let spot = Spot { row, col, azimuth_rad: place.azimuth_rad };
    let size = (place.frame.height, place.frame.width);
    Landing::new((GRID, pixel_um / CELLS_PER_PIXEL as f64), spot, 0.0, pixel_um, size)
}

/// Fits the cells of one channel; returns them with the mean squared residual over variance and the rounds.
fn fit(field: &[&Place], landings: &[Landing], channel: usize) -> (Vec<f64>, f64, usize) {
    // Of each position: its pixels of this colour in electrons, offset by the read noise.
    let data: Vec<Vec<Datum>> = field.iter().map(|p| pixels(p, channel)).collect();
    let centre = 0.5 * (GRID as f64 - 1.0);
    let mut cells: Vec<f64> = (0..GRID * GRID)
        .map(|i| {
            let distance = ((i / GRID) as f64 - centre).hypot((i % GRID) as f64 - centre);
            if distance < 0.5 * GRID as f64 { 1.0 / (GRID * GRID) as f64 } else { 0.0 }
        })
        .collect();
    let spread = |values: &dyn Fn(&Datum) -> f64, landing: &Landing, data: &[Datum]| {
        let mut window = vec![0.0; landing.height * landing.width];
        data.iter().for_each(|d| window[d.pixel] = values(d));
        landing.gather(&window)
    };
    let add = |sum: &mut Vec<f64>, part: Vec<f64>| sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
    let mut seen = vec![0.0; cells.len()];
    for (landing, data) in landings.iter().zip(&data) {
        add(&mut seen, spread(&|d| d.electrons, landing, data));
    }
    let count: usize = data.iter().map(Vec::len).sum();
    let mut chi2 = f64::INFINITY;
    let mut rounds = 0;
    while rounds < ROUNDS {
        let (mut square, mut ratio) = (0.0, vec![0.0; cells.len()]);
        for (landing, data) in landings.iter().zip(&data) {
            let landed = landing.land(&cells);
            let expected = |d: &Datum| d.electrons * landed[d.pixel];
            square += data.iter().map(|d| (d.value - expected(d)).powi(2) / d.variance).sum::<f64>();
            let quotient = |d: &Datum| {
                d.electrons * ((d.value + d.offset).max(0.0) / (expected(d) + d.offset).max(f64::MIN_POSITIVE))
            };
            add(&mut ratio, spread(&quotient, landing, data));
        }
        chi2 = square / count.max(1) as f64;
        if chi2 <= 1.0 {
            break;
        }
        for ((cell, ratio), seen) in cells.iter_mut().zip(&ratio).zip(&seen) {
            *cell *= if *seen > 0.0 { ratio / seen } else { 0.0 };
        }
        rounds += 1;
    }
    (cells, chi2, rounds)
}

/// A pixel of the mosaic, in electrons over the whole time that it gathered light.
struct Datum {
    pixel: usize,
    /// Signal.
    value: f64,
    /// Its variance.
    variance: f64,
    /// What of the variance is no shot noise of the signal.
    offset: f64,
    /// Electrons of the whole source in this colour.
    electrons: f64,
}

/// Pixels of the crop with the channel's colour that were not saturated.
fn pixels(place: &Place, channel: usize) -> Vec<Datum> {
    let (row, col) = place.measured.psf.corner;
    let of_crop = (0..CROP * CROP).map(|i| (row + i / CROP) * place.frame.width + col + i % CROP);
    let usable = of_crop
        .filter(|i| place.frame.is_colour(*i, channel) && !place.merged.saturated[*i]);
    usable
        .map(|pixel| {
            let time_s = place.merged.time_s[pixel];
            let value = place.measured.mosaic_e_per_s[pixel] * time_s;
            let variance = place.merged.variance[pixel] * time_s * time_s;
            Datum {
                pixel,
                value,
                variance,
                offset: (variance - value.max(0.0)).max(1e-3 * variance),
                electrons: place.measured.psf.light_e_per_s[channel] * time_s,
            }
        })
        .collect()
}
