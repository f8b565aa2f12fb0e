//! Settings of an ISP: values of its parameters by stage and key.

use petzval_base::FileError;
use petzval_camera::isp::IspParameter;
use schemars::JsonSchema;
use serde::Deserialize;
use toml::{Table, Value};

/// Values of parameters of an external ISP, in tables by stage: `[settings.tone]`, below it `gamma = 2.2`; the numbers of an array in a
/// list.
#[derive(Clone, Debug, PartialEq)]
pub struct IspSettingsFile {
    /// The description of the ISP, relative to this file.
    pub isp: String,
    tables: Table,
    text: String,
}

/// Settings of an external ISP.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Keys {
    /// The description of the ISP, relative to this file.
    isp: String,
    /// What the settings are for, in words; not read.
    #[serde(default, rename = "about")]
    _about: String,
    /// Values by stage and key: `[settings.tone]`, below it `gamma = 2.2`.
    #[serde(default)]
    #[schemars(with = "std::collections::BTreeMap<String, serde_json::Value>")]
    settings: Table,
}

impl IspSettingsFile {
    /// Reads settings; their values are checked once the ISP is known.
    pub(super) fn parse(text: &str) -> Result<Self, FileError> {
        let keys: Keys = FileError::read_toml(text)?;
        Ok(Self { isp: keys.isp, tables: keys.settings, text: text.to_owned() })
    }

    /// The values of all parameters of an ISP; those that the file leaves out have their defaults.
    ///
    /// Fails at the line of a stage or key that the ISP does not have, and of a value outside its range.
    pub fn values(&self, parameters: &[IspParameter]) -> Result<Vec<f64>, FileError> {
        let mut values: Vec<f64> = parameters.iter().map(IspParameter::default_value).collect();
        for (stage, table) in &self.tables {
            let at = |path: &[&str], message: &str| {
                FileError::at_key(&self.text, &[&["settings"], path].concat(), message)
            };
            let Value::Table(table) = table else {
                let message = "expected a table of parameters";
                return Err(at(&[stage], message).hint("write [settings.stage], and below it key = value"));
            };
            let keys = keys_of(parameters, stage);
            if keys.is_empty() {
                let mut stages: Vec<&str> = parameters.iter().map(|p| split(&p.name).0).collect();
                stages.dedup();
                let hint = format!("its stages are {}", stages.join(", "));
                return Err(at(&[stage], "the ISP has no such stage").without_value().hint(hint));
            }
            for (key, value) in table {
                let numbers: Vec<(Option<usize>, usize)> = (0..parameters.len())
                    .filter(|i| {
                        split(&parameters[*i].name).0 == stage && split(&parameters[*i].name).1 == key
                    })
                    .map(|i| (split(&parameters[i].name).2, i))
                    .collect();
                let given: Vec<&Value> = match value {
                    Value::Array(list) => list.iter().collect(),
                    single => vec![single],
                };
                if numbers.is_empty() {
                    let hint = format!("its keys are {}", keys.join(", "));
                    return Err(at(&[stage, key], "the ISP has no such parameter").hint(hint));
                }
                if given.len() != numbers.len() || value.is_array() != numbers[0].0.is_some() {
                    let need = match numbers[0].0 {
                        Some(_) => format!("expected a list of {} numbers", numbers.len()),
                        None => "expected a number".to_owned(),
                    };
                    return Err(at(&[stage, key], &need));
                }
                for (value, (_, i)) in given.into_iter().zip(numbers) {
                    let about = &parameters[i].about;
                    let number = value.as_float().or(value.as_integer().map(|v| v as f64));
                    let Some(number) = number else {
                        return Err(at(&[stage, key], "expected a number"));
                    };
                    if !(about.min..=about.max).contains(&number) {
                        let message = format!("must lie between {} and {}", about.min, about.max);
                        return Err(at(&[stage, key], &message).hint(about.hint));
                    }
                    values[i] = number;
                }
            }
        }
        Ok(values)
    }
}

/// Stage, key, and place in an array of a name `stage.key` or `stage.key[i]`.
fn split(name: &str) -> (&str, &str, Option<usize>) {
    let (stage, key) = name.split_once('.').unwrap_or(("", name));
    match key.strip_suffix(']').and_then(|key| key.split_once('[')) {
        Some((key, place)) => (stage, key, place.parse().ok()),
        None => (stage, key, None),
    }
}

/// Stage and key of a name, without the place in an array.
pub(super) fn key_path(name: &str) -> (&str, &str) {
    let (stage, key, _) = split(name);
    (stage, key)
}

/// Keys of a stage, each once, in their order.
fn keys_of<'a>(parameters: &'a [IspParameter], stage: &str) -> Vec<&'a str> {
    let names = parameters.iter().map(|p| split(&p.name));
    let mut keys: Vec<&str> = names.filter(|(s, ..)| *s == stage).map(|(_, key, _)| key).collect();
    keys.dedup();
    keys
}

/// The text of a settings file of an external ISP with every parameter, each below its sentence. `about` says what it is for.
pub fn settings_toml(about: &str, isp: &str, parameters: &[IspParameter], values: &[f64]) -> String {
    let head = format!("about = {}\nisp = {}\n", Value::from(about), Value::from(isp));
    format!("{head}{}", stages_toml(parameters, values))
}

/// Tables `[settings.stage]` with every parameter below its sentence.
pub(super) fn stages_toml(parameters: &[IspParameter], values: &[f64]) -> String {
    let written = |value: f64| Value::Float(value).to_string();
    let mut text = String::new();
    let mut stage_now = "";
    let mut i = 0;
    while i < parameters.len() {
        let (stage, key, place) = split(&parameters[i].name);
        if stage != stage_now {
            text += &format!("\n[settings.{stage}]\n");
            stage_now = stage;
        }
        let about = &parameters[i].about;
        let unit = if about.unit.is_empty() { String::new() } else { format!(" {}", about.unit) };
        let sentence = about.sentence.replace(['\n', '\r'], " ");
        text += &format!("# {sentence} {}..{}{unit}\n", about.min, about.max);
        // The numbers of an array stand together.
        let is_same = |p: &&IspParameter| split(&p.name).0 == stage && split(&p.name).1 == key;
        let count = if place.is_some() { parameters[i..].iter().take_while(is_same).count() } else { 1 };
        text += &format!("{key} = ");
        match place {
            Some(_) => {
                let list: Vec<String> = values[i..i + count].iter().map(|v| written(*v)).collect();
                text += &format!("[{}]\n", list.join(", "));
            }
            None => text += &format!("{}\n", written(values[i])),
        }
        i += count;
    }
    text
}

#[cfg(test)]
mod tests {
    use petzval_base::parameter::{Parameter, Scale};

    use super::*;

    fn parameters() -> Vec<IspParameter> {
        let one = |name: &str, default: f64| IspParameter {
            name: name.to_owned(),
            about: Parameter {
                name: "key",
                unit: "dB",
                min: 0.0,
                max: 10.0,
                scale: Scale::Linear,
                default: vec![default],
                sentence: "A number.".to_owned(),
                hint: "give a small one",
            },
        };
        vec![
            one("gain.red", 1.0),
            one("gain.blue", 2.0),
            one("tone.knots[0]", 3.0),
            one("tone.knots[1]", 4.0),
        ]
    }

    fn values(text: &str) -> Result<Vec<f64>, FileError> {
        IspSettingsFile::parse(text)?.values(&parameters())
    }

    #[test]
    fn what_is_written_reads_back() {
        let written = settings_toml("Tuned.", "lab \"7\".toml", &parameters(), &[0.1, 1.0 / 3.0, 5.0, 6e-7]);
        let file = IspSettingsFile::parse(&written).unwrap();
        assert_eq!(file.isp, "lab \"7\".toml");
        assert_eq!(file.values(&parameters()).unwrap(), [0.1, 1.0 / 3.0, 5.0, 6e-7], "{written}");
        assert!(written.contains("\n# A number. 0..10 dB\nblue = 0.333"), "{written}");
        assert!(written.contains("\n[settings.tone]\n") && written.contains("knots = [5.0, "), "{written}");
    }

    #[test]
    fn keys_that_are_left_out_have_their_defaults() {
        assert_eq!(values("isp = \"a\"\n[settings.gain]\nblue = 7").unwrap(), [1.0, 7.0, 3.0, 4.0]);
        assert_eq!(values("isp = \"a\"").unwrap(), [1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn errors_name_line_key_and_hint() {
        for (text, line, key, says) in [
            ("isp = \"a\"\n[settings.gian]\nblue = 7", None, "gian", "gain, tone"),
            ("isp = \"a\"\n[settings.gain]\nbleu = 7", Some(3), "bleu", "red, blue"),
            ("isp = \"a\"\n[settings.gain]\nblue = 11", Some(3), "blue", "between 0 and 10"),
            ("isp = \"a\"\n[settings.gain]\nblue = nan", Some(3), "blue", "between 0 and 10"),
            ("isp = \"a\"\n[settings.gain]\nblue = \"x\"", Some(3), "blue", "a number"),
            ("isp = \"a\"\n[settings.gain]\nblue = [1]", Some(3), "blue", "a number"),
            ("isp = \"a\"\n[settings.tone]\nknots = [1]", Some(3), "knots", "2 numbers"),
            ("isp = \"a\"\n[settings.tone]\nknots = 1", Some(3), "knots", "2 numbers"),
            ("isp = \"a\"\nsettings.gain = 1", Some(2), "gain", "table"),
            ("isp = 1", Some(1), "isp", "text"),
            ("isp = \"a\"\n[gain", Some(2), "", ""),
            ("isp = \"a\"\n[gain]\nred = 1", None, "gain", "settings"),
        ] {
            let error = values(text).unwrap_err();
            assert!(line.is_none() || error.line == line, "{text}: {error:?}");
            assert_eq!(error.key, key, "{error}");
            assert!(error.to_string().contains(says), "{error}");
        }
    }
}
