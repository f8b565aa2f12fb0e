//! The fit against simulated frames: it has no bias, and reports what is not noise.

use super::*;
use crate::emva::captures::Kind;
use crate::emva::counts::Counts;
use crate::emva::warning::Warning;
use crate::emva::warnings::fit_warnings;
use crate::emva::{Captures, Characterization, Options, Plan, characterize, write_series};
use petzval_camera::image::{CHANNELS, LinearImage};
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Capture, Colour, Exposure, Noise, NoiseMode, SensorModel, expose};

fn mono() -> SensorModel {
    let sensor = include_str!("../../../../petzval-data/data/sensors/imx249-fitted.toml");
    SensorModel {
        cfa: "mono".parse().unwrap(),
        clear_response: [1.0 / 3.0; 3],
        ..petzval_files::parse_sensor(sensor).unwrap()
    }
}

fn truth() -> ModelParameters {
    ModelParameters {
        gain_dn_per_e: 0.14,
        read_noise_mean_e: 3.25,
        dark_offset_dn: 120.15,
        electronics_noise_dn: 0.92,
        red_over_green: 1.0,
        blue_over_green: 1.0,
        read_noise_e: 4.0,
        dark_current_e_per_s: 25.0,
        full_well_e: f64::INFINITY,
    }
}

/// Histograms of pairs of frames at three gains: four of light up to `brightest_e` at gain 1, four of none.
fn captured(
    sensor: &SensorModel,
    (height, width): (usize, usize),
    brightest_e: f64,
    seed: u64,
) -> Vec<PointHistogram> {
    let (mut found, mut frame) = (Vec::new(), 0);
    for gain in [1.0, 4.0, 16.0] {
        for (kind, time_s) in [5e-3, 10e-3, 15e-3, 20e-3, 5e-3, 10e-3, 20e-3, 40e-3]
            .into_iter()
            .enumerate()
            .map(|(i, t)| (if i < 4 { Kind::Flat } else { Kind::Dark }, t))
        {
            let electrons = brightest_e / gain * time_s / 20e-3;
            let (light, white_e) = match kind {
                Kind::Flat => (1.0, electrons),
                Kind::Dark => (0.0, 1.0),
            };
            let mut table = vec![0u64; 4096];
            for _ in 0..2 {
                let exposure =
                    Exposure { white_e: white_e as f32, time_s: time_s as f32, linear_gain: gain as f32 };
                let capture = Capture { exposure, placement: Placement::default(), frame };
                let noise = Noise { mode: NoiseMode::Exact, seed };
                let scene = LinearImage::filled(CHANNELS, height, width, light);
                let raw = expose(&scene, sensor, &capture, &noise).unwrap();
                raw.dn.iter().for_each(|dn| table[*dn as usize] += 1);
                frame += 1;
            }
            let first = table.iter().position(|c| *c > 0).unwrap();
            let end = table.iter().rposition(|c| *c > 0).unwrap() + 1;
            found.push(PointHistogram {
                point: found.len(),
                kind,
                linear_gain: gain,
                exposure_s: time_s,
                photons: (kind == Kind::Flat).then_some(2.0 * electrons),
                black_shift_dn: 0.0,
                colour: (kind == Kind::Flat).then_some(Colour::Clear),
                pixels: height * width,
                in_range: true,
                counts: Counts { first_dn: first as u32, counts: table[first..end].to_vec() },
            });
        }
    }
    found
}

/// Deviation in standard errors.
#[track_caller]
fn z(found: Measured, truth: f64) -> f64 {
    let (Some(value), Some(se)) = (found.value(), found.standard_error()) else { panic!("{found:?}") };
    (value - truth) / se
}

/// Standard deviation of what is fixed in a specimen.
fn spread(values: &[f32]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    (values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n).sqrt()
}

fn names(warnings: &[Warning]) -> Vec<&'static str> {
    warnings.iter().map(Warning::name).collect()
}

#[test]
fn the_fit_has_no_bias_and_its_errors_match_the_scatter() {
    let (sensor, truth) = (mono(), truth());
    let seeds = 20;
    let mut all: [Vec<f64>; 5] = Default::default();
    for seed in 1..=seeds {
        let fit = fit_histograms_from(&truth, 12, &captured(&sensor, (48, 64), 4000.0, seed), &|| Ok(()))
            .unwrap()
            .unwrap();
        assert!(fit.converged && fit.left_out == 0, "seed {seed}: {} steps", fit.steps);
        let found = [
            z(fit.gain_dn_per_e, truth.gain_dn_per_e),
            z(fit.read_noise_mean_e, truth.read_noise_mean_e),
            z(fit.dark_offset_dn, truth.dark_offset_dn),
            z(fit.electronics_noise_dn, truth.electronics_noise_dn),
            z(fit.dark_noise_e, truth.read_noise_e),
        ];
        all.iter_mut().zip(found).for_each(|(all, z)| all.push(z));
    }
    // The mean of the deviations is normal with the variance 1 / seeds, the sum of their squares chi^2: ten tests at 5e-4.
    for (name, all) in ["K", "mu_r", "BL + mu_el", "sigma_el", "sigma_r"].iter().zip(&all) {
        let mean = all.iter().sum::<f64>() / seeds as f64;
        let squares: f64 = all.iter().map(|z| z * z).sum();
        assert!(mean.abs() * (seeds as f64).sqrt() < 3.5, "{name}: mean z {mean}");
        assert!((5.0..48.0).contains(&squares), "{name}: sum of z^2 {squares}");
    }
}

#[test]
fn photo_response_non_uniformity_does_not_change_the_gain() {
    for percent in [0.3, 1.0] {
        let mut sensor = mono();
        sensor.nonuniformity.prnu_pixel_percent = percent;
        let fit = fit_histograms_from(&truth(), 12, &captured(&sensor, (120, 160), 16_000.0, 5), &|| Ok(()))
            .unwrap()
            .unwrap();
        let specimen = 100.0 * spread(&sensor.fixed_pattern(Placement::default(), 120, 160).response);
        assert!(fit.converged, "{} steps", fit.steps);
        assert!(z(fit.gain_dn_per_e, 0.14).abs() < 3.5, "{percent} %: {:?}", fit.gain_dn_per_e);
        assert!(z(fit.prnu_percent, specimen).abs() < 3.5, "{:?}, {specimen}", fit.prnu_percent);
        assert!(fit.gain_dn_per_e.standard_error().unwrap() < 0.0015);
    }
}

fn series(sensor: &SensorModel, plan: &Plan, full_wells_e: &[Option<f64>]) -> Vec<Characterization> {
    let folder = tempfile::tempdir().unwrap();
    write_series(sensor, plan, folder.path(), &|| Ok(())).unwrap();
    let mut captures = Captures::open(folder.path()).unwrap();
    let options = Options { fit_histograms: true, ..Options::default() };
    let one = |full_well_e: &Option<f64>| {
        captures.sensor.full_well_e = *full_well_e;
        characterize(&captures, &options, &|_| Ok(())).unwrap()
    };
    full_wells_e.iter().map(one).collect()
}

#[test]
fn dark_signal_non_uniformity_is_separated_from_read_noise() {
    let mut sensor = mono();
    sensor.nonuniformity.dsnu_pixel_e = 3.0;
    let plan = Plan { height: 120, width: 160, gains: vec![1.0, 4.0, 16.0], seed: 4, ..Plan::default() };
    let found = &series(&sensor, &plan, &[Some(33_723.0)])[0];
    let fit = found.histogram_fit.as_ref().unwrap();
    let specimen = spread(&sensor.fixed_pattern(Placement::default(), 120, 160).offset_e);
    assert!(z(fit.dsnu_e, specimen).abs() < 3.5, "{:?}, {specimen}", fit.dsnu_e);
    assert!(z(fit.read_noise_e, 4.0).abs() < 3.5, "{:?}", fit.read_noise_e);
    assert!((fit.dark_noise_e.value().unwrap() - specimen.hypot(4.0)).abs() < 0.1, "{:?}", fit.dark_noise_e);
    assert!(names(&found.warnings).contains(&"wider-than-noise"), "{:?}", found.warnings);
}

#[test]
fn frames_at_the_full_well_are_left_out_even_if_the_data_sheet_is_wrong() {
    let sensor = SensorModel { full_well_e: 15_000.0, ..mono() };
    let plan = Plan {
        height: 64,
        width: 96,
        gains: vec![1.0, 2.0, 4.0],
        flat_ms: (1..=12).map(f64::from).collect(),
        dark_ms: vec![20.0, 30.0],
        level: 1.2,
        seed: 2,
        ..Plan::default()
    };
    let stated = [None, Some(14_700.0), Some(15_010.0), Some(16_000.0)];
    for (found, stated) in series(&sensor, &plan, &stated).iter().zip(stated) {
        let fit = found.histogram_fit.as_ref().unwrap();
        assert!(fit.converged && fit.left_out >= 9, "{stated:?}: {} left out", fit.left_out);
        assert!(z(fit.gain_dn_per_e, 0.14).abs() < 3.5, "{stated:?}: {:?}", fit.gain_dn_per_e);
        assert!((mean_core_chi2(&fit.histograms) - 1.0).abs() < 0.15);
        assert!(!names(&found.warnings).contains(&"poor-histogram-fit"), "{:?}", found.warnings);
    }
}

#[test]
fn a_fit_that_does_not_describe_the_captures_has_warnings_and_no_standard_errors() {
    // Every second sample of light is 40 DN brighter: two peaks, which no parameter makes.
    let mut all = captured(&mono(), (48, 64), 4000.0, 1);
    for h in all.iter_mut().filter(|h| h.kind == Kind::Flat) {
        let mut counts = vec![0; h.counts.counts.len() + 40];
        for (i, c) in h.counts.counts.iter().enumerate() {
            counts[i] += c / 2;
            counts[i + 40] += c - c / 2;
        }
        h.counts.counts = counts;
    }
    let fit = fit_histograms_from(&truth(), 12, &all, &|| Ok(())).unwrap().unwrap();
    let plan = Plan { height: 32, width: 48, gains: vec![1.0, 4.0, 16.0], ..Plan::default() };
    let joint = series(&mono(), &plan, &[Some(33_723.0)]).remove(0).joint;
    let found = fit_warnings(Some(&fit), &joint);
    assert!(names(&found).contains(&"poor-histogram-fit"), "{found:?}");
    assert!(names(&found).contains(&"histogram-fit-differs"), "{found:?}");
    assert!(fit.gain_dn_per_e.value().is_some() && fit.gain_dn_per_e.standard_error().is_none());
    assert!(!fit.is_sound() && fit.dsnu_e.value().is_none());

    // A fit ends at once where a histogram may not be compared any more.
    let stopped = fit_histograms_from(&truth(), 12, &all, &|| Err(Cancelled));
    assert_eq!(stopped.unwrap_err(), Cancelled);

    // Too few steps to arrive.
    let moved = ModelParameters { gain_dn_per_e: 0.11, electronics_noise_dn: 0.6, ..truth() };
    let fit =
        fit_in_steps(&moved, 12, &captured(&mono(), (48, 64), 4000.0, 1), 2, &|| Ok(())).unwrap().unwrap();
    assert!(!fit.converged && fit.gain_dn_per_e.standard_error().is_none());
    assert!(names(&fit_warnings(Some(&fit), &joint)).contains(&"histogram-fit-stopped"));
}

#[test]
fn seconds_replace_photons_if_one_point_states_none() {
    let mut all = captured(&mono(), (48, 64), 4000.0, 3);
    all[0].photons = None;
    let fit = fit_histograms_from(&truth(), 12, &all, &|| Ok(())).unwrap().unwrap();
    assert!(fit.converged, "{} steps", fit.steps);
    assert!(z(fit.gain_dn_per_e, 0.14).abs() < 3.5, "{:?}", fit.gain_dn_per_e);
    // At gain 1 the light is in electrons per second, elsewhere in electrons per photon.
    let light: Vec<f64> = fit.light.iter().map(|l| l.electrons.value().unwrap()).collect();
    assert!((light[0] / 200_000.0 - 1.0).abs() < 0.06 && (light[1] / 0.5 - 1.0).abs() < 0.06, "{light:?}");
}

#[test]
fn a_nearly_empty_last_bin_does_not_dominate_chi_square() {
    let expected = [1000.0, 1000.0, 1e-3];
    let found = goodness(&[1000, 1000, 2], &expected, 2002.0);
    // Two samples where a thousandth is expected: alone 4000, beside a thousand others nothing.
    assert!(found.reduced_chi2 < 0.01, "{found:?}");
    let few = goodness(&[3, 4], &[3.5, 3.5], 7.0);
    assert_eq!(few.reduced_chi2, 0.0);
}

#[test]
fn a_model_that_misses_every_sample_is_a_bad_fit() {
    for expected in [[0.0, 0.0, 0.0, 7000.0], [7000.0, 0.0, 0.0, 0.0]] {
        let found = goodness(&[0, 3000, 4000, 0], &expected, 7000.0);
        assert!(found.reduced_chi2 > 1e3 && found.total_variation == 1.0, "{found:?}");
    }
}

/// A colour sensor, three gains, one exposure time of the flat frames, light that no list states.
fn unstated_light_changes() -> Characterization {
    let folder = tempfile::tempdir().unwrap();
    let sensor = include_str!("../../../../petzval-data/data/sensors/imx249-fitted.toml");
    let sensor = petzval_files::parse_sensor(sensor).unwrap();
    let plan = Plan { height: 120, width: 160, gains: vec![1.0, 4.0, 16.0], seed: 3, ..Plan::default() };
    write_series(&sensor, &plan, folder.path(), &|| Ok(())).unwrap();
    let mut captures = Captures::open(folder.path()).unwrap();
    // The longest time for all flat frames, each with the dark current of its own, which is nothing beside the light.
    let longest = 0.01;
    captures
        .points
        .iter_mut()
        .filter(|p| p.kind == Kind::Flat)
        .for_each(|p| (p.exposure_s, p.photons) = (longest, None));
    characterize(&captures, &Options { fit_histograms: true, ..Options::default() }, &|_| Ok(())).unwrap()
}

#[test]
fn the_colours_of_a_point_share_its_light() {
    let found = unstated_light_changes();
    let fit = found.histogram_fit.as_ref().unwrap();
    assert!(z(fit.red_over_green, 0.82).abs() < 3.5, "{:?}", fit.red_over_green);
    assert!(z(fit.blue_over_green, 1.25).abs() < 3.5, "{:?}", fit.blue_over_green);
    assert!(z(fit.gain_dn_per_e, 0.14).abs() < 3.5, "{:?}", fit.gain_dn_per_e);
    let names = names(&found.warnings);
    let wrong = ["histogram-fit-differs", "histogram-fit-ambiguous", "poor-histogram-fit"];
    assert!(!names.iter().any(|n| wrong.contains(n)), "{:?}", found.warnings);
}

#[test]
fn noise_below_the_step_of_the_converter_widens_the_errors_and_makes_no_non_uniformity() {
    let sensor = SensorModel { read_noise_e: 1.5, electronics_noise_dn: 0.3, ..mono() };
    let (mut of_read, mut of_electronics) = (Vec::new(), Vec::new());
    for seed in 1..=6 {
        let plan = Plan { height: 120, width: 160, gains: vec![1.0, 2.0, 4.0, 8.0], seed, ..Plan::default() };
        let found = &series(&sensor, &plan, &[Some(33_723.0)])[0];
        let (joint, fit) = (&found.joint, found.histogram_fit.as_ref().unwrap());
        of_read.push(z(joint.read_variance_e2, 2.25));
        // sigma_el^2 is the intercept less 1/12.
        of_electronics.push(z(joint.variance_line.intercept, 0.09 + 1.0 / 12.0));
        assert!(z(joint.dark_offset_dn, 120.15).abs() < 3.5, "{:?}", joint.dark_offset_dn);
        assert!(z(fit.electronics_noise_dn, 0.3).abs() < 3.5, "{:?}", fit.electronics_noise_dn);
        assert!(z(fit.dark_noise_e, 1.5).abs() < 3.5, "{:?}", fit.dark_noise_e);
        assert!(fit.dsnu_e.value().is_none(), "{:?}", fit.dsnu_e);
        let names = names(&found.warnings);
        assert!(names.contains(&"rounding") && !names.contains(&"wider-than-noise"), "{:?}", found.warnings);
    }
    for all in [of_read, of_electronics] {
        assert!(all.iter().all(|z| z.abs() < 3.5), "{all:?}");
    }
}
