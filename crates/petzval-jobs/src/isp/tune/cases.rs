//! Raw frames and the pictures that they should become.

use std::fs;
use std::path::{Path, PathBuf};

use petzval_camera::image::LinearImage;
use petzval_design::error::DesignError;
use petzval_files::PICTURE_ENDINGS;
use petzval_files::raw_file::{Sidecar, holds_digital_numbers, sidecar_path};
use sha2::{Digest, Sha256};

use super::plan::Plan;
use super::reference_colours::ReferenceColours;
use crate::error::{JobError, Result};
use crate::named_isp::NamedIsp;
use crate::noted_pictures::NotedPictures;

/// A raw frame and its reference.
pub(super) struct Case {
    /// File of the frame.
    pub raw: PathBuf,
    /// File of the reference.
    pub reference: PathBuf,
}

const RAW_ENDINGS: [&str; 7] = ["tif", "tiff", "png", "npy", "raw", "bin", "dng"];
/// Endings of references in linear light, beside the [usual pictures](PICTURE_ENDINGS).
const LINEAR_ENDINGS: [&str; 2] = ["exr", "hdr"];

/// Ends of the names of raw files and of references that are no part of the name that both share: those of `simulate` and the like.
const RAW_SUFFIX: &str = "-raw";

/// Ends of the names of the developed pictures of `simulate`, which are no raw frames.
const PICTURE_SUFFIXES: [&str; 2] = ["-developed", "-isp"];

impl Case {
    /// The reference, sRGB-encoded, which must have the size of its frame.
    pub fn read_reference(
        &self,
        (height, width): (usize, usize),
        pictures: &NotedPictures<'_>,
    ) -> Result<LinearImage> {
        let picture = pictures.light(&self.reference).map_err(DesignError::Image)?;
        if (picture.height, picture.width) != (height, width) {
            let message = format!(
                "{}: {} x {} pixels, and {} has {width} x {height}",
                self.reference.display(),
                picture.width,
                picture.height,
                self.raw.display()
            );
            return Err(JobError::input(message, "give references of the size of their frames"));
        }
        let data = picture.to_srgb();
        Ok(LinearImage { data, ..picture })
    }

    /// Whether a reference, sRGB-encoded, is gray. Refuses one that is a mosaic saved in colour.
    pub fn is_gray(&self, reference: &LinearImage) -> Result<bool> {
        match ReferenceColours::of(reference) {
            ReferenceColours::Several => Ok(false),
            ReferenceColours::Gray => Ok(true),
            ReferenceColours::Mosaic => Err(self.misleads(
                "it is a raw mosaic saved in colour, with one value for each pixel: tuning would lead to this mosaic",
            )),
        }
    }

    /// The error of a reference that leads an ISP astray.
    pub fn misleads(&self, reason: &str) -> JobError {
        let message = format!("{}: {reason}", self.reference.display());
        JobError::input(message, "give the picture in colour that the frame should become")
    }
}

/// The frames of a plan, by name, each with its reference.
pub(super) fn cases(plan: &Plan) -> Result<Vec<Case>> {
    let mut raws = files(&plan.raws, "raws", &RAW_ENDINGS)?;
    let references = files(&plan.reference, "reference", &[&PICTURE_ENDINGS[..], &LINEAR_ENDINGS].concat())?;
    let name = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    // `simulate` puts its pictures beside its raw frames.
    raws.retain(|raw| !PICTURE_SUFFIXES.iter().any(|suffix| name(raw).ends_with(suffix)));
    if raws.is_empty() {
        let message = format!("{}: holds developed pictures and no raw frame", plan.raws.display());
        return Err(JobError::input(message, "give the folder of the raw frames"));
    }
    let mut found = Vec::new();
    for raw in raws {
        let stem = name(&raw);
        let own = stem.strip_suffix(RAW_SUFFIX).unwrap_or(&stem);
        // A folder may hold frames and pictures: the picture counts.
        let named = references.iter().filter(|r| name(r) == stem || name(r) == own);
        let (mut picture, mut mosaic) = (None, None);
        for reference in named {
            if is_mosaic(reference)? {
                mosaic = Some(reference);
            } else if let Some(other) = picture.replace(reference) {
                return Err(ambiguous(plan, &raw, [other, reference]));
            }
        }
        let Some(reference) = picture else {
            if let Some(mosaic) = mosaic {
                let message = format!(
                    "{}: gray whole numbers are a raw frame, not a picture: tuning would lead to its mosaic",
                    mosaic.display()
                );
                let hint = format!("give {own}.png in colour, as the frame should be developed");
                return Err(JobError::setting("reference", plan.reference.display(), message, hint));
            }
            let message =
                format!("{}: {} has no picture of this name", raw.display(), plan.reference.display());
            return Err(JobError::input(message, format!("add {own}.png, as the frame should be developed")));
        };
        found.push(Case { raw, reference: reference.clone() });
    }
    Ok(found)
}

/// The error of two pictures that may be the reference of one frame.
fn ambiguous(plan: &Plan, raw: &Path, [first, second]: [&PathBuf; 2]) -> JobError {
    let message = format!(
        "{} and {} are both named like a reference of {}",
        first.display(),
        second.display(),
        raw.display()
    );
    JobError::setting("reference", plan.reference.display(), message, "keep one of them in the folder")
}

/// Whether a file holds the digital numbers of a frame: gray whole numbers, or any file with a sidecar.
fn is_mosaic(path: &Path) -> Result<bool> {
    Ok(sidecar_path(path).is_file() || holds_digital_numbers(path)?)
}

/// Files of a folder with one of these endings, by name.
fn files(folder: &Path, key: &'static str, endings: &[&str]) -> Result<Vec<PathBuf>> {
    let hint = match key {
        "reference" => "give the folder of the pictures that the frames should become",
        _ => "give a folder of raw frames",
    };
    let wrong = |message: String| JobError::setting(key, folder.display(), message, hint);
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| wrong(e.to_string()))? {
        let path = entry.map_err(|e| wrong(e.to_string()))?.path();
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if path.is_file() && endings.contains(&ending.as_str()) {
            found.push(path);
        }
    }
    found.sort();
    if found.is_empty() {
        Err(wrong(format!("holds no file with one of the endings {}", endings.join(", "))))
    } else {
        Ok(found)
    }
}

/// SHA-256 of everything that a score depends on beside the varied values: ISP, other values, frames, sidecars, references.
pub(super) fn fingerprint(named: &NamedIsp, base: &[f64], cases: &[Case]) -> Result<String> {
    let mut hash = Sha256::new();
    let mut add = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    add(named.in_words(base).as_bytes());
    for case in cases {
        for path in [&case.raw, &case.reference] {
            add(&petzval_base::read_whole(path)
                .map_err(|e| JobError::input(format!("{}: {e}", path.display()), ""))?);
        }
        // A frame may have no sidecar, and a sidecar no calibration.
        add(&petzval_base::read_whole(sidecar_path(&case.raw)).unwrap_or_default());
        if let Some(file) = Sidecar::beside(&case.raw)?.and_then(|sidecar| sidecar.info.calibration) {
            let path = case.raw.parent().unwrap_or(Path::new("")).join(file);
            add(&petzval_base::read_whole(path).unwrap_or_default());
        }
    }
    Ok(petzval_base::hex(&hash.finalize()))
}
