//! Why a design space or an optimisation problem cannot be entered.

use crate::number::Number;

/// A design space that cannot be entered, or a problem in it that cannot be begun. Surfaces are counted from 1; values and
/// bounds are as users state them.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DesignSpaceError {
    /// A variable, pickup, solve or glass names a surface that the lens does not have.
    #[error("surface {surface} does not exist: the lens has {count} surfaces")]
    NoSuchSurface {
        /// Surface.
        surface: usize,
        /// Number of surfaces.
        count: usize,
    },
    /// A variable, pickup or solve names a number that its surface does not have.
    #[error("surface {surface} has no {number}")]
    NoSuchNumber {
        /// Surface.
        surface: usize,
        /// Which number.
        number: Number,
    },
    /// A pickup follows a variable that does not exist.
    #[error("a pickup follows variable {variable}, of {count}")]
    NoSuchVariable {
        /// Variable, from 1.
        variable: usize,
        /// Number of variables.
        count: usize,
    },
    /// A variable or a pickup on a number that a solve computes.
    #[error("surface {surface}: {number} can be neither a variable nor a pickup, a solve computes it")]
    Settled {
        /// Surface.
        surface: usize,
        /// Which number.
        number: Number,
    },
    /// Bounds that leave nothing between them.
    #[error("surface {surface}, {number}: the bounds {min} and {max} leave nothing between them")]
    Bounds {
        /// Surface.
        surface: usize,
        /// Which number.
        number: Number,
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// A starting value outside its bounds.
    #[error("surface {surface}, {number}: the lens has {value}, outside {min} ... {max}")]
    OutsideBounds {
        /// Surface.
        surface: usize,
        /// Which number.
        number: Number,
        /// Its value in the lens.
        value: f64,
        /// Lower bound.
        min: f64,
        /// Upper bound.
        max: f64,
    },
    /// No curvature of the solved surface gives the focal length: it has no power, or no light passes it at a height.
    #[error("no curvature of surface {surface} gives a focal length of {efl_mm} mm")]
    EflUnsolvable {
        /// Surface.
        surface: usize,
        /// Wanted EFL, mm.
        efl_mm: f64,
    },
    /// No curvature of the solved surface gives the magnification: as [`Self::EflUnsolvable`], or the object is at infinity.
    #[error("no curvature of surface {surface} gives a magnification of {magnification}")]
    MagnificationUnsolvable {
        /// Surface.
        surface: usize,
        /// Wanted magnification.
        magnification: f64,
    },
    /// Solves for the focal length and for the magnification at once.
    #[error("the focal length and the magnification cannot both be solved for")]
    TwoPowers,
    /// The defocus of the lens lies outside the range.
    #[error(
        "the image plane is {value_mm:.4} mm from the paraxial focus, outside +-{range_mm} mm; hint: raise that range (`defocus_mm` of an experiment) or refocus the lens"
    )]
    DefocusOutsideRange {
        /// Defocus of the lens, mm.
        value_mm: f64,
        /// Half-range, mm.
        range_mm: f64,
    },
    /// A problem without fields or wavelengths, or with another number of weights than fields.
    #[error("there are {fields} fields, {weights} weights for them and {wavelengths} wavelengths")]
    NothingToSee {
        /// Number of fields.
        fields: usize,
        /// Number of weights.
        weights: usize,
        /// Number of wavelengths.
        wavelengths: usize,
    },
    /// A glass that a search may exchange has no candidates.
    #[error("the glass behind surface {surface} has no candidates")]
    NoGlass {
        /// Surface.
        surface: usize,
    },
    /// A thickness of the lens, as its solves and bounds make it, goes against the light.
    #[error(
        "surface {surface}: the thickness goes against the light, with the lens as its solves and bounds make it"
    )]
    AgainstTheLight {
        /// Surface.
        surface: usize,
    },
    /// A limit or a goal needs a ray that the lens loses.
    #[error("{what}: the lens loses a ray that this needs, with the lens as its solves and bounds make it")]
    Unmeasured {
        /// The limit or the goal.
        what: String,
    },
    /// Rays of the lens, as its solves and bounds make it, do not reach the image.
    #[error("rays through the stop do not reach the image, with the lens as its solves and bounds make it")]
    NoRays,
}
