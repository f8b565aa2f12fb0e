//! Scores on held-out photographs: exact noise, fixed places from the sensor's centre to its corner.

use burn::prelude::*;
use petzval_camera::image::LinearImage;
use petzval_camera::quality::{psnr, ssim_gaussian_wang};
use petzval_camera::render::Placement;
use petzval_camera::sensor::{Noise, NoiseMode};
use petzval_learn::dataset::held_out_placements;
use petzval_learn::loss::Lpips;
use petzval_learn::metric::one_minus_lpips;
use petzval_learn::task::Task;
use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::{chief_ray, field_imaged_at};
use petzval_optics::spot::spot;
use rayon::prelude::*;

use crate::error::DesignError;
use crate::light_path::{LightPath, PsfLeaves, Shot};
use crate::run::{CameraMetrics, PictureScore};
use crate::setup::Setup;

/// Seed of the noise in scored frames: the same for every camera and every run.
const SCORING_SEED: u64 = 0x5C0_12E;

/// A scored picture in its three states, sRGB-encoded.
pub struct ScoredPicture {
    /// Its scores.
    pub score: PictureScore,
    /// The photograph.
    pub truth: LinearImage,
    /// The developed raw frame, before the network.
    pub developed: LinearImage,
    /// The network's picture.
    pub output: LinearImage,
}

/// Held-out windows: every photograph at every place.
fn held_out_shots(setup: &Setup, path: &LightPath) -> Result<Vec<(String, f64, Shot)>, DesignError> {
    let places = held_out_placements(&setup.scoring_crops, setup.experiment.scoring.places_per_side)?;
    let window = setup.scoring_crops.window();
    let mut shots = Vec::new();
    for photo in setup.photos.held_out() {
        for place in &places {
            // The middle of the photograph, wherever it lands on the sensor: places differ by the lens alone.
            let row = (photo.image.height - window) / 2;
            let column = (photo.image.width - window) / 2;
            let scene = photo
                .image
                .crop(row, column, window, window)
                .map_err(|e| DesignError::Device(e.to_string()))?;
            let placement = Placement { row: place.sensor_row, col: place.sensor_column };
            let frame = shots.len() as u64;
            let middle = path.geometry.radius_mm(
                placement.row + setup.scoring_crops.crop / 2,
                placement.col + setup.scoring_crops.crop / 2,
            );
            shots.push((photo.name.clone(), middle / setup.corner_mm(), Shot { scene, placement, frame }));
        }
    }
    Ok(shots)
}

/// Scores a camera: its lens by exact tracing, its pictures on held-out photographs.
///
/// `keep` says which pictures are handed out for the report.
pub fn score_camera(
    setup: &Setup,
    path: &LightPath,
    name: &str,
    lens: &Lens,
    task: &dyn Task,
    lpips: &Lpips,
) -> Result<(CameraMetrics, Vec<ScoredPicture>), DesignError> {
    let bank = setup.fixed_plan.bank(lens)?;
    let leaves = PsfLeaves::new(&bank, &setup.device, false);
    let noise = Noise { mode: NoiseMode::Exact, seed: SCORING_SEED };
    let mut pictures = Vec::new();
    for (photo, relative_field, shot) in held_out_shots(setup, path)? {
        let shots = [shot];
        let developed = path.take(&leaves, &shots, &noise)?;
        let truth = path.truth(&shots, &setup.device)?;
        let output = task.picture(developed.clone()).clamp(0.0, 1.0);
        let similarity = one_minus_lpips(lpips, output.clone(), truth.clone())?;
        let [_, channels, height, width] = output.dims();
        let image = |t: Tensor<4>| -> Result<LinearImage, DesignError> {
            Ok(LinearImage { channels, height, width, data: to_host(t)? })
        };
        let (truth, developed, output) = (image(truth)?, image(developed)?, image(output)?);
        let quality = |e: petzval_camera::quality::QualityError| DesignError::Device(e.to_string());
        let score = PictureScore {
            photo,
            relative_field,
            one_minus_lpips: similarity.first().copied().map_or(f64::NAN, f64::from),
            psnr_db: psnr(&truth.data, &output.data).map_err(quality)?,
            ssim: ssim_gaussian_wang(&truth.data, &output.data, channels, height, width).map_err(quality)?,
        };
        pictures.push(ScoredPicture { score, truth, developed, output });
    }
    let metrics = camera_metrics(setup, name, lens, pictures.iter().map(|p| p.score.clone()).collect())?;
    Ok((metrics, pictures))
}

fn camera_metrics(
    setup: &Setup,
    name: &str,
    lens: &Lens,
    pictures: Vec<PictureScore>,
) -> Result<CameraMetrics, DesignError> {
    let reference = lens.at_wavelength(lens.reference_um);
    let order = first_order(&reference);
    let angles = setup.fixed_plan.field_angles(lens);
    // The field of view ends where the light of the sensor's corner comes from.
    let (corner_mm, ideal) = (setup.corner_mm(), angles.last().copied().unwrap_or(0.0));
    let dark = || DesignError::NoLight { field_deg: ideal.to_degrees() };
    let corner_chief = chief_ray(&reference, ideal).ok_or_else(dark)?;
    let corner_field = field_imaged_at(&reference, corner_mm, ideal).ok_or_else(dark)?;
    let psfs = setup.fixed_plan.psfs(lens)?;
    let psf_captured = psfs.iter().flat_map(|p| &p.captured).fold(1.0_f64, |least, c| least.min(*c));
    let rms_spot_by_field_um: Vec<f64> = angles
        .par_iter()
        .map(|field| {
            spot(lens, *field, &setup.fixed_plan.quadrature)
                .map(|s| s.rms_poly_um)
                .ok_or(DesignError::NoLight { field_deg: field.to_degrees() })
        })
        .collect::<Result<_, _>>()?;
    let mean = |f: fn(&PictureScore) -> f64| pictures.iter().map(f).sum::<f64>() / pictures.len() as f64;
    Ok(CameraMetrics {
        camera: name.to_owned(),
        one_minus_lpips: mean(|p| p.one_minus_lpips),
        psnr_db: mean(|p| p.psnr_db),
        ssim: mean(|p| p.ssim),
        rms_spot_um: rms_spot_by_field_um.iter().sum::<f64>() / rms_spot_by_field_um.len() as f64,
        efl_mm: order.efl_mm,
        f_number: order.f_number,
        fov_deg: 2.0 * corner_field.to_degrees(),
        corner_distortion_percent: 100.0 * (corner_chief.y_mm / corner_mm - 1.0),
        psf_captured,
        white_e: f64::from(setup.experiment.exposure.white_e),
        network_steps: setup.experiment.training.steps,
        rms_spot_by_field_um,
        pictures,
    })
}

/// Values of a tensor on the host.
pub(crate) fn to_host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, DesignError> {
    tensor.detach().into_data().try_to_vec::<f32>().map_err(|e| DesignError::Device(format!("{e:?}")))
}
