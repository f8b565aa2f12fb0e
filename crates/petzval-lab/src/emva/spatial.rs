//! Spatial non-uniformity from a stack of flat and a stack of dark frames.
//!
//! The mean of `L` frames still holds `1/L` of the temporal variance `s2_stack`. Its variance over the `M x N` pixels,
//! that of its column means and that of its row means are split into the contributions of single pixels, columns and
//! rows:
//!
//! ```text
//! V  = var(mean frame)       = P + C + R       P = pixel variance + s2_stack / L
//! Ac = var(column means)     = C + P / M
//! Ar = var(row means)        = R + P / N
//! ```
//!
//! After a high-pass the three parts count with their remaining shares (`g_p`, `g_l`, [`HighPass::passed`]), and single pixels in the means of rows and
//! columns with `g_r` and `g_c` ([`HighPass::passed_by_means`]):
//! `C = (Ac - g_c P/M) / g_l`, `R = (Ar - g_r P/N) / g_l`, `P = (V - Ac - Ar) / (g_p - g_c/M - g_r/N)`. With `g = 1` these are the formulas
//! of EMVA 1288 release 4.
//!
//! Before this split the temporal variance is freed of flicker, as it is for pairs. Of the temporal noise of rows and
//! columns `1/L` remains as well, as far as it passes the filter: how it is [correlated](super::line_covariance) decides that. It is subtracted from `C` and `R`. Pixels that do not answer light
//! ([`super::defects`]) take the mean of their neighbours. The plain variances without a high-pass have none of these corrections.

use std::collections::BTreeSet;
use std::rc::Rc;

use schemars::JsonSchema;
use serde::Serialize;

use super::compressed::level_step_dn;
use super::defects::{Defect, defects, without};
use super::goodness::{FitTest, Verdict};
use super::high_pass::{HighPass, Plane, high_pass_5x5_times_25};
use super::histogram::{Histogram, MOST_BINS, accumulated, histogram};
use super::line_covariance::LineCovariance;
use super::measured::{Measured, Unresolved};
use super::neighbours::Neighbours;
use super::plane_moments::{SharedScatter, moments};
use super::point::{Moments, PointStatistics, Stack};
use super::rounding::Steps;
use super::spectrogram::{column_spectrogram, row_spectrogram};
use petzval_camera::sensor::{CfaPattern, Colour};

/// Variances of the mean of a stack, DN^2, or their standard errors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, JsonSchema)]
pub struct Variances {
    /// Mean temporal variance.
    pub temporal: f64,
    /// Variance of the mean frame.
    pub measured: f64,
    /// The same minus the remaining temporal variance.
    pub total: f64,
    /// Variance of the column means minus temporal variance.
    pub column_means: f64,
    /// Variance of the row means minus temporal variance.
    pub row_means: f64,
    /// Of columns.
    pub column: f64,
    /// Of rows.
    pub row: f64,
    /// Of single pixels.
    pub pixel: f64,
}

/// Variances of the mean of a stack without a high-pass, as release 4 and the library split them.
///
/// Standard errors are the scatter over specimens of one kind: `A sqrt(2/N)` of the variance `A` of `N` column means, `A
/// sqrt(2/M)` of that of `M` row means, from the fourth moment of the residual for the pixels; the three are
/// independent. They are too small for an uneven field, whose rows and columns are not random.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, JsonSchema)]
pub struct StackVariances {
    /// Frames L.
    pub frames: usize,
    /// Mean, DN.
    pub mean_dn: f64,
    /// The variances, DN^2.
    #[serde(flatten)]
    pub variances: Variances,
    /// Their standard errors, DN^2.
    pub standard_errors: Variances,
}

impl StackVariances {
    /// One of the variances with its standard error, DN^2.
    pub fn with_error(&self, of: fn(&Variances) -> f64) -> Measured {
        Measured::new(of(&self.variances), of(&self.standard_errors))
    }
}

/// Variances after the high-pass, corrected for its loss, DN^2.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Components {
    /// All three.
    pub total: Measured,
    /// Of rows.
    pub row: Measured,
    /// Of columns.
    pub column: Measured,
    /// Of single pixels.
    pub pixel: Measured,
    /// Whether single pixels differ independently of their neighbours, as the split assumes: correlations with the neighbours below and to
    /// the right, and the next ones, against those that the filter makes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub test: Option<FitTest>,
    /// Whether the pixels repeat as in a tile of colour filters.
    #[serde(skip)]
    pub is_tiled: bool,
}

/// Rows or columns of a picture seen from the side.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Profile {
    /// The middle row (column).
    pub middle_dn: Vec<f64>,
    /// Mean over the rows (columns).
    pub mean_dn: Vec<f64>,
    /// Least of the rows (columns).
    pub min_dn: Vec<f64>,
    /// Largest of the rows (columns).
    pub max_dn: Vec<f64>,
}

/// Data of the plots of one stack.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct StackPlots {
    /// Power along rows at the frequencies `k / (2 (n - 1))` periods per pixel (for even widths), DN^2.
    pub horizontal_spectrogram_dn2: Vec<f64>,
    /// Power along columns, DN^2.
    pub vertical_spectrogram_dn2: Vec<f64>,
    /// Along a row.
    pub horizontal_profile: Profile,
    /// Along a column.
    pub vertical_profile: Profile,
    /// Histogram of the defects over their deviation, DN.
    pub histogram: Histogram,
    /// Percent of pixels that deviate by at least a number of DN.
    pub accumulated: Histogram,
}

/// Non-uniformity of one gain and colour.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Spatial {
    /// Exposure time of the stacks, s.
    pub exposure_s: f64,
    /// The filter before [`flat_components`](Self::flat_components) and [`dark_components`](Self::dark_components).
    pub high_pass: HighPass,
    /// Flat stack, no filter.
    pub flat: StackVariances,
    /// Dark stack, no filter.
    pub dark: StackVariances,
    /// Flat stack after the filter.
    pub flat_components: Components,
    /// Dark stack after the filter.
    pub dark_components: Components,
    /// Share of the scatter over specimens that the components of both stacks have in common.
    #[serde(skip)]
    pub shared: SharedScatter,
    /// Pixels that do not answer light as others do; the components leave them out.
    pub defects: Vec<Defect>,
    /// Components of the flat and of the dark stack with these pixels, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub components_with_defects: Option<[Components; 2]>,
    /// Components of the dark stack without the hot pixels either, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark_components_without_hot: Option<Components>,
    /// Number of pixels that are bright in the dark at every exposure time and answer light.
    pub bright: usize,
    /// Components of the dark stack without the bright pixels, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dark_components_without_bright: Option<Components>,
    /// Mean signal of all pixels over that of those that answer light, minus one, if some do not. R, QE and the saturation capacity, means over all
    /// pixels, are off by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signal_bias: Option<f64>,
    /// Plots of the flat stack minus the dark one (PRNU).
    pub prnu: StackPlots,
    /// Plots of the dark stack (DSNU).
    pub dsnu: StackPlots,
}

/// A flat and a dark stack of one exposure time.
pub struct Stacks<'a> {
    /// In the light.
    pub flat: &'a PointStatistics,
    /// In the dark.
    pub dark: &'a PointStatistics,
    /// Exposure time, s.
    pub exposure_s: f64,
    /// Places of the hot pixels in the frame, row by row, ascending.
    pub hot_pixels: &'a [usize],
    /// Places of the pixels that are bright in the dark at every exposure time, likewise.
    pub bright_pixels: &'a [usize],
}

/// Evaluates two stacks of the same size for the pixels of one colour. Each place of the colour in the mosaic tile is evaluated as a
/// picture of its own, and the variances are averaged over the places. `None` if a point is not a stack, or is too small.
pub fn spatial(
    &Stacks { flat, dark, exposure_s, hot_pixels, bright_pixels }: &Stacks<'_>,
    cfa: &CfaPattern,
    colour: Colour,
    high_pass: HighPass,
) -> Option<Spatial> {
    let places: Vec<(usize, usize)> = (0..cfa.rows())
        .flat_map(|row| (0..cfa.cols()).map(move |col| (row, col)))
        .filter(|(row, col)| cfa.colour(*row, *col) == colour && *row < flat.height && *col < flat.width)
        .collect();
    let sub = |point: &PointStatistics| -> Option<Vec<Sub>> {
        let (stack, moments) = (point.stack.as_ref()?, point.colour(colour)?);
        Some(places.iter().map(|place| Sub::of(stack, moments, cfa, *place)).collect())
    };
    let frame_width = dark.width;
    let (flat, dark) = (sub(flat)?, sub(dark)?);
    let smallest = flat.iter().map(|s| s.height.min(s.width)).min()?;
    if smallest < 3 {
        return None;
    }

    // Find the defect pixels of each place, and name them by their row and column of the frame.
    let (mut found, mut clean) = (Vec::new(), [flat.clone(), dark.clone()]);
    let (mut not_hot, mut not_bright, mut bright) = (dark.clone(), dark.clone(), 0);
    let (mut of_all, mut of_others) = (Mean::default(), Mean::default());
    for (i, (row, col)) in places.iter().enumerate() {
        let (light, dark) = (flat[i].mean(), dark[i].mean());
        let of_place = defects(&light, &dark);
        for stack in &mut clean {
            stack[i] = stack[i].without(&of_place);
        }
        // Leave the hot pixels of the place out of one copy of the dark stack, the bright ones out of another.
        let with_defects = |pixels: &[usize]| -> Vec<usize> {
            let places = pixels.iter().map(|at| (at / frame_width, at % frame_width));
            let of_others = places
                .filter(|(r, c)| (r % cfa.rows(), c % cfa.cols()) == (*row, *col))
                .map(|(r, c)| r / cfa.rows() * light.width + c / cfa.cols());
            let all: BTreeSet<usize> = of_place.iter().copied().chain(of_others).collect();
            all.into_iter().collect()
        };
        not_hot[i] = not_hot[i].without(&with_defects(hot_pixels));
        let left_out = with_defects(bright_pixels);
        bright += left_out.len() - of_place.len();
        not_bright[i] = not_bright[i].without(&left_out);
        // Average the signal over all pixels, and over those that answer light.
        for (at, signal) in light.values.iter().zip(&dark.values).map(|(lit, unlit)| lit - unlit).enumerate()
        {
            of_all.add(signal);
            if of_place.binary_search(&at).is_err() {
                of_others.add(signal);
            }
        }
        found.extend(of_place.iter().map(|at| Defect {
            row: row + at / light.width * cfa.rows(),
            column: col + at % light.width * cfa.cols(),
            flat_dn: light.values[*at],
            dark_dn: dark.values[*at],
        }));
    }
    found.sort_by_key(|defect| (defect.row, defect.column));
    let [clean_flat, clean_dark] = clean;
    Some(Spatial {
        exposure_s,
        high_pass,
        flat: mean_of(&flat),
        dark: mean_of(&dark),
        shared: shared_scatter(&clean_flat, &clean_dark, high_pass),
        flat_components: components(&clean_flat, high_pass),
        dark_components: components(&clean_dark, high_pass),
        dark_components_without_hot: (!hot_pixels.is_empty()).then(|| components(&not_hot, high_pass)),
        bright,
        dark_components_without_bright: (bright > 0).then(|| components(&not_bright, high_pass)),
        signal_bias: (!found.is_empty()).then(|| of_all.mean() / of_others.mean() - 1.0),
        components_with_defects: (!found.is_empty())
            .then(|| [components(&flat, high_pass), components(&dark, high_pass)]),
        defects: found,
        prnu: prnu_plots(&flat, &dark),
        dsnu: dsnu_plots(&dark),
    })
}

/// A running mean.
#[derive(Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }
}

/// One place of the tile over the whole stack.
#[derive(Clone)]
struct Sub {
    height: usize,
    width: usize,
    frames: usize,
    sum_dn: Vec<i64>,
    /// Temporal variance of each pixel, DN^2.
    variance_dn2: Rc<[f64]>,
    temporal: f64,
    temporal_se: f64,
    /// Part of the temporal variance by which whole frames differ, DN^2.
    flicker: f64,
    /// How the temporal noise of rows, and that of columns, is correlated.
    lines: Rc<[LineCovariance; 2]>,
    /// Distance of its rows, and of its columns, in the frame.
    steps: [usize; 2],
    /// Temporal variance of single pixels, DN^2.
    pixel_temporal: Measured,
    /// Distance of the digital numbers near its level, DN.
    step_dn: f64,
}

impl Sub {
    fn of(
        stack: &Stack,
        moments: &Moments,
        cfa: &CfaPattern,
        (first_row, first_col): (usize, usize),
    ) -> Self {
        let rows = (first_row..stack.height).step_by(cfa.rows());
        let cols = (first_col..stack.width).step_by(cfa.cols());
        let (height, width) = (rows.len(), cols.len());
        let pixels = || rows.clone().flat_map(|row| cols.clone().map(move |col| row * stack.width + col));
        let n = (height * width) as f64;
        let variance_dn2: Rc<[f64]> = pixels().map(|i| stack.variance_dn2[i]).collect();
        let temporal = variance_dn2.iter().sum::<f64>() / n;
        let squares = variance_dn2.iter().map(|v| (v - temporal).powi(2)).sum::<f64>();
        Self {
            height,
            width,
            frames: stack.frames,
            sum_dn: pixels().map(|i| i64::from(stack.sum_dn[i])).collect(),
            variance_dn2,
            temporal,
            temporal_se: squares.sqrt() / n,
            flicker: moments.variance_uncorrected_dn2 - moments.variance_dn2,
            lines: Rc::new(moments.line_covariances.clone()),
            steps: [cfa.rows(), cfa.cols()],
            pixel_temporal: moments.line_noise.pixel_dn2,
            step_dn: level_step_dn(&moments.histogram),
        }
    }

    /// The same with the mean of their neighbours in place of these pixels, ascending, and with the temporal noise of the others.
    fn without(&self, pixels: &[usize]) -> Self {
        let kept = (self.variance_dn2.len() - pixels.len()) as f64;
        let of_pixels = pixels.iter().map(|i| self.variance_dn2[*i] - self.temporal).sum::<f64>();
        let less = if kept > 0.0 { of_pixels / kept } else { 0.0 };
        Self {
            sum_dn: without(&self.sum_dn, self.width, pixels),
            temporal: self.temporal - less,
            pixel_temporal: self.pixel_temporal.map(|v| v - less, |_| 1.0),
            ..self.clone()
        }
    }

    /// The mean frame.
    fn mean(&self) -> Plane {
        let l = self.frames as f64;
        let values = self.sum_dn.iter().map(|s| *s as f64 / l).collect();
        Plane { height: self.height, width: self.width, values }
    }
}

/// The split of release 4 without a filter.
fn variances(sub: &Sub) -> StackVariances {
    let (m, n, l) = (sub.height as f64, sub.width as f64, sub.frames as f64);
    let found = moments(&sub.mean());
    let total = found.variance - sub.temporal / l;
    let column_means = found.column_means - sub.temporal / (l * m);
    let row_means = found.row_means - sub.temporal / (l * n);
    let free = m * n - m - n;
    // Column means and row means contain a part of the pixels' variance; the split subtracts it.
    let column_means_se = found.column_means * (2.0 / n).sqrt();
    let row_means_se = found.row_means * (2.0 / m).sqrt();
    let pixel_se = m * n / free * found.pixel_se;
    let temporal_se = sub.temporal_se;
    let measured_se = found.pixel_se.hypot(column_means_se).hypot(row_means_se);
    StackVariances {
        frames: sub.frames,
        mean_dn: found.mean,
        variances: Variances {
            temporal: sub.temporal,
            measured: found.variance,
            total,
            column_means,
            row_means,
            column: ((m * n - m) * column_means - n * (total - row_means)) / free,
            row: ((m * n - n) * row_means - m * (total - column_means)) / free,
            pixel: m * n / free * (total - column_means - row_means),
        },
        standard_errors: Variances {
            temporal: temporal_se,
            measured: measured_se,
            total: measured_se.hypot(temporal_se / l),
            column_means: column_means_se.hypot(temporal_se / (l * m)),
            row_means: row_means_se.hypot(temporal_se / (l * n)),
            column: column_means_se.hypot(pixel_se / m),
            row: row_means_se.hypot(pixel_se / n),
            pixel: pixel_se.hypot(temporal_se / l),
        },
    }
}

/// Mean over the places of a colour in the tile, which are independent pixels.
fn mean_of(subs: &[Sub]) -> StackVariances {
    let parts: Vec<StackVariances> = subs.iter().map(variances).collect();
    let count = parts.len() as f64;
    let mean = |f: fn(&StackVariances) -> f64| parts.iter().map(f).sum::<f64>() / count;
    let each = |f: &dyn Fn(fn(&Variances) -> f64) -> f64| Variances {
        temporal: f(|v| v.temporal),
        measured: f(|v| v.measured),
        total: f(|v| v.total),
        column_means: f(|v| v.column_means),
        row_means: f(|v| v.row_means),
        column: f(|v| v.column),
        row: f(|v| v.row),
        pixel: f(|v| v.pixel),
    };
    let squares =
        |of: fn(&Variances) -> f64| parts.iter().map(|p| of(&p.standard_errors).powi(2)).sum::<f64>();
    StackVariances {
        frames: parts.first().map_or(0, |p| p.frames),
        mean_dn: mean(|p| p.mean_dn),
        variances: each(&|of| parts.iter().map(|p| of(&p.variances)).sum::<f64>() / count),
        standard_errors: each(&|of| squares(of).sqrt() / count),
    }
}

/// The split after a high-pass, with standard errors: that of the pixels from the fourth moment of the residual after
/// rows and columns, that of `n` means of variance `A` as `A sqrt(2/n)`; neighbours that the filter correlates count
/// less.
fn components(subs: &[Sub], high_pass: HighPass) -> Components {
    let passed = high_pass.passed();
    let mut parts: Vec<[(f64, f64); 4]> = Vec::new();
    let mut neighbours = Neighbours::default();
    for sub in subs {
        let Some(plane) = high_pass.apply(&sub.mean()).filter(|p| p.height >= 8 && p.width >= 8) else {
            let [total, row, column, pixel] = [Measured::none(Unresolved::TooSmall); 4];
            return Components { total, row, column, pixel, test: None, is_tiled: false };
        };
        let (m, n, l) = (plane.height as f64, plane.width as f64, sub.frames as f64);
        let found = moments(&plane);
        // Without a filter the means of rows and columns are about their own mean, which has a share of their variance.
        let freed = |lines: f64| if high_pass == HighPass::None { lines / (lines - 1.0) } else { 1.0 };
        let (ac, ar) = (found.column_means * freed(n), found.row_means * freed(m));
        let of_means = [plane.width, plane.height].map(|across| high_pass.passed_by_means(across));
        let shares = passed.pixel - of_means[1] / (m * freed(n)) - of_means[0] / (n * freed(m));
        let of_lines = |lines: f64| (2.0 / lines * passed.line_correlation).sqrt();
        let p = (found.variance - found.column_means - found.row_means) / shares;
        let p_se = found.pixel_se * passed.pixel_correlation.sqrt() / shares;
        // Of the temporal variance of pixels, and of that of rows and columns after the filter, 1/L remains in the mean frame.
        let pixels = sub.pixel_temporal.value().unwrap_or(sub.temporal - sub.flicker);
        let pixels_se = sub.pixel_temporal.standard_error().unwrap_or(sub.temporal_se);
        let (pixel, pixel_se) = (p - pixels / l, p_se.hypot(pixels_se / l));
        let own = Neighbours::of(&plane, high_pass);
        // Pixels that are alike vary together, and the filter takes more of them than of independent ones.
        let pixel_se = match own.test().verdict {
            Verdict::Widened => (pixel_se * own.scatter()).hypot(pixel * own.lost_share(high_pass)),
            _ => pixel_se,
        };
        neighbours.add(&own);
        let kernel = high_pass.kernel();
        let of_axis = |axis: usize, means: f64, lines: f64, across: f64| {
            let temporal = sub.lines[axis].filtered(&kernel, sub.steps[axis]);
            let of_pixels = of_means[axis] / across;
            // What the temporal noise of lines leaves in the mean frame, what that of their pixels does, and what all of the pixels do.
            let (alone, alone_se, correlation) = match temporal {
                Some(t) => {
                    let se = t.standard_error_dn2.hypot(t.pixel_share * pixels_se) / l;
                    ((t.variance_dn2 - t.pixel_share * pixels) * freed(lines) / l, se, t.correlation)
                }
                None => (0.0, 0.0, 1.0),
            };
            let (noise, by_pixels) = (of_pixels * pixels / l, of_pixels * p);
            // What differs between specimens scatters as independent lines do, what is left of the temporal noise as its own correlation says.
            // What is found is no less than what pixels and noise leave: chance must not make its error small.
            let fixed = (means - alone - by_pixels).max(0.0) + (by_pixels - noise).max(0.0);
            let left = alone.max(0.0) + noise;
            let means_se = fixed * of_lines(lines) + left * (2.0 / lines * correlation).sqrt();
            let value = (means - alone - by_pixels) / passed.line;
            (value, means_se.hypot(alone_se).hypot(of_pixels * p_se) / passed.line)
        };
        let (column, column_se) = of_axis(1, ac, n, m);
        let (row, row_se) = of_axis(0, ar, m, n);
        let total = pixel + column + row;
        let total_se = pixel_se.hypot(column_se).hypot(row_se);
        // Noise too small to smooth the steps of the converter stretches or shrinks the differences of pixels. Those of rows and columns
        // are smoothed by the pixels as well, whose spread is taken without its tails: a few hot pixels smooth nothing.
        let steps = Steps::behind(sub.temporal - sub.flicker, sub.step_dn);
        let of_lines = steps.smoothed_by(found.pixel_core / shares - pixels / l);
        let rounded =
            |steps: &Steps, value: f64, se: f64| (value, se.hypot(steps.error_of_variance(value, se)));
        parts.push([
            rounded(&steps, total, total_se),
            rounded(&of_lines, row, row_se),
            rounded(&of_lines, column, column_se),
            rounded(&steps, pixel, pixel_se),
        ]);
    }
    let count = parts.len() as f64;
    let of = |k: usize| {
        let value = parts.iter().map(|p| p[k].0).sum::<f64>() / count;
        let se = parts.iter().map(|p| p[k].1 * p[k].1).sum::<f64>().sqrt() / count;
        Measured::new(value, se)
    };
    let [total, row, column, pixel] = [0, 1, 2, 3].map(of);
    let (test, is_tiled) = (Some(neighbours.test()), neighbours.is_tiled());
    Components { total, row, column, pixel, test, is_tiled }
}

/// What the filtered mean frames of both stacks have in common, over the places of a colour.
fn shared_scatter(flat: &[Sub], dark: &[Sub], high_pass: HighPass) -> SharedScatter {
    let of_place = |(flat, dark): (&Sub, &Sub)| {
        Some(SharedScatter::of(&high_pass.apply(&flat.mean())?, &high_pass.apply(&dark.mean())?))
    };
    SharedScatter::mean(flat.iter().zip(dark).filter_map(of_place))
}

fn profiles(plane: &Plane) -> (Profile, Profile) {
    let (height, width) = (plane.height, plane.width);
    let at = |row: usize, col: usize| plane.values[row * width + col];
    let along = |length: usize, across: usize, at: &dyn Fn(usize, usize) -> f64| {
        let over = |f: fn(f64, f64) -> f64, start: f64| {
            (0..length).map(|i| (0..across).fold(start, |s, k| f(s, at(i, k)))).collect::<Vec<f64>>()
        };
        Profile {
            middle_dn: (0..length).map(|i| at(i, across / 2)).collect(),
            mean_dn: over(|s, v| s + v, 0.0).into_iter().map(|s| s / across as f64).collect(),
            min_dn: over(f64::min, f64::INFINITY),
            max_dn: over(f64::max, f64::NEG_INFINITY),
        }
    };
    (along(width, height, &|col, row| at(row, col)), along(height, width, &|row, col| at(row, col)))
}

fn mean_spectrum(planes: &[Plane], spectrum: fn(&Plane) -> Vec<f64>) -> Vec<f64> {
    let all: Vec<Vec<f64>> = planes.iter().map(spectrum).collect();
    let length = all.iter().map(Vec::len).min().unwrap_or(0);
    (0..length).map(|i| all.iter().map(|s| s[i]).sum::<f64>() / all.len() as f64).collect()
}

/// The plots of planes and of their defects. `defects` are in units of 1 / `divisor` DN; `middle` is subtracted from the histogram.
fn plots(planes: &[Plane], defects: &[i64], divisor: f64, middle: f64) -> StackPlots {
    let (horizontal_profile, vertical_profile) = planes.first().map(profiles).unwrap_or_default();
    StackPlots {
        horizontal_spectrogram_dn2: mean_spectrum(planes, row_spectrogram),
        vertical_spectrogram_dn2: mean_spectrum(planes, column_spectrogram),
        horizontal_profile,
        vertical_profile,
        histogram: histogram(defects, MOST_BINS).rescaled(divisor, middle),
        accumulated: accumulated(defects, MOST_BINS).rescaled(divisor, 0.0),
    }
}

/// Defects in the dark: sums of the frames, whole numbers, so that bins are exact.
fn dsnu_plots(dark: &[Sub]) -> StackPlots {
    let planes: Vec<Plane> = dark.iter().map(Sub::mean).collect();
    let sums: Vec<i64> = dark.iter().flat_map(|s| s.sum_dn.iter().copied()).collect();
    let l = dark.first().map_or(1.0, |s| s.frames as f64);
    let mean = sums.iter().map(|v| *v as f64).sum::<f64>() / sums.len() as f64;
    plots(&planes, &sums, l, mean / l)
}

/// Defects in the light: flat minus dark sums, after the 5x5 high-pass of release 3.1 in whole numbers.
fn prnu_plots(flat: &[Sub], dark: &[Sub]) -> StackPlots {
    let (mut planes, mut filtered) = (Vec::new(), Vec::new());
    let mut divisor = 25.0;
    for (f, d) in flat.iter().zip(dark) {
        // Scale stacks of different lengths to a common one.
        let (a, b) = if f.frames == d.frames { (1, 1) } else { (d.frames as i64, f.frames as i64) };
        let difference: Vec<i64> = f.sum_dn.iter().zip(&d.sum_dn).map(|(x, y)| a * x - b * y).collect();
        let l = (f.frames as i64 * a) as f64;
        divisor = 25.0 * l;
        filtered.extend(high_pass_5x5_times_25(&difference, f.height, f.width).0);
        let values = difference.iter().map(|v| *v as f64 / l).collect();
        planes.push(Plane { height: f.height, width: f.width, values });
    }
    plots(&planes, &filtered, divisor, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nearly normal numbers of variance one: sums of twelve uniform ones.
    struct Normal(u64);

    impl Normal {
        fn draw(&mut self) -> f64 {
            let mut uniform = || {
                self.0 =
                    self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (self.0 >> 11) as f64 / (1u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        }
    }

    /// Two frames of 72 x 96 pixels with pixels, rows, columns and temporal noise of 100 DN each in the mean of two frames.
    fn specimen(normal: &mut Normal) -> Stack {
        let (height, width) = (72, 96);
        let rows: Vec<f64> = (0..height).map(|_| 100.0 * normal.draw()).collect();
        let cols: Vec<f64> = (0..width).map(|_| 100.0 * normal.draw()).collect();
        let (mut sum_dn, mut variance_dn2) = (Vec::new(), Vec::new());
        for (row, col) in (0..height).flat_map(|row| (0..width).map(move |col| (row, col))) {
            let fixed = 10_000.0 + rows[row] + cols[col] + 100.0 * normal.draw();
            let [a, b] = [0, 1].map(|_| (fixed + 100.0 * 2.0_f64.sqrt() * normal.draw()).round());
            sum_dn.push((a + b) as u32);
            variance_dn2.push(0.5 * (a - b).powi(2));
        }
        Stack { height, width, frames: 2, sum_dn, variance_dn2 }
    }

    /// A stack of a mono sensor without flicker, whose rows and columns have no temporal noise.
    fn whole(stack: &Stack) -> Sub {
        let rows = (0..stack.height).flat_map(|row| (0..stack.width).map(move |col| row * stack.width + col));
        let temporal = stack.variance_dn2.iter().sum::<f64>() / stack.variance_dn2.len() as f64;
        let squares = stack.variance_dn2.iter().map(|v| (v - temporal).powi(2)).sum::<f64>();
        Sub {
            height: stack.height,
            width: stack.width,
            frames: stack.frames,
            sum_dn: rows.map(|i| i64::from(stack.sum_dn[i])).collect(),
            variance_dn2: stack.variance_dn2.as_slice().into(),
            temporal,
            temporal_se: squares.sqrt() / stack.variance_dn2.len() as f64,
            flicker: 0.0,
            lines: Rc::default(),
            step_dn: 1.0,
            steps: [1; 2],
            pixel_temporal: Measured::new(temporal, squares.sqrt() / stack.variance_dn2.len() as f64),
        }
    }

    #[test]
    fn standard_errors_match_the_scatter_over_specimens() {
        const SPECIMENS: usize = 150;
        let mut normal = Normal(1);
        let specimens: Vec<Sub> = (0..SPECIMENS).map(|_| whole(&specimen(&mut normal))).collect();
        let filtered = |high_pass| {
            move |sub: &Sub| {
                let c = components(std::slice::from_ref(sub), high_pass);
                vec![(c.pixel, 1e4), (c.row, 1e4), (c.column, 1e4)]
            }
        };
        // The variance over a sample with its own mean of rows is less by their share in the mean.
        let plain = |sub: &Sub| {
            let v = variances(sub);
            let (of_rows, of_columns) = (1e4 * (1.0 - 1.0 / 72.0), 1e4 * (1.0 - 1.0 / 96.0));
            vec![
                (v.with_error(|v| v.temporal), 2e4),
                (v.with_error(|v| v.measured), 2e4 + of_rows + of_columns),
                (v.with_error(|v| v.total), 1e4 + of_rows + of_columns),
                (v.with_error(|v| v.column_means), of_columns + 1e4 / 72.0),
                (v.with_error(|v| v.row_means), of_rows + 1e4 / 96.0),
                (v.with_error(|v| v.column), of_columns),
                (v.with_error(|v| v.row), of_rows),
                (v.with_error(|v| v.pixel), 1e4),
            ]
        };
        type Parts<'a> = &'a dyn Fn(&Sub) -> Vec<(Measured, f64)>;
        let all: [(&str, Parts<'_>); 3] = [
            ("high-pass none", &filtered(HighPass::None)),
            ("high-pass r3.1", &filtered(HighPass::R31)),
            ("release 4", &plain),
        ];
        for (name, parts) in all {
            let found: Vec<Vec<(Measured, f64)>> = specimens.iter().map(parts).collect();
            for (k, (_, truth)) in found[0].iter().enumerate() {
                let values: Vec<f64> = found.iter().map(|f| f[k].0.value().unwrap()).collect();
                let n = SPECIMENS as f64;
                let mean = values.iter().sum::<f64>() / n;
                let scatter = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
                let stated = found.iter().map(|f| f[k].0.standard_error().unwrap()).sum::<f64>() / n;
                // The scatter of n specimens is known to 1/sqrt(2 n) = 5.8 %: four of them, 6e-5 each.
                let ratio = stated / scatter;
                assert!((ratio - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{name} {k}: {ratio}");
                assert!((mean - truth).abs() < 4.0 * scatter / n.sqrt(), "{name} {k}: {mean} +- {scatter}");
            }
        }
    }
}
