//! A part of a file of units: every n-th one. Batch systems number their tasks, and the number says which part is whose.

use std::fmt;
use std::str::FromStr;

use petzval_jobs::{JobError, Result};

/// The units whose place in the file, from 0, leaves `index` when it is divided by `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, from 0.
    pub index: u64,
    /// Parts in all.
    pub count: u64,
}

impl Shard {
    /// Its items, in order.
    pub fn of<T: Clone>(self, all: &[T]) -> Vec<T> {
        let is_own = |place: &usize| *place as u64 % self.count == self.index;
        (0..all.len()).filter(is_own).map(|place| all[place].clone()).collect()
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if index < count => Ok(Self { index, count }),
            _ => Err("a shard is i/n with i from 0 to n - 1, such as 0/4 to 3/4".to_owned()),
        }
    }
}

/// Where a shard comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShardSource {
    /// A Slurm array.
    Slurm,
    /// A HyperQueue array.
    HyperQueue,
}

impl ShardSource {
    /// The variable that numbers the task.
    pub fn variable(self) -> &'static str {
        match self {
            Self::Slurm => "SLURM_ARRAY_TASK_ID",
            Self::HyperQueue => "HQ_TASK_ID",
        }
    }
}

/// The shard of this task of a batch system; none outside of one.
///
/// Slurm: `SLURM_ARRAY_TASK_ID` counts from `_MIN` in steps of `_STEP`, and there are `_COUNT`. HyperQueue: `HQ_TASK_ID` is the place of
/// one unit in the file, from 0; `units` is their number.
///
/// `SLURM_ARRAY_TASK_ID` without `_COUNT` gives no shard: see [`task_without_count`].
///
/// Fails if a number cannot be read, or if an array with gaps has numbers beyond its count.
pub fn shard_of_environment(
    variable: impl Fn(&str) -> Option<String>,
    units: usize,
) -> Result<Option<(Shard, ShardSource)>> {
    let number = |name: &str| match variable(name) {
        None => Ok(None),
        Some(text) => match text.trim().parse::<u64>() {
            Ok(number) => Ok(Some(number)),
            Err(_) => Err(JobError::input(
                format!("{name}={text}: not a whole number"),
                "give the part yourself: --shard i/n, with i from 0",
            )),
        },
    };
    if let (Some(id), Some(count)) = (number("SLURM_ARRAY_TASK_ID")?, number("SLURM_ARRAY_TASK_COUNT")?) {
        let least = number("SLURM_ARRAY_TASK_MIN")?.unwrap_or(0);
        let step = number("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
        let index = id.checked_sub(least).map(|above| above / step);
        return match index {
            Some(index) if index < count => Ok(Some((Shard { index, count }, ShardSource::Slurm))),
            _ => Err(JobError::input(
                format!("SLURM_ARRAY_TASK_ID={id}: the array has {count} tasks from {least} on, and gaps"),
                "submit the array without gaps, or give the part yourself: --shard i/n, with i from 0",
            )),
        };
    }
    if let Some(index) = number("HQ_TASK_ID")? {
        let count = units as u64;
        if index >= count {
            return Err(JobError::input(
                format!("HQ_TASK_ID={index}: the file has {units} units, numbered from 0"),
                format!(
                    "submit with --array 0-{}, or give the part yourself: --shard i/n",
                    count.saturating_sub(1)
                ),
            ));
        }
        return Ok(Some((Shard { index, count }, ShardSource::HyperQueue)));
    }
    Ok(None)
}

/// What is to be said of a task of a Slurm array without the number of its tasks, which gives no shard; none elsewhere. The number of a task may
/// come into a container or over ssh alone, so that it is no error.
pub fn task_without_count(variable: impl Fn(&str) -> Option<String>) -> Option<String> {
    let id = variable("SLURM_ARRAY_TASK_ID")?;
    variable("SLURM_ARRAY_TASK_COUNT").is_none().then(|| {
        format!(
            "SLURM_ARRAY_TASK_ID={id} without SLURM_ARRAY_TASK_COUNT: every unit is run; in a task of an array give its part by --shard i/n, with i from 0"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(variables: &[(&str, &str)], units: usize) -> Result<Option<String>, String> {
        let variable = |name: &str| {
            variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned())
        };
        let found = shard_of_environment(variable, units).map_err(|e| e.to_string())?;
        Ok(found.map(|(shard, source)| format!("{shard} by {}", source.variable())))
    }

    #[test]
    fn every_unit_belongs_to_one_shard() {
        let units: Vec<usize> = (0..10).collect();
        let mut all: Vec<usize> = (0..4).flat_map(|index| Shard { index, count: 4 }.of(&units)).collect();
        all.sort();
        assert_eq!(all, units);
        assert_eq!("3/4".parse(), Ok(Shard { index: 3, count: 4 }));
        for wrong in ["4/4", "1", "a/2", "-1/2", "0/0", "1/2/3"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_shard_is_that_of_the_task_of_a_batch_system() {
        let slurm = |id, min, step| {
            vec![
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_COUNT", "5"),
                ("SLURM_ARRAY_TASK_MIN", min),
                ("SLURM_ARRAY_TASK_STEP", step),
                ("HQ_TASK_ID", "1"),
            ]
        };
        let by_slurm = |shard: &str| Ok(Some(format!("{shard} by SLURM_ARRAY_TASK_ID")));
        assert_eq!(found(&slurm("0", "0", "1"), 9), by_slurm("0/5"));
        assert_eq!(found(&slurm("5", "1", "1"), 9), by_slurm("4/5"));
        assert_eq!(found(&slurm("8", "0", "2"), 9), by_slurm("4/5"));
        assert!(found(&slurm("9", "1", "1"), 9).unwrap_err().contains("gaps"));
        assert!(found(&slurm("x", "1", "1"), 9).unwrap_err().contains("not a whole number"));
        assert_eq!(found(&[("HQ_TASK_ID", "2")], 3), Ok(Some("2/3 by HQ_TASK_ID".to_owned())));
        assert!(found(&[("HQ_TASK_ID", "3")], 3).unwrap_err().contains("3 units"));
        assert_eq!(found(&[], 3), Ok(None));
    }

    #[test]
    fn a_task_without_the_number_of_tasks_has_no_shard_and_says_so() {
        assert_eq!(found(&[("SLURM_ARRAY_TASK_ID", "3")], 9), Ok(None));
        let said = |known: &[&str]| {
            task_without_count(|name| known.contains(&name).then(|| "3".to_owned())).unwrap_or_default()
        };
        assert!(said(&["SLURM_ARRAY_TASK_ID"]).contains("every unit is run"));
        assert_eq!(said(&["SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT"]), "");
        assert_eq!(said(&["SLURM_ARRAY_TASK_COUNT"]), "");
    }
}
