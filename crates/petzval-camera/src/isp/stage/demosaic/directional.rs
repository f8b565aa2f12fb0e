//! The directional method of Menon, Andriani and Calvagno (IEEE TIP 16(1), 2007) with its refinement, in whole numbers.
//!
//! `develop/demosaic/menon.rs` explains the steps, in floating point. Here each step makes a grid. One number per pixel holds the direction of
//! interpolation: 1 along the column, 0 along the row.

use crate::isp::fixed::{Around, Grid, ROOT, shift_round};
use crate::sensor::CfaPattern;

/// A third, 12 bits behind the point: as many as leave room for three differences of roots.
const THIRD: i32 = 1365;

/// Roots of the three colours from the roots of a mosaic.
pub fn directional(mosaic: &Grid<i16>, cfa: CfaPattern) -> [Grid<i16>; 3] {
    let size = mosaic.size();
    let columns = directions(mosaic, cfa);
    // Green at red and blue, along the chosen direction.
    let green = Grid::from_rows(
        size,
        #[inline(always)]
        |row, out| {
            let width = out.len();
            let near = mosaic.around(row, width);
            let across = [near.at(0, -2), near.at(0, -1), near.at(0, 1), near.at(0, 2)];
            let along = [near.at(-2, 0), near.at(-1, 0), near.at(1, 0), near.at(2, 0)];
            let (here, column) = (near.at(0, 0), &columns.row(row)[..width]);
            let (green_first, _) = cfa.row_kind(row);
            for c in 0..width {
                let of = |l: [&[i16]; 4]| {
                    let [a, b, d, e] = l.map(|line| i32::from(line[c]));
                    2 * (b + d) + 2 * i32::from(here[c]) - a - e
                };
                let value = if column[c] == 1 { of(along) } else { of(across) };
                let is_green = (c % 2 == 0) == green_first;
                out[c] = if is_green { here[c] } else { ROOT.short(shift_round(value, 2)) };
            }
        },
    );
    // Colours at green: along the row and the column in which they were measured. `from` gives the colour there, and elsewhere.
    let at_green = |green: &Grid<i16>, from: [&Grid<i16>; 2]| {
        Grid::several_from_rows(
            size,
            #[inline(always)]
            |row, [red, blue]| {
                let width = red.len();
                let (green_first, is_red_row) = cfa.row_kind(row);
                for (k, out) in [red, blue].into_iter().enumerate() {
                    // The colour of this row has its measured pixels beside, the other one above and below.
                    let (d, r) = if (k == 0) == is_red_row { (0, 1) } else { (1, 0) };
                    let colour = [&from[k].near(row, -d, -r)[..width], &from[k].near(row, d, r)[..width]];
                    let near = [&green.near(row, -d, -r)[..width], &green.near(row, d, r)[..width]];
                    let g = &green.row(row)[..width];
                    let kept = &from[k].row(row)[..width];
                    for c in 0..width {
                        let mean = difference([colour[0][c], colour[1][c]], [near[0][c], near[1][c]]);
                        let is_green = (c % 2 == 0) == green_first;
                        let at = || ROOT.short(i32::from(g[c]) + shift_round(mean, 1));
                        out[c] = if is_green { at() } else { kept[c] };
                    }
                }
            },
        )
    };
    let [red, blue] = at_green(&green, [mosaic, mosaic]);
    // Red at blue and blue at red, along the chosen direction.
    let [red, blue] = Grid::several_from_rows(
        size,
        #[inline(always)]
        |row, [to_red, to_blue]| {
            let width = to_red.len();
            let (green_first, is_red_row) = cfa.row_kind(row);
            let (o, u) = if is_red_row { (&red, &blue) } else { (&blue, &red) };
            let (to_own, to_other) = if is_red_row { (to_red, to_blue) } else { (to_blue, to_red) };
            let (ol, or, oa, ob) =
                (o.near(row, 0, -1), o.near(row, 0, 1), o.near(row, -1, 0), o.near(row, 1, 0));
            let (ul, ur, ua, ub) =
                (u.near(row, 0, -1), u.near(row, 0, 1), u.near(row, -1, 0), u.near(row, 1, 0));
            let (here, mine, column) = (o.row(row), u.row(row), columns.row(row));
            for c in 0..width {
                let along = difference([ua[c], ub[c]], [oa[c], ob[c]]);
                let across = difference([ul[c], ur[c]], [ol[c], or[c]]);
                let mean = if column[c] == 1 { along } else { across };
                let is_green = (c % 2 == 0) == green_first;
                to_own[c] = here[c];
                let at = || ROOT.short(i32::from(here[c]) + shift_round(mean, 1));
                to_other[c] = if is_green { mine[c] } else { at() };
            }
        },
    );
    // Refine green by the low-pass of its difference from the measured colour along the chosen direction.
    let refined = Grid::from_rows(
        size,
        #[inline(always)]
        |row, out| {
            let (green_first, is_red_row) = cfa.row_kind(row);
            let own = if is_red_row { &red } else { &blue };
            let (own, green) = (own.around(row, out.len()), green.around(row, out.len()));
            let columns = columns.around(row, out.len()).at(0, 0);
            without_third(own, green, columns, green_first, out);
        },
    );
    // Refine red and blue at green by the mean difference of the measured neighbours.
    let [red, blue] = at_green(&refined, [&red, &blue]);
    // Refine red at blue and blue at red by the low-pass of their difference along the chosen direction.
    let [red, blue] = Grid::several_from_rows(
        size,
        #[inline(always)]
        |row, [to_red, to_blue]| {
            let width = to_red.len();
            let (green_first, is_red_row) = cfa.row_kind(row);
            let (own, other) = if is_red_row { (&red, &blue) } else { (&blue, &red) };
            let (to_own, to_other) = if is_red_row { (to_red, to_blue) } else { (to_blue, to_red) };
            let (own, other) = (own.around(row, width), other.around(row, width));
            to_own.copy_from_slice(own.at(0, 0));
            let columns = columns.around(row, width).at(0, 0);
            without_third(own, other, columns, green_first, &mut to_other[..width]);
        },
    );
    [red, refined, blue]
}

/// The sum of two numbers less that of two others.
#[inline(always)]
fn difference(a: [i16; 2], b: [i16; 2]) -> i32 {
    let [a, b] = [a, b].map(|[one, other]| i32::from(one) + i32::from(other));
    a - b
}

/// `a` less the mean of three differences of `a` from `b`, along the column where `columns` holds 1, else along the row; at green, `b`.
#[inline(always)]
fn without_third(
    a: Around<'_, i16>,
    b: Around<'_, i16>,
    columns: &[i16],
    green_first: bool,
    out: &mut [i16],
) {
    let (a_above, a_left, a_right, a_below) = (a.at(-1, 0), a.at(0, -1), a.at(0, 1), a.at(1, 0));
    let (b_above, b_left, b_right, b_below) = (b.at(-1, 0), b.at(0, -1), b.at(0, 1), b.at(1, 0));
    let (a, b, columns) = (a.at(0, 0), b.at(0, 0), &columns[..out.len()]);
    for c in 0..out.len() {
        let along = difference([a_above[c], a_below[c]], [b_above[c], b_below[c]]);
        let across = difference([a_left[c], a_right[c]], [b_left[c], b_right[c]]);
        let (here, known) = (i32::from(a[c]), i32::from(b[c]));
        let sum = if columns[c] == 1 { along } else { across } + here - known;
        let is_green = (c % 2 == 0) == green_first;
        out[c] = if is_green { b[c] } else { ROOT.short(here - shift_round(sum * THIRD, 12)) };
    }
}

/// 1 where the differences of the measured colour from green vary less along the column than along the row.
fn directions(mosaic: &Grid<i16>, cfa: CfaPattern) -> Grid<i16> {
    let size = mosaic.size();
    // Differences from green by the row and by the column, times 4; 0 at green.
    let [by_row, by_col] = Grid::several_from_rows(
        size,
        #[inline(always)]
        |row, [by_row, by_col]| {
            let width = by_row.len();
            let near = mosaic.around(row, width);
            let across = [near.at(0, -2), near.at(0, -1), near.at(0, 1), near.at(0, 2)];
            let along = [near.at(-2, 0), near.at(-1, 0), near.at(1, 0), near.at(2, 0)];
            let here = near.at(0, 0);
            let by_col = &mut by_col[..width];
            let (green_first, _) = cfa.row_kind(row);
            for c in 0..width {
                let of = |l: [&[i16]; 4]| {
                    let [a, b, d, e] = l.map(|line| i32::from(line[c]));
                    2 * i32::from(here[c]) - 2 * (b + d) + a + e
                };
                let is_green = (c % 2 == 0) == green_first;
                by_row[c] = if is_green { 0 } else { of(across) };
                by_col[c] = if is_green { 0 } else { of(along) };
            }
        },
    );
    Grid::from_rows(
        size,
        #[inline(always)]
        |row, out| {
            let (by_row, by_col) = (by_row.around(row, out.len()), by_col.around(row, out.len()));
            let mut across = vec![0; out.len()];
            variation(|along, beside| by_row.at(beside, along), &mut across);
            let mut along = vec![0; out.len()];
            variation(|along, beside| by_col.at(along, beside), &mut along);
            for c in 0..out.len() {
                out[c] = i16::from(along[c] < across[c]);
            }
        },
    )
}

/// How much differences vary around the pixels of a row along their own direction. `line` gives the row that is a number of pixels
/// further along the direction, and beside it.
///
/// The variations that straddle the pixel count three times, those of the second lines beside it and of the other colour between once.
#[inline(always)]
fn variation<'g>(line: impl Fn(isize, isize) -> &'g [i32], out: &mut [i32]) {
    let [behind, here, ahead] = [line(-2, 0), line(0, 0), line(2, 0)];
    let [behind_a, here_a, ahead_a] = [line(-2, -2), line(0, -2), line(2, -2)];
    let [behind_b, here_b, ahead_b] = [line(-2, 2), line(0, 2), line(2, 2)];
    let [other_a, other_b] = [[line(-1, -1), line(1, -1)], [line(-1, 1), line(1, 1)]];
    for c in 0..out.len() {
        let middle = (here[c] - ahead[c]).abs() + (here[c] - behind[c]).abs();
        let beside = (here_a[c] - ahead_a[c]).abs()
            + (here_a[c] - behind_a[c]).abs()
            + (here_b[c] - ahead_b[c]).abs()
            + (here_b[c] - behind_b[c]).abs();
        let others = (other_a[0][c] - other_a[1][c]).abs() + (other_b[0][c] - other_b[1][c]).abs();
        out[c] = 3 * middle + beside + others;
    }
}
