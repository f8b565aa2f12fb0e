//! The Strehl ratio: the peak of a PSF divided by that of the same beam without aberrations.

use petzval_fourier::Complex64;

use super::psf::WaveChannel;

/// Halvings of the step around the brightest point of the grid.
const HALVINGS: usize = 12;

impl WaveChannel {
    /// `max_x |sum U exp(i k n' x.d)|^2 / (sum |U|)^2`, with the peak wherever it lies on the image plane.
    pub fn strehl(&self) -> f64 {
        let wave = self.wave().values;
        let ideal: f64 = wave.iter().map(|v| v.norm_sqr().sqrt()).sum();
        let peak = self.brightest(&wave);
        (self.amplitude(&wave, peak).norm() / ideal).powi(2)
    }

    /// Position of the greatest amplitude, in turns of the phase from one node to the next along both axes.
    fn brightest(&self, wave: &[Complex64]) -> [f64; 2] {
        let n = self.nodes;
        let length = (2 * n).next_power_of_two();
        let fft = petzval_fourier::inverse(length);
        // Transform the rows, then the columns, and find the brightest point.
        let mut rows = vec![Complex64::ZERO; n * length];
        for (row, from) in rows.chunks_exact_mut(length).zip(wave.chunks_exact(n)) {
            row[..n].copy_from_slice(from);
        }
        fft.process(&mut rows);
        let (mut best, mut at) = (-1.0, [0.0; 2]);
        let mut column = vec![Complex64::ZERO; length];
        let turns = |k: usize| {
            let signed = if 2 * k < length { k as f64 } else { k as f64 - length as f64 };
            signed / length as f64
        };
        for x in 0..length {
            column.fill(Complex64::ZERO);
            for (j, to) in column[..n].iter_mut().enumerate() {
                *to = rows[j * length + x];
            }
            fft.process(&mut column);
            for (y, e) in column.iter().enumerate() {
                if e.norm_sqr() > best {
                    (best, at) = (e.norm_sqr(), [turns(x), turns(y)]);
                }
            }
        }
        // Refine the position between the grid points by hill climbing with a shrinking step.
        let mut step = 0.5 / length as f64;
        for _ in 0..HALVINGS {
            let around = [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]];
            let moved = around.map(|[x, y]| [at[0] + x, at[1] + y]);
            let found = moved.map(|to| (self.amplitude(wave, to).norm_sqr(), to));
            match found.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((value, to)) if value > best => (best, at) = (value, to),
                _ => step *= 0.5,
            }
        }
        at
    }

    /// The amplitude at a position in the units of [`WaveChannel::brightest`].
    fn amplitude(&self, wave: &[Complex64], turns: [f64; 2]) -> Complex64 {
        let n = self.nodes;
        let phases = |turn: f64| -> Vec<Complex64> {
            (0..n).map(|i| Complex64::cis(std::f64::consts::TAU * turn * i as f64)).collect()
        };
        let (x, y) = (phases(turns[0]), phases(turns[1]));
        wave.chunks_exact(n)
            .zip(&y)
            .map(|(row, y)| *y * row.iter().zip(&x).map(|(v, x)| v * x).sum::<Complex64>())
            .sum()
    }
}
