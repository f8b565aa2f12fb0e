//! Opens a folder of captures: reads its list, finds the frames, and checks the rules for both kinds of list.

use std::collections::HashMap;
use std::path::Path;

use petzval_base::{FileError, InFile, IoError};
use petzval_files::decode;

use super::captures::{CaptureError, Captures, DESCRIPTOR, FrameFile, Kind, MANIFEST, Point, SERIES};
use super::compat::{descriptor, manifest};
use super::frame_names;
use petzval_files::raw_file::page_count;

impl Captures {
    /// Reads the list of captures of a folder and checks that every frame exists. The path may also be that of the list.
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let is_list = path.file_name().is_some_and(|name| name == MANIFEST || name == DESCRIPTOR);
        let folder = match (path.is_file(), is_list, path.parent()) {
            (true, true, Some(folder)) if folder.as_os_str().is_empty() => Path::new("."),
            (true, true, Some(folder)) => folder,
            (true, ..) => return Err(CaptureError::NoFolder(path.to_owned())),
            (false, ..) => path,
        };
        let (ours, theirs) = (folder.join(MANIFEST), folder.join(DESCRIPTOR));
        if !folder.is_dir() {
            let source = std::io::Error::new(std::io::ErrorKind::NotFound, "no such folder");
            return Err(IoError::at(folder)(source).into());
        }
        let (list, ours) = match (ours.is_file(), theirs.is_file()) {
            (true, _) => (ours, true),
            (false, true) => (theirs, false),
            (false, false) if folder.join(SERIES).is_file() => {
                return Err(CaptureError::Unfinished(folder.to_owned()));
            }
            (false, false) => return Err(CaptureError::NoList(folder.to_owned())),
        };
        let bytes = petzval_base::read_whole(&list).map_err(IoError::at(&list))?;
        let wrong = |error: FileError| CaptureError::List(InFile::at(&list)(error));
        let text = decode(&bytes);
        let parsed = if ours { manifest::parse(&text, folder) } else { descriptor::parse(&text, folder) };
        let mut captures = parsed.map_err(wrong)?;
        for point in &mut captures.points {
            if ours {
                point.frames = frame_names::expanded(folder, point).map_err(wrong)?;
            }
            if let Some(missing) = point.frames.iter().find(|frame| !frame.path.is_file()) {
                let name = missing.name_below(folder);
                let error = FileError::at_line(point.line, "", format!("the frame {name} is not there"));
                return Err(wrong(
                    error.hint("copy the frame into the folder, or take the point off the list"),
                ));
            }
            let mut frames = Vec::with_capacity(point.frames.len());
            for FrameFile { path, .. } in std::mem::take(&mut point.frames) {
                match page_count(&path)? {
                    1 => frames.push(path.into()),
                    pages => {
                        frames.extend((0..pages).map(|k| FrameFile { path: path.clone(), page: Some(k) }))
                    }
                }
            }
            point.frames = frames;
        }
        captures.check().map_err(wrong)?;
        Ok(captures)
    }

    /// Checks the rules for both kinds of list: every point has enough frames, no point and no frame is listed twice, and
    /// either all flat points of a gain state photons or none.
    fn check(&self) -> Result<(), FileError> {
        if self.points.is_empty() {
            return Err(FileError::at_line(0, "", "the list has no captures").hint("add points with frames"));
        }
        let mut listed: HashMap<&FrameFile, &Point> = HashMap::new();
        for (i, point) in self.points.iter().enumerate() {
            let at = |message: String| FileError::at_line(point.line, "", message);
            if point.frames.len() < 2 {
                return Err(at(format!("{}: two are needed", point.label()))
                    .hint("noise is measured from the difference of two frames of one setting"));
            }
            if point.frames.len() > MAX_FRAMES {
                return Err(
                    at(format!("{} is more than {MAX_FRAMES}", point.label())).hint("use fewer frames")
                );
            }
            for frame in &point.frames {
                if let Some(first) = listed.insert(frame, point) {
                    let name = frame.name_below(&self.folder);
                    return Err(at(format!(
                        "the frame {name} is listed twice, first in line {}",
                        first.line
                    ))
                    .hint("every frame is an exposure of its own, listed once"));
                }
            }
            let other_light = |other: &&Point| {
                (other.kind, point.kind) == (Kind::Flat, Kind::Flat)
                    && other.linear_gain == point.linear_gain
                    && other.photons.is_some() != point.photons.is_some()
            };
            if let Some(first) = self.points[..i].iter().find(other_light) {
                let (here, there) = match point.photons {
                    Some(_) => ("states photons", "does not"),
                    None => ("states no photons", "does"),
                };
                return Err(at(format!(
                    "{} {here}, the flat point of this gain in line {} {there}",
                    point.label(),
                    first.line
                ))
                .hint("state `photons` at every flat point of a gain, or at none"));
            }
            let same = |other: &&Point| {
                other.kind == point.kind
                    && other.linear_gain == point.linear_gain
                    && other.exposure_s == point.exposure_s
                    && other.photons == point.photons
                    && other.is_stack() == point.is_stack()
                    && !self.is_illumination_series(point)
            };
            if let Some(first) = self.points[..i].iter().find(same) {
                return Err(at(format!("{} is listed already in line {}", point.label(), first.line))
                    .hint("list all frames of one setting as one point"));
            }
        }
        Ok(())
    }
}

impl Captures {
    /// True if this gain's flat points share one exposure time and state no photons: the light level is unknown, so they are ordered by
    /// signal.
    fn is_illumination_series(&self, point: &Point) -> bool {
        let flats =
            || self.points.iter().filter(|p| p.kind == Kind::Flat && p.linear_gain == point.linear_gain);
        point.kind == Kind::Flat
            && flats().filter(|p| !p.is_stack()).count() > 2
            && flats().all(|p| p.photons.is_none() && p.exposure_s == point.exposure_s)
    }
}

/// Largest number of frames of a point, so that sums fit in 64 bits.
const MAX_FRAMES: usize = 4096;
