//! The directional method of Menon, Andriani and Calvagno (IEEE TIP 16(1), 2007) with its refinement, in whole numbers.
//!
//! The steps are those of the floating-point version, which `isp/demosaic/menon.rs` explains; here each step makes a grid, and a number
//! per pixel tells whether it looks along its column (1) or its row (0).

use super::super::fixed::{Grid, ROOT, shift_round};
use crate::sensor::{CfaPattern, Colour};

/// A third, 16 bits behind the point.
const THIRD: i32 = 21_845;

/// Roots of the three colours from the roots of a mosaic.
pub fn directional(mosaic: &Grid, cfa: CfaPattern) -> [Grid; 3] {
    let (height, width) = (mosaic.height, mosaic.width);
    let columns = directions(mosaic, cfa);
    let row_kind = |row: usize| {
        let green_first = cfa.colour(row, 0) == Colour::Green;
        (green_first, cfa.colour(row, usize::from(green_first)) == Colour::Red)
    };
    // Green at red and blue, along the chosen direction.
    let green = Grid::from_rows(height, width, |row, out| {
        let width = out.len();
        let line = |down, right| &mosaic.near(row, down, right)[..width];
        let across = [line(0, -2), line(0, -1), line(0, 1), line(0, 2)];
        let along = [line(-2, 0), line(-1, 0), line(1, 0), line(2, 0)];
        let (here, column) = (line(0, 0), &columns.row(row)[..width]);
        let (green_first, _) = row_kind(row);
        for c in 0..width {
            let of = |l: [&[i32]; 4]| 2 * (l[1][c] + l[2][c]) + 2 * here[c] - l[0][c] - l[3][c];
            let value = if column[c] == 1 { of(along) } else { of(across) };
            let is_green = (c % 2 == 0) == green_first;
            out[c] = if is_green { here[c] } else { ROOT.clamp(shift_round(value, 2)) };
        }
    });
    // Colours at green: along the row and the column in which they were measured. `from` gives the colour there.
    let at_green = |green: &Grid, from: [&Grid; 2], keep: Option<[&Grid; 2]>| {
        let [red, _, blue] = Grid::three_from_rows(height, width, |row, [red, _, blue]| {
            let width = red.len();
            let (green_first, is_red_row) = row_kind(row);
            for (k, out) in [red, blue].into_iter().enumerate() {
                // The colour of this row has its measured pixels beside, the other one above and below.
                let (d, r) = if (k == 0) == is_red_row { (0, 1) } else { (1, 0) };
                let colour = [&from[k].near(row, -d, -r)[..width], &from[k].near(row, d, r)[..width]];
                let near = [&green.near(row, -d, -r)[..width], &green.near(row, d, r)[..width]];
                let g = &green.row(row)[..width];
                let kept = &keep.map_or(mosaic, |kept| kept[k]).row(row)[..width];
                for c in 0..width {
                    let mean = colour[0][c] + colour[1][c] - near[0][c] - near[1][c];
                    let is_green = (c % 2 == 0) == green_first;
                    out[c] = if is_green { ROOT.clamp(g[c] + shift_round(mean, 1)) } else { kept[c] };
                }
            }
        });
        [red, blue]
    };
    let [red, blue] = at_green(&green, [mosaic, mosaic], None);
    // Red at blue and blue at red, along the chosen direction.
    let [red, _, blue] = Grid::three_from_rows(height, width, |row, [to_red, _, to_blue]| {
        let width = to_red.len();
        let (green_first, is_red_row) = row_kind(row);
        let (own, other) = if is_red_row { (&red, &blue) } else { (&blue, &red) };
        let (to_own, to_other) = if is_red_row { (to_red, to_blue) } else { (to_blue, to_red) };
        let [o, u] = [own, other];
        let (ol, or, oa, ob) = (o.near(row, 0, -1), o.near(row, 0, 1), o.near(row, -1, 0), o.near(row, 1, 0));
        let (ul, ur, ua, ub) = (u.near(row, 0, -1), u.near(row, 0, 1), u.near(row, -1, 0), u.near(row, 1, 0));
        let (here, mine, column) = (o.row(row), u.row(row), columns.row(row));
        for c in 0..width {
            let along = ua[c] + ub[c] - oa[c] - ob[c];
            let across = ul[c] + ur[c] - ol[c] - or[c];
            let mean = if column[c] == 1 { along } else { across };
            let is_green = (c % 2 == 0) == green_first;
            to_own[c] = here[c];
            to_other[c] = if is_green { mine[c] } else { ROOT.clamp(here[c] + shift_round(mean, 1)) };
        }
    });
    // Refine green by the low-pass of its difference from the measured colour along the chosen direction.
    let third = |a: &Grid, b: &Grid, row: usize, c: usize, is_column: bool| {
        let (d, r) = if is_column { (1, 0) } else { (0, 1) };
        let of = |down: isize, right: isize| a.near(row, down, right)[c] - b.near(row, down, right)[c];
        ((of(-d, -r) + of(0, 0) + of(d, r)) * THIRD + (1 << 15)) >> 16
    };
    let refined = Grid::from_rows(height, width, |row, out| {
        let (green_first, is_red_row) = row_kind(row);
        let (own, g, column) = (if is_red_row { &red } else { &blue }, green.row(row), columns.row(row));
        for c in 0..out.len() {
            out[c] = g[c];
            if (c % 2 == 0) != green_first {
                out[c] = ROOT.clamp(own.row(row)[c] - third(own, &green, row, c, column[c] == 1));
            }
        }
    });
    // Refine red and blue at green by the mean difference of the measured neighbours.
    let [red, blue] = at_green(&refined, [&red, &blue], Some([&red, &blue]));
    // Refine red at blue and blue at red by the low-pass of their difference along the chosen direction.
    let [red, _, blue] = Grid::three_from_rows(height, width, |row, [to_red, _, to_blue]| {
        let (green_first, is_red_row) = row_kind(row);
        let column = columns.row(row);
        to_red.copy_from_slice(red.row(row));
        to_blue.copy_from_slice(blue.row(row));
        let (own, other, out) = if is_red_row { (&red, &blue, to_blue) } else { (&blue, &red, to_red) };
        for c in usize::from(green_first)..out.len() {
            if (c % 2 == 0) != green_first {
                out[c] = ROOT.clamp(own.row(row)[c] - third(own, other, row, c, column[c] == 1));
            }
        }
    });
    [red, refined, blue]
}

/// 1 where the differences of the measured colour from green vary less along the column than along the row.
fn directions(mosaic: &Grid, cfa: CfaPattern) -> Grid {
    let (height, width) = (mosaic.height, mosaic.width);
    // Differences from green by the row and by the column, times 4; 0 at green.
    let [by_row, by_col, _] = Grid::three_from_rows(height, width, |row, [by_row, by_col, _]| {
        let width = by_row.len();
        let line = |down, right| &mosaic.near(row, down, right)[..width];
        let across = [line(0, -2), line(0, -1), line(0, 1), line(0, 2)];
        let along = [line(-2, 0), line(-1, 0), line(1, 0), line(2, 0)];
        let here = line(0, 0);
        let by_col = &mut by_col[..width];
        let green_first = cfa.colour(row, 0) == Colour::Green;
        for c in 0..width {
            let of = |l: [&[i32]; 4]| 2 * here[c] - 2 * (l[1][c] + l[2][c]) + l[0][c] + l[3][c];
            let is_green = (c % 2 == 0) == green_first;
            by_row[c] = if is_green { 0 } else { of(across) };
            by_col[c] = if is_green { 0 } else { of(along) };
        }
    });
    Grid::from_rows(height, width, |row, out| {
        let width = out.len();
        let [r, v] = [&by_row, &by_col];
        // |d(place) - d(place two steps on)| along rows of the one and columns of the other.
        let d = |grid: &Grid, at: (isize, isize), step: (isize, isize), c: usize| {
            (grid.near(row, at.0, at.1)[c] - grid.near(row, at.0 + 2 * step.0, at.1 + 2 * step.1)[c]).abs()
        };
        let variation = |grid: &Grid, step: (isize, isize), across: (isize, isize), c: usize| {
            let back = |at: (isize, isize)| (at.0 - 2 * step.0, at.1 - 2 * step.1);
            let pair = |at: (isize, isize)| d(grid, at, step, c) + d(grid, back(at), step, c);
            let one = |sign: isize| (sign * across.0 - step.0, sign * across.1 - step.1);
            3 * pair((0, 0))
                + pair((-2 * across.0, -2 * across.1))
                + pair((2 * across.0, 2 * across.1))
                + d(grid, one(-1), step, c)
                + d(grid, one(1), step, c)
        };
        for c in 0..width {
            out[c] = i32::from(variation(v, (1, 0), (0, 1), c) < variation(r, (0, 1), (1, 0), c));
        }
    })
}
