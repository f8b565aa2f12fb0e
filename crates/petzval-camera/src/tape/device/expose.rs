//! The exposure of the sensor on a device.
//!
//! Draws have the words of the CPU's generator. Numbers have 32 bits where the CPU has 64: a digital number is the CPU's for light that
//! differs by a few parts in 10 million. Near the middle between two numbers, or two counts of electrons, that is the next one.

use burn::backend::{DispatchTensor, TensorMetadata};
use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;
use burn_cubecl::tensor::CubeTensor;
use petzval_base::random::Stage;

use super::draws::{At, CORRECTIONS, first, normals, pair, poisson, rare_exponential};
use super::{buffers, empty, given, groups, numbers, taken, words};
use crate::image::CHANNELS;
use crate::sensor::{Electronics, NoiseMode, shared_lines};
use crate::tape::expose_op::ExposeKernel;
use crate::tape::{BackwardPass, DeviceForm};

/// What compiles a kernel of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Physics {
    mode: NoiseMode,
    /// Whether single pixels differ, and whether some are hot.
    has_pattern: bool,
    has_hot: bool,
    is_after_adc: bool,
}

/// Numbers of one capture in the order in which the kernel reads them.
const NUMBERS: usize = 16;

/// Words of one capture: frame, and the place of the first pixel.
const WORDS: usize = 4;

/// Words of all captures: seed and specimen.
const SHARED_WORDS: usize = 4;

/// The tensors and numbers that both passes read.
struct Inputs {
    irradiance: CubeTensor,
    numbers: CubeTensor,
    words: CubeTensor,
    lines: CubeTensor,
    tile: CubeTensor,
}

impl ExposeKernel {
    fn physics(&self) -> Physics {
        let of = &self.sensor.nonuniformity;
        Physics {
            mode: self.noise.mode,
            has_pattern: of.dsnu_pixel_e != 0.0 || of.prnu_pixel_percent != 0.0,
            has_hot: of.hot_pixel_share * of.hot_pixel_e_per_s != 0.0,
            is_after_adc: self.sensor.electronics == Electronics::AfterAdc,
        }
    }

    fn inputs(&self, irradiance: &DispatchTensor) -> Inputs {
        let [_, _, height, width] = self.shape;
        let (sensor, of) = (&self.sensor, &self.sensor.nonuniformity);
        let irradiance = taken(irradiance);
        let halves = |v: u64| [v as u32, (v >> 32) as u32];
        let mut all_numbers = CORRECTIONS.to_vec();
        let mut all_words = [halves(self.noise.seed), halves(of.specimen)].concat();
        let mut lines = Vec::new();
        for capture in &self.captures {
            let exposure = &capture.exposure;
            let gain = sensor.gain_dn_per_e * f64::from(exposure.linear_gain);
            let of_capture: [f64; NUMBERS] = [
                exposure.white_e.into(),
                exposure.time_s.into(),
                sensor.dark_current_e_per_s,
                sensor.full_well_e,
                sensor.read_noise_mean_e,
                sensor.read_noise_e,
                gain,
                sensor.black_level_dn,
                sensor.electronics_mean_dn,
                sensor.electronics_noise_dn,
                sensor.max_dn(),
                of.dsnu_pixel_e,
                0.01 * of.prnu_pixel_percent,
                of.hot_pixel_share,
                of.hot_pixel_e_per_s,
                0.0,
            ];
            all_numbers.extend(of_capture.map(|v| v as f32));
            let place = [capture.placement.row as u32, capture.placement.col as u32];
            all_words.extend([halves(capture.frame), place].concat());
            lines.extend(shared_lines(sensor, capture, &self.noise, height, width));
        }
        let (rows, cols) = (sensor.cfa.rows(), sensor.cfa.cols());
        let of_tile = |i: usize| sensor.response(sensor.cfa.colour(i / cols, i % cols)).map(|v| v as f32);
        let tile: Vec<f32> = (0..rows * cols).flat_map(of_tile).collect();
        Inputs {
            numbers: numbers(&irradiance, &all_numbers),
            words: words(&irradiance, &all_words),
            lines: numbers(&irradiance, &lines),
            tile: numbers(&irradiance, &tile),
            irradiance,
        }
    }

    /// Rows and columns of a frame and of the colour filter array's tile.
    fn sizes(&self) -> SizesLaunch {
        let [_, _, height, width] = self.shape;
        SizesLaunch::new(height, width, self.sensor.cfa.rows(), self.sensor.cfa.cols())
    }
}

impl DeviceForm for ExposeKernel {
    fn forward(&self, inputs: &[DispatchTensor], _: &[bool]) -> DispatchTensor {
        let Inputs { irradiance, numbers, words, lines, tile } = self.inputs(&inputs[0]);
        let dn = empty(&irradiance, self.shape);
        let (count, dim) = groups(&dn, self.shape.iter().product());
        let [light, numbers, words] = buffers([&irradiance, &numbers, &words]);
        let [lines, tile, to] = buffers([&lines, &tile, &dn]);
        let (client, sizes, physics) = (&dn.client, self.sizes(), self.physics());
        expose_pixels::launch(client, count, dim, light, numbers, words, lines, tile, to, sizes, physics);
        given(dn)
    }

    fn backward(&self, inputs: &[DispatchTensor], at: BackwardPass<'_>) -> Vec<Option<DispatchTensor>> {
        // The slopes are those of the same draws, which are made again.
        let Inputs { irradiance, numbers, words, lines, tile } = self.inputs(&inputs[0]);
        let bar = empty(&irradiance, irradiance.shape());
        let (count, dim) = groups(&bar, self.shape.iter().product());
        let [light, numbers, words] = buffers([&irradiance, &numbers, &words]);
        let [lines, tile, d_dn, to] = buffers([&lines, &tile, &taken(at.gradient), &bar]);
        let (client, sizes, physics) = (&bar.client, self.sizes(), self.physics());
        pull_back_pixels::launch(
            client, count, dim, light, numbers, words, lines, tile, d_dn, to, sizes, physics,
        );
        vec![Some(given(bar))]
    }
}

/// Pixels of a frame and of the tile of its colour filter array.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
struct Sizes {
    height: usize,
    width: usize,
    tile_rows: usize,
    tile_cols: usize,
}

/// Where a unit's pixel is.
#[derive(CubeType, Clone, Copy)]
struct Pixel {
    frame: usize,
    row: usize,
    col: usize,
    /// First of its filter's three responses.
    response: usize,
}

#[cube]
fn pixel_of(at: usize, words: &[u32], sizes: &Sizes) -> Pixel {
    let frame = at / (sizes.height * sizes.width);
    let row = at / sizes.width % sizes.height;
    let col = at % sizes.width;
    let base = SHARED_WORDS + frame * WORDS;
    let tile_row = (words[base + 2] as usize + row) % sizes.tile_rows;
    let tile_col = (words[base + 3] as usize + col) % sizes.tile_cols;
    Pixel { frame, row, col, response: (tile_row * sizes.tile_cols + tile_col) * CHANNELS }
}

/// A pixel's digital number and its derivative by the light in it.
#[derive(CubeType, Clone, Copy)]
struct Reading {
    dn: f32,
    by_light: f32,
}

/// Electrons, and their derivative by the mean.
#[derive(CubeType, Clone, Copy)]
struct Electrons {
    count: f32,
    by_rate: f32,
}

/// Electrons of a pixel from its rate.
#[cube]
fn electrons(rate: f32, at: &At, numbers: &[f32], #[comptime] mode: NoiseMode) -> Electrons {
    let shot = comptime!(Stage::Shot as u32);
    // The floor by which derivatives divide; see `RATE_FLOOR_E`.
    let divisor = max(rate, 0.05f32);
    let mut count = rate;
    let mut by_rate = 1.0f32;
    if comptime!(mode == NoiseMode::Gaussian) {
        let z = normals(&pair(at, shot, 0u32)).cosine;
        count = rate + rate.sqrt() * z;
        by_rate = 1.0f32 + z / (2.0f32 * divisor.sqrt());
    } else if comptime!(mode != NoiseMode::Off) {
        let n = poisson(rate, at, shot, numbers);
        count = n;
        if comptime!(mode == NoiseMode::Dequantised) {
            let t = first(&pair(at, comptime!(Stage::Dither as u32), 0u32));
            count = n + (t - 0.5f32);
            by_rate = t + (1.0f32 - t) * (n + (divisor - rate)) / divisor;
        } else if comptime!(mode == NoiseMode::HalfStep) {
            count = n + 0.5f32;
        } else if comptime!(mode == NoiseMode::Exact) {
            by_rate = 0.0f32;
        }
    }
    Electrons { count, by_rate }
}

/// The converter's number, and the share of a derivative that it passes.
#[derive(CubeType, Clone, Copy)]
struct Converted {
    dn: f32,
    passes: f32,
}

#[cube]
fn convert(v: f32, max_dn: f32, #[comptime] rounds: bool) -> Converted {
    let passes = if v >= 0.0f32 && v <= max_dn { 1.0f32 } else { 0.0f32 };
    let mut rounded = v;
    if comptime!(rounds) {
        // Half way, the even one.
        let below = v.floor();
        let past = v - below;
        let is_odd = below - 2.0f32 * (below * 0.5f32).floor() > 0.5f32;
        rounded = select(past > 0.5f32 || (past == 0.5f32 && is_odd), below + 1.0f32, below);
    }
    Converted { dn: min(max(rounded, 0.0f32), max_dn), passes }
}

/// The reading of one pixel: see [`crate::sensor::expose_pixel`].
#[cube]
fn reading(
    irradiance: &[f32],
    numbers: &[f32],
    words: &[u32],
    lines: &[f32],
    tile: &[f32],
    pixel: &Pixel,
    sizes: &Sizes,
    #[comptime] physics: Physics,
) -> Reading {
    let of = (1 + pixel.frame) * NUMBERS;
    let base = SHARED_WORDS + pixel.frame * WORDS;
    let sensor_row = words[base + 2] + pixel.row as u32;
    let sensor_col = words[base + 3] + pixel.col as u32;
    let place = (sensor_row << 16u32) | (sensor_col & 0xFFFFu32);
    let at = At {
        seed_low: words[0],
        seed_high: words[1],
        frame_low: words[base],
        frame_high: words[base + 1],
        place,
    };

    // The light that the filter passes.
    let plane = sizes.height * sizes.width;
    let i = pixel.frame * CHANNELS * plane + pixel.row * sizes.width + pixel.col;
    let light = tile[pixel.response] * irradiance[i]
        + tile[pixel.response + 1] * irradiance[i + plane]
        + tile[pixel.response + 2] * irradiance[i + 2 * plane];
    let is_finite = u32::reinterpret(light) & 0x7F80_0000u32 != 0x7F80_0000u32;

    // What sets the pixel apart: its row's and its column's part, and its own.
    let line = pixel.frame * 2 * (sizes.height + sizes.width);
    let column = line + 2 * sizes.height;
    let mut offset_e = lines[line + 2 * pixel.row] + lines[column + 2 * pixel.col];
    let mut response = 1.0f32 + lines[line + 2 * pixel.row + 1] + lines[column + 2 * pixel.col + 1];
    let mut dark_e_per_s = numbers[of + 2];
    let specimen = At { seed_low: words[2], seed_high: words[3], frame_low: 0u32, frame_high: 0u32, place };
    if comptime!(physics.has_pattern) {
        let own = normals(&pair(&specimen, comptime!(Stage::FixedPixel as u32), 0u32));
        offset_e += numbers[of + 11] * own.cosine;
        response += numbers[of + 12] * own.sine;
    }
    if comptime!(physics.has_hot) {
        let hot = pair(&specimen, comptime!(Stage::Hot as u32), 0u32);
        dark_e_per_s += numbers[of + 14] * rare_exponential(&hot, numbers[of + 13]);
    }
    response = max(response, 0.0f32);

    // From light to a mean rate, to electrons, to the full well.
    let white_e = numbers[of];
    let known = if is_finite { max(light, 0.0f32) } else { 0.0f32 };
    let rate = known * white_e * response + dark_e_per_s * numbers[of + 1];
    let charge = electrons(rate, &at, numbers, physics.mode);
    let full_well = numbers[of + 3];
    let well_passes = if charge.count < full_well { 1.0f32 } else { 0.0f32 };

    // Read out, amplify, convert.
    let mut z_read = 0.0f32;
    let mut z_electronics = 0.0f32;
    if comptime!(physics.mode != NoiseMode::Off) {
        let z = normals(&pair(&at, comptime!(Stage::Read as u32), 0u32));
        z_read = z.cosine;
        z_electronics = z.sine;
    }
    let gain = numbers[of + 6];
    let e = min(charge.count, full_well) + (numbers[of + 4] + offset_e + numbers[of + 5] * z_read);
    let signal = gain * e + numbers[of + 7];
    let electronics = numbers[of + 8] + numbers[of + 9] * z_electronics;
    let max_dn = numbers[of + 10];
    let rounds = comptime!(physics.mode != NoiseMode::Off);
    let mut last = signal + electronics;
    let mut passes = 1.0f32;
    if comptime!(physics.is_after_adc) {
        let digital = convert(signal, max_dn, rounds);
        last = digital.dn + electronics;
        passes = digital.passes;
    }
    let value = convert(last, max_dn, rounds);
    let by_rate = passes * value.passes * gain * well_passes * charge.by_rate;
    let by_light = if light < 0.0f32 { 0.0f32 } else { by_rate * white_e * response };
    let unknown = f32::reinterpret(0x7FC0_0000u32);
    Reading { dn: select(is_finite, value.dn, unknown), by_light: select(is_finite, by_light, unknown) }
}

/// Digital numbers of all pixels, one a unit.
#[cube(launch)]
fn expose_pixels(
    irradiance: &[f32],
    numbers: &[f32],
    words: &[u32],
    lines: &[f32],
    tile: &[f32],
    dn: &mut [f32],
    sizes: Sizes,
    #[comptime] physics: Physics,
) {
    let at = ABSOLUTE_POS;
    if at < dn.len() {
        let pixel = pixel_of(at, words, &sizes);
        let reading = reading(irradiance, numbers, words, lines, tile, &pixel, &sizes, physics);
        dn[at] = reading.dn;
    }
}

/// Cotangents of the irradiance from those of the digital numbers, one pixel a unit.
#[cube(launch)]
fn pull_back_pixels(
    irradiance: &[f32],
    numbers: &[f32],
    words: &[u32],
    lines: &[f32],
    tile: &[f32],
    d_dn: &[f32],
    d_irradiance: &mut [f32],
    sizes: Sizes,
    #[comptime] physics: Physics,
) {
    let at = ABSOLUTE_POS;
    if at < d_dn.len() {
        let pixel = pixel_of(at, words, &sizes);
        let reading = reading(irradiance, numbers, words, lines, tile, &pixel, &sizes, physics);
        // Each colour has its share by what the filter passes of it.
        let plane = sizes.height * sizes.width;
        let i = pixel.frame * CHANNELS * plane + pixel.row * sizes.width + pixel.col;
        for c in 0..CHANNELS {
            d_irradiance[i + c * plane] = reading.by_light * d_dn[at] * tile[pixel.response + c];
        }
    }
}
