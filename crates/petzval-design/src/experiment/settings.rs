//! Settings: values by their key paths, which take the place of those of an experiment's file.

use std::collections::BTreeMap;

use petzval_base::{FileError, SMALLER_NUMBER, WHOLE_NUMBERS_OF_TOML, nearest, quote};
use serde_json::Value as Json;
use toml::Value;

use super::{Experiment, former_keys};
use crate::error::WrongSetting;

/// Values of an experiment by key path: `training.steps`, `psf.kind`, `variant.end-to-end.stage.2.schedule.optics.learning_rate`.
///
/// An element of a list of tables is named by its `name`, or by its place from 0. A table as value sets each of its keys; a key path that is
/// set twice is refused. Null is no value.
pub type Settings = BTreeMap<String, Json>;

/// A single value at a path of keys.
struct Leaf {
    /// The setting that it comes from, as `key=value`.
    setting: String,
    /// Names of keys, as the setting has them.
    path: Vec<String>,
    value: Value,
}

/// The text of an experiment with settings in it.
pub(crate) struct WithSettings {
    /// The text.
    pub text: String,
    /// The values that were set: the setting as `key=value`, and the keys and places that lead to its value in the text.
    places: Vec<(String, Vec<String>)>,
}

impl WithSettings {
    /// Puts settings into the text of an experiment. `complete` is the experiment that the text itself gives: the lists of tables that the text
    /// leaves out are taken from it.
    ///
    /// Fails on unknown keys and values of the wrong type; ranges and rules are left to the checks of the experiment.
    pub fn new(text: &str, complete: &Experiment, settings: &Settings) -> Result<Self, WrongSetting> {
        let unreadable = |problem: String| WrongSetting {
            setting: listed(settings),
            message: format!("the experiment cannot be read: {problem}"),
            hint: String::new(),
        };
        let mut table: Value =
            text.parse::<toml::Table>().map(Value::Table).map_err(|e| unreadable(e.to_string()))?;
        let whole = toml::Table::try_from(complete).map_err(|e| unreadable(e.to_string()))?;
        let whole = Value::Table(whole);
        let mut leaves = Vec::new();
        for (key, value) in settings {
            let setting = in_words(key, value);
            let path: Vec<String> = key.split('.').map(|part| part.trim().to_owned()).collect();
            if path.iter().any(String::is_empty) {
                return Err(WrongSetting {
                    setting,
                    message: "the key has an empty part".to_owned(),
                    hint: "write keys as in training.steps".to_owned(),
                });
            }
            add_leaves(&setting, path, value, &mut leaves)?;
        }
        let mut places: Vec<(String, Vec<String>)> = Vec::new();
        for Leaf { setting, path, value } in leaves {
            let parts: Vec<&str> = path.iter().map(String::as_str).collect();
            let place = put(&mut table, Some(&whole), &parts, value)
                .map_err(|(message, hint)| WrongSetting { setting: setting.clone(), message, hint })?;
            if let Some((other, _)) = places.iter().find(|(_, known)| *known == place) {
                return Err(WrongSetting {
                    message: format!("`{other}` sets the same key"),
                    hint: "set each key once".to_owned(),
                    setting,
                });
            }
            places.push((setting, place));
        }
        check_types(&table, &whole, &places)?;
        let text = toml::to_string(&table).map_err(|e| unreadable(e.to_string()))?;
        Ok(Self { text, places })
    }

    /// An error of the text with the settings in it as one of the setting that it is about; of all of them where it is about another key.
    pub fn wrong(&self, error: &FileError, settings: &Settings) -> WrongSetting {
        let hint = error.hint.clone().unwrap_or_default();
        let is_at = |(_, path): &&(String, Vec<String>)| {
            let path: Vec<&str> = path.iter().map(String::as_str).collect();
            let place = FileError::at_key(&self.text, &path, "");
            error.line.is_some() && place.line == error.line
        };
        if let Some((setting, _)) = self.places.iter().find(is_at) {
            return WrongSetting { setting: setting.clone(), message: error.message.clone(), hint };
        }
        let bare = FileError { line: None, column: None, hint: None, ..error.clone() };
        WrongSetting { setting: listed(settings), message: bare.to_string(), hint }
    }

    /// Whether a path of keys and places holds a value that was set.
    pub fn is_set(&self, path: &[String]) -> bool {
        self.places.iter().any(|(_, place)| path.starts_with(place))
    }
}

/// Settings as `key=value` with commas between.
fn listed(settings: &Settings) -> String {
    settings.iter().map(|(key, value)| in_words(key, value)).collect::<Vec<_>>().join(", ")
}

/// A setting as `key=value`.
fn in_words(key: &str, value: &Json) -> String {
    let value = match value {
        Json::String(text) => text.clone(),
        other => other.to_string(),
    };
    format!("{key}={}", quote(&value))
}

/// Adds the single values of a setting: those of a table by their keys.
fn add_leaves(
    setting: &str,
    path: Vec<String>,
    value: &Json,
    leaves: &mut Vec<Leaf>,
) -> Result<(), WrongSetting> {
    if let Json::Object(keys) = value {
        return keys.iter().try_for_each(|(key, value)| {
            let below = path.iter().cloned().chain([key.clone()]).collect();
            add_leaves(setting, below, value, leaves)
        });
    }
    let value = Value::try_from(value).map_err(|_| {
        let (message, hint) = if has_number_beyond_toml(value) {
            (WHOLE_NUMBERS_OF_TOML, SMALLER_NUMBER)
        } else {
            (
                "this is no value of an experiment",
                "give a text, a number, true, false, or a list of them; leave the key out in place of null",
            )
        };
        WrongSetting { setting: setting.to_owned(), message: message.to_owned(), hint: hint.to_owned() }
    })?;
    leaves.push(Leaf { setting: setting.to_owned(), path, value });
    Ok(())
}

/// Whether a value, or one in its list, is a whole number that TOML cannot hold.
fn has_number_beyond_toml(value: &Json) -> bool {
    match value {
        Json::Number(number) => number.is_u64() && !number.is_i64(),
        Json::Array(values) => values.iter().any(has_number_beyond_toml),
        _ => false,
    }
}

/// Puts a value at a path of keys, and makes the tables that lead to it. Lists that are not there are taken from `whole`. Returns the path with
/// the places of elements in place of their names; message and hint where the path leads nowhere.
fn put(
    at: &mut Value,
    whole: Option<&Value>,
    path: &[&str],
    value: Value,
) -> Result<Vec<String>, (String, String)> {
    let Some((first, rest)) = path.split_first() else {
        *at = value;
        return Ok(Vec::new());
    };
    let (key, below, whole) = match at {
        Value::Table(table) => {
            let known = whole.and_then(|whole| whole.get(*first));
            let made = || match known {
                Some(list @ Value::Array(_)) => list.clone(),
                _ => Value::Table(toml::Table::new()),
            };
            ((*first).to_owned(), table.entry(*first).or_insert_with(made), known)
        }
        Value::Array(elements) => {
            let names: Vec<String> = elements.iter().enumerate().map(|(i, e)| name_of(e, i)).collect();
            let place = names.iter().position(|name| name == first).or_else(|| first.parse().ok());
            let Some(place) = place.filter(|place| *place < elements.len()) else {
                let near: Vec<&str> = names.iter().map(String::as_str).collect();
                let near = nearest(first, &near).map(|near| format!("did you mean `{near}`? "));
                let hint = format!("{}there are {}", near.unwrap_or_default(), names.join(", "));
                return Err((format!("there is no `{first}` in this list"), hint));
            };
            let known = whole.and_then(|whole| whole.get(place));
            (place.to_string(), &mut elements[place], known)
        }
        other => {
            let message = format!("`{first}` cannot lie below {}", quote(&other.to_string()));
            return Err((message, "that key holds a value and no table".to_owned()));
        }
    };
    let inner = put(below, whole, rest, value)?;
    Ok([key].into_iter().chain(inner).collect())
}

/// The name of an element of a list: that of a table, else its place.
fn name_of(element: &Value, place: usize) -> String {
    element.get("name").and_then(Value::as_str).map_or_else(|| place.to_string(), str::to_owned)
}

/// Fails on the first key that an experiment does not have, or whose value has another type.
fn check_types(table: &Value, whole: &Value, places: &[(String, Vec<String>)]) -> Result<(), WrongSetting> {
    let Err(error) = serde_path_to_error::deserialize::<_, Experiment>(table.clone()) else { return Ok(()) };
    let message = error.inner().message().trim().to_owned();
    let text = error.path().to_string().replace('[', ".").replace(']', "");
    let mut path: Vec<String> =
        text.split('.').filter(|part| !part.is_empty() && *part != "?").map(str::to_owned).collect();
    // The path may end above a key that is not known.
    let unknown = message.strip_prefix("unknown field `").and_then(|rest| rest.split('`').next());
    if let Some(unknown) = unknown.filter(|unknown| path.last().map(String::as_str) != Some(*unknown)) {
        path.push(unknown.to_owned());
    }
    let found = FileError::of_value(&path.join("."), &message);
    let of_set = |(_, place): &&(String, Vec<String>)| place.starts_with(&path) || path.starts_with(place);
    let set = places.iter().find(of_set);
    let setting = set.map_or_else(
        || places.iter().map(|(setting, _)| setting.as_str()).collect::<Vec<_>>().join(", "),
        |(setting, _)| setting.clone(),
    );
    let key = set.map(|(_, place)| place.last().cloned().unwrap_or_default()).unwrap_or_default();
    let elsewhere = if message.starts_with("unknown field") { paths_to(&key, whole) } else { Vec::new() };
    let hint = match (former_keys::hint_at(&path), &elsewhere[..], found.hint.clone()) {
        (Some(became), ..) => became,
        (None, [], hint) => hint.unwrap_or_default(),
        (None, known, _) => format!("did you mean {}?", in_a_choice(known)),
    };
    let bare = FileError { hint: None, ..found };
    Err(WrongSetting { setting, message: bare.to_string(), hint })
}

/// Most key paths that a hint names.
const NAMED: usize = 4;

/// Key paths in a sentence.
fn in_a_choice(paths: &[String]) -> String {
    let named: Vec<String> = paths.iter().take(NAMED).map(|path| format!("`{path}`")).collect();
    let more = if paths.len() > NAMED { " or others" } else { "" };
    format!("{}{more}", named.join(" or "))
}

/// Every key path of a whole experiment that ends in a key.
fn paths_to(key: &str, whole: &Value) -> Vec<String> {
    fn collect(at: &Value, path: &str, key: &str, found: &mut Vec<String>) {
        let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        match at {
            Value::Table(table) => {
                for (name, value) in table {
                    if name == key {
                        found.push(below(name));
                    }
                    collect(value, &below(name), key, found);
                }
            }
            Value::Array(elements) if elements.iter().all(Value::is_table) => {
                elements.iter().enumerate().for_each(|(i, e)| collect(e, &below(&name_of(e, i)), key, found));
            }
            _ => {}
        }
    }
    let mut found = Vec::new();
    collect(whole, "", key, &mut found);
    found
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn settings(of: Json) -> Settings {
        serde_json::from_value(of).unwrap()
    }

    fn set(text: &str, of: Json) -> Result<Experiment, WrongSetting> {
        let complete = Experiment::read(text).unwrap();
        let with = WithSettings::new(text, &complete, &settings(of))?;
        Ok(Experiment::read(&with.text).unwrap())
    }

    #[test]
    fn values_take_the_place_of_those_of_the_file_and_nothing_else_changes() {
        let text = "seed = 4\n[training]\nbatch = 2\n";
        let of = json!({
            "training.steps": 7, "psf.pitch_um": 2, "scoring.scores": ["ssim"], "psf": {"grid": 48},
            "variant.end-to-end.stage.2.schedule.optics.learning_rate": 0.25, "variant.0.noise": "off", "lens": "a b"
        });
        let found = set(text, of).unwrap();
        let mut wanted = Experiment::read(text).unwrap();
        wanted.training.steps = 7;
        (wanted.psf.pitch_um, wanted.psf.grid) = (2.0, 48);
        wanted.scoring.scores = vec!["ssim".to_owned()];
        wanted.lens = "a b".to_owned();
        wanted.variant[0].noise = Some(petzval_camera::sensor::NoiseMode::Off);
        let schedule = wanted.variant[2].stage[2].schedule.values_mut().next().unwrap();
        schedule.learning_rate = Some(0.25);
        assert_eq!(found, wanted);
        assert_eq!(set(text, json!({})).unwrap(), Experiment::read(text).unwrap());
    }

    #[test]
    fn a_wrong_setting_is_named_with_the_nearest_key() {
        for (of, setting, message, hint) in [
            (json!({"psf.gird": 64}), "psf.gird=64", "`psf.gird`: no such key here", "did you mean `grid`?"),
            (
                json!({"steps": 64, "seed": 2}),
                "steps=64",
                "`steps`: no such key here",
                "`optics.steps` or `training.steps`",
            ),
            (
                json!({"training.steps": "many"}),
                "training.steps=many",
                "`training.steps`: expected a number from 0",
                "",
            ),
            (json!({"psf.kind": "wave"}), "psf.kind=wave", "\"wave\": this key takes", ""),
            (
                json!({"variant.end-to-ned.noise": "off"}),
                "variant.end-to-ned.noise=off",
                "there is no `end-to-ned` in this list",
                "did you mean `end-to-end`? there are nominal, spot-optimised, end-to-end",
            ),
            (json!({"seed.x": 1}), "seed.x=1", "`x` cannot lie below 4", "that key holds a value"),
            (json!({"psf": {"grid": 64}, "psf.grid": 32}), "psf.grid=32", "sets the same key", "once"),
            (
                json!({"seed": u64::MAX}),
                "seed=18446744073709551615",
                "TOML holds whole numbers from",
                "write a smaller whole number",
            ),
            (json!({"seed": null}), "seed=null", "no value of an experiment", "in place of null"),
            (json!({"psf..grid": 1}), "psf..grid=1", "an empty part", "training.steps"),
        ] {
            let wrong = set("seed = 4\n", of).unwrap_err();
            assert_eq!(wrong.setting, setting);
            assert!(wrong.message.contains(message), "{wrong}");
            assert!(wrong.hint.contains(hint), "{wrong}");
        }
    }

    #[test]
    fn a_seed_that_a_run_could_not_write_is_refused_at_its_line() {
        let error = Experiment::read("lens = \"a\"\nseed = 18446744073709551615\n").unwrap_err();
        assert_eq!((error.line, error.key.as_str()), (Some(2), "seed"));
        assert!(error.message.contains("TOML holds whole numbers") && error.hint.is_some(), "{error}");
    }

    #[test]
    fn an_error_of_the_whole_names_the_setting_that_it_is_about() {
        let of = settings(json!({"psf.grid": 47, "seed": 3}));
        let with = WithSettings::new("seed = 4\n", &Experiment::default(), &of).unwrap();
        let odd = FileError::at_key(&with.text, &["psf", "grid"], "must be even").hint("take 48");
        let wrong = with.wrong(&odd, &of);
        assert_eq!(
            (wrong.setting.as_str(), wrong.message.as_str(), wrong.hint.as_str()),
            ("psf.grid=47", "must be even", "take 48")
        );
        let other = with.wrong(&FileError::at_key(&with.text, &["loss", "l1_weight"], "is zero"), &of);
        assert_eq!(
            (other.setting.as_str(), other.message.as_str()),
            ("psf.grid=47, seed=3", "`l1_weight`: is zero")
        );
        assert!(with.is_set(&["seed".to_owned()]) && !with.is_set(&["lens".to_owned()]));
    }
}
