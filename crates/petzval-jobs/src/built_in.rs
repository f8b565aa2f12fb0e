//! The files that Petzval carries, as a library.

use std::borrow::Cow;

use petzval_data::ALL;
use petzval_design::assets::Assets;
use petzval_design::library::Library;

/// The built-in library of lenses, glasses, sensors, experiments, photographs and weights.
pub fn built_in_assets() -> Library {
    let (mut files, mut open) = (Vec::new(), vec![&ALL]);
    while let Some(folder) = open.pop() {
        open.extend(folder.dirs());
        files.extend(
            folder
                .files()
                .map(|f| (f.path().to_string_lossy().replace('\\', "/"), Cow::Borrowed(f.contents()))),
        );
    }
    files.sort();
    Assets::new(files).into()
}

/// Whether something built in has this name.
pub(crate) fn is_built_in(name: &str) -> bool {
    let folders = ALL.dirs().flat_map(|folder| folder.files());
    folders.filter_map(|file| file.path().file_stem()).any(|stem| stem == name)
}

/// Names of the built-in photographs, in the order of the alphabet.
pub(crate) fn photographs() -> Vec<String> {
    let Some(folder) = ALL.get_dir("photos") else { return Vec::new() };
    let pictures =
        folder.files().filter(|file| file.path().extension().is_some_and(|ending| ending == "png"));
    let mut names: Vec<String> =
        pictures.filter_map(|file| Some(file.path().file_stem()?.to_string_lossy().into_owned())).collect();
    names.sort();
    names
}
