//! A measured number with its standard error, or the reason why it is not resolved.

use std::borrow::Cow;

use petzval_base::counted;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Serialize, Serializer};

/// Multiple of the standard error within which a slope or a variance counts as zero.
pub const RESOLVED_SIGMAS: f64 = 2.0;

/// A result of a measurement. Never NaN: a number that is not resolved has a reason instead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Measured {
    /// A number.
    Value {
        /// The number, in the unit that its name or its figure states.
        value: f64,
        /// Its standard error in the same unit; absent if none can be stated.
        #[serde(skip_serializing_if = "Option::is_none")]
        standard_error: Option<f64>,
    },
    /// The captures do not determine the number.
    NotResolved {
        /// Why not, in words.
        not_resolved: Unresolved,
    },
}

/// Why a number could not be resolved.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unresolved {
    /// There are fewer points than the fit needs.
    #[error("{}, {need} are needed", counted(*got, "usable point"))]
    TooFewPoints {
        /// Points that were found.
        got: usize,
        /// Points that are needed.
        need: usize,
    },
    /// Every flat point is clipped or close to saturation.
    #[error("every flat point is clipped or above 70 % of saturation")]
    AllSaturated,
    /// No flat point has dark frames of its exposure time.
    #[error("no flat frames with dark ones of their exposure time")]
    NoFlat,
    /// There are no dark frames, or those there are clipped at zero or moved.
    #[error("no usable dark frames")]
    NoDark,
    /// The frames have fewer than three rows or columns of a colour.
    #[error("the frames have fewer than three rows or columns of a colour")]
    FewLines,
    /// The noise of rows, or of columns, is correlated over the whole frame.
    #[error(
        "the noise is correlated over the {lines} lines of the frame, and is not told from a drift of the frame"
    )]
    LinesTogether {
        /// Rows, or columns, of the frame.
        lines: usize,
    },
    /// There are too few linear gains.
    #[error("{} with K and a dark series, {need} are needed", counted(*got, "linear gain"))]
    TooFewGains {
        /// Gains that were found.
        got: usize,
        /// Gains that are needed.
        need: usize,
    },
    /// Number of points within 5 to 95 % of saturation: too few for linearity.
    #[error("{} within 5 to 95 % of saturation, three or more are needed", counted(*.0, "point"))]
    FewInLinearRange(usize),
    /// All points have one exposure time, and no photons are stated: their light is not known.
    #[error("one exposure time and no photons: the light is not known")]
    OneLight,
    /// The exposure times do not differ enough.
    #[error("{}, {need} are needed", counted(*got, "exposure time"))]
    TooFewExposures {
        /// Different exposure times that were found.
        got: usize,
        /// Different exposure times that are needed.
        need: usize,
    },
    /// The points of the fit do not lie on its model.
    #[error(
        "the points of the fit do not lie on its line (reduced chi^2 {reduced_chi2:.1} at {degrees} degrees of freedom)"
    )]
    PoorFit {
        /// Chi-squared over the degrees of freedom.
        reduced_chi2: f64,
        /// Degrees of freedom.
        degrees: usize,
    },
    /// The number is the root of a variance that came out negative.
    #[error("the variance is negative ({0:.4e})")]
    NegativeVariance(f64),
    /// The number is impossible: it is below zero by more than two standard errors.
    #[error("{value:.4e} +- {standard_error:.2e} is negative")]
    BelowZero {
        /// The number.
        value: f64,
        /// Its standard error.
        standard_error: f64,
    },
    /// The number is within two standard errors of zero.
    #[error("{value:.4e} +- {standard_error:.2e} is within two standard errors of zero")]
    WithinNoise {
        /// The measured value.
        value: f64,
        /// Its standard error.
        standard_error: f64,
    },
    /// The number is above its noise, but not above what the departure of its points from a line may do to it.
    #[error(
        "{value:.4e} +- {standard_error:.2e}: its points are not on a line, or too few to show that they are"
    )]
    WithinModelError {
        /// The measured value.
        value: f64,
        /// Its standard error, with that of the model.
        standard_error: f64,
    },
    /// No point says how many photons fell on a pixel.
    #[error("no point states its photons per pixel")]
    NoPhotons,
    /// There is no stack of more than two frames of this kind.
    #[error("no stack of more than two flat and two dark frames")]
    NoStack,
    /// The series does not reach saturation.
    #[error("the series does not reach saturation")]
    NotSaturated,
    /// Too few pixels have a dark current above the noise, or it is too little above.
    #[error(
        "{outliers} pixels have a dark current above the noise of the dark series: too few, or by too little"
    )]
    NoHotPixels {
        /// Number of such pixels.
        outliers: usize,
    },
    /// Pixels with a dark current above the noise are not those of the model.
    #[error(
        "{outliers} pixels have a dark current above the noise of the dark series, which is not exponentially distributed as that of hot pixels"
    )]
    NotExponential {
        /// Number of such pixels.
        outliers: usize,
    },
    /// Light leaks into the dark frames, or the sensor glows.
    #[error("light leaks into the dark frames, or the sensor glows: bright pixels are not hot ones")]
    LightLeak,
    /// The frames are smaller than the filter.
    #[error("the frames are smaller than the high-pass filter")]
    TooSmall,
    /// The manifest does not state a fact of the sensor that is needed.
    #[error("the captures do not state {0}")]
    NotStated(&'static str),
    /// A number from which this one is computed is not resolved.
    #[error("{0} is not resolved")]
    FollowsFrom(&'static str),
    /// Neighbouring pixels, or frames that follow each other, share temporal noise.
    #[error(
        "pixels or frames share noise, as after a filter in the camera: the variance is not that of the sensor"
    )]
    SharedNoise,
    /// The arithmetic has no finite result: a division by a signal of zero, for example.
    #[error("a division by zero signal")]
    NotFinite,
}

impl Serialize for Unresolved {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// In words.
impl JsonSchema for Unresolved {
    fn schema_name() -> Cow<'static, str> {
        "Unresolved".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        String::json_schema(generator)
    }
}

impl Measured {
    /// A number with its standard error.
    pub fn new(value: f64, standard_error: f64) -> Self {
        match (value.is_finite(), standard_error.is_finite()) {
            (true, true) => Self::Value { value, standard_error: Some(standard_error) },
            (true, false) => Self::Value { value, standard_error: None },
            _ => Self::none(Unresolved::NotFinite),
        }
    }

    /// A number without a standard error.
    pub fn exact(value: f64) -> Self {
        Self::new(value, f64::NAN)
    }

    /// Not resolved.
    pub fn none(not_resolved: Unresolved) -> Self {
        Self::NotResolved { not_resolved }
    }

    /// The number, if it is resolved.
    pub fn value(&self) -> Option<f64> {
        match self {
            Self::Value { value, .. } => Some(*value),
            Self::NotResolved { .. } => None,
        }
    }

    /// The standard error, if there is one.
    pub fn standard_error(&self) -> Option<f64> {
        match self {
            Self::Value { standard_error, .. } => *standard_error,
            Self::NotResolved { .. } => None,
        }
    }

    /// Why there is no number.
    pub fn reason(&self) -> Option<Unresolved> {
        match self {
            Self::Value { .. } => None,
            Self::NotResolved { not_resolved } => Some(*not_resolved),
        }
    }

    /// Standard error as a number: zero where none is stated.
    pub(super) fn error_or_zero(&self) -> f64 {
        self.standard_error().unwrap_or(0.0)
    }

    /// The number with a further independent error added, if it has a standard error.
    pub fn with_error(self, error: f64) -> Self {
        match (self.value(), self.standard_error()) {
            (Some(value), Some(own)) => Self::new(value, own.hypot(error)),
            _ => self,
        }
    }

    /// The number as a limit, without an error.
    pub fn limit(self) -> Self {
        self.value().map_or(self, Self::exact)
    }

    /// `f(x)` with the standard error `|f'(x)| s`.
    pub fn map(self, f: impl FnOnce(f64) -> f64, slope: impl FnOnce(f64) -> f64) -> Self {
        match self {
            Self::Value { value, standard_error } => {
                Self::new(f(value), standard_error.map_or(f64::NAN, |s| (slope(value) * s).abs()))
            }
            none => none,
        }
    }

    /// The number times an exact factor.
    pub fn scale(self, factor: f64) -> Self {
        self.map(|v| v * factor, |_| factor)
    }

    /// `x y` of independent numbers: relative variances add.
    pub fn times(self, other: Self) -> Self {
        match (self.value(), other.value()) {
            (Some(x), Some(y)) => {
                let known = self.standard_error().or(other.standard_error()).is_some();
                let error = (y * self.error_or_zero()).hypot(x * other.error_or_zero());
                Self::new(x * y, if known { error } else { f64::NAN })
            }
            (None, _) => self,
            (_, None) => other,
        }
    }

    /// `x + y` of independent numbers: variances add.
    pub fn plus(self, other: Self) -> Self {
        self.minus(other.scale(-1.0))
    }

    /// `x - y` of independent numbers: variances add.
    pub fn minus(self, other: Self) -> Self {
        match (self.value(), other.value()) {
            (Some(x), Some(y)) => {
                let known = self.standard_error().or(other.standard_error()).is_some();
                let error = self.error_or_zero().hypot(other.error_or_zero());
                Self::new(x - y, if known { error } else { f64::NAN })
            }
            (None, _) => self,
            (_, None) => other,
        }
    }

    /// `x^2`.
    pub fn squared(self) -> Self {
        self.map(|v| v * v, |v| 2.0 * v)
    }

    /// `x / y` of independent numbers: relative variances add.
    pub fn over(self, other: Self) -> Self {
        self.times(other.map(|y| 1.0 / y, |y| 1.0 / (y * y)))
    }

    /// `sqrt(x)` of a variance, with the standard error `s / (2 sqrt(x))`.
    pub fn root(self) -> Self {
        match self.value() {
            Some(v) if v < 0.0 => Self::none(Unresolved::NegativeVariance(v)),
            Some(0.0) => Self::new(0.0, f64::NAN),
            _ => self.map(f64::sqrt, |v| 0.5 / v.sqrt()),
        }
    }

    /// Not resolved if the number is within two standard errors of zero; for numbers of either sign.
    pub fn if_beyond_noise(self) -> Self {
        match (self.value(), self.standard_error()) {
            (Some(value), Some(standard_error)) if value.abs() <= RESOLVED_SIGMAS * standard_error => {
                Self::none(Unresolved::WithinNoise { value, standard_error })
            }
            _ => self,
        }
    }

    /// Not resolved if the number is not more than two standard errors above zero.
    pub fn if_above_noise(self) -> Self {
        match (self.value(), self.standard_error()) {
            (Some(value), Some(standard_error)) if value < -RESOLVED_SIGMAS * standard_error => {
                Self::none(Unresolved::BelowZero { value, standard_error })
            }
            (Some(value), Some(standard_error)) if value <= RESOLVED_SIGMAS * standard_error => {
                Self::none(Unresolved::WithinNoise { value, standard_error })
            }
            _ => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_state_their_counts() {
        let said = |why: Unresolved| why.to_string();
        assert_eq!(
            said(Unresolved::TooFewGains { got: 1, need: 3 }),
            "1 linear gain with K and a dark series, 3 are needed"
        );
        assert_eq!(said(Unresolved::TooFewPoints { got: 0, need: 2 }), "0 usable points, 2 are needed");
        assert!(said(Unresolved::TooFewExposures { got: 1, need: 3 }).starts_with("1 exposure time,"));
        assert!(said(Unresolved::FewInLinearRange(1)).starts_with("1 point within"));
    }

    #[test]
    fn errors_propagate_and_reasons_are_kept() {
        let (x, y) = (Measured::new(8.0, 0.4), Measured::new(2.0, 0.1));
        let q = x.over(y);
        assert_eq!(q.value(), Some(4.0));
        assert!((q.standard_error().unwrap() - 4.0 * (2.0_f64).sqrt() * 0.05).abs() < 1e-12);
        assert!((Measured::new(16.0, 0.8).root().standard_error().unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(x.minus(y).value(), Some(6.0));
        assert!((x.minus(y).standard_error().unwrap() - 0.17_f64.sqrt()).abs() < 1e-12);
        assert_eq!((x.squared().value(), x.squared().standard_error()), (Some(64.0), Some(6.4)));
        let none = Measured::none(Unresolved::NoPhotons);
        assert_eq!(x.times(none), none);
        assert!(matches!(Measured::new(-1.0, 0.1).root().reason(), Some(Unresolved::NegativeVariance(_))));
        assert!(Measured::new(0.19, 0.1).if_above_noise().value().is_none());
        assert!(Measured::new(0.21, 0.1).if_above_noise().value().is_some());
        let below = |v: f64| Measured::new(v, 0.1).if_above_noise().reason();
        assert!(matches!(below(-0.19), Some(Unresolved::WithinNoise { .. })));
        assert!(matches!(below(-0.21), Some(Unresolved::BelowZero { .. })));
        assert!(Measured::new(f64::NAN, 0.1).value().is_none());
        // Numbers of either sign.
        assert_eq!(
            [-0.21, -0.19, 0.19, 0.21].map(|v| Measured::new(v, 0.1).if_beyond_noise().value()),
            [Some(-0.21), None, None, Some(0.21)]
        );
    }
}
