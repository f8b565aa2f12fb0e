//! The figures that a run ends with. They hold nothing that a second run would not repeat to the bit.

use std::collections::BTreeMap;

use petzval_learn::score::ScoreDescription;
use serde::{Deserialize, Serialize};

use crate::camera::PsfErrors;

/// Scores of every camera on held-out pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// One row a camera.
    pub rows: Vec<CameraMetrics>,
    /// Seeds of the run.
    pub seeds: Vec<u64>,
    /// Number of held-out photographs.
    pub held_out_images: usize,
    /// Number of places on the sensor at which each of them is scored.
    pub held_out_places: usize,
    /// The scores of the pictures, in the order of the experiment file.
    pub scores: Vec<ScoreDescription>,
    /// Version of Petzval that scored the cameras; empty where an earlier one did not write it.
    #[serde(default)]
    pub version: String,
}

impl Metrics {
    /// Whether the scores are those of objects in all pictures, and not of single pictures.
    pub fn is_of_objects(&self) -> bool {
        self.rows.iter().flat_map(|row| &row.pictures).all(|picture| picture.scores.is_empty())
    }

    /// What the cameras are scored on: `4 held-out photographs at 16 places each`.
    pub fn scored_on(&self) -> String {
        match self.is_of_objects() {
            true => format!("{} windows of held-out scenes", self.held_out_images),
            false => format!(
                "{} held-out photographs at {} places each",
                self.held_out_images, self.held_out_places
            ),
        }
    }
}

/// One camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraMetrics {
    /// Name of the variant.
    pub camera: String,
    /// Means of the experiment's scores over all pictures, by name.
    #[serde(flatten)]
    pub scores: BTreeMap<String, f64>,
    /// Ranges, low and high, in which scores over all windows lie in 95 % of draws of the windows; none for means over pictures.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub intervals: BTreeMap<String, [f64; 2]>,
    /// Whether its lens has no aberrations: then it is the ceiling of the others.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_ceiling: bool,
    /// Root of the expected squared error after the best linear restoration of raw frames, % of white; absent in runs of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restored_error_percent: Option<f64>,
    /// Mean over the fields of the polychromatic RMS spot radius, um.
    pub rms_spot_um: f64,
    /// Effective focal length, mm.
    pub efl_mm: f64,
    /// EFL over entrance pupil diameter.
    pub f_number: f64,
    /// Full field of view along the sensor's diagonal, degrees: twice the field whose chief ray lands in the corner.
    pub fov_deg: f64,
    /// Image radius of the sensor's corner against that of an image without distortion, %; -100 where no such image reaches the field.
    pub corner_distortion_percent: f64,
    /// Least share of a PSF's light that its grid holds, over fields and wavelengths.
    pub psf_captured: f64,
    /// Errors of the PSFs that the camera was scored with; absent in runs of versions that did not measure them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psf_errors: Option<PsfErrors>,
    /// Photoelectrons of white.
    pub white_e: f64,
    /// Steps that the hardware ISP of the camera got, with those of the variants from which it started.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub isp_steps: usize,
    /// Network steps that the camera got, with those of the variants from which it started.
    pub network_steps: usize,
    /// Polychromatic RMS spot radius per field, um.
    pub rms_spot_by_field_um: Vec<f64>,
    /// Each picture.
    pub pictures: Vec<PictureScore>,
}

/// One held-out picture at one place of the sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureScore {
    /// Photograph.
    pub photo: String,
    /// Distance of the crop's centre from the axis over that of the sensor's corner, 0..1.
    pub relative_field: f64,
    /// The experiment's scores, by name.
    #[serde(flatten)]
    pub scores: BTreeMap<String, f64>,
}

fn is_zero(steps: &usize) -> bool {
    *steps == 0
}
