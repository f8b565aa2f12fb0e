//! The light of a scene on the pixels, from samples of the scene that may be finer than the pixels.

use petzval_base::Cancel;

use super::geometry::Window;
use super::{
    Distortion, Placement, RenderError, RenderGeometry, illumination_map, kernel_radius, patch_kernels,
    render_kernels_unless,
};
use crate::image::{CHANNELS, LinearImage};
use crate::psf::PsfBank;

/// Samples of the scene that are rendered at a time: a strip of them takes about 60 bytes each.
const MOST_AT_A_TIME: usize = 1 << 23;

/// Light on a window of pixels, three planes, when a lens with these PSFs looks at a `picture` of `samples` x `samples` samples a pixel.
///
/// Every sample is a point of light. The PSF spreads it over pixels of the size of the samples, and relative illumination dims it. Each
/// pixel of the sensor collects the mean of the samples that it covers. This integrates the blurred scene over the pixel, aliasing
/// included. The cells of the PSF are not resampled: detail finer than `PsfBank::pitch_um` is blurred by a cell.
///
/// `geometry` and `window` are those of the pixels. The `picture` covers the sensor, or with a `distortion` what the lens projects
/// onto it, [`Distortion::ideal_frame`]; outside it its edge is repeated. Light below zero, from the rounding of transforms, is cut off.
///
/// A call that is cancelled ends within the time of a tile, with [`RenderError::Stopped`].
pub fn light_on_pixels(
    geometry: &RenderGeometry,
    bank: &PsfBank,
    picture: &LinearImage,
    distortion: Option<&Distortion>,
    window: &Window,
    samples: usize,
    cancel: &Cancel,
) -> Result<LinearImage, RenderError> {
    let rows = MOST_AT_A_TIME / (window.width * samples * samples).max(1);
    in_strips(geometry, bank, picture, distortion, window, samples, rows.max(1), cancel)
}

/// [`light_on_pixels`] in strips of so many rows of pixels.
fn in_strips(
    geometry: &RenderGeometry,
    bank: &PsfBank,
    picture: &LinearImage,
    distortion: Option<&Distortion>,
    window: &Window,
    samples: usize,
    rows: usize,
    cancel: &Cancel,
) -> Result<LinearImage, RenderError> {
    let (fine, layout) = (geometry.finer(samples), bank.layout());
    let border = kernel_radius(&fine, &layout)?;
    let active = fine.active_patches(&window.finer(samples));
    let kernels = patch_kernels(&fine, &layout, &bank.values, &active)?;
    let mut out = LinearImage::zeros(CHANNELS, window.height, window.width);
    for first in (0..window.height).step_by(rows) {
        let placement = Placement { row: window.placement.row + first, col: window.placement.col };
        let strip = Window { placement, height: rows.min(window.height - first), width: window.width };
        let on_samples = strip.finer(samples);
        cancel.check()?;
        // The scene as it lies on the image, and around the strip what the PSF brings in.
        let scene = match distortion {
            Some(distortion) => distortion.project(&fine, picture, &on_samples, border)?,
            None => on_samples.scene(picture, border),
        };
        // The lens spreads it and dims it off the axis.
        let Window { placement, height, width } = on_samples;
        let mut light = render_kernels_unless(cancel, &fine, &kernels, &scene, placement)?;
        let dimming = illumination_map(&fine, &layout, &bank.illumination, placement, height, width)?;
        for (light, share) in light.data.iter_mut().zip(&dimming.data) {
            *light = (*light * share).max(0.0);
        }
        // Every pixel collects its samples.
        let collected = if samples == 1 { light } else { light.box_mean(samples) };
        for c in 0..CHANNELS {
            let at = first * window.width;
            out.plane_mut(c)[at..at + strip.height * window.width].copy_from_slice(collected.plane(c));
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::render::render_direct;

    const GEOMETRY: RenderGeometry =
        RenderGeometry { sensor_height: 36, sensor_width: 48, pixel_um: 6.0, patches: (2, 3) };
    const WHOLE: Window = Window { placement: Placement { row: 0, col: 0 }, height: 36, width: 48 };

    /// PSFs of an axis and a corner: Gauss curves of `sigma_um` on cells of 0.5 um, wider at the corner by `growth`.
    fn bank(sigma_um: f64, growth: f64) -> PsfBank {
        let (grid, pitch_um) = (48, 0.5);
        let mut values = Vec::new();
        for sigma_um in [sigma_um, sigma_um * growth] {
            let cell = |i: usize| (-0.5 * ((i as f64 - 23.5) * pitch_um / sigma_um).powi(2)).exp();
            let psf: Vec<f64> = (0..grid * grid).map(|i| cell(i / grid) * cell(i % grid)).collect();
            let sum: f64 = psf.iter().sum();
            (0..CHANNELS).for_each(|_| values.extend(psf.iter().map(|v| (v / sum) as f32)));
        }
        let illumination = vec![1.0, 1.0, 1.0, 1.0, 0.8, 0.6];
        PsfBank { field_radius_mm: vec![0.0, 0.18], grid, pitch_um, values, illumination }
    }

    fn picture(samples: usize, value: impl Fn(usize, usize) -> f32) -> LinearImage {
        let (height, width) = (36 * samples, 48 * samples);
        let plane: Vec<f32> = (0..height * width).map(|i| value(i / width, i % width)).collect();
        LinearImage { data: plane.repeat(CHANNELS), ..LinearImage::zeros(CHANNELS, height, width) }
    }

    /// Barrel distortion of 2 % at the corner.
    fn barrel() -> Distortion {
        let image_mm: Vec<f64> = (0..8).map(|i| f64::from(i) * 0.03).collect();
        Distortion::new(image_mm.clone(), image_mm.iter().map(|r| r * (1.0 + 0.6 * r * r)).collect()).unwrap()
    }

    #[test]
    fn a_pixel_collects_the_mean_of_the_samples_that_it_covers() {
        let bank = bank(2.0, 1.5);
        let layout = bank.layout();
        for (samples, distortion) in [(1, None), (3, None), (3, Some(barrel())), (4, Some(barrel()))] {
            let picture = picture(samples, |r, c| ((r * 7919 + c * 104_729) % 1000) as f32 * 1e-3);
            // Every sample by the defining sum, dimmed at its own place, then averaged block by block.
            let fine = GEOMETRY.finer(samples);
            let border = kernel_radius(&fine, &layout).unwrap();
            let all = WHOLE.finer(samples);
            let scene = match &distortion {
                Some(map) => map.project(&fine, &picture, &all, border).unwrap(),
                None => picture.pad_replicate(border),
            };
            let kernels = patch_kernels(&fine, &layout, &bank.values, &[true; 6]).unwrap();
            let blurred = render_direct(&fine, &kernels, &scene, all.placement).unwrap();
            let table = &bank.illumination;
            let map = illumination_map(&fine, &layout, table, all.placement, all.height, all.width).unwrap();
            let mut expected = LinearImage::zeros(CHANNELS, 36, 48);
            for c in 0..CHANNELS {
                for (row, col) in (0..all.height).flat_map(|r| (0..all.width).map(move |c| (r, c))) {
                    let (r, s) = (row / samples, col / samples);
                    let share = blurred.get(c, row, col) * map.get(c, row, col) / (samples * samples) as f32;
                    expected.set(c, r, s, expected.get(c, r, s) + share);
                }
            }
            let map = distortion.as_ref();
            let whole = light_on_pixels(&GEOMETRY, &bank, &picture, map, &WHOLE, samples, &Cancel::default())
                .unwrap();
            let in_pieces =
                in_strips(&GEOMETRY, &bank, &picture, map, &WHOLE, samples, 7, &Cancel::default()).unwrap();
            let part = Window { placement: Placement { row: 9, col: 14 }, height: 11, width: 20 };
            let window =
                light_on_pixels(&GEOMETRY, &bank, &picture, map, &part, samples, &Cancel::default()).unwrap();
            let cut = expected.crop(9, 14, 11, 20).unwrap();
            for (found, expected) in [(whole, &expected), (in_pieces, &expected), (window, &cut)] {
                assert!(
                    found.data.iter().zip(&expected.data).all(|(a, b)| (a - b).abs() < 5e-6),
                    "{samples}"
                );
            }
        }
    }

    #[test]
    fn a_dot_that_moves_by_a_sample_moves_its_image_by_that_part_of_a_pixel() {
        let (bank, samples) = (bank(4.0, 1.0), 4);
        let centroid = |col: usize| {
            let dot = picture(samples, |r, c| if (r, c) == (70, col) { 16.0 } else { 0.0 });
            let seen =
                light_on_pixels(&GEOMETRY, &bank, &dot, None, &WHOLE, samples, &Cancel::default()).unwrap();
            let plane = seen.plane(0).iter().enumerate();
            let sums = plane
                .fold((0.0, 0.0), |s, (i, v)| (s.0 + f64::from(*v), s.1 + f64::from(*v) * (i % 48) as f64));
            (sums.0, sums.1 / sums.0)
        };
        for col in 90..99 {
            let (light, at) = centroid(col);
            assert!((light - 1.0).abs() < 1e-4, "{light}");
            // Samples 0..4 lie 3/8 and 1/8 of a pixel left and right of the middle of the first pixel. Collecting by pixels moves the
            // centroid by the aliases of the PSF, which this one suppresses to a thousandth of a pixel.
            let wanted = (col as f64 - 1.5) / 4.0;
            assert!((at - wanted).abs() < 2e-3, "{at} {wanted}");
        }
    }

    #[test]
    fn a_sinusoid_beyond_the_limit_of_the_pixels_aliases_with_the_contrast_of_optics_and_pixel() {
        let (bank, samples, pixel_um) = (bank(0.9, 1.0), 6, GEOMETRY.pixel_um);
        // Cycles per pixel: Nyquist's limit is 1/2.
        for (cycles, alias) in [(0.25, 0.25), (0.75, 0.25), (1.25, 0.25), (0.625, 0.375)] {
            let place = |col: usize| (col as f64 + 0.5) / samples as f64 - 0.5;
            let grating = picture(samples, |_, col| (0.5 + 0.5 * (TAU * cycles * place(col)).cos()) as f32);
            let seen = light_on_pixels(&GEOMETRY, &bank, &grating, None, &WHOLE, samples, &Cancel::default())
                .unwrap();
            // The transfer of the cells of the PSF, of their squares, and of the pixel.
            let frequency = cycles / pixel_um;
            let plane = &bank.values[..48 * 48];
            let of_cells: f64 = (plane.iter().enumerate())
                .map(|(i, v)| {
                    f64::from(*v) * (TAU * frequency * (i % 48) as f64 * 0.5 - TAU * frequency * 11.75).cos()
                })
                .sum();
            let square = |side: f64| (0.5 * TAU * frequency * side).sin() / (0.5 * TAU * frequency * side);
            let contrast = of_cells * square(0.5) * square(pixel_um);
            // The squares of cells and samples fit into each other, which the product of their transfers leaves out.
            // Columns away from the edge, whose repetition is not part of the grating.
            let row = &seen.plane(0)[18 * 48..][8..40];
            for (col, value) in row.iter().enumerate() {
                let wanted = 0.5 + 0.5 * contrast * (TAU * alias * (col + 8) as f64).cos();
                assert!((f64::from(*value) - wanted).abs() < 2e-3, "{cycles} {col}: {value} {wanted}");
            }
            assert!(contrast.abs() > 0.05, "{cycles}: {contrast}");
        }
    }
}
