//! An experiment by its keys: which differ, which are missing, which name inputs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use petzval_base::{FileError, quote};

use super::{BUILT_IN_PHOTOS, Experiment, NO_FILE, NO_ISP, STREET, is_derived_lens};

/// Whether a path leads to an input of this key: a file, or a folder where the key takes one. A folder is no lens, so that it hides no built-in one.
pub fn is_input(key: &[String], path: &Path) -> bool {
    let takes_folder = ["photos", "data"].contains(&key[0].as_str()) || key == ["psf", "file"];
    path.is_file() || takes_folder && path.is_dir()
}

impl Experiment {
    /// The keys in which this experiment differs from another, each with the value there: `training.steps`, `60`.
    pub fn differences(&self, other: &Self) -> Vec<(String, String)> {
        let whole = |e: &Self| toml::Value::Table(toml::Table::try_from(e).unwrap_or_default());
        let mut found = Vec::new();
        differences("", Some(&whole(self)), Some(&whole(other)), &mut found);
        found
    }

    /// Every value by its key, such as `psf.grid` and `variant.0.name`.
    pub fn values(&self) -> BTreeMap<String, String> {
        let whole = toml::Value::Table(toml::Table::try_from(self).unwrap_or_default());
        let mut found = BTreeMap::new();
        add_values("", &whole, &mut found);
        found
    }

    /// Every lens, sensor, ISP, network, data set and bank of PSFs that the experiment names, each with its key. Words that name no file are not among
    /// them: the perfect lens, no ISP, the built-in photographs, the generated streets.
    pub fn inputs_mut(&mut self) -> impl Iterator<Item = (Vec<String>, &mut String)> {
        let key = |parts: &[&str]| parts.iter().map(|part| (*part).to_owned()).collect::<Vec<_>>();
        let of_variants = self.variant.iter_mut().enumerate().flat_map(move |(i, v)| {
            let key = |name: &str| vec!["variant".to_owned(), i.to_string(), name.to_owned()];
            let lens = v.lens.as_mut().filter(|name| !is_derived_lens(name)).map(|lens| (key("lens"), lens));
            lens.into_iter().chain(v.optics_proxy.as_mut().map(|proxy| (key("optics_proxy"), proxy)))
        });
        let is_file = !self.network.draws_weights() && !self.network.has_built_in_weights();
        let weights = Some(&mut self.network.weights).filter(|_| is_file);
        let psfs = Some(&mut self.psf.file).filter(|file| *file != NO_FILE);
        let preset = Some(&mut self.isp.preset).filter(|preset| *preset != NO_ISP);
        let photos = Some(&mut self.photos).filter(|photos| *photos != BUILT_IN_PHOTOS);
        let data = Some(&mut self.data).filter(|data| *data != STREET);
        [
            Some((key(&["lens"]), &mut self.lens)),
            Some((key(&["sensor"]), &mut self.sensor)),
            photos.map(|photos| (key(&["photos"]), photos)),
            data.map(|data| (key(&["data"]), data)),
        ]
        .into_iter()
        .flatten()
        .chain(weights.map(|weights| (key(&["network", "weights"]), weights)))
        .chain(psfs.map(|file| (key(&["psf", "file"]), file)))
        .chain(preset.map(|preset| (key(&["isp", "preset"]), preset)))
        .chain(self.detector.weights.as_mut().map(|weights| (key(&["detector", "weights"]), weights)))
        .chain(of_variants)
    }

    /// Refuses the text of a run's `config.toml` that lacks a key of its record, the `complete`: a default in place of a key that was lost would
    /// make another run of it. Keys that are younger than a run are not in its record.
    pub(crate) fn check_complete(text: &str, complete: &serde_json::Value) -> Result<(), FileError> {
        let found: serde_json::Value = toml::from_str(text).map_err(|e| FileError::from_toml(text, &e))?;
        match missing_key(&found, complete) {
            None => Ok(()),
            Some(key) => Err(FileError::at_key(text, &[&key], "is missing")
                .hint("the config.toml of a run holds every key; put it back as it was")),
        }
    }
}

/// Adds the paths at which two values differ, each with the second value.
fn differences(
    path: &str,
    one: Option<&toml::Value>,
    other: Option<&toml::Value>,
    found: &mut Vec<(String, String)>,
) {
    use toml::Value;
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match (one, other) {
        (Some(Value::Table(a)), Some(Value::Table(b))) => {
            let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            keys.into_iter().for_each(|key| differences(&below(key), a.get(key), b.get(key), found));
        }
        (Some(Value::Array(a)), Some(Value::Array(b))) => {
            let places = 0..a.len().max(b.len());
            places.for_each(|i| differences(&below(&i.to_string()), a.get(i), b.get(i), found));
        }
        _ if one == other => {}
        _ => found.push((path.to_owned(), other.map_or("not there".to_owned(), |v| quote(&v.to_string())))),
    }
}

/// Adds the values below a path by their keys.
fn add_values(path: &str, value: &toml::Value, found: &mut BTreeMap<String, String>) {
    use toml::Value;
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Table(table) => table.iter().for_each(|(key, value)| add_values(&below(key), value, found)),
        Value::Array(all) if all.iter().any(Value::is_table) => {
            all.iter().enumerate().for_each(|(i, value)| add_values(&below(&i.to_string()), value, found));
        }
        _ => drop(found.insert(path.to_owned(), value.to_string())),
    }
}

/// The path of the first key of `whole` that `found` does not have: `psf.grid`, `variant.0.name`.
fn missing_key(found: &serde_json::Value, complete: &serde_json::Value) -> Option<String> {
    use serde_json::Value;
    let pairs: Vec<(String, Option<&Value>, &Value)> = match (found, complete) {
        (Value::Object(found), Value::Object(complete)) => {
            complete.iter().map(|(key, value)| (key.clone(), found.get(key), value)).collect()
        }
        (Value::Array(found), Value::Array(complete)) => {
            complete.iter().enumerate().map(|(i, value)| (i.to_string(), found.get(i), value)).collect()
        }
        _ => return None,
    };
    pairs.into_iter().find_map(|(key, found, complete)| match found {
        None => Some(key),
        Some(found) => missing_key(found, complete).map(|below| format!("{key}.{below}")),
    })
}
