//! Convolution with the kernels of patches, blended from patch to patch, and its transposes, in direct space.
//!
//! `out(x) = sum_p w_p(x) sum_d K_p(d) scene(x - d)`, as `render/direct.rs` defines it. A unit sums eight neighbouring values of one row, so
//! that each pixel of the scene is read once for all of them. Transposes gather, and add frames in fixed order.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

use super::{buffers, empty, groups, numbers, words};
use crate::image::CHANNELS;
use crate::render::{PatchKernels, Placement, RenderGeometry, hat};

/// Neighbouring values that one unit sums.
const AT_ONCE: usize = 8;

/// Words of a region: slot, row and column of the patch; first row of its pixels and the row after them, and so for columns.
const REGION: usize = 7;

/// The patches of a batch of windows on a device, and how pixels blend them.
pub struct Blend {
    batch: usize,
    height: usize,
    width: usize,
    patches: (usize, usize),
    /// Patches that have a kernel.
    slots: usize,
    segments: usize,
    regions: usize,
    /// For each frame, the lower patch of each row, then of each column; and the weight of the upper one.
    lows: CubeTensor,
    uppers: CubeTensor,
    /// The place of each patch's kernel.
    of_patch: CubeTensor,
    /// First column and length of runs of up to [`AT_ONCE`] pixels that blend the same columns of patches; `segments` for each frame.
    runs: CubeTensor,
    /// The patches of each frame with their pixels; `regions` for each frame.
    areas: CubeTensor,
    /// For each slot where its regions begin in the list behind them, one more than slots.
    members: CubeTensor,
}

/// The rectangle of kernels outside of which all are zero: first row, rows, first column, columns.
pub type Support = [usize; 4];

/// The whole of kernels of a radius.
pub fn whole(radius: usize) -> Support {
    [0, 2 * radius + 1, 0, 2 * radius + 1]
}

/// The support of kernels on the host.
pub fn support(kernels: &PatchKernels) -> Support {
    let side = kernels.size();
    let (mut rows, mut cols) = ((side, 0), (side, 0));
    for (i, _) in kernels.values.iter().enumerate().filter(|(_, v)| **v != 0.0) {
        let (row, col) = (i / side % side, i % side);
        rows = (rows.0.min(row), rows.1.max(row + 1));
        cols = (cols.0.min(col), cols.1.max(col + 1));
    }
    if rows.0 >= rows.1 { [0, 1, 0, 1] } else { [rows.0, rows.1 - rows.0, cols.0, cols.1 - cols.0] }
}

impl Blend {
    /// The blend of windows of one size by the patches that have kernels, in their order.
    pub fn new(
        like: &CubeTensor,
        geometry: &RenderGeometry,
        patches: &[usize],
        placements: &[Placement],
        [height, width]: [usize; 2],
    ) -> Self {
        let (patch_rows, patch_cols) = geometry.patches;
        let mut of_patch = vec![0u32; geometry.patch_count()];
        patches.iter().enumerate().for_each(|(slot, patch)| of_patch[*patch] = slot as u32);
        let (mut lows, mut uppers) = (Vec::new(), Vec::new());
        let mut runs: Vec<Vec<[usize; 2]>> = Vec::new();
        let mut regions: Vec<Vec<[usize; REGION]>> = Vec::new();
        for placement in placements {
            let axis = |len, patches, first: usize, count: usize| -> Vec<(usize, f32)> {
                (first..first + count).map(|k| hat(len, patches, k)).collect()
            };
            let rows = axis(geometry.sensor_height, patch_rows, placement.row, height);
            let cols = axis(geometry.sensor_width, patch_cols, placement.col, width);
            for (lower, upper) in rows.iter().chain(&cols) {
                lows.push(*lower as u32);
                uppers.push(*upper);
            }
            // Cut where the columns of patches change.
            let mut of_frame = Vec::new();
            let mut first = 0;
            while first < width {
                let same = cols[first..].iter().take(AT_ONCE).take_while(|c| c.0 == cols[first].0).count();
                of_frame.push([first, same]);
                first += same;
            }
            runs.push(of_frame);
            // The pixels in which each row and each column of patches has a weight.
            let spans = |axis: &[(usize, f32)], patches: usize| -> Vec<Option<(usize, usize)>> {
                let of = |patch: usize| {
                    let has = |k: &usize| weight_of(axis[*k], patch) > 0.0;
                    let first = (0..axis.len()).find(has)?;
                    Some((first, (0..axis.len()).rfind(has)? + 1))
                };
                (0..patches).map(of).collect()
            };
            let (row_spans, col_spans) = (spans(&rows, patch_rows), spans(&cols, patch_cols));
            let mut of_frame = Vec::new();
            for (i, rows) in row_spans.iter().enumerate() {
                for (j, cols) in col_spans.iter().enumerate() {
                    if let (Some(rows), Some(cols)) = (rows, cols) {
                        let slot = of_patch[i * patch_cols + j] as usize;
                        of_frame.push([slot, i, j, rows.0, rows.1, cols.0, cols.1]);
                    }
                }
            }
            regions.push(of_frame);
        }
        let [segments, most] = [runs.iter().map(Vec::len).max(), regions.iter().map(Vec::len).max()]
            .map(|most| most.unwrap_or(0));
        let mut members = vec![Vec::new(); patches.len()];
        for (frame, of_frame) in regions.iter_mut().enumerate() {
            for (k, region) in of_frame.iter().enumerate() {
                members[region[0]].push((frame * most + k) as u32);
            }
            of_frame.resize(most, [0; REGION]);
        }
        runs.iter_mut().for_each(|of_frame| of_frame.resize(segments, [0; 2]));
        let mut listed = vec![members.len() as u32 + 1];
        for of_slot in &members {
            listed.push(listed[listed.len() - 1] + of_slot.len() as u32);
        }
        listed.extend(members.iter().flatten());
        let flat = |values: Vec<usize>| words(like, &values.iter().map(|v| *v as u32).collect::<Vec<_>>());
        Self {
            batch: placements.len(),
            height,
            width,
            patches: geometry.patches,
            slots: patches.len(),
            segments,
            regions: most,
            lows: words(like, &lows),
            uppers: numbers(like, &uppers),
            of_patch: words(like, &of_patch),
            runs: flat(runs.concat().concat()),
            areas: flat(regions.concat().concat()),
            members: words(like, &listed),
        }
    }

    fn sizes(&self, radius: usize, support: Support) -> SizesLaunch {
        let [first_row, rows, first_col, cols] = support;
        let (patch_rows, patch_cols) = self.patches;
        let Self { height, width, segments, regions, .. } = *self;
        SizesLaunch::new(
            height, width, radius, patch_rows, patch_cols, segments, regions, first_row, rows, first_col,
            cols,
        )
    }

    /// The blended pictures `[B,3,H,W]` of scenes with a border of `radius` pixels, by kernels `[slots,3,side,side]`.
    pub fn convolved(
        &self,
        scenes: &CubeTensor,
        kernels: &CubeTensor,
        radius: usize,
        support: Support,
    ) -> CubeTensor {
        let out = empty(scenes, [self.batch, CHANNELS, self.height, self.width]);
        let (count, dim) = groups(scenes, self.batch * CHANNELS * self.height * self.segments);
        let [scenes, kernels, runs, to] = buffers([scenes, kernels, &self.runs, &out]);
        let [lows, uppers, of_patch] = buffers([&self.lows, &self.uppers, &self.of_patch]);
        let sizes = self.sizes(radius, support);
        convolve::launch(&out.client, count, dim, scenes, kernels, lows, uppers, of_patch, runs, to, sizes);
        out
    }

    /// The transpose of [`Self::convolved`] by the kernels, for cotangents `[B,3,H,W]`.
    pub fn by_kernels(&self, scenes: &CubeTensor, gradient: &CubeTensor, radius: usize) -> CubeTensor {
        let side = 2 * radius + 1;
        let per_patch = CHANNELS * side * side;
        let planes = self.batch * self.regions * CHANNELS;
        let weighted = empty(scenes, [planes * self.height * self.width]);
        let (count, dim) = groups(scenes, planes * self.height * self.width);
        let sizes = || self.sizes(radius, whole(radius));
        let [bars, lows, uppers] = buffers([gradient, &self.lows, &self.uppers]);
        let [areas, to] = buffers([&self.areas, &weighted]);
        weigh::launch(&weighted.client, count, dim, bars, lows, uppers, areas, to, sizes());
        let parts = empty(scenes, [planes * side * side]);
        let (count, dim) = groups(scenes, planes * side * side.div_ceil(AT_ONCE));
        let [from, bars, areas, to] = buffers([scenes, &weighted, &self.areas, &parts]);
        correlate::launch(&parts.client, count, dim, from, bars, areas, to, sizes());
        let out = empty(scenes, [self.slots * per_patch]);
        let (count, dim) = groups(scenes, self.slots * per_patch);
        let [parts, members, to] = buffers([&parts, &self.members, &out]);
        add_frames::launch(&out.client, count, dim, parts, members, to, per_patch);
        out
    }

    /// The transpose of [`Self::convolved`] by the scenes, border included.
    pub fn by_scenes(
        &self,
        gradient: &CubeTensor,
        kernels: &CubeTensor,
        radius: usize,
        support: Support,
    ) -> CubeTensor {
        let out = empty(gradient, [self.batch, CHANNELS, self.height + 2 * radius, self.width + 2 * radius]);
        let count = self.batch * CHANNELS * (self.height + 2 * radius) * (self.width + 2 * radius);
        let (count, dim) = groups(gradient, count);
        let [bars, kernels, to] = buffers([gradient, kernels, &out]);
        let [lows, uppers, of_patch] = buffers([&self.lows, &self.uppers, &self.of_patch]);
        let sizes = self.sizes(radius, support);
        spread_back::launch(&out.client, count, dim, bars, kernels, lows, uppers, of_patch, to, sizes);
        out
    }
}

/// The weight of a patch at a pixel of an axis, whose lower patch and weight of the upper one are given.
fn weight_of((lower, upper): (usize, f32), patch: usize) -> f32 {
    if patch == lower {
        1.0 - upper
    } else if patch == lower + 1 {
        upper
    } else {
        0.0
    }
}

/// Sizes of a blend.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
struct Sizes {
    height: usize,
    width: usize,
    radius: usize,
    patch_rows: usize,
    patch_cols: usize,
    segments: usize,
    regions: usize,
    first_row: usize,
    rows: usize,
    first_col: usize,
    cols: usize,
}

/// Neighbouring pixels of a row of a picture.
#[cube(launch)]
fn convolve(
    scenes: &[f32],
    kernels: &[f32],
    lows: &[u32],
    uppers: &[f32],
    of_patch: &[u32],
    runs: &[u32],
    out: &mut [f32],
    sizes: Sizes,
) {
    let at = ABSOLUTE_POS;
    let row = at / sizes.segments % sizes.height;
    let plane = at / sizes.segments / sizes.height;
    let frame = plane / CHANNELS;
    let run = (frame * sizes.segments + at % sizes.segments) * 2;
    if plane * sizes.height * sizes.width < out.len() && run < runs.len() {
        let first = runs[run] as usize;
        let count = runs[run + 1] as usize;
        if count > 0 {
            let side = 2 * sizes.radius + 1;
            let stride = sizes.width + 2 * sizes.radius;
            let scene = plane * (sizes.height + 2 * sizes.radius) * stride;
            let axis = frame * (sizes.height + sizes.width);
            // The kernels of the upper and lower, left and right patches.
            let upper_row = lows[axis + row] as usize;
            let left_col = lows[axis + sizes.height + first] as usize;
            let lower_row = min(upper_row + 1, sizes.patch_rows - 1);
            let right_col = min(left_col + 1, sizes.patch_cols - 1);
            let channel = plane % CHANNELS;
            let per_kernel = side * side;
            let base = channel * per_kernel;
            let per_patch = CHANNELS * per_kernel;
            let upper_left = of_patch[upper_row * sizes.patch_cols + left_col] as usize * per_patch + base;
            let upper_right = of_patch[upper_row * sizes.patch_cols + right_col] as usize * per_patch + base;
            let lower_left = of_patch[lower_row * sizes.patch_cols + left_col] as usize * per_patch + base;
            let lower_right = of_patch[lower_row * sizes.patch_cols + right_col] as usize * per_patch + base;
            let of_lower = uppers[axis + row];
            let of_upper = 1.0f32 - of_lower;
            let mut left_sums = Array::<f32>::new(AT_ONCE);
            let mut right_sums = Array::<f32>::new(AT_ONCE);
            let mut light = Array::<f32>::new(AT_ONCE);
            #[unroll]
            for q in 0..AT_ONCE {
                left_sums[q] = 0.0f32;
                right_sums[q] = 0.0f32;
            }
            let last = scenes.len() - 1;
            for down in 0..sizes.rows {
                let tap_row = sizes.first_row + down;
                // Light at the first pixel under the first tap; taps go left from there.
                let start = scene + (row + side - 1 - tap_row) * stride + first + side - 1 - sizes.first_col;
                #[unroll]
                for q in 1..AT_ONCE {
                    light[q] = scenes[min(start + q, last)];
                }
                let taps = tap_row * side + sizes.first_col;
                for tap in 0..sizes.cols {
                    light[0] = scenes[start - tap];
                    // Along a row the weights of upper and lower patches are constant: mix their kernels first.
                    let k = taps + tap;
                    let left = of_upper * kernels[upper_left + k] + of_lower * kernels[lower_left + k];
                    let right = of_upper * kernels[upper_right + k] + of_lower * kernels[lower_right + k];
                    #[unroll]
                    for q in 0..AT_ONCE {
                        left_sums[q] += left * light[q];
                        right_sums[q] += right * light[q];
                    }
                    // The next tap sees each pixel one to the left.
                    #[unroll]
                    for q in 1..AT_ONCE {
                        light[AT_ONCE - q] = light[AT_ONCE - q - 1];
                    }
                }
            }
            let to = (plane * sizes.height + row) * sizes.width + first;
            let weights = axis + sizes.height + first;
            #[unroll]
            for q in 0..AT_ONCE {
                if q < count {
                    out[to + q] = left_sums[q] + uppers[weights + q] * (right_sums[q] - left_sums[q]);
                }
            }
        }
    }
}

/// The weight of a patch at a pixel of an axis.
#[cube]
fn weight(lows: &[u32], uppers: &[f32], at: usize, patch: u32) -> f32 {
    let upper = uppers[at];
    let is_lower = lows[at] == patch;
    let is_upper = lows[at] + 1u32 == patch;
    select(is_lower, 1.0f32 - upper, select(is_upper, upper, 0.0f32))
}

/// The cotangents of each region: the picture's, weighted by its patch.
#[cube(launch)]
fn weigh(gradient: &[f32], lows: &[u32], uppers: &[f32], areas: &[u32], weighted: &mut [f32], sizes: Sizes) {
    let at = ABSOLUTE_POS;
    if at < weighted.len() {
        let col = at % sizes.width;
        let row = at / sizes.width % sizes.height;
        let plane = at / (sizes.width * sizes.height);
        let region = plane / CHANNELS;
        let frame = region / sizes.regions;
        let axis = frame * (sizes.height + sizes.width);
        let of_row = weight(lows, uppers, axis + row, areas[region * REGION + 1]);
        let of_col = weight(lows, uppers, axis + sizes.height + col, areas[region * REGION + 2]);
        let from = (frame * CHANNELS + plane % CHANNELS) * sizes.height + row;
        weighted[at] = of_row * of_col * gradient[from * sizes.width + col];
    }
}

/// Neighbouring values of the cotangent of a patch's kernel in one frame.
#[cube(launch)]
fn correlate(scenes: &[f32], weighted: &[f32], areas: &[u32], parts: &mut [f32], sizes: Sizes) {
    let at = ABSOLUTE_POS;
    let side = 2 * sizes.radius + 1;
    let blocks = side.div_ceil(AT_ONCE);
    let tap_row = at / blocks % side;
    let plane = at / (blocks * side);
    let region = plane / CHANNELS;
    if region * REGION < areas.len() {
        let first_tap = at % blocks * AT_ONCE;
        let stride = sizes.width + 2 * sizes.radius;
        let scene =
            (region / sizes.regions * CHANNELS + plane % CHANNELS) * (sizes.height + 2 * sizes.radius);
        let first_row = areas[region * REGION + 3] as usize;
        let last_row = areas[region * REGION + 4] as usize;
        let first_col = areas[region * REGION + 5] as usize;
        let last_col = areas[region * REGION + 6] as usize;
        let mut sums = Array::<f32>::new(AT_ONCE);
        let mut of_row = Array::<f32>::new(AT_ONCE);
        let mut light = Array::<f32>::new(AT_ONCE);
        #[unroll]
        for q in 0..AT_ONCE {
            sums[q] = 0.0f32;
        }
        for row in first_row..last_row {
            let bars = (plane * sizes.height + row) * sizes.width;
            // Light at column 0 under the first tap; the others lie left of it.
            let start = (scene + row + side - 1 - tap_row) * stride + side - 1 - first_tap;
            #[unroll]
            for q in 0..AT_ONCE {
                of_row[q] = 0.0f32;
                light[q] = 0.0f32;
                if start + first_col >= q {
                    light[q] = scenes[start + first_col - q];
                }
            }
            for col in first_col..last_col {
                light[0] = scenes[start + col];
                let bar = weighted[bars + col];
                #[unroll]
                for q in 0..AT_ONCE {
                    of_row[q] += bar * light[q];
                }
                #[unroll]
                for q in 1..AT_ONCE {
                    light[AT_ONCE - q] = light[AT_ONCE - q - 1];
                }
            }
            #[unroll]
            for q in 0..AT_ONCE {
                sums[q] += of_row[q];
            }
        }
        let to = (plane * side + tap_row) * side + first_tap;
        #[unroll]
        for q in 0..AT_ONCE {
            if first_tap + q < side {
                parts[to + q] = sums[q];
            }
        }
    }
}

/// Sums of the regions of each slot, in the order of the frames.
#[cube(launch)]
fn add_frames(parts: &[f32], members: &[u32], out: &mut [f32], per_patch: usize) {
    let at = ABSOLUTE_POS;
    if at < out.len() {
        let slot = at / per_patch;
        let mut sum = 0.0f32;
        for k in members[slot]..members[slot + 1] {
            sum += parts[members[k as usize] as usize * per_patch + at % per_patch];
        }
        out[at] = sum;
    }
}

/// The cotangent of one pixel of a scene: what the pixels within the reach of the kernels give back.
#[cube(launch)]
fn spread_back(
    gradient: &[f32],
    kernels: &[f32],
    lows: &[u32],
    uppers: &[f32],
    of_patch: &[u32],
    out: &mut [f32],
    sizes: Sizes,
) {
    let at = ABSOLUTE_POS;
    if at < out.len() {
        let side = 2 * sizes.radius + 1;
        let stride = sizes.width + 2 * sizes.radius;
        let scene_rows = sizes.height + 2 * sizes.radius;
        let scene_col = at % stride;
        let scene_row = at / stride % scene_rows;
        let plane = at / (stride * scene_rows);
        let frame = plane / CHANNELS;
        let per_kernel = side * side;
        let per_patch = CHANNELS * per_kernel;
        let base = plane % CHANNELS * per_kernel;
        let axis = frame * (sizes.height + sizes.width);
        let columns = axis + sizes.height;
        let mut sum = 0.0f32;
        for down in 0..sizes.rows {
            let tap_row = sizes.first_row + down;
            // The pixel that took this light by the tap, counted from `side - 1` on.
            let from_row = scene_row + tap_row;
            if from_row >= side - 1 && from_row < sizes.height + side - 1 {
                let row = from_row - (side - 1);
                let of_lower = uppers[axis + row];
                let upper_row = lows[axis + row] as usize;
                let lower_row = min(upper_row + 1, sizes.patch_rows - 1);
                for right in 0..sizes.cols {
                    let tap_col = sizes.first_col + right;
                    let from_col = scene_col + tap_col;
                    if from_col >= side - 1 && from_col < sizes.width + side - 1 {
                        let col = from_col - (side - 1);
                        let of_right = uppers[columns + col];
                        let left_col = lows[columns + col] as usize;
                        let right_col = min(left_col + 1, sizes.patch_cols - 1);
                        let k = base + tap_row * side + tap_col;
                        let upper_left = kernels
                            [of_patch[upper_row * sizes.patch_cols + left_col] as usize * per_patch + k];
                        let upper_right = kernels
                            [of_patch[upper_row * sizes.patch_cols + right_col] as usize * per_patch + k];
                        let lower_left = kernels
                            [of_patch[lower_row * sizes.patch_cols + left_col] as usize * per_patch + k];
                        let lower_right = kernels
                            [of_patch[lower_row * sizes.patch_cols + right_col] as usize * per_patch + k];
                        let upper = upper_left + of_right * (upper_right - upper_left);
                        let lower = lower_left + of_right * (lower_right - lower_left);
                        let bar = gradient[(plane * sizes.height + row) * sizes.width + col];
                        sum += bar * (upper + of_lower * (lower - upper));
                    }
                }
            }
        }
        out[at] = sum;
    }
}
