//! Limit of the size of a picture that is read.

/// Largest number of values of an image that is read: 2 GiB.
pub const MAX_VALUES: usize = 1 << 29;
