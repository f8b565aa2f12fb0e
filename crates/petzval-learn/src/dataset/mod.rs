//! Photographs for training and for held-out scores.
//!
//! A [`Photo`] is one picture, which may be read when it is needed. [`find_photos`] lists those of a folder, a list or shards. A [`PhotoSet`] keeps training and held-out pictures apart. [`training_crop`] draws a
//! window of a picture and its sensor position for each item of a training step; [`dead_leaves`] generates pictures that may stand in for it, and
//! [`relight`] changes its exposure and colour.

mod class_map;
mod classes;
mod crop;
mod dead_leaves;
mod error;
mod first_reads;
mod found_photos;
mod label_file;
mod label_images;
mod labelled_pictures;
mod labelled_window;
mod photo;
mod photo_set;
mod picture_file;
mod relight;
mod shelf;
mod small_pictures;
mod street_plan;
mod street_thing;

pub use crate::loss::IGNORED;
pub use class_map::ClassMap;
pub use classes::{
    Classes, Judged, ObjectClass, RepeatedClaim, Taken, TakenClass, in_classes, own_categories, taken_as,
};
pub use crop::{CropPlan, HeldOutPlacement, TrainingCrop, held_out_placements, training_crop};
pub use dead_leaves::dead_leaves;
pub use error::DatasetError;
pub use first_reads::FirstReads;
pub use found_photos::{FoundPhotos, PhotoSearch, READ_AT_ONCE, find_photos};
pub use label_file::IGNORED_VALUES;
pub use labelled_pictures::{LabelledPictures, PictureWindows};
pub use labelled_window::{LabelledWindow, List, Purpose};
pub use photo::{Photo, Readers};
pub use photo_set::{PhotoSet, PhotoSplit};
pub use picture_file::PictureFile;
pub use relight::{light_factors, relight};
pub use shelf::{Shelf, TakesBytes};
pub use small_pictures::LEAST_SCORED;
pub use street_plan::{PlacedWindow, StreetPlan, StreetView};
pub use street_thing::StreetThing;
