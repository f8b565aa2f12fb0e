//! A JSON Schema as rows: key, kind, default, range, unit and meaning of everything that may stand in a file, a request or a response.

use serde_json::Value;

use super::markdown::{code, prose, sentence, table};

/// A key, with all that its schema says.
#[derive(Clone, Debug)]
pub struct Row {
    pub key: String,
    pub kind: String,
    pub default: String,
    pub range: String,
    pub unit: String,
    pub meaning: String,
    /// Words that may stand there, and the least and the greatest number.
    words: Vec<String>,
    ends: [Option<f64>; 2],
}

impl Row {
    /// Whether a value may stand here; tables are not looked into.
    pub fn check(&self, value: &Value) -> Result<(), String> {
        let [min, max] = self.ends;
        match value {
            Value::String(word) if !self.words.is_empty() && !self.words.contains(word) => {
                Err(format!("{word:?} is none of {}", self.words.join(", ")))
            }
            Value::Number(number) => {
                let number = number.as_f64().unwrap_or(f64::NAN);
                let fits = min.is_none_or(|min| number >= min) && max.is_none_or(|max| number <= max);
                if fits { Ok(()) } else { Err(format!("{number} lies outside {}", self.range)) }
            }
            Value::Array(all) => all.iter().try_for_each(|one| self.check(one)),
            _ => Ok(()),
        }
    }
}

/// What stands in place of the default of a key that has none.
const MUST: &str = "must be given";

/// Levels of tables in tables.
const DEEPEST: usize = 6;

/// Rows as a table.
pub fn as_table(rows: &[Row]) -> String {
    let cells = |row: &Row| {
        let Row { key, kind, default, range, unit, meaning, .. } = row;
        vec![code(key), kind.clone(), default.clone(), range.clone(), prose(unit), meaning.clone()]
    };
    table(
        &["key", "type", "default", "range", "unit", "meaning"],
        &rows.iter().map(cells).collect::<Vec<_>>(),
    )
}

/// Rows of what is always there, as a table: a response has no defaults.
pub fn as_table_of_response(rows: &[Row]) -> String {
    let rows: Vec<Row> =
        rows.iter().map(|row| Row { default: String::new(), range: String::new(), ..row.clone() }).collect();
    as_table(&rows)
}

/// A schema and its named parts.
pub struct Schema<'a>(pub &'a Value);

impl<'a> Schema<'a> {
    /// The rows of the whole schema, or of what it is a list of; tables in tables included, as deep as `levels` says.
    pub fn rows(&self, levels: usize) -> Vec<Row> {
        let mut rows = Vec::new();
        let whole = self.bare(self.0);
        let whole = if whole["items"].is_object() { &whole["items"] } else { whole };
        self.add(whole, "", None, levels.min(DEEPEST), &mut rows);
        rows
    }

    /// What the schema as a whole says.
    pub fn kind(&self) -> String {
        self.kind_of(self.0)
    }

    /// The part that a reference names; the schema itself if it is none.
    fn followed(&self, node: &'a Value) -> &'a Value {
        match node["$ref"].as_str() {
            Some(place) => self.0.pointer(place.trim_start_matches('#')).expect("a part of the schema"),
            None => node,
        }
    }

    /// A schema without references, and without the alternative that there is nothing.
    fn bare(&self, node: &'a Value) -> &'a Value {
        let node = self.followed(node);
        let alternatives: Vec<&Value> =
            (node["anyOf"].as_array().into_iter().flatten()).filter(|one| one["type"] != "null").collect();
        if let [one] = alternatives[..] { self.bare(one) } else { node }
    }

    /// Adds the keys of a table, below a path.
    fn add(&self, node: &'a Value, path: &str, defaults: Option<&Value>, levels: usize, rows: &mut Vec<Row>) {
        let node = self.bare(node);
        if levels == 0 {
            return;
        }
        let alternatives = node["oneOf"].as_array().into_iter().flatten();
        for alternative in alternatives.filter(|&one| self.followed(one)["properties"].is_object()) {
            let before = rows.len();
            self.add(alternative, path, defaults, levels, rows);
            // One of several: none of them must be given.
            let depth = path.matches('.').count() + usize::from(!path.is_empty());
            for row in rows[before..].iter_mut().filter(|row| row.key.matches('.').count() == depth) {
                row.default = row.default.replace(MUST, "");
            }
        }
        let needed: Vec<&str> =
            node["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        for (name, property) in node["properties"].as_object().into_iter().flatten() {
            let key = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            let default = defaults.and_then(|of| of.get(name)).or_else(|| property.get("default"));
            let row = self.row(&key, property, default, needed.contains(&name.as_str()));
            if !rows.iter().any(|other| other.key == row.key) {
                rows.push(row);
            }
            let inner = self.bare(property);
            let inner = if inner["items"].is_object() { self.bare(&inner["items"]) } else { inner };
            self.add(inner, &key, default, levels - 1, rows);
        }
    }

    fn row(&self, key: &str, property: &'a Value, default: Option<&Value>, is_needed: bool) -> Row {
        let bare = self.bare(property);
        // A table says what it is; the description of a plain type says nothing of the key.
        let of_type = Some(bare).filter(|bare| bare["properties"].is_object() || bare["oneOf"].is_array());
        let mut said = Some(property).into_iter().chain(of_type);
        let described = said.find_map(|of| of["description"].as_str()).unwrap_or_default();
        let (meaning, unit) = described.split_once(" Unit: ").unwrap_or((described, ""));
        let numbers = if bare["items"].is_object() { self.bare(&bare["items"]) } else { bare };
        let words = words(numbers).map(|(word, what)| format!("{}: {}", code(&word), sentence(&what)));
        Row {
            key: key.to_owned(),
            kind: self.kind_of(property),
            default: match default {
                Some(default) => shown(default),
                None if is_needed => MUST.to_owned(),
                None => String::new(),
            },
            range: range(numbers),
            unit: unit.trim_end_matches('.').to_owned(),
            meaning: std::iter::once(sentence(meaning))
                .chain(words)
                .filter(|text| !text.is_empty())
                .collect::<Vec<_>>()
                .join(" "),
            words: self::words(numbers).map(|(word, _)| word).collect(),
            ends: ["minimum", "maximum"].map(|end| numbers[end].as_f64()),
        }
    }

    /// What may stand at a key, in a few words.
    fn kind_of(&self, node: &'a Value) -> String {
        let bare = self.bare(node);
        if words(bare).next().is_some() {
            return "word".to_owned();
        }
        for several in ["anyOf", "oneOf"] {
            if let Some(all) = bare[several].as_array() {
                let mut kinds: Vec<String> = Vec::new();
                for kind in all.iter().filter(|one| one["type"] != "null").map(|one| self.kind_of(one)) {
                    if !kinds.contains(&kind) {
                        kinds.push(kind);
                    }
                }
                return kinds.join(" or ");
            }
        }
        let kinds: Vec<&str> = match &bare["type"] {
            Value::String(kind) => vec![kind],
            Value::Array(kinds) => {
                kinds.iter().filter_map(Value::as_str).filter(|kind| *kind != "null").collect()
            }
            _ => vec![],
        };
        let of = |kind: &&str| match *kind {
            "string" => "text".to_owned(),
            "integer" => "whole number".to_owned(),
            "boolean" => "true or false".to_owned(),
            "array" if bare["items"].is_object() => match self.kind_of(&bare["items"]).as_str() {
                "text" => "list of texts".to_owned(),
                "true or false" => "list of true or false".to_owned(),
                one if one.starts_with("list") => one.replacen("list", "list of lists", 1),
                one => format!("list of {one}s"),
            },
            "array" => "list".to_owned(),
            "object" => "table".to_owned(),
            other => other.to_owned(),
        };
        if kinds.is_empty() {
            "any value".to_owned()
        } else {
            kinds.iter().map(of).collect::<Vec<_>>().join(" or ")
        }
    }
}

/// The words that may stand somewhere, each with its meaning.
fn words(node: &Value) -> impl Iterator<Item = (String, String)> {
    let described = node["oneOf"].as_array().into_iter().flatten().flat_map(|one| {
        let plain = one["enum"].as_array().into_iter().flatten().filter_map(Value::as_str);
        let word = one["const"].as_str().map(|word| (word, one["description"].as_str().unwrap_or_default()));
        word.into_iter().chain(plain.map(|word| (word, ""))).collect::<Vec<_>>()
    });
    let plain =
        node["enum"].as_array().into_iter().flatten().filter_map(Value::as_str).map(|word| (word, ""));
    described.chain(plain).map(|(word, what)| (word.to_owned(), what.to_owned()))
}

/// The range of numbers, in which the wide ends of whole numbers are not said.
fn range(node: &Value) -> String {
    match (node["minimum"].as_f64(), node["maximum"].as_f64()) {
        (Some(min), Some(max)) => format!("{} to {}", short(min), short(max)),
        (Some(min), None) if min != 0.0 => format!("{} or more", short(min)),
        (None, Some(max)) => format!("{} or less", short(max)),
        _ => String::new(),
    }
}

/// A number without a row of zeros, and a single-precision number without the digits that it does not have.
pub fn short(number: f64) -> String {
    let single = number as f32;
    if f64::from(single) == number && number.fract() != 0.0 {
        return single.to_string();
    }
    let is_plain = number == 0.0 || (1e-3..1e7).contains(&number.abs());
    if is_plain { number.to_string() } else { format!("{number:e}") }
}

/// A default as a file would have it. Tables say theirs key by key.
fn shown(default: &Value) -> String {
    match default {
        Value::Null => "none".to_owned(),
        Value::Object(_) => String::new(),
        Value::Array(all) if all.iter().any(Value::is_object) => "see above".to_owned(),
        Value::Array(all) if all.is_empty() => "`[]`".to_owned(),
        other => code(&plain(other)),
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::Array(all) => format!("[{}]", all.iter().map(plain).collect::<Vec<_>>().join(", ")),
        Value::Number(number) if number.is_f64() => short(number.as_f64().expect("a number")),
        other => other.to_string(),
    }
}

#[test]
fn rows_follow_references_alternatives_and_defaults_of_tables() {
    let schema = serde_json::json!({
        "$defs": {
            "Inner": {"type": "object", "properties": {
                "gain": {"type": "number", "minimum": 0.1, "maximum": 1000.0, "default": 1.0, "description": "Gain. Unit: dB."},
                "mode": {"oneOf": [{"const": "a", "description": "First."}, {"const": "b", "description": "Second"}]},
            }},
        },
        "type": "object",
        "required": ["name"],
        "properties": {
            "inner": {"anyOf": [{"$ref": "#/$defs/Inner"}, {"type": "null"}], "default": {"gain": 2.0}, "description": "A table."},
            "name": {"type": ["string", "null"]},
            "rows": {"type": "array", "items": {"$ref": "#/$defs/Inner"}, "default": []},
        },
    });
    let rows = Schema(&schema).rows(9);
    let find =
        |key: &str| rows.iter().find(|row| row.key == key).unwrap_or_else(|| panic!("{key}: {rows:?}"));
    let gain = find("inner.gain");
    assert_eq!(
        (gain.default.as_str(), gain.range.as_str(), gain.unit.as_str()),
        ("`2`", "0.1 to 1000", "dB")
    );
    assert_eq!(
        (find("inner.mode").kind.as_str(), find("inner.mode").meaning.as_str()),
        ("word", "`a`: First. `b`: Second.")
    );
    assert_eq!(
        (find("name").default.as_str(), find("rows").kind.as_str()),
        ("must be given", "list of tables")
    );
    assert_eq!(find("rows.gain").default, "`1`");
    assert_eq!(
        [short(0.004_999_999_888_241_291), short(1e8), short(0.02), short(1e-8)],
        ["0.005", "1e8", "0.02", "1e-8"]
    );
}
