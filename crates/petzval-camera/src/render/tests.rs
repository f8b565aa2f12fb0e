use super::*;
use crate::image::CHANNELS;

/// Uniform numbers in [0, 1) from a fixed sequence.
pub(crate) fn noise(seed: u64, n: usize) -> Vec<f32> {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random::<f32>()).collect()
}

pub(super) fn geometry() -> RenderGeometry {
    RenderGeometry { sensor_height: 60, sensor_width: 84, pixel_um: 5.0, patches: (3, 4) }
}

/// Random PSFs of unit sum at three fields.
pub(super) fn bank(seed: u64) -> PsfBank {
    let grid = 12;
    let mut values = noise(seed, 3 * CHANNELS * grid * grid);
    for psf in values.chunks_exact_mut(grid * grid) {
        let sum: f32 = psf.iter().sum();
        psf.iter_mut().for_each(|v| *v /= sum);
    }
    let illumination = vec![1.0, 1.0, 1.0, 0.8, 0.79, 0.78, 0.5, 0.49, 0.48];
    PsfBank { field_radius_mm: vec![0.0, 0.1, 0.3], grid, pitch_um: 2.0, values, illumination }
}

fn radius() -> usize {
    kernel_radius(&geometry(), &bank(0).layout()).unwrap()
}

fn random_scene(seed: u64, height: usize, width: usize) -> LinearImage {
    LinearImage::from_data(CHANNELS, height, width, noise(seed, CHANNELS * height * width)).unwrap()
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(&x, &y)| x as f64 * y as f64).sum()
}

fn max_difference(a: &LinearImage, b: &LinearImage) -> f32 {
    assert_eq!((a.height, a.width), (b.height, b.width));
    a.data.iter().zip(&b.data).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
}

#[test]
fn a_point_like_psf_leaves_the_scene_unchanged() {
    let mut b = bank(1);
    b.values.fill(0.0);
    let g = b.grid;
    for psf in b.values.chunks_exact_mut(g * g) {
        for cell in [(g / 2 - 1, g / 2 - 1), (g / 2 - 1, g / 2), (g / 2, g / 2 - 1), (g / 2, g / 2)] {
            psf[cell.0 * g + cell.1] = 0.25;
        }
    }
    let scene = random_scene(2, 40 + 2 * radius(), 50 + 2 * radius());
    let out = render(&geometry(), &b, &scene, Placement { row: 7, col: 11 }).unwrap();
    let expected = scene.crop(radius(), radius(), 40, 50).unwrap();
    assert!(max_difference(&out, &expected) < 2e-6);
}

#[test]
fn a_flat_field_stays_flat() {
    let scene = LinearImage::filled(CHANNELS, 60, 84, 1.0).pad_replicate(radius());
    let out = render(&geometry(), &bank(3), &scene, Placement::default()).unwrap();
    assert!(out.data.iter().all(|v| (v - 1.0).abs() < 1e-6));
}

#[test]
fn kernels_conserve_energy() {
    let kernels = patch_kernels(&geometry(), &bank(4).layout(), &bank(4).values, &[true; 12]).unwrap();
    for patch in 0..12 {
        for c in 0..CHANNELS {
            let sum: f64 = kernels.kernel(patch, c).iter().map(|&v| v as f64).sum();
            assert!((sum - 1.0).abs() < 2e-6, "patch {patch}: {sum}");
        }
    }
}

#[test]
fn the_kernel_of_the_default_camera_holds_the_corners_of_a_128_um_grid() {
    let layout = PsfBank { grid: 128, pitch_um: 1.0, ..bank(0) }.layout();
    assert_eq!(kernel_radius(&RenderGeometry::default(), &layout), Ok(15));
}

#[test]
fn a_psf_shifted_along_y_moves_light_radially_outward_at_any_azimuth() {
    // A Gaussian spot 5 pixels outward of the image point, wide enough that pixel sampling keeps its centroid.
    let geometry = RenderGeometry { sensor_height: 300, sensor_width: 300, pixel_um: 5.0, patches: (5, 5) };
    let (grid, shift_um) = (96, 25.0);
    let centre = 0.5 * (grid as f64 - 1.0);
    let spot = |i: usize| {
        let (y, x) = ((i / grid) as f64 - centre - shift_um, (i % grid) as f64 - centre);
        (-(x * x + y * y) / (2.0 * 5.0f64.powi(2))).exp() / (2.0 * std::f64::consts::PI * 5.0f64.powi(2))
    };
    let values: Vec<f32> = (0..CHANNELS * grid * grid).map(|i| spot(i % (grid * grid)) as f32).collect();
    let b = PsfBank { field_radius_mm: vec![0.0], grid, pitch_um: 1.0, values, illumination: vec![1.0; 3] };
    let radius = kernel_radius(&geometry, &b.layout()).unwrap();
    let kernels = patch_kernels(&geometry, &b.layout(), &b.values, &[true; 25]).unwrap();
    let pixels = shift_um / geometry.pixel_um;
    for patch in 0..25 {
        let (x, y) = geometry.patch_centre_um(patch);
        let r = x.hypot(y);
        let outward = if r < 1.0 { (0.0, 1.0) } else { (x / r, y / r) };
        let miss = |dx: f64, dy: f64| (dx - pixels * outward.0).hypot(dy - pixels * outward.1);

        // The kernel has its centroid there, up to a hundredth of a pixel from sampling the rotated cells.
        let (kernel, size) = (kernels.kernel(patch, 1), kernels.size());
        let centroid = |f: &dyn Fn(usize) -> usize| {
            (0..size * size).map(|i| kernel[i] as f64 * (f(i) as f64 - radius as f64)).sum::<f64>()
        };
        let (dx, dy) = (centroid(&|i| i % size), centroid(&|i| i / size));
        assert!(miss(dx, dy) < 0.02, "patch {patch}: kernel at ({dx}, {dy})");

        // Rendering blends patches. Near the axis the azimuth varies within a patch, so the shift is not defined there.
        if r < 400.0 {
            continue;
        }
        // A point of light in the pixel nearest to the patch centre.
        let pixel = |u: f64| (u / geometry.pixel_um + 149.5).round() as usize;
        let (row, col) = (pixel(y), pixel(x));
        let mut scene = LinearImage::zeros(CHANNELS, 300 + 2 * radius, 300 + 2 * radius);
        scene.set(1, row + radius, col + radius, 1.0);
        let out = render(&geometry, &b, &scene, Placement::default()).unwrap();
        let moment = |f: &dyn Fn(usize, usize) -> f64| {
            (0..300 * 300).map(|i| out.plane(1)[i] as f64 * f(i / 300, i % 300)).sum::<f64>()
        };
        let energy = moment(&|_, _| 1.0);
        let (dy, dx) =
            (moment(&|i, _| i as f64) / energy - row as f64, moment(&|_, j| j as f64) / energy - col as f64);
        // Neighbouring patches blend in with slightly different azimuths: allow a quarter of a pixel.
        assert!(miss(dx, dy) < 0.25, "patch {patch}: moved ({dx}, {dy})");
    }
}

#[test]
fn rendering_that_is_cancelled_stops_before_the_next_tile() {
    let (geometry, b, cancel) = (geometry(), bank(5), Cancel::default());
    cancel.set();
    let (window, scene) =
        (Window { placement: Placement::default(), height: 60, width: 84 }, random_scene(6, 60, 84));
    let light = light_on_pixels(&geometry, &b, &scene, None, &window, 1, &cancel);
    assert!(matches!(light, Err(RenderError::Stopped(_))));
    let restored = Wiener::default().restore(&geometry, &b, &scene, Placement::default(), &cancel);
    assert!(matches!(restored, Err(RenderError::Stopped(_))));
    // Neither tiles by transforms nor those by the defining sum.
    let kernels = patch_kernels(&geometry, &b.layout(), &b.values, &[true; 12]).unwrap();
    let set = TileSet::new(&geometry, &window, radius(), Some(&kernels));
    let padded = scene.pad_replicate(radius());
    assert!(convolve::by_transforms(&set, &padded, &cancel).is_err());
    let supports = spatial::supports(&set, &kernels);
    assert!(spatial::render_tiles(&set, &kernels, &supports, &padded, &cancel).is_err());
}

#[test]
fn fast_rendering_equals_the_direct_sum() {
    let (geometry, b) = (geometry(), bank(5));
    for (height, width, placement) in [
        (60, 84, Placement::default()),
        (17, 23, Placement { row: 30, col: 40 }),
        (1, 1, Placement { row: 59, col: 0 }),
    ] {
        let scene = random_scene(6, height + 2 * radius(), width + 2 * radius());
        let kernels = patch_kernels(&geometry, &b.layout(), &b.values, &[true; 12]).unwrap();
        let reference = render_direct(&geometry, &kernels, &scene, placement).unwrap();
        // Directly and by FFTs, whichever is chosen.
        let cancel = Cancel::default();
        let window = Window { placement, height, width };
        let set = TileSet::new(&geometry, &window, radius(), Some(&kernels));
        let directly = set.assembled(
            &window,
            spatial::render_tiles(&set, &kernels, &spatial::supports(&set, &kernels), &scene, &cancel)
                .unwrap(),
        );
        let by_transforms = set.assembled(&window, convolve::by_transforms(&set, &scene, &cancel).unwrap());
        let chosen = render(&geometry, &b, &scene, placement).unwrap();
        for fast in [directly, by_transforms, chosen] {
            assert!(max_difference(&fast, &reference) < 2e-6);
        }
    }
}

#[test]
fn a_crop_equals_its_part_of_the_whole_picture_and_has_no_seams() {
    let (geometry, b, r) = (geometry(), bank(7), radius());
    let scene = random_scene(8, 60 + 2 * r, 84 + 2 * r);
    let whole = render(&geometry, &b, &scene, Placement::default()).unwrap();
    let part = scene.crop(13, 21, 30 + 2 * r, 40 + 2 * r).unwrap();
    let crop = render(&geometry, &b, &part, Placement { row: 13, col: 21 }).unwrap();
    assert!(max_difference(&crop, &whole.crop(13, 21, 30, 40).unwrap()) < 2e-6);

    // A smooth scene gives a smooth picture: no jump where patches or tiles meet.
    let mut ramp = LinearImage::zeros(CHANNELS, 60 + 2 * r, 84 + 2 * r);
    let width = ramp.width;
    for c in 0..CHANNELS {
        for (i, v) in ramp.plane_mut(c).iter_mut().enumerate() {
            *v = 0.01 * (i / width) as f32 + 0.005 * (i % width) as f32;
        }
    }
    let smooth = render(&geometry, &b, &ramp, Placement::default()).unwrap();
    for row in 1..59 {
        for col in 1..83 {
            let v = |dr: usize, dc: usize| smooth.get(0, row + dr - 1, col + dc - 1);
            let curvature =
                (v(0, 1) + v(2, 1) - 2.0 * v(1, 1)).abs().max((v(1, 0) + v(1, 2) - 2.0 * v(1, 1)).abs());
            assert!(curvature < 2e-3, "({row}, {col}): {curvature}");
        }
    }
}

#[test]
fn render_adjoint_passes_the_dot_product_test() {
    let (geometry, b, r) = (geometry(), bank(9), radius());
    for placement in [Placement::default(), Placement { row: 19, col: 30 }] {
        let (height, width) = (41, 53);
        let scene = random_scene(10, height + 2 * r, width + 2 * r);
        let mut y = random_scene(11, height, width);
        y.data.iter_mut().for_each(|v| *v -= 0.5);
        let gradient = render_adjoint(&geometry, &b, &scene, placement, &y).unwrap();

        let mut dv = bank(12);
        dv.values = noise(13, dv.values.len()).into_iter().map(|v| v - 0.5).collect();
        let forward = dot(&y.data, &render(&geometry, &dv, &scene, placement).unwrap().data);
        let backward = dot(&gradient.psfs.values, &dv.values);
        assert!((forward - backward).abs() < 1e-5 * forward.abs().max(1.0), "psf {forward} {backward}");

        let mut ds = random_scene(14, scene.height, scene.width);
        ds.data.iter_mut().for_each(|v| *v -= 0.5);
        let forward = dot(&y.data, &render(&geometry, &b, &ds, placement).unwrap().data);
        let backward = dot(&gradient.scene.data, &ds.data);
        assert!((forward - backward).abs() < 1e-5 * forward.abs().max(1.0), "scene {forward} {backward}");
    }
}

#[test]
fn finite_differences_agree_with_the_adjoint() {
    let (geometry, b, r) = (geometry(), bank(15), radius());
    let placement = Placement { row: 2, col: 3 };
    let scene = random_scene(16, 33 + 2 * r, 37 + 2 * r);
    let y = random_scene(17, 33, 37);
    let gradient = render_adjoint(&geometry, &b, &scene, placement, &y).unwrap();
    for index in [0, 78, 5 * 144 + 66, 8 * 144 + 80] {
        // The map is linear, so a large step has no truncation error.
        let mut moved = b.clone();
        moved.values[index] += 1.0;
        let change = dot(&y.data, &render(&geometry, &moved, &scene, placement).unwrap().data)
            - dot(&y.data, &render(&geometry, &b, &scene, placement).unwrap().data);
        let analytic = gradient.psfs.values[index] as f64;
        assert!((change - analytic).abs() < 1e-4 * (1.0 + analytic.abs()), "{index}: {change} {analytic}");
    }
    // Radii: the PSFs stay and move outwards.
    for field in 1..b.field_radius_mm.len() {
        let moved = |step: f64| {
            let mut moved = b.clone();
            moved.field_radius_mm[field] += step;
            dot(&y.data, &render(&geometry, &moved, &scene, placement).unwrap().data)
        };
        let (h, analytic) = (2e-3, gradient.psfs.radius[field]);
        let change = (moved(h) - moved(-h)) / (2.0 * h);
        assert!(
            (change - analytic).abs() < 1e-2 * (1.0 + analytic.abs()),
            "radius {field}: {change} {analytic}"
        );
    }
}

#[test]
fn illumination_interpolates_and_its_adjoint_passes_the_dot_product_test() {
    let (geometry, b) = (geometry(), bank(18));
    let placement = Placement { row: 4, col: 6 };
    let map = illumination_map(&geometry, &b.layout(), &b.illumination, placement, 50, 70).unwrap();
    let r = geometry.radius_mm(4, 6);
    let expected = 0.8 + (r - 0.1) / 0.2 * (0.5 - 0.8);
    assert!((map.get(0, 0, 0) as f64 - expected).abs() < 1e-6);
    assert!((map.get(0, 26, 36) - 1.0).abs() < 0.02);

    let y = random_scene(19, 50, 70);
    let table = noise(20, 9);
    let forward =
        dot(&y.data, &illumination_map(&geometry, &b.layout(), &table, placement, 50, 70).unwrap().data);
    let (by_table, by_radius) =
        illumination_adjoint(&geometry, &b.layout(), &table, placement, &y, [true; 2]).unwrap();
    // One of both alone has the same bits.
    let alone = |wanted: [bool; 2]| {
        illumination_adjoint(&geometry, &b.layout(), &table, placement, &y, wanted).unwrap()
    };
    assert_eq!(alone([true, false]), (by_table.clone(), Vec::new()));
    assert_eq!(alone([false, true]), (Vec::new(), by_radius.clone()));
    assert!((forward - dot(&table, &by_table)).abs() < 1e-6 * forward.abs());
    for field in 1..3 {
        let light = |step: f64| {
            let mut layout = b.layout();
            layout.field_radius_mm[field] += step;
            dot(&y.data, &illumination_map(&geometry, &layout, &table, placement, 50, 70).unwrap().data)
        };
        let change = (light(1e-4) - light(-1e-4)) / 2e-4;
        assert!(
            (change - by_radius[field]).abs() < 1e-2 * change.abs().max(1.0),
            "{change} {}",
            by_radius[field]
        );
    }
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    let (geometry, b, r) = (geometry(), bank(21), radius());
    let scene = random_scene(22, 60 + 2 * r, 84 + 2 * r);
    let y = random_scene(23, 60, 84);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let out = render(&geometry, &b, &scene, Placement::default()).unwrap();
            (out, render_adjoint(&geometry, &b, &scene, Placement::default(), &y).unwrap())
        })
    };
    assert!(run(1) == run(2));
}

#[test]
fn wrong_calls_are_typed_errors() {
    let (geometry, b, r) = (geometry(), bank(24), radius());
    let scene = |h: usize, w: usize| LinearImage::zeros(CHANNELS, h, w);
    let call = |s: &LinearImage, p: Placement| render(&geometry, &b, s, p).unwrap_err();
    assert!(matches!(call(&scene(2 * r, 90), Placement::default()), RenderError::SceneTooSmall { .. }));
    assert!(matches!(call(&scene(40, 90), Placement { row: 59, col: 0 }), RenderError::OffSensor { .. }));
    assert!(matches!(
        call(&scene(40, 40), Placement { row: usize::MAX, col: 0 }),
        RenderError::OffSensor { .. }
    ));
    assert!(matches!(
        call(&LinearImage::zeros(1, 40, 40), Placement::default()),
        RenderError::Channels { .. }
    ));
    let no_patches = RenderGeometry { patches: (0, 3), ..geometry.clone() };
    let error = render(&no_patches, &b, &scene(40, 40), Placement::default()).unwrap_err();
    assert!(matches!(error, RenderError::Geometry { .. }));
    let tiny_pixels = RenderGeometry { pixel_um: 1e-9, ..geometry };
    assert!(matches!(kernel_radius(&tiny_pixels, &b.layout()), Err(RenderError::PsfTooLarge { .. })));
}
