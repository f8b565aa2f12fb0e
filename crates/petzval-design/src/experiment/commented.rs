//! An experiment as a file to read and to start from: every key with its unit, range and sentence.

use petzval_base::parameter::{OutOfRange, ParameterTable, Parameters};
use serde_json::Value;

use super::Experiment;
use crate::error::Result;

/// A table of numbers of an experiment: its name, what it holds, and the first value outside its range.
pub(super) type NumberTable = (&'static str, ParameterTable, Option<OutOfRange>);

/// The tables of numbers of an experiment.
pub(super) fn tables(e: &Experiment) -> [NumberTable; 14] {
    fn of<P: Parameters>(name: &'static str, table: &P) -> NumberTable {
        (name, P::table(), table.out_of_range())
    }
    [
        of("exposure", &e.exposure),
        of("psf", &e.psf),
        of("isp", &e.isp),
        of("network", &e.network),
        of("street", &e.street),
        of("training", &e.training),
        of("loss", &e.loss),
        of("optics", &e.optics),
        of("spot", &e.spot),
        of("constraints", &e.constraints),
        of("scoring", &e.scoring),
        of("validation", &e.validation),
        of("checkpoint", &e.checkpoint),
        of("reading", &e.reading),
    ]
}

/// [`Experiment::to_toml`] with a comment above each table, and behind each number and each word that is one of several.
pub fn commented_toml(experiment: &Experiment) -> Result<String> {
    let tables = tables(experiment);
    let schema = schemars::schema_for!(Experiment).to_value();
    let mut current: Option<&ParameterTable> = None;
    let mut name = "";
    let mut out = String::new();
    for line in experiment.to_toml()?.lines() {
        if let Some(header) = line.strip_prefix('[') {
            name = header.trim_end_matches(']');
            current = tables.iter().find(|(table, ..)| *table == name).map(|(_, table, _)| table);
            if let Some(table) = current {
                out += &format!("# {}\n", table.sentence);
            }
        }
        let key = line.split(" = ").next().unwrap_or_default();
        let parameter = current.and_then(|t| t.parameters.iter().find(|p| p.name == key));
        out += &match parameter {
            Some(p) => {
                let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
                format!("{line:<40} # {} to {}{unit}: {}\n", p.min, p.max, p.sentence)
            }
            None => match choices(&schema, name, key) {
                Some(choices) => format!("{line:<40} # {choices}\n"),
                None => format!("{line}\n"),
            },
        };
    }
    Ok(out)
}

/// The words that may stand at a key, and what they decide, by the schema of experiments; none for a key of another kind.
fn choices<'a>(schema: &'a Value, table: &str, key: &str) -> Option<String> {
    let followed = |value: &'a Value| match value["$ref"].as_str() {
        Some(place) => schema.pointer(place.trim_start_matches('#')),
        None => Some(value),
    };
    let owner = if table.is_empty() { schema } else { followed(&schema["properties"][table])? };
    let property = &owner["properties"][key];
    let words = followed(property)?["oneOf"].as_array()?.iter().filter_map(|choice| choice["const"].as_str());
    let words: Vec<String> = words.map(|word| format!("\"{word}\"")).collect();
    let sentence = property["description"].as_str()?.replace('\n', " ");
    (!words.is_empty()).then(|| format!("{}: {sentence}", words.join(", ")))
}
