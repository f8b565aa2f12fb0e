//! The operand file in TOML: figures that an optimisation should reach, each with a weight.
//!
//! ```
//! # use petzval_base::FileError;
//! let file = petzval_files::parse_operands(
//!     r#"
//! spot_weight = 0.2           # of the RMS spots beside the operands; 0 leaves them out
//!
//! [[operand]]
//! of = "mtf"                  # the mean of sagittal and tangential
//! frequency_per_mm = 40.0
//! field_deg = 10.0            # all fields of the lens if left out
//! waves = true                # with diffraction; by rays if left out
//! at_least = 0.5
//! weight_um = 100.0           # the weight of one unit beyond the bound, um of spot
//!
//! [[operand]]
//! of = "distortion"
//! field_deg = 15.0
//! at_most = 0.01
//! "#,
//! )?;
//! assert_eq!(file.operand.len(), 2);
//! # Ok::<(), FileError>(())
//! ```

use petzval_base::FileError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Figures that a lens should reach.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OperandFile {
    /// How much the RMS spots count beside them, from 0.
    #[serde(default = "one")]
    pub spot_weight: f64,
    /// The figures.
    pub operand: Vec<Operand>,
}

/// A figure with its bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Operand {
    /// The figure.
    pub of: Figure,
    /// Field angle, degrees; where it is left out, all fields of the lens for contrast, spots and wavefronts, and the outermost for the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field_deg: Option<f64>,
    /// Spatial frequency of contrast, cycles per mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_per_mm: Option<f64>,
    /// Whether contrast includes diffraction.
    #[serde(default)]
    pub waves: bool,
    /// Least value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_least: Option<f64>,
    /// Greatest value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
    /// The weight of one unit beyond a bound, as a spot radius in um. A unit is 1 for contrast, 1 wave for a wavefront, 1 um for a spot. Bounds of
    /// the other figures bind: a millimetre beyond weighs at least 10 000 um, as for a limit.
    #[serde(default = "hundred")]
    pub weight_um: f64,
}

fn one() -> f64 {
    1.0
}

fn hundred() -> f64 {
    100.0
}

/// A figure of a lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Figure {
    /// MTF at a frequency, mean of sagittal and tangential, 0 to 1.
    Mtf,
    /// RMS spot radius, um.
    Spot,
    /// RMS wavefront error about the best sphere of all wavelengths, waves.
    Wavefront,
    /// Effective focal length, mm.
    FocalLength,
    /// Paraxial back focal length, mm, positive in the direction of the light.
    BackFocalLength,
    /// Greatest distance between any two of the vertices and the image plane, mm.
    Track,
    /// Distortion, a share of the ideal image height.
    Distortion,
    /// Angle of the chief ray to the axis at the image, degrees.
    ChiefRayAngle,
    /// Height on the image plane at which the chief ray of a field lands, mm.
    ImageHeight,
}

/// Reads an operand file. Errors name line, key, value and a hint.
pub fn parse_operands(text: &str) -> Result<OperandFile, FileError> {
    let file: OperandFile = FileError::read_toml(text)?;
    if !(file.spot_weight >= 0.0 && file.spot_weight.is_finite()) {
        let error = FileError::at_key(text, &["spot_weight"], "must be a number from 0");
        return Err(error.hint("1 for the spots beside the operands, 0 for the operands alone"));
    }
    if file.operand.is_empty() {
        let error = FileError::at_key(text, &["operand"], "there are no operands");
        return Err(error.hint("add an [[operand]] with `of`, a bound and a weight"));
    }
    for (i, operand) in file.operand.iter().enumerate() {
        operand.check().map_err(|(key, message, hint)| {
            FileError::at_key(text, &["operand", &i.to_string(), key], message).hint(hint)
        })?;
    }
    Ok(file)
}

impl Operand {
    /// Key, message and hint of what is wrong.
    fn check(&self) -> Result<(), (&'static str, &'static str, &'static str)> {
        let is_positive = |v: Option<f64>| v.is_none_or(|v| v > 0.0 && v.is_finite());
        if !(self.weight_um > 0.0 && self.weight_um.is_finite()) {
            let hint = "100 counts one unit as much as 100 um of spot";
            return Err(("weight_um", "must be a positive number", hint));
        }
        if (self.of == Figure::Mtf) != self.frequency_per_mm.is_some() || !is_positive(self.frequency_per_mm)
        {
            let hint = "contrast has a positive frequency, such as 40.0, and no other figure has one";
            return Err(("frequency_per_mm", "does not go with this figure", hint));
        }
        if self.waves && self.of != Figure::Mtf {
            return Err(("waves", "does not go with this figure", "only contrast can include diffraction"));
        }
        if self.field_deg.is_some_and(|deg| deg.is_nan() || deg.abs() >= 180.0) {
            return Err(("field_deg", "is no field angle", "degrees from the axis"));
        }
        let bounds = [self.at_least, self.at_most];
        if bounds.iter().flatten().any(|v| !v.is_finite()) {
            return Err(("at_least", "must be a number", "a bound is finite"));
        }
        let [takes_least, takes_most] = match self.of {
            Figure::Mtf => [true, false],
            Figure::Spot | Figure::Wavefront | Figure::Track | Figure::Distortion | Figure::ChiefRayAngle => {
                [false, true]
            }
            Figure::FocalLength | Figure::BackFocalLength | Figure::ImageHeight => [true, true],
        };
        let hint = "at_least for mtf; at_most for spot, wavefront, track, distortion and chief-ray-angle; one or both for the others";
        if self.at_least.is_some() && !takes_least {
            return Err(("at_least", "the figure has no such bound", hint));
        }
        if self.at_most.is_some() && !takes_most {
            return Err(("at_most", "the figure has no such bound", hint));
        }
        if bounds.iter().all(Option::is_none) {
            return Err(("of", "the figure has not the bound that it needs", hint));
        }
        if let (Some(least), Some(most)) = (self.at_least, self.at_most)
            && least > most
        {
            return Err(("at_least", "is above at_most", "exchange the two"));
        }
        Ok(())
    }
}
