//! Photographs to train on and to judge by.
//!
//! A [`NamedPhoto`] is one picture; a [`PhotoSet`] keeps training pictures and held-out pictures apart;
//! [`training_crop`] says which window of which picture goes where on the sensor at each step.

mod crop;
mod error;
mod photo_set;

pub use crop::{CropPlan, HeldOutPlacement, TrainingCrop, held_out_placements, training_crop};
pub use error::DatasetError;
pub use photo_set::{NamedPhoto, PhotoSet, PhotoSplit, load_folder};
