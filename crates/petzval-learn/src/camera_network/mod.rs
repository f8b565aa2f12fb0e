//! The network of a camera: one that finishes its pictures, or one that finds objects in them.

mod any;
mod zoomed;

pub use any::{Network, NetworkKind};
pub use zoomed::{Zoom, Zoomed};

use crate::detection::Detector;
use crate::network::PictureNetwork;

/// A network behind the development, which may be a detector.
pub trait CameraNetwork: PictureNetwork {
    /// The detector that looks at the finished pictures, if the network is one.
    fn detector(&self) -> Option<&dyn Detector> {
        None
    }
}
