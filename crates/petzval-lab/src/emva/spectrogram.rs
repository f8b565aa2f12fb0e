//! Spectrograms: the mean power spectrum of the rows (or columns) of a picture.

use petzval_fourier::Complex64;

use super::high_pass::Plane;

/// Mean power over the rows of `|FFT(y - mean)|^2 / N`, in the square of the picture's unit, at the frequencies
/// `0, 1/N, 2/N, ...` up to half a period per pixel. White noise has its variance at every frequency.
pub fn row_spectrogram(plane: &Plane) -> Vec<f64> {
    let width = plane.width;
    let mean = plane.values.iter().sum::<f64>() / plane.values.len() as f64;
    let fft = petzval_fourier::forward(width);
    let mut power = vec![0.0; width / 2 + 1];
    let mut line = vec![Complex64::ZERO; width];
    let mut scratch = vec![Complex64::ZERO; fft.get_inplace_scratch_len()];
    for row in plane.values.chunks_exact(width) {
        line.iter_mut().zip(row).for_each(|(c, v)| *c = Complex64::new(v - mean, 0.0));
        fft.process_with_scratch(&mut line, &mut scratch);
        power.iter_mut().zip(&line).for_each(|(p, c)| *p += c.norm_sqr());
    }
    let scale = 1.0 / (width * plane.height) as f64;
    power.iter_mut().for_each(|p| *p *= scale);
    power
}

/// As [`row_spectrogram`], of the columns.
pub fn column_spectrogram(plane: &Plane) -> Vec<f64> {
    row_spectrogram(&transposed(plane))
}

fn transposed(plane: &Plane) -> Plane {
    let (height, width) = (plane.width, plane.height);
    let values = (0..height * width).map(|i| plane.values[i % width * plane.width + i / width]).collect();
    Plane { height, width, values }
}
