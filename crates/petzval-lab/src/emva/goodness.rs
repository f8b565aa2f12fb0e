//! Whether the points of a fit lie on its model, by two tests of stated level: chi-squared, and a quadratic term.
//!
//! For points `y` of the covariance `S` and a model of powers of `x`, `A b`, generalised least squares minimise
//! `chi2 = (y - A b)^T S^-1 (y - A b)`. If the model holds, `chi2` has the chi-squared distribution of `points - coefficients` degrees of
//! freedom, and the coefficient of a further quadratic term over its standard error is normal. Where the points scatter by more
//! than `S` says around the bent line as well, that coefficient follows Student's distribution with their scatter for its error.
//!
//! A fit that fails either test at [`ALPHA`] does not describe its points, and an error of noise alone would be too small. The
//! [`Departure`] is what to add: the change of the slope that the quadratic term makes at `x = 0`, and the error of noise as many times as
//! the points scatter more than noise does (Birge 1932), for few degrees of freedom more.
//!
//! With one or two degrees of freedom that scatter is hardly known, and Student's distribution lets nearly every curvature pass for chance.
//! So a response over the light that fails its test may bend, see [`bend`].

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use schemars::JsonSchema;
use serde::Serialize;

/// Level of each test: a model that holds fails one in ten thousand.
pub const ALPHA: f64 = 1e-4;

/// What follows from the tests of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// There are no more points than coefficients.
    Untested,
    /// The points lie on the model within their errors.
    Holds,
    /// They do not: the stated errors contain by how much.
    Widened,
    /// They do not, and by how much is what the figure states.
    Stated,
    /// They are so far off that the figure is withdrawn.
    Withdrawn,
}

impl Verdict {
    /// The verdict in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Untested => "not tested",
            Self::Holds => "holds",
            Self::Widened => "departs; errors widened",
            Self::Stated => "departs; the figure states by how much",
            Self::Withdrawn => "departs; withdrawn",
        }
    }
}

/// Test of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct FitTest {
    /// Points of the fit.
    pub points: usize,
    /// Points less coefficients.
    pub degrees_of_freedom: usize,
    /// Chi-squared over the degrees of freedom; 0 if there are none.
    pub reduced_chi2: f64,
    /// Probability of at least this chi-squared if the model holds.
    pub p_value: f64,
    /// Quadratic term over its standard error; `None` with too few points.
    pub curvature_sigmas: Option<f64>,
    /// Probability of at least this curvature if the model holds.
    pub curvature_p_value: Option<f64>,
    /// Level of the tests.
    pub alpha: f64,
    /// What follows.
    pub verdict: Verdict,
    /// Standard error that the departure from the model adds to the slope, in its unit; 0 if the model holds.
    pub model_error: f64,
}

impl FitTest {
    /// A fit that is not tested yet.
    pub fn untested(points: usize, degrees_of_freedom: usize) -> Self {
        Self {
            points,
            degrees_of_freedom,
            reduced_chi2: 0.0,
            p_value: 1.0,
            curvature_sigmas: None,
            curvature_p_value: None,
            alpha: ALPHA,
            verdict: Verdict::Untested,
            model_error: 0.0,
        }
    }
}

/// What a departure from the model adds to the errors of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Departure {
    /// Factor on the errors of noise.
    pub scatter: f64,
    /// Changes of the coefficients, in their order, by a quadratic term; zero if none is significant.
    pub bend: [f64; 2],
}

impl Departure {
    /// None: the model holds.
    pub const NONE: Self = Self { scatter: 1.0, bend: [0.0; 2] };

    /// Standard error to add in quadrature to one of noise alone, for a coefficient.
    pub fn error(&self, coefficient: usize, of_noise: f64) -> f64 {
        (of_noise * (self.scatter * self.scatter - 1.0).max(0.0).sqrt()).hypot(self.bend[coefficient])
    }
}

/// The model of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// `y = b x`.
    ThroughOrigin,
    /// `y = a + b x`: coefficients `a`, `b`.
    Line,
    /// `y = a`.
    Constant,
}

impl Model {
    fn powers(self) -> &'static [i32] {
        match self {
            Self::ThroughOrigin => &[1],
            Self::Line => &[0, 1],
            Self::Constant => &[0],
        }
    }

    fn bent(self) -> Option<&'static [i32]> {
        match self {
            Self::ThroughOrigin => Some(&[1, 2]),
            Self::Line => Some(&[0, 1, 2]),
            Self::Constant => None,
        }
    }
}

/// Points of a fit with their errors.
#[derive(Debug, Clone)]
pub struct Points {
    /// Abscissae, without error.
    pub x: Vec<f64>,
    /// Ordinates.
    pub y: Vec<f64>,
    /// Standard errors of the ordinates that each point has alone.
    pub own_se: Vec<f64>,
    /// Errors that points share: each moves all points by these amounts together, in standard errors.
    pub shared: Vec<Vec<f64>>,
}

impl Points {
    /// Points with independent errors. Points without an error are left out.
    pub fn independent(x: &[f64], y: &[f64], se: &[f64]) -> Self {
        let usable: Vec<usize> = (0..x.len()).filter(|i| se[*i] > 0.0).collect();
        let of = |values: &[f64]| usable.iter().map(|i| values[*i]).collect();
        Self { x: of(x), y: of(y), own_se: of(se), shared: Vec::new() }
    }

    fn covariance(&self, i: usize, j: usize) -> f64 {
        let shared = self.shared.iter().map(|s| s[i] * s[j]).sum::<f64>();
        shared + if i == j { self.own_se[i].powi(2) } else { 0.0 }
    }

    /// One draw of the errors of the ordinates.
    pub fn draw(&self, rng: &mut impl rand::Rng) -> Vec<f64> {
        let mut one = || -> f64 { StandardNormal.sample(rng) };
        let mut errors: Vec<f64> = self.own_se.iter().map(|s| s * one()).collect();
        for shared in &self.shared {
            let common = one();
            errors.iter_mut().zip(shared).for_each(|(e, s)| *e += s * common);
        }
        errors
    }

    /// Standard error of `sum(weights * y)`.
    pub fn error_of(&self, weights: &[f64]) -> f64 {
        let dot = |s: &[f64]| weights.iter().zip(s).map(|(w, s)| w * s).sum::<f64>();
        let own: f64 = weights.iter().zip(&self.own_se).map(|(w, s)| (w * s).powi(2)).sum();
        (own + self.shared.iter().map(|s| dot(s).powi(2)).sum::<f64>()).sqrt()
    }
}

/// A generalised least-squares fit.
struct Fitted {
    coefficients: DVector<f64>,
    covariance: DMatrix<f64>,
    chi2: f64,
}

impl Fitted {
    /// How far points scatter over their errors; `None` where these explain it.
    fn scatter(&self, degrees: usize) -> Option<f64> {
        let is_beyond = degrees > 0 && chi2_beyond(self.chi2, degrees) < ALPHA;
        is_beyond.then(|| (self.chi2 / degrees as f64).sqrt())
    }
}

/// Abscissae that differ by less than this share of the largest are one.
const SAME_PLACE: f64 = 1e-6;

/// Number of different abscissae.
pub fn places(x: &[f64]) -> usize {
    let scale = x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let mut places = x.to_vec();
    places.sort_by(f64::total_cmp);
    places.dedup_by(|a, b| (*a - *b).abs() <= SAME_PLACE * scale);
    places.len()
}

/// Fits powers of `x`; `None` without enough points, or if they do not determine the coefficients.
fn fit(points: &Points, powers: &[i32]) -> Option<Fitted> {
    let n = points.x.len();
    let scale = points.x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    if places(&points.x) < powers.len() || scale <= 0.0 {
        return None;
    }
    // Whiten the points by the Cholesky factor of their covariance, each first scaled by its own error.
    let size: Vec<f64> = (0..n).map(|i| points.covariance(i, i).sqrt()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| points.covariance(i, j) / (size[i] * size[j]));
    let factor = scaled.cholesky()?.unpack();
    let design = DMatrix::from_fn(n, powers.len(), |i, k| (points.x[i] / scale).powi(powers[k]) / size[i]);
    let y = DVector::from_fn(n, |i, _| points.y[i] / size[i]);
    let (design, y) = (factor.solve_lower_triangular(&design)?, factor.solve_lower_triangular(&y)?);
    let normal = design.tr_mul(&design);
    let inverse = normal.cholesky().map(|c| c.inverse())?;
    let found = &inverse * design.tr_mul(&y);
    let chi2 = (&y - &design * &found).norm_squared();
    if !chi2.is_finite() {
        return None;
    }
    let unit = |k: usize| scale.powi(-powers[k]);
    Some(Fitted {
        coefficients: DVector::from_fn(powers.len(), |k, _| found[k] * unit(k)),
        covariance: DMatrix::from_fn(powers.len(), powers.len(), |i, j| inverse[(i, j)] * unit(i) * unit(j)),
        chi2,
    })
}

/// A quadratic term that points show beyond a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// Coefficients of `y = a + b x + c x^2`; `a` is zero for a model through the origin.
    pub coefficients: [f64; 3],
    /// Their change where the quadratic one is larger by its standard error, which contains how the points scatter.
    pub step: [f64; 3],
    /// Whether the quadratic term is significant at [`ALPHA`], and there are more abscissae than coefficients: without them, points that scatter look
    /// the same.
    pub is_certain: bool,
}

impl Bend {
    /// The coefficients with a quadratic one that differs by so many standard errors.
    pub fn off_by(&self, sigmas: f64) -> Self {
        let coefficients = [0, 1, 2].map(|k| self.coefficients[k] + sigmas * self.step[k]);
        Self { coefficients, ..*self }
    }
}

/// The quadratic term of points, if it is significant, or if they depart from a model: what makes them scatter may hide a bend. `None` if the
/// model holds, has no bent form, or the points do not determine that form.
pub fn bend(points: &Points, model: Model) -> Option<Bend> {
    let powers = model.bent()?;
    let bent = fit(points, powers)?;
    let degrees = points.x.len() - powers.len();
    let (_, p) = curvature(&bent, degrees);
    let is_significant = p < ALPHA;
    let departs = || {
        let straight = fit(points, model.powers());
        straight.is_some_and(|straight| chi2_beyond(straight.chi2, degrees + 1) < ALPHA)
    };
    (is_significant || departs()).then(|| {
        let (first, last) = (3 - powers.len(), powers.len() - 1);
        let mut coefficients = [0.0; 3];
        coefficients[first..].copy_from_slice(bent.coefficients.as_slice());
        let scatter = bent.scatter(degrees).unwrap_or(1.0);
        let mut step = [0.0; 3];
        for k in 0..powers.len() {
            step[first + k] = scatter * bent.covariance[(k, last)] / bent.covariance[(last, last)].sqrt();
        }
        Bend { coefficients, step, is_certain: is_significant && places(&points.x) > powers.len() }
    })
}

/// Slope at zero, and its standard error, of `y = b x + c x^2`; `None` if the points do not determine both terms.
pub fn slope_at_zero(points: &Points) -> Option<[f64; 2]> {
    let bent = fit(points, &[1, 2])?;
    Some([bent.coefficients[0], bent.covariance[(0, 0)].sqrt()])
}

/// The last coefficient over its standard error, and the probability of as much by chance. Points that scatter by more than their errors
/// have the error of their scatter.
fn curvature(bent: &Fitted, degrees: usize) -> (f64, f64) {
    let last = bent.coefficients.len() - 1;
    let sigmas = bent.coefficients[last] / bent.covariance[(last, last)].sqrt();
    match bent.scatter(degrees) {
        Some(scatter) => {
            let sigmas = sigmas / scatter;
            (sigmas, student_beyond(sigmas, degrees))
        }
        None => (sigmas, normal_beyond(sigmas)),
    }
}

/// Tests a fit of these points whose coefficients came out as `found`, in the order of [`Model`].
pub fn test(points: &Points, model: Model, found: &[f64]) -> (FitTest, Departure) {
    let n = points.x.len();
    let mut test = FitTest::untested(n, n.saturating_sub(model.powers().len()));
    let Some(straight) = fit(points, model.powers()).filter(|_| test.degrees_of_freedom > 0) else {
        return (test, Departure::NONE);
    };
    let degrees = test.degrees_of_freedom;
    test.reduced_chi2 = straight.chi2 / degrees as f64;
    test.p_value = chi2_beyond(straight.chi2, degrees);
    let bent = model.bent().and_then(|powers| fit(points, powers)).map(|bent| {
        let (sigmas, p) = curvature(&bent, degrees - 1);
        (test.curvature_sigmas, test.curvature_p_value) = (Some(sigmas), Some(p));
        (bent, p)
    });
    let is_bent = bent.as_ref().filter(|(_, p)| *p < ALPHA).map(|(bent, _)| bent);
    if test.p_value >= ALPHA && is_bent.is_none() {
        test.verdict = Verdict::Holds;
        return (test, Departure::NONE);
    }
    // Points scatter about the bent line if there is one, else about the straight one.
    test.verdict = Verdict::Widened;
    let mut departure = Departure::NONE;
    let (chi2, left) = match is_bent {
        Some(bent) => (bent.chi2, degrees - 1),
        None => (straight.chi2, degrees),
    };
    if left > 0 && chi2_beyond(chi2, left) < ALPHA {
        departure.scatter = (chi2 / left as f64).sqrt() * of_few(left);
    }
    if let Some(bent) = is_bent {
        let bends = found.iter().zip(bent.coefficients.iter()).zip(&mut departure.bend);
        bends.for_each(|((a, b), bend)| *bend = b - a);
    }
    (test, departure)
}

/// By how much the interval of one standard error of Student's distribution is wider than that of the normal one: 1.84, 1.32, 1.20, 1.14.
pub fn of_few(degrees: usize) -> f64 {
    1.0 + 0.84 / (degrees as f64).powf(1.3)
}

/// Degrees of freedom beyond which the closed forms lose their digits.
const MANY_DEGREES: usize = 200;

/// Probability of more than `chi2` at a number of degrees of freedom. Closed forms of Abramowitz and Stegun 26.4.4 and 26.4.5.
pub fn chi2_beyond(chi2: f64, degrees: usize) -> f64 {
    if degrees == 0 || chi2.is_nan() || chi2 <= 0.0 {
        return 1.0;
    }
    // Many degrees: by the cube root, which is nearly normal (Wilson and Hilferty 1931).
    let n = degrees as f64;
    if degrees > MANY_DEGREES {
        let sigmas = ((chi2 / n).cbrt() - 1.0 + 2.0 / (9.0 * n)) / (2.0 / (9.0 * n)).sqrt();
        return 0.5 * libm::erfc(sigmas * std::f64::consts::FRAC_1_SQRT_2);
    }
    // Terms (chi2/2)^k / k! for whole k, or for k = 1/2, 3/2 and so on.
    let half = 0.5 * chi2;
    let is_odd = degrees % 2 == 1;
    let (mut term, mut sum, mut k) = if is_odd {
        ((-half).exp() * 2.0 * (half / std::f64::consts::PI).sqrt(), libm::erfc(half.sqrt()), 1.5)
    } else {
        ((-half).exp(), 0.0, 1.0)
    };
    for _ in 0..degrees / 2 {
        sum += term;
        term *= half / k;
        k += 1.0;
    }
    sum.min(1.0)
}

/// Probability of a normal number beyond `sigmas` on either side.
fn normal_beyond(sigmas: f64) -> f64 {
    libm::erfc(sigmas.abs() * std::f64::consts::FRAC_1_SQRT_2)
}

/// Probability of a number of Student's distribution beyond `t` on either side. Abramowitz and Stegun 26.7.3 and 26.7.4.
fn student_beyond(t: f64, degrees: usize) -> f64 {
    let angle = (t.abs() / (degrees as f64).sqrt()).atan();
    let (sine, cosine) = angle.sin_cos();
    let is_odd = degrees % 2 == 1;
    let (mut term, mut sum) = if is_odd { (cosine, 0.0) } else { (1.0, 0.0) };
    let mut k = if is_odd { 1 } else { 0 };
    while k + 2 <= degrees {
        sum += term;
        term *= cosine * cosine * (k + 1) as f64 / (k + 2) as f64;
        k += 2;
    }
    let within = if is_odd { 2.0 / std::f64::consts::PI * (angle + sine * sum) } else { sine * sum };
    (1.0 - within).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_those_of_the_tables() {
        // Abramowitz and Stegun, table 26.8 (chi-squared at 0.05 and 0.001) and table 26.10 (Student at 0.05 and 0.01, both sides).
        for (degrees, chi2, p) in [
            (1, 3.84146, 0.05),
            (2, 5.99146, 0.05),
            (3, 7.81473, 0.05),
            (4, 9.48773, 0.05),
            (5, 11.0705, 0.05),
            (10, 18.307, 0.05),
            (30, 43.773, 0.05),
            (1, 10.828, 0.001),
            (7, 24.322, 0.001),
            (20, 45.315, 0.001),
        ] {
            let found = chi2_beyond(chi2, degrees);
            assert!((found / p - 1.0).abs() < 1e-3, "{degrees}: {found} instead of {p}");
        }
        for (degrees, t, p) in [
            (1, 12.706, 0.05),
            (2, 4.303, 0.05),
            (3, 3.182, 0.05),
            (4, 2.776, 0.05),
            (5, 4.032, 0.01),
            (10, 3.169, 0.01),
        ] {
            let found = student_beyond(t, degrees);
            assert!((found / p - 1.0).abs() < 2e-3, "{degrees}: {found} instead of {p}");
        }
        assert!((normal_beyond(1.959_964) - 0.05).abs() < 1e-6);
        // Beyond the closed forms, the two ways agree.
        let (exact, near) = (chi2_beyond(260.0, 200), chi2_beyond(261.2, 201));
        assert!((exact / near - 1.0).abs() < 0.02, "{exact} {near}");
        assert!(chi2_beyond(2e4, 3) < 1e-300 && chi2_beyond(0.0, 3) == 1.0);
    }

    #[test]
    fn a_shared_error_is_no_departure_and_curvature_is_one() {
        let x: Vec<f64> = (1..=6).map(f64::from).collect();
        // All points are 5 too high together, by an error of 3 that they share and one of 0.1 that they do not.
        let points = Points {
            y: x.iter().map(|x| 2.0 * x + 5.0).collect(),
            own_se: vec![0.1; 6],
            shared: vec![vec![3.0; 6]],
            x: x.clone(),
        };
        let (found, departure) = test(&points, Model::ThroughOrigin, &[2.0]);
        assert!(found.verdict == Verdict::Holds && departure == Departure::NONE, "{found:?}");
        let alone = Points { shared: Vec::new(), ..points.clone() };
        assert_eq!(test(&alone, Model::ThroughOrigin, &[2.0]).0.verdict, Verdict::Widened);

        // y = 2 x - 0.05 x^2: the bend is what the slope at zero differs by.
        let bent = Points::independent(
            &x,
            &x.iter().map(|x| 2.0 * x - 0.05 * x * x).collect::<Vec<_>>(),
            &[0.01; 6],
        );
        let (found, departure) = test(&bent, Model::ThroughOrigin, &[1.77]);
        assert!(found.curvature_sigmas.unwrap() < -20.0, "{found:?}");
        assert!((departure.bend[0] - 0.23).abs() < 1e-9 && departure.scatter == 1.0, "{departure:?}");
        let found = bend(&bent, Model::Line).unwrap();
        assert!((found.coefficients[2] + 0.05).abs() < 1e-9 && found.is_certain, "{found:?}");
        assert_eq!(bend(&points, Model::Line), None);
        assert!((departure.error(0, 0.01) - 0.23).abs() < 1e-9);
    }

    #[test]
    fn few_points_that_depart_may_bend() {
        let of = |y: &[f64], se: f64| {
            let x: Vec<f64> = (1..=y.len()).map(|x| x as f64).collect();
            Points::independent(&x, y, &vec![se; y.len()])
        };
        // y = x - 0.004 x^3: a quadratic leaves a scatter of 0.0054 and one degree of freedom, at first within the errors.
        let cubic = [0.996, 1.968, 2.892, 3.744];
        let found = bend(&of(&cubic, 0.01), Model::Line).unwrap();
        assert!(found.is_certain, "{found:?}");
        // Beyond the errors it is the scatter of the points, and Student's distribution excludes nothing.
        let far = of(&cubic, 0.001);
        let found = bend(&far, Model::Line).unwrap();
        assert!(!found.is_certain, "{found:?}");
        assert_eq!(test(&far, Model::Line, &[0.0, 1.0]).1.bend, [0.0; 2]);
        // Two points determine a bend through the origin, which nothing confirms.
        let two = of(&[0.98, 1.92], 0.001);
        let found = bend(&two, Model::ThroughOrigin).unwrap();
        assert!(!found.is_certain, "{found:?}");
        assert!((found.coefficients[1] - 1.0).abs() < 1e-9 && found.coefficients[0] == 0.0, "{found:?}");
        assert_eq!(bend(&two, Model::Line), None);
        assert_eq!(bend(&of(&[1.0, 2.0], 0.001), Model::ThroughOrigin), None);
        let [slope, error] = slope_at_zero(&two).unwrap();
        assert!((slope - 1.0).abs() < 1e-9, "{slope}");
        assert!((error - 0.001 * 4.25_f64.sqrt()).abs() < 1e-9, "{error}");
    }

    #[test]
    fn scatter_widens_and_is_no_curvature() {
        let x: Vec<f64> = (1..=8).map(f64::from).collect();
        let off = [1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0];
        let y: Vec<f64> = x.iter().zip(off).map(|(x, off)| 2.0 * x + 0.1 * off).collect();
        let (found, departure) = test(&Points::independent(&x, &y, &[0.01; 8]), Model::Line, &[0.0, 2.0]);
        assert!(found.verdict == Verdict::Widened && found.reduced_chi2 > 50.0, "{found:?}");
        assert!(departure.scatter > 8.0 && departure.bend == [0.0; 2], "{departure:?}");
        let few = Points::independent(&x[..2], &y[..2], &[0.01; 2]);
        assert_eq!(test(&few, Model::Line, &[0.0, 2.0]).0.verdict, Verdict::Untested);
    }

    #[test]
    fn a_model_that_holds_fails_as_often_as_the_level_says() {
        use rand::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let x: Vec<f64> = (1..=7).map(f64::from).collect();
        let (mut of_chi2, mut of_curvature) = (Vec::new(), Vec::new());
        for _ in 0..2000 {
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let common = normal();
            let y = x.iter().map(|x| 1.0 + 2.0 * x + 0.1 * x * normal() + common).collect();
            let own_se = x.iter().map(|x| 0.1 * x).collect();
            let points = Points { x: x.clone(), y, own_se, shared: vec![vec![1.0; 7]] };
            let (found, _) = test(&points, Model::Line, &[1.0, 2.0]);
            of_chi2.push(found.p_value);
            of_curvature.push(found.curvature_p_value.unwrap());
        }
        // Probabilities are uniform: by Kolmogorov and Smirnov at 1e-4, 2.23 / sqrt(n).
        for all in [&mut of_chi2, &mut of_curvature] {
            all.sort_by(f64::total_cmp);
            let n = all.len() as f64;
            let off =
                all.iter().enumerate().map(|(i, p)| (p - (i as f64 + 0.5) / n).abs()).fold(0.0, f64::max);
            assert!(off < 2.23 / n.sqrt(), "{off}");
        }
    }
}
