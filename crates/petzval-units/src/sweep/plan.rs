//! The units of a sweep: every combination as a call, checked before the first one runs.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

use petzval_base::FileError;
use petzval_jobs::design::{Changes, NewRun, Request, Run, Settings, VariantNames};
use petzval_jobs::{
    Call, Context, DEVICES, ExperimentInput, InputKind, JobError, MOST_THREADS, NamedInput, Result, design,
};
use serde_json::{Map, Value};

use super::expand::{Expansion, SweptKey, by_key, expand, json_at, leaves_of};
use super::file::{Level, Source, in_file};
use super::name::names;
use super::place::at_place;
use crate::unit::row_of_unit;

/// The job of a sweep over an experiment.
pub const DESIGN: &str = "design";

/// A unit of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedUnit {
    /// Its name, unlike that of any other unit of the sweep.
    pub name: String,
    /// The values of the keys that vary, in their order.
    pub values: Vec<Value>,
    /// The variant that it makes alone.
    pub variant: Option<String>,
    /// Its seed, where the sweep names any.
    pub seed: Option<u64>,
    /// What it runs. Of a design the experiment is complete, and stands in the request itself.
    pub call: Call,
}

/// The units of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Title of the sweep.
    pub title: String,
    /// The job of every unit.
    pub job: String,
    /// Keys that vary.
    pub keys: Vec<String>,
    /// Instruction set of every unit.
    pub simd: Level,
    /// Threads of a unit; 0 means those that the machine or the cluster gives.
    pub threads: usize,
    /// The units, in the order in which they are best run.
    pub units: Vec<PlannedUnit>,
    /// Draws that gave the values of an earlier one, and are left out.
    pub merged: usize,
}

/// Makes the units of a sweep and checks each. Nothing is run or written.
///
/// The first unit that cannot run is an error that names it, with file, line, key, value and a hint. Two units that would run the same are refused.
pub fn plan(source: &Source, context: &Context) -> Result<Plan> {
    let file = &source.file;
    let expansion = expand(file, &source.text).map_err(|error| in_file(&source.path, error))?;
    let job = match (&file.experiment, &file.job) {
        (Some(_), None) => DESIGN.to_owned(),
        (None, Some(job)) => job.clone(),
        (Some(_), Some(_)) => {
            return Err(source.at(&["job"], "an experiment is named as well", "leave one of the two out"));
        }
        (None, None) => {
            let hint = "write experiment = \"NAME or PATH\", or job = \"NAME\" with a table [request]";
            return Err(source.at(&[], "the sweep names neither an experiment nor a job", hint));
        }
    };
    if file.experiment.is_none() {
        check_is_of_a_job(source, &job)?;
    } else if !file.request.is_empty() {
        let hint = "what an experiment has for every unit belongs to [set]; a request belongs to a job";
        return Err(source.at(&["request"], "the sweep is over an experiment", hint));
    }
    // Whether a device can be used, the machine of the unit says; its name can be checked here.
    if file.device.as_deref().is_some_and(|device| !DEVICES.contains(&device)) {
        let hint = format!("the devices are {}", DEVICES.join(", "));
        return Err(source.at(&["device"], "there is no such device", hint));
    }
    if file.threads > MOST_THREADS {
        let hint = "threads of one unit; 0 takes those that the machine or the cluster gives";
        return Err(source.at(&["threads"], format!("more than {MOST_THREADS}"), hint));
    }
    let (names, common) = (names(&expansion), Common::of(source)?);
    let mut checked = HashSet::new();
    let total = names.len();
    let mut known: HashMap<String, usize> = HashMap::new();
    let mut units = Vec::with_capacity(total);
    for (place, name) in names.iter().enumerate() {
        context.check(|| format!("stopped after the check of {place} of {total} units"))?;
        let unit = Unresolved { source, expansion: &expansion, common: &common, place, name, total };
        let call = if file.experiment.is_some() {
            unit.design(context)?
        } else {
            unit.job(&job, context, &mut checked)?
        };
        if let Some(same) = known.insert(call.request.to_string(), place) {
            let message = format!("the units `{}` and `{name}` would run the same", names[same]);
            let hint = "1 and 1.0 are one value, as are a key that is left out and its default: leave one of the two out";
            return Err(unit.at_its_values(&message, hint));
        }
        let combination = &expansion.combinations[place];
        units.push(PlannedUnit {
            name: name.clone(),
            values: combination.values.clone(),
            variant: combination.variant.clone(),
            seed: combination.seed,
            call,
        });
    }
    Ok(Plan {
        title: source.title(),
        job,
        keys: expansion.keys.iter().map(|key| key.key.clone()).collect(),
        simd: file.simd,
        threads: file.threads,
        units,
        merged: expansion.merged,
    })
}

/// Refuses what only an experiment has.
fn check_is_of_a_job(source: &Source, job: &str) -> Result<()> {
    let file = &source.file;
    let of_experiments = [
        ("set", !file.set.is_empty()),
        ("steps", file.steps.is_some()),
        ("variants", !file.variants.is_empty()),
    ];
    if let Some((key, _)) = of_experiments.into_iter().find(|(_, is_there)| *is_there) {
        let hint = "what does not vary belongs to [request]; or name an experiment in place of the job";
        return Err(source.at(&[key], format!("the job `{job}` has no such key"), hint));
    }
    let row = row_of_unit(job).map_err(|error| match error {
        JobError::Input { message, hint, .. } => {
            source.at(&["job"], message.trim_start_matches("call: "), hint)
        }
        other => other,
    })?;
    // What the sweep gives to the request of every unit, the request must have.
    let schema = row.schema();
    for (key, of_request, is_there) in
        [("seeds", "seed", !file.seeds.is_empty()), ("device", "device", file.device.is_some())]
    {
        if is_there && schema.pointer(&format!("/properties/{of_request}")).is_none() {
            let message = format!("the request of the job `{job}` has no key `{of_request}`");
            let hint =
                format!("leave `{key}` out; `petzval schema job {job}` prints what a request may hold");
            return Err(source.at(&[key], message, hint));
        }
    }
    Ok(())
}

/// What every unit has.
struct Common {
    /// The values of the table `set`, by key path.
    set: Settings,
    /// The table `request`.
    request: Value,
}

impl Common {
    /// Reads both tables. Paths beside the sweep are absolute. Fails at the place of a date, and of a number that is not finite.
    fn of(source: &Source) -> Result<Self> {
        let json = |value: &toml::Value, place: &[String]| -> Result<Value> {
            let mut value =
                json_at(value, place, &source.text).map_err(|error| in_file(&source.path, error))?;
            located(&mut value, source);
            Ok(value)
        };
        let mut set = Settings::new();
        for (place, value) in leaves_of(&source.file.set, "set") {
            set.insert(place[1..].join("."), json(value, &place)?);
        }
        let request = toml::Value::Table(source.file.request.clone());
        Ok(Self { set, request: json(&request, &["request".to_owned()])? })
    }
}

/// A combination that is made a call.
struct Unresolved<'a> {
    source: &'a Source,
    expansion: &'a Expansion,
    common: &'a Common,
    place: usize,
    name: &'a str,
    total: usize,
}

impl Unresolved<'_> {
    /// The unit in words.
    fn in_words(&self) -> String {
        format!("unit `{}` ({} of {})", self.name, self.place + 1, self.total)
    }

    /// The values of the combination by key. Paths beside the sweep are absolute.
    fn values(&self) -> BTreeMap<String, Value> {
        let mut values = by_key(&self.expansion.keys, &self.expansion.combinations[self.place]);
        values.values_mut().for_each(|value| located(value, self.source));
        values
    }

    /// A design with the complete experiment in its request: what becomes of its file later changes no unit.
    fn design(&self, context: &Context) -> Result<Call> {
        let file = &self.source.file;
        let combination = &self.expansion.combinations[self.place];
        let mut set = self.common.set.clone();
        for (key, value) in self.values() {
            if set.insert(key.clone(), value).is_some() {
                return Err(self.at_key(&key, "stands in [set] as well", "let it vary, or set it"));
            }
        }
        let mut name = Value::from(file.experiment.clone().unwrap_or_default());
        located(&mut name, self.source);
        let changes = Changes {
            seed: combination.seed,
            steps: file.steps,
            variant: combination.variant.clone().map(VariantNames::One),
            set,
            ..Changes::default()
        };
        let experiment = name.as_str().unwrap_or_default().into();
        let new = NewRun { experiment, out: None, changes };
        let resolved = design::resolved(&new, context).map_err(|error| {
            let name = new.experiment.to_string();
            self.missing_experiment(name, context).unwrap_or_else(|| self.explained(error))
        })?;
        if resolved.lens.ends_with(design::FITTED) {
            let hint = "write an experiment for it by `petzval init --lens LENS --out DIR`, and name its experiment.toml";
            return Err(self.source.at(&["experiment"], "this is a lens and not an experiment", hint));
        }
        let toml = resolved.to_toml().map_err(JobError::from)?;
        let experiment: ExperimentInput = serde_json::from_value(serde_json::json!({ "toml": toml }))
            .map_err(|e| JobError::failed(e.to_string()))?;
        let new = NewRun { experiment, ..NewRun::default() };
        let device = file.device.clone().unwrap_or_else(|| Request::default().device);
        let request = Request { run: Run::New(new), device, ..Request::default() };
        let request = serde_json::to_value(request).map_err(|e| JobError::failed(e.to_string()))?;
        Ok(self.call(DESIGN, request))
    }

    /// A job with its values in the base request.
    fn job(&self, job: &str, context: &Context, checked: &mut HashSet<(InputKind, String)>) -> Result<Call> {
        let mut request = self.common.request.clone();
        let seed =
            self.expansion.combinations[self.place].seed.map(|seed| ("seed".to_owned(), Value::from(seed)));
        let device = self.source.file.device.clone().map(|device| ("device".to_owned(), Value::from(device)));
        for (key, value) in self.values().into_iter().chain(seed).chain(device) {
            put(&mut request, &key, value).map_err(|message| {
                self.at_key(
                    &key,
                    &message,
                    &format!("`petzval schema job {job}` prints what a request may hold"),
                )
            })?;
        }
        // A request that does not fit its schema is refused here.
        let row = row_of_unit(job)?;
        let complete = row.filled_in_as_unit(request.clone()).map_err(|wrong| self.at_request(&wrong))?;
        if let Some(wrong) = row.out_of_range(&request) {
            return Err(self.at_request(&wrong));
        }
        context.check(|| "stopped")?;
        // So is an input that no unit could read; one of many units is looked at once.
        for input in row.named_inputs(&complete)? {
            if checked.insert((input.kind, input.name.clone())) {
                input.check(context).map_err(|error| self.at_input(&input.key, error))?;
            }
        }
        Ok(self.call(job, request))
    }

    fn call(&self, job: &str, request: Value) -> Call {
        Call { threads: self.source.file.threads, ..Call::new(job, request) }
    }

    /// An error of an input that the request names at a key.
    fn at_input(&self, key: &str, error: JobError) -> JobError {
        let JobError::Input { message, hint, .. } = error else {
            // What is wrong in a file is shown there.
            return error;
        };
        self.at_request_key(key, &message, &from_the_folder(&hint))
    }

    /// The error of an experiment that is not there, at its name; none if there is one.
    fn missing_experiment(&self, name: String, context: &Context) -> Option<JobError> {
        let input = NamedInput { key: "experiment".to_owned(), kind: InputKind::Experiment, name };
        let Err(JobError::Input { message, hint, .. }) = input.check(context) else { return None };
        Some(self.source.at(&["experiment"], message, from_the_folder(&hint)))
    }

    /// The error of a request, at the place of its key.
    fn at_request(&self, wrong: &FileError) -> JobError {
        // Readers of JSON number the elements of lists in brackets.
        let key = wrong.key.replace('[', ".").replace(']', "");
        self.at_request_key(&key, &wrong.message, wrong.hint.as_deref().unwrap_or(""))
    }

    /// An error about a key path of the request: at the value that varies, in the list of seeds, or in the table of the request. One about a
    /// key that is not in that table is shown at a key that varies below it, at the nearest table above it, or at the job.
    fn at_request_key(&self, key: &str, message: &str, hint: &str) -> JobError {
        let holds = |swept: &&SweptKey| key == swept.key || key.starts_with(&format!("{}.", swept.key));
        if let Some(swept) = self.expansion.keys.iter().find(holds) {
            return self.at_key(&swept.key, message, hint);
        }
        let seed = self.expansion.combinations[self.place].seed.filter(|_| key == "seed");
        if let Some(place) = self.source.file.seeds.iter().position(|known| Some(*known) == seed) {
            return self.source.at(&["seeds", &place.to_string()], message, hint);
        }
        let place: Vec<&str> = ["request"].into_iter().chain(key.split('.')).collect();
        let at =
            |place: &[&str]| Some(at_place(&self.source.text, place, message)).filter(|e| e.line.is_some());
        let error = match at(&place[..]) {
            Some(error) => error,
            None => {
                let below = |swept: &&SweptKey| swept.key.starts_with(&format!("{key}."));
                if let Some(swept) = self.expansion.keys.iter().find(below) {
                    return self.at_key(&swept.key, &format!("`{key}`: {message}"), hint);
                }
                let above = (1..place.len()).rev().find_map(|length| at(&place[..length]));
                let above = above.unwrap_or_else(|| at_place(&self.source.text, &["job"], message));
                FileError { key: key.to_owned(), ..above.without_value() }
            }
        };
        in_file(&self.source.path, if hint.is_empty() { error } else { error.hint(hint) })
    }

    /// An error of the unit, at the place of the file that it comes from.
    fn explained(&self, error: JobError) -> JobError {
        match error {
            JobError::Setting { key: "set", value, message, hint } => {
                let key = value.split('=').next().unwrap_or_default();
                let is_one =
                    self.expansion.keys.iter().any(|swept| swept.key == key) && !value.contains(", ");
                if is_one {
                    return self.at_key(key, &message, &hint);
                }
                let set = leaves_of(&self.source.file.set, "set");
                if let Some((place, _)) = set.iter().find(|(place, _)| place[1..].join(".") == key)
                    && !value.contains(", ")
                {
                    let place: Vec<&str> = place.iter().map(String::as_str).collect();
                    return self.source.at(&place, message, hint);
                }
                self.at_its_values(&format!("{value}: {message}"), &hint)
            }
            JobError::Setting { key: "variant", value, message, hint } => {
                let place = self
                    .source
                    .file
                    .variants
                    .iter()
                    .position(|variant| *variant == value)
                    .unwrap_or(0)
                    .to_string();
                self.source.at(&["variants", &place], message, hint)
            }
            JobError::Setting { key: "steps", message, hint, .. } => {
                self.source.at(&["steps"], message, hint)
            }
            JobError::Input { message, hint, .. } => {
                // Requests name the key that is wrong.
                let swept =
                    self.expansion.keys.iter().find(|key| message.contains(&format!("`{}`", key.key)));
                match swept {
                    Some(swept) => self.at_key(&swept.key, &message, &hint),
                    None => self.at_its_values(&message, &hint),
                }
            }
            JobError::Setting { key, value, message, hint } => {
                self.at_its_values(&format!("{key} {value}: {message}"), &hint)
            }
            // A file that the sweep names is shown at its own place.
            other => other,
        }
    }

    /// An error about a key that varies, at its value in this unit.
    fn at_key(&self, key: &str, message: &str, hint: &str) -> JobError {
        let Some(k) = self.expansion.keys.iter().position(|swept| swept.key == key) else {
            return self.at_its_values(message, hint);
        };
        let swept = &self.expansion.keys[k];
        let value = &self.expansion.combinations[self.place].values[k];
        let path: Vec<&str> = swept.place.iter().map(String::as_str).collect();
        let in_list = self.source.value_at(&path).and_then(|list| {
            let values: Vec<Value> =
                list.as_array()?.iter().filter_map(|value| serde_json::to_value(value).ok()).collect();
            values.iter().position(|other| other == value)
        });
        let place = in_list.map(|place| place.to_string());
        let whole: Vec<&str> = path.iter().copied().chain(place.as_deref()).collect();
        let error = FileError::at_key(&self.source.text, &whole, format!("{}: {message}", self.in_words()));
        let error = FileError { key: swept.key.clone(), ..error };
        in_file(&self.source.path, if hint.is_empty() { error } else { error.hint(hint) })
    }

    /// An error of the unit that no single key is to blame for.
    fn at_its_values(&self, message: &str, hint: &str) -> JobError {
        let name = self.source.path.display();
        JobError::input(format!("{name}: {}: {message}", self.in_words()), hint)
    }
}

/// The hint of an input that is named in the file of a sweep.
fn from_the_folder(hint: &str) -> String {
    let end = "a relative path counts from the folder of the sweep";
    if hint.is_empty() { end.to_owned() } else { format!("{hint}; {end}") }
}

/// Makes texts that are paths of files or folders beside the sweep absolute, in a value and all below it. A path has a dot or a slash: a word may be
/// a name of something else.
fn located(value: &mut Value, source: &Source) {
    match value {
        Value::String(text) if text.contains(['.', '/']) => {
            let folder = source.path.parent().unwrap_or(Path::new(""));
            let beside = [folder.join(&*text), text.as_str().into()].into_iter().find(|path| path.exists());
            if let Some(path) =
                beside.and_then(|path| std::path::absolute(path).ok()?.into_os_string().into_string().ok())
            {
                *text = path;
            }
        }
        Value::Array(values) => values.iter_mut().for_each(|value| located(value, source)),
        Value::Object(keys) => keys.values_mut().for_each(|value| located(value, source)),
        _ => {}
    }
}

/// Puts a value at a key path of a request.
fn put(at: &mut Value, key: &str, value: Value) -> Result<(), String> {
    let (first, rest) = key.split_once('.').map_or((key, None), |(first, rest)| (first, Some(rest)));
    let below = match at {
        Value::Object(keys) => keys.entry(first).or_insert_with(|| Value::Object(Map::new())),
        Value::Array(values) => {
            let length = values.len();
            let place = first.parse::<usize>().ok().filter(|place| *place < length);
            let Some(place) = place else {
                return Err(format!("`{first}` is no place of a list of {length}"));
            };
            &mut values[place]
        }
        other => return Err(format!("`{first}` cannot lie below {other}")),
    };
    match rest {
        Some(rest) => put(below, rest, value),
        None => {
            *below = value;
            Ok(())
        }
    }
}
