//! Rendered distortion against light that is put where exact rays land, and its gradient by the lens against differences.

use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::{
    Placement, RenderGeometry, Window, illumination_map, kernel_radius, patch_kernels, render,
    with_patches_for,
};
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_optics::lens::Lens;
use petzval_optics::psf::PsfOptions;
use petzval_optics::pupil::{Quadrature, chief_ray};

use crate::common::library;

const WAVELENGTHS_UM: [f64; 3] = [0.62, 0.55, 0.486];

/// A grid of patches so fine that one patch is a place: 5 rows by 8 columns.
const PLACES: (usize, usize) = (240, 240);

/// Standard deviation of a source, in pixels of the scene: wide enough for its samples to hold it.
const SOURCE_PX: f64 = 1.2;

fn nominal() -> Lens {
    library().lens("cooke-triplet-nominal").unwrap().lens
}

fn plan(fields: usize, cells: usize) -> PsfPlan {
    PsfPlan::new(fields, 6.634, WAVELENGTHS_UM, PsfOptions::default(), Quadrature::grid(cells).unwrap())
}

/// Position in pixels from the optical axis of the centre of an image with `size` pixels.
fn from_axis(at: usize, size: usize) -> f64 {
    at as f64 - 0.5 * (size as f64 - 1.0)
}

/// The picture of round sources, rendered as a camera does, against the superposition of the PSFs that are traced for each place,
/// laid where the chief rays of each source land. Nothing is shared with the interpolation of the map, its resampling and the blend of
/// patches; the search for the field of a place is by halving, on traced rays.
#[test]
fn sources_land_where_exact_rays_put_their_light() {
    let (lens, plan) = (nominal(), plan(31, 96));
    let bank = plan.bank(&lens).unwrap();
    let (geometry, _) = with_patches_for(&RenderGeometry::default(), &bank, 0.03).unwrap();
    let border = kernel_radius(&geometry, &bank.layout()).unwrap();
    let map = plan.distortion(&lens).unwrap();
    let (height, width) = map.ideal_frame(&geometry).unwrap();
    let pixel_mm = 1e-3 * geometry.pixel_um;
    // The scale of the image near the axis, by its rays.
    let reference = lens.at_wavelength(lens.reference_um);
    let scale_mm = chief_ray(&reference, 1e-3).unwrap().y_mm / 1e-3_f64.tan();

    let fine = RenderGeometry { patches: PLACES, ..geometry.clone() };
    let mut differences = Vec::new();
    for i in 1..=9 {
        // Places spread over the sensor by a sequence that fills it evenly; the last one is near a corner.
        let share = |step: f64| (f64::from(i) * step).fract();
        let (row, col) = match i {
            9 => (236, 237),
            _ => ((share(0.754_877_666) * 232.0) as usize + 4, (share(0.569_840_291) * 232.0) as usize + 4),
        };
        let place = row * PLACES.1 + col;
        let (x_um, y_um) = fine.patch_centre_um(place);
        let (centre_x, centre_y) = (x_um / geometry.pixel_um, y_um / geometry.pixel_um);
        // The ideal position of a position of the sensor, pixels from the axis: exact rays, no map.
        let ideal = |x: f64, y: f64| {
            let radius_mm = x.hypot(y) * pixel_mm;
            let (mut low, mut high) = (0.0_f64, 0.4_f64);
            while high - low > 1e-9 {
                let middle = 0.5 * (low + high);
                let lands_mm = chief_ray(&reference, middle).unwrap().y_mm;
                if lands_mm < radius_mm { low = middle } else { high = middle }
            }
            let stretch = scale_mm * low.tan() / radius_mm;
            (x * stretch, y * stretch)
        };
        let (source_x, source_y) = ideal(centre_x, centre_y);
        let source = |x: f64, y: f64| {
            (-0.5 * ((x - source_x).powi(2) + (y - source_y).powi(2)) / SOURCE_PX.powi(2)).exp()
        };

        // The scene with this source, rendered in a window around it.
        let mut scene = LinearImage::zeros(CHANNELS, height, width);
        for c in 0..CHANNELS {
            let plane = scene.plane_mut(c);
            for (k, value) in plane.iter_mut().enumerate() {
                let (x, y) = (from_axis(k % width, width), from_axis(k / width, height));
                if (x - source_x).abs() < 9.0 && (y - source_y).abs() < 9.0 {
                    *value = source(x, y) as f32;
                }
            }
        }
        let reach = 9 + border;
        let pixel = |centre: f64, size: usize| (centre + 0.5 * (size as f64 - 1.0)).round() as isize;
        let (top, left) = (
            pixel(centre_y, geometry.sensor_height) - reach as isize,
            pixel(centre_x, geometry.sensor_width) - reach as isize,
        );
        let place_of = |low: isize, side: usize, size: usize| low.clamp(0, (size - side) as isize) as usize;
        let side = 2 * reach + 1;
        let placement = Placement {
            row: place_of(top, side, geometry.sensor_height),
            col: place_of(left, side, geometry.sensor_width),
        };
        let window = Window { placement, height: side, width: side };
        let light = map.project(&geometry, &scene, &window, border).unwrap();
        let seen = render(&geometry, &bank, &light, placement).unwrap();
        let shade =
            illumination_map(&geometry, &bank.layout(), &bank.illumination, placement, side, side).unwrap();

        // The same by brute force: the source as exact rays distort it, convolved with the PSF of its own place.
        let exact_plan = PsfPlan { field_radius_mm: vec![0.0, 1e-3 * x_um.hypot(y_um)], ..plan.clone() };
        let exact = exact_plan.bank(&lens).unwrap();
        let mut active = vec![false; fine.patch_count()];
        active[place] = true;
        let kernels = patch_kernels(&fine, &exact.layout(), &exact.values, &active).unwrap();
        let size = kernels.size();
        let mut wanted = LinearImage::zeros(CHANNELS, side, side);
        for r in 0..side + 2 * border {
            for c in 0..side + 2 * border {
                let at = |k: usize, first: usize, size: usize| {
                    first as f64 + k as f64 - border as f64 - 0.5 * (size as f64 - 1.0)
                };
                let (x, y) = (
                    at(c, placement.col, geometry.sensor_width),
                    at(r, placement.row, geometry.sensor_height),
                );
                if (x - centre_x).hypot(y - centre_y) > 7.0 * SOURCE_PX {
                    continue;
                }
                let (ideal_x, ideal_y) = ideal(x, y);
                let radiance = source(ideal_x, ideal_y);
                // Pixel (r, c) of the light with its border is pixel (r - border, c - border) of the window.
                for colour in 0..CHANNELS {
                    let kernel = kernels.kernel(place, colour);
                    let lit = radiance * f64::from(exact.illumination[CHANNELS + colour]);
                    for (k, value) in kernel.iter().enumerate() {
                        let (to_row, to_col) = (r + k / size, c + k % size);
                        let half = border + size / 2;
                        if (half..half + side).contains(&to_row) && (half..half + side).contains(&to_col) {
                            let i = (to_row - half) * side + to_col - half;
                            wanted.plane_mut(colour)[i] += (lit * f64::from(*value)) as f32;
                        }
                    }
                }
            }
        }
        let total: f32 = wanted.data.iter().sum();
        let apart = |shift: usize| -> f32 {
            let shifted =
                |k: usize| seen.data[k.min(seen.data.len() - 1)] * shade.data[k.min(seen.data.len() - 1)];
            (0..wanted.data.len()).map(|k| (shifted(k + shift) - wanted.data[k]).abs()).sum::<f32>() / total
        };
        println!("place ({centre_x:.0}, {centre_y:.0}): L1 {:.4}, one pixel off {:.3}", apart(0), apart(1));
        assert!(apart(1) > 0.2, "a shift by a pixel is seen");
        differences.push(apart(0));
    }
    differences.sort_by(f32::total_cmp);
    assert!(differences[4] < 0.03, "{differences:?}");
    assert!(differences[8] < 0.05, "{differences:?}");
}
