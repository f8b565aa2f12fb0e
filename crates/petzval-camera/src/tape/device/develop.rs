//! Linear development on a device: dark signal, white balance, variance stabilisation, demosaicing of Bayer arrays.
//!
//! Frames get the mirrored border that the CPU's strips have, so that no step looks beyond its plane. The steps of Menon's method are those
//! of `develop/demosaic/menon.rs`, one kernel each; a step writes no value that another pixel reads in the same step. Adjoints gather: each
//! pixel adds what its neighbours give back, so that sums have one order.

use burn::backend::DispatchTensor;
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;

use super::{empty, given, groups, is_served, numbers, taken, words};
use crate::develop::{Demosaic, Domain, Stabiliser, dark_mean_dn, light_per_dn};
use crate::image::CHANNELS;
use crate::sensor::Colour;
use crate::tape::DeviceForm;
use crate::tape::develop_op::DevelopKernel;

/// Border around a frame, even so that it keeps the phase of the array: as far as the farthest-reaching method looks.
const BORDER: usize = 12;

/// Numbers of one capture: dark level, light per digital number of red, green, blue, and the offset of the square root.
const NUMBERS: usize = 5;

/// Planes of a frame's cotangents: red, green, blue, and the mosaic.
const BARS: usize = CHANNELS + 1;

/// Distance from the edge of the bordered frame at which each step of Menon's method begins.
const GREEN: usize = 6;
const CHROMA_AT_GREEN: usize = 7;
const OPPOSITE: usize = 8;
const REFINED_GREEN: usize = 9;
const REFINED_CHROMA: usize = 10;
const REFINED_OPPOSITE: usize = 11;

/// Step of an adjoint, in the order of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Step {
    Green,
    ChromaAtGreen,
    Opposite,
    RefinedGreen,
    RefinedChroma,
    RefinedOpposite,
}

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
        balance::launch(
            &mosaic.client,
            count.clone(),
            dim,
            frames.raw.clone().into_buffer_arg(),
            frames.numbers.clone().into_buffer_arg(),
            frames.words.clone().into_buffer_arg(),
            mosaic.clone().into_buffer_arg(),
            self.sizes(),
            self.is_stabilised(),
        );
        let [of_mosaic, of_words] = [&mosaic, &frames.words].map(|t| t.clone().into_buffer_arg());
        if self.interpolation.demosaic != Demosaic::Menon {
            let (client, of_planes) = (&mosaic.client, planes.clone().into_buffer_arg());
            if self.interpolation.demosaic == Demosaic::Malvar {
                malvar::launch(client, count, dim, of_mosaic, of_words, of_planes, self.sizes());
            } else {
                bilinear::launch(client, count, dim, of_mosaic, of_words, of_planes, self.sizes());
            }
            let none = numbers(&mosaic, &[]);
            return (mosaic, planes, none);
        }
        let steps = empty(&mosaic, [n]);
        let [of_steps, of_planes] = [&steps, &planes].map(|t| t.clone().into_buffer_arg());
        directions_and_green::launch(
            &mosaic.client,
            count.clone(),
            dim,
            of_mosaic,
            of_words,
            of_steps,
            of_planes,
            self.sizes(),
        );
        let all = [
            Step::ChromaAtGreen,
            Step::Opposite,
            Step::RefinedGreen,
            Step::RefinedChroma,
            Step::RefinedOpposite,
        ];
        for step in all {
            let [of_steps, of_planes] = [&steps, &planes].map(|t| t.clone().into_buffer_arg());
            let of_words = frames.words.clone().into_buffer_arg();
            let (client, count) = (&mosaic.client, count.clone());
            take_step::launch(client, count, dim, of_words, of_steps, of_planes, self.sizes(), step);
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
        finish::launch(
            &picture.client,
            count,
            dim,
            planes.into_buffer_arg(),
            frames.numbers.into_buffer_arg(),
            picture.clone().into_buffer_arg(),
            self.sizes(),
            self.is_stabilised(),
        );
        given(picture)
    }

    fn backward(
        &self,
        inputs: &[DispatchTensor],
        _: Option<&DispatchTensor>,
        gradient: &DispatchTensor,
        _: &[bool],
    ) -> Vec<Option<DispatchTensor>> {
        let [batch, _, height, width] = self.shape;
        let frames = self.frames(&inputs[0]);
        let (mosaic, planes, steps) = self.interpolated(&frames);
        let (client, n) = (mosaic.client.clone(), batch * self.bordered());
        let [mut bars, mut next] = [(); 2].map(|()| empty(&mosaic, [n * BARS]));
        // The cotangents of the planes in a border of zeros.
        let (count, dim) = groups(&mosaic, n);
        begin_back::launch(
            &client,
            count.clone(),
            dim,
            taken(gradient).into_buffer_arg(),
            planes.into_buffer_arg(),
            frames.numbers.clone().into_buffer_arg(),
            bars.clone().into_buffer_arg(),
            self.sizes(),
            self.is_stabilised(),
        );
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
            let [from, to] = [&bars, &next].map(|t| t.clone().into_buffer_arg());
            let [of_words, of_steps] = [&frames.words, &steps].map(|t| t.clone().into_buffer_arg());
            step_back::launch(&client, count.clone(), dim, of_words, of_steps, from, to, self.sizes(), step);
            std::mem::swap(&mut bars, &mut next);
        }
        let of_mosaic = empty(&mosaic, [n]);
        measured_back::launch(
            &client,
            count,
            dim,
            frames.words.clone().into_buffer_arg(),
            bars.into_buffer_arg(),
            of_mosaic.clone().into_buffer_arg(),
            self.sizes(),
            self.interpolation.demosaic,
        );
        // The border goes back to the pixels that it mirrors, and from light to digital numbers.
        let d_raw = empty(&mosaic, [batch, 1, height, width]);
        let (count, dim) = groups(&mosaic, batch * height * width);
        fold::launch(
            &client,
            count,
            dim,
            of_mosaic.into_buffer_arg(),
            mosaic.into_buffer_arg(),
            frames.numbers.into_buffer_arg(),
            frames.words.into_buffer_arg(),
            d_raw.clone().into_buffer_arg(),
            self.sizes(),
            self.is_stabilised(),
        );
        vec![Some(given(d_raw))]
    }
}

/// Pixels of a frame without its border.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
struct Sizes {
    height: usize,
    width: usize,
}

/// A pixel of a bordered frame.
#[derive(CubeType, Clone, Copy)]
struct Place {
    frame: usize,
    row: usize,
    col: usize,
    /// Index in the frame's plane.
    i: usize,
    /// Elements of a row, and of a plane.
    stride: usize,
    plane: usize,
    rows: usize,
    /// Whether the pixel is in a row, and in a column, with red.
    in_red_row: bool,
    in_red_col: bool,
}

#[cube]
fn place(at: usize, words: &[u32], sizes: &Sizes) -> Place {
    let stride = sizes.width + 2 * BORDER;
    let rows = sizes.height + 2 * BORDER;
    let plane = rows * stride;
    let frame = at / plane;
    let i = at % plane;
    let row = i / stride;
    let col = i % stride;
    // The border is even: it does not change the phase.
    let in_red_row = row % 2 == words[2 * frame] as usize;
    let in_red_col = col % 2 == words[2 * frame + 1] as usize;
    Place { frame, row, col, i, stride, plane, rows, in_red_row, in_red_col }
}

/// Whether a pixel is at least `margin` from the edge of its bordered frame.
#[cube]
fn is_within(place: &Place, row: usize, col: usize, margin: usize) -> bool {
    row >= margin && row < place.rows - margin && col >= margin && col < place.stride - margin
}

/// The pixel at which position `at` of a bordered line lands when the outermost pixels are mirrors.
#[cube]
fn mirrored(at: usize, len: usize) -> usize {
    let period = 2 * (len - 1);
    // Whole periods keep the number positive.
    let in_period = (at + BORDER * period - BORDER) % period;
    min(in_period, period - in_period)
}

/// The colour that a pixel measured: 0, 1, 2.
#[cube]
fn colour(in_red_row: bool, in_red_col: bool) -> usize {
    let mut colour = 1usize;
    if in_red_row && in_red_col {
        colour = 0usize;
    }
    if !in_red_row && !in_red_col {
        colour = 2usize;
    }
    colour
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

/// Where a step begins.
fn margin_of(step: Step) -> usize {
    match step {
        Step::Green => GREEN,
        Step::ChromaAtGreen => CHROMA_AT_GREEN,
        Step::Opposite => OPPOSITE,
        Step::RefinedGreen => REFINED_GREEN,
        Step::RefinedChroma => REFINED_CHROMA,
        Step::RefinedOpposite => REFINED_OPPOSITE,
    }
}

/// Cotangents of the interpolated planes from those of the picture, in a border of zeros; that of the mosaic is zero.
#[cube(launch)]
fn begin_back(
    d_picture: &[f32],
    planes: &[f32],
    numbers: &[f32],
    bars: &mut [f32],
    sizes: Sizes,
    #[comptime] is_stabilised: bool,
) {
    let at = ABSOLUTE_POS;
    let stride = sizes.width + 2 * BORDER;
    let rows = sizes.height + 2 * BORDER;
    let plane = rows * stride;
    if at < bars.len() / BARS {
        let frame = at / plane;
        let i = at % plane;
        let row = i / stride;
        let col = i % stride;
        let is_inside =
            row >= BORDER && row < sizes.height + BORDER && col >= BORDER && col < sizes.width + BORDER;
        for c in 0..CHANNELS {
            let mut bar = 0.0f32;
            if is_inside {
                let of = (frame * CHANNELS + c) * sizes.height + row - BORDER;
                bar = d_picture[of * sizes.width + col - BORDER];
                if comptime!(is_stabilised) {
                    // The slope of the square that takes values back to light.
                    let root = (0.25f32 * numbers[frame * NUMBERS + 4]).sqrt();
                    bar *= 2.0f32 * max(planes[(frame * CHANNELS + c) * plane + i], root);
                }
            }
            bars[(frame * BARS + c) * plane + i] = bar;
        }
        bars[(frame * BARS + CHANNELS) * plane + i] = 0.0f32;
    }
}

/// The cotangent that a red or blue neighbour of a green pixel gives back, if its direction points here: own colour's plane of the
/// neighbour is `from`.
#[cube]
fn pointed(
    place: &Place,
    steps: &[f32],
    bars: &[f32],
    row: usize,
    col: usize,
    is_column: bool,
    plane: usize,
    margin: usize,
) -> f32 {
    let mut bar = 0.0f32;
    if is_within(place, row, col, margin) {
        let i = row * place.stride + col;
        let is_along_col = steps[place.frame * place.plane + i] > 0.5f32;
        if is_along_col == is_column {
            bar = bars[plane + i];
        }
    }
    bar
}

/// A cotangent, zero outside the margin.
#[cube]
fn within(place: &Place, bars: &[f32], row: usize, col: usize, plane: usize, margin: usize) -> f32 {
    let mut bar = 0.0f32;
    if is_within(place, row, col, margin) {
        bar = bars[plane + row * place.stride + col];
    }
    bar
}

/// The transpose of one step of Menon's method: every pixel gathers from its neighbours.
#[cube(launch)]
fn step_back(
    words: &[u32],
    steps: &[f32],
    bars: &[f32],
    out: &mut [f32],
    sizes: Sizes,
    #[comptime] step: Step,
) {
    let at = ABSOLUTE_POS;
    if at < steps.len() {
        let place = place(at, words, &sizes);
        let margin = comptime!(margin_of(step));
        let red = place.frame * BARS * place.plane;
        let green = red + place.plane;
        let blue = green + place.plane;
        let i = place.i;
        let mut d_red = bars[red + i];
        let mut d_green = bars[green + i];
        let mut d_blue = bars[blue + i];
        let mut d_mosaic = bars[blue + place.plane + i];
        let is_green = place.in_red_row != place.in_red_col;
        let is_own = is_within(&place, place.row, place.col, margin);
        // Nothing is given back to the outermost pixels: no step begins beside them.
        if is_within(&place, place.row, place.col, 2) {
            let up = place.row - 1;
            let down = place.row + 1;
            let left = place.col - 1;
            let right = place.col + 1;
            if comptime!(matches!(step, Step::RefinedChroma | Step::ChromaAtGreen)) {
                if is_green {
                    if is_own {
                        d_green += d_red + d_blue;
                        d_red = 0.0f32;
                        d_blue = 0.0f32;
                    }
                } else {
                    // The four green neighbours took this pixel's colour from it.
                    let own = select(place.in_red_row, red, blue);
                    let half = 0.5f32
                        * (within(&place, bars, place.row, left, own, margin)
                            + within(&place, bars, place.row, right, own, margin)
                            + within(&place, bars, up, place.col, own, margin)
                            + within(&place, bars, down, place.col, own, margin));
                    d_green -= half;
                    if comptime!(matches!(step, Step::ChromaAtGreen)) {
                        d_mosaic += half;
                    } else if place.in_red_row {
                        d_red += half;
                    } else {
                        d_blue += half;
                    }
                }
            } else if is_green {
                // Neighbours in this row are red where the row is one of red; those in the column are the others. What they gave is the
                // cotangent of their green, or of the colour that they did not measure.
                let is_of_green = comptime!(matches!(step, Step::RefinedGreen | Step::Green));
                let own_in_row = select(place.in_red_row, red, blue);
                let own_in_col = select(place.in_red_row, blue, red);
                let mut from_row = green;
                let mut from_col = green;
                if comptime!(!is_of_green) {
                    from_row = own_in_col;
                    from_col = own_in_row;
                }
                let by_row = pointed(&place, steps, bars, place.row, left, false, from_row, margin)
                    + pointed(&place, steps, bars, place.row, right, false, from_row, margin);
                let by_col = pointed(&place, steps, bars, up, place.col, true, from_col, margin)
                    + pointed(&place, steps, bars, down, place.col, true, from_col, margin);
                let of_red = select(place.in_red_row, by_row, by_col);
                let of_blue = select(place.in_red_row, by_col, by_row);
                // `of_red` comes from red pixels.
                if comptime!(matches!(step, Step::RefinedOpposite)) {
                    d_red += (of_blue - of_red) / 3.0f32;
                    d_blue += (of_red - of_blue) / 3.0f32;
                } else if comptime!(matches!(step, Step::RefinedGreen)) {
                    d_red -= of_red / 3.0f32;
                    d_blue -= of_blue / 3.0f32;
                    d_green += (of_red + of_blue) / 3.0f32;
                } else if comptime!(matches!(step, Step::Opposite)) {
                    d_red += 0.5f32 * (of_blue - of_red);
                    d_blue += 0.5f32 * (of_red - of_blue);
                } else {
                    d_mosaic += 0.5f32 * (of_red + of_blue);
                }
            } else {
                if is_own {
                    let other = select(place.in_red_row, d_blue, d_red);
                    let mut to_own = 0.0f32;
                    if comptime!(matches!(step, Step::RefinedOpposite)) {
                        to_own = other - other / 3.0f32;
                        if place.in_red_row {
                            d_blue = other / 3.0f32;
                        } else {
                            d_red = other / 3.0f32;
                        }
                    } else if comptime!(matches!(step, Step::RefinedGreen)) {
                        to_own = d_green - d_green / 3.0f32;
                        d_green /= 3.0f32;
                    } else if comptime!(matches!(step, Step::Opposite)) {
                        d_mosaic += other;
                        if place.in_red_row {
                            d_blue = 0.0f32;
                        } else {
                            d_red = 0.0f32;
                        }
                    } else {
                        d_mosaic += 0.5f32 * d_green;
                        d_green = 0.0f32;
                    }
                    if place.in_red_row {
                        d_red += to_own;
                    } else {
                        d_blue += to_own;
                    }
                }
                if comptime!(matches!(step, Step::Green)) {
                    // The Laplacian of the pixels two steps away.
                    let far = pointed(&place, steps, bars, place.row, place.col - 2, false, green, margin)
                        + pointed(&place, steps, bars, place.row, place.col + 2, false, green, margin)
                        + pointed(&place, steps, bars, place.row - 2, place.col, true, green, margin)
                        + pointed(&place, steps, bars, place.row + 2, place.col, true, green, margin);
                    d_mosaic -= 0.25f32 * far;
                }
            }
        }
        out[red + i] = d_red;
        out[green + i] = d_green;
        out[blue + i] = d_blue;
        out[blue + place.plane + i] = d_mosaic;
    }
}

/// The cotangent of the bordered mosaic: its own colour's, and what the steps of Menon's method gave it or what neighbours took by the
/// other methods.
#[cube(launch)]
fn measured_back(
    words: &[u32],
    bars: &[f32],
    d_mosaic: &mut [f32],
    sizes: Sizes,
    #[comptime] demosaic: Demosaic,
) {
    let at = ABSOLUTE_POS;
    if at < d_mosaic.len() {
        let place = place(at, words, &sizes);
        let first = place.frame * BARS * place.plane;
        let own = first + colour(place.in_red_row, place.in_red_col) * place.plane;
        let i = own + place.i;
        let s = place.stride;
        let is_green = place.in_red_row != place.in_red_col;
        let mut sum = bars[i];
        if comptime!(demosaic == Demosaic::Menon) {
            sum += bars[first + CHANNELS * place.plane + place.i];
        } else if is_within(&place, place.row, place.col, 2) {
            // Cotangents are zero in the border: what is beyond two pixels of the edge of the frame gives nothing back.
            let edges = bars[i - 1] + bars[i + 1] + bars[i - s] + bars[i + s];
            let corners = bars[i - s - 1] + bars[i - s + 1] + bars[i + s - 1] + bars[i + s + 1];
            if comptime!(demosaic == Demosaic::Bilinear) {
                sum += select(is_green, 0.25f32 * edges, 0.5f32 * edges + 0.25f32 * corners);
            } else {
                // The planes of the row's and of the column's colour; at red and blue, of the own and of the opposite one.
                let red = first + place.i;
                let blue = red + 2 * place.plane;
                let row = select(place.in_red_row, red, blue);
                let col = select(place.in_red_row, blue, red);
                let row_h = bars[row - 2] + bars[row + 2];
                let row_v = bars[row - 2 * s] + bars[row + 2 * s];
                let col_h = bars[col - 2] + bars[col + 2];
                let col_v = bars[col - 2 * s] + bars[col + 2 * s];
                if is_green {
                    let others = bars[row - s - 1]
                        + bars[row - s + 1]
                        + bars[row + s - 1]
                        + bars[row + s + 1]
                        + bars[col - s - 1]
                        + bars[col - s + 1]
                        + bars[col + s - 1]
                        + bars[col + s + 1];
                    sum += 0.625f32 * (bars[row] + bars[col]) + 0.25f32 * edges - 0.125f32 * others;
                    sum += 0.0625f32 * (col_h + row_v) - 0.125f32 * (row_h + col_v);
                } else {
                    let green = red + place.plane;
                    let far = bars[green - 2] + bars[green + 2] + bars[green - 2 * s] + bars[green + 2 * s];
                    sum += 0.5f32 * bars[green] + 0.75f32 * bars[col] + 0.5f32 * edges + 0.25f32 * corners;
                    sum -= 0.125f32 * far + 0.1875f32 * (col_h + col_v);
                }
            }
        }
        d_mosaic[at] = sum;
    }
}

/// The cotangent of each digital number: its pixel's, and those of the border that mirrors it.
#[cube(launch)]
fn fold(
    d_mosaic: &[f32],
    mosaic: &[f32],
    numbers: &[f32],
    words: &[u32],
    d_raw: &mut [f32],
    sizes: Sizes,
    #[comptime] is_stabilised: bool,
) {
    let at = ABSOLUTE_POS;
    if at < d_raw.len() {
        let stride = sizes.width + 2 * BORDER;
        let rows = sizes.height + 2 * BORDER;
        let col = at % sizes.width;
        let row = at / sizes.width % sizes.height;
        let frame = at / (sizes.width * sizes.height);
        let base = frame * rows * stride;
        let down = 2 * (sizes.height - 1);
        let across = 2 * (sizes.width - 1);
        let mut sum = 0.0f32;
        // A pixel is seen once in each direction of a period; the outermost ones only once.
        for row_way in 0..2u32 {
            let mut r = (row + BORDER) % down;
            if row_way == 1u32 {
                r = (BORDER + BORDER * down - row) % down;
            }
            if row_way == 0u32 || (row != 0 && row != sizes.height - 1) {
                while r < rows {
                    for col_way in 0..2u32 {
                        let mut c = (col + BORDER) % across;
                        if col_way == 1u32 {
                            c = (BORDER + BORDER * across - col) % across;
                        }
                        if col_way == 0u32 || (col != 0 && col != sizes.width - 1) {
                            while c < stride {
                                sum += d_mosaic[base + r * stride + c];
                                c += across;
                            }
                        }
                    }
                    r += down;
                }
            }
        }
        let in_red_row = row % 2 == words[2 * frame] as usize;
        let in_red_col = col % 2 == words[2 * frame + 1] as usize;
        let of = frame * NUMBERS;
        if comptime!(is_stabilised) {
            // The slope of the root, by the root itself: 1 / (2 root), and no steeper than where its straight line begins.
            let root = mosaic[base + (row + BORDER) * stride + col + BORDER];
            sum /= 2.0f32 * max(root, (0.25f32 * numbers[of + 4]).sqrt());
        }
        d_raw[at] = sum * numbers[of + 1 + colour(in_red_row, in_red_col)];
    }
}
