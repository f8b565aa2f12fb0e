//! A file with the labels of a picture's pixels.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use petzval_files::{LabelImage, load_label_image};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::{ClassMap, DatasetError, IGNORED};

/// Indices that are always ignored; the second one in files of 16 bits.
pub const IGNORED_VALUES: [u16; 2] = [255, 65_535];

/// The folder of label images.
pub(super) const LABELS: &str = "labels";

/// The name in its data set of a file of this folder.
pub(super) fn name_in(folder: &str, path: &Path) -> String {
    format!("{folder}/{}", path.file_name().unwrap_or_default().to_string_lossy())
}

/// A file with the labels of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LabelFile {
    /// The file.
    pub path: PathBuf,
    /// The class of each index.
    pub of_values: Arc<BTreeMap<u16, u8>>,
    /// SHA-256 of the file, hexadecimal.
    pub digest: String,
}

impl LabelFile {
    /// Its name in the data set.
    pub fn name(&self) -> String {
        name_in(LABELS, &self.path)
    }

    /// The class of each pixel. Fails where an index is of no class.
    pub fn read(&self) -> Result<ClassMap, DatasetError> {
        self.classes_of(load_label_image(&self.path)?)
    }

    /// The class of each pixel of the labels in the file. Fails where an index is of no class.
    pub fn classes_of(&self, labels: LabelImage) -> Result<ClassMap, DatasetError> {
        let LabelImage { height, width, has_16_bits, values, .. } = labels;
        let ignored = &IGNORED_VALUES[..1 + usize::from(has_16_bits)];
        let class = |(pixel, value): (usize, u16)| match self.of_values.get(&value) {
            _ if ignored.contains(&value) => Ok(IGNORED),
            Some(class) => Ok(*class),
            None => Err(self.wrong(
                format!(
                    "the value {value} in row {}, column {} is of no class",
                    pixel / width,
                    pixel % width
                ),
                "name it in `values` of a [[class]], or of one with `ignored = true`",
            )),
        };
        let classes = values.into_iter().enumerate().map(class).collect::<Result<_, _>>()?;
        Ok(ClassMap::new(height, width, classes))
    }

    pub fn wrong(&self, problem: String, hint: &'static str) -> DatasetError {
        DatasetError::LabelImage { path: self.path.clone(), problem, hint: hint.to_owned() }
    }
}

/// The middle of a pixel, row and column, of a class that is drawn first, each that is there as often as the others. None if all pixels are ignored.
pub(super) fn drawn_pixel(classes: &ClassMap, random: &mut ChaCha8Rng) -> Option<[f64; 2]> {
    let counts = pixels_of_classes(classes);
    let present: Vec<usize> = (0..counts.len()).filter(|class| counts[*class] > 0).collect();
    if present.is_empty() {
        return None;
    }
    let class = present[random.random_range(0..present.len())];
    let wanted = random.random_range(0..counts[class]);
    let mut all = classes.classes.iter().enumerate().filter(|(_, found)| usize::from(**found) == class);
    let (pixel, _) = all.nth(wanted)?;
    Some([pixel / classes.width, pixel % classes.width].map(|place| place as f64 + 0.5))
}

/// Pixels of each class by its number.
pub(super) fn pixels_of_classes(classes: &ClassMap) -> [usize; IGNORED as usize] {
    let mut counts = [0; IGNORED as usize];
    for class in classes.classes.iter().filter(|class| **class != IGNORED) {
        counts[usize::from(*class)] += 1;
    }
    counts
}
