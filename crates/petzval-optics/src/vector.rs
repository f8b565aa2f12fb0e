//! Points, directions and rotations in space.

/// A point or a direction, `[x, y, z]`.
pub type Vec3 = [f64; 3];

#[inline]
pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + s b`.
#[inline]
pub(crate) fn along(a: Vec3, s: f64, b: Vec3) -> Vec3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// Rows of a rotation.
pub(crate) type Matrix3 = [[f64; 3]; 3];

/// `A B`.
pub(crate) fn product(a: Matrix3, b: Matrix3) -> Matrix3 {
    let mut m = [[0.0; 3]; 3];
    for (i, row) in m.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            *value = (0..3).map(|k| a[i][k] * b[k][j]).sum();
        }
    }
    m
}

/// `M v`.
pub(crate) fn apply(m: &Matrix3, v: Vec3) -> Vec3 {
    [0, 1, 2].map(|i| m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2])
}

/// The transpose.
pub(crate) fn transposed(m: &Matrix3) -> Matrix3 {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[j][i]))
}

/// `D M D` with `D = diag(-1, -1, 1)`: a half turn about z on either side.
pub(crate) fn half_turned(m: &Matrix3) -> Matrix3 {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| if (i == 2) == (j == 2) { m[i][j] } else { -m[i][j] }))
}

/// Change of the determinant of a 2 x 2 matrix, from that of its elements.
pub(crate) fn determinant_change([x, y]: [[f64; 2]; 2], [dx, dy]: [[f64; 2]; 2]) -> f64 {
    dx[0] * y[1] + x[0] * dy[1] - dx[1] * y[0] - x[1] * dy[0]
}
