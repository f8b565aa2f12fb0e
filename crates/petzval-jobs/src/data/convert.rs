//! `data convert`: a data set of another format in COCO format.

use std::path::{Component, Path, PathBuf};

use petzval_files::coco::convert::{SourceFormat, convert};
use petzval_files::coco::{ANNOTATIONS, Defect, Statistics, save_coco};
use schemars::JsonSchema;
use serde::de::{Error as _, IntoDeserializer};
use serde::{Deserialize, Deserializer, Serialize};

use crate::as_unit::AsUnit;
use crate::context::Context;
use crate::error::{JobError, Result, make_folder};

/// Why there is no conversion from [COCO](is_coco), and what to do in its place.
pub const NO_CONVERSION: &str = "COCO needs no conversion: every verb reads it, and `petzval data check FOLDER` says whether it can be used";

/// Whether the name of a format is that of the format which a conversion makes.
pub fn is_coco(format: &str) -> bool {
    format.eq_ignore_ascii_case("coco")
}

/// Reads a format that can be converted.
fn source_format<'de, D: Deserializer<'de>>(word: D) -> Result<SourceFormat, D::Error> {
    let word = String::deserialize(word)?;
    if is_coco(&word) {
        return Err(D::Error::custom(NO_CONVERSION));
    }
    SourceFormat::deserialize(word.as_str().into_deserializer())
}

/// A data set to convert.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Its format.
    #[serde(deserialize_with = "source_format")]
    pub format: SourceFormat,
    /// Its folder; of BDD100K also a file.
    pub input: PathBuf,
    /// Folder for the data set; it must be new or empty.
    pub out: PathBuf,
    /// Copy pictures. Otherwise they are hard links to the given files, which take no space, where the file system allows.
    #[serde(default)]
    pub copy: bool,
    /// Whether the boxes of pictures that EXIF turns are of the pictures as they are shown (`true`), or of the stored pixels (`false`), where neither the
    /// format nor a stated size says so. Without it such pictures are left out.
    #[serde(default)]
    pub turned: Option<bool>,
}

/// The converted data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Response {
    /// The file of annotations.
    #[serde(serialize_with = "petzval_base::lossy_path::serialize")]
    pub annotations: PathBuf,
    /// Pictures that are hard links.
    pub linked: usize,
    /// Pictures that are copies.
    pub copied: usize,
    /// What the data set holds.
    pub statistics: Statistics,
    /// What was found wrong; what cannot be used is not in the data set.
    pub defects: Vec<Defect>,
    /// Cases that cannot be used.
    pub errors: usize,
}

/// As a unit of work.
pub(crate) const UNIT: AsUnit<Request> =
    AsUnit { out_in: Some(""), ..AsUnit::placed(|request, folder| request.out = folder.to_owned()) };

/// Converts a data set. The annotations are written last: a folder that has them is complete.
pub fn run(request: &Request, context: &Context) -> Result<Response> {
    let out = &request.out;
    let is_used = out.is_dir() && std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
    if is_used {
        let hint = "give a new folder, or empty this one";
        return Err(JobError::input(format!("{}: the folder is not empty", out.display()), hint));
    }
    let converted = convert(request.format, &request.input, request.turned, context.cancel())?;
    if converted.data.images.is_empty() {
        let worst = converted.defects.iter().next();
        let because =
            worst.and_then(|defect| defect.first.first()).map_or(String::new(), |text| format!(": {text}"));
        let message = format!("{}: no picture can be used{because}", request.input.display());
        let hint =
            worst.map_or("name the folder that holds both pictures and labels", |defect| defect.kind.hint());
        return Err(JobError::input(message, hint));
    }
    make_folder(out)?;
    let total = converted.data.images.len();
    let (mut linked, mut copied) = (0, 0);
    for (i, (image, source)) in converted.data.images.iter().zip(&converted.sources).enumerate() {
        context.check(|| format!("stopped after {i} of {total} pictures"))?;
        let target = inside(out, &image.file_name)?;
        if place(source, &target, request.copy)? {
            linked += 1
        } else {
            copied += 1
        }
        context.progress(i as u64 + 1, total as u64, "pictures");
    }
    let annotations = out.join(ANNOTATIONS);
    save_coco(&converted.data, &annotations)?;
    context.wrote(&annotations, "annotations");
    Ok(Response {
        annotations,
        linked,
        copied,
        statistics: Statistics::of(&converted.data),
        defects: converted.defects.iter().cloned().collect(),
        errors: converted.defects.errors(),
    })
}

/// A place inside the folder.
fn inside(folder: &Path, name: &str) -> Result<PathBuf> {
    let is_plain = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    if is_plain {
        Ok(folder.join(name))
    } else {
        Err(JobError::failed(format!("{name}: this is not a place inside the folder")))
    }
}

/// Links a picture, or copies it where it cannot be linked; true if it is a link.
fn place(source: &Path, target: &Path, copy: bool) -> Result<bool> {
    let failed = |e: std::io::Error| JobError::failed(format!("{}: {e}", target.display()));
    if let Some(folder) = target.parent() {
        std::fs::create_dir_all(folder).map_err(failed)?;
    }
    // A link to a symbolic link would be one to a file that may go.
    let source = source.canonicalize().map_err(failed)?;
    if !copy && std::fs::hard_link(&source, target).is_ok() {
        return Ok(true);
    }
    std::fs::copy(&source, target).map_err(failed)?;
    Ok(false)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn coco_is_no_misspelt_format() {
        let read = |format: &str| {
            let request = json!({"format": format, "input": "in", "out": "out"});
            serde_json::from_value::<Request>(request).map_err(|error| error.to_string())
        };
        assert_eq!(read("yolo").unwrap().format, SourceFormat::Yolo);
        for word in ["coco", "COCO"] {
            assert!(read(word).unwrap_err().contains("needs no conversion"), "{word}");
        }
        assert!(read("yol").unwrap_err().starts_with("unknown variant `yol`, expected one of"));
    }
}
