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

/// XYZ of a colour in CIELAB relative to `white`: the inverse of [`lab`].
pub fn xyz_of_lab([l, a, b]: [f64; 3], white: [f64; 3]) -> [f64; 3] {
    let y = (l + 16.0) / 116.0;
    let inverse = |t: f64| {
        let d: f64 = 6.0 / 29.0;
        if t > d { t.powi(3) } else { 3.0 * d * d * (t - 4.0 / 29.0) }
    };
    let relative = [inverse(y + a / 500.0), inverse(y), inverse(y - b / 200.0)];
    [0, 1, 2].map(|i| relative[i] * white[i])
}

/// Colour difference of CIE 1976: the distance in CIELAB.
pub fn delta_e_1976(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// Colour difference CIEDE2000 of two colours in CIELAB, with the weights 1 of the reference conditions.
pub fn delta_e_2000(a: [f64; 3], b: [f64; 3]) -> f64 {
    let colour = |[l, a, b]: [f64; 3]| palette::Lab::<palette::white_point::D65, f64>::new(l, a, b);
    palette::color_difference::Ciede2000::difference(colour(a), colour(b))
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

    #[test]
    fn lab_and_xyz_are_inverses() {
        for xyz in [[0.2, 0.3, 0.1], [0.001, 0.002, 0.004], [0.9, 1.0, 1.0]] {
            let back = xyz_of_lab(lab(xyz, D65), D65);
            assert!((0..3).all(|i| (back[i] - xyz[i]).abs() < 1e-12), "{back:?}");
        }
    }

    /// Pairs of colours with their difference: G. Sharma, W. Wu, E. Dalal, "The CIEDE2000 color-difference formula", Color Research and
    /// Application 30 (2005), table 1. They meet every branch of the mean hue and of the rotation term.
    const SHARMA: [[f64; 7]; 34] = [
        [50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425],
        [50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615],
        [50.0, 2.8361, -74.0200, 50.0, 0.0, -82.7485, 3.4412],
        [50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0000],
        [50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0000],
        [50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0000],
        [50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669],
        [50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.3669],
        [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0009, 7.1792],
        [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0010, 7.1792],
        [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0011, 7.2195],
        [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0012, 7.2195],
        [50.0, -0.0010, 2.4900, 50.0, 0.0009, -2.4900, 4.8045],
        [50.0, -0.0010, 2.4900, 50.0, 0.0010, -2.4900, 4.8045],
        [50.0, -0.0010, 2.4900, 50.0, 0.0011, -2.4900, 4.7461],
        [50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065],
        [50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492],
        [50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977],
        [50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.9030],
        [50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.4535],
        [50.0, 2.5, 0.0, 50.0, 3.1736, 0.5854, 1.0000],
        [50.0, 2.5, 0.0, 50.0, 3.2972, 0.0, 1.0000],
        [50.0, 2.5, 0.0, 50.0, 1.8634, 0.5757, 1.0000],
        [50.0, 2.5, 0.0, 50.0, 3.2592, 0.3350, 1.0000],
        [60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644],
        [63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630],
        [61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731],
        [35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645],
        [22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373],
        [36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146],
        [90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441],
        [90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381],
        [6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377],
        [2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082],
    ];

    #[test]
    fn ciede2000_is_that_of_the_published_pairs() {
        for [l1, a1, b1, l2, a2, b2, wanted] in SHARMA {
            let (first, second) = ([l1, a1, b1], [l2, a2, b2]);
            let found = delta_e_2000(first, second);
            assert!((found - wanted).abs() < 1e-4, "{first:?} {second:?}: {found} {wanted}");
            assert!((delta_e_2000(second, first) - found).abs() < 1e-9);
        }
    }

    /// A fixture of rows of three numbers.
    fn triples(reference: &serde_json::Value, name: &str, key: &str) -> Vec<[f64; 3]> {
        serde_json::from_value(reference[name][key].clone()).unwrap()
    }

    fn reference() -> serde_json::Value {
        serde_json::from_str(include_str!("../../tests/fixtures/isp_reference.json")).unwrap()
    }

    #[test]
    fn lab_is_that_of_scikit_image() {
        // Its XYZ of linear sRGB, rounded to six digits.
        const ROUNDED: Matrix3 = [
            [0.412_453, 0.357_580, 0.180_423],
            [0.212_671, 0.715_160, 0.072_169],
            [0.019_334, 0.119_193, 0.950_227],
        ];
        let reference = reference();
        let (srgb, wanted) = (triples(&reference, "lab_d65", "srgb"), triples(&reference, "lab_d65", "lab"));
        assert_eq!(srgb.len(), 5);
        for (srgb, wanted) in srgb.into_iter().zip(wanted) {
            // In f64: what f32 rounds of linear light is 2e-5 of a*.
            let linear =
                srgb.map(|s: f64| if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) });
            let found = lab(apply(&ROUNDED, linear), D65);
            assert!((0..3).all(|i| (found[i] - wanted[i]).abs() < 1e-6), "{found:?} {wanted:?}");
            // The matrix of the exact chromaticities, and light in f32.
            let light = srgb.map(|s| f64::from(crate::image::srgb_decode(s as f32)));
            let found = lab(apply(&xyz_from_srgb(D65), light), D65);
            assert!(delta_e_1976(found, wanted) < 0.01, "{found:?} {wanted:?}");
        }
    }

    #[test]
    fn ciede2000_is_that_of_scikit_image() {
        let reference = reference();
        let [first, second] = ["lab1", "lab2"].map(|key| triples(&reference, "deltaE2000", key));
        let wanted: Vec<f64> = serde_json::from_value(reference["deltaE2000"]["dE"].clone()).unwrap();
        assert_eq!(wanted.len(), 5);
        for ((a, b), wanted) in first.into_iter().zip(second).zip(wanted) {
            let found = delta_e_2000(a, b);
            assert!((found - wanted).abs() < 1e-6, "{a:?} {b:?}: {found} {wanted}");
        }
    }
}
