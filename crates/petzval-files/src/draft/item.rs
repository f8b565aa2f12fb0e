//! The items that a file lists between object and image: surfaces and coordinate breaks.

use super::record::Record;
use petzval_optics::lens::Surface;

/// The clear semi-diameter that the file gives for a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clear {
    /// The surface clips light beyond this height, mm.
    Edge(f64),
    /// The surface clips light beyond this height, mm, which the program set to that of its beam.
    Beam(f64),
    /// The surface does not clip; the file prints this height for information, mm, or 0.
    Open(f64),
}

/// A surface of the file.
#[derive(Clone, Debug)]
pub(crate) struct Drafted {
    /// The surface, still without its clear semi-diameter and, for a mirror, the medium behind it.
    pub surface: Surface,
    pub clear: Clear,
    pub record: Record,
    /// Where the aperture stands that [`Clear::Edge`] encloses, if that is off the vertex.
    pub offset: Option<Offset>,
}

/// A round aperture off the vertex of its surface.
#[derive(Clone, Debug)]
pub(crate) struct Offset {
    /// Its middle, mm.
    pub at_mm: [f64; 2],
    pub radius_mm: f64,
    pub record: Record,
}

/// An item between object and image.
#[derive(Clone, Debug)]
pub(crate) enum Item {
    Surface(Box<Drafted>),
    Break(Break),
}

/// A move of the axis.
#[derive(Clone, Debug, Default)]
pub(crate) struct Break {
    /// Shift along x and y, mm.
    pub decenter_mm: [f64; 2],
    /// Rotation about x, y and z, rad.
    pub tilt_rad: [f64; 3],
    /// Whether the rotations come first, in reverse order.
    pub tilt_first: bool,
    /// Distance along the new axis to the next item, mm.
    pub thickness_mm: f64,
    pub record: Record,
}
