//! What the tests of characterisation share.

#[allow(dead_code, reason = "each test file takes what it needs of this module")]
pub mod bench;

use petzval_camera::SensorModel;
use petzval_camera::sensor::NonUniformity;
use petzval_lab::emva::Measured;

#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn imx249() -> SensorModel {
    petzval_files::parse_sensor(include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml"))
        .unwrap()
}

/// A made-up monochrome sensor whose converter ends at (4095 - 64) / 0.38 = 10,608 electrons.
#[allow(dead_code, reason = "each test file takes what it needs of this one")]
pub fn small_mono(full_well_e: f64, nonuniformity: NonUniformity) -> SensorModel {
    SensorModel {
        cfa: "mono".parse().unwrap(),
        clear_response: [1.0 / 3.0; 3],
        full_well_e,
        black_level_dn: 64.0,
        gain_dn_per_e: 0.38,
        dark_current_e_per_s: 5.0,
        read_noise_mean_e: 0.0,
        read_noise_e: 2.3,
        electronics_mean_dn: 0.0,
        electronics_noise_dn: 0.3,
        nonuniformity,
        ..imx249()
    }
}

#[allow(dead_code, reason = "each test file takes what it needs of this one")]
#[track_caller]
pub fn within(what: &str, found: Measured, truth: f64, sigmas: f64) {
    let (Some(value), Some(se)) = (found.value(), found.standard_error()) else {
        panic!("{what}: {found:?}")
    };
    assert!(((value - truth) / se).abs() < sigmas, "{what}: {value} +- {se}, truth {truth}");
}
