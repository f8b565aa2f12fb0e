//! Aperture, fields and wavelengths.

use petzval_base::FileError;

use super::object::Object;
use crate::decimal::{shifted, shown};
use crate::draft::{Aperture, FieldKind, Fields, MOST_VALUES, Record, Wave, Wavelengths};
use crate::loss::{Effect, Losses};
use crate::wavelength::WavelengthUnit;

/// Keys of a field.
const FIELD_KEYS: &[&str] = &["field_type", "x", "y", "vx", "vy", "weight"];

/// Keys of a wavelength.
const WAVELENGTH_KEYS: &[&str] = &["value", "is_primary", "unit", "weight"];

/// The aperture. The program's image-space f-number is the focal length over the entrance pupil, whatever the conjugates; the stop's size is
/// a diameter.
pub(super) fn aperture(root: &Object<'_>) -> Result<(Aperture, Record), FileError> {
    let aperture = root.needed_object("aperture")?;
    let kind = aperture.needed_text("type")?;
    let value = aperture.needed_number("value")?;
    if !(value > 0.0 && value.is_finite()) {
        return Err(aperture.error("value", "the aperture must be positive"));
    }
    let read = match kind {
        "EPD" => Aperture::EntrancePupil(value),
        "imageFNO" => Aperture::FNumber(value),
        "objectNA" => Aperture::ObjectNa(value),
        "float_by_stop_size" => Aperture::StopRadius(0.5 * value),
        _ => {
            let error = aperture.error("type", "apertures of this type are not read");
            return Err(error.hint("EPD, imageFNO, objectNA and float_by_stop_size are"));
        }
    };
    Ok((read, aperture.record(&format!("{kind} {}", shown(value)))))
}

/// The fields.
pub(super) fn fields(root: &Object<'_>, losses: &mut Losses) -> Result<Fields, FileError> {
    let group = root.needed_object("fields")?;
    let mut telecentric = telecentric(&group)?;
    if telecentric.is_none() {
        telecentric = self::telecentric(&root.needed_object("aperture")?)?;
    }
    // Newer versions name the class, older ones its registered name.
    let definition = group.object("field_definition")?;
    let holder = definition.unwrap_or(group);
    let kind = match holder.needed_text("field_type")? {
        "angle" | "AngleField" => FieldKind::Angle,
        "object_height" | "ObjectHeightField" => FieldKind::ObjectHeight,
        "paraxial_image_height" | "ParaxialImageHeightField" => FieldKind::ParaxialImageHeight,
        "real_image_height" | "RealImageHeightField" => FieldKind::RealImageHeight,
        _ => {
            let error = holder.error("field_type", "fields of this type are not read");
            return Err(error.hint("angle, object_height, paraxial_image_height and real_image_height are"));
        }
    };
    let listed = group.list("fields")?;
    if listed.len() > MOST_VALUES {
        return Err(group.error("fields", format!("a lens with more than {MOST_VALUES} fields is not read")));
    }
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for node in listed {
        let field = Object::new(node, "fields")?;
        field.report_others(FIELD_KEYS, losses);
        let of = |key: &str| field.number(key).map(|value| value.unwrap_or(0.0));
        let point = [of("x")?, of("y")?];
        if point.iter().any(|v| !v.is_finite()) {
            return Err(field.error("y", "a field must be finite"));
        }
        if of("vx")? != 0.0 || of("vy")? != 0.0 {
            let message = "vignetting factors are not read: clear semi-diameters vignette the beam";
            losses.add(field.line("vx"), "vx, vy", Effect::Approximated, message);
        }
        points.push(point);
        weights.push(field.number("weight")?.unwrap_or(1.0));
    }
    if points.is_empty() {
        losses.assume("the file gives no fields; the axis is the only one");
        points.push([0.0; 2]);
    }
    let record = group.record("fields");
    let weights = Some((weights, Record::new(group.line("fields"), "weight")));
    Ok(Fields { kind, points, x_record: record.clone(), record, telecentric, weights })
}

/// The record by which an object of the file calls the lens telecentric.
fn telecentric(object: &Object<'_>) -> Result<Option<Record>, FileError> {
    for key in ["telecentric", "object_space_telecentric"] {
        if object.flag(key)? {
            return Ok(Some(Record::new(object.line(key), &format!("{key} = true"))));
        }
    }
    Ok(None)
}

/// The wavelengths, and the index of the primary one: the last that is marked, or the first.
pub(super) fn wavelengths(root: &Object<'_>, losses: &mut Losses) -> Result<(Wavelengths, usize), FileError> {
    let group = root.needed_object("wavelengths")?;
    if group.has("polarization") && group.text("polarization").ok().flatten() != Some("ignore") {
        losses.add(group.line("polarization"), "polarization", Effect::NoRay, "polarisation is not traced");
    }
    let listed = group.list("wavelengths")?;
    if listed.is_empty() || listed.len() > MOST_VALUES {
        return Err(group.error("wavelengths", format!("a lens has 1 to {MOST_VALUES} wavelengths")));
    }
    let (mut list, mut primary) = (Vec::new(), 0);
    for (i, node) in listed.iter().enumerate() {
        let wave = Object::new(node, "wavelengths")?;
        wave.report_others(WAVELENGTH_KEYS, losses);
        let unit = match wave.text("unit")?.unwrap_or("um").to_lowercase().as_str() {
            "nm" => WavelengthUnit::NM,
            "um" => WavelengthUnit::UM,
            "mm" => WavelengthUnit { name: "mm", power: 3 },
            "cm" => WavelengthUnit { name: "cm", power: 4 },
            "m" => WavelengthUnit { name: "m", power: 6 },
            _ => return Err(wave.error("unit", "no such unit").hint("nm, um, mm, cm and m are known")),
        };
        let text = wave.needed_text("value")?;
        let um = shifted(text, unit.power).ok_or_else(|| wave.error("value", "expected a number"))?;
        let weight = wave.number("weight")?.unwrap_or(1.0);
        let record = Record::new(wave.line("value"), &format!("value = {text}"));
        list.push(Wave { um, weight, unit, record });
        if wave.flag("is_primary")? {
            primary = i;
        }
    }
    Ok((Wavelengths { list, record: group.record("wavelengths") }, primary))
}
