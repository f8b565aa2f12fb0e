//! Features of a box of any size as a small map of fixed size (ROI-align, He 2017), with their gradient.
//!
//! Each cell of the small map is the mean of bilinear samples of the feature map. The samples are the same for all channels, so they are
//! listed once as taps: places of the feature map and their weights. On the CPU a kernel of ours adds the taps up; on other devices the
//! framework gathers them.

use std::sync::Arc;

use burn::prelude::*;
use burn::tensor::TensorData;
use petzval_camera::tape::{Kernel, View, apply, is_on_host};
use rayon::prelude::*;
use serde::Serialize;

use super::BBox;

/// How boxes become small maps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RoiAlign {
    /// Height and width of the small map.
    pub size: [usize; 2],
    /// Samples along each side of a cell; none takes as many as the cell covers pixels of the feature map.
    pub samples: Option<usize>,
    /// Whether the centre of the first pixel of the feature map is at half a pixel, as it should be. Weights that were trained with
    /// torchvision's detectors need `false`.
    pub is_aligned: bool,
}

/// A box of a picture of the batch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Number of the picture.
    pub picture: usize,
    /// The box, pixels of the picture.
    pub bbox: BBox,
}

/// A place of a plane and its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Tap {
    place: u32,
    weight: f32,
}

/// The taps of a box: those of cell `i` are `taps[starts[i]..starts[i + 1]]`.
#[derive(Clone, Debug)]
struct RegionTaps {
    picture: usize,
    starts: Vec<usize>,
    taps: Vec<Tap>,
}

impl RoiAlign {
    /// The small maps `[regions, channels, size...]` of boxes on features `[batch, channels, height, width]`. `scale` is the size of a
    /// pixel of the picture on the feature map. The gradient goes to the features, not to the boxes.
    ///
    /// # Panics
    /// Panics if a region belongs to no picture of the batch.
    pub fn pool(&self, features: Tensor<4>, regions: &[Region], scale: f32) -> Tensor<4> {
        let [batch, channels, height, width] = features.dims();
        assert!(regions.iter().all(|r| r.picture < batch), "roi_align: a region of no picture");
        let [rows, columns] = self.size;
        if regions.is_empty() {
            return Tensor::zeros([0, channels, rows, columns], &features.device());
        }
        let taps: Vec<RegionTaps> =
            regions.par_iter().map(|region| self.taps(region, [height, width], scale)).collect();
        if is_on_host(&features) {
            return apply(Arc::new(Pool { taps, size: self.size }), [features.into_dispatch()]);
        }
        gathered(features, &taps, self.size)
    }

    /// The taps of a box on a feature map of this height and width.
    fn taps(&self, region: &Region, map: [usize; 2], scale: f32) -> RegionTaps {
        let offset = if self.is_aligned { 0.5 } else { 0.0 };
        let BBox { x1, y1, x2, y2 } = region.bbox;
        let start = [y1 * scale - offset, x1 * scale - offset];
        let least = if self.is_aligned { f32::NEG_INFINITY } else { 1.0 };
        let side = [(y2 - y1) * scale, (x2 - x1) * scale].map(|side| side.max(least));
        let cell: [f32; 2] = std::array::from_fn(|i| side[i] / self.size[i] as f32);
        let samples: [usize; 2] =
            std::array::from_fn(|i| self.samples.unwrap_or_else(|| cell[i].ceil().max(0.0) as usize));
        let weight = 1.0 / (samples[0] * samples[1]).max(1) as f32;

        // Rows and columns of samples are independent: list the two neighbours of each once.
        let along: [Vec<Vec<(usize, f32)>>; 2] = std::array::from_fn(|i| {
            let sample = |cell_number: usize, s: usize| {
                let at = (s as f32 + 0.5) * cell[i] / samples[i] as f32;
                neighbours(start[i] + cell_number as f32 * cell[i] + at, map[i])
            };
            (0..self.size[i]).map(|c| (0..samples[i]).flat_map(|s| sample(c, s)).collect()).collect()
        });
        let (mut starts, mut taps) = (vec![0], Vec::new());
        for rows in &along[0] {
            for columns in &along[1] {
                for (row, by_row) in rows {
                    for (column, by_column) in columns {
                        let place = (row * map[1] + column) as u32;
                        taps.push(Tap { place, weight: weight * by_row * by_column });
                    }
                }
                starts.push(taps.len());
            }
        }
        RegionTaps { picture: region.picture, starts, taps }
    }
}

/// The two pixels around a place on a line of `length` pixels, with their weights; none outside by more than a pixel.
fn neighbours(at: f32, length: usize) -> Vec<(usize, f32)> {
    if at < -1.0 || at > length as f32 || !at.is_finite() {
        return Vec::new();
    }
    let at = at.max(0.0);
    let low = at as usize;
    if low + 1 >= length {
        return vec![(length - 1, 1.0)];
    }
    let share = at - low as f32;
    vec![(low, 1.0 - share), (low + 1, share)]
}

#[derive(Debug)]
struct Pool {
    taps: Vec<RegionTaps>,
    size: [usize; 2],
}

impl Kernel for Pool {
    fn forward(&self, inputs: &[View<'_>], _: &[bool]) -> (Vec<f32>, Vec<usize>) {
        let [batch_planes, channels, height, width] = inputs[0].dims();
        debug_assert!(self.taps.iter().all(|t| t.picture < batch_planes));
        let (plane, cells) = (height * width, self.size[0] * self.size[1]);
        let mut pooled = vec![0.0; self.taps.len() * channels * cells];
        pooled.par_chunks_mut(channels * cells).zip(&self.taps).for_each(|(out, region)| {
            let first = region.picture * channels * plane;
            for (channel, out) in out.chunks_exact_mut(cells).enumerate() {
                let x = &inputs[0].values[first + channel * plane..][..plane];
                for (cell, out) in out.iter_mut().enumerate() {
                    let taps = &region.taps[region.starts[cell]..region.starts[cell + 1]];
                    *out = taps.iter().map(|tap| tap.weight * x[tap.place as usize]).sum();
                }
            }
        });
        (pooled, vec![self.taps.len(), channels, self.size[0], self.size[1]])
    }

    fn backward(&self, inputs: &[View<'_>], _: &[f32], gradient: &[f32], _: &[bool]) -> Vec<Vec<f32>> {
        let [_, channels, height, width] = inputs[0].dims();
        let (plane, cells) = (height * width, self.size[0] * self.size[1]);
        let mut for_x = vec![0.0; inputs[0].values.len()];
        // Each plane adds up the regions of its picture in their order, so that the sum does not depend on the threads.
        for_x.par_chunks_mut(plane).enumerate().for_each(|(number, out)| {
            let (picture, channel) = (number / channels, number % channels);
            for (i, region) in self.taps.iter().enumerate().filter(|(_, r)| r.picture == picture) {
                let gradient = &gradient[(i * channels + channel) * cells..][..cells];
                for (cell, g) in gradient.iter().enumerate() {
                    for tap in &region.taps[region.starts[cell]..region.starts[cell + 1]] {
                        out[tap.place as usize] += tap.weight * g;
                    }
                }
            }
        });
        vec![for_x]
    }
}

/// The same by the framework's operations: every cell is padded to the same number of taps.
fn gathered(features: Tensor<4>, taps: &[RegionTaps], [rows, columns]: [usize; 2]) -> Tensor<4> {
    let [batch, channels, height, width] = features.dims();
    let (device, cells) = (features.device(), rows * columns);
    let most = taps.iter().flat_map(|r| r.starts.windows(2).map(|w| w[1] - w[0])).max().unwrap_or(0).max(1);
    let (mut places, mut weights) = (Vec::new(), Vec::new());
    for region in taps {
        for cell in region.starts.windows(2) {
            let taps = &region.taps[cell[0]..cell[1]];
            let first = region.picture * height * width;
            places.extend(taps.iter().map(|tap| (first + tap.place as usize) as i64));
            weights.extend(taps.iter().map(|tap| tap.weight));
            places.extend(std::iter::repeat_n(first as i64, most - taps.len()));
            weights.extend(std::iter::repeat_n(0.0_f32, most - taps.len()));
        }
    }
    let regions = taps.len();
    let places = Tensor::<1, Int>::from_data(TensorData::new(places, [regions * cells * most]), &device);
    let weights = Tensor::<3>::from_data(TensorData::new(weights, [1, regions * cells, most]), &device);
    let planes = features.swap_dims(0, 1).reshape([channels, batch * height * width]);
    let near = planes.select(1, places).reshape([channels, regions * cells, most]);
    (near * weights).sum_dim(2).reshape([channels, regions, rows, columns]).swap_dims(0, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_and_the_framework_agree_in_value_and_gradient() {
        let device = Device::flex().autodiff();
        let values: Vec<f32> = (0..2 * 3 * 6 * 7).map(|i| (0.7 * i as f32).sin()).collect();
        let leaf = || {
            let data = TensorData::new(values.clone(), [2, 3, 6, 7]);
            Tensor::<4>::from_data(data, &device).require_grad()
        };
        let region = |picture, x1, y1, x2, y2| Region { picture, bbox: BBox::new(x1, y1, x2, y2) };
        let regions =
            [region(1, 1.0, 2.0, 9.0, 8.0), region(0, -3.0, 0.0, 30.0, 4.0), region(1, 5.0, 5.0, 5.5, 5.5)];
        for samples in [Some(2), None] {
            let align = RoiAlign { size: [3, 2], samples, is_aligned: true };
            let taps: Vec<_> = regions.iter().map(|r| align.taps(r, [6, 7], 0.5)).collect();
            let results = [0, 1].map(|way| {
                let x = leaf();
                let pooled = match way {
                    0 => align.pool(x.clone(), &regions, 0.5),
                    _ => gathered(x.clone(), &taps, align.size),
                };
                let gradient = x.grad(&pooled.clone().powf_scalar(2.0).sum().backward()).unwrap();
                [pooled.into_data(), gradient.into_data()].map(|data| data.try_to_vec::<f32>().unwrap())
            });
            for (ours, theirs) in results[0].iter().zip(&results[1]) {
                assert!(ours.iter().any(|v| *v != 0.0));
                assert!(ours.iter().zip(theirs).all(|(a, b)| (a - b).abs() < 1e-5), "{ours:?} {theirs:?}");
            }
        }
        let none = RoiAlign { size: [3, 2], samples: None, is_aligned: false }.pool(leaf(), &[], 1.0);
        assert_eq!(none.dims(), [0, 3, 3, 2]);
    }
}
