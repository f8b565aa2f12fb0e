//! What an edge has to be for its response to be measured.

/// Least height and width of a region, and least number of rows that the edge crosses, pixels.
pub const LEAST_SIDE: usize = 16;

/// Fewest pixels on either side of the edge.
pub const LEAST_HALF: usize = 6;

/// Largest gap between the distances at which pixels sample the edge, pixels: that of an edge at 45 degrees is 0.7072.
pub const LARGEST_GAP_PX: f64 = 0.72;

/// Largest share of pixels that may be left out as defects.
pub const MOST_LEFT_OUT: f64 = 0.1;
