//! Figures of a data set: pictures, objects by class, and their sizes.

use std::collections::{BTreeMap, HashMap, HashSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::data_set::{Annotation, Attribute, DataSet};

/// Areas that part small from medium and medium from large objects in COCO, px^2.
pub const SMALL_PX2: f64 = 32.0 * 32.0;
/// See [`SMALL_PX2`].
pub const LARGE_PX2: f64 = 96.0 * 96.0;

/// Figures of a data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Statistics {
    /// Pictures.
    pub images: usize,
    /// Pictures by part; empty if none names its part.
    pub images_by_split: BTreeMap<String, usize>,
    /// Pictures that name no part, where others do.
    #[serde(default)]
    pub images_without_split: usize,
    /// Different sequences.
    pub sequences: usize,
    /// Pictures by size, the most frequent first, up to five: columns, rows and number.
    pub sizes: Vec<(u32, u32, usize)>,
    /// Boxes.
    pub boxes: usize,
    /// Most boxes in one picture.
    pub most_boxes: usize,
    /// Figures by class, in the order of the data set.
    pub classes: Vec<ClassStatistics>,
}

/// Figures of a class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClassStatistics {
    /// Name.
    pub name: String,
    /// Boxes, with crowds and those to be ignored.
    pub boxes: usize,
    /// Pictures with one or more.
    pub images: usize,
    /// Boxes of crowds, or to be ignored.
    pub ignored: usize,
    /// Boxes below 32^2 px^2.
    pub small: usize,
    /// Boxes from 32^2 to 96^2 px^2.
    pub medium: usize,
    /// Boxes above 96^2 px^2.
    pub large: usize,
    /// Square root of the area at which 5 %, 50 % and 95 % of the boxes are smaller, px.
    pub side_px: [f64; 3],
    /// Boxes by value of the attribute `state`; empty if none has one.
    pub states: BTreeMap<String, usize>,
}

impl Statistics {
    /// The figures of a data set.
    pub fn of(data: &DataSet) -> Self {
        let mut by_class: HashMap<u64, Vec<&Annotation>> = HashMap::new();
        for annotation in &data.annotations {
            by_class.entry(annotation.category_id).or_default().push(annotation);
        }
        let classes = data.categories.iter().map(|category| {
            let boxes = by_class.get(&category.id).map_or(&[][..], Vec::as_slice);
            ClassStatistics::of(&category.name, boxes)
        });
        let mut sizes: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        let mut images_by_split = BTreeMap::new();
        for image in &data.images {
            *sizes.entry((image.width, image.height)).or_default() += 1;
            if let Some(split) = &image.split {
                *images_by_split.entry(split.clone()).or_default() += 1;
            }
        }
        let mut sizes: Vec<(u32, u32, usize)> = sizes.into_iter().map(|((w, h), n)| (w, h, n)).collect();
        sizes.sort_by_key(|(_, _, n)| std::cmp::Reverse(*n));
        sizes.truncate(5);
        let named: usize = images_by_split.values().sum();
        let sequences: HashSet<&String> =
            data.images.iter().filter_map(|image| image.sequence.as_ref()).collect();
        Self {
            images: data.images.len(),
            images_without_split: if named > 0 { data.images.len() - named } else { 0 },
            images_by_split,
            sequences: sequences.len(),
            sizes,
            boxes: data.annotations.len(),
            most_boxes: data.objects_of_images().iter().map(Vec::len).max().unwrap_or(0),
            classes: classes.collect(),
        }
    }
}

impl ClassStatistics {
    fn of(name: &str, boxes: &[&Annotation]) -> Self {
        let mut sides: Vec<f64> = boxes.iter().map(|a| a.area.max(0.0).sqrt()).collect();
        sides.sort_by(f64::total_cmp);
        let quantile = |share: f64| match sides.len() {
            0 => 0.0,
            n => sides[((n - 1) as f64 * share).round() as usize],
        };
        let images: HashSet<u64> = boxes.iter().map(|a| a.image_id).collect();
        let count = |is_counted: &dyn Fn(&Annotation) -> bool| boxes.iter().filter(|a| is_counted(a)).count();
        let mut states = BTreeMap::new();
        for state in boxes.iter().filter_map(|a| a.attributes.get("state").and_then(Attribute::text)) {
            *states.entry(state.to_owned()).or_default() += 1;
        }
        Self {
            name: name.to_owned(),
            boxes: boxes.len(),
            images: images.len(),
            ignored: count(&|a| a.crowd || a.ignore),
            small: count(&|a| a.area < SMALL_PX2),
            medium: count(&|a| (SMALL_PX2..=LARGE_PX2).contains(&a.area)),
            large: count(&|a| a.area > LARGE_PX2),
            side_px: [quantile(0.05), quantile(0.5), quantile(0.95)],
            states,
        }
    }
}
