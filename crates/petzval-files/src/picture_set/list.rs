//! A list of pictures: a text file with one path a line.

use std::collections::HashMap;
use std::path::Path;

use rayon::prelude::*;

use super::{PictureSetError, Places, StoredPicture};

/// Largest list that is read, bytes: ten million paths.
const LARGEST: u64 = 1 << 30;

/// The pictures that a list names.
pub(super) fn pictures_of(list: &Path) -> Result<Vec<StoredPicture>, PictureSetError> {
    let bytes = petzval_base::read_at_most(list, LARGEST).map_err(PictureSetError::io(list))?;
    let text = String::from_utf8(bytes).map_err(|error| {
        if ::image::guess_format(error.as_bytes()).is_ok() {
            return PictureSetError::Picture { path: list.to_owned() };
        }
        let read = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + read.iter().filter(|byte| **byte == b'\n').count();
        let bytes = error.as_bytes().split(|byte| *byte == b'\n').nth(line - 1).unwrap_or_default();
        let value = String::from_utf8_lossy(bytes).chars().take(LONGEST_SHOWN).collect();
        PictureSetError::Line { path: list.to_owned(), line, value, problem: "is not UTF-8 text" }
    })?;
    let folder = list.parent().unwrap_or(Path::new(""));
    let lines =
        (1..).zip(text.trim_start_matches('\u{feff}').lines()).map(|(number, line)| (number, line.trim()));
    let lines: Vec<(usize, &str)> =
        lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).collect();
    let picture = |(line, name): &(usize, &str)| {
        let path = folder.join(name);
        if path.is_file() {
            return Ok(StoredPicture::file(path).named((*name).to_owned()));
        }
        let value = name.chars().take(LONGEST_SHOWN).collect();
        let problem = if path.is_dir() { "is a folder" } else { "is no file that can be read" };
        Err(PictureSetError::Line { path: list.to_owned(), line: *line, value, problem })
    };
    // The first line that is wrong, whatever thread finds it.
    let found: Vec<Result<StoredPicture, PictureSetError>> = lines.par_iter().map(picture).collect();
    let found = found.into_iter().collect::<Result<Vec<StoredPicture>, PictureSetError>>()?;
    check_spellings(list, &found)?;
    Ok(found)
}

/// Refuses two names of one file. Equal names are left to the check of all sets.
fn check_spellings(list: &Path, found: &[StoredPicture]) -> Result<(), PictureSetError> {
    let (mut places, mut firsts) = (Places::default(), HashMap::new());
    for picture in found {
        let Some(place) = places.of(picture.path()) else { continue };
        let first: &mut &str = firsts.entry(place).or_insert(picture.name.as_str());
        if *first != picture.name {
            let (path, first, name) = (list.to_owned(), (*first).to_owned(), picture.name.clone());
            return Err(PictureSetError::OneFile { path, first, name });
        }
    }
    Ok(())
}

/// Characters of a line that an error shows.
const LONGEST_SHOWN: usize = 120;
