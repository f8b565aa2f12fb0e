//! The profile of an edge: a spline through all pixels at their distances from its path.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use petzval_base::statistics::{SIGMA_OVER_MEDIAN, median};

use super::defects::marked;
use super::error::SfrError;
use super::estimate::Estimate;
use super::fit::Fit;
use super::ghost::{Beside, Ghost};
use super::limits::{LARGEST_GAP_PX, LEAST_HALF, MOST_LEFT_OUT};
use super::path::Path;
use super::place::Sample;
use super::region::Region;
use super::response::Sfr;
use super::sides::{Sides, far_px};
use super::spline::{Basis, Factor, Spline, gathered};

/// Longest profile on either side, pixels.
const LONGEST_PX: usize = 256;

/// Share of the usual number of pixels in a pixel of distance that the ends of a profile need.
const LEAST_DENSITY: f64 = 0.25;

/// Bands of rows whose pulls give the standard errors, and the rows that each has at least: noise of neighbouring pixels may be correlated.
const BANDS: usize = 16;
const ROWS_OF_BAND: usize = 3;

/// Rounds of leaving out defects, and of refining the path.
const ROUNDS: usize = 3;

/// Deviation of a pixel from the fitted step beyond which it does not count in the first profile, of the step.
const FIRST_DEVIATION: f64 = 0.3;

/// Weight of the spline's penalty: of the pixels at a knot, and by their noise, of the step.
const PENALTY: f64 = 1e-5;
const PENALTY_NOISE: f64 = 0.2;

/// Gap between the distances of the pixels, pixels, from which the penalty is largest.
///
/// Near slopes of small integers, as at 45 degrees, the pixels lie in groups. Within a group their distances differ by little, so noise, or a path
/// that is a few thousandths of a degree off, would decide the slope of a soft spline there. The penalty keeps the slope from one group to the next.
const COARSE_GAP_PX: f64 = 0.6;
/// The penalty there, of the pixels at a knot. It takes 0.1 % of the modulation at 0.5 cycles per pixel, and 1.5 % at 0.7.
const COARSE_PENALTY: f64 = 1e-2;
/// Below that gap the penalty falls by this power of the gap: pixels that lie closer sample further, and need less of it.
const COARSE_POWER: i32 = 4;

/// Share of pixels left out from which they are the reason if there is no profile without them.
const MANY_LEFT_OUT: f64 = 0.03;

/// Largest deviation of an even side from its level, as a share of the step, beyond noise.
const LARGEST_DEVIATION: f64 = 0.1;
/// Standard deviations of noise that are subtracted from a deviation.
const NOISE_SIGMAS: f64 = 6.0;
/// Side of the squares in which a side is compared with its level, pixels. It is compared per pixel of distance as well.
const SQUARE_PX: f64 = 8.0;
/// Least pixels of a part that is compared.
const LEAST_OF_PART: f64 = 8.0;

/// Shares of the highest frequency that the pixels sample without ambiguity, and the modulation there above which an edge is sampled too coarsely.
/// At that frequency the image from beyond it may cancel the modulation, by the phase at which the pixels meet the edge. Just below it cannot.
const LARGEST_ALIAS: [(f64, f64); 2] = [(1.0, 0.05), (0.9, 0.08)];

/// A gap between the distances of the pixels below which frequencies to 5/4 cycles per pixel are sampled, pixels.
const FINE_GAP_PX: f64 = 0.4;

/// The edge spread function.
pub struct Profile<'a> {
    region: &'a Region,
    pub path: Path,
    blur_px: f64,
    /// The step between the planes of light of the fit.
    fitted_step: f64,
    pub sides: Sides,
    samples: Vec<Sample>,
    /// Shares of the step of the samples within the profile.
    points: Vec<Point>,
    pub spline: Spline,
    factor: Factor,
    /// Root mean square deviation of the pixels, of the step.
    pub scatter: f64,
    pub left_out: usize,
    bands: usize,
}

/// A pixel within the profile.
#[derive(Clone, Copy)]
struct Point {
    sample: usize,
    distance: f64,
    share: f64,
}

impl<'a> Profile<'a> {
    /// The profile across a fitted edge.
    pub fn of(region: &'a Region, fit: Fit) -> Result<Self, SfrError> {
        let bands = (region.height / ROWS_OF_BAND).min(BANDS);
        let mut path = fit.path.clone();
        // The first profile leaves out what is far from the fitted step.
        let mut deviations: Vec<f64> = (0..region.values.len())
            .map(|i| (region.values[i] - fit.value(region, region.middle(i))).abs() / fit.step)
            .collect();
        let limit = FIRST_DEVIATION.max(7.0 * fit.noise / fit.step);
        let mut is_left_out: Vec<bool> =
            deviations.iter().zip(&region.is_dead).map(|(d, is_dead)| *is_dead || *d > limit).collect();
        let mut found = Self::about(region, &path, &fit, &is_left_out, bands)
            .map_err(|error| because(error, &deviations, &is_left_out))?;
        for _ in 0..ROUNDS {
            path = found.refined_path();
            found = Self::about(region, &path, &fit, &is_left_out, bands)?;
            let compared = found.deviations();
            is_left_out = marked(region, &compared);
            deviations = compared.iter().map(|of| of.map_or(0.0, |(deviation, _)| deviation.abs())).collect();
            let left_out = is_left_out.iter().filter(|is| **is).count();
            if left_out as f64 > MOST_LEFT_OUT * region.values.len() as f64 {
                return Err(because(SfrError::Uneven { deviation: 0.0 }, &deviations, &is_left_out));
            }
            found = Self::about(region, &path, &fit, &is_left_out, bands)
                .map_err(|error| because(error, &deviations, &is_left_out))?;
        }
        Ok(found)
    }

    fn about(
        region: &'a Region,
        path: &Path,
        fit: &Fit,
        is_left_out: &[bool],
        bands: usize,
    ) -> Result<Self, SfrError> {
        let (blur_px, fitted_step) = (fit.blur_px, fit.step);
        let sample = |i: usize| {
            let at = region.middle(i);
            let (distance, value) = (path.beside(at).distance, region.values[i]);
            Sample { at, distance, value, band: i / region.width * bands / region.height }
        };
        let samples: Vec<Sample> =
            (0..region.values.len()).filter(|i| !is_left_out[*i]).map(sample).collect();
        let half = half_of(&samples);
        if half < LEAST_HALF {
            return Err(SfrError::Small { along: region.height, across: half });
        }
        let sides = Sides::of(region, &samples, path, blur_px, half, bands);
        let basis = Basis { half };
        let near = samples.iter().enumerate().filter(|(_, s)| s.distance.abs() <= half as f64);
        let points = near.filter_map(|(sample, s)| {
            Some(Point { sample, distance: s.distance, share: sides.share(s.at, s.value)? })
        });
        let points: Vec<Point> = points.collect();
        let within = samples.iter().filter(|s| s.distance.abs() <= half as f64).count();
        // Sides that meet, or change beyond the step between them, are those of no edge.
        if sides.levels[1] <= sides.levels[0] || 2 * points.len() < within {
            return Err(SfrError::Uneven { deviation: 1.0 });
        }
        let density = points.len() as f64 / basis.len() as f64;
        let fitted = |weight: f64| {
            let factor = Factor::of(basis, points.iter().map(|p| p.distance), weight);
            let coefficients = factor.solve(gathered(basis, points.iter().map(|p| (p.distance, p.share))));
            let spline = Spline { basis, coefficients };
            let squares: f64 = points.iter().map(|p| residual(&spline, p).powi(2)).sum();
            (factor, spline, (squares / points.len().max(1) as f64).sqrt())
        };
        let gap_px = gap_of(points.iter().map(|p| p.distance), blur_px);
        let least = density * least_penalty(gap_px);
        let (_, _, scatter) = fitted(least);
        if !scatter.is_finite() || !sides.levels.iter().all(|level| level.is_finite()) {
            return Err(SfrError::Uneven { deviation: 1.0 });
        }
        let (factor, spline, scatter) = fitted(least.max((scatter / PENALTY_NOISE).powi(2)));
        let left_out = is_left_out.iter().filter(|is| **is).count();
        let path = path.clone();
        Ok(Self {
            region,
            path,
            blur_px,
            fitted_step,
            sides,
            samples,
            points,
            spline,
            factor,
            scatter,
            left_out,
            bands,
        })
    }

    /// Pixels of the profile on either side.
    pub fn half(&self) -> usize {
        self.spline.basis.half
    }

    /// The step from dark to bright.
    pub fn step(&self) -> f64 {
        self.sides.levels[1] - self.sides.levels[0]
    }

    /// Distance from the edge and value, at every quarter of a pixel.
    pub fn points(&self) -> Vec<(f64, f64)> {
        let ends = 4 * self.half() as i64;
        let at = |k: i64| (k as f64 + 0.5) / 4.0;
        (-ends..ends).filter_map(|k| Some((at(k), self.spline.at(at(k))?))).collect()
    }

    /// Distances and values of all pixels that are not left out.
    pub fn values(&self) -> impl Iterator<Item = (f64, f64)> {
        self.samples.iter().map(|s| (s.distance, s.value))
    }

    /// Values of the pixels of one side beyond the blur.
    pub fn even_pixels(&self, sign: f64) -> impl Iterator<Item = f64> {
        let far = self.far();
        self.samples.iter().filter(move |s| sign * s.distance > far).map(|s| s.value)
    }

    /// Root mean square deviation of the pixels of one side within the blur, of the step.
    pub fn noise_of_blur(&self, sign: f64) -> f64 {
        let near = (1.5 * self.blur_px).max(0.8);
        let of = self.points.iter().filter(|p| (0.0..near).contains(&(sign * p.distance)));
        let (sum, count) =
            of.fold((0.0, 0.0), |(sum, count), p| (sum + residual(&self.spline, p).powi(2), count + 1.0));
        (sum / f64::max(count, 1.0)).sqrt()
    }

    /// Where a side begins to be even; in a short profile its outer third.
    fn far(&self) -> f64 {
        far_px(self.blur_px).min(self.half() as f64 * 2.0 / 3.0)
    }

    /// The pixels within the blur, which alone say where the edge lies: beyond it the slope of the spline is noise.
    fn blurred(&self) -> impl Iterator<Item = &Point> {
        let far = self.far();
        self.points.iter().filter(move |p| p.distance.abs() <= far)
    }

    /// Deviations of all pixels from the profile and the levels beyond it, and their zones.
    fn deviations(&self) -> Vec<Option<(f64, usize)>> {
        let far = self.far();
        let of = |i: usize| {
            let (at, value) = (self.region.middle(i), self.region.values[i]);
            let distance = self.path.beside(at).distance;
            let share = self.sides.share(at, value)?;
            let wanted = self.spline.at(distance).unwrap_or(f64::from(u8::from(distance > 0.0)));
            let zone = match distance {
                dark if dark < -far => 0,
                bright if bright > far => 2,
                _ => 1,
            };
            Some((share - wanted, zone))
        };
        (0..self.region.values.len()).map(of).collect()
    }

    /// The path that brings the pixels nearest to the profile: a step of Gauss-Newton, and the middle of the profile at distance zero.
    fn refined_path(&self) -> Path {
        let count = self.path.coefficients.len();
        let (mut g, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let limit = (4.0 * self.scatter).max(0.0) + 1e-12;
        for p in self.blurred() {
            let Some(slope) = self.spline.slope(p.distance) else { continue };
            let beside = self.path.beside(self.samples[p.sample].at);
            let r = residual(&self.spline, p).clamp(-limit, limit);
            let mut row = DVector::zeros(count);
            let mut power = -slope * beside.cosine;
            for k in 0..count {
                row[k] = power;
                power *= beside.u;
            }
            right.axpy(r, &row, 1.0);
            g.syger(1.0, &row, &row, 1.0);
        }
        g.fill_upper_triangle_with_lower_triangle();
        let floor = 1e-9 * g.diagonal().max().max(1e-300);
        (0..count).for_each(|i| g[(i, i)] += floor);
        let Some(step) = g.cholesky().map(|factor| factor.solve(&right)) else { return self.path.clone() };
        let mut coefficients: Vec<f64> =
            self.path.coefficients.iter().zip(step.iter()).map(|(c, s)| c + s.clamp(-0.5, 0.5)).collect();
        coefficients[0] += self.place_of_half() / self.cosine();
        self.path.with(&coefficients)
    }

    /// Where the profile reaches a half nearest to the path.
    fn place_of_half(&self) -> f64 {
        let value = |k: i64| self.spline.at(0.05 * k as f64).unwrap_or(0.5) - 0.5;
        let crossing = |k: i64| {
            let (low, high) = (value(k), value(k + 1));
            (low <= 0.0 && high > 0.0).then(|| 0.05 * (k as f64 - low / (high - low)))
        };
        (0..60).flat_map(|k| [k, -k - 1]).find_map(crossing).unwrap_or(0.0)
    }

    fn cosine(&self) -> f64 {
        1.0 / self.path.slope().hypot(1.0)
    }

    /// How every band of rows pulls the profile: the coefficients `G^-1 sum_(i in band) r_i B_i`, and what it pulls by the light of the sides.
    /// The sum of the squares of all pulls, times [`Self::pull_scale`] squared, is the variance.
    fn pulls(&self) -> Vec<Spline> {
        let basis = self.spline.basis;
        let light: Vec<Vec<f64>> = (0..basis.len())
            .map(|k| {
                let at = basis.centre(k);
                let share = self.spline.at(at.clamp(-(basis.half as f64), basis.half as f64)).unwrap_or(0.5);
                let middle_y = 0.5 * self.region.height as f64;
                self.sides.pulls_at([self.path.at(middle_y) + at / self.cosine(), middle_y], share)
            })
            .collect();
        (0..self.bands)
            .map(|band| {
                let mut pull = self.pull_of(|sample| sample.band == band);
                for (c, pulls) in pull.coefficients.iter_mut().zip(&light) {
                    *c += pulls.get(band).copied().unwrap_or(0.0);
                }
                pull
            })
            .collect()
    }

    /// How the pixels of some samples pull the profile.
    fn pull_of(&self, is_in: impl Fn(&Sample) -> bool) -> Spline {
        let basis = self.spline.basis;
        let own = self.points.iter().filter(|p| is_in(&self.samples[p.sample]));
        let sums = gathered(basis, own.map(|p| (p.distance, residual(&self.spline, p))));
        Spline { basis, coefficients: self.factor.solve(sums) }
    }

    /// The factor that makes pulls of so many groups of fitted residuals those of noise: residuals are fewer by the numbers fitted, and sum to zero.
    fn pull_scale(&self, groups: usize) -> f64 {
        let (groups, count) = (groups as f64, self.points.len() as f64);
        let free = (count - self.spline.basis.len() as f64).max(0.1 * count);
        (groups / (groups - 1.0) * count / free).sqrt()
    }

    /// Response by frequency.
    ///
    /// A small region has few bands, and their scatter by chance is far too small in some regions. Its rows one by one are more; the noise of
    /// neighbours may be correlated, though. The larger error of both counts.
    pub fn sfr(&self) -> Sfr {
        let by = |pulls: &[Spline]| Sfr::of(&self.spline, pulls, self.pull_scale(pulls.len()), self.blur_px);
        let by_bands = by(&self.pulls());
        if self.bands == BANDS {
            return by_bands;
        }
        let of_row = |row: usize| self.pull_of(|sample| sample.at[1] as usize == row);
        by_bands.with_errors_at_least(&by(&(0..self.region.height).map(of_row).collect::<Vec<Spline>>()))
    }

    /// Levels of both sides.
    pub fn levels(&self) -> [Estimate; 2] {
        let pulls = self.sides.level_pulls(&self.samples, self.half() as f64, self.bands);
        let scale = (self.bands as f64 / (self.bands as f64 - 1.0)).sqrt();
        [0, 1].map(|side| {
            let error = scale * pulls[side].iter().map(|p| p * p).sum::<f64>().sqrt();
            Estimate { value: self.sides.levels[side], standard_error: error }
        })
    }

    /// How far the profile falls below the dark level, and rises above the bright one.
    pub fn beyond_levels(&self) -> [Estimate; 2] {
        let pulls = self.pulls();
        let scale = self.pull_scale(self.bands);
        [-1.0, 1.0].map(|sign| {
            let level = if sign > 0.0 { 1.0 } else { 0.0 };
            let beyond = |(at, v): &(f64, f64)| (*at, sign * (v - level));
            let all = self.points();
            let Some((at, most)) = all.iter().map(beyond).max_by(|a, b| a.1.total_cmp(&b.1)) else {
                return Estimate::default();
            };
            let squares: f64 = pulls.iter().filter_map(|p| p.at(at)).map(|p| p * p).sum();
            Estimate { value: most.max(0.0), standard_error: scale * squares.sqrt() }
        })
    }

    /// Inclination to the nearer axis, degrees, and whether that is the other axis of the region.
    pub fn angle_deg(&self) -> (Estimate, bool) {
        let deg = self.path.slope().atan().to_degrees();
        // The slope has the error of a line through the rows' own places.
        let (rows, spread) = self.rows();
        let squares: f64 = rows.iter().map(|(y, shift)| (y * shift).powi(2)).sum();
        let slope_error = squares.sqrt() / spread.max(1e-300);
        let standard_error = (slope_error / (1.0 + self.path.slope().powi(2))).to_degrees();
        let is_steep = deg.abs() > 45.0;
        let value = if is_steep { deg.signum() * 90.0 - deg } else { deg };
        (Estimate { value, standard_error }, is_steep)
    }

    /// Root mean square distance of the edge from its path, row by row, pixels.
    pub fn roughness_px(&self) -> f64 {
        let (rows, _) = self.rows();
        let squares: f64 = rows.iter().map(|(_, shift)| shift * shift).sum();
        self.cosine() * (squares / rows.len().max(1) as f64).sqrt()
    }

    /// Largest mean distance of the edge from its path over the rows in which it meets the pixels at all phases, or a third of all rows, pixels. The
    /// pixels of a straight edge may be off its profile at some phases, which such a mean does not show.
    pub fn drift_px(&self) -> f64 {
        let (rows, _) = self.rows();
        let period = 1.0 / self.path.slope().abs().max(1e-9);
        let count = (period.ceil() as usize).clamp(1, (rows.len() / 3).max(1));
        let mean = |rows: &[(f64, f64)]| rows.iter().map(|(_, shift)| shift).sum::<f64>() / count as f64;
        self.cosine() * rows.windows(count).map(|rows| mean(rows).abs()).fold(0.0, f64::max)
    }

    /// For every row that the edge crosses: its distance from the middle row, and the shift of the edge there by least squares, pixels; and
    /// the sum of the squares of these distances.
    fn rows(&self) -> (Vec<(f64, f64)>, f64) {
        let mut sums = vec![[0.0; 2]; self.region.height];
        for p in self.blurred() {
            if let Some(slope) = self.spline.slope(p.distance) {
                let row = (self.samples[p.sample].at[1] as usize).min(sums.len() - 1);
                let by_shift = -slope * self.cosine();
                sums[row][0] += by_shift * residual(&self.spline, p);
                sums[row][1] += by_shift * by_shift;
            }
        }
        let most = sums.iter().map(|s| s[1]).fold(0.0, f64::max);
        let middle = 0.5 * self.region.height as f64;
        let filled = sums.iter().enumerate().filter(|(_, s)| s[1] > 0.3 * most && s[1] > 0.0);
        let rows: Vec<(f64, f64)> = filled.map(|(row, s)| (row as f64 + 0.5 - middle, s[0] / s[1])).collect();
        let spread = rows.iter().map(|(y, _)| y * y).sum();
        (rows, spread)
    }

    /// Refuses sides that leave their levels: at a distance from the edge, or in a square of pixels; also where only one side is in the window.
    pub fn check_sides(&self) -> Result<(), SfrError> {
        let far = self.far();
        let beyond = |s: &Sample| {
            let level = if s.distance > 0.0 { 1.0 } else { 0.0 };
            Some((*s, self.sides.share(s.at, s.value)? - level))
        };
        let even: Vec<(Sample, f64)> =
            self.samples.iter().filter(|s| s.distance.abs() > far).filter_map(beyond).collect();
        // Noise by neighbours in a row, which share whatever else is in the picture.
        let neighbours = even.windows(2).filter(|pair| {
            let [a, b] = [pair[0].0.at, pair[1].0.at];
            a[1] == b[1] && b[0] - a[0] == 1.0
        });
        let noise =
            SIGMA_OVER_MEDIAN * median(neighbours.map(|pair| (pair[1].1 - pair[0].1).abs())) / 2f64.sqrt();
        let mut parts: BTreeMap<[i64; 3], [f64; 2]> = BTreeMap::new();
        for (sample, deviation) in &even {
            let [x, y] = sample.at.map(|v| (v / SQUARE_PX) as i64);
            let side = i64::from(sample.distance > 0.0);
            for part in [[2, 0, sample.distance.floor() as i64], [side, x, y]] {
                let [sum, count] = parts.entry(part).or_default();
                *sum += deviation;
                *count += 1.0;
            }
        }
        let deviation = parts
            .values()
            .filter(|part| part[1] >= LEAST_OF_PART)
            .map(|[sum, count]| (sum / count).abs() - NOISE_SIGMAS * noise / count.sqrt())
            .fold(0.0, f64::max);
        if deviation > LARGEST_DEVIATION { Err(SfrError::Uneven { deviation }) } else { Ok(()) }
    }

    /// Refuses an edge with a weaker step beside it, which would pass for light that changes.
    pub fn check_ghost(&self) -> Result<(), SfrError> {
        let beside = Beside {
            blur_px: self.blur_px,
            far_px: self.far(),
            half_px: self.half() as f64,
            step: self.fitted_step,
            height: self.region.height as f64,
        };
        match beside.ghost(&self.samples) {
            Some(Ghost { distance_px, share }) => Err(SfrError::Ghost { distance_px, share }),
            None => Ok(()),
        }
    }

    /// Largest gap between the distances at which pixels sample the blur, pixels. Frequencies to half of its inverse are sampled without ambiguity.
    pub fn gap_px(&self) -> f64 {
        gap_of(self.points.iter().map(|p| p.distance), self.blur_px)
    }

    /// Refuses an edge that the pixels sample too coarsely.
    pub fn check_sampling(&self, sfr: &Sfr) -> Result<(), SfrError> {
        let gap_px = self.gap_px();
        let is_aliased = || {
            LARGEST_ALIAS.iter().any(|(share, largest)| {
                let frequency = share * 0.5 / gap_px;
                sfr.at(frequency) - 3.0 * sfr.error_at(frequency) > *largest
            })
        };
        let is_coarse = gap_px > LARGEST_GAP_PX || (gap_px > FINE_GAP_PX && is_aliased());
        if is_coarse {
            return Err(SfrError::Angle { deg: self.angle_deg().0.value.abs(), gap_px });
        }
        Ok(())
    }
}

/// Least penalty of a spline through pixels whose distances have such a largest gap, pixels; of the pixels at a knot.
///
/// `min(1, gap / COARSE_GAP_PX)^COARSE_POWER COARSE_PENALTY`, and at least [`PENALTY`]: without a jump, so that an edge that turns slowly
/// to 45 degrees has figures that change slowly.
fn least_penalty(gap_px: f64) -> f64 {
    let share = (gap_px / COARSE_GAP_PX).min(1.0);
    (COARSE_PENALTY * share.powi(COARSE_POWER)).max(PENALTY)
}

/// Largest gap between the distances within the blur, pixels.
fn gap_of(distances: impl Iterator<Item = f64>, blur_px: f64) -> f64 {
    let near = 2.0 * blur_px + 1.0;
    let mut distances: Vec<f64> = distances.filter(|d| d.abs() < near).collect();
    distances.sort_unstable_by(f64::total_cmp);
    distances.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max)
}

/// Why there is no profile without the pixels that are left out: their deviation, unless only few are left out.
fn because(error: SfrError, deviations: &[f64], is_left_out: &[bool]) -> SfrError {
    let left_out = || deviations.iter().zip(is_left_out).filter(|(_, is)| **is).map(|(d, _)| *d);
    let is_many = left_out().count() as f64 > MANY_LEFT_OUT * deviations.len() as f64;
    if is_many { SfrError::Uneven { deviation: median(left_out()) } } else { error }
}

/// Deviation of a pixel from the profile.
fn residual(spline: &Spline, point: &Point) -> f64 {
    spline.at(point.distance).map_or(0.0, |v| point.share - v)
}

/// Pixels on either side of the edge over which there are enough samples.
fn half_of(samples: &[Sample]) -> usize {
    let mut counts = vec![[0_usize; 2]; LONGEST_PX];
    for s in samples {
        let bin = s.distance.abs() as usize;
        if bin < LONGEST_PX {
            counts[bin][usize::from(s.distance > 0.0)] += 1;
        }
    }
    let near =
        counts.iter().take(LEAST_HALF / 2).flatten().sum::<usize>() as f64 / (LEAST_HALF / 2 * 2) as f64;
    let least = LEAST_DENSITY * near;
    counts.iter().take_while(|both| both.iter().all(|n| *n as f64 >= least && *n > 0)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_penalty_grows_with_the_gap_without_a_jump() {
        for k in 0..90 {
            let gap_px = 0.01 * f64::from(k);
            let (penalty, next) = (least_penalty(gap_px), least_penalty(gap_px + 0.01));
            assert!(next >= penalty && next < 1.6 * penalty, "{gap_px}: {penalty}, {next}");
        }
        assert_eq!(least_penalty(0.05), PENALTY);
        assert_eq!(least_penalty(0.5_f64.sqrt()), COARSE_PENALTY);
    }
}
