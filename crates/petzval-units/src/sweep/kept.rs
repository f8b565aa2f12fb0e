//! A sweep as its store keeps it: `sweep.json` with what varies and the key of every unit, and `units.jsonl` with the units themselves.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use petzval_base::{nearest, write_whole};
use petzval_jobs::{Context, JobError, Result, json};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::file::{Level, Source};
use super::plan::Plan;
use crate::store::Store;
use crate::unit::{Digests, Key, Prepared, Unit, UnitFile};

/// The version of `sweep.json` that this program writes and reads.
const FORMAT: u32 = 1;

/// The file in the folder of a store that says what varies.
const SWEEP: &str = "sweep.json";

/// The file of the units.
const UNITS: &str = "units.jsonl";

/// The file of the sweep as it was when its units were made.
const COPY: &str = "sweep.toml";

/// The folder of the output of tasks.
const LOGS: &str = "logs";

/// A sweep with the keys of its units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptSweep {
    /// Version of this form.
    format: u32,
    /// Title.
    pub title: String,
    /// The job of every unit.
    pub job: String,
    /// The file, as it was named.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub file: PathBuf,
    /// Keys that vary.
    pub keys: Vec<String>,
    /// Instruction set of every unit.
    pub simd: Level,
    /// Threads of a unit; 0 means those that the machine or the cluster gives.
    pub threads: usize,
    /// The units.
    pub units: Vec<KeptUnit>,
}

/// A unit by its name and its key in the store.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KeptUnit {
    /// Its name.
    pub name: String,
    /// Its key in the store.
    pub key: Key,
    /// The values of the keys that vary, in their order.
    pub values: Vec<Value>,
    /// The variant that it makes alone.
    pub variant: Option<String>,
    /// Its seed, where the sweep names any.
    pub seed: Option<u64>,
}

/// Names the units of a plan, and their keys. Fails if a unit cannot be run, or if two would run the same.
pub fn keyed(plan: &Plan, source: &Source, context: &Context) -> Result<(KeptSweep, UnitFile)> {
    let digests = Digests::default();
    let mut known: HashMap<Key, &str> = HashMap::new();
    let (mut kept, mut units) = (Vec::new(), Vec::new());
    for (place, planned) in plan.units.iter().enumerate() {
        context.check(|| format!("stopped after the keys of {place} of {} units", plan.units.len()))?;
        let unit =
            Unit { simd: plan.simd.name().to_owned(), ..Unit::new(&planned.name, planned.call.clone()) };
        let prepared = Prepared::new(&unit, context, &digests)?;
        if let Some(same) = known.insert(prepared.key.clone(), &planned.name) {
            let message = format!(
                "{}: the units `{same}` and `{}` would run the same",
                source.path.display(),
                planned.name
            );
            return Err(JobError::input(
                message,
                "files of one content are one input: leave one of the two out",
            ));
        }
        kept.push(KeptUnit {
            name: planned.name.clone(),
            key: prepared.key.clone(),
            values: planned.values.clone(),
            variant: planned.variant.clone(),
            seed: planned.seed,
        });
        // Inputs may change before a task begins the unit, whose result the sweep would not know.
        units.push(Unit { key: Some(prepared.key), ..unit });
    }
    let sweep = KeptSweep {
        format: FORMAT,
        title: plan.title.clone(),
        job: plan.job.clone(),
        file: source.path.clone(),
        keys: plan.keys.clone(),
        simd: plan.simd,
        threads: plan.threads,
        units: kept,
    };
    Ok((sweep, UnitFile { units }))
}

impl KeptSweep {
    /// Keeps the sweep in a store, which is made if it is not there. Results that the store has of the same units count.
    pub fn keep(&self, units: &UnitFile, source: &Source, root: &Path) -> Result<Store> {
        let store = Store::open_or_new(root)?;
        let root = store.root();
        let write = |name: &str, text: &str| {
            let path = root.join(name);
            write_whole(&path, text.as_bytes()).map_err(|e| {
                JobError::system(format!("{}: {e}", path.display()), &e, "name a store that can be written")
            })
        };
        units.write(&root.join(UNITS))?;
        write(COPY, &source.text)?;
        let logs = root.join(LOGS);
        std::fs::create_dir_all(&logs).map_err(|e| {
            JobError::system(format!("{}: {e}", logs.display()), &e, "name a store that can be written")
        })?;
        // Last: a store that has it has all of the sweep.
        write(SWEEP, &json(self)?)?;
        Ok(store)
    }

    /// Whether a folder is the store of a sweep.
    pub fn is_in(root: &Path) -> bool {
        root.join(SWEEP).is_file()
    }

    /// Reads the sweep of a store.
    pub fn read(root: &Path) -> Result<Self> {
        let path = root.join(SWEEP);
        if !Self::is_in(root) {
            let message = format!("{}: no sweep is kept here: there is no {SWEEP}", root.display());
            return Err(JobError::input(message, "give the folder that `petzval sweep` had as --store"));
        }
        let text = petzval_base::read_text(&path)
            .map_err(|e| JobError::input(format!("{}: {e}", path.display()), ""))?;
        /// A later form may have other keys.
        #[derive(Deserialize)]
        struct Form {
            format: u32,
        }
        let damaged = |e: serde_json::Error| {
            let hint = "`petzval sweep FILE --store DIR` writes it again; no result is lost";
            JobError::input(format!("{}: {e}", path.display()), hint)
        };
        let Form { format } = serde_json::from_str(&text).map_err(damaged)?;
        if format != FORMAT {
            let message = format!("{}: format {format}, and this program reads {FORMAT}", path.display());
            return Err(JobError::input(message, "use the version of Petzval that wrote it"));
        }
        serde_json::from_str(&text).map_err(damaged)
    }

    /// The unit of a name. The error names one that comes near.
    pub fn named(&self, name: &str) -> Result<&KeptUnit> {
        self.units.iter().find(|unit| unit.name == name).ok_or_else(|| {
            let names: Vec<&str> = self.units.iter().map(|unit| unit.name.as_str()).collect();
            let hint = match nearest(name, &names) {
                Some(near) => format!("did you mean `{near}`?"),
                None => "`petzval sweep status DIR` lists the units".to_owned(),
            };
            JobError::setting("retry", name, "the sweep has no unit of this name", hint)
        })
    }
}

/// The store of a sweep that names none.
pub fn usual_store(file: &Path) -> PathBuf {
    let stem = file.file_stem().map_or_else(|| "sweep".into(), |stem| stem.to_os_string());
    Path::new("sweeps").join(stem)
}

/// The file of the units of a sweep in its store.
pub fn units_file(root: &Path) -> PathBuf {
    root.join(UNITS)
}

/// The folder of the output of its tasks.
pub fn logs_folder(root: &Path) -> PathBuf {
    root.join(LOGS)
}
