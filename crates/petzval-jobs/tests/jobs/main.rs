//! Jobs, without the command.

mod control;
mod inline;
mod lens_and_glass;
mod lens_mtf;
mod measuring;
mod one_development;
mod pinhole_captures;
mod psf_files;
mod row_check;
mod schema_check;
mod schemas;
mod table;
mod values;
mod weights;
mod whole_table;

use std::path::Path;

/// The usual sensor with other numbers of pixels, as a file in a folder. A scene is computed for a whole sensor, however few of its pixels are read.
fn small_sensor(folder: &Path, rows: usize, columns: usize) -> String {
    let usual = include_str!("../../../petzval-data/data/sensors/imx249-fitted.toml");
    let (height, width) = ("height = 1200", "width = 1920");
    assert!(usual.contains(height) && usual.contains(width), "{usual}");
    let fewer = usual.replace(height, &format!("height = {rows}"));
    let path = folder.join("small-sensor.toml");
    std::fs::write(&path, fewer.replace(width, &format!("width = {columns}"))).unwrap();
    path.display().to_string()
}
