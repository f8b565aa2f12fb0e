//! The request of a training from the arguments of its verb.

use std::path::PathBuf;

use crate::cli::failure::Failure;
use crate::jobs::train::Request;

/// The training of a plan that begins in a folder, or the one that is continued.
pub(super) fn begun_or_resumed<P>(
    plan: P,
    out: Option<PathBuf>,
    resume: Option<PathBuf>,
) -> Result<Request<P>, Failure> {
    match (resume, out) {
        (Some(folder), _) => Ok(Request::Resume { folder }),
        (None, Some(out)) => Ok(Request::New { plan, out }),
        (None, None) => Err(Failure::input("--out is missing", "give a folder, or --resume")),
    }
}
