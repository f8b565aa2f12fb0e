//! A unit that can be run, with its key.

use std::path::{Path, PathBuf};

use petzval_jobs::{CALL_FORMAT, Context, JobError, NOWHERE, Result, Row};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::digest::{Digests, InputDigest};
use super::job::row_of_unit;
use super::key::Key;
use super::{UNIT_FORMAT, Unit};

/// A unit that can be run: its request is complete and checked, its inputs are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepared {
    /// The unit as it was given.
    pub unit: Unit,
    /// Its key.
    pub key: Key,
    /// Its request with every default and the seed of the unit. Results go to a folder that stands for any if the job writes some.
    pub request: Value,
    /// Files and folders that the request names, and those that a named experiment names.
    pub inputs: Vec<InputDigest>,
}

impl Prepared {
    /// Checks a unit and computes its key.
    ///
    /// The key is the SHA-256 of JSON with sorted keys: form, job, complete request with the seed of the unit, glasses, device, version,
    /// instruction set. A text of the request that is the path of a file or a folder counts by its content: `sha256:` and the digest. So do
    /// files that an experiment names, whether the experiment is a file or stands in the request as TOML. Threads and the folder of results do
    /// not count, nor does the folder in which inputs lie.
    ///
    /// Fails if the call is of another form, if the request does not fit its schema or has a number out of range, or if a seed is given and the
    /// job draws nothing at random. Fails if an input cannot be read, or if the unit has a key and it is another one.
    pub fn new(unit: &Unit, context: &Context, digests: &Digests) -> Result<Self> {
        let named = |error: JobError| match error {
            JobError::Input { message, hint, .. } => unit.refused(&message, hint),
            JobError::Setting { ref hint, .. } => unit.refused(&error.to_string(), hint),
            // What is wrong in a file that the unit names is shown there.
            other => other,
        };
        Self::of(unit, context, digests).map_err(named)
    }

    /// As [`Prepared::new`], for a unit that is to be run. Fails as [`Unit::check`] does as well.
    pub fn checked(unit: &Unit, context: &Context, digests: &Digests) -> Result<Self> {
        unit.check()?;
        Self::new(unit, context, digests)
    }

    fn of(unit: &Unit, context: &Context, digests: &Digests) -> Result<Self> {
        // The key has no place for it: a later form would be taken for this one.
        if unit.call.format != CALL_FORMAT {
            let message = format!("`call.format` is {}, which is not known", unit.call.format);
            return Err(JobError::input(
                message,
                format!("this program reads and writes format {CALL_FORMAT}"),
            ));
        }
        let row = row_of_unit(&unit.call.job)?;
        let request = complete(unit, row)?;
        let mut inputs = Inputs { digests, found: Vec::new() };
        let known = inputs.by_content(&request, is_path)?;
        let behind = row.behind(request.clone(), context)?;
        let behind = behind.iter().map(|path| inputs.add(path)).collect::<Result<Vec<_>, _>>()?;
        let glasses = unit.call.glasses.iter().map(|path| inputs.add(path)).collect::<Result<Vec<_>, _>>()?;
        let all = json!({
            "format": UNIT_FORMAT,
            "job": unit.call.job,
            "request": known,
            "behind": behind,
            "glasses": glasses,
            "device": unit.call.device,
            "version": unit.version,
            "simd": unit.simd,
        });
        let key = Key::of(Sha256::new_with_prefix(all.to_string()));
        if unit.key.as_ref().is_some_and(|then| *then != key) {
            return Err(changed(&inputs.found));
        }
        Ok(Self { unit: unit.clone(), key, request, inputs: inputs.found })
    }

    /// The row of its job.
    pub fn row(&self) -> Result<&'static Row> {
        row_of_unit(&self.unit.call.job)
    }
}

/// The error of a unit that no longer is what it was when its file was made.
fn changed(inputs: &[InputDigest]) -> JobError {
    let paths: Vec<String> = inputs.iter().map(|input| input.path.display().to_string()).collect();
    let of = if paths.is_empty() { String::new() } else { format!(": {}", paths.join(", ")) };
    JobError::input(
        format!("its request or its inputs have changed since the file of units was made{of}"),
        "`petzval sweep FILE --store DIR` makes the units anew, and passes those over that have not changed; or put the inputs back",
    )
}

/// The request with every default, the seed of the unit, and nowhere to write to. It may leave its folder of results out.
fn complete(unit: &Unit, row: &Row) -> Result<Value> {
    let given = &unit.call.request;
    let request = row.filled_in_as_unit(given.clone()).map_err(|wrong| row.refused(wrong, given))?;
    if let Some(wrong) = row.out_of_range(given) {
        return Err(row.refused(wrong, given));
    }
    let request = match unit.seed {
        None => request,
        Some(seed) => row.seeded(request, seed)?.ok_or_else(|| {
            let message = format!("`seed` is {seed}, and the job `{}` draws nothing at random", row.name);
            JobError::input(message, "leave the seed out")
        })?,
    };
    row.kept_in(request, Path::new(NOWHERE))
}

/// Inputs as they are found.
struct Inputs<'a> {
    digests: &'a Digests,
    found: Vec<InputDigest>,
}

impl Inputs<'_> {
    /// A request, in which texts that `is_input` takes for paths stand for what is there. So it is in a file of TOML that stands in it.
    fn by_content(&mut self, of: &Value, is_input: fn(&str) -> bool) -> Result<Value> {
        Ok(match of {
            Value::String(text) if is_input(text) => self.add(Path::new(text))?.into(),
            Value::String(text) if text.contains('\n') => match toml::from_str(text) {
                Ok(inline) => self.by_content(&inline, is_whole_path)?,
                Err(_other_text) => of.clone(),
            },
            Value::Array(items) => {
                let items = items.iter().map(|item| self.by_content(item, is_input));
                Value::Array(items.collect::<Result<_>>()?)
            }
            Value::Object(keys) => {
                let by_content =
                    |(key, value): (&String, &Value)| Ok((key.clone(), self.by_content(value, is_input)?));
                Value::Object(keys.iter().map(by_content).collect::<Result<_>>()?)
            }
            other => other.clone(),
        })
    }

    fn add(&mut self, path: &Path) -> Result<String> {
        let digest = self.digests.of(path).map_err(|e| {
            JobError::input(format!("{}: {e}", path.display()), "an input of a unit has to be readable")
        })?;
        let text = format!("sha256:{}", digest.sha256);
        if !self.found.contains(&digest) {
            self.found.push(digest);
        }
        Ok(text)
    }
}

/// Whether a text of a request is the path of something that exists. The text of a whole file is none.
fn is_path(text: &str) -> bool {
    let is_short = !text.is_empty() && text.len() < 4096 && !text.contains('\n');
    is_short && !text.starts_with(NOWHERE) && ![".", ".."].contains(&text) && PathBuf::from(text).exists()
}

/// Whether a text of a file is the path of something that exists. Its words are none, whatever lies in the folder of the program.
fn is_whole_path(text: &str) -> bool {
    Path::new(text).is_absolute() && is_path(text)
}
