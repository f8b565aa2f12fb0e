//! The figures that a run ends with. They hold nothing that a second run would not repeat to the bit.

use std::collections::BTreeMap;

use petzval_base::statistics::{maximum, minimum};
use petzval_base::{counted, csv_number, csv_text};
use petzval_learn::score::ScoreDescription;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::PsfErrors;
use crate::error::{DesignError, Result};

/// Scores of every camera on held-out pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// Why some cameras have no value of a score, by the name of the score; absent where all have one, and in runs of earlier versions.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub without_value: BTreeMap<String, String>,
    /// Version of Petzval that scored the cameras; empty where an earlier one did not write it.
    #[serde(default)]
    pub version: String,
}

impl Metrics {
    /// Whether the scores are those of objects in all pictures, and not of single pictures.
    pub fn is_of_objects(&self) -> bool {
        self.rows.iter().flat_map(|row| &row.pictures).all(|picture| picture.scores.is_empty())
    }

    /// Whether any camera has a score: none has where nothing counts in all windows.
    pub fn has_scores(&self) -> bool {
        self.rows.iter().any(|row| !row.scores.is_empty())
    }

    /// Photoelectrons of white on the axis: `16000` of every camera, or `212 to 310` where a lens that gathers more light has more of them.
    pub fn electrons_of_white(&self) -> String {
        let all = || self.rows.iter().map(|row| row.white_e);
        let (least, most) = (all().fold(f64::INFINITY, minimum), all().fold(0.0, maximum));
        if least < most { format!("{least:.0} to {most:.0}") } else { most.to_string() }
    }

    /// The scores of which cameras have no value, and why: `no value of ap50_car (no object of the class car in the pictures)`. Cameras are named
    /// where others have one. None where no reason is known.
    pub fn missing_values(&self) -> Option<String> {
        let clause = |score: &ScoreDescription| {
            let reason = self.without_value.get(&score.name)?;
            let lack = self.rows.iter().filter(|row| !row.scores.contains_key(&score.name));
            let cameras: Vec<&str> = lack.map(|row| row.camera.as_str()).collect();
            let of = if cameras.len() == self.rows.len() {
                String::new()
            } else {
                format!(" for {}", cameras.join(", "))
            };
            (!cameras.is_empty()).then(|| format!("{}{of} ({reason})", score.name))
        };
        let clauses: Vec<String> = self.scores.iter().filter_map(clause).collect();
        (!clauses.is_empty()).then(|| format!("no value of {}", clauses.join("; ")))
    }

    /// What the cameras are scored on: `4 held-out photographs at 16 places each`.
    pub fn scored_on(&self) -> String {
        self.on("held-out ")
    }

    /// The same of pictures that the run has not held out: `4 photographs at 16 places each`.
    pub fn scored_on_others(&self) -> String {
        self.on("")
    }

    /// What the cameras are scored on. `kind` stands before the pictures.
    fn on(&self, kind: &str) -> String {
        if self.is_of_objects() {
            return format!("{} of {kind}scenes", counted(self.held_out_images, "window"));
        }
        let photographs = counted(self.held_out_images, &format!("{kind}photograph"));
        let each = if self.held_out_images == 1 { "" } else { " each" };
        format!("{photographs} at {}{each}", counted(self.held_out_places, "place"))
    }
}

impl Metrics {
    /// The figures of the cameras as comma-separated values, a line each, with the unit in the name of each column. A figure that a camera
    /// does not have is left empty.
    pub fn csv(&self) -> String {
        let names = || self.scores.iter().map(|score| &score.name);
        let of_scores =
            names().flat_map(|name| [name.clone(), format!("{name}_low"), format!("{name}_high")]);
        let head = ["camera".to_owned()].into_iter().chain(of_scores).chain(LENS_COLUMNS.map(str::to_owned));
        let mut lines: Vec<Vec<String>> = vec![head.collect()];
        for row in &self.rows {
            let scores = names().flat_map(|name| {
                let interval = row.intervals.get(name);
                [row.scores.get(name).copied(), interval.map(|i| i[0]), interval.map(|i| i[1])]
                    .map(csv_number)
            });
            let lens = [
                row.restored_error_percent,
                Some(row.rms_spot_um),
                Some(row.efl_mm),
                Some(row.f_number),
                Some(row.fov_deg),
                Some(row.corner_distortion_percent),
                Some(row.white_e),
                Some(row.isp_steps as f64),
                Some(row.network_steps as f64),
            ];
            lines.push([row.camera.clone()].into_iter().chain(scores).chain(lens.map(csv_number)).collect());
        }
        csv_text(lines)
    }

    /// The scores of every picture as comma-separated values; none where no picture has scores of its own, as those of objects in all pictures.
    pub fn pictures_csv(&self) -> Option<String> {
        let names: Vec<&str> = self.scores.iter().map(|score| score.name.as_str()).collect();
        let head = ["camera", "photo", "relative_field"].into_iter().chain(names.iter().copied());
        let mut lines: Vec<Vec<String>> = vec![head.map(str::to_owned).collect()];
        for row in &self.rows {
            for picture in row.pictures.iter().filter(|picture| !picture.scores.is_empty()) {
                let scores = names.iter().map(|name| csv_number(picture.scores.get(*name).copied()));
                let about = [row.camera.clone(), picture.photo.clone(), picture.relative_field.to_string()];
                lines.push(about.into_iter().chain(scores).collect());
            }
        }
        (lines.len() > 1).then(|| csv_text(lines))
    }
}

/// Columns of [`Metrics::csv`] behind the scores.
const LENS_COLUMNS: [&str; 9] = [
    "linear_limit_percent",
    "rms_spot_um",
    "efl_mm",
    "f_number",
    "fov_deg",
    "corner_distortion_percent",
    "white_e",
    "isp_steps",
    "network_steps",
];

/// One camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// Illumination in the sensor's corner relative to the axis, %; absent in runs of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corner_light_percent: Option<f64>,
    /// Least share of a PSF's light that its grid holds, over fields and wavelengths.
    pub psf_captured: f64,
    /// Share of the fields whose PSFs are by rays although those of the experiment are by waves.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub psf_by_rays: f64,
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

impl CameraMetrics {
    /// Fails on the first figure that is no finite number. JSON has no such numbers, and no mean has a meaning with them.
    pub(crate) fn check_finite(&self) -> Result<()> {
        let named = |name: &str, value: f64| (name.to_owned(), value);
        let lens = [("RMS spot", self.rms_spot_um), ("PSF", self.psf_captured), ("white", self.white_e)];
        let restored = self.restored_error_percent.map(|error| ("linear limit", error));
        let figures = lens.into_iter().chain(restored).map(|(name, value)| named(name, value));
        let of_pictures = self.pictures.iter().flat_map(|picture| {
            picture.scores.iter().map(|(name, value)| (format!("{name} of {}", picture.photo), *value))
        });
        let scores = self.scores.iter().map(|(name, value)| named(name, *value));
        let ends = self.intervals.iter().flat_map(|(name, ends)| ends.map(|end| named(name, end)));
        match figures.chain(of_pictures).chain(scores).chain(ends).find(|(_, value)| !value.is_finite()) {
            Some((name, _)) => Err(DesignError::NotFinite(format!("{}: {name}", self.camera))),
            None => Ok(()),
        }
    }
}

/// One held-out picture at one place of the sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PictureScore {
    /// Photograph.
    pub photo: String,
    /// Distance of the crop's centre from the axis over that of the sensor's corner, 0..1.
    pub relative_field: f64,
    /// The experiment's scores, by name.
    #[serde(flatten)]
    pub scores: BTreeMap<String, f64>,
}

fn is_zero<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_comma_separated() {
        let metrics: Metrics = serde_json::from_value(serde_json::json!({
            "rows": [{
                "camera": "wide, fast", "psnr_db": 30.5, "intervals": {"psnr_db": [29.0, 31.0]}, "rms_spot_um": 7.25, "efl_mm": 25.0,
                "f_number": 2.8, "fov_deg": 40.0, "corner_distortion_percent": -1.5, "psf_captured": 1.0, "white_e": 16000.0,
                "network_steps": 3, "rms_spot_by_field_um": [],
                "pictures": [{"photo": "a \"b\"", "relative_field": 0.5, "psnr_db": 30.5}]
            }],
            "seeds": [1], "held_out_images": 1, "held_out_places": 1,
            "scores": [{"name": "psnr_db", "title": "PSNR", "unit": "dB", "definition": "", "decimals": 2, "higher_is_better": true}]
        }))
        .unwrap();
        assert_eq!(
            metrics.csv(),
            "camera,psnr_db,psnr_db_low,psnr_db_high,linear_limit_percent,rms_spot_um,efl_mm,f_number,fov_deg,\
             corner_distortion_percent,white_e,isp_steps,network_steps\n\"wide, fast\",30.5,29,31,,7.25,25,2.8,40,-1.5,16000,0,3\n"
        );
        assert_eq!(
            metrics.pictures_csv().unwrap(),
            "camera,photo,relative_field,psnr_db\n\"wide, fast\",\"a \"\"b\"\"\",0.5,30.5\n"
        );
        let mut of_all = metrics.clone();
        of_all.rows[0].scores.clear();
        assert!(metrics.has_scores() && !of_all.has_scores());
        of_all.rows[0].pictures[0].scores.clear();
        assert_eq!(of_all.pictures_csv(), None, "a heading alone is no table");
        assert_eq!(metrics.electrons_of_white(), "16000");
        assert_eq!(metrics.scored_on(), "1 held-out photograph at 1 place");
        assert_eq!(metrics.scored_on_others(), "1 photograph at 1 place");
        let brighter = CameraMetrics { white_e: 24_321.7, ..metrics.rows[0].clone() };
        let metrics = Metrics { rows: vec![brighter, metrics.rows[0].clone()], ..metrics };
        assert_eq!(metrics.electrons_of_white(), "16000 to 24322");
    }

    #[test]
    fn a_score_without_a_value_is_named_with_its_reason() {
        let row = |camera: &str, scores: serde_json::Value| {
            let mut row = serde_json::json!({
                "camera": camera, "rms_spot_um": 7.25, "efl_mm": 25.0, "f_number": 2.8, "fov_deg": 40.0,
                "corner_distortion_percent": -1.5, "psf_captured": 1.0, "white_e": 16000.0, "network_steps": 3,
                "rms_spot_by_field_um": [], "pictures": []
            });
            row.as_object_mut().unwrap().extend(scores.as_object().unwrap().clone());
            row
        };
        let score = |name: &str| {
            serde_json::json!({
                "name": name, "title": name, "unit": "", "definition": "", "decimals": 4, "higher_is_better": true
            })
        };
        let metrics: Metrics = serde_json::from_value(serde_json::json!({
            "rows": [
                row("nominal", serde_json::json!({"ap50": 0.5})),
                row("end-to-end", serde_json::json!({"ap50": 0.5, "class_accuracy": 1.0})),
            ],
            "seeds": [1], "held_out_images": 3, "held_out_places": 1,
            "scores": [score("ap50"), score("ap50_drone"), score("class_accuracy")],
            "without_value": {"ap50_drone": "no object of the class drone", "class_accuracy": "no object is found"}
        }))
        .unwrap();
        assert_eq!(
            metrics.missing_values().unwrap(),
            "no value of ap50_drone (no object of the class drone); class_accuracy for nominal (no object is found)"
        );
        // Runs of earlier versions know no reasons; where all cameras have values, the file has no such key.
        let complete = Metrics { without_value: BTreeMap::new(), ..metrics };
        assert_eq!(complete.missing_values(), None);
        assert!(serde_json::to_value(&complete).unwrap().get("without_value").is_none());
    }
}
