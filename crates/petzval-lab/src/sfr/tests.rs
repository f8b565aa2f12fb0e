//! Edges whose response is known.

use std::f64::consts::PI;

use petzval_camera::render::Placement;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::*;

const SIDE: usize = 80;

/// Standard deviation of the blur with which an upright edge has MTF50 at 0.2807 cycles per pixel, the square pixel included.
const SIGMA: f64 = 0.6;

/// An edge to render: light from `levels[0]` to `levels[1]` across a straight or curved line.
#[derive(Clone, Copy)]
struct Edge {
    height: usize,
    width: usize,
    angle_deg: f64,
    sigma: f64,
    levels: [f64; 2],
    /// Distance of the middle of the window from the line, pixels.
    offset: f64,
    /// Radius of curvature, pixels; infinite for a straight edge.
    radius: f64,
}

impl Edge {
    fn at(angle_deg: f64, sigma: f64) -> Self {
        Self {
            height: SIDE,
            width: SIDE,
            angle_deg,
            sigma,
            levels: [0.2, 0.8],
            offset: 0.3,
            radius: f64::INFINITY,
        }
    }

    /// Signed distance from the edge, of a point relative to the middle of the window.
    fn distance(&self, x: f64, y: f64) -> f64 {
        let (sin, cos) = self.angle_deg.to_radians().sin_cos();
        let (across, along) = ((x - self.offset) * cos - y * sin, (x - self.offset) * sin + y * cos);
        let radius = self.radius.abs();
        if radius.is_infinite() {
            across
        } else if self.radius > 0.0 {
            radius - (radius - across).hypot(along)
        } else {
            (radius + across).hypot(along) - radius
        }
    }

    /// The light that square pixels collect, blurred by a Gaussian. Straight edges are integrated exactly along the rows.
    fn light(&self) -> Vec<f32> {
        const POINTS: usize = 20;
        let cos = self.angle_deg.to_radians().cos();
        let share = |distance: f64| 0.5 * libm::erfc(-distance / (self.sigma * 2f64.sqrt()));
        // The integral of the normal distribution's integral: u P(u) + p(u).
        let integral = |distance: f64| {
            let u = distance / self.sigma;
            self.sigma * (u * share(distance) + (-0.5 * u * u).exp() / (2.0 * PI).sqrt())
        };
        let of_pixel = |row: usize, col: usize| {
            let middle = self.distance(
                col as f64 + 0.5 - 0.5 * self.width as f64,
                row as f64 + 0.5 - 0.5 * self.height as f64,
            );
            if middle.abs() > 6.0 * self.sigma + 1.0 {
                return self.levels[usize::from(middle > 0.0)];
            }
            let point = |k: usize| (k as f64 + 0.5) / POINTS as f64;
            let y = |k: usize| row as f64 + point(k) - 0.5 * self.height as f64;
            let x = |by: f64| col as f64 + by - 0.5 * self.width as f64;
            let mean = |of: &dyn Fn(usize) -> f64| (0..POINTS).map(of).sum::<f64>() / POINTS as f64;
            let lit = if self.radius.is_finite() {
                mean(&|k| mean(&|j| share(self.distance(x(point(j)), y(k)))))
            } else {
                mean(&|k| {
                    let [left, right] = [0.0, 1.0].map(|by| integral(self.distance(x(by), y(k))));
                    (right - left) / cos
                })
            };
            self.levels[0] + (self.levels[1] - self.levels[0]) * lit
        };
        (0..self.height * self.width).map(|i| of_pixel(i / self.width, i % self.width) as f32).collect()
    }

    /// The edge over its whole window.
    fn measured(&self, values: &[f32]) -> Result<EdgeResponse, SfrError> {
        slanted_edge(&Plane { values, width: self.width }, &window(0, 0, self.height, self.width))
    }

    fn known(&self, frequency: f64) -> f64 {
        known(frequency, self.angle_deg, self.sigma)
    }

    /// The frequency where [`known`] is a half.
    fn mtf50(&self) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.known(middle) > 0.5 { low = middle } else { high = middle }
        }
        low
    }

    #[track_caller]
    fn assert_mtf50(&self, values: &[f32], share: f64) -> EdgeResponse {
        let found = self.measured(values).unwrap();
        let (mtf50, wanted) = (found.sfr.mtf50().unwrap(), self.mtf50());
        let error = mtf50.frequency / wanted - 1.0;
        assert!(error.abs() < share, "{} deg: {mtf50:?} for {wanted}, {error:+.5}", self.angle_deg);
        found
    }
}

/// The response of Gaussian blur and of a square pixel, across an inclined edge.
fn known(frequency: f64, angle_deg: f64, sigma: f64) -> f64 {
    let sinc = |x: f64| if x.abs() < 1e-9 { 1.0 } else { (PI * x).sin() / (PI * x) };
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    let pixel = sinc(frequency * cos) * sinc(frequency * sin);
    (-2.0 * (PI * sigma * frequency).powi(2)).exp() * pixel
}

fn window(row: usize, col: usize, height: usize, width: usize) -> Window {
    Window { placement: Placement { row, col }, height, width }
}

fn edge(angle_deg: f64, sigma: f64) -> Vec<f32> {
    Edge::at(angle_deg, sigma).light()
}

fn measured(values: &[f32]) -> Result<EdgeResponse, SfrError> {
    slanted_edge(&Plane { values, width: SIDE }, &window(4, 8, SIDE - 8, SIDE - 16))
}

fn with_noise(values: &[f32], sigma: f32, seed: u64) -> Vec<f32> {
    let noise = Normal::new(0.0, sigma).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    values.iter().map(|v| v + noise.sample(&mut rng)).collect()
}

#[test]
fn the_response_is_that_of_blur_and_pixel() {
    for (angle_deg, sigma) in [(5.0, 0.3), (5.0, 0.7), (-7.3, 0.7), (3.1, 1.4), (12.0, 0.5), (5.0, 2.5)] {
        let of = measured(&edge(angle_deg, sigma)).unwrap();
        assert!(
            (of.angle_deg.value.abs() - f64::abs(angle_deg)).abs() < 0.01,
            "{angle_deg}: {:?}",
            of.angle_deg
        );
        for k in 1..=60 {
            let frequency = 0.01 * f64::from(k);
            let (found, wanted) = (of.sfr.at(frequency), known(frequency, angle_deg, sigma));
            assert!((found - wanted).abs() < 0.002, "{angle_deg} {sigma} {frequency}: {found} {wanted}");
        }
        let [dark, bright] = of.levels.map(|level| level.value);
        assert!((dark - 0.2).abs() < 1e-3 && (bright - 0.8).abs() < 1e-3, "{:?}", of.levels);
        assert!(of.overshoot.value < 0.002 && of.undershoot.value < 0.002 && of.roughness_px < 0.02);
        assert!(of.left_out == 0 && of.light_fall.is_none() && of.sagitta_px < 0.01, "{of:?}");
    }
}

#[test]
fn mtf50_is_right_to_a_fifth_of_a_percent_from_2_to_45_degrees() {
    let upright = Edge::at(0.0, SIGMA).mtf50();
    assert!((upright - 0.2807).abs() < 5e-5, "{upright}");
    for (i, tenths) in [20, 25, 31, 50, 71, 101, 143, 184, 200, 266, 300, 337, 350, 369, 400, 430, 445, 450]
        .iter()
        .enumerate()
    {
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        let edge = Edge::at(sign * 0.1 * f64::from(*tenths), SIGMA);
        edge.assert_mtf50(&edge.light(), 0.002);
    }
    // Regions of other sizes.
    for (height, width, angle_deg) in [(60, 100, 35.0), (200, 60, 2.0), (120, 120, 43.0), (40, 40, 8.0)] {
        let edge = Edge { height, width, ..Edge::at(angle_deg, SIGMA) };
        edge.assert_mtf50(&edge.light(), 0.002);
    }
}

#[test]
fn a_sharp_edge_at_45_degrees_is_refused_at_every_phase_of_the_pixels() {
    // The pixels sample it every 0.71 pixels. At the offset of a half they do so at opposite phases on either side.
    for offset in [0.0, 0.2, 0.3, 0.5] {
        let edge = Edge { offset, ..Edge::at(45.0, 0.3) };
        let found = edge.measured(&edge.light());
        let is_coarse = |error: &SfrError| matches!(error, SfrError::Angle { gap_px, .. } if (gap_px - 0.5f64.sqrt()).abs() < 1e-3);
        assert!(found.as_ref().is_err_and(is_coarse), "{offset}: {found:?}");
        // A softer one has nothing beyond what they sample.
        let edge = Edge { sigma: SIGMA, ..edge };
        edge.assert_mtf50(&edge.light(), 0.002);
    }
}

/// Noise turns the path by thousandths of a degree, and the pixels of a diagonal then lie a little apart.
#[test]
fn noise_does_not_narrow_the_response_of_an_edge_at_45_degrees() {
    for seed in 0..8 {
        let edge = Edge { height: 96, width: 96, offset: 0.1 * seed as f64, ..Edge::at(45.0, 0.5) };
        edge.assert_mtf50(&with_noise(&edge.light(), 0.0022, seed), 0.01);
    }
}

/// The pixels near a diagonal lie in groups with gaps of nearly half a pixel between them. A spline that is soft there scatters eight times as far as at 43 degrees.
#[test]
fn noise_moves_the_response_near_45_degrees_no_further_than_elsewhere() {
    const SEEDS: u64 = 12;
    let rms = |angle_deg: f64| {
        let deviation = |seed: u64| {
            let at = Edge::at(angle_deg, 0.5);
            let edge = Edge { height: 64, width: 64, offset: 0.1 * seed as f64, ..at };
            let found = edge.measured(&with_noise(&edge.light(), 0.0005, seed)).unwrap();
            found.sfr.mtf50().unwrap().frequency / edge.mtf50() - 1.0
        };
        ((0..SEEDS).map(|seed| deviation(seed).powi(2)).sum::<f64>() / SEEDS as f64).sqrt()
    };
    let usual = rms(43.0);
    for angle_deg in [44.8, 44.85, 44.9, -44.85] {
        let near = rms(angle_deg);
        assert!(near < 3.0 * usual + 3e-4, "{angle_deg}: {near} for {usual}");
    }
}

#[test]
fn a_wide_blur_is_neither_narrowed_by_the_window_nor_moved_by_the_steps_of_the_frequency() {
    for (side, sigma) in [(100, 8.0), (60, 6.0), (50, 6.0)] {
        let edge = Edge { height: side, width: side, ..Edge::at(8.0, sigma) };
        edge.assert_mtf50(&edge.light(), 0.002);
    }
}

#[test]
fn a_tiny_region_is_measured() {
    for angle_deg in [4.0, 10.0, 30.0] {
        let edge = Edge { height: 20, width: 20, ..Edge::at(angle_deg, SIGMA) };
        edge.assert_mtf50(&edge.light(), 0.01);
    }
}

#[test]
fn curved_edges_have_the_response_of_straight_ones() {
    // Sagittas s of 0.3, 1 and 2 pixels over the window: radius L^2 / (8 s).
    for sagitta in [0.3, 1.0, 2.0] {
        for sign in [-1.0, 1.0] {
            let edge = Edge { radius: sign * (SIDE * SIDE) as f64 / (8.0 * sagitta), ..Edge::at(5.0, SIGMA) };
            let found = edge.assert_mtf50(&edge.light(), 0.003);
            assert!((found.sagitta_px - sagitta).abs() < 0.1 * sagitta, "{sagitta}: {}", found.sagitta_px);
        }
    }
}

#[test]
fn light_that_falls_across_the_window_is_divided_out() {
    let side = SIDE as f64;
    type Light<'a> = &'a dyn Fn(f64, f64) -> f64;
    let falls: [(f64, Light); 7] = [
        (5.0, &|x, _| 1.0 - 0.25 * x),
        (5.0, &|x, _| 0.75 + 0.25 * x),
        (5.0, &|_, y| 1.0 - 0.25 * y),
        (5.0, &|x, y| 1.0 - 0.2 * x * x - 0.1 * y),
        (35.0, &|x, _| 1.0 - 0.25 * x),
        (35.0, &|x, y| 0.75 + 0.125 * (x + y)),
        // The fourth power of the cosine.
        (10.0, &|x, y| (1.0 + 0.07 * (x * x + y * y)).powi(-2)),
    ];
    for (i, (angle_deg, fall)) in falls.iter().enumerate() {
        let edge = Edge::at(*angle_deg, SIGMA);
        let light = edge.light();
        let at = |k: usize| fall(((k % SIDE) as f64 + 0.5) / side, ((k / SIDE) as f64 + 0.5) / side);
        let fallen: Vec<f32> = light.iter().enumerate().map(|(k, v)| v * at(k) as f32).collect();
        let found = edge.assert_mtf50(&fallen, 0.003);
        let said = found.light_fall.unwrap();
        assert!((0.2..0.5).contains(&said), "{i}: {said}");
    }
}

#[test]
fn stray_light_that_grows_across_the_edge_is_subtracted() {
    let side = SIDE as f64;
    // Shares of the step over the window, across and along it, and the fall of the light that multiplies.
    for (angle_deg, across, along, fall) in [
        (5.0, 0.02, 0.0, 0.0),
        (5.0, 0.05, 0.0, 0.0),
        (5.0, -0.05, 0.03, 0.0),
        (35.0, 0.05, 0.0, 0.0),
        (5.0, 0.05, 0.0, 0.1),
    ] {
        let edge = Edge::at(angle_deg, SIGMA);
        let strayed = |(k, v): (usize, &f32)| {
            let (x, y) = ((k % SIDE) as f64 / side, (k / SIDE) as f64 / side);
            (f64::from(*v) * (1.0 - fall * y) + 0.6 * (across * x + along * y)) as f32
        };
        let light: Vec<f32> = edge.light().iter().enumerate().map(strayed).collect();
        edge.assert_mtf50(&with_noise(&light, 0.001, 6), 0.004);
    }
}

#[test]
fn a_sharp_edge_that_meets_the_pixels_at_few_phases_is_not_clipped() {
    // A slope of a third: pixels lie every 0.32 pixels from the edge.
    for angle_deg in [18.434_949, 26.565_051] {
        let edge = Edge { levels: [0.1, 0.7], offset: 0.37, ..Edge::at(angle_deg, 0.1) };
        let values: Vec<f32> = edge.light().iter().map(|v| (v * 4095.0).round() / 4095.0).collect();
        let found = edge.measured(&values);
        assert!(!matches!(found, Err(SfrError::Clipped { .. })), "{angle_deg}: {found:?}");
    }
}

#[test]
fn sides_of_nearly_one_level_have_no_deviation_in_percent() {
    let said = SfrError::Uneven { deviation: 2e13 }.to_string();
    assert!(said.contains("by far more than the step;"), "{said}");
    assert!(SfrError::Uneven { deviation: 0.23 }.to_string().contains("by 23 % of the step;"));
}

/// A blur whose tail is a second, wider normal one, on the axis of a lens or with coma.
#[test]
fn the_tail_of_a_blur_is_no_light_that_changes() {
    const SHARE: f64 = 0.1;
    for (side, tail, coma) in [(50, 4.0, 0.0), (80, 3.0, 1.5), (50, 3.0, 1.5)] {
        let part = |sigma: f64, by: f64| {
            let at = Edge::at(5.0, sigma);
            Edge { height: side, width: side, levels: [0.0, 1.0], offset: at.offset + by, ..at }
        };
        let (sharp, wide) = (part(SIGMA, 0.0), part(tail, coma));
        let cos = 5f64.to_radians().cos();
        let wanted = |f: f64| {
            let (a, b) = ((1.0 - SHARE) * sharp.known(f), SHARE * wide.known(f));
            let phase = 2.0 * PI * f * coma * cos;
            (a + b * phase.cos()).hypot(b * phase.sin())
        };
        for [dark, bright] in [[0.1, 0.8], [0.5, 0.55]] {
            let lit = |(a, b): (&f32, &f32)| {
                let share = (1.0 - SHARE) * f64::from(*a) + SHARE * f64::from(*b);
                (dark + (bright - dark) * share) as f32
            };
            let values: Vec<f32> = sharp.light().iter().zip(&wide.light()).map(lit).collect();
            let found = sharp.measured(&values).unwrap();
            assert_eq!(found.light_fall, None, "{side} {tail} {coma} {dark}");
            for k in 1..=50 {
                let (m, wanted) = (found.sfr.at(0.01 * f64::from(k)), wanted(0.01 * f64::from(k)));
                assert!((m - wanted).abs() < 0.001, "{side} {tail} {coma} {dark} {k}: {m} {wanted}");
            }
        }
    }
}

#[test]
fn light_cut_off_at_either_end_is_refused() {
    let edge = Edge::at(5.0, SIGMA);
    let light = edge.light();
    for noise in [0.0, 0.01] {
        for (side, low, high) in [(Side::Bright, 0.0, 0.76), (Side::Dark, 0.24, 1.0)] {
            let cut: Vec<f32> = with_noise(&light, noise, 3).iter().map(|v| v.clamp(low, high)).collect();
            let error = edge.measured(&cut).unwrap_err();
            assert!(
                matches!(error, SfrError::Clipped { side: of, .. } if of == side),
                "{noise} {side:?}: {error}"
            );
        }
        edge.measured(&with_noise(&light, noise, 3)).unwrap();
    }
    // Few pixels at the end are noise that is cut off, and do no harm.
    let cut: Vec<f32> = with_noise(&light, 0.01, 3).iter().map(|v| v.min(0.815)).collect();
    edge.assert_mtf50(&cut, 0.02);
}

/// Noise of a twentieth of the step whose level is 0.3 of its standard deviations above the end moves by 1.3 % of the step, and MTF50 by 2 %.
#[test]
fn noise_of_which_much_is_cut_off_is_refused() {
    const NOISE: f32 = 0.03;
    let edge = Edge::at(5.0, 1.2);
    let [dark, bright] = edge.levels.map(|level| level as f32);
    let noisy = with_noise(&edge.light(), NOISE, 4);
    edge.measured(&noisy).unwrap();
    for side in [Side::Dark, Side::Bright] {
        let cut = |sigmas: f32| -> Vec<f32> {
            let beyond = sigmas * NOISE;
            match side {
                Side::Dark => noisy.iter().map(|v| v.max(dark - beyond)).collect(),
                Side::Bright => noisy.iter().map(|v| v.min(bright + beyond)).collect(),
            }
        };
        let error = edge.measured(&cut(0.3)).unwrap_err();
        assert!(
            matches!(error, SfrError::Clipped { side: of, share } if of == side && share < 0.5),
            "{side:?}: {error}"
        );
        edge.measured(&cut(1.2)).unwrap();
    }
}

/// The less of the step is left, the farther apart are the last values before the end.
#[test]
fn light_of_which_little_is_left_is_refused_as_cut_off() {
    let edge = Edge { levels: [0.1, 0.8], ..Edge::at(6.0, 0.55) };
    for noise in [0.0, 0.0007] {
        for (side, low, high) in [
            (Side::Bright, 0.0, 0.6),
            (Side::Bright, 0.0, 0.45),
            (Side::Bright, 0.0, 0.35),
            (Side::Dark, 0.3, 1.0),
            (Side::Dark, 0.45, 1.0),
        ] {
            let number = |v: &f32| (v.clamp(low, high) * 4095.0).round() / 4095.0;
            let cut: Vec<f32> = with_noise(&edge.light(), noise, 3).iter().map(number).collect();
            let error = edge.measured(&cut).map(|found| found.sfr.mtf50()).unwrap_err();
            // With less than half of the step left, the other side may look as if it were cut off.
            let [dark, bright] = edge.levels;
            let left = (bright.min(high.into()) - dark.max(low.into())) / (bright - dark);
            assert!(
                matches!(error, SfrError::Clipped { side: of, .. } if of == side || left < 0.499),
                "{noise} {high}: {error}"
            );
        }
    }
}

/// A dark side of few steps of the values ends sharply without being cut off.
#[test]
fn a_dark_side_without_noise_is_not_taken_for_a_clipped_one() {
    for (angle, sigma) in [(3.0, 0.4), (5.0, 0.6), (8.0, 0.9), (12.0, 1.4)] {
        for dark in [0.0025, 0.005, 0.01, 0.02] {
            for white in [1023.0, 4095.0, 16383.0] {
                let light = Edge { levels: [dark, 0.6], ..Edge::at(angle, sigma) };
                let values: Vec<f32> = light.light().iter().map(|v| (v * white).round() / white).collect();
                let found = light.measured(&values);
                assert!(found.is_ok(), "{angle} {sigma} {dark} {white}: {:?}", found.err());
            }
        }
    }
}

/// Rows of a straight edge, each shifted by the share of a pixel that a wave gives, are an edge that is no smooth arc. Neither side has noise.
#[test]
fn an_edge_that_leaves_its_path_is_not_taken_for_a_clipped_one() {
    for amplitude in [0.5, 1.0] {
        let row = |y: usize| {
            let shift = amplitude * (2.0 * PI * y as f64 / SIDE as f64).sin();
            let edge = Edge { offset: 0.3 + shift, ..Edge::at(5.0, SIGMA) };
            edge.light()[y * SIDE..(y + 1) * SIDE].to_vec()
        };
        let values: Vec<f32> = (0..SIDE).flat_map(row).map(|v| (v * 4095.0).round() / 4095.0).collect();
        let error = Edge::at(5.0, SIGMA).measured(&values).map(|found| found.sfr.mtf50()).unwrap_err();
        assert!(matches!(error, SfrError::OffPath { drift_px } if drift_px < amplitude), "{error}");
    }
}

/// Noise of half a step makes rounding a part of the scatter.
#[test]
fn rounding_of_an_edge_without_noise_is_noted() {
    let edge = Edge::at(7.0, 0.6);
    let coarse_step = |noise: f32, white: f32| {
        let light = with_noise(&edge.light(), noise, 5);
        let values: Vec<f32> = light.iter().map(|v| (v * white).round() / white).collect();
        edge.measured(&values).unwrap().coarse_step
    };
    let step = coarse_step(0.0, 255.0).unwrap();
    assert!((step - 1.0 / 255.0 / 0.6).abs() < 2e-4, "{step}");
    assert_eq!(coarse_step(0.002, 255.0), None);
    assert_eq!(coarse_step(0.0, 65_535.0), None);
    assert_eq!(edge.measured(&edge.light()).unwrap().coarse_step, None);
}

#[test]
fn dead_and_hot_pixels_and_columns_do_not_count() {
    let edge = Edge::at(5.0, SIGMA);
    let light = with_noise(&edge.light(), 0.002, 1);
    let columns: [&dyn Fn(usize, usize) -> Option<f32>; 4] = [
        &|_, col| (col == 42).then_some(0.0),
        &|_, col| (col == 39 || col == 40).then_some(0.0),
        &|row, col| ((row * 80 + col) % 97 == 5).then_some(1.0),
        &|row, _| (row == 30).then_some(0.0),
    ];
    for (i, of) in columns.iter().enumerate() {
        let dead: Vec<f32> =
            light.iter().enumerate().map(|(k, v)| of(k / SIDE, k % SIDE).unwrap_or(*v)).collect();
        let found = edge.assert_mtf50(&dead, 0.01);
        let count = (0..SIDE * SIDE).filter(|k| of(k / SIDE, k % SIDE).is_some()).count();
        assert!(found.left_out <= count && found.left_out >= count / 3, "{i}: {} of {count}", found.left_out);
    }
}

#[test]
fn a_dead_column_along_a_steep_edge_hides_it_not() {
    let edge = Edge::at(2.0, SIGMA);
    let light = edge.light();
    for dead in [38, 40, 41] {
        let at = |(k, v): (usize, &f32)| if k % SIDE == dead { 0.0 } else { *v };
        let values: Vec<f32> = light.iter().enumerate().map(at).collect();
        let found = edge.assert_mtf50(&values, 0.002);
        assert_eq!(found.left_out, SIDE, "{dead}");
    }
}

#[test]
fn the_edge_may_stand_or_lie_and_be_bright_on_either_side() {
    for angle_deg in [5.0, 30.0] {
        let upright = edge(angle_deg, 0.7);
        let wanted = measured(&upright).unwrap();
        let turned: Vec<f32> = (0..SIDE * SIDE).map(|i| upright[i % SIDE * SIDE + i / SIDE]).collect();
        let inverse: Vec<f32> = upright.iter().map(|v| 1.0 - v).collect();
        let lying = slanted_edge(&Plane { values: &turned, width: SIDE }, &window(8, 4, SIDE - 16, SIDE - 8));
        let lying = lying.unwrap();
        assert!(wanted.is_upright && !lying.is_upright);
        for found in [lying, measured(&inverse).unwrap()] {
            for (a, b) in found.sfr.modulation.iter().zip(&wanted.sfr.modulation).take(60) {
                assert!((a - b).abs() < 0.001, "{a} {b}");
            }
            assert!((found.angle_deg.value.abs() - angle_deg).abs() < 0.01);
        }
        // The path lies where the edge was drawn.
        for [row, col] in &wanted.path {
            let distance = Edge::at(angle_deg, 0.7).distance(col + 8.0 - 40.0, row + 4.0 - 40.0);
            assert!(distance.abs() < 0.02, "{row} {col}: {distance}");
        }
    }
}

#[test]
fn an_edge_may_leave_the_window_through_a_corner() {
    let edge = Edge { height: 60, width: 60, offset: 14.0, ..Edge::at(35.0, SIGMA) };
    edge.assert_mtf50(&edge.light(), 0.003);
    let edge = Edge { height: 100, width: 40, offset: 9.0, ..Edge::at(-20.0, SIGMA) };
    edge.assert_mtf50(&edge.light(), 0.003);
}

/// The figure is right in the mean, and its standard error is its scatter.
#[track_caller]
fn assert_honest(edge: &Edge, rounds: u64, noisy: impl Fn(u64) -> Vec<f32>) {
    let wanted = edge.mtf50();
    let all: Vec<Crossing> =
        (0..rounds).map(|seed| edge.measured(&noisy(seed)).unwrap().sfr.mtf50().unwrap()).collect();
    let count = rounds as f64;
    let mean = all.iter().map(|at| at.frequency).sum::<f64>() / count;
    let scatter = (all.iter().map(|at| (at.frequency - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt();
    let said = (all.iter().map(|at| at.standard_error.powi(2)).sum::<f64>() / count).sqrt();
    let ratio = said / scatter;
    assert!((0.7..1.5).contains(&ratio), "said {said}, scatter {scatter}");
    let bias = (mean - wanted) / (scatter / count.sqrt());
    assert!(
        (mean / wanted - 1.0).abs() < 0.01 + 3.0 * scatter / count.sqrt() / wanted,
        "{mean} {wanted}, {bias} sigma"
    );
}

#[test]
fn standard_errors_are_the_scatter_over_noise() {
    let edge = Edge { height: 48, width: 48, ..Edge::at(5.0, SIGMA) };
    let light = edge.light();
    assert_honest(&edge, 32, |seed| with_noise(&light, 0.02, seed));
    // Noise of a bright side five times that of the dark one.
    let unequal = |seed: u64| {
        let noise = with_noise(&vec![0.0; light.len()], 0.01, seed);
        light.iter().zip(noise).map(|(v, n)| v + n * (1.0 + 4.0 * (v - 0.2) / 0.6)).collect::<Vec<f32>>()
    };
    assert_honest(&edge, 32, unequal);
    // Noise whose neighbours in a row are correlated.
    let correlated = |seed: u64| {
        let noise = with_noise(&vec![0.0; light.len()], 0.02, seed);
        let mean = |i: usize| noise[i.saturating_sub(1)..(i + 2).min(noise.len())].iter().sum::<f32>() / 3.0;
        light.iter().enumerate().map(|(i, v)| v + mean(i)).collect::<Vec<f32>>()
    };
    assert_honest(&edge, 32, correlated);
}

/// By the scatter of six bands alone the root of the mean square of the deviations was 1.7 to 1.9 standard errors.
#[test]
fn standard_errors_of_small_regions_hold() {
    const SEEDS: u64 = 100;
    let mut deviations = Vec::new();
    for angle_deg in [3.0, 4.0, 5.0, 7.0] {
        let edge = Edge { height: 20, width: 20, ..Edge::at(angle_deg, SIGMA) };
        let light = edge.light();
        let deviation = |seed| {
            let found = edge.measured(&with_noise(&light, 0.012, seed)).unwrap().sfr.mtf50().unwrap();
            (found.frequency - edge.mtf50()) / found.standard_error
        };
        deviations.extend((0..SEEDS).map(deviation));
    }
    let count = deviations.len() as f64;
    let rms = (deviations.iter().map(|z: &f64| z * z).sum::<f64>() / count).sqrt();
    let within = deviations.iter().filter(|z| z.abs() < 2.0).count() as f64 / count;
    assert!((0.8..1.35).contains(&rms) && within > 0.88, "rms {rms}, {within} within two errors");
}

/// Beyond the blur the slope of the spline is noise. With the pixels there the error of the inclination was half of its scatter.
#[test]
fn the_error_of_the_inclination_holds_in_a_wide_window() {
    const SEEDS: u64 = 64;
    let edge = Edge { height: 32, width: 160, ..Edge::at(10.0, SIGMA) };
    let light = edge.light();
    let angle = |seed: u64| edge.measured(&with_noise(&light, 0.03, seed)).unwrap().angle_deg;
    let all: Vec<Estimate> = (0..SEEDS).map(angle).collect();
    let rms = |of: &dyn Fn(&Estimate) -> f64| {
        (all.iter().map(|angle| of(angle).powi(2)).sum::<f64>() / SEEDS as f64).sqrt()
    };
    let (said, scatter) = (rms(&|a| a.standard_error), rms(&|a| a.value.abs() - 10.0));
    assert!((0.62..1.5).contains(&(said / scatter)), "said {said}, scatter {scatter}");
}

#[test]
fn a_contrast_of_5_percent_with_noise_is_measured() {
    let edge = Edge { height: 64, width: 64, levels: [0.5, 0.525], ..Edge::at(5.0, SIGMA) };
    let light = edge.light();
    assert_honest(&edge, 24, |seed| with_noise(&light, 0.003, seed));
}

#[test]
fn an_edge_below_the_noise_of_a_pixel_is_found() {
    let edge = Edge { levels: [0.5, 0.525], ..Edge::at(5.0, SIGMA) };
    let found = edge.measured(&with_noise(&edge.light(), 0.025, 2)).unwrap();
    assert!(
        (found.angle_deg.value.abs() - 5.0).abs() < 4.0 * found.angle_deg.standard_error + 0.2,
        "{:?}",
        found.angle_deg
    );
    let [dark, bright] = found.levels;
    assert!(
        (bright.value - dark.value - 0.025).abs() < 5.0 * bright.standard_error.hypot(dark.standard_error)
    );
    assert!(matches!(edge.measured(&with_noise(&vec![0.5; SIDE * SIDE], 0.025, 2)), Err(SfrError::NoEdge)));
}

#[test]
fn sharpening_shows_as_overshoot_and_as_a_response_above_one() {
    let soft = edge(5.0, 1.0);
    // `v + (v - mean of the neighbours)`, whose response along the row is 2 - cos(2 pi f).
    let at = |i: usize, by: i64| soft[(i as i64 + by).clamp(0, (SIDE * SIDE) as i64 - 1) as usize];
    let sharp: Vec<f32> = (0..SIDE * SIDE).map(|i| 2.0 * at(i, 0) - 0.5 * (at(i, -1) + at(i, 1))).collect();
    let found = measured(&sharp).unwrap();
    // The profile P - P'' / 2 of the normal integral P reaches 1.028.
    for found in [found.overshoot, found.undershoot] {
        assert!((found.value - 0.028).abs() < 0.006, "{found:?}");
    }
    for frequency in [0.1, 0.2, 0.3, 0.4] {
        let cos = 5f64.to_radians().cos();
        let wanted = known(frequency, 5.0, 1.0) * (2.0 - (2.0 * PI * frequency * cos).cos());
        assert!(
            (found.sfr.at(frequency) - wanted).abs() < 0.005,
            "{frequency}: {} {wanted}",
            found.sfr.at(frequency)
        );
    }
}

#[test]
fn what_is_no_slanted_edge_is_refused() {
    let flat = vec![0.5; SIDE * SIDE];
    assert_eq!(measured(&flat), Err(SfrError::NoEdge));
    // Too few fractions of a pixel.
    for angle_deg in [0.0, 0.2] {
        let error = measured(&edge(angle_deg, SIGMA)).unwrap_err();
        assert!(matches!(error, SfrError::Angle { .. }), "{angle_deg}: {error}");
    }
    let steep = edge(5.0, 0.7);
    let of = |window| slanted_edge(&Plane { values: &steep, width: SIDE }, &window);
    assert_eq!(of(window(10, 10, SIDE, 20)), Err(SfrError::Outside));
    assert!(matches!(of(window(10, 30, 10, 20)), Err(SfrError::Small { .. })));
    assert!(matches!(of(window(10, 38, 60, 16)), Err(SfrError::Small { .. })));
    let holed: Vec<f32> =
        steep.iter().enumerate().map(|(i, v)| if i == 3000 { f32::NAN } else { *v }).collect();
    assert_eq!(measured(&holed), Err(SfrError::NotFinite));
}

#[test]
fn two_edges_and_corners_are_refused() {
    let one = edge(5.0, SIGMA);
    let other = Edge { offset: 22.0, ..Edge::at(5.0, SIGMA) }.light();
    let bar: Vec<f32> = one.iter().zip(&other).map(|(a, b)| a - b + 0.2).collect();
    let crossing: Vec<f32> = one.iter().zip(&edge(60.0, SIGMA)).map(|(a, b)| 0.5 * (a + b)).collect();
    let corner: Vec<f32> =
        one.iter().enumerate().map(|(i, v)| if i / SIDE < 40 { *v } else { 0.2 }).collect();
    for (name, picture) in [("bar", bar), ("crossing", crossing), ("corner", corner)] {
        let found = Edge::at(5.0, SIGMA).measured(&picture);
        assert!(matches!(found, Err(SfrError::Uneven { .. })), "{name}: {found:?}");
    }
    // Two steps of which one is weaker.
    let steps: Vec<f32> = one.iter().zip(&other).map(|(a, b)| 0.7 * a + 0.3 * b).collect();
    let found = Edge::at(5.0, SIGMA).measured(&steps);
    let Err(SfrError::Ghost { distance_px, share }) = found else { panic!("{found:?}") };
    assert!((distance_px - 22.0).abs() < 2.0 && (share - 0.3 / 0.7).abs() < 0.02, "{distance_px} {share}");
}

#[test]
fn a_ghost_of_the_edge_is_refused_and_smooth_light_is_not() {
    let one = edge(5.0, SIGMA);
    let whole = |values: &[f32]| Edge::at(5.0, SIGMA).measured(values);
    for (offset, share) in [(20.0, 0.06), (-20.0, 0.06), (17.0, -0.05), (20.0, 0.03)] {
        let other = Edge { offset, ..Edge::at(5.0, SIGMA) }.light();
        let with_ghost: Vec<f32> = one.iter().zip(&other).map(|(a, b)| a + share * (b - 0.2)).collect();
        // Noise of a hundredth of the step.
        let found = whole(&with_noise(&with_ghost, 0.006, 4));
        let Err(SfrError::Ghost { distance_px, share: of_edge }) = found else {
            panic!("{offset}, {share}: {found:?}")
        };
        assert!((distance_px - offset).abs() < 2.0, "{offset}: {distance_px}");
        assert!((of_edge - f64::from(share)).abs() < 0.02, "{share}: {of_edge}");
    }
    // Light that falls by as much as these, and more, over the window; a wide halo.
    let falls = |i: usize| 1.0 - 0.3 * ((i % SIDE) as f32 / SIDE as f32).powi(2);
    let halo = Edge::at(5.0, 8.0).light();
    let lit: Vec<f32> = one.iter().enumerate().map(|(i, v)| v * falls(i)).collect();
    let with_halo: Vec<f32> = one.iter().zip(&halo).map(|(a, b)| 0.9 * a + 0.1 * b).collect();
    for picture in [&one, &lit, &with_halo] {
        let found = whole(&with_noise(picture, 0.006, 5));
        assert!(!matches!(found, Err(SfrError::Ghost { .. })), "{found:?}");
    }
    assert!(whole(&with_noise(&one, 0.006, 5)).is_ok());
}

#[test]
fn correlated_noise_beside_a_short_edge_is_no_ghost() {
    for (height, seed) in [24, 40].into_iter().flat_map(|height| (0..12).map(move |seed| (height, seed))) {
        let edge = Edge { height, ..Edge::at(5.0, SIGMA) };
        // Noise that each pixel shares with its neighbours, as after demosaicing: twice the mean of a cell of 2x2 pixels.
        let noise = with_noise(&vec![0.0; height * SIDE], 0.02, seed);
        let at = |i: usize| noise[i % noise.len()];
        let smooth = |i: usize| 0.5 * (at(i) + at(i + 1) + at(i + SIDE) + at(i + SIDE + 1));
        let noisy: Vec<f32> = edge.light().iter().enumerate().map(|(i, v)| v + smooth(i)).collect();
        let found = edge.measured(&noisy);
        assert!(!matches!(found, Err(SfrError::Ghost { .. })), "{height}, {seed}: {found:?}");
    }
}
