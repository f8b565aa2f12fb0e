//! The picture that an image signal processor makes of a simulated frame, calibrated by what the simulation knows: the shading and the
//! distortion of the lens, the answer and the noise of the sensor.

use petzval_camera::image::LinearImage;
use petzval_camera::isp::{Mesh, RawInput, RgbPicture};
use petzval_camera::render::{Distortion, RenderGeometry, Window};
use petzval_camera::sensor::{Raw, SensorModel};
use petzval_camera::spectral::Matrix3;
use petzval_design::error::DesignError;

use super::rig::Rig;
use super::shot::Warnings;
use crate::error::Result;
use crate::event::WarningKind;
use crate::named_isp::NamedIsp;

/// Nodes along a side of the calibrated meshes.
pub const MESH: usize = 33;

/// The picture, and warnings of coefficients that the registers of the ISP cut off.
pub fn picture(isp: &NamedIsp, frame: &RawInput) -> Result<(RgbPicture, Warnings)> {
    let values = isp.values(frame.about.gain_ev)?;
    let clipped = isp.clipped(&frame.about, &values).map_err(DesignError::from)?;
    let warnings = clipped.iter().map(|clipped| (WarningKind::RawFrame, format!("its {clipped}"))).collect();
    Ok((isp.isp().develop(frame, &values).map_err(DesignError::from)?, warnings))
}

/// A raw frame, taken where the lens leaves `illumination`, as the image signal processor receives it.
pub fn frame(
    rig: &Rig,
    sensor: &SensorModel,
    (raw, illumination): (&Raw, &LinearImage),
    colour_matrix: Option<Matrix3>,
) -> Result<RawInput> {
    let mut frame = RawInput::from_raw(raw, sensor).map_err(DesignError::from)?;
    frame.about.shading = Some(Mesh::of_picture(illumination, MESH, MESH));
    frame.about.warp = rig.distortion.as_ref().map(|map| warp(map, &rig.geometry, &rig.window));
    frame.about.colour_matrix = colour_matrix;
    Ok(frame)
}

/// How far from each node the light lies that belongs there without distortion, in rows and columns of pixels.
fn warp(map: &Distortion, geometry: &RenderGeometry, window: &Window) -> Mesh {
    let mut planes = vec![Vec::new(); 2];
    let centre = [geometry.sensor_height, geometry.sensor_width].map(|side| 0.5 * (side as f64 - 1.0));
    let pixel_mm = 1e-3 * geometry.pixel_um;
    let at =
        |k: usize, first: usize, len: usize| first as f64 + k as f64 * (len - 1) as f64 / (MESH - 1) as f64;
    for row in 0..MESH {
        for column in 0..MESH {
            let y = at(row, window.placement.row, window.height) - centre[0];
            let x = at(column, window.placement.col, window.width) - centre[1];
            let ideal_mm = pixel_mm * y.hypot(x);
            let stretch = if ideal_mm > 0.0 { map.image_mm(ideal_mm) / ideal_mm - 1.0 } else { 0.0 };
            planes[0].push((stretch * y) as f32);
            planes[1].push((stretch * x) as f32);
        }
    }
    Mesh { rows: MESH, cols: MESH, planes }
}

#[cfg(test)]
mod tests {
    use petzval_camera::render::Placement;

    use super::*;

    #[test]
    fn the_warp_leads_from_the_ideal_to_the_real_place() {
        // A barrel of 10 % at 1 mm: the ideal radius is larger than the real one.
        let radii: Vec<f64> = (0..=20).map(|i| 0.05 * f64::from(i)).collect();
        let ideal = radii.iter().map(|r| r * (1.0 + 0.1 * r * r)).collect();
        let map = Distortion::new(radii, ideal).unwrap();
        let geometry =
            RenderGeometry { sensor_height: 101, sensor_width: 201, pixel_um: 10.0, patches: (1, 1) };
        let whole = Window { placement: Placement { row: 0, col: 0 }, height: 101, width: 201 };
        let mesh = warp(&map, &geometry, &whole);
        let size = (101, 201);
        assert!(mesh.at(0, (50, 100), size).abs() < 1e-6 && mesh.at(1, (50, 100), size).abs() < 1e-6);
        // The right edge of the middle row, 1 mm from the axis.
        let wanted = (map.image_mm(1.0) - 1.0) / 0.01;
        assert!((f64::from(mesh.at(1, (50, 200), size)) - wanted).abs() < 1e-3 && wanted < -5.0);
        assert!(mesh.at(0, (50, 200), size).abs() < 1e-6);
        // A window of the frame has the displacements of its own places.
        let window = Window { placement: Placement { row: 50, col: 100 }, height: 51, width: 101 };
        let part = warp(&map, &geometry, &window);
        assert!((part.at(1, (0, 100), (51, 101)) - mesh.at(1, (50, 200), size)).abs() < 1e-3);
    }
}
