//! What a file lists between object and image: surfaces and coordinate breaks.

use super::record::Record;
use petzval_optics::lens::Surface;

/// How far out a surface works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clear {
    /// Light beyond this is lost, mm.
    Edge(f64),
    /// No light is lost; the file prints this, mm, or 0.
    Open(f64),
}

/// A surface of the file.
#[derive(Clone, Debug)]
pub(crate) struct Drafted {
    /// Its clear semi-diameter is not filled in yet; nor is the medium behind a mirror.
    pub surface: Surface,
    pub clear: Clear,
    pub record: Record,
}

/// What stands between object and image.
#[derive(Clone, Debug)]
pub(crate) enum Item {
    Surface(Box<Drafted>),
    Break(Break),
}

/// A move of the axis.
#[derive(Clone, Debug, Default)]
pub(crate) struct Break {
    /// Along x and y, mm.
    pub decenter_mm: [f64; 2],
    /// About x, y and z, rad.
    pub tilt_rad: [f64; 3],
    /// Whether the rotations come first, in reverse order.
    pub tilt_first: bool,
    /// Along the new axis to what comes next, mm.
    pub thickness_mm: f64,
    pub record: Record,
}
