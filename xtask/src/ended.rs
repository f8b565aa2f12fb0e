//! How a check ends that is no failure.

use std::fmt;

/// How a check ended. A failure is an error.
#[derive(Debug, PartialEq)]
pub enum Ended {
    /// With what was seen.
    Passed(String),
    /// A program is missing here, and this is which.
    NotRun(String),
}

impl fmt::Display for Ended {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Passed(seen) => write!(f, "{seen}"),
            Self::NotRun(why) => write!(f, "NOT RUN: {why}"),
        }
    }
}
