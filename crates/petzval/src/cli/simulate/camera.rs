//! The camera of a simulation: PSFs on a sensor.

use petzval::built_in_assets;
use petzval::camera::psf::PsfBank;
use petzval::camera::psf_calibration::psf_file::load_psfs;
use petzval::camera::render::{RenderGeometry, kernel_radius};
use petzval::camera::sensor::SensorModel;
use petzval::design::error::DesignError;
use petzval::design::optics::PsfPlan;
use petzval::optics::lens::Lens;
use petzval::optics::psf::PsfOptions;
use petzval::optics::pupil::Quadrature;

use super::{Args, Failure};
use crate::cli::psf_calibrate;

/// Everything that all photographs share.
pub struct Camera {
    pub geometry: RenderGeometry,
    pub bank: PsfBank,
    pub sensor: SensorModel,
    /// Light that the PSFs need from outside the frame, pixels.
    pub border: usize,
    /// The lens and how its PSFs are traced; none behind measured PSFs.
    pub traced: Option<(Lens, PsfPlan)>,
}

/// The camera that a command asks for.
pub fn camera(args: &Args) -> Result<Camera, Failure> {
    let assets = built_in_assets();
    let sensor = assets.sensor(&args.sensor)?;
    let geometry = RenderGeometry {
        sensor_height: sensor.height,
        sensor_width: sensor.width,
        pixel_um: sensor.pixel_um,
        patches: (7, 7),
    };
    let (bank, traced) = match &args.psfs {
        Some(path) => (load_psfs(path).map_err(|e| psf_calibrate::failure(e, path))?, None),
        None => {
            let lens = assets.lens(&args.lens)?.lens;
            let plan = plan(&sensor)?;
            (plan.bank(&lens)?, Some((lens, plan)))
        }
    };
    let border = kernel_radius(&geometry, &bank.layout()).map_err(DesignError::from)?;
    Ok(Camera { geometry, bank, sensor, border, traced })
}

/// PSFs at 13 fields from the centre of a sensor to its corner, in three colours.
fn plan(sensor: &SensorModel) -> Result<PsfPlan, Failure> {
    let corner_mm = 0.5e-3 * sensor.pixel_um * (sensor.height as f64).hypot(sensor.width as f64);
    let quadrature = Quadrature::grid(128).map_err(DesignError::from)?;
    Ok(PsfPlan::new(13, corner_mm, [0.62, 0.55, 0.486], PsfOptions::default(), quadrature))
}
