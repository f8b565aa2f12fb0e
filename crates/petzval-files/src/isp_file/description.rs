//! The description of an external ISP: its command, and the parameters that it takes.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use petzval_base::FileError;
use petzval_base::parameter::{Parameter, Scale};
use petzval_camera::isp::IspParameter;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// An external ISP: a command that develops a frame, and its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ExternalIspFile {
    /// Its name, for messages and reports.
    pub name: String,
    /// Version of program and hardware; pictures of another version are not taken from the cache.
    pub version: String,
    /// Program and arguments.
    pub command: Vec<String>,
    /// Longest time for one frame, s.
    pub timeout_s: f64,
    /// How many times a frame is tried again after a failure.
    pub retries: u32,
    /// Frames that may be developed at the same time.
    pub parallel: usize,
    /// Folder of developed pictures, beside the description; none keeps nothing.
    pub cache: Option<String>,
    /// Its parameters.
    pub parameters: Vec<IspParameter>,
}

/// The description of an external ISP: its command, and the parameters that it takes.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Keys {
    /// Name, for messages and reports.
    name: String,
    /// Version of program and hardware; pictures of another version are not taken from the cache.
    #[serde(default)]
    version: String,
    /// Program and arguments: `["program", "argument"]`.
    command: Vec<String>,
    /// Longest time for one frame. Unit: s.
    #[serde(default = "minute")]
    #[schemars(range(min = 0.01, max = 86400.0))]
    timeout_s: f64,
    /// How many times a frame is tried again after a failure.
    #[serde(default)]
    #[schemars(range(max = 100))]
    retries: u32,
    /// Frames that may be developed at the same time.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 1024))]
    parallel: usize,
    /// Folder of developed pictures, beside the description; nothing is kept if it is left out.
    cache: Option<String>,
    /// Its parameters, at least one.
    #[serde(default)]
    parameter: Vec<ParameterKeys>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ParameterKeys {
    /// Name as `stage.key`, such as `tone.gamma`.
    name: String,
    /// Unit, for tables.
    #[serde(default)]
    unit: String,
    /// Least value.
    min: f64,
    /// Greatest value.
    max: f64,
    /// How it is best varied.
    #[serde(default)]
    scale: ScaleKey,
    /// Value unless it is set.
    default: f64,
    /// What it does, in one sentence.
    sentence: String,
}

#[derive(Clone, Copy, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum ScaleKey {
    /// By equal differences.
    #[default]
    Linear,
    /// By equal ratios.
    Log,
}

fn minute() -> f64 {
    60.0
}

fn one() -> usize {
    1
}

/// Reads the description of an external ISP and checks it.
pub fn parse_external_isp(text: &str) -> Result<ExternalIspFile, FileError> {
    let keys: Keys = FileError::read_toml(text)?;
    let wrong =
        |path: &[&str], message: &str, hint: &str| Err(FileError::at_key(text, path, message).hint(hint));
    if keys.command.first().is_none_or(|program| program.is_empty()) {
        return wrong(&["command"], "names no program", "write [\"program\", \"argument\", ...]");
    }
    if !(0.01..=86_400.0).contains(&keys.timeout_s) {
        return wrong(&["timeout_s"], "must lie between 0.01 and 86400", "one minute is 60");
    }
    if keys.retries > 100 {
        return wrong(&["retries"], "must lie between 0 and 100", "0 fails at the first failure");
    }
    if !(1..=1024).contains(&keys.parallel) {
        return wrong(&["parallel"], "must lie between 1 and 1024", "1 develops one frame after the other");
    }
    if keys.parameter.is_empty() {
        let hint = "describe each below a line [[parameter]]";
        return wrong(&["parameter"], "the ISP has no parameters", hint);
    }
    let mut names = BTreeSet::new();
    let mut parameters = Vec::new();
    for (i, p) in keys.parameter.into_iter().enumerate() {
        let place = i.to_string();
        let wrong = |key: &str, message: &str, hint: &str| wrong(&["parameter", &place, key], message, hint);
        if !is_name(&p.name) {
            let message = "is not stage.key";
            return wrong("name", message, "two names of letters, digits, `_` and `-`: \"tone.gamma\"");
        }
        if !names.insert(p.name.clone()) {
            return wrong("name", "an earlier parameter has this name", "give each its own");
        }
        if !(p.min.is_finite() && p.max.is_finite() && p.min < p.max) {
            return wrong("max", "is not above min", "both are numbers, and min is the lower one");
        }
        if matches!(p.scale, ScaleKey::Log) && p.min <= 0.0 {
            return wrong("min", "must be above 0 for scale = \"log\"", "or write scale = \"linear\"");
        }
        if !(p.min..=p.max).contains(&p.default) {
            return wrong("default", "lies outside min to max", "give a value of the range");
        }
        let key = p.name.split_once('.').map_or("", |(_, key)| key);
        let about = Parameter {
            name: kept(key),
            unit: kept(&p.unit),
            min: p.min,
            max: p.max,
            scale: match p.scale {
                ScaleKey::Linear => Scale::Linear,
                ScaleKey::Log => Scale::Log,
            },
            default: vec![p.default],
            sentence: p.sentence,
            hint: "see the description of the ISP",
        };
        parameters.push(IspParameter { name: p.name, about });
    }
    Ok(ExternalIspFile {
        name: keys.name,
        version: keys.version,
        command: keys.command,
        timeout_s: keys.timeout_s,
        retries: keys.retries,
        parallel: keys.parallel,
        cache: keys.cache.filter(|folder| !folder.is_empty()),
        parameters,
    })
}

/// Whether a text is `stage.key`, so that it is a path of bare TOML keys.
fn is_name(name: &str) -> bool {
    let is_key = |key: &str| {
        !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'))
    };
    name.split_once('.').is_some_and(|(stage, key)| is_key(stage) && is_key(key))
}

/// A text that lives as long as the program, as those of built-in parameters do. Each text is kept once.
fn kept(text: &str) -> &'static str {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut all = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(found) = all.get(text) {
        return found;
    }
    let text: &'static str = Box::leak(text.to_owned().into_boxed_str());
    all.insert(text);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAB: &str = r#"name = "Lab ISP"
version = "3"
command = ["python3", "isp.py"]
timeout_s = 20
retries = 2
cache = "cache"

[[parameter]]
name = "tone.gamma"
min = 1
max = 3
default = 2.2
sentence = "Exponent of the display curve."

[[parameter]]
name = "denoise.strength"
unit = "sigma"
min = 0.01
max = 10
scale = "log"
default = 1
sentence = "Strength."
"#;

    #[test]
    fn a_description_is_read() {
        let isp = parse_external_isp(LAB).unwrap();
        assert_eq!((isp.name.as_str(), isp.timeout_s, isp.retries, isp.parallel), ("Lab ISP", 20.0, 2, 1));
        assert_eq!(isp.cache.as_deref(), Some("cache"));
        let names: Vec<&str> = isp.parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["tone.gamma", "denoise.strength"]);
        let [gamma, strength] = [0, 1].map(|i| &isp.parameters[i].about);
        assert_eq!((gamma.name, gamma.unit, gamma.scale, gamma.min), ("gamma", "", Scale::Linear, 1.0));
        assert_eq!(
            (strength.unit, strength.scale, strength.value_at(0.5)),
            ("sigma", Scale::Log, 0.31622776601683794)
        );
        // Reading it again keeps no further texts.
        let again = parse_external_isp(LAB).unwrap();
        assert!(std::ptr::eq(again.parameters[1].about.unit, strength.unit));
    }

    #[test]
    fn errors_name_line_key_and_hint() {
        for (from, to, line, key, says) in [
            ("command = [\"python3\", \"isp.py\"]", "command = []", 3, "command", "program"),
            ("timeout_s = 20", "timeout_s = 0", 4, "timeout_s", "0.01"),
            ("timeout_s = 20", "time_out_s = 20", 4, "time_out_s", "timeout_s"),
            ("retries = 2", "retries = 101", 5, "retries", "100"),
            ("retries = 2", "parallel = 0", 5, "parallel", "1024"),
            ("name = \"tone.gamma\"", "name = \"gamma\"", 9, "name", "stage.key"),
            ("name = \"denoise.strength\"", "name = \"tone.gamma\"", 16, "name", "earlier"),
            ("max = 3", "max = 1", 11, "max", "above min"),
            ("min = 0.01", "min = 0", 18, "min", "log"),
            ("default = 2.2", "default = 7", 12, "default", "outside"),
            ("default = 2.2", "default = nan", 12, "default", "outside"),
            ("scale = \"log\"", "scale = \"logg\"", 20, "scale", "log"),
        ] {
            let error = parse_external_isp(&LAB.replace(from, to)).unwrap_err();
            assert_eq!((error.line, error.key.as_str()), (Some(line), key), "{error}");
            assert!(error.to_string().contains(says), "{error}");
        }
        let (head, _) = LAB.split_once("[[parameter]]").unwrap();
        assert!(parse_external_isp(head).unwrap_err().to_string().contains("[[parameter]]"));
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(line in 0usize..21, text in "\\PC{0,40}") {
            let mut lines: Vec<&str> = LAB.lines().collect();
            lines[line] = &text;
            let _ = parse_external_isp(&lines.join("\n"));
        }
    }
}
