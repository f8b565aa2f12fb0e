//! Reads the glass catalogues of a user: AGF and TOML files, pages of refractiveindex.info, and folders of them.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use petzval_base::FileError;
use petzval_design::error::DesignError;
use petzval_design::library::Library;
use petzval_files::{GlassWarning, decode, is_meant_as_catalog, parse_agf, parse_catalog, parse_rii};
use petzval_optics::glass::Catalog;

use crate::context::Context;
use crate::error::{JobError, Result};
use crate::event::WarningKind;

/// The glasses of the user's files, and the lines of these files that were not understood.
#[derive(Clone, Debug, Default)]
pub struct ChosenGlasses {
    /// The glasses; those of later files count where a name is in several.
    pub catalog: Catalog,
    /// Lines that were left out, or look wrong, with their files.
    pub warnings: Vec<(PathBuf, GlassWarning)>,
}

impl ChosenGlasses {
    /// One line for each kind of warning about each file: its first, and how many more there are.
    pub fn warning_lines(&self) -> Vec<String> {
        let of_files = self.warnings.chunk_by(|(a, _), (b, _)| a == b);
        let kinds = of_files.flat_map(|of_file| {
            let kinds = GlassWarning::by_kind(of_file.iter().map(|(_, warning)| warning));
            kinds.into_iter().map(|(first, more)| (&of_file[0].0, first, more))
        });
        let line = |(path, first, more): (&PathBuf, &GlassWarning, usize)| match more {
            0 => format!("{}: {}", path.display(), first.error),
            more => format!("{}: {} (and {more} more like it)", path.display(), first.error),
        };
        kinds.map(line).collect()
    }

    /// Every warning, one line each.
    pub fn all_warning_lines(&self) -> Vec<String> {
        let line =
            |(path, warning): &(PathBuf, GlassWarning)| format!("{}: {}", path.display(), warning.error);
        self.warnings.iter().map(line).collect()
    }
}

/// A library with the glasses of these files, which take precedence. Lines that were not understood are warnings: all of them, or the first of
/// each kind.
pub fn library_with(
    library: Library,
    paths: &[PathBuf],
    in_full: bool,
    warn: &dyn Fn(String),
) -> Result<Library> {
    if paths.is_empty() {
        return Ok(library);
    }
    let chosen = read_glasses(paths)?;
    let lines = if in_full { chosen.all_warning_lines() } else { chosen.warning_lines() };
    let are_all = lines.len() == chosen.warnings.len();
    lines.into_iter().for_each(warn);
    if !are_all {
        warn("`petzval glass list` shows every line of glass catalogues that is left out".to_owned());
    }
    Ok(library.with_glasses(chosen.catalog))
}

/// A context with the glasses of these files, which take precedence. Lines that were not understood are warnings, the first of each kind.
pub fn context_with(context: Context, paths: &[PathBuf]) -> Result<Context> {
    let warn = |line: String| context.warning(WarningKind::LensFile, line);
    let library = library_with(context.assets.clone(), paths, false, &warn)?;
    Ok(context.with_assets(library))
}

const ENDINGS: &str = ".agf, .toml, .yml or .yaml";

/// Reads glass files and folders of them, in their order, the files of a folder in the order of their paths.
///
/// The maker of an AGF file is its name without `.agf`. A page of refractiveindex.info is called as its file is, made by
/// the folder below `specs`; a page in a folder `MATERIAL/nk` is called `MATERIAL-PAGE`. Files in a folder that hold no
/// glass, such as pages of media without an index and lens files, are warnings.
pub fn read_glasses(paths: &[PathBuf]) -> Result<ChosenGlasses> {
    let mut chosen = ChosenGlasses::default();
    for path in paths {
        if !path.exists() {
            return Err(wrong(
                path,
                "there is no such file or folder",
                format!("glass files end in {ENDINGS}"),
            ));
        }
        if !path.is_dir() {
            read_file(path, &mut chosen)?;
            continue;
        }
        let (mut files, mut is_empty) = (glass_files(path)?, true);
        files.sort();
        for file in files {
            match read_file(&file, &mut chosen) {
                Err(JobError::File { path, mut error }) if !is_broken_catalogue(&file) => {
                    if is_page(&file) {
                        let (name, maker) = page_name(&file);
                        chosen.catalog.refuse(&name, &maker, error.message.clone());
                    }
                    error.message += ": the file is left out";
                    let kind = "the file is left out".to_owned();
                    chosen.warnings.push((path, GlassWarning { error: *error, kind }));
                }
                other => {
                    other?;
                    is_empty = false;
                }
            }
        }
        if is_empty {
            return Err(wrong(
                path,
                "there is no glass in this folder",
                format!("glass files end in {ENDINGS}"),
            ));
        }
    }
    Ok(chosen)
}

/// The glass files below a folder.
fn glass_files(root: &Path) -> Result<Vec<PathBuf>> {
    let (mut files, mut open) = (Vec::new(), vec![root.to_path_buf()]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).map_err(DesignError::io(&folder))? {
            let entry = entry.map_err(DesignError::io(&folder))?;
            let (path, kind) = (entry.path(), entry.file_type().map_err(DesignError::io(&folder))?);
            if kind.is_dir() {
                open.push(path);
            } else if matches!(ending(&path).as_str(), "agf" | "toml") || is_page(&path) && !is_index(&path) {
                files.push(path);
            }
        }
    }
    Ok(files)
}

/// Whether a file that could not be read is a glass catalogue in TOML with a mistake in it, which its author has to correct.
/// Other TOML files in the same folder, such as lenses, are left out.
fn is_broken_catalogue(path: &Path) -> bool {
    let Ok(bytes) = petzval_base::read_whole(path) else { return true };
    ending(path) == "toml" && is_meant_as_catalog(&decode(&bytes))
}

fn ending(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

fn is_page(path: &Path) -> bool {
    matches!(ending(path).as_str(), "yml" | "yaml")
}

/// What the database of refractiveindex.info keeps beside its pages.
fn is_index(path: &Path) -> bool {
    let stem = stem(path);
    stem == "about" || stem.starts_with("catalog-")
}

fn read_file(path: &Path, chosen: &mut ChosenGlasses) -> Result<()> {
    let known = matches!(ending(path).as_str(), "agf" | "toml") || is_page(path);
    if path.exists() && !known {
        return Err(wrong(path, "this is no glass catalogue", format!("glass files end in {ENDINGS}")));
    }
    let bytes = petzval_base::read_whole(path).map_err(DesignError::io(path))?;
    let text = decode(&bytes);
    let file = match ending(path).as_str() {
        "agf" => parse_agf(&text, &stem(path)),
        "toml" => {
            let catalog = parse_catalog(&text).map_err(DesignError::input(path))?;
            chosen.catalog.merge(catalog);
            return Ok(());
        }
        _ => {
            let (name, maker) = page_name(path);
            parse_rii(&text, &name, &maker)
        }
    };
    let file = file.map_err(DesignError::input(path))?;
    chosen.warnings.extend(file.warnings.iter().map(|warning| (path.to_path_buf(), warning.clone())));
    chosen.catalog.merge(file.into_catalog());
    Ok(())
}

/// Name and maker of a page by its place in the database.
fn page_name(path: &Path) -> (String, String) {
    let folders: Vec<&str> = path.iter().rev().skip(1).filter_map(OsStr::to_str).collect();
    if let Some(below) = folders.iter().position(|folder| *folder == "specs").and_then(|i| i.checked_sub(1)) {
        return (stem(path), folders[below].to_owned());
    }
    match folders[..] {
        // `(C5H8O2)n - poly(methyl methacrylate)` has its formula before the dash.
        ["nk", material, ..] => {
            let formula = material.split(" - ").next().unwrap_or(material);
            (format!("{formula}-{}", stem(path)), String::new())
        }
        _ => (stem(path), String::new()),
    }
}

fn wrong(path: &Path, message: &str, hint: String) -> JobError {
    let error = FileError {
        line: None,
        column: None,
        key: String::new(),
        value: String::new(),
        message: message.to_owned(),
        hint: Some(hint),
    };
    JobError::File { path: path.to_path_buf(), error: Box::new(error) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_called_by_their_place() {
        for (path, name, maker) in [
            ("rii/specs/schott/optical/N-BK7.yml", "N-BK7", "schott"),
            ("rii/specs/corning/EagleXG.yml", "EagleXG", "corning"),
            ("main/SiO2/nk/Malitson.yml", "SiO2-Malitson", ""),
            ("organic/(C8H8)n - polystyrene/nk/Zhang.yml", "(C8H8)n-Zhang", ""),
            ("melt.yml", "melt", ""),
        ] {
            assert_eq!(page_name(Path::new(path)), (name.to_owned(), maker.to_owned()));
        }
    }
}
