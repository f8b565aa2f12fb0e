//! The figures of a calibration as plain data, the content of `calibration.json`.

use petzval_camera::image::CHANNELS;
use petzval_camera::psf::PsfBank;
use petzval_camera::sensor::{CfaPattern, SensorModel};
use petzval_lab::psf_calibration::compare::Comparison;
use petzval_lab::psf_calibration::estimate::FieldEstimate;
use petzval_lab::psf_calibration::held_out::HeldOutBy;
use petzval_lab::psf_calibration::measure::COLOURS;
use petzval_lab::psf_calibration::{CROP, CalibratedPosition, ExposureReport};
use petzval_report::psf_calibration_sheet::Calibration;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Everything that a calibration found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Name of the folder of captures.
    pub captures: String,
    /// Name of the sensor.
    pub sensor: String,
    /// The lens that was compared with, if any.
    pub lens: Option<String>,
    /// Pixel pitch, um.
    pub pixel_um: f64,
    /// Pixels a side of a measured PSF.
    pub crop: usize,
    /// Names of the channels; all `clear` for a monochrome sensor.
    pub channels: [String; CHANNELS],
    /// Measured positions in the order of the manifest.
    pub positions: Vec<PositionFigures>,
    /// The PSFs for the renderer.
    pub bank: BankFigures,
}

/// A measured position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PositionFigures {
    /// Its name.
    pub name: String,
    /// Field radius, mm.
    pub field_radius_mm: f64,
    /// Direction from the axis, degrees from the columns towards higher rows.
    pub azimuth_deg: f64,
    /// Centroid of each channel on the sensor, (row, column), px.
    pub centroid_px: [[f64; 2]; CHANNELS],
    /// Standard error of the green centroid, (row, column), px.
    pub centroid_standard_error_px: [f64; 2],
    /// Where the bank has the middle of the PSF on the sensor, (row, column), px.
    pub bank_middle_px: Option<[f64; 2]>,
    /// Row and column of the first pixel of the measured PSF on the sensor.
    pub crop_origin: [usize; 2],
    /// Light of each channel over the crop, electrons/s.
    pub light_e_per_s: [f64; CHANNELS],
    /// Background of each channel, electrons/s.
    pub background_e_per_s: [f64; CHANNELS],
    /// What noise alone does.
    pub noise_floor: NoiseFloor,
    /// The exposures.
    pub exposures: Vec<ExposureFigures>,
    /// The same position simulated, if there is a lens.
    pub simulated: Option<Simulated>,
    /// What a careful reader should know.
    pub warnings: Vec<String>,
}

/// What noise alone does to a measurement, per channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NoiseFloor {
    /// L1 distance of the PSF from the noiseless one.
    pub l1: [f64; CHANNELS],
    /// Standard deviation of the centroid, (row, column), px.
    pub centroid_px: [[f64; 2]; CHANNELS],
    /// Relative standard deviation of the light.
    pub light: [f64; CHANNELS],
}

/// One exposure time of a position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ExposureFigures {
    /// Exposure time, ms.
    pub exposure_ms: f64,
    /// Frames averaged.
    pub frames: usize,
    /// Dark frames averaged; with 0 the dark signal is that of the sensor model.
    pub dark_frames: usize,
    /// Saturated pixels.
    pub saturated_pixels: usize,
    /// Mean of the frames' variance over the modelled one; `None` for one frame.
    pub variance_ratio: Option<f64>,
    /// Comparison with all other exposures; `None` if no bright pixel of it is usable in another.
    pub agreement: Option<AgreementFigures>,
}

/// An exposure compared with the others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AgreementFigures {
    /// Light of this exposure over that of the others.
    pub light_over_others: f64,
    /// Mean squared difference over its variance.
    pub chi2: f64,
    /// Bright pixels that were compared.
    pub pixels: usize,
}

/// A measured position compared with the traced lens, per channel; see [`Comparison`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Simulated {
    /// L1 distance from the simulated PSF through the same mosaic.
    pub l1: [f64; CHANNELS],
    /// L1 distance from the simulated PSF on ideal pixels.
    pub l1_ideal_pixels: [f64; CHANNELS],
    /// L1 distance between the two simulated PSFs.
    pub l1_of_demosaicing: [f64; CHANNELS],
    /// Measured minus simulated centroid through the same mosaic, (row, column), px.
    pub centroid_error_same_mosaic_px: [[f64; 2]; CHANNELS],
    /// Measured minus ideal centroid, (row, column), px.
    pub centroid_error_ideal_pixels_px: [[f64; 2]; CHANNELS],
    /// Simulated centroid on ideal pixels of the sensor, (row, column), px.
    pub centroid_ideal_pixels_px: [[f64; 2]; CHANNELS],
    /// Whether the place of the image was known, and within the frame.
    pub place_is_known: bool,
}

/// The PSFs for the renderer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BankFigures {
    /// Image radius of each field, mm.
    pub field_radius_mm: Vec<f64>,
    /// Cells along a side of the grid.
    pub grid: usize,
    /// Cell size, um.
    pub pitch_um: f64,
    /// Relative illumination of each field and channel.
    pub illumination: Vec<[f32; CHANNELS]>,
    /// How each field was fitted.
    pub fit: Vec<FieldFigures>,
}

/// The fit of one field, per channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FieldFigures {
    /// Mean radius of its positions, mm.
    pub field_radius_mm: f64,
    /// Positions that see it.
    pub positions: usize,
    /// Mean squared residual of the fitted pixels over the variance.
    pub chi2: [f64; CHANNELS],
    /// The same for pixels that took no part in a fit.
    pub held_out: HeldOutFigures,
    /// Standard deviation of the chosen blobs, px.
    pub blob_px: [f64; CHANNELS],
    /// Rounds of the fit.
    pub rounds: [usize; CHANNELS],
    /// Whether the fit started from the cells of green.
    pub starts_from_green: [bool; CHANNELS],
    /// What a careful reader should know.
    pub warnings: Vec<String>,
}

/// How well the fit predicts pixels that took no part in it, per channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HeldOutFigures {
    /// What was held out.
    pub by: HeldOutBy,
    /// Mean squared residual over the variance.
    pub chi2: [f64; CHANNELS],
    /// Sum of absolute residuals over the light on the same pixels.
    pub l1: [f64; CHANNELS],
    /// What noise alone would make of `l1`.
    pub l1_of_noise: [f64; CHANNELS],
}

impl Figures {
    pub(super) fn new(calibration: &Calibration, bank: &PsfBank, sensor: &SensorModel) -> Self {
        let middles: Vec<(usize, [f64; 2])> =
            calibration.fields.iter().flat_map(|f| f.middle_px.iter().copied()).collect();
        let position =
            |(index, (position, comparison)): (usize, &(CalibratedPosition, Option<Comparison>))| {
                let middle = middles.iter().find(|m| m.0 == index).map(|m| m.1);
                PositionFigures::new(position, comparison.as_ref(), middle)
            };
        let is_mono = sensor.cfa == CfaPattern::MONO;
        Self {
            captures: calibration.captures.clone(),
            sensor: calibration.sensor.clone(),
            lens: calibration.lens.clone(),
            pixel_um: sensor.pixel_um,
            crop: CROP,
            channels: if is_mono { ["clear"; CHANNELS] } else { COLOURS }.map(str::to_owned),
            positions: calibration.positions.iter().enumerate().map(position).collect(),
            bank: BankFigures {
                field_radius_mm: bank.field_radius_mm.clone(),
                grid: bank.grid,
                pitch_um: bank.pitch_um,
                illumination: bank.illumination.as_chunks().0.to_vec(),
                fit: calibration.fields.iter().map(FieldFigures::from).collect(),
            },
        }
    }
}

impl PositionFigures {
    /// `middle_px` is where the bank has the middle of the PSF in the window.
    fn new(p: &CalibratedPosition, comparison: Option<&Comparison>, middle_px: Option<[f64; 2]>) -> Self {
        let (measured, placement) = (&p.measured, &p.frame.placement);
        let on_sensor = |at: [f64; 2]| [placement.row as f64 + at[0], placement.col as f64 + at[1]];
        let floor = &measured.floor;
        Self {
            name: p.name.clone(),
            field_radius_mm: p.field_radius_mm,
            azimuth_deg: p.azimuth_rad.to_degrees(),
            centroid_px: measured.psf.centroid_px.map(on_sensor),
            centroid_standard_error_px: measured.centroid_se_px,
            bank_middle_px: middle_px.map(on_sensor),
            crop_origin: [placement.row + measured.psf.corner.0, placement.col + measured.psf.corner.1],
            light_e_per_s: measured.psf.light_e_per_s,
            background_e_per_s: measured.background_e_per_s,
            noise_floor: NoiseFloor { l1: floor.l1, centroid_px: floor.centroid_px, light: floor.light },
            exposures: p.exposures.iter().map(ExposureFigures::from).collect(),
            simulated: comparison.map(|c| Simulated {
                l1: c.l1,
                l1_ideal_pixels: c.l1_ideal,
                l1_of_demosaicing: c.demosaic_l1,
                centroid_error_same_mosaic_px: c.centroid_error_px,
                centroid_error_ideal_pixels_px: c.centroid_error_ideal_px,
                centroid_ideal_pixels_px: c.ideal_centroid_px.map(on_sensor),
                place_is_known: c.is_placed,
            }),
            warnings: p.warnings.clone(),
        }
    }
}

impl From<&ExposureReport> for ExposureFigures {
    fn from(e: &ExposureReport) -> Self {
        Self {
            exposure_ms: e.exposure_ms,
            frames: e.frames,
            dark_frames: e.dark_frames,
            saturated_pixels: e.saturated_pixels,
            variance_ratio: e.variance_ratio,
            agreement: e.agreement.map(|a| AgreementFigures {
                light_over_others: a.ratio,
                chi2: a.chi2,
                pixels: a.pixels,
            }),
        }
    }
}

impl From<&FieldEstimate> for FieldFigures {
    fn from(f: &FieldEstimate) -> Self {
        let score = &f.held_out.score;
        Self {
            field_radius_mm: f.field_radius_mm,
            positions: f.positions,
            chi2: f.chi2,
            held_out: HeldOutFigures {
                by: f.held_out.by,
                chi2: score.map(|s| s.chi2()),
                l1: score.map(|s| s.l1()),
                l1_of_noise: score.map(|s| s.noise_l1()),
            },
            blob_px: f.blob_px,
            rounds: f.rounds,
            starts_from_green: f.is_from_green,
            warnings: f.warnings(),
        }
    }
}
