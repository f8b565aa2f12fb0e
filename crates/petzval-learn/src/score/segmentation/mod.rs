//! How well the classes of pixels are found: the confusion matrix over all pixels of all frames, the intersection over union of each class, and
//! their ranges.
//!
//! ```text
//! truth and found classes of a frame -> PixelConfusion -> sum over frames -> IoU of each class -> mIoU, interval over frames
//! ```
//!
//! This module needs no tensors.

mod confusion;
mod scores;

pub use confusion::PixelConfusion;
pub use scores::{SegmentScore, segment_scores};
