//! Joins units that are parts of one analysis: random lenses of `lens-tolerance`, by number.

use std::path::Path;

use petzval_jobs::lens::tolerance::{self, Part};
use petzval_jobs::{Context, JobError, Result};
use serde_json::Value;

use super::Store;
use crate::unit::{Digests, Prepared, Unit};

/// The job whose parts are joined.
const JOB: &str = "lens-tolerance";

/// An analysis that was made in parts.
pub struct Joined {
    /// Names of the units.
    pub units: Vec<String>,
    /// The response, as the job gives it in one run.
    pub response: tolerance::Response,
}

/// Units of one analysis: their names, and the request of the whole.
struct Group {
    request: tolerance::Request,
    names: Vec<String>,
    parts: Vec<tolerance::Response>,
}

/// Joins the units among these that are parts of tolerance analyses: those whose requests differ in `part` alone. With a folder, the files of
/// each analysis are written there; of several into `1`, `2`, and so on.
///
/// Fails if a unit has no result yet, and as [`tolerance::join`] does.
pub fn gather_tolerances(
    units: &[&Unit],
    store: &Store,
    context: &Context,
    out: Option<&Path>,
) -> Result<Vec<Joined>> {
    let digests = Digests::default();
    let mut groups: Vec<Group> = Vec::new();
    for unit in units.iter().filter(|unit| unit.call.job == JOB) {
        let prepared = Prepared::new(unit, context, &digests)?;
        let request: tolerance::Request = read(prepared.request)?;
        if request.part.is_none() {
            continue;
        }
        unit.check_level()?;
        let result = store.result(&prepared.key)?.ok_or_else(|| {
            let message = format!("unit \"{}\" has no result yet", unit.name);
            JobError::input(
                message,
                format!("run it: petzval unit run FILE --store {}", store.root().display()),
            )
        })?;
        let (whole, response) =
            (tolerance::Request { part: None, out: None, ..request }, read(result.response)?);
        match groups.iter_mut().find(|group| group.request == whole) {
            Some(group) => {
                group.names.push(unit.name.clone());
                group.parts.push(response);
            }
            None => {
                groups.push(Group { request: whole, names: vec![unit.name.clone()], parts: vec![response] })
            }
        }
    }
    if groups.is_empty() {
        let hint = "a unit of the job lens-tolerance has `part` in its request: {\"from\": 0, \"to\": 500}";
        return Err(JobError::input("no unit is a part of a tolerance analysis", hint));
    }
    let is_alone = groups.len() == 1;
    let joined = |(number, group): (usize, Group)| {
        let Group { request, names, mut parts } = group;
        // Parts in the order of their lenses: an error names the first one that is wrong.
        parts.sort_by_key(|part| part.made.as_ref().map_or(0, |made| made.part.from));
        let own = |out: &Path| if is_alone { out.to_owned() } else { out.join((number + 1).to_string()) };
        let request = tolerance::Request { out: out.map(own), ..request };
        Ok(Joined { response: tolerance::join(&request, &parts, context)?, units: names })
    };
    groups.into_iter().enumerate().map(joined).collect()
}

/// Parts of so many lenses, as even as can be.
pub fn parts_of(trials: usize, parts: usize) -> Vec<Part> {
    let bound = |i: usize| trials * i / parts;
    (0..parts).map(|i| Part { from: bound(i), to: bound(i + 1) }).filter(|part| part.from < part.to).collect()
}

fn read<T: serde::de::DeserializeOwned>(value: Value) -> Result<T> {
    serde_json::from_value(value).map_err(|e| JobError::failed(format!("{JOB}: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_hold_every_lens_once() {
        for (trials, parts) in [(1000, 7), (3, 8), (1, 1), (0, 4)] {
            let all = parts_of(trials, parts);
            assert!(all.windows(2).all(|pair| pair[0].to == pair[1].from));
            assert_eq!(all.iter().map(|part| part.to - part.from).sum::<usize>(), trials);
            let sizes = all.iter().map(|part| part.to - part.from);
            assert!(sizes.clone().max().unwrap_or(0) <= sizes.min().unwrap_or(0) + 1);
        }
    }
}
