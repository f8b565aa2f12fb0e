//! Shares the light of a ray among the cells of a grid.
//!
//! A ray at a non-integer cell coordinate u gives its light to the three nearest cells by the
//! quadratic B-spline, `1/2 (1/2 - d)^2, 3/4 - d^2, 1/2 (1/2 + d)^2` with `d = u - round(u)`. Its first
//! derivative is continuous, so a loss of the PSF has a gradient everywhere; it widens the PSF by
//! 0.5 cells RMS on each axis.

/// The three weights around the nearest cell, their derivatives by u, and the first cell's index.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stencil {
    pub first: isize,
    pub weight: [f64; 3],
    pub slope: [f64; 3],
}

/// The stencil of a ray at cell coordinate u.
#[inline]
pub(super) fn stencil(u: f64) -> Stencil {
    let nearest = u.round();
    let d = u - nearest;
    Stencil {
        first: nearest as isize - 1,
        weight: [0.5 * (0.5 - d) * (0.5 - d), 0.75 - d * d, 0.5 * (0.5 + d) * (0.5 + d)],
        slope: [d - 0.5, -2.0 * d, d + 0.5],
    }
}

/// Adds `light` at cell coordinates (u, v); light off the grid is lost.
#[inline]
pub(super) fn add(grid: &mut [f64], cells: usize, u: f64, v: f64, light: f64) {
    let (a, b) = (stencil(u), stencil(v));
    let range = 0..cells as isize;
    for (j, wy) in b.weight.iter().enumerate() {
        let row = b.first + j as isize;
        if !range.contains(&row) {
            continue;
        }
        for (i, wx) in a.weight.iter().enumerate() {
            let column = a.first + i as isize;
            if range.contains(&column) {
                grid[row as usize * cells + column as usize] += light * wy * wx;
            }
        }
    }
}

/// The adjoint of [`add`]: cotangents of u, v and light from that of the grid, for unit light.
#[inline]
pub(super) fn gather(grid_bar: &[f64], cells: usize, u: f64, v: f64) -> [f64; 3] {
    let (a, b) = (stencil(u), stencil(v));
    let range = 0..cells as isize;
    let mut out = [0.0; 3];
    for j in 0..3 {
        let row = b.first + j as isize;
        if !range.contains(&row) {
            continue;
        }
        for i in 0..3 {
            let column = a.first + i as isize;
            if range.contains(&column) {
                let bar = grid_bar[row as usize * cells + column as usize];
                out[0] += bar * b.weight[j] * a.slope[i];
                out[1] += bar * b.slope[j] * a.weight[i];
                out[2] += bar * b.weight[j] * a.weight[i];
            }
        }
    }
    out
}

/// Adds the change of what [`add`] adds, along changes of u, v and light: the transpose of [`gather`].
#[inline]
pub(super) fn push_forward(
    grid: &mut [f64],
    cells: usize,
    [u, v, light]: [f64; 3],
    [u_change, v_change, light_change]: [f64; 3],
) {
    let (a, b) = (stencil(u), stencil(v));
    let range = 0..cells as isize;
    for j in 0..3 {
        let row = b.first + j as isize;
        if !range.contains(&row) {
            continue;
        }
        let (here, moved) =
            (light * b.weight[j] * u_change, light_change * b.weight[j] + light * b.slope[j] * v_change);
        for i in 0..3 {
            let column = a.first + i as isize;
            if range.contains(&column) {
                grid[row as usize * cells + column as usize] += here * a.slope[i] + moved * a.weight[i];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_and_centroid_are_kept() {
        let mut grid = vec![0.0; 16 * 16];
        add(&mut grid, 16, 7.3, 5.8, 2.0);
        let sum: f64 = grid.iter().sum();
        let x: f64 = grid.iter().enumerate().map(|(i, g)| g * (i % 16) as f64).sum();
        let y: f64 = grid.iter().enumerate().map(|(i, g)| g * (i / 16) as f64).sum();
        assert!((sum - 2.0).abs() < 1e-14);
        assert!((x / sum - 7.3).abs() < 1e-13 && (y / sum - 5.8).abs() < 1e-13);
    }

    #[test]
    fn gather_is_the_transpose_of_add() {
        // <bar, add(light)> = light <gather(bar), 1>, also at the edge where light is lost.
        let bar: Vec<f64> = (0..64).map(|i| f64::from(i * 37 % 101) - 50.0).collect();
        for (u, v) in [(3.2, 4.9), (0.1, 7.2), (-0.4, 2.0)] {
            let mut grid = vec![0.0; 64];
            add(&mut grid, 8, u, v, 1.5);
            let along = |grid: &[f64]| grid.iter().zip(&bar).map(|(g, b)| g * b).sum::<f64>();
            let by = gather(&bar, 8, u, v);
            assert!((along(&grid) - 1.5 * by[2]).abs() < 1e-12);
            // Changes of the position count times the light.
            grid.fill(0.0);
            push_forward(&mut grid, 8, [u, v, 1.5], [0.3, -0.7, 0.2]);
            assert!((along(&grid) - (1.5 * (0.3 * by[0] - 0.7 * by[1]) + 0.2 * by[2])).abs() < 1e-12);
        }
    }
}
