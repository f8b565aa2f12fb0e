//! Where the camera stands and looks.

use crate::error::StreetError;
use crate::vector::{Frame, vec3};

/// Where the camera stands and looks. The street's axes are x to the right, y up, z forward.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pose {
    /// Entrance pupil `[x, y, z]`, m; y is the height above the road.
    pub position_m: [f64; 3],
    /// Turn to the right, rad.
    pub yaw_rad: f64,
    /// Turn upward, rad.
    pub pitch_rad: f64,
    /// Turn about the axis, clockwise as the camera sees the street turn anticlockwise, rad.
    pub roll_rad: f64,
}

impl Pose {
    /// The camera's axes (right, up, forward) at its place.
    pub(crate) fn frame(&self) -> Frame {
        let [x, y, z] = self.position_m;
        let level = Frame::turned(vec3(x, y, z), self.yaw_rad);
        let (sin, cos) = self.pitch_rad.sin_cos();
        let (up, forward) = (level.y * cos - level.z * sin, level.z * cos + level.y * sin);
        let (sin, cos) = self.roll_rad.sin_cos();
        Frame { x: level.x * cos - up * sin, y: up * cos + level.x * sin, z: forward, ..level }
    }

    /// An error if a number is not finite.
    pub(crate) fn check(&self) -> Result<(), StreetError> {
        let [x, y, z] = self.position_m;
        let numbers = [
            ("x", x),
            ("y", y),
            ("z", z),
            ("yaw", self.yaw_rad),
            ("pitch", self.pitch_rad),
            ("roll", self.roll_rad),
        ];
        match numbers.into_iter().find(|(_, value)| !value.is_finite()) {
            Some((name, value)) => Err(StreetError::Pose { name, value }),
            None => Ok(()),
        }
    }
}
