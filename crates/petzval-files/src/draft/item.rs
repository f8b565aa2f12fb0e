//! The items that a file lists between object and image: surfaces and coordinate breaks.

use super::record::Record;
use crate::impossible::Culprit;
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
    pub places: Places,
    /// Where the aperture stands that [`Clear::Edge`] encloses, if that is off the vertex.
    pub offset: Option<Offset>,
}

/// The records of single numbers of a surface; `None` for those that stand in the surface's own record.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    pub thickness: Option<Record>,
    /// Of the clear semi-diameter.
    pub clear: Option<Record>,
    pub glass: Option<Record>,
}

impl Drafted {
    /// The record of the thickness.
    pub fn thickness_at(&self) -> &Record {
        self.places.thickness.as_ref().unwrap_or(&self.record)
    }

    /// The record of the clear semi-diameter.
    pub fn clear_at(&self) -> &Record {
        self.places.clear.as_ref().unwrap_or(&self.record)
    }

    /// Whether the file leaves its clear semi-diameter to the beam.
    pub fn follows_beam(&self) -> bool {
        matches!(self.clear, Clear::Open(_))
    }

    /// The record of what a defect is about. A clear semi-diameter that the beam makes follows from `aperture`, that of the lens.
    pub fn record_of<'a>(&'a self, culprit: Culprit, aperture: &'a Record) -> &'a Record {
        let own = &self.record;
        match culprit {
            Culprit::Thickness => self.thickness_at(),
            Culprit::SemiDiameter if self.follows_beam() => aperture,
            Culprit::SemiDiameter => self.clear_at(),
            Culprit::Glass => self.places.glass.as_ref().unwrap_or(own),
            Culprit::Placement | Culprit::ThinLens | Culprit::Other => own,
        }
    }
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
    /// The record of its thickness, if it is not its own.
    pub thickness_at: Option<Record>,
}
