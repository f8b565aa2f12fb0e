//! Where the points of a raw frame lie in its dewarped picture, and back.
//!
//! The pixel p of the picture shows the light of `p + strength * d(p)` of the raw frame, with the displacements d between the nodes of the
//! calibration's mesh bilinear; beyond the frame the outermost cells continue. The way back solves this for p by Newton's method.
//!
//! Points are `[x, y]` in pixels from the upper left corner of the frame, x to the right and y downwards: the middle of the first pixel is
//! `[0.5, 0.5]`.

use super::Mesh;

/// Steps of Newton's method, and the distance from the wanted point at which they end, pixels.
const STEPS: usize = 60;
const CLOSE_PX: f64 = 1e-6;

/// The map between the raw frame and the dewarped picture of one frame size.
#[derive(Clone, Copy, Debug)]
pub struct DewarpMap<'a> {
    mesh: Option<&'a Mesh>,
    strength: f64,
    height: usize,
    width: usize,
}

impl<'a> DewarpMap<'a> {
    /// The map of a frame of `height` x `width` pixels with the mesh [`FrameData::warp`](super::FrameData::warp), in an ISP that undoes the
    /// share `strength` of the displacement (its parameter `dewarp.strength`). Without a mesh, or with a strength of 0, points stay.
    pub fn new(mesh: Option<&'a Mesh>, strength: f64, (height, width): (usize, usize)) -> Self {
        Self { mesh: mesh.filter(|_| strength > 0.0), strength, height, width }
    }

    /// The point of the raw frame that a point of the picture shows.
    pub fn raw_from_picture(&self, point: [f64; 2]) -> [f64; 2] {
        let (moved, _) = self.displacement(point);
        [point[0] + moved[0], point[1] + moved[1]]
    }

    /// The point of the picture that shows a point of the raw frame; none where the mesh folds and no point does.
    pub fn picture_from_raw(&self, point: [f64; 2]) -> Option<[f64; 2]> {
        let missed = |at: [f64; 2]| {
            let raw = self.raw_from_picture(at);
            [raw[0] - point[0], raw[1] - point[1]]
        };
        let mut at = point;
        let mut off = missed(at);
        for _ in 0..STEPS {
            if off[0].hypot(off[1]) < CLOSE_PX {
                return Some(at);
            }
            // Solve (1 + D) step = off, with D the derivative of the displacement.
            let (_, [[dx_x, dx_y], [dy_x, dy_y]]) = self.displacement(at);
            let (a, b, c, d) = (1.0 + dx_x, dx_y, dy_x, 1.0 + dy_y);
            let determinant = a * d - b * c;
            if determinant <= 0.0 {
                return None;
            }
            let step = [(d * off[0] - b * off[1]) / determinant, (a * off[1] - c * off[0]) / determinant];
            // Shorten a step that leads further away, as it may across the kink between two cells.
            let mut share = 1.0;
            loop {
                let next = [at[0] - share * step[0], at[1] - share * step[1]];
                let next_off = missed(next);
                if next_off[0].hypot(next_off[1]) < off[0].hypot(off[1]) {
                    (at, off) = (next, next_off);
                    break;
                }
                share *= 0.5;
                if share < 1e-6 {
                    return None;
                }
            }
        }
        None
    }

    /// How far the raw point lies from a point of the picture, `[x, y]`, and the derivatives `[[dx/dx, dx/dy], [dy/dx, dy/dy]]`.
    fn displacement(&self, [x, y]: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
        let Some(mesh) = self.mesh else { return ([0.0; 2], [[0.0; 2]; 2]) };
        // The outermost nodes lie on the middles of the outermost pixels.
        let place = |at: f64, len: usize, nodes: usize| {
            let per_pixel = (nodes - 1) as f64 / (len.max(2) - 1) as f64;
            let node = (at - 0.5) * per_pixel;
            let cell = node.floor().clamp(0.0, (nodes - 2) as f64);
            (cell as usize, node - cell, per_pixel)
        };
        let (row, v, per_row) = place(y, self.height, mesh.rows);
        let (col, u, per_col) = place(x, self.width, mesh.cols);
        let of = |plane: usize| {
            let node = |r: usize, c: usize| self.strength * f64::from(mesh.planes[plane][r * mesh.cols + c]);
            let (a, b) = (node(row, col), node(row, col + 1));
            let (c, d) = (node(row + 1, col), node(row + 1, col + 1));
            let value = (1.0 - v) * ((1.0 - u) * a + u * b) + v * ((1.0 - u) * c + u * d);
            let by_x = per_col * ((1.0 - v) * (b - a) + v * (d - c));
            let by_y = per_row * ((1.0 - u) * (c - a) + u * (d - b));
            (value, [by_x, by_y])
        };
        // The mesh holds displacements of rows first.
        let ((down, by_down), (right, by_right)) = (of(0), of(1));
        ([right, down], [by_right, by_down])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::isp::{FrameData, HardwareIsp, IspSettings, NoiseProfile, RawInput};
    use crate::sensor::CfaPattern;

    const SIZE: (usize, usize) = (96, 160);

    /// The mesh of a barrel: points move towards the middle by `share` of their distance in the corner.
    fn barrel(share: f32) -> Mesh {
        let (rows, cols) = (17, 25);
        let mut planes = vec![Vec::new(); 2];
        for i in 0..rows * cols {
            let y = ((i / cols) as f32 / (rows - 1) as f32 - 0.5) * (SIZE.0 - 1) as f32;
            let x = ((i % cols) as f32 / (cols - 1) as f32 - 0.5) * (SIZE.1 - 1) as f32;
            let corner = 0.5 * (SIZE.0 as f32).hypot(SIZE.1 as f32);
            let shrink = -share * (y.hypot(x) / corner).powi(2);
            planes[0].push(shrink * y);
            planes[1].push(shrink * x);
        }
        Mesh { rows, cols, planes }
    }

    #[test]
    fn points_come_back_to_where_they_were() {
        for (share, strength) in [(0.3, 1.0), (0.3, 0.5), (-0.25, 1.0), (0.3, 0.0)] {
            let mesh = barrel(share);
            let map = DewarpMap::new(Some(&mesh), strength, SIZE);
            let (mut furthest, mut shown) = (0.0_f64, 0);
            let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
            for k in 0..2000 {
                let point = [(k * 37 % 1700) as f64 / 10.0 - 5.0, (k * 53 % 1060) as f64 / 10.0 - 5.0];
                let back = map.picture_from_raw(map.raw_from_picture(point)).unwrap();
                furthest = furthest.max(apart(back, point));
                // The corners of a raw frame with a strong barrel lie beyond every picture.
                if let Some(place) = map.picture_from_raw(point) {
                    furthest = furthest.max(apart(map.raw_from_picture(place), point));
                    shown += 1;
                }
            }
            assert!(furthest < 1e-4 && shown > 1000, "{share} {strength}: {furthest}, {shown}");
            let corner = map.raw_from_picture([0.5, 0.5]);
            let moved = (corner[0] - 0.5).hypot(corner[1] - 0.5);
            let expected = f64::from(share.abs()) * strength * 93.3 * 0.98;
            assert!((moved - expected).abs() < 0.5, "{moved} {expected}");
        }
        // A mesh that folds the corner over shows some raw points nowhere.
        let folded = barrel(0.7);
        assert_eq!(DewarpMap::new(Some(&folded), 1.0, SIZE).picture_from_raw([0.5, 0.5]), None);
    }

    /// A dark frame with one bright spot of the form `exp(-r^2 / (2 * 2^2))` about a point, in all colours.
    fn spot([x, y]: [f64; 2], mesh: &Mesh) -> RawInput {
        let (height, width) = SIZE;
        let light = |i: usize| {
            let (row, col) = ((i / width) as f64 + 0.5, (i % width) as f64 + 0.5);
            100 + (3000.0 * (-((row - y).powi(2) + (col - x).powi(2)) / 8.0).exp()) as u32
        };
        let about = FrameData {
            black_dn: 100.0,
            white_dn: 4000.0,
            response: [1.0; 3],
            saturation: 1.0,
            noise: NoiseProfile { shot: 1e-4, read: 1e-7 },
            gain_ev: 0.0,
            colour_matrix: None,
            companding: None,
            shading: None,
            warp: Some(mesh.clone()),
        };
        let dn = (0..height * width).map(light).collect();
        RawInput { height, width, dn, bits: 12, cfa: CfaPattern::RGGB, about }
    }

    #[test]
    fn a_label_lies_on_the_spot_that_the_chip_shows() {
        let mesh = barrel(0.25);
        let mut isp = HardwareIsp { settings: IspSettings::default() };
        // So small a spot would count as a hot pixel.
        isp.settings.defects.slope = 0.0;
        let map = DewarpMap::new(Some(&mesh), isp.settings.dewarp.strength, SIZE);
        for raw in [[80.3, 47.6], [33.2, 28.7], [125.5, 70.1], [118.0, 22.4]] {
            let picture = isp.develop_as_set(&spot(raw, &mesh)).unwrap();
            // The centroid of the green plane. High powers of the light are near the peak, where the map is nearly linear.
            let (height, width) = SIZE;
            let green = &picture.data[height * width..][..height * width];
            let mut sums = [0.0; 3];
            for (i, v) in green.iter().enumerate() {
                let light = (f64::from(*v) / 255.0).powf(2.2 * 4.0);
                sums[0] += light;
                sums[1] += light * ((i % width) as f64 + 0.5);
                sums[2] += light * ((i / width) as f64 + 0.5);
            }
            let shown = [sums[1] / sums[0], sums[2] / sums[0]];
            let wanted = map.picture_from_raw(raw).unwrap();
            let apart = (shown[0] - wanted[0]).hypot(shown[1] - wanted[1]);
            let moved = (raw[0] - wanted[0]).hypot(raw[1] - wanted[1]);
            assert!(apart < 0.1 && (moved > 2.0 || raw[0] == 80.3), "{shown:?} {wanted:?}, moved {moved}");
        }
    }
}
