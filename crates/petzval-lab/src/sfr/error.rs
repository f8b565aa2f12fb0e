//! Why an edge cannot be measured.

/// A side of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The dark one.
    Dark,
    /// The bright one.
    Bright,
}

impl Side {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dark => "dark",
            Self::Bright => "bright",
        }
    }
}

/// Why the window of an edge has no response.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SfrError {
    /// The window leaves the plane.
    #[error("the window leaves the picture")]
    Outside,
    /// A value is infinite or not a number.
    #[error("the window holds values that are no numbers")]
    NotFinite,
    /// The window is too small.
    #[error(
        "{along} rows along the edge and {across} pixels on either side of it: at least {} and {} are needed",
        super::limits::LEAST_SIDE,
        super::limits::LEAST_HALF
    )]
    Small {
        /// Rows that the edge crosses.
        along: usize,
        /// Pixels between the edge and the nearer end of the window.
        across: usize,
    },
    /// There is no step from dark to bright.
    #[error("no edge: the two sides differ by less than their noise")]
    NoEdge,
    /// The pixels sample the edge at too few distances.
    #[error(
        "an edge at {deg:.1} degrees: the pixels sample it every {gap_px:.2} pixels, too coarse for its response; incline it by a pixel or more over its length, and not by 45 degrees"
    )]
    Angle {
        /// Inclination, degrees.
        deg: f64,
        /// Largest gap between the distances of the pixels from the edge, pixels.
        gap_px: f64,
    },
    /// The sides are not even: a second edge, a texture, a corner.
    #[error(
        "not one edge between two even sides: beyond the blur the values leave their level by {}; a second edge, a corner or a texture is in the window",
        of_step(*.deviation)
    )]
    Uneven {
        /// Largest deviation of a side from its level, of the step.
        deviation: f64,
    },
    /// A weaker step lies beside the edge: a ghost, a reflection, a faint second edge.
    #[error(
        "a second step of {:.1} % of the edge, as sharp as it, {:.0} pixels on its {} side: a ghost, a reflection or another edge, which is no change of the light; choose a window without it",
        100.0 * .share.abs(),
        .distance_px.abs(),
        if *.distance_px < 0.0 { Side::Dark.name() } else { Side::Bright.name() }
    )]
    Ghost {
        /// Its distance from the edge, pixels; negative on the dark side.
        distance_px: f64,
        /// Its step, of that of the edge; negative if the light falls there.
        share: f64,
    },
    /// The edge is not where its path is, or a row or column beside it is off.
    #[error(
        "the edge leaves its path by {drift_px:.2} pixels: it is no smooth arc, or a row or column that it crosses is darker or brighter than the others"
    )]
    OffPath {
        /// Largest mean distance over several rows, pixels.
        drift_px: f64,
    },
    /// A side ends at one value.
    #[error("the {} side is clipped: {:.0} % of its pixels have the same value, while the edge has noise or ends abruptly", .side.name(), 100.0 * .share)]
    Clipped {
        /// Which.
        side: Side,
        /// Share of its pixels at the extreme value.
        share: f64,
    },
}

/// Largest deviation that is given as a share of the step, 1000 %: beyond, the sides have nearly the same level.
const LARGEST_SAID: f64 = 10.0;

/// A deviation in words.
fn of_step(deviation: f64) -> String {
    if deviation <= LARGEST_SAID {
        format!("{:.0} % of the step", 100.0 * deviation)
    } else {
        "far more than the step".to_owned()
    }
}

impl SfrError {
    /// The same error of a plane that has every `pitch`-th pixel of a frame, with the gap in pixels of the frame.
    pub fn of_frame(self, pitch: usize) -> Self {
        match self {
            Self::Angle { deg, gap_px } => Self::Angle { deg, gap_px: pitch as f64 * gap_px },
            Self::OffPath { drift_px } => Self::OffPath { drift_px: pitch as f64 * drift_px },
            Self::Ghost { distance_px, share } => {
                Self::Ghost { distance_px: pitch as f64 * distance_px, share }
            }
            other => other,
        }
    }
}
