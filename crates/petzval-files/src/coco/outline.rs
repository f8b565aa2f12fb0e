//! The bounds of an outline or a mask (`segmentation`) in a file of COCO, found while it is read, so that its points need no memory.

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess};

use super::bounds::Bounds;
use super::loose::{AnyValue, Loose, any_value};
use super::mask::{MOST_RUNS, Mask, runs_of_text};

/// What is known of an outline.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Outline {
    /// There is none.
    #[default]
    Absent,
    /// Polygons within these bounds: `[[x, y, x, y, ...], ...]`.
    Polygons(Bounds),
    /// A mask with at least one pixel.
    Mask(Mask),
    /// An outline without points, a mask that makes no sense, or something else.
    Other,
}

/// A list of numbers or of such lists, or a mask.
enum Part {
    Number(f64),
    Mask(Mask),
    /// The bounds of the points in a list of pairs.
    Points(Option<Bounds>),
    /// A list without a number.
    Empty,
    Other,
}

impl<'de> Deserialize<'de> for Outline {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(match Option::<Part>::deserialize(deserializer)? {
            None => Self::Absent,
            Some(Part::Empty) => Self::Absent,
            Some(Part::Points(Some(bounds))) => Self::Polygons(bounds),
            Some(Part::Mask(mask)) => Self::Mask(mask),
            Some(_) => Self::Other,
        })
    }
}

impl<'de> Deserialize<'de> for Part {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        any_value(deserializer)
    }
}

impl<'de> AnyValue<'de> for Part {
    fn plain(value: Loose) -> Self {
        match value {
            Loose::Whole(n) => Self::Number(n as f64),
            Loose::Number(v) => Self::Number(v),
            _ => Self::Other,
        }
    }

    fn table<A: MapAccess<'de>>(mut table: A) -> Result<Self, A::Error> {
        let (mut size, mut counts) = (None, None);
        while let Some(key) = table.next_key::<String>()? {
            match key.as_str() {
                "size" => size = table.next_value::<Runs>()?.0,
                "counts" => counts = table.next_value::<Runs>()?.0,
                _ => drop(table.next_value::<IgnoredAny>()?),
            }
        }
        let sides: Option<Vec<u32>> =
            size.and_then(|sides| sides.into_iter().map(|side| u32::try_from(side).ok()).collect());
        let mask = match (sides.as_deref(), counts) {
            (Some(&[rows, columns]), Some(runs)) => Mask::of_runs([rows, columns], &runs),
            _ => None,
        };
        Ok(mask.map_or(Part::Other, Part::Mask))
    }

    fn list<A: SeqAccess<'de>>(mut list: A) -> Result<Self, A::Error> {
        let (mut bounds, mut across, mut is_pairs, mut is_empty) = (None::<Bounds>, None::<f64>, true, true);
        let corners = |b: &Bounds| [[b.x, b.y], [b.x + b.width, b.y + b.height]];
        while let Some(part) = list.next_element::<Part>()? {
            is_empty = false;
            let points: Vec<[f64; 2]> = match (part, across.take()) {
                (Part::Number(x), None) => {
                    across = Some(x);
                    continue;
                }
                (Part::Number(y), Some(x)) => vec![[x, y]],
                (Part::Points(Some(inner)), None) => corners(&inner).to_vec(),
                _ => {
                    is_pairs = false;
                    continue;
                }
            };
            bounds = Bounds::around(bounds.iter().flat_map(corners).chain(points));
        }
        Ok(match (is_empty, is_pairs && across.is_none()) {
            (true, _) => Part::Empty,
            (false, true) => Part::Points(bounds),
            (false, false) => Part::Other,
        })
    }
}

/// A list of whole numbers from 0, or the text of one; `None` for anything else.
struct Runs(Option<Vec<u64>>);

impl<'de> Deserialize<'de> for Runs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        any_value(deserializer)
    }
}

impl<'de> AnyValue<'de> for Runs {
    fn plain(value: Loose) -> Self {
        Self(value.text().ok().and_then(runs_of_text))
    }

    fn table<A: MapAccess<'de>>(mut table: A) -> Result<Self, A::Error> {
        while table.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(Runs(None))
    }

    fn list<A: SeqAccess<'de>>(mut list: A) -> Result<Self, A::Error> {
        let mut runs = Some(Vec::new());
        while let Some(value) = list.next_element::<Loose>()? {
            match (value.whole(), &mut runs) {
                (Ok(length), Some(lengths)) if lengths.len() < MOST_RUNS => lengths.push(length),
                _ => runs = None,
            }
        }
        Ok(Runs(runs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_and_masks_have_bounds_and_everything_else_has_none() {
        let of = |text: &str| serde_json::from_str::<Outline>(text).unwrap();
        assert_eq!(of("null"), Outline::Absent);
        assert_eq!(of("[]"), Outline::Absent);
        let one = Bounds::from([100.0, 80.0, 60.0, 120.0]);
        assert_eq!(of("[[100, 80, 160, 80.0, 160, 200, 100, 200]]"), Outline::Polygons(one));
        assert_eq!(of("[100, 80, 160, 80, 160, 200]"), Outline::Polygons(one));
        let both = Bounds::from([-1.0, 2.0, 161.0, 198.0]);
        assert_eq!(of("[[100, 80, 160, 200], [-1, 2, 3, 4]]"), Outline::Polygons(both));
        let mask = Outline::Mask(Mask { size: [4, 5], bounds: Bounds::from([1.0, 1.0, 2.0, 2.0]) });
        assert_eq!(of(r#"{"counts": [5, 2, 2.0, 2, 9], "size": [4, 5]}"#), mask);
        assert_eq!(of(r#"{"size": [4, 5], "counts": "52207", "area": {"px": [4]}}"#), mask);
        for other in [
            r#"{"counts": [1, 2], "size": [4, 5]}"#,
            r#"{"counts": [5, -2, 17], "size": [4, 5]}"#,
            r#"{"counts": [5, [2], 13], "size": [4, 5]}"#,
            r#"{"counts": {"a": 1}, "size": [4, 5]}"#,
            r#"{"counts": "5 207", "size": [4, 5]}"#,
            r#"{"counts": "52207", "size": [4, 5, 1]}"#,
            r#"{"counts": "52207", "size": 20}"#,
            r#"{"counts": "52207"}"#,
            r#"[{"counts": "52207", "size": [4, 5]}]"#,
            "{}",
            "[[1, 2, 3]]",
            "[[1, null]]",
            "[[]]",
            "[[1, 2], [\"?\", 3]]",
            "7",
            "\"a\"",
            "[1, [2, 3]]",
        ] {
            assert_eq!(of(other), Outline::Other, "{other}");
        }
    }
}
