//! Ratio-corrected demosaicing (L. Sanz Rodriguez 2017), in whole numbers and on the tape.
//!
//! The steps are those of the floating-point version, which `develop/demosaic/rcd.rs` explains. A share of two sides or of two directions has
//! 12 bits and costs one division.

use burn::prelude::*;

use crate::isp::fixed::{COLOUR, Grid, Pixel, ROOT, shift_round};
use crate::isp::tape_grid::{Stencil, colour_mask};
use crate::sensor::{CfaPattern, Colour};

/// Rows down and columns to the right.
type Step = (isize, isize);

/// Along a column and along a row.
const STRAIGHT: [Step; 2] = [(1, 0), (0, 1)];
/// Along the diagonals.
const DIAGONAL: [Step; 2] = [(1, 1), (1, -1)];

/// Bits of shares.
const SHARE_BITS: u32 = 12;
const HALF: i32 = 1 << (SHARE_BITS - 1);

/// Keeps quotients on the tape finite where a picture is flat; in whole numbers 1 does.
const EPSILON: f64 = 1e-5;

/// Roots of the three colours from the roots of a mosaic.
pub fn fixed(mosaic: &Grid<i16>, cfa: CfaPattern) -> [Grid<i16>; 3] {
    let size = mosaic.size();
    let is_green = |row: usize, c: usize| cfa.colour(row, c) == Colour::Green;
    let by_column = shares(mosaic, STRAIGHT);
    let low = Grid::from_rows(size, |row, out| {
        let near = mosaic.around(row, out.len());
        let line = |d: isize| [near.at(d, -1), near.at(d, 0), near.at(d, 1)];
        let [above, here, below] = [line(-1), line(0), line(1)];
        for c in 0..out.len() {
            let tent = |[a, b, d]: [&[i16]; 3]| i32::from(a[c]) + 2 * i32::from(b[c]) + i32::from(d[c]);
            out[c] = ROOT.short(shift_round(tent(above) + 2 * tent(here) + tent(below), 4));
        }
    });
    // Green at red and blue.
    let green = Grid::from_rows(size, |row, out| {
        let sides = both_sides(STRAIGHT)
            .map(|step| (along(mosaic, row, step, [-1, 0, 1, 2, 3, 4]), along(&low, row, step, [0, 2])));
        for c in 0..out.len() {
            if is_green(row, c) {
                out[c] = mosaic.row(row)[c];
                continue;
            }
            let side = |(v, low): &([&[i16]; 6], [&[i16]; 2])| {
                let [behind, here, v1, v2, v3, v4] = v.map(|line| i32::from(line[c]));
                let [low0, low2] = low.map(|line| i32::from(line[c]));
                let variation =
                    1 + (v1 - behind).abs() + (here - v2).abs() + (v1 - v3).abs() + (v2 - v4).abs();
                let ratio = ((low0 - low2) << SHARE_BITS) / (1 + low0.abs() + low2.abs());
                (ROOT.clamp(v1 + shift_round(v1 * ratio, SHARE_BITS)), variation)
            };
            out[c] = ROOT.short(of_four_sides(sides.each_ref().map(side), decided(&by_column, row, c)));
        }
    });
    // Red at blue and blue at red, along the diagonals.
    let falling = shares(mosaic, DIAGONAL);
    let known = |colour: Colour| {
        Grid::from_rows(size, |row, out| {
            let sides = differences(mosaic, &green, row, DIAGONAL);
            for (c, out) in out.iter_mut().enumerate() {
                let at = cfa.colour(row, c);
                *out = mosaic.row(row)[c];
                if at != Colour::Green && at != colour {
                    let difference =
                        of_four_sides(sides.each_ref().map(|of| of(c)), decided(&falling, row, c));
                    *out = ROOT.short(i32::from(green.row(row)[c]) + difference);
                }
            }
        })
    };
    let [red, blue] = [Colour::Red, Colour::Blue].map(known);
    // Red and blue at green.
    let whole = |known: &Grid<i16>| {
        Grid::from_rows(size, |row, out| {
            let sides = differences(known, &green, row, STRAIGHT);
            for (c, out) in out.iter_mut().enumerate() {
                *out = known.row(row)[c];
                if is_green(row, c) {
                    let difference =
                        of_four_sides(sides.each_ref().map(|of| of(c)), decided(&by_column, row, c));
                    *out = ROOT.short(i32::from(green.row(row)[c]) + difference);
                }
            }
        })
    };
    let [red, blue] = [&red, &blue].map(whole);
    [red, green, blue]
}

/// The differences of a colour from green one step away from the pixels of a row, to four sides, and how much the picture varies there; as
/// functions of the column.
fn differences<'g>(
    colour: &'g Grid<i16>,
    green: &'g Grid<i16>,
    row: usize,
    directions: [Step; 2],
) -> [impl Fn(usize) -> (i32, i32) + 'g; 4] {
    both_sides(directions).map(|step| {
        let (v, g) = (along(colour, row, step, [-1, 1, 3]), along(green, row, step, [0, 1, 2]));
        move |c: usize| {
            let [behind, v1, v3] = v.map(|line| i32::from(line[c]));
            let [here, g1, g2] = g.map(|line| i32::from(line[c]));
            let variation = 1 + (v1 - behind).abs() + (v1 - v3).abs() + (here - g2).abs();
            (COLOUR.clamp(v1 - g1), variation)
        }
    })
}

/// The two directions, each to both sides: first the opposite one.
fn both_sides(directions: [Step; 2]) -> [Step; 4] {
    let [(a, b), (c, d)] = directions;
    [(-a, -b), (a, b), (-c, -d), (c, d)]
}

/// Rows of a grid that are so many steps away.
fn along<T: Pixel, const N: usize>(
    grid: &Grid<T>,
    row: usize,
    (down, right): Step,
    steps: [isize; N],
) -> [&[T]; N] {
    steps.map(|k| grid.near(row, k * down, k * right))
}

/// The share of the first direction in how much a mosaic varies along both: squares of a sixth-order high-pass at three pixels.
fn shares(mosaic: &Grid<i16>, directions: [Step; 2]) -> Grid<i16> {
    let size = mosaic.size();
    let squares = directions.map(|step| {
        Grid::from_rows(size, |row, out: &mut [i32]| {
            let v = along(mosaic, row, step, [-3, -2, -1, 0, 1, 2, 3]);
            for (c, out) in out.iter_mut().enumerate() {
                let [a, b, d, e, f, g, h] = v.map(|line| i32::from(line[c]));
                // Cut off to 16 bits, so that three squares fit 32 bits without sign.
                let high = shift_round(a + h - d - f - 3 * (b + g) + 6 * e, 1).clamp(-0x7fff, 0x7fff);
                *out = high * high;
            }
        })
    });
    Grid::from_rows(size, |row, out: &mut [i16]| {
        let lines = [0, 1].map(|k: usize| along(&squares[k], row, directions[k], [-1, 0, 1]));
        for (c, out) in out.iter_mut().enumerate() {
            let [first, second] =
                lines.map(|lines| lines.iter().map(|line| line[c] as u64).sum::<u64>().max(1));
            *out = (((first << SHARE_BITS) + (first + second) / 2) / (first + second)) as i16;
        }
    })
}

/// The share of a pixel, or the mean of its diagonal neighbours where that is further from one half.
fn decided(shares: &Grid<i16>, row: usize, c: usize) -> i32 {
    let at = |down: isize, right: isize| i32::from(shares.near(row, down, right)[c]);
    let (here, around) = (at(0, 0), shift_round(at(-1, -1) + at(-1, 1) + at(1, -1) + at(1, 1), 2));
    if (HALF - here).abs() < (HALF - around).abs() { around } else { here }
}

/// The value at a share of the way from one 16-bit number to another.
fn between(a: i32, b: i32, share: i32) -> i32 {
    a + shift_round((b - a) * share, SHARE_BITS)
}

/// The value between the estimates of four sides, each given with its variation. The two estimates along a direction are mixed first, each
/// weighted by the variation on the opposite side. Then the second direction gets the share `weight`.
fn of_four_sides([a, b, c, d]: [(i32, i32); 4], weight: i32) -> i32 {
    let of_two = |(a, of_a): (i32, i32), (b, of_b): (i32, i32)| {
        // A variation has at most 18 bits.
        between(a, b, (of_a << SHARE_BITS) / (of_a + of_b))
    };
    between(of_two(a, b), of_two(c, d), weight)
}

/// The same on the tape, of a plane `[1, 1, height, width]`.
pub fn smooth(mosaic: &Tensor<4>, cfa: CfaPattern) -> [Tensor<4>; 3] {
    let [is_red, is_green, is_blue] = [Colour::Red, Colour::Green, Colour::Blue]
        .map(|colour| colour_mask(cfa, colour, mosaic).equal_elem(1.0));
    let v = Stencil::new(mosaic);
    let by_column = smooth_shares(&v, STRAIGHT);
    let tent = |d: isize| v.at(d, -1) + v.at(d, 0) * 2.0 + v.at(d, 1);
    let low = Stencil::new(&((tent(-1) + tent(0) * 2.0 + tent(1)) / 16.0));
    let side = |(d, r): Step| {
        let (v, low) = (|k: isize| v.at(k * d, k * r), |k: isize| low.at(k * d, k * r));
        let variation =
            (v(1) - v(-1)).abs() + (v(0) - v(2)).abs() + (v(1) - v(3)).abs() + (v(2) - v(4)).abs() + EPSILON;
        let ratio = (low(0) - low(2)) / (low(0).abs() + low(2).abs() + EPSILON);
        (v(1) * (ratio + 1.0), variation)
    };
    let found = smooth_of_four_sides(both_sides(STRAIGHT).map(side), by_column.clone());
    let green = found.mask_where(is_green.clone(), mosaic.clone());
    let g = Stencil::new(&green);
    let from_green = |colour: &Tensor<4>, directions: [Step; 2], shares: Tensor<4>| {
        let of = Stencil::new(colour);
        let side = |(d, r): Step| {
            let (v, g) = (|k: isize| of.at(k * d, k * r), |k: isize| g.at(k * d, k * r));
            let variation = (v(1) - v(-1)).abs() + (v(1) - v(3)).abs() + (g(0) - g(2)).abs() + EPSILON;
            (v(1) - g(1), variation)
        };
        smooth_of_four_sides(both_sides(directions).map(side), shares)
    };
    let opposite = green.clone() + from_green(mosaic, DIAGONAL, smooth_shares(&v, DIAGONAL));
    let whole = |is_opposite: Tensor<4, Bool>| {
        let known = mosaic.clone().mask_where(is_opposite, opposite.clone());
        let at_green = green.clone() + from_green(&known, STRAIGHT, by_column.clone());
        known.mask_where(is_green.clone(), at_green)
    };
    let [red, blue] = [whole(is_blue), whole(is_red)];
    [red, green, blue]
}

/// [`shares`], [`decided`], on the tape.
fn smooth_shares(v: &Stencil, directions: [Step; 2]) -> Tensor<4> {
    let [first, second] = directions.map(|(d, r)| {
        let at = |k: isize| v.at(k * d, k * r);
        let high = at(-3) + at(3) - at(-1) - at(1) - (at(-2) + at(2)) * 3.0 + at(0) * 6.0;
        let squares = Stencil::new(&(high.clone() * high));
        (squares.at(-d, -r) + squares.at(0, 0) + squares.at(d, r)).clamp_min(EPSILON * EPSILON)
    });
    let shares = first.clone() / (first + second);
    let near = Stencil::new(&shares);
    let around = (near.at(-1, -1) + near.at(-1, 1) + near.at(1, -1) + near.at(1, 1)) * 0.25;
    let is_clearer = (shares.clone() - 0.5).abs().lower((around.clone() - 0.5).abs());
    shares.mask_where(is_clearer, around)
}

/// [`of_four_sides`] on the tape.
fn smooth_of_four_sides([a, b, c, d]: [(Tensor<4>, Tensor<4>); 4], weight: Tensor<4>) -> Tensor<4> {
    let of_two = |(a, of_a): (Tensor<4>, Tensor<4>), (b, of_b): (Tensor<4>, Tensor<4>)| {
        let sum = of_a.clone() + of_b.clone();
        (of_b * a + of_a * b) / sum
    };
    let (first, second) = (of_two(a, b), of_two(c, d));
    first.clone() + (second - first) * weight
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;
    use crate::develop::Demosaic;
    use crate::render::Placement;

    const SIDE: usize = 48;
    /// Pixels at the border that the versions mirror differently.
    const BORDER: usize = 12;

    /// A mosaic of stripes of two directions and a step, in roots of light.
    fn mosaic() -> Vec<f32> {
        let of = |i: usize| {
            let (row, col) = ((i / SIDE) as f32, (i % SIDE) as f32);
            let colour = [0.0, 0.1, -0.1][CfaPattern::RGGB.colour(i / SIDE, i % SIDE).plane().unwrap()];
            let step = if row + 0.5 * col > 35.0 { 0.2 } else { 0.0 };
            0.45 + 0.15 * (0.7 * row + 0.3 * col).sin() + 0.1 * (0.9 * col).cos() + colour + step
        };
        (0..SIDE * SIDE).map(of).collect()
    }

    fn inner(plane: &[f32]) -> Vec<f32> {
        let rows = BORDER..SIDE - BORDER;
        rows.flat_map(|row| plane[row * SIDE + BORDER..(row + 1) * SIDE - BORDER].to_vec()).collect()
    }

    fn on_tape(mosaic: &[f32], device: &Device) -> Tensor<4> {
        Tensor::from_data(TensorData::new(mosaic.to_vec(), [1, 1, SIDE, SIDE]), device)
    }

    fn host(plane: Tensor<4>) -> Vec<f32> {
        plane.into_data().try_to_vec().unwrap()
    }

    #[test]
    fn all_three_versions_agree_inside() {
        let mosaic = mosaic();
        let origin = Placement { row: 0, col: 0 };
        let wanted = Demosaic::Rcd.apply(&mosaic, SIDE, SIDE, CfaPattern::RGGB, origin).unwrap();
        let tape = smooth(&on_tape(&mosaic, &Device::flex()), CfaPattern::RGGB).map(host);
        let whole = Grid::from_rows([SIDE, SIDE], |row, out| {
            out.iter_mut()
                .enumerate()
                .for_each(|(c, out)| *out = ROOT.of(mosaic[row * SIDE + c].into()) as i16);
        });
        let fixed = fixed(&whole, CfaPattern::RGGB);
        // Two other methods, as a measure of what would be far away.
        let menon = Demosaic::Menon.apply(&mosaic, SIDE, SIDE, CfaPattern::RGGB, origin).unwrap();
        for plane in 0..3 {
            let wanted = inner(wanted.plane(plane));
            let distance = |plane: &[f32]| {
                inner(plane).iter().zip(&wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
            };
            let fixed: Vec<f32> = (0..SIDE)
                .flat_map(|row| fixed[plane].row(row).iter().map(|v| ROOT.value(i32::from(*v)) as f32))
                .collect();
            assert!(distance(&tape[plane]) < 2e-5, "{}", distance(&tape[plane]));
            assert!(distance(&fixed) < 2e-3, "{}", distance(&fixed));
            assert!(distance(menon.plane(plane)) > 0.01);
        }
    }

    #[test]
    fn the_gradient_is_that_of_differences() {
        let mosaic = mosaic();
        let device = Device::flex();
        let weights: Vec<f32> = (0..3 * SIDE * SIDE).map(|i| (0.37 * i as f32).sin() + 0.2).collect();
        let value = |mosaic: &[f32]| -> f64 {
            let planes = smooth(&on_tape(mosaic, &device), CfaPattern::RGGB).map(host);
            planes.iter().flatten().zip(&weights).map(|(v, w)| f64::from(*v) * f64::from(*w)).sum()
        };
        let tape = device.clone().autodiff();
        let x = on_tape(&mosaic, &tape).require_grad();
        let planes = smooth(&x, CfaPattern::RGGB);
        let weighted = |k: usize| {
            let weights = weights[k * SIDE * SIDE..(k + 1) * SIDE * SIDE].to_vec();
            let weights: Tensor<4> = Tensor::from_data(TensorData::new(weights, [1, 1, SIDE, SIDE]), &tape);
            (planes[k].clone() * weights).sum()
        };
        let gradients = (weighted(0) + weighted(1) + weighted(2)).backward();
        let slope = host(x.grad(&gradients).unwrap());
        // By single pixels: of a few, a decision between two shares changes on the way, where the method jumps.
        let size = slope.iter().map(|v| v.abs()).fold(0.0, f32::max);
        let step = 5e-4;
        let agrees = |i: &usize| {
            let moved = |step: f32| {
                let mut mosaic = mosaic.clone();
                mosaic[*i] += step;
                value(&mosaic)
            };
            let by_difference = (moved(step) - moved(-step)) / (2.0 * f64::from(step));
            (by_difference - f64::from(slope[*i])).abs() < 0.02 * f64::from(size)
        };
        let pixels: Vec<usize> = (0..60).map(|k| (k * 389 + 7) % (SIDE * SIDE)).collect();
        let count = pixels.iter().filter(|i| agrees(i)).count();
        assert!(count >= 54, "{count} of 60");
    }
}
