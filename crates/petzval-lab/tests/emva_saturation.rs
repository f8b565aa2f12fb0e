//! Where the signal ends, and series that end before it, in it and far beyond it: K, QE and saturation are those of the sensor.

mod common;

use common::{imx249, small_mono, within};
use petzval_camera::SensorModel;
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Colour, NonUniformity};
use petzval_lab::emva::{
    Captures, Characterization, Plan, Unresolved, characterize, sensor_toml, write_series,
};

fn sensor(full_well_e: f64, prnu_pixel_percent: f64) -> SensorModel {
    let nonuniformity =
        NonUniformity { specimen: 3, dsnu_pixel_e: 2.0, prnu_pixel_percent, ..NonUniformity::default() };
    small_mono(full_well_e, nonuniformity)
}

/// `points` exposures up to 20 ms, the brightest at `level` of saturation.
fn measured(sensor: &SensorModel, points: usize, level: f64, seed: u64) -> Characterization {
    let plan = Plan {
        height: 90,
        width: 120,
        gains: vec![1.0],
        flat_ms: (1..=points).map(|i| 20.0 * i as f64 / points as f64).collect(),
        dark_ms: vec![1.0, 10.0, 20.0],
        level,
        quantum_efficiency: Some(0.6),
        seed,
        ..Plan::default()
    };
    let folder = tempfile::tempdir().unwrap();
    write_series(sensor, &plan, folder.path(), &|| Ok(())).unwrap();
    characterize(&Captures::open(folder.path()).unwrap(), &Default::default(), &|_| Ok(())).unwrap()
}

#[test]
fn the_saturation_is_that_of_the_pixel_or_the_converter_at_any_sampling() {
    let mut seed = 0;
    for full_well_e in [4000.0, 10_500.0, 14_000.0] {
        for prnu_percent in [0.0, 2.5] {
            for (points, level) in [(5, 1.2), (5, 3.0), (12, 2.0), (25, 1.05), (40, 1.2)] {
                seed += 1;
                let found = measured(&sensor(full_well_e, prnu_percent), points, level, seed);
                let channel = &found.gains[0].channels[0];
                let best = |name: &str| channel.figure(name).unwrap().best();
                let what = |name: &str| format!("{name} of {full_well_e} e-, {points} points to {level}");
                let truth = sensor(full_well_e, 0.0).full_well_e.min((4095.0 - 64.0) / 0.38);
                // The pixels of the frames are as sensitive as their specimen was drawn.
                let specimen = sensor(full_well_e, prnu_percent).fixed_pattern(Placement::default(), 90, 120);
                let response = specimen.response.iter().map(|r| f64::from(*r)).sum::<f64>() / (90.0 * 120.0);
                // 120 numbers at four standard errors: a false alarm once in 130 sets of seeds; these are fixed.
                within(&what("R"), best("R"), 0.38 * 0.6 * response, 4.0);
                within(&what("K"), best("K"), 0.38, 4.0);
                within(&what("QE"), best("QE"), 60.0, 4.0);
                within(&what("u_e_sat"), best("u_e_sat"), truth, 4.0);
                // The error is that of K unless the knee is all that is seen.
                let error = best("u_e_sat").standard_error().unwrap() / truth;
                assert!(error < 0.04, "{}: {error}", what("u_e_sat"));
            }
        }
    }
}

#[test]
fn the_full_well_is_that_of_the_colour_that_reaches_it() {
    // Red and blue get half of the light of green, which alone is full.
    let sensor = SensorModel { full_well_e: 8000.0, relative_qe: [0.5, 1.0, 0.5], ..imx249() };
    let plan = Plan {
        height: 90,
        width: 120,
        gains: vec![1.0],
        flat_ms: (1..=16).map(f64::from).collect(),
        dark_ms: vec![1.0, 8.0, 16.0],
        level: 1.2,
        seed: 5,
        ..Plan::default()
    };
    let folder = tempfile::tempdir().unwrap();
    write_series(&sensor, &plan, folder.path(), &|| Ok(())).unwrap();
    // The list does not state the full well.
    let list = folder.path().join("captures.toml");
    let text = std::fs::read_to_string(&list).unwrap();
    let kept: Vec<&str> = text.lines().filter(|line| !line.starts_with("full_well_e")).collect();
    std::fs::write(&list, kept.join("\n")).unwrap();
    let found =
        characterize(&Captures::open(folder.path()).unwrap(), &Default::default(), &|_| Ok(())).unwrap();
    let capacity = |colour: Colour| {
        let channel = found.gains[0].channels.iter().find(|c| c.colour == colour).unwrap();
        channel.figure("u_e_sat").unwrap().best()
    };
    assert_eq!(capacity(Colour::Red).reason(), Some(Unresolved::NotSaturated));
    within("u_e_sat of green", capacity(Colour::Green), 8000.0, 4.0);
    assert_eq!(found.gains[0].saturated_channel().unwrap().colour, Colour::Green);
    let text = sensor_toml(&found).unwrap();
    let full_well_e = petzval_files::parse_sensor(&text).unwrap().full_well_e;
    assert_eq!(Some(full_well_e), capacity(Colour::Green).value(), "{text}");
    assert!(text.contains("e-, of the green pixels"), "{text}");
}

#[test]
fn points_in_the_knee_do_not_enter_the_gain() {
    // The brightest point loses a part of its noise; what is left is more than that of the point before.
    for (seed, prnu_percent, points, level) in
        [(1, 0.0, 5, 0.985), (2, 2.5, 5, 0.96), (3, 2.5, 5, 0.98), (4, 0.8, 12, 0.99), (5, 2.5, 25, 0.98)]
    {
        let found = measured(&sensor(8000.0, prnu_percent), points, level, seed);
        within(&format!("K, {points} points to {level}"), found.joint.gain_dn_per_e, 0.38, 3.5);
    }
    // Well below saturation all points are used, and there is no warning.
    let found = measured(&sensor(8000.0, 0.8), 12, 0.6, 6);
    let transfer = &found.gains[0].channels[0].transfer;
    assert_eq!((transfer.used, transfer.saturated), (12, false));
    assert_eq!(transfer.saturation_signal_dn.reason(), Some(Unresolved::NotSaturated));
}

#[test]
fn the_ratios_of_the_colours_are_those_of_their_responsivities() {
    for (seed, full_well_e, level) in
        [(1, 10_500.0, 1.2), (2, 4000.0, 1.1), (3, 14_000.0, 1.3), (4, 8000.0, 2.0)]
    {
        let sensor = SensorModel { cfa: "RGGB".parse().unwrap(), ..sensor(full_well_e, 0.0) };
        let found = measured(&sensor, 12, level, seed);
        within("alpha", found.joint.red_over_green, 0.82, 3.5);
        within("beta", found.joint.blue_over_green, 1.25, 3.5);
        let responsivity = |colour: Colour| {
            let channel = found.gains[0].channels.iter().find(|c| c.colour == colour).unwrap();
            channel.transfer.responsivity_dn
        };
        for (ratio, colour) in
            [(found.joint.red_over_green, Colour::Red), (found.joint.blue_over_green, Colour::Blue)]
        {
            let other = responsivity(colour).over(responsivity(Colour::Green));
            let se = ratio.standard_error().unwrap().hypot(other.standard_error().unwrap());
            let off = (ratio.value().unwrap() - other.value().unwrap()) / se;
            assert!(off.abs() < 3.5, "{colour:?}: {ratio:?} {other:?}");
        }
    }
}
