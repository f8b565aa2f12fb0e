//! Figures of a lens that an optimisation reports.

use std::collections::BTreeSet;

use petzval_optics::analysis::first_order_table;
use petzval_optics::constraint::{Constraint, SemiDiameters, Stated};
use petzval_optics::lens::Lens;
use petzval_optics::optimize::{Analysis, Goal as MeritGoal, Problem};
use petzval_optics::paraxial::{first_order, image_height_per_tangent, rectilinear_tangent};
use petzval_optics::pupil::chief_ray;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::operand::as_it_stands;
use crate::finite::finite;

/// A limit counts as violated from here, mm.
pub(super) const VIOLATED_MM: f64 = 1e-4;

/// The bound of contrast, a spot or a wavefront counts as missed from this share of it.
const MISSED: f64 = 1e-4;

/// Spots of so many times those of the start are worth a warning where requirements are not met.
const COSTLY: f64 = 10.0;

/// Figures of a lens.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Figures {
    /// Root of the expected squared error after the best linear restoration, % of white; `None` unless that is the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restored_error_percent: Option<f64>,
    /// Operands: what each is, its value, its target and its unit.
    #[serde(default)]
    pub operands: Vec<OperandFigure>,
    /// Mean over the fields of the RMS spot radius, um.
    pub mean_rms_spot_um: f64,
    /// RMS spot radius by field, um.
    pub rms_spot_um: Vec<f64>,
    /// Focal length, mm.
    pub focal_length_mm: Option<f64>,
    /// From the last vertex to the rear focal point, mm; positive in the direction of the light.
    pub back_focal_length_mm: Option<f64>,
    /// Focal length over entrance pupil diameter.
    pub f_number: Option<f64>,
    /// Height of the image over that of the object; `None` for an object at infinity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub magnification: Option<f64>,
    /// Length with the image plane, mm, see [`petzval_optics::lens::Lens::track_mm`].
    pub track_to_the_image_mm: f64,
    /// Largest clear diameter of a surface, mm: what the beams need, and the margin of the mount.
    pub largest_clear_diameter_mm: f64,
    /// Distortion at the outermost field; `None` without such a field, or without rotational symmetry.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion_percent: Option<f64>,
    /// Limits that are violated, and by how much, mm: diameters by their radius, distortions on the image, a slope as its tangent times the clear
    /// radius, a chief ray's as its tangent times the back focal length.
    pub violations_mm: Vec<(String, f64)>,
    /// The same limits in words: the figure and its bound, in the unit of the bound.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub violations: Vec<String>,
}

/// Whether a goal is the error after restoration, and no operand.
pub(super) fn is_restored(goal: &MeritGoal) -> bool {
    goal.merit.unit() == "% of white"
}

/// What a lens reaches of an operand. Of a figure that is bounded on both sides this is by how much it is beyond its bounds, and the target 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OperandFigure {
    /// The figure.
    pub of: String,
    /// Its value.
    pub value: f64,
    /// Its bound.
    pub target: f64,
    /// The unit of both.
    pub unit: String,
    /// By how much it misses its bound, in its unit; 0 where it keeps it.
    #[serde(default)]
    pub missed_by: f64,
    /// The figure itself and its bound, where the value is how far it is missed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached: Option<Reached>,
}

/// A bounded figure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reached {
    /// Its value.
    pub value: f64,
    /// Its bound in words, in the same unit.
    pub bound: String,
    /// The unit of both.
    pub unit: String,
}

impl From<Stated> for Reached {
    fn from(Stated { value, unit, bound }: Stated) -> Self {
        Self { value, bound, unit: unit.to_owned() }
    }
}

/// A limit that a lens with fitted apertures violates by a length, mm: the figure and its bound.
pub(super) fn violation_in_words(
    problem: &Problem,
    what: &Constraint,
    fitted: &Lens,
    excess_mm: f64,
) -> String {
    match stated(&as_it_stands(problem, what), fitted) {
        Some(Stated { value, unit, bound }) => format!("{what}: {value:.4} {unit}, {bound}"),
        None => format!("{what}, by {excess_mm:.4} mm"),
    }
}

/// What a lens with fitted apertures reaches of a constraint, at these apertures.
fn stated(bound: &Constraint, fitted: &Lens) -> Option<Stated> {
    bound.stated(fitted, bound.excess_mm(fitted, &SemiDiameters(fitted))?)
}

impl Figures {
    /// The limits and the bounds of operands that it does not keep, each with by how much.
    pub fn missed(&self) -> Vec<String> {
        let limits = self.violations_mm.iter().enumerate().filter(|(_, (_, mm))| *mm > VIOLATED_MM);
        let in_words = |(i, (what, mm)): (usize, &(String, f64))| {
            self.violations.get(i).cloned().unwrap_or_else(|| format!("{what}, by {mm:.4} mm"))
        };
        let limits = limits.map(in_words);
        // The bound of a length is among the limits.
        let is_traded = |o: &&OperandFigure| o.unit != "mm" && o.missed_by > MISSED * o.target.abs();
        let of_operand = |o: &OperandFigure| {
            let OperandFigure { of, value, target, unit, .. } = o;
            format!("{of}: {value:.4} for {target:.4} {unit}").trim_end().to_owned()
        };
        limits.chain(self.operands.iter().filter(is_traded).map(of_operand)).collect()
    }

    /// A warning where requirements are not met and the mean spot is at least [`COSTLY`] times that of the lens at the start.
    pub(super) fn cost_of_missed(&self, start: &Self) -> Option<String> {
        let (before_um, now_um) = (start.mean_rms_spot_um, self.mean_rms_spot_um);
        let is_costly = before_um > 0.0 && now_um >= COSTLY * before_um && !self.missed().is_empty();
        is_costly.then(|| {
            format!(
                "requirements that are not met leave a mean spot of {now_um:.1} um, {:.0} times that of the start: loosen one of them or leave one out",
                now_um / before_um
            )
        })
    }

    /// The limits that hold it: those which a penalty keeps, a hair beyond.
    pub fn reached(&self) -> Vec<String> {
        let held = self.violations_mm.iter().filter(|(_, mm)| *mm <= VIOLATED_MM);
        held.map(|(what, _)| what.clone()).collect()
    }

    /// Every figure by name, value and unit, for the fields that the spots belong to.
    pub fn rows(&self, fields_deg: &[f64]) -> Vec<(String, Option<f64>, &'static str)> {
        let restored = self
            .restored_error_percent
            .map(|e| ("error after restoration".to_owned(), Some(e), "% of white"));
        let mut rows: Vec<_> = restored.into_iter().collect();
        let unit = |unit: &str| {
            ["mm", "um", "waves", "%", "degrees"].into_iter().find(|known| *known == unit).unwrap_or("")
        };
        let row = |o: &OperandFigure| match &o.reached {
            Some(reached) => {
                (format!("{}, {}", o.of, reached.bound), Some(reached.value), unit(&reached.unit))
            }
            None => (o.of.clone(), Some(o.value), unit(&o.unit)),
        };
        rows.extend(self.operands.iter().map(row));
        rows.push(("mean RMS spot".to_owned(), Some(self.mean_rms_spot_um), "um"));
        let digits = digits_apart(fields_deg);
        for (field, rms) in fields_deg.iter().zip(&self.rms_spot_um) {
            rows.push((format!("RMS spot at {field:.digits$} deg"), Some(*rms), "um"));
        }
        rows.push(("focal length".to_owned(), self.focal_length_mm, "mm"));
        rows.push(("back focal length".to_owned(), self.back_focal_length_mm, "mm"));
        rows.push(("f-number".to_owned(), self.f_number, ""));
        if let Some(magnification) = self.magnification {
            rows.push(("magnification".to_owned(), Some(magnification), ""));
        }
        rows.push(("track to the image".to_owned(), Some(self.track_to_the_image_mm), "mm"));
        rows.push(("largest clear diameter".to_owned(), Some(self.largest_clear_diameter_mm), "mm"));
        rows.push(("distortion".to_owned(), self.distortion_percent, "%"));
        rows
    }

    /// The figures of a lens under a problem.
    pub(super) fn new(problem: &Problem, analysis: &Analysis) -> Self {
        // The lens is that of its file, whose spots are the same to `lens show`.
        let lens = &analysis.fitted_lens(problem);
        let rms_um = analysis.rms_of_light_um(problem, lens).unwrap_or_else(|| analysis.rms_um.clone());
        let sequence = lens.at_wavelength(lens.reference_um);
        let order = first_order(&sequence);
        let widest = lens.surfaces.iter().fold(0.0_f64, |w, s| w.max(2.0 * s.semi_diameter_mm));
        let violations = analysis.violations_as_written(problem, lens);
        let outermost = problem.merit.outermost_field_rad();
        let chief = (outermost != 0.0 && lens.is_rotationally_symmetric())
            .then(|| chief_ray(&sequence, outermost))
            .flatten();
        let goals = || problem.goals.iter().zip(analysis.goals.iter().copied());
        let figure = |(goal, value): (&MeritGoal, f64)| OperandFigure {
            of: goal.merit.name(),
            value,
            target: goal.target,
            missed_by: goal.merit.better().loss(value, goal.target).max(0.0),
            reached: goal.merit.bound().and_then(|bound| stated(bound, lens)).map(Reached::from),
            unit: goal.merit.unit().to_owned(),
        };
        let operands = goals().filter(|(goal, _)| !is_restored(goal)).map(figure).collect();
        let distortion = chief
            .map(|c| c.y_mm / (image_height_per_tangent(&sequence) * rectilinear_tangent(outermost)) - 1.0);
        Self {
            restored_error_percent: goals().find(|(goal, _)| is_restored(goal)).map(|(_, percent)| percent),
            operands,
            mean_rms_spot_um: rms_um.iter().sum::<f64>() / rms_um.len() as f64,
            rms_spot_um: rms_um,
            focal_length_mm: finite(order.efl_mm),
            back_focal_length_mm: finite(lens.away_from_lens_mm(order.bfl_mm)),
            f_number: finite(order.f_number),
            magnification: first_order_table(lens).magnification,
            track_to_the_image_mm: lens.track_mm(),
            largest_clear_diameter_mm: widest,
            distortion_percent: distortion.map(|share| 100.0 * share).and_then(finite),
            violations: violations
                .iter()
                .map(|(what, mm)| violation_in_words(problem, what, lens, *mm))
                .collect(),
            violations_mm: violations.into_iter().map(|(what, mm)| (what.to_string(), mm)).collect(),
        }
    }
}

/// Digits behind the point, from one to four, with which no two fields look the same: telescopes see hundredths of a degree.
fn digits_apart(fields_deg: &[f64]) -> usize {
    let are_apart = |digits: &usize| {
        let digits = *digits;
        let shown: BTreeSet<String> = fields_deg.iter().map(|deg| format!("{deg:.digits$}")).collect();
        shown.len() == fields_deg.len()
    };
    (1..=4).find(are_apart).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::digits_apart;

    #[test]
    fn fields_look_different() {
        assert_eq!(digits_apart(&[0.0, 14.245_905, 19.567_665]), 1);
        assert_eq!(digits_apart(&[0.0, 0.05, 0.1]), 2);
        assert_eq!(digits_apart(&[0.0, 0.004]), 3);
        assert_eq!(digits_apart(&[5.0, 5.0]), 1);
    }
}
