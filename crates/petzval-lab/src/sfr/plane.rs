//! One plane of a picture.

/// One plane of a picture, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Plane<'a> {
    /// Its values, linear in light.
    pub values: &'a [f32],
    /// Pixels in a row.
    pub width: usize,
}
