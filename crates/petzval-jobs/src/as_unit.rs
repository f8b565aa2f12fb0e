//! How a job is done as a unit of work: its seed, the folder of its results, and how it goes on from them.

use std::path::{Path, PathBuf};

use crate::context::Context;
use crate::error::Result;

/// What a job lets a runner of many jobs change in its request. Each part is left out where a job has no such thing.
///
/// It belongs to the job, so that a runner knows no request.
pub struct AsUnit<R> {
    /// Sets the seed of everything random.
    pub(crate) seed: Option<fn(&mut R, u64)>,
    /// Has everything that the job writes written into a folder, or below it. The folder need not exist.
    pub(crate) place: Option<fn(&mut R, &Path)>,
    /// The request that goes on from what such a folder holds; none if nothing in it can be continued.
    pub(crate) going_on: Option<fn(&R, &Path) -> Option<R>>,
    /// Files and folders on which the result depends, but which another file names: those of an experiment.
    pub(crate) behind: Option<Behind<R>>,
    /// JSON pointer to the table of a request whose key `out` is the folder of results, where a call must name one. A unit may leave it out, since
    /// it has a folder of its own.
    pub(crate) out_in: Option<&'static str>,
}

/// Finds files behind those that a request names.
pub(crate) type Behind<R> = fn(&R, &Context) -> Result<Vec<PathBuf>>;

impl<R> AsUnit<R> {
    /// A job without a seed that writes nothing.
    pub const PLAIN: Self = Self { seed: None, place: None, going_on: None, behind: None, out_in: None };

    /// A job without a seed that writes into a folder, or below it.
    pub(crate) const fn placed(place: fn(&mut R, &Path)) -> Self {
        Self { place: Some(place), ..Self::PLAIN }
    }

    /// The same for a job with a seed.
    pub(crate) const fn seeded(seed: fn(&mut R, u64), place: fn(&mut R, &Path)) -> Self {
        Self { seed: Some(seed), ..Self::placed(place) }
    }
}

/// A file in a folder, with the name of another path; `named` where that has none.
pub(crate) fn within(folder: &Path, path: &Path, named: &str) -> PathBuf {
    folder.join(path.file_name().unwrap_or(named.as_ref()))
}
