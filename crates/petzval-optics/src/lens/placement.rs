//! Where a surface sits when it is not on the axis: coordinate breaks.

use crate::vector::{Matrix3, product};

/// A shift of the vertex across the axis, then rotations of the surface about its own x, y and z, in this order.
///
/// Rotations are right-handed: a positive one about x turns y towards z. The rotation from surface to axis coordinates is
/// `R = Rx Ry Rz`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placement {
    /// Shift along x and y, mm.
    pub decenter_mm: [f64; 2],
    /// Rotations about x, y and z, rad.
    pub tilt_rad: [f64; 3],
    /// Where the axis goes behind the surface.
    pub axis: Axis,
}

/// Where the axis goes behind a surface that is shifted or turned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// On as if the surface sat straight: a misplaced element.
    #[default]
    Returns,
    /// Along the z axis of the surface: a coordinate break.
    Follows,
    /// As a ray along it is reflected: a fold mirror. Only mirrors bend it.
    Bends,
}

impl Placement {
    /// Whether the y-z plane is still a plane of symmetry.
    pub fn is_mirror_symmetric(&self) -> bool {
        self.decenter_mm[0] == 0.0 && self.tilt_rad[1] == 0.0 && self.tilt_rad[2] == 0.0
    }

    /// Rotation from surface coordinates to those of the axis.
    pub(crate) fn rotation(&self) -> Matrix3 {
        let [x, y, z] = self.tilt_rad;
        product(product(about(0, x, false), about(1, y, false)), about(2, z, false))
    }

    /// The three angles of a rotation `Rx Ry Rz`, the second within a quarter turn.
    pub(crate) fn tilts_of(rotation: &Matrix3) -> [f64; 3] {
        // Its first row is (cy cz, -cy sz, sy), its last column (sy, -sx cy, cx cy).
        let [[a, b, sin_y], [_, _, c], [_, _, d]] = *rotation;
        [(-c).atan2(d), sin_y.clamp(-1.0, 1.0).asin(), (-b).atan2(a)]
    }

    /// Derivative of the rotation by each of the three angles.
    pub(crate) fn rotation_by_tilt(&self) -> [Matrix3; 3] {
        let angles = self.tilt_rad;
        [0, 1, 2].map(|moved| {
            let turn = |axis: usize| about(axis, angles[axis], axis == moved);
            product(product(turn(0), turn(1)), turn(2))
        })
    }
}

/// Rotation about an axis, or its derivative by the angle.
fn about(axis: usize, angle: f64, derivative: bool) -> Matrix3 {
    let (sin, cos) = angle.sin_cos();
    let (along, cos, sin) = if derivative { (0.0, -sin, cos) } else { (1.0, cos, sin) };
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut m = [[0.0; 3]; 3];
    m[axis][axis] = along;
    m[a][a] = cos;
    m[b][b] = cos;
    m[b][a] = sin;
    m[a][b] = -sin;
    m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{apply, transposed};

    #[test]
    fn a_positive_rotation_about_x_turns_y_towards_z() {
        let placed = Placement { tilt_rad: [0.3, 0.0, 0.0], ..Placement::default() };
        let y = apply(&placed.rotation(), [0.0, 1.0, 0.0]);
        assert!((y[1] - 0.3_f64.cos()).abs() < 1e-15 && (y[2] - 0.3_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn tilts_come_back_from_their_rotation() {
        for tilt_rad in [[0.3, -0.2, 0.7], [-1e-9, 2e-9, 0.0], [0.0; 3], [0.4, 0.0, 0.0], [-2.0, 1.2, 3.0]] {
            let placed = Placement { tilt_rad, ..Placement::default() };
            let back = Placement::tilts_of(&placed.rotation());
            for (a, b) in back.into_iter().zip(tilt_rad) {
                assert!((a - b).abs() < 4e-16 + 1e-15 * b.abs(), "{back:?} {tilt_rad:?}");
            }
        }
    }

    #[test]
    fn rotations_are_orthogonal_and_their_derivatives_right() {
        let placed = Placement { tilt_rad: [0.3, -0.2, 0.7], ..Placement::default() };
        let r = placed.rotation();
        let unit = product(r, transposed(&r));
        for (i, row) in unit.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                assert!((value - if i == j { 1.0 } else { 0.0 }).abs() < 1e-15);
            }
        }
        for axis in 0..3 {
            let at = |h: f64| {
                let mut moved = placed;
                moved.tilt_rad[axis] += h;
                moved.rotation()
            };
            let h = 1e-6;
            for i in 0..3 {
                for j in 0..3 {
                    let numeric = (at(h)[i][j] - at(-h)[i][j]) / (2.0 * h);
                    assert!((placed.rotation_by_tilt()[axis][i][j] - numeric).abs() < 1e-9);
                }
            }
        }
    }
}
