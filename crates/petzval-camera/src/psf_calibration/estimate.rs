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
//! 1993): `u <- u B'[(y + b)/(B u + b)] / B'1`, `b = var(y) T - y` in electrons. There are more cells than pixels, so the
//! cells are a sum of round blobs, `x = G u` and `B = A G` (the method of sieves, Snyder & Miller 1985), of a standard
//! deviation of 0.42, 0.27 or 0.17 pixels, the first that explains the pixels: no detail is made up that they do not ask for. The renderer's PSF is that of a
//! rotationally symmetric lens, so u is kept symmetric about the field's own axis and, in the middle of the image, seen at eight
//! azimuths. The fit stops when residuals are as large as the noise (mean square over variance at 1), when 20 rounds lower
//! that by less than 0.03 %, or at 1500 rounds. Cells beyond half the crop stay dark but for the blobs' rim.
//!
//! The cells also hold the field's *light*. The sum of a demosaiced spot is no measure of it: of a spot as small as a pixel a red
//! pixel in four catches much or little, by where it falls. Positions of one radius see one source through a rotationally symmetric
//! lens, so they have one light, and their phases together tell how much. In green they do to a tenth or better; red and blue
//! of the sharpest spots leave it open, so the relative illumination of green stands for all colours.
//!
//! Where each position's middle lies is fitted too, by turns with the cells: the demosaiced centroid of a sharp spot is off by
//! parts of a pixel. The middle of the grid is the green centroid, not the chief ray, which a measured spot does not show: lateral colour between
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
const ROUNDS: usize = 800;

/// The fit is looked at so often, in rounds, ...
const LOOK: usize = 20;

/// ... and ends when it gained less than this share since.
const GAIN: f64 = 3e-4;

/// Standard deviations of a blob, cells, from smooth to sharp: the first that explains the pixels is taken.
const BLOBS_CELLS: [f64; 3] = [1.25, 0.8, 0.5];

/// Mean squared residual over the variance at which pixels count as explained.
const EXPLAINED: f64 = 1.2;

/// How often positions are put right between fits, ...
const REGISTRATIONS: usize = 4;

/// ... which take so many rounds.
const REGISTRATION_ROUNDS: usize = 100;

/// Step of the differences behind a registration, px.
const STEP_PX: f64 = 0.02;

/// Farthest that one registration moves a position, px.
const MOST_PX: f64 = 0.3;

/// Azimuths at which a position on the axis counts.
const AXIS_AZIMUTHS: usize = 8;

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
    /// Where the middle of the PSF lies in the window of each position: its index in the list of places, and (row, column), px.
    pub middle_px: Vec<(usize, [f64; 2])>,
}

/// The bank of measured PSFs, and how each field was fitted.
///
/// The field nearest to the axis also stands for the axis if no position is on it.
pub fn estimate_bank(places: &[Place], pixel_um: f64) -> Result<(PsfBank, Vec<FieldEstimate>), PsfError> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|a, b| places[*a].field_radius_mm.total_cmp(&places[*b].field_radius_mm));
    let mut fields: Vec<Vec<usize>> = Vec::new();
    for index in order {
        let radius_mm = places[index].field_radius_mm;
        match fields.last_mut() {
            Some(field) if radius_mm - places[field[0]].field_radius_mm < SAME_FIELD_MM => field.push(index),
            _ => fields.push(vec![index]),
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
    let mut axis_light = 0.0;
    let mut estimates = Vec::new();
    for members in &fields {
        let field: Vec<&Place> = members.iter().map(|i| &places[*i]).collect();
        let count = field.len() as f64;
        let radius_mm = field.iter().map(|p| p.field_radius_mm).sum::<f64>() / count;
        // On the axis no azimuth is special.
        let turns = if radius_mm < SAME_FIELD_MM { AXIS_AZIMUTHS } else { 1 };
        let turn = |k: usize| std::f64::consts::TAU * k as f64 / turns as f64;
        let seen: Vec<Place> = (0..turns)
            .flat_map(|k| field.iter().map(move |p| Place { azimuth_rad: p.azimuth_rad + turn(k), ..**p }))
            .collect();
        let land = |middle: &[[f64; 2]]| -> Vec<Landing> {
            let at = middle.iter().cycle();
            seen.iter().zip(at).map(|(p, at)| landing(p, *at, pixel_um)).collect()
        };
        let fit_all = |landings: &[Landing], blob: f64, rounds: usize| -> Vec<Fit> {
            (0..CHANNELS).into_par_iter().map(|c| fit(&seen, landings, c, blob, rounds)).collect()
        };

        // Demosaiced centroids of sharp spots are off by parts of a pixel, each its own: put the positions right.
        let mut middle: Vec<[f64; 2]> = field.iter().map(|p| p.measured.psf.centroid_px[1]).collect();
        for _ in 0..REGISTRATIONS {
            let fits = fit_all(&land(&middle), BLOBS_CELLS[1], REGISTRATION_ROUNDS);
            let outward = outward_px(&fits[1].cells);
            for (place, middle) in field.iter().zip(&mut middle) {
                let moved = misplaced(place, *middle, &fits, pixel_um);
                let (sin, cos) = place.azimuth_rad.sin_cos();
                // And keep the green centroid in the middle of the grid; on the axis it is there.
                let outward = if turns > 1 { 0.0 } else { outward };
                *middle = [middle[0] + moved[0] + outward * sin, middle[1] + moved[1] + outward * cos];
            }
        }
        let landings = land(&middle);
        let channels: Vec<Fit> = (0..CHANNELS)
            .into_par_iter()
            .map(|c| {
                let mut best = fit(&seen, &landings, c, BLOBS_CELLS[0], ROUNDS);
                for blob in &BLOBS_CELLS[1..] {
                    if best.chi2 <= EXPLAINED {
                        break;
                    }
                    let sharper = fit(&seen, &landings, c, *blob, ROUNDS);
                    if sharper.chi2 < best.chi2 {
                        best = sharper;
                    }
                }
                best
            })
            .collect();
        let mut light = [0.0; CHANNELS];
        for (c, fit) in channels.iter().enumerate() {
            let sum: f64 = fit.cells.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            bank.values.extend(fit.cells.iter().map(|v| (v / sum) as f32));
            light[c] = sum * field.iter().map(|p| p.light_factor).sum::<f64>() / count;
        }
        // Half of the pixels see green, a quarter red; lenses dim all colours nearly alike.
        if estimates.is_empty() {
            axis_light = light[1];
        }
        bank.illumination.extend([(light[1] / axis_light) as f32; CHANNELS]);
        bank.field_radius_mm.push(radius_mm);
        estimates.push(FieldEstimate {
            field_radius_mm: radius_mm,
            positions: field.len(),
            chi2: [0, 1, 2].map(|c| channels[c].chi2),
            rounds: [0, 1, 2].map(|c| channels[c].rounds),
            middle_px: members.iter().copied().zip(middle).collect(),
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

/// The renderer's operator for one position: cells to pixels of the window, the middle of the grid at (row, column).
fn landing(place: &Place, [row, col]: [f64; 2], pixel_um: f64) -> Landing {
    let spot = Spot { row, col, azimuth_rad: place.azimuth_rad };
    let size = (place.frame.height, place.frame.width);
    Landing::new((GRID, pixel_um / CELLS_PER_PIXEL as f64), spot, 0.0, pixel_um, size)
}

/// How far a position's middle is from where the fitted cells explain its pixels best, (row, column), px: one Gauss-Newton step
/// over all colours.
fn misplaced(place: &Place, middle: [f64; 2], fits: &[Fit], pixel_um: f64) -> [f64; 2] {
    let at = |row: f64, col: f64| landing(place, [middle[0] + row, middle[1] + col], pixel_um);
    let landings = [at(0.0, 0.0), at(STEP_PX, 0.0), at(0.0, STEP_PX)];
    let (mut normal, mut right) = ([0.0; 3], [0.0; 2]);
    for (channel, fit) in fits.iter().enumerate() {
        let landed = [0, 1, 2].map(|k| landings[k].land(&fit.cells));
        for d in pixels(place, channel) {
            let expected = d.time_s * landed[0][d.pixel];
            let by = [1, 2].map(|k| d.time_s * (landed[k][d.pixel] - landed[0][d.pixel]) / STEP_PX);
            // Where the fit is not there yet, its own variance is the fairer one.
            let weight = 1.0 / (d.variance + 1e-4 * expected * expected);
            let residual = d.value - expected;
            normal = [
                normal[0] + weight * by[0] * by[0],
                normal[1] + weight * by[0] * by[1],
                normal[2] + weight * by[1] * by[1],
            ];
            right = [right[0] + weight * by[0] * residual, right[1] + weight * by[1] * residual];
        }
    }
    let determinant = normal[0] * normal[2] - normal[1] * normal[1];
    let step = [
        (normal[2] * right[0] - normal[1] * right[1]) / determinant,
        (normal[0] * right[1] - normal[1] * right[0]) / determinant,
    ];
    step.map(|s| if s.is_finite() { s.clamp(-MOST_PX, MOST_PX) } else { 0.0 })
}

/// Centroid of cells along the field's own axis, from the middle of the grid outwards, px.
fn outward_px(cells: &[f64]) -> f64 {
    let centre = 0.5 * (GRID as f64 - 1.0);
    let sum: f64 = cells.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let moment: f64 = cells.iter().enumerate().map(|(i, v)| v * ((i / GRID) as f64 - centre)).sum();
    moment / sum / CELLS_PER_PIXEL as f64
}

/// The cells of one channel.
struct Fit {
    /// Light of each cell, electrons/s.
    cells: Vec<f64>,
    /// Mean squared residual over the variance.
    chi2: f64,
    rounds: usize,
}

/// Fits the cells of one channel as blobs of a standard deviation of `blob` cells.
fn fit(seen: &[Place], landings: &[Landing], channel: usize, blob: f64, most_rounds: usize) -> Fit {
    // Of each position: its pixels of this colour in electrons, offset by the read noise.
    let data: Vec<Vec<Datum>> = seen.iter().map(|p| pixels(p, channel)).collect();
    let light =
        seen.iter().map(|p| p.measured.psf.light_e_per_s[channel]).sum::<f64>() / seen.len().max(1) as f64;
    let gather = |values: &dyn Fn(&Datum, f64) -> f64, landed: &[Vec<f64>]| {
        let mut sum = vec![0.0; GRID * GRID];
        for ((landing, data), landed) in landings.iter().zip(&data).zip(landed) {
            let mut window = vec![0.0; landing.height * landing.width];
            data.iter().for_each(|d| window[d.pixel] = d.time_s * values(d, d.time_s * landed[d.pixel]));
            sum.iter_mut().zip(landing.gather(&window)).for_each(|(s, p)| *s += p);
        }
        mirrored(blurred(&sum, blob))
    };
    let land = |cells: &[f64]| landings.iter().map(|l| l.land(cells)).collect::<Vec<_>>();
    let count = data.iter().map(Vec::len).sum::<usize>().max(1) as f64;

    // Start from even light within the circle that the crop holds at any azimuth.
    let centre = 0.5 * (GRID as f64 - 1.0);
    let mut blobs: Vec<f64> = (0..GRID * GRID)
        .map(|i| ((i / GRID) as f64 - centre).hypot((i % GRID) as f64 - centre))
        .map(|distance| if distance < 0.5 * GRID as f64 { light / (GRID * GRID) as f64 } else { 0.0 })
        .collect();
    let mut cells = blurred(&blobs, blob);
    let mut landed = land(&cells);
    let sensitivity = gather(&|_, _| 1.0, &landed);
    let (mut chi2, mut looked, mut rounds) = (f64::INFINITY, f64::INFINITY, 0);
    while rounds < most_rounds {
        let ratio = gather(
            &|d, expected| (d.value + d.offset).max(0.0) / (expected + d.offset).max(f64::MIN_POSITIVE),
            &landed,
        );
        for ((light, ratio), sensitivity) in blobs.iter_mut().zip(&ratio).zip(&sensitivity) {
            *light *= if *sensitivity > 0.0 { ratio / sensitivity } else { 0.0 };
        }
        cells = blurred(&blobs, blob);
        landed = land(&cells);
        rounds += 1;
        if rounds % LOOK == 0 {
            let residual = |d: &Datum, at: f64| (d.value - d.time_s * at).powi(2) / d.variance;
            let of = |(data, landed): (&Vec<Datum>, &Vec<f64>)| -> f64 {
                data.iter().map(|d| residual(d, landed[d.pixel])).sum()
            };
            chi2 = data.iter().zip(&landed).map(of).sum::<f64>() / count;
            if chi2 <= 1.0 || chi2 > (1.0 - GAIN) * looked {
                break;
            }
            looked = chi2;
        }
    }
    Fit { cells, chi2, rounds }
}

/// Every cell as a round blob: a Gaussian along rows and columns. Its own transpose, as long as nothing reaches the rim.
fn blurred(cells: &[f64], blob: f64) -> Vec<f64> {
    const REACH: usize = 4;
    let weights: Vec<f64> =
        (0..=2 * REACH).map(|k| (-0.5 * ((k as f64 - REACH as f64) / blob).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let along = |cells: &[f64], step: usize, place: &dyn Fn(usize) -> usize| {
        let mut out = vec![0.0; cells.len()];
        for (i, out) in out.iter_mut().enumerate() {
            let at = place(i);
            let (from, to) = (at.saturating_sub(REACH), (at + REACH).min(GRID - 1));
            *out =
                (from..=to).map(|k| weights[k + REACH - at] * cells[i + k * step - at * step]).sum::<f64>()
                    / sum;
        }
        out
    };
    let rows = along(cells, 1, &|i| i % GRID);
    along(&rows, GRID, &|i| i / GRID)
}

/// The mean of a grid and its mirror image across the field's own axis.
fn mirrored(cells: Vec<f64>) -> Vec<f64> {
    (0..GRID * GRID).map(|i| 0.5 * (cells[i] + cells[i / GRID * GRID + GRID - 1 - i % GRID])).collect()
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
    /// Time over which it gathered light, s.
    time_s: f64,
}

/// Pixels of the crop with the channel's colour that were not saturated.
fn pixels(place: &Place, channel: usize) -> Vec<Datum> {
    let (row, col) = place.measured.psf.corner;
    let of_crop = (0..CROP * CROP).map(|i| (row + i / CROP) * place.frame.width + col + i % CROP);
    let usable = of_crop.filter(|i| place.frame.is_colour(*i, channel) && !place.merged.saturated[*i]);
    usable
        .map(|pixel| {
            let time_s = place.merged.time_s[pixel];
            let value = place.measured.mosaic_e_per_s[pixel] * time_s;
            let variance = place.merged.variance[pixel] * time_s * time_s;
            Datum { pixel, value, variance, offset: (variance - value.max(0.0)).max(1e-3 * variance), time_s }
        })
        .collect()
}
