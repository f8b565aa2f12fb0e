//! `sweep-gather`: the results of a sweep so far, as tables and a page.

use std::path::{Path, PathBuf};

use petzval_base::pasted;
use petzval_jobs::{Context, Result, WarningKind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::store::Seen;
use crate::sweep::{Choice, Gathered, KeptSweep, gather, keep_results, status, view};

/// A sweep, and where its tables and its page go.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Request {
    /// Folder of its store.
    pub store: PathBuf,
    /// Folder for tables and page, which is made; nothing is written if none is named. Those in the store itself are replaced, whether or not results
    /// may be overwritten.
    pub out: Option<PathBuf>,
    /// Key or figure along the axis of the page's scatter plot to the right; the key with the most values other than the seed if none is named, else
    /// the second figure.
    pub x: Option<String>,
    /// Key or figure along the upward axis of the plot; the first figure that varies if none is named.
    pub y: Option<String>,
    /// Figures that the page shows; those that vary if none is named.
    pub figure: Vec<String>,
}

/// The results of a sweep, and the files that were written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The results.
    #[serde(flatten)]
    pub gathered: Gathered,
    /// The files that were written.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub files: Vec<PathBuf>,
}

/// Gathers the units that are finished. Fails if no sweep is kept in the store, or if files are there in another folder that must stay.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let Request { store, out, .. } = request;
    let kept = KeptSweep::read(store)?;
    let status = status(&kept, store, &mut Seen::default(), context.cancel())?;
    let gathered = gather(&kept, store, status, context.cancel())?;
    if let Some(text) = gathered.unlike_machines() {
        context.warning(WarningKind::InstructionSet, text);
    }
    let files = match out {
        Some(out) => write(request, &kept, &gathered, out, context)?,
        None => Vec::new(),
    };
    Ok(Response { gathered, files })
}

/// Writes tables and page into a folder.
fn write(
    request: &Request,
    kept: &KeptSweep,
    gathered: &Gathered,
    out: &Path,
    context: &Context,
) -> Result<Vec<PathBuf>> {
    let Request { store, x, y, figure, .. } = request;
    let choice = Choice { x: x.clone(), y: y.clone(), figures: figure.clone() };
    let again = format!("petzval sweep {} --store {} --retry", pasted(&kept.file), pasted(store));
    // Only the tables of the store are known to be of this sweep.
    let is_of_store =
        matches!((out.canonicalize(), store.canonicalize()), (Ok(out), Ok(store)) if out == store);
    let keeps = !is_of_store && !context.overwrites();
    let files = keep_results(gathered, &view(gathered, &choice, &again)?, out, keeps)?;
    for path in &files {
        let is_page = path.extension().is_some_and(|ending| ending == "html");
        context.wrote(path, if is_page { "page" } else { "table" });
    }
    Ok(files)
}
