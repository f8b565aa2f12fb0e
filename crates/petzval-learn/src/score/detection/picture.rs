//! A picture with the objects that are in it and those that a detector reports.

/// Bounds in pixels: left edge, upper edge, width, height.
pub type Xywh = [f64; 4];

/// An object that is in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct TrueObject {
    /// Its class, from 0.
    pub class: usize,
    /// Its bounds.
    pub bounds: Xywh,
    /// Its area, px^2; that of an outline may be less than that of the bounds.
    pub area: f64,
    /// Many objects in one rectangle: any number of detections may lie in it, and none has to.
    pub crowd: bool,
    /// Nobody has to detect it, and whoever does is neither right nor wrong.
    pub ignore: bool,
}

/// An object that a detector reports.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundObject {
    /// Its class, from 0.
    pub class: usize,
    /// Its bounds.
    pub bounds: Xywh,
    /// How sure the detector is; only the order counts.
    pub score: f64,
}

/// A picture: what is in it, and what was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// What is in it.
    pub objects: Vec<TrueObject>,
    /// What was found.
    pub detections: Vec<FoundObject>,
}
