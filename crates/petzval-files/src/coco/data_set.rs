//! A data set for object detection: pictures, classes, and the objects in the pictures.

use std::collections::{BTreeMap, HashMap};
use std::fmt;

use serde::{Deserialize, Serialize};

use super::bounds::Bounds;

/// A data set for object detection.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DataSet {
    /// What the file says of itself: names and values of `info`.
    pub info: serde_json::Map<String, serde_json::Value>,
    /// The licences that the file lists, as they are.
    pub licenses: Vec<serde_json::Value>,
    /// The pictures, in the order of the file.
    pub images: Vec<Image>,
    /// The classes, in the order of the file.
    pub categories: Vec<Category>,
    /// The objects, in the order of the file.
    pub annotations: Vec<Annotation>,
    /// Whether every box is known to be left edge, upper edge, width and height: the file says so (`bbox_mode` 1, as Detectron2 writes it), or a converter
    /// made the boxes.
    pub states_form: bool,
}

/// A picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Its number in the data set.
    pub id: u64,
    /// Its id in the file, where ids of pictures are texts there.
    pub text_id: Option<String>,
    /// Its file, relative to the folder of the data set.
    pub file_name: String,
    /// Columns, px.
    pub width: u32,
    /// Rows, px.
    pub height: u32,
    /// The film that it is from: pictures of one film resemble each other.
    pub sequence: Option<String>,
    /// The part of the data set that it belongs to, such as `train` or `valid`.
    pub split: Option<String>,
    /// Where EXIF turns the picture: whether boxes are of the turned picture, or of the stored pixels. None if the file does not say.
    pub turned: Option<bool>,
}

/// A class.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Category {
    /// Its number in the data set.
    pub id: u64,
    /// Its id in the file, where ids of classes are texts there.
    pub text_id: Option<String>,
    /// Its name.
    pub name: String,
    /// The class above it; empty if there is none.
    pub supercategory: String,
}

/// An object in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Annotation {
    /// Its number in the data set.
    pub id: u64,
    /// Number of the picture.
    pub image_id: u64,
    /// Number of the class.
    pub category_id: u64,
    /// Its bounds.
    pub bounds: Bounds,
    /// Its area, px^2; that of its outline where the data set knows one, else that of its bounds.
    pub area: f64,
    /// Many objects in one rectangle: any number of detections may lie in it, and none has to.
    pub crowd: bool,
    /// One object that nobody has to detect.
    pub ignore: bool,
    /// Further facts, such as the `state` of a traffic light.
    pub attributes: BTreeMap<String, Attribute>,
    /// Bounds and area, px^2, as the file has them, where they reach out of the picture: `bounds` and `area` are then of the part inside.
    pub unclipped: Option<(Bounds, f64)>,
}

/// A fact about an object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Attribute {
    /// True or false.
    Flag(bool),
    /// A number.
    Number(f64),
    /// A word.
    Text(String),
}

impl Attribute {
    /// The word, if it is one.
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }
}

impl fmt::Display for Attribute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Number(value) => write!(f, "{value}"),
            Self::Text(text) => write!(f, "{text:?}"),
        }
    }
}

impl DataSet {
    /// The places in `annotations` of the objects of each picture, in the order of `images`.
    pub fn objects_of_images(&self) -> Vec<Vec<usize>> {
        let place: HashMap<u64, usize> =
            self.images.iter().enumerate().map(|(i, image)| (image.id, i)).collect();
        let mut objects = vec![Vec::new(); self.images.len()];
        for (k, annotation) in self.annotations.iter().enumerate() {
            if let Some(&i) = place.get(&annotation.image_id) {
                objects[i].push(k);
            }
        }
        objects
    }

    /// The data set with boxes as its file has them: those that reach out of their pictures are whole.
    pub fn unclipped(&self) -> Self {
        let mut whole = self.clone();
        for annotation in &mut whole.annotations {
            if let Some((bounds, area)) = annotation.unclipped.take() {
                (annotation.bounds, annotation.area) = (bounds, area);
            }
        }
        whole
    }

    /// The class of a number.
    pub fn category(&self, id: u64) -> Option<&Category> {
        self.categories.iter().find(|category| category.id == id)
    }
}
