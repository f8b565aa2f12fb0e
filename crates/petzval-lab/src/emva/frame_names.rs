//! Names of frames with wildcards.

use std::path::Path;

use glob::Pattern;
use petzval_base::FileError;

use super::captures::{FrameFile, Point};

/// The frames of a point in `captures.toml`. A name with `*`, `?` or `[` that is not itself a file stands for all files
/// that match it, in the order of their names and without sidecars; `**` matches folders of any depth.
pub(super) fn expanded(folder: &Path, point: &Point) -> Result<Vec<FrameFile>, FileError> {
    let mut frames = Vec::new();
    for frame in &point.frames {
        let name = frame.name_below(folder);
        if !name.contains(['*', '?', '[']) || frame.path.is_file() {
            frames.push(frame.clone());
            continue;
        }
        let wrong = |message: String, hint: &str| Err(FileError::at_line(point.line, "", message).hint(hint));
        // Escape the name of the folder, which is not a pattern.
        let pattern = match (frame.path.is_relative() || frame.path.starts_with(folder), folder.to_str()) {
            (true, Some(folder)) => Path::new(&Pattern::escape(folder)).join(&name),
            (true, None) => {
                let said = format!("`{name}` has wildcards, and the folder's name is not UTF-8");
                return wrong(said, "list the frames by their names, or rename the folder");
            }
            (false, _) => frame.path.clone(),
        };
        let matches = match glob::glob(&pattern.to_string_lossy()) {
            Ok(matches) => matches,
            Err(error) => {
                return wrong(format!("`{name}`: {}", error.msg), "wildcards are *, ?, [abc], [!abc] and **");
            }
        };
        let is_frame = |path: &Path| path.is_file() && path.extension().is_none_or(|e| e != "toml");
        let found = matches.filter_map(Result::ok).filter(|path| is_frame(path)).map(FrameFile::from);
        let before = frames.len();
        frames.extend(found);
        if frames.len() == before {
            let hint = "names are below the folder of the list; * matches any letters but /";
            return wrong(format!("`{name}` matches no file"), hint);
        }
    }
    Ok(frames)
}
