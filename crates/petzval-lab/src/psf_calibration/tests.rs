use super::average::{Average, Dark};
use super::capture::{WindowLight, take_frame};
use super::compare::{Comparison, compare};
use super::estimate::{FieldEstimate, Place, estimate_bank};
use super::held_out::HeldOutBy;
use super::landing::{FinePsf, Landing, Spot};
use super::measure::{Frame, Measured, check_mosaic, extract, l1, measure};
use super::merge::{ExposureMean, Merged, merge};
use super::register::explain;
use petzval_camera::develop::dark_mean_dn;
use petzval_camera::image::CHANNELS;
use petzval_camera::psf::PsfBank;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{CfaPattern, Exposure, Noise, NoiseMode, SensorModel};

/// Uniform numbers in [0, 1) from a fixed sequence.
fn noise(seed: u64, n: usize) -> Vec<f32> {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| rng.random::<f32>()).collect()
}

const SIDE: usize = 64;
const TIMES_S: [f64; 3] = [0.001, 0.004, 0.016];

fn sensor() -> SensorModel {
    petzval_files::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx249-calibrated.toml"))
        .unwrap()
}

/// A spot with a core, a comatic tail away from the axis, and lateral colour, on 1 um cells.
fn fine() -> FinePsf {
    let grid = 128;
    let spot = |shift_um: f64, i: usize| {
        let y = (i / grid) as f64 - 63.5 - shift_um;
        let x = (i % grid) as f64 - 63.5;
        let gauss = |dy: f64, sx: f64, sy: f64| (-0.5 * ((x / sx).powi(2) + ((y - dy) / sy).powi(2))).exp();
        gauss(0.0, 4.0, 4.0) + 0.12 * gauss(9.0, 9.0, 12.0)
    };
    let channel = |shift_um: f64| {
        let cells: Vec<f64> = (0..grid * grid).map(|i| spot(shift_um, i)).collect();
        let sum: f64 = cells.iter().sum();
        cells.into_iter().map(|v| v / sum).collect::<Vec<f64>>()
    };
    FinePsf {
        grid,
        pitch_um: 1.0,
        values: [channel(2.0), channel(0.0), channel(-1.5)],
        light: [7.0e6, 1.0e7, 6.0e6],
        disc_um: 1.3,
    }
}

struct Taken {
    frame: Frame,
    merged: Merged,
    exposures: Vec<ExposureMean>,
    measured: Measured,
}

/// Captures as in the paper: three times of 20 frames, or one without noise of each.
fn take(
    psf: &FinePsf,
    spot: Spot,
    placement: Placement,
    mode: NoiseMode,
    brightness: f64,
    seed: u64,
) -> Taken {
    take_with(&sensor(), psf, spot, placement, mode, brightness, seed)
}

fn take_with(
    sensor: &SensorModel,
    psf: &FinePsf,
    spot: Spot,
    placement: Placement,
    mode: NoiseMode,
    brightness: f64,
    seed: u64,
) -> Taken {
    let rate_e_per_s = psf
        .land(spot, sensor.pixel_um, (SIDE, SIDE))
        .map(|plane| plane.into_iter().map(|v| v * brightness).collect::<Vec<f64>>());
    let light = WindowLight { height: SIDE, width: SIDE, placement, rate_e_per_s };
    let count = if mode == NoiseMode::Off { 1 } else { 20 };
    let exposures: Vec<ExposureMean> = TIMES_S
        .iter()
        .enumerate()
        .map(|(k, &time_s)| {
            let mut average = Average::default();
            for n in 0..count {
                let noise = Noise { mode, seed };
                let raw = take_frame(&light, sensor, time_s, 1.0, &noise, (k * count + n) as u64).unwrap();
                average.add(raw.dn.iter().map(|v| f64::from(*v)), sensor.max_dn());
            }
            let exposure = Exposure { white_e: 1.0, time_s: time_s as f32, linear_gain: 1.0 };
            let dark = Dark::modelled(dark_mean_dn(sensor, &exposure), SIDE * SIDE);
            ExposureMean { time_s, light: average, dark }
        })
        .collect();
    let merged = merge(&exposures, sensor, 1.0);
    let frame = Frame { height: SIDE, width: SIDE, placement, cfa: sensor.cfa };
    let measured = measure(&merged, &frame, "test", seed).unwrap();
    Taken { frame, merged, exposures, measured }
}

fn against(psf: &FinePsf, taken: &Taken, spot: Spot) -> Comparison {
    let expected = Some([spot.row, spot.col]);
    compare(&taken.measured, &taken.frame, psf, 5.86, spot.azimuth_rad, expected, "test").unwrap()
}

const SPOT: Spot = Spot { row: 31.3, col: 32.4, azimuth_rad: 0.6 };
const CORNER: Placement = Placement { row: 801, col: 1200 };

#[test]
fn landing_conserves_light_and_centroid() {
    let psf = fine();
    let planes = psf.land(SPOT, 5.86, (SIDE, SIDE));
    let total: f64 = planes[1].iter().sum();
    assert!((total / psf.light[1] - 1.0).abs() < 1e-9, "{total}");
    let row = planes[1].iter().enumerate().map(|(i, v)| v * (i / SIDE) as f64).sum::<f64>() / total;
    let col = planes[1].iter().enumerate().map(|(i, v)| v * (i % SIDE) as f64).sum::<f64>() / total;
    let [across, outward] = psf.centroid_um(1).map(|um| um / 5.86);
    let (sin, cos) = SPOT.azimuth_rad.sin_cos();
    // Pixels a little smaller than the spot keep its centroid but for their beat with it.
    assert!((row - (SPOT.row + outward * sin - across * cos)).abs() < 1e-3);
    assert!((col - (SPOT.col + outward * cos + across * sin)).abs() < 1e-3);
}

#[test]
fn the_image_of_a_wide_pinhole_is_a_disc() {
    let psf = FinePsf { disc_um: 8.0 * 5.86, ..fine() };
    let seen = psf.land(SPOT, 5.86, (SIDE, SIDE));
    // The same by the points of a fine square grid within the disc.
    let point = FinePsf { disc_um: 0.0, ..fine() };
    let mut truth = vec![0.0; SIDE * SIDE];
    let mut count = 0.0;
    for i in 0..33 * 33 {
        let [row, col] = [i / 33, i % 33].map(|k| (k as f64 - 16.0) / 4.0);
        if row.hypot(col) <= 4.0 {
            let spot = Spot { row: SPOT.row + row, col: SPOT.col + col, ..SPOT };
            truth.iter_mut().zip(&point.land(spot, 5.86, (SIDE, SIDE))[1]).for_each(|(t, v)| *t += v);
            count += 1.0;
        }
    }
    let scale = |plane: &[f64], by: f64| plane.iter().map(|v| v / by).collect::<Vec<f64>>();
    let error = l1(&scale(&seen[1], psf.light[1]), &scale(&truth, count * point.light[1]));
    // Seven points are off by 0.5; the reference's own square grid by a percent of the disc's rim.
    assert!(error < 0.05, "{error}");
}

#[test]
fn the_error_of_a_centroid_includes_demosaicing() {
    // A spot below a pixel, without noise: through the same mosaic nothing is left, but the centroid is off.
    let values = vec![1.0];
    let psf = FinePsf {
        grid: 1,
        pitch_um: 4.0,
        values: [values.clone(), values.clone(), values],
        light: [5.0e5; CHANNELS],
        disc_um: 0.0,
    };
    let spot = Spot { row: 31.3, col: 32.4, azimuth_rad: 0.0 };
    let taken = take(&psf, spot, CORNER, NoiseMode::Off, 1.0, 1);
    let comparison = against(&psf, &taken, spot);
    for axis in 0..2 {
        assert!(comparison.centroid_error_px[1][axis].abs() < 0.01, "{:?}", comparison.centroid_error_px);
    }
    let ideal = comparison.ideal_centroid_px[1];
    // On ideal pixels, a box of 0.68 px that lies over two pixels: at most 0.16 px from its own middle.
    assert!((ideal[0] - spot.row).hypot(ideal[1] - spot.col) < 0.25, "{ideal:?}");
    let off = comparison.centroid_error_ideal_px[1];
    let measured = taken.measured.psf.centroid_px[1];
    assert!(off[0].hypot(off[1]) > 0.05, "{off:?}");
    assert!((off[0] - (measured[0] - ideal[0])).abs() < 1e-12);
}

#[test]
fn a_position_outside_the_frame_counts_as_unknown() {
    let psf = fine();
    let taken = take(&psf, SPOT, CORNER, NoiseMode::Off, 0.8, 1);
    for expected in [[-40.0, 30.0], [500.0, 500.0], [31.0, 2.0]] {
        let found =
            compare(&taken.measured, &taken.frame, &psf, 5.86, SPOT.azimuth_rad, Some(expected), "far");
        let found = found.unwrap();
        assert!(!found.is_placed, "{expected:?}");
        assert!(found.l1[1] < 2e-3, "{}", found.l1[1]);
    }
    // Far off but within the frame: the error is reported.
    let expected = [SPOT.row + 12.0, SPOT.col - 9.0];
    let off = compare(&taken.measured, &taken.frame, &psf, 5.86, SPOT.azimuth_rad, Some(expected), "off");
    let off = off.unwrap().centroid_error_px[1];
    assert!((off[0].hypot(off[1]) - 15.0).abs() < 1.0, "{off:?}");
}

#[test]
fn gathering_is_the_transpose_of_landing() {
    let landing = Landing::new((31, 2.0), SPOT, 3.0, 5.86, (SIDE, SIDE));
    let x = noise(1, 31 * 31);
    let y = noise(2, SIDE * SIDE);
    let wide = |v: &[f32]| v.iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (x, y) = (wide(&x), wide(&y));
    let (forward, backward) = (dot(&y, &landing.land(&x)), dot(&landing.gather(&y), &x));
    assert!((forward - backward).abs() < 1e-12 * forward.abs());
}

#[test]
fn a_landing_on_some_pixels_has_the_bits_of_the_whole_one_there() {
    let whole = Landing::new((31, 2.0), SPOT, 3.0, 5.86, (SIDE, SIDE));
    // The red pixels of a mosaic.
    let red: Vec<usize> =
        (0..SIDE * SIDE / 4).map(|i| 2 * (i / (SIDE / 2) * SIDE + i % (SIDE / 2))).collect();
    let some = whole.on(red.iter().copied());
    let wide = |v: Vec<f32>| v.into_iter().map(f64::from).collect::<Vec<f64>>();
    let cells = wide(noise(1, 31 * 31));
    let (of_some, of_whole) = (some.land(&cells), whole.land(&cells));
    assert!(red.iter().all(|pixel| of_some[*pixel] == of_whole[*pixel]));
    assert!(of_some.iter().sum::<f64>() < 0.5 * of_whole.iter().sum::<f64>());
    let mut window = vec![0.0; SIDE * SIDE];
    red.iter().zip(wide(noise(2, red.len()))).for_each(|(pixel, value)| window[*pixel] = value);
    assert_eq!(some.gather(&window), whole.gather(&window));
}

#[test]
fn without_noise_only_the_error_of_demosaicing_remains() {
    let psf = fine();
    let taken = take(&psf, SPOT, CORNER, NoiseMode::Off, 0.8, 1);
    let comparison = against(&psf, &taken, SPOT);
    for c in 0..CHANNELS {
        assert!(comparison.l1[c] < 2e-3, "channel {c}: {}", comparison.l1[c]);
        assert!(comparison.demosaic_l1[c] > 0.02, "a mosaic does no harm: {}", comparison.demosaic_l1[c]);
        assert!((comparison.l1_ideal[c] - comparison.demosaic_l1[c]).abs() < 2e-3);
        for axis in 0..2 {
            assert!(comparison.centroid_error_px[c][axis].abs() < 2e-3, "{:?}", comparison.centroid_error_px);
        }
    }
}

#[test]
fn a_monochrome_sensor_measures_one_psf_without_demosaicing() {
    let of_green = fine();
    let [_, green, _] = &of_green.values;
    let psf = FinePsf { values: [green, green, green].map(Clone::clone), light: [1.0e7; CHANNELS], ..fine() };
    let mono = SensorModel { cfa: CfaPattern::MONO, ..sensor() };
    let clean = take_with(&mono, &psf, SPOT, CORNER, NoiseMode::Off, 0.8, 1);
    let comparison = against(&psf, &clean, SPOT);
    assert!(comparison.l1_ideal.iter().chain(&comparison.l1).all(|l1| *l1 < 2e-3), "{comparison:?}");
    assert!(comparison.demosaic_l1.iter().all(|l1| *l1 < 1e-5));

    // Noise carries it no further than its floor says, and the bank holds one PSF three times.
    let noisy = take_with(&mono, &psf, SPOT, CORNER, NoiseMode::Exact, 0.8, 2);
    let comparison = against(&psf, &noisy, SPOT);
    let (l1, floor) = (comparison.l1[1], noisy.measured.floor.l1[1]);
    assert!(l1 < 1.5 * floor && l1 > 0.5 * floor, "{l1} {floor}");
    let place = Place {
        field_radius_mm: 0.0,
        azimuth_rad: SPOT.azimuth_rad,
        light_factor: 1.0,
        frame: &noisy.frame,
        merged: &noisy.merged,
        measured: &noisy.measured,
    };
    let (bank, fields) = estimate_bank(&[place], 5.86, &|_, _| Ok(())).unwrap();
    let planes: Vec<&[f32]> = bank.values.chunks(bank.grid * bank.grid).collect();
    assert!(planes.len() == CHANNELS && planes[0] == planes[1] && planes[1] == planes[2]);
    let warnings = fields[0].warnings();
    assert!(fields[0].is_mono && !warnings.iter().any(|w| w.contains("red")), "{warnings:?}");
}

#[test]
fn a_mosaic_that_is_neither_bayer_nor_mono_is_refused_with_a_hint() {
    for tile in ["RRGG/RRGG/GGBB/GGBB", "WR/GB", "GBGGRG/RGRBGB/GBGGRG/GRGGBG/BGBRGR/GRGGBG"] {
        let error = check_mosaic(tile.parse().unwrap()).unwrap_err().to_string();
        assert!(error.contains(tile) && error.contains("hint: "), "{error}");
    }
    assert!(check_mosaic(CfaPattern::MONO).is_ok() && check_mosaic(CfaPattern::GBRG).is_ok());
}

/// The acceptance: PSF and centroid come back within the predicted noise floor, whatever the azimuth, phase and brightness;
/// with an exposure that clips, too.
#[test]
fn a_known_psf_is_recovered_within_its_noise_floor() {
    let psf = fine();
    let mut errors = Vec::new();
    for (k, brightness) in [0.1, 0.3, 0.8, 0.8, 4.0].into_iter().enumerate() {
        let spot = Spot {
            row: 31.0 + 0.23 * k as f64,
            col: 32.0 - 0.19 * k as f64,
            azimuth_rad: 1.1 * k as f64 - 2.0,
        };
        let placement = Placement { row: 100 + 3 * k, col: 301 + 7 * k };
        let taken = take(&psf, spot, placement, NoiseMode::Exact, brightness, 40 + k as u64);
        let comparison = against(&psf, &taken, spot);
        let floor = &taken.measured.floor;
        for c in 0..CHANNELS {
            // The L1 distance sums 529 pixels: its own spread is a few percent of it, and half as much again is far out.
            let ratio = comparison.l1[c] / floor.l1[c];
            assert!((0.6..1.5).contains(&ratio), "place {k}, channel {c}: {ratio}");
            assert!(comparison.l1_ideal[c] < comparison.demosaic_l1[c] + 1.5 * floor.l1[c]);
            for axis in 0..2 {
                errors.push(comparison.centroid_error_px[c][axis] / floor.centroid_px[c][axis]);
            }
        }
        let propagated = taken.measured.centroid_se_px;
        for axis in 0..2 {
            let ratio = propagated[axis] / floor.centroid_px[1][axis];
            // 48 draws know their spread to 10 %; the moving window and the background widen it.
            assert!((0.5..1.5).contains(&ratio), "standard error {propagated:?}: {ratio}");
        }
    }
    // z-test of 30 centroid errors: the largest at a false alarm rate of 1e-4 (normal beyond 4.65 sigma, 30 times), widened by
    // the 10 % to which the spread is known.
    let worst = errors.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    assert!(worst < 5.2, "{errors:?}");
    let mean_square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
    assert!((0.3..2.2).contains(&mean_square), "{mean_square}");
}

#[test]
fn the_modelled_variance_equals_that_of_the_merged_rates() {
    let psf = fine();
    let sensor = sensor();
    let truth = take(&psf, SPOT, CORNER, NoiseMode::Off, 0.8, 1);
    let taken = take(&psf, SPOT, CORNER, NoiseMode::Exact, 0.8, 9);
    let rates = taken.merged.rate_e_per_s.iter().zip(&truth.merged.rate_e_per_s);
    let z: Vec<f64> = rates.zip(&taken.merged.variance).map(|((a, b), v)| (a - b) / v.sqrt()).collect();
    let count = z.len() as f64;
    let mean = z.iter().sum::<f64>() / count;
    let square = z.iter().map(|z| z * z).sum::<f64>() / count;
    // Both tests at alpha = 1e-5 (4.4 sigma).
    assert!(mean.abs() < 4.4 / count.sqrt(), "biased by {mean} standard deviations");
    assert!((square - 1.0).abs() < 4.4 * (2.0 / count).sqrt(), "variance off: {square}");
    for e in &taken.exposures {
        let ratio = e.variance_ratio(&taken.merged, &sensor, 1.0).unwrap();
        // 64 x 64 pixels with 19 degrees of freedom each.
        assert!((ratio - 1.0).abs() < 4.4 * (2.0 / (19.0 * count)).sqrt(), "{ratio}");
    }
}

#[test]
fn clipped_pixels_come_from_shorter_exposures() {
    let psf = fine();
    let dim = take(&psf, SPOT, CORNER, NoiseMode::Off, 0.8, 1);
    let bright = take(&psf, SPOT, CORNER, NoiseMode::Off, 8.0, 1);
    assert!(bright.exposures[2].light.clipped.iter().any(|c| *c), "the longest exposure clips");
    assert!(bright.merged.saturated.iter().all(|s| !s));
    for (a, b) in dim.merged.rate_e_per_s.iter().zip(&bright.merged.rate_e_per_s) {
        assert!((10.0 * a - b).abs() < 1e-3 * b.abs() + 30.0, "{a} {b}");
    }
    let blinding = take(&psf, SPOT, CORNER, NoiseMode::Exact, 200.0, 1);
    assert!(blinding.merged.saturated.iter().any(|s| *s), "reported, not hidden");
}

fn bank_of(psf: &FinePsf) -> (PsfBank, FieldEstimate) {
    let places: Vec<(Taken, Spot)> = (0..3)
        .map(|k| {
            let azimuth_rad = [std::f64::consts::FRAC_PI_2, 0.0, 0.65][k];
            let spot = Spot { row: 31.2 + 0.3 * k as f64, col: 32.3 - 0.4 * k as f64, azimuth_rad };
            (take(psf, spot, Placement { row: 200 + k, col: 300 }, NoiseMode::Exact, 0.8, k as u64), spot)
        })
        .collect();
    let inputs: Vec<Place> = places
        .iter()
        .map(|(taken, spot)| Place {
            field_radius_mm: 3.0,
            azimuth_rad: spot.azimuth_rad,
            light_factor: 1.0,
            frame: &taken.frame,
            merged: &taken.merged,
            measured: &taken.measured,
        })
        .collect();
    let (bank, fields) = estimate_bank(&inputs, 5.86, &|_, _| Ok(())).unwrap();
    assert_eq!(bank.illumination, [1.0; 6], "one field is its own reference");
    assert_eq!(bank.field_radius_mm, [0.0, 3.0]);
    (bank, fields[0].clone())
}

/// A place, an azimuth and noise that took no part: what the bank says of itself holds, on the mosaic and demosaiced.
#[test]
fn the_bank_predicts_a_new_position_within_its_stated_error() {
    let psf = fine();
    let (bank, field) = bank_of(&psf);
    let cells = bank.grid * bank.grid;
    let values: Vec<Vec<f64>> = bank.values[..CHANNELS * cells]
        .chunks(cells)
        .map(|v| v.iter().map(|v| f64::from(*v)).collect())
        .collect();
    assert_eq!(field.held_out.by, HeldOutBy::Positions);
    for (seed, azimuth_rad) in [(11, -2.1), (12, 0.3)] {
        let spot = Spot { row: 31.8 - 0.1 * f64::from(seed), col: 30.9, azimuth_rad };
        let new = take(&psf, spot, Placement { row: 301, col: 404 }, NoiseMode::Exact, 0.8, seed as u64);
        let place = Place {
            field_radius_mm: 3.0,
            azimuth_rad,
            light_factor: 1.0,
            frame: &new.frame,
            merged: &new.merged,
            measured: &new.measured,
        };
        let shapes: [&[f64]; CHANNELS] = [&values[0], &values[1], &values[2]];
        let (middle, score) = explain(&place, new.measured.psf.centroid_px[1], shapes, 5.86);
        let at = Spot { row: middle[0], col: middle[1], azimuth_rad };
        let landing = Landing::new((bank.grid, bank.pitch_um), at, 0.0, 5.86, (SIDE, SIDE));
        let light: [Vec<f64>; CHANNELS] = std::array::from_fn(|c| landing.land(&values[c]));
        let corner = Some(new.measured.psf.corner);
        let again = extract(&new.frame.mosaic(&light), &new.frame, middle, corner, "again").unwrap();
        for c in 0..CHANNELS {
            // One position beside the mean of three: twice that is far out.
            let said = field.held_out.score[c].l1();
            assert!(score[c].l1() < 2.0 * said, "channel {c}: {} where {said} was promised", score[c].l1());
            let error = l1(&again.values[c], &new.measured.psf.values[c]);
            assert!(error < 2.0 * said, "channel {c}, demosaiced: {error} where {said} was promised");
        }
    }
}

/// A field with one position can be tested on parts of its pixels only, and says so.
#[test]
fn a_single_position_gives_a_warning() {
    let psf = fine();
    let taken = take(&psf, SPOT, CORNER, NoiseMode::Exact, 0.8, 3);
    let place = Place {
        field_radius_mm: 3.0,
        azimuth_rad: SPOT.azimuth_rad,
        light_factor: 1.0,
        frame: &taken.frame,
        merged: &taken.merged,
        measured: &taken.measured,
    };
    let (_, mut fields) = estimate_bank(&[place], 5.86, &|_, _| Ok(())).unwrap();
    assert_eq!(fields[0].held_out.by, HeldOutBy::Pixels);
    assert!(fields[0].warnings().iter().any(|w| w.contains("one position only")));
    // And so are pixels that the cells do not explain.
    fields[0].chi2 = [1.0, 7.25, 1.1];
    let warnings = fields[0].warnings();
    assert!(warnings[0].contains("chi2 green 7.25 where"), "{warnings:?}");
    fields[0].chi2 = [1.0; CHANNELS];
    assert!(!fields[0].warnings()[0].contains("chi2"));
}

#[test]
fn captures_without_a_psf_are_errors() {
    let sensor = sensor();
    let frame = Frame { height: SIDE, width: SIDE, placement: CORNER, cfa: sensor.cfa };
    let dark = Merged {
        rate_e_per_s: noise(3, SIDE * SIDE).into_iter().map(f64::from).collect(),
        variance: vec![1.0 / 12.0; SIDE * SIDE],
        time_s: vec![1.0; SIDE * SIDE],
        saturated: vec![false; SIDE * SIDE],
    };
    let error = measure(&dark, &frame, "night", 1).unwrap_err().to_string();
    assert!(error.contains("`night`: no source"), "{error}");

    let psf = fine();
    let edge = Spot { row: 6.0, ..SPOT };
    let rates = frame.mosaic(&psf.land(edge, 5.86, (SIDE, SIDE)));
    let bright = Merged { rate_e_per_s: rates.clone(), variance: vec![100.0; SIDE * SIDE], ..dark.clone() };
    assert!(measure(&bright, &frame, "edge", 1).unwrap_err().to_string().contains("leave its 64 x 64"));

    // Two sources: the brighter one is measured, the other is reported.
    let both: Vec<f64> = frame
        .mosaic(&psf.land(Spot { row: 40.0, col: 24.0, ..SPOT }, 5.86, (SIDE, SIDE)))
        .iter()
        .zip(frame.mosaic(&psf.land(Spot { row: 10.0, col: 54.0, ..SPOT }, 5.86, (SIDE, SIDE))))
        .map(|(a, b)| a + 0.4 * b)
        .collect();
    let two = Merged { rate_e_per_s: both, ..bright.clone() };
    let measured = measure(&two, &frame, "two", 1).unwrap();
    assert_eq!(measured.other_sources.len(), 1);
    assert!((measured.other_sources[0].1 - 0.4).abs() < 0.15, "{:?}", measured.other_sources);

    let small = Frame { height: 20, ..frame };
    assert!(measure(&bright, &small, "small", 1).unwrap_err().to_string().contains("at least 36 x 36"));
    let binned = Frame { cfa: "RRGG/RRGG/GGBB/GGBB".parse().unwrap(), ..frame };
    assert!(measure(&bright, &binned, "binned", 1).unwrap_err().to_string().contains("a Bayer mosaic"));
}
