//! Series of captures and their lists, and how tests change them.

use std::path::Path;

use petzval_camera::SensorModel;
use petzval_lab::emva::{
    CaptureError, Captures, Characterization, Options, Plan, characterize, write_series,
};

use crate::common::imx249;

pub fn mono() -> SensorModel {
    SensorModel { cfa: "mono".parse().unwrap(), clear_response: [1.0 / 3.0; 3], ..imx249() }
}

/// One gain of a small sensor.
pub fn one_gain() -> Plan {
    Plan { height: 80, width: 80, gains: vec![1.0], format: "png".into(), seed: 5, ..Plan::default() }
}

/// A series in a folder that goes when it is dropped.
pub fn series(sensor: &SensorModel, plan: &Plan) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_series(sensor, plan, folder.path(), &|| Ok(())).unwrap();
    folder
}

pub fn measured(folder: &Path) -> Result<Characterization, CaptureError> {
    characterize(&Captures::open(folder)?, &Options::default(), &|_| Ok(()))
}

pub fn list(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("captures.toml")).unwrap()
}

pub fn set_list(folder: &Path, text: &str) {
    std::fs::write(folder.join("captures.toml"), text).unwrap();
}

pub fn edit(folder: &Path, name: &str, change: &dyn Fn(u32, u32, u16) -> u16) {
    let path = folder.join("gain-1").join(name);
    let mut picture = image::open(&path).unwrap().into_luma16();
    picture.enumerate_pixels_mut().for_each(|(x, y, p)| p.0[0] = change(x, y, p.0[0]));
    picture.save(&path).unwrap();
}

/// The texts of the warnings of one name.
pub fn messages(found: &Characterization, name: &str) -> Vec<String> {
    found.warnings.iter().filter(|w| w.name() == name).map(ToString::to_string).collect()
}

/// Changes the frames of a folder whose names begin alike, by column, row and digital number.
pub fn change(folder: &Path, start: &str, of: &dyn Fn(u32, u32, u16) -> u16) {
    let frames = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    for path in frames.filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with(start)) {
        let mut frame = image::open(&path).unwrap().into_luma16();
        frame.enumerate_pixels_mut().for_each(|(x, y, dn)| dn.0[0] = of(x, y, dn.0[0]));
        frame.save(&path).unwrap();
    }
}

/// Shifts all samples of a series left, as some cameras write them, and states other bits.
pub fn restate(folder: &Path, shift: u32, bits: u32) {
    for entry in std::fs::read_dir(folder.join("gain-1")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        edit(folder, &name, &|_, _, dn| dn << shift);
    }
    set_list(folder, &list(folder).replace("bits = 12", &format!("bits = {bits}")));
}
