//! Linear development on a device: dark signal, white balance, variance stabilisation, demosaicing of Bayer arrays.
//!
//! Frames get the mirrored border that the CPU's strips have, so that no step looks beyond its plane. The steps of Menon's method are those
//! of `develop/demosaic/menon.rs`, one kernel each; a step writes no value that another pixel reads in the same step. Adjoints gather: each
//! pixel adds what its neighbours give back, so that sums have one order.

use burn::backend::DispatchTensor;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

use super::bordered::{
    BARS, BORDER, GREEN, NUMBERS, Sizes, SizesLaunch, Step, colour, is_within, margin_of, mirrored, place,
};
use super::develop_back::{begin_back, fold, measured_back, step_back};
use super::{buffers, empty, given, groups, numbers, taken, words};
use crate::develop::{Demosaic, Domain, Stabiliser, dark_mean_dn, light_per_dn};
use crate::image::CHANNELS;
use crate::sensor::Colour;
use crate::tape::develop_op::DevelopKernel;
use crate::tape::{BackwardPass, DeviceForm, is_served};

/// A batch with what its kernels read.
struct Frames {
    raw: CubeTensor,
    numbers: CubeTensor,
    /// Row and column of the first red pixel of each frame.
    words: CubeTensor,
}

impl DevelopKernel {
    fn frames(&self, raw: &DispatchTensor) -> Frames {
        let raw = taken(raw);
        let (mut all_numbers, mut all_words) = (Vec::new(), Vec::new());
        for capture in &self.captures {
            let exposure = &capture.exposure;
            let scale = light_per_dn(&self.sensor, exposure);
            all_numbers.push(dark_mean_dn(&self.sensor, exposure) as f32);
            all_numbers.extend((0..CHANNELS).map(|c| scale[c] as f32));
            all_numbers.push(Stabiliser::of_sensor(&self.sensor, exposure).offset());
            let place = capture.placement;
            let is_red = |at: &u32| {
                let (row, col) = (place.row + (at / 2) as usize, place.col + (at % 2) as usize);
                self.sensor.cfa.colour(row, col) == Colour::Red
            };
            let red = (0..4u32).find(is_red).expect("a Bayer array has a red pixel in every tile");
            all_words.extend([red / 2, red % 2]);
        }
        Frames { numbers: numbers(&raw, &all_numbers), words: words(&raw, &all_words), raw }
    }

    fn is_stabilised(&self) -> bool {
        self.interpolation.domain == Domain::Stabilised
    }

    /// Pixels of a bordered frame.
    fn bordered(&self) -> usize {
        let [_, _, height, width] = self.shape;
        (height + 2 * BORDER) * (width + 2 * BORDER)
    }

    fn sizes(&self) -> SizesLaunch {
        let [_, _, height, width] = self.shape;
        SizesLaunch::new(height, width)
    }

    /// Bordered frames: the mosaic of each, and its interpolated planes; and the directions of Menon's method, of one number otherwise.
    fn interpolated(&self, frames: &Frames) -> (CubeTensor, CubeTensor, CubeTensor) {
        let [batch, ..] = self.shape;
        let n = batch * self.bordered();
        let [mosaic, planes] = [1, CHANNELS].map(|c| empty(&frames.raw, [n * c]));
        let (count, dim) = groups(&mosaic, n);
        let [raw, levels, reds, to] = buffers([&frames.raw, &frames.numbers, &frames.words, &mosaic]);
        let (client, sizes, is_stabilised) = (&mosaic.client, self.sizes(), self.is_stabilised());
        balance::launch(client, count.clone(), dim, raw, levels, reds, to, sizes, is_stabilised);
        let [of_mosaic, of_words] = buffers([&mosaic, &frames.words]);
        if self.interpolation.demosaic != Demosaic::Menon {
            let [of_planes] = buffers([&planes]);
            if self.interpolation.demosaic == Demosaic::Malvar {
                malvar::launch(client, count, dim, of_mosaic, of_words, of_planes, self.sizes());
            } else {
                bilinear::launch(client, count, dim, of_mosaic, of_words, of_planes, self.sizes());
            }
            let none = numbers(&mosaic, &[]);
            return (mosaic, planes, none);
        }
        let steps = empty(&mosaic, [n]);
        let ([of_steps, of_planes], sizes) = (buffers([&steps, &planes]), self.sizes());
        let cubes = count.clone();
        directions_and_green::launch(client, cubes, dim, of_mosaic, of_words, of_steps, of_planes, sizes);
        let all = [
            Step::ChromaAtGreen,
            Step::Opposite,
            Step::RefinedGreen,
            Step::RefinedChroma,
            Step::RefinedOpposite,
        ];
        for step in all {
            let [of_words, of_steps, of_planes] = buffers([&frames.words, &steps, &planes]);
            take_step::launch(client, count.clone(), dim, of_words, of_steps, of_planes, self.sizes(), step);
        }
        (mosaic, planes, steps)
    }
}

impl DeviceForm for DevelopKernel {
    fn serves(&self, input: &DispatchTensor) -> bool {
        self.interpolation.demosaic.is_differentiable() && self.sensor.cfa.is_bayer() && is_served(input)
    }

    fn forward(&self, inputs: &[DispatchTensor], _: &[bool]) -> DispatchTensor {
        let frames = self.frames(&inputs[0]);
        let (_, planes, _) = self.interpolated(&frames);
        let picture = empty(&planes, self.shape);
        let (count, dim) = groups(&picture, self.shape.iter().product());
        let [planes, levels, to] = buffers([&planes, &frames.numbers, &picture]);
        finish::launch(&picture.client, count, dim, planes, levels, to, self.sizes(), self.is_stabilised());
        given(picture)
    }

    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        let [batch, _, height, width] = self.shape;
        let frames = self.frames(&inputs[0]);
        let (mosaic, planes, steps) = self.interpolated(&frames);
        let (client, n) = (mosaic.client.clone(), batch * self.bordered());
        let [mut bars, mut next] = [(); 2].map(|()| empty(&mosaic, [n * BARS]));
        // The cotangents of the planes in a border of zeros.
        let (count, dim) = groups(&mosaic, n);
        let [from, of_planes, levels, to] = buffers([&taken(at.gradient), &planes, &frames.numbers, &bars]);
        let (sizes, is_stabilised) = (self.sizes(), self.is_stabilised());
        begin_back::launch(&client, count.clone(), dim, from, of_planes, levels, to, sizes, is_stabilised);
        drop(planes);
        let is_menon = self.interpolation.demosaic == Demosaic::Menon;
        let all = [
            Step::RefinedOpposite,
            Step::RefinedChroma,
            Step::RefinedGreen,
            Step::Opposite,
            Step::ChromaAtGreen,
            Step::Green,
        ];
        for step in all.into_iter().take(if is_menon { all.len() } else { 0 }) {
            let [of_words, of_steps, from, to] = buffers([&frames.words, &steps, &bars, &next]);
            step_back::launch(&client, count.clone(), dim, of_words, of_steps, from, to, self.sizes(), step);
            std::mem::swap(&mut bars, &mut next);
        }
        let of_mosaic = empty(&mosaic, [n]);
        let [of_words, from, to] = buffers([&frames.words, &bars, &of_mosaic]);
        let demosaic = self.interpolation.demosaic;
        measured_back::launch(&client, count, dim, of_words, from, to, self.sizes(), demosaic);
        // The border goes back to the pixels that it mirrors, and from light to digital numbers.
        let d_raw = empty(&mosaic, [batch, 1, height, width]);
        let (count, dim) = groups(&mosaic, batch * height * width);
        let [from, mosaic, to] = buffers([&of_mosaic, &mosaic, &d_raw]);
        let [levels, reds] = buffers([&frames.numbers, &frames.words]);
        fold::launch(&client, count, dim, from, mosaic, levels, reds, to, self.sizes(), is_stabilised);
        vec![Some(given(d_raw))]
    }
}

/// The stabilised value of light; see [`Stabiliser`].
#[cube]
fn stabilised(light: f32, offset: f32) -> f32 {
    let sum = light + offset;
    let least = 0.25f32 * offset;
    let root = least.sqrt();
    if sum >= least { sum.sqrt() } else { root + (sum - least) / (2.0f32 * root) }
}

#[cube]
fn light_of(value: f32, offset: f32) -> f32 {
    let least = 0.25f32 * offset;
    let root = least.sqrt();
    let sum = if value >= root { value * value } else { least + 2.0f32 * root * (value - root) };
    sum - offset
}

/// The mosaic of every frame with its border: light, or its stabilised values.
#[cube(launch)]
fn balance(
    raw: &[f32],
    numbers: &[f32],
    words: &[u32],
    mosaic: &mut [f32],
    sizes: Sizes,
    #[comptime] is_stabilised: bool,
) {
    let at = ABSOLUTE_POS;
    if at < mosaic.len() {
        let place = place(at, words, &sizes);
        let of = place.frame * NUMBERS;
        let row = mirrored(place.row, sizes.height);
        let col = mirrored(place.col, sizes.width);
        let dn = raw[(place.frame * sizes.height + row) * sizes.width + col];
        // Without the dark signal, and scaled by colour so that white light gives equal values.
        let light = (dn - numbers[of]) * numbers[of + 1 + colour(place.in_red_row, place.in_red_col)];
        if comptime!(is_stabilised) {
            mosaic[at] = stabilised(light, numbers[of + 4]);
        } else {
            mosaic[at] = light;
        }
    }
}

/// The pictures of interpolated planes: without the border, as light.
#[cube(launch)]
fn finish(
    planes: &[f32],
    numbers: &[f32],
    picture: &mut [f32],
    sizes: Sizes,
    #[comptime] is_stabilised: bool,
) {
    let at = ABSOLUTE_POS;
    if at < picture.len() {
        let col = at % sizes.width;
        let row = at / sizes.width % sizes.height;
        let of_plane = at / (sizes.width * sizes.height);
        let stride = sizes.width + 2 * BORDER;
        let rows = sizes.height + 2 * BORDER;
        let value = planes[(of_plane * rows + row + BORDER) * stride + col + BORDER];
        if comptime!(is_stabilised) {
            picture[at] = light_of(value, numbers[of_plane / CHANNELS * NUMBERS + 4]);
        } else {
            picture[at] = value;
        }
    }
}

/// Bilinear interpolation: the mean of the nearest pixels of a colour.
#[cube(launch)]
fn bilinear(mosaic: &[f32], words: &[u32], planes: &mut [f32], sizes: Sizes) {
    let at = ABSOLUTE_POS;
    if at < mosaic.len() {
        let place = place(at, words, &sizes);
        if is_within(&place, place.row, place.col, 1) {
            let s = place.stride;
            let out = place.frame * CHANNELS * place.plane + place.i;
            let across = (mosaic[at - 1] + mosaic[at + 1]) * 0.5f32;
            let along = (mosaic[at - s] + mosaic[at + s]) * 0.5f32;
            if place.in_red_row == place.in_red_col {
                let edges = (mosaic[at - s] + mosaic[at - 1] + mosaic[at + 1] + mosaic[at + s]) * 0.25f32;
                let upper = mosaic[at - s - 1] + mosaic[at - s + 1];
                let corners = (upper + mosaic[at + s - 1] + mosaic[at + s + 1]) * 0.25f32;
                planes[out] = select(place.in_red_row, mosaic[at], corners);
                planes[out + place.plane] = edges;
                planes[out + 2 * place.plane] = select(place.in_red_row, corners, mosaic[at]);
            } else {
                planes[out] = select(place.in_red_row, across, along);
                planes[out + place.plane] = mosaic[at];
                planes[out + 2 * place.plane] = select(place.in_red_row, along, across);
            }
        }
    }
}

/// Bilinear values, corrected by the Laplacian of the measured colour; see `develop/demosaic/malvar.rs`.
#[cube(launch)]
fn malvar(mosaic: &[f32], words: &[u32], planes: &mut [f32], sizes: Sizes) {
    let at = ABSOLUTE_POS;
    if at < mosaic.len() {
        let place = place(at, words, &sizes);
        if is_within(&place, place.row, place.col, 2) {
            let s = place.stride;
            let red = place.frame * CHANNELS * place.plane + place.i;
            let green = red + place.plane;
            let blue = green + place.plane;
            let here = mosaic[at];
            let near_h = mosaic[at - 1] + mosaic[at + 1];
            let near_v = mosaic[at - s] + mosaic[at + s];
            let upper = mosaic[at - s - 1] + mosaic[at - s + 1];
            let diagonal = upper + mosaic[at + s - 1] + mosaic[at + s + 1];
            let far_h = mosaic[at - 2] + mosaic[at + 2];
            let far_v = mosaic[at - 2 * s] + mosaic[at + 2 * s];
            // The colour of the row's other pixels, and that of the column's; or that which the pixel did not measure.
            let mut of_row = here;
            let mut of_col = (6.0f32 * here + 2.0f32 * diagonal - 1.5f32 * (far_h + far_v)) / 8.0f32;
            let mut of_green = (4.0f32 * here + 2.0f32 * (near_h + near_v) - far_h - far_v) / 8.0f32;
            if place.in_red_row != place.in_red_col {
                of_green = here;
                of_row = (5.0f32 * here + 4.0f32 * near_h - diagonal - far_h + 0.5f32 * far_v) / 8.0f32;
                of_col = (5.0f32 * here + 4.0f32 * near_v - diagonal - far_v + 0.5f32 * far_h) / 8.0f32;
            }
            planes[red] = select(place.in_red_row, of_row, of_col);
            planes[green] = of_green;
            planes[blue] = select(place.in_red_row, of_col, of_row);
        }
    }
}

/// Difference of the measured colour from green, interpolated along a step.
#[cube]
fn difference(mosaic: &[f32], i: usize, step: usize) -> f32 {
    let green = 0.5f32 * (mosaic[i - step] + mosaic[i + step]);
    let laplacian = 0.5f32 * mosaic[i] - 0.25f32 * (mosaic[i - 2 * step] + mosaic[i + 2 * step]);
    mosaic[i] - (green + laplacian)
}

/// How much a difference changes from a pixel to the next of its colour along the step.
#[cube]
fn change(mosaic: &[f32], i: usize, step: usize) -> f32 {
    (difference(mosaic, i, step) - difference(mosaic, i + 2 * step, step)).abs()
}

#[cube]
fn changes(mosaic: &[f32], i: usize, step: usize) -> f32 {
    change(mosaic, i, step) + change(mosaic, i - 2 * step, step)
}

/// How much a difference varies around a pixel, along its own direction.
#[cube]
fn variation(mosaic: &[f32], i: usize, step: usize, across: usize) -> f32 {
    let beside = changes(mosaic, i - 2 * across, step) + changes(mosaic, i + 2 * across, step);
    3.0f32 * changes(mosaic, i, step)
        + beside
        + change(mosaic, i - across - step, step)
        + change(mosaic, i + across - step, step)
}

/// The direction of each red and blue pixel (1 along the column, 0 along the row), and green there.
#[cube(launch)]
fn directions_and_green(mosaic: &[f32], words: &[u32], steps: &mut [f32], planes: &mut [f32], sizes: Sizes) {
    let at = ABSOLUTE_POS;
    if at < mosaic.len() {
        let place = place(at, words, &sizes);
        let mut is_along_col = 0.0f32;
        let mut green = mosaic[at];
        if place.in_red_row == place.in_red_col && is_within(&place, place.row, place.col, GREEN) {
            let s = place.stride;
            let mut step = 1usize;
            if variation(mosaic, at, s, 1) < variation(mosaic, at, 1, s) {
                is_along_col = 1.0f32;
                step = s;
            }
            // The mean of its neighbours along the direction, corrected by the Laplacian of the measured colour.
            let laplacian = 0.5f32 * mosaic[at] - 0.25f32 * (mosaic[at - 2 * step] + mosaic[at + 2 * step]);
            green = 0.5f32 * (mosaic[at - step] + mosaic[at + step]) + laplacian;
        }
        steps[at] = is_along_col;
        let out = place.frame * CHANNELS * place.plane + place.i;
        planes[out] = mosaic[at];
        planes[out + place.plane] = green;
        planes[out + 2 * place.plane] = mosaic[at];
    }
}

/// One step of Menon's method behind that of green, in place.
#[cube(launch)]
fn take_step(words: &[u32], steps: &[f32], planes: &mut [f32], sizes: Sizes, #[comptime] step: Step) {
    let at = ABSOLUTE_POS;
    if at < steps.len() {
        let place = place(at, words, &sizes);
        let margin = comptime!(margin_of(step));
        let is_green = place.in_red_row != place.in_red_col;
        if is_within(&place, place.row, place.col, margin) {
            let red = place.frame * CHANNELS * place.plane + place.i;
            let green = red + place.plane;
            let blue = green + place.plane;
            let s = place.stride;
            if comptime!(matches!(step, Step::ChromaAtGreen | Step::RefinedChroma)) {
                if is_green {
                    // Red and blue at green: along the row or the column in which they were measured.
                    let of_red = select(place.in_red_row, 1usize, s);
                    let of_blue = select(place.in_red_row, s, 1usize);
                    let of_green = 0.5f32 * (planes[green - of_red] + planes[green + of_red]);
                    let mean = 0.5f32 * (planes[red - of_red] + planes[red + of_red]);
                    planes[red] = planes[green] + mean - of_green;
                    let of_green = 0.5f32 * (planes[green - of_blue] + planes[green + of_blue]);
                    let mean = 0.5f32 * (planes[blue - of_blue] + planes[blue + of_blue]);
                    planes[blue] = planes[green] + mean - of_green;
                }
            } else if !is_green {
                let along = select(steps[at] > 0.5f32, s, 1usize);
                let own = select(place.in_red_row, red, blue);
                let other = select(place.in_red_row, blue, red);
                if comptime!(matches!(step, Step::Opposite)) {
                    // Red at blue and blue at red: along the chosen direction.
                    let of_other = 0.5f32 * (planes[other - along] + planes[other + along]);
                    let of_own = 0.5f32 * (planes[own - along] + planes[own + along]);
                    planes[other] = planes[own] + of_other - of_own;
                } else {
                    // The low-pass of the difference to green, or of that to the other colour, along the chosen direction.
                    let to = if comptime!(matches!(step, Step::RefinedGreen)) { green } else { other };
                    let low = (planes[own - along] - planes[to - along] + planes[own] - planes[to]
                        + planes[own + along]
                        - planes[to + along])
                        / 3.0f32;
                    planes[to] = planes[own] - low;
                }
            }
        }
    }
}
