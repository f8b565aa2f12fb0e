//! Numbers of a request outside the ranges of its schema, found before the job runs.

use petzval_base::FileError;
use petzval_files::wavelength_hint;
use serde_json::Value;

use crate::job::{Row, schema_hint};
use crate::range::{number_text, short};

impl Row {
    /// The first number of a request outside the range that its schema gives it, with its key path and a hint. The request fits its schema
    /// otherwise; a number that it leaves out has its default.
    pub fn out_of_range(&self, request: &Value) -> Option<FileError> {
        let wrong = out_of_range(&self.kept_schema(), request)?;
        Some(FileError { hint: wrong.hint.clone().or_else(|| Some(schema_hint(self.name))), ..wrong })
    }
}

/// The first number of a request outside the range that the schema gives it, with its key path and value; none if all are in range.
///
/// Of several forms that a value may have, those count that fit its kind and keys: the number is wrong if it is wrong in all of them.
fn out_of_range(schema: &Value, request: &Value) -> Option<FileError> {
    Search { root: schema }.first(schema, request, "", Range::ANY)
}

/// Least and greatest value of the numbers at a place.
#[derive(Clone, Copy)]
struct Range {
    min: f64,
    max: f64,
}

impl Range {
    const ANY: Self = Self { min: f64::NEG_INFINITY, max: f64::INFINITY };

    /// The part of it that a schema allows as well.
    fn within(self, schema: &Value) -> Self {
        let end = |key: &str| schema.get(key).and_then(Value::as_f64);
        Self {
            min: end("minimum").map_or(self.min, |min| min.max(self.min)),
            max: end("maximum").map_or(self.max, |max| max.min(self.max)),
        }
    }

    /// The range in words.
    fn in_words(self) -> String {
        match (self.min.is_finite(), self.max.is_finite()) {
            (true, true) => format!("between {} and {}", short(self.min), short(self.max)),
            (true, false) => format!("at {} or above", short(self.min)),
            (false, _) => format!("at {} or below", short(self.max)),
        }
    }
}

/// A search through a request; `root` holds the definitions that schemas refer to.
struct Search<'s> {
    root: &'s Value,
}

impl<'s> Search<'s> {
    fn first(&self, schema: &'s Value, value: &Value, path: &str, range: Range) -> Option<FileError> {
        let range = range.within(schema);
        let here = value.as_f64().and_then(|number| wrong(path, number, range));
        here.or_else(|| self.named(schema).and_then(|named| self.first(named, value, path, range)))
            .or_else(|| branches(schema, "allOf").find_map(|part| self.first(part, value, path, range)))
            .or_else(|| {
                let mut lists = ["anyOf", "oneOf"].into_iter();
                lists.find_map(|key| self.in_every_form(schema, key, value, path, range))
            })
            .or_else(|| self.below(schema, value, path, range))
    }

    /// The number that is wrong in each of the forms that fit the value; none if one of them allows it.
    fn in_every_form(
        &self,
        schema: &'s Value,
        key: &str,
        value: &Value,
        path: &str,
        range: Range,
    ) -> Option<FileError> {
        let fitting = branches(schema, key).filter(|form| self.fits(form, value));
        let all: Option<Vec<FileError>> = fitting.map(|form| self.first(form, value, path, range)).collect();
        all?.into_iter().next()
    }

    /// The first wrong number of the elements of a list or the keys of a table. A range given for a list is one of its numbers.
    fn below(&self, schema: &'s Value, value: &Value, path: &str, range: Range) -> Option<FileError> {
        let place = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
        match value {
            Value::Array(items) => items.iter().enumerate().find_map(|(i, item)| {
                let of_place = schema.get("prefixItems").and_then(|all| all.get(i));
                let of_item = of_place.or_else(|| schema.get("items"))?;
                self.first(of_item, item, &place(&i.to_string()), range)
            }),
            Value::Object(keys) => keys.iter().find_map(|(key, value)| {
                let of_key = schema.get("properties").and_then(|all| all.get(key));
                let of_key = of_key.or_else(|| schema.get("additionalProperties"))?;
                self.first(of_key, value, &place(key), Range::ANY)
            }),
            _ => None,
        }
    }

    /// The definition that a schema refers to.
    fn named(&self, schema: &Value) -> Option<&'s Value> {
        let place = schema.get("$ref")?.as_str()?.strip_prefix("#/")?;
        self.root.pointer(&format!("/{place}"))
    }

    /// Whether a value is of the kind of a schema, has the keys that it requires, and the words that it fixes.
    fn fits(&self, schema: &Value, value: &Value) -> bool {
        let schema = self.named(schema).unwrap_or(schema);
        let is_of_kind = match schema.get("type") {
            Some(Value::String(kind)) => is_of_kind(value, kind),
            Some(Value::Array(kinds)) => {
                kinds.iter().filter_map(Value::as_str).any(|kind| is_of_kind(value, kind))
            }
            _ => true,
        };
        let Some(keys) = value.as_object() else { return is_of_kind };
        let has_required = branches(schema, "required")
            .filter_map(Value::as_str)
            .all(|required| keys.contains_key(required));
        let has_fixed = keys.iter().all(|(key, value)| {
            let of_key = schema.get("properties").and_then(|all| all.get(key));
            of_key.and_then(|of_key| of_key.get("const")).is_none_or(|fixed| fixed == value)
        });
        is_of_kind && has_required && has_fixed
    }
}

/// The elements of a list of a schema; none where it has no such list.
fn branches<'s>(schema: &'s Value, key: &str) -> impl Iterator<Item = &'s Value> {
    schema.get(key).and_then(Value::as_array).into_iter().flatten()
}

/// Whether a value is of a kind of JSON Schema.
fn is_of_kind(value: &Value, kind: &str) -> bool {
    match value {
        Value::Null => kind == "null",
        Value::Bool(_) => kind == "boolean",
        Value::Number(_) => ["number", "integer"].contains(&kind),
        Value::String(_) => kind == "string",
        Value::Array(_) => kind == "array",
        Value::Object(_) => kind == "object",
    }
}

/// The error of a number outside a range.
fn wrong(path: &str, number: f64, range: Range) -> Option<FileError> {
    // A number of single precision is a little off as JSON: 1e-6 is 9.999999974752427e-7.
    let single = number as f32;
    let is_at_an_end = f64::from(single) == number
        && [range.min, range.max].iter().any(|end| end.is_finite() && *end as f32 == single);
    if number >= range.min && number <= range.max || is_at_an_end {
        return None;
    }
    let message = format!("must lie {}", range.in_words());
    let error = FileError { value: number_text(number), ..FileError::of_value(path, &message) };
    let key = path.rsplit('.').find(|part| part.parse::<usize>().is_err());
    // A wavelength in nm or mm is the usual slip: its hint names the number that was meant.
    let is_wavelength = matches!(key, Some("wavelength" | "wavelengths"));
    Some(if is_wavelength { error.hint(wavelength_hint(number)) } else { error })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn found(schema: &Value, request: Value) -> Option<String> {
        out_of_range(schema, &request).map(|error| FileError { hint: None, ..error }.to_string())
    }

    #[test]
    fn numbers_are_found_in_lists_tables_and_definitions() {
        let schema = json!({
            "properties": {
                "trials": {"type": "integer", "minimum": 0.0, "maximum": 1e6},
                "times": {"type": ["array", "null"], "items": {"type": "number", "minimum": 1.0, "maximum": 2.0}},
                "pairs": {"items": {"type": "array", "items": {"type": "number"}, "minimum": 0.0, "maximum": 9.0}},
                "table": {"anyOf": [{"$ref": "#/$defs/Table"}, {"type": "null"}]},
                "word": {"type": "string"},
            },
            "$defs": {"Table": {"type": "object", "properties": {"gain": {"type": "number", "minimum": 1.0}}}},
        });
        let right = json!({
            "trials": 1e6, "times": null, "pairs": [[0, 9]], "table": {"gain": 1e9}, "word": "a", "other": -1,
        });
        assert_eq!(found(&schema, right), None);
        for (request, says) in [
            (json!({"trials": 5_000_000}), "`trials = 5000000`: must lie between 0 and 1000000"),
            (json!({"times": [1.5, 2.5]}), "`times.1 = 2.5`: must lie between 1 and 2"),
            (json!({"pairs": [[0, 1], [2, 10]]}), "`pairs.1.1 = 10`: must lie between 0 and 9"),
            (json!({"table": {"gain": 0.5}}), "`table.gain = 0.5`: must lie at 1 or above"),
        ] {
            assert_eq!(found(&schema, request).as_deref(), Some(says));
        }
    }

    #[test]
    fn a_number_that_one_form_of_a_value_allows_is_right() {
        let form = |name: &str, max: f64| {
            json!({
                "type": "object", "required": [name],
                "properties": {name: {"type": "number", "minimum": 0.0, "maximum": max}},
            })
        };
        let schema = json!({"oneOf": [form("a", 1.0), form("b", 2.0), form("b", 3.0)]});
        assert_eq!(found(&schema, json!({"b": 2.5})), None);
        assert!(found(&schema, json!({"b": 4})).is_some());
        assert!(found(&schema, json!({"a": 1.5})).is_some());
    }

    #[test]
    fn an_end_of_a_range_in_single_precision_is_within() {
        let schema = json!({"properties": {"gain": {"type": "number", "minimum": 1e-6, "maximum": 1e3}}});
        let end = f64::from(1e-6_f32);
        assert!(end < 1e-6);
        assert_eq!(found(&schema, json!({"gain": end})), None);
        assert!(found(&schema, json!({"gain": 0.999e-6})).is_some());
    }

    #[test]
    fn a_wavelength_in_nm_has_its_own_hint() {
        let schema = json!({"properties": {"wavelengths": {"items": {"minimum": 0.1, "maximum": 20.0}}}});
        let wrong = out_of_range(&schema, &json!({"wavelengths": [0.5, 550]})).unwrap();
        assert!(wrong.hint.unwrap().contains("did you mean 0.55?"));
    }
}
