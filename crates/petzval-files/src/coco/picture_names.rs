//! The files of pictures by the names that annotations state, also where a file is spelt otherwise or the name is that of another machine.

use std::collections::{BTreeSet, HashMap};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use percent_encoding::percent_decode_str;
use petzval_base::{Cancel, Cancelled};
use rayon::prelude::*;

use super::data_set::Image;
use super::defect::{DefectKind, Defects};
use super::spelling::common_spelling;
use crate::picture_set::Places;

/// Behind this Label Studio states the path of a file in an address.
const FILE_IN_ADDRESS: &str = "?d=";

/// The file of a picture in the first of these folders that has it, else a link by its name that leads to no file. Some programs write `images\\a.png`.
pub(super) fn picture_in(folders: &[PathBuf], file_name: &str) -> Option<PathBuf> {
    let find = |name: &str| {
        let paths = || folders.iter().map(move |folder| folder.join(name));
        paths().find(|path| path.is_file()).or_else(|| paths().find(|path| path.is_symlink()))
    };
    match find(file_name) {
        None if file_name.contains('\\') => find(&file_name.replace('\\', "/")),
        found => found,
    }
}

/// Gives pictures whose files are not where their names say the names of the only files that can be meant, and notes them. Returns the file of each
/// picture as [`picture_in`] finds it by the name that the picture has then.
///
/// The name of the file may differ in the form of its letters (NFC, NFD) and in capitals of its ending, and the stated one may have signs as `%20`. Of
/// a path of another machine or an address the last names count, as many as are here. Where a name means several files, or several names mean one
/// file, none is taken.
pub(super) fn take_other_spellings(
    images: &mut [Image],
    folders: &[PathBuf],
    defects: &mut Defects,
    cancel: &Cancel,
) -> Result<Vec<Option<PathBuf>>, Cancelled> {
    let mut files: Vec<Option<PathBuf>> =
        images.par_iter().map(|image| picture_in(folders, &image.file_name)).collect();
    cancel.check()?;
    let mut listings = Listings::default();
    let mut found: Vec<(usize, PathBuf)> = Vec::new();
    for (place, image) in images.iter().enumerate().filter(|(place, _)| files[*place].is_none()) {
        cancel.check()?;
        found.extend(listings.only_file(folders, &image.file_name).map(|path| (place, path)));
    }
    if found.is_empty() {
        return Ok(files);
    }
    let mut names: HashMap<&Path, BTreeSet<&str>> = HashMap::new();
    let of_direct = images.iter().zip(&files).filter_map(|(image, path)| Some((image, path.as_deref()?)));
    for (image, path) in of_direct.chain(found.iter().map(|(place, path)| (&images[*place], path.as_path())))
    {
        names.entry(path).or_default().insert(&image.file_name);
    }
    let is_alone = |(_, path): &&(usize, PathBuf)| names[path.as_path()].len() == 1;
    let new_name = |(place, path): &(usize, PathBuf)| Some((*place, name_in(folders, path)?, path.clone()));
    let renamed: Vec<(usize, String, PathBuf)> = found.iter().filter(is_alone).filter_map(new_name).collect();
    for (place, name, path) in renamed {
        let stated = std::mem::replace(&mut images[place].file_name, name);
        defects.add(DefectKind::OtherFileName, || format!("{stated}: {}", images[place].file_name));
        files[place] = Some(path);
    }
    Ok(files)
}

/// Gives entries of one file the name of the first one, and notes the others: `a/../x.png`, `./x.png` and `x.png`; or `images/x.png` and `x.png`, where
/// pictures are looked for in `images`. `files` has the file of each picture, if there is one. Entries of equal names are not noted here.
pub(super) fn take_first_names(
    images: &mut [Image],
    files: &[Option<PathBuf>],
    defects: &mut Defects,
    cancel: &Cancel,
) -> Result<(), Cancelled> {
    let (mut places, mut firsts) = (Places::default(), HashMap::new());
    for (number, path) in files.iter().enumerate() {
        cancel.check()?;
        let Some(place) = path.as_deref().and_then(|path| places.of(path)) else { continue };
        let first: usize = *firsts.entry(place).or_insert(number);
        let name = images[first].file_name.clone();
        if images[number].file_name != name {
            let image = &mut images[number];
            let stated = std::mem::replace(&mut image.file_name, name);
            // Where several files were joined, ids are no longer those that the files state.
            defects.add(DefectKind::RepeatedFile, || format!("{} and {stated}", image.file_name));
        }
    }
    Ok(())
}

/// The name by which a file is found in these folders.
fn name_in(folders: &[PathBuf], path: &Path) -> Option<String> {
    let names = folders.iter().filter_map(|folder| path.strip_prefix(folder).ok()?.to_str());
    names.map(str::to_owned).find(|name| picture_in(folders, name).as_deref() == Some(path))
}

/// The names in folders that were looked into, by their common spelling.
#[derive(Default)]
struct Listings(HashMap<PathBuf, HashMap<PathBuf, Vec<OsString>>>);

impl Listings {
    /// The only file below these folders that a name can mean; `None` if there is none or more than one.
    fn only_file(&mut self, folders: &[PathBuf], name: &str) -> Option<PathBuf> {
        let decoded = percent_decode_str(name).decode_utf8().ok().filter(|decoded| decoded != name);
        let spellings = [Some(name), decoded.as_deref()];
        for stated in spellings.into_iter().flatten().map(Stated::of) {
            let starts = if stated.is_elsewhere { stated.names.len() } else { 1 };
            for names in (0..starts).map(|from| &stated.names[from..]) {
                let mut files: BTreeSet<PathBuf> =
                    folders.iter().flat_map(|folder| self.files(folder, names)).collect();
                if let Some(first) = files.pop_first() {
                    return files.is_empty().then_some(first);
                }
            }
        }
        None
    }

    /// The files below a folder that these names can mean, one a step.
    fn files(&mut self, folder: &Path, names: &[String]) -> Vec<PathBuf> {
        let mut places = vec![folder.to_owned()];
        for name in names {
            let name = OsStr::new(name);
            places = places.iter().flat_map(|place| self.spelt(place, name)).collect();
        }
        places.retain(|place| place.is_file());
        places
    }

    /// The places in a folder that a name can mean: that of the same spelling, else all others.
    fn spelt(&mut self, folder: &Path, name: &OsStr) -> Vec<PathBuf> {
        let listing = self.0.entry(folder.to_owned()).or_insert_with(|| listing(folder));
        let alike = listing.get(&common_spelling(name)).map(Vec::as_slice).unwrap_or_default();
        let same = alike.iter().find(|found| *found == name).map(std::slice::from_ref);
        same.unwrap_or(alike).iter().map(|found| folder.join(found)).collect()
    }
}

/// The names in a folder by their common spelling; none where it cannot be read.
fn listing(folder: &Path) -> HashMap<PathBuf, Vec<OsString>> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let mut listing: HashMap<PathBuf, Vec<OsString>> = HashMap::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        listing.entry(common_spelling(&name)).or_default().push(name);
    }
    listing
}

/// A name of a picture as annotations state it.
struct Stated {
    /// The names in its path.
    names: Vec<String>,
    /// Whether the path does not begin in the folder of the data set: it is one of another machine, an address, or leads out of the folder.
    is_elsewhere: bool,
}

impl Stated {
    fn of(text: &str) -> Self {
        let text = text.replace('\\', "/");
        let (path, is_address) = match (text.split_once(FILE_IN_ADDRESS), text.split_once("://")) {
            (Some((_, file)), _) => (file, true),
            (None, Some((_, address))) => (address.split(['?', '#']).next().unwrap_or(address), true),
            (None, None) => (text.as_str(), false),
        };
        let has_disk = path.as_bytes().get(1) == Some(&b':');
        let mut stated =
            Self { names: Vec::new(), is_elsewhere: is_address || has_disk || path.starts_with('/') };
        for name in path.split('/') {
            match name {
                "" | "." => {}
                ".." => stated = Self { names: Vec::new(), is_elsewhere: true },
                name => stated.names.push(name.to_owned()),
            }
        }
        stated
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_those_of_the_names_that_pictures_then_have() {
        let root = tempfile::tempdir().unwrap();
        let folders = [root.path().to_owned(), root.path().join("images")];
        std::fs::create_dir(&folders[1]).unwrap();
        for name in ["a.png", "images/b c.png"] {
            std::fs::write(root.path().join(name), "").unwrap();
        }
        let image = |name: &str| Image { file_name: name.to_owned(), ..Image::default() };
        let mut images = ["a.png", "b%20c.png", "none.png", "./a.png"].map(image);
        let (mut defects, cancel) = (Defects::default(), Cancel::default());
        let files = take_other_spellings(&mut images, &folders, &mut defects, &cancel).unwrap();
        assert_eq!(defects.count(DefectKind::OtherFileName), 1);
        assert_ne!(images[1].file_name, "b%20c.png");
        let by_name = |image: &Image| picture_in(&folders, &image.file_name);
        assert_eq!(files, images.iter().map(by_name).collect::<Vec<_>>());
        assert_eq!(files.iter().map(Option::is_some).collect::<Vec<_>>(), [true, true, false, true]);
        take_first_names(&mut images, &files, &mut defects, &cancel).unwrap();
        assert_eq!((images[3].file_name.as_str(), defects.count(DefectKind::RepeatedFile)), ("a.png", 1));
    }

    #[test]
    fn paths_of_other_machines_are_known() {
        let of = |text: &str| {
            let Stated { names, is_elsewhere } = Stated::of(text);
            (names.join("/"), is_elsewhere)
        };
        assert_eq!(of("sub/./a.jpg"), ("sub/a.jpg".into(), false));
        assert_eq!(of(r"C:\set\a.jpg"), ("C:/set/a.jpg".into(), true));
        assert_eq!(of("/set/a.jpg"), ("set/a.jpg".into(), true));
        assert_eq!(of("../images/a.jpg"), ("images/a.jpg".into(), true));
        assert_eq!(of("https://x.y/z/a.jpg?size=3#top"), ("x.y/z/a.jpg".into(), true));
        assert_eq!(of("/data/local-files/?d=set/a.jpg"), ("set/a.jpg".into(), true));
    }
}
