//! Estimates PSFs for the renderer from measured ones, on cells smaller than a pixel and with the field's axis up.
//!
//! A pixel has already integrated the light over its area. The renderer turns its cells and integrates them over pixels
//! *again*; measured pixels used as cells would be blurred twice. So the bank holds light that explains the pixels:
//! cells `x >= 0` of a third of a pixel with
//!
//! ```text
//! y_j = (A_j x)_j + noise,    A_j: turn to the azimuth of position j, put at its centre, integrate over pixels
//! ```
//!
//! `A_j` is the renderer's own operator ([`Landing`]). Each channel is fitted to the *mosaic's* own pixels of its colour:
//! nothing is demosaiced. The fit is in `ascent`.
//!
//! **The pixels do not determine the cells.** Red and blue are sampled at two pixels, three azimuths of a radius are
//! three sub-pixel phases, and spots have structure of two pixels. Cells that explain the fitted pixels down to noise
//! can be far off for another phase or azimuth. So the smoothness of the fit is the one that best predicts held-out
//! pixels (`held_out`), and chi^2 and L1 distance on pixels that took no part are reported with every field. The
//! renderer's PSF is that of a rotationally symmetric lens, so the cells are symmetric about the field's own axis. A
//! position in the middle of the image counts at eight azimuths. Cells beyond half the crop stay dark, except for the
//! rim of the blobs.
//!
//! The cells also hold the field's *light*. The sum of a demosaiced spot does not measure it: one pixel in four is red, and it catches much
//! or little of a spot as small as a pixel, depending on the spot's position. Positions of one radius see one source through a rotationally
//! symmetric lens, so their light is equal. Their phases together determine it: in green to a tenth or better, but not in red and blue for
//! the sharpest spots. So all colours use the relative illumination of green.
//!
//! The fit alternates between the centres of the positions and the cells, because the demosaiced centroid of a sharp
//! spot is off by a fraction of a pixel. The middle of the grid is the green centroid, because a measured spot does not
//! show its chief ray. Lateral colour between channels is kept; the distance between chief ray and centroid is lost, as
//! distortion is.

use petzval_base::{Cancelled, Tally};
use rayon::prelude::*;

use super::PsfCalibrationError;
use super::ascent::{Ascent, landing, pixels};
use super::held_out::{Choice, Fold, HeldOut, HeldOutBy, choose, start, tile_folds};
use super::landing::Landing;
use super::measure::COLOURS;
pub use super::place::{CELLS_PER_PIXEL, GRID, Place};
use super::register::{explain, misplaced};
use petzval_camera::image::CHANNELS;
use petzval_camera::psf::{PsfBank, PsfError};

/// Largest chi2 (mean squared residual over the variance) of pixels that count as explained.
const EXPLAINED: f64 = 1.2;

/// Largest L1 distance on held-out pixels, divided by that of noise, of a field that counts as known.
const KNOWN: f64 = 1.5;

/// Number of corrections of the positions, each followed by a fit, ...
const REGISTRATIONS: usize = 4;

/// ... of this number of iterations, ...
const REGISTRATION_ROUNDS: usize = 100;

/// ... with blobs of this standard deviation, cells.
const REGISTRATION_BLOB: f64 = 0.8;

/// Number of azimuths at which a position on the axis counts.
const AXIS_AZIMUTHS: usize = 8;

/// Two positions whose radii differ by less than this belong to one field, mm.
pub const SAME_FIELD_MM: f64 = 0.05;

/// The estimate of one field.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldEstimate {
    /// Mean radius of its positions, mm.
    pub field_radius_mm: f64,
    /// Number of its positions.
    pub positions: usize,
    /// Whether the sensor is monochrome: all channels are then one.
    pub is_mono: bool,
    /// Mean squared residual of the fitted pixels over the variance, per channel. It shows whether the positions agree, not
    /// how well the PSF is known: see `held_out`.
    pub chi2: [f64; CHANNELS],
    /// The same and the L1 distance for pixels that took no part in a fit. Smoothness was chosen by them, so they are
    /// slightly too small.
    pub held_out: HeldOut,
    /// Standard deviation of the blobs chosen, per channel, px.
    pub blob_px: [f64; CHANNELS],
    /// Rounds of the fit, per channel.
    pub rounds: [usize; CHANNELS],
    /// Whether the fit started from the cells of green, per channel.
    pub is_from_green: [bool; CHANNELS],
    /// Centre of the PSF in the window of each position: index in the list of places, and (row, column), px.
    pub middle_px: Vec<(usize, [f64; 2])>,
}

impl FieldEstimate {
    /// Warnings about the estimate.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let named = |of: &dyn Fn(usize) -> bool, figure: &dyn Fn(usize) -> f64| -> Vec<String> {
            if self.is_mono {
                return (of(1)).then(|| format!("{:.2}", figure(1))).into_iter().collect();
            }
            let shown = (0..CHANNELS).filter(|c| of(*c));
            shown.map(|c| format!("{} {:.2}", COLOURS[c], figure(c))).collect()
        };
        let unexplained = named(&|c| self.chi2[c] > EXPLAINED, &|c| self.chi2[c]);
        if !unexplained.is_empty() {
            warnings.push(format!(
                "the fitted cells do not explain the fitted pixels: chi2 {} where noise gives 1",
                unexplained.join(", ")
            ));
        }
        if self.held_out.by == HeldOutBy::Pixels {
            warnings.push(
                "one position only: how the PSF looks at another sub-pixel phase was not tested".to_owned(),
            );
        }
        let score = &self.held_out.score;
        let unknown =
            named(&|c| score[c].l1() > KNOWN * score[c].noise_l1(), &|c| score[c].l1() / score[c].noise_l1());
        if !unknown.is_empty() {
            warnings.push(format!(
                "pixels that took no part in the fit are missed by more than noise: L1 over that of noise {}",
                unknown.join(", ")
            ));
        }
        warnings
    }
}

/// The bank of measured PSFs, and how each field was fitted.
///
/// The field nearest to the axis also stands for the axis if no position is on it. Calls `progress` with the number of fields
/// that are fitted and that of all, at the start and after each, from any thread; its error ends the work.
pub fn estimate_bank(
    places: &[Place],
    pixel_um: f64,
    progress: &(dyn Fn(usize, usize) -> Result<(), Cancelled> + Sync),
) -> Result<(PsfBank, Vec<FieldEstimate>), PsfCalibrationError> {
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
        return Err(PsfError::NoField.into());
    }
    let pitch_um = pixel_um / CELLS_PER_PIXEL as f64;
    let (values, illumination) = (Vec::new(), Vec::new());
    let mut bank = PsfBank { field_radius_mm: Vec::new(), grid: GRID, pitch_um, values, illumination };
    let done = Tally::default();
    progress(0, fields.len())?;
    let fit = |members: &Vec<usize>| {
        let field = fit_field(places, members, pixel_um);
        done.add(1, |done| progress(done as usize, fields.len()))?;
        Ok(field)
    };
    let fitted: Vec<Fitted> = fields.par_iter().map(fit).collect::<Result<_, Cancelled>>()?;
    // Use green for all colours: half of the pixels measure it, and lenses dim all colours nearly alike.
    let axis_light = fitted[0].green_light;
    let mut estimates = Vec::new();
    for field in fitted {
        for cells in &field.cells {
            let sum: f64 = cells.iter().sum::<f64>().max(f64::MIN_POSITIVE);
            bank.values.extend(cells.iter().map(|v| (v / sum) as f32));
        }
        bank.illumination.extend([(field.green_light / axis_light) as f32; CHANNELS]);
        bank.field_radius_mm.push(field.estimate.field_radius_mm);
        estimates.push(field.estimate);
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

/// One field, fitted.
struct Fitted {
    /// Light of each cell, electrons/s.
    cells: [Vec<f64>; CHANNELS],
    /// Light of green, times the factor of its place.
    green_light: f64,
    estimate: FieldEstimate,
}

/// Fits the cells of the field that the positions `members` see.
fn fit_field(places: &[Place], members: &[usize], pixel_um: f64) -> Fitted {
    let field: Vec<Place> = members.iter().map(|i| places[*i]).collect();
    let count = field.len() as f64;
    let radius_mm = field.iter().map(|p| p.field_radius_mm).sum::<f64>() / count;
    // On the axis all azimuths are equivalent: use a position at several.
    let turns = if radius_mm < SAME_FIELD_MM { AXIS_AZIMUTHS } else { 1 };
    let (middle, cells) = register(&field, turns, pixel_um);
    let (seen, landings) = sights(&field, &middle, turns, pixel_um);

    // Choose the smoothness: predict each position from the others, or a part of the pixels from the rest.
    let folds = if field.len() > 1 {
        (0..field.len())
            .into_par_iter()
            .map(|held| {
                let rest: Vec<Place> =
                    field.iter().enumerate().filter(|(i, _)| *i != held).map(|(_, p)| *p).collect();
                let (middle, cells) = register(&rest, turns, pixel_um);
                let (seen, landings) = sights(&rest, &middle, turns, pixel_um);
                let start = field[held].measured.psf.centroid_px[1];
                let (middle, _) = explain(&field[held], start, cells.each_ref().map(|c| &c[..]), pixel_um);
                Fold { seen, landings, held: field[held], middle, part: None }
            })
            .collect()
    } else {
        tile_folds(&seen, &landings, field[0], middle[0])
    };
    // Find the lateral colour to whole cells, for fits that start from green.
    let outward = [0, 1, 2].map(|c| {
        let cells_out = CELLS_PER_PIXEL as f64 * (outward_px(&cells[c]) - outward_px(&cells[1]));
        cells_out.round() as isize
    });
    let is_mono = field.iter().all(|p| p.frame.is_mono());
    let (choice, held_out) = choose(&folds, outward, is_mono, pixel_um);

    let fit = |c: usize, green: Option<&Vec<f64>>| {
        let Choice { blob, is_from_green, rounds } = choice[c];
        let from = green.filter(|_| is_from_green).map(|cells| (&cells[..], outward[c]));
        let data = seen.iter().map(|p| pixels(p, c)).collect();
        let mut ascent = Ascent::new(&landings, data, blob, start(&seen, c, from));
        (0..rounds).for_each(|_| ascent.advance());
        (ascent.chi2(), ascent.cells)
    };
    let green = fit(1, None);
    let (red, blue) = if is_mono {
        (green.clone(), green.clone())
    } else {
        (fit(0, Some(&green.1)), fit(2, Some(&green.1)))
    };
    let light: f64 = green.1.iter().sum();
    let estimate = FieldEstimate {
        field_radius_mm: radius_mm,
        positions: field.len(),
        is_mono,
        chi2: [red.0, green.0, blue.0],
        held_out,
        blob_px: choice.map(|c| c.blob / CELLS_PER_PIXEL as f64),
        rounds: choice.map(|c| c.rounds),
        is_from_green: choice.map(|c| c.is_from_green),
        middle_px: members.iter().copied().zip(middle).collect(),
    };
    let factor = field.iter().map(|p| p.light_factor).sum::<f64>() / count;
    Fitted { cells: [red.1, green.1, blue.1], green_light: light * factor, estimate }
}

/// Positions of a field at each azimuth at which they count, and their landings.
fn sights<'a>(
    field: &[Place<'a>],
    middle: &[[f64; 2]],
    turns: usize,
    pixel_um: f64,
) -> (Vec<Place<'a>>, Vec<Landing>) {
    let turn = |k: usize| std::f64::consts::TAU * k as f64 / turns as f64;
    let seen: Vec<Place> = (0..turns)
        .flat_map(|k| field.iter().map(move |p| Place { azimuth_rad: p.azimuth_rad + turn(k), ..*p }))
        .collect();
    let landings = seen.iter().zip(middle.iter().cycle()).map(|(p, at)| landing(p, *at, pixel_um)).collect();
    (seen, landings)
}

/// Fits the centres of the positions of a field and its cells alternately: the demosaiced centroid of each sharp spot
/// has its own error of a fraction of a pixel.
fn register(field: &[Place], turns: usize, pixel_um: f64) -> (Vec<[f64; 2]>, [Vec<f64>; CHANNELS]) {
    let mut middle: Vec<[f64; 2]> = field.iter().map(|p| p.measured.psf.centroid_px[1]).collect();
    let mut cells: [Vec<f64>; CHANNELS] = Default::default();
    for _ in 0..REGISTRATIONS {
        let (seen, landings) = sights(field, &middle, turns, pixel_um);
        let fits: Vec<Vec<f64>> = (0..CHANNELS)
            .into_par_iter()
            .map(|c| {
                let data = seen.iter().map(|p| pixels(p, c)).collect();
                let mut ascent = Ascent::new(&landings, data, REGISTRATION_BLOB, start(&seen, c, None));
                (0..REGISTRATION_ROUNDS).for_each(|_| ascent.advance());
                ascent.cells
            })
            .collect();
        cells = std::array::from_fn(|c| fits[c].clone());
        // Keep the green centroid in the middle of the grid. On the axis symmetry keeps it there.
        let outward = if turns > 1 { 0.0 } else { outward_px(&cells[1]) };
        for (place, middle) in field.iter().zip(&mut middle) {
            let moved = misplaced(place, *middle, cells.each_ref().map(|c| &c[..]), pixel_um);
            let (sin, cos) = place.azimuth_rad.sin_cos();
            *middle = [middle[0] + moved[0] + outward * sin, middle[1] + moved[1] + outward * cos];
        }
    }
    (middle, cells)
}

/// Centroid of cells along the field's own axis, from the middle of the grid outwards, px.
fn outward_px(cells: &[f64]) -> f64 {
    let centre = 0.5 * (GRID as f64 - 1.0);
    let sum: f64 = cells.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let moment: f64 = cells.iter().enumerate().map(|(i, v)| v * ((i / GRID) as f64 - centre)).sum();
    moment / sum / CELLS_PER_PIXEL as f64
}
