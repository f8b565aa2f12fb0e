//! The optical transfer function of a wave, through its line-spread functions.
//!
//! By Parseval's theorem the light on a line across the image is the sum of the squared one-dimensional Fourier
//! transforms of the wave's rows. So a fast Fourier transform of every row gives the line-spread function with all its
//! detail, and its Fourier sum gives the transfer function at any frequency. This is the autocorrelation of the wave
//! over direction cosines, which is exact for a flat image at any numerical aperture.

use std::f64::consts::TAU;
use std::sync::Arc;

use petzval_fourier::{Complex64, Fft};

use super::nodes::NodeWave;
use super::psf::WaveChannel;

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
    /// Light beyond the points: diffracted by hard edges of the beam.
    beyond: f64,
    /// Frequency from which on that light is not modulated, 1/mm.
    beyond_fades_per_mm: f64,
    /// Frequency at which a shift of the wave is as wide as the grid of the pupil, 1/mm.
    highest_per_mm: f64,
}

impl LineSpread {
    /// The transfer function at a frequency, 1/mm.
    pub fn transfer(&self, frequency_per_mm: f64) -> Complex64 {
        // Beyond this frequency the wave and its shifted copy do not overlap; the sum would repeat.
        if frequency_per_mm.abs() >= self.highest_per_mm {
            return Complex64::ZERO;
        }
        let half = (self.values.len() / 2) as f64;
        let turn = TAU * frequency_per_mm * self.spacing_mm;
        // Sum with the recurrence of sines, restarted often enough to stay exact.
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

/// The wave on the nodes of the pupil.
#[derive(Clone)]
pub(crate) struct PupilWave<'a> {
    channel: &'a WaveChannel,
    /// `[row * nodes + column]`
    pub(super) values: Vec<Complex64>,
    /// Energy of all nodes, in units of `|value|^2`.
    energy: f64,
    fft: Arc<dyn Fft<f64>>,
}

impl WaveChannel {
    /// The wave on the nodes.
    pub fn wave(&self) -> PupilWave<'_> {
        let (n, grid) = (self.nodes, self.grid());
        let NodeWave { wave, energy, .. } = grid.wave(&self.map);
        let first = grid.columns(self.map.samples.sides).start;
        let mut values = Vec::with_capacity(n * n);
        for j in 0..n {
            let at = |i: usize| Complex64::new(wave.re[(i, j)], wave.im[(i, j)]);
            // The columns in front of the first are mirror images.
            values.extend((0..first).map(|i| at(n - 1 - i - first)));
            values.extend((0..n - first).map(at));
        }
        PupilWave {
            channel: self,
            values,
            energy,
            // Pad to twice the length: the autocorrelation of a wave is twice as wide as the wave.
            fft: petzval_fourier::inverse((2 * n).next_power_of_two()),
        }
    }
}

impl PupilWave<'_> {
    /// The same beam without aberrations: the diffraction limit.
    pub fn ideal(&self) -> Self {
        let values = self.values.iter().map(|v| Complex64::new(v.norm_sqr().sqrt(), 0.0)).collect();
        Self { values, ..self.clone() }
    }

    /// The line-spread function of a section.
    pub fn line_spread(&self, section: Section) -> LineSpread {
        let (channel, n) = (self.channel, self.channel.nodes);
        let length = self.fft.len();
        let mut scratch = vec![Complex64::ZERO; self.fft.get_inplace_scratch_len()];
        let mut values = vec![0.0; length];
        let mut line = vec![Complex64::ZERO; length];
        // Use half of the lines of a symmetric pupil: the other half gives the same light.
        let lines = match section {
            Section::Sagittal => 0..n,
            Section::Tangential => channel.grid().columns(channel.map.samples.sides),
        };
        let times = n as f64 / lines.len() as f64;
        for i in lines {
            // Transform one line of the pupil, and add its squared modulus.
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
        // Move negative positions, the second half of the transform, to the front.
        values.rotate_right(length / 2);
        let unit = times / (self.energy * length as f64);
        values.iter_mut().for_each(|v| *v *= unit);
        let axis = match section {
            Section::Sagittal => 0,
            Section::Tangential => 1,
        };
        let node = 2.0 * channel.map.scale[axis] / n as f64;
        let per_node_mm = TAU / (channel.wavenumber * channel.map.n_image.abs() * node);
        LineSpread {
            spacing_mm: per_node_mm / length as f64,
            beyond: (1.0 - values.iter().sum::<f64>()).max(0.0),
            beyond_fades_per_mm: 2.0 * channel.soft_nodes() / per_node_mm,
            highest_per_mm: n as f64 / per_node_mm,
            values,
        }
    }
}
