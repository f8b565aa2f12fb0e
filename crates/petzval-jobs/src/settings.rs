//! Settings as words of a command line: `key=value`, where the value is TOML.

use petzval_design::experiment::Settings;
use serde_json::Value;

use crate::error::{JobError, Result};

/// Reads settings of the form `key=value`. A value is TOML; a word that is none is a text, so that `psf.kind=diffraction` needs no quotes.
pub fn settings_of(words: &[String]) -> Result<Settings> {
    let mut settings = Settings::new();
    for word in words {
        let refused =
            |message: &str, hint: &str| JobError::setting("set", word, message.to_owned(), hint.to_owned());
        let Some((key, value)) = word.split_once('=') else {
            return Err(refused("there is no `=`", "write key=value, such as training.steps=400"));
        };
        let value = value_of(value).ok_or_else(|| {
            refused("the value is no TOML", "write a number, true, false, \"a text\" or [a list]")
        })?;
        if settings.insert(key.trim().to_owned(), value).is_some() {
            return Err(refused("this key is set twice", "set each key once"));
        }
    }
    Ok(settings)
}

/// A value as JSON: TOML, or else the text itself. None for what begins as a list, a table or a text of TOML and is none, and for numbers that
/// are not finite.
fn value_of(text: &str) -> Option<Value> {
    let text = text.trim();
    let parsed: Option<toml::Value> = format!("value = {text}")
        .parse::<toml::Table>()
        .ok()
        .filter(|table| table.len() == 1)
        .and_then(|mut table| table.remove("value"));
    match parsed {
        Some(toml::Value::Datetime(_)) => Some(text.into()),
        Some(toml::Value::Float(number)) => serde_json::Number::from_f64(number).map(Value::Number),
        Some(value) => serde_json::to_value(value).ok(),
        None if text.starts_with(['[', '{', '"', '\'']) => None,
        None => Some(text.into()),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn read(words: &[&str]) -> Result<Value, String> {
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        settings_of(&words).map(|found| json!(found)).map_err(|error| error.to_string())
    }

    #[test]
    fn values_are_toml_and_bare_words_are_texts() {
        for (word, value) in [
            ("a=400", json!(400)),
            ("a=1e-3", json!(0.001)),
            ("a=2.0", json!(2.0)),
            ("a=true", json!(true)),
            ("a=diffraction", json!("diffraction")),
            ("a=\"4\"", json!("4")),
            ("a=[1, 2]", json!([1, 2])),
            ("a={b = 1}", json!({"b": 1})),
            ("a=/data/my photos", json!("/data/my photos")),
            ("a=x=y", json!("x=y")),
            ("a=2026-11-28", json!("2026-11-28")),
            ("a=", json!("")),
            ("a=1\nb=2", json!("1\nb=2")),
            ("a=1 # note", json!(1)),
        ] {
            assert_eq!(read(&[word]).unwrap()["a"], value, "{word}");
        }
        assert_eq!(read(&["a.b = 1", "c=x"]).unwrap(), json!({"a.b": 1, "c": "x"}));
    }

    #[test]
    fn what_is_no_setting_is_refused() {
        for (words, says) in [
            (&["steps"][..], "there is no `=`"),
            (&["a=[1"], "no TOML"),
            (&["a=\"x"], "no TOML"),
            (&["a=nan"], "no TOML"),
            (&["a=1", "a=2"], "set twice"),
        ] {
            let error = read(words).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }
}
