//! Numbers that may not exist, such as the focal length of an afocal lens.

/// The value, or `None` if it is infinite or no number: JSON has neither.
pub(crate) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
