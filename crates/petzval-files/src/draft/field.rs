//! Converts every kind of field to angles in the y-z plane.

use super::record::Record;
use crate::decimal::shown;
use crate::field_weights::{MOST_FIELD_WEIGHT, WeightFault, uneven_weights};
use crate::loss::{Effect, Losses};
use petzval_base::FileError;
use petzval_optics::lens::{Action, Lens, ObjectDistance};
use petzval_optics::paraxial::{first_order, image_height_per_tangent, paraxial_ray};
use petzval_optics::pupil::field_imaged_at;

/// Meaning of the numbers of a field.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum FieldKind {
    /// Angles of the chief ray to the axis in front of the lens, degrees. Its slopes in x and y are the tangents of the two
    /// numbers.
    #[default]
    Angle,
    /// Height of the object point, mm.
    ObjectHeight,
    /// Height of the paraxial image, mm.
    ParaxialImageHeight,
    /// Height at which the chief ray lands, mm.
    RealImageHeight,
}

/// The fields of a file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fields {
    pub kind: FieldKind,
    /// x and y of each field.
    pub points: Vec<[f64; 2]>,
    pub record: Record,
    /// The record of the x of the fields.
    pub x_record: Record,
    /// The record that calls the object telecentric: the chief rays in front of the lens are parallel to the axis.
    pub telecentric: Option<Record>,
    /// The weights that the file gives the fields, and where; a field without one has 1.
    pub weights: Option<(Vec<f64>, Record)>,
}

/// How far the chief rays may be from parallel to the axis where the file says that they are parallel, rad.
const PARALLEL_RAD: f64 = 1e-3;

/// Checks that the chief rays of a telecentric object are parallel to the axis in front of the lens. They go through the middle of the stop, which
/// must stand at the focus for that; the program of the file would have traced parallel ones wherever the stop stands.
pub(super) fn check_telecentric(
    lens: &Lens,
    fields_deg: &[f64],
    record: &Record,
    losses: &mut Losses,
) -> Result<(), FileError> {
    let ObjectDistance::Finite(distance) = lens.object else {
        let message = "chief rays that are parallel in front of the lens (telecentric) need a near object";
        return Err(record.error(message));
    };
    let to_pupil = distance + first_order(&lens.at_wavelength(lens.reference_um)).entrance_pupil_at_mm;
    let highest =
        fields_deg.iter().fold(0.0_f64, |most, deg| most.max(distance * deg.to_radians().tan().abs()));
    let off_mrad = 1e3 * (highest / to_pupil).abs();
    if off_mrad > 1e3 * PARALLEL_RAD {
        let message = format!(
            "chief rays go through the middle of the stop, and those of the file are parallel to the axis in front of the lens \
             (telecentric): they differ by up to {off_mrad:.3} mrad"
        );
        let hint = match focus_behind_mm(lens) {
            Some(mm) => format!(
                "a stop at the focus of the surfaces in front of it makes them parallel: {mm:.4} mm behind the last of these"
            ),
            None => "a stop at the focus that the lens has behind the object's light makes them parallel"
                .to_owned(),
        };
        return Err(record.error(message).hint(hint));
    }
    let message = format!(
        "chief rays go through the middle of the stop, up to {off_mrad:.2e} mrad from parallel to the axis (telecentric)"
    );
    record.lose(losses, Effect::Approximated, &message);
    Ok(())
}

/// Distance of the focus of the surfaces in front of the stop from the last of them, mm, at the reference wavelength. `None` if there is none, if
/// it does not lie behind that surface, or if there are mirrors.
fn focus_behind_mm(lens: &Lens) -> Option<f64> {
    let last = lens.stop.checked_sub(1)?;
    let sequence = lens.at_wavelength(lens.reference_um);
    let parallel = paraxial_ray(&sequence, 1.0, 0.0);
    let focus_mm = -parallel.y[last] * sequence.surfaces[last].n_after / parallel.w[lens.stop];
    let has_mirrors = lens.surfaces[..=last].iter().any(|surface| surface.action == Action::Reflect);
    (focus_mm.is_finite() && focus_mm > 0.0 && !has_mirrors).then_some(focus_mm)
}

impl Fields {
    /// The weight of each field; empty if all are the same, or make no sense, which is a loss.
    fn weights(&self, losses: &mut Losses) -> Vec<f64> {
        let Some((stated, record)) = &self.weights else { return Vec::new() };
        let count = self.points.len();
        let weights: Vec<f64> = (0..count).map(|i| stated.get(i).copied().unwrap_or(1.0)).collect();
        if WeightFault::of(&weights).is_some() {
            let message = format!(
                "weights of fields below 0, above {MOST_FIELD_WEIGHT} or all 0 are not kept: all count the same"
            );
            record.lose(losses, Effect::NoRay, &message);
            return Vec::new();
        }
        uneven_weights(weights)
    }
}

/// Field angles of the lens, degrees, ascending, each once. Second: their weights; empty if all are the same. The weights of fields that are
/// mirror images add up, as both are in the merit of the file's program.
///
/// In a rotationally symmetric lens every field is turned into the y-z plane. Other lenses allow only fields in that plane:
/// another field is an error.
pub(super) fn angles_deg(
    lens: &Lens,
    fields: &Fields,
    losses: &mut Losses,
) -> Result<(Vec<f64>, Vec<f64>), FileError> {
    let record = &fields.record;
    let round = lens.is_rotationally_symmetric();
    let (mut turned, mut mirrored) = (false, false);
    let mut angles = Vec::with_capacity(fields.points.len());
    if fields.kind == FieldKind::ObjectHeight
        && lens.object == ObjectDistance::Infinity
        && fields.points.iter().any(|point| *point != [0.0; 2])
    {
        let message =
            "heights of the object need an object at a finite distance, and this one is at infinity";
        return Err(record.error(message).hint("give the fields as angles"));
    }
    let point = |x: f64, y: f64| format!("({}, {})", shown(x), shown(y));
    for &[x, y] in &fields.points {
        if x != 0.0 && !round {
            let message = format!(
                "the field {} lies off the y-z plane, and the lens is not rotationally symmetric",
                point(x, y)
            );
            return Err(fields
                .x_record
                .error(message)
                .hint("only fields in the y-z plane are traced: give every field an x of 0"));
        }
        turned |= x != 0.0;
        mirrored |= x == 0.0 && y < 0.0 && round;
        let value = match (x, fields.kind) {
            (0.0, _) if round => y.abs(),
            (0.0, _) => y,
            // Beyond 90 degrees two tangents name no direction.
            (_, FieldKind::Angle) if x.abs().max(y.abs()) >= 90.0 => f64::INFINITY,
            (_, FieldKind::Angle) => {
                let tangent = |v: f64| v.to_radians().tan();
                tangent(x).hypot(tangent(y)).atan().to_degrees()
            }
            _ => x.hypot(y),
        };
        let angle = angle_deg(lens, fields.kind, value);
        let limit_deg = lens.object.field_limit_deg();
        match angle.filter(|angle| angle.abs() < limit_deg) {
            // Turn -0 into 0 on the axis.
            Some(angle) => angles.push(angle + 0.0),
            None => {
                let message =
                    format!("no ray below {limit_deg} degrees belongs to the field {}", point(x, y));
                return Err(record.error(message));
            }
        }
    }
    if turned {
        let message = "fields off the y axis are turned into it: the lens is rotationally symmetric";
        record.lose(losses, Effect::NoRay, message);
    }
    if mirrored {
        let message = "negative fields are the mirror images of positive ones, and weights of such pairs add up: the lens is rotationally symmetric";
        record.lose(losses, Effect::NoRay, message);
    }
    let weights = fields.weights(losses);
    let weight = |i: usize| weights.get(i).copied().unwrap_or(1.0);
    let mut weighted: Vec<(f64, f64)> =
        angles.into_iter().enumerate().map(|(i, angle)| (angle, weight(i))).collect();
    weighted.sort_by(|a, b| a.0.total_cmp(&b.0));
    weighted.dedup_by(|next, kept| {
        let is_same = next.0 == kept.0;
        if is_same {
            kept.1 = (kept.1 + next.1).min(MOST_FIELD_WEIGHT);
        }
        is_same
    });
    let (angles, weights): (Vec<f64>, Vec<f64>) = weighted.into_iter().unzip();
    Ok((angles, uneven_weights(weights)))
}

/// The angle of one field as seen from the first vertex, degrees; `None` if no ray belongs to it.
fn angle_deg(lens: &Lens, kind: FieldKind, value: f64) -> Option<f64> {
    if value == 0.0 {
        return Some(0.0);
    }
    let sequence = lens.at_wavelength(lens.reference_um);
    // Seen from the first vertex, an object point at the height h has the field -atan(h / D): its light travels downwards.
    let seen = |height: f64, distance: f64| {
        let turned = if lens.is_rotationally_symmetric() { height } else { -height };
        (turned / distance).atan().to_degrees()
    };
    let angle = match (kind, lens.object) {
        (FieldKind::Angle, ObjectDistance::Infinity) => value,
        (FieldKind::Angle, ObjectDistance::Finite(_)) if value.abs() >= 90.0 => return None,
        (FieldKind::Angle, ObjectDistance::Finite(distance)) => {
            // The file's angle is measured at the entrance pupil.
            let to_pupil = distance + first_order(&sequence).entrance_pupil_at_mm;
            (value.to_radians().tan() * to_pupil / distance).atan().to_degrees()
        }
        (FieldKind::ObjectHeight, ObjectDistance::Finite(distance)) => seen(value, distance),
        (FieldKind::ObjectHeight, ObjectDistance::Infinity) => return None,
        (FieldKind::ParaxialImageHeight, _) => {
            (value / image_height_per_tangent(&sequence)).atan().to_degrees()
        }
        (FieldKind::RealImageHeight, _) => {
            let per_tangent = image_height_per_tangent(&sequence);
            let height = if lens.is_rotationally_symmetric() { value.copysign(per_tangent) } else { value };
            field_imaged_at(&sequence, height, (height / per_tangent).atan())?.to_degrees()
        }
    };
    // The fields of a round lens are counted upwards, also where a virtual object is seen from behind.
    let angle = if lens.is_rotationally_symmetric() { angle.abs() } else { angle };
    angle.is_finite().then_some(angle)
}
