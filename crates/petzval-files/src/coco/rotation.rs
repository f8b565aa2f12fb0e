//! Rotations of boxes: which keys of a label state one, and in which unit.
//!
//! The attribute `rotation` is the angle in degrees by which a box is rotated about its middle, as CVAT writes it. Without it, a number of another
//! spelling (`Rotation`) is. That holds in every format, because a converted data set is read again with its attributes. No format states the unit of
//! other angles, nor whether they are of the box. As attributes they are counted as not read; within a box they are errors.

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

/// Whether an attribute of this name is the rotation of a box in degrees, whatever its value.
pub(super) fn is_rotation(name: &str) -> bool {
    name.trim() == ROTATION
}

/// Whether an attribute has the name in other letters. It may be another fact of the user's own.
fn is_other_spelling(name: &str) -> bool {
    name.trim().eq_ignore_ascii_case(ROTATION) && !is_rotation(name)
}

/// Whether a key of this name may be an angle.
pub(super) fn is_angle(name: &str) -> bool {
    let signs = name.split(|c: char| !c.is_alphanumeric());
    signs.flat_map(words).any(|word| ANGLES.iter().any(|angle| word.eq_ignore_ascii_case(angle)))
}

/// Names of those attributes of a label that may be angles and are not read.
pub(super) fn unread_angles<'a>(
    attributes: impl IntoIterator<Item = (&'a String, &'a Loose)>,
) -> impl Iterator<Item = &'a str> {
    let all: Vec<(&str, &Loose)> =
        attributes.into_iter().map(|(name, value)| (name.as_str(), value)).collect();
    let is_stated = all.iter().any(|(name, value)| is_rotation(name) && **value != Loose::Absent);
    let is_read = move |name: &str, value: &Loose| {
        is_rotation(name) || is_other_spelling(name) && !is_stated && is_number(value)
    };
    all.into_iter()
        .filter(move |(name, value)| is_angle(name) && !is_read(name, value) && !is_zero(value))
        .map(|(name, _)| name)
}

fn is_number(value: &Loose) -> bool {
    matches!(value, Loose::Whole(_)) || matches!(value, Loose::Number(value) if value.is_finite())
}

/// The words of a name such as `rotationAngle`: each begins with a capital behind a small letter.
fn words(name: &str) -> impl Iterator<Item = &str> {
    let mut rest = name;
    std::iter::from_fn(move || {
        let next = rest
            .char_indices()
            .zip(rest.chars().skip(1))
            .find(|((_, c), next)| c.is_lowercase() && next.is_uppercase());
        let end = next.map_or(rest.len(), |((at, c), _)| at + c.len_utf8());
        let word = rest.get(..end).filter(|word| !word.is_empty())?;
        rest = &rest[end..];
        Some(word)
    })
}

/// Whether a value for an angle rotates nothing.
pub(super) fn is_zero(value: &Loose) -> bool {
    matches!(value, Loose::Absent | Loose::Flag(false)) || value.number() == Ok(0.0)
}

/// Takes the rotation of a box out of its attributes, degrees; `None` where the box is upright. Fails with the value if that of `rotation` is no number,
/// or if two attributes differ. Beside `rotation`, numbers of other spellings are taken out too, lest the next reader rotates by them.
pub(super) fn take_rotation_deg(attributes: &mut BTreeMap<String, Attribute>) -> Result<Option<f64>, String> {
    let is_stated = attributes.keys().any(|name| is_rotation(name));
    let mut found: Option<f64> = None;
    for (name, value) in &*attributes {
        let degrees = match value {
            _ if is_stated && !is_rotation(name) => continue,
            Attribute::Number(degrees) if is_rotation(name) || is_other_spelling(name) => *degrees,
            Attribute::Flag(false) if is_rotation(name) => 0.0,
            value if is_rotation(name) => return Err(value.to_string()),
            _ => continue,
        };
        if let Some(other) = found.filter(|other| *other != degrees) {
            return Err(format!("{other}, and `{name}` is {degrees}"));
        }
        found = Some(degrees);
    }
    attributes.retain(|name, value| {
        let is_number = matches!(value, Attribute::Number(_));
        !(is_rotation(name) || is_other_spelling(name) && is_number)
    });
    Ok(found.filter(|degrees| degrees % 360.0 != 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_angles_are_whole_words() {
        for name in
            ["angle", "Angle", "rotation_deg", "box theta", "ROT", "Rotation", "rotationAngle", "boxTheta"]
        {
            assert!(is_angle(name), "{name}");
        }
        for name in ["rectangle", "triangle", "orientation", "rotten", "roTate", ""] {
            assert!(!is_angle(name), "{name}");
        }
        assert!(is_rotation(" rotation") && !is_rotation("Rotation") && is_other_spelling("Rotation"));
    }

    #[test]
    fn angles_that_rotate_no_box_are_counted() {
        let unread = |entries: &[(&str, Loose)]| {
            let entries: Vec<(String, Loose)> =
                entries.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
            let names = unread_angles(entries.iter().map(|(name, value)| (name, value)));
            names.map(str::to_owned).collect::<Vec<String>>()
        };
        let other = || ("Rotation", Loose::Number(90.0));
        assert!(unread(&[other(), ("parked", Loose::Flag(true))]).is_empty());
        assert_eq!(unread(&[other(), ("rotation", Loose::Number(0.0))]), ["Rotation"]);
        assert!(unread(&[other(), ("rotation", Loose::Absent)]).is_empty());
        assert_eq!(unread(&[("Rotation", Loose::Text("left".to_owned()))]), ["Rotation"]);
        assert_eq!(unread(&[("angle", Loose::Whole(3)), ("theta", Loose::Whole(0))]), ["angle"]);
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
        assert_eq!(take(&[parked(), ("rotation", Attribute::Flag(false))]), (Ok(None), 1));
        // CVAT's own comes before an attribute of the user's.
        assert_eq!(take(&[("rotation", number(0.0)), ("Rotation", number(90.0))]), (Ok(None), 0));
        assert_eq!(take(&[("rotation", number(30.0)), ("ROTATION", parked().1)]), (Ok(Some(30.0)), 1));
        let two = take(&[("ROTATION", number(30.0)), ("Rotation", number(40.0))]).0;
        assert_eq!(two, Err("30, and `Rotation` is 40".to_owned()));
        let text = || Attribute::Text("30,5".to_owned());
        assert_eq!(take(&[("rotation", text())]).0, Err("\"30,5\"".to_owned()));
        assert_eq!(take(&[("Rotation", text())]), (Ok(None), 1));
    }
}
