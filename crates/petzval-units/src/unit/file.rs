//! A file of units: one in each line, as JSON.

use std::collections::HashMap;
use std::path::Path;

use petzval_base::{FileError, write_whole};
use petzval_jobs::{JobError, Result};

use super::Unit;

/// Units in the order of their file.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitFile {
    /// The units; no two have one name.
    pub units: Vec<Unit>,
}

/// What is wrong in a file of units, with its line.
pub type UnitFileError = FileError;

impl UnitFile {
    /// Reads a file. The error names the file, the line and the key.
    pub fn read(path: &Path) -> Result<Self> {
        let text = petzval_base::read_text(path).map_err(|e| {
            JobError::input(
                format!("{}: {e}", path.display()),
                "give a file of units: one in each line, as JSON",
            )
        })?;
        let mut file = Self::parse(&text)
            .map_err(|error| JobError::File { path: path.to_owned(), error: Box::new(error) })?;
        file.units.iter_mut().for_each(|unit| unit.origin.file = Some(path.to_owned()));
        Ok(file)
    }

    /// Reads the text of a file. Empty lines and a byte order mark are skipped.
    pub fn parse(text: &str) -> Result<Self, UnitFileError> {
        let hint = "a unit is {\"name\": NAME, \"call\": {\"format\": 1, \"job\": JOB, \"request\": {...}}}, on one line";
        let mut units: Vec<Unit> = Vec::new();
        let mut lines = HashMap::new();
        for (number, line) in (1..).zip(text.trim_start_matches('\u{feff}').lines()) {
            if line.trim().is_empty() {
                continue;
            }
            let wrong = |key: &str, message: String, hint: &str| FileError {
                line: Some(number),
                hint: Some(hint.to_owned()),
                ..FileError::of_value(key, &message)
            };
            let mut read = serde_json::Deserializer::from_str(line);
            let mut unit: Unit = serde_path_to_error::deserialize(&mut read)
                .map_err(|e| wrong(&e.path().to_string(), e.inner().to_string(), hint))?;
            read.end().map_err(|e| wrong(".", e.to_string(), hint))?;
            check_name(&unit.name).map_err(|message| wrong("name", message, "give it a short name"))?;
            if let Some(other) = lines.insert(unit.name.clone(), number) {
                let message = format!("\"{}\" is the name of the unit in line {other} as well", unit.name);
                return Err(wrong("name", message, "give each unit a name of its own"));
            }
            unit.origin.line = Some(number);
            units.push(unit);
        }
        if units.is_empty() {
            return Err(FileError::of_value(".", "the file holds no unit").hint(hint));
        }
        Ok(Self { units })
    }

    /// The text of the file.
    pub fn text(&self) -> Result<String> {
        let mut text = String::new();
        for unit in &self.units {
            text += &serde_json::to_string(unit).map_err(|e| JobError::failed(e.to_string()))?;
            text.push('\n');
        }
        Ok(text)
    }

    /// Writes the file, wholly or not at all.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_whole(path, self.text()?.as_bytes()).map_err(|e| {
            JobError::system(format!("{}: {e}", path.display()), &e, "give a place that can be written")
        })
    }

    /// The units of these names, in the order of the file. The error names one that is not there, and one that comes near.
    pub fn named(&self, path: &Path, names: &[String]) -> Result<Vec<&Unit>> {
        let known: Vec<&str> = self.units.iter().map(|unit| unit.name.as_str()).collect();
        for name in names {
            if !known.contains(&name.as_str()) {
                let hint = petzval_base::nearest(name, &known)
                    .map_or_else(String::new, |near| format!("did you mean \"{near}\"?"));
                let message = format!("{} has no unit of this name", path.display());
                return Err(JobError::setting("name", name, message, hint));
            }
        }
        Ok(self.units.iter().filter(|unit| names.contains(&unit.name)).collect())
    }
}

/// As [`UnitFile::read`].
pub fn read_units(path: &Path) -> Result<UnitFile> {
    UnitFile::read(path)
}

/// Most bytes of a name.
const LONGEST: usize = 200;

fn check_name(name: &str) -> Result<(), String> {
    if name.is_empty() || name.len() > LONGEST || name.chars().any(char::is_control) {
        return Err(format!("a name has 1 to {LONGEST} bytes and no control characters"));
    }
    Ok(())
}
