//! What a camera made of the [test chart](petzval_camera::spectral::TestChart): colour errors, noise and sharpness of a developed picture.

mod edges;
mod figures;
mod patches;
#[cfg(test)]
mod tests;

pub use edges::EdgeFigures;
pub use figures::{ChartFigures, Lightness, measure};
pub use patches::{PatchFigures, PatchNoise};
