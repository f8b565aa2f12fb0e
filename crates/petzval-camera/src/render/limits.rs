//! Sizes up to which pictures are rendered.

/// Most pixels along one side of the sensor.
pub const MAX_SIDE: usize = 65536;

/// Most patches along one side of the sensor.
pub const MAX_PATCHES: usize = 256;

/// Largest reach of a kernel, pixels.
pub const MAX_RADIUS: usize = 512;
