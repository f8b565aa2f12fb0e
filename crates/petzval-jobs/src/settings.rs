//! Settings as words of a command line: `key=value`, where the value is TOML.

use petzval_base::{SMALLER_NUMBER, WHOLE_NUMBERS_OF_TOML};
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
        let value = value_of(value).map_err(|NoValue { message, hint }| refused(message, hint))?;
        if settings.insert(key.trim().to_owned(), value).is_some() {
            return Err(refused("this key is set twice", "set each key once"));
        }
    }
    Ok(settings)
}

/// Why a text is no value.
struct NoValue {
    message: &'static str,
    hint: &'static str,
}

/// A value as JSON: TOML, or else the text itself. Fails for what begins as a list, a table or a text of TOML and is none, for numbers that are not
/// finite, and for whole numbers that TOML cannot hold.
fn value_of(text: &str) -> Result<Value, NoValue> {
    const NO_TOML: NoValue = NoValue {
        message: "the value is no TOML",
        hint: "write a number, true, false, \"a text\" or [a list]",
    };
    let text = text.trim();
    let parsed: Option<toml::Value> = format!("value = {text}")
        .parse::<toml::Table>()
        .ok()
        .filter(|table| table.len() == 1)
        .and_then(|mut table| table.remove("value"));
    match parsed {
        Some(toml::Value::Datetime(_)) => Ok(text.into()),
        Some(value) if !is_finite(&value) => Err(NoValue {
            message: "a number in the value is not finite",
            hint: "write a number such as 4 or 1e-3",
        }),
        Some(value) => serde_json::to_value(value).map_err(|_| NO_TOML),
        None if has_number_beyond_toml(text) => {
            Err(NoValue { message: WHOLE_NUMBERS_OF_TOML, hint: SMALLER_NUMBER })
        }
        None if text.starts_with(['[', '{', '"', '\'']) => Err(NO_TOML),
        None => Ok(text.into()),
    }
}

/// Whether a text is a whole number that TOML cannot hold, or a list with one.
fn has_number_beyond_toml(text: &str) -> bool {
    let is_beyond = |word: &str| {
        let plain = word.trim().replace('_', "");
        let digits = plain.strip_prefix(['+', '-']).unwrap_or(&plain);
        let is_whole = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
        is_whole && plain.parse::<i64>().is_err()
    };
    match text.strip_prefix('[') {
        Some(list) => list.split(['[', ']', ',']).any(is_beyond),
        None => is_beyond(text),
    }
}

/// Whether every number of a value is finite: JSON has no others.
fn is_finite(value: &toml::Value) -> bool {
    match value {
        toml::Value::Float(number) => number.is_finite(),
        toml::Value::Array(values) => values.iter().all(is_finite),
        toml::Value::Table(keys) => keys.values().all(is_finite),
        _ => true,
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
            (&["a=[1, nan]"], "is not finite"),
            (&["a=nan"], "is not finite"),
            (&["a=-inf"], "is not finite"),
            (&["a=18446744073709551615"], "TOML holds whole numbers from"),
            (&["a=-9_223_372_036_854_775_809"], "TOML holds whole numbers from"),
            (&["a=[1, 99999999999999999999]"], "TOML holds whole numbers from"),
            (&["a=1", "a=2"], "set twice"),
        ] {
            let error = read(words).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }
}
