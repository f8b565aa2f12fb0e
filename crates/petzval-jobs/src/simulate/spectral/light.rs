//! The light of a run in a set of bands: the electrons of white, the balance of the sensor, the colour matrix.

use std::path::Path;

use petzval_camera::sensor::{Colour, SensorError, SensorModel};
use petzval_camera::spectral::{
    ColourMatrix, Spectrum, ThreeBand, band_weights, bands_within, even_bands, fit_colour_matrix,
    share_outside, white_range_um,
};
use petzval_design::error::DesignError;
use petzval_design::lens::psf_plan::PsfPlan;
use petzval_files::raw_file::shortest;
use serde_json::{Map, Value, json};

use super::super::request::Request;
use super::super::rig::Rig;
use super::conditions::Conditions;
use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;

/// Bands of scenes and photographs are at most so far apart, um, and at least so many, unless --bands gives another number.
const BAND_STEP_UM: f64 = 0.020;
const LEAST_BANDS: usize = 16;
/// Share of the electrons of white from whose loss on there is a warning; and share of its peak at which a curve is not at its end yet.
const WARNED_SHARE: f64 = 0.01;
/// Largest share of the electrons of white that is left out because the lens forms no image at the ends of the spectrum; with more, the
/// simulation fails there.
const MOST_CUT: f64 = 0.05;
/// Step in which an end of the bands moves towards the middle, um, and the wavelengths within which every lens has to form an image.
const CUT_STEP_UM: f64 = 0.010;
const MIDDLE_UM: (f64, f64) = (0.45, 0.65);
/// Electrons of white that a simulation can be made for.
const WHITE_E: std::ops::RangeInclusive<f64> = 1e-6..=1e9;

/// Everything that follows from light, lens and sensor in a set of bands.
pub struct Light {
    pub band_um: Vec<f64>,
    /// Electrons per unit radiance of each colour and band.
    pub weights: Vec<(Colour, Vec<f64>)>,
    pub white: ThreeBand,
    /// The sensor, balanced for the light.
    pub sensor: SensorModel,
    pub matrix: Option<ColourMatrix>,
    /// Share of the electrons of white that these bands leave out.
    left_out: f64,
    /// Whether they leave out ends of the spectrum at which the lens forms no image on its PSFs' grid.
    is_cut: bool,
}

impl Light {
    /// Even bands over all wavelengths at which light, lens and sensor have something.
    pub fn over_all(request: &Request, conditions: &Conditions, rig: &Rig) -> Result<Self> {
        let range = white_range_um(&rig.sensor, &conditions.optics, &conditions.illuminant)
            .map_err(DesignError::from)?;
        let (range, is_cut) = imaged_range(request, conditions, rig, range)?;
        let count = request.spectral.bands.unwrap_or(bands_within(range, BAND_STEP_UM).max(LEAST_BANDS));
        let light = Self::new(conditions, rig, even_bands(range.0, range.1, count))?;
        light.check_white(request, conditions)?;
        Ok(Self { is_cut, ..light })
    }

    /// The bands of a file: white is what can be seen of it there.
    pub fn in_file(
        request: &Request,
        conditions: &Conditions,
        rig: &Rig,
        path: &Path,
        band_um: &[f64],
    ) -> Result<Self> {
        let light = Self::new(conditions, rig, band_um.to_vec()).map_err(|error| {
            JobError::input(
                format!("{}: in its bands, {}, {error}", path.display(), range_nm(band_um)),
                "light, lens and pixels need wavelengths in common with the bands of the file",
            )
        })?;
        light.check_white(request, conditions)?;
        Ok(light)
    }

    fn new(conditions: &Conditions, rig: &Rig, band_um: Vec<f64>) -> Result<Self, DesignError> {
        let (sensor, optics, illuminant) = (&rig.sensor, &conditions.optics, &conditions.illuminant);
        let weights = band_weights(sensor, optics, &band_um)?;
        let white = ThreeBand::new(sensor, optics, illuminant, conditions.lux, &band_um)?;
        let matrix = fit_colour_matrix(sensor, optics, illuminant, &band_um)?;
        let range = (band_um[0], band_um[band_um.len() - 1]);
        let left_out = share_outside(sensor, optics, illuminant, range)?;
        let sensor = white.balanced(sensor);
        sensor.validate().map_err(SensorError::from)?;
        Ok(Self { band_um, weights, white, sensor, matrix, left_out, is_cut: false })
    }

    /// Refuses light that is nothing, or too much, for any sensor.
    fn check_white(&self, request: &Request, conditions: &Conditions) -> Result<()> {
        let white_e = self.white.white_e();
        if WHITE_E.contains(&white_e) {
            return Ok(());
        }
        let what = format!(
            "white gives {white_e:.2e} electrons under {:e} lux (--illuminance-lux) in {} s (--time-s)",
            conditions.lux, request.time_s
        );
        Err(JobError::input(
            what,
            format!("light and time must give {:e} to {:e} electrons", WHITE_E.start(), WHITE_E.end()),
        ))
    }

    /// Warns of light that these bands leave out, and where the lens is traced outside the range of its glasses.
    /// `whose` is the file that the bands are of.
    pub fn warn(&self, conditions: &Conditions, rig: &Rig, whose: Option<&Path>, context: &Context) {
        if self.is_cut {
            context.warning(WarningKind::Spectrum, format!(
                "{}: at the ends of the spectrum the lens forms no image that fits its PSFs; the bands, {}, leave out {:.2} % of the electrons that white would give",
                conditions.lens.name,
                range_nm(&self.band_um),
                100.0 * self.left_out
            ));
        } else if self.left_out > WARNED_SHARE {
            let file = whose.map(|path| format!("{}: ", path.display())).unwrap_or_default();
            context.warning(
                WarningKind::Spectrum,
                format!(
                    "{file}the bands, {}, leave out {:.1} % of the electrons that white would give",
                    range_nm(&self.band_um),
                    100.0 * self.left_out
                ),
            );
        }
        if whose.is_none() {
            warn_of_cut_light(conditions, &rig.sensor, context);
        }
        let seen = |band: &usize| self.weights.iter().any(|(_, weight)| weight[*band] > 0.0);
        let seen: Vec<f64> = (0..self.band_um.len()).filter(seen).map(|band| self.band_um[band]).collect();
        conditions.warn_of_glasses(&seen, context);
    }

    /// What the light gives, for the JSON of an image.
    pub fn facts(&self, request: &Request, conditions: &Conditions) -> Map<String, Value> {
        let white_of: Map<String, Value> = (self.white.rows.iter())
            .map(|(colour, row)| (colour.letter().to_string(), json!(row.iter().sum::<f64>())))
            .collect();
        let matrix = self.matrix.as_ref().filter(|_| !request.spectral.no_colour_matrix);
        let facts = [
            ("illuminant", json!(conditions.illuminant.name)),
            ("illuminance_lux", json!(conditions.lux)),
            ("f_number", json!(conditions.optics.f_number)),
            ("time_s", json!(shortest(request.time_s))),
            ("bands_um", json!(self.band_um)),
            ("share_left_out", json!(self.left_out)),
            ("three_band", json!(request.spectral.three_band)),
            ("white_e", json!(self.white.white_e())),
            ("white_e_by_colour", json!(white_of)),
            ("relative_qe", json!(self.sensor.relative_qe)),
            (
                "colour_matrix",
                json!(matrix.map(|m| json!({
                    "linear_srgb_from_camera": m.matrix,
                    "mean_delta_e_1976": m.mean_delta_e,
                    "worst_delta_e_1976": m.worst_delta_e,
                }))),
            ),
        ];
        facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
    }

    /// What the light gives, for a person.
    pub fn says(&self, request: &Request, conditions: &Conditions) -> String {
        let mut says = format!(
            "white under {} lux of {} gives {:.0} electrons in {} at f/{:.2} in {} s, times the relative illumination of the lens",
            (1e3 * conditions.lux).round() / 1e3,
            conditions.illuminant.name,
            self.white.white_e(),
            if self.white.rows.len() > 1 { "a green pixel" } else { "a pixel" },
            conditions.optics.f_number,
            request.time_s,
        );
        let coloured = [Colour::Red, Colour::Green, Colour::Blue]
            .iter()
            .all(|colour| self.white.white_of(*colour).is_some());
        match &self.matrix {
            _ if request.spectral.no_colour_matrix => {}
            Some(matrix) => says.push_str(&format!(
                "; the colour matrix shows the ColorChecker with a mean dE*ab of {:.1}, at most {:.1}",
                matrix.mean_delta_e, matrix.worst_delta_e
            )),
            None if coloured => {
                says.push_str("; there is no colour matrix: the curves of the pixels tell no colours apart");
            }
            None => {}
        }
        says
    }
}

/// Warns where the table of a light or of a transmission ends while the other lets light through and the pixels
/// would see it.
fn warn_of_cut_light(conditions: &Conditions, sensor: &SensorModel, context: &Context) {
    let light = (conditions.illuminant.name.as_str(), &conditions.illuminant.power);
    let passes = conditions.optics.transmission.as_ref().map(|tau| ("the transmission", tau));
    let sees = |um: f64| {
        let curves = sensor.quantum_efficiency.as_ref();
        let at = |colour: &Colour| curves.and_then(|c| c.curve(*colour)).map_or(0.0, |c| c.at(um));
        sensor.cfa.colours().iter().any(|colour| at(colour) > WARNED_SHARE)
    };
    let has_light = |(_, curve): (&str, &Spectrum), um: f64| {
        curve.at(um) > WARNED_SHARE * curve.value().iter().copied().fold(0.0, f64::max)
    };
    for (ends, other) in [(Some(light), passes), (passes, Some(light))] {
        let Some(ends) = ends else { continue };
        let (first, last) = ends.1.range_um();
        for (um, beyond_um) in [(first, first - 1e-3), (last, last + 1e-3)] {
            if has_light(ends, um) && sees(beyond_um) && other.is_none_or(|other| has_light(other, beyond_um))
            {
                context.warning(WarningKind::Spectrum, format!(
                    "nothing is known of {} beyond {:.0} nm, where the pixels still see: that light is not counted",
                    ends.0,
                    1000.0 * um
                ));
            }
        }
    }
}

fn range_nm(band_um: &[f64]) -> String {
    format!("{:.0} to {:.0} nm", 1000.0 * band_um[0], 1000.0 * band_um[band_um.len() - 1])
}

/// The part of a range of wavelengths, um, in which the lens forms an image on its PSFs' grid, and whether that is less than all. All of it
/// where the rest has too much of the light: then the simulation says which bands fail.
fn imaged_range(
    request: &Request,
    conditions: &Conditions,
    rig: &Rig,
    range: (f64, f64),
) -> Result<((f64, f64), bool)> {
    if request.spectral.three_band {
        return Ok((range, false));
    }
    let is_imaged = |um: f64| {
        let plan = PsfPlan { wavelengths_um: [um; 3], ..conditions.plan.clone() };
        plan.bank(&conditions.lens).is_ok()
    };
    let (mut low, mut high) = range;
    while low < MIDDLE_UM.0 && !is_imaged(low) {
        low += CUT_STEP_UM;
    }
    while high > MIDDLE_UM.1 && !is_imaged(high) {
        high -= CUT_STEP_UM;
    }
    let (sensor, optics, illuminant) = (&rig.sensor, &conditions.optics, &conditions.illuminant);
    let is_cut = (low, high) != range;
    if !is_cut || low >= high {
        return Ok((range, false));
    }
    let share = share_outside(sensor, optics, illuminant, (low, high)).map_err(DesignError::from)?;
    Ok(if share <= MOST_CUT { ((low, high), true) } else { (range, false) })
}
