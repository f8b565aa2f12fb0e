//! The optical transfer function of a wave, through its line-spread functions.
//!
//! The light on a line across the image adds up to that of the one-dimensional Fourier transforms of the wave's rows (Parseval),
//! so a fast Fourier transform of every row gives the line-spread function on points that hold all its detail, and its
//! Fourier sum the transfer function at any frequency. That is the autocorrelation of the wave over direction cosines: exact
//! for a flat image at any numerical aperture.

use std::f64::consts::TAU;
use std::sync::Arc;

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

use super::psf::WaveChannel;

/// Direction of the modulation of a test pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Section {
    /// Across the plane of the fields, along x: lines that point away from the axis.
    Sagittal,
    /// In the plane of the fields, along y.
    Tangential,
}

/// A line-spread function of unit sum.
#[derive(Clone, Debug)]
pub(crate) struct LineSpread {
    /// Distance of the points, mm.
    pub spacing_mm: f64,
    /// Light at `(k - half) spacing` from the origin, half of them on each side.
    pub values: Vec<f64>,
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
        sum
    }
}

/// The wave on the nodes of the pupil, `[row * nodes + column]`: evaluated once, looked at from many image planes.
#[derive(Clone)]
pub(crate) struct PupilWave<'a> {
    channel: &'a WaveChannel,
    pub(super) values: Vec<Complex64>,
    fft: Arc<dyn Fft<f64>>,
}

impl WaveChannel {
    /// The wave on the nodes.
    pub fn wave(&self) -> PupilWave<'_> {
        let (n, nodes) = (self.nodes, self.nodes());
        let at = |j: usize, i: usize| Complex64::new(nodes.wave.re[(i, j)], nodes.wave.im[(i, j)]);
        PupilWave {
            channel: self,
            values: (0..n).flat_map(|j| (0..n).map(move |i| (j, i))).map(|(j, i)| at(j, i)).collect(),
            // A wave as wide as the pupil has a transform of twice that width.
            fft: FftPlanner::new().plan_fft_inverse((2 * n).next_power_of_two()),
        }
    }
}

impl PupilWave<'_> {
    /// The same beam without aberrations: the diffraction limit.
    pub fn ideal(&self) -> Self {
        let values = self.values.iter().map(|v| Complex64::new(v.norm_sqr().sqrt(), 0.0)).collect();
        Self { values, ..self.clone() }
    }

    /// What shifts the image plane by `defocus_mm` along z, by node: every plane wave turns by `k n' dz` times the cosine of its
    /// slant.
    pub fn turns(&self, defocus_mm: f64) -> Vec<Complex64> {
        let (channel, n) = (self.channel, self.channel.nodes);
        let per_mm = channel.wavenumber * channel.map.n_image * defocus_mm;
        let mut turns = vec![Complex64::ZERO; n * n];
        for (k, turn) in turns.iter_mut().enumerate().filter(|(k, _)| self.values[*k] != Complex64::ZERO) {
            *turn = Complex64::cis(per_mm * channel.map.slant(channel.q(k / n), channel.q(k % n)));
        }
        turns
    }

    /// Turns every node.
    pub fn turn(&mut self, turns: &[Complex64]) {
        self.values.iter_mut().zip(turns).for_each(|(v, turn)| *v *= turn);
    }

    /// The line-spread function of a section.
    pub fn line_spread(&self, section: Section) -> LineSpread {
        let (channel, n) = (self.channel, self.channel.nodes);
        let length = self.fft.len();
        let mut scratch = vec![Complex64::ZERO; self.fft.get_inplace_scratch_len()];
        let mut values = vec![0.0; length];
        let mut line = vec![Complex64::ZERO; length];
        // The lines of the two halves of a symmetric pupil make the same light.
        let lines = match section {
            Section::Sagittal => 0..n,
            Section::Tangential => channel.columns(),
        };
        for i in lines {
            line[n..].fill(Complex64::ZERO);
            for (k, to) in line[..n].iter_mut().enumerate() {
                *to = match section {
                    Section::Sagittal => self.values[i * n + k],
                    Section::Tangential => self.values[k * n + i],
                };
            }
            if line[..n].iter().all(|v| *v == Complex64::ZERO) {
                continue;
            }
            self.fft.process_with_scratch(&mut line, &mut scratch);
            values.iter_mut().zip(&line).for_each(|(sum, e)| *sum += e.norm_sqr());
        }
        // The second half of the transform is that of negative places.
        values.rotate_right(length / 2);
        let total: f64 = values.iter().sum();
        values.iter_mut().for_each(|v| *v /= total);
        let axis = match section {
            Section::Sagittal => 0,
            Section::Tangential => 1,
        };
        let node = 2.0 * channel.map.scale[axis] / n as f64;
        let spacing_mm = TAU / (channel.wavenumber * channel.map.n_image.abs() * node * length as f64);
        LineSpread { spacing_mm, values }
    }
}
