//! The figures of EMVA 1288 under the computer names of the EMVA 1288 Python library, each as the library derives it and,
//! where ours differs, the corrected value beside it.

use serde::Serialize;

use super::dark::{DarkPoint, DarkSeries, dark_series};
use super::measured::{Measured, Unresolved};
use super::plane_moments::SharedScatter;
pub use super::rounding::QUANTISATION_DN2;
use super::rounding::{LEAST_DARK_VARIANCE_DN2, RoundingError};
use super::spatial::{Components, Spatial, StackVariances, Variances};
use super::transfer::PhotonTransfer;
use super::transfer_point::{Rules, TransferPoint};

/// One figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    let same = |a: &Measured, b: &Measured| match (a.value(), b.value()) {
        (Some(x), Some(y)) => (x - y).abs() <= 1e-12 * x.abs(),
        (None, None) => a.reason() == b.reason(),
        _ => false,
    };
    NAMES
        .iter()
        .zip(library.into_iter().zip(ours))
        .map(|((name, section, unit, meaning), (library, ours))| {
            // Where both agree, keep our number, because it has a standard error.
            let (value, corrected) = if same(&library, &ours) { (ours, None) } else { (library, Some(ours)) };
            Figure { name, section, meaning, unit, value, corrected }
        })
        .collect()
}

/// Name, section, unit, meaning; in the order of [`values`].
const NAMES: [(&str, &str, &str, &str); 57] = [
    ("DR", "sensitivity", "", "dynamic range"),
    ("DR_dB", "sensitivity", "dB", "dynamic range"),
    ("DSNU1288", "spatial", "e-", "dark signal non-uniformity"),
    ("DSNU1288_DN", "spatial", "DN", "dark signal non-uniformity"),
    ("DSNU1288_col", "spatial", "e-", "dark signal non-uniformity of columns"),
    ("DSNU1288_pixel", "spatial", "e-", "dark signal non-uniformity of pixels"),
    ("DSNU1288_row", "spatial", "e-", "dark signal non-uniformity of rows"),
    ("K", "sensitivity", "DN/e-", "overall system gain"),
    ("LE_max", "linearity", "%", "largest linearity error"),
    ("LE_min", "linearity", "%", "least linearity error"),
    ("PRNU1288", "spatial", "%", "photo response non-uniformity"),
    ("PRNU1288_col", "spatial", "%", "photo response non-uniformity of columns"),
    ("PRNU1288_pixel", "spatial", "%", "photo response non-uniformity of pixels"),
    ("PRNU1288_row", "spatial", "%", "photo response non-uniformity of rows"),
    ("QE", "sensitivity", "%", "quantum efficiency"),
    ("R", "sensitivity", "DN/p", "responsivity"),
    ("SNR_max", "sensitivity", "", "largest signal-to-noise ratio"),
    ("SNR_max_bit", "sensitivity", "bit", "largest signal-to-noise ratio"),
    ("SNR_max_dB", "sensitivity", "dB", "largest signal-to-noise ratio"),
    ("index_linearity_max", "linearity", "", "last point of the linearity fit"),
    ("index_linearity_min", "linearity", "", "first point of the linearity fit"),
    ("index_sensitivity_max", "sensitivity", "", "last point of the sensitivity fits"),
    ("index_sensitivity_min", "sensitivity", "", "first point of the sensitivity fits"),
    ("index_start", "info", "", "first point"),
    ("index_u_ysat", "sensitivity", "", "point of saturation"),
    ("inverse_K", "sensitivity", "e-/DN", "inverse of the overall system gain"),
    ("inverse_SNR_max", "sensitivity", "%", "inverse of the largest signal-to-noise ratio"),
    ("s_2_y", "spatial", "DN2", "spatial variance, flat"),
    ("s_2_y_cav", "spatial", "DN2", "variance of column means, flat"),
    ("s_2_y_cav_dark", "spatial", "DN2", "variance of column means, dark"),
    ("s_2_y_col", "spatial", "DN2", "spatial variance of columns, flat"),
    ("s_2_y_col_dark", "spatial", "DN2", "spatial variance of columns, dark"),
    ("s_2_y_dark", "spatial", "DN2", "spatial variance, dark"),
    ("s_2_y_measured", "spatial", "DN2", "variance of the mean frame, flat"),
    ("s_2_y_measured_dark", "spatial", "DN2", "variance of the mean frame, dark"),
    ("s_2_y_pixel", "spatial", "DN2", "spatial variance of pixels, flat"),
    ("s_2_y_pixel_dark", "spatial", "DN2", "spatial variance of pixels, dark"),
    ("s_2_y_rav", "spatial", "DN2", "variance of row means, flat"),
    ("s_2_y_rav_dark", "spatial", "DN2", "variance of row means, dark"),
    ("s_2_y_row", "spatial", "DN2", "spatial variance of rows, flat"),
    ("s_2_y_row_dark", "spatial", "DN2", "spatial variance of rows, dark"),
    ("sigma_2_y_stack", "spatial", "DN2", "temporal variance of the stack, flat"),
    ("sigma_2_y_stack_dark", "spatial", "DN2", "temporal variance of the stack, dark"),
    ("sigma_d", "sensitivity", "e-", "temporal dark noise"),
    ("sigma_y_dark", "sensitivity", "DN", "temporal dark noise"),
    ("u_I_mean", "dark_current", "e-/s", "dark current from the mean"),
    ("u_I_mean_DN", "dark_current", "DN/s", "dark current from the mean"),
    ("u_I_var", "dark_current", "e-/s", "dark current from the variance"),
    ("u_I_var_DN", "dark_current", "DN/s", "dark current from the variance"),
    ("u_e_min", "sensitivity", "e-", "absolute sensitivity threshold"),
    ("u_e_min_area", "sensitivity", "e-/um2", "absolute sensitivity threshold per area"),
    ("u_e_sat", "sensitivity", "e-", "saturation capacity"),
    ("u_e_sat_area", "sensitivity", "e-/um2", "saturation capacity per area"),
    ("u_p_min", "sensitivity", "p", "absolute sensitivity threshold"),
    ("u_p_min_area", "sensitivity", "p/um2", "absolute sensitivity threshold per area"),
    ("u_p_sat", "sensitivity", "p", "saturation capacity"),
    ("u_p_sat_area", "sensitivity", "p/um2", "saturation capacity per area"),
];

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
        })
        .collect();
    dark_series(all)
}

fn values(basis: &Basis<'_>, rules: Rules) -> Vec<Measured> {
    let ours = rules == Rules::Ours;
    let transfer = if ours { basis.ours } else { basis.library };
    let points = basis.points;
    let (k, r) = (transfer.gain_dn_per_e, transfer.responsivity_dn);
    let dark = if ours { basis.dark } else { &dark_of(points) };

    // Dark noise: the intercept over exposure time, or the value at the only exposure time.
    let first = &points[0];
    let dark_variance = match dark.variance.intercept.value() {
        Some(_) => dark.variance.intercept,
        None => {
            let rounding = RoundingError::of(first.dark_variance_dn2);
            Measured::new(first.dark_variance_dn2, first.dark_variance_se_dn2)
                .with_error(rounding.variance_dn2)
        }
    };
    // Dark variance below what a converter of whole numbers resolves is set to that limit, as the standard does. A limit has no
    // error.
    let is_limit = dark_variance.value().is_some_and(|v| v <= LEAST_DARK_VARIANCE_DN2);
    let or_limit = |m: Measured| if is_limit { m.limit() } else { m };
    let dark_variance = or_limit(dark_variance.map(|v| v.max(LEAST_DARK_VARIANCE_DN2), |_| 1.0));
    let sigma_y_dark = dark_variance.root();
    let sigma_d = or_limit(dark_variance.map(|v| v - QUANTISATION_DN2, |_| 1.0).root().over(k));

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
    let per_area = |m: Measured| match basis.pixel_area_um2 {
        Some(area) => m.scale(1.0 / area),
        None => Measured::none(Unresolved::NotStated("the pixel pitch")),
    };

    // Dark current: from the mean, and from the shot noise that it makes.
    let significant = |m: Measured| if ours { m.if_above_noise() } else { m };
    let mean_slope = significant(dark.mean.slope);
    let variance_slope = significant(match dark.variance.slope.value() {
        Some(slope) if slope < 0.0 => Measured::none(Unresolved::NegativeVariance(slope)),
        _ => dark.variance.slope,
    });
    let linearity = transfer.linearity.as_ref();
    let too_few = Measured::none(transfer.no_linearity.unwrap_or(Unresolved::NotFinite));
    let [le_min, le_max] = match linearity {
        None => [too_few; 2],
        Some(l) if ours => l.response_percent,
        Some(l) => [l.min_percent, l.max_percent].map(Measured::exact),
    };
    let index = |i: Option<usize>| i.map_or(too_few, |i| Measured::exact(i as f64));
    let dsnu = non_uniformity(basis, k, ours);
    let raw = |f: fn(&Variances) -> f64, dark: bool| match basis.spatial {
        Some(s) => (if dark { &s.dark } else { &s.flat }).with_error(f),
        None => Measured::none(Unresolved::NoStack),
    };
    vec![
        dr,
        db(dr),
        dsnu.dsnu_e[0],
        dsnu.dsnu_dn,
        dsnu.dsnu_e[2],
        dsnu.dsnu_e[3],
        dsnu.dsnu_e[1],
        k,
        le_max,
        le_min,
        dsnu.prnu_percent[0],
        dsnu.prnu_percent[2],
        dsnu.prnu_percent[3],
        dsnu.prnu_percent[1],
        r.over(k).scale(100.0),
        r,
        snr,
        snr.map(f64::log2, |v| 1.0 / (v * std::f64::consts::LN_2)),
        db(snr),
        index(linearity.map(|l| l.range.1)),
        index(linearity.map(|l| l.range.0)),
        Measured::exact(transfer.range.1 as f64),
        Measured::exact(transfer.range.0 as f64),
        Measured::exact(0.0),
        Measured::exact(at as f64),
        k.map(|v| 1.0 / v, |v| 1.0 / (v * v)),
        snr.map(|v| 100.0 / v, |v| 100.0 / (v * v)),
        raw(|s| s.total, false),
        raw(|s| s.column_means, false),
        raw(|s| s.column_means, true),
        raw(|s| s.column, false),
        raw(|s| s.column, true),
        raw(|s| s.total, true),
        raw(|s| s.measured, false),
        raw(|s| s.measured, true),
        raw(|s| s.pixel, false),
        raw(|s| s.pixel, true),
        raw(|s| s.row_means, false),
        raw(|s| s.row_means, true),
        raw(|s| s.row, false),
        raw(|s| s.row, true),
        raw(|s| s.temporal, false),
        raw(|s| s.temporal, true),
        sigma_d,
        sigma_y_dark,
        mean_slope.over(k),
        mean_slope,
        variance_slope.over(k.squared()),
        variance_slope.over(k),
        u_e_min,
        per_area(u_e_min),
        u_e_sat,
        per_area(u_e_sat),
        u_p_min,
        per_area(u_p_min),
        u_p_sat,
        per_area(u_p_sat),
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
    let root = |m: Measured| if ours { m.if_above_noise().root() } else { m.root() };
    let signal_dn = s.flat.mean_dn - s.dark.mean_dn;
    let percent = |m: Measured| m.map(|v| 100.0 * v / signal_dn, |_| 100.0 / signal_dn);
    NonUniformityFigures {
        dsnu_e: std::array::from_fn(|i| root(dark[i]).over(k)),
        dsnu_dn: root(dark[0]),
        prnu_percent: std::array::from_fn(|i| percent(root(light[i]))),
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
