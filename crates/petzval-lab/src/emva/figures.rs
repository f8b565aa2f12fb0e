//! The figures of EMVA 1288 under the computer names of the EMVA 1288 Python library, each as the library derives it and,
//! where ours differs, the corrected value beside it.

use schemars::JsonSchema;
use serde::Serialize;

use super::dark::{DarkPoint, DarkSeries, dark_series};
use super::measured::{Measured, Unresolved};
use super::plane_moments::SharedScatter;
use super::rounding::{LEAST_DARK_VARIANCE_DN2, QUANTISATION_DN2, rounding_dn2};
use super::spatial::{Components, Spatial, StackVariances, Variances};
use super::transfer::PhotonTransfer;
use super::transfer_point::{Rules, TransferPoint};

/// The side of a limit on which the true value lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// The value is an upper limit.
    Upper,
    /// The value is a lower limit.
    Lower,
}

impl Limit {
    /// The sign in front of the value.
    pub fn sign(self) -> &'static str {
        match self {
            Self::Upper => "<",
            Self::Lower => ">",
        }
    }
}

/// Figures that are limits where the dark noise is below what the converter resolves.
const UPPER_LIMITS: [&str; 6] =
    ["sigma_d", "sigma_y_dark", "u_e_min", "u_e_min_area", "u_p_min", "u_p_min_area"];
const LOWER_LIMITS: [&str; 2] = ["DR", "DR_dB"];

/// One figure.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Figure {
    /// Computer name in the library.
    pub name: &'static str,
    /// Section of the library's results.
    pub section: &'static str,
    /// Meaning.
    pub meaning: &'static str,
    /// Unit; empty for pure numbers.
    pub unit: &'static str,
    /// Value as the library derives it, with our standard error.
    pub value: Measured,
    /// Our value, where it differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corrected: Option<Measured>,
    /// Whether our value is no measurement but a limit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<Limit>,
}

impl Figure {
    /// Our value if there is one, else that of the library.
    pub fn best(&self) -> Measured {
        self.corrected.unwrap_or(self.value)
    }
}

/// The inputs of the figures of one gain and colour.
pub struct Basis<'a> {
    /// The points, light ascending.
    pub points: &'a [TransferPoint],
    /// Photon transfer by the rules of the library.
    pub library: &'a PhotonTransfer,
    /// Photon transfer by our rules.
    pub ours: &'a PhotonTransfer,
    /// All dark frames of the gain, also those without flat frames of the same exposure time; the library has only dark
    /// frames of points.
    pub dark: &'a DarkSeries,
    /// Non-uniformity, if there are stacks.
    pub spatial: Option<&'a Spatial>,
    /// Area of a pixel, um^2, if the pitch is known.
    pub pixel_area_um2: Option<f64>,
}

/// All figures, in the order of their names.
pub fn figures(basis: &Basis<'_>) -> Vec<Figure> {
    let library = values(basis, Rules::Library);
    let ours = values(basis, Rules::Ours);
    // The dark noise at the limit makes limits of all figures that contain it.
    let least_dn = LEAST_DARK_VARIANCE_DN2.sqrt() * (1.0 + 1e-12);
    let is_limit = |(name, .., m): &Value| {
        *name == "sigma_y_dark" && m.standard_error().is_none() && m.value().is_some_and(|v| v <= least_dn)
    };
    let has_limits = ours.iter().any(is_limit);
    let limit = |name: &str, best: Measured| match best.value() {
        Some(_) if has_limits && UPPER_LIMITS.contains(&name) => Some(Limit::Upper),
        Some(_) if has_limits && LOWER_LIMITS.contains(&name) => Some(Limit::Lower),
        _ => None,
    };
    let same = |a: &Measured, b: &Measured| match (a.value(), b.value()) {
        (Some(x), Some(y)) => (x - y).abs() <= 1e-12 * x.abs(),
        (None, None) => a.reason() == b.reason(),
        _ => false,
    };
    let figures =
        library.into_iter().zip(ours).map(|((name, section, unit, meaning, library), (.., ours))| {
            // Where both agree, keep our number, because it has a standard error.
            let (value, corrected) = if same(&library, &ours) { (ours, None) } else { (library, Some(ours)) };
            let limit = limit(name, corrected.unwrap_or(value));
            Figure { name, section, meaning, unit, value, corrected, limit }
        });
    figures.collect()
}

/// Dark frames of the points, each exposure time once.
fn dark_of(points: &[TransferPoint]) -> DarkSeries {
    let all: Vec<DarkPoint> = points
        .iter()
        .map(|p| DarkPoint {
            exposure_s: p.exposure_s,
            mean_dn: p.dark_mean_dn,
            mean_se_dn: p.dark_mean_se_dn,
            variance_dn2: p.dark_variance_dn2,
            variance_se_dn2: p.dark_variance_se_dn2,
            step_dn: p.dark_step_dn,
        })
        .collect();
    dark_series(all)
}

/// Name, section, unit and meaning of a figure, and its value.
type Value = (&'static str, &'static str, &'static str, &'static str, Measured);

fn values(basis: &Basis<'_>, rules: Rules) -> Vec<Value> {
    let ours = rules == Rules::Ours;
    let transfer = if ours { basis.ours } else { basis.library };
    let points = basis.points;
    let (k, r) = (transfer.gain_dn_per_e, transfer.responsivity_dn);
    let dark = if ours { basis.dark } else { &dark_of(points) };

    // Dark noise: the intercept over exposure time, or the value at the only exposure time.
    let first = &points[0];
    let dark_variance = match dark.variance.intercept.value() {
        Some(_) => dark.variance.intercept,
        None => Measured::new(first.dark_variance_dn2, first.dark_variance_se_dn2)
            .with_error(first.dark_rounding().variance_dn2),
    };
    // Dark variance below what a converter of whole numbers resolves is set to that limit, as the standard does. A limit has no
    // error.
    let is_limit = dark_variance.value().is_some_and(|v| v <= LEAST_DARK_VARIANCE_DN2);
    let or_limit = |m: Measured| if is_limit { m.limit() } else { m };
    let dark_variance = or_limit(dark_variance.map(|v| v.max(LEAST_DARK_VARIANCE_DN2), |_| 1.0));
    let sigma_y_dark = dark_variance.root();
    // The library takes numbers for whole ones, and so does the limit.
    let rounding = if ours && !is_limit { rounding_dn2(first.dark_step_dn) } else { QUANTISATION_DN2 };
    let sigma_d = or_limit(dark_variance.map(|v| v - rounding, |_| 1.0).root().over(k));

    // Sensitivity threshold: dark noise plus half an electron, where the signal-to-noise ratio is one.
    let threshold_dn = match (sigma_y_dark.value(), k.value()) {
        (Some(s), Some(gain)) => {
            Measured::new(s + 0.5 * gain, sigma_y_dark.error_or_zero().hypot(0.5 * k.error_or_zero()))
        }
        _ => Measured::none(Unresolved::FollowsFrom("K")),
    };
    let u_e_min = or_limit(sigma_y_dark.over(k).map(|v| v + 0.5, |_| 1.0));
    let u_p_min = or_limit(threshold_dn.over(r));

    let at = transfer.saturation;
    let (u_p_sat, u_e_sat) = match rules {
        Rules::Ours => {
            let signal = transfer.saturation_signal_dn;
            // If photons are missing as well, "not saturated" is the more useful reason.
            let no_photons = signal.value().is_some() && points.iter().any(|p| p.photons.is_none());
            let u_p_sat = if no_photons { Measured::none(Unresolved::NoPhotons) } else { signal.over(r) };
            (u_p_sat, signal.over(k))
        }
        Rules::Library => {
            let u_p_sat = library_saturation(points, at);
            (u_p_sat, u_p_sat.times(r).over(k))
        }
    };
    let snr = u_e_sat.root();
    let dr = match rules {
        // K and R are in both numbers, and their errors cancel.
        Rules::Ours => transfer.saturation_signal_dn.over(threshold_dn),
        Rules::Library => u_p_sat.over(u_p_min),
    };
    let dr = or_limit(dr);
    let db = |m: Measured| m.map(|v| 20.0 * v.log10(), |v| 20.0 / (v * std::f64::consts::LN_10));
    let bits = |m: Measured| m.map(f64::log2, |v| 1.0 / (v * std::f64::consts::LN_2));
    let inverse = |of: f64, m: Measured| m.map(|v| of / v, |v| of / (v * v));
    let per_area = |m: Measured| match basis.pixel_area_um2 {
        Some(area) => m.scale(1.0 / area),
        None => Measured::none(Unresolved::NotStated("the pixel pitch")),
    };

    // Dark current: from the mean, and from the shot noise that it makes.
    // Each figure is judged in its own unit, so that its reason holds its own number. A variance that falls over time gives no current.
    let significant = |m: Measured| if ours { m.if_above_noise() } else { m };
    let mean_slope = dark.mean.slope;
    let current = |of_variance: Measured| match of_variance.value() {
        Some(value) if value < 0.0 => of_variance.if_above_noise(),
        _ => significant(of_variance),
    };
    let linearity = transfer.linearity.as_ref();
    let too_few = Measured::none(transfer.no_linearity.unwrap_or(Unresolved::NotFinite));
    let [le_min, le_max] = match linearity {
        None => [too_few; 2],
        Some(l) if ours => l.extremes_percent.map(Measured::if_beyond_noise),
        Some(l) => [l.min_percent, l.max_percent].map(Measured::exact),
    };
    let index = |i: usize| Measured::exact(i as f64);
    let [first, last] = [transfer.range.0, transfer.range.1].map(index);
    let [first_linear, last_linear] = linearity.map_or([too_few; 2], |l| [l.range.0, l.range.1].map(index));
    let dsnu = non_uniformity(basis, k, ours);
    let raw = |of: fn(&Spatial) -> &StackVariances, f: fn(&Variances) -> f64| {
        basis.spatial.map_or(Measured::none(Unresolved::NoStack), |s| of(s).with_error(f))
    };
    let lit = |f| raw(|s| &s.flat, f);
    let unlit = |f| raw(|s| &s.dark, f);
    let (inverse_snr, stack_dark) = (inverse(100.0, snr), unlit(|s| s.temporal));
    let (u_e_min_area, u_p_min_area) = (per_area(u_e_min), per_area(u_p_min));
    let current_dn = current(dark.variance.slope.over(k));
    let current_e = current(dark.variance.slope.over(k.squared()));
    vec![
        ("DR", "sensitivity", "", "dynamic range", dr),
        ("DR_dB", "sensitivity", "dB", "dynamic range", db(dr)),
        ("DSNU1288", "spatial", "e-", "dark signal non-uniformity", dsnu.dsnu_e[0]),
        ("DSNU1288_DN", "spatial", "DN", "dark signal non-uniformity", dsnu.dsnu_dn),
        ("DSNU1288_col", "spatial", "e-", "dark signal non-uniformity of columns", dsnu.dsnu_e[2]),
        ("DSNU1288_pixel", "spatial", "e-", "dark signal non-uniformity of pixels", dsnu.dsnu_e[3]),
        ("DSNU1288_row", "spatial", "e-", "dark signal non-uniformity of rows", dsnu.dsnu_e[1]),
        ("K", "sensitivity", "DN/e-", "overall system gain", k),
        ("LE_max", "linearity", "%", "largest linearity error", le_max),
        ("LE_min", "linearity", "%", "least linearity error", le_min),
        ("PRNU1288", "spatial", "%", "photo response non-uniformity", dsnu.prnu_percent[0]),
        ("PRNU1288_col", "spatial", "%", "photo response non-uniformity of columns", dsnu.prnu_percent[2]),
        ("PRNU1288_pixel", "spatial", "%", "photo response non-uniformity of pixels", dsnu.prnu_percent[3]),
        ("PRNU1288_row", "spatial", "%", "photo response non-uniformity of rows", dsnu.prnu_percent[1]),
        ("QE", "sensitivity", "%", "quantum efficiency", r.over(k).scale(100.0)),
        ("R", "sensitivity", "DN/p", "responsivity", r),
        ("SNR_max", "sensitivity", "", "largest signal-to-noise ratio", snr),
        ("SNR_max_bit", "sensitivity", "bit", "largest signal-to-noise ratio", bits(snr)),
        ("SNR_max_dB", "sensitivity", "dB", "largest signal-to-noise ratio", db(snr)),
        ("index_linearity_max", "linearity", "", "last point of the linearity fit", last_linear),
        ("index_linearity_min", "linearity", "", "first point of the linearity fit", first_linear),
        ("index_sensitivity_max", "sensitivity", "", "last point of the sensitivity fits", last),
        ("index_sensitivity_min", "sensitivity", "", "first point of the sensitivity fits", first),
        ("index_start", "info", "", "first point", index(0)),
        ("index_u_ysat", "sensitivity", "", "point of saturation", index(at)),
        ("inverse_K", "sensitivity", "e-/DN", "inverse of the overall system gain", inverse(1.0, k)),
        ("inverse_SNR_max", "sensitivity", "%", "inverse of the largest signal-to-noise ratio", inverse_snr),
        ("s_2_y", "spatial", "DN2", "spatial variance, flat", lit(|s| s.total)),
        ("s_2_y_cav", "spatial", "DN2", "variance of column means, flat", lit(|s| s.column_means)),
        ("s_2_y_cav_dark", "spatial", "DN2", "variance of column means, dark", unlit(|s| s.column_means)),
        ("s_2_y_col", "spatial", "DN2", "spatial variance of columns, flat", lit(|s| s.column)),
        ("s_2_y_col_dark", "spatial", "DN2", "spatial variance of columns, dark", unlit(|s| s.column)),
        ("s_2_y_dark", "spatial", "DN2", "spatial variance, dark", unlit(|s| s.total)),
        ("s_2_y_measured", "spatial", "DN2", "variance of the mean frame, flat", lit(|s| s.measured)),
        ("s_2_y_measured_dark", "spatial", "DN2", "variance of the mean frame, dark", unlit(|s| s.measured)),
        ("s_2_y_pixel", "spatial", "DN2", "spatial variance of pixels, flat", lit(|s| s.pixel)),
        ("s_2_y_pixel_dark", "spatial", "DN2", "spatial variance of pixels, dark", unlit(|s| s.pixel)),
        ("s_2_y_rav", "spatial", "DN2", "variance of row means, flat", lit(|s| s.row_means)),
        ("s_2_y_rav_dark", "spatial", "DN2", "variance of row means, dark", unlit(|s| s.row_means)),
        ("s_2_y_row", "spatial", "DN2", "spatial variance of rows, flat", lit(|s| s.row)),
        ("s_2_y_row_dark", "spatial", "DN2", "spatial variance of rows, dark", unlit(|s| s.row)),
        ("sigma_2_y_stack", "spatial", "DN2", "temporal variance of the stack, flat", lit(|s| s.temporal)),
        ("sigma_2_y_stack_dark", "spatial", "DN2", "temporal variance of the stack, dark", stack_dark),
        ("sigma_d", "sensitivity", "e-", "temporal dark noise", sigma_d),
        ("sigma_y_dark", "sensitivity", "DN", "temporal dark noise", sigma_y_dark),
        ("u_I_mean", "dark_current", "e-/s", "dark current from the mean", significant(mean_slope.over(k))),
        ("u_I_mean_DN", "dark_current", "DN/s", "dark current from the mean", significant(mean_slope)),
        ("u_I_var", "dark_current", "e-/s", "dark current from the variance", current_e),
        ("u_I_var_DN", "dark_current", "DN/s", "dark current from the variance", current_dn),
        ("u_e_min", "sensitivity", "e-", "absolute sensitivity threshold", u_e_min),
        ("u_e_min_area", "sensitivity", "e-/um2", "absolute sensitivity threshold per area", u_e_min_area),
        ("u_e_sat", "sensitivity", "e-", "saturation capacity", u_e_sat),
        ("u_e_sat_area", "sensitivity", "e-/um2", "saturation capacity per area", per_area(u_e_sat)),
        ("u_p_min", "sensitivity", "p", "absolute sensitivity threshold", u_p_min),
        ("u_p_min_area", "sensitivity", "p/um2", "absolute sensitivity threshold per area", u_p_min_area),
        ("u_p_sat", "sensitivity", "p", "saturation capacity", u_p_sat),
        ("u_p_sat_area", "sensitivity", "p/um2", "saturation capacity per area", per_area(u_p_sat)),
    ]
}

/// Photons of the point of the largest noise. The true peak lies anywhere in the step beyond it; a uniform number from 0 to
/// one step has the root mean square `step / sqrt(3)`, which is the error.
fn library_saturation(points: &[TransferPoint], at: usize) -> Measured {
    let Some(photons) = points.iter().map(|p| p.photons).collect::<Option<Vec<f64>>>() else {
        return Measured::none(Unresolved::NoPhotons);
    };
    let step = photons.get(at + 1).map_or(f64::NAN, |next| next - photons[at]);
    Measured::new(photons[at], step / 3.0_f64.sqrt())
}

/// DSNU and PRNU: total, row, column, pixel.
struct NonUniformityFigures {
    dsnu_e: [Measured; 4],
    dsnu_dn: Measured,
    prnu_percent: [Measured; 4],
}

fn non_uniformity(basis: &Basis<'_>, k: Measured, ours: bool) -> NonUniformityFigures {
    let Some(s) = basis.spatial else {
        let none = Measured::none(Unresolved::NoStack);
        return NonUniformityFigures { dsnu_e: [none; 4], dsnu_dn: none, prnu_percent: [none; 4] };
    };
    let plain = |v: &StackVariances| {
        [
            v.with_error(|v| v.total),
            v.with_error(|v| v.row),
            v.with_error(|v| v.column),
            v.with_error(|v| v.pixel),
        ]
    };
    let (dark, light) = if ours {
        let dark = &s.dark_components;
        let light = of_light(&s.flat_components, dark, s.shared);
        ([dark.total, dark.row, dark.column, dark.pixel], light)
    } else {
        let (dark, flat) = (plain(&s.dark), plain(&s.flat));
        (dark, std::array::from_fn(|i| flat[i].minus(dark[i])))
    };
    let root = |m: Measured| if ours { without_filter(basis, m.if_above_noise().root()) } else { m.root() };
    let signal_dn = s.flat.mean_dn - s.dark.mean_dn;
    let percent = |m: Measured| m.map(|v| 100.0 * v / signal_dn, |_| 100.0 / signal_dn);
    NonUniformityFigures {
        dsnu_e: std::array::from_fn(|i| root(dark[i]).over(k)),
        dsnu_dn: root(dark[0]),
        prnu_percent: std::array::from_fn(|i| percent(root(light[i]))),
    }
}

/// A spread of pixels. A filter of the frames in the camera takes as much of it as of the noise, which is an error, or withdraws it.
fn without_filter(basis: &Basis<'_>, spread: Measured) -> Measured {
    match basis.ours.shared_noise.filter(|shared| shared.is_spatial()) {
        None => spread,
        Some(shared) if shared.is_far() => Measured::none(Unresolved::SharedNoise),
        Some(shared) => spread.with_error(0.5 * shared.missing_share() * spread.value().unwrap_or(0.0)),
    }
}

/// The spatial variances that light adds to those of the dark: total, row, column, pixel. `shared` is the share of their scatter over specimens that
/// cancels in the difference.
pub fn of_light(flat: &Components, dark: &Components, shared: SharedScatter) -> [Measured; 4] {
    let parts = |c: &Components| [c.total, c.row, c.column, c.pixel];
    let (flat, dark) = (parts(flat), parts(dark));
    let product = |i: usize| flat[i].error_or_zero() * dark[i].error_or_zero();
    let [row, column, pixel] =
        [shared.row * product(1), shared.column * product(2), shared.pixel * product(3)];
    let covariances = [row + column + pixel, row, column, pixel];
    std::array::from_fn(|i| match flat[i].minus(dark[i]) {
        Measured::Value { value, standard_error: Some(error) } => {
            Measured::new(value, (error * error - 2.0 * covariances[i]).max(0.0).sqrt())
        }
        other => other,
    })
}
