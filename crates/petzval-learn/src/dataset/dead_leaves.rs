//! Generated pictures for training: shapes that occlude each other, in linear light.
//!
//! The model of dead leaves (Lee, Mumford, Huang, "Occlusion models for natural images", IJCV 41, 2001). Shapes fall one upon the other.
//! Their sizes are distributed as `r^-3`, so the picture looks alike at every distance. It has the edges, the flat parts and the spectrum
//! of photographs. Colours are drawn as logarithms of light, yellow-blue and red-green: natural scenes vary independently along these axes
//! (Ruderman, Cronin and Chiao, JOSA A 15, 1998). Their spreads were chosen by eye for linear sRGB, with some strong colours such as those
//! of paint, flowers and skies. Shapes are shaded by a gradient, and half of them carry waves as a texture.

use petzval_camera::image::{CHANNELS, LinearImage};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Samples along a side of a pixel: edges are as smooth as a sensor sees them.
const SAMPLES: usize = 2;

/// Least and largest radius of a shape, pixels; the largest is a share of the picture's side.
const LEAST_RADIUS: f64 = 4.0;
const LARGEST_RADIUS: f64 = 0.6;

/// Width of the surroundings in which shapes lie as well, as a share of the side.
const MARGIN: f64 = 0.5;

/// Most shapes for each pixel of a picture; they cover all but the last gaps, in which a background lies.
const MOST_SHAPES_PER_PIXEL: f64 = 0.25;

/// Words of random numbers that belong to one picture: 90 for each shape of the largest one.
const WORDS: u128 = 1 << 26;

/// Keeps the pictures apart from all else that is drawn from a seed.
const OWN: u64 = 0x006c_6561_7665_7321;

/// A picture of `side` x `side` pixels, three planes, light from 0 to 1. It depends on the arguments alone.
pub fn dead_leaves(side: usize, seed: u64, step: u64, item: u32) -> LinearImage {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ OWN);
    random.set_stream(step);
    random.set_word_pos(u128::from(item) * WORDS);
    let (mut picture, _) = leaves(side, &mut random);
    // Scenes are exposed differently, and end at white.
    let exposure = 2.0_f32.powf(random.random_range(-1.0..0.7));
    picture.data.iter_mut().for_each(|v| *v = (*v * exposure).min(1.0));
    picture.box_mean(SAMPLES)
}

/// Shapes on `side` x `side` pixels at [`SAMPLES`], and the number of samples that none covered, where the background shows.
fn leaves(side: usize, random: &mut ChaCha8Rng) -> (LinearImage, usize) {
    let fine = side * SAMPLES;
    let mut picture = LinearImage::zeros(CHANNELS, fine, fine);
    let mut is_open = vec![true; fine * fine];
    let mut open = fine * fine;
    // From front to back: what is covered stays covered.
    let most_shapes = 1 + (MOST_SHAPES_PER_PIXEL * (side * side) as f64) as usize;
    for _ in 0..most_shapes {
        if open == 0 {
            break;
        }
        let leaf = Leaf::new(fine as f64, random);
        let reach = leaf.radius * Leaf::REACH;
        let range = |centre: f64| {
            let [low, high] =
                [centre - reach, centre + reach + 1.0].map(|at| at.clamp(0.0, fine as f64) as usize);
            low..high
        };
        for row in range(leaf.centre[0]) {
            for col in range(leaf.centre[1]) {
                let i = row * fine + col;
                let at = [row as f64 - leaf.centre[0], col as f64 - leaf.centre[1]];
                if is_open[i] && leaf.holds(at) {
                    is_open[i] = false;
                    open -= 1;
                    paint(&mut picture, i, &leaf, at);
                }
            }
        }
    }
    let background = Leaf { radius: fine as f64, ..Leaf::new(fine as f64, random) };
    for i in (0..fine * fine).filter(|i| is_open[*i]) {
        let at = [(i / fine) as f64 - background.centre[0], (i % fine) as f64 - background.centre[1]];
        paint(&mut picture, i, &background, at);
    }
    (picture, open)
}

fn paint(picture: &mut LinearImage, i: usize, leaf: &Leaf, at: [f64; 2]) {
    let shade = leaf.shade(at);
    for (c, light) in leaf.light.iter().enumerate() {
        picture.plane_mut(c)[i] = (light * shade) as f32;
    }
}

/// A shape, in samples.
struct Leaf {
    centre: [f64; 2],
    radius: f64,
    /// Cosine and sine of its turn.
    turn: [f64; 2],
    /// Width over length.
    slimness: f64,
    is_box: bool,
    light: [f64; CHANNELS],
    /// Logarithm of the light across the shape, per radius.
    gradient: [f64; 2],
    /// Amplitude, phase and waves per sample of its texture.
    waves: Vec<(f64, f64, [f64; 2])>,
}

impl Leaf {
    /// Distance from the centre that a shape of radius 1 can reach: the corner of a box.
    const REACH: f64 = std::f64::consts::SQRT_2;

    fn new(fine: f64, random: &mut impl Rng) -> Self {
        let normal = |random: &mut _, spread: f64| -> f64 {
            let value: f64 = StandardNormal.sample(random);
            spread * value
        };
        // Sizes of density r^-3 between the least and the largest radius.
        let [least, largest] = [LEAST_RADIUS * SAMPLES as f64, LARGEST_RADIUS * fine];
        let (a, b) = (least.powi(-2), largest.max(least).powi(-2));
        let radius = (a - random.random::<f64>() * (a - b)).powf(-0.5);
        let (sin, cos) = random.random_range(0.0..std::f64::consts::TAU).sin_cos();
        // Light and opponent colours as logarithms; every sixth shape has a strong colour.
        let luma = 0.18_f64.ln() + normal(random, 0.9);
        let strength = if random.random_bool(1.0 / 6.0) { 3.0 } else { 1.0 };
        let yellow_blue = strength * normal(random, 0.25) / 6.0_f64.sqrt();
        let red_green = strength * normal(random, 0.12) / 2.0_f64.sqrt();
        let logs = [luma + yellow_blue + red_green, luma + yellow_blue - red_green, luma - 2.0 * yellow_blue];
        let waves = if random.random_bool(0.5) {
            (0..3)
                .map(|_| {
                    let period = 3.0 * SAMPLES as f64 * 16.0_f64.powf(random.random());
                    let (sin, cos) = random.random_range(0.0..std::f64::consts::TAU).sin_cos();
                    // Coarse waves are stronger, as in natural textures.
                    let amplitude = normal(random, 0.06) * (period / (3.0 * SAMPLES as f64)).sqrt();
                    let phase = random.random_range(0.0..std::f64::consts::TAU);
                    (amplitude, phase, [sin / period, cos / period].map(|v| v * std::f64::consts::TAU))
                })
                .collect()
        } else {
            Vec::new()
        };
        Self {
            // Also beside the picture, as far as a large shape reaches into it.
            centre: [(); 2].map(|()| random.random_range(-MARGIN * fine..(1.0 + MARGIN) * fine)),
            radius,
            turn: [cos, sin],
            slimness: random.random_range(0.25..1.0),
            is_box: random.random_bool(0.4),
            light: logs.map(f64::exp),
            gradient: [normal(random, 0.15), normal(random, 0.15)],
            waves,
        }
    }

    /// Whether it covers a position, from its centre.
    fn holds(&self, [y, x]: [f64; 2]) -> bool {
        let along = (x * self.turn[0] + y * self.turn[1]) / self.radius;
        let across = (y * self.turn[0] - x * self.turn[1]) / (self.radius * self.slimness);
        if self.is_box { along.abs() <= 1.0 && across.abs() <= 1.0 } else { along.hypot(across) <= 1.0 }
    }

    /// The factor of its light at a position, from its centre.
    fn shade(&self, [y, x]: [f64; 2]) -> f64 {
        let gradient = (self.gradient[0] * y + self.gradient[1] * x) / self.radius;
        let waves: f64 = self
            .waves
            .iter()
            .map(|(amplitude, phase, [by_y, by_x])| amplitude * (phase + by_y * y + by_x * x).cos())
            .sum();
        (gradient + waves).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_depends_on_its_place_alone_and_no_two_are_alike() {
        let of = |seed, step, item| dead_leaves(96, seed, step, item);
        assert_eq!(of(1, 7, 2), of(1, 7, 2));
        for other in [of(2, 7, 2), of(1, 8, 2), of(1, 7, 3)] {
            let apart: f32 = other.data.iter().zip(&of(1, 7, 2).data).map(|(a, b)| (a - b).abs()).sum();
            assert!(apart / other.data.len() as f32 > 0.02);
        }
        let picture = of(3, 0, 0);
        assert!(picture.data.iter().all(|v| (0.0..=1.0).contains(v)));
        assert_eq!((picture.channels, picture.height, picture.width), (3, 96, 96));
        // A picture of one pixel is possible.
        assert_eq!(dead_leaves(1, 1, 1, 1).data.len(), 3);
    }

    /// Mean square of the differences of green between pixels `distance` apart along a row, of logarithms, over many pictures.
    fn variogram(distance: usize) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for item in 0..12 {
            let picture = dead_leaves(128, 5, 3, item);
            for row in picture.plane(1).chunks_exact(128) {
                for (a, b) in row.iter().zip(&row[distance..]) {
                    sum += f64::from((a.max(1e-3) / b.max(1e-3)).ln()).powi(2);
                    count += 1;
                }
            }
        }
        sum / f64::from(count)
    }

    #[test]
    fn shapes_cover_large_pictures_too() {
        for side in [60, 222, 700] {
            let (_, open) = leaves(side, &mut ChaCha8Rng::seed_from_u64(4));
            assert!(open * 1000 <= side * side * SAMPLES * SAMPLES, "{side}: {open}");
        }
    }

    #[test]
    fn differences_grow_slowly_with_distance_as_in_photographs() {
        // A spectrum of 1 / f^2 gives differences that grow with the logarithm of the distance. White noise has equal ones, and those of
        // a random walk along the row grow with the distance, 16 times from 1 to 16 pixels.
        let [near, middle, far] = [1, 4, 16].map(variogram);
        assert!(near < 0.75 * middle && middle < 0.85 * far, "{near} {middle} {far}");
        assert!(far < 12.0 * near, "{near} {far}");
        // The picture is neither flat nor black and white.
        assert!((0.1..2.5).contains(&far), "{far}");
    }

    #[test]
    fn colours_are_mostly_weak_and_sometimes_strong_on_both_sides() {
        let (mut blue, mut yellow, mut weak, mut all) = (0, 0, 0, 0);
        for item in 0..12 {
            let picture = dead_leaves(96, 9, 1, item);
            for i in 0..96 * 96 {
                let [r, g, b] = [0, 1, 2].map(|c| f64::from(picture.plane(c)[i].max(1e-3)));
                let log = (b / (r * g).sqrt()).ln();
                all += 1;
                weak += usize::from(log.abs() < 0.35);
                blue += usize::from(log > 0.5);
                yellow += usize::from(log < -0.5);
            }
        }
        assert!(weak > all / 2 && blue > all / 50 && yellow > all / 50, "{weak} {blue} {yellow} of {all}");
    }
}
