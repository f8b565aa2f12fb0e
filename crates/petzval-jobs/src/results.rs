//! Places of results, checked before a job's work begins: a place that cannot be written, or that holds results already, is an error at
//! once and not after an hour. Nothing is made yet, so that a request that is refused later leaves no empty folder.

use std::io::ErrorKind;
use std::path::Path;

use petzval_base::{PartFolder, create_whole, sweep_parts_in};
use petzval_design::error::DesignError;

use crate::context::Context;
use crate::error::{JobError, Result, check_length, write_file};

/// A folder of results at which no file can be, for requests whose place of results must not count: in keys of units, and where a request is searched
/// for its inputs.
pub const NOWHERE: &str = "/dev/null/results";

/// Endings of files that are read or written here, or that people would expect.
const FILE_ENDINGS: [&str; 28] = [
    "agf",
    "bmp",
    "csv",
    "dng",
    "exr",
    "hdr",
    "htm",
    "html",
    "jpeg",
    "jpg",
    "json",
    "jsonl",
    "md",
    "npy",
    "pdf",
    "png",
    "raw",
    "safetensors",
    "seq",
    "svg",
    "tif",
    "tiff",
    "toml",
    "txt",
    "webp",
    "y4m",
    "yuv",
    "zmx",
];

/// Sees that the folder `out`, which need not exist, can take files of these names. Fails if nothing can be written there, and, unless
/// the context lets results be overwritten, if one of the files is there.
pub(crate) fn check_folder<N: AsRef<Path>>(
    out: &Path,
    names: impl IntoIterator<Item = N>,
    context: &Context,
) -> Result<()> {
    if out.exists() && !out.is_dir() {
        return Err(refused(out, "this is a file", "give a folder; it is made if it does not exist"));
    }
    if !out.exists() && names_a_file(out) {
        let folder = out.with_extension("");
        let hint = format!(
            "results go into a folder, such as {}; it is made if it does not exist",
            folder.display()
        );
        return Err(refused(out, "this is the name of a file", &hint));
    }
    let names: Vec<N> = names.into_iter().collect();
    check_length(out)?;
    names.iter().try_for_each(|name| check_length(&out.join(name)))?;
    // The folder is made with its parents: what counts is the nearest one that is there.
    let there = out.ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    check_writable(there, out)?;
    names.iter().try_for_each(|name| check_unused(&out.join(name), context))
}

/// What a file of results holds, by the ending of its name; for [`Context::wrote`].
pub(crate) fn what_is(path: &Path) -> &'static str {
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("html") => "page",
        Some("svg" | "png" | "exr") => "picture",
        Some("csv") => "table",
        Some("json" | "xml") => "figures",
        Some("npy") => "numbers",
        _ => "file",
    }
}

/// Whether a name ends as those of files do.
pub(crate) fn names_a_file(path: &Path) -> bool {
    FILE_ENDINGS.iter().any(|ending| has_ending(path, ending))
}

/// Whether a file's name has an ending, in small letters or capitals.
pub(crate) fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending))
}

/// Sees that no two results have one name, also on systems that take `A` for `a`.
pub(crate) fn check_distinct(files: &[String]) -> Result<()> {
    let mut seen = std::collections::BTreeSet::new();
    match files.iter().find(|file| !seen.insert(file.to_lowercase())) {
        Some(twice) => Err(JobError::input(
            format!("two results would be called {twice}"),
            "give the inputs other names, or write them into different folders with --out",
        )),
        None => Ok(()),
    }
}

/// Sees that a file can be written; its folder must exist. Fails as [`check_folder`] does.
pub(crate) fn check_file(path: &Path, context: &Context) -> Result<()> {
    if path.is_dir() {
        return Err(refused(path, "this is a folder", "name a file"));
    }
    check_length(path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    check_writable(folder, path)?;
    check_unused(path, context)
}

/// Writes a file of results wholly or not at all. Fails as [`check_file`] does if another process has written it since it was checked.
pub(crate) fn write_result(path: &Path, contents: impl AsRef<[u8]>, context: &Context) -> Result<()> {
    if context.overwrites() {
        return write_file(path, contents);
    }
    create_whole(path, contents.as_ref()).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => there_already(path),
        _ => DesignError::io(path)(error).into(),
    })
}

/// Fails if a file is there that the context does not let a job overwrite.
fn check_unused(path: &Path, context: &Context) -> Result<()> {
    if path.is_file() && !context.overwrites() { Err(there_already(path)) } else { Ok(()) }
}

/// Fails if no file can be made in a folder; `named` is what the request names.
fn check_writable(folder: &Path, named: &Path) -> Result<()> {
    if !folder.is_dir() {
        let what = format!("nothing can be written there: {} is no folder", folder.display());
        return Err(refused(named, &what, "make the folder, or name a place that can be written"));
    }
    sweep_parts_in(folder);
    let made = PartFolder::beside(&folder.join("results"));
    made.map(drop).map_err(|e| {
        refused(named, &format!("nothing can be written there: {e}"), "name a place that can be written")
    })
}

/// The error for a file that is there, and that the context does not let a job overwrite.
pub(crate) fn there_already(path: &Path) -> JobError {
    refused(path, "exists already", "--force replaces it; or name another place")
}

fn refused(path: &Path, message: &str, hint: &str) -> JobError {
    JobError::input(format!("{}: {message}", path.display()), hint)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::context::Silent;

    #[test]
    fn a_file_that_came_since_the_check_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let context = Context::new(crate::built_in_assets(), Arc::new(Silent));
        check_file(&path, &context).unwrap();
        std::fs::write(&path, "of another process").unwrap();
        let error = write_result(&path, "mine", &context).unwrap_err().to_string();
        assert!(error.contains("a.toml: exists already"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "of another process");
        write_result(&path, "mine", &context.overwriting(true)).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
    }
}
