//! KITTI tracking: a text file of labels for each film, `label_02/0000.txt`, with the pictures `image_02/0000/000000.png`.
//!
//! A line is `frame track_id`, and behind these what a line of [detection](super::kitti) holds. Films become sequences, and the number of a track the
//! attribute `track`. A frame without a line shows no object. <https://www.cvlibs.net/datasets/kitti/eval_tracking.php>

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::Path;

use petzval_base::{Cancel, FileError};

use super::builder::{Builder, Converted};
use super::kitti_lines::{Files, Line, Regions, line_of};
use super::tree::{labels_text, pictures_among};
use crate::coco::defect::DefectKind;
use crate::coco::error::CocoError;

/// The folders of labels and of pictures.
pub(super) const LABELS: &str = "label_02";
const PICTURES: &str = "image_02";

/// Values of a line; detections have one more, the score.
const VALUES: [usize; 2] = [17, 18];

/// The pictures of a film by the number of the frame.
type Film<'f> = BTreeMap<u32, &'f Path>;

/// Reads a folder with `label_02/*.txt` and `image_02/FILM/`.
pub(super) fn convert(base: &Path, turned: Option<bool>, cancel: &Cancel) -> Result<Converted, CocoError> {
    let files = Files::of(base, [LABELS, PICTURES], cancel)?;
    let mut builder = Builder::new(turned);
    let mut films: BTreeMap<&OsStr, Film> = BTreeMap::new();
    let mut unlabelled: Vec<&Path> = Vec::new();
    for picture in pictures_among(&files.pictures) {
        let film = picture.parent().and_then(Path::file_name).unwrap_or(OsStr::new(""));
        let frame = picture.file_stem().and_then(|stem| stem.to_str()?.parse::<u32>().ok());
        // A frame has its first picture: further ones, and those without a number, are of no frame.
        let Some(frame) = frame else {
            unlabelled.push(picture);
            continue;
        };
        match films.entry(film).or_default().entry(frame) {
            Entry::Vacant(place) => {
                place.insert(picture);
            }
            Entry::Occupied(_) => unlabelled.push(picture),
        }
    }
    let mut regions = Regions::default();
    for path in &files.labels {
        let film = path.file_stem().unwrap_or(OsStr::new(""));
        let pictures = films.remove(film).unwrap_or_default();
        let mut ids: BTreeMap<u32, u64> = BTreeMap::new();
        for (frame, picture) in &pictures {
            cancel.check()?;
            let Some(image) = builder.picture(base, picture, files.split.clone()) else { continue };
            image.sequence = Some(film.to_string_lossy().into_owned());
            ids.insert(*frame, image.id);
        }
        let text = labels_text(path)?;
        let mut missing: BTreeSet<u32> = BTreeSet::new();
        for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
            let Some((frame, line)) = builder.understood(path, parse_line(number, line)) else { continue };
            if let Some(id) = ids.get(&frame) {
                let place = || format!("{}: line {number}", path.display());
                regions.add_line(&mut builder, *id, line, &place);
            } else if !pictures.contains_key(&frame) {
                missing.insert(frame);
            }
        }
        for frame in missing {
            let place = || format!("no picture for frame {frame} of {}", path.display());
            builder.defects.add(DefectKind::MissingPicture, place);
        }
    }
    for picture in unlabelled.into_iter().chain(films.values().flat_map(BTreeMap::values).copied()) {
        builder.defects.add(DefectKind::PictureWithoutLabels, || picture.display().to_string());
    }
    regions.become_crowds(&mut builder);
    builder.finish("KITTI tracking")
}

/// The number of the frame, and the object in it.
fn parse_line(number: u32, line: &str) -> Result<(u32, Line), FileError> {
    let words: Vec<&str> = line.split_whitespace().collect();
    if !VALUES.contains(&words.len()) {
        return Err(FileError::at_line(number, line, format!("the line has {} values", words.len()))
            .hint("give 17: frame track_id type truncated occluded alpha left top right bottom height width length x y z rotation_y"));
    }
    let wrong = |word: &str, name: &str, hint: &str| {
        FileError::at_line(number, word, format!("`{name}` is no such number")).hint(hint)
    };
    let frame = words[0].parse::<u32>();
    let frame = frame.map_err(|_| wrong(words[0], "frame", "count frames from 0"))?;
    let track = words[1].parse::<i32>();
    let track = track.map_err(|_| wrong(words[1], "track_id", "write a whole number, -1 for DontCare"))?;
    let mut read = line_of(number, line, &words[2..])?;
    read.track = Some(track);
    Ok((frame, read))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coco::bounds::Bounds;

    #[test]
    fn a_line_begins_with_frame_and_track() {
        let line = "12 3 Car 0 1 -1.57 10.5 20 110.5 70 1.5 1.6 3.9 1 2 30 -1.5";
        let (frame, found) = parse_line(3, line).unwrap();
        assert_eq!((frame, found.track), (12, Some(3)));
        assert_eq!(found.bounds, Bounds::from([10.5, 20.0, 100.0, 50.0]));
        for (from, to, value, needle) in [
            ("12 3", "12", "12 Car 0 1 -1.57", "has 16 values"),
            ("12 3", "-1 3", "-1", "`frame` is no such number"),
            ("12 3", "12 a", "a", "`track_id` is no such number"),
            ("10.5", "10,5", "10,5", "`left` is no number"),
        ] {
            let error = parse_line(3, &line.replacen(from, to, 1)).unwrap_err();
            assert!(error.line == Some(3) && error.value.starts_with(value), "{error}");
            assert!(error.message.contains(needle) && error.hint.is_some(), "{error}");
        }
    }
}
