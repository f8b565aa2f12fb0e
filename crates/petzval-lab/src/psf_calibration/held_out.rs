//! Chooses the smoothness of the cells of a field: the one that best predicts pixels that took no part in the fit.
//!
//! The pixels do not determine the cells. Red and blue are sampled every two pixels, spots have structure of two
//! pixels, and cells of a third of a pixel reach a chi^2 of 1 on the fitted pixels whatever their detail. So held-out
//! pixels choose the size of the blobs, the number of iterations and the start. Each position of a radius is held out
//! in turn, with its centre and light free. A radius with only one position holds out each fifth of its 2x2 tiles,
//! which does not test another sub-pixel phase.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ascent::{Ascent, Datum, even, landing, pixels, shaped};
use super::landing::Landing;
use super::place::Place;
use super::register::{Score, explain};
use petzval_camera::image::CHANNELS;

/// Standard deviations of a blob, cells.
const BLOBS_CELLS: [f64; 4] = [1.8, 1.25, 0.8, 0.5];

/// Numbers of iterations after which the fit is scored.
const LOOKS: [usize; 11] = [10, 15, 25, 40, 60, 90, 140, 200, 300, 450, 700];

/// Number of successive worse scores that ends a fit.
const PATIENCE: usize = 3;

/// Number of parts into which the tiles of a single position are divided.
const TILE_FOLDS: usize = 5;

/// The kind of held-out data.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HeldOutBy {
    /// Each position in turn.
    Positions,
    /// Parts of the pixels of the only position.
    Pixels,
}

/// Scores of the cells on the held-out pixels, per channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// What was held out.
    pub by: HeldOutBy,
    /// Score of each channel, all parts together.
    pub score: [Score; CHANNELS],
}

/// One split of a field into fitted and held-out pixels.
pub(super) struct Fold<'a> {
    /// Fitted positions, at each azimuth.
    pub seen: Vec<Place<'a>>,
    /// Their landings.
    pub landings: Vec<Landing>,
    /// The position of the held-out pixels, ...
    pub held: Place<'a>,
    /// ... and its centre.
    pub middle: [f64; 2],
    /// Which part of its tiles is held out; all if `None`.
    pub part: Option<usize>,
}

impl Fold<'_> {
    /// Pixels of one colour, fitted or held out.
    fn data(&self, place: &Place, channel: usize, is_held: bool) -> Vec<Datum> {
        let width = place.frame.width;
        let mut data = pixels(place, channel);
        if let Some(part) = self.part {
            data.retain(|d| {
                let tile = d.pixel / width / 2 + 2 * (d.pixel % width / 2);
                (tile % TILE_FOLDS == part) == is_held
            });
        }
        data
    }
}

/// Splits of a field whose only position is seen at `seen`.
pub(super) fn tile_folds<'a>(
    seen: &[Place<'a>],
    landings: &[Landing],
    held: Place<'a>,
    middle: [f64; 2],
) -> Vec<Fold<'a>> {
    (0..TILE_FOLDS)
        .map(|part| Fold { seen: seen.to_vec(), landings: landings.to_vec(), held, middle, part: Some(part) })
        .collect()
}

/// Settings of the fit of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Choice {
    /// Standard deviation of a blob, cells.
    pub blob: f64,
    /// Whether the fit starts from green's cells.
    pub is_from_green: bool,
    /// Rounds.
    pub rounds: usize,
}

/// Start of a fit: even light, or the cells of green, moved outwards by this number of cells.
pub(super) fn start(seen: &[Place], channel: usize, green: Option<(&[f64], isize)>) -> Vec<f64> {
    let sum = seen.iter().map(|p| p.measured.psf.light_e_per_s[channel]).sum::<f64>();
    let light = sum / seen.len().max(1) as f64;
    green.map_or_else(|| even(light), |(cells, outward)| shaped(cells, outward, light))
}

/// Chooses the settings of each channel and returns the scores on the held-out pixels. The channels of a monochrome
/// sensor are one, and fitted once.
pub(super) fn choose(
    folds: &[Fold],
    outward: [isize; CHANNELS],
    is_mono: bool,
    pixel_um: f64,
) -> ([Choice; CHANNELS], HeldOut) {
    let green = best(folds, 1, None, pixel_um);
    let others: Vec<(Choice, Vec<Vec<f64>>)> = if is_mono {
        Vec::new()
    } else {
        [0, 2].into_par_iter().map(|c| best(folds, c, Some((&green.1, outward[c])), pixel_um)).collect()
    };
    let channels = match &others[..] {
        [red, blue] => [red, &green, blue],
        _ => [&green; CHANNELS],
    };
    let by = if folds.iter().any(|f| f.part.is_some()) { HeldOutBy::Pixels } else { HeldOutBy::Positions };
    let mut score = [Score::default(); CHANNELS];
    for (k, fold) in folds.iter().enumerate() {
        let cells = channels.map(|c| &c.1[k][..]);
        let of_fold = match by {
            HeldOutBy::Positions => explain(&fold.held, fold.middle, cells, pixel_um).1,
            HeldOutBy::Pixels => {
                let landing = landing(&fold.held, fold.middle, pixel_um);
                let of =
                    |c: usize| Score::of(&fold.data(&fold.held, c, true), &landing.land(cells[c]), false);
                std::array::from_fn(of)
            }
        };
        score = std::array::from_fn(|c| score[c].and(of_fold[c]));
    }
    (channels.map(|c| c.0), HeldOut { by, score })
}

/// The settings of one channel that best explain the held-out pixels, and the cells of each split fitted with them.
fn best(
    folds: &[Fold],
    channel: usize,
    green: Option<(&Vec<Vec<f64>>, isize)>,
    pixel_um: f64,
) -> (Choice, Vec<Vec<f64>>) {
    let starts: &[bool] = if green.is_some() { &[false, true] } else { &[false] };
    let ways: Vec<(f64, bool)> = BLOBS_CELLS.iter().flat_map(|b| starts.iter().map(|s| (*b, *s))).collect();
    let tried: Vec<(f64, Choice, Vec<Vec<f64>>)> = ways
        .into_par_iter()
        .map(|(blob, is_from_green)| {
            let fits = folds.iter().enumerate().map(|(k, fold)| {
                let data = fold.seen.iter().map(|p| fold.data(p, channel, false)).collect();
                let from = green.filter(|_| is_from_green).map(|(cells, by)| (&cells[k][..], by));
                let ascent = Ascent::new(&fold.landings, data, blob, start(&fold.seen, channel, from));
                let landing = landing(&fold.held, fold.middle, pixel_um);
                (ascent, landing, fold.data(&fold.held, channel, true))
            });
            let mut fits: Vec<(Ascent, Landing, Vec<Datum>)> = fits.collect();
            let is_light_free = folds.iter().all(|f| f.part.is_none());
            let mut best = (f64::INFINITY, Choice { blob, is_from_green, rounds: 0 }, Vec::new());
            let (mut rounds, mut worse) = (0, 0);
            for look in LOOKS {
                fits.par_iter_mut().for_each(|(ascent, ..)| (rounds..look).for_each(|_| ascent.advance()));
                rounds = look;
                let score = fits
                    .iter()
                    .map(|(ascent, landing, held)| {
                        Score::of(held, &landing.land(&ascent.cells), is_light_free)
                    })
                    .fold(Score::default(), Score::and);
                if best.2.is_empty() || score.chi2() < best.0 {
                    let cells = fits.iter().map(|(ascent, ..)| ascent.cells.clone()).collect();
                    best = (score.chi2(), Choice { rounds, ..best.1 }, cells);
                    worse = 0;
                } else {
                    worse += 1;
                }
                if worse == PATIENCE {
                    break;
                }
            }
            best
        })
        .collect();
    let mut tried = tried.into_iter();
    let first =
        tried.next().unwrap_or((0.0, Choice { blob: 1.0, is_from_green: false, rounds: 1 }, Vec::new()));
    let best = tried.fold(first, |a, b| if b.0 < a.0 { b } else { a });
    (best.1, best.2)
}
