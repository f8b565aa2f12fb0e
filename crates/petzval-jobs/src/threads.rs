//! How many threads a process has where nobody gives a number: as many as a batch system allots to it, else one per core.

use std::fmt;

use crate::error::{JobError, Result};

/// Most threads of a call or of the command; far more would hang the machine.
pub const MOST_THREADS: usize = 1024;

/// A number of threads, and what it comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads {
    /// The number; at least 1.
    pub number: usize,
    /// What it comes from.
    pub source: Source,
}

/// What a number of threads comes from, in the order in which they are looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The option `--threads`, or `petzval.set_threads`.
    Given,
    /// An environment variable.
    Variable(&'static str),
    /// One per core that the process may use.
    Cores,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Given => "--threads",
            Self::Variable(name) => name,
            Self::Cores => "one per core",
        })
    }
}

/// The number of threads of this process. Zero means that none is given: then `RAYON_NUM_THREADS`, `SLURM_CPUS_PER_TASK` and `HQ_CPUS` are looked
/// at in this order, and where none of them is set there is one thread per core.
pub fn threads(given: usize) -> Result<Threads> {
    chosen(given, |name| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned()))
}

fn chosen(given: usize, value: impl Fn(&str) -> Option<String>) -> Result<Threads> {
    if given > 0 {
        return Ok(Threads { number: given, source: Source::Given });
    }
    for (name, read) in VARIABLES {
        let Some(text) = value(name).filter(|text| !text.trim().is_empty()) else { continue };
        // For rayon, zero is one per core.
        if name == RAYON && text.trim() == "0" {
            break;
        }
        let number = read(text.trim()).filter(|number| (1..=MOST_THREADS).contains(number));
        let number = number.ok_or_else(|| {
            JobError::input(
                format!("{name}={text}: no number of threads from 1 to {MOST_THREADS}"),
                "unset the variable, or give the number by --threads, which takes precedence",
            )
        })?;
        return Ok(Threads { number, source: Source::Variable(name) });
    }
    let number = std::thread::available_parallelism().map_or(1, usize::from);
    Ok(Threads { number, source: Source::Cores })
}

const RAYON: &str = "RAYON_NUM_THREADS";

/// Reads a number of threads.
type Reads = fn(&str) -> Option<usize>;

/// The variables, each with how it says a number.
const VARIABLES: [(&str, Reads); 3] =
    [(RAYON, number), ("SLURM_CPUS_PER_TASK", number), ("HQ_CPUS", cores_in_list)];

fn number(text: &str) -> Option<usize> {
    text.parse().ok()
}

/// HyperQueue lists the cores of a task by their indices: `0,1,6`, or `0-3`.
fn cores_in_list(text: &str) -> Option<usize> {
    let count = |part: &str| match part.split_once('-') {
        None => number(part).map(|_| 1),
        Some((first, last)) => number(last)?.checked_add(1)?.checked_sub(number(first)?),
    };
    text.split(',').try_fold(0_usize, |sum, part| sum.checked_add(count(part.trim())?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(variables: &[(&str, &str)], given: usize) -> Result<Threads> {
        let found = |name: &str| variables.iter().find(|(key, _)| *key == name);
        chosen(given, |name| found(name).map(|(_, value)| (*value).to_owned()))
    }

    #[test]
    fn the_option_comes_first_then_rayon_slurm_and_hyperqueue() {
        let all = [("HQ_CPUS", "0,1,6"), ("SLURM_CPUS_PER_TASK", "4"), ("RAYON_NUM_THREADS", "5")];
        let of = |variables: &[(&str, &str)], given| {
            let Threads { number, source } = with(variables, given).unwrap();
            (number, source.to_string())
        };
        assert_eq!(of(&all, 2), (2, "--threads".to_owned()));
        assert_eq!(of(&all, 0), (5, "RAYON_NUM_THREADS".to_owned()));
        assert_eq!(of(&all[..2], 0), (4, "SLURM_CPUS_PER_TASK".to_owned()));
        assert_eq!(of(&all[..1], 0), (3, "HQ_CPUS".to_owned()));
        assert_eq!(of(&[("HQ_CPUS", "0-3,7")], 0).0, 5);
        let cores = std::thread::available_parallelism().unwrap().get();
        for none in [&[][..], &[("SLURM_CPUS_PER_TASK", "")], &[("RAYON_NUM_THREADS", "0"), all[1]]] {
            assert_eq!(of(none, 0), (cores, "one per core".to_owned()), "{none:?}");
        }
    }

    #[test]
    fn what_is_no_number_of_threads_is_refused_with_its_name() {
        for (name, value) in [
            ("RAYON_NUM_THREADS", "many"),
            ("RAYON_NUM_THREADS", "-1"),
            ("SLURM_CPUS_PER_TASK", "0"),
            ("SLURM_CPUS_PER_TASK", "100000"),
            ("HQ_CPUS", "3-1"),
            ("HQ_CPUS", "0-18446744073709551615"),
            ("HQ_CPUS", "a,b"),
        ] {
            let message = with(&[(name, value)], 0).unwrap_err().to_string();
            assert!(message.contains(&format!("{name}={value}")), "{message}");
            assert_eq!(with(&[(name, value)], 1).unwrap().number, 1);
        }
    }
}
