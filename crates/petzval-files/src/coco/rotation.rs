//! Rotations of boxes: which keys of a label state one, and in which unit.
//!
//! The attribute `rotation`, in small letters or capitals, is the angle in degrees by which a box is rotated about its middle, as CVAT writes it.
//! That holds in every format, because a converted data set is read again with its attributes. No format states the unit of other angles, nor
//! whether they are of the box. As attributes they are counted as not read; within a box they are errors.

use std::collections::BTreeMap;

use super::data_set::Attribute;
use super::loose::Loose;

/// The attribute of CVAT.
const ROTATION: &str = "rotation";

/// Words in the names of angles.
const ANGLES: [&str; 6] = ["angle", "rot", "rotate", "rotated", ROTATION, "theta"];

/// What is wrong with a box that states an angle.
pub(super) const NO_UNIT: &str = "the box states an angle, and nothing says in which unit";

/// What to do with a box that states an angle.
pub(super) const UNIT_HINT: &str = "write it as the attribute `rotation`: degrees about the middle of the box; or take it out if the box is upright";

/// Whether an attribute of this name is the rotation of a box in degrees.
pub(super) fn is_rotation(name: &str) -> bool {
    name.trim().eq_ignore_ascii_case(ROTATION)
}

/// Whether a key of this name may be an angle.
pub(super) fn is_angle(name: &str) -> bool {
    let mut words = name.split(|c: char| !c.is_alphanumeric());
    words.any(|word| ANGLES.iter().any(|angle| word.eq_ignore_ascii_case(angle)))
}

/// Whether an attribute of this name may be an angle, but not the one that is read.
pub(super) fn is_other_angle(name: &str) -> bool {
    is_angle(name) && !is_rotation(name)
}

/// Whether a value for an angle rotates nothing.
pub(super) fn is_zero(value: &Loose) -> bool {
    matches!(value, Loose::Absent | Loose::Flag(false)) || value.number() == Ok(0.0)
}

/// Takes the rotation of a box out of its attributes, degrees; `None` where the box is upright. Fails with the value if that is no number, or if two
/// attributes differ.
pub(super) fn take_rotation_deg(attributes: &mut BTreeMap<String, Attribute>) -> Result<Option<f64>, String> {
    let mut found: Option<f64> = None;
    for (name, value) in attributes.iter().filter(|(name, _)| is_rotation(name)) {
        let Attribute::Number(degrees) = value else { return Err(value.to_string()) };
        if let Some(other) = found.filter(|other| other != degrees) {
            return Err(format!("{other}, and `{name}` is {degrees}"));
        }
        found = Some(*degrees);
    }
    attributes.retain(|name, _| !is_rotation(name));
    Ok(found.filter(|degrees| degrees % 360.0 != 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_angles_are_whole_words() {
        for name in ["angle", "Angle", "rotation_deg", "box theta", "ROT"] {
            assert!(is_other_angle(name), "{name}");
        }
        for name in ["rectangle", "triangle", "orientation", "rotten", ""] {
            assert!(!is_angle(name), "{name}");
        }
        assert!(is_rotation("Rotation") && is_angle("Rotation") && !is_other_angle("Rotation"));
    }

    #[test]
    fn a_rotation_is_a_number_of_degrees_and_is_taken_out() {
        let take = |entries: &[(&str, Attribute)]| {
            let entries = entries.iter().map(|(name, value)| ((*name).to_owned(), value.clone()));
            let mut attributes: BTreeMap<String, Attribute> = entries.collect();
            let taken = take_rotation_deg(&mut attributes);
            (taken, attributes.len())
        };
        let number = Attribute::Number;
        let parked = || ("parked", Attribute::Flag(true));
        assert_eq!(take(&[parked()]), (Ok(None), 1));
        assert_eq!(take(&[parked(), ("Rotation", number(30.0))]), (Ok(Some(30.0)), 1));
        assert_eq!(take(&[parked(), ("rotation", number(-360.0))]), (Ok(None), 1));
        assert_eq!(take(&[("rotation", number(30.0)), ("ROTATION", number(30.0))]), (Ok(Some(30.0)), 0));
        let two = take(&[("rotation", number(30.0)), ("Rotation", number(40.0))]).0;
        assert_eq!(two, Err("40, and `rotation` is 30".to_owned()));
        assert_eq!(take(&[("rotation", Attribute::Text("30,5".to_owned()))]).0, Err("\"30,5\"".to_owned()));
    }
}
