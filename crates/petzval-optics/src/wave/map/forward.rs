//! The change of a wave along a change of the lens.

use super::{WaveMap, WaveRow, WaveTangent};
use crate::gradient::LensGradient;
use crate::number::Number;
use crate::pupil::Symmetry;
use crate::trace::Sequence;
use crate::vector::determinant_change;

impl WaveMap {
    /// The change of the map along changes of the lens, of the logarithm of the stop radius and of the centre (mm): the transpose
    /// of [`WaveMap::pull_back`].
    pub fn push_forward(
        &self,
        sequence: &Sequence,
        change: &LensGradient,
        stop_growth: f64,
        origin: [f64; 2],
    ) -> WaveTangent {
        // From the numbers of the lens to the samples and to the index behind the lens.
        let s = &self.samples;
        let count = self.q.len();
        let moved = s.push_forward(sequence, change, stop_growth);
        let last = sequence.surfaces.len() - 1;
        let n_image = sequence.index_change(last, |glass| change[(glass, Number::Index)]);
        // From positions and directions on the image plane to W = L + n' run and q = (towards - middle) / scale.
        let (mut path, mut q) = (vec![0.0; count], vec![[0.0; 2]; count]);
        for i in 0..count {
            let (place, d) = ([s.x[i], s.y[i]], [0, 1, 2].map(|k| self.direction[k][i]));
            let shift = [moved.rays.image_x[i] - origin[0], moved.rays.image_y[i] - origin[1]];
            let turn = [0, 1].map(|axis| moved.rays.direction[axis][i]);
            let (run, towards) = self.sphere.push_forward(place, d, shift, turn);
            path[i] = moved.rays.optical_path[i] + self.n_image * run + n_image * self.sphere.run(place, d).0;
            q[i] = [0, 1].map(|axis| towards[axis] / self.scale[axis]);
        }
        // Paths are relative to the first sample.
        let first = path[0];
        path.iter_mut().for_each(|p| *p -= first);
        // From values at the samples and their points q to the coefficients. The stop coordinates of the samples are fixed.
        let fixed = vec![0.0; count];
        let odd = self.odd.as_ref().unwrap_or(&self.even);
        let density = self.push_forward_density(&moved.light, &q);
        let heights = self.heights.iter().zip(&moved.rays.heights);
        WaveTangent {
            path: self.even.push_forward(&self.path, &path, &q),
            density: self.even.push_forward(&self.density, &density, &q),
            stop: [
                odd.push_forward(&self.stop[0], &fixed, &q),
                self.even.push_forward(&self.stop[1], &fixed, &q),
            ],
            heights: heights.map(|((.., c), h)| self.even.push_forward(c, &h.values, &q)).collect(),
            semi_diameters: self.heights.iter().map(|(s, ..)| change[(*s, Number::SemiDiameter)]).collect(),
            origin,
            n_image,
        }
    }

    /// Changes of the density, from those of the light and of the points q: the transpose of [`WaveMap::pull_back_density`].
    fn push_forward_density(&self, light: &[f64], q: &[[f64; 2]]) -> Vec<f64> {
        let (basis, sides) = (self.samples.basis, self.samples.sides);
        let slopes = |axis: usize, symmetry| {
            let moved: Vec<f64> = q.iter().map(|q| q[axis]).collect();
            basis.slopes(&basis.fit(&moved, sides, symmetry), sides)
        };
        let [xx, xy, yx, yy] = &self.q_by_p;
        let (x, y) = (slopes(0, Symmetry::Odd), slopes(1, Symmetry::Even));
        (0..q.len())
            .map(|i| {
                let determinant = xx[i] * yy[i] - xy[i] * yx[i];
                let moved = [&x, &y].map(|row| [row[0][i], row[1][i]]);
                let growth = determinant_change([[xx[i], xy[i]], [yx[i], yy[i]]], moved);
                let per_area = 1.0 / (std::f64::consts::PI * determinant.abs());
                per_area * (light[i] - self.samples.light[i] * growth / determinant)
            })
            .collect()
    }

    /// Changes of the coefficients along a row of q_y, from those of the map: the transpose of [`WaveMap::pull_back_row`].
    pub fn push_forward_row(&self, change: &WaveTangent, q_y: f64) -> WaveRow {
        let odd = self.odd.as_ref().unwrap_or(&self.even);
        WaveRow {
            q_y,
            path: self.even.along(&change.path, q_y),
            density: self.even.along(&change.density, q_y),
            stop: [odd.along(&change.stop[0], q_y), self.even.along(&change.stop[1], q_y)],
            heights: change.heights.iter().map(|c| self.even.along(c, q_y)).collect(),
        }
    }
}

impl WaveTangent {
    /// Changes of the semi-diameters, mm, in the order of [`WaveMap::semi_diameters_mm`].
    pub fn semi_diameters(&self) -> &[f64] {
        &self.semi_diameters
    }
}
