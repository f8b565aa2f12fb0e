//! Operands: figures of the lens, each with a bound, as goals of the problem.
//!
//! Contrast, spots and wavefronts are traded against the spots by their weight. The bound of any other figure binds: it is a constraint of the
//! problem, and its goal has no weight but is there to be reported.

use std::sync::Arc;

use petzval_files::{Figure, Operand};
use petzval_optics::constraint::Constraint;
use petzval_optics::merit::{FieldSet, Merit, Mtf, RmsSpot, RmsWavefront, Violation};
use petzval_optics::optimize::{Goal, Problem};
use petzval_optics::psf::PsfKind;
use petzval_optics::wave::NoWaves;

use crate::error::{JobError, Result};

/// By how much a bound is taken more strictly than it stands, mm: a penalty ends a little beyond its limit, and that must be within the bound.
const INSIDE_MM: f64 = 1e-4;

/// The same for a bound that is a share or an angle, as a share of it.
const INSIDE: f64 = 1e-3;

/// What an operand adds to what is minimised: contrast and spots at every field that it means, each as a figure of its own, which descents can
/// tell apart. Its wavelengths are those of the problem. The constraint of a bound that binds comes second.
pub(super) fn goals_of(operand: &Operand, problem: &Problem) -> Result<(Vec<Goal>, Option<Constraint>)> {
    let mut lens = problem.base.clone();
    lens.wavelengths_um.clone_from(&problem.merit.wavelengths_um);
    let limit_deg = lens.object.field_limit_deg();
    let own = problem.merit.fields_rad.iter().map(|field| field.to_degrees());
    let fields_deg: Vec<f64> = operand.field_deg.map_or_else(|| own.collect(), |deg| vec![deg]);
    if let Some(deg) = fields_deg.iter().find(|deg| deg.abs() >= limit_deg) {
        let message = format!("the lens has no field of {deg} degrees");
        return Err(JobError::input(message, format!("field_deg of an operand is less than {limit_deg}")));
    }
    let goal = |merit, target| Goal { merit, target, weight_um: operand.weight_um };
    let at_each = |merit: &dyn Fn(FieldSet) -> Arc<dyn Merit>, target: f64| -> Vec<Goal> {
        fields_deg.iter().map(|deg| goal(merit(FieldSet::new(&lens, &[*deg])), target)).collect()
    };
    let field_rad = operand.field_deg.map_or(problem.merit.outermost_field_rad(), f64::to_radians);
    let [least, most] = [operand.at_least.unwrap_or(-FAR_MM), operand.at_most.unwrap_or(FAR_MM)];
    let traded = match operand.of {
        Figure::Mtf => {
            let kind = if operand.waves { PsfKind::Diffraction } else { PsfKind::Geometric };
            let mtf = Mtf::new(&lens, operand.frequency_per_mm.unwrap_or_default(), kind);
            at_each(&|fields| Arc::new(mtf.clone().with_fields(fields)), least)
        }
        Figure::Spot => {
            let spot = RmsSpot::new(&lens);
            at_each(&|fields| Arc::new(RmsSpot { fields, ..spot.clone() }), most)
        }
        Figure::Wavefront => at_each(&|fields| Arc::new(RmsWavefront { fields }), most),
        _ => Vec::new(),
    };
    let bound = |inside_mm: f64, inside: f64| {
        // A range that is no wider than the margins is aimed at in its middle.
        let margin_mm = inside_mm.min(0.5 * (most - least));
        let between_mm = [least + margin_mm, most - margin_mm];
        match operand.of {
            Figure::Mtf | Figure::Spot | Figure::Wavefront => None,
            Figure::FocalLength => Some(Constraint::FocalLength { between_mm }),
            Figure::BackFocalLength => Some(Constraint::BackFocal { between_mm }),
            Figure::Track => Some(Constraint::Track { most_mm: most - inside_mm }),
            Figure::Distortion => Some(Constraint::Distortion { field_rad, share: most * (1.0 - inside) }),
            Figure::ChiefRayAngle => {
                let greatest_rad = (most * (1.0 - inside)).to_radians();
                Some(Constraint::ChiefRayAngle { field_rad, greatest_rad })
            }
            Figure::ImageHeight => {
                let [low, high] = between_mm;
                let (wanted_mm, tolerance_mm) = (0.5 * (low + high), 0.5 * (high - low));
                Some(Constraint::ChiefHeight { field_rad, wanted_mm, tolerance_mm })
            }
        }
    };
    let as_it_stands = bound(0.0, 0.0);
    let reported =
        as_it_stands.map(|bound| Goal { merit: Arc::new(Violation(bound)), target: 0.0, weight_um: 0.0 });
    let goals: Vec<Goal> = traded.into_iter().chain(reported).collect();
    if let Some(lost) = goals.iter().find(|goal| goal.merit.value(&lens).is_none()) {
        let name = lost.merit.name();
        let is_by_waves = operand.waves || operand.of == Figure::Wavefront;
        if let Some(no_waves) = NoWaves::of(&lens).filter(|_| is_by_waves) {
            let hint = match operand.of {
                Figure::Mtf => "leave `waves` out: contrast by rays",
                _ => "leave the operand out: spots need no waves",
            };
            return Err(JobError::input(format!("{name}: {no_waves}"), hint));
        }
        let message = format!("{name}: the lens to start from has no such figure");
        return Err(JobError::input(message, "improve its spots first, or leave the operand out"));
    }
    Ok((goals, bound(INSIDE_MM, INSIDE)))
}

/// A constraint of a problem as it stands in its file: the bound of an operand is taken a little more strictly.
pub(super) fn as_it_stands(problem: &Problem, what: &Constraint) -> Constraint {
    // The operands that bind are in the same order in both.
    let stated = problem.goals.iter().filter_map(|goal| goal.merit.bound());
    let mut pairs = problem.further.iter().zip(stated);
    pairs.find(|(taken, _)| *taken == what).map_or(*what, |(_, stated)| *stated)
}

/// A bound that no lens meets.
const FAR_MM: f64 = 1e6;
