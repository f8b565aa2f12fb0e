//! What the tests of characterisation share.

use petzval_camera::SensorModel;
use petzval_camera::emva::Measured;

pub fn imx249() -> SensorModel {
    SensorModel::from_toml(include_str!("../../../../data/sensors/imx249-fitted.toml")).unwrap()
}

#[track_caller]
pub fn within(what: &str, found: Measured, truth: f64, sigmas: f64) {
    let (Some(value), Some(se)) = (found.value(), found.standard_error()) else {
        panic!("{what}: {found:?}")
    };
    assert!(((value - truth) / se).abs() < sigmas, "{what}: {value} +- {se}, truth {truth}");
}
