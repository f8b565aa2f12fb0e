//! The bounds of an outline (`segmentation`) in a file of COCO, found while it is read, so that its points need no memory.

use std::fmt;

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::bounds::Bounds;

/// What is known of an outline.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Outline {
    /// There is none.
    #[default]
    Absent,
    /// Polygons within these bounds: `[[x, y, x, y, ...], ...]`.
    Polygons(Bounds),
    /// A mask, an outline without points, or something else.
    Other,
}

/// A list of numbers or of such lists.
enum Part {
    Number(f64),
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
            Some(_) => Self::Other,
        })
    }
}

impl<'de> Deserialize<'de> for Part {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PartVisitor)
    }
}

struct PartVisitor;

impl<'de> Visitor<'de> for PartVisitor {
    type Value = Part;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an outline")
    }

    fn visit_u64<E>(self, n: u64) -> Result<Part, E> {
        Ok(Part::Number(n as f64))
    }

    fn visit_i64<E>(self, n: i64) -> Result<Part, E> {
        Ok(Part::Number(n as f64))
    }

    fn visit_f64<E>(self, v: f64) -> Result<Part, E> {
        Ok(Part::Number(v))
    }

    fn visit_bool<E>(self, _: bool) -> Result<Part, E> {
        Ok(Part::Other)
    }

    fn visit_str<E>(self, _: &str) -> Result<Part, E> {
        Ok(Part::Other)
    }

    fn visit_unit<E>(self) -> Result<Part, E> {
        Ok(Part::Other)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut table: A) -> Result<Part, A::Error> {
        while table.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(Part::Other)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Part, A::Error> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_have_bounds_and_everything_else_has_none() {
        let of = |text: &str| serde_json::from_str::<Outline>(text).unwrap();
        assert_eq!(of("null"), Outline::Absent);
        assert_eq!(of("[]"), Outline::Absent);
        let one = Bounds::from([100.0, 80.0, 60.0, 120.0]);
        assert_eq!(of("[[100, 80, 160, 80.0, 160, 200, 100, 200]]"), Outline::Polygons(one));
        assert_eq!(of("[100, 80, 160, 80, 160, 200]"), Outline::Polygons(one));
        let both = Bounds::from([-1.0, 2.0, 161.0, 198.0]);
        assert_eq!(of("[[100, 80, 160, 200], [-1, 2, 3, 4]]"), Outline::Polygons(both));
        for other in [
            r#"{"counts": [1, 2], "size": [4, 5]}"#,
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
