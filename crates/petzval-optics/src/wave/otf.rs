//! The optical transfer function of a wave, through its line-spread functions.
//!
//! The light on a line across the image adds up to that of the one-dimensional Fourier transforms of the wave's rows (Parseval),
//! so a fast Fourier transform of every row gives the line-spread function on points that hold all its detail, and its
//! Fourier sum the transfer function at any frequency. That is the autocorrelation of the wave over direction cosines: exact
//! for a flat image at any numerical aperture.

use std::f64::consts::TAU;

use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

use super::psf::{Nodes, WaveChannel};

/// Direction of the modulation of a test pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Section {
    /// Across the plane of the fields, along x: lines that point away from the axis.
    Sagittal,
    /// In the plane of the fields, along y.
    Tangential,
}

/// A line-spread function, as shares of all light.
#[derive(Clone, Debug)]
pub(crate) struct LineSpread {
    /// Distance of the points, mm.
    pub spacing_mm: f64,
    /// Light at `(k - half) spacing` from the origin, half of them on each side.
    pub values: Vec<f64>,
    /// Light that lands further away than the points reach: what hard edges of the beam diffract.
    beyond: f64,
    /// Frequency from which on that light is not modulated, 1/mm.
    beyond_fades_per_mm: f64,
}

impl LineSpread {
    /// The transfer function at a frequency, 1/mm.
    pub fn transfer(&self, frequency_per_mm: f64) -> Complex64 {
        let half = (self.values.len() / 2) as f64;
        let turn = TAU * frequency_per_mm * self.spacing_mm;
        // By the recurrence of sines, refreshed often enough to stay exact.
        const REFRESH: usize = 64;
        let step = Complex64::cis(-turn);
        let mut sum = Complex64::ZERO;
        for (block, values) in self.values.chunks(REFRESH).enumerate() {
            let mut phase = Complex64::cis(-turn * ((block * REFRESH) as f64 - half));
            for value in values {
                sum += phase * value;
                phase *= step;
            }
        }
        sum + self.beyond * (1.0 - frequency_per_mm.abs() / self.beyond_fades_per_mm).max(0.0)
    }
}

impl WaveChannel {
    /// The line-spread function of a section, on an image plane shifted by `defocus_mm` along z.
    ///
    /// With `ideal` it is that of the same beam without aberrations: the diffraction limit.
    pub fn line_spread(&self, section: Section, defocus_mm: f64, ideal: bool) -> LineSpread {
        let n = self.nodes;
        // A wave as wide as the pupil has a transform of twice that width.
        let length = (2 * n).next_power_of_two();
        let fft = FftPlanner::new().plan_fft_inverse(length);
        let mut scratch = vec![Complex64::ZERO; fft.get_inplace_scratch_len()];
        let mut values = vec![0.0; length];
        let mut line = vec![Complex64::ZERO; length];
        let nodes = self.nodes();
        let wave = self.defocused(&nodes, defocus_mm, ideal);
        for i in 0..n {
            line.fill(Complex64::ZERO);
            for (k, to) in line[..n].iter_mut().enumerate() {
                *to = match section {
                    Section::Sagittal => wave[i * n + k],
                    Section::Tangential => wave[k * n + i],
                };
            }
            if line[..n].iter().all(|v| *v == Complex64::ZERO) {
                continue;
            }
            fft.process_with_scratch(&mut line, &mut scratch);
            // The second half of the transform is that of negative places.
            for (k, e) in line.iter().enumerate() {
                values[(k + length / 2) % length] += e.norm_sqr();
            }
        }
        let total = nodes.points.iter().map(|p| p.energy).sum::<f64>() * length as f64;
        values.iter_mut().for_each(|v| *v /= total);
        let axis = match section {
            Section::Sagittal => 0,
            Section::Tangential => 1,
        };
        let node = 2.0 * self.map.scale[axis] / n as f64;
        // From a plane further behind, the sphere looks smaller.
        let (_, further) = self.map.sphere.further(self.map.slant(0.0, 0.0), defocus_mm);
        let per_node_mm = TAU / (self.wavenumber * self.map.n_image.abs() * node) * further;
        LineSpread {
            spacing_mm: per_node_mm / length as f64,
            beyond: (1.0 - values.iter().sum::<f64>()).max(0.0),
            beyond_fades_per_mm: 2.0 * self.soft_nodes() / per_node_mm,
            values,
        }
    }

    /// The wave on the nodes, `[row * nodes + column]`, seen from an image plane shifted along z: every wavelet of the reference
    /// sphere has so much further to go.
    pub(super) fn defocused(&self, nodes: &Nodes, defocus_mm: f64, ideal: bool) -> Vec<Complex64> {
        let n = self.nodes;
        let per_mm = self.wavenumber * self.map.n_image;
        let mut wave = Vec::with_capacity(n * n);
        for j in 0..n {
            for i in 0..n {
                let value = Complex64::new(nodes.wave.re[(i, j)], nodes.wave.im[(i, j)]);
                wave.push(if value == Complex64::ZERO {
                    value
                } else if ideal {
                    Complex64::new(value.norm(), 0.0)
                } else if defocus_mm == 0.0 {
                    value
                } else {
                    let slant = self.map.slant(self.q(j), self.q(i));
                    value * Complex64::cis(per_mm * self.map.sphere.further(slant, defocus_mm).0)
                });
            }
        }
        wave
    }
}
