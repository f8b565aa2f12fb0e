//! Places of results, checked before a job's work begins: a place that cannot be written, or that holds results already, is an error at
//! once and not after an hour. Nothing is made yet, so that a request that is refused later leaves no empty folder.

use std::path::Path;

use petzval_base::{LONGEST_NAME, PartFolder, sweep_parts_in};

use crate::context::Context;
use crate::error::JobError;

/// Endings of files that are read or written here, or that people would expect.
const FILE_ENDINGS: [&str; 26] = [
    "agf",
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
) -> Result<(), JobError> {
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

/// Whether a name ends as those of files do.
fn names_a_file(path: &Path) -> bool {
    FILE_ENDINGS.iter().any(|ending| has_ending(path, ending))
}

/// Whether a file's name has an ending, in small letters or capitals.
pub(crate) fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending))
}

/// Sees that no two results have one name, also on systems that take `A` for `a`.
pub(crate) fn check_distinct(files: &[String]) -> Result<(), JobError> {
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
pub(crate) fn check_file(path: &Path, context: &Context) -> Result<(), JobError> {
    if path.is_dir() {
        return Err(refused(path, "this is a folder", "name a file"));
    }
    check_length(path)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    check_writable(folder, path)?;
    check_unused(path, context)
}

/// Bytes of the longest path that systems take, with room for the names of files in a folder of results.
const LONGEST_PATH: usize = 3900;

/// Fails if a name or a path is longer than file systems hold. A folder that does not exist yet would tell only when it is made.
pub(crate) fn check_length(path: &Path) -> Result<(), JobError> {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let longest = whole.components().map(|part| part.as_os_str().len()).max().unwrap_or(0);
    if longest > LONGEST_NAME {
        let message = format!("a name of {longest} bytes is too long: file systems hold {LONGEST_NAME}");
        return Err(refused(path, &message, "give a shorter name"));
    }
    if whole.as_os_str().len() > LONGEST_PATH {
        let message = format!("the path of {} bytes is too long", whole.as_os_str().len());
        return Err(refused(path, &message, "give a place with a shorter path"));
    }
    Ok(())
}

/// Fails if a file is there that the context does not let a job overwrite.
fn check_unused(path: &Path, context: &Context) -> Result<(), JobError> {
    match path.is_file() && !context.overwrites() {
        true => Err(refused(path, "exists already", "--force replaces it; or name another place")),
        false => Ok(()),
    }
}

/// Fails if no file can be made in a folder; `named` is what the request names.
fn check_writable(folder: &Path, named: &Path) -> Result<(), JobError> {
    sweep_parts_in(folder);
    let made = PartFolder::beside(&folder.join("results"));
    made.map(drop).map_err(|e| {
        refused(named, &format!("nothing can be written there: {e}"), "name a place that can be written")
    })
}

fn refused(path: &Path, message: &str, hint: &str) -> JobError {
    JobError::input(format!("{}: {message}", path.display()), hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_no_file_system_holds_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(check_length(&folder.path().join("a".repeat(LONGEST_NAME))).is_ok());
        let long = check_length(&folder.path().join("ä".repeat(128))).unwrap_err().to_string();
        assert!(long.contains("256 bytes"), "{long}");
        let deep = ["a"; 2000].join("/");
        assert!(check_length(Path::new(&deep)).unwrap_err().to_string().contains("path"));
    }
}
