//! Choices of a request as arguments: their words, and what each of them means, stand in the request, and nowhere else.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use schemars::{JsonSchema, schema_for};
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Reads a word as the choice of a request.
pub fn choice<T>() -> impl TypedValueParser<Value = T>
where
    T: DeserializeOwned + JsonSchema + Clone + Send + Sync + 'static,
{
    let schema = schema_for!(T).to_value();
    let all = schema["oneOf"].as_array().into_iter().flatten().filter_map(|one| {
        let meaning = one["description"].as_str()?.replace('\n', " ").replace('`', "");
        // What follows the first sentence stands in the reference of the job.
        let first = meaning.split_once(". ").map_or(meaning.trim_end_matches('.'), |(first, _)| first);
        let word = one["const"].as_str()?.to_owned();
        Some(PossibleValue::new(word).help(first.to_owned()))
    });
    let all: Vec<PossibleValue> = all.collect();
    // A variant without a doc comment has no such entry.
    assert_eq!(
        Some(all.len()),
        schema["oneOf"].as_array().map(Vec::len),
        "a choice without a meaning: {schema}"
    );
    PossibleValuesParser::new(all).try_map(|word| serde_json::from_value(Value::String(word)))
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;

    use clap::Command;

    use super::*;
    use crate::jobs::isp::develop::Chroma;

    #[test]
    fn words_and_meanings_are_those_of_the_request() {
        let parser = choice::<Chroma>();
        let all: Vec<PossibleValue> = parser.possible_values().into_iter().flatten().collect();
        assert_eq!(all.iter().map(PossibleValue::get_name).collect::<Vec<_>>(), ["444", "422", "420"]);
        assert_eq!(all[2].get_help().unwrap().to_string(), "4:2:0: one for two by two pixels");
        let read = |word: &str| parser.parse_ref(&Command::new("petzval"), None, OsStr::new(word));
        assert_eq!(read("422").unwrap(), Chroma::HalfWidth);
        assert!(read("HalfWidth").is_err());
    }
}
