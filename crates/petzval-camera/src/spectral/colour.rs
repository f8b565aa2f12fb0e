//! Colours from XYZ: linear sRGB, CIELAB, and chromatic adaptation between two illuminants.

/// A 3x3 matrix, rows first.
pub type Matrix3 = [[f64; 3]; 3];

/// Matrix times vector.
pub fn apply(m: &Matrix3, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Product of two matrices.
pub fn product(a: &Matrix3, b: &Matrix3) -> Matrix3 {
    a.map(|row| [0, 1, 2].map(|c| (0..3).map(|k| row[k] * b[k][c]).sum()))
}

/// Inverse; not finite for a singular matrix.
pub fn inverse(m: &Matrix3) -> Matrix3 {
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    [0, 1, 2].map(|r| [0, 1, 2].map(|c| minor(c, r) / determinant))
}

/// Chromaticities of the sRGB primaries (IEC 61966-2-1, as ITU-R BT.709).
pub const SRGB_PRIMARIES: [(f64, f64); 3] = [(0.64, 0.33), (0.30, 0.60), (0.15, 0.06)];

/// XYZ of linear sRGB whose white (1, 1, 1) is `white` (Y = 1): the columns are the primaries.
///
/// Each primary `P = (x/y, 1, (1-x-y)/y)` is scaled so that their sum is white.
pub fn xyz_from_srgb(white: [f64; 3]) -> Matrix3 {
    let columns = SRGB_PRIMARIES.map(|(x, y)| [x / y, 1.0, (1.0 - x - y) / y]);
    let primaries: Matrix3 = [0, 1, 2].map(|r| [0, 1, 2].map(|c| columns[c][r]));
    let weights = apply(&inverse(&primaries), white);
    [0, 1, 2].map(|r| [0, 1, 2].map(|c| primaries[r][c] * weights[c]))
}

/// Linear sRGB from XYZ whose white is `white`.
pub fn srgb_from_xyz(white: [f64; 3]) -> Matrix3 {
    inverse(&xyz_from_srgb(white))
}

/// The Bradford transform: XYZ under one white to the corresponding XYZ under another
/// (K. M. Lam 1985; as in the ICC profile specification).
pub fn bradford(from_white: [f64; 3], to_white: [f64; 3]) -> Matrix3 {
    const CONES: Matrix3 = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
    let (from, to) = (apply(&CONES, from_white), apply(&CONES, to_white));
    let gains: Matrix3 = [0, 1, 2].map(|r| [0, 1, 2].map(|c| if r == c { to[r] / from[r] } else { 0.0 }));
    product(&inverse(&CONES), &product(&gains, &CONES))
}

/// CIELAB (CIE 1976), `[L*, a*, b*]`, of XYZ relative to `white`.
pub fn lab(xyz: [f64; 3], white: [f64; 3]) -> [f64; 3] {
    let f = |t: f64| {
        let d: f64 = 6.0 / 29.0;
        if t > d.powi(3) { t.cbrt() } else { t / (3.0 * d * d) + 4.0 / 29.0 }
    };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i] / white[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Colour difference of CIE 1976: the distance in CIELAB.
pub fn delta_e_1976(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const D65: [f64; 3] = [0.95047, 1.0, 1.08883];

    #[test]
    fn the_srgb_matrix_matches_the_standard() {
        let standard = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
        // IEC 61966-2-1 prints four decimals of the inverse of a rounded matrix.
        for (ours, theirs) in srgb_from_xyz(D65).iter().flatten().zip(standard.iter().flatten()) {
            assert!((ours - theirs).abs() < 5e-4, "{ours} {theirs}");
        }
    }

    #[test]
    fn adaptation_maps_white_to_white() {
        let a = [1.0985, 1.0, 0.3558];
        let moved = apply(&bradford(a, D65), a);
        assert!((0..3).all(|i| (moved[i] - D65[i]).abs() < 1e-12));
        assert!(delta_e_1976(lab(D65, D65), [100.0, 0.0, 0.0]) < 1e-12);
        // A gray of Y = 0.184187 has L* = 50.
        assert!((lab(D65.map(|v| v * 0.184187), D65)[0] - 50.0).abs() < 1e-3);
    }
}
